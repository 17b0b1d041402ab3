"""Grains of several discs: bonds that hold discs together (thesis ch. 5) and rigid clumps.

Rows and units are those of `forces.py`; discs of one body lie side by side in the rows, and so do the bonds of one body.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.explicit.forces import ARC, FX, FY, MOBILITY, RATIO, ROW, TURN, Q, R, U, V, X, Y
from dem_cli.geometry.lanes import WIDTH, maximum, root, spread, unpack, where
from dem_cli.geometry.rows import load_rows, store_rows
from dem_cli.jit import kernel

# Columns of a bond. Share of the way from i to j at which the common point lies; Cn, Cs [N s/m], Cr [N m s].
SHARE, NORMAL, TANGENTIAL, ROLLING = range(4)
# Force on i along n and t over kn [m], moment on i over kn [m^2]; length at rest [m]; slip at the common point [m], turn of j against i [rad].
PULL, SHEAR, MOMENT, LENGTH, SLIP, ROLL = range(4, 10)
# What holds within a step: see `_geometry` and `_work_motion`.
NX, NY, AI, BI, AJ, BJ, REACH, AWAY, BESIDE, ABOUT = range(12, 22)
PULLED, SHEARED, TURNED = range(22, 25)  # what the forces came to over the step: forces times kicks
BOND = 25
TINY = 1e-280  # a viscosity that is none


class Bonded(NamedTuple):
    """Bonds of all bodies: first, second (b,) int32 row offsets of their discs; data (b * BOND,); edges (chunks + 1,): first bond of each
    chunk of grains, and b; paired: every disc has exactly one bond, so that bond k joins the rows 2 k and 2 k + 1.
    """

    first: np.ndarray
    second: np.ndarray
    data: np.ndarray
    edges: np.ndarray
    paired: bool


# The functions below take floats or Lanes. motion: (u, v, w) of the first and of the second disc, ways [m] and turn [rad] in a step; inertia:
# kn dt^2/m of both and kn dt^2/I of both.


@kernel(inline=True)
def _geometry(dx, dy, motion, share):
    """(nx, ny, ai, bi, aj, bj, reach): unit vector, where the common point lies from i and from j now, along n and t = (-ny, nx), and length.

    dx, dy: from i to j. Unit vector and length are those of the middle of the step, from the motion of the last one: what moves across the
    bond then neither stretches nor shortens it as it turns. But the forces act at the one common point of now: whatever their
    direction, they keep the angular momentum.
    """
    ui, vi, _, uj, vj, _ = motion
    mx, my = dx + 0.5 * (uj - ui), dy + 0.5 * (vj - vi)
    reach = root(mx * mx + my * my)
    inverse = 1.0 / reach
    nx, ny = mx * inverse, my * inverse
    along, across = dx * nx + dy * ny, dy * nx - dx * ny
    return nx, ny, share * along, share * across, (share - 1.0) * along, (share - 1.0) * across, reach


@kernel(inline=True)
def _relative(motion, geometry, share):
    """Motion of the second disc against the first in the middle of the step: away along n, beside along t [m], and about [rad]."""
    ui, vi, wi, uj, vj, wj = motion
    nx, ny, reach = geometry[0], geometry[1], geometry[6]
    du, dv = uj - ui, vj - vi
    return du * nx + dv * ny, dv * nx - du * ny - reach * ((1.0 - share) * wj + share * wi), wj - wi


@kernel(inline=True)
def _work_motion(motion, geometry):
    """The same at the common point of now, where the forces do their work."""
    ui, vi, wi, uj, vj, wj = motion
    nx, ny, ai, bi, aj, bj, _ = geometry
    du, dv = uj - ui, vj - vi
    return du * nx + dv * ny - wj * bj + wi * bi, dv * nx - du * ny + wj * aj - wi * ai, wj - wi


@kernel(inline=True)
def _pushed(motion, geometry, inertia, kick, pull, shear, moment):
    """The motion after `kick` steps of a bond's forces on the first disc and their reactions on the second."""
    ui, vi, wi, uj, vj, wj = motion
    nx, ny, ai, bi, aj, bj, _ = geometry
    mi, mj, ki, kj = inertia
    fx, fy = kick * (pull * nx - shear * ny), kick * (pull * ny + shear * nx)
    return (
        ui + mi * fx,
        vi + mi * fy,
        wi + kick * ki * (ai * shear - bi * pull + moment),
        uj - mj * fx,
        vj - mj * fy,
        wj - kick * kj * (aj * shear - bj * pull + moment),
    )


@kernel(inline=True)
def _settled(motion, geometry, inertia, share, give, forces):
    """Motion and forces once each dashpot gives what the motion after it asks for (backward Euler), one direction after the other.

    give: kn dt over the three viscosities; forces: (pull, shear, moment) that the motion holds already. What they lack acts over a whole step.
    """
    mi, mj, ki, kj = inertia
    ai, aj, reach = geometry[2], geometry[4], geometry[6]
    pull, shear, moment = forces
    away, _, _ = _relative(motion, geometry, share)
    more = (away - give[0] * pull) / (give[0] + mi + mj)
    motion, pull = _pushed(motion, geometry, inertia, 1.0, more, 0.0, 0.0), pull + more
    _, beside, _ = _relative(motion, geometry, share)
    turning = ki * ai * share - kj * aj * (1.0 - share)
    more = (beside - give[1] * shear) / (give[1] + mi + mj + reach * turning)
    motion, shear = _pushed(motion, geometry, inertia, 1.0, 0.0, more, 0.0), shear + more
    _, _, about = _relative(motion, geometry, share)
    more = (about - give[2] * moment) / (give[2] + ki + kj)
    motion, moment = _pushed(motion, geometry, inertia, 1.0, 0.0, 0.0, more), moment + more
    return motion, (pull, shear, moment)


@kernel(inline=True)
def _losses(impulses, before, after):
    """Twice the energy over kn that a bond takes from a motion: its forces over the step times the mean of the motions before and after."""
    return (
        impulses[0] * (before[0] + after[0])
        + impulses[1] * (before[1] + after[1])
        + impulses[2] * (before[2] + after[2])
    )


@kernel(inline=True)
def _impulses(kick, old, new):
    """Forces over the step: the known ones over `kick` steps, what was found to lack over a whole one."""
    return (
        kick * old[0] + (new[0] - old[0]),
        kick * old[1] + (new[1] - old[1]),
        kick * old[2] + (new[2] - old[2]),
    )


@kernel(inline=True)
def _read(rows, a, b):
    """Motion and inertia of the discs at the row offsets a and b."""
    ri, rj = 1.0 / rows[a + R], 1.0 / rows[b + R]
    mi, mj = rows[a + MOBILITY], rows[b + MOBILITY]
    motion = (rows[a + U], rows[a + V], rows[a + Q] * ri, rows[b + U], rows[b + V], rows[b + Q] * rj)
    return motion, (mi, mj, mi * rows[a + RATIO] * ri * ri, mj * rows[b + RATIO] * rj * rj)


@kernel(inline=True)
def _write(rows, a, b, motion):
    rows[a + U], rows[a + V], rows[a + Q] = motion[0], motion[1], motion[2] * rows[a + R]
    rows[b + U], rows[b + V], rows[b + Q] = motion[3], motion[4], motion[5] * rows[b + R]


@kernel(inline=True)
def _known(data, o):
    return data[o + NX], data[o + NY], data[o + AI], data[o + BI], data[o + AJ], data[o + BJ], data[o + REACH]


@kernel()
def prepare_bonds(rows, bonds, begin, end):
    """Geometry and motion of the bonds begin..end-1 before their discs are pushed."""
    data = bonds.data
    for k in range(begin, end):
        a, b, o = np.int64(bonds.first[k]), np.int64(bonds.second[k]), BOND * k
        motion, _ = _read(rows, a, b)
        dx, dy = rows[b + X] - rows[a + X], rows[b + Y] - rows[a + Y]
        geometry = _geometry(dx, dy, motion, data[o + SHARE])
        for m in range(7):
            data[o + NX + m] = geometry[m]
        data[o + AWAY], data[o + BESIDE], data[o + ABOUT] = _work_motion(motion, geometry)


@kernel()
def solve_bonds(rows, bonds, begin, end, kick, unit, backward, settle):
    """Forces of the bonds begin..end-1 on velocities that the other forces have changed already, over `kick` steps.

    Implicit, so any viscosity is stable, and a load F creeps at exactly F/C. One Gauss-Seidel sweep a step, in turn from either end and begun
    with the forces of the last step, follows chains as well as the full solution does (without that start it is wrong by
    orders of magnitude). unit: kn dt. settle: False in the half kick that ends a call, so that two halves come to what one whole kick would:
    corrections over half a step would be twice as large, and from call to call they would grow. Returns twice the energy lost, over kn.
    """
    data, lost = bonds.data, 0.0
    for k in range(begin, end):
        a, b, o = np.int64(bonds.first[k]), np.int64(bonds.second[k]), BOND * k
        motion, inertia = _read(rows, a, b)
        forces = data[o + PULL], data[o + SHEAR], data[o + MOMENT]
        data[o + PULLED], data[o + SHEARED], data[o + TURNED] = _impulses(kick, forces, forces)
        _write(rows, a, b, _pushed(motion, _known(data, o), inertia, kick, *forces))
    for m in range(end - begin if settle else 0):
        k = end - 1 - m if backward else begin + m
        a, b, o = np.int64(bonds.first[k]), np.int64(bonds.second[k]), BOND * k
        motion, inertia = _read(rows, a, b)
        give = unit / data[o + NORMAL], unit / data[o + TANGENTIAL], unit / max(data[o + ROLLING], TINY)
        old = data[o + PULL], data[o + SHEAR], data[o + MOMENT]
        motion, forces = _settled(motion, _known(data, o), inertia, data[o + SHARE], give, old)
        data[o + PULL], data[o + SHEAR], data[o + MOMENT] = forces
        data[o + PULLED], data[o + SHEARED], data[o + TURNED] = _impulses(kick, old, forces)
        _write(rows, a, b, motion)
    for k in range(begin, end):
        o = BOND * k
        motion, _ = _read(rows, np.int64(bonds.first[k]), np.int64(bonds.second[k]))
        impulses = data[o + PULLED], data[o + SHEARED], data[o + TURNED]
        before = data[o + AWAY], data[o + BESIDE], data[o + ABOUT]
        lost += _losses(impulses, before, _work_motion(motion, _known(data, o)))
    return lost


@kernel()
def follow_bonds(rows, bonds, begin, end):
    """Add the motion of a step to slip and roll of the bonds begin..end-1."""
    data = bonds.data
    for k in range(begin, end):
        o = BOND * k
        motion, _ = _read(rows, np.int64(bonds.first[k]), np.int64(bonds.second[k]))
        _, beside, about = _relative(motion, _known(data, o), data[o + SHARE])
        data[o + SLIP] += beside
        data[o + ROLL] += about


@kernel(inline=True)
def _kicked(rows, a, kick, fx, fy):
    """Four discs whose rows begin at a, a + 2 ROW, ...: places, motion before and after their forces, inertia, radius and what rows hold."""
    x, y, u, v = load_rows(rows, a, 2 * ROW)
    q, r, mobility, arc = load_rows(rows, a + Q, 2 * ROW)
    pushes_x, pushes_y, ratio, turn = load_rows(rows, a + FX, 2 * ROW)
    inverse = 1.0 / r
    turnable = mobility * ratio * inverse
    share = where(mobility > 0.0, spread(kick), 0.0)
    before = (u, v, q * inverse)
    after = (
        u + share * (mobility * pushes_x + fx),
        v + share * (mobility * pushes_y + fy),
        before[2] + share * turnable * turn,
    )
    return x, y, before, after, mobility, turnable * inverse, r, arc, ratio


@kernel(inline=True)
def _moved(rows, a, x, y, motion, r, mobility, arc, ratio):
    """Write four discs back after a step with their new motion, forces set to zero; returns squared displacements."""
    u, v, q = motion[0], motion[1], motion[2] * r
    zero = spread(0.0)
    store_rows(rows, a, 2 * ROW, x + u, y + v, u, v)
    store_rows(rows, a + Q, 2 * ROW, q, r, mobility, arc + q)
    store_rows(rows, a + FX, 2 * ROW, zero, zero, ratio, zero)
    return u * u + v * v


@kernel()
def move_pairs(rows, bonds, begin, end, kick, fx, fy, unit):
    """Leapfrog of the pairs begin..end-1, a multiple of WIDTH, four at a time: what prepare, push, solve, drift and follow do one by one.

    Returns (largest squared displacement [m^2], twice the energy lost to bonds over kn).
    """
    data = bonds.data
    most, lost = spread(0.0), spread(0.0)
    for k in range(begin, end, WIDTH):
        a, b, o = 2 * ROW * k, 2 * ROW * k + ROW, BOND * k
        share, normal, tangential, rolling = load_rows(data, o, BOND)
        pull, shear, moment, length = load_rows(data, o + PULL, BOND)
        slip, roll, _, _ = load_rows(data, o + SLIP, BOND)
        xi, yi, before_i, after_i, mi, ki, ri, arc_i, ratio_i = _kicked(rows, a, kick, fx, fy)
        xj, yj, before_j, after_j, mj, kj, rj, arc_j, ratio_j = _kicked(rows, b, kick, fx, fy)
        before, inertia = before_i + before_j, (mi, mj, ki, kj)
        geometry = _geometry(xj - xi, yj - yi, before, share)
        give = unit / normal, unit / tangential, unit / maximum(rolling, TINY)
        motion = _pushed(after_i + after_j, geometry, inertia, kick, pull, shear, moment)
        old = (pull, shear, moment)
        motion, forces = _settled(motion, geometry, inertia, share, give, old)
        impulses = _impulses(kick, old, forces)
        lost = lost + _losses(impulses, _work_motion(before, geometry), _work_motion(motion, geometry))
        relative = _relative(motion, geometry, share)
        store_rows(data, o + PULL, BOND, forces[0], forces[1], forces[2], length)
        zero = spread(0.0)
        store_rows(data, o + SLIP, BOND, slip + relative[1], roll + relative[2], zero, zero)
        most = maximum(_moved(rows, a, xi, yi, motion[:3], ri, mi, arc_i, ratio_i), most)
        most = maximum(_moved(rows, b, xj, yj, motion[3:], rj, mj, arc_j, ratio_j), most)
    p, q, r, s = unpack(most)
    t, u, v, w = unpack(lost)
    return max(max(p, q), max(r, s)), t + u + v + w


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
