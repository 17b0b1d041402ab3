"""Which grains are joined to the bed: clusters of contacts and near contacts, by union-find."""

from __future__ import annotations

import numpy as np

from dem_cli.jit import kernel
from dem_cli.state import Bools, Floats, Ints


@kernel()
def _root(parent, k):  # type: ignore[no-untyped-def]
    """The root of k; parent is modified in place (paths are halved)."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel()
def _unite(parent, size, a, b):  # type: ignore[no-untyped-def]
    """Join the clusters of a and b, the smaller one to the larger; parent and size are modified in place."""
    a, b = _root(parent, a), _root(parent, b)
    if a == b:
        return
    if size[a] < size[b]:
        a, b = b, a
    parent[b] = a
    size[a] += size[b]


@kernel()
def _unite_contacts(i, j, parent, size):  # type: ignore[no-untyped-def]
    """Join the grains of each contact (c,), walls left out; parent and size (n,) are modified in place.

    Returns the root of a largest cluster.
    """
    for c in range(len(i)):
        if j[c] >= 0:
            _unite(parent, size, i[c], j[c])
    largest = 0
    for k in range(len(parent)):
        if parent[k] == k and size[k] > size[largest]:
            largest = k
    return largest


@kernel()
def _sort_into_cells(cell, start, order):  # type: ignore[no-untyped-def]
    """Fill start (cells + 1,), zeros at first, and order (n,): cell c holds order[start[c]:start[c + 1]]."""
    for k in range(len(cell)):
        start[cell[k]] += 1
    for c in range(1, len(start)):
        start[c] += start[c - 1]
    for k in range(len(cell) - 1, -1, -1):
        start[cell[k]] -= 1
        order[start[cell[k]]] = k


@kernel()
def _unite_near(x, y, radius, gap, cell, columns, start, order, largest, parent, size):  # type: ignore[no-untyped-def]
    """Join grains less than gap [m] apart; parent and size are modified in place.

    Neighbours lie in the 3 x 3 cells about a grain; the outermost cells of the grid are empty. Grains of
    the cluster of `largest` need not look around: what is near them finds them, and among themselves
    nothing changes.
    """
    for k in range(len(x)):
        if _root(parent, k) == _root(parent, largest):
            continue
        for below in range(cell[k] - columns, cell[k] + columns + 1, columns):
            for s in range(start[below - 1], start[below + 2]):
                m = order[s]
                dx, dy = x[m] - x[k], y[m] - y[k]
                reach = radius[k] + radius[m] + gap
                if m != k and dx * dx + dy * dy < reach * reach:
                    _unite(parent, size, k, m)


@kernel()
def _roots(parent):  # type: ignore[no-untyped-def]
    """Replace each parent by its root, in place."""
    for k in range(len(parent)):
        parent[k] = _root(parent, k)


def _cells(x: Floats, y: Floats, side: float) -> tuple[Ints, int, int]:
    """Cell of each grain (n,), number of columns and of cells, in a grid of square cells with an empty rim.

    Cells are at least `side` [m] wide, and wider if there would be more than about four a grain.
    """
    most = 4 * len(x) + 64
    left, bottom = x.min(), y.min()
    width, height = x.max() - left, y.max() - bottom
    side = max(side, width / most, height / most)
    while (width / side + 1.0) * (height / side + 1.0) > most:
        side *= 1.25
    columns, rows = int(width / side) + 3, int(height / side) + 3
    column = ((x - left) / side).astype(np.int64) + 1
    row = ((y - bottom) / side).astype(np.int64) + 1
    return row * columns + column, columns, columns * rows


def clusters(x: Floats, y: Floats, radius: Floats, i: Ints, j: Ints, gap: float) -> Ints:
    """A number for each grain, shape (n,), the same for all grains of a cluster.

    Two grains are joined if they touch (contacts i, j, walls as in state.Contacts) or are less than `gap`
    [m] apart.
    """
    parent = np.arange(len(x))
    size = np.ones(len(x), dtype=np.int64)
    largest = _unite_contacts(i, j, parent, size)
    cell, columns, cells = _cells(x, y, 2.0 * float(radius.max()) + gap)
    start = np.zeros(cells + 1, dtype=np.int64)
    order = np.empty(len(x), dtype=np.int64)
    _sort_into_cells(cell, start, order)
    _unite_near(x, y, radius, gap, cell, columns, start, order, largest, parent, size)
    _roots(parent)
    return parent


def joined_to_bed(x: Floats, y: Floats, radius: Floats, present: Bools, i: Ints, j: Ints, gap: float) -> Bools:
    """Which grains belong to the bed, shape (n,); grains with present = False never do.

    The bed is every cluster (touching, or gaps below `gap` [m]) with a grain less than `gap` above the
    floor y = 0, and a cluster with more than half of the present grains even if it has left the floor.
    """
    index = np.flatnonzero(present)
    if len(index) < len(x):
        number = np.cumsum(present) - 1
        kept = present[i] & ((j < 0) | present[j])
        i, j = number[i[kept]], np.where(j[kept] < 0, -1, number[j[kept]])
        x, y, radius = x[index], y[index], radius[index]
    joined = np.zeros(len(present), dtype=bool)
    if len(index) == 0:
        return joined
    cluster = clusters(x, y, radius, i, j, gap)
    of_bed = 2 * np.bincount(cluster, minlength=len(x)) > len(x)
    of_bed[cluster[y - radius < gap]] = True
    joined[index] = of_bed[cluster]
    return joined
