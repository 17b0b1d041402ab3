"""Edges of one body across edges of another, and which contacts of two convex bodies are the true ones."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.arrays import (
    CENTER,
    CORNER0,
    COUNT,
    EDGE0,
    END,
    FIRST,
    INWARD,
    OTHER_END,
    OTHER_INWARD,
    PLACE,
    RIDGES,
    SCALE,
)
from dem_cli.engines.impulse.found import EDGES, SAME, key_of, move, put_new
from dem_cli.engines.impulse.vectors import (
    along,
    cross,
    dot,
    placed_at,
    row,
    sub,
    times,
    to_world,
    turn_of,
    turned,
    turned_back,
)
from dem_cli.jit import kernel

PARALLEL = 0.01  # sine of the angle between edges below which their corners make the contact
BESIDE = (
    0.02  # sine of the angle by which a normal may miss an edge's arc: face on face, the normal is the end of both arcs
)
MARGIN = 1e-4  # overlap that two normals may differ by and both be kept, over the smaller reach
ALIKE = 0.995  # cosine of the angle between normals that are kept whatever their overlaps


@kernel(inner=True)
def _crossing(shapes, e, p, d, length, t1, t2, q, limits):
    """Contact of an edge at p along unit d, with t1, t2 into its faces, and edge e of j's shape, all in j's frame.

    Returns (found, place on the first edge, unit normal away from its body, gap). Where two lines come closest: n = d1 x d2,
    s = ((q - p) x d2).n / n.n, and so on.
    """
    none = False, 0.0, d, 0.0
    tolerance, depth, border = limits
    g = sub(row(shapes.vertex, shapes.edge_part[e, OTHER_END], PLACE), q)
    other = np.sqrt(dot(g, g))
    g = times(g, 1.0 / other)
    n = cross(d, g)
    square = dot(n, n)
    if square < PARALLEL * PARALLEL:
        return none
    n = times(n, 1.0 / np.sqrt(square))
    if dot(n, t1) + dot(n, t2) > 0.0:
        n = times(n, -1.0)
    way = sub(q, p)
    gap = dot(way, n)
    if gap > tolerance or gap < -depth or dot(n, t1) > BESIDE or dot(n, t2) > BESIDE:
        return none
    if dot(n, row(shapes.edge, e, INWARD)) < -BESIDE or dot(n, row(shapes.edge, e, OTHER_INWARD)) < -BESIDE:
        return none
    along_d, along_g, slant = dot(way, d), dot(way, g), dot(d, g)
    s = (along_d - along_g * slant) / square
    u = s * slant - along_g
    if s < -border or s > length + border or u < -border or u > other + border:
        return none
    return True, s, n, gap


@kernel(inner=True)
def edges_on_edges(shapes, placed, near_i, near_j, relation, found, pair, rows, limits, merge):
    """Gathered convex edges of body i = rows[0] against those of j = rows[1]; relation: `relative` of i and j.

    A contact where the lines come closest within both edges, and the normal lies in the arc between the normals of the faces at either.
    """
    i, j = rows
    si, sj = placed.shape[i], placed.shape[j]
    wide = limits[0] + limits[2]
    for m in range(near_i.many[RIDGES]):
        e = near_i.item[RIDGES, m]
        p, end = (
            placed_at(relation, row(shapes.vertex, shapes.edge_part[e, END], PLACE)),
            placed_at(relation, row(shapes.vertex, shapes.edge_part[e, OTHER_END], PLACE)),
        )
        d = sub(end, p)
        length = np.sqrt(dot(d, d))
        d = times(d, 1.0 / length)
        t1, t2 = (
            turned(relation[0], row(shapes.edge, e, INWARD)),
            turned(relation[0], row(shapes.edge, e, OTHER_INWARD)),
        )
        low = min(p[0], end[0]), min(p[1], end[1]), min(p[2], end[2])
        high = max(p[0], end[0]), max(p[1], end[1]), max(p[2], end[2])
        for r in range(near_j.many[RIDGES]):
            k = near_j.item[RIDGES, r]
            q, tip = (
                row(shapes.vertex, shapes.edge_part[k, END], PLACE),
                row(shapes.vertex, shapes.edge_part[k, OTHER_END], PLACE),
            )
            far = wide + limits[1]
            if (
                min(q[0], tip[0]) - far > high[0] or max(q[0], tip[0]) + far < low[0]
                or min(q[1], tip[1]) - far > high[1] or max(q[1], tip[1]) + far < low[1]
                or min(q[2], tip[2]) - far > high[2] or max(q[2], tip[2]) + far < low[2]
            ):  # fmt: skip
                continue
            touching, s, n, gap = _crossing(shapes, k, p, d, length, t1, t2, q, limits)
            if touching:
                point = to_world(placed, j, along(along(p, d, s), n, 0.5 * gap))
                normal = turned(turn_of(placed, j), n)
                key = key_of(EDGES, e - shapes.number[si, EDGE0], k - shapes.number[sj, EDGE0])
                put_new(found, pair, key, point, normal, gap * placed.frame[j, SCALE], merge, SAME)


@kernel(inner=True)
def _farthest(shapes, placed, i, n):
    """Largest x . n of the corners of body i."""
    s = placed.shape[i]
    way = turned_back(turn_of(placed, i), n)
    most = -np.inf
    for k in range(shapes.number[s, CORNER0], shapes.number[s + 1, CORNER0]):
        most = max(most, dot(row(shapes.vertex, shapes.corner[k], PLACE), way))
    return most * placed.frame[i, SCALE] + dot(row(placed.frame, i, CENTER), n)


@kernel(inner=True)
def _overlap(shapes, placed, rows, n):
    return _farthest(shapes, placed, rows[0], n) + _farthest(shapes, placed, rows[1], times(n, -1.0))


@kernel(inner=True)
def keep_least(shapes, placed, found, rows, reach):
    """Of the contacts of two convex bodies, those along the normal of least overlap.

    overlap(n) = max over i of x.n - min over j of x.n. Two convex bodies touch along one normal; as they overlap, features around
    it come into each other as well and would push sideways.
    """
    first, end = found.state[FIRST], min(found.state[COUNT], found.i.size)
    deepest = 0.0
    for k in range(first, end):
        deepest = min(deepest, found.gap[k])
    if deepest > -MARGIN * reach or end - first < 2:
        return
    least, best = np.inf, first
    for k in range(first, end):
        overlap = _overlap(shapes, placed, rows, row(found.normal, k, 0))
        if overlap < least:
            least, best = overlap, k
    chosen = row(found.normal, best, 0)
    kept = first
    for k in range(first, end):
        n = row(found.normal, k, 0)
        if dot(n, chosen) > ALIKE or _overlap(shapes, placed, rows, n) <= least + MARGIN * reach:
            if kept < k:
                move(found, kept, k)
            kept += 1
    found.state[COUNT] -= end - kept
