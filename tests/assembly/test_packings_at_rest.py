"""What becomes of each packing under gravity: it starts without energy in its contacts, comes to rest, and stays there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from packing_samples import METHODS, packing

from dem_cli.results import open_results
from dem_cli.run import run_scenario

REST: dict[str, Any] = {
    "grains.count": 120,
    "contact.damping_ratio": 0.5,
    "stage": [{"kind": "settle"}, {"kind": "run", "duration": "0.2 s"}],
}


@pytest.mark.parametrize("method", METHODS)
def test_comes_to_rest_and_stays_there(method: str, tmp_path: Path) -> None:
    said: list[str] = []
    scenario = packing(method, REST)
    path = run_scenario(scenario, tmp_path / "run.h5", packing_listener=said.append)
    assert said[-1].startswith(f"{method}: void ratio ")
    with open_results(path) as results:
        series = results.series
        assert results.warnings == []
        assert results.stages[0].reason.startswith("at rest")
        # No overlap is released: what moves the grains is their fall.
        assert series["max_overlap"][0] == 0.0
        assert series["elastic_normal"][0] == 0.0
        assert np.max(series["kinetic"]) <= np.max(series["energy_in"])
        after = series["stage"] == 1.0
        grains = results.frame(-1).grains
        weight = float(np.mean(grains.mass * 9.80665 * grains.radius))
        # The mean force swings about its limit when rest is declared; the swing dies out, and no vibration goes on.
        assert np.max(series["unbalanced"][after][-10:]) < 1e-4
        assert np.max(series["kinetic"][after]) / 120 < 1e-6 * weight
        # A disc on a single contact may roll for long, there is no rolling friction; all others are a hundred times stiller than rest asks for.
        frame = results.frame(-1)
        assert frame.contacts is not None
        both = np.concatenate([frame.contacts.i, frame.contacts.j[frame.contacts.j >= 0]])
        held = np.bincount(both, minlength=120) > 1
        energy = 0.5 * grains.mass * (grains.vx**2 + grains.vy**2) + 0.5 * grains.inertia * grains.spin**2
        assert np.count_nonzero(held) > 100
        assert np.mean(energy[held]) < 1e-8 * weight
        assert 2.5 < series["coordination"][-1] < 4.5
        assert 0.15 < series["void_ratio"][-1] < 0.33


@pytest.mark.parametrize("method", ["growth", "insertion"])
def test_dense_packings_hardly_move(method: str, tmp_path: Path) -> None:
    """Gaps left by the packing are small: the energy of motion stays below that of a fall by a part of a radius."""
    with open_results(run_scenario(packing(method, REST), tmp_path / "run.h5")) as results:
        grains = results.frame(0).grains
        fall = float(np.sum(grains.mass) * 9.80665 * np.mean(grains.radius))
        assert np.max(results.series["kinetic"]) < {"growth": 0.05, "insertion": 0.3}[method] * fall


def test_a_packing_that_misses_its_void_ratio_warns_in_the_file(tmp_path: Path) -> None:
    changes = {**REST, "packing": {"method": "rejection", "void_ratio": 0.3}}
    heard: list[str] = []
    path = run_scenario(
        packing("rejection", changes), tmp_path / "run.h5", listener=lambda f, _: heard.extend(f.warnings)
    )
    with open_results(path) as results:
        (warning,) = results.warnings
    assert heard == [warning]
    assert warning.startswith("packing: method rejection reached a void ratio of ")
