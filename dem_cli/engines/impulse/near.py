"""Which features of two bodies are near enough to each other to be looked at: boxes about the bodies, and grids of their triangles."""

from __future__ import annotations

from dem_cli.engines.impulse.arrays import (
    BEND,
    BOX_HIGH,
    BOX_LOW,
    CORNER0,
    CORNERS,
    END,
    HIGH,
    IS_CORNER,
    LOW,
    OTHER_END,
    PLACE,
    POINT_CELL,
    POINT_GRID,
    POINTS,
    RIDGE0,
    RIDGES,
    STAMP,
    TRIANGLE0,
    TRIANGLE_CELL,
    TRIANGLE_EDGE,
    TRIANGLE_GRID,
    TRIANGLE_VERTEX,
    TRIANGLES,
)
from dem_cli.engines.impulse.vectors import add, placed_at, row, sub, times
from dem_cli.jit import kernel

FEW = 40  # triangles that are looked at one by one rather than by the grid


@kernel(inline=True, inner=True)
def _half(shapes, s):
    low, high = row(shapes.size, s, LOW), row(shapes.size, s, HIGH)
    return times(add(low, high), 0.5), times(sub(high, low), 0.5)


@kernel(inline=True, inner=True)
def _spread(m, h):
    """Half edges of the upright box about a box with half edges h that is turned by m."""
    return (
        abs(m[0]) * h[0] + abs(m[1]) * h[1] + abs(m[2]) * h[2],
        abs(m[3]) * h[0] + abs(m[4]) * h[1] + abs(m[5]) * h[2],
        abs(m[6]) * h[0] + abs(m[7]) * h[1] + abs(m[8]) * h[2],
    )


@kernel(inner=True)
def box_seen(shapes, s, relation):
    """Corners (low, high) of the upright box, in b's frame, about the box of body a with shape s; relation: `relative` of a and b."""
    middle, half = _half(shapes, s)
    center = placed_at(relation, middle)
    half = times(_spread(relation[0], half), relation[2])
    return sub(center, half), add(center, half)


@kernel(inner=True)
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


@kernel(inline=True, inner=True)
def _meets(low, high, a_low, a_high):
    return (
        a_low[0] <= high[0] and a_high[0] >= low[0] and a_low[1] <= high[1] and a_high[1] >= low[1]
        and a_low[2] <= high[2] and a_high[2] >= low[2]
    )  # fmt: skip


@kernel(inline=True, inner=True)
def holds(low, high, p):
    return (
        low[0] <= p[0] and p[0] <= high[0] and low[1] <= p[1] and p[1] <= high[1] and low[2] <= p[2] and p[2] <= high[2]
    )


@kernel(inline=True, inner=True)
def _cut(low, high, origin, cell, many):
    """First and last of the cells along an axis that meet an interval; there are none where the last is less than the first."""
    return int(min(max((low - origin) / cell, 0.0), float(many))), int(
        max(min((high - origin) / cell, many - 1.0), -1.0)
    )


@kernel(inner=True)
def _cells(shapes, s, low, high, number, size):
    """Cells of a grid that a box meets: (x0, x1, y0, y1, z0, z1). number, size: where the grid's columns start."""
    origin, cell, many = row(shapes.size, s, size), shapes.size[s, size + 3], row(shapes.number, s, number + 1)
    x0, x1 = _cut(low[0], high[0], origin[0], cell, many[0])
    y0, y1 = _cut(low[1], high[1], origin[1], cell, many[1])
    z0, z1 = _cut(low[2], high[2], origin[2], cell, many[2])
    return x0, x1, y0, y1, z0, z1


@kernel(inline=True, inner=True)
def _span(shapes, s, number, x, y, z0, z1):
    """Members of the cells z0 to z1 of column (x, y): the first, and one past the last."""
    at = shapes.number[s, number] + (x * shapes.number[s, number + 2] + y) * shapes.number[s, number + 3]
    return shapes.cell[at + z0], shapes.cell[at + max(z1 + 1, z0)]


@kernel(inner=True)
def _take_triangle(shapes, near, t, low, high):
    if _meets(low, high, row(shapes.triangle, t, BOX_LOW), row(shapes.triangle, t, BOX_HIGH)):
        near.item[TRIANGLES, near.many[TRIANGLES]] = t
        near.many[TRIANGLES] += 1


@kernel(inner=True)
def gather_triangles(shapes, near, s, low, high):
    """Triangles of shape s whose boxes meet the box (low, high), into `near`."""
    near.many[TRIANGLES] = 0
    start, end = shapes.number[s, TRIANGLE0], shapes.number[s + 1, TRIANGLE0]
    if end - start <= FEW:
        for t in range(start, end):
            _take_triangle(shapes, near, t, low, high)
        return
    near.many[STAMP] += 1
    stamp = near.many[STAMP]
    x0, x1, y0, y1, z0, z1 = _cells(shapes, s, low, high, TRIANGLE_GRID, TRIANGLE_CELL)
    for x in range(x0, x1 + 1):
        for y in range(y0, y1 + 1):
            first, last = _span(shapes, s, TRIANGLE_GRID, x, y, z0, z1)
            for m in range(first, last):
                t = shapes.member[m]
                if near.seen[0, t] != stamp:
                    near.seen[0, t] = stamp
                    _take_triangle(shapes, near, t, low, high)


@kernel(inner=True)
def _take_ridge(shapes, near, e, low, high):
    a, b = (
        row(shapes.vertex, shapes.edge_part[e, END], PLACE),
        row(shapes.vertex, shapes.edge_part[e, OTHER_END], PLACE),
    )
    if (
        min(a[0], b[0]) <= high[0] and max(a[0], b[0]) >= low[0] and min(a[1], b[1]) <= high[1]
        and max(a[1], b[1]) >= low[1] and min(a[2], b[2]) <= high[2] and max(a[2], b[2]) >= low[2]
    ):  # fmt: skip
        near.item[RIDGES, near.many[RIDGES]] = e
        near.many[RIDGES] += 1


@kernel(inner=True)
def gather_edges(shapes, near, s, low, high):
    """Corners and convex edges of shape s that meet the box (low, high), into `near`, whose triangles are gathered in a box as large."""
    near.many[RIDGES] = near.many[CORNERS] = 0
    if shapes.number[s + 1, TRIANGLE0] - shapes.number[s, TRIANGLE0] <= FEW:
        for k in range(shapes.number[s, RIDGE0], shapes.number[s + 1, RIDGE0]):
            _take_ridge(shapes, near, shapes.ridge[k], low, high)
        for k in range(shapes.number[s, CORNER0], shapes.number[s + 1, CORNER0]):
            if holds(low, high, row(shapes.vertex, shapes.corner[k], PLACE)):
                near.item[CORNERS, near.many[CORNERS]] = shapes.corner[k]
                near.many[CORNERS] += 1
        return
    near.many[STAMP] += 1
    stamp = near.many[STAMP]
    for m in range(near.many[TRIANGLES]):
        t = near.item[TRIANGLES, m]
        for k in range(3):
            e, v = shapes.triangle_part[t, TRIANGLE_EDGE + k], shapes.triangle_part[t, TRIANGLE_VERTEX + k]
            if near.seen[1, e] != stamp:
                near.seen[1, e] = stamp
                if shapes.edge_part[e, BEND] > 0:
                    _take_ridge(shapes, near, e, low, high)
            if near.seen[2, v] != stamp:
                near.seen[2, v] = stamp
                if shapes.vertex_part[v, IS_CORNER] and holds(low, high, row(shapes.vertex, v, PLACE)):
                    near.item[CORNERS, near.many[CORNERS]] = v
                    near.many[CORNERS] += 1


@kernel(inner=True)
def gather_points(shapes, near, s, low, high):
    """Face points or particles of shape s in the box (low, high), into `near`."""
    near.many[POINTS] = 0
    x0, x1, y0, y1, z0, z1 = _cells(shapes, s, low, high, POINT_GRID, POINT_CELL)
    for x in range(x0, x1 + 1):
        for y in range(y0, y1 + 1):
            first, last = _span(shapes, s, POINT_GRID, x, y, z0, z1)
            for m in range(first, last):
                k = shapes.member[m]
                if holds(low, high, row(shapes.point, k, PLACE)):
                    near.item[POINTS, near.many[POINTS]] = k
                    near.many[POINTS] += 1
