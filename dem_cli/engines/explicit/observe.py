"""The contacts of an explicit run as they are shown to the world: by ids, sorted, in SI units."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.explicit.forces import ROW, R, X, Y, wall_direction
from dem_cli.jit import kernel


@kernel(inline=True)
def _touch(rows, walls, first, second, is_wall):
    """Unit normal from the first body, its distance from the second's centre or surface, and overlap."""
    a = ROW * first
    if is_wall:
        nx, ny, distance = wall_direction(rows[a + X], rows[a + Y], walls, second)
        return nx, ny, rows[a + R] - distance
    b = ROW * second
    dx, dy = rows[b + X] - rows[a + X], rows[b + Y] - rows[a + Y]
    distance = np.sqrt(dx * dx + dy * dy)
    inverse = 1.0 / distance
    return dx * inverse, dy * inverse, rows[a + R] + rows[b + R] - distance


@kernel()
def touching_contacts(rows, lists, walls, order, friction, kn, ks):
    """Contacts with overlap, sorted by (i, j), as in `state.Contacts`.

    rows: as in `forces.py`; lists: Lists with the memory of this instant; walls (w, 5); order (n,): id of the grain in each row;
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
        _, _, overlap = _touch(rows, walls, first, second, is_wall)
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
                memory, limit = lists.wall_memory[k], walls[second, 4]
            else:
                first, second = np.int64(owner[k]), np.int64(lists.neighbour[k])
                if order[first] != i:
                    first, second = second, first
                memory, limit = lists.memory[k], friction
            nx, ny, overlap = _touch(rows, walls, first, second, is_wall)
            arm = rows[ROW * first + R] - 0.5 * overlap
            normal, shear = kn * (overlap + memory[1]), -kn * (memory[0] + memory[2])
            i_of[m] = i
            columns[0, m], columns[1, m] = nx, ny
            columns[2, m], columns[3, m] = rows[ROW * first + X] + arm * nx, rows[ROW * first + Y] + arm * ny
            columns[4, m], columns[5, m], columns[6, m] = overlap, normal, shear
            columns[7, m] = memory[0] * kn / ks
            sliding[m] = abs(shear) >= limit * normal * (1.0 - 1e-9)
    return i_of, j, columns, sliding
