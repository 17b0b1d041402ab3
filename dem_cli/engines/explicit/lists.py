"""Which contacts the explicit engine looks at: an outer list with a wide skin from the cell grid, an inner one taken from it.

The outer list is made anew when a grain may have moved half its skin, the inner one, some ten times shorter to walk, when it may have
moved half of a skin that suits the present speed. The memory of contacts goes along.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.explicit.forces import CHUNK, MOBILITY, ROW, Pairs, Q, R, X, Y, wall_direction
from dem_cli.geometry.cells import carry_memory, neighbour_list
from dem_cli.geometry.lanes import WIDTH
from dem_cli.jit import kernel

FINE, TOO_DEEP, NOT_A_NUMBER = 0, 1, 2


class Lists(NamedTuple):
    """Outer lists and the memory of their contacts, (entries, 3): spring, dashpot_n, dashpot_s in units of kn.

    start, neighbour: half list of grains; wall_grain, wall_number: which grain may touch which wall.
    """

    start: np.ndarray
    neighbour: np.ndarray
    memory: np.ndarray
    wall_grain: np.ndarray
    wall_number: np.ndarray
    wall_memory: np.ndarray


@kernel()
def _wall_list(x, y, radius, alive, walls, skin, old_grain, old_wall, old_memory):
    """Which grains are closer to which wall than the skin, with the memory of those that were before.

    walls: (w, 5) x0, y0, x1, y1, friction. Returns grain int32, wall int32, memory (entries, 3), sorted by grain then wall.
    """
    grain, number = [], []
    for i in range(x.size):
        if alive[i]:
            for w in range(walls.shape[0]):
                _, _, distance = wall_direction(x[i], y[i], walls, w)
                if distance < radius[i] + skin:
                    grain.append(np.int32(i))
                    number.append(np.int32(w))
    n = len(grain)
    new_grain, new_wall, memory = np.empty(n, np.int32), np.empty(n, np.int32), np.zeros((n, 3))
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
def outer_lists(x, y, radius, alive, walls, skin, old):
    """Outer lists at the present positions [m], with the memory of the `old` Lists."""
    start, neighbour = neighbour_list(x, y, radius, alive, skin)
    memory = carry_memory(old.start, old.neighbour, old.memory, start, neighbour)
    grain, number, wall_memory = _wall_list(
        x, y, radius, alive, walls, skin, old.wall_grain, old.wall_number, old.wall_memory
    )
    return Lists(start, neighbour, memory, grain, number, wall_memory)


@kernel()
def _empty_pairs(grains, n):
    return Pairs(
        np.zeros(-(-grains // CHUNK) + 1, np.int64), np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int32),
        np.empty(n), np.empty(n), np.empty(n), np.empty(n),
    )  # fmt: skip


@kernel(inline=True)
def _recall(pairs, n, memory, k):
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
def inner_pairs(rows, lists, skin, deepest):
    """Pairs of grains closer than `skin` [m], with their memory; a pair of far dummies fills up each chunk.

    rows ((n + 2) * ROW,): those of `forces.py`, the last two are the dummies; deepest [-]: overlap over the smaller radius that ends the run.
    Returns (pairs, status, i, j): status TOO_DEEP names the pair.
    """
    n = lists.start.size - 1
    pairs = _empty_pairs(n, lists.neighbour.size + WIDTH * (n // CHUNK + 1))
    count, status, bad_i, bad_j = 0, FINE, -1, -1
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
                _recall(pairs, count, lists.memory, k)
                count += 1
                least = reach - deepest * min(r, rows[b + R])
                if square < least * least and status == FINE:
                    status, bad_i, bad_j = TOO_DEEP, i, lists.neighbour[k]
        if (i + 1) % CHUNK == 0 or i == n - 1:
            while count % WIDTH != 0:
                pairs.first[count], pairs.second[count], pairs.outer[count] = ROW * n, ROW * (n + 1), -1
                pairs.spring[count] = pairs.dashpot_n[count] = pairs.dashpot_s[count] = pairs.inertia_root[count] = 0.0
                count += 1
            pairs.chunk[i // CHUNK + 1] = count
    return _cut(pairs, count), status, bad_i, bad_j


@kernel()
def inner_walls(rows, lists, walls, skin, deepest):
    """Contacts of grains with walls closer than `skin` [m]: as `inner_pairs`, without padding; j is the wall."""
    pairs = _empty_pairs(lists.start.size - 1, lists.wall_grain.size)
    count, status, bad_i, bad_j = 0, FINE, -1, -1
    for k in range(lists.wall_grain.size):
        i, w = lists.wall_grain[k], lists.wall_number[k]
        a = ROW * np.int64(i)
        _, _, distance = wall_direction(rows[a + X], rows[a + Y], walls, w)
        if distance < rows[a + R] + skin:
            pairs.first[count], pairs.second[count] = a, w
            pairs.inertia_root[count] = 1.0 / np.sqrt(rows[a + MOBILITY])
            _recall(pairs, count, lists.wall_memory, k)
            count += 1
            if distance < (1.0 - deepest) * rows[a + R] and status == FINE:
                status, bad_i, bad_j = TOO_DEEP, i, w
            pairs.chunk[i // CHUNK + 1] = count
    for c in range(1, pairs.chunk.size):
        pairs.chunk[c] = max(pairs.chunk[c], pairs.chunk[c - 1])
    return _cut(pairs, count), status, bad_i, bad_j


@kernel()
def _cut(pairs, n):
    return Pairs(
        pairs.chunk, pairs.first[:n], pairs.second[:n], pairs.outer[:n], pairs.spring[:n],
        pairs.dashpot_n[:n], pairs.dashpot_s[:n], pairs.inertia_root[:n],
    )  # fmt: skip


@kernel()
def remember(pairs, memory):
    """Write the memory of the inner pairs back to their outer list; pairs that are not in it are open and hold none."""
    memory[:] = 0.0
    for m in range(pairs.first.size):
        k = pairs.outer[m]
        if k >= 0:
            memory[k, 0], memory[k, 1], memory[k, 2] = pairs.spring[m], pairs.dashpot_n[m], pairs.dashpot_s[m]
