"""Which grains may touch: half neighbour lists from a cell grid, and their all-pairs twin for tests.

A list holds, for each grain i, the grains j > i whose surfaces are closer than the skin: start (n + 1,) and neighbour (pairs,), so
that i's are neighbour[start[i]:start[i+1]]. It stays valid while no grain has moved more than half the skin.
"""

from __future__ import annotations

import numpy as np

from dem_cli.jit import kernel


@kernel()
def order_by_columns(x, y, cell):
    """Permutation that sorts points into columns of cells, each from the bottom up; keeps neighbours close in memory.

    x, y: (n,) [m]; cell [m]: width of a column. Returns (n,) int64.
    """
    column = np.floor((x - x.min()) / cell)
    height = y.max() - y.min() + cell
    return np.argsort(column * (2.0 * height) + (y - y.min()), kind="mergesort")


@kernel()
def _cell_grid(x, y, alive, cell):
    """Counting sort of the living grains, whose places must be finite, into cells: (cell of grain, start of cell, grains by cell, rows)."""
    n = x.size
    left, right, bottom, top = np.inf, -np.inf, np.inf, -np.inf
    for i in range(n):
        if alive[i]:
            left, right = min(left, x[i]), max(right, x[i])
            bottom, top = min(bottom, y[i]), max(top, y[i])
    if left > right:
        left = right = bottom = top = 0.0
    # Grains thrown far away share the last row or column: the list stays right, and the grid small.
    most = 16 * n + 64
    columns = int(min((right - left) / cell, np.sqrt(most) * 8.0)) + 1
    rows = int(min((top - bottom) / cell, most / columns)) + 1
    where = np.full(n, -1, np.int64)
    start = np.zeros(columns * rows + 1, np.int64)
    for i in range(n):
        if alive[i]:
            column = int(min((x[i] - left) / cell, columns - 1.0))
            row = int(min((y[i] - bottom) / cell, rows - 1.0))
            where[i] = column * rows + row
            start[where[i] + 1] += 1
    for c in range(columns * rows):
        start[c + 1] += start[c]
    fill = start[:-1].copy()
    members = np.empty(n, np.int32)
    for i in range(n):
        if alive[i]:
            members[fill[where[i]]] = i
            fill[where[i]] += 1
    return where, start, members, columns, rows


@kernel()
def neighbour_list(x, y, radius, alive, skin):
    """Half neighbour list of discs from a cell grid.

    x, y, radius: (n,) [m], finite; alive: (n,) bool, grains that are left out are False; skin [m] > 0.
    Returns start (n + 1,) int64, neighbour (pairs,) int32, ascending in i; within i in the order of the cells.
    """
    n = x.size
    cell = 2.0 * radius.max() + skin
    where, cells, members, columns, rows = _cell_grid(x, y, alive, cell)
    start = np.zeros(n + 1, np.int64)
    neighbour = np.empty(4 * n + 64, np.int32)
    k = 0
    for i in range(n):
        start[i] = k
        if not alive[i]:
            continue
        column = where[i] // rows
        row = where[i] - column * rows
        low, high = max(row - 1, 0), min(row + 1, rows - 1)
        for c in range(max(column - 1, 0), min(column + 1, columns - 1) + 1):
            for m in range(cells[c * rows + low], cells[c * rows + high + 1]):
                j = members[m]
                if j > i:
                    dx, dy, reach = x[j] - x[i], y[j] - y[i], radius[i] + radius[j] + skin
                    if dx * dx + dy * dy < reach * reach:
                        if k == neighbour.size:
                            larger = np.empty(2 * k, np.int32)
                            larger[:k] = neighbour
                            neighbour = larger
                        neighbour[k] = j
                        k += 1
    start[n] = k
    return start, neighbour[:k].copy()


@kernel()
def neighbour_list_all_pairs(x, y, radius, alive, skin):
    """The same list by looking at every pair: the reference for tests."""
    n = x.size
    start = np.zeros(n + 1, np.int64)
    found = []
    for i in range(n):
        start[i] = len(found)
        for j in range(i + 1, n):
            reach = radius[i] + radius[j] + skin
            if alive[i] and alive[j] and (x[j] - x[i]) ** 2 + (y[j] - y[i]) ** 2 < reach * reach:
                found.append(np.int32(j))
    start[n] = len(found)
    neighbour = np.empty(len(found), np.int32)
    for k in range(len(found)):
        neighbour[k] = found[k]
    return start, neighbour


@kernel()
def carry_memory(start, neighbour, memory, new_start, new_neighbour):
    """Memory of the contacts of one half list, moved to the pairs of another; 0 for pairs that are new.

    memory: (pairs, c), a row is looked up only where it is not all zero. Returns (new pairs, c).
    """
    carried = np.zeros((new_neighbour.size, memory.shape[1]))
    for i in range(start.size - 1):
        for k in range(start[i], start[i + 1]):
            used = False
            for c in range(memory.shape[1]):
                used = used or memory[k, c] != 0.0
            if used:
                for m in range(new_start[i], new_start[i + 1]):
                    if new_neighbour[m] == neighbour[k]:
                        carried[m] = memory[k]
                        break
    return carried
