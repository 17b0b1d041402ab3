"""The contacts of an explicit run as they are shown to the world: by ids, sorted, in SI units."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.explicit.ellipses import FOUR, enlarged_overlap, wall_contact
from dem_cli.engines.explicit.forces import ROW, R, X, Y, wall_direction
from dem_cli.geometry.ellipse import gap_slopes, support, widest_gap
from dem_cli.jit import kernel


@kernel()
def _disc_touch(rows, walls, first, second, is_wall):
    """Unit normal from the first body, overlap, and the contact point seen from its centre."""
    a = ROW * first
    if is_wall:
        nx, ny, distance = wall_direction(rows[a + X], rows[a + Y], walls, second)
        overlap = rows[a + R] - distance
    else:
        b = ROW * second
        dx, dy = rows[b + X] - rows[a + X], rows[b + Y] - rows[a + Y]
        distance = np.sqrt(dx * dx + dy * dy)
        inverse = 1.0 / distance
        nx, ny, overlap = dx * inverse, dy * inverse, rows[a + R] + rows[b + R] - distance
    arm = rows[a + R] - 0.5 * overlap
    return nx, ny, overlap, arm * nx, arm * ny


@kernel()
def _ellipse_touch(rows, outlines, walls, first, second, is_wall, nx, ny):
    """As `_disc_touch`, from a normal that may be near; the overlap is that of the direction alone where it shows that there is none."""
    a, o, f = ROW * first, FOUR * first, outlines.fours
    if is_wall:
        nx, ny, gap, h, h1 = wall_contact(rows, outlines, a, walls, second)
        overlap = -gap
    else:
        b, e = ROW * second, FOUR * second
        dx, dy = rows[b + X] - rows[a + X], rows[b + Y] - rows[a + Y]
        mi, pi, qi, mj, pj, qj = f[o], f[o + 1], f[o + 2], f[e], f[e + 1], f[e + 2]
        if nx * nx + ny * ny > 0.0:
            gap, _, _ = gap_slopes(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny)
            if gap > 0.0:
                return nx, ny, -gap, 0.0, 0.0
        nx, ny, gap = widest_gap(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny)
        overlap = -gap
        if outlines.enlarged:
            overlap = enlarged_overlap(dx, dy, mi, pi, qi, mj, pj, qj, dx * nx + dy * ny)
        h, h1, _ = support(mi, pi, qi, nx, ny)
    arm = h - 0.5 * overlap
    return nx, ny, overlap, arm * nx - h1 * ny, arm * ny + h1 * nx


@kernel()
def _touch(rows, outlines, walls, first, second, is_wall, memory, sign):
    if outlines is not None:
        nx, ny = (0.0, 0.0) if is_wall else (sign * memory[3], sign * memory[4])
        return _ellipse_touch(rows, outlines, walls, first, second, is_wall, nx, ny)
    return _disc_touch(rows, walls, first, second, is_wall)


@kernel()
def touching_contacts(rows, outlines, lists, walls, order, friction, kn, ks):
    """Contacts with overlap, sorted by (i, j), as in `state.Contacts`.

    rows: as in `forces.py`; outlines: Outlines, or None for discs; lists: Lists with the memory of this instant; walls (w, 5);
    order (n,): id of the element in each row;
    friction [-] between grains; kn, ks [N/m]. Returns i, j (c,) int64, columns (8, c): nx, ny, px, py, overlap, normal, shear, stretch,
    and sliding (c,) bool.
    """
    n = order.size
    pairs = lists.neighbour.size
    owner = np.empty(pairs, np.int32)
    for i in range(n):
        owner[lists.start[i] : lists.start[i + 1]] = i
    entries = pairs + lists.wall_grain.size
    begin = np.zeros(n + 1, np.int64)
    on = np.zeros(entries, np.bool_)
    for k in range(entries):
        is_wall = k >= pairs
        first = np.int64(lists.wall_grain[k - pairs] if is_wall else owner[k])
        second = np.int64(lists.wall_number[k - pairs] if is_wall else lists.neighbour[k])
        memory = lists.wall_memory[k - pairs] if is_wall else lists.memory[k]
        _, _, overlap, _, _ = _touch(rows, outlines, walls, first, second, is_wall, memory, 1.0)
        if overlap > 0.0:
            on[k] = True
            i = order[first] if is_wall else min(order[first], order[second])
            begin[i + 1] += 1
    for i in range(n):
        begin[i + 1] += begin[i]
    fill = begin[:-1].copy()
    source, j = np.empty(begin[n], np.int64), np.empty(begin[n], np.int64)
    for k in range(entries):
        if on[k]:
            is_wall = k >= pairs
            if is_wall:
                i, other = order[lists.wall_grain[k - pairs]], np.int64(-1 - lists.wall_number[k - pairs])
            else:
                one, two = order[owner[k]], order[lists.neighbour[k]]
                i, other = min(one, two), max(one, two)
            m = fill[i]
            while m > begin[i] and j[m - 1] > other:
                j[m], source[m] = j[m - 1], source[m - 1]
                m -= 1
            j[m], source[m] = other, k
            fill[i] += 1
    i_of, columns, sliding = np.empty(begin[n], np.int64), np.empty((8, begin[n])), np.empty(begin[n], np.bool_)
    for i in range(n):
        for m in range(begin[i], begin[i + 1]):
            k = source[m]
            is_wall = k >= pairs
            if is_wall:
                k -= pairs
                first, second = np.int64(lists.wall_grain[k]), np.int64(lists.wall_number[k])
                memory, limit, sign = lists.wall_memory[k], walls[second, 4], 1.0
            else:
                first, second, sign = np.int64(owner[k]), np.int64(lists.neighbour[k]), 1.0
                if order[first] != i:
                    first, second, sign = second, first, -1.0
                memory, limit = lists.memory[k], friction
            nx, ny, overlap, arm_x, arm_y = _touch(rows, outlines, walls, first, second, is_wall, memory, sign)
            normal, shear = kn * (overlap + memory[1]), -kn * (memory[0] + memory[2])
            i_of[m] = i
            columns[0, m], columns[1, m] = nx, ny
            columns[2, m], columns[3, m] = rows[ROW * first + X] + arm_x, rows[ROW * first + Y] + arm_y
            columns[4, m], columns[5, m], columns[6, m] = overlap, normal, shear
            columns[7, m] = memory[0] * kn / ks
            sliding[m] = abs(shear) >= limit * normal * (1.0 - 1e-9)
    return i_of, j, columns, sliding
