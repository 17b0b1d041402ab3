"""Do grains overlap? Tests of single grains against the grains around them, found through a grid of cells.

`placed` (elements, 6) holds every element where it is now: centre x, y [m], outline m, p, q [m^2] (geometry/ellipse.py) and a [m].
`bodies` is a `Bodies`. The cells of `head`, `following`, `before` are chains of grains by their origins: head (columns, rows).
"""

from __future__ import annotations

import math

import numpy as np

from dem_cli.geometry.ellipse import gap_slopes, outline, widest_gap
from dem_cli.jit import kernel

X, Y, M, P, Q, A = range(6)
PLACED = 6


@kernel()
def place(bodies, k, x, y, angle, scale, swell, placed, row):
    """Writes the elements of grain k, its origin at (x, y), to rows of `placed` from `row` on.

    scale: of the whole grain. swell: elements are larger by this share, their centres stay.
    """
    c, s = math.cos(angle), math.sin(angle)
    for e in range(bodies.start[k], bodies.start[k + 1]):
        ox, oy, size = scale * bodies.ox[e], scale * bodies.oy[e], scale * (1.0 + swell)
        placed[row, X] = x + c * ox - s * oy
        placed[row, Y] = y + s * ox + c * oy
        m, p, q = outline(size * bodies.a[e], size * bodies.b[e], angle + bodies.turn[e])
        placed[row, M], placed[row, P], placed[row, Q], placed[row, A] = m, p, q, size * bodies.a[e]
        row += 1


@kernel()
def place_all(bodies, x, y, angle, scale, swell, placed):
    """Writes all elements; scale (g,)."""
    for k in range(x.size):
        place(bodies, k, x[k], y[k], angle[k], scale[k], swell, placed, bodies.start[k])


@kernel()
def extents(placed, first, end):
    """Smallest and largest x and y [m] of the elements first:end."""
    left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
    for e in range(first, end):
        hx, hy = math.sqrt(placed[e, M] + placed[e, P]), math.sqrt(placed[e, M] - placed[e, P])
        left, right = min(left, placed[e, X] - hx), max(right, placed[e, X] + hx)
        bottom, top = min(bottom, placed[e, Y] - hy), max(top, placed[e, Y] + hy)
    return left, right, bottom, top


@kernel()
def separate(one, i, two, j):
    """Whether element i of `one` and element j of `two` do not overlap; `one` and `two` are like `placed`."""
    dx, dy = two[j, X] - one[i, X], two[j, Y] - one[i, Y]
    square, reach = dx * dx + dy * dy, one[i, A] + two[j, A]
    if square >= reach * reach:
        return True
    pi, qi, pj, qj = one[i, P], one[i, Q], two[j, P], two[j, Q]
    mi, mj = one[i, M], two[j, M]
    if pi == 0.0 and qi == 0.0 and pj == 0.0 and qj == 0.0:
        return False
    inner = math.sqrt(max(mi - math.hypot(pi, qi), 0.0)) + math.sqrt(max(mj - math.hypot(pj, qj), 0.0))
    if square <= inner * inner:
        return False
    # The gap f(n) as a function of vectors n of any length is concave, so f(w) <= grad f(n).w. A direction w that separates the two lies within
    # acos(inner / distance) of the line of centres: where grad f(n).w <= 0 at both ends of that fan there is none.
    distance = math.sqrt(square)
    cx, cy = dx / distance, dy / distance
    along, aside = inner / distance, math.sqrt(max(1.0 - inner * inner / square, 0.0))
    nx, ny = cx, cy
    for _ in range(8):
        g, g1, g2 = gap_slopes(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny)
        if g >= 0.0:
            return True
        fx, fy = g * nx - g1 * ny, g * ny + g1 * nx
        middle, across = along * (fx * cx + fy * cy), aside * (fy * cx - fx * cy)
        if middle + across <= 0.0 and middle - across <= 0.0:
            return False
        if g2 >= 0.0:
            break
        turn = min(max(-g1 / g2, -0.5), 0.5)
        length = math.sqrt(1.0 + turn * turn)
        nx, ny = (nx - turn * ny) / length, (ny + turn * nx) / length
    return widest_gap(dx, dy, mi, pi, qi, mj, pj, qj, 0.0, 0.0)[2] >= 0.0


@kernel()
def cell_of(x, y, cell, columns, rows):
    """Column and row of a point; points beyond the grid belong to its border."""
    return (
        min(max(math.floor(x / cell), 0), columns - 1),
        min(max(math.floor(y / cell), 0), rows - 1),
    )


@kernel()
def link(k, column, row, head, following, before):
    """Puts grain k at the head of a cell's chain."""
    following[k], before[k] = head[column, row], -1
    if head[column, row] >= 0:
        before[head[column, row]] = k
    head[column, row] = k


@kernel()
def unlink(k, column, row, head, following, before):
    """Takes grain k out of the chain of its cell."""
    if before[k] >= 0:
        following[before[k]] = following[k]
    else:
        head[column, row] = following[k]
    if following[k] >= 0:
        before[following[k]] = before[k]


@kernel()
def link_all(members, x, y, cell, head, following, before):
    """Chains of the grains of `members`."""
    head[:] = -1
    for k in members:
        column, row = cell_of(x[k], y[k], cell, head.shape[0], head.shape[1])
        link(k, column, row, head, following, before)


@kernel()
def is_free(bodies, k, trial, tx, ty, x, y, placed, cell, head, following, largest):
    """Whether grain k, its elements in `trial` from row 0 on and its origin at (tx, ty), overlaps no other grain of the cells.

    largest [m]: the largest reach of a grain.
    """
    own, elements = bodies.reach[k], bodies.start[k + 1] - bodies.start[k]
    around = own + largest
    left, bottom = cell_of(tx - around, ty - around, cell, head.shape[0], head.shape[1])
    right, top = cell_of(tx + around, ty + around, cell, head.shape[0], head.shape[1])
    for column in range(left, right + 1):
        for row in range(bottom, top + 1):
            g = head[column, row]
            while g >= 0:
                if g != k:
                    dx, dy, reach = x[g] - tx, y[g] - ty, own + bodies.reach[g]
                    if dx * dx + dy * dy < reach * reach:
                        for i in range(elements):
                            for j in range(bodies.start[g], bodies.start[g + 1]):
                                if not separate(trial, i, placed, j):
                                    return False
                g = following[g]
    return True
