"""The two ways to equilibrium: Kishino's block Jacobi, and the same direction as preconditioner of a momentum iteration.

Both move all discs together and stop when every fixing force is below the accuracy (14) and the servos hold their stresses.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dem_cli.engines.granular_element.boundary import (
    FIXING,
    GONE,
    MOST_SERVOS,
    account,
    area_inside,
    follow_box,
    membrane_forces,
    membrane_stiffness,
    move_box,
    servo_errors,
)
from dem_cli.engines.granular_element.contacts import (
    DRIVEN,
    FLIPS,
    GRAIN,
    SUMS,
    TIED,
    contact_stiffness,
    count_contacts,
    forces,
    is_stale,
    renew,
    wall_of,
)
from dem_cli.engines.granular_element.ledger import lose, lost_so_far, opened_and_closed, set_anchor
from dem_cli.jit import kernel

BALANCED, UNBALANCED, NOT_A_NUMBER, AWAY = 0, 1, 2, 3
WALL_STEP = 0.3  # share of a servo's error that a momentum step takes
FIRM, LOOSE = 0.1, 1.0  # added to the blocks, in units of kn, for discs with two contacts and more, and with less
LOOK = 50  # iterations between two looks at how far discs have moved
SOON, LATER = (
    4,
    9,
)  # iterations after which blocks are made anew where contacts opened or closed, and where the pace is keen
STRAIN_PARTS = 8  # pieces of a prescribed strain where the path is followed
WARM = 5.0  # iterations after a restart until the momentum is half of what it may be
LEAST = 0.3  # cap of the momentum below which it begins anew from the highest
REFRESH = 20  # iterations after which blocks are made anew though no contact opened or closed


class Pace(NamedTuple):
    """How to iterate.

    momentum: the momentum iteration, else Kishino's; keen: discs with one contact keep their momentum, too, which is faster along
    smooth paths; collapses and preparation go without; step: h, or alpha; cap: of the momentum; most: iterations; follow: the slider starts
    anew from every iterate (as in the paper) and the ledger is kept iterate by iterate; accuracy [N]; stress: error of the servos over
    their scale; far [m]: way from the anchor at which a grain that is held ends the attempt; patience: iterations in which the error must
    fall by half, in square, or the momentum's cap is lowered; alpha_prime, beta, beta_prime: (10), (11).
    """

    momentum: bool
    keen: bool
    step: float
    cap: float
    most: int
    follow: bool
    accuracy: float
    stress: float
    far: float
    patience: int
    alpha_prime: float
    beta: float
    beta_prime: float


class Iterates(NamedTuple):
    """Work arrays: velocity, fixing, old fixing (n, 3), blocks and their inverses (n, 6), normals of the last contacts (n, 2), number of
    contacts (n,) and the last one's other body (contacts.count_contacts), old load (n, 2).
    """

    velocity: np.ndarray
    fixing: np.ndarray
    old_fixing: np.ndarray
    blocks: np.ndarray
    inverse: np.ndarray
    last: np.ndarray
    touching: np.ndarray
    other: np.ndarray
    old_load: np.ndarray


@kernel()
def room_for(n):
    return Iterates(
        np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((n, 2)),
        np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros((n, 2)),
    )  # fmt: skip


@kernel()
def look(x, anchor, near, bodies, law, chain, box, depth, room, sums):
    """Fixing forces at x, membranes included; returns the energy of the membranes' links [J]."""
    forces(x, anchor, near, bodies, law, box, room.fixing, sums)
    return membrane_forces(x, bodies, chain, depth, room.fixing) if chain.ring.size > 0 else 0.0


@kernel()
def _invert(block, add, turns, out):
    """Inverse of a symmetric block (xx, xy, xq, yy, yq, qq) with `add` on its diagonal, or of its part that does not turn; 0 if singular."""
    a, b, c = block[0] + add, block[1], block[2]
    d, e, g = block[3] + add, block[4], block[5] + add
    out[:] = 0.0
    if turns:
        aa, bb, cc = d * g - e * e, c * e - b * g, b * e - c * d
        det = a * aa + b * bb + c * cc
        if det > 1e-9 * (a + d) ** 3:
            scale = 1.0 / det
            out[0], out[1], out[2] = aa * scale, bb * scale, cc * scale
            out[3], out[4], out[5] = (a * g - c * c) * scale, (b * c - a * e) * scale, (a * d - b * b) * scale
            return
    det = a * d - b * b
    if det > 1e-9 * (a + d) ** 2:
        out[0], out[1], out[3] = d / det, -b / det, a / det


@kernel()
def _blocks(x, near, bodies, law, chain, box, room, momentum):
    """Inverse blocks of all discs; those that cannot be inverted (12) are zero."""
    blocks = room.blocks
    contact_stiffness(x, near, law, box, blocks, room.last)
    if chain.ring.size > 0:
        membrane_stiffness(x, bodies, chain, blocks)
    for i in range(x.shape[0]):
        add = 0.0
        if momentum:
            add = law.kn * (FIRM if room.touching[i] > 1 or bodies.kind[i] != GRAIN else LOOSE)
        if bodies.kind[i] == TIED:
            room.inverse[i, :] = 0.0
            room.inverse[i, 0] = 1.0 / (blocks[i, 0] + max(add, FIRM * law.kn))
        else:
            _invert(blocks[i], add, bodies.kind[i] == GRAIN, room.inverse[i])


@kernel(inline=True)
def _block_move(inverse, fixing, i):
    v = inverse[i, 0] * fixing[i, 0] + inverse[i, 1] * fixing[i, 1] + inverse[i, 2] * fixing[i, 2]
    w = inverse[i, 1] * fixing[i, 0] + inverse[i, 3] * fixing[i, 1] + inverse[i, 4] * fixing[i, 2]
    q = inverse[i, 2] * fixing[i, 0] + inverse[i, 4] * fixing[i, 1] + inverse[i, 5] * fixing[i, 2]
    return v, w, q


@kernel(inline=True)
def _towards(x, box, other, i):
    """Unit normal from disc i to the body that its last contact is with."""
    j = other[i]
    if j < 0:
        nx, ny, _ = wall_of(-1 - j, box)
        return nx, ny
    ex, ey = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
    distance = math.sqrt(ex * ex + ey * ey)
    return ex / distance, ey / distance


@kernel(inline=True)
def _rolling_move(x, bodies, box, room, law, keen, i, alpha, beta):
    """(11): one contact; back along its normal, and rolling about it with the body force. The last row is -1: so the contact does not slip."""
    nx, ny = room.last[i, 0], room.last[i, 1]
    if keen:
        nx, ny = _towards(x, box, room.other, i)
    along = -alpha * (room.fixing[i, 0] * nx + room.fixing[i, 1] * ny) / law.kn
    roll = beta * (bodies.load[i, 1] * nx - bodies.load[i, 0] * ny) / law.kn
    return along * nx - roll * ny, along * ny + roll * nx, -roll


@kernel(inline=True)
def _is_loaded(bodies, i):
    """Whether a grain has weight."""
    return bodies.load[i, 0] != 0.0 or bodies.load[i, 1] != 0.0


@kernel(inline=True)
def _stay_near(x, box, law, room, i):
    """A disc with one contact and no weight keeps its momentum, or it would hold back like a viscous liquid those that push it on; but nothing
    stops it either, so it goes no farther than out of the overlap, and ahead of the other body as far as that moves towards it.
    """
    v, j = room.velocity, room.other[i]
    nx, ny = _towards(x, box, room.other, i)
    ahead = max(-v[j, 0] * nx - v[j, 1] * ny, 0.0) if j >= 0 else 0.0
    most = ahead + (room.fixing[i, 0] * nx + room.fixing[i, 1] * ny) / law.kn
    over = max(-v[i, 0] * nx - v[i, 1] * ny - most, 0.0)
    v[i, 0] += over * nx
    v[i, 1] += over * ny


@kernel()
def _move(x, bodies, law, box, room, pace, momentum):
    """Moves all free discs once; `momentum` is that of this iteration. The velocities are what each moved."""
    v, fixing = room.velocity, room.fixing
    for i in range(x.shape[0]):
        kind = bodies.kind[i]
        if kind == DRIVEN:
            continue
        keep, count = momentum, room.touching[i]
        if kind == GRAIN and count == 0:
            dx, dy, dq = pace.beta * bodies.load[i, 0] / law.kn, pace.beta * bodies.load[i, 1] / law.kn, 0.0
            keep = 0.0
        elif kind == GRAIN and count == 1 and (not pace.momentum or _is_loaded(bodies, i)):
            dx, dy, dq = _rolling_move(x, bodies, box, room, law, pace.keen, i, pace.alpha_prime, pace.beta_prime)
            keep = 0.0
        else:
            dx, dy, dq = _block_move(room.inverse, fixing, i)
            dx, dy, dq = -pace.step * dx, -pace.step * dy, -pace.step * dq
            if count < 2 and kind == GRAIN and not pace.keen:
                keep = 0.0
        v[i, 0] = keep * v[i, 0] + dx
        v[i, 1] = keep * v[i, 1] + (dy if kind != TIED else 0.0)
        v[i, 2] = keep * v[i, 2] + (dq if kind == GRAIN else 0.0)
        if kind == GRAIN and count == 1 and pace.keen and not _is_loaded(bodies, i):
            _stay_near(x, box, law, room, i)
        x[i, 0] += v[i, 0]
        x[i, 1] += v[i, 1]
        x[i, 2] += v[i, 2]


@kernel()
def _largest(bodies, fixing):
    """Square of the largest fixing force of a free disc, and its number."""
    worst, which = 0.0, -1
    for i in range(fixing.shape[0]):
        kind = bodies.kind[i]
        square = 0.0
        if kind != DRIVEN:
            square = fixing[i, 0] ** 2
            if kind != TIED:
                square += fixing[i, 1] ** 2
            if kind == GRAIN:
                square += fixing[i, 2] ** 2
        if not square <= worst:
            worst, which = square, i
            if not square < np.inf:
                break
    return worst, which


@kernel()
def _moved(x, anchor, bodies, room):
    """Farthest way from the anchor of a grain that is held by two contacts and more [m]."""
    most = 0.0
    for i in range(bodies.grains):
        if room.touching[i] > 1:
            most = max(most, (x[i, 0] - anchor[i, 0]) ** 2 + (x[i, 1] - anchor[i, 1]) ** 2)
    return math.sqrt(most)


@kernel()
def _strain(x, box, goal, guess, bodies, chain, affine):
    """The prescribed strain: half sizes to goal (2,) [m]; grains move by guess (n, 3), or along with it, or stay (the paper's way)."""
    if guess.shape[0] > 0:
        x += guess
    elif affine:
        for i in range(x.shape[0]):
            x[i, 0] = box[0] + (x[i, 0] - box[0]) * (goal[0] / box[2])
            x[i, 1] = box[1] + (x[i, 1] - box[1]) * (goal[1] / box[3])
    box[2:] = goal
    if bodies.grains < x.shape[0]:
        follow_box(x, box, bodies, chain)


@kernel()
def relax(x, anchor, box, goal, guess, size, near, bodies, law, chain, servos, depth, skin, pace, ledger):
    """Strains the sample to half sizes goal (2,) [m], then iterates to equilibrium. guess (n, 3) [m]: how discs will move; (0, 3) for no guess.

    x, anchor (n, 3), box (4,), the memory of `near` (LOST, and with `follow` the anchor) and ledger (LEDGER,) [J] change in place;
    size (2,) [m]: half sizes that strains count against. Returns (near, status, iterations, largest fixing force [N], disc, error of stress).
    """
    n = x.shape[0]
    room, mean_radius = room_for(n), bodies.radius.mean()
    sums, old_sums, old_box, before = np.zeros(SUMS), np.zeros(SUMS), box.copy(), x.copy()
    error, push, speed = np.zeros(MOST_SERVOS), np.zeros(MOST_SERVOS), np.zeros(MOST_SERVOS)
    age, since, worst, which, stress = 0, REFRESH, 0.0, -1, 0.0
    cap, best, waited, flips = pace.cap, np.inf, 0, 0.0
    began, parts = box[2:].copy(), STRAIN_PARTS if pace.follow else 0
    for iteration in range(-parts, pace.most + 1):
        if iteration == 0 and not pace.follow:
            _strain(x, box, goal, guess, bodies, chain, pace.momentum)
        elif iteration > -parts and iteration <= 0:
            # piece by piece, so that the work of the strain is known
            _strain(x, box, began + (iteration + parts) / parts * (goal - began), guess, bodies, chain, pace.momentum)
        if is_stale(x, box, near, skin):
            had = lost_so_far(near)
            near = renew(x, bodies, law, box, skin, near)
            ledger[GONE] += had - lost_so_far(near)
            since = REFRESH
        look(x, anchor, near, bodies, law, chain, box, depth, room, sums)
        if pace.follow:
            lose(near, True)
            if iteration > -parts:
                ledger[FIXING] -= opened_and_closed(near, law)
                account(
                    x, before, room.fixing, room.old_fixing, bodies, room.old_load, sums, old_sums, box, old_box, ledger
                )
            set_anchor(x, anchor, near)
            before[:], room.old_fixing[:], room.old_load[:] = x, room.fixing, bodies.load
            old_sums[:], old_box[:] = sums, box
            if iteration < 0:
                continue
        worst, which = _largest(bodies, room.fixing)
        stress = servo_errors(
            servos, sums, area_inside(x, box, bodies, chain), depth, box, law.kn, mean_radius, error, push
        )
        if not (worst < np.inf and stress < np.inf):
            return near, NOT_A_NUMBER, iteration, worst, which, stress
        if worst <= pace.accuracy**2 and stress <= pace.stress:
            near_by = pace.follow or _moved(x, anchor, bodies, room) <= pace.far
            return near, BALANCED if near_by else AWAY, iteration, math.sqrt(worst), which, stress
        if iteration == pace.most:
            break
        if iteration % LOOK == 0 and not pace.follow and _moved(x, anchor, bodies, room) > pace.far:
            return near, AWAY, iteration, math.sqrt(worst), which, stress
        since += 1
        flips += sums[FLIPS]
        stale = since > REFRESH or (flips > 0.0 and since > (LATER if pace.keen else SOON))
        if pace.keen or stale:
            count_contacts(near, room.touching, room.other)
        if stale:
            _blocks(x, near, bodies, law, chain, box, room, pace.momentum)
            since, flips = 0, 0.0
        momentum = 0.0
        if pace.momentum:
            power = 0.0
            for i in range(n):
                power -= (
                    room.fixing[i, 0] * room.velocity[i, 0]
                    + room.fixing[i, 1] * room.velocity[i, 1]
                    + room.fixing[i, 2] * room.velocity[i, 2]
                )
            for k in range(servos.number):
                power += push[k] * speed[k]
            age += 1
            if power < 0.0:
                room.velocity[:] = 0.0
                speed[:] = 0.0
                age = 0
            measure = max(worst / pace.accuracy**2, (stress / pace.stress) ** 2)
            waited += 1
            if measure < 0.5 * best:
                best, waited = measure, 0
            elif waited > pace.patience:
                cap, best, waited = 1.0 - 1.6 * (1.0 - cap), measure, 0
                if cap < LEAST:
                    cap = pace.cap if pace.keen else LEAST
                room.velocity[:] = 0.0
                speed[:] = 0.0
                age = 0
            momentum = min(cap, age / (age + (WARM if pace.keen else 3.0)))
        _move(x, bodies, law, box, room, pace, momentum)
        for k in range(servos.number):
            speed[k] = momentum * speed[k] + (WALL_STEP if pace.momentum else 1.0) * error[k]
        move_box(box, size, servos, speed)
        if bodies.grains < n:
            follow_box(x, box, bodies, chain)
    return near, UNBALANCED, pace.most, math.sqrt(worst), which, stress
