"""The shapes of a scene as arrays that the kernels of the contact search take.

All shapes lie one after another: what belongs to shape s is [start[s]:start[s + 1]] of its array, and indices (of vertices in triangles, of
edges) count over all of them. The terrain, where there is one, is the last shape. Lengths are those of scale 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dem_cli.engines.impulse.topology import Cells, Mesh, cells_of, mesh_of
from dem_cli.rigid import Scene, Shape
from dem_cli.state import Bools, Floats, Ints

SPHERES, POLYHEDRON, CLOUD = range(3)
KINDS = {"spheres": SPHERES, "polyhedron": POLYHEDRON, "cloud": CLOUD}


class Grids(NamedTuple):
    """The `Cells` of all shapes: origin (s, 3), cell (s,), size (s, 3), offset (s,): first cell in start; member: global indices."""

    origin: Floats
    cell: Floats
    size: Ints
    offset: Ints
    start: Ints
    member: Ints


class Shapes(NamedTuple):
    """All shapes; see `topology.Mesh` for what belongs to a surface.

    kind, convex, reach, spacing (s,); low, high (s, 3): box about the shape. sphere (., 4): centre and radius. triangle_low, triangle_high
    (., 3): box about a triangle. ridge (.,): the convex edges, which alone make contacts; corners (.,): the vertices that do. point,
    point_normal (., 3), trusted (.,): face points of a polyhedron, particles of a cloud.
    """

    kind: Ints
    convex: Bools
    reach: Floats
    spacing: Floats
    low: Floats
    high: Floats
    sphere_start: Ints
    sphere: Floats
    vertex_start: Ints
    vertex: Floats
    vertex_normal: Floats
    leave_start: Ints
    leave: Floats
    triangle_start: Ints
    triangle: Ints
    normal: Floats
    middle: Floats
    group: Ints
    triangle_edge: Ints
    side: Floats
    stretch: Floats
    triangle_low: Floats
    triangle_high: Floats
    edge_start: Ints
    edge: Ints
    inward: Floats
    bend: Ints
    rim: Bools
    corner: Bools
    ridge_start: Ints
    ridge: Ints
    corners_start: Ints
    corners: Ints
    point_start: Ints
    point: Floats
    point_normal: Floats
    trusted: Bools
    triangles: Grids
    points: Grids


class _Part(NamedTuple):
    """What one shape brings."""

    kind: int
    reach: float
    spacing: float
    sphere: Floats
    mesh: Mesh
    point: Floats
    normal: Floats
    trusted: Bools


def _part(shape: Shape) -> _Part:
    kind = KINDS[shape.kind]
    empty = np.zeros((0, 3))
    spheres = np.column_stack([shape.centers, shape.radii]) if kind == SPHERES else np.zeros((0, 4))
    # What other kinds carry of a surface is for pictures only.
    mesh = (
        mesh_of(shape.vertices, shape.triangles) if kind == POLYHEDRON else mesh_of(empty, np.zeros((0, 3), np.int64))
    )
    point, normal = (empty, empty) if kind == SPHERES else (shape.points.reshape(-1, 3), shape.normals.reshape(-1, 3))
    trusted = shape.trusted if kind == CLOUD else np.ones(len(point), dtype=bool)
    return _Part(kind, shape.reach, shape.spacing, spheres, mesh, point, normal, np.asarray(trusted, dtype=bool))


def _starts(counts: list[int]) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _stack(arrays: list[npt.NDArray[np.generic]]) -> npt.NDArray[np.generic]:
    return np.ascontiguousarray(np.concatenate(arrays))


def _grids(cells: list[Cells], first: Ints) -> Grids:
    """Cells of each shape; first (s,): what to add to its members. Each keeps its own end, so that offsets are one apart more."""
    at, start = 0, []
    for one in cells:
        start.append(one.start + at)
        at += len(one.member)
    return Grids(
        np.array([one.origin for one in cells]),
        np.array([one.cell for one in cells]),
        np.array([one.size for one in cells], dtype=np.int64),
        _starts([len(one.start) for one in cells])[:-1],
        np.concatenate(start).astype(np.int64),
        np.concatenate([one.member + add for one, add in zip(cells, first, strict=False)]).astype(np.int64),
    )


def _box(part: _Part) -> tuple[Floats, Floats]:
    spheres, radius = part.sphere[:, :3], part.sphere[:, 3:]
    corners = np.concatenate([spheres - radius, spheres + radius, part.mesh.vertex, part.point])
    return corners.min(axis=0), corners.max(axis=0)


def flatten(scene: Scene) -> Shapes:
    """The shapes of a scene, its terrain last."""
    parts = [_part(shape) for shape in scene.shapes]
    if scene.terrain is not None:
        mesh = mesh_of(scene.terrain.vertices, scene.terrain.triangles)
        none = np.zeros((0, 3))
        # without end: what lies on it sets all lengths
        parts.append(_Part(POLYHEDRON, np.inf, 0.0, np.zeros((0, 4)), mesh, none, none, np.zeros(0, dtype=bool)))
    meshes = [part.mesh for part in parts]
    boxes = [_box(part) for part in parts]
    vertex_start = _starts([len(mesh.vertex) for mesh in meshes])
    edge_start = _starts([len(mesh.edge) for mesh in meshes])
    leave_start = _starts([len(mesh.leave) for mesh in meshes])
    triangle_start = _starts([len(mesh.triangle) for mesh in meshes])
    point_start = _starts([len(part.point) for part in parts])
    ridges = [np.flatnonzero(mesh.bend > 0) for mesh in meshes]
    corners = [np.flatnonzero(mesh.corner) for mesh in meshes]

    def stack(name: str, add: Ints | None = None) -> npt.NDArray[np.generic]:
        arrays = [getattr(mesh, name) for mesh in meshes]
        return _stack(arrays if add is None else [a + b for a, b in zip(arrays, add, strict=False)])

    triangle = stack("triangle", vertex_start)
    vertex = np.asarray(stack("vertex"))
    ends = vertex[triangle]
    low, high = ends.min(axis=1), ends.max(axis=1)
    point = _stack([part.point for part in parts])
    spans = list(zip(triangle_start[:-1], triangle_start[1:], strict=True))
    grains = list(zip(point_start[:-1], point_start[1:], strict=True))
    return Shapes(
        kind=np.array([part.kind for part in parts]),
        convex=np.array([part.mesh.convex for part in parts]),
        reach=np.array([part.reach for part in parts], dtype=float),
        spacing=np.array([part.spacing for part in parts], dtype=float),
        low=np.array([box[0] for box in boxes]),
        high=np.array([box[1] for box in boxes]),
        sphere_start=_starts([len(part.sphere) for part in parts]),
        sphere=_stack([part.sphere for part in parts]),
        vertex_start=vertex_start,
        vertex=vertex,
        vertex_normal=stack("vertex_normal"),
        leave_start=np.concatenate(
            [mesh.leave_start[:-1] + add for mesh, add in zip(meshes, leave_start, strict=False)] + [leave_start[-1:]]
        ),
        leave=stack("leave"),
        triangle_start=triangle_start,
        triangle=triangle,
        normal=stack("normal"),
        middle=stack("middle"),
        group=stack("group", triangle_start),
        triangle_edge=stack("triangle_edge", edge_start),
        side=stack("side"),
        stretch=stack("stretch"),
        triangle_low=low,
        triangle_high=high,
        edge_start=edge_start,
        edge=stack("edge", vertex_start),
        inward=stack("inward"),
        bend=stack("bend"),
        rim=stack("rim"),
        corner=stack("corner"),
        ridge_start=_starts([len(some) for some in ridges]),
        ridge=_stack([some + add for some, add in zip(ridges, edge_start, strict=False)]),
        corners_start=_starts([len(some) for some in corners]),
        corners=_stack([some + add for some, add in zip(corners, vertex_start, strict=False)]),
        point_start=point_start,
        point=point,
        point_normal=_stack([part.normal for part in parts]),
        trusted=_stack([part.trusted for part in parts]),
        triangles=_grids([cells_of(low[a:b], high[a:b]) for a, b in spans], triangle_start),
        points=_grids([cells_of(point[a:b], point[a:b]) for a, b in grains], point_start),
    )
