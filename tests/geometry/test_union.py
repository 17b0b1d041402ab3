"""Area, centre and polar moment of unions of discs: against the lens of two circles, and against lines through the union."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dem_cli.geometry.union import pieces

Discs = tuple[np.ndarray, np.ndarray, np.ndarray]


def by_lines(x: np.ndarray, y: np.ndarray, r: np.ndarray, low: float, high: float) -> np.ndarray:
    """Integrals of 1, x, y, x^2 + y^2 over the part of a union of discs between two heights, by intersecting it with horizontal lines.

    Between the heights where the set of arcs changes, an integrand along y is smooth but for square roots at the ends, which the substitution
    y = middle - half cos(phi) takes away; Gauss-Legendre in phi then converges exponentially.
    """
    nodes, weights = np.polynomial.legendre.leggauss(120)
    phi = 0.5 * math.pi * (nodes + 1.0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    at, w = (middle - half * np.cos(phi))[:, None], 0.5 * math.pi * weights * half * np.sin(phi)
    reach = np.sqrt(np.maximum(r**2 - (at - y) ** 2, 0.0))
    order = np.argsort(x - reach, axis=1)
    left, right = (np.take_along_axis(ends, order, axis=1) for ends in (x - reach, x + reach))
    # where a disc is not met, left = right = x: an empty interval, which must not bridge gaps
    seen = np.maximum.accumulate(np.where(right > left, right, -np.inf), axis=1)
    before = np.concatenate([np.full((len(at), 1), -np.inf), seen[:, :-1]], axis=1)
    left = np.maximum(left, before)
    right = np.maximum(right, left)
    length = (right - left).sum(axis=1)
    square = ((right**3 - left**3) / 3.0).sum(axis=1)
    return np.array(
        [
            w @ length,
            w @ (0.5 * (right**2 - left**2)).sum(axis=1),
            w @ (at[:, 0] * length),
            w @ (square + at[:, 0] ** 2 * length),
        ]
    )


def heights(x: np.ndarray, y: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Tops and bottoms of all discs, and heights where two circles cross."""
    found = [*(y - r), *(y + r)]
    for i in range(len(x)):
        for j in range(i):
            dx, dy = x[j] - x[i], y[j] - y[i]
            distance = math.hypot(dx, dy)
            if abs(r[i] - r[j]) < distance < r[i] + r[j]:
                along = (distance**2 + r[i] ** 2 - r[j] ** 2) / (2.0 * distance)
                off = math.sqrt(max(r[i] ** 2 - along**2, 0.0))
                found += [y[i] + (along * dy + sign * off * dx) / distance for sign in (-1.0, 1.0)]
    return np.unique(found)


def reference(x: np.ndarray, y: np.ndarray, r: np.ndarray) -> tuple[float, float, float, float]:
    """Area, centre and polar moment about it."""
    cuts = heights(x, y, r)
    area, mx, my, second = sum(by_lines(x, y, r, a, b) for a, b in pairwise(cuts))
    return area, mx / area, my / area, second - (mx**2 + my**2) / area


def close(one: tuple[float, ...], other: tuple[float, ...], tolerance: float) -> bool:
    return bool(np.allclose(one, other, rtol=tolerance, atol=tolerance))


coordinate = st.floats(-1.5, 1.5)
discs = st.lists(st.tuples(coordinate, coordinate, st.floats(0.1, 1.5)), min_size=1, max_size=7).map(
    lambda rows: tuple(np.array(rows).T)
)


@settings(deadline=None)
@given(discs)
def test_union_is_that_of_lines_through_it(some: Discs) -> None:
    assert close(pieces(*some).whole, reference(*some), 1e-11)


@given(st.floats(0.2, 2.0), st.floats(0.2, 2.0), st.floats(0.0, 1.0), st.floats(0.0, 6.3))
def test_two_discs_are_two_less_their_lens(r: float, other: float, part: float, turn: float) -> None:
    """Area of the lens: two sectors less the kite, its axis along the line of centres."""
    distance = abs(r - other) + part * (r + other - abs(r - other))
    x, y = np.array([0.0, distance * math.cos(turn)]), np.array([0.0, distance * math.sin(turn)])
    if distance - abs(r - other) < 1e-13:  # a lens within 1e-12 of the smaller disc
        expected = math.pi * max(r, other) ** 2
    else:
        sides = (-distance + r + other) * (distance + r - other) * (distance - r + other) * (distance + r + other)
        kite = math.sqrt(max(sides, 0.0))
        a = math.atan2(kite, distance**2 + (r - other) * (r + other))
        b = math.atan2(kite, distance**2 - (r - other) * (r + other))
        lens = r**2 * a + other**2 * b - 0.5 * kite
        expected = math.pi * (r**2 + other**2) - lens
    assert pieces(x, y, np.array([r, other])).whole[0] == pytest.approx(expected, rel=1e-12)


def test_equal_pair_overlapped_by_half() -> None:
    """Two unit discs at distance 1: area 2 pi - (2 pi/3 - sqrt 3/2); each half's own centre, and the moment, from the cap's closed form."""
    own = pieces(np.array([-0.5, 0.5]), np.zeros(2), np.ones(2))
    half = math.pi - (math.pi / 3.0 - math.sqrt(3.0) / 4.0)  # a disc less the cap beyond x = 1/2
    assert own.area == pytest.approx([half, half], rel=1e-14)
    cap_moment = (2.0 / 3.0) * (0.75**1.5)  # of the cap's area about the disc's centre
    assert own.x == pytest.approx([-0.5 - cap_moment / half, 0.5 + cap_moment / half], rel=1e-14)
    assert own.y == pytest.approx([0.0, 0.0], abs=1e-15)
    assert own.whole[1:3] == pytest.approx((0.0, 0.0), abs=1e-15)


@given(discs, st.floats(0.0, 6.3), st.floats(-3.0, 3.0), st.floats(0.1, 10.0))
def test_turned_moved_scaled_and_reordered(some: Discs, turn: float, shift: float, scale: float) -> None:
    x, y, r = some
    area, cx, cy, polar = pieces(x, y, r).whole
    c, s = math.cos(turn), math.sin(turn)
    moved = (scale * (x * c - y * s) + shift, scale * (x * s + y * c) - shift, scale * r)
    centre = (scale * (cx * c - cy * s) + shift, scale * (cx * s + cy * c) - shift)
    found = pieces(*(values[::-1] for values in moved)).whole
    assert found == pytest.approx((scale**2 * area, *centre, scale**4 * polar), rel=1e-12, abs=1e-12)


@given(discs)
def test_pieces_are_parts_of_their_discs(some: Discs) -> None:
    x, y, r = some
    own = pieces(x, y, r)
    assert np.all((own.area >= 0.0) & (own.area <= math.pi * r**2 * (1.0 + 1e-14)))
    assert np.all(np.hypot(own.x - x, own.y - y) <= r * (1.0 + 1e-12))
    # no piece of that area has a smaller moment than a disc
    assert np.all(own.polar >= own.area**2 / (2.0 * math.pi) * (1.0 - 1e-9) - 1e-12)


@given(discs)
def test_areas_at_the_discs_centres_balance_at_the_unions(some: Discs) -> None:
    """So that elements which carry the mass of their own piece need nothing to make up for overlaps, and leave a moment of inertia above 0."""
    x, y, r = some
    own = pieces(x, y, r)
    area, cx, cy, polar = own.whole
    assert (own.area @ x / area, own.area @ y / area) == pytest.approx((cx, cy), abs=1e-12)
    left = polar - own.area @ ((x - cx) ** 2 + (y - cy) ** 2)
    about = own.polar + own.area * ((own.x - x) ** 2 + (own.y - y) ** 2)  # of the pieces, about the discs' centres
    assert left >= about.sum() * (1.0 - 1e-12)


def test_a_disc_that_others_hold_has_no_piece() -> None:
    inside = pieces(np.array([0.0, 0.2]), np.zeros(2), np.array([1.0, 0.5]))
    assert inside.area == pytest.approx([math.pi, 0.0], abs=1e-15)
    twins = pieces(np.zeros(3), np.zeros(3), np.ones(3))
    assert twins.area == pytest.approx([math.pi, 0.0, 0.0], abs=1e-15)
    angle = np.arange(6) * math.pi / 3.0
    covered = pieces(np.append(np.cos(angle), 0.0), np.append(np.sin(angle), 0.0), np.append(np.full(6, 1.2), 0.3))
    assert covered.area[6] == 0.0


def test_ring_with_a_hole() -> None:
    """Six touching discs around an empty place: their areas add up, centre in the hole."""
    angle = np.arange(6) * math.pi / 3.0
    area, x, y, polar = pieces(2.0 * np.cos(angle), 2.0 * np.sin(angle), np.ones(6)).whole
    assert area == pytest.approx(6.0 * math.pi, rel=1e-14)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-14)
    assert polar == pytest.approx(6.0 * math.pi * (0.5 + 4.0), rel=1e-14)
    wide = (2.0 * np.cos(angle), 2.0 * np.sin(angle), np.full(6, 1.3))
    assert close(pieces(*wide).whole, reference(*wide), 1e-11)
