"""Which contacts the explicit engine looks at: an outer list with a wide skin from the cell grid, an inner one taken from it.

The outer list is made anew when a grain may have moved half its skin, the inner one, some ten times shorter to walk, when it may have
moved half of a skin that suits the present speed. The memory of contacts goes along.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.explicit.forces import MOBILITY, ROW, Pairs, Q, R, X, Y, wall_direction
from dem_cli.geometry.cells import carry_memory, neighbour_list
from dem_cli.geometry.lanes import WIDTH
from dem_cli.jit import kernel

FINE, TOO_DEEP, NOT_A_NUMBER = 0, 1, 2


class Lists(NamedTuple):
    """Outer lists and the memory of their contacts, (entries, 3): spring, dashpot_n, dashpot_s in units of kn; for ellipses (entries, 5),
    with the unit normal of the last look (0, 0 for none).

    start, neighbour: half list of grains; wall_grain, wall_number: which grain may touch which wall.
    """

    start: np.ndarray
    neighbour: np.ndarray
    memory: np.ndarray
    wall_grain: np.ndarray
    wall_number: np.ndarray
    wall_memory: np.ndarray


@kernel()
def _wall_list(x, y, reach, alive, walls, skin, old_grain, old_wall, old_memory):
    """Which grains are closer to which wall than the skin, with the memory of those that were before.

    walls: (w, 5) x0, y0, x1, y1, friction. Returns grain int32, wall int32, memory (entries, c), sorted by grain then wall.
    """
    grain, number = [], []
    for i in range(x.size):
        if alive[i]:
            for w in range(walls.shape[0]):
                _, _, distance = wall_direction(x[i], y[i], walls, w)
                if distance < reach[i] + skin:
                    grain.append(np.int32(i))
                    number.append(np.int32(w))
    n = len(grain)
    new_grain, new_wall, memory = np.empty(n, np.int32), np.empty(n, np.int32), np.zeros((n, old_memory.shape[1]))
    old = 0
    for k in range(n):
        new_grain[k], new_wall[k] = grain[k], number[k]
        while old < old_grain.size and (
            old_grain[old] < grain[k] or (old_grain[old] == grain[k] and old_wall[old] < number[k])
        ):
            old += 1
        if old < old_grain.size and old_grain[old] == grain[k] and old_wall[old] == number[k]:
            memory[k] = old_memory[old]
    return new_grain, new_wall, memory


@kernel()
def _without_own(start, neighbour, body):
    """A half list without the pairs of elements of one body, body (n,)."""
    kept, count = np.empty_like(neighbour), 0
    new_start = np.zeros_like(start)
    for i in range(start.size - 1):
        for k in range(start[i], start[i + 1]):
            if body[neighbour[k]] != body[i]:
                kept[count] = neighbour[k]
                count += 1
        new_start[i + 1] = count
    return new_start, kept[:count].copy()


@kernel()
def outer_lists(x, y, reach, alive, walls, skin, body, old):
    """Outer lists at the present positions [m], with the memory of the `old` Lists.

    reach (n,): radius of the circle about each element [m]; body (n,): number of the body of each element, or None where each is its own.
    """
    start, neighbour = neighbour_list(x, y, reach, alive, skin)
    if body is not None:
        start, neighbour = _without_own(start, neighbour, body)
    memory = carry_memory(old.start, old.neighbour, old.memory, start, neighbour)
    grain, number, wall_memory = _wall_list(
        x, y, reach, alive, walls, skin, old.wall_grain, old.wall_number, old.wall_memory
    )
    return Lists(start, neighbour, memory, grain, number, wall_memory)


@kernel()
def empty_pairs(chunks, n, normals):
    m = n if normals else 0
    return Pairs(
        np.zeros(chunks + 1, np.int64), np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int32),
        np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(m), np.empty(m),
    )  # fmt: skip


@kernel()
def fill_up(pairs, count, n):
    """Pairs of the dummies n and n + 1 from `count` on, up to a multiple of WIDTH, which is returned."""
    while count % WIDTH != 0:
        pairs.first[count], pairs.second[count], pairs.outer[count] = ROW * n, ROW * (n + 1), -1
        pairs.spring[count] = pairs.dashpot_n[count] = pairs.dashpot_s[count] = pairs.inertia_root[count] = 0.0
        if pairs.nx.size > 0:
            pairs.nx[count], pairs.ny[count] = 1.0, 0.0
        count += 1
    return count


@kernel(inline=True)
def recall(pairs, n, memory, k):
    pairs.outer[n] = k
    pairs.spring[n], pairs.dashpot_n[n], pairs.dashpot_s[n] = memory[k, 0], memory[k, 1], memory[k, 2]


@kernel()
def not_finite(rows, n):
    """The first of n grains whose place or spin is not a finite number, or -1: lists of such grains would lead out of memory."""
    for i in range(n):
        a = ROW * i
        if not (abs(rows[a + X]) < np.inf and abs(rows[a + Y]) < np.inf and abs(rows[a + Q]) < np.inf):
            return i
    return -1


@kernel()
def inner_pairs(rows, lists, edges, skin, deepest):
    """Pairs of discs closer than `skin` [m], with their memory; a pair of far dummies fills up each chunk.

    rows ((n + 2) * ROW,): those of `forces.py`, the last two are the dummies; edges (chunks + 1,): first grain of each chunk, and n;
    deepest [-]: overlap over the smaller radius that ends the run. Returns (pairs, status, i, j): status TOO_DEEP names the pair.
    """
    n = lists.start.size - 1
    pairs = empty_pairs(edges.size - 1, lists.neighbour.size + WIDTH * edges.size, False)
    count, chunk, status, bad_i, bad_j = 0, 0, FINE, -1, -1
    for i in range(n):
        a = ROW * i
        x, y, r, mobility = rows[a + X], rows[a + Y], rows[a + R], rows[a + MOBILITY]
        for k in range(lists.start[i], lists.start[i + 1]):
            b = ROW * np.int64(lists.neighbour[k])
            dx, dy, reach = rows[b + X] - x, rows[b + Y] - y, r + rows[b + R]
            square = dx * dx + dy * dy
            if square < (reach + skin) * (reach + skin):
                pairs.first[count], pairs.second[count] = a, b
                pairs.inertia_root[count] = 1.0 / np.sqrt(mobility + rows[b + MOBILITY])
                recall(pairs, count, lists.memory, k)
                count += 1
                least = reach - deepest * min(r, rows[b + R])
                if square < least * least and status == FINE:
                    status, bad_i, bad_j = TOO_DEEP, i, lists.neighbour[k]
        if i + 1 == edges[chunk + 1]:
            count = fill_up(pairs, count, n)
            chunk += 1
            pairs.chunk[chunk] = count
    return cut(pairs, count), status, bad_i, bad_j


@kernel()
def inner_walls(rows, lists, edges, walls, skin, deepest):
    """Contacts of discs with walls closer than `skin` [m]: as `inner_pairs`, without padding; j is the wall."""
    pairs = empty_pairs(edges.size - 1, lists.wall_grain.size, False)
    count, chunk, status, bad_i, bad_j = 0, 0, FINE, -1, -1
    for k in range(lists.wall_grain.size):
        i, w = lists.wall_grain[k], lists.wall_number[k]
        chunk = next_chunk(pairs, edges, chunk, i, count)
        a = ROW * np.int64(i)
        _, _, distance = wall_direction(rows[a + X], rows[a + Y], walls, w)
        if distance < rows[a + R] + skin:
            pairs.first[count], pairs.second[count] = a, w
            pairs.inertia_root[count] = 1.0 / np.sqrt(rows[a + MOBILITY])
            recall(pairs, count, lists.wall_memory, k)
            count += 1
            if distance < (1.0 - deepest) * rows[a + R] and status == FINE:
                status, bad_i, bad_j = TOO_DEEP, i, w
    next_chunk(pairs, edges, chunk, edges[-1], count)
    return cut(pairs, count), status, bad_i, bad_j


@kernel()
def next_chunk(pairs, edges, chunk, i, count):
    """End the chunks before the one of grain i at `count` contacts; returns its number."""
    while chunk < edges.size - 1 and i >= edges[chunk + 1]:
        chunk += 1
        pairs.chunk[chunk] = count
    return chunk


@kernel()
def cut(pairs, n):
    return Pairs(
        pairs.chunk, pairs.first[:n], pairs.second[:n], pairs.outer[:n], pairs.spring[:n],
        pairs.dashpot_n[:n], pairs.dashpot_s[:n], pairs.inertia_root[:n], pairs.nx[:n], pairs.ny[:n],
    )  # fmt: skip


@kernel()
def remember(pairs, memory):
    """Write the memory of the inner pairs back to their outer list; pairs that are not in it are open and hold none."""
    memory[:, :3] = 0.0
    for m in range(pairs.first.size):
        k = pairs.outer[m]
        if k >= 0:
            memory[k, 0], memory[k, 1], memory[k, 2] = pairs.spring[m], pairs.dashpot_n[m], pairs.dashpot_s[m]
            if pairs.nx.size > 0:
                memory[k, 3], memory[k, 4] = pairs.nx[m], pairs.ny[m]
