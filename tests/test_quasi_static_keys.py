"""Scenarios of the granular element method: defaults, round trip, overrides, stages and branches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from quasi_static_text import quick
from scenario_text import ABSENT, small

from dem_cli.scenario import (
    AnyScenario,
    Compress,
    Cyclic,
    Load,
    QuasiStaticScenario,
    Scenario,
    Shear,
    parse_scenario,
)


def quasi_static(text: str, *overrides: str) -> QuasiStaticScenario:
    scenario = parse_scenario(text, overrides=overrides)
    assert isinstance(scenario, QuasiStaticScenario)
    return scenario


def test_engine_decides() -> None:
    assert isinstance(parse_scenario(small()), Scenario)
    assert isinstance(parse_scenario(small({"engine": "explicit"})), Scenario)
    assert isinstance(quasi_static(quick()), AnyScenario)


def test_defaults() -> None:
    s = quasi_static(quick())
    walls = s.contact.wall_friction
    assert (walls.left, walls.right, walls.bottom, walls.top, s.contact.cohesion) == (0.0, 0.0, 0.0, 0.0, 0.0)
    assert (s.container.width, s.container.gravity, s.container.gravity_direction) == (None, 0.0, -math.pi / 2)
    assert (s.boundary.kind, s.boundary.radius, s.boundary.link_stiffness) == ("walls", None, None)
    assert (s.output.frames, s.output.tracks) == (1, None)
    compress, shear, load, cyclic = s.stages
    assert isinstance(compress, Compress)
    assert isinstance(shear, Shear)
    assert isinstance(load, Load)
    assert isinstance(cyclic, Cyclic)
    assert (compress.stress, compress.levels) == (15000.0, (0.05, 0.1, 0.2, 0.4, 0.7, 1.0))
    assert (compress.friction, compress.branch, compress.name) == (None, None, "compress")
    assert (shear.hold, shear.axial, shear.increment, shear.total) == ("mean-stress", "y", 0.0005, None)
    assert (load.x.stress, load.x.strain, load.y.stress, load.y.strain, load.increments) == (20e3, None, None, 0.01, 20)
    assert (cyclic.branch, cyclic.hold, cyclic.axial, cyclic.total) == ("compress", "volume", "y", "mean-stress")
    assert (cyclic.limit.stress_ratio, cyclic.limit.stress, cyclic.limit.strain) == (0.15, None, None)
    assert (cyclic.cycles, cyclic.increment, cyclic.liquefied, cyclic.max_strain) == (10, 1e-4, 0.01, 0.05)


@pytest.mark.parametrize(
    ("solver", "expected"),
    [
        (ABSENT, ("momentum", 4, 1e-6, None, None, None, None, None)),
        ("kishino", ("kishino", 1, 1e-4, 0.75, 0.5, 20.0, 20.0, 100000)),
        ({"method": "kishino", "alpha": 0.5, "sub_steps": 2}, ("kishino", 2, 1e-4, 0.5, 0.5, 20.0, 20.0, 100000)),
        ({"max_iterations": 7}, ("momentum", 4, 1e-6, None, None, None, None, 7)),
    ],
    ids=str,
)
def test_solver(solver: object, expected: tuple[object, ...]) -> None:
    one = quasi_static(quick({} if solver is ABSENT else {"solver": solver})).solver
    found = (one.method, one.sub_steps, one.stress_tolerance, one.alpha, one.alpha_prime, one.beta, one.beta_prime)
    assert (*found, one.max_iterations) == expected
    assert (one.accuracy, one.max_overlap) == (None, 0.1)


EVERYTHING = {
    "solver": {"method": "kishino", "accuracy": "100 dyn", "beta": 10},
    "boundary": {"kind": "membrane", "radius": "4 mm", "link_stiffness": "1e7 dyn/cm"},
    "contact": {"friction": "25 deg", "wall_friction": {"top": "5 deg"}, "cohesion": "3 dyn"},
    "container": {"width": "7 cm", "gravity": "980 gal"},
    "grains.count": ABSENT,
    "grains.radius": {"classes": [{"radius": "3 mm", "count": 20}, {"radius": "4.5 mm", "count": 7}]},
    "stage.0.friction": "15 deg",
    "stage.2": {"kind": "load", "name": "more", "from": "shear", "x": {"stress": "2 bar"}, "y": {"strain": 0.1}},
    "stage.1.hold": "lateral-stress",
    "stage.3.hold": "lateral-stress",
    "output": {"frames": 5, "tracks": {"grains": [0, 26]}},
}


@pytest.mark.parametrize("changes", [{}, EVERYTHING], ids=["small", "everything"])
def test_resolved_form_loads_back_to_the_same(changes: dict[str, object]) -> None:
    s = quasi_static(quick(changes))
    again = quasi_static(s.resolved_toml())
    assert again == s
    assert again.hash == s.hash
    assert again.resolved_toml() == s.resolved_toml()


def test_hash_tells_runs_apart() -> None:
    hashes = {quasi_static(quick(c)).hash for c in ({}, {"seed": 4}, {"solver": "kishino"}, {"stage.1.axial": "x"})}
    assert len(hashes) == 4
    assert quasi_static(quick({"title": "other"})).hash == quasi_static(quick()).hash


@pytest.mark.parametrize("engine", [small, quick], ids=["explicit", "granular-element"])
def test_friction_angle_is_its_tangent(engine: object) -> None:
    text = engine({"contact.friction": "30 deg", "contact.wall_friction": {"left": "0.1 rad", "top": 0.5}})  # type: ignore[operator]
    contact = parse_scenario(text).contact
    assert contact.friction == pytest.approx(1.0 / math.sqrt(3.0), rel=1e-15)  # type: ignore[attr-defined]
    walls = contact.wall_friction  # type: ignore[attr-defined]
    assert (walls.left, walls.top) == (math.tan(0.1), 0.5)
    # A side that is left out: as between grains in explicit DEM, smooth in quasi-static tests.
    assert walls.bottom == (contact.friction if engine is small else 0.0)  # type: ignore[attr-defined]


def test_classes_of_radii() -> None:
    classes = [{"radius": "3 mm", "count": 72}, {"radius": "4.5 mm", "count": 32}, {"radius": "6 mm", "count": 18}]
    s = parse_scenario(
        small({"grains.count": ABSENT, "grains.radius": {"classes": classes}, "packing.grid.columns": 9})
    )
    assert s.grain_count == 122
    assert s.grains.radius is not None
    assert s.grains.radius.bounds == (0.003, 0.006)
    radii = s.grains.radius.draw(np.random.default_rng(5), 122)
    assert sorted(radii) == sorted([0.003] * 72 + [0.0045] * 32 + [0.006] * 18)
    assert list(radii) != sorted(radii)  # shuffled, so that ids say nothing of sizes
    assert list(radii) == list(s.grains.radius.draw(np.random.default_rng(5), 122))
    assert list(radii) != list(s.grains.radius.draw(np.random.default_rng(6), 122))


def test_increments_to_expect() -> None:
    s = quasi_static(quick())
    assert [stage.planned for stage in s.stages] == [6, 60, 20, 400]
    assert s.planned == 486
    assert quasi_static(quick({"stage.1.increment": 0.0007})).stages[1].planned == 43
    # Between limits of strain there and back: 4 x 0.01 a cycle.
    assert quasi_static(quick({"stage.3.limit": {"strain": 0.01}})).stages[3].planned == 10 * 400


def test_whole_numbers_of_increments_stay_whole() -> None:
    """Rounding of shear_strain / increment does not add an increment."""
    for steps in range(1, 200):
        shear = Shear(kind="shear", hold="volume", shear_strain=0.03, increment=0.03 / steps)
        assert shear.planned == steps


def test_branches() -> None:
    s = quasi_static(quick())
    assert [s.goes_on_from(k) for k in range(4)] == [None, 0, 1, 0]


def test_cycles_to_large_strains_may_reach_them() -> None:
    cyclic = quasi_static(quick({"stage.3.limit": {"strain": 0.1}})).stages[3]
    assert isinstance(cyclic, Cyclic)
    assert cyclic.max_strain == 0.2


@pytest.mark.parametrize(
    ("changes", "override", "gone"),
    [
        ({"solver": "kishino"}, "solver.method=momentum", "solver.beta"),
        ({"solver": {"method": "kishino", "beta": 3}}, "solver.method=momentum", "solver.beta"),
        ({"boundary": {"kind": "chain", "radius": "4 mm"}}, "boundary.kind=walls", "boundary.radius"),
        ({"stage.3.total": "lateral-stress"}, "stage.4.hold=mean-stress", "stage.3.total"),
        ({}, "stage.cyclic.limit.strain=0.01", "stage.3.limit.stress_ratio"),
        ({"stage.3.max_strain": 0.01}, "stage.cyclic.limit.strain=0.02", ""),
        ({}, "stage.load.y.stress=3 kPa", "stage.2.y.strain"),
        ({"grains.count": ABSENT, "grains.radius": {"list": ["3 mm"]}}, "grains.radius.classes=[{radius='1 mm',count=2}]", "grains.radius.list"),
        ({}, "solver=kishino", ""),
        ({}, "contact.friction=30 deg", ""),
    ],
    ids=str,
)  # fmt: skip
def test_overrides_displace_what_they_exclude(changes: dict[str, object], override: str, gone: str) -> None:
    data: object = quasi_static(quick(changes), override).to_dict()
    for key in gone.split(".") if gone else ():
        assert isinstance(data, dict | list)
        if isinstance(data, dict) and key not in data:
            return
        data = data[int(key)] if isinstance(data, list) else data[key]
    assert not gone


def test_override_may_change_the_engine_of_a_scenario_without_stages_of_its_own() -> None:
    text = quick({"engine": "explicit"})
    assert quasi_static(text, "engine=granular-element").engine == "granular-element"
