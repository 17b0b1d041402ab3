"""Scenes of bodies in 3D made by hand, frames of them with invented contacts, and result files: every number is known."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from dem_cli.results import ImpulseWriter
from dem_cli.results.body_schema import BODY_SERIES
from dem_cli.rigid import Bodies, BodyContacts, BodyFrame, ImpulseEnergy, Planes, Scene, Shape, Solving, Terrain
from dem_cli.state import Floats

DENSITY = 2500.0
N = 5
NO_POINTS = np.empty((0, 3))
CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def box_shape(size: tuple[float, float, float] = (2.0, 1.0, 2.0), name: str = "box", density: float = DENSITY) -> Shape:
    edges = np.array(size)
    volume = float(np.prod(edges))
    mass = density * volume
    squares = edges**2
    return Shape(
        name=name, kind="polyhedron", vertices=CUBE * edges, triangles=CUBE_TRIANGLES, centers=NO_POINTS, radii=np.empty(0),
        points=np.array([[0.5 * edges[0], 0.0, 0.0]]), normals=np.array([[1.0, 0.0, 0.0]]), trusted=np.array([True]),
        spacing=0.0, mass=mass, inertia=mass / 12.0 * (squares.sum() - squares), volume=volume,
        reach=0.5 * float(np.linalg.norm(edges)),
    )  # fmt: skip


def pair_shape(radius: float = 0.5) -> Shape:
    """Two spheres side by side that touch (a surface of no triangles)."""
    volume = 8.0 / 3.0 * np.pi * radius**3
    mass = DENSITY * volume
    return Shape(
        name="pair", kind="spheres", vertices=NO_POINTS, triangles=np.empty((0, 3), dtype=np.int64),
        centers=np.array([[-radius, 0.0, 0.0], [radius, 0.0, 0.0]]), radii=np.array([radius, radius]), points=NO_POINTS,
        normals=NO_POINTS, trusted=np.empty(0, dtype=bool), spacing=0.0, mass=mass,
        inertia=mass * radius**2 * np.array([0.4, 1.4, 1.4]), volume=float(volume), reach=2.0 * radius,
    )  # fmt: skip


def no_planes() -> Planes:
    return Planes((), np.empty((0, 3)), np.empty((0, 3)), np.empty(0, dtype=np.int64), np.empty((0, 4, 3)))


def planes_of(*rows: tuple[str, list[float], list[float]]) -> Planes:
    """Planes (name, point, normal) of material 0 with a square piece of 2 m around the point."""
    point, normal = (np.array([row[k] for row in rows], dtype=float) for k in (1, 2))
    edges = []
    for p, n in zip(point, normal, strict=True):
        a = np.cross(n, [0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [1.0, 0.0, 0.0])
        a /= np.linalg.norm(a)
        b = np.cross(n, a)
        edges.append([p - a - b, p + a - b, p + a + b, p - a + b])
    return Planes(tuple(row[0] for row in rows), point, normal, np.zeros(len(rows), dtype=np.int64), np.array(edges))


def container(width: float, breadth: float, height: float = 3.0) -> Planes:
    w, b, h = width, breadth, height
    found = planes_of(
        ("left", [0, 0, 0], [1, 0, 0]),
        ("right", [width, 0, 0], [-1, 0, 0]),
        ("front", [0, 0, 0], [0, 1, 0]),
        ("back", [0, breadth, 0], [0, -1, 0]),
        ("bottom", [0, 0, 0], [0, 0, 1]),
    )
    edge = [
        [[0, 0, 0], [0, b, 0], [0, b, h], [0, 0, h]],
        [[w, b, 0], [w, 0, 0], [w, 0, h], [w, b, h]],
        [[w, 0, 0], [0, 0, 0], [0, 0, h], [w, 0, h]],
        [[0, b, 0], [w, b, 0], [w, b, h], [0, b, h]],
        [[0, 0, 0], [w, 0, 0], [w, b, 0], [0, b, 0]],
    ]
    return replace(found, edge=np.array(edge, dtype=float))


def ramp() -> Terrain:
    """Two triangles that rise towards -x."""
    vertices = np.array([[0.0, 0, 0], [4.0, 0, -1], [4.0, 3, -1], [0.0, 3, 0]])
    return Terrain("hill", vertices, np.array([[0, 1, 2], [0, 2, 3]]), 1)


def bodies_at(x: Any, shapes: tuple[Shape, ...], shape: Any = None, **changes: Any) -> Bodies:
    """Bodies (n,) at rest, not turned, at places x (n, 3); shape: number of each, 0 if left out."""
    x = np.array(x, dtype=float).reshape(-1, 3)
    n = len(x)
    shape = np.zeros(n, dtype=np.int64) if shape is None else np.array(shape, dtype=np.int64)
    scale = np.array(changes.pop("scale", np.ones(n)), dtype=float)
    given: dict[str, Any] = {
        "id": np.arange(n, dtype=np.int64), "group": shape.copy(), "shape": shape, "scale": scale,
        "material": np.zeros(n, dtype=np.int64), "x": x, "q": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        "v": np.zeros((n, 3)), "w": np.zeros((n, 3)),
        "mass": np.array([shapes[k].mass for k in shape]) * scale**3,
        "inertia": np.array([shapes[k].inertia for k in shape]).reshape(n, 3) * scale[:, None] ** 5,
        "escaped": np.zeros(n, dtype=bool),
    }  # fmt: skip
    return Bodies(**{**given, **{name: np.array(value) for name, value in changes.items()}})


def scene_of(
    bodies: Bodies, shapes: tuple[Shape, ...], planes: Planes | None = None, terrain: Terrain | None = None
) -> Scene:
    return Scene(
        groups=tuple(shape.name for shape in shapes), shapes=shapes, bodies=bodies,
        planes=no_planes() if planes is None else planes, terrain=terrain, materials=("rock", "slope"),
        restitution=np.array([[0.5, 0.25], [0.25, 0.0]]), friction=np.array([[0.3, 0.6], [0.6, 0.1]]),
        low=np.array([-np.inf, -np.inf, -10.0]), high=np.array([np.inf, 50.0, np.inf]),
    )  # fmt: skip


def some_scene() -> Scene:
    """Five boxes and pairs of any place, turn and speed, two planes and a terrain."""
    rng = np.random.default_rng(5)
    shapes = (box_shape(), pair_shape())
    q = rng.normal(size=(N, 4))
    bodies = bodies_at(
        rng.normal(size=(N, 3)), shapes, [0, 1, 0, 1, 1], scale=[1.0, 0.5, 2.0, 1.5, 1.0],
        q=q / np.linalg.norm(q, axis=1)[:, None], v=rng.normal(size=(N, 3)), w=rng.normal(size=(N, 3)),
    )  # fmt: skip
    planes = planes_of(("floor", [0, 0, 0], [0, 0, 1]), ("wall", [-3, 0, 0], [1, 0, 0]))
    return scene_of(bodies, shapes, planes, ramp())


def some_contacts(pairs: list[tuple[int, int]], seed: int = 2) -> BodyContacts:
    rng = np.random.default_rng(seed)
    c = len(pairs)
    i, j = (np.array([pair[k] for pair in pairs], dtype=np.int64) for k in (0, 1))
    normal = rng.normal(size=(c, 3))
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    impulse = normal * rng.random(c)[:, None] + 0.1 * rng.normal(size=(c, 3))
    return BodyContacts(i, j, normal, rng.normal(size=(c, 3)), 1e-3 * rng.normal(size=c), impulse, rng.random(c) < 0.5)


def no_contacts() -> BodyContacts:
    return some_contacts([])


def moved(bodies: Bodies, k: int) -> Bodies:
    rng = np.random.default_rng(100 + k)
    q = rng.normal(size=(len(bodies), 4))
    escaped = np.zeros(len(bodies), dtype=bool)
    escaped[2] = k % 2 == 1
    return replace(
        bodies, x=bodies.x + rng.normal(size=(len(bodies), 3)), v=rng.normal(size=(len(bodies), 3)),
        w=rng.normal(size=(len(bodies), 3)), q=q / np.linalg.norm(q, axis=1)[:, None], escaped=escaped,
    )  # fmt: skip


def frame_of(bodies: Bodies, time: float = 0.0, contacts: BodyContacts | None = None, **changes: Any) -> BodyFrame:
    given: dict[str, Any] = {
        "step": 0, "time": time, "dt": 1e-3, "stage": 0, "bodies": bodies, "ground": np.zeros((3, 3)), "energy": ImpulseEnergy(),
        "residual": 0.0, "energy_in": 0.0, "solving": Solving(), "due": frozenset({"series", "frames"}),
        "contacts": no_contacts() if contacts is None else contacts,
    }  # fmt: skip
    return BodyFrame(**{**given, **changes})


def some_frame(k: int, pairs: list[tuple[int, int]]) -> BodyFrame:
    rng = np.random.default_rng(200 + k)
    return frame_of(
        moved(some_scene().bodies, k), 0.1 * k, some_contacts(pairs, seed=k), step=100 * k, stage=k // 2,
        ground=rng.normal(size=(3, 3)), energy=ImpulseEnergy(*rng.normal(size=len(fields(ImpulseEnergy))).tolist()),
        residual=1e-9 * k, energy_in=3.0 + k, solving=Solving(100, 7, 3.5 + k, 12.25, 40, k, 1e-6, 2, 9),
        stage_start=k == 0, stage_end=k == 2,
    )  # fmt: skip


# Contacts of each frame: with planes and the terrain (-3), without any, with bodies only; twice the same pair.
PAIRS: list[list[tuple[int, int]]] = [
    [(0, -1), (0, 1), (0, 1), (4, -3)],
    [],
    [(1, -2), (1, -1), (2, 3), (3, -3), (3, 4)],
    [(0, 4)],
]


def open_writer(path: Path, scene: Scene | None = None, **changes: Any) -> ImpulseWriter:
    arguments: dict[str, Any] = {
        "scenario_text": 'title = "test"  # as given\n',
        "resolved_toml": 'title = "test"\nseed = 7\n',
        "scenario_hash": "0123456789abcdef",
        "seed": 7,
        "title": "test",
        "scene": some_scene() if scene is None else scene,
        "gravity": np.array([0.0, 0.0, -9.80665]),
        "container": {"width": None, "breadth": None, "height": None},
        "tracks": np.array([1, 4]),
    }
    return ImpulseWriter(path, **{**arguments, **changes})


def series_row(k: int) -> dict[str, float]:
    return {**{name: 10.0 * k + index for index, name in enumerate(BODY_SERIES)}, "time": 0.1 * k}


def write_all(path: Path, **changes: Any) -> Path:
    """Four frames, three rows of series and tracks, two stages."""
    with open_writer(path, **changes) as writer:
        writer.begin_stage("fall", "settle", 0.0)
        for k in range(3):
            writer.append_series(series_row(k))
            writer.append_tracks(0.05 * k, moved(some_scene().bodies, k))
        writer.end_stage(0.2, "at rest", series_row(2))
        writer.begin_stage("go on", "run", 0.2)
        for k, pairs in enumerate(PAIRS):
            writer.append_frame(some_frame(k, pairs))
        writer.warn("first")
        writer.finish("all stages done")
    return path


def axis_angle(axis: Any, angle: float) -> Floats:
    """Unit quaternion of a turn by `angle` [rad] about `axis`."""
    axis = np.array(axis, dtype=float)
    return np.array([np.cos(0.5 * angle), *(np.sin(0.5 * angle) * axis / np.linalg.norm(axis))])
