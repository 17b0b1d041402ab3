"""Means of repeated runs, their confidence, and differences, against scipy.stats and numbers by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from dem_cli.analysis.statistics import LEVEL, difference, estimate, holm


def test_three_values_by_hand():
    # mean 2, sd 1; t of 2 degrees of freedom at 97.5 % is 4.302653
    found = estimate([1.0, 2.0, 3.0, math.nan])
    assert (found.mean, found.sd, found.n) == (2.0, 1.0, 3)
    assert found.half == pytest.approx(4.302653 / math.sqrt(3.0), rel=1e-6)


def test_interval_is_that_of_scipy():
    values = np.random.default_rng(3).normal(0.2, 0.01, 7)
    low, high = stats.t.interval(LEVEL, 6, values.mean(), stats.sem(values))
    found = estimate(values)
    assert (found.mean - found.half, found.mean + found.half) == pytest.approx((low, high), rel=1e-12)


def test_interval_holds_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(1)
    hits = sum(abs((one := estimate(rng.normal(5.0, 2.0, 4))).mean - 5.0) <= one.half for _ in range(2000))
    assert hits / 2000 == pytest.approx(LEVEL, abs=0.015)


def test_one_value_has_no_confidence_and_none_no_mean():
    one, none = estimate([4.0]), estimate([math.nan])
    assert (one.mean, one.n) == (4.0, 1)
    assert math.isnan(one.sd)
    assert math.isnan(one.half)
    assert none.n == 0
    assert math.isnan(none.mean)


def test_common_seeds_are_compared_in_pairs():
    a = {1: 0.20, 2: 0.25, 3: 0.30, 4: 0.1}
    b = {1: 0.21, 2: 0.262, 3: 0.309, 5: 0.9, 4: math.nan}
    found = difference(a, b)
    want = stats.ttest_rel([0.21, 0.262, 0.309], [0.20, 0.25, 0.30])
    low, high = want.confidence_interval(LEVEL)
    assert (found.test, found.n) == ("paired", 3)
    assert found.p == pytest.approx(want.pvalue, rel=1e-9)
    assert (found.mean - found.half, found.mean + found.half) == pytest.approx((low, high), rel=1e-9)
    # the seeds' own spread, ten times the difference, would hide it
    assert found.p < 0.02 < stats.ttest_ind([0.21, 0.262, 0.309], [0.20, 0.25, 0.30]).pvalue


def test_other_seeds_are_compared_by_welch():
    a, b = {1: 0.20, 2: 0.25, 3: 0.30}, {4: 0.31, 5: 0.32, 6: 0.325, 7: 0.33, 1: 0.31}
    found = difference(a, b)
    want = stats.ttest_ind(list(b.values()), list(a.values()), equal_var=False)
    low, high = want.confidence_interval(LEVEL)
    assert (found.test, found.n) == ("welch", 8)
    assert found.p == pytest.approx(want.pvalue, rel=1e-9)
    assert (found.mean - found.half, found.mean + found.half) == pytest.approx((low, high), rel=1e-9)


def test_too_few_runs_are_not_tested():
    for one, other in (({1: 0.2}, {1: 0.3}), ({1: 0.2}, {2: 0.3, 3: 0.4}), ({1: 0.2, 2: 0.2}, {1: 0.3})):
        found = difference(one, other)
        assert found.test == ""
        assert math.isnan(found.p)
        assert found.mean > 0.0
    assert math.isnan(difference({}, {1: 1.0}).mean)


def test_values_without_spread():
    same, apart = {1: 0.2, 2: 0.2}, {1: 0.25, 2: 0.25}
    assert difference(same, same).p == 1.0
    assert difference(same, apart).p == 0.0
    assert difference({1: 0.2, 2: 0.2}, {3: 0.25, 4: 0.25}).p == 0.0


def test_holm_by_hand():
    # ordered .01 .02 .03 .04 times 4 3 2 1: .04 .06 .06 .04, never falling: .04 .06 .06 .06
    assert holm([0.03, 0.01, math.nan, 0.04, 0.02])[:2] == pytest.approx([0.06, 0.04])
    assert holm([0.03, 0.01, math.nan, 0.04, 0.02])[3:] == pytest.approx([0.06, 0.06])
    assert math.isnan(holm([0.03, math.nan])[1])
    assert holm([0.7, 0.6]) == [1.0, 1.0]
    assert holm([]) == []


def test_holm_keeps_false_findings_of_a_family_rare():
    rng = np.random.default_rng(2)
    found = sum(min(holm(rng.uniform(size=8).tolist())) < 0.05 for _ in range(3000))
    assert found / 3000 == pytest.approx(0.05, abs=0.012)
