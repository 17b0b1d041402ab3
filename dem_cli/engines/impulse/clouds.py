"""Points of one body against the particles of a cloud, each a small plane with its normal (the article's contact), and spheres on clouds."""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.arrays import (
    CORNERS,
    COUNT,
    FIRST,
    NORMAL,
    PLACE,
    POINT0,
    POINTS,
    SCALE,
    SPACING,
    SPHERE0,
    TRUSTED,
    VERTEX0,
)
from dem_cli.engines.impulse.faces import UNOPPOSED, corner_fits, opposed_to
from dem_cli.engines.impulse.found import CORNER_I, POINT_I, SPHERE, key_of, put, put_new
from dem_cli.engines.impulse.near import gather_points
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

ROUND = 1.000001  # particles of a grid are one spacing apart but for rounding
BESIDE = 0.9  # cosine of the angle between normals of contacts from both sides that are one


@kernel(inner=True)
def _particle_below(shapes, near, p, feature, opposed, relation, limits):
    """The nearest trusted particle j of the gathered ones whose plane p touches, and the gap (p - x_j).n_j; -1 for none.

    feature: corner of the other body, or -1 - k for point k, whose normal's cosine with n_j may be at most `opposed`. limits: (tolerance, depth,
    spacing): gap from -depth to tolerance, p at most a spacing beside x_j.
    """
    tolerance, depth, spacing = limits
    best, least, gap = -1, np.inf, 0.0
    for m in range(near.many[POINTS]):
        j = near.item[POINTS, m]
        if not shapes.point[j, TRUSTED]:
            continue
        d, n = sub(p, row(shapes.point, j, PLACE)), row(shapes.point, j, NORMAL)
        square, height = dot(d, d), dot(d, n)
        if height > tolerance or height < -depth or square - height * height > ROUND * spacing * spacing:
            continue
        if square > least or (square == least and j > best):
            continue
        n = turned_back(relation[0], n)
        if feature >= 0:
            if not corner_fits(shapes, feature, n):
                continue
        elif dot(row(shapes.point, -1 - feature, NORMAL), n) > opposed:
            continue
        best, least, gap = j, square, height
    return best, gap


@kernel(inner=True)
def _put_particle(shapes, placed, found, ends, pair, owner, p, j, gap, key, merge):
    """A contact of p with particle j of body owner[1]; only if none of the contacts from ends[0] to ends[1] is the same."""
    b = owner[1]
    n = row(shapes.point, j, NORMAL)
    normal = turned(turn_of(placed, b), times(n, -owner[2]))
    point = to_world(placed, b, along(p, n, -0.5 * gap))
    for k in range(ends[0], min(ends[1], found.i.size)):
        d = sub(row(found.point, k, 0), point)
        if dot(d, d) < merge * merge and dot(row(found.normal, k, 0), normal) > BESIDE:
            return None
    return put(found, pair, key, point, normal, gap * placed.frame[b, SCALE])


@kernel(inner=True)
def features_on_cloud(shapes, placed, near_a, near_b, relation, found, pair, owner, limits, merge):
    """Gathered corners and points of body a against the gathered particles of body b; as `faces.features_on_faces`.

    limits: (tolerance, depth, spacing) of scale 1 of b; contacts nearer than `merge` [m] to one that was there before are left out.
    """
    sa = placed.shape[owner[0]]
    other = 0 if owner[2] > 0 else 1
    ends = found.state[FIRST], found.state[COUNT]
    for m in range(near_a.many[CORNERS]):
        v = near_a.item[CORNERS, m]
        p = placed_at(relation, row(shapes.vertex, v, PLACE))
        j, gap = _particle_below(shapes, near_b, p, v, UNOPPOSED, relation, limits)
        if j >= 0:
            key = key_of(CORNER_I + other, v - shapes.number[sa, VERTEX0], 0)
            _put_particle(shapes, placed, found, ends, pair, owner, p, j, gap, key, merge)
    for m in range(near_a.many[POINTS]):
        k = near_a.item[POINTS, m]
        p = placed_at(relation, row(shapes.point, k, PLACE))
        j, gap = _particle_below(shapes, near_b, p, -1 - k, opposed_to(shapes, k), relation, limits)
        if j >= 0:
            # Without j: as the bodies slide, the point goes on from one particle of a face to the next.
            key = key_of(POINT_I + other, k - shapes.number[sa, POINT0], 0)
            _put_particle(shapes, placed, found, ends, pair, owner, p, j, gap, key, merge)


@kernel(inner=True)
def spheres_on_cloud(shapes, placed, near, relation, found, pair, owner, tolerance, depth):
    """Contacts of the spheres of body owner[0] with the cloud owner[1]; owner[2]: 1.0 if the spheres are i's, else -1.0.

    gap = (c - x_j).n_j - r with the nearest trusted particle whose plane holds the centre within a spacing; where there is none,
    gap = |c - x_j| - r with the nearest particle. tolerance, depth: of scale 1 of the cloud.
    """
    a, b, sign = owner
    sa, sb = placed.shape[a], placed.shape[b]
    start, spacing = shapes.number[sa, SPHERE0], shapes.size[sb, SPACING]
    turn = turn_of(placed, b)
    for k in range(start, shapes.number[sa + 1, SPHERE0]):
        c, r = placed_at(relation, row(shapes.sphere, k, 0)), shapes.sphere[k, 3] * relation[2]
        wide = r + tolerance + spacing
        gather_points(
            shapes, near, sb, (c[0] - wide, c[1] - wide, c[2] - wide), (c[0] + wide, c[1] + wide, c[2] + wide)
        )
        j, gap = _particle_below(shapes, near, c, np.int64(-1), UNOPPOSED, relation, (r + tolerance, depth, spacing))
        gap -= r
        n = row(shapes.point, max(j, 0), NORMAL)
        if j < 0:
            least = (r + tolerance) * (r + tolerance)
            for m in range(near.many[POINTS]):
                d = sub(c, row(shapes.point, near.item[POINTS, m], PLACE))
                square = dot(d, d)
                if square > 0.0 and square <= least and dot(d, row(shapes.point, near.item[POINTS, m], NORMAL)) > 0.0:
                    least, j = square, near.item[POINTS, m]
            if j < 0:
                continue
            distance = np.sqrt(least)
            n, gap = times(sub(c, row(shapes.point, j, PLACE)), 1.0 / distance), distance - r
        point = to_world(placed, b, along(c, n, -r - 0.5 * gap))
        key = key_of(SPHERE, k - start, 0)
        put_new(found, pair, key, point, turned(turn, times(n, -sign)), gap * placed.frame[b, SCALE], 0.0, 2.0)
