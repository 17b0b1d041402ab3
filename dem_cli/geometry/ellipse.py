"""Ellipses and what they touch: support functions, and the direction in which the gap between two outlines is largest.

An outline is (m, p, q) [m^2] with m = (a^2 + b^2)/2, p = (a^2 - b^2)/2 cos 2 theta, q = (a^2 - b^2)/2 sin 2 theta; a disc has p = q = 0 and
a point (0, 0, 0). In the unit direction n it reaches h = sqrt(n.A n), h^2 = m + p (nx^2 - ny^2) + q 2 nx ny, at the point h n + h' t,
t = (-ny, nx). The gap of two convex outlines is the largest n.delta - h_i(n) - h_j(n) over all n, delta from centre i to centre j;
below zero its size is the overlap. Nothing here is singular for a = b.
"""

from __future__ import annotations

import math

import numpy as np

from dem_cli.geometry.lanes import root
from dem_cli.jit import kernel

SAMPLES = 64  # directions of the search; the narrowest peak of an ellipse of aspect ratio 5 is some four of them wide
NEAR = 0.2  # rad: a known direction that moves further than this is not trusted
TRUSTED = 0.01  # rad: further than this is trusted only where the gap is open
CLOSE = 1e-9  # rad: Newton's method squares its error, so one step from here is exact


@kernel(inline=True)
def outline(a, b, angle):
    """(m, p, q) [m^2] of semi-axes a, b [m], a turned anticlockwise by `angle` [rad] from +x."""
    half = 0.5 * (a - b) * (a + b)
    return 0.5 * (a * a + b * b), half * math.cos(2.0 * angle), half * math.sin(2.0 * angle)


@kernel(inline=True)
def support(m, p, q, nx, ny):
    """h, h' and h'' [m] in the unit direction n, primes by the angle of n; arguments are floats or Lanes, not a point's."""
    c, s = nx * nx - ny * ny, 2.0 * nx * ny
    along, across = p * c + q * s, q * c - p * s
    h = root(m + along)
    inverse = 1.0 / h
    h1 = across * inverse
    return h, h1, -(2.0 * along + h1 * h1) * inverse


@kernel()
def gap_slopes(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny):
    """n.delta - h_i - h_j and its first two derivatives by the angle of n [m]; either outline may be a point."""
    g, g1, g2 = dx * nx + dy * ny, dy * nx - dx * ny, -(dx * nx + dy * ny)
    if mi > 0.0:
        h, h1, h2 = support(mi, pi, qi, nx, ny)
        g, g1, g2 = g - h, g1 - h1, g2 - h2
    if mj > 0.0:
        h, h1, h2 = support(mj, pj, qj, nx, ny)
        g, g1, g2 = g - h, g1 - h1, g2 - h2
    return g, g1, g2


@kernel()
def _climb(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny, reach):
    """The maximum of the gap within `reach` [rad] of n: Newton's method, halving the bracket where it fails.

    Once a step is as small as CLOSE the next would be lost in rounding, and the gap itself is too flat to tell which is best.
    Returns (nx, ny, gap, angle from the start [rad]).
    """
    low, high, angle, x, y, gap = -reach, reach, 0.0, nx, ny, 0.0
    for _ in range(60):
        gap, g1, g2 = gap_slopes(dx, dy, mi, pi, qi, mj, pj, qj, x, y)
        if g1 > 0.0:
            low = angle
        else:
            high = angle
        new = angle - g1 / g2 if g2 < 0.0 else 2.0 * reach
        last = abs(new - angle) <= CLOSE
        if last:
            gap += 0.5 * g1 * (new - angle)
        elif not low < new < high:
            new = 0.5 * (low + high)
        angle = new
        c, s = math.cos(angle), math.sin(angle)
        x, y = nx * c - ny * s, nx * s + ny * c
        if last:
            break
    return x, y, gap, angle


@kernel()
def widest_gap(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny):
    """Unit direction of the largest gap between two outlines, and the gap [m].

    dx, dy: from centre i to centre j [m], not both 0; nx, ny: a direction known to be near, or (0, 0): then, and where the known one proves to
    be far off, all directions are searched. Returns (nx, ny, gap).

    An open gap has one maximum only, since n.delta - h_i - h_j is concave over the plane. Outlines that overlap have others, deep ones, at
    more than 90 degrees from it.
    """
    if nx * nx + ny * ny > 0.0:
        x, y, gap, moved = _climb(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny, 2.0 * NEAR)
        if abs(moved) < TRUSTED or (abs(moved) < NEAR and gap > 0.0):
            return x, y, gap
    step = 2.0 * math.pi / SAMPLES
    distance = math.sqrt(dx * dx + dy * dy)
    x0, y0 = dx / distance, dy / distance
    best, bx, by = -np.inf, x0, y0
    for k in range(SAMPLES):
        c, s = math.cos(k * step), math.sin(k * step)
        x, y = x0 * c - y0 * s, x0 * s + y0 * c
        g, _, _ = gap_slopes(dx, dy, mi, pi, qi, mj, pj, qj, x, y)
        if g > best:
            best, bx, by = g, x, y
    x, y, gap, _ = _climb(dx, dy, mi, pi, qi, mj, pj, qj, bx, by, step)
    return x, y, gap


@kernel()
def wall_gap(x, y, m, p, q, x0, y0, x1, y1):
    """Direction from a centre (x, y) in which the gap to a wall, the segment from (x0, y0) to (x1, y1), is largest, and the gap [m].

    In each direction the end that is reached first counts. So the largest gap is that of the face where the point of the outline that
    reaches furthest lies beside the wall, or that of an end, seen in a direction in which it is the nearer one.
    """
    ex, ey = x1 - x0, y1 - y0
    length = math.sqrt(ex * ex + ey * ey)
    ex, ey = ex / length, ey / length
    dx, dy = x0 - x, y0 - y
    distance = -dx * ey + dy * ex
    side = 1.0 if distance >= 0.0 else -1.0
    nx, ny = -side * ey, side * ex
    h, h1, _ = support(m, p, q, nx, ny)
    foot = -(dx * ex + dy * ey)
    along, gap = foot + h1 * (-ny * ex + nx * ey), side * distance - h
    beside = 0.0 <= along <= length
    # No end is within reach where the whole outline lies beside the wall: its circle has a radius of less than sqrt(2 m).
    inner = min(foot, length - foot)
    if beside and (gap >= 0.0 or (inner > 0.0 and inner * inner >= 2.0 * m)):
        return nx, ny, gap
    if not beside:
        gap = -np.inf
    for end in range(2):
        if end == 1:
            dx, dy = x1 - x, y1 - y
        if dx * dx + dy * dy > 0.0:
            ux, uy, open_by = widest_gap(dx, dy, m, p, q, 0.0, 0.0, 0.0, 0.0, 0.0)
            onwards = ux * ex + uy * ey
            if open_by > gap and (onwards >= 0.0 if end == 0 else onwards <= 0.0):
                nx, ny, gap = ux, uy, open_by
    if gap == -np.inf:
        gap = side * distance - h
    return nx, ny, gap
