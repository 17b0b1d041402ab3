"""How grains move under their forces: leapfrog and the thesis' scheme, extra damping, and what leaves the container.

Rows and units are those of `forces.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.explicit.forces import ARC, FX, FY, MOBILITY, RATIO, ROW, TURN, Q, R, U, V, X, Y
from dem_cli.geometry.lanes import first_half_last, last_half_first, maximum, pack, spread, unpack
from dem_cli.geometry.rows import load, store
from dem_cli.jit import kernel

LEAPFROG, THESIS = 0, 1


class Motion(NamedTuple):
    """How grains move besides their contacts.

    field: (steps + 1, 2) acceleration of the body force at each step, gravity included [m/s^2]; driving: the part of it whose work enters
    the ledger, the same shape, or (0, 2) where there is none; mass_damping [1/s] and local_damping [-] (Cundall's): extra damping;
    integrator: LEAPFROG or THESIS.
    """

    field: np.ndarray
    driving: np.ndarray
    mass_damping: float
    local_damping: float
    integrator: int


class Box(NamedTuple):
    """Where grains count as inside [m]: one that is wholly left, right or below has escaped."""

    left: float
    right: float
    bottom: float


@kernel()
def move(rows, begin, end, kick, fx, fy):
    """Leapfrog of the grains begin..end-1 without extra damping: velocities by `kick` steps of force, positions by one step.

    fx, fy: acceleration of the body force times dt^2 [m]. Forces are set to zero; grains without mobility stay.
    Returns the largest squared displacement [m^2].
    """
    body, most = pack(0.0, 0.0, fx, fy), spread(0.0)
    for i in range(begin, end):
        a = ROW * i
        mobility, ratio = rows[a + MOBILITY], rows[a + RATIO]
        share = kick if mobility > 0.0 else 0.0
        row = load(rows, a)
        row = row + share * (mobility * first_half_last(load(rows, a + FX)) + body)
        step = last_half_first(row)
        q = rows[a + Q] + share * (ratio * mobility) * rows[a + TURN]
        store(rows, a, row + step)
        rows[a + Q] = q
        rows[a + ARC] += q
        store(rows, a + FX, pack(0.0, 0.0, ratio, 0.0))
        most = maximum(step * step, most)
    # An array of its own keeps this loop from being merged into `advance`, where LLVM makes it half as fast.
    squares = np.empty(4)
    store(squares, 0, most)
    return squares[0] + squares[1]


@kernel()
def push(rows, velocity, begin, end, kick, fx, fy, motion, dt):
    """New velocities of the grains begin..end-1, with extra damping and for either integrator; not written for speed.

    velocity: (n, 3) u dt, v dt, q of the thesis' scheme, which keeps them apart from the displacements of the last step: they are
    taken into the rows here. Mass damping acts as -c m x' (thesis (3.13)), local damping as a force of a share of the resultant, against the
    motion (Cundall). Returns the energy lost to damping over kn [m^2].
    """
    lost = 0.0
    rate = motion.mass_damping * dt
    for i in range(begin, end):
        a = ROW * i
        mobility = rows[a + MOBILITY]
        if mobility == 0.0:
            continue
        turnable = rows[a + RATIO] * mobility
        pushes = (mobility * rows[a + FX] + fx, mobility * rows[a + FY] + fy, turnable * rows[a + TURN])
        for c in range(3):
            inertia = 1.0 / turnable if c == 2 else 1.0 / mobility
            old = velocity[i, c] if motion.integrator == THESIS else rows[a + U + c]
            drag = rate * old + motion.local_damping * abs(pushes[c]) * np.sign(old)
            new = old + kick * (pushes[c] - drag)
            lost += inertia * kick * drag * 0.5 * (old + new)
            rows[a + U + c] = new
    return lost


@kernel()
def motions(rows, velocity, begin, end, thesis):
    """Velocities that `push` begins with, (end - begin, 3)."""
    out = np.empty((end - begin, 3))
    for i in range(begin, end):
        for c in range(3):
            out[i - begin, c] = velocity[i, c] if thesis else rows[ROW * i + U + c]
    return out


@kernel()
def drag_on_bonded(rows, old, pushed, begin, end, kick, fx, fy):
    """What `push` could not know: energy lost to extra damping over kn [m^2] since bonds changed its velocities once more.

    old, pushed (end - begin, 3): velocities before and after `push`; the drag acts over the mean of the old and the final ones.
    """
    lost = 0.0
    for i in range(begin, end):
        a = ROW * i
        mobility = rows[a + MOBILITY]
        if mobility == 0.0:
            continue
        turnable = rows[a + RATIO] * mobility
        pushes = (mobility * rows[a + FX] + fx, mobility * rows[a + FY] + fy, turnable * rows[a + TURN])
        for c in range(3):
            inertia = 1.0 / turnable if c == 2 else 1.0 / mobility
            drag = old[i - begin, c] + kick * pushes[c] - pushed[i - begin, c]
            lost += inertia * drag * 0.5 * (rows[a + U + c] - pushed[i - begin, c])
    return lost


@kernel()
def drift(rows, velocity, begin, end, thesis):
    """Positions of the grains begin..end-1 after a step with the velocities of `push`; forces are set to zero.

    The thesis (3.16), (3.17): velocity by forward Euler, position by the mean of the old and the new velocity; it gains energy.
    Returns the largest squared displacement [m^2].
    """
    fastest = 0.0
    for i in range(begin, end):
        a = ROW * i
        if rows[a + MOBILITY] == 0.0:
            continue
        if thesis:
            for c in range(3):
                old, new = velocity[i, c], rows[a + U + c]
                velocity[i, c] = new
                rows[a + U + c] = 0.5 * (old + new)
        rows[a + X] += rows[a + U]
        rows[a + Y] += rows[a + V]
        rows[a + ARC] += rows[a + Q]
        rows[a + FX] = rows[a + FY] = rows[a + TURN] = 0.0
        fastest = max(fastest, rows[a + U] ** 2 + rows[a + V] ** 2)
    return fastest


@kernel()
def mass_moved(rows, mass, n):
    """Sum of mass times displacement of the last step, (x, y) [kg m]; grains that have left do not move."""
    even, odd = spread(0.0), spread(0.0)
    for i in range(0, n - 1, 2):
        even = even + load(rows, ROW * i) * mass[i]
        odd = odd + load(rows, ROW * (i + 1)) * mass[i + 1]
    if n % 2 == 1:
        even = even + load(rows, ROW * (n - 1)) * mass[n - 1]
    _, _, x, y = unpack(even + odd)
    return x, y


@kernel()
def _outside(rows, radius, i, box):
    x, y = rows[ROW * i + X], rows[ROW * i + Y]
    return x < box.left - radius[i] or x > box.right + radius[i] or y < box.bottom - radius[i]


@kernel()
def let_go(rows, mass, inertia, reach, alive, box, gravity, dt, body, cores):
    """Take grains that have wholly left the box out of the motion: they stay where they are, and their energy is returned [J]."""
    i, energy = 0, 0.0
    while i < reach.size:
        end = i + 1
        gone = alive[i] and _outside(rows, reach, i, box)
        if body is not None:
            while end < reach.size and body[end] == body[i]:
                gone = gone and _outside(rows, reach, end, box)
                end += 1
        if gone:
            for k in range(i, end):
                a = ROW * k
                alive[k] = False
                # Half a kick brings the velocity to the instant of the position.
                u, v = rows[a + U] + 0.5 * dt * dt * gravity[0], rows[a + V] + 0.5 * dt * dt * gravity[1]
                swing = mass[k] * (u**2 + v**2) + inertia[k] * (rows[a + Q] / rows[a + R]) ** 2
                height = gravity[0] * rows[a + X] + gravity[1] * rows[a + Y]
                energy += 0.5 * swing / (dt * dt) - mass[k] * height
                rows[a + U] = rows[a + V] = rows[a + Q] = rows[a + MOBILITY] = 0.0
            if cores is not None:
                c = ROW * body[i]
                cores.rows[c + U] = cores.rows[c + V] = cores.rows[c + Q] = cores.rows[c + MOBILITY] = 0.0
        i = end
    return energy
