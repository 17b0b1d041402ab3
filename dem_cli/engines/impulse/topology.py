"""What the contact search wants to know of a triangulated surface: edges, corners, flat faces, and a grid to find triangles by place.

Arrays of one mesh, found once at the start with NumPy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.state import Bools, Floats, Ints

FLAT = 1e-3  # rad: an edge that bends less is no edge
OPEN_CORNER = 1e-3  # rad: a cone of normals that is narrower makes no corner
STEEPEST = 3.0  # largest way past a valley's line that a face is followed below it, over the depth


class Mesh(NamedTuple):
    """A triangulated surface, welded and without slivers.

    vertex (v, 3), triangle (t, 3) anticlockwise seen from outside, normal (t, 3) unit, middle (t, 3) of a triangle.
    triangle_edge (t, 3): edge from corner k to the next one, side (t, 3, 3): unit, in the face, from there inwards; stretch (t, 3): tangent of
    the bend of valleys there, 0 of others: how far past the side a point below the valley belongs to the face, over its depth.
    group (t,): number of the flat face that a triangle is a part of. edge (e, 2), inward (e, 2, 3): unit, from the edge into both faces, bend
    (e,): 1 ridge, -1 valley, 0 flat. Where a surface ends (rim (e,)), it is taken to go down at a right angle.
    vertex_normal (v, 3): mean of the normals, by angle. leave (m, 3), leave_start (v + 1,): unit directions of the edges that leave a vertex;
    corner (v,): whether some direction has an angle of more than 90 degrees to all of them. closed, convex: of the whole.
    """

    vertex: Floats
    triangle: Ints
    normal: Floats
    middle: Floats
    triangle_edge: Ints
    side: Floats
    stretch: Floats
    group: Ints
    edge: Ints
    inward: Floats
    bend: Ints
    rim: Bools
    vertex_normal: Floats
    leave: Floats
    leave_start: Ints
    corner: Bools
    closed: bool
    convex: bool


class Cells(NamedTuple):
    """Boxes in a grid: origin (3,), cell [m], size (3,); members of cell (x size_1 + y) size_2 + z are member[start[c]:start[c + 1]]."""

    origin: Floats
    cell: float
    size: Ints
    start: Ints
    member: Ints


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Floats = vectors / np.where(length > 0.0, length, 1.0)
    return unit


def _dot(a: Floats, b: Floats) -> Floats:
    product: Floats = np.einsum("...k,...k->...", a, b)
    return product


def _welded(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Vertices at one place made one, triangles without area left out."""
    if not len(triangles):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    span = float(np.ptp(vertices, axis=0).max())
    _, first, number = np.unique(np.round(vertices / (1e-9 * span)), axis=0, return_index=True, return_inverse=True)
    # in the order in which they stood
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    vertex, triangle = vertices[first[order]], place[number.reshape(-1)[triangles]]
    a, b, c = (vertex[triangle[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max(
        [np.linalg.norm(b - a, axis=1), np.linalg.norm(c - b, axis=1), np.linalg.norm(a - c, axis=1)], axis=0
    )
    return vertex, triangle[area > 1e-9 * longest * longest].astype(np.int64)


def _edges(triangle: Ints) -> tuple[Ints, Ints, Ints]:
    """(edge (e, 2), triangle_edge (t, 3), halves (e, 2)): a half is 3 t + k; -1 for none; edges of more than two faces have none."""
    ends = np.stack([triangle, np.roll(triangle, -1, axis=1)], axis=2).reshape(-1, 2)
    edge, number = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    number = number.reshape(-1)
    order = np.argsort(number, kind="stable")
    count = np.bincount(number, minlength=len(edge))
    start = np.concatenate([[0], np.cumsum(count)])
    halves = np.full((len(edge), 2), -1)
    for k in range(2):
        have = (count > k) & (count <= 2)
        halves[have, k] = order[start[:-1][have] + k]
    return edge.astype(np.int64), number.reshape(-1, 3), halves


def _joined(count: int, first: Ints, second: Ints) -> Ints:
    """Number of the connected group of each of `count` things that are joined pairwise."""
    number = np.arange(count)
    while True:
        least = np.minimum(number[first], number[second])
        new = number.copy()
        np.minimum.at(new, first, least)
        np.minimum.at(new, second, least)
        new = new[new]
        if np.array_equal(new, number):
            return number
        number = new


def _leaving(edge: Ints, vertex: Floats, rim: Bools, down: Floats) -> tuple[Floats, Ints]:
    """Directions that leave each vertex, and where they start; `down` (e, 3): the wall that hangs from an edge of the rim."""
    along = _unit(vertex[edge[:, 1]] - vertex[edge[:, 0]])
    at = np.concatenate([edge[:, 0], edge[:, 1], edge[rim, 0], edge[rim, 1]])
    leave = np.concatenate([along, -along, down[rim], down[rim]])
    order = np.argsort(at, kind="stable")
    return leave[order], np.searchsorted(at[order], np.arange(len(vertex) + 1))


def _corners(normal: Floats, leave: Floats, start: Ints) -> Bools:
    """Whether a vertex has a cone of normals, found by stepping away from the edges that are in the way."""
    used = np.flatnonzero(np.diff(start))
    corner = np.zeros(len(normal), dtype=bool)
    if not len(used):
        return corner
    owner = np.repeat(np.arange(len(used)), np.diff(start)[used])
    at, way = start[used], normal[used]
    for _ in range(60):
        dots = _dot(leave, way[owner])
        corner[used[np.maximum.reduceat(dots, at) < -OPEN_CORNER]] = True
        way = _unit(way - np.add.reduceat(np.maximum(dots + 2.0 * OPEN_CORNER, 0.0)[:, None] * leave, at))
    return corner


def _is_convex(vertex: Floats, triangle: Ints, normal: Floats, bend: Ints) -> bool:
    if np.any(bend < 0):
        return False
    used = vertex[np.unique(triangle)]
    if len(used) * len(triangle) > 50_000_000:
        return True
    size = float(np.ptp(used, axis=0).max())
    first = vertex[triangle[:, 0]]
    return all(
        float((used @ n - a @ n).max()) < 1e-6 * size for n, a in zip(normal, first, strict=True)
    )  # one face at a time keeps the memory small


def mesh_of(vertices: Floats, triangles: Ints) -> Mesh:
    """The Mesh of vertices (v, 3) and triangles (t, 3)."""
    vertex, triangle = _welded(np.asarray(vertices, dtype=float).reshape(-1, 3), np.asarray(triangles).reshape(-1, 3))
    corners = vertex[triangle]
    normal = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    along = _unit(np.roll(corners, -1, axis=1) - corners)
    side = _unit(np.cross(normal[:, None, :], along))
    edge, triangle_edge, halves = _edges(triangle)
    rim = (halves[:, 0] >= 0) & (halves[:, 1] < 0)
    odd = halves[:, 0] < 0
    flat_side = side.reshape(-1, 3)
    n1, n2 = normal[halves[:, 0] // 3], normal[halves[:, 1] // 3]
    inward = np.stack([flat_side[halves[:, 0]], flat_side[halves[:, 1]]], axis=1).reshape(-1, 2, 3)
    inward[rim, 1] = -n1[rim]
    lift, same = _dot(inward[:, 1], n1), _dot(n1, n2)
    bend = np.where(lift < 0.0, 1, -1)
    bend[~rim & (same > 0.0) & (np.abs(lift) < FLAT)] = 0
    bend[odd] = 0
    stretch = np.zeros(triangle.shape)
    valley = bend[triangle_edge] < 0
    tangent = np.where(same > 1e-6, np.abs(lift) / np.maximum(same, 1e-6), STEEPEST)
    stretch[valley] = np.minimum(tangent, STEEPEST)[triangle_edge][valley]
    joined = np.flatnonzero((bend == 0) & ~odd)
    group = _joined(len(triangle), halves[joined, 0] // 3, halves[joined, 1] // 3)
    angle = np.arccos(np.clip(_dot(along, -np.roll(along, 1, axis=1)), -1.0, 1.0))
    vertex_normal = np.zeros_like(vertex)
    for k in range(3):
        np.add.at(vertex_normal, triangle[:, k], angle[:, k, None] * normal)
    vertex_normal = _unit(vertex_normal)
    leave, leave_start = _leaving(edge, vertex, rim, -n1)
    closed = bool(len(triangle)) and not np.any(rim | odd)
    return Mesh(
        vertex, triangle, normal, corners.mean(axis=1), triangle_edge, side, stretch, group, edge, inward, bend, rim,
        vertex_normal, leave, leave_start, _corners(vertex_normal, leave, leave_start),
        closed, closed and _is_convex(vertex, triangle, normal, bend),
    )  # fmt: skip


def cells_of(low: Floats, high: Floats) -> Cells:
    """Boxes (b, 3), (b, 3) sorted into a grid of about as many cells as boxes."""
    if not len(low):
        return Cells(np.zeros(3), 1.0, np.ones(3, np.int64), np.zeros(2, np.int64), np.zeros(0, np.int64))
    origin, extent = low.min(axis=0), high.max(axis=0) - low.min(axis=0)
    cell = max(float((high - low).max(axis=1).mean()), 1e-3 * float(extent.max()), 1e-300)
    while np.prod(np.floor(extent / cell) + 1.0) > 2 * len(low) + 8:
        cell *= 1.1
    size = np.floor(extent / cell).astype(np.int64) + 1
    first = np.minimum(((low - origin) / cell).astype(np.int64), size - 1)
    last = np.minimum(((high - origin) / cell).astype(np.int64), size - 1)
    span = last - first + 1
    count = span.prod(axis=1)
    box = np.repeat(np.arange(len(low)), count)
    within = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
    z = first[box, 2] + within % span[box, 2]
    y = first[box, 1] + within // span[box, 2] % span[box, 1]
    x = first[box, 0] + within // (span[box, 2] * span[box, 1])
    where = (x * size[1] + y) * size[2] + z
    order = np.argsort(where, kind="stable")
    start = np.searchsorted(where[order], np.arange(int(size.prod()) + 1))
    return Cells(origin, cell, size, start.astype(np.int64), box[order].astype(np.int64))
