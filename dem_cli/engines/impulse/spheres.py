"""Spheres against spheres and against triangulated surfaces."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.arrays import (
    BEND,
    CENTER,
    END,
    FACE_NORMAL,
    GROUP,
    HIGH,
    INWARD,
    LEAVE0,
    LOW,
    NORMAL,
    OTHER_END,
    OTHER_INWARD,
    PLACE,
    RADIUS,
    RIM,
    SCALE,
    SPHERE0,
    TRIANGLE_EDGE,
    TRIANGLE_VERTEX,
    TRIANGLES,
)
from dem_cli.engines.impulse.found import SAME, SPHERE, key_of, put, put_new
from dem_cli.engines.impulse.near import gather_triangles
from dem_cli.engines.impulse.vectors import (
    add,
    along,
    dot,
    placed_at,
    row,
    sub,
    times,
    to_world,
    turn_of,
    turned,
)
from dem_cli.jit import kernel

FACE, EDGE, VERTEX = range(3)
BEYOND = 1.5  # how far from a centre triangles are looked for, in radii: a centre may be half a radius inside
ROUND = 1e-9  # sine of an angle that rounding makes


@kernel(inner=True)
def spheres_on_spheres(placed, ball, ball_start, found, pair, tolerance):
    """Contacts of two bodies of spheres (pair (i, j), both bodies): gap = |x_j - x_i| - r_i - r_j.

    ball (., 4): centre and radius of the spheres of all bodies in the container's frame; body i's start at ball_start[i].
    """
    i, j = pair
    away, reach = row(placed.frame, j, CENTER), placed.frame[j, RADIUS] + tolerance
    for a in range(ball_start[i], ball_start[i + 1]):
        p, r = row(ball, a, 0), ball[a, 3]
        d = sub(away, p)
        if dot(d, d) > (reach + r) * (reach + r):
            continue
        for b in range(ball_start[j], ball_start[j + 1]):
            d = sub(row(ball, b, 0), p)
            square, both = dot(d, d), r + ball[b, 3]
            if square > (both + tolerance) * (both + tolerance):
                continue
            distance = np.sqrt(square)
            # Two spheres in one place have no direction: up, as good as any and the same every time.
            n = times(d, 1.0 / distance) if distance > 0.0 else (0.0, 0.0, 1.0)
            gap = distance - both
            key = key_of(SPHERE, a - ball_start[i], b - ball_start[j])
            put(found, pair, key, along(p, n, r + 0.5 * gap), n, gap)


@kernel(inner=True)
def closest_on_triangle(shapes, t, c):
    """Closest point of triangle t to c, and on what it lies: (point, FACE, t), (point, EDGE, edge) or (point, VERTEX, vertex)."""
    va, vb, vc = (
        shapes.triangle_part[t, TRIANGLE_VERTEX + 0],
        shapes.triangle_part[t, TRIANGLE_VERTEX + 1],
        shapes.triangle_part[t, TRIANGLE_VERTEX + 2],
    )
    a, b, d = row(shapes.vertex, va, PLACE), row(shapes.vertex, vb, PLACE), row(shapes.vertex, vc, PLACE)
    ab, ad, ac = sub(b, a), sub(d, a), sub(c, a)
    d1, d2 = dot(ab, ac), dot(ad, ac)
    if d1 <= 0.0 and d2 <= 0.0:
        return a, VERTEX, va
    bc = sub(c, b)
    d3, d4 = dot(ab, bc), dot(ad, bc)
    if d3 >= 0.0 and d4 <= d3:
        return b, VERTEX, vb
    if d1 * d4 - d3 * d2 <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return along(a, ab, d1 / (d1 - d3)), EDGE, shapes.triangle_part[t, TRIANGLE_EDGE + 0]
    dc = sub(c, d)
    d5, d6 = dot(ab, dc), dot(ad, dc)
    if d6 >= 0.0 and d5 <= d6:
        return d, VERTEX, vc
    if d5 * d2 - d1 * d6 <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return along(a, ad, d2 / (d2 - d6)), EDGE, shapes.triangle_part[t, TRIANGLE_EDGE + 2]
    if d3 * d6 - d5 * d4 <= 0.0 and d4 >= d3 and d5 >= d6:
        return (
            along(b, sub(d, b), (d4 - d3) / ((d4 - d3) + (d5 - d6))),
            EDGE,
            shapes.triangle_part[t, TRIANGLE_EDGE + 1],
        )
    n = row(shapes.triangle, t, FACE_NORMAL)
    return along(c, n, -dot(ac, n)), FACE, t


@kernel(inner=True)
def _outward(shapes, t, kind, feature):
    """Outward direction at a feature of triangle t, not of unit length at edges: which side of the surface a point lies on."""
    if kind == FACE:
        return row(shapes.triangle, t, FACE_NORMAL)
    if kind == VERTEX:
        return row(shapes.vertex, feature, NORMAL)
    # the sum of both normals is against the sum of both inward directions at a ridge, and along it in a valley
    lean = add(row(shapes.edge, feature, INWARD), row(shapes.edge, feature, OTHER_INWARD))
    n = row(shapes.triangle, t, FACE_NORMAL)
    if shapes.edge_part[feature, BEND] == 0 or dot(lean, lean) < ROUND:
        return n
    return times(lean, -float(shapes.edge_part[feature, BEND]))


@kernel(inner=True)
def _is_nearest_around(shapes, t, kind, feature, d):
    """Whether no point of the surface next to the feature is nearer than it to a point at the unit direction d."""
    if kind == FACE:
        return dot(row(shapes.triangle, t, FACE_NORMAL), d) > 0.0
    if kind == EDGE:
        return (
            dot(row(shapes.edge, feature, INWARD), d) <= ROUND
            and dot(row(shapes.edge, feature, OTHER_INWARD), d) <= ROUND
        )
    for k in range(shapes.vertex_part[feature, LEAVE0], shapes.vertex_part[feature + 1, LEAVE0]):
        if dot(row(shapes.leave, k, 0), d) > ROUND:
            return False
    return True


@kernel(inner=True)
def _at_rim(shapes, t, kind, feature):
    """Whether a feature of triangle t lies where the surface ends."""
    if kind == EDGE:
        return shapes.edge_part[feature, RIM]
    if kind == VERTEX:
        for k in range(3):
            e = shapes.triangle_part[t, TRIANGLE_EDGE + k]
            if shapes.edge_part[e, RIM] and (
                shapes.edge_part[e, END] == feature or shapes.edge_part[e, OTHER_END] == feature
            ):
                return True
    return False


@kernel(inner=True)
def _nearest_feature(shapes, near, c):
    """(distance, triangle, point, kind, feature) of the gathered triangle nearest to c, and whether c is inside."""
    least, best, q, kind, feature = np.inf, -1, c, FACE, -1
    for m in range(near.many[TRIANGLES]):
        t = near.item[TRIANGLES, m]
        p, k, f = closest_on_triangle(shapes, t, c)
        d = sub(c, p)
        square = dot(d, d)
        if square < least or (square == least and t < best):
            least, best, q, kind, feature = square, t, p, k, f
    inside = best >= 0 and dot(sub(c, q), _outward(shapes, best, kind, feature)) < 0.0
    return np.sqrt(least), best, q, kind, feature, inside


@kernel(inner=True)
def _feature_key(shapes, t, kind, feature, a):
    """Key of sphere a on a feature: of a flat face one and the same wherever the sphere is."""
    if kind == EDGE and shapes.edge_part[feature, BEND] != 0:
        return key_of(SPHERE, a, feature * 3 + EDGE)
    if kind == VERTEX:
        return key_of(SPHERE, a, feature * 3 + VERTEX)
    return key_of(SPHERE, a, shapes.triangle_part[t, GROUP] * 3 + FACE)


@kernel(inner=True)
def sphere_on_mesh(shapes, placed, near, found, pair, owner, c, r, a, tolerance, merge):
    """Contacts of one sphere with the surface of body owner[0], in its frame of scale 1.

    c: centre, r: radius, a: number of the sphere in its body; owner[1]: 1.0 if the sphere is the pair's i, else -1.0. Outside, every
    feature (face, edge, vertex) that is the nearest around it; inside, the nearest feature alone, gap = -distance - r.
    """
    b, sign = owner
    s, scale = placed.shape[b], placed.frame[b, SCALE]
    wide = max(BEYOND * r, r + tolerance)
    gather_triangles(shapes, near, s, (c[0] - wide, c[1] - wide, c[2] - wide), (c[0] + wide, c[1] + wide, c[2] + wide))
    distance, t, q, kind, feature, inside = _nearest_feature(shapes, near, c)
    if t < 0 or (not inside and distance > r + tolerance) or (inside and distance > BEYOND * r):
        return
    turn = turn_of(placed, b)
    if inside or distance < ROUND * r:
        if _at_rim(shapes, t, kind, feature):
            return
        n = sub(q, c)
        if distance < ROUND * r:
            n = _outward(shapes, t, kind, feature)
        n = times(n, 1.0 / np.sqrt(dot(n, n)))
        gap = -distance - r
        key = _feature_key(shapes, t, kind, feature, a)
        point = to_world(placed, b, along(q, n, 0.5 * gap))
        put_new(found, pair, key, point, turned(turn, times(n, -sign)), gap * scale, merge, SAME)
        return
    for m in range(near.many[TRIANGLES]):
        t = near.item[TRIANGLES, m]
        q, kind, feature = closest_on_triangle(shapes, t, c)
        d = sub(c, q)
        square = dot(d, d)
        if square > (r + tolerance) * (r + tolerance):
            continue
        distance = np.sqrt(square)
        d = times(d, 1.0 / distance)
        if not _is_nearest_around(shapes, t, kind, feature, d):
            continue
        key = _feature_key(shapes, t, kind, feature, a)
        gap = distance - r
        point = to_world(placed, b, along(q, d, 0.5 * gap))
        put_new(found, pair, key, point, turned(turn, times(d, -sign)), gap * scale, merge, SAME)


@kernel(inner=True)
def spheres_on_mesh(shapes, placed, near, relation, found, pair, owner, tolerance, merge):
    """Contacts of all spheres of body owner[0] with the surface of body owner[1]; owner[2]: 1.0 if the spheres are i's, else -1.0.

    relation: `relative` of owner[0] and owner[1]; tolerance: of scale 1 of the surface.
    """
    a, b, sign = owner
    sa, sb = placed.shape[a], placed.shape[b]
    start = shapes.number[sa, SPHERE0]
    low, high = row(shapes.size, sb, LOW), row(shapes.size, sb, HIGH)
    for k in range(start, shapes.number[sa + 1, SPHERE0]):
        c, r = placed_at(relation, row(shapes.sphere, k, 0)), shapes.sphere[k, 3] * relation[2]
        wide = r + tolerance
        if (
            low[0] - wide <= c[0] and c[0] <= high[0] + wide and low[1] - wide <= c[1] and c[1] <= high[1] + wide
            and low[2] - wide <= c[2] and c[2] <= high[2] + wide
        ):  # fmt: skip
            sphere_on_mesh(shapes, placed, near, found, pair, (b, sign), c, r, k - start, tolerance, merge)
