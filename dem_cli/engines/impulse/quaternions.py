"""Unit quaternions w, x, y, z as tuples, which turn vectors of the body's frame into the container's."""

from __future__ import annotations

import math

from dem_cli.engines.impulse.vectors import cross, dot, plus, scaled
from dem_cli.jit import kernel


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
