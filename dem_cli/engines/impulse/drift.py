"""Free flight of rigid bodies: straight on, and turning with constant angular momentum."""

from __future__ import annotations

from dem_cli.engines.impulse.quaternions import after_turn, turned, turned_back
from dem_cli.jit import kernel


@kernel()
def drift(h, present, x, q, velocity, inertia):
    """Moves bodies on for h [s]; x (n, 3), q (n, 4), velocity (n + 1, 6) are changed in place.

    The angular momentum L = R I R' w is kept, not w: an asymmetric body turns by the midpoint rule, q' = exp(h w_m) q with
    w_m = I(q_m)^-1 L halfway, then w' = I(q')^-1 L. present (n,): bodies that are moved. inertia (n, 3): principal moments [kg m^2].
    """
    for k in range(len(q)):
        if not present[k]:
            continue
        for axis in range(3):
            x[k, axis] += h * velocity[k, axis]
        w = (velocity[k, 3], velocity[k, 4], velocity[k, 5])
        if w[0] == 0.0 and w[1] == 0.0 and w[2] == 0.0:
            continue
        old = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        moments = (inertia[k, 0], inertia[k, 1], inertia[k, 2])
        if moments[0] == moments[1] and moments[1] == moments[2]:
            new = after_turn(old, w, h)
        else:
            own = turned_back(old, w)
            momentum = turned(old, (moments[0] * own[0], moments[1] * own[1], moments[2] * own[2]))
            middle = spin_of(after_turn(old, w, 0.5 * h), moments, momentum)
            new = after_turn(old, middle, h)
            w = spin_of(new, moments, momentum)
        for axis in range(4):
            q[k, axis] = new[axis]
        for axis in range(3):
            velocity[k, 3 + axis] = w[axis]


@kernel(inline=True)
def spin_of(q, moments, momentum):
    """Angular velocity [rad/s] that the angular momentum [kg m^2/s] means at the orientation q."""
    own = turned_back(q, momentum)
    return turned(q, (own[0] / moments[0], own[1] / moments[1], own[2] / moments[2]))


@kernel()
def turn_inverse(present, q, mass, inertia, inverse):
    """What a unit impulse does to each body: inverse (n + 1, 7) is overwritten by 1/m and R I^-1 R' (xx, yy, zz, xy, xz, yz).

    Rows of absent bodies, and the last row, which stands for all that never moves, are zero.
    """
    inverse[:] = 0.0
    for k in range(len(q)):
        if not present[k]:
            continue
        one = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        inverse[k, 0] = 1.0 / mass[k]
        for axis in range(3):
            unit = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
            e = turned(one, unit)
            over = 1.0 / inertia[k, axis]
            inverse[k, 1] += over * e[0] * e[0]
            inverse[k, 2] += over * e[1] * e[1]
            inverse[k, 3] += over * e[2] * e[2]
            inverse[k, 4] += over * e[0] * e[1]
            inverse[k, 5] += over * e[0] * e[2]
            inverse[k, 6] += over * e[1] * e[2]


@kernel(inner=True)
def turning_energy(k, inertia, q, velocity):
    """Kinetic energy [J] of the rotation of body k."""
    own = turned_back((q[k, 0], q[k, 1], q[k, 2], q[k, 3]), (velocity[k, 3], velocity[k, 4], velocity[k, 5]))
    return 0.5 * (inertia[k, 0] * own[0] ** 2 + inertia[k, 1] * own[1] ** 2 + inertia[k, 2] * own[2] ** 2)


@kernel()
def kinetic_energy(present, mass, inertia, q, velocity):
    """Kinetic energy [J] of the centres of mass, and of rotation."""
    moving, turning = 0.0, 0.0
    for k in range(len(q)):
        if present[k]:
            v = velocity[k]
            moving += 0.5 * mass[k] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            turning += turning_energy(k, inertia, q, velocity)
    return moving, turning
