"""The steps of the explicit DEM between two outputs, in one compiled loop.

Rows and units are those of `forces.py`. The state enters and leaves with positions, velocities and forces of the same instant:
leapfrog kicks by half a step first and last, so that a run may change its time step between two outputs.
"""

from __future__ import annotations

import numpy as np

from dem_cli.engines.explicit.bodies import (
    follow_bonds,
    gather_cores,
    move_pairs,
    prepare_bonds,
    solve_bonds,
    spread_cores,
    spread_velocities,
)
from dem_cli.engines.explicit.ellipses import (
    ellipse_pair_forces,
    ellipse_wall_forces,
    inner_ellipse_pairs,
    inner_ellipse_walls,
    turn_outlines,
)
from dem_cli.engines.explicit.forces import FX, FY, ROW, TURN, R, X, Y, pair_forces, wall_forces
from dem_cli.engines.explicit.lists import (
    FINE,
    NOT_A_NUMBER,
    inner_pairs,
    inner_walls,
    not_finite,
    outer_lists,
    remember,
)
from dem_cli.engines.explicit.moves import (
    LEAPFROG,
    THESIS,
    drag_on_bonded,
    drift,
    let_go,
    mass_moved,
    motions,
    move,
    push,
)
from dem_cli.geometry.lanes import WIDTH
from dem_cli.jit import kernel

# Entries of the ledger that the loop adds up [J]
DASHPOT_N, DASHPOT_S, FRICTION, TIME_STEP, DAMPING, WORK, ESCAPED, BONDS, LEDGER = 0, 1, 2, 3, 4, 5, 6, 7, 8


@kernel()
def _kick_bonded(
    rows, velocity, begin, end, first, last, kick, settle, fx, fy, motion, kn, dt, backward, ledger, bonds
):  # fmt: skip
    """New velocities of the elements begin..end-1 and of the bonds first..last-1 between them; settle: see `bodies.solve_bonds`."""
    damped = motion.mass_damping > 0.0 or motion.local_damping > 0.0
    old = pushed = np.empty((0, 3))
    prepare_bonds(rows, bonds, first, last)
    if damped:
        old = motions(rows, velocity, begin, end, motion.integrator == THESIS)
    ledger[DAMPING] += kn * push(rows, velocity, begin, end, kick, fx, fy, motion, dt)
    if damped:
        pushed = motions(rows, velocity, begin, end, False)
    ledger[BONDS] += 0.5 * kn * solve_bonds(rows, bonds, first, last, kick, kn * dt, backward, settle)
    if damped:
        ledger[DAMPING] += kn * drag_on_bonded(rows, old, pushed, begin, end, kick, fx, fy)


@kernel()
def _move_chunk(rows, velocity, begin, end, c, kick, fx, fy, motion, kn, dt, backward, ledger, bonds, cores):
    """One step of the grains begin..end-1, chunk c, whatever they are made of; bonds and cores are None where there are none.

    Returns the largest squared displacement [m^2].
    """
    thesis = motion.integrator == THESIS
    general = thesis or motion.mass_damping > 0.0 or motion.local_damping > 0.0
    if cores is not None:
        first, last = cores.edges[c], cores.edges[c + 1]
        gather_cores(rows, cores, first, last)
        if general:
            ledger[DAMPING] += kn * push(cores.rows, cores.velocity, first, last, kick, fx, fy, motion, dt)
            drift(cores.rows, cores.velocity, first, last, thesis)
        else:
            move(cores.rows, first, last, kick, fx, fy)
        return spread_cores(rows, cores, first, last)
    if bonds is not None:
        first, last = bonds.edges[c], bonds.edges[c + 1]
        fastest = 0.0
        if bonds.paired and not general:
            middle = first + (last - first) // WIDTH * WIDTH
            fastest, lost = move_pairs(rows, bonds, first, middle, kick, fx, fy, kn * dt)
            ledger[BONDS] += 0.5 * kn * lost
            first, begin = middle, begin + 2 * (middle - first)
        _kick_bonded(
            rows, velocity, begin, end, first, last, kick, True, fx, fy, motion, kn, dt, backward, ledger, bonds
        )
        fastest = max(fastest, drift(rows, velocity, begin, end, thesis))
        follow_bonds(rows, bonds, first, last)
        return fastest
    if general:
        ledger[DAMPING] += kn * push(rows, velocity, begin, end, kick, fx, fy, motion, dt)
        return drift(rows, velocity, begin, end, thesis)
    return move(rows, begin, end, kick, fx, fy)


@kernel()
def _last_half_kick(rows, velocity, n, fx, fy, motion, kn, dt, backward, ledger, bonds, cores):
    """Bring velocities to the instant of the positions; forces are kept for the half kick that follows."""
    if cores is not None:
        bodies = cores.start.size - 1
        gather_cores(rows, cores, 0, bodies)
        ledger[DAMPING] += kn * push(cores.rows, cores.velocity, 0, bodies, 0.5, fx, fy, motion, dt)
    elif bonds is not None:
        _kick_bonded(
            rows, velocity, 0, n, 0, bonds.first.size, 0.5, False, fx, fy, motion, kn, dt, backward, ledger, bonds
        )
    else:
        ledger[DAMPING] += kn * push(rows, velocity, 0, n, 0.5, fx, fy, motion, dt)


@kernel()
def _work(rows, mass, motion, s, ledger):
    """Add the work of the driving part of the body force over the displacement of step s to the ledger."""
    px, py = mass_moved(rows, mass, mass.size)
    after = s if motion.integrator == THESIS else s + 1
    ledger[WORK] += 0.5 * (motion.driving[s, 0] + motion.driving[after, 0]) * px
    ledger[WORK] += 0.5 * (motion.driving[s, 1] + motion.driving[after, 1]) * py


@kernel()
def _next_inner_skin(fastest, skin, radius_mean):
    """Inner skin that balances remaking the list against walking it: measured best near 0.9 sqrt(step's displacement x radius)."""
    return min(max(0.9 * np.sqrt(fastest * radius_mean), 1e-3 * radius_mean), 0.5 * skin)


@kernel()
def _inner_lists(rows, lists, edges, walls, skin, deepest, outlines):
    """Inner pairs and contacts with walls, and the first contact that is too deep: (pairs, touching, status, i, j), j >= n for wall j - n."""
    n = lists.start.size - 1
    if outlines is not None:
        pairs, status, i, j = inner_ellipse_pairs(rows, outlines, lists, edges, skin, deepest)
        touching, wall_status, wall_i, wall_j = inner_ellipse_walls(rows, outlines, lists, edges, walls, skin, deepest)
    else:
        pairs, status, i, j = inner_pairs(rows, lists, edges, skin, deepest)
        touching, wall_status, wall_i, wall_j = inner_walls(rows, lists, edges, walls, skin, deepest)
    if status == FINE and wall_status != FINE:
        status, i, j = wall_status, wall_i, n + wall_j
    return pairs, touching, status, i, j


@kernel()
def _chunk_forces(rows, pairs, touching, c, walls, law, losses, outlines):
    """Forces of the contacts of chunk c."""
    first, last = pairs.chunk[c], pairs.chunk[c + 1]
    wall_first, wall_last = touching.chunk[c], touching.chunk[c + 1]
    if outlines is not None:
        ellipse_pair_forces(rows, outlines, pairs, first, last, law, losses)
        ellipse_wall_forces(rows, outlines, touching, wall_first, wall_last, walls, law, losses)
    else:
        pair_forces(rows, pairs, first, last, law, losses)
        wall_forces(rows, touching, wall_first, wall_last, walls, law, losses)


@kernel()
def advance(
    rows, velocity, mass, inertia, reach, alive, lists, travelled, walls, law, motion, kn, dt, skin, deepest, box, ledger, edges,
    outlines, body, bonds, cores
):  # fmt: skip
    """Advance all grains by field.shape[0] - 1 steps.

    rows ((n + 2) * ROW,): as in `forces.py`, changed in place; the last two rows are the dummies. velocity (n, 3): of the
    thesis' scheme. mass [kg], inertia [kg m^2], reach [m] (radius of the circle about it), alive: (n,) of each element. lists: Lists;
    travelled (1,): how far grains may have moved since they were made [m]. walls (w, 5): x0, y0, x1, y1 [m], friction. skin [m]: of the outer
    lists. deepest [-]: overlap that ends the run. ledger (LEDGER,) [J]. edges (chunks + 1,): first element of each chunk, and n.
    outlines: Outlines where there are ellipses; body (n,): number of the body of each element where some have several; bonds: Bonded;
    cores: Cores of rigid bodies. Each is None where it does not apply, and then its code is not even compiled.
    Returns (lists, status, i, j, steps done): status FINE, or TOO_DEEP or NOT_A_NUMBER with the bodies (j >= n: wall j - n).
    """
    n = reach.size
    steps = motion.field.shape[0] - 1
    gravity = motion.field[0] - motion.driving[0] if motion.driving.shape[0] > 0 else motion.field[0]
    radius_mean = rows[R : ROW * n : ROW].mean()
    losses = np.zeros(4)
    status, i, j, done = FINE, -1, -1, 0
    room, fresh = 0.0, False
    pairs, touching, _, _, _ = _inner_lists(rows, lists, edges, walls, 0.0, deepest, outlines)
    thesis = motion.integrator == THESIS
    for s in range(steps + 1):
        # All pairs of a chunk of grains with earlier grains are done once its own are: it is moved while it is in the cache.
        kick = 0.5 if s == 0 and not thesis else 1.0
        fx, fy = motion.field[s, 0] * dt * dt, motion.field[s, 1] * dt * dt
        fastest, swayed = 0.0, 0.0
        for c in range(edges.size - 1):
            if s > 0:
                _chunk_forces(rows, pairs, touching, c, walls, law, losses, outlines)
            if s < steps:
                begin, end = edges[c], edges[c + 1]
                fast = _move_chunk(
                    rows, velocity, begin, end, c, kick, fx, fy, motion, kn, dt, s % 2 == 1, ledger, bonds, cores
                )
                fastest = max(fastest, fast)
                if outlines is not None:
                    swayed = max(swayed, turn_outlines(rows, outlines, begin, end))
        done = s
        if s == steps:
            break
        if motion.driving.shape[0] > 0:
            _work(rows, mass, motion, s, ledger)
        moved = np.sqrt(fastest)
        travelled[0] += moved
        moved += swayed
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
                ledger[ESCAPED] += let_go(rows, mass, inertia, reach, alive, box, gravity, dt, body, cores)
                x, y = rows[X : ROW * n : ROW].copy(), rows[Y : ROW * n : ROW].copy()
                lists = outer_lists(x, y, reach, alive, walls, skin, body, lists)
                travelled[0] = 0.0
            room, fresh = _next_inner_skin(moved, skin, radius_mean), True
            pairs, touching, status, i, j = _inner_lists(rows, lists, edges, walls, room, deepest, outlines)
            if status != FINE:
                break
    if status == FINE:
        remember(pairs, lists.memory)
        remember(touching, lists.wall_memory)
        if motion.integrator == LEAPFROG:
            fx, fy = motion.field[steps, 0] * dt * dt, motion.field[steps, 1] * dt * dt
            _last_half_kick(rows, velocity, n, fx, fy, motion, kn, dt, steps % 2 == 1, ledger, bonds, cores)
        if cores is not None:
            spread_velocities(rows, velocity, cores, thesis)
    ledger[DASHPOT_N] += 0.5 * kn * losses[0]
    ledger[DASHPOT_S] += 0.5 * kn * losses[1]
    ledger[FRICTION] += 0.5 * kn * losses[2]
    ledger[TIME_STEP] += 0.5 * kn * losses[3]
    return lists, status, i, j, done


@kernel()
def evaluate(rows, reach, alive, lists, walls, law, skin, edges, outlines, body):
    """Forces at the present positions without a step, from fresh lists; the energy of what overlaps already is not a loss."""
    n = reach.size
    lists = outer_lists(
        rows[X : ROW * n : ROW].copy(), rows[Y : ROW * n : ROW].copy(), reach, alive, walls, skin, body, lists
    )
    pairs, touching, _, _, _ = _inner_lists(rows, lists, edges, walls, skin, np.inf, outlines)
    losses = np.zeros(4)
    for i in range(n):
        rows[ROW * i + FX] = rows[ROW * i + FY] = rows[ROW * i + TURN] = 0.0
    for c in range(edges.size - 1):
        _chunk_forces(rows, pairs, touching, c, walls, law, losses, outlines)
    remember(pairs, lists.memory)
    remember(touching, lists.wall_memory)
    return lists
