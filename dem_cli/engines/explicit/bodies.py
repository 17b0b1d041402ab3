"""Grains of several discs: bonds that hold discs together (thesis ch. 5) and rigid clumps.

Rows and units are those of `forces.py`; discs of one body lie side by side in the rows, and so do the bonds of one body.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.explicit.forces import ARC, FX, FY, MOBILITY, RATIO, ROW, TURN, Q, R, U, V, X, Y
from dem_cli.jit import kernel

# Columns of a bond. Fixed: share of the way from i to j at which the common point lies, Cn, Cs [N s/m], Cr [N m s], length at rest [m].
SHARE, NORMAL, TANGENTIAL, ROLLING, LENGTH = range(5)
# Its memory: force on i along n and t over kn [m], moment on i over kn [m^2], slip at the common point [m], turn of j against i.
PULL, SHEAR, MOMENT, SLIP, ROLL = range(5, 10)
# What holds within a step: unit vector n from i to j at its middle; places of the common point seen from i and j along n and t = (-ny, nx);
# motion of j against i before the step along n, t and about.
NX, NY, AI, BI, AJ, BJ, FAR_N, FAR_T, FAR_R = range(10, 19)
BOND = 19


class Bonded(NamedTuple):
    """Bonds of all bodies: first, second (b,) int32 row offsets of their discs; data (b * BOND,); edges (chunks + 1,): first bond of each
    chunk of grains, and b.
    """

    first: np.ndarray
    second: np.ndarray
    data: np.ndarray
    edges: np.ndarray


@kernel(inline=True)
def _motion(rows, a, b, data, o):
    """Motion of the second disc against the first at the common point: along n, along t [m] and about [rad] in a step."""
    nx, ny = data[o + NX], data[o + NY]
    du, dv = rows[b + U] - rows[a + U], rows[b + V] - rows[a + V]
    wi, wj = rows[a + Q] / rows[a + R], rows[b + Q] / rows[b + R]
    return (
        du * nx + dv * ny - wj * data[o + BJ] + wi * data[o + BI],
        dv * nx - du * ny + wj * data[o + AJ] - wi * data[o + AI],
        wj - wi,
    )


@kernel()
def prepare_bonds(rows, bonds, begin, end):
    """Geometry and motion of the bonds begin..end-1 before their discs are pushed.

    The unit vector is that of the middle of the step, from the motion of the last one: so a turning body neither shrinks nor grows. The forces
    act at the one common point of now: whatever their direction, they keep the angular momentum.
    """
    data = bonds.data
    for k in range(begin, end):
        a, b, o = np.int64(bonds.first[k]), np.int64(bonds.second[k]), BOND * k
        dx, dy = rows[b + X] - rows[a + X], rows[b + Y] - rows[a + Y]
        mx, my = dx + 0.5 * (rows[b + U] - rows[a + U]), dy + 0.5 * (rows[b + V] - rows[a + V])
        inverse = 1.0 / np.sqrt(mx * mx + my * my)
        nx, ny = mx * inverse, my * inverse
        along, across = dx * nx + dy * ny, dy * nx - dx * ny
        share = data[o + SHARE]
        data[o + NX], data[o + NY] = nx, ny
        data[o + AI], data[o + BI] = share * along, share * across
        data[o + AJ], data[o + BJ] = (share - 1.0) * along, (share - 1.0) * across
        data[o + FAR_N], data[o + FAR_T], data[o + FAR_R] = _motion(rows, a, b, data, o)


@kernel(inline=True)
def _push(rows, a, b, data, o, kick, pull, shear, moment):
    """Change velocities by `kick` steps of a bond's force on the first disc and its reaction on the second."""
    nx, ny = data[o + NX], data[o + NY]
    fx, fy = kick * (pull * nx - shear * ny), kick * (pull * ny + shear * nx)
    mi, mj = rows[a + MOBILITY], rows[b + MOBILITY]
    rows[a + U] += mi * fx
    rows[a + V] += mi * fy
    rows[b + U] -= mj * fx
    rows[b + V] -= mj * fy
    about_i = data[o + AI] * shear - data[o + BI] * pull + moment
    about_j = data[o + AJ] * shear - data[o + BJ] * pull + moment
    rows[a + Q] += kick * mi * rows[a + RATIO] / rows[a + R] * about_i
    rows[b + Q] -= kick * mj * rows[b + RATIO] / rows[b + R] * about_j


@kernel(inline=True)
def _solve(rows, a, b, data, o, kick, unit):
    """Set the forces of one bond to what its dashpots give for the motion after them (backward Euler), one direction after the other.

    unit: kn dt, which turns a viscosity into force over kn per way in a step.
    """
    mi, mj = rows[a + MOBILITY], rows[b + MOBILITY]
    ri, rj = rows[a + R], rows[b + R]
    ki, kj = mi * rows[a + RATIO] / (ri * ri), mj * rows[b + RATIO] / (rj * rj)
    ai, bi, aj, bj = data[o + AI], data[o + BI], data[o + AJ], data[o + BJ]
    away, _, _ = _motion(rows, a, b, data, o)
    give = unit / data[o + NORMAL]
    pull = (away - give * data[o + PULL]) / (give + kick * (mi + mj + ki * bi * bi + kj * bj * bj))
    _push(rows, a, b, data, o, kick, pull, 0.0, 0.0)
    data[o + PULL] += pull
    _, beside, _ = _motion(rows, a, b, data, o)
    give = unit / data[o + TANGENTIAL]
    shear = (beside - give * data[o + SHEAR]) / (give + kick * (mi + mj + ki * ai * ai + kj * aj * aj))
    _push(rows, a, b, data, o, kick, 0.0, shear, 0.0)
    data[o + SHEAR] += shear
    if data[o + ROLLING] > 0.0:
        _, _, about = _motion(rows, a, b, data, o)
        give = unit / data[o + ROLLING]
        moment = (about - give * data[o + MOMENT]) / (give + kick * (ki + kj))
        _push(rows, a, b, data, o, kick, 0.0, 0.0, moment)
        data[o + MOMENT] += moment


@kernel()
def solve_bonds(rows, bonds, begin, end, kick, unit, backward):
    """Forces of the bonds begin..end-1 on velocities that the other forces have changed already, over `kick` steps.

    Implicit, so any viscosity is stable, and a load F creeps at exactly F/C. One Gauss-Seidel sweep a step, in turn from either end and begun
    with the forces of the last step, follows chains as well as the full solution does (without that start it is wrong by
    orders of magnitude). Returns twice the energy lost, over kn.
    """
    data, lost = bonds.data, 0.0
    for k in range(begin, end):
        o = BOND * k
        a, b = np.int64(bonds.first[k]), np.int64(bonds.second[k])
        _push(rows, a, b, data, o, kick, data[o + PULL], data[o + SHEAR], data[o + MOMENT])
    for m in range(end - begin):
        k = end - 1 - m if backward else begin + m
        _solve(rows, np.int64(bonds.first[k]), np.int64(bonds.second[k]), data, BOND * k, kick, unit)
    for k in range(begin, end):
        o = BOND * k
        away, beside, about = _motion(rows, np.int64(bonds.first[k]), np.int64(bonds.second[k]), data, o)
        lost += kick * data[o + PULL] * (away + data[o + FAR_N])
        lost += kick * data[o + SHEAR] * (beside + data[o + FAR_T])
        lost += kick * data[o + MOMENT] * (about + data[o + FAR_R])
    return lost


@kernel()
def follow_bonds(rows, bonds, begin, end):
    """Add the motion of a step to slip and roll of the bonds begin..end-1."""
    data = bonds.data
    for k in range(begin, end):
        o = BOND * k
        _, beside, about = _motion(rows, np.int64(bonds.first[k]), np.int64(bonds.second[k]), data, o)
        data[o + SLIP] += beside
        data[o + ROLL] += about


class Cores(NamedTuple):
    """Rigid bodies: rows (bodies * ROW,) as of grains, velocity (bodies, 3) of the thesis' scheme, start (bodies + 1,): first element of each
    body; arms (n, 2): element's centre from the body's centre of mass [m]; edges (chunks + 1,): first body of each chunk.
    """

    rows: np.ndarray
    velocity: np.ndarray
    start: np.ndarray
    arms: np.ndarray
    edges: np.ndarray


@kernel()
def gather_cores(rows, cores, begin, end):
    """Forces on the elements of the bodies begin..end-1 become those of the bodies."""
    for body in range(begin, end):
        c = ROW * body
        fx = fy = moment = 0.0
        for i in range(cores.start[body], cores.start[body + 1]):
            a = ROW * i
            fx += rows[a + FX]
            fy += rows[a + FY]
            moment += rows[a + TURN] * rows[a + R] + cores.arms[i, 0] * rows[a + FY] - cores.arms[i, 1] * rows[a + FX]
        cores.rows[c + FX], cores.rows[c + FY], cores.rows[c + TURN] = fx, fy, moment / cores.rows[c + R]


@kernel()
def spread_cores(rows, cores, begin, end):
    """Elements follow the step of their bodies begin..end-1: turned arms, places, and displacements exact to rounding.

    An arm turns by Cayley's formula, which keeps its length, and moves by 2 tan(w/2) times the mean of its old and new place, turned by a
    right angle. Forces on the elements are set to zero. Returns the largest squared displacement [m^2].
    """
    most = 0.0
    for body in range(begin, end):
        c = ROW * body
        x, y, u, v = cores.rows[c + X], cores.rows[c + Y], cores.rows[c + U], cores.rows[c + V]
        turning = cores.rows[c + Q] / cores.rows[c + R]
        half = 0.5 * turning
        tangent = half + half * half * half / 3.0
        share = 1.0 / (1.0 + tangent * tangent)
        cos, sin = (1.0 - tangent * tangent) * share, 2.0 * tangent * share
        for i in range(cores.start[body], cores.start[body + 1]):
            a = ROW * i
            ox, oy = cores.arms[i, 0], cores.arms[i, 1]
            px, py = ox * cos - oy * sin, ox * sin + oy * cos
            cores.arms[i, 0], cores.arms[i, 1] = px, py
            rows[a + X], rows[a + Y] = x + px, y + py
            rows[a + U], rows[a + V] = u - tangent * (oy + py), v + tangent * (ox + px)
            rows[a + Q] = turning * rows[a + R]
            rows[a + ARC] += rows[a + Q]
            rows[a + FX] = rows[a + FY] = rows[a + TURN] = 0.0
            most = max(most, rows[a + U] ** 2 + rows[a + V] ** 2)
    return most


@kernel()
def spread_velocities(rows, velocity, cores, thesis):
    """Velocities of elements from those of their bodies at one instant; of the thesis' scheme, where they are kept apart."""
    for body in range(cores.start.size - 1):
        c = ROW * body
        u, v, q = cores.rows[c + U], cores.rows[c + V], cores.rows[c + Q]
        if thesis:
            u, v, q = cores.velocity[body, 0], cores.velocity[body, 1], cores.velocity[body, 2]
        turning = q / cores.rows[c + R]
        for i in range(cores.start[body], cores.start[body + 1]):
            a = ROW * i
            out = (u - turning * cores.arms[i, 1], v + turning * cores.arms[i, 0], turning * rows[a + R])
            if thesis:
                velocity[i, 0], velocity[i, 1], velocity[i, 2] = out
            else:
                rows[a + U], rows[a + V], rows[a + Q] = out
