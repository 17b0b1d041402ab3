"""Projected Gauss-Seidel: impulses of all contacts of an island that touch at once, one contact after the other until nothing changes."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.engines.impulse.rows import (
    DRIFT,
    FRICTION,
    INVERSE,
    MATRIX,
    NORMAL,
    STIFF,
    STIFF_ACROSS,
    TARGET,
    push,
    relative,
    symmetric,
    vector,
)
from dem_cli.engines.impulse.symmetric import symmetric_times
from dem_cli.engines.impulse.vectors import along, dot, times
from dem_cli.jit import kernel

# Islands of so few contacts, or of so few bodies (a cloud has a contact for each particle of a face), are solved to this share of the
# tolerance, in so many sweeps at most: flat bodies land flat, stacks stand.
SMALL, FEW, FINE, FINE_SWEEPS = 64, 4, 1e-9, 500
FIRST = 1e-2  # [m/s] of the first change, beyond which the aim of larger islands grows with it


@kernel(inner=True)
def is_small(first, last, i, j, fixed):
    """Whether an island has at most SMALL contacts or FEW bodies; `fixed` is the number of what never moves."""
    if last - first <= SMALL:
        return True
    seen, many = np.empty(FEW, np.int64), 0
    for c in range(first, last):
        for k in (i[c], j[c]):
            new = k != fixed
            for m in range(many):
                new = new and seen[m] != k
            if new and many == FEW:
                return False
            if new:
                seen[many] = k
                many += 1
    return True


@kernel(inline=True, inner=True)
def aim_of(small, tolerance):
    """The change of velocity [m/s] at which the solution of an island ends; one that ends below `tolerance` hit no cap either way."""
    return tolerance * FINE if small else tolerance


@kernel(inline=True, inner=True)
def new_impulse(row, old, u):
    """The impulse [N s] of one contact that, with all others as they are, lets its bodies neither approach nor slide; or with
    sliding, the impulse on the friction cone. old: the present one, u: relative velocity with it.

    Sticking: J = J_old - K^-1 (u - target n), if J.n >= 0 and |J_t| <= mu J.n. Else J_n = max(0, J_n,old - (u.n - target)/(n.K.n)),
    and J_t follows the slip, to the edge of the cone at most.
    """
    n, mu = vector(row, NORMAL), row[FRICTION]
    away = dot(u, n) - row[TARGET]
    before = dot(old, n)
    if mu > 0.0:
        still = along(old, symmetric_times(symmetric(row, INVERSE), along(u, n, -row[TARGET])), -1.0)
        pressing = dot(still, n)
        if pressing >= 0.0 and dot(still, still) - pressing * pressing <= mu * mu * pressing * pressing:
            return still
    pressing = max(0.0, before - away / row[STIFF])
    if mu <= 0.0:
        return times(n, pressing)
    moved = along(u, symmetric_times(symmetric(row, MATRIX), n), pressing - before)
    slip = along(moved, n, -dot(moved, n))
    shear = along(along(old, n, -before), slip, -1.0 / row[STIFF_ACROSS])
    size, most = math.sqrt(dot(shear, shear)), mu * pressing
    return along(times(n, pressing), shear, most / size if size > most else 1.0)


@kernel(inline=True, inner=True)
def sweep(first, last, backwards, i, j, rows, velocity, inverse, impulse, change):
    """One sweep over the contacts first..last - 1; returns the sum of the squared changes of their velocities [m^2/s^2], and that of the
    energies dJ.K.dJ [J] that the changes dJ stand for.

    change (contacts, 3) [N s]: by how much each impulse has changed.
    """
    speeds, energies = 0.0, 0.0
    for k in range(last - first):
        c = last - 1 - k if backwards else first + k
        row, of_i, of_j = rows[c], velocity[i[c]], velocity[j[c]]
        old = vector(impulse[c], 0)
        new = new_impulse(row, old, along(relative(row, of_i, of_j), vector(row, DRIFT), 1.0))
        step = along(new, old, -1.0)
        push(row, step, of_i, of_j, inverse[i[c]], inverse[j[c]])
        for axis in range(3):
            impulse[c, axis] = new[axis]
            change[c - first, axis] = step[axis]
        energy = dot(step, step) * row[STIFF]
        energies += energy
        speeds += energy * row[STIFF]
    return speeds, energies


@kernel(inner=True)
def sweep_until_still(first, last, i, j, rows, velocity, inverse, impulse, tolerance, most):
    """Solves the contacts first..last - 1 of an island; returns sweeps done, the change of velocity [m/s] in the last one, root mean square,
    and whether that is enough.

    impulse (c, 3) [N s], taken as applied already, and velocity (n + 1, 6) are changed in place. Ends once the change is below `tolerance`
    [m/s], times first change / FIRST where that is more (small islands: `aim_of`), or after `most` sweeps, which go to and fro, so that no
    contact is always first. What a sweep changes is taken for the
    gradient of a nonlinear conjugate gradient method (Silcowitz-Hansen, Niebe and Erleben 2010): a share of the last direction is added
    after it, unless changes grow. The last sweep ends on the cones.
    """
    contacts = last - first
    small = is_small(first, last, i, j, len(velocity) - 1)
    aim, before, residual = aim_of(small, tolerance), 0.0, 0.0
    change, direction = np.empty((contacts, 3)), np.zeros((contacts, 3))
    for number in range(most):
        speeds, energies = sweep(first, last, number % 2 == 1, i, j, rows, velocity, inverse, impulse, change)
        residual = math.sqrt(speeds / contacts)
        if number == 0 and not small:
            aim *= max(1.0, residual / FIRST)
        if residual <= aim or (number + 1 >= FINE_SWEEPS and residual <= tolerance):
            return number + 1, residual, True
        share = energies / before if before > 0.0 else 2.0
        before = energies
        if share > 1.0:
            direction[:] = change
        elif number + 1 < most:
            for k in range(contacts):
                c = first + k
                more = times(vector(direction[k], 0), share)
                push(rows[c], more, velocity[i[c]], velocity[j[c]], inverse[i[c]], inverse[j[c]])
                for axis in range(3):
                    impulse[c, axis] += more[axis]
                    direction[k, axis] = more[axis] + change[k, axis]
    return most, residual, residual <= tolerance
