"""Grains made of elements, as pictures need them: centres of mass, axes, extents, and the outline of several discs."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.state import Floats, Grains, Ints

# A grain whose axes differ by less than this share has none that is longer.
ROUND = 1e-6
TURN = 2.0 * math.pi


def centers(grains: Grains) -> tuple[Floats, Floats]:
    """Centre of mass of the grain that each element belongs to, x and y, shape (n,) each [m]."""
    return of_bodies(grains, grains.x), of_bodies(grains, grains.y)


def of_bodies(grains: Grains, values: Floats) -> Floats:
    """Mean of `values` (n,) over each grain, weighted by mass, at its elements (n,); those of single elements bit for bit."""
    alone = np.bincount(grains.body, minlength=1)[grains.body] == 1
    total = np.bincount(grains.body, grains.mass)
    mean = (np.bincount(grains.body, grains.mass * values) / np.where(total > 0.0, total, 1.0))[grains.body]
    return np.where(alone, values, mean)


def reach(grains: Grains) -> tuple[Floats, Floats]:
    """Half the width and half the height of each element [m], shape (n,) each."""
    c, s = np.cos(grains.angle), np.sin(grains.angle)
    turned = np.hypot(grains.a * c, grains.b * s), np.hypot(grains.a * s, grains.b * c)
    disc = grains.a == grains.b
    return np.where(disc, grains.a, turned[0]), np.where(disc, grains.a, turned[1])


def axes(grains: Grains) -> tuple[Floats, Floats]:
    """Aspect ratio [-] and direction of the long axis [rad, -pi/2 to pi/2] of each grain, at its elements, shape (n,) each.

    They are those of the ellipse with the grain's second moments of mass, for an ellipse its own; a round grain has no direction: NaN.
    """
    x, y = centers(grains)
    dx, dy = grains.x - x, grains.y - y
    c2, s2 = np.cos(2.0 * grains.angle), np.sin(2.0 * grains.angle)
    lean = (
        grains.inertia * (grains.a**2 - grains.b**2) / (grains.a**2 + grains.b**2)
    )  # Sxx - Syy of an element along its own axes
    polar = _sums(grains, grains.inertia + grains.mass * (dx**2 + dy**2))
    difference = _sums(grains, lean * c2 + grains.mass * (dx**2 - dy**2))
    mixed = _sums(grains, lean * s2 + 2.0 * grains.mass * dx * dy)
    size = np.hypot(difference, mixed)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.sqrt((polar + size) / (polar - size))
        angle = np.where(size > ROUND * polar, 0.5 * np.arctan2(mixed, difference), np.nan)
    return ratio, angle


def _sums(grains: Grains, values: Floats) -> Floats:
    return np.asarray(np.bincount(grains.body, values)[grains.body], dtype=float)


def several(grains: Grains) -> Ints:
    """Indices of the elements that share their grain with others."""
    return np.flatnonzero(np.bincount(grains.body, minlength=1)[grains.body] > 1)


def open_arcs(x: Floats, y: Floats, radius: Floats) -> list[tuple[int, float, float]]:
    """Outline of the union of a few discs, (m,) each: arcs (disc, from, to) [rad], anticlockwise, to > from, that lie in no other disc.

    Of discs in the same place and of the same size only the first has an arc.
    """
    arcs = []
    discs = list(zip(x.tolist(), y.tolist(), radius.tolist(), strict=True))
    for k, (xk, yk, rk) in enumerate(discs):
        covered: list[tuple[float, float]] = []
        for other, (xo, yo, ro) in enumerate(discs):
            dx, dy = xo - xk, yo - yk
            distance = math.hypot(dx, dy)
            if other == k or distance >= rk + ro:
                continue
            inside = ro - rk - distance
            if inside > 0.0 or (inside == 0.0 and (distance > 0.0 or other < k)):
                covered = [(0.0, TURN)]
                break
            if rk - ro >= distance:
                continue
            half = math.acos(max(-1.0, min(1.0, (distance**2 + rk**2 - ro**2) / (2.0 * distance * rk))))
            start = (math.atan2(dy, dx) - half) % TURN
            covered.append((start, start + 2.0 * half))
        arcs += [(k, low, high) for low, high in _gaps(covered)]
    return arcs


def _gaps(covered: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """What intervals of a circle, from in [0, 2 pi) and to > from, leave free [rad]; the whole circle where there are none."""
    if not covered:
        return [(0.0, TURN)]
    ordered = sorted(covered)
    first = ordered[0][0]
    end, free = first, []
    for low, high in [*ordered, (first + TURN, first + TURN)]:
        if low > end:
            free.append((end, low))
        end = max(end, high)
    # An interval that begins late may reach over the start of the first ones.
    over = max(high for _, high in ordered) - TURN
    return [(max(low, over), high) for low, high in free if high > over]
