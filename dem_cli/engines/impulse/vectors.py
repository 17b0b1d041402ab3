"""Vectors of three numbers and turns of nine (row by row) as tuples, for kernels."""

from __future__ import annotations

import math

from dem_cli.engines.impulse.arrays import CENTER, SCALE, TURN
from dem_cli.jit import kernel


@kernel(inline=True, inner=True)
def row(a, k, c):
    """Row k of array a from column c on."""
    return a[k, c], a[k, c + 1], a[k, c + 2]


@kernel(inline=True, inner=True)
def add(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel(inline=True, inner=True)
def sub(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel(inline=True, inner=True)
def times(a, s):
    return a[0] * s, a[1] * s, a[2] * s


@kernel(inline=True, inner=True)
def along(a, d, s):
    """a + s d"""
    return a[0] + d[0] * s, a[1] + d[1] * s, a[2] + d[2] * s


@kernel(inline=True, inner=True)
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel(inline=True, inner=True)
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel(inline=True, inner=True)
def turned(m, v):
    """m v"""
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    )


@kernel(inline=True, inner=True)
def turned_back(m, v):
    """m^T v"""
    return (
        m[0] * v[0] + m[3] * v[1] + m[6] * v[2],
        m[1] * v[0] + m[4] * v[1] + m[7] * v[2],
        m[2] * v[0] + m[5] * v[1] + m[8] * v[2],
    )


@kernel(inline=True, inner=True)
def turn_of(placed, i):
    f = placed.frame
    return (
        f[i, TURN], f[i, TURN + 1], f[i, TURN + 2], f[i, TURN + 3], f[i, TURN + 4], f[i, TURN + 5],
        f[i, TURN + 6], f[i, TURN + 7], f[i, TURN + 8],
    )  # fmt: skip


@kernel(inline=True, inner=True)
def to_world(placed, i, p):
    """Place of a point of body i's frame of scale 1."""
    return along(row(placed.frame, i, CENTER), turned(turn_of(placed, i), p), placed.frame[i, SCALE])


@kernel(inner=True)
def relative(placed, a, b):
    """Body a's frame seen from body b's, both of scale 1: (m (9,), t (3,), f) with p_b = f m p_a + t."""
    ta, tb = turn_of(placed, a), turn_of(placed, b)
    x = turned_back(tb, (ta[0], ta[3], ta[6]))
    y = turned_back(tb, (ta[1], ta[4], ta[7]))
    z = turned_back(tb, (ta[2], ta[5], ta[8]))
    m = (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])
    t = times(
        turned_back(tb, sub(row(placed.frame, a, CENTER), row(placed.frame, b, CENTER))), 1.0 / placed.frame[b, SCALE]
    )
    return m, t, placed.frame[a, SCALE] / placed.frame[b, SCALE]


@kernel(inline=True, inner=True)
def placed_at(relation, p):
    """Point p of a's frame in b's, of the `relative` of a and b."""
    return along(relation[1], turned(relation[0], p), relation[2])


@kernel()
def set_turns(placed, x, q, n):
    """Write x (n, 3) and the matrices of the quaternions q (n, 4) of the first n bodies into `placed`."""
    f = placed.frame
    for i in range(n):
        w, a, b, c = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        f[i, CENTER], f[i, CENTER + 1], f[i, CENTER + 2] = x[i, 0], x[i, 1], x[i, 2]
        f[i, TURN], f[i, TURN + 4], f[i, TURN + 8] = (
            1.0 - 2.0 * (b * b + c * c), 1.0 - 2.0 * (a * a + c * c), 1.0 - 2.0 * (a * a + b * b),
        )  # fmt: skip
        f[i, TURN + 1], f[i, TURN + 3] = 2.0 * (a * b - w * c), 2.0 * (a * b + w * c)
        f[i, TURN + 2], f[i, TURN + 6] = 2.0 * (a * c + w * b), 2.0 * (a * c - w * b)
        f[i, TURN + 5], f[i, TURN + 7] = 2.0 * (b * c - w * a), 2.0 * (b * c + w * a)


@kernel(inline=True, inner=True)
def across(n):
    """A unit vector at right angles to the unit vector n."""
    if abs(n[0]) < 0.6:
        length = math.sqrt(n[1] * n[1] + n[2] * n[2])
        return 0.0, n[2] / length, -n[1] / length
    length = math.sqrt(n[0] * n[0] + n[1] * n[1])
    return n[1] / length, -n[0] / length, 0.0
