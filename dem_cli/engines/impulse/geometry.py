"""The shapes of a scene as the few arrays that the kernels of the contact search take."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dem_cli.engines.impulse.arrays import (
    CLOUD,
    CONVEX,
    CORNER0,
    EDGE0,
    HIGH,
    KIND,
    LOW,
    NUMBERS,
    POINT0,
    POINT_CELL,
    POINT_GRID,
    POLYHEDRON,
    REACH,
    RIDGE0,
    SIZES,
    SPACING,
    SPHERE0,
    SPHERES,
    TRIANGLE0,
    TRIANGLE_CELL,
    TRIANGLE_GRID,
    VERTEX0,
    Near,
    Shapes,
)
from dem_cli.engines.impulse.topology import Cells, Mesh, cells_of, mesh_of
from dem_cli.rigid import Scene, Shape
from dem_cli.state import Floats, Ints

KINDS = {"spheres": SPHERES, "polyhedron": POLYHEDRON, "cloud": CLOUD}


class _Part(NamedTuple):
    """What one shape brings; point (p, 7): place, normal, 1.0 if that is trusted."""

    kind: int
    reach: float
    spacing: float
    sphere: Floats
    mesh: Mesh
    point: Floats


def _part(shape: Shape) -> _Part:
    kind = KINDS[shape.kind]
    spheres = np.column_stack([shape.centers, shape.radii]) if kind == SPHERES else np.zeros((0, 4))
    # What other kinds carry of a surface is for pictures only.
    surface = (
        (shape.vertices, shape.triangles) if kind == POLYHEDRON else (np.zeros((0, 3)), np.zeros((0, 3), np.int64))
    )
    count = 0 if kind == SPHERES else len(shape.points)
    trusted = shape.trusted[:count] if kind == CLOUD else np.ones(count)
    point = np.column_stack([shape.points[:count].reshape(-1, 3), shape.normals[:count].reshape(-1, 3), trusted])
    spacing = shape.spacing if kind == CLOUD else 0.0
    return _Part(kind, shape.reach, spacing, spheres, mesh_of(*surface), point.astype(float))


def _box(part: _Part) -> tuple[Floats, Floats]:
    """Corners of the box about a shape."""
    spheres, radius = part.sphere[:, :3], part.sphere[:, 3:]
    corners = np.concatenate([spheres - radius, spheres + radius, part.mesh.vertex, part.point[:, :3]])
    return corners.min(axis=0), corners.max(axis=0)


def _starts(counts: list[int]) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _floats(arrays: list[Floats]) -> Floats:
    return np.ascontiguousarray(np.concatenate(arrays), dtype=np.float64)


def _ints(arrays: list[Ints]) -> Ints:
    return np.ascontiguousarray(np.concatenate(arrays), dtype=np.int64)


def _triangles(mesh: Mesh) -> Floats:
    ends = mesh.vertex[mesh.triangle]
    return np.column_stack(
        [mesh.normal, mesh.middle, ends.min(axis=1), ends.max(axis=1), mesh.side.reshape(-1, 9), mesh.stretch]
    )


class _Grids:
    """Grids of all shapes as they are added: what goes into Shapes.cell and .member."""

    def __init__(self) -> None:
        self.cell: list[Ints] = []
        self.member: list[Ints] = []
        self.at = self.members = 0

    def add(self, cells: Cells, first: int) -> tuple[list[int], list[float]]:
        """Numbers and sizes of a grid whose members count from `first`."""
        numbers = [self.at, *cells.size.tolist()]
        self.cell.append(cells.start + self.members)
        self.member.append(cells.member + first)
        self.at += len(cells.start)
        self.members += len(cells.member)
        return numbers, [*cells.origin.tolist(), cells.cell]


def _numbers(
    parts: list[_Part], starts: dict[int, Ints], triangle: Floats, point: Floats
) -> tuple[Ints, Floats, _Grids]:
    """Shapes.number and Shapes.size, and the grids."""
    number, size = np.zeros((len(parts) + 1, NUMBERS), np.int64), np.zeros((len(parts), SIZES))
    for column, start in starts.items():
        number[:, column] = start
    grids = _Grids()
    for s, part in enumerate(parts):
        number[s, KIND], number[s, CONVEX] = part.kind, part.mesh.convex
        size[s, REACH], size[s, SPACING] = part.reach, part.spacing
        size[s, LOW : LOW + 3], size[s, HIGH : HIGH + 3] = _box(part)
        a, b = number[s : s + 2, TRIANGLE0]
        numbers, sizes = grids.add(cells_of(triangle[a:b, 6:9], triangle[a:b, 9:12]), int(a))
        number[s, TRIANGLE_GRID : TRIANGLE_GRID + 4], size[s, TRIANGLE_CELL : TRIANGLE_CELL + 4] = numbers, sizes
        a, b = number[s : s + 2, POINT0]
        numbers, sizes = grids.add(cells_of(point[a:b, :3], point[a:b, :3]), int(a))
        number[s, POINT_GRID : POINT_GRID + 4], size[s, POINT_CELL : POINT_CELL + 4] = numbers, sizes
    return number, size, grids


def _parts(scene: Scene) -> list[_Part]:
    parts = [_part(shape) for shape in scene.shapes]
    if scene.terrain is not None:
        mesh = mesh_of(scene.terrain.vertices, scene.terrain.triangles)
        # without end: what lies on it sets all lengths
        parts.append(_Part(POLYHEDRON, np.inf, 0.0, np.zeros((0, 4)), mesh, np.zeros((0, 7))))
    return parts


def flatten(scene: Scene) -> Shapes:
    """The shapes of a scene, its terrain last."""
    parts = _parts(scene)
    meshes = [part.mesh for part in parts]
    ridges = [np.flatnonzero(mesh.bend > 0) for mesh in meshes]
    corners = [np.flatnonzero(mesh.corner) for mesh in meshes]
    vertices, edges = _starts([len(mesh.vertex) for mesh in meshes]), _starts([len(mesh.edge) for mesh in meshes])
    triangles, leaves = _starts([len(mesh.triangle) for mesh in meshes]), _starts([len(mesh.leave) for mesh in meshes])
    starts = {
        SPHERE0: _starts([len(part.sphere) for part in parts]),
        VERTEX0: vertices,
        TRIANGLE0: triangles,
        EDGE0: edges,
        RIDGE0: _starts([len(some) for some in ridges]),
        CORNER0: _starts([len(some) for some in corners]),
        POINT0: _starts([len(part.point) for part in parts]),
    }
    vertex_part = [
        np.column_stack([mesh.leave_start[:-1] + at, mesh.corner]) for mesh, at in zip(meshes, leaves, strict=False)
    ]
    triangle_part = [
        np.column_stack([mesh.triangle + v, mesh.triangle_edge + e, mesh.group + t])
        for mesh, v, e, t in zip(meshes, vertices, edges, triangles, strict=False)
    ]
    edge_part = [
        np.column_stack([mesh.edge + v, mesh.bend, mesh.rim]) for mesh, v in zip(meshes, vertices, strict=False)
    ]
    triangle, point = _floats([_triangles(mesh) for mesh in meshes]), _floats([part.point for part in parts])
    number, size, grids = _numbers(parts, starts, triangle, point)
    return Shapes(
        number=number,
        size=size,
        sphere=_floats([part.sphere for part in parts]),
        vertex=_floats([np.column_stack([mesh.vertex, mesh.vertex_normal]) for mesh in meshes]),
        vertex_part=_ints([*vertex_part, np.array([[leaves[-1], 0]])]),
        leave=_floats([mesh.leave for mesh in meshes]),
        triangle=triangle,
        triangle_part=_ints(triangle_part),
        edge=_floats([mesh.inward.reshape(-1, 6) for mesh in meshes]),
        edge_part=_ints(edge_part),
        ridge=_ints([some + at for some, at in zip(ridges, edges, strict=False)]),
        corner=_ints([some + at for some, at in zip(corners, vertices, strict=False)]),
        point=point,
        cell=_ints(grids.cell),
        member=_ints(grids.member),
    )


def empty_near(shapes: Shapes) -> Near:
    """Scratch for features of any of the shapes."""
    most = max(len(array) for array in (shapes.triangle, shapes.edge, shapes.vertex, shapes.point))
    return Near(np.zeros((5, most), np.int64), np.zeros(6, np.int64), np.zeros((3, most), np.int64), np.zeros(most))


def reach_of(shapes: Shapes, shape: Ints) -> Floats:
    """Reach of bodies of these shapes at scale 1."""
    reach: npt.NDArray[np.float64] = shapes.size[shape, REACH]
    return reach
