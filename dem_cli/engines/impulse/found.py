"""The list of contacts that the narrow phase fills, and what is done to those of one pair once they are found."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.arrays import COUNT, FIRST, Found
from dem_cli.engines.impulse.vectors import dot, row, sub
from dem_cli.jit import kernel

# What a contact is made of, most significant part of its key: a feature of i or j on a surface of the other.
SPHERE, CORNER_I, CORNER_J, POINT_I, POINT_J, EDGES = range(6)
SHIFT = 28  # bits of each of the two features in a key
SAME = 0.999  # cosine of the angle between normals that count as one


def empty_found(capacity: int) -> Found:
    return Found(
        np.zeros(capacity, np.int64), np.zeros(capacity, np.int64), np.zeros(capacity, np.int64),
        np.zeros((capacity, 3)), np.zeros((capacity, 3)), np.zeros(capacity), np.zeros(2, np.int64),
    )  # fmt: skip


@kernel(inline=True, inner=True)
def key_of(kind, first, second):
    return (((np.int64(kind) << SHIFT) | np.int64(first)) << SHIFT) | np.int64(second)


@kernel(inner=True)
def put(found, pair, key, point, normal, gap):
    """Add a contact of pair (i, j). Beyond the capacity they are counted only."""
    k = found.state[COUNT]
    found.state[COUNT] += 1
    if k < found.i.size:
        found.i[k], found.j[k], found.key[k], found.gap[k] = pair[0], pair[1], key, gap
        found.point[k, 0], found.point[k, 1], found.point[k, 2] = point
        found.normal[k, 0], found.normal[k, 1], found.normal[k, 2] = normal


@kernel(inner=True)
def put_new(found, pair, key, point, normal, gap, near, same):
    """`put`, unless the pair has one of this key, or one closer than `near` [m] with its normal within the angle of cosine `same`."""
    for k in range(found.state[FIRST], min(found.state[COUNT], found.i.size)):
        if found.key[k] == key:
            return
        d = sub(row(found.point, k, 0), point)
        if dot(d, d) < near * near and dot(row(found.normal, k, 0), normal) > same:
            return
    put(found, pair, key, point, normal, gap)


@kernel(inner=True)
def move(found, a, b):
    """Write contact b over contact a of the same pair."""
    found.key[a], found.gap[a] = found.key[b], found.gap[b]
    for c in range(3):
        found.point[a, c], found.normal[a, c] = found.point[b, c], found.normal[b, c]


@kernel(inner=True)
def sort_pair(found):
    """Sort the contacts of the present pair by key, in place, by insertion: they mostly are."""
    first, end = found.state[FIRST], min(found.state[COUNT], found.i.size)
    for k in range(first + 1, end):
        key, gap = found.key[k], found.gap[k]
        point, normal = row(found.point, k, 0), row(found.normal, k, 0)
        m = k
        while m > first and found.key[m - 1] > key:
            move(found, m, m - 1)
            m -= 1
        if m < k:
            found.key[m], found.gap[m] = key, gap
            found.point[m, 0], found.point[m, 1], found.point[m, 2] = point
            found.normal[m, 0], found.normal[m, 1], found.normal[m, 2] = normal
