"""Unit quaternions w, x, y, z as tuples, which turn vectors of the body's frame into the container's."""

from __future__ import annotations

import math

from dem_cli.engines.impulse.vectors import along, cross, dot, times
from dem_cli.jit import kernel


@kernel(inline=True, inner=True)
def turned(q, a):
    """The vector a turned by the unit quaternion q: w, x, y, z."""
    u = (q[1], q[2], q[3])
    t = times(cross(u, a), 2.0)
    return along(along(a, t, q[0]), cross(u, t), 1.0)


@kernel(inline=True, inner=True)
def turned_back(q, a):
    """The vector a turned by the inverse of the unit quaternion q."""
    return turned((q[0], -q[1], -q[2], -q[3]), a)


@kernel(inline=True, inner=True)
def after_turn(q, w, h):
    """The quaternion q after a turn with angular velocity w [rad/s] over h [s], of unit length."""
    speed = math.sqrt(dot(w, w))
    half = 0.5 * h * speed
    factor = math.sin(half) / speed if speed > 0.0 else 0.5 * h
    c, s = math.cos(half), times(w, factor)
    v = (q[1], q[2], q[3])
    first = c * q[0] - dot(s, v)
    rest = along(along(times(v, c), s, q[0]), cross(s, v), 1.0)
    over = 1.0 / math.sqrt(first * first + dot(rest, rest))
    return first * over, rest[0] * over, rest[1] * over, rest[2] * over
