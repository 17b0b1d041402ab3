"""Narrow phase: all points at which bodies touch one another, planes and the terrain.

What is looked for depends on the kinds of both shapes; `spheres`, `faces`, `edges` and `clouds` hold the rules.
"""

from __future__ import annotations

import numpy as np

from dem_cli.engines.impulse.arrays import (
    CENTER,
    CLOUD,
    CONVEX,
    CORNER0,
    CORNERS,
    COUNT,
    FIRST,
    KIND,
    PLACE,
    POINT0,
    POLYHEDRON,
    RADIUS,
    RIDGES,
    SCALE,
    SPACING,
    SPHERE0,
    SPHERES,
    TRIANGLE0,
    TRIANGLES,
    VERTEX0,
)
from dem_cli.engines.impulse.clouds import features_on_cloud, spheres_on_cloud
from dem_cli.engines.impulse.edges import edges_on_edges, keep_least
from dem_cli.engines.impulse.faces import features_on_faces
from dem_cli.engines.impulse.found import CORNER_I, POINT_I, SPHERE, key_of, put, sort_pair
from dem_cli.engines.impulse.near import box_seen, boxes_apart, gather_edges, gather_points, gather_triangles
from dem_cli.engines.impulse.slab import keep_beyond, overlap_between
from dem_cli.engines.impulse.spheres import spheres_on_mesh, spheres_on_spheres
from dem_cli.engines.impulse.vectors import (
    add,
    along,
    dot,
    relative,
    row,
    sub,
    times,
    to_world,
    turn_of,
    turned,
    turned_back,
)
from dem_cli.jit import kernel

DEPTH = 0.25  # deepest that a point is looked for under a face, over the smaller reach; of terrain always
BORDER = 1e-6  # how far a point may lie beside a face and still be over it, over the smaller reach
MANY = 80  # triangles and points of a pair from which on the space where it overlaps is found first
MERGE = 4e-6  # contacts of one normal that are closer than this are one, over the smaller reach


@kernel()
def place_spheres(shapes, placed, ball, ball_start, n):
    """Write centre and radius of the spheres of the first n bodies, in the container's frame, into ball (., 4)."""
    for i in range(n):
        s, scale, m = placed.shape[i], placed.frame[i, SCALE], ball_start[i]
        x, turn = row(placed.frame, i, CENTER), turn_of(placed, i)
        for k in range(shapes.number[s, SPHERE0], shapes.number[s + 1, SPHERE0]):
            p = along(x, turned(turn, row(shapes.sphere, k, 0)), scale)
            ball[m, 0], ball[m, 1], ball[m, 2], ball[m, 3] = p[0], p[1], p[2], scale * shapes.sphere[k, 3]
            m += 1


@kernel(inner=True)
def _on_plane(shapes, placed, found, pair, plane, tolerance):
    """Contacts of body pair[0] with a plane (point, unit normal towards the bodies): what is no higher over it than tolerance [m]."""
    i, (foot, n) = pair[0], plane
    s, scale, x = placed.shape[i], placed.frame[i, SCALE], row(placed.frame, i, CENTER)
    height = dot(sub(x, foot), n)
    if height - placed.frame[i, RADIUS] > tolerance:
        return
    inwards = times(n, -1.0)
    own = times(turned_back(turn_of(placed, i), n), scale)
    for k in range(shapes.number[s, SPHERE0], shapes.number[s + 1, SPHERE0]):
        c, r = row(shapes.sphere, k, 0), shapes.sphere[k, 3] * scale
        gap = height + dot(c, own) - r
        if gap <= tolerance:
            point = along(to_world(placed, i, c), n, -r - 0.5 * gap)
            put(found, pair, key_of(SPHERE, k - shapes.number[s, SPHERE0], 0), point, inwards, gap)
    for m in range(shapes.number[s, CORNER0], shapes.number[s + 1, CORNER0]):
        k = shapes.corner[m]
        v = row(shapes.vertex, k, PLACE)
        gap = height + dot(v, own)
        if gap <= tolerance:
            point = along(to_world(placed, i, v), n, -0.5 * gap)
            put(found, pair, key_of(CORNER_I, k - shapes.number[s, VERTEX0], 0), point, inwards, gap)
    for k in range(shapes.number[s, POINT0], shapes.number[s + 1, POINT0]):
        v = row(shapes.point, k, PLACE)
        gap = height + dot(v, own)
        if gap <= tolerance:
            point = along(to_world(placed, i, v), n, -0.5 * gap)
            put(found, pair, key_of(POINT_I, k - shapes.number[s, POINT0], 0), point, inwards, gap)


@kernel(inner=True)
def _gather(shapes, near, s, low, high, tight, wide):
    """Corners, edges and points of shape s in the box (low, high) made larger by `tight`, triangles and cloud in that by `wide`."""
    t, w = (tight, tight, tight), (wide, wide, wide)
    if shapes.number[s, KIND] == POLYHEDRON:
        gather_triangles(shapes, near, s, sub(low, w), add(high, w))
        gather_edges(shapes, near, s, sub(low, t), add(high, t))
        gather_points(shapes, near, s, sub(low, t), add(high, t))
    else:
        near.many[TRIANGLES] = near.many[RIDGES] = near.many[CORNERS] = 0
        gather_points(shapes, near, s, sub(low, w), add(high, w))


@kernel(inner=True)
def _gather_both(shapes, placed, nears, rows, to_i, to_j, margins):
    """Features of both bodies that may touch, into `nears`; margins: (tight, depth, spacing) [m].

    Returns the depth to which contacts are to be looked for [m], -1.0 where the bodies are apart.
    """
    (i, j), (tight, depth, spacing) = rows, margins
    si, sj = placed.shape[i], placed.shape[j]
    many = 0
    for column in (TRIANGLE0, POINT0):
        many += shapes.number[si + 1, column] - shapes.number[si, column]
        many += shapes.number[sj + 1, column] - shapes.number[sj, column]
    cut = many > MANY and placed.frame[j, RADIUS] < np.inf
    n, bottom, top = (0.0, 0.0, 1.0), 0.0, 0.0
    if cut:
        n, bottom, top = overlap_between(shapes, placed, i, j, tight + spacing)
        if bottom - top > tight + spacing:
            return -1.0
        # What lies inside the other body is no deeper than this, along -n or n; twice that leaves room for faces at a slant.
        depth = min(depth, 2.0 * max(top - bottom, 0.0) + tight)
    wide = tight + depth + spacing
    # An open surface has an inside that its box does not hold.
    below = tight if placed.frame[j, RADIUS] < np.inf else wide
    low, high = box_seen(shapes, sj, to_i)
    f = 1.0 / placed.frame[i, SCALE]
    _gather(shapes, nears[0], si, low, high, below * f, wide * f)
    low, high = box_seen(shapes, si, to_j)
    f = 1.0 / placed.frame[j, SCALE]
    _gather(shapes, nears[1], sj, low, high, tight * f, wide * f)
    if cut:
        keep_beyond(shapes, placed, nears[0], i, n, bottom - tight - spacing, bottom - wide)
        keep_beyond(shapes, placed, nears[1], j, times(n, -1.0), -top - tight - spacing, -top - wide)
    return depth


@kernel(inner=True)
def _features(shapes, placed, near_a, near_b, relation, found, pair, owner, margins, merge):
    """Corners and points of body owner[0] on the faces or particles of body owner[1]; margins: (tolerance, depth, border, spacing) [m]."""
    f = 1.0 / placed.frame[owner[1], SCALE]
    tolerance, depth, border, spacing = margins
    if shapes.number[placed.shape[owner[1]], KIND] == POLYHEDRON:
        limits = (tolerance * f, depth * f, border * f)
        features_on_faces(shapes, placed, near_a, near_b, relation, found, pair, owner, limits, merge)
    else:
        limits = (tolerance * f, depth * f, spacing * f)
        features_on_cloud(shapes, placed, near_a, near_b, relation, found, pair, owner, limits, merge)


@kernel(inner=True)
def _on_surface(shapes, placed, nears, found, pair, rows, tolerance, deepest):
    """Contacts of two bodies (rows of `placed`) that are polyhedra or clouds."""
    i, j = rows
    si, sj = placed.shape[i], placed.shape[j]
    to_j, to_i = relative(placed, i, j), relative(placed, j, i)
    fi, fj = placed.frame[i, SCALE], placed.frame[j, SCALE]
    spacings = shapes.size[si, SPACING] * fi, shapes.size[sj, SPACING] * fj
    spacing = max(spacings[0], spacings[1])
    reach = min(placed.frame[i, RADIUS], placed.frame[j, RADIUS])
    deepest *= reach
    below = 0.0
    if placed.frame[j, RADIUS] == np.inf:
        below = deepest = DEPTH * reach
    if boxes_apart(shapes, si, sj, to_j, (tolerance + spacing + below) / fj):
        return
    border, merge = BORDER * reach, MERGE * reach
    if spacing > 0.0:
        merge = 0.25 * (min(spacings[0], spacings[1]) if min(spacings[0], spacings[1]) > 0.0 else spacing)
    depth = _gather_both(shapes, placed, nears, rows, to_i, to_j, (tolerance + 2.0 * border, deepest, spacing))
    if depth < 0.0:
        return
    margins = (tolerance, depth, border, spacing)
    _features(shapes, placed, nears[0], nears[1], to_j, found, pair, (i, j, 1.0), margins, merge)
    _features(shapes, placed, nears[1], nears[0], to_i, found, pair, (j, i, -1.0), margins, merge)
    if spacing == 0.0:
        limits = (tolerance / fj, depth / fj, border / fj)
        edges_on_edges(shapes, placed, nears[0], nears[1], to_j, found, pair, rows, limits, merge)
        if shapes.number[si, CONVEX] and shapes.number[sj, CONVEX]:
            keep_least(shapes, placed, found, rows, reach)


@kernel(inner=True)
def _spheres_on(shapes, placed, near, found, pair, owner, tolerance, deepest):
    """Contacts of the spheres of body owner[0] with the surface or cloud owner[1]; owner[2]: 1.0 if the spheres are i's, else -1.0."""
    a, b, _ = owner
    sa, sb = placed.shape[a], placed.shape[b]
    relation = relative(placed, a, b)
    scaled = tolerance / placed.frame[b, SCALE]
    if boxes_apart(
        shapes, sa, sb, relation, scaled + (shapes.size[sb, SPACING] if shapes.number[sb, KIND] == CLOUD else 0.0)
    ):
        return
    reach = min(placed.frame[a, RADIUS], placed.frame[b, RADIUS])
    if shapes.number[sb, KIND] == CLOUD:
        depth = deepest * reach / placed.frame[b, SCALE]
        spheres_on_cloud(shapes, placed, near, relation, found, pair, owner, scaled, depth)
        return
    spheres_on_mesh(shapes, placed, near, relation, found, pair, owner, scaled, MERGE * reach)


@kernel(inline=True, inner=True)
def _near(placed, i, j, tolerance):
    """Whether the spheres about two bodies are no farther apart than the tolerance."""
    d = sub(row(placed.frame, j, CENTER), row(placed.frame, i, CENTER))
    far = placed.frame[i, RADIUS] + placed.frame[j, RADIUS] + tolerance
    return dot(d, d) <= far * far


@kernel()
def find(shapes, placed, ball, ball_start, nears, walls, alive, start, neighbour, tolerance, deepest, found):
    """Write all contacts with gap <= tolerance [m] into `found`; found.state[COUNT] is how many
    there are, more than it holds where it is too small.

    shapes: `geometry.Shapes`; placed: bodies, and the terrain as one more where there is one; ball (., 4), ball_start (n + 1,): spheres in the
    container's frame; nears: two scratch `Near`; walls (w, 6): point and unit normal towards the bodies; alive (n,) bool; start, neighbour:
    half list of bodies that may touch; deepest: penetration up to which bodies see each other, over the
    smaller reach. found: i; j: body > i, or -1 - w for wall w, or -1 - walls for the terrain; key: the same
    from step to step for one and the same point of the pair; point: half way between both surfaces [m]; normal: unit, from i to j; gap [m].
    Sorted by (i, j, key).
    """
    found.state[COUNT] = 0
    n, planes = alive.size, walls.shape[0]
    ground = placed.shape.size > n
    for i in range(n):
        if not alive[i]:
            continue
        before = start[i] - 1  # the terrain comes before the planes, and both before other bodies
        for k in range(before, start[i + 1]):
            j = n if k == before else np.int64(neighbour[k])
            if (k > before and _near(placed, i, j, tolerance)) or (k == before and ground):
                found.state[FIRST] = found.state[COUNT]
                pair = i, (-1 - planes if k == before else j)
                ki, kj = shapes.number[placed.shape[i], KIND], shapes.number[placed.shape[j], KIND]
                if ki == SPHERES and kj == SPHERES:
                    spheres_on_spheres(placed, ball, ball_start, found, pair, tolerance)
                elif ki == SPHERES or kj == SPHERES:
                    owner = (i, j, 1.0) if ki == SPHERES else (j, i, -1.0)
                    _spheres_on(shapes, placed, nears[0], found, pair, owner, tolerance, deepest)
                else:
                    _on_surface(shapes, placed, nears, found, pair, (i, j), tolerance, deepest)
                sort_pair(found)
            if k == before:
                for w in range(planes - 1, -1, -1):
                    plane = row(walls, w, 0), row(walls, w, 3)
                    _on_plane(shapes, placed, found, (i, -1 - w), plane, tolerance)
