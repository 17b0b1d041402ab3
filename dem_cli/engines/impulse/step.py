"""One step of rigid bodies under impulses: half a drift, contacts, impacts, gravity, load, half a drift.

Impacts are solved with the velocities before this step's gravity, so resting contacts never meet restitution; gravity then comes and the load
phase, with e = 0, keeps contacts closed, and rebounds as fast as the impact left them: seen over the whole step a contact obeys v' = -e v,
which is Moreau's midpoint rule, and a bounce with e = 1 keeps its energy. Penetration is taken back by displacements that leave velocities
alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dem_cli.engines.impulse.drift import turning_energy
from dem_cli.engines.impulse.impact import back_to, solve_impact, work_done
from dem_cli.engines.impulse.islands import split_islands
from dem_cli.engines.impulse.pgs import sweep_until_still
from dem_cli.engines.impulse.quaternions import after_turn
from dem_cli.engines.impulse.rows import (
    DRIFT,
    FRICTION,
    NORMAL,
    RESTITUTION,
    STIFF,
    TARGET,
    WIDTH,
    fill_rows,
    push,
    push_all,
    relative,
    relative_of_all,
    vector,
)
from dem_cli.engines.impulse.tracking import link_contacts
from dem_cli.engines.impulse.vectors import dot, times
from dem_cli.jit import kernel

PROJECTION_SWEEPS = 10
SPURIOUS = 1e-9  # share of the energy exchanged that a load may gain by rounding
AT_CONE = 1.0 - 1e-6  # share of the friction limit from which a contact counts as sliding


class Moving(NamedTuple):
    """Bodies in motion: present (n,), x (n + 1, 3) [m], q (n, 4), velocity (n + 1, 6): v [m/s] and w [rad/s], mass (n,), inertia (n, 3):
    principal moments, size (n,) [m]: radius of the bounding sphere, inverse (n + 1, 7): see `drift.turn_inverse`. Row n, of zeros, is what
    never moves."""

    present: np.ndarray
    x: np.ndarray
    q: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    size: np.ndarray
    inverse: np.ndarray


class Touching(NamedTuple):
    """Contacts of a step, shape (c,) each, in the order of the search: bodies i and j (n for what never moves), key, point, normal (c, 3),
    gap [m], restitution, friction, new: not there in the step before; load (c, 3) [N s]: impulses of the load phase, and left (c, 3)
    [m/s]: u after it, at first those of the step before; impulse (c, 3): both phases together; sliding."""

    i: np.ndarray
    j: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    restitution: np.ndarray
    friction: np.ndarray
    new: np.ndarray
    load: np.ndarray
    left: np.ndarray
    impulse: np.ndarray
    sliding: np.ndarray


class Rules(NamedTuple):
    """How contacts are solved; see the scenario's [solver]. method: `impact.PGS` or `impact.TRACKING`; speeds [m/s]; most, most_quanta:
    iterations of one solve; correction, slop [-]: of the penetration."""

    method: int
    quanta: float
    rest_speed: float
    tolerance: float
    most: int
    most_quanta: int
    correction: float
    slop: float


# Energies since the start of the run [J]: see `rigid.ImpulseEnergy`.
RESTITUTION_LOSS, FRICTION_LOSS, PROJECTED, WORK = range(4)
ENERGIES = 4
# Counts since they were last set to zero (CAPPED, since the start): see `rigid.Solving`.
STEPS, IMPACTS, IMPACT_ITERATIONS, LOAD_SWEEPS, MOST, RESIDUAL, ISLANDS, LARGEST, CAPPED = range(9)
COUNTS = 9


@kernel()
def carry_over(old_i, old_j, old_key, old_load, old_left, i, j, key, load, left):
    """Gives each contact the load impulse (c, 3), and the u (c, 3) it was left with, of the step before, zero to new ones.

    Returns which are new (c,).

    Both lists are sorted by (i, j, key).
    """
    k, new = 0, np.ones(len(i), np.bool_)
    for c in range(len(i)):
        while k < len(old_i) and (old_i[k], old_j[k], old_key[k]) < (i[c], j[c], key[c]):
            k += 1
        known = k < len(old_i) and old_i[k] == i[c] and old_j[k] == j[c] and old_key[k] == key[c]
        new[c] = not known
        for axis in range(3):
            load[c, axis] = old_load[k, axis] if known else 0.0
            left[c, axis] = old_left[k, axis] if known else 0.0
    return new


@kernel()
def solve_step(dt, gravity, driving, moving, found, rules, energies, counts):
    """Impacts, gravity, load and projection of one step, at the middle of which bodies and contacts are given.

    gravity, driving (3,) [m/s^2]: weight and the inertial acceleration of a shaken container. moving, found, energies (ENERGIES,) and counts
    (COUNTS,) are changed in place.
    """
    bodies, contacts = len(moving.mass), len(found.i)
    velocity, inverse = moving.velocity, moving.inverse
    before = velocity.copy()
    order, starts = split_islands(found.i, found.j, bodies)
    i, j = found.i[order], found.j[order]
    rows, start = np.empty((contacts, WIDTH)), np.empty((contacts, 3))
    fill_rows(
        i, j, found.point[order], found.normal[order], moving.x, inverse, found.restitution[order], found.friction[order], rows
    )  # fmt: skip
    relative_of_all(0, contacts, i, j, rows, velocity, start)
    fall = (gravity[0] + driving[0], gravity[1] + driving[1], gravity[2] + driving[2])
    rebound_at_surface(dt, fall, bodies, j, rows, start, found.gap[order], found.new[order])
    hit = solve_impacts(starts, i, j, rows, moving, before, start, rules, counts)
    for k in range(bodies):
        if moving.present[k]:
            for axis in range(3):
                velocity[k, axis] += dt * (gravity[axis] + driving[axis])
    load = found.load[order]
    turn_with_drift(rows, start, load, found.left[order], found.new[order])
    solve_load(starts, i, j, rows, velocity, inverse, load, rules, counts)
    book(i, j, rows, velocity, start, hit, load, energies)
    for k in range(bodies):
        if moving.present[k]:
            for axis in range(3):
                energies[WORK] += 0.5 * dt * moving.mass[k] * driving[axis] * (before[k, axis] + velocity[k, axis])
    for c in range(contacts):
        one = vector(load[c], 0)
        pressing = dot(one, vector(rows[c], NORMAL))
        across = math.sqrt(max(dot(one, one) - pressing * pressing, 0.0))
        at = order[c]
        now = relative(rows[c], velocity[i[c]], velocity[j[c]])
        found.sliding[at] = pressing > 0.0 and across >= AT_CONE * rows[c, FRICTION] * pressing
        for axis in range(3):
            found.load[at, axis] = load[c, axis]
            found.left[at, axis] = now[axis]
            found.impulse[at, axis] = hit[c, axis] + load[c, axis]
    energies[PROJECTED] += take_back(dt, starts, i, j, rows, found.gap[order], moving, rules, gravity)
    counts[STEPS] += 1.0
    counts[ISLANDS] = len(starts) - 1
    counts[LARGEST] = 0.0
    for k in range(len(starts) - 1):
        counts[LARGEST] = max(counts[LARGEST], starts[k + 1] - starts[k])


@kernel(inner=True)
def rebound_at_surface(dt, fall, bodies, j, rows, start, gap, new):
    """Restitution of new contacts with what never moves, as if they had met at the surface and not where this step finds them.

    A body that falls with g into a depth d within the step has had v_s^2 = v^2 + g v dt - 2 g d at the surface, v being its speed at the
    start of the step. It shall leave the surface with e v_s, so have v'^2 + g v' dt = e^2 v_s^2 + 2 g d at the end: v'/v takes the place of
    e; it is 1 for e = 1. A body in free fall then leaves as fast as in closed form. g is the acceleration (fall, (3,)) along the normal.
    """
    for c in range(len(j)):
        n = vector(rows[c], NORMAL)
        v, g, d = -dot(vector(start[c], 0), n), dot(fall, n), -gap[c]
        at_surface = v * v + g * v * dt - 2.0 * g * d
        if j[c] < bodies or not new[c] or v <= 0.0 or g <= 0.0 or at_surface <= 0.0:
            continue
        half = 0.5 * g * dt
        leaving = math.sqrt(half * half + rows[c, RESTITUTION] ** 2 * at_surface + 2.0 * g * d) - half
        rows[c, RESTITUTION] = min(max(leaving / v, 0.0), 1.0) if rows[c, RESTITUTION] > 0.0 else 0.0


@kernel(inner=True)
def turn_with_drift(rows, start, load, left, new):
    """DRIFT of contacts that last: half of what the drifts between two steps do to u, taken from the last ones.

    A corner on which a body turns and that is left with u = 0 drifts to u = c, so that on the way the contact opens by c/2 dt and the body is
    lifted. Left with -c/2 it neither opens nor slides, and no energy is gained.
    """
    for c in range(len(rows)):
        if new[c] or rows[c, TARGET] > 0.0 or dot(vector(load[c], 0), vector(rows[c], NORMAL)) <= 0.0:
            continue
        for axis in range(3):
            rows[c, DRIFT + axis] = 0.5 * (start[c, axis] - left[c, axis])


@kernel(inner=True)
def solve_impacts(starts, i, j, rows, moving, before, start, rules, counts):
    """The impact phase of all islands; returns its impulses (c, 3) [N s]."""
    hit = np.zeros((len(i), 3))
    head, following = link_contacts(i, j, len(moving.mass))
    for k in range(len(starts) - 1):
        iterations, residual, capped = solve_impact(
            starts[k], starts[k + 1], i, j, rows, moving.velocity, moving.inverse, hit, before, start, head, following,
            rules.method, rules.quanta, rules.rest_speed, rules.tolerance, rules.most, rules.most_quanta,
        )  # fmt: skip
        if iterations > 0:
            counts[IMPACTS] += 1.0
            note(counts, IMPACT_ITERATIONS, iterations, residual, capped)
    return hit


@kernel(inline=True, inner=True)
def note(counts, which, iterations, residual, capped):
    counts[which] += iterations
    counts[MOST] = max(counts[MOST], iterations)
    counts[RESIDUAL] = max(counts[RESIDUAL], residual)
    counts[CAPPED] += 1.0 if capped else 0.0


@kernel(inner=True)
def solve_load(starts, i, j, rows, velocity, inverse, load, rules, counts):
    """The load phase of all islands: from the impulses (c, 3) of the step before, which are applied first.

    A solve that hits its cap with energy gained is done again without friction.
    """
    before, start = velocity.copy(), np.empty((len(i), 3))
    relative_of_all(0, len(i), i, j, rows, velocity, start)
    for k in range(len(starts) - 1):
        first, last = starts[k], starts[k + 1]
        push_all(first, last, i, j, rows, velocity, inverse, load[first:last])
        sweeps, residual, done = sweep_until_still(
            first, last, i, j, rows, velocity, inverse, load, rules.tolerance, rules.most
        )
        if not done:
            gained, exchanged = work_done(first, last, i, j, rows, velocity, load, start)
            for c in range(first, last):  # a rebound is held against gravity, which is no gain
                gained -= rows[c, TARGET] * dot(vector(load[c], 0), vector(rows[c], NORMAL))
            if gained > SPURIOUS * exchanged:
                friction = rows[first:last, FRICTION].copy()
                rows[first:last, FRICTION] = 0.0
                back_to(first, last, i, j, velocity, before, load)
                more, _, _ = sweep_until_still(
                    first, last, i, j, rows, velocity, inverse, load, rules.tolerance, rules.most
                )
                rows[first:last, FRICTION] = friction
                sweeps += more
        note(counts, LOAD_SWEEPS, sweeps, residual, not done)


@kernel(inner=True)
def book(i, j, rows, velocity, start, hit, load, energies):
    """Adds what this step's impulses have lost, -J.(u before + u after)/2, its normal part and the rest.

    With the velocities before the impact and after the load this is exact: the work of gravity in between is that of both half drifts.
    """
    after = np.empty((len(i), 3))
    relative_of_all(0, len(i), i, j, rows, velocity, after)
    for c in range(len(i)):
        n, u = vector(rows[c], NORMAL), vector(after[c], 0)
        one = (hit[c, 0] + load[c, 0], hit[c, 1] + load[c, 1], hit[c, 2] + load[c, 2])
        mean = times((u[0] + start[c, 0], u[1] + start[c, 1], u[2] + start[c, 2]), 0.5)
        pressing = dot(one, n) * dot(mean, n)
        energies[RESTITUTION_LOSS] -= pressing
        energies[FRICTION_LOSS] -= dot(one, mean) - pressing


@kernel()
def take_back(dt, starts, i, j, rows, gap, moving, rules, gravity):
    """Moves bodies that penetrate apart: a share `correction` of what goes beyond `slop`, less what they part by themselves in dt [s].

    By displacements of least kinetic energy that close no other contact. Returns the energy gained [J]: of gravity, and of rotation, as spins
    stay.
    """
    gained = 0.0
    for k in range(len(starts) - 1):
        first, last = starts[k], starts[k + 1]
        deep = False
        goal, push_out, parting = np.zeros(last - first), np.zeros(last - first), np.empty((last - first, 3))
        relative_of_all(first, last, i, j, rows, moving.velocity, parting)
        for c in range(first, last):
            size = moving.size[i[c]] if j[c] == len(moving.mass) else min(moving.size[i[c]], moving.size[j[c]])
            own = dt * max(dot(vector(parting[c - first], 0), vector(rows[c], NORMAL)), 0.0)
            goal[c - first] = max(0.0, rules.correction * (-gap[c] - rules.slop * size) - own)
            deep = deep or goal[c - first] > 0.0
        if deep:
            gained += move_apart(first, last, i, j, rows, goal, push_out, moving, gravity)
    return gained


@kernel(inner=True)
def move_apart(first, last, i, j, rows, goal, push_out, moving, gravity):
    """The displacements of one island, u.n >= goal (contacts,) [m] for each, by projected Gauss-Seidel.

    Returns the energy gained [J], of gravity and of rotation, as spins stay.
    """
    shift = np.zeros_like(moving.velocity)
    for _ in range(PROJECTION_SWEEPS):
        for c in range(first, last):
            row, at = rows[c], c - first
            n = vector(row, NORMAL)
            away = dot(relative(row, shift[i[c]], shift[j[c]]), n)
            new = max(0.0, push_out[at] + (goal[at] - away) / row[STIFF])
            change = times(n, new - push_out[at])
            push_out[at] = new
            push(row, change, shift[i[c]], shift[j[c]], moving.inverse[i[c]], moving.inverse[j[c]])
    gained = 0.0
    for c in range(first, last):
        for side in range(2):
            k = i[c] if side == 0 else j[c]
            if k == len(moving.mass):
                continue
            for axis in range(3):
                moving.x[k, axis] += shift[k, axis]
                gained -= moving.mass[k] * gravity[axis] * shift[k, axis]
            gained -= turning_energy(k, moving.inertia, moving.q, moving.velocity)
            one = (moving.q[k, 0], moving.q[k, 1], moving.q[k, 2], moving.q[k, 3])
            new_q = after_turn(one, (shift[k, 3], shift[k, 4], shift[k, 5]), 1.0)
            for axis in range(4):
                moving.q[k, axis] = new_q[axis]
            gained += turning_energy(k, moving.inertia, moving.q, moving.velocity)
            shift[k] = 0.0
    return gained
