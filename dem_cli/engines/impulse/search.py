"""Which bodies may touch: a half neighbour list of bounding spheres of any sizes, and its all-pairs twin for tests.

Bodies are sorted into levels by their radius, each level a factor of two, with a grid of cells of its own. A body looks for others in the
levels of its own size and larger, so that a few large bodies among many small ones cost no more than the small ones do.
The list holds for each body i the bodies j > i, ascending, whose spheres are closer than the skin: i's are
neighbour[start[i]:start[i + 1]]. It stays valid while no body has moved more than half the skin.
"""

from __future__ import annotations

import numpy as np

from dem_cli.jit import kernel

MOST = 1 << 18  # cells along an axis; what is farther out shares the last one, so that the list stays right
BITS = 19


@kernel()
def order_of(key):
    """Stable permutation (n,) that sorts key (n,) int64, by merging; NumPy's own takes seconds to compile."""
    n = key.size
    order, other = np.arange(n), np.empty(n, np.int64)
    width = 1
    while width < n:
        for first in range(0, n, 2 * width):
            a, b = first, min(first + width, n)
            middle, end = b, min(first + 2 * width, n)
            for k in range(first, end):
                if a < middle and (b >= end or key[order[a]] <= key[order[b]]):
                    other[k] = order[a]
                    a += 1
                else:
                    other[k] = order[b]
                    b += 1
        order, other = other, order
        width *= 2
    return order


@kernel(inner=True)
def _stable_by(number, n, order):
    """`order` sorted by number[order], numbers 0 to n - 1, stably: (start (n + 1,), sorted order)."""
    start = np.zeros(n + 2, np.int64)
    for k in range(number.size):
        start[number[k] + 2] += 1
    for i in range(n):
        start[i + 2] += start[i + 1]
    result = np.empty_like(order)
    for k in order:
        result[start[number[k] + 1]] = k
        start[number[k] + 1] += 1
    return start[: n + 1], result


@kernel(inline=True, inner=True)
def _cell(x, low, cell):
    return np.int64(min(max((x - low) / cell, 0.0), MOST - 1.0))


@kernel(inline=True, inner=True)
def _code(level, x, y, z):
    """Order of a cell: cells along z follow one another."""
    return ((((level << BITS) | x) << BITS) | y) << BITS | z


@kernel(inner=True)
def _levels(radius, alive):
    """Level of each body (n,), and how many there are: the smallest radius r0 and up to 2 r0 is level 0, then 4 r0, ...; at most 64."""
    n = radius.size
    least = np.inf
    for i in range(n):
        if alive[i]:
            least = min(least, radius[i])
    level = np.zeros(n, np.int64)
    count = 1
    for i in range(n):
        if alive[i]:
            level[i] = min(int(np.log2(max(radius[i] / least, 1.0))), 63)
            count = max(count, level[i] + 1)
    return level, count


@kernel(inner=True)
def _sorted(x, radius, alive, skin):
    """Living bodies sorted by cell: (order, code of each in that order, level of each body, low (3,), cell size and start of each level)."""
    n = radius.size
    level, count = _levels(radius, alive)
    low = np.full(3, np.inf)
    largest = np.zeros(count)
    for i in range(n):
        if alive[i]:
            largest[level[i]] = max(largest[level[i]], radius[i])
            for k in range(3):
                low[k] = min(low[k], x[i, k])
    cell = 2.0 * largest + skin
    # Levels of more bits than are left would run over: 6 bits of level and 3 x 19 make 63.
    code = np.empty(n, np.int64)
    living = 0
    for i in range(n):
        if alive[i]:
            c = cell[level[i]]
            code[i] = _code(level[i], _cell(x[i, 0], low[0], c), _cell(x[i, 1], low[1], c), _cell(x[i, 2], low[2], c))
            living += 1
        else:
            code[i] = np.iinfo(np.int64).max
    order = order_of(code)[:living]
    return order, code[order], level, low, cell, largest


@kernel(inner=True)
def _first(code, wanted):
    """How many of the ascending codes are below `wanted`."""
    low, high = 0, code.size
    while low < high:
        middle = (low + high) // 2
        if code[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@kernel(inner=True)
def _pairs(x, radius, alive, skin):
    """All pairs (first, second), each once, in no special order; first < second."""
    order, code, level, low, cell, largest = _sorted(x, radius, alive, skin)
    n = radius.size
    first, second = np.empty(4 * n + 64, np.int32), np.empty(4 * n + 64, np.int32)
    count = 0
    for m in range(order.size):
        i = order[m]
        for k in range(level[i], cell.size):
            if largest[k] == 0.0:
                continue
            c = cell[k]
            way = radius[i] + largest[k] + skin
            z0, z1 = _cell(x[i, 2] - way, low[2], c), _cell(x[i, 2] + way, low[2], c)
            for cx in range(_cell(x[i, 0] - way, low[0], c), _cell(x[i, 0] + way, low[0], c) + 1):
                for cy in range(_cell(x[i, 1] - way, low[1], c), _cell(x[i, 1] + way, low[1], c) + 1):
                    last = _code(k, cx, cy, z1)
                    at = _first(code, _code(k, cx, cy, z0))
                    while at < code.size and code[at] <= last:
                        j = order[at]
                        at += 1
                        if level[j] == level[i] and j <= i:
                            continue
                        dx, dy, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
                        reach = radius[i] + radius[j] + skin
                        if dx * dx + dy * dy + dz * dz < reach * reach:
                            if count == first.size:
                                more = np.empty(2 * count, np.int32)
                                more[:count] = first
                                first = more
                                more = np.empty(2 * count, np.int32)
                                more[:count] = second
                                second = more
                            first[count], second[count] = min(i, j), max(i, j)
                            count += 1
    return first[:count], second[:count]


@kernel()
def neighbour_list(x, radius, alive, skin):
    """Half neighbour list of spheres.

    x (n, 3), radius (n,) [m], finite; alive (n,) bool: bodies that are left out are False; skin [m] > 0.
    Returns start (n + 1,) int64, neighbour (pairs,) int32, ascending in i and within i in j.
    """
    n = radius.size
    first, second = _pairs(x, radius, alive, skin)
    _, order = _stable_by(second, n, np.arange(first.size))
    start, order = _stable_by(first, n, order)
    neighbour = np.empty(first.size, np.int32)
    for k in range(first.size):
        neighbour[k] = second[order[k]]
    return start, neighbour


@kernel()
def neighbour_list_all_pairs(x, radius, alive, skin):
    """The same list by looking at every pair: the reference for tests."""
    n = radius.size
    start = np.zeros(n + 1, np.int64)
    found = []
    for i in range(n):
        start[i] = len(found)
        for j in range(i + 1, n):
            reach = radius[i] + radius[j] + skin
            square = (x[j, 0] - x[i, 0]) ** 2 + (x[j, 1] - x[i, 1]) ** 2 + (x[j, 2] - x[i, 2]) ** 2
            if alive[i] and alive[j] and square < reach * reach:
                found.append(np.int32(j))
    start[n] = len(found)
    neighbour = np.empty(len(found), np.int32)
    for k in range(len(found)):
        neighbour[k] = found[k]
    return start, neighbour


@kernel()
def farthest_move(x, old, alive):
    """Largest way [m] of a living body from its place in `old` (n, 3), and the number of one whose place is not finite, or -1."""
    most, bad = 0.0, -1
    for i in range(x.shape[0]):
        if alive[i]:
            dx, dy, dz = x[i, 0] - old[i, 0], x[i, 1] - old[i, 1], x[i, 2] - old[i, 2]
            square = dx * dx + dy * dy + dz * dz
            if not square < np.inf and bad < 0:
                bad = i
            most = max(most, square)
    return np.sqrt(most), bad
