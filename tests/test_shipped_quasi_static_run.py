"""The scenarios of quasi-static tests that come along, run: with fewer discs and increments where they are large."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator

import numpy as np
import pytest

from dem_cli.results import Results, open_results
from dem_cli.run import run_scenario
from dem_cli.scenario import load_scenario
from dem_cli.scenario.shipped import folder, shipped_scenarios

SHORTER = {
    "biaxial-kishino": ("stage.shear.shear_strain=0.0025",),
    "biaxial-three-discs": ("stage.shear.shear_strain=0.01",),
    "biaxial-three-discs-wall-friction": ("stage.shear.shear_strain=0.01",),
    "biaxial-2000": ("grains.count=100", "stage.shear.shear_strain=0.0025"),
    "biaxial-membrane": ("grains.count=100", "stage.shear.shear_strain=0.0025"),
    "undrained-cyclic-loose": (),
    "undrained-cyclic-dense": ("stage.cyclic.cycles=3",),
}


@pytest.fixture(scope="module", params=SHORTER)
def results(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    scenario = load_scenario(folder() / f"{request.param}.toml", SHORTER[request.param])
    with open_results(run_scenario(scenario, tmp_path_factory.mktemp("shipped") / f"{request.param}.h5")) as opened:
        yield opened


def test_each_has_a_shorter_form() -> None:
    found = {one.name: tomllib.loads(one.text) for one in shipped_scenarios()}
    quasi_static = {name for name, raw in found.items() if raw.get("engine") == "granular-element"}
    assert quasi_static == SHORTER.keys()


def test_ends_well(results: Results) -> None:
    assert results.complete
    if (
        results.path.stem == "undrained-cyclic-loose"
    ):  # grains that bear next to nothing: collapses may be left out of balance
        assert all("cyclic" in one and "not in balance" in one for one in results.warnings)
    else:
        assert results.warnings == []
    compressed, last = results.stages[0], results.stages[-1]
    assert "Pa all round" in compressed.reason
    assert last.reason.startswith(("shear strain of", "3 cycles done", "liquefied"))
    assert results.series["max_overlap"].max() < 0.05


def test_ledger_closes(results: Results) -> None:
    """While it is sheared: the residual, against the work that was done on the way in either sense, event or not."""
    rows = results.series["stage"] == 1
    way = np.abs(np.diff(results.series["work"][rows])).sum()
    residual = results.series["residual"][rows]
    assert abs(residual[-1] - residual[0]) < 5e-3 * way


def test_holds_what_it_is_to_hold(results: Results) -> None:
    """Mean or lateral stress as at the start of the stage, or the volume, at every increment."""
    series = results.series
    rows = series["stage"] == 1
    hold = results.scenario["stage"][1]["hold"]
    if hold == "volume":
        area = series["width"][rows] * series["height"][rows]
        assert np.ptp(area) < 1e-12 * area[0]
        return
    held = series["mean_stress"][rows] if hold == "mean-stress" else series["stress_x"][rows]
    assert np.ptp(held) < 1e-3 * held[0]


def test_shears_the_sample(results: Results) -> None:
    """Stress follows: axial compression makes the axial stress the larger one."""
    ratio = results.series["stress_ratio"][results.series["stage"] == 1]
    assert np.nanmax(ratio) > 1.05
    assert ratio[0] == pytest.approx(1.0, abs=0.02)


def test_only_the_loose_sample_liquefies(results: Results) -> None:
    """Under cycles of the closed pores; a drained sample has no pore pressure."""
    mean = results.series["mean_stress"][results.series["stage"] == 1]
    liquefied = results.stages[-1].reason.startswith("liquefied")
    assert liquefied == ("loose" in results.path.stem)
    if results.scenario["stage"][1]["hold"] == "volume":
        assert (mean[-1] < 0.01 * mean[0]) if liquefied else (mean.min() > 0.95 * mean[0])
