"""The steps of the explicit DEM between two outputs, in one compiled loop.

Rows and units are those of `forces.py`. The state enters and leaves with positions, velocities and forces of the same instant:
leapfrog kicks by half a step first and last, so that a run may change its time step between two outputs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.explicit.forces import (
    ARC,
    CHUNK,
    FX,
    FY,
    MOBILITY,
    ROW,
    TURN,
    Q,
    U,
    V,
    X,
    Y,
    pair_forces,
    wall_forces,
)
from dem_cli.engines.explicit.lists import (
    FINE,
    NOT_A_NUMBER,
    inner_pairs,
    inner_walls,
    not_finite,
    outer_lists,
    remember,
)
from dem_cli.geometry.lanes import first_half_last, last_half_first, load, maximum, pack, spread, store, unpack
from dem_cli.jit import kernel

LEAPFROG, THESIS = 0, 1
# Entries of the ledger that the loop adds up [J]
DASHPOT_N, DASHPOT_S, FRICTION, TIME_STEP, DAMPING, WORK, ESCAPED, LEDGER = 0, 1, 2, 3, 4, 5, 6, 7
DISC_INERTIA = 2.0  # m r^2 / I


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
        mobility = rows[a + MOBILITY]
        share = kick if mobility > 0.0 else 0.0
        row = load(rows, a)
        row = row + share * (mobility * first_half_last(load(rows, a + FX)) + body)
        step = last_half_first(row)
        q = rows[a + Q] + share * (DISC_INERTIA * mobility) * rows[a + TURN]
        store(rows, a, row + step)
        rows[a + Q] = q
        rows[a + ARC] += q
        store(rows, a + FX, spread(0.0))
        most = maximum(step * step, most)
    # An array of its own keeps this loop from being merged into `advance`, where LLVM makes it half as fast.
    squares = np.empty(4)
    store(squares, 0, most)
    return squares[0] + squares[1]


@kernel()
def move_general(rows, velocity, begin, end, kick, drift, fx, fy, motion, dt):
    """Like `move`, with extra damping and the thesis' integrator, and with or without the drift; not written for speed.

    velocity: (n, 3) u dt, v dt, q of the thesis' scheme, which keeps them apart from the displacements of the last step.
    Mass damping acts as -c m x' (thesis (3.13)), local damping as a force of a share of the resultant, against the motion (Cundall).
    The thesis (3.16), (3.17): velocity by forward Euler, position by the mean of the old and the new velocity; it gains energy.
    Without drift positions stay and forces are kept. Returns (largest squared displacement [m^2], energy lost to damping / kn [m^2]).
    """
    fastest, lost = 0.0, 0.0
    rate = motion.mass_damping * dt
    thesis = motion.integrator == THESIS
    for i in range(begin, end):
        a = ROW * i
        mobility = rows[a + MOBILITY]
        if mobility == 0.0:
            continue
        pushes = (
            mobility * rows[a + FX] + fx,
            mobility * rows[a + FY] + fy,
            DISC_INERTIA * mobility * rows[a + TURN],
        )
        for c in range(3):
            inertia = 1.0 / (DISC_INERTIA * mobility) if c == 2 else 1.0 / mobility
            old = velocity[i, c] if thesis else rows[a + U + c]
            drag = rate * old + motion.local_damping * abs(pushes[c]) * np.sign(old)
            new = old + kick * (pushes[c] - drag)
            lost += inertia * kick * drag * 0.5 * (old + new)
            if thesis:
                velocity[i, c] = new
            rows[a + U + c] = 0.5 * (old + new) if thesis else new
        if drift:
            rows[a + X] += rows[a + U]
            rows[a + Y] += rows[a + V]
            rows[a + ARC] += rows[a + Q]
            rows[a + FX] = rows[a + FY] = rows[a + TURN] = 0.0
            fastest = max(fastest, rows[a + U] ** 2 + rows[a + V] ** 2)
    return fastest, lost


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
def _work(rows, mass, motion, s, ledger):
    """Add the work of the driving part of the body force over the displacement of step s to the ledger."""
    px, py = mass_moved(rows, mass, mass.size)
    after = s if motion.integrator == THESIS else s + 1
    ledger[WORK] += 0.5 * (motion.driving[s, 0] + motion.driving[after, 0]) * px
    ledger[WORK] += 0.5 * (motion.driving[s, 1] + motion.driving[after, 1]) * py


@kernel()
def _let_go(rows, mass, radius, alive, box, gravity, dt, kn, ledger):
    """Take grains that have left the box out of the motion: they stay where they are, and their energy goes to ESCAPED."""
    for i in range(radius.size):
        a = ROW * i
        x, y = rows[a + X], rows[a + Y]
        if alive[i] and (x < box.left - radius[i] or x > box.right + radius[i] or y < box.bottom - radius[i]):
            alive[i] = False
            # Half a kick brings the velocity to the instant of the position.
            u, v = rows[a + U] + 0.5 * dt * dt * gravity[0], rows[a + V] + 0.5 * dt * dt * gravity[1]
            swing = u**2 + v**2 + rows[a + Q] ** 2 / DISC_INERTIA
            ledger[ESCAPED] += 0.5 * kn / rows[a + MOBILITY] * swing - mass[i] * (gravity[0] * x + gravity[1] * y)
            rows[a + U] = rows[a + V] = rows[a + Q] = rows[a + MOBILITY] = 0.0


@kernel()
def _next_inner_skin(fastest, skin, radius_mean):
    """Inner skin that balances remaking the list against walking it: measured best near 0.9 sqrt(step's displacement x radius)."""
    return min(max(0.9 * np.sqrt(np.sqrt(fastest) * radius_mean), 1e-3 * radius_mean), 0.5 * skin)


@kernel()
def advance(
    rows, velocity, mass, radius, alive, lists, travelled, walls, law, motion, kn, dt, skin, deepest, box, ledger
):
    """Advance all grains by field.shape[0] - 1 steps.

    rows ((n + 2) * ROW,): as in `forces.py`, changed in place; the last two rows are the dummies. velocity (n, 3): of the
    thesis' scheme. mass [kg], radius [m], alive: (n,). lists: Lists; travelled (1,): how far grains may have moved since they were made [m].
    walls (w, 5): x0, y0, x1, y1 [m], friction. skin [m]: of the outer lists. deepest [-]: overlap that ends the run. ledger (LEDGER,) [J].
    Returns (lists, status, i, j, steps done): status FINE, or TOO_DEEP or NOT_A_NUMBER with the bodies (j >= n: wall j - n).
    """
    n = radius.size
    steps = motion.field.shape[0] - 1
    gravity = motion.field[0] - motion.driving[0] if motion.driving.shape[0] > 0 else motion.field[0]
    radius_mean = radius.mean()
    losses = np.zeros(4)
    status, i, j, done = FINE, -1, -1, 0
    room, fresh = 0.0, False
    pairs, _, _, _ = inner_pairs(rows, lists, 0.0, deepest)
    touching, _, _, _ = inner_walls(rows, lists, walls, 0.0, deepest)
    thesis = motion.integrator == THESIS
    general = thesis or motion.mass_damping > 0.0 or motion.local_damping > 0.0
    fastest = 0.0
    for s in range(steps + 1):
        # All pairs of a chunk of grains with earlier grains are done once its own are: it is moved while it is in the cache.
        kick = 0.5 if s == 0 and not thesis else 1.0
        fx, fy = motion.field[s, 0] * dt * dt, motion.field[s, 1] * dt * dt
        fastest = 0.0
        for c in range(pairs.chunk.size - 1):
            begin, end = c * CHUNK, min((c + 1) * CHUNK, n)
            if s > 0:
                pair_forces(rows, pairs, pairs.chunk[c], pairs.chunk[c + 1], law, losses)
                wall_forces(rows, touching, touching.chunk[c], touching.chunk[c + 1], walls, law, losses)
            if s < steps and general:
                fast, lost = move_general(rows, velocity, begin, end, kick, True, fx, fy, motion, dt)
                ledger[DAMPING] += kn * lost
                fastest = max(fastest, fast)
            elif s < steps:
                fastest = max(fastest, move(rows, begin, end, kick, fx, fy))
        done = s
        if s == steps:
            break
        if motion.driving.shape[0] > 0:
            _work(rows, mass, motion, s, ledger)
        moved = np.sqrt(fastest)
        travelled[0] += moved
        room -= 2.0 * moved
        if 2.0 * travelled[0] > skin or not fresh or room < 0.0:
            if fresh:
                remember(pairs, lists.memory)
                remember(touching, lists.wall_memory)
            i = not_finite(rows, n)
            if i >= 0:
                status = NOT_A_NUMBER
                break
            if 2.0 * travelled[0] > skin:
                _let_go(rows, mass, radius, alive, box, gravity, dt, kn, ledger)
                x, y = rows[X : ROW * n : ROW].copy(), rows[Y : ROW * n : ROW].copy()
                lists = outer_lists(x, y, radius, alive, walls, skin, lists)
                travelled[0] = 0.0
            room, fresh = _next_inner_skin(fastest, skin, radius_mean), True
            pairs, status, i, j = inner_pairs(rows, lists, room, deepest)
            touching, wall_status, wall_i, wall_j = inner_walls(rows, lists, walls, room, deepest)
            if status == FINE and wall_status != FINE:
                status, i, j = wall_status, wall_i, n + wall_j
            if status != FINE:
                break
    if status == FINE:
        remember(pairs, lists.memory)
        remember(touching, lists.wall_memory)
        if motion.integrator == LEAPFROG:
            fx, fy = motion.field[steps, 0] * dt * dt, motion.field[steps, 1] * dt * dt
            _, lost = move_general(rows, velocity, 0, n, 0.5, False, fx, fy, motion, dt)
            ledger[DAMPING] += kn * lost
    ledger[DASHPOT_N] += 0.5 * kn * losses[0]
    ledger[DASHPOT_S] += 0.5 * kn * losses[1]
    ledger[FRICTION] += 0.5 * kn * losses[2]
    ledger[TIME_STEP] += 0.5 * kn * losses[3]
    return lists, status, i, j, done


@kernel()
def evaluate(rows, radius, alive, lists, walls, law, skin):
    """Forces at the present positions without a step, from fresh lists; the energy of what overlaps already is not a loss."""
    n = radius.size
    lists = outer_lists(
        rows[X : ROW * n : ROW].copy(), rows[Y : ROW * n : ROW].copy(), radius, alive, walls, skin, lists
    )
    pairs, _, _, _ = inner_pairs(rows, lists, skin, np.inf)
    touching, _, _, _ = inner_walls(rows, lists, walls, skin, np.inf)
    losses = np.zeros(4)
    for i in range(n):
        rows[ROW * i + FX] = rows[ROW * i + FY] = rows[ROW * i + TURN] = 0.0
    pair_forces(rows, pairs, 0, pairs.first.size, law, losses)
    wall_forces(rows, touching, 0, touching.first.size, walls, law, losses)
    remember(pairs, lists.memory)
    remember(touching, lists.wall_memory)
    return lists
