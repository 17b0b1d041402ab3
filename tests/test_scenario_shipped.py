"""The scenarios that come along: complete, consistent, and the thesis' numbers in those that say so."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dem_cli.scenario import Scenario, Settle, Shake, load_scenario
from dem_cli.scenario.shipped import shipped_scenarios
from dem_cli.sweep.plan import make_plan

FOLDER = Path(__file__).parent.parent / "scenarios"
ALL = sorted(FOLDER.glob("*.toml"))
SWEEPS = [path for path in ALL if "\nscenarios" in path.read_text(encoding="utf-8")]
FILES = [path for path in ALL if path not in SWEEPS]


def test_they_are_those_of_the_folder() -> None:
    assert [one.name for one in shipped_scenarios()] == [path.stem for path in ALL]
    assert {"shake-quick", "thesis-discs-400gal-10hz", "thesis-discs-1200gal-1hz"} <= {path.stem for path in FILES}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_loads_and_says_what_it_shows(path: Path) -> None:
    scenario = load_scenario(path)
    assert scenario.title != "untitled"
    one = next(s for s in shipped_scenarios() if s.name == path.stem)
    assert one.title == scenario.title
    assert len(one.shows) > 20
    assert one.takes
    assert one.text == path.read_text(encoding="utf-8")


@pytest.mark.parametrize("path", SWEEPS, ids=lambda path: path.stem)
def test_sweeps_have_their_members(path: Path) -> None:
    one = next(s for s in shipped_scenarios() if s.name == path.stem)
    plan = make_plan(path)
    members = {"thesis-grid": (18, 2), "thesis-shapes": (9, 0)}[path.stem]
    assert (len(plan.members), len(plan.shared), plan.invalid, plan.twins) == (*members, (), 0)
    assert set(one.files) == {member.base.name for member in plan.members}
    assert len(one.shows) > 20
    assert re.match(r"[a-z].*(minutes|hour)", one.takes)


def thesis(name: str) -> Scenario:
    return load_scenario(FOLDER / f"{name}.toml")


@pytest.mark.parametrize("name", ["thesis-discs-400gal-10hz", "thesis-discs-1200gal-1hz"])
def test_values_of_the_thesis(name: str) -> None:
    """Thesis 2010, tables 8.2 and 8.7, with the container's width corrected (121.5, not 1215 cm)."""
    scenario = thesis(name)
    assert (scenario.grains.count, scenario.grains.density, scenario.depth) == (3000, 2480.0, 1.0)
    assert scenario.grains.radius is not None
    assert scenario.grains.radius.uniform == (0.005, 0.01)
    assert (scenario.material.s_wave_velocity, scenario.material.poisson_ratio) == (150.0, 0.25)
    walls = scenario.contact.wall_friction
    assert (scenario.contact.friction, walls.left, walls.right, walls.bottom) == (0.17, 0.25, 0.25, 0.25)
    assert scenario.contact.damping() == (1.0, 1.0)
    assert (scenario.container.width, scenario.container.height) == (1.215, None)
    grid = scenario.packing.grid
    assert grid is not None
    assert (grid.columns, grid.spacing, grid.shift, grid.rows(3000)) == (40, 0.03, 0.015, 75)
    assert grid.columns * grid.spacing + grid.shift == pytest.approx(scenario.container.width, rel=1e-15)
    tracks = scenario.output.tracks
    assert tracks is not None
    # the thesis counts from 1: 485 is the 5th of its row of 40
    assert [k + 1 for k in tracks.grains] == [485, 500, 515, 1485, 1500, 1515, 2485, 2500, 2515]
    assert tracks.interval == 0.001


def test_shaking() -> None:
    for name, amplitude, frequency in (
        ("thesis-discs-400gal-10hz", 4.0, 10.0),
        ("thesis-discs-1200gal-1hz", 12.0, 1.0),
    ):
        packing, shake, after = thesis(name).stages
        assert isinstance(packing, Settle)
        assert isinstance(shake, Shake)
        assert isinstance(after, Settle)
        assert (shake.amplitude, shake.frequency, shake.longest, shake.angle) == (amplitude, frequency, 5.0, 0.0)


def test_quick_one_is_small() -> None:
    scenario = thesis("shake-quick")
    assert 400 <= scenario.grain_count <= 600
    assert sum(s.longest for s in scenario.stages if isinstance(s, Shake)) == 1.0
