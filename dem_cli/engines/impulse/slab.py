"""Where two bodies with many faces overlap: the space between two parallel planes, outside which no feature can touch."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.arrays import (
    CENTER,
    CORNERS,
    END,
    OTHER_END,
    PLACE,
    POINT0,
    POINTS,
    RIDGES,
    SCALE,
    TRIANGLE_VERTEX,
    TRIANGLES,
    VERTEX0,
)
from dem_cli.engines.impulse.vectors import dot, row, sub, times, to_world, turn_of, turned_back
from dem_cli.jit import kernel

TURNS = 8  # of the direction, while the overlap is looked for


@kernel(inner=True)
def _support(shapes, placed, i, n):
    """The point of body i that is farthest along n, in the container's frame."""
    s = placed.shape[i]
    way = turned_back(turn_of(placed, i), n)
    most, best = -np.inf, (0.0, 0.0, 0.0)
    for k in range(shapes.number[s, VERTEX0], shapes.number[s + 1, VERTEX0]):
        p = row(shapes.vertex, k, PLACE)
        if dot(p, way) > most:
            most, best = dot(p, way), p
    for k in range(shapes.number[s, POINT0], shapes.number[s + 1, POINT0]):
        p = row(shapes.point, k, PLACE)
        if dot(p, way) > most:
            most, best = dot(p, way), p
    return to_world(placed, i, best)


@kernel(inner=True)
def overlap_between(shapes, placed, i, j, enough):
    """(unit n from i to j, low, high): a direction along which bodies i and j overlap little, from low = min x.n of j to high = max x.n of i.

    The direction is turned along the gradient of the overlap, which is the way between the farthest points, until they are `enough` [m] apart.
    """
    d = sub(row(placed.frame, j, CENTER), row(placed.frame, i, CENTER))
    length = np.sqrt(dot(d, d))
    n = times(d, 1.0 / length) if length > 0.0 else (0.0, 0.0, 1.0)
    best, low, high = n, -np.inf, np.inf
    for _ in range(TURNS):
        p, q = _support(shapes, placed, i, n), _support(shapes, placed, j, times(n, -1.0))
        if dot(p, n) - dot(q, n) < high - low:
            best, low, high = n, dot(q, n), dot(p, n)
        if low - high > enough:
            break
        way = sub(q, p)
        along = dot(way, n)
        step = 1.0 / max(length, 1e-300)
        n = (
            n[0] + step * (way[0] - along * n[0]),
            n[1] + step * (way[1] - along * n[1]),
            n[2] + step * (way[2] - along * n[2]),
        )
        n = times(n, 1.0 / np.sqrt(dot(n, n)))
    return best, low, high


@kernel(inner=True)
def _height(shapes, v, way):
    return dot(row(shapes.vertex, v, PLACE), way)


@kernel(inner=True)
def keep_beyond(shapes, placed, near, i, n, least, faces):
    """Of the gathered features of body i keep those that reach x.n >= least [m]; triangles, and points if of a cloud, x.n >= faces."""
    way = turned_back(turn_of(placed, i), n)
    from_center, f = dot(row(placed.frame, i, CENTER), n), 1.0 / placed.frame[i, SCALE]
    least, faces = (least - from_center) * f, (faces - from_center) * f
    item, count, part = near.item, near.many, shapes.triangle_part
    kept = 0
    for m in range(count[TRIANGLES]):
        t = item[TRIANGLES, m]
        a = _height(shapes, part[t, TRIANGLE_VERTEX], way)
        b = _height(shapes, part[t, TRIANGLE_VERTEX + 1], way)
        c = _height(shapes, part[t, TRIANGLE_VERTEX + 2], way)
        if max(a, b, c) >= faces:
            item[TRIANGLES, kept] = t
            kept += 1
    count[TRIANGLES] = kept
    kept = 0
    for m in range(count[RIDGES]):
        e = item[RIDGES, m]
        a = _height(shapes, shapes.edge_part[e, END], way)
        b = _height(shapes, shapes.edge_part[e, OTHER_END], way)
        if max(a, b) >= least:
            item[RIDGES, kept] = e
            kept += 1
    count[RIDGES] = kept
    kept = 0
    for m in range(count[CORNERS]):
        if _height(shapes, item[CORNERS, m], way) >= least:
            item[CORNERS, kept] = item[CORNERS, m]
            kept += 1
    count[CORNERS] = kept
    kept = 0
    for m in range(count[POINTS]):
        if dot(row(shapes.point, item[POINTS, m], PLACE), way) >= faces:
            item[POINTS, kept] = item[POINTS, m]
            kept += 1
    count[POINTS] = kept
