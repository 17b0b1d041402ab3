"""Which features of two bodies are near enough to each other to be looked at: boxes about the bodies, and grids of their triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.impulse.vectors import add, placed_at, row, sub, times
from dem_cli.jit import kernel

TRIANGLES, RIDGES, CORNERS, POINTS, STAMP = range(5)
FEW = 40  # triangles or points that are looked at one by one rather than by the grid


class Near(NamedTuple):
    """Features of one body that were gathered, as indices into `Shapes`: the first count[k] of each array; all arrays are as long as may be.

    seen_*: the last call that looked at a feature, so that each is gathered once. way, depth: scratch of who asks.
    """

    triangle: np.ndarray
    ridge: np.ndarray
    corner: np.ndarray
    point: np.ndarray
    count: np.ndarray
    seen_triangle: np.ndarray
    seen_edge: np.ndarray
    seen_vertex: np.ndarray
    held: np.ndarray
    height: np.ndarray


def empty_near(triangles: int, edges: int, vertices: int, points: int) -> Near:
    """A Near for shapes with so many features in all."""
    return Near(
        np.zeros(triangles, np.int64), np.zeros(edges, np.int64), np.zeros(vertices, np.int64), np.zeros(points, np.int64),
        np.zeros(5, np.int64), np.zeros(triangles, np.int64), np.zeros(edges, np.int64), np.zeros(vertices, np.int64),
        np.zeros(triangles, np.int64), np.zeros(triangles),
    )  # fmt: skip


@kernel(inline=True)
def _half(shapes, s):
    low, high = row(shapes.low, s), row(shapes.high, s)
    return times(add(low, high), 0.5), times(sub(high, low), 0.5)


@kernel(inline=True)
def _spread(m, h):
    """Half edges of the upright box about a box with half edges h that is turned by m."""
    return (
        abs(m[0]) * h[0] + abs(m[1]) * h[1] + abs(m[2]) * h[2],
        abs(m[3]) * h[0] + abs(m[4]) * h[1] + abs(m[5]) * h[2],
        abs(m[6]) * h[0] + abs(m[7]) * h[1] + abs(m[8]) * h[2],
    )


@kernel()
def box_seen(shapes, s, relation):
    """Corners (low, high) of the upright box, in b's frame, about the box of body a with shape s; relation: `relative` of a and b."""
    middle, half = _half(shapes, s)
    center = placed_at(relation, middle)
    half = times(_spread(relation[0], half), relation[2])
    return sub(center, half), add(center, half)


@kernel()
def boxes_apart(shapes, a, b, relation, tolerance):
    """Whether the boxes of shapes a and b are farther apart than `tolerance` in b's frame, by the separating axis theorem (15 axes)."""
    m, _, f = relation
    ca, ha = _half(shapes, a)
    cb, hb = _half(shapes, b)
    ha = times(ha, f)
    t = sub(placed_at(relation, ca), cb)
    reach = add(hb, _spread(m, ha))
    if abs(t[0]) > reach[0] + tolerance or abs(t[1]) > reach[1] + tolerance or abs(t[2]) > reach[2] + tolerance:
        return True
    for k in range(3):
        mk = (m[k], m[3 + k], m[6 + k])
        away = abs(t[0] * mk[0] + t[1] * mk[1] + t[2] * mk[2])
        if away > ha[k] + abs(mk[0]) * hb[0] + abs(mk[1]) * hb[1] + abs(mk[2]) * hb[2] + tolerance:
            return True
    for k in range(
        3
    ):  # axis k of a times axis r of b; shorter than one where they are not at right angles, which keeps more pairs
        u, v = (k + 1) % 3, (k + 2) % 3
        for r in range(3):
            p, q = (r + 1) % 3, (r + 2) % 3
            away = abs(t[q] * m[3 * p + k] - t[p] * m[3 * q + k])
            ra = ha[u] * abs(m[3 * r + v]) + ha[v] * abs(m[3 * r + u])
            rb = hb[p] * abs(m[3 * q + k]) + hb[q] * abs(m[3 * p + k])
            if away > ra + rb + tolerance:
                return True
    return False


@kernel(inline=True)
def _meets(low, high, a_low, a_high):
    return (
        a_low[0] <= high[0] and a_high[0] >= low[0] and a_low[1] <= high[1] and a_high[1] >= low[1]
        and a_low[2] <= high[2] and a_high[2] >= low[2]
    )  # fmt: skip


@kernel(inline=True)
def holds(low, high, p):
    return (
        low[0] <= p[0] and p[0] <= high[0] and low[1] <= p[1] and p[1] <= high[1] and low[2] <= p[2] and p[2] <= high[2]
    )


@kernel(inline=True)
def _cells(grids, s, low, high):
    """Ranges of cells that a box meets, cut to the grid: (x0, x1, y0, y1, z0, z1); empty where x1 < x0 and so on."""
    origin, c, size = row(grids.origin, s), grids.cell[s], grids.size
    x0, x1 = max((low[0] - origin[0]) / c, 0.0), min((high[0] - origin[0]) / c, size[s, 0] - 1.0)
    y0, y1 = max((low[1] - origin[1]) / c, 0.0), min((high[1] - origin[1]) / c, size[s, 1] - 1.0)
    z0, z1 = max((low[2] - origin[2]) / c, 0.0), min((high[2] - origin[2]) / c, size[s, 2] - 1.0)
    return (
        int(np.floor(min(x0, 1e9))), int(np.floor(max(x1, -1.0))), int(np.floor(min(y0, 1e9))),
        int(np.floor(max(y1, -1.0))), int(np.floor(min(z0, 1e9))), int(np.floor(max(z1, -1.0))),
    )  # fmt: skip


@kernel()
def _take_triangle(shapes, near, t, low, high):
    if _meets(low, high, row(shapes.triangle_low, t), row(shapes.triangle_high, t)):
        near.triangle[near.count[TRIANGLES]] = t
        near.count[TRIANGLES] += 1


@kernel()
def gather_triangles(shapes, near, s, low, high):
    """Triangles of shape s whose boxes meet the box (low, high), into `near`."""
    near.count[TRIANGLES] = 0
    start, end = shapes.triangle_start[s], shapes.triangle_start[s + 1]
    if end - start <= FEW:
        for t in range(start, end):
            _take_triangle(shapes, near, t, low, high)
        return
    near.count[STAMP] += 1
    stamp = near.count[STAMP]
    grids = shapes.triangles
    size, first = grids.size, grids.offset[s]
    x0, x1, y0, y1, z0, z1 = _cells(grids, s, low, high)
    for x in range(x0, x1 + 1):
        for y in range(y0, y1 + 1):
            at = first + (x * size[s, 1] + y) * size[s, 2]
            if z1 >= z0:
                for m in range(grids.start[at + z0], grids.start[at + z1 + 1]):
                    t = grids.member[m]
                    if near.seen_triangle[t] != stamp:
                        near.seen_triangle[t] = stamp
                        _take_triangle(shapes, near, t, low, high)


@kernel()
def _take_ridge(shapes, near, e, low, high):
    a, b = row(shapes.vertex, shapes.edge[e, 0]), row(shapes.vertex, shapes.edge[e, 1])
    if (
        min(a[0], b[0]) <= high[0] and max(a[0], b[0]) >= low[0] and min(a[1], b[1]) <= high[1]
        and max(a[1], b[1]) >= low[1] and min(a[2], b[2]) <= high[2] and max(a[2], b[2]) >= low[2]
    ):  # fmt: skip
        near.ridge[near.count[RIDGES]] = e
        near.count[RIDGES] += 1


@kernel()
def gather_edges(shapes, near, s, low, high):
    """Corners and convex edges of shape s that meet the box (low, high), into `near`, whose triangles are gathered in a box as large."""
    near.count[RIDGES] = near.count[CORNERS] = 0
    if shapes.triangle_start[s + 1] - shapes.triangle_start[s] <= FEW:
        for k in range(shapes.ridge_start[s], shapes.ridge_start[s + 1]):
            _take_ridge(shapes, near, shapes.ridge[k], low, high)
        for k in range(shapes.corners_start[s], shapes.corners_start[s + 1]):
            if holds(low, high, row(shapes.vertex, shapes.corners[k])):
                near.corner[near.count[CORNERS]] = shapes.corners[k]
                near.count[CORNERS] += 1
        return
    near.count[STAMP] += 1
    stamp = near.count[STAMP]
    for m in range(near.count[TRIANGLES]):
        t = near.triangle[m]
        for k in range(3):
            e, v = shapes.triangle_edge[t, k], shapes.triangle[t, k]
            if near.seen_edge[e] != stamp:
                near.seen_edge[e] = stamp
                if shapes.bend[e] > 0:
                    _take_ridge(shapes, near, e, low, high)
            if near.seen_vertex[v] != stamp:
                near.seen_vertex[v] = stamp
                if shapes.corner[v] and holds(low, high, row(shapes.vertex, v)):
                    near.corner[near.count[CORNERS]] = v
                    near.count[CORNERS] += 1


@kernel()
def gather_points(shapes, near, s, low, high):
    """Face points or particles of shape s in the box (low, high), into `near`."""
    near.count[POINTS] = 0
    start, end = shapes.point_start[s], shapes.point_start[s + 1]
    grids = shapes.points
    size, first = grids.size, grids.offset[s]
    if end - start <= FEW:
        x0, x1, y0, y1, z0, z1 = 0, size[s, 0] - 1, 0, size[s, 1] - 1, 0, size[s, 2] - 1
    else:
        x0, x1, y0, y1, z0, z1 = _cells(grids, s, low, high)
    for x in range(x0, x1 + 1):
        for y in range(y0, y1 + 1):
            at = first + (x * size[s, 1] + y) * size[s, 2]
            if z1 >= z0:
                for m in range(grids.start[at + z0], grids.start[at + z1 + 1]):
                    if holds(low, high, row(shapes.point, grids.member[m])):
                        near.point[near.count[POINTS]] = grids.member[m]
                        near.count[POINTS] += 1
