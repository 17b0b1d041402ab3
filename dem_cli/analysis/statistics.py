"""Means of repeated runs and what can be said of their differences: Student's t, paired or Welch's, and Holm's correction.

Values of runs are taken as independent and about normal. NaN where a number is not defined.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dem_cli.state import Floats

LEVEL = 0.95
"""Confidence of all intervals."""


@dataclass(frozen=True)
class Estimate:
    """Mean of `n` values, their standard deviation (of n - 1), and the half width of the mean's confidence interval (Student's t, LEVEL)."""

    mean: float
    sd: float
    half: float
    n: int


@dataclass(frozen=True)
class Difference:
    """Mean of others less ones, half width of its confidence interval (LEVEL), and p: how likely one so large is by chance, of two sides.

    n: pairs, or runs of both samples. test: "paired", "welch", or "" where there are too few runs for either; p is NaN then.
    """

    mean: float
    half: float
    p: float
    n: int
    test: Literal["paired", "welch", ""]


def estimate(values: Iterable[float]) -> Estimate:
    """Of those values that are defined."""
    known = _known(values)
    n = len(known)
    if n == 0:
        return Estimate(math.nan, math.nan, math.nan, 0)
    mean = float(known.mean())
    if n == 1:
        return Estimate(mean, math.nan, math.nan, 1)
    sd = float(known.std(ddof=1))
    return Estimate(mean, sd, _factor(n - 1.0) * sd / math.sqrt(n), n)


def difference(ones: Mapping[int, float], others: Mapping[int, float]) -> Difference:
    """Values by seed. Paired where two seeds or more are common, as one seed gives the same start to both; else Welch's."""
    common = [seed for seed in ones if math.isfinite(ones[seed]) and math.isfinite(others.get(seed, math.nan))]
    if len(common) > 1:
        found = estimate(others[seed] - ones[seed] for seed in common)
        return Difference(
            found.mean, found.half, _p(found.mean, found.sd / math.sqrt(found.n), found.n - 1.0), found.n, "paired"
        )
    first, second = _known(ones.values()), _known(others.values())
    n = len(first) + len(second)
    mean = float(second.mean() - first.mean()) if len(first) and len(second) else math.nan
    if len(first) < 2 or len(second) < 2:
        return Difference(mean, math.nan, math.nan, n, "")
    parts = [float(values.var(ddof=1)) / len(values) for values in (first, second)]
    error = math.sqrt(sum(parts))
    squares = sum(part**2 / (len(values) - 1) for part, values in zip(parts, (first, second), strict=True))
    freedom = sum(parts) ** 2 / squares if squares > 0.0 else n - 2.0
    return Difference(mean, _factor(freedom) * error, _p(mean, error, freedom), n, "welch")


def holm(p: Sequence[float]) -> list[float]:
    """Holm's step-down correction for len(p) comparisons: what is below a level is significant at it, for all of them together.

    NaN stands for a comparison that was not made, and is not counted.
    """
    order = sorted((k for k in range(len(p)) if math.isfinite(p[k])), key=lambda k: p[k])
    found, so_far = [math.nan] * len(p), 0.0
    for place, k in enumerate(order):
        so_far = max(so_far, min(1.0, (len(order) - place) * p[k]))
        found[k] = so_far
    return found


def _known(values: Iterable[float]) -> Floats:
    return np.array([value for value in values if math.isfinite(value)], dtype=np.float64)


def _factor(freedom: float) -> float:
    """Quantile of Student's t that LEVEL lies within, on both sides."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * LEVEL))


def _p(mean: float, error: float, freedom: float) -> float:
    """Of two sides; values without any spread differ for certain, or not at all."""
    from scipy.special import stdtr

    if error == 0.0:
        return 1.0 if mean == 0.0 else 0.0
    return float(2.0 * stdtr(freedom, -abs(mean) / error))
