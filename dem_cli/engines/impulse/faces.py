"""Corners, face points and particles of one body against the faces of another."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.arrays import (
    CONVEX,
    CORNERS,
    FACE_NORMAL,
    GROUP,
    HELD,
    HIGH,
    LEAVE0,
    LOW,
    MIDDLE,
    NORMAL,
    PLACE,
    POINT0,
    POINTS,
    RADIUS,
    SCALE,
    SIDE,
    STRETCH,
    TRIANGLE_VERTEX,
    TRIANGLES,
    TRUSTED,
    VERTEX0,
)
from dem_cli.engines.impulse.found import CORNER_I, POINT_I, SAME, key_of, put_new
from dem_cli.engines.impulse.near import holds
from dem_cli.engines.impulse.vectors import (
    along,
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

DIP = 0.17364817766693033  # sine of 10 degrees: how far an edge that leaves a touching corner may point into the face
OPPOSED = -0.5  # cosine of the angle between normals of a face point and the face that it touches, at most
UNOPPOSED = 2.0  # the same for what has no normal


@kernel(inner=True)
def opposed_to(shapes, k):
    """Largest cosine of the angle between the normal of point k and that of what it touches."""
    return OPPOSED if shapes.point[k, TRUSTED] > 0.0 else UNOPPOSED


@kernel(inner=True)
def _over(shapes, t, p, height, border):
    """Whether p, at `height` over the plane of triangle t, lies over the triangle, or below a valley at its side."""
    for k in range(3):
        out = -dot(
            sub(p, row(shapes.vertex, shapes.triangle_part[t, TRIANGLE_VERTEX + k], PLACE)),
            row(shapes.triangle, t, SIDE + 3 * k),
        )
        if out > border and out > border - height * shapes.triangle[t, STRETCH + k]:
            return False
    return True


@kernel(inner=True)
def _face_to_face(shapes, a, b):
    """Whether triangles a and b have each other's middle in front, as the two sides of a valley do."""
    way = sub(row(shapes.triangle, b, MIDDLE), row(shapes.triangle, a, MIDDLE))
    return (
        dot(way, row(shapes.triangle, a, FACE_NORMAL)) >= 0.0 and dot(way, row(shapes.triangle, b, FACE_NORMAL)) <= 0.0
    )


@kernel(inner=True)
def corner_fits(shapes, v, n):
    """Whether all edges that leave corner v point away from a face with normal n, in the corner's frame; by 10 degrees they need not."""
    least = 0.0
    for k in range(shapes.vertex_part[v, LEAVE0], shapes.vertex_part[v + 1, LEAVE0]):
        least = min(least, dot(row(shapes.leave, k, 0), n))
    return least >= -DIP


@kernel(inner=True)
def touched_faces(shapes, near, s, p, feature, opposed, relation, limits):
    """Faces of shape s that a point p in its frame touches: near.held and near.height, the first of the number returned.

    feature: the corner, or -1 - k for point k, whose normal's cosine with the face's may be at most `opposed`. relation: from the
    point's body to this one. limits: (tolerance, depth, border), of scale 1. A face counts where it holds the point's foot, the height
    is from -depth to tolerance, and the body could touch it there; of those the nearest, and others only that face it across a valley.
    """
    tolerance, depth, border = limits
    count, convex = near.many, shapes.number[s, CONVEX]
    count[HELD] = 0
    for m in range(near.many[TRIANGLES]):
        t = near.item[TRIANGLES, m]
        n = row(shapes.triangle, t, FACE_NORMAL)
        height = dot(sub(p, row(shapes.triangle, t, MIDDLE)), n)
        if convex and height > tolerance:
            return 0
        if abs(height) > depth or not _over(shapes, t, p, height, border):
            continue
        n = turned_back(relation[0], n)
        if feature >= 0:
            if not corner_fits(shapes, feature, n):
                continue
        elif dot(row(shapes.point, -1 - feature, NORMAL), n) > opposed:
            continue
        near.item[HELD, count[HELD]], near.height[count[HELD]] = t, height
        count[HELD] += 1
    return _nearest(shapes, near, tolerance)


@kernel(inner=True)
def _nearest(shapes, near, tolerance):
    """Of the faces near.held those that are the nearest, or face all nearer ones, and are no higher than the tolerance."""
    many = near.many[HELD]
    for k in range(1, many):
        m, t, height = k, near.item[HELD, k], near.height[k]
        while m > 0 and (
            abs(height) < abs(near.height[m - 1])
            or (abs(height) == abs(near.height[m - 1]) and t < near.item[HELD, m - 1])
        ):
            near.item[HELD, m], near.height[m] = near.item[HELD, m - 1], near.height[m - 1]
            m -= 1
        near.item[HELD, m], near.height[m] = t, height
    kept = 0
    for k in range(many):
        t, height, fits = near.item[HELD, k], near.height[k], True
        for m in range(kept):
            other = near.item[HELD, m]
            fits = (
                fits
                and shapes.triangle_part[other, GROUP] != shapes.triangle_part[t, GROUP]
                and _face_to_face(shapes, other, t)
            )
        if fits:  # in front of some face and not touching it: keeps what lies behind that face from counting
            near.item[HELD, kept], near.height[kept] = t, height
            kept += 1
    touching = 0
    for k in range(kept):
        if near.height[k] <= tolerance:
            near.item[HELD, touching], near.height[touching] = near.item[HELD, k], near.height[k]
            touching += 1
    return touching


@kernel(inner=True)
def _put_faces(shapes, placed, near, many, found, pair, owner, p, kind, feature, merge):
    """Contacts of point p of body `owner[0]`, in the frame of body `owner[1]`, with the first faces of near.held; owner[2]: 1 if i's."""
    b, scale = owner[1], placed.frame[owner[1], SCALE]
    for k in range(many):
        t, height = near.item[HELD, k], near.height[k]
        n = row(shapes.triangle, t, FACE_NORMAL)
        normal = turned(turn_of(placed, b), times(n, -owner[2]))
        key = key_of(kind, feature, shapes.triangle_part[t, GROUP])
        point = to_world(placed, b, along(p, n, -0.5 * height))
        put_new(found, pair, key, point, normal, height * scale, merge, SAME)


@kernel(inner=True)
def features_on_faces(shapes, placed, near_a, near_b, relation, found, pair, owner, limits, merge):
    """Gathered corners and points of body a against the gathered triangles of body b.

    owner: (a, b, 1.0 if a is the pair's i, else -1.0); relation: `relative` of a and b.
    """
    a, b, sign = owner
    sa, sb = placed.shape[a], placed.shape[b]
    wide = limits[0] + limits[2] + (0.0 if placed.frame[b, RADIUS] < np.inf else limits[1])
    low, high = row(shapes.size, sb, LOW), row(shapes.size, sb, HIGH)
    low, high = (low[0] - wide, low[1] - wide, low[2] - wide), (high[0] + wide, high[1] + wide, high[2] + wide)
    other = 0 if sign > 0 else 1
    for m in range(near_a.many[CORNERS]):
        v = near_a.item[CORNERS, m]
        p = placed_at(relation, row(shapes.vertex, v, PLACE))
        if holds(low, high, p):
            many = touched_faces(shapes, near_b, sb, p, v, UNOPPOSED, relation, limits)
            v -= shapes.number[sa, VERTEX0]
            _put_faces(shapes, placed, near_b, many, found, pair, owner, p, CORNER_I + other, v, merge)
    for m in range(near_a.many[POINTS]):
        k = near_a.item[POINTS, m]
        p = placed_at(relation, row(shapes.point, k, PLACE))
        if holds(low, high, p):
            many = touched_faces(shapes, near_b, sb, p, -1 - k, opposed_to(shapes, k), relation, limits)
            k -= shapes.number[sa, POINT0]
            _put_faces(shapes, placed, near_b, many, found, pair, owner, p, POINT_I + other, k, merge)
