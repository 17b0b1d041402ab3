"""Shapes of rigid bodies, kind by kind of the scenario."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dem_cli.assembly.clouds import read_cloud
from dem_cli.assembly.clumps import sphere_surfaces, union_of_spheres
from dem_cli.assembly.meshes import check_closed, pieces_of, read_mesh
from dem_cli.assembly.solids import Solid, ball, cuboid, polyhedron, principal, quaternion_of
from dem_cli.rigid import Shape
from dem_cli.scenario import BodyKind
from dem_cli.state import Bools, Floats, Ints

# Corners of a box of edge 2, and its faces, anticlockwise seen from outside.
CORNERS = np.array([[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)])
FACES = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))
NO_POINTS = np.empty((0, 3))


class Made(NamedTuple):
    """A shape of scale 1, and how its bodies are made of it.

    turned (4,): quaternion that turns its frame, that of its principal axes, into that of the file or key. unit: the length that scale 1
    stands for, of shapes with a radius; else 1. told: of the quality of a cloud. warnings: what is seldom meant.
    """

    shape: Shape
    turned: Floats
    unit: float = 1.0
    told: str = ""
    warnings: tuple[str, ...] = ()


def make_shape(kind: BodyKind, path_of: Callable[[str], Path]) -> Made:
    """The shape of the bodies of a kind. ScenarioError if its file is none, or holds no solid."""
    if kind.shape == "box":
        return Made(box(kind), np.array([1.0, 0.0, 0.0, 0.0]))
    if kind.shape in ("sphere", "clump"):
        return _of_spheres(kind)
    assert kind.file is not None
    path = path_of(kind.file)
    return _of_mesh(kind, path) if kind.shape == "mesh" else _of_cloud(kind, path)


def box(kind: BodyKind) -> Shape:
    """A cuboid: 8 corners, 12 triangles, and k x k points within each face."""
    assert kind.size is not None
    size = np.array(kind.size)
    triangles = np.array([t for a, b, c, d in FACES for t in ((a, b, c), (a, c, d))], dtype=np.int64)
    points, normals = _face_points(kind.face_points or 0)
    return finished(
        kind, "polyhedron", cuboid(size), np.eye(3), surface=(0.5 * size * CORNERS, triangles),
        points=(0.5 * size * points, normals),
    )  # fmt: skip


def _face_points(count: int) -> tuple[Floats, Floats]:
    """count x count points within each face of a box of edge 2, those at the rims half a spacing inside, and their outward normals."""
    if not count:
        return NO_POINTS, NO_POINTS
    line = (2.0 * np.arange(count) + 1.0) / count - 1.0
    u, v = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    points, normals = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            face = np.empty((count * count, 3))
            face[:, axis], face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = side, u, v
            normal = np.zeros((count * count, 3))
            normal[:, axis] = side
            points.append(face)
            normals.append(normal)
    return np.concatenate(points), np.concatenate(normals)


def _of_spheres(kind: BodyKind) -> Made:
    assert kind.radius is not None
    unit = kind.radius.bounds[1]
    if kind.template is None:
        centres, radii, solid = np.zeros((1, 3)), np.array([unit]), ball(unit)
    else:
        centres, radii = (unit * part for part in kind.template.outline())
        solid = union_of_spheres(centres, radii)
    _, axes = principal(solid)
    centres = (centres - solid.centre) @ axes
    shape = finished(kind, "spheres", solid, axes, surface=sphere_surfaces(centres, radii), spheres=(centres, radii))
    return Made(shape, quaternion_of(axes), unit)


def _of_mesh(kind: BodyKind, path: Path) -> Made:
    vertices, triangles = read_mesh(path, kind.file_unit or "m")
    check_closed(path, vertices, triangles)
    solid = polyhedron(vertices, triangles)
    _, axes = principal(solid)
    shape = finished(kind, "polyhedron", solid, axes, surface=((vertices - solid.centre) @ axes, triangles))
    warnings: tuple[str, ...] = ()
    if (pieces := pieces_of(triangles, len(vertices))) > 1:
        warnings = (f"mesh {kind.name}: its surface is {pieces} separate pieces, which move as one body",)
    return Made(shape, quaternion_of(axes), warnings=warnings)


def _of_cloud(kind: BodyKind, path: Path) -> Made:
    cloud = read_cloud(path, kind.file_unit or "m", kind.spacing, kind.name)
    _, axes = principal(cloud.solid)
    centre = cloud.solid.centre
    vertices, triangles = cloud.surface
    shape = finished(
        kind, "cloud", cloud.solid, axes, surface=((vertices - centre) @ axes, triangles),
        points=((cloud.points - centre) @ axes, cloud.normals @ axes), trusted=cloud.trusted, spacing=cloud.spacing,
    )  # fmt: skip
    return Made(shape, quaternion_of(axes), warnings=cloud.warnings, told=cloud.words(kind.name))


def finished(
    kind: BodyKind,
    form: str,
    solid: Solid,
    axes: Floats,
    *,
    surface: tuple[Floats, Ints],
    spheres: tuple[Floats, Floats] = (NO_POINTS, np.empty(0)),
    points: tuple[Floats, Floats] = (NO_POINTS, NO_POINTS),
    trusted: Bools | None = None,
    spacing: float = 0.0,
) -> Shape:
    """A shape with its mass; all places are in the frame of `axes` about the solid's centre already."""
    away = [np.linalg.norm(surface[0], axis=1), np.linalg.norm(points[0], axis=1)]
    if form == "spheres":
        away = [np.linalg.norm(spheres[0], axis=1) + spheres[1]]
    moments = np.diag(axes.T @ solid.inertia @ axes)
    return Shape(
        name=kind.name,
        kind=form,  # type: ignore[arg-type]
        vertices=surface[0],
        triangles=surface[1],
        centers=spheres[0],
        radii=spheres[1],
        points=points[0],
        normals=points[1],
        trusted=np.ones(len(points[0]), dtype=bool) if trusted is None else np.asarray(trusted, dtype=bool),
        spacing=spacing,
        mass=kind.density * solid.volume,
        inertia=kind.density * moments,
        volume=solid.volume,
        reach=float(np.max(np.concatenate(away))),
    )
