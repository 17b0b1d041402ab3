"""Contacts as the solvers see them: one row of numbers each, and what an impulse does to the two bodies.

A contact holds body i and body j, or what never moves, whose number is n, at one common point p; r = p - x is the arm of each.
With the normal n from i to j the relative velocity is u = (v_j + w_j x r_j) - (v_i + w_i x r_i); they approach while u.n < 0. The impulse J
acts on j at p and -J on i, so that u changes by K J, K = (1/m_i + 1/m_j) 1 - [r_i] I_i^-1 [r_i] - [r_j] I_j^-1 [r_j] (article).
"""

from __future__ import annotations

from dem_cli.engines.impulse.symmetric import symmetric_inverse, symmetric_times
from dem_cli.engines.impulse.vectors import across, along, cross, dot, times
from dem_cli.jit import kernel

# Columns of a row: arms, normal, K and its inverse (xx, yy, zz, xy, xz, yz), n.K.n, an upper bound of t.K.t, friction,
# restitution, the least u.n [m/s] to be reached, and what is added to u in the law: half of its change by the coming drift [m/s].
ARM_I, ARM_J, NORMAL, MATRIX, INVERSE = 0, 3, 6, 9, 15
STIFF, STIFF_ACROSS, FRICTION, RESTITUTION, TARGET = 21, 22, 23, 24, 25
DRIFT, WIDTH = 26, 29


@kernel(inline=True, inner=True)
def vector(row, at):
    return row[at], row[at + 1], row[at + 2]


@kernel(inline=True, inner=True)
def symmetric(row, at):
    return row[at], row[at + 1], row[at + 2], row[at + 3], row[at + 4], row[at + 5]


@kernel(inline=True, inner=True)
def relative(row, of_i, of_j):
    """u [m/s] from the velocities (6,) of the two bodies."""
    ri, rj = vector(row, ARM_I), vector(row, ARM_J)
    wi, wj = cross(vector(of_i, 3), ri), cross(vector(of_j, 3), rj)
    return (
        of_j[0] + wj[0] - of_i[0] - wi[0],
        of_j[1] + wj[1] - of_i[1] - wi[1],
        of_j[2] + wj[2] - of_i[2] - wi[2],
    )


@kernel(inline=True, inner=True)
def push(row, impulse, of_i, of_j, inverse_i, inverse_j):
    """Changes the velocities (6,) of the two bodies by the impulse [N s] on j, and its opposite on i."""
    turn_i = symmetric_times(symmetric(inverse_i, 1), cross(vector(row, ARM_I), impulse))
    turn_j = symmetric_times(symmetric(inverse_j, 1), cross(vector(row, ARM_J), impulse))
    for axis in range(3):
        of_i[axis] -= inverse_i[0] * impulse[axis]
        of_j[axis] += inverse_j[0] * impulse[axis]
        of_i[3 + axis] -= turn_i[axis]
        of_j[3 + axis] += turn_j[axis]


@kernel(inner=True)
def relative_of_all(first, last, i, j, rows, velocity, u):
    """Writes u (last - first, 3) [m/s] of the contacts first..last - 1."""
    for c in range(first, last):
        one = relative(rows[c], velocity[i[c]], velocity[j[c]])
        for axis in range(3):
            u[c - first, axis] = one[axis]


@kernel(inner=True)
def push_all(first, last, i, j, rows, velocity, inverse, impulse):
    """Applies the impulses (last - first, 3) [N s] of the contacts first..last - 1."""
    for c in range(first, last):
        push(rows[c], vector(impulse[c - first], 0), velocity[i[c]], velocity[j[c]], inverse[i[c]], inverse[j[c]])


@kernel(inline=True, inner=True)
def of_both(inverse_i, inverse_j, ri, rj, unit):
    """K times a vector."""
    turn_i = cross(symmetric_times(symmetric(inverse_i, 1), cross(ri, unit)), ri)
    turn_j = cross(symmetric_times(symmetric(inverse_j, 1), cross(rj, unit)), rj)
    return along(along(times(unit, inverse_i[0] + inverse_j[0]), turn_i, 1.0), turn_j, 1.0)


@kernel()
def fill_rows(i, j, point, normal, x, inverse, restitution, friction, rows):
    """Writes rows (c, WIDTH) of the contacts i, j (c,), point, normal (c, 3) between bodies at x (n + 1, 3), with restitution and
    friction (c,); j is n for what never moves. Targets become 0."""
    for c in range(len(i)):
        a, b, row = i[c], j[c], rows[c]
        n = vector(normal[c], 0)
        for axis in range(3):
            row[ARM_I + axis] = point[c, axis] - x[a, axis]
            row[ARM_J + axis] = point[c, axis] - x[b, axis]
            row[NORMAL + axis] = n[axis]
        ri, rj = vector(row, ARM_I), vector(row, ARM_J)
        kx = of_both(inverse[a], inverse[b], ri, rj, (1.0, 0.0, 0.0))
        ky = of_both(inverse[a], inverse[b], ri, rj, (0.0, 1.0, 0.0))
        kz = of_both(inverse[a], inverse[b], ri, rj, (0.0, 0.0, 1.0))
        k = (kx[0], ky[1], kz[2], 0.5 * (kx[1] + ky[0]), 0.5 * (kx[2] + kz[0]), 0.5 * (ky[2] + kz[1]))
        back = symmetric_inverse(k)
        for axis in range(6):
            row[MATRIX + axis] = k[axis]
            row[INVERSE + axis] = back[axis]
        t = across(n)
        s = cross(n, t)
        kt, ks = symmetric_times(k, t), symmetric_times(k, s)
        row[STIFF] = dot(n, symmetric_times(k, n))
        row[STIFF_ACROSS] = max(dot(t, kt), dot(s, ks)) + abs(dot(s, kt))
        row[FRICTION] = friction[c]
        row[RESTITUTION] = restitution[c]
        row[TARGET] = row[DRIFT] = row[DRIFT + 1] = row[DRIFT + 2] = 0.0
