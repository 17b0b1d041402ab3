"""Contacts of the granular element method: forces, contact stiffness and what sliding dissipates (Kishino 1988, section 2).

Bodies are discs; x (n, 3) holds their centre and r times their turn [m], so that all three have one unit. Grains come first, boundary
grains (chains, membranes) last. The fixing force F (n, 3) [N] of a disc is what would hold it at rest: F = sum T' P - B (5), its third
part the moment over r.
Four walls stand around a fixed centre; `box` is (centre x, centre y, half width, half height) [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dem_cli.geometry.cells import carry_memory, neighbour_list
from dem_cli.jit import kernel

# free; moved with the box; of a membrane: free but not to turn, and, next to a wall, free along x only
GRAIN, DRIVEN, MEMBRANE, TIED = 0, 1, 2, 3
# Rows of the memory of a contact: shear and normal force where the slider starts from ("anchor"), the same at the start of the
# sub-step, and the energy that sliding has cost in it [J].
SHEAR, NORMAL, STEP_SHEAR, STEP_NORMAL, LOST, OVERLAP, COLUMNS = 0, 1, 2, 3, 4, 5, 6
# Rows of the work of pairs: branch, sum of branches, relative turn, reach [m]; force [N].
EX, EY, MX, MY, TURN, REACH, FX, FY, DEPTH, WORK = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9
LEFT, RIGHT, BOTTOM, TOP = 0, 1, 2, 3
# Sums over the boundary: force times arm about the centre along x and y [N m], their stiffness against strain [N m], force on both walls
# across x and across y [N], smallest gap at these walls [m], contacts that opened or closed since the last look.
XX, YY, STIFF_X, STIFF_Y, WALL_X, WALL_Y, GAP_X, GAP_Y, FLIPS, SUMS = 0, 1, 2, 3, 4, 5, 6, 7, 8, 9


class Bodies(NamedTuple):
    """radius (n,) [m]; load (n, 2) [N]: body force; kind (n,); grains: number of free grains, which come first."""

    radius: np.ndarray
    load: np.ndarray
    kind: np.ndarray
    grains: int


class Law(NamedTuple):
    """kn, kt [N/m]; friction [-] and cohesion [N] between grains, wall_friction (4,) [-]; wall (4,) bool: which walls there are."""

    kn: float
    kt: float
    friction: float
    cohesion: float
    wall_friction: np.ndarray
    wall: np.ndarray


class Near(NamedTuple):
    """Contacts that may come to touch while no disc moves more than half a skin, and their forces at the last look.

    start, neighbour: half list; first, second (m,): the same as pairs; memory (COLUMNS, m); normal, shear [N], slip [m] (m,): what the slider
    has cut off since the anchor. disc, side (w,): disc and wall; wall_*: as for pairs; wall_depth (w,) [m]: overlap, gaps are negative.
    place (n, 2), box (4,): where the list was made; work
    (WORK, m): room for numbers of each pair.
    """

    start: np.ndarray
    neighbour: np.ndarray
    first: np.ndarray
    second: np.ndarray
    memory: np.ndarray
    normal: np.ndarray
    shear: np.ndarray
    slip: np.ndarray
    disc: np.ndarray
    side: np.ndarray
    wall_memory: np.ndarray
    wall_normal: np.ndarray
    wall_shear: np.ndarray
    wall_slip: np.ndarray
    wall_depth: np.ndarray
    place: np.ndarray
    box: np.ndarray
    work: np.ndarray


@kernel()
def no_list(n):
    """The list of n discs before the first look."""
    ints, floats, memory = np.zeros(0, np.int32), np.zeros(0), np.zeros((COLUMNS, 0))
    return Near(
        np.zeros(n + 1, np.int64), ints, ints, ints, memory, floats, floats, floats, ints, ints, memory, floats, floats, floats, floats,
        np.full((n, 2), np.inf), np.zeros(4), np.zeros((WORK, 0)),
    )  # fmt: skip


@kernel(inline=True)
def wall_of(side, box):
    """Unit normal of a wall (outward) and its distance from the origin along it: nx, ny, place."""
    if side == LEFT:
        return -1.0, 0.0, box[2] - box[0]
    if side == RIGHT:
        return 1.0, 0.0, box[0] + box[2]
    if side == BOTTOM:
        return 0.0, -1.0, box[3] - box[1]
    return 0.0, 1.0, box[1] + box[3]


@kernel()
def renew(x, bodies, law, box, skin, old):
    """The list at the present places, with the memory and forces of the old one. Pairs of boundary grains are left out."""
    n = bodies.radius.size
    start, neighbour = neighbour_list(x[:, 0].copy(), x[:, 1].copy(), bodies.radius, np.ones(n, np.bool_), skin)
    if bodies.grains < n:
        kept, count = np.empty_like(neighbour), 0
        for i in range(n):
            low, high = start[i], start[i + 1]
            start[i] = count
            for k in range(low, high):
                if i < bodies.grains or neighbour[k] < bodies.grains:
                    kept[count] = neighbour[k]
                    count += 1
        start[n] = count
        neighbour = kept[:count].copy()
    m = neighbour.size
    first = np.empty(m, np.int32)
    for i in range(n):
        first[start[i] : start[i + 1]] = i
    carried = np.empty((old.first.size, COLUMNS + 1))
    carried[:, :COLUMNS], carried[:, COLUMNS] = old.memory.T, old.normal
    carried = carry_memory(old.start, old.neighbour, carried, start, neighbour)

    disc, side = [np.int32(0) for _ in range(0)], [np.int32(0) for _ in range(0)]
    for i in range(n):
        for w in range(4):
            nx, ny, place = wall_of(w, box)
            near_wall = nx * x[i, 0] + ny * x[i, 1] + bodies.radius[i] > place - skin
            if near_wall and law.wall[w] and bodies.kind[i] == GRAIN:
                disc.append(np.int32(i))
                side.append(np.int32(w))
    k = len(disc)
    discs, sides, memory = np.empty(k, np.int32), np.empty(k, np.int32), np.zeros((k, COLUMNS + 1))
    seen = 0
    for c in range(k):
        discs[c], sides[c] = disc[c], side[c]
        while seen < old.disc.size and (
            old.disc[seen] < disc[c] or (old.disc[seen] == disc[c] and old.side[seen] < side[c])
        ):
            seen += 1
        if seen < old.disc.size and old.disc[seen] == disc[c] and old.side[seen] == side[c]:
            memory[c, :COLUMNS], memory[c, COLUMNS] = old.wall_memory[:, seen], old.wall_normal[seen]
    return Near(
        start, neighbour, first, neighbour, carried[:, :COLUMNS].T.copy(), carried[:, COLUMNS].copy(), np.zeros(m), np.zeros(m),
        discs, sides, memory[:, :COLUMNS].T.copy(), memory[:, COLUMNS].copy(), np.zeros(k), np.zeros(k), np.zeros(k),
        x[:, :2].copy(), box.copy(), np.empty((WORK, m)),
    )  # fmt: skip


@kernel()
def is_stale(x, box, near, skin):
    """Whether a disc or wall may have moved more than half the skin since the list was made."""
    most = 0.0
    for i in range(x.shape[0]):
        dx, dy = x[i, 0] - near.place[i, 0], x[i, 1] - near.place[i, 1]
        most = max(most, dx * dx + dy * dy)
    wall = max(abs(box[2] - near.box[2]), abs(box[3] - near.box[3]))
    return not most < 0.25 * skin * skin or not wall < 0.5 * skin


@kernel()
def _gather(x, anchor, near, bodies):
    """What the arithmetic of all pairs needs, side by side: branch, sum of the branches now and at the anchor, relative displacement and turn
    since the anchor, reach.
    """
    start, work = near.start, near.work
    for i in range(start.size - 1):
        xi, yi, ri = x[i, 0], x[i, 1], bodies.radius[i]
        ai, bi, qi = anchor[i, 0], anchor[i, 1], x[i, 2] - anchor[i, 2]
        for c in range(start[i], start[i + 1]):
            j = np.uint32(near.second[c])
            ex, ey = x[j, 0] - xi, x[j, 1] - yi
            fx, fy = anchor[j, 0] - ai, anchor[j, 1] - bi
            work[EX, c], work[EY, c] = ex, ey
            work[MX, c], work[MY, c] = ex + fx, ey + fy
            work[TURN, c] = qi + (x[j, 2] - anchor[j, 2])
            work[REACH, c] = ri + bodies.radius[j]


@kernel()
def _pair_law(ex, ey, mx, my, turn, reach, anchored, normal, shear, slip, fx, fy, depth, kn, kt, mu, cohesion):
    """Forces of all pairs from what was gathered, without a branch, so that several are done at once; returns how many opened or closed.

    The way of i against j since the anchor is (branch at the anchor) - (branch now) = m - 2 e.
    """
    flips = 0
    for c in range(ex.size):
        distance = math.sqrt(ex[c] * ex[c] + ey[c] * ey[c])
        depth[c] = reach[c] - distance
        p = kn * max(depth[c], 0.0)
        nx, ny = ex[c] / distance, ey[c] / distance
        along = 2.0 * (my[c] * ex[c] - mx[c] * ey[c]) / math.sqrt(mx[c] * mx[c] + my[c] * my[c]) + turn[c]
        trial = anchored[c] + kt * along
        touches = p > 0.0
        limit = mu * p + cohesion if touches else 0.0
        t = min(max(trial, -limit), limit)
        flips += touches != (normal[c] > 0.0)
        normal[c], shear[c] = p, t
        slip[c] = (trial - t) / kt if touches or anchored[c] != 0.0 else 0.0
        fx[c], fy[c] = p * nx - t * ny, p * ny + t * nx
    return flips


@kernel()
def forces(x, anchor, near, bodies, law, box, fixing, sums):
    """Fixing forces of all discs at x; the slider returns to its limit from the anchor.

    The normal force is kn times the overlap, a state; the tangential one starts from the memory and takes kt times the relative displacement
    since the anchor (n, 3), along the tangent in the middle of the way. fixing (n, 3) [N], sums (SUMS,) and the forces in `near`
    change in place.
    """
    kn, kt = law.kn, law.kt
    sums[:] = 0.0
    sums[GAP_X] = sums[GAP_Y] = np.inf
    work = near.work
    _gather(x, anchor, near, bodies)
    flips = _pair_law(
        work[EX], work[EY], work[MX], work[MY], work[TURN], work[REACH], near.memory[SHEAR], near.normal, near.shear, near.slip,
        work[FX], work[FY], work[DEPTH], kn, kt, law.friction, law.cohesion,
    )  # fmt: skip
    fixing[:] = 0.0
    for i in range(bodies.grains):  # the load of membranes comes with their pressure
        fixing[i, 0], fixing[i, 1] = -bodies.load[i, 0], -bodies.load[i, 1]
    for i in range(near.start.size - 1):
        sum_x = sum_y = sum_q = 0.0
        for c in range(near.start[i], near.start[i + 1]):
            if near.normal[c] > 0.0:
                j = np.uint32(near.second[c])
                fx, fy, t = work[FX, c], work[FY, c], near.shear[c]
                sum_x += fx
                sum_y += fy
                sum_q += t
                fixing[j, 0] -= fx
                fixing[j, 1] -= fy
                fixing[j, 2] += t
        fixing[i, 0] += sum_x
        fixing[i, 1] += sum_y
        fixing[i, 2] += sum_q
    if bodies.grains < bodies.radius.size:
        _sum_over_chain(x, near, bodies, law, box, sums)
    for c in range(near.disc.size):
        i, side = near.disc[c], near.side[c]
        nx, ny, place = wall_of(side, box)
        overlap = nx * x[i, 0] + ny * x[i, 1] + bodies.radius[i] - place
        near.wall_depth[c] = overlap
        along = (x[i, 1] - anchor[i, 1]) * nx - (x[i, 0] - anchor[i, 0]) * ny + (x[i, 2] - anchor[i, 2])
        trial = near.wall_memory[SHEAR, c] + kt * along
        if overlap <= 0.0:
            if near.wall_normal[c] > 0.0:
                flips += 1
            near.wall_normal[c] = near.wall_shear[c] = 0.0
            near.wall_slip[c] = trial / kt if near.wall_memory[SHEAR, c] != 0.0 else 0.0
            gap = GAP_X if side <= RIGHT else GAP_Y
            sums[gap] = min(sums[gap], -overlap)
            continue
        if near.wall_normal[c] == 0.0:
            flips += 1
        p = kn * overlap
        limit = law.wall_friction[side] * p
        t = min(max(trial, -limit), limit)
        near.wall_normal[c], near.wall_shear[c], near.wall_slip[c] = p, t, (trial - t) / kt
        fixing[i, 0] += p * nx - t * ny
        fixing[i, 1] += p * ny + t * nx
        fixing[i, 2] += t
        arm = box[2] if side <= RIGHT else box[3]
        sums[WALL_X if side <= RIGHT else WALL_Y] += p
        sums[XX if side <= RIGHT else YY] += p * arm
        sums[STIFF_X if side <= RIGHT else STIFF_Y] += kn * arm * arm
    sums[FLIPS] = flips


@kernel()
def _sum_over_chain(x, near, bodies, law, box, sums):
    """Adds the contacts of grains with boundary grains to the sums over the boundary."""
    for c in range(near.second.size):
        j = near.second[c]
        if near.normal[c] > 0.0 and j >= bodies.grains:
            i = near.first[c]
            ex, ey = near.work[EX, c], near.work[EY, c]
            distance = math.sqrt(ex * ex + ey * ey)
            nx, ny, arm = ex / distance, ey / distance, bodies.radius[i] - 0.5 * near.normal[c] / law.kn
            ax, ay = x[i, 0] + nx * arm - box[0], x[i, 1] + ny * arm - box[1]
            sums[XX] += near.work[FX, c] * ax
            sums[YY] += near.work[FY, c] * ay
            sums[STIFF_X] += (law.kn * nx * nx + law.kt * ny * ny) * ax * ax
            sums[STIFF_Y] += (law.kn * ny * ny + law.kt * nx * nx) * ay * ay


@kernel()
def count_contacts(near, touching, other):
    """Number of contacts that carry force on each disc, touching (n,), and the other body of the last one, other (n,), walls as -1 - side.

    Both are overwritten, `other` where there is a contact.
    """
    touching[:] = 0
    for c in range(near.first.size):
        if near.normal[c] > 0.0:
            i, j = near.first[c], near.second[c]
            touching[i] += 1
            touching[j] += 1
            other[i], other[j] = j, i
    for c in range(near.disc.size):
        if near.wall_normal[c] > 0.0:
            i = near.disc[c]
            touching[i] += 1
            other[i] = -1 - near.side[c]


@kernel(inline=True)
def _add(stiffness, i, nx, ny, kn, kt):
    """Add T' diag(kn, kt) T of a contact with the outward normal (nx, ny) to the block of disc i: xx, xy, xq, yy, yq, qq."""
    stiffness[i, 0] += kn * nx * nx + kt * ny * ny
    stiffness[i, 1] += (kn - kt) * nx * ny
    stiffness[i, 2] -= kt * ny
    stiffness[i, 3] += kn * ny * ny + kt * nx * nx
    stiffness[i, 4] += kt * nx
    stiffness[i, 5] += kt


@kernel()
def contact_stiffness(x, near, law, box, stiffness, last):
    """Contact stiffness S (8) of each disc, shape (n, 6) as xx, xy, xq, yy, yq, qq, with kt also where contacts slide.

    last (n, 2): normal of the last contact of each disc, towards the other body. Both are overwritten.
    """
    stiffness[:] = 0.0
    for c in range(near.first.size):
        if near.normal[c] > 0.0:
            i, j = near.first[c], near.second[c]
            ex, ey = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
            distance = math.sqrt(ex * ex + ey * ey)
            nx, ny = ex / distance, ey / distance
            _add(stiffness, i, nx, ny, law.kn, law.kt)
            _add(stiffness, j, -nx, -ny, law.kn, law.kt)
            last[i, 0], last[i, 1], last[j, 0], last[j, 1] = nx, ny, -nx, -ny
    for c in range(near.disc.size):
        if near.wall_normal[c] > 0.0:
            nx, ny, _ = wall_of(near.side[c], box)
            rough = law.kt if law.wall_friction[near.side[c]] > 0.0 else 0.0
            _add(stiffness, near.disc[c], nx, ny, law.kn, rough)
            last[near.disc[c], 0], last[near.disc[c], 1] = nx, ny
