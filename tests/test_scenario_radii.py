"""Sizes of grains: bounds, moments, and the grading curve that the mass of a drawn sample must follow."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm

from dem_cli.scenario.radii import Radius

NORMAL = {"normal": {"mean": "7 mm", "sd": "2 mm", "min": "4 mm", "max": "9 mm"}}
GRADING = {"grading": {"sieve": ["2 mm", "5 mm", "6 mm", "20 mm"], "passing": [0, 30, 70, 100]}}


def radius(raw: Any) -> Radius:
    return Radius.model_validate(raw)


@pytest.mark.parametrize(
    ("raw", "bounds"),
    [
        ("7 mm", (0.007, 0.007)),
        ({"uniform": ["5 mm", "1 cm"]}, (0.005, 0.01)),
        (NORMAL, (0.004, 0.009)),
        ({"list": ["5 mm", "3 mm", "4 mm"]}, (0.003, 0.005)),
        (GRADING, (0.001, 0.010)),  # sieves are diameters
    ],
)
def test_radii_keep_their_bounds(raw: Any, bounds: tuple[float, float]) -> None:
    sizes = radius(raw)
    assert sizes.bounds == bounds
    count = 3 if sizes.sizes else 5000
    drawn = sizes.draw(np.random.default_rng(1), count)
    assert drawn.shape == (count,)
    assert drawn.min() >= bounds[0] * (1 - 1e-12)
    assert drawn.max() <= bounds[1] * (1 + 1e-12)
    if count > 3 and bounds[0] < bounds[1]:  # and they reach for both ends
        assert drawn.min() < bounds[0] + 0.1 * (bounds[1] - bounds[0])
        assert drawn.max() > bounds[1] - 0.2 * (bounds[1] - bounds[0])


@pytest.mark.parametrize("raw", ["7 mm", {"uniform": ["5 mm", "1 cm"]}, NORMAL, GRADING])
def test_the_seed_decides(raw: Any) -> None:
    first, again, other = (radius(raw).draw(np.random.default_rng(seed), 50) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert raw == "7 mm" or not np.array_equal(first, other)


def test_list_is_taken_as_it_is() -> None:
    assert radius({"list": ["5 mm", "3 mm"]}).draw(np.random.default_rng(1), 2).tolist() == [0.005, 0.003]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_distributions(seed: int) -> None:
    """Kolmogorov-Smirnov against the closed forms; a right sampler fails one seed of 10^4, a wrong one (not cut, not uniform)
    is off by several percent, which 20 000 numbers show at once."""
    drawn = radius({"uniform": ["5 mm", "1 cm"]}).draw(np.random.default_rng(seed), 20000)
    assert kstest(drawn, lambda r: (r - 0.005) / 0.005).pvalue > 1e-4
    drawn = radius(NORMAL).draw(np.random.default_rng(seed), 20000)
    assert kstest(drawn, truncnorm(-1.5, 1.0, loc=0.007, scale=0.002).cdf).pvalue > 1e-4


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_mass_follows_the_grading_curve(seed: int) -> None:
    """Definition: the grains finer than a size make up the curve's share of the sample's mass (areas, in 2D).

    Tolerance: the share is a ratio of sums, F = sum(m [d < D]) / sum(m), whose standard deviation is
    sqrt(sum(m^2 ([d < D] - F)^2)) / sum(m) for independent draws; 4.5 of it fails one right comparison in 10^5. With 40 000
    grains it is below 0.01, a tenth of what a draw by number in place of mass would miss.
    """
    sieve, passing = np.array([2.0, 5.0, 6.0, 20.0]) * 1e-3, np.array([0.0, 0.3, 0.7, 1.0])
    drawn = 2.0 * radius(GRADING).draw(np.random.default_rng(seed), 40000)
    mass = drawn**2
    for size in (2.5e-3, 4e-3, 5e-3, 5.5e-3, 6e-3, 9e-3, 15e-3):
        finer = drawn < size
        share = mass[finer].sum() / mass.sum()
        curve = np.interp(math.log(size), np.log(sieve), passing)
        sd = math.sqrt(np.sum(mass**2 * (finer - share) ** 2)) / mass.sum()
        assert sd < 0.01
        assert abs(share - curve) < 4.5 * sd


def test_grading_of_one_step_is_log_uniform_by_mass() -> None:
    """Closed form between two sieves: mass per ln d constant, so the mean diameter by mass is (b - a) / ln(b/a)."""
    drawn = 2.0 * radius({"grading": {"sieve": ["1 mm", "8 mm"], "passing": [0, 100]}}).draw(
        np.random.default_rng(5), 200000
    )
    mean = np.sum(drawn**3) / np.sum(drawn**2)
    assert mean == pytest.approx(7e-3 / math.log(8.0), rel=0.02)


def test_flat_part_of_the_curve_holds_no_grains() -> None:
    raw = {"grading": {"sieve": ["1 mm", "2 mm", "4 mm", "8 mm"], "passing": [0, 50, 50, 100]}}
    drawn = 2.0 * radius(raw).draw(np.random.default_rng(5), 5000)
    assert not np.any((drawn > 2.0001e-3) & (drawn < 3.9999e-3))


def test_share_of_a_window() -> None:
    """P(-1.5 < z < 1) of the normal distribution."""
    normal = radius(NORMAL).normal
    assert normal is not None
    assert normal.share == pytest.approx(norm.cdf(1.0) - norm.cdf(-1.5), rel=1e-12)
