"""Shapes as small triangles to be painted: icospheres for clumps, subdivided faces and their sharp edges for polyhedra, hulls for clouds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dem_cli.rigid import Shape
from dem_cli.state import Floats, Ints

SHARP = np.cos(np.radians(25.0))  # faces that turn by more meet in an edge that is drawn
MOST_FACES = 100  # above, a mesh is drawn without edges: they would hide it
MOST_PARTS = 6  # into which an edge is split


@dataclass(frozen=True)
class Solid:
    """What of a shape of scale 1 is painted, in its own axes [m]: triangles (t, 3, 3), outward normals (t, 3), sharp edges (e, 2, 3)
    and the normals (e, 2, 3) of the two faces that meet in each."""

    triangles: Floats
    normals: Floats
    edges: Floats
    beside: Floats


def solid_of(shape: Shape, fine: int) -> Solid:
    """fine: subdivisions of icospheres, 1 to 3; polyhedra are cut into triangles no longer than a fifth to half of their reach."""
    if shape.kind == "spheres":
        points, triangles = icosphere(fine)
        placed = shape.centers[:, None, None] + shape.radii[:, None, None, None] * points[triangles]
        normals = np.tile(points[triangles].mean(axis=1), (len(shape.radii), 1))
        hidden = _inside_another(placed.reshape(-1, 3, 3), shape)
        return Solid(
            placed.reshape(-1, 3, 3)[~hidden], _unit(normals)[~hidden], np.empty((0, 2, 3)), np.empty((0, 2, 3))
        )
    vertices, triangles = shape.vertices.reshape(-1, 3), shape.triangles.reshape(-1, 3)
    if len(triangles) == 0:
        vertices, triangles = hull(shape.points)
    corners = vertices[triangles]
    normals = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    edges, beside = (
        sharp_edges(vertices, triangles, normals) if len(triangles) <= MOST_FACES else (np.empty((0, 2, 3)),) * 2
    )
    longest = shape.reach * (0.9 if fine < 2 else 0.45)
    cut, owner = subdivided(corners, longest)
    split, which = _split(edges, longest)
    return Solid(cut, normals[owner], split, beside[which])


@lru_cache(maxsize=4)
def icosphere(subdivisions: int) -> tuple[Floats, Ints]:
    """Points (p, 3) of the unit sphere and triangles (t, 3), anticlockwise seen from outside; 20 * 4^subdivisions of them."""
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    points = np.array(
        [
            [-1, golden, 0], [1, golden, 0], [-1, -golden, 0], [1, -golden, 0], [0, -1, golden], [0, 1, golden],
            [0, -1, -golden], [0, 1, -golden], [golden, 0, -1], [golden, 0, 1], [-golden, 0, -1], [-golden, 0, 1],
        ]
    )  # fmt: skip
    triangles = np.array(
        [
            [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
            [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
        ]
    )  # fmt: skip
    points = _unit(points)
    for _ in range(subdivisions):
        corners = _unit(_quarters(points[triangles]).reshape(-1, 3))
        points, index = np.unique(corners.round(12), axis=0, return_inverse=True)
        triangles = index.reshape(-1, 3)
    return _unit(points), triangles


def _quarters(corners: Floats) -> Floats:
    """Each triangle (t, 3, 3) as four, in turn: (4 t, 3, 3)."""
    a, b, c = (corners[:, k] for k in range(3))
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.stack([np.stack(part, axis=1) for part in parts], axis=1).reshape(-1, 3, 3)


def subdivided(corners: Floats, longest: float) -> tuple[Floats, Ints]:
    """Triangles (t, 3, 3) cut in four until no edge is longer than `longest`, at most three times, and the one that each comes from."""
    owner = np.arange(len(corners))
    for _ in range(3):
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        large = sides.max(axis=1, initial=0.0) > longest
        if not large.any():
            break
        corners = np.concatenate([corners[~large], _quarters(corners[large])])
        owner = np.concatenate([owner[~large], np.repeat(owner[large], 4)])
    return corners, owner


def sharp_edges(vertices: Floats, triangles: Ints, normals: Floats) -> tuple[Floats, Floats]:
    """Edges (e, 2, 3) at which two faces meet under more than 25 deg, or at which a surface ends, and the normals (e, 2, 3) of these faces."""
    _, same = np.unique(vertices.round(12), axis=0, return_inverse=True)
    ends = np.sort(np.stack([same.ravel()[triangles], same.ravel()[np.roll(triangles, -1, axis=1)]], axis=2), axis=2)
    sides = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    _, number = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    number = number.ravel()
    order = np.argsort(number, kind="stable")
    first = np.searchsorted(number[order], np.arange(number.max(initial=-1) + 1))
    last = np.searchsorted(number[order], np.arange(number.max(initial=-1) + 1), side="right") - 1
    one, two = order[first] // 3, order[last] // 3
    keep = (first == last) | (np.einsum("ek,ek->e", normals[one], normals[two]) < SHARP)
    return vertices[sides[order[first]]][keep], np.stack([normals[one], normals[two]], axis=1)[keep]


def _split(edges: Floats, longest: float) -> tuple[Floats, Ints]:
    """Edges (e, 2, 3) in equal parts no longer than `longest`, and the one that each comes from."""
    length = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    parts = np.clip(np.ceil(length / longest - 1e-9), 1, MOST_PARTS).astype(np.int64)
    which = np.repeat(np.arange(len(edges)), parts)
    k = np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = np.stack([k, k + 1], axis=1) / parts[which][:, None]
    start, way = edges[which, 0], edges[which, 1] - edges[which, 0]
    return start[:, None] + share[:, :, None] * way[:, None], which


def _inside_another(triangles: Floats, shape: Shape) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether a triangle of a clump lies with all corners inside another sphere of it."""
    each = len(triangles) // max(1, len(shape.radii))
    own = np.repeat(np.arange(len(shape.radii)), each)
    hidden = np.zeros(len(triangles), dtype=bool)
    for k, (center, radius) in enumerate(zip(shape.centers, shape.radii, strict=True)):
        within = (np.linalg.norm(triangles - center, axis=2) < radius * (1.0 - 1e-9)).all(axis=1)
        hidden |= within & (own != k)
    return hidden


def hull(points: Floats) -> tuple[Floats, Ints]:
    """Convex hull of points (p, 3), triangles anticlockwise seen from outside; nothing for fewer than four, or flat ones."""
    from scipy.spatial import ConvexHull, QhullError

    none = np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    if len(points) < 4:
        return none
    try:
        triangles = np.asarray(ConvexHull(points).simplices, dtype=np.int64)
    except QhullError:
        return none
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("tk,tk->t", normals, corners[:, 0] - points.mean(axis=0)) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return points, triangles


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))
