"""Vectors and symmetric matrices of three dimensions as tuples of numbers, which compiled code keeps in registers.

A symmetric matrix is written xx, yy, zz, xy, xz, yz, in tuples and in the rows of arrays (n, 6).
"""

from __future__ import annotations

import math

from dem_cli.jit import kernel


@kernel(inline=True)
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel(inline=True)
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel(inline=True)
def plus(a, s, b):
    """a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@kernel(inline=True)
def scaled(s, a):
    return s * a[0], s * a[1], s * a[2]


@kernel(inline=True)
def symmetric_times(m, a):
    """The symmetric matrix m times a."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[4] * a[2],
        m[3] * a[0] + m[1] * a[1] + m[5] * a[2],
        m[4] * a[0] + m[5] * a[1] + m[2] * a[2],
    )


@kernel(inline=True)
def symmetric_inverse(m):
    """Inverse of a symmetric positive definite matrix, by cofactors."""
    xx = m[1] * m[2] - m[5] * m[5]
    xy = m[5] * m[4] - m[3] * m[2]
    xz = m[3] * m[5] - m[1] * m[4]
    over = 1.0 / (m[0] * xx + m[3] * xy + m[4] * xz)
    yy = m[0] * m[2] - m[4] * m[4]
    yz = m[3] * m[4] - m[0] * m[5]
    zz = m[0] * m[1] - m[3] * m[3]
    return xx * over, yy * over, zz * over, xy * over, xz * over, yz * over


@kernel(inline=True)
def across(n):
    """A unit vector at right angles to the unit vector n."""
    if abs(n[0]) < 0.6:
        length = math.sqrt(n[1] * n[1] + n[2] * n[2])
        return 0.0, n[2] / length, -n[1] / length
    length = math.sqrt(n[0] * n[0] + n[1] * n[1])
    return n[1] / length, -n[0] / length, 0.0


@kernel(inline=True)
def turned(q, a):
    """The vector a turned by the unit quaternion q: w, x, y, z."""
    u = (q[1], q[2], q[3])
    t = scaled(2.0, cross(u, a))
    return plus(plus(a, q[0], t), 1.0, cross(u, t))


@kernel(inline=True)
def turned_back(q, a):
    """The vector a turned by the inverse of the unit quaternion q."""
    return turned((q[0], -q[1], -q[2], -q[3]), a)


@kernel(inline=True)
def after_turn(q, w, h):
    """The quaternion q after a turn with angular velocity w [rad/s] over h [s], of unit length."""
    speed = math.sqrt(dot(w, w))
    half = 0.5 * h * speed
    factor = math.sin(half) / speed if speed > 0.0 else 0.5 * h
    c, s = math.cos(half), scaled(factor, w)
    v = (q[1], q[2], q[3])
    first = c * q[0] - dot(s, v)
    rest = plus(plus(scaled(c, v), q[0], s), 1.0, cross(s, v))
    over = 1.0 / math.sqrt(first * first + dot(rest, rest))
    return first * over, rest[0] * over, rest[1] * over, rest[2] * over
