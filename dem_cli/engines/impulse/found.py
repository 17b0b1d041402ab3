"""The list of contacts that the narrow phase fills, and what is done to those of one pair once they are found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.impulse.vectors import dot, row, sub
from dem_cli.jit import kernel

# What a contact is made of, most significant part of its key: a feature of i or j on a surface of the other.
SPHERE, CORNER_I, CORNER_J, POINT_I, POINT_J, EDGES = range(6)
SHIFT = 28  # bits of each of the two features in a key
SAME = 0.999  # cosine of the angle between normals that count as one


class Found(NamedTuple):
    """Contacts (capacity,): see `contacts.find`."""

    i: np.ndarray
    j: np.ndarray
    key: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    gap: np.ndarray


def empty_found(capacity: int) -> Found:
    whole = np.zeros(capacity, np.int64)
    return Found(
        whole, whole.copy(), whole.copy(), np.zeros((capacity, 3)), np.zeros((capacity, 3)), np.zeros(capacity)
    )


@kernel(inline=True)
def key_of(kind, first, second):
    return (((np.int64(kind) << SHIFT) | np.int64(first)) << SHIFT) | np.int64(second)


@kernel()
def put(found, count, pair, key, point, normal, gap):
    """Add a contact of pair (i, j); returns how many there are. Beyond the capacity they are counted only."""
    if count < found.i.size:
        found.i[count], found.j[count], found.key[count], found.gap[count] = pair[0], pair[1], key, gap
        found.point[count, 0], found.point[count, 1], found.point[count, 2] = point
        found.normal[count, 0], found.normal[count, 1], found.normal[count, 2] = normal
    return count + 1


@kernel()
def put_new(found, first, count, pair, key, point, normal, gap, near, same):
    """`put`, unless a contact from `first` on lies closer than `near` [m], its normal within the angle of cosine `same`."""
    for k in range(first, min(count, found.i.size)):
        if found.key[k] == key:
            return count
        d = sub(row(found.point, k), point)
        if dot(d, d) < near * near and dot(row(found.normal, k), normal) > same:
            return count
    return put(found, count, pair, key, point, normal, gap)


@kernel()
def _swap(found, a, b):
    found.key[a], found.key[b] = found.key[b], found.key[a]
    found.gap[a], found.gap[b] = found.gap[b], found.gap[a]
    for c in range(3):
        found.point[a, c], found.point[b, c] = found.point[b, c], found.point[a, c]
        found.normal[a, c], found.normal[b, c] = found.normal[b, c], found.normal[a, c]


@kernel()
def sort_pair(found, first, count):
    """Sort the contacts of one pair by key, in place; they mostly are."""
    count = min(count, found.i.size)
    if count - first > 64:
        order = np.argsort(found.key[first:count], kind="mergesort")
        found.key[first:count] = found.key[first:count][order]
        found.gap[first:count] = found.gap[first:count][order]
        found.point[first:count] = found.point[first:count][order]
        found.normal[first:count] = found.normal[first:count][order]
        return
    for k in range(first + 1, count):
        m = k
        while m > first and found.key[m - 1] > found.key[m]:
            _swap(found, m - 1, m)
            m -= 1
