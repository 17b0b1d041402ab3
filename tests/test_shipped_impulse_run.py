"""The scenarios of rigid bodies that come along, run to a result file, the large ones with fewer bodies; report and picture of each.

The closed forms of the checks are tests/analytic/test_impulse_checks.py's.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from dem_cli.cli import main
from dem_cli.results import open_results
from dem_cli.scenario.shipped import folder

SHORTER = {
    "impulse-drop": ("stage.duration=0.8 s",),
    "impulse-slope": ("stage.duration=0.2 s",),
    "impulse-two-bodies": (),
    "impulse-row-of-ten": (),
    "impulse-stack": ("stage.duration=0.2 s",),
    "impulse-tumble": ("stage.limit=2 s",),
    "impulse-pour": ("grains.count=20", "stage.limit=1 s"),
    "impulse-rockfall": ("grains.count=6", "stage.limit=3 s"),
}


def test_all_of_them_are_run() -> None:
    assert SHORTER.keys() == {path.stem for path in folder().glob("impulse-*.toml")}


@pytest.mark.parametrize("name", SHORTER)
def test_shipped_scenario_runs_reports_and_draws(name: str, tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    changes = [part for change in SHORTER[name] for part in ("--set", change)]
    for command in (
        ["run", str(folder() / f"{name}.toml"), "-o", str(file), *changes],
        ["report", str(file)],
        ["render", str(file), "-o", str(tmp_path / "scene.png")],
    ):
        done = CliRunner().invoke(main, command)
        assert done.exit_code == 0, done.output
        if command[0] == "report":
            assert ("closed form" in done.output) == (
                name.removeprefix("impulse-") in ("drop", "slope", "two-bodies", "row-of-ten")
            )
    with open_results(file) as results:
        assert results.complete
        series = results.series
        assert abs(series["residual"][-1]) <= 1e-5 * max(series["energy_in"][-1], 1e-9)
        assert series["capped"][-1] == 0
        assert series["penetration"].max() < 0.05
