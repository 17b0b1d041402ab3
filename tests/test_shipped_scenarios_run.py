"""The scenarios of explicit DEM that come along, run: the quick one as it is, the large ones with fewer grains and less time."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator

import numpy as np
import pytest

from dem_cli.results import Results, StoredFrame, open_results
from dem_cli.run import run_scenario
from dem_cli.scenario import Shake, load_scenario, parse_scenario
from dem_cli.scenario.shipped import folder, shipped_scenarios

# A tenth of the grains, in a box of a third of the width.
SMALLER = (
    "grains.count=300",
    "packing.grid.columns=13",
    "container.width=40.5 cm",
    "output.tracks.grains=[0, 150, 299]",
)
SHORTER = {
    "packings": (),
    "shake-quick": (),
    "shake-record": ("stage.shake.duration=0.9 s",),
    "thesis-discs-400gal-10hz": (*SMALLER, "stage.shake.duration=0.5 s"),
    "thesis-discs-1200gal-1hz": (*SMALLER, "stage.shake.duration=1 s"),
    "thesis-ellipses-400gal-10hz": (*SMALLER, "stage.shake.duration=0.4 s"),
    "thesis-pairs-400gal-10hz": (
        "grains.count=150",
        "packing.grid.columns=6",
        "container.width=37.5 cm",
        "output.tracks.grains=[0, 150, 299]",
        "stage.shake.duration=0.4 s",
    ),
}


@pytest.fixture(scope="module", params=SHORTER)
def results(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    scenario = load_scenario(folder() / f"{request.param}.toml", SHORTER[request.param])
    with open_results(run_scenario(scenario, tmp_path_factory.mktemp("shipped") / "run.h5")) as opened:
        yield opened


def test_each_has_a_shorter_form() -> None:
    found = {one.name: tomllib.loads(one.text) for one in shipped_scenarios()}
    explicit = {
        name for name, raw in found.items() if raw.get("engine", "explicit") == "explicit" and "sweep" not in raw
    }
    assert explicit == SHORTER.keys()


def test_ends_well(results: Results) -> None:
    assert results.complete
    assert results.warnings == []
    for stage in results.stages:
        assert stage.reason.startswith("at rest" if stage.kind == "settle" else "its time was over")


def test_ledger_closes(results: Results) -> None:
    """The residual stays below 1e-3 of the energy put in, at the end and everywhere."""
    residual, put_in = results.series["residual"], results.series["energy_in"]
    assert abs(residual[-1]) < 1e-3 * put_in[-1]
    begun = put_in > 0.0
    assert np.count_nonzero(begun) >= len(put_in) - 1
    assert np.max(np.abs(residual[begun]) / put_in[begun]) < 1e-3
    assert np.count_nonzero(residual) > 0


def test_packs_and_densifies(results: Results) -> None:
    """What the thesis sees: falling leaves a dense sample, shaking does not loosen it at 400 gal; none is lost."""
    packing = results.stages[0]
    loosest, most = {"ellipse": (0.2, 5.5), "bonded": (0.26, 6.0)}.get(results.scenario["grains"]["shape"], (0.26, 4.2))
    assert loosest - 0.09 < packing.after["void_ratio_inner"] < loosest
    assert most - 1.7 < packing.after["coordination"] < most
    assert results.series["escaped"].max() == 0.0
    assert results.series["max_overlap"].max() < 0.05
    if len(results.stages) == 1:
        return
    shaking = results.stages[1]
    stages = parse_scenario(str(results.attrs["resolved"]), folder=folder()).stages
    shake = next(s for s in stages if isinstance(s, Shake))
    if (shake.amplitude or (shake.record and shake.record.peak) or 0.0) < 5.0:
        assert shaking.after["void_ratio"] < packing.after["void_ratio"]
    else:
        moved = results.frame(-1).grains.x - frame_at(results, packing.end).grains.x
        assert np.abs(moved).max() > 0.02
    assert shaking.after["work"] > 0.0


def frame_at(results: Results, moment: float) -> StoredFrame:
    return results.frame(int(np.argmin(np.abs(results.frame_times - moment))))
