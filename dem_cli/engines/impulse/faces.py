"""Corners, face points and particles of one body against the faces of another."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.found import CORNER_I, POINT_I, SAME, key_of, put_new
from dem_cli.engines.impulse.near import CORNERS, POINTS, TRIANGLES, holds
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


@kernel()
def _over(shapes, t, p, height, border):
    """Whether p, at `height` over the plane of triangle t, lies over the triangle, or below a valley at its side."""
    for k in range(3):
        out = -dot(sub(p, row(shapes.vertex, shapes.triangle[t, k])), row(shapes.side[t], k))
        if out > border and out > border - height * shapes.stretch[t, k]:
            return False
    return True


@kernel()
def _face_to_face(shapes, a, b):
    """Whether triangles a and b have each other's middle in front, as the two sides of a valley do."""
    way = sub(row(shapes.middle, b), row(shapes.middle, a))
    return dot(way, row(shapes.normal, a)) >= 0.0 and dot(way, row(shapes.normal, b)) <= 0.0


@kernel()
def corner_fits(shapes, v, n):
    """Whether all edges that leave corner v point away from a face with normal n, in the corner's frame; by 10 degrees they need not."""
    for k in range(shapes.leave_start[v], shapes.leave_start[v + 1]):
        if dot(row(shapes.leave, k), n) < -DIP:
            return False
    return True


@kernel()
def touched_faces(shapes, near, s, p, feature, own, relation, limits):
    """Faces of shape s that a point p in its frame touches: near.held and near.height, the first of the number returned.

    feature: the corner, or -1 - k for point k; own: whether a point's normal must oppose the face's. relation: from the point's body to this
    one. limits: (tolerance, depth, border), of scale 1. A face counts where it holds the point's foot, the height is from -depth to
    tolerance, and the body could touch it there; of those the nearest, and others only that face it across a valley.
    """
    tolerance, depth, border = limits
    many, convex = 0, shapes.convex[s]
    for m in range(near.count[TRIANGLES]):
        t = near.triangle[m]
        n = row(shapes.normal, t)
        height = dot(sub(p, row(shapes.middle, t)), n)
        if convex and height > tolerance:
            return 0
        if abs(height) > depth or not _over(shapes, t, p, height, border):
            continue
        n = turned_back(relation[0], n)
        if feature >= 0:
            if not corner_fits(shapes, feature, n):
                continue
        elif own and dot(row(shapes.point_normal, -1 - feature), n) > OPPOSED:
            continue
        near.held[many], near.height[many] = t, height
        many += 1
    return _nearest(shapes, near, many, tolerance)


@kernel()
def _nearest(shapes, near, many, tolerance):
    """Of the faces near.held those that are the nearest, or face all nearer ones, and are no higher than the tolerance."""
    for k in range(1, many):
        m, t, height = k, near.held[k], near.height[k]
        while m > 0 and (
            abs(height) < abs(near.height[m - 1]) or (abs(height) == abs(near.height[m - 1]) and t < near.held[m - 1])
        ):
            near.held[m], near.height[m] = near.held[m - 1], near.height[m - 1]
            m -= 1
        near.held[m], near.height[m] = t, height
    kept = 0
    for k in range(many):
        t, height, fits = near.held[k], near.height[k], True
        for m in range(kept):
            other = near.held[m]
            fits = fits and shapes.group[other] != shapes.group[t] and _face_to_face(shapes, other, t)
        if fits:  # in front of some face and not touching it: keeps what lies behind that face from counting
            near.held[kept], near.height[kept] = t, height
            kept += 1
    touching = 0
    for k in range(kept):
        if near.height[k] <= tolerance:
            near.held[touching], near.height[touching] = near.held[k], near.height[k]
            touching += 1
    return touching


@kernel()
def _put_faces(shapes, placed, near, many, found, first, count, pair, owner, p, kind, feature, merge):
    """Contacts of point p of body `owner[0]`, in the frame of body `owner[1]`, with the first faces of near.held; owner[2]: 1 if i's."""
    b, scale = owner[1], placed.scale[owner[1]]
    for k in range(many):
        t, height = near.held[k], near.height[k]
        n = row(shapes.normal, t)
        normal = turned(turn_of(placed, b), times(n, -owner[2]))
        key = key_of(kind, feature, shapes.group[t])
        point = to_world(placed, b, along(p, n, -0.5 * height))
        count = put_new(found, first, count, pair, key, point, normal, height * scale, merge, SAME)
    return count


@kernel()
def features_on_faces(shapes, placed, near_a, near_b, relation, found, first, count, pair, owner, limits, merge):
    """Gathered corners and points of body a against the gathered triangles of body b.

    owner: (a, b, 1.0 if a is the pair's i, else -1.0); relation: `relative` of a and b. Returns the new count of contacts.
    """
    a, b, sign = owner
    sa, sb = placed.shape[a], placed.shape[b]
    wide = limits[0] + limits[2]
    low, high = row(shapes.low, sb), row(shapes.high, sb)
    low, high = (low[0] - wide, low[1] - wide, low[2] - wide), (high[0] + wide, high[1] + wide, high[2] + wide)
    other = 0 if sign > 0 else 1
    for m in range(near_a.count[CORNERS]):
        v = near_a.corner[m]
        p = placed_at(relation, row(shapes.vertex, v))
        if holds(low, high, p):
            many = touched_faces(shapes, near_b, sb, p, v, False, relation, limits)
            v -= shapes.vertex_start[sa]
            count = _put_faces(
                shapes, placed, near_b, many, found, first, count, pair, owner, p, CORNER_I + other, v, merge
            )
    for m in range(near_a.count[POINTS]):
        k = near_a.point[m]
        p = placed_at(relation, row(shapes.point, k))
        if holds(low, high, p):
            many = touched_faces(shapes, near_b, sb, p, -1 - k, shapes.trusted[k], relation, limits)
            k -= shapes.point_start[sa]
            count = _put_faces(
                shapes, placed, near_b, many, found, first, count, pair, owner, p, POINT_I + other, k, merge
            )
    return count
