"""Area covered by ellipses and by bodies of overlapping discs: closed forms, and unions by slices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from analysis_samples import bodies_of, discs, ellipses, rotated, touching, union_in_rectangle
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dem_cli.analysis.bodies import areas
from dem_cli.analysis.clipping import lens_area
from dem_cli.analysis.void_ratio import Rectangle, solid_area
from dem_cli.state import Grains

EVERYWHERE = Rectangle(-math.inf, -math.inf, math.inf, math.inf)
part = st.floats(0.05, 0.95)


def solids(grains: Grains, window: Rectangle) -> float:
    return solid_area(grains, np.ones(len(grains), bool), touching(grains), window)


def window_within(grains: Grains, u, v, w, h) -> Rectangle:
    """A rectangle that cuts the box about a sample, given by shares of it."""
    x0, x1 = (grains.x - grains.a).min(), (grains.x + grains.a).max()
    y0, y1 = (grains.y - grains.a).min(), (grains.y + grains.a).max()
    left, low = x0 + u * (x1 - x0), y0 + v * (y1 - y0)
    return Rectangle(left, low, left + w * (x1 - x0), low + h * (y1 - y0))


@pytest.mark.parametrize("d", [2.0, 1.7, 0.4, 0.0])
def test_pair_is_two_discs_less_their_lens(d):
    grains = bodies_of([(3.0, 1.0, 1.0), (3.0, 1.0 + d, 0.5)])
    exact = 1.25 * math.pi - lens_area(d, 1.0, 0.5)
    assert solids(grains, EVERYWHERE) == pytest.approx(exact, rel=1e-14)
    np.testing.assert_allclose(areas(grains), [exact], rtol=1e-14)
    # the axis of the pair halves it
    assert solids(grains, Rectangle(3.0, -9.0, 9.0, 9.0)) == pytest.approx(0.5 * exact, rel=1e-13)


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_three_discs_with_a_spot_common_to_all(angle):
    # unit discs on a triangle of side 1: a Reuleaux triangle in the middle belongs to all three
    place = [(math.cos(t) / math.sqrt(3), math.sin(t) / math.sqrt(3), 1.0) for t in angle + np.arange(3) * math.tau / 3]
    grains = bodies_of(place)
    reuleaux = 0.5 * (math.pi - math.sqrt(3))
    exact = 3.0 * math.pi - 3.0 * lens_area(1.0, 1.0, 1.0) + reuleaux
    np.testing.assert_allclose(areas(grains), [exact], rtol=1e-14)
    assert solids(grains, EVERYWHERE) == pytest.approx(exact, rel=1e-14)


def test_discs_within_and_upon_each_other_count_once():
    big = (0.0, 0.0, 2.0)
    for body in (
        [big, big, big],
        [(0.5, 0.0, 1.0), big, (0.5, 0.0, 1.0)],
        [(0.0, 0.0, 1.0), big, (0.3, 0.2, 0.1), big],
    ):
        assert areas(bodies_of(body))[0] == pytest.approx(4.0 * math.pi, rel=1e-14)


def test_hole_in_a_ring_is_no_solid():
    ring = [(1.0, 1.0, 1.0), (3.0, 1.0, 1.0), (3.0, 3.0, 1.0), (1.0, 3.0, 1.0)]
    assert areas(bodies_of(ring))[0] == pytest.approx(4.0 * math.pi, rel=1e-14)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 7), part, part, part, part)
def test_body_in_a_window_is_the_union_of_its_discs(seed, n, u, v, w, h):
    rng = np.random.default_rng(seed)
    grains = bodies_of(list(zip(rng.uniform(0, 2, n), rng.uniform(0, 2, n), rng.uniform(0.1, 1.0, n), strict=True)))
    window = window_within(grains, u, v, w, h)
    assert solids(grains, window) == pytest.approx(union_in_rectangle(grains, window), abs=1e-5)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), part, part, st.booleans())
def test_halves_of_a_window_add_up(seed, cut, turn, upright):
    """Bodies, ellipses and discs that touch each other: what two windows side by side hold is what both hold."""
    rng = np.random.default_rng(seed)
    n = 12
    x, y, size = rng.uniform(0, 5, n), rng.uniform(0, 5, n), rng.uniform(0.3, 1.0, n)
    mixed = ellipses(x, y, size, size * rng.choice([1.0, 0.4, 0.9], n), rng.uniform(0, 3, n))
    clumps = bodies_of(*(list(zip(x[k : k + 3], y[k : k + 3], size[k : k + 3], strict=True)) for k in range(0, n, 3)))
    for grains in (mixed, clumps):
        contacts, member = touching(grains), np.ones(n, bool)
        a, b = (1.0 + 3.0 * cut, 1.0 + 3.0 * turn) if upright else (1.0 + 3.0 * turn, 1.0 + 3.0 * cut)
        first = Rectangle(1.0, 1.0, a, 4.0) if upright else Rectangle(1.0, 1.0, 4.0, b)
        second = Rectangle(a, 1.0, 4.0, 4.0) if upright else Rectangle(1.0, b, 4.0, 4.0)
        whole, *halves = (
            solid_area(grains, member, contacts, window) for window in (Rectangle(1.0, 1.0, 4.0, 4.0), first, second)
        )
        assert whole == pytest.approx(sum(halves), abs=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_two_bodies_that_share_a_notch(seed):
    """A disc pressed deep into the notch of a body overlaps two of its discs where they overlap themselves."""
    rng = np.random.default_rng(seed)
    gap = rng.uniform(0.3, 1.2)
    body = [(-0.5 * gap, 0.0, 1.0), (0.5 * gap, 0.0, 1.0), (0.0, 0.3, 0.8)]
    other = [(rng.uniform(-0.1, 0.1), 1.6, 0.9), (0.5, 2.0, 0.9), (-0.3, 2.2, 0.7)]
    grains = bodies_of(body, other)
    for window in (Rectangle(-3.0, -3.0, 3.0, 4.0), Rectangle(-0.2, 0.2, 0.7, 1.9), Rectangle(0.05, 0.0, 3.0, 0.95)):
        assert solids(grains, window) == pytest.approx(union_in_rectangle(grains, window), abs=1e-5)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), part, part, part, part)
def test_touching_discs_and_ellipses_against_slices(seed, u, v, w, h):
    """A chain of discs and ellipses, each pressed a little into the next: overlaps of 1 % of the thickness."""
    rng = np.random.default_rng(seed)
    n = 6
    b = rng.uniform(0.5, 1.0, n)
    a = b * rng.choice([1.0, 1.0, 2.0, 4.0], n)
    angle = rng.uniform(0.0, math.pi, n)
    x, y = np.zeros(n), np.zeros(n)
    for k in range(1, n):
        # along +x until the two touch, then back by the overlap
        low, high = 0.0, 12.0
        while high - low > 1e-12:
            middle = 0.5 * (low + high)
            pair = ellipses([0.0, middle], [0.0, 0.0], a[k - 1 : k + 1], b[k - 1 : k + 1], angle[k - 1 : k + 1])
            low, high = (middle, high) if len(touching(pair)) else (low, middle)
        x[k] = x[k - 1] + high - 0.01 * min(b[k - 1], b[k])
    grains = ellipses(x, y, a, b, angle)
    # two tall ones may meet across a small one between them, deep in each other
    assume(touching(grains).overlap.max() <= 0.01)
    window = window_within(grains, u, v, w, h)
    reference = union_in_rectangle(grains, window)
    assert solids(grains, window) == pytest.approx(reference, abs=2e-4 * window.area)


def test_lens_of_ellipses_counts_once():
    # flat sides 2 % pressed into each other: circles of radius a^2/b = 4
    grains = ellipses([0.0, 0.0], [0.0, 1.98], [2.0, 2.0], [1.0, 1.0], [0.0, 0.0])
    both = 4.0 * math.pi
    assert solids(grains, EVERYWHERE) == pytest.approx(both - lens_area(8.0 - 0.02, 4.0, 4.0), rel=1e-13)
    exact = union_in_rectangle(grains, Rectangle(-2.0, -1.0, 2.0, 3.0))
    assert both - solids(grains, EVERYWHERE) == pytest.approx(both - exact, rel=0.2 * 0.02 / 0.5)
    # and for two discs that are written as ellipses the answer is that of discs
    discs_pressed = ellipses([0.0, 0.0], [0.0, 1.98], 1.0, 1.0, [0.3, 2.0])
    assert solids(discs_pressed, EVERYWHERE) == pytest.approx(2.0 * math.pi - lens_area(1.98, 1.0, 1.0), rel=1e-14)


def test_nearly_equal_axes_give_the_area_of_discs():
    rng = np.random.default_rng(8)
    x, y, r = rng.uniform(0, 6, 15), rng.uniform(0, 6, 15), rng.uniform(0.4, 0.9, 15)
    window = Rectangle(0.7, 0.9, 5.1, 5.2)
    almost = ellipses(x, y, r * (1.0 + 1e-14), r, rng.uniform(0, 3, 15))
    round_ones = discs(x, y, r)
    member = np.ones(15, bool)
    contacts = touching(round_ones)
    found = [solid_area(grains, member, contacts, window) for grains in (almost, round_ones)]
    assert found[0] == pytest.approx(found[1], rel=1e-12)


def test_a_turned_sample_covers_the_same_area():
    rng = np.random.default_rng(9)
    grains = ellipses(
        rng.uniform(0, 5, 12), rng.uniform(0, 5, 12), 0.9, rng.uniform(0.3, 0.9, 12), rng.uniform(0, 3, 12)
    )
    contacts = touching(grains)
    turned, contacts_turned = rotated(grains, contacts, 1.1)
    member = np.ones(12, bool)
    first = solid_area(grains, member, contacts, EVERYWHERE)
    assert solid_area(turned, member, contacts_turned, EVERYWHERE) == pytest.approx(first, rel=1e-12)


def test_body_that_is_no_member_counts_not_at_all():
    grains = bodies_of([(0.0, 0.0, 1.0), (1.0, 0.0, 1.0)], [(2.5, 0.0, 1.0)])
    member = np.array([True, True, False])
    pair = 2.0 * math.pi - lens_area(1.0, 1.0, 1.0)
    assert solid_area(grains, member, touching(grains), EVERYWHERE) == pytest.approx(pair, rel=1e-14)
    assert solid_area(grains, ~member, touching(grains), EVERYWHERE) == pytest.approx(math.pi, rel=1e-14)
