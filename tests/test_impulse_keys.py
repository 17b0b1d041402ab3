"""Scenarios of the impulse engine: defaults, names, round trip, hash, overrides."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impulse_text import BOX, CLUMP, PLACED, drop, pour
from scenario_text import ABSENT

from dem_cli.scenario import AnyScenario, ImpulseScenario, ImpulseSettle, ImpulseShake, Run, parse_scenario
from dem_cli.scenario.radii import Grading


def impulse(text: str, *overrides: str, folder: Path | str = ".") -> ImpulseScenario:
    scenario = parse_scenario(text, overrides=overrides, folder=folder)
    assert isinstance(scenario, ImpulseScenario)
    return scenario


def test_defaults() -> None:
    s = impulse(drop())
    assert isinstance(s, AnyScenario)
    (box,) = s.grains
    assert (box.name, box.count, box.size, box.face_points, box.material) == ("box", 1, (2.0, 1.0, 2.0), 0, "box")
    assert (box.position, box.step, box.orientation.fixed) == ((0.0, 0.0, 1.6), None, (1.0, 0.0, 0.0, 0.0))
    assert (box.velocity, box.spin, box.scale.fixed) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
    assert (box.radius, box.template, box.file, box.file_unit, box.spacing) == (None, None, None, None, None)
    assert (s.container.width, s.container.lid, s.gravity) == (None, False, (0.0, 0.0, -9.80665))
    (floor,) = s.planes
    assert (floor.point, floor.direction, floor.material) == ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), "floor")
    assert (s.terrain, s.packing.method, s.packing.overlaps, s.integration.time_step) == (
        None,
        "grid",
        "separate",
        "auto",
    )
    solver = s.solver
    assert (solver.method, solver.sweeps, solver.tolerance, solver.rest_speed) == ("pgs", 5000, 1e-4, 1e-3)
    assert (solver.quanta, solver.iterations, solver.correction, solver.slop, solver.max_penetration) == (
        None,
        None,
        0.2,
        1e-4,
        0.5,
    )
    assert (s.output.interval, s.output.frames, s.output.tracks, s.output.check) == (0.01, 0.1, None, None)
    assert (s.grain_count, s.materials) == (1, ("box", "floor"))
    assert isinstance(s.stages[0], Run)


def test_defaults_of_what_is_packed() -> None:
    s = impulse(pour())
    clump, box = s.grains
    assert (clump.position, clump.orientation.random, clump.orientation.fixed) == (None, True, None)
    assert clump.template is not None
    assert len(clump.template.outline()[1]) == 4
    assert box.size == (0.1, 0.1, 0.1)
    assert (s.grain_count, s.materials) == (21, ("clump", "box", "wall"))
    settle, shake = s.stages
    assert isinstance(settle, ImpulseSettle)
    assert isinstance(shake, ImpulseShake)
    assert (settle.limit, settle.kinetic, shake.angle, shake.heading, shake.longest) == (20.0, 1e-6, 0.0, 0.0, 2.0)


def test_energy_tracking_has_keys_of_its_own() -> None:
    solver = impulse(drop({"solver": "energy-tracking"})).solver
    assert (solver.method, solver.quanta, solver.iterations) == ("energy-tracking", 50, 100000)
    assert impulse(drop({"solver": {"method": "energy-tracking", "quanta": 15}})).solver.quanta == 15


def test_names() -> None:
    """A kind without a name is called by its shape, a second one by a number; a plane by its number."""
    boxes = [BOX | PLACED | more for more in ({}, {}, {"name": "box 2"}, {"name": "lid", "material": "steel"})]
    s = impulse(drop({"grains": boxes, "plane": [{}, {"name": "slope", "material": "soil"}]}))
    assert [kind.name for kind in s.grains] == ["box", "box 3", "box 2", "lid"]
    assert [kind.material for kind in s.grains] == ["box", "box 3", "box 2", "steel"]
    assert [(plane.name, plane.material) for plane in s.planes] == [("plane 1", "plane 1"), ("slope", "soil")]


@pytest.mark.parametrize(
    ("plane", "normal"),
    [
        ({"normal": [0, 0, 2]}, (0.0, 0.0, 1.0)),
        ({"normal": [3, 0, 4]}, (0.6, 0.0, 0.8)),
        ({"slope": "0 deg"}, (0.0, 0.0, 1.0)),
        ({"slope": "30 deg"}, (0.5, 0.0, math.sqrt(0.75))),
        ({"slope": "30 deg", "heading": "90 deg"}, (0.0, 0.5, math.sqrt(0.75))),
        ({"slope": "90 deg", "heading": "180 deg"}, (-1.0, 0.0, 0.0)),
    ],
    ids=str,
)
def test_normal_of_a_plane(plane: dict[str, Any], normal: tuple[float, float, float]) -> None:
    assert impulse(drop({"plane": [plane]})).planes[0].direction == pytest.approx(normal, abs=1e-15)


def test_downhill_is_towards_the_heading() -> None:
    """A point that moves along the heading on the slope comes lower."""
    x, y, z = impulse(drop({"plane": [{"slope": "20 deg", "heading": "70 deg"}]})).planes[0].direction
    along = math.cos(math.radians(70)) * x + math.sin(math.radians(70)) * y
    assert -along / z == pytest.approx(-math.tan(math.radians(20)))  # dz per length along the heading


def test_orientation() -> None:
    turned = impulse(drop({"grains.orientation": {"axis": [0, 0, 2], "angle": "90 deg"}})).grains[0].orientation.fixed
    assert turned == pytest.approx((math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))
    given = impulse(drop({"grains.orientation": {"quaternion": [0, 3, 4, 0]}})).grains[0].orientation.fixed
    assert given == pytest.approx((0.0, 0.6, 0.8, 0.0))


EVERYTHING = {
    "grains": [
        BOX | {"count": 3, "face_points": 2, "name": "block", "material": "rock", "scale": {"uniform": [0.5, 1.5]}}
        | {"position": ["0 m", "10 cm", "1 m"], "step": ["0 m", "0 m", "2.5 m"], "velocity": ["1 m/s", "0 m/s", "-1 kine"]}
        | {"spin": ["1 rad/s", "10 deg/s", "0 rad/s"], "orientation": {"axis": [1, 2, 3], "angle": "0.3 rad"}},
        CLUMP | {"radius": {"uniform": ["1 cm", "2 cm"]}, "count": 5, "template": [[0, 0, 0, 1], [1, 0, 0.1, 0.7]]},
        {"shape": "sphere", "radius": {"classes": [{"radius": "1 cm", "count": 2}]}, "density": "1 g/cm^3", "orientation": "random"},
        CLUMP | {"name": "mixed", "scale": {"normal": {"mean": 1, "sd": 0.2, "min": 0.5, "max": 2}}},
    ],
    "contact.pairs": [{"between": ["rock", "wall"], "friction": "20 deg"}, {"between": ["clump", "slope"], "restitution": 0}],
    "container": {"width": "9 m", "breadth": "8 m", "height": "10 m", "lid": True, "gravity": "980 gal", "gravity_direction": [1, 2, -2]},
    "plane": [{"name": "slope", "slope": "12.3 deg", "heading": "77 deg", "point": ["1 m", "2 m", "3 m"]}, {"normal": [1, 1, 1]}],
    "packing": {"method": "rejection", "gap": "1 mm", "overlaps": "refuse", "region": {"from": ["1 m"] * 3, "to": ["3 m"] * 3}},
    "solver": {"method": "energy-tracking", "quanta": 15},
    "integration": {"time_step": "0.5 ms"},
    "output": {"tracks": {"grains": [0, 9]}, "interval": "0.02 s"},
    "stage": [{"kind": "settle"}, {"kind": "shake", "amplitude": "1 gal", "frequency": "3 Hz", "cycles": 3, "heading": "1 deg"}],
}  # fmt: skip


@pytest.mark.parametrize("text", [drop(), pour(), drop(EVERYTHING)], ids=["drop", "pour", "everything"])
def test_resolved_form_loads_back_to_the_same(text: str) -> None:
    s = impulse(text)
    again = impulse(s.resolved_toml())
    assert again == s
    assert again.hash == s.hash
    assert again.resolved_toml() == s.resolved_toml()


def test_hash_tells_runs_apart() -> None:
    changes = ({}, {"seed": 4}, {"solver": "energy-tracking"}, {"grains.face_points": 1}, {"plane.0.slope": "1 deg"})
    assert len({impulse(drop(one)).hash for one in changes}) == 5
    assert impulse(drop({"title": "other"})).hash == impulse(drop()).hash


@pytest.mark.parametrize("table", ["grains", "terrain"])
def test_files_count_in_the_hash(tmp_path: Path, table: str) -> None:
    cloud = {"shape": "cloud", "file": "a.csv", "density": "1 g/cm^3"} | PLACED
    text = drop({"grains": cloud} if table == "grains" else {"terrain": {"file": "a.csv"}})
    hashes = []
    for content in ("x,y,z\n", "x,y,z\n0,0,0\n"):
        (tmp_path / "a.csv").write_text(content)
        hashes.append(impulse(text, folder=tmp_path).hash)
    assert hashes[0] != hashes[1]


@pytest.mark.parametrize(
    ("text", "override", "place", "value"),
    [
        (drop(), "grains.face_points=3", ("grains", 0, "face_points"), 3),
        (drop(), "grains.size=3 m", ("grains", 0, "size"), ["3.0 m"] * 3),
        (drop(), "grains.1.scale.uniform=[1, 2]", ("grains", 0, "scale"), {"uniform": [1.0, 2.0]}),
        (pour(), "grains.clump.count=7", ("grains", 0, "count"), 7),
        (pour(), "grains.1.count=7", ("grains", 0, "count"), 7),
        (pour(), "grains.box.velocity=['1 m/s', '0 m/s', '0 m/s']", ("grains", 1, "velocity", 0), "1.0 m/s"),
        (pour(), "grains.clump.shape=sphere", ("grains", 0, "template"), None),
        (drop(), "plane.floor.slope=0.5 rad", ("plane", 0, "slope"), "0.5 rad"),
        (drop(), "plane.slope=0.5 rad", ("plane", 0, "slope"), "0.5 rad"),
        (drop({"plane.0.slope": "1 deg", "plane.0.heading": "1 deg"}), "plane.1.normal=[0, 0, 1]", ("plane", 0, "heading"), None),
        (pour({"packing": {"method": "rejection", "attempts": 9}}), "packing.method=grid", ("packing", "attempts"), None),
        (drop({"solver": {"method": "energy-tracking", "quanta": 9}}), "solver.method=pgs", ("solver", "quanta"), None),
        (pour(), "stage.shake.heading=1 rad", ("stage", 1, "heading"), "1.0 rad"),
        (pour(), "stage.kinetic=0.1", ("stage", 0, "kinetic"), 0.1),
        (drop(), "contact.restitution=0", ("contact", "restitution"), 0.0),
    ],
)  # fmt: skip
def test_overrides(text: str, override: str, place: tuple[str | int, ...], value: object) -> None:
    found: Any = impulse(text, override).to_dict()
    for part in place[:-1]:
        found = found[part]
    assert (found.get(place[-1]) if isinstance(found, dict) else found[place[-1]]) == value


def test_number_of_bodies_follows_from_lists_and_classes() -> None:
    assert impulse(pour({"grains.0.count": ABSENT, "grains.0.scale": {"list": [1, 2, 3]}})).grain_count == 4
    classes = {"classes": [{"radius": "1 cm", "count": 5}, {"radius": "2 cm", "count": 6}]}
    assert impulse(pour({"grains.0.count": ABSENT, "grains.0.radius": classes})).grain_count == 12
    assert impulse(drop({"grains.scale": {"classes": [{"scale": 2, "count": 1}]}})).grain_count == 1


def test_grading_of_spheres_follows_the_curve_by_mass() -> None:
    """The mass of spheres that pass each sieve; log-uniform between two sieves."""
    grading = Grading(sieve=("2 mm", "5 mm", "1 cm"), passing=(0, 30, 100))  # type: ignore[arg-type]
    d = 2.0 * grading.draw(np.random.default_rng(1), 100000, dimensions=3)
    for size, passing in ((0.005, 0.3), (math.sqrt(0.002 * 0.005), 0.15), (math.sqrt(0.005 * 0.01), 0.65)):
        assert np.sum(d[d < size] ** 3) / np.sum(d**3) == pytest.approx(passing, abs=0.02)
    flat = 2.0 * grading.draw(np.random.default_rng(1), 100000)
    assert np.sum(flat[flat < 0.005] ** 2) / np.sum(flat**2) == pytest.approx(0.3, abs=0.02)
