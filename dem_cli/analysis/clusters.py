"""Which grains are joined to the bed: clusters of contacts and near contacts, by union-find."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.analysis.bodies import outlines
from dem_cli.geometry.ellipse import gap_slopes, widest_gap
from dem_cli.jit import kernel
from dem_cli.state import Bools, Floats, Grains, Ints


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
def _unite_contacts(body, i, j, parent, size):  # type: ignore[no-untyped-def]
    """Join the elements of each grain and of each contact (c,), walls left out; parent and size (n,) are modified in place.

    Returns the root of a largest cluster.
    """
    for k in range(1, len(body)):
        if body[k] == body[k - 1]:
            _unite(parent, size, k, k - 1)
    for c in range(len(i)):
        # most pairs are known to be of one cluster already: their parents say so
        if j[c] >= 0 and parent[i[c]] != parent[j[c]]:
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
def _ellipses_near(dx, dy, mk, pk, qk, ml, pl, ql, gap):  # type: ignore[no-untyped-def]
    """Whether two ellipses are less than gap [m] apart, centres (dx, dy) [m] apart.

    The gap along any direction is a lower bound: that along the line of centres settles most pairs.
    """
    d = math.sqrt(dx * dx + dy * dy)
    along, _, _ = gap_slopes(dx, dy, mk, pk, qk, ml, pl, ql, dx / d, dy / d)
    if along >= gap:
        return False
    _, _, widest = widest_gap(dx, dy, mk, pk, qk, ml, pl, ql, 0.0, 0.0)
    return widest < gap


@kernel()
def _unite_near(x, y, a, b, m, p, q, gap, cell, columns, start, order, largest, parent, size):  # type: ignore[no-untyped-def]
    """Join elements less than gap [m] apart; parent and size are modified in place.

    Neighbours lie in the 3 x 3 cells about an element; the outermost cells of the grid are empty. Elements of
    the cluster of `largest` need not look around: what is near them finds them, and among themselves
    nothing changes. Circles about and within ellipses tell most pairs, and all of discs.
    """
    for k in range(len(x)):
        if _root(parent, k) == _root(parent, largest):
            continue
        for below in range(cell[k] - columns, cell[k] + columns + 1, columns):
            for s in range(start[below - 1], start[below + 2]):
                l = order[s]  # noqa: E741
                dx, dy = x[l] - x[k], y[l] - y[k]
                dd = dx * dx + dy * dy
                outer, inner = a[k] + a[l] + gap, b[k] + b[l] + gap
                if l == k or dd >= outer * outer:
                    continue
                near = dd < inner * inner
                if not near and _root(parent, k) != _root(parent, l):
                    near = _ellipses_near(dx, dy, m[k], p[k], q[k], m[l], p[l], q[l], gap)
                if near:
                    _unite(parent, size, k, l)


@kernel()
def _roots(parent):  # type: ignore[no-untyped-def]
    """Replace each parent by its root, in place."""
    for k in range(len(parent)):
        parent[k] = _root(parent, k)


def _cells(x: Floats, y: Floats, side: float) -> tuple[Ints, int, int]:
    """Cell of each element (n,), number of columns and of cells, in a grid of square cells with an empty rim.

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


def joined_to_bed(grains: Grains, present: Bools, i: Ints, j: Ints, gap: float) -> Bools:
    """Which elements belong to the bed, shape (n,); those with present = False, the same for all elements of a grain, never do.

    The bed is every cluster with an element less than `gap` [m] above the floor y = 0, and a cluster with more than half of
    the present grains even if it has left the floor. A cluster is made of elements of one grain, that touch (contacts
    i, j, walls as in state.Contacts), or that are less than `gap` apart: ellipses by their true gap.
    """
    index = np.flatnonzero(present)
    joined = np.zeros(len(present), dtype=bool)
    if len(index) == 0:
        return joined
    elements: tuple[Floats, ...] = (grains.x, grains.y, grains.a, grains.b, *outlines(grains))
    body = grains.body
    if len(index) < len(present):
        number = np.cumsum(present) - 1
        kept = present[i] & ((j < 0) | present[j])
        i, j = number[i[kept]], np.where(j[kept] < 0, -1, number[j[kept]])
        elements = tuple(array[index] for array in elements)
        body = body[index]
    cluster = _clusters(elements, body, i, j, gap)
    # one element a grain, to count grains by
    head = np.append(True, body[1:] != body[:-1])
    of_bed = 2 * np.bincount(cluster[head], minlength=len(index)) > np.count_nonzero(head)
    _, y, _, _, m, p, _ = elements
    of_bed[cluster[y - np.sqrt(m - p) < gap]] = True
    joined[index] = of_bed[cluster]
    return joined


def _clusters(elements: tuple[Floats, ...], body: Ints, i: Ints, j: Ints, gap: float) -> Ints:
    """A number for each element, shape (n,), the same for all of a cluster (see `joined_to_bed`); elements: x, y, a, b, m, p, q."""
    x, y, a = elements[:3]
    parent = np.arange(len(x))
    size = np.ones(len(x), dtype=np.int64)
    largest = _unite_contacts(body, i, j, parent, size)
    cell, columns, cells = _cells(x, y, 2.0 * float(a.max()) + gap)
    start = np.zeros(cells + 1, dtype=np.int64)
    order = np.empty(len(x), dtype=np.int64)
    _sort_into_cells(cell, start, order)
    _unite_near(*elements, gap, cell, columns, start, order, largest, parent, size)
    _roots(parent)
    return parent
