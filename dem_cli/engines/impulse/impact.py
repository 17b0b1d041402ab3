"""The impact phase: velocities before this step's gravity, restitution and friction, and a guard that no impact gains energy."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.engines.impulse.pgs import SMALL, sweep_until_still
from dem_cli.engines.impulse.rows import FRICTION, NORMAL, RESTITUTION, TARGET, push_all, relative_of_all, vector
from dem_cli.engines.impulse.tracking import track_energy
from dem_cli.engines.impulse.vectors import dot
from dem_cli.jit import kernel

PGS, TRACKING = 0, 1
GAIN = 1e-12  # share of the energy exchanged that counts as rounding


@kernel(inner=True)
def work_done(first, last, i, j, rows, velocity, impulse, start):
    """Energy [J] that the impulses of contacts first..last - 1 have brought to the bodies, the sum of J.(u before + u after)/2, and
    the sum of |J.u before|.

    start (c, 3): u before [m/s].
    """
    gained, exchanged, after = 0.0, 0.0, np.empty((last - first, 3))
    relative_of_all(first, last, i, j, rows, velocity, after)
    for c in range(first, last):
        one, before = vector(impulse[c], 0), vector(start[c], 0)
        gained += 0.5 * (dot(one, before) + dot(one, vector(after[c - first], 0)))
        exchanged += abs(dot(one, before))
    return gained, exchanged


@kernel(inner=True)
def back_to(first, last, i, j, velocity, before, impulse):
    """Puts the velocities of the island's bodies back to `before`, and its impulses to zero."""
    for c in range(first, last):
        velocity[i[c]] = before[i[c]]
        velocity[j[c]] = before[j[c]]
        impulse[c] = 0.0


@kernel(inner=True)
def guard_energy(first, last, i, j, rows, velocity, inverse, impulse, before, start, tolerance, most):
    """Blends an impact that gained energy with one without restitution, so that none is gained.

    Returns sweeps, residual and whether that is enough, of the latter.

    The solution with e = 0 loses energy, half-spaces and friction cones are convex, so every blend J_0 + s (J_e - J_0) is admissible; s is the
    largest that gains nothing. Where even e = 0 gains energy, as friction that feeds the approach keeps it from ending, friction is left out.
    """
    exchange = last - first
    rebound, after = np.empty((exchange, 3)), np.empty((exchange, 3))
    gain_e, _ = work_done(first, last, i, j, rows, velocity, impulse, start)
    relative_of_all(first, last, i, j, rows, velocity, after)
    for c in range(first, last):
        rebound[c - first] = impulse[c]
        rows[c, TARGET] = 0.0
    back_to(first, last, i, j, velocity, before, impulse)
    sweeps, residual, done = sweep_until_still(first, last, i, j, rows, velocity, inverse, impulse, tolerance, most)
    gain_0, exchanged = work_done(first, last, i, j, rows, velocity, impulse, start)
    if gain_0 > GAIN * exchanged:
        friction = rows[first:last, FRICTION].copy()
        rows[first:last, FRICTION] = 0.0
        back_to(first, last, i, j, velocity, before, impulse)
        more, _, done = sweep_until_still(first, last, i, j, rows, velocity, inverse, impulse, tolerance, most)
        rows[first:last, FRICTION] = friction
        return sweeps + more, residual, done
    square, stopped = 0.0, np.empty((exchange, 3))
    relative_of_all(first, last, i, j, rows, velocity, stopped)
    for k in range(exchange):
        for axis in range(3):
            square += 0.5 * (rebound[k, axis] - impulse[first + k, axis]) * (after[k, axis] - stopped[k, axis])
    slope = gain_e - gain_0 - square
    share = 0.0
    if square > 0.0:
        share = (math.sqrt(max(slope * slope - 4.0 * square * gain_0, 0.0)) - slope) / (2.0 * square)
    share = min(max(share, 0.0), 1.0)
    blended = np.empty((exchange, 3))
    for c in range(first, last):
        for axis in range(3):
            blended[c - first, axis] = impulse[c, axis] + share * (rebound[c - first, axis] - impulse[c, axis])
    back_to(first, last, i, j, velocity, before, impulse)
    impulse[first:last] = blended
    push_all(first, last, i, j, rows, velocity, inverse, blended)
    return sweeps, residual, done


@kernel()
def solve_impact(
    first, last, i, j, rows, velocity, inverse, impulse, before, start, head, following, method, quanta, rest_speed, tolerance,
    most, most_quanta,
):  # fmt: skip
    """The impacts of one island, contacts first..last - 1: those that approach faster than `rest_speed` [m/s] rebound, the others stop.

    Returns iterations (0: no impact), the residual [m/s], and whether a cap was hit. impulse (c, 3) [N s] from zero, velocity (n + 1, 6) and
    targets of rows are changed in place: TARGET becomes the speed u.n [m/s] that the load phase must not fall below, that of a rebound where
    there was one. before (n + 1, 6), start (c, 3): velocities, and u of the contacts [m/s], as they are before. most: sweeps, most_quanta:
    quanta of energy tracking at most. Small islands that sweeps cannot solve, as friction feeds the approach (Painleve), are left to
    energy tracking.
    """
    fastest = 0.0
    for c in range(first, last):
        approach = -dot(vector(start[c], 0), vector(rows[c], NORMAL))
        fastest = max(fastest, approach)
        rows[c, TARGET] = rows[c, RESTITUTION] * approach if approach > rest_speed else 0.0
    if fastest <= rest_speed:
        return 0, 0.0, False
    iterations, residual, done = 0, math.inf, False
    if method == PGS:
        iterations, residual, done = sweep_until_still(
            first, last, i, j, rows, velocity, inverse, impulse, tolerance, most
        )
    if method == TRACKING or (not done and last - first <= SMALL):
        back_to(first, last, i, j, velocity, before, impulse)
        more, residual = track_energy(
            first, last, i, j, rows, velocity, inverse, impulse, head, following, quanta, tolerance, most_quanta
        )
        iterations, done = iterations + more, residual <= tolerance
    gained, exchanged = work_done(first, last, i, j, rows, velocity, impulse, start)
    if gained > GAIN * exchanged or (not done and method == TRACKING):
        more, left, ended = guard_energy(
            first, last, i, j, rows, velocity, inverse, impulse, before, start, tolerance, most
        )
        iterations, residual, done = iterations + more, max(residual, left), done and ended
    after = np.empty((last - first, 3))
    relative_of_all(first, last, i, j, rows, velocity, after)
    for c in range(first, last):
        parting = dot(vector(after[c - first], 0), vector(rows[c], NORMAL))
        met = dot(vector(impulse[c], 0), vector(rows[c], NORMAL)) > 0.0
        rows[c, TARGET] = max(0.0, parting) if met else 0.0
    return iterations, residual, not done
