"""Bodies that overlap at the start of a run of the impulse engine: moved apart, or refused, however deep they lie in each other."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impulse_text import drop

from dem_cli import run_scenario
from dem_cli.errors import ScenarioError
from dem_cli.results import open_results
from dem_cli.scenario import parse_scenario

ROW: dict[str, Any] = {
    "grains": {
        "shape": "box",
        "size": "20 cm",
        "density": "2000 kg/m^3",
        "count": 3,
        "position": ["0 m", "0 m", "10 cm"],
    },
    "stage": [{"kind": "run", "duration": "20 ms"}],
}


def row(step: float, **changes: Any) -> str:
    """Three cubes of 20 cm on a floor, side by side, `step` [m] from one to the next."""
    return drop(ROW | {"grains.step": [f"{step} m", "0 m", "0 m"]} | changes)


@pytest.mark.parametrize("step", [0.19, 0.12, 0.06, 0.001])
def test_they_are_moved_apart(tmp_path: Path, step: float) -> None:
    path = run_scenario(parse_scenario(row(step)), tmp_path / "row.h5")
    with open_results(path) as results:
        bodies = results.frame(-1).bodies
        assert "overlap at the start" in results.warnings[0]
        assert results.series["penetration"].max() < 1e-3
    apart = [np.abs(b - a).max() for a, b in pairwise(bodies.x[np.argsort(bodies.x[:, 0])])]
    assert min(apart) > 0.2 - 1e-3


def test_what_a_run_leaves_is_no_overlap(tmp_path: Path) -> None:
    """Bodies of a result file penetrate by the slop and a little more; as a packing they go over as they are."""
    path = run_scenario(parse_scenario(row(0.2 - 1e-4, packing={"overlaps": "refuse"})), tmp_path / "row.h5")
    with open_results(path) as results:
        assert not results.warnings
        assert results.frame(0).bodies.x[1, 0] == 0.2 - 1e-4


@pytest.mark.parametrize("step", [0.19, 0.12, 0.001])
def test_they_are_refused_if_asked(tmp_path: Path, step: float) -> None:
    with pytest.raises(ScenarioError, match=r"^scenario: body 0 \(box\) and body \d \(box\) overlap at the start by"):
        run_scenario(parse_scenario(row(step, packing={"overlaps": "refuse"})), tmp_path / "row.h5")
    assert not list(tmp_path.iterdir())


def test_a_run_warns_that_its_bodies_may_pass_through_each_other(tmp_path: Path) -> None:
    """As `dem check` does: at 300 m/s and 1 ms the boxes are not seen in each other."""
    boxes = [
        {"shape": "box", "size": "1 m", "density": "2 kg/m^3", "position": [x, "0 m", "9 m"]} for x in ("0 m", "1.2 m")
    ]
    boxes[0]["velocity"] = ["300 m/s", "0 m/s", "0 m/s"]
    text = drop({"grains": boxes, "stage.0.duration": "3 ms", "integration": {"time_step": "1 ms"}})
    with open_results(run_scenario(parse_scenario(text), tmp_path / "two.h5")) as results:
        assert "in a step of 0.001 s the fastest body may move by 35% of the smallest" in results.warnings[0]
