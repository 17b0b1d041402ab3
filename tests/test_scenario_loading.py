"""Scenarios: values in SI, defaults, short forms, the resolved form and its hash, files of grains."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenario_text import ABSENT, small

from dem_cli.errors import ScenarioError
from dem_cli.scenario import Run, Scenario, Settle, Shake, load_scenario, parse_scenario
from dem_cli.scenario.restitution import restitution


def load(changes: dict[str, Any] | None = None) -> Scenario:
    return parse_scenario(small(changes))


def test_values_are_si() -> None:
    scenario = load({"stage.1.angle": "30 deg", "container.gravity_direction": "-60 deg"})
    assert scenario.grains.density == 2480.0
    assert scenario.grains.radius is not None
    assert scenario.grains.radius.uniform == (0.005, 0.01)
    assert scenario.container.width == 0.3
    assert scenario.container.gravity_direction == pytest.approx(-math.pi / 3)
    shake = scenario.stages[1]
    assert isinstance(shake, Shake)
    assert (shake.amplitude, shake.frequency, shake.duration) == (4.0, 10.0, 2.0)
    assert shake.angle == pytest.approx(math.pi / 6)


def test_defaults() -> None:
    scenario = load()
    assert (scenario.engine, scenario.depth, scenario.grains.shape) == ("explicit", 1.0, "disc")
    assert (scenario.contact.tension, scenario.contact.slider) == ("none", "total")
    assert (scenario.container.height, scenario.container.lid) == (None, False)
    assert scenario.container.gravity == 9.80665
    assert scenario.container.gravity_direction == -math.pi / 2
    grid = scenario.packing.grid
    assert grid is not None
    assert (grid.shift, grid.row_spacing) == (0.015, 0.03)  # half of spacing, and spacing
    settle = scenario.stages[0]
    assert isinstance(settle, Settle)
    assert (settle.name, settle.limit, settle.unbalanced, settle.kinetic) == ("settle", 20.0, 1e-4, 1e-6)
    assert (settle.damping.mass, settle.damping.local) == (0.0, 0.0)
    integration = scenario.integration
    assert (integration.time_step, integration.integrator, integration.safety) == ("auto", "leapfrog", 0.9)
    assert integration.max_overlap == 0.1
    output = scenario.output
    assert (output.interval, output.frames, output.tracks, output.surface_bins) == (0.01, 0.1, None, 40)
    assert (output.window.side, output.window.bottom, output.window.top) == (0.1, 0.1, 0.2)


def test_wall_friction() -> None:
    def sides(changes: dict[str, Any]) -> list[float]:
        walls = load(changes).contact.wall_friction
        return [walls.left, walls.right, walls.bottom, walls.top]

    assert sides({}) == [0.25] * 4
    assert sides({"contact.wall_friction": ABSENT}) == [0.17] * 4
    assert sides({"contact.wall_friction": {"bottom": 0.5, "left": 0}}) == [0.0, 0.17, 0.5, 0.17]


def test_damping() -> None:
    assert load().contact.damping() == (1.0, 1.0)
    assert load({"contact.damping_ratio": {"normal": 0.3, "tangential": 0.1}}).contact.damping() == (0.3, 0.1)
    for tension in ("none", "damping"):
        changes = {"contact.damping_ratio": ABSENT, "contact.restitution": 0.5, "contact.tension": tension}
        hn, hs = load(changes).contact.damping()
        assert hn == hs
        assert restitution(hn, tension) == pytest.approx(0.5, rel=1e-9)  # type: ignore[arg-type]


def test_stiffness_of_the_thesis() -> None:
    """physics.md 1.2: Vp = 259.81 m/s, kn = 1.3148e8 and ks = 4.3825e7 N/m at a depth of 1 m."""
    scenario = load()
    kn, ks = scenario.stiffness
    assert kn == pytest.approx(1.3148e8, rel=5e-5)
    assert ks == pytest.approx(4.3825e7, rel=5e-5)
    assert scenario.material.wave_speeds(2480.0, 1.0) == (pytest.approx(259.81, abs=0.005), 150.0)
    assert load({"depth": "2 m"}).stiffness == (pytest.approx(2 * kn), pytest.approx(2 * ks))


def test_given_stiffness() -> None:
    material = {"normal_stiffness": "131.475652553 MN/m", "tangential_stiffness": "4.3825217518e7 N/m"}
    scenario = load({"material": material})
    assert scenario.stiffness == (131475652.553, 43825217.518)
    vp, vs = scenario.material.wave_speeds(2480.0, 1.0)  # the speeds that they stand for
    assert (vp, vs) == (pytest.approx(150.0 * math.sqrt(3.0)), pytest.approx(150.0))


def test_stages() -> None:
    scenario = load({"stage.1.duration": ABSENT, "stage.1.cycles": 25, "stage.0.limit": "3 s"})
    settle, shake = scenario.stages
    assert (settle.longest, shake.longest) == (3.0, 2.5)
    run = load({"stage": [{"kind": "run", "name": "rest", "duration": "200 ms"}]}).stages[0]
    assert isinstance(run, Run)
    assert (run.name, run.longest) == ("rest", 0.2)


def test_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        load().contact.friction = 0.3  # type: ignore[misc]


def test_source_and_path(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("# by hand\n" + small(), encoding="utf-8")
    scenario = load_scenario(path)
    assert scenario.source.startswith("# by hand\n")
    assert scenario.path == path
    assert load().path is None


CHANGES: list[dict[str, Any]] = [
    {},
    {"grains.radius": "7.3 mm"},
    {"grains.radius": {"normal": {"mean": "7 mm", "sd": "2 mm", "min": "4 mm", "max": "9 mm"}}},
    {"grains.radius": {"grading": {"sieve": ["3 mm", "7 mm"], "passing": [0, 100]}}},
    {"grains.radius": {"list": ["5 mm", "3 mm"]}, "grains.count": ABSENT},
    {"contact.damping_ratio": ABSENT, "contact.restitution": 0.3},
    {"contact.wall_friction": {"bottom": 0.5}},
    {"container.height": "2 m", "container.lid": True, "container.gravity_direction": "-60 deg"},
    {"material": {"normal_stiffness": "1e8 N/m", "tangential_stiffness": "1e8 N/m"}},
    {"integration.time_step": "1e-6 s", "integration.integrator": "thesis"},
    {"output.tracks": {"grains": [1, 2]}, "output.interval": "7 ms"},
    {"stage.0.damping": {"mass": "5 1/s", "local": 0.2}, "stage.1.ramp": "0.1 s"},
]


@pytest.mark.parametrize("changes", CHANGES)
def test_resolved_form_loads_back(changes: dict[str, Any]) -> None:
    scenario = load(changes)
    again = parse_scenario(scenario.resolved_toml())
    assert again == scenario
    assert again.model_dump() == scenario.model_dump()  # SI values, bit by bit
    assert again.hash == scenario.hash
    assert again.resolved_toml() == scenario.resolved_toml()


@given(st.floats(1e-6, 1e-1), st.floats(1.0, 1e5), st.floats(-10.0, 10.0))
def test_resolved_form_is_exact_to_the_bit(radius: float, density: float, direction: float) -> None:
    changes = {
        "grains.radius": f"{radius!r} m",
        "grains.density": f"{density!r} kg/m^3",
        "container.gravity_direction": f"{direction!r} deg",
        "container.width": "10 m",
        "packing.grid.spacing": "30 cm",
    }
    scenario = load(changes)
    again = parse_scenario(scenario.resolved_toml())
    assert again.grains.radius is not None
    assert (again.grains.radius.fixed, again.grains.density) == (radius, density)
    assert again.container.gravity_direction == scenario.container.gravity_direction


def test_hash_identifies_the_run() -> None:
    base = load()
    assert len(base.hash) == 16
    assert int(base.hash, 16) >= 0
    same = [{"title": "other words"}, {"container.width": "0.3 m"}, {"depth": "100 cm"}, {"contact.tension": "none"}]
    for changes in same:
        assert load(changes).hash == base.hash
    for changes in [*CHANGES[1:], {"seed": 4}, {"container.width": "0.30000001 m"}, {"output.frames": "0.2 s"}]:
        assert load(changes).hash != base.hash


def test_hash_is_stable() -> None:
    """A stored number: a change means that every run gets a new identity, which must be on purpose."""
    assert load().hash == "fcc6cf04efa145c5"


GRAINS = "# three grains\nx,y,r\n1,2,0.5\n\n3,2,0.6\n5,2,0.7\n"
FROM_FILE: dict[str, Any] = {
    "grains.count": ABSENT,
    "grains.radius": ABSENT,
    "packing": {"method": "file", "file": "grains.csv", "file_unit": "cm"},
}


def test_grains_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "grains.csv").write_text(GRAINS)
    (tmp_path / "a.toml").write_text(small(FROM_FILE))
    scenario = load_scenario(tmp_path / "a.toml")
    assert scenario.grain_count == 3
    grains = scenario.grain_file()
    assert grains.x.tolist() == [0.01, 0.03, 0.05]
    assert np.allclose(grains.radius, [0.005, 0.006, 0.007], rtol=1e-15)
    assert grains.vx.tolist() == [0.0] * 3
    again = parse_scenario(scenario.resolved_toml(), folder=tmp_path)
    assert (again, again.hash) == (scenario, scenario.hash)


def test_hash_covers_the_file_of_grains(tmp_path: Path) -> None:
    (tmp_path / "grains.csv").write_text(GRAINS)
    before = parse_scenario(small(FROM_FILE), folder=tmp_path).hash
    (tmp_path / "grains.csv").write_text(GRAINS.replace("5,2", "5,3"))
    assert parse_scenario(small(FROM_FILE), folder=tmp_path).hash != before


def test_velocities_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "grains.csv").write_text("r,y,x,vx,vy\n1,2,3,4,-5\n")
    scenario = parse_scenario(small(FROM_FILE), folder=tmp_path)
    grains = scenario.grain_file()
    assert (grains.x[0], grains.y[0], grains.radius[0], grains.vx[0], grains.vy[0]) == (0.03, 0.02, 0.01, 0.04, -0.05)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["empty"]),
        ("x,y\n1,2\n", ["line 1", "x,y,r"]),
        ("x,y,r,vx\n1,2,3,4\n", ["line 1", "x,y,r,vx,vy"]),
        ("x,y,r\n1,2,3\n4,5\n", ["line 3", "3 numbers"]),
        ("x,y,r\n# more\n1,2,wide\n", ["line 3", "3 numbers"]),
        ("x,y,r\n1,2,0\n", ["line 2", "r is not above 0"]),
        ("x,y,r\n1,nan,1\n", ["line 2", "finite"]),
        ("x,y,r\n", ["no grains"]),
    ],
)
def test_mistakes_in_a_file_of_grains(tmp_path: Path, text: str, words: list[str]) -> None:
    (tmp_path / "grains.csv").write_text(text)
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(small(FROM_FILE), folder=tmp_path)
    for word in ['[packing] file = "grains.csv"', *words]:
        assert word in str(caught.value)


def test_keys_that_disagree_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "grains.csv").write_text(GRAINS)
    changes = FROM_FILE | {"grains.count": 4, "output": {"tracks": {"grains": [2, 3]}}}
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(small(changes), folder=tmp_path)
    lines = str(caught.value).splitlines()
    assert "[grains] count = 4: differs from the 3 grains of grains.csv" in lines[0]
    assert "[output] tracks.grains = [2, 3]: names grain 3" in lines[1]
    with pytest.raises(ScenarioError, match=r"\[grains\] radius .*contradicts packing.file"):
        parse_scenario(small({**FROM_FILE, "grains.radius": "7 mm"}), folder=tmp_path)
