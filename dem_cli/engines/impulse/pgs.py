"""Projected Gauss-Seidel: impulses of all contacts of an island that touch at once, one contact after the other until nothing changes."""

from __future__ import annotations

import math

from dem_cli.engines.impulse.rows import (
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
from dem_cli.engines.impulse.vectors import dot, plus, scaled, symmetric_times
from dem_cli.jit import kernel

SMALL, FINE = (
    32,
    1e-6,
)  # islands of so few contacts are solved to this share of the tolerance: it costs little, and flat bodies land flat


@kernel(inline=True)
def aim_of(contacts, tolerance):
    """The change of velocity [m/s] at which the solution of an island ends; one that ends below `tolerance` hit no cap."""
    return tolerance * FINE if contacts <= SMALL else tolerance


@kernel(inline=True)
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
        still = plus(old, -1.0, symmetric_times(symmetric(row, INVERSE), plus(u, -row[TARGET], n)))
        along = dot(still, n)
        if along >= 0.0 and dot(still, still) - along * along <= mu * mu * along * along:
            return still
    along = max(0.0, before - away / row[STIFF])
    if mu <= 0.0:
        return scaled(along, n)
    moved = plus(u, along - before, symmetric_times(symmetric(row, MATRIX), n))
    slip = plus(moved, -dot(moved, n), n)
    shear = plus(plus(old, -before, n), -1.0 / row[STIFF_ACROSS], slip)
    size, most = math.sqrt(dot(shear, shear)), mu * along
    return plus(scaled(along, n), most / size if size > most else 1.0, shear)


@kernel()
def sweep_until_still(first, last, i, j, rows, velocity, inverse, impulse, tolerance, most):
    """Solves the contacts first..last - 1 of an island; returns sweeps done and the largest change of a velocity [m/s] in the last one.

    impulse (c, 3) [N s], taken as applied already, and velocity (n + 1, 6) are changed in place. Ends once no contact changes by more than
    `tolerance` [m/s] (`aim_of`), or after `most` sweeps, which go to and fro, so that no contact is always first.
    """
    residual, aim = 0.0, aim_of(last - first, tolerance)
    for sweep in range(most):
        residual = 0.0
        for k in range(last - first):
            c = first + k if sweep % 2 == 0 else last - 1 - k
            row, of_i, of_j = rows[c], velocity[i[c]], velocity[j[c]]
            old = vector(impulse[c], 0)
            new = new_impulse(row, old, relative(row, of_i, of_j))
            change = plus(new, -1.0, old)
            size = dot(change, change)
            if size == 0.0:
                continue
            push(row, change, of_i, of_j, inverse[i[c]], inverse[j[c]])
            for axis in range(3):
                impulse[c, axis] = new[axis]
            residual = max(residual, math.sqrt(size) * row[STIFF])
        if residual <= aim:
            return sweep + 1, residual
    return most, residual
