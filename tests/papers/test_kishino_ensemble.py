"""Samples of 122 discs as in Kishino 1988, section 4: what the friction while they are prepared does to them, and the shipped seed.

One sample is one realisation, so bounds are on medians and on order. They come from seeds 1 to 8 sheared to 3 %, whose table is in the README
("Biaxial tests"); here three of those seeds, which take little time, go to 1 %, before most collapses.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from dem_cli.analysis.quasi_static import measure_increment
from dem_cli.assembly import build_assembly
from dem_cli.engines.granular_element.engine import GranularElementEngine
from dem_cli.scenario import load_scenario
from dem_cli.scenario.quasi_static import QuasiStaticScenario
from dem_cli.scenario.shipped import folder
from dem_cli.state import Floats, Increment

SEEDS = (2, 5, 8)
FRICTION = (0, 15, 25)  # degrees, while the sample is prepared


class Sheared(NamedTuple):
    """Void ratio and coordination number before the shear; over its increments s1/s2, volumetric strain, and the number of collapses."""

    void_ratio: float
    coordination: float
    ratio: Floats
    contraction: Floats
    events: int


@cache
def sheared(seed: int | None, friction: int = 15, shear_strain: float = 0.01) -> Sheared:
    changes = [f"stage.1.friction={friction} deg", f"stage.2.shear_strain={shear_strain}"]
    scenario = load_scenario(folder() / "biaxial-kishino.toml", changes if seed is None else [f"seed={seed}", *changes])
    assert isinstance(scenario, QuasiStaticScenario)
    found: list[Increment] = [
        one for one in GranularElementEngine(scenario, build_assembly(scenario)).increments() if one.stage == 1
    ]
    start = measure_increment(found[0], scenario.depth, *scenario.stiffness).row
    return Sheared(
        start["void_ratio"],
        start["coordination"],
        np.array([one.stress[1] / one.stress[0] for one in found]),
        np.array([one.strain.sum() for one in found]),
        sum(one.event for one in found),
    )


def median(values: list[float]) -> float:
    return float(np.median(values))


def test_friction_while_preparing_makes_samples_loose() -> None:
    """Without friction every sample is denser and has more contacts than with any; medians rise with the friction."""
    void, contacts = (
        {f: [getattr(sheared(seed, f), name) for seed in SEEDS] for f in FRICTION}
        for name in ("void_ratio", "coordination")
    )
    for f in FRICTION[1:]:
        assert all(a < b for a, b in zip(void[0], void[f], strict=True))
        assert all(a > b for a, b in zip(contacts[0], contacts[f], strict=True))
    assert median(void[0]) < median(void[15]) < median(void[25])
    assert 0.247 < median(void[15]) < 0.27


def test_dense_samples_dilate_at_once() -> None:
    """Without friction in the preparation no sample contracts by more than 1e-4, and the median dilates more than with any."""
    for seed in SEEDS:
        assert sheared(seed, 0).contraction.max() < 1e-4
        assert sheared(seed, 0).contraction[-1] < 0.0
    ends = {f: median([float(sheared(seed, f).contraction[-1]) for seed in SEEDS]) for f in FRICTION}
    assert ends[0] < 3.0 * min(ends[15], ends[25], 0.0)
    assert max(sheared(seed, 25).contraction.max() for seed in SEEDS) > 1e-4  # some of the loose ones contract at first


def test_dense_samples_are_stronger() -> None:
    """Median s1/s2 at 1 %."""
    ratios = {f: median([float(sheared(seed, f).ratio[-1]) for seed in SEEDS]) for f in FRICTION}
    assert ratios[0] > 2.1
    assert ratios[0] > ratios[15] + 0.3


def test_shipped_seed_is_like_the_papers_sample() -> None:
    """Fig. 9: void ratio 0.260, slight contraction first (up to increment 14 there), s1/s2 1.7 at the peak near increment 36, mild dilatancy."""
    found = sheared(None, shear_strain=0.03)
    if abs(found.void_ratio - 0.2559) > 1e-4:
        pytest.skip("preparations are chaotic: with the rounding of this processor the seed makes another sample")
    assert found.void_ratio == pytest.approx(0.260, abs=0.005)
    assert 30 <= int(found.ratio.argmax()) <= 45
    assert 1.6 < found.ratio.max() < 1.8
    first = found.contraction[:31]
    assert 8 <= int(first.argmax()) <= 22
    assert 1e-4 < first.max() < 1e-3
    assert -2e-3 < found.contraction[-1] < 0.0
    assert found.events <= 5
