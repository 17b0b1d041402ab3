"""Islands: bodies that touch each other, directly or through others. What never moves joins none."""

from __future__ import annotations

import numpy as np

from dem_cli.jit import kernel


@kernel(inline=True)
def root(parent, k):
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel()
def split_islands(i, j, bodies):
    """Order (c,) that puts the contacts of each island together, and starts (islands + 1,) of the islands in it.

    i, j (c,): bodies of each contact, j = `bodies` for what never moves. Islands come in the order of their first contact, contacts of an
    island in the order given.
    """
    parent = np.arange(bodies)
    for c in range(len(i)):
        if j[c] < bodies:
            one, other = root(parent, i[c]), root(parent, j[c])
            if one != other:
                parent[max(one, other)] = min(one, other)
    number = np.full(bodies, -1)
    found = np.empty(len(i), np.int64)
    sizes = np.zeros(len(i) + 1, np.int64)
    islands = 0
    for c in range(len(i)):
        head = root(parent, i[c])
        if number[head] < 0:
            number[head] = islands
            islands += 1
        found[c] = number[head]
        sizes[found[c] + 1] += 1
    starts = np.cumsum(sizes[: islands + 1])
    order, place = np.empty(len(i), np.int64), starts.copy()
    for c in range(len(i)):
        order[place[found[c]]] = c
        place[found[c]] += 1
    return order, starts
