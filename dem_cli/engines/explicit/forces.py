"""Forces of contacts on grains: discs with discs four at a time, walls one by one, both under the law of `law.py`.

Lengths are metres, forces are in units of kn and times in units of the step, so that most factors vanish. A grain is one row of
twelve: [x, y, u dt, v dt | q = w r dt, r, kn dt^2/m, r angle | Fx, Fy, m r^2/I, M/r, forces over kn]; each third of it is read at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.explicit.law import contact_force, contact_losses
from dem_cli.geometry.lanes import WIDTH, maximum, root, spread, unpack
from dem_cli.geometry.rows import gather_difference, gather_sum, load, scatter_action, store
from dem_cli.jit import kernel

X, Y, U, V, Q, R, MOBILITY, ARC, FX, FY, RATIO, TURN = range(12)
ROW = 12
CHUNK = 4096  # about as many grains as have rows and pairs that fit into the second level of cache


class Pairs(NamedTuple):
    """Contacts that may open or close soon: flat arrays, a pair an entry, sorted by the first body.

    chunk (chunks + 1,): where the pairs of each chunk of grains begin; those of two grains are padded to multiples of WIDTH.
    first, second: int32 offsets of the bodies' rows, ROW times their number (second: the number of the wall for walls); outer: entry
    of the list they were taken from, -1 for padding; spring, dashpot_n, dashpot_s: memory of the last step in units of kn;
    inertia_root: 1/sqrt(kn dt^2/m_eff); nx, ny: unit normal of the last step, of ellipses only.
    """

    chunk: np.ndarray
    first: np.ndarray
    second: np.ndarray
    outer: np.ndarray
    spring: np.ndarray
    dashpot_n: np.ndarray
    dashpot_s: np.ndarray
    inertia_root: np.ndarray
    nx: np.ndarray
    ny: np.ndarray


@kernel(inline=True)
def wall_direction(x, y, walls, w):
    """Unit vector from a point to the nearest point of wall w, and their distance (the wall may be met at its end)."""
    ex, ey = walls[w, 2] - walls[w, 0], walls[w, 3] - walls[w, 1]
    along = ((x - walls[w, 0]) * ex + (y - walls[w, 1]) * ey) / (ex * ex + ey * ey)
    along = min(max(along, 0.0), 1.0)
    dx, dy = walls[w, 0] + along * ex - x, walls[w, 1] + along * ey - y
    distance = np.sqrt(dx * dx + dy * dy)
    inverse = 1.0 / distance if distance > 0.0 else 0.0
    return dx * inverse, dy * inverse, distance


@kernel(inline=True)
def _approach(rows, pairs, k):
    """Relative place and motion of the pairs k..k+3 and the distance of their centres, lanes."""
    dx, dy, du, dv = gather_difference(rows, pairs.first, pairs.second, k, X)
    turning, reach = gather_sum(rows, pairs.first, pairs.second, k, Q)
    return dx, dy, du, dv, turning, reach, root(dx * dx + dy * dy)


@kernel(inline=True)
def _contact(pairs, k, approach, law, lost):
    """Law and memory of the pairs k..k+3: forces on the second discs (x, y, turn) and the losses so far, lanes."""
    dx, dy, du, dv, turning, reach, distance = approach
    inverse = 1.0 / distance
    nx, ny = dx * inverse, dy * inverse
    overlap, closing, sliding = reach - distance, -(du * nx + dv * ny), dv * nx - du * ny - turning
    spring = load(pairs.spring, k)
    normal, shear, stretched = contact_force(
        overlap, closing, sliding, spring, load(pairs.inertia_root, k), law.friction, law
    )
    old = (load(pairs.dashpot_n, k), load(pairs.dashpot_s, k), spring)
    new = (normal - maximum(overlap, 0.0), shear - stretched, stretched)
    n, s, f, c = contact_losses(overlap, closing, sliding, old, new, law)
    store(pairs.spring, k, stretched)
    store(pairs.dashpot_n, k, new[0])
    store(pairs.dashpot_s, k, new[1])
    forces = (normal * nx + shear * ny, normal * ny - shear * nx, shear)
    return forces, (lost[0] + n, lost[1] + s, lost[2] + f, lost[3] + c)


@kernel()
def pair_forces(rows, pairs, begin, end, law, losses):
    """Forces of the pairs begin..end-1 of discs on their grains; rows, memory and losses (4,) change in place.

    losses: twice the energies of contact_losses, in units of kn. Three groups of pairs are under way at once, one at each
    station: each waits long for its own root, division and sums, and so they run in each other's shade.
    """
    if begin == end:
        return
    zero = spread(0.0)
    lost = (zero, zero, zero, zero)
    forces = (zero, zero, zero)
    coming = _approach(rows, pairs, begin)
    done = begin
    for k in range(begin, end - WIDTH, WIDTH):
        later = _approach(rows, pairs, k + WIDTH)
        there, lost = _contact(pairs, k, coming, law, lost)
        scatter_action(rows, pairs.first, pairs.second, done, FX, *forces)
        coming, forces, done = later, there, k
    there, lost = _contact(pairs, end - WIDTH, coming, law, lost)
    scatter_action(rows, pairs.first, pairs.second, done, FX, *forces)
    scatter_action(rows, pairs.first, pairs.second, end - WIDTH, FX, *there)
    for m in range(4):
        a, b, c, d = unpack(lost[m])
        losses[m] += a + b + c + d


@kernel()
def wall_forces(rows, pairs, begin, end, walls, law, losses):
    """Forces of walls, bodies of infinite mass and no curvature, on grains under the same law, one contact at a time."""
    for k in range(begin, end):
        a, w = pairs.first[k], pairs.second[k]
        nx, ny, distance = wall_direction(rows[a + X], rows[a + Y], walls, w)
        overlap = rows[a + R] - distance
        closing = rows[a + U] * nx + rows[a + V] * ny
        sliding = rows[a + U] * ny - rows[a + V] * nx - rows[a + Q]
        spring = pairs.spring[k]
        normal, shear, stretched = contact_force(
            overlap, closing, sliding, spring, pairs.inertia_root[k], walls[w, 4], law
        )
        rows[a + FX] -= normal * nx + shear * ny
        rows[a + FY] -= normal * ny - shear * nx
        rows[a + TURN] += shear
        old = (pairs.dashpot_n[k], pairs.dashpot_s[k], spring)
        new = (normal - max(overlap, 0.0), shear - stretched, stretched)
        n, s, f_, c = contact_losses(overlap, closing, sliding, old, new, law)
        losses[0] += n
        losses[1] += s
        losses[2] += f_
        losses[3] += c
        pairs.spring[k], pairs.dashpot_n[k], pairs.dashpot_s[k] = stretched, new[0], new[1]
