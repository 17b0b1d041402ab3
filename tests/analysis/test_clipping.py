"""Areas of discs and lenses in rectangles: closed forms, an independent integral, additivity."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dem_cli.analysis import clipping
from dem_cli.geometry.ellipse import outline, support

place = st.floats(-3.0, 3.0)
size = st.floats(0.05, 2.0)
ROUNDING = 1e-14


def integral(discs, x0, y0, x1, y1, slices=4000):
    """Area common to all discs and the rectangle: exact lengths of vertical slices, summed at their middles."""
    left = max(x0, *(c[0] - c[2] for c in discs), -1e9)
    right = min(x1, *(c[0] + c[2] for c in discs), 1e9)
    if right <= left:
        return 0.0
    width = (right - left) / slices
    x = left + (np.arange(slices) + 0.5) * width
    top, bottom = np.full(slices, y1), np.full(slices, y0)
    for cx, cy, r in discs:
        half = np.sqrt(np.maximum(0.0, r**2 - (x - cx) ** 2))
        top, bottom = np.minimum(top, cy + half), np.maximum(bottom, cy - half)
    return float(np.maximum(0.0, top - bottom).sum() * width)


@settings(max_examples=150, deadline=None)
@given(place, place, size, place, place, size, size)
def test_disc_in_rectangle_is_the_integral_of_its_slices(cx, cy, r, x0, y0, w, h):
    box = (x0, y0, x0 + w, y0 + h)
    assert clipping.disc_in_rectangle(cx, cy, r, *box) == pytest.approx(integral([(cx, cy, r)], *box), abs=1e-4 * r * r)


@settings(max_examples=150, deadline=None)
@given(place, place, size, st.floats(0.0, 1.05), st.floats(0.0, 6.3), size, place, place, size, size)
def test_lens_in_rectangle_is_the_integral_of_its_slices(xi, yi, ri, reach, turn, rj, x0, y0, w, h):
    d = reach * (ri + rj)
    xj, yj = xi + d * math.cos(turn), yi + d * math.sin(turn)
    box = (x0, y0, x0 + w, y0 + h)
    area = clipping.lens_in_rectangle(xi, yi, ri, xj, yj, rj, *box)
    assert area == pytest.approx(integral([(xi, yi, ri), (xj, yj, rj)], *box), abs=1e-4 * min(ri, rj) ** 2)


@settings(max_examples=200, deadline=None)
@given(place, place, size, place, place, size, size, st.floats(0.01, 0.99), st.booleans())
def test_parts_of_a_split_rectangle_add_up(cx, cy, r, x0, y0, w, h, cut, upright):
    box = (x0, y0, x0 + w, y0 + h)
    middle = x0 + cut * w if upright else y0 + cut * h
    first = (x0, y0, middle, y0 + h) if upright else (x0, y0, x0 + w, middle)
    second = (middle, y0, x0 + w, y0 + h) if upright else (x0, middle, x0 + w, y0 + h)
    disc = [clipping.disc_in_rectangle(cx, cy, r, *b) for b in (box, first, second)]
    assert disc[0] == pytest.approx(disc[1] + disc[2], abs=20 * ROUNDING * r * r)
    lens = [clipping.lens_in_rectangle(cx, cy, r, 0.1, 0.2, 1.1, *b) for b in (box, first, second)]
    assert lens[0] == pytest.approx(lens[1] + lens[2], abs=100 * ROUNDING)


@pytest.mark.parametrize(
    ("box", "share"),
    [
        ((-2.0, -2.0, 2.0, 2.0), 1.0),
        ((-math.inf, -math.inf, math.inf, math.inf), 1.0),
        ((0.0, -2.0, 2.0, 2.0), 0.5),
        ((0.0, 0.0, 2.0, math.inf), 0.25),
        ((-2.0, -2.0, 2.0, 0.5), 1.0 - (1.0 / 3.0 - math.sqrt(0.75) / (2.0 * math.pi))),
        ((-0.5, -0.5, 0.5, 0.5), 1.0 / math.pi),
        ((1.0, -2.0, 2.0, 2.0), 0.0),
        ((0.8, 0.8, 2.0, 2.0), 0.0),
    ],
)
def test_disc_in_rectangle_closed_forms(box, share):
    r, cx, cy = 1.7, -0.4, 2.3
    moved = (cx + r * box[0], cy + r * box[1], cx + r * box[2], cy + r * box[3])
    area = clipping.disc_in_rectangle(cx, cy, r, *moved)
    assert area == pytest.approx(share * math.pi * r * r, abs=ROUNDING)


@pytest.mark.parametrize("d", [0.3, 1.2, 1.9, 1.98, 1.995, 1.9999, 2.0 - 1e-9])
def test_lens_of_equal_discs(d):
    exact = 2.0 * math.acos(0.5 * d) - 0.5 * d * math.sqrt((2.0 - d) * (2.0 + d))
    assert clipping.lens_area(d, 1.0, 1.0) == pytest.approx(exact, abs=ROUNDING)


def test_thin_lens_keeps_its_digits():
    # leading order of two caps of height e: 2 * (4/3) e sqrt(2 e)
    e = 1e-10
    assert clipping.lens_area(2.0 - 2.0 * e, 1.0, 1.0) == pytest.approx(8 / 3 * e * math.sqrt(2 * e), rel=1e-6)


def test_lens_limits():
    assert clipping.lens_area(3.0, 1.0, 2.0) == 0.0
    assert clipping.lens_area(0.9, 1.0, 2.0) == pytest.approx(math.pi)
    assert clipping.lens_area(1.0 + 1e-12, 1.0, 2.0) == pytest.approx(math.pi, rel=1e-5)


def test_lens_wholly_inside_equals_the_clipped_one():
    # the box about both discs reaches to x = 1, the lens to 0.93: a border between them takes the way through the polygon
    args = (0.0, 0.0, 1.0, 1.3, 1.3, 1.0)
    whole = clipping.lens_area(1.3 * math.sqrt(2.0), 1.0, 1.0)
    assert clipping.lens_in_rectangle(*args, -5.0, -5.0, 5.0, 5.0) == pytest.approx(whole, abs=ROUNDING)
    assert clipping.lens_in_rectangle(*args, -5.0, -5.0, 0.95, 5.0) == pytest.approx(whole, abs=ROUNDING)
    assert clipping.lens_in_rectangle(*args, -5.0, -5.0, 0.9, 5.0) < whole - 1e-4


def test_disc_in_polygon_agrees_with_the_rectangle():
    px, py = np.array([0.1, 0.9, 0.9, 0.1]), np.array([-0.4, -0.4, 1.3, 1.3])
    area = clipping.disc_in_polygon(0.2, 0.3, 0.8, px, py, 4)
    assert area == pytest.approx(clipping.disc_in_rectangle(0.2, 0.3, 0.8, 0.1, -0.4, 0.9, 1.3), abs=ROUNDING)


aspect = st.floats(1.0, 5.0)
turn = st.floats(-4.0, 4.0)


def clipped_polygon(points, x0, y0, x1, y1):
    """Area of the polygon points (n, 2) inside a rectangle, by cutting it along the four sides (Sutherland and Hodgman)."""
    for axis, side, sign in ((0, x0, 1.0), (0, x1, -1.0), (1, y0, 1.0), (1, y1, -1.0)):
        inside = sign * (points[:, axis] - side)
        after, inside_after = np.roll(points, -1, axis=0), np.roll(inside, -1)
        crossing = inside * inside_after < 0.0
        share = np.where(crossing, inside / np.where(crossing, inside - inside_after, 1.0), 0.0)[:, None]
        corners = np.stack([points, points + share * (after - points)], axis=1).reshape(-1, 2)
        points = corners[np.stack([inside >= 0.0, crossing], axis=1).ravel()]
        if len(points) < 3:
            return 0.0
    x, y = points.T
    return 0.5 * float(x @ np.roll(y, -1) - np.roll(x, -1) @ y)


@settings(max_examples=200, deadline=None)
@given(place, place, size, aspect, turn, place, place, size, size)
def test_ellipse_in_rectangle_is_that_of_a_fine_polygon(cx, cy, r, k, angle, x0, y0, w, h):
    a, b = r * math.sqrt(k), r / math.sqrt(k)
    box = (x0, y0, x0 + w, y0 + h)
    # the polygon leaves 2 pi^3 / (3 n^2) a b of the ellipse out: 1.3e-6
    t = np.arange(4000) * (math.tau / 4000)
    u, v = a * np.cos(t), b * np.sin(t)
    points = np.stack(
        [cx + u * math.cos(angle) - v * math.sin(angle), cy + u * math.sin(angle) + v * math.cos(angle)], 1
    )
    area = clipping.ellipse_in_rectangle(cx, cy, math.pi * a * b, *outline(a, b, angle), *box)
    assert area == pytest.approx(clipped_polygon(points, *box), abs=2e-6 * r * r)


@settings(max_examples=200, deadline=None)
@given(place, place, size, turn, place, place, size, size, st.sampled_from([0.0, 1e-14, 1e-9]))
def test_ellipse_of_equal_axes_is_a_disc(cx, cy, r, angle, x0, y0, w, h, more):
    box = (x0, y0, x0 + w, y0 + h)
    area = clipping.ellipse_in_rectangle(
        cx, cy, math.pi * r * r * (1.0 + more), *outline(r * (1.0 + more), r, angle), *box
    )
    assert area == pytest.approx(clipping.disc_in_rectangle(cx, cy, r, *box), abs=(1e-12 + 4.0 * more) * r * r)


@settings(max_examples=200, deadline=None)
@given(place, place, size, aspect, turn, place, place, size, size, st.floats(0.01, 0.99), st.booleans())
def test_ellipse_in_parts_of_a_split_rectangle_adds_up(cx, cy, r, k, angle, x0, y0, w, h, cut, upright):
    middle = x0 + cut * w if upright else y0 + cut * h
    first = (x0, y0, middle, y0 + h) if upright else (x0, y0, x0 + w, middle)
    second = (middle, y0, x0 + w, y0 + h) if upright else (x0, middle, x0 + w, y0 + h)
    shape = outline(r * math.sqrt(k), r / math.sqrt(k), angle)
    boxes = ((x0, y0, x0 + w, y0 + h), first, second)
    whole, *parts = (clipping.ellipse_in_rectangle(cx, cy, math.pi * r * r, *shape, *box) for box in boxes)
    assert whole == pytest.approx(sum(parts), abs=100 * ROUNDING * r * r)


@pytest.mark.parametrize(
    ("box", "share"),
    [
        ((-math.inf, -math.inf, math.inf, math.inf), 1.0),
        ((-math.inf, 0.0, math.inf, math.inf), 0.5),
        ((0.0, 0.0, math.inf, math.inf), 0.25),
        ((-math.inf, 2.5, math.inf, math.inf), 0.0),
    ],
)
@pytest.mark.parametrize("quarter", [0.0, 0.5 * math.pi])
def test_ellipse_in_rectangle_closed_forms(box, share, quarter):
    area = clipping.ellipse_in_rectangle(0.0, 0.0, math.pi * 2.0, *outline(2.0, 1.0, quarter), *box)
    assert area == pytest.approx(share * math.pi * 2.0, abs=10 * ROUNDING)


def outline_above(a, b, angle, d):
    """Height of an ellipse's upper outline at the distance d from its centre; -inf beyond it."""
    m, p, q = outline(a, b, angle)
    reach = m + p - d * d
    return np.where(reach > 0.0, (q * d + a * b * np.sqrt(np.maximum(reach, 0.0))) / (m + p), -math.inf)


@settings(max_examples=200, deadline=None)
@given(size, aspect, turn, size, aspect, turn, st.floats(-4.0, math.log10(0.5)))
def test_lens_at_a_contact_is_within_the_stated_error(ri, ki, turn_i, rj, kj, turn_j, press):
    # the normal is +y; i below, j above it
    ai, bi, aj, bj = ri * math.sqrt(ki), ri / math.sqrt(ki), rj * math.sqrt(kj), rj / math.sqrt(kj)
    sharpest = min(bi * bi / ai, bj * bj / aj)
    overlap = 10.0**press * sharpest
    shape_i, shape_j = outline(ai, bi, turn_i), outline(aj, bj, turn_j)
    hi, hi1, _ = support(*shape_i, 0.0, 1.0)
    hj, hj1, _ = support(*shape_j, 0.0, 1.0)
    rho_i = clipping.curvature_radius(math.pi * ai * bi, *shape_i, 0.0, 1.0)
    rho_j = clipping.curvature_radius(math.pi * aj * bj, *shape_j, 0.0, 1.0)
    xj, yj = -hi1 - hj1, hi - overlap + hj
    reach = 4.0 * math.sqrt(2.0 * overlap / (1.0 / rho_i + 1.0 / rho_j))
    x = np.linspace(-hi1 - reach, -hi1 + reach, 40001)
    thick = outline_above(ai, bi, turn_i, x) + outline_above(aj, bj, turn_j, xj - x) - yj
    exact = float(np.maximum(0.0, thick).sum() * (x[1] - x[0]))
    everywhere = (-math.inf, -math.inf, math.inf, math.inf)
    lens = clipping.lens_at_contact(0.0, 1.0, -hi1, hi - 0.5 * overlap, overlap, rho_i, rho_j, *everywhere)
    assert lens == pytest.approx(exact, rel=0.2 * overlap / sharpest + 1e-5)


def test_curvature_at_the_ends_of_the_axes():
    shape = outline(3.0, 1.0, 0.4)
    at_tip = clipping.curvature_radius(3.0 * math.pi, *shape, math.cos(0.4), math.sin(0.4))
    at_side = clipping.curvature_radius(3.0 * math.pi, *shape, -math.sin(0.4), math.cos(0.4))
    assert at_tip == pytest.approx(1.0 / 3.0, rel=1e-14)
    assert at_side == pytest.approx(9.0, rel=1e-14)
