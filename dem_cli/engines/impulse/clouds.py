"""Points of one body against the particles of a cloud, each a small plane with its normal (the article's contact), and spheres on clouds."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.faces import OPPOSED, corner_fits
from dem_cli.engines.impulse.found import CORNER_I, POINT_I, SPHERE, key_of, put, put_new
from dem_cli.engines.impulse.near import CORNERS, POINTS, gather_points
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

BESIDE = 0.9  # cosine of the angle between normals of contacts from both sides that are one


@kernel()
def _particle_below(shapes, near, p, feature, own, relation, limits):
    """The nearest trusted particle j of the gathered ones whose plane p touches, and the gap (p - x_j).n_j; -1 for none.

    feature: corner of the other body, or -1 - k for point k; own: whether that point's normal must oppose n_j. limits: (tolerance, depth,
    spacing): gap from -depth to tolerance, p at most a spacing beside x_j.
    """
    tolerance, depth, spacing = limits
    best, least, gap = -1, np.inf, 0.0
    for m in range(near.count[POINTS]):
        j = near.point[m]
        if not shapes.trusted[j]:
            continue
        d, n = sub(p, row(shapes.point, j)), row(shapes.point_normal, j)
        square, height = dot(d, d), dot(d, n)
        if height > tolerance or height < -depth or square - height * height > spacing * spacing:
            continue
        if square > least or (square == least and j > best):
            continue
        n = turned_back(relation[0], n)
        if feature >= 0:
            if not corner_fits(shapes, feature, n):
                continue
        elif own and dot(row(shapes.point_normal, -1 - feature), n) > OPPOSED:
            continue
        best, least, gap = j, square, height
    return best, gap


@kernel()
def _put_particle(shapes, placed, found, ends, count, pair, owner, p, j, gap, key, merge):
    """A contact of p with particle j of body owner[1]; only if none of the contacts from ends[0] to ends[1] is the same."""
    b = owner[1]
    n = row(shapes.point_normal, j)
    normal = turned(turn_of(placed, b), times(n, -owner[2]))
    point = to_world(placed, b, along(p, n, -0.5 * gap))
    for k in range(ends[0], min(ends[1], found.i.size)):
        d = sub(row(found.point, k), point)
        if dot(d, d) < merge * merge and dot(row(found.normal, k), normal) > BESIDE:
            return count
    return put(found, count, pair, key, point, normal, gap * placed.scale[b])


@kernel()
def features_on_cloud(shapes, placed, near_a, near_b, relation, found, first, count, pair, owner, limits, merge):
    """Gathered corners and points of body a against the gathered particles of body b; as `faces.features_on_faces`.

    limits: (tolerance, depth, spacing) of scale 1 of b; contacts nearer than `merge` [m] to one that was there before are left out.
    """
    a, b, sign = owner
    sa = placed.shape[a]
    other, ends = 0 if sign > 0 else 1, (first, count)
    for m in range(near_a.count[CORNERS]):
        v = near_a.corner[m]
        p = placed_at(relation, row(shapes.vertex, v))
        j, gap = _particle_below(shapes, near_b, p, v, False, relation, limits)
        if j >= 0:
            key = key_of(CORNER_I + other, v - shapes.vertex_start[sa], 0)
            count = _put_particle(shapes, placed, found, ends, count, pair, owner, p, j, gap, key, merge)
    for m in range(near_a.count[POINTS]):
        k = near_a.point[m]
        p = placed_at(relation, row(shapes.point, k))
        j, gap = _particle_below(shapes, near_b, p, -1 - k, shapes.trusted[k], relation, limits)
        if j >= 0:
            # Without j: as the bodies slide, the point goes on from one particle of a face to the next.
            key = key_of(POINT_I + other, k - shapes.point_start[sa], 0)
            count = _put_particle(shapes, placed, found, ends, count, pair, owner, p, j, gap, key, merge)
    return count


@kernel()
def spheres_on_cloud(shapes, placed, near, relation, found, count, pair, owner, tolerance, depth):
    """Contacts of the spheres of body owner[0] with the cloud owner[1]; owner[2]: 1.0 if the spheres are i's, else -1.0.

    gap = (c - x_j).n_j - r with the nearest trusted particle whose plane holds the centre within a spacing; where there is none, gap = |c - x_j| - r
    with the nearest particle. tolerance, depth: of scale 1 of the cloud. Returns the new count.
    """
    a, b, sign = owner
    sa, sb = placed.shape[a], placed.shape[b]
    start, spacing, first = shapes.sphere_start[sa], shapes.spacing[sb], count
    turn = turn_of(placed, b)
    for k in range(start, shapes.sphere_start[sa + 1]):
        c, r = placed_at(relation, row(shapes.sphere, k)), shapes.sphere[k, 3] * relation[2]
        wide = r + tolerance + spacing
        gather_points(
            shapes, near, sb, (c[0] - wide, c[1] - wide, c[2] - wide), (c[0] + wide, c[1] + wide, c[2] + wide)
        )
        j, gap = _particle_below(shapes, near, c, -1, False, relation, (r + tolerance, depth, spacing))
        gap -= r
        n = row(shapes.point_normal, max(j, 0))
        if j < 0:
            least = (r + tolerance) * (r + tolerance)
            for m in range(near.count[POINTS]):
                d = sub(c, row(shapes.point, near.point[m]))
                square = dot(d, d)
                if 0.0 < square and square <= least and dot(d, row(shapes.point_normal, near.point[m])) > 0.0:
                    least, j = square, near.point[m]
            if j < 0:
                continue
            distance = np.sqrt(least)
            n, gap = times(sub(c, row(shapes.point, j)), 1.0 / distance), distance - r
        point = to_world(placed, b, along(c, n, -r - 0.5 * gap))
        key = key_of(SPHERE, k - start, 0)
        count = put_new(
            found, first, count, pair, key, point, turned(turn, times(n, -sign)), gap * placed.scale[b], 0.0, 2.0
        )
    return count
