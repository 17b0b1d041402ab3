"""What the thesis finds of shapes (8.5): void ratios ellipse < disc < bonded pair, when packed and after shaking, and each lower after it.

A tenth of its 3000 elements, in a third of its width, five seeds; damping ratio 0.3 in place of 1, which allows steps of three times the length.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dem_cli.results import open_results
from dem_cli.run import run_scenario
from dem_cli.scenario import load_scenario
from dem_cli.scenario.shipped import folder

SEEDS = range(1, 6)
SMALLER = (
    "container.width=40.5 cm", "contact.damping_ratio=0.3", "stage.shake.duration=1 s", "stage.1.unbalanced=3e-3", "stage.1.kinetic=1e-4",
    "stage.3.unbalanced=3e-3", "stage.3.kinetic=1e-4", "output.interval=0.02 s", "output.frames=10 s", "output.tracks.grains=[0]",
)  # fmt: skip
CASES = {
    "ellipse": ("thesis-ellipses-400gal-10hz", ("grains.count=300", "packing.grid.columns=13")),
    "disc": ("thesis-discs-400gal-10hz", ("grains.count=300", "packing.grid.columns=13")),
    "pair": ("thesis-pairs-400gal-10hz", ("grains.count=150", "packing.grid.columns=6")),
}


def void_ratios(shape: str, seed: int, place: Path) -> tuple[float, float]:
    """Void ratio of the whole fill when packed and after shaking."""
    name, changes = CASES[shape]
    scenario = load_scenario(folder() / f"{name}.toml", [*SMALLER, *changes, f"seed={seed}"])
    with open_results(run_scenario(scenario, place / f"{shape}-{seed}.h5")) as results:
        assert all(results.stages[k].reason.startswith("at rest") for k in (0, 2))
        return results.stages[0].after["void_ratio"], results.stages[2].after["void_ratio"]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """Void ratios, shape (seeds, 2), of each shape."""
    place = tmp_path_factory.mktemp("shapes")
    found = {shape: np.array([void_ratios(shape, seed, place) for seed in SEEDS]) for shape in CASES}
    for shape, values in found.items():
        mean, sd = values.mean(axis=0), values.std(axis=0, ddof=1)
        print(
            f"{shape:8s} packed {mean[0]:.4f} +- {sd[0]:.4f}, shaken {mean[1]:.4f} +- {sd[1]:.4f}  {values.round(4).tolist()}"
        )
    return found


@pytest.mark.parametrize("when", [0, 1], ids=["packed", "shaken"])
def test_ellipses_are_densest_and_pairs_loosest(found: dict[str, np.ndarray], when: int) -> None:
    """In the mean, by more than the standard error of the difference."""
    for denser, looser in (("ellipse", "disc"), ("disc", "pair")):
        a, b = found[denser][:, when], found[looser][:, when]
        error = np.sqrt((a.var(ddof=1) + b.var(ddof=1)) / len(SEEDS))
        assert b.mean() - a.mean() > 2.0 * error, (denser, looser)


@pytest.mark.parametrize("shape", CASES)
def test_shaking_densifies(found: dict[str, np.ndarray], shape: str) -> None:
    """Every sample of every seed."""
    assert (found[shape][:, 1] < found[shape][:, 0]).all()
