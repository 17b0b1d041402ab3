"""Bodies and scenes for tests of the contact search, built by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dem_cli.engines.impulse.detect import ContactSearch, Touching
from dem_cli.rigid import Bodies, Planes, Scene, Shape, Terrain, rotation
from dem_cli.state import Floats, Ints

NONE = np.zeros((0, 3))
TINY = 1e-6


def shape_of(kind: Any, **parts: Any) -> Shape:
    given = {
        "vertices": NONE, "triangles": np.zeros((0, 3), np.int64), "centers": NONE, "radii": np.zeros(0), "points": NONE,
        "normals": NONE, "trusted": np.zeros(0, dtype=bool), "spacing": 0.0,
    } | parts  # fmt: skip
    far = [np.linalg.norm(given["vertices"], axis=1), np.linalg.norm(given["points"], axis=1)]
    reach = float(np.concatenate([*far, np.linalg.norm(given["centers"], axis=1) + given["radii"]]).max())
    return Shape(name=kind, kind=kind, mass=1.0, inertia=np.ones(3), volume=1.0, reach=reach, **given)


def box_mesh(size: Sequence[float]) -> tuple[Floats, Ints]:
    half = np.asarray(size) / 2.0
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def box(size: Sequence[float] = (1.0, 1.0, 1.0), face_points: int = 0) -> Shape:
    """A box; face_points k: k x k points inside each face."""
    vertices, triangles = box_mesh(size)
    places, normals = [], []
    steps = (np.arange(face_points) + 0.5) / max(face_points, 1) - 0.5
    for axis in range(3):
        for sign in (-1.0, 1.0):
            for a in steps:
                for b in steps:
                    place = np.empty(3)
                    place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3] = 0.5 * sign, a, b
                    places.append(place * np.asarray(size))
                    normals.append(sign * np.eye(3)[axis])
    points = {"points": np.array(places), "normals": np.array(normals)} if places else {}
    return shape_of("polyhedron", vertices=vertices, triangles=triangles, **points)


def clump(centers: Any, radii: Any) -> Shape:
    return shape_of("spheres", centers=np.asarray(centers, dtype=float), radii=np.asarray(radii, dtype=float))


def ball(radius: float = 0.5) -> Shape:
    return clump([[0.0, 0.0, 0.0]], [radius])


def mesh(vertices: Any, triangles: Any) -> Shape:
    return shape_of("polyhedron", vertices=np.asarray(vertices, dtype=float), triangles=np.asarray(triangles))


def subdivided(vertices: Any, triangles: Any, times: int) -> tuple[Floats, Ints]:
    """Each triangle made four, `times` times; corners of neighbours are listed more than once."""
    corners = np.asarray(vertices, dtype=float)[np.asarray(triangles)]
    for _ in range(times):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        four = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(one, axis=1) for one in four])
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def round_stone(times: int, radius: float) -> Shape:
    """A mesh about a sphere: 8 triangles, subdivided."""
    ends = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    fan = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (1, 0, 5), (2, 1, 5), (3, 2, 5), (0, 3, 5)]
    vertices, triangles = subdivided(ends, fan, times)
    return mesh(radius * vertices / np.linalg.norm(vertices, axis=1)[:, None], triangles)


def cloud_box(size: Sequence[float], many: int, edge: float = 0.3) -> Shape:
    """Particles at the centres of many x many cells of each face; those up to `edge` from a face's middle, in box sizes, are trusted."""
    points = box(size, many)
    around = np.sort(np.abs(points.points / np.asarray(size)), axis=1)[:, 1]
    spacing = max(size) / many
    return shape_of("cloud", points=points.points, normals=points.normals, trusted=around < edge, spacing=spacing)


def scene(
    shapes: Sequence[Shape],
    x: Any,
    which: Any = None,
    q: Any = None,
    scale: Any = None,
    planes: Sequence[tuple[Any, Any]] = (),
    terrain: tuple[Any, Any] | None = None,
) -> Scene:
    """Bodies at x, body k of shape which[k] (default: of shape k, or all of the one there is); planes: (point, normal)."""
    x = np.asarray(x, dtype=float).reshape(-1, 3)
    n = len(x)
    zero = np.zeros(n, np.int64)
    which = (zero if len(shapes) == 1 else np.arange(n)) if which is None else np.asarray(which)
    bodies = Bodies(
        id=np.arange(n), group=zero, shape=which, scale=np.ones(n) if scale is None else np.asarray(scale, dtype=float),
        material=zero, x=x, q=np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)) if q is None else np.asarray(q, dtype=float),
        v=np.zeros((n, 3)), w=np.zeros((n, 3)), mass=np.ones(n), inertia=np.ones((n, 3)), escaped=np.zeros(n, dtype=bool),
    )  # fmt: skip
    walls = Planes(
        tuple(f"plane {k}" for k in range(len(planes))),
        np.array([point for point, _ in planes], dtype=float).reshape(-1, 3),
        np.array([normal for _, normal in planes], dtype=float).reshape(-1, 3),
        np.zeros(len(planes), np.int64),
        np.zeros((len(planes), 4, 3)),
    )
    ground = (
        None if terrain is None else Terrain("ground", np.asarray(terrain[0], dtype=float), np.asarray(terrain[1]), 0)
    )
    ends = np.full(3, np.inf)
    return Scene(
        ("kind",), tuple(shapes), bodies, walls, ground, ("stone",), np.ones((1, 1)), np.ones((1, 1)), -ends, ends
    )


def contacts(given: Scene, tolerance: float = TINY) -> Touching:
    """All contacts of a scene, copied."""
    found = ContactSearch(given).look(given.bodies.x, given.bodies.q, tolerance)
    return Touching(*(array.copy() for array in found))


def about(axis: Sequence[float], angle: float) -> Floats:
    """Quaternion of a turn by an angle [rad]."""
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    return np.array([np.cos(angle / 2.0), *(np.sin(angle / 2.0) * unit)])


def product(a: Floats, b: Floats) -> Floats:
    """Quaternion of turn b, then turn a."""
    w = a[0] * b[0] - a[1:] @ b[1:]
    return np.array([w, *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def random_turn(random: np.random.Generator) -> Floats:
    q = random.normal(size=4)
    turn: Floats = q / np.linalg.norm(q)
    return turn


def corners_of(given: Scene, i: int) -> Floats:
    """Vertices of body i in the container's frame."""
    bodies = given.bodies
    places: Floats = bodies.x[i] + bodies.scale[i] * given.shapes[bodies.shape[i]].vertices @ rotation(bodies.q[i])[0].T
    return places
