"""Result files of bodies in 3D made by tiny simulations whose answers are known, for tests of reports and pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scene_samples import axis_angle, bodies_at, box_shape, container, pair_shape, planes_of, scene_of

from dem_cli.analysis.bodies3d import measure_bodies
from dem_cli.results import ImpulseWriter, partial_path
from dem_cli.rigid import Bodies, BodyContacts, BodyFrame, ImpulseEnergy, Scene, Solving, Terrain, rotation
from dem_cli.state import Floats

G = 9.80665
RESOLVED = """
title = "{title}"
engine = "impulse"
[solver]
method = "pgs"
[output]
{check}
"""
State = tuple[float, Bodies]
DOWN = np.array([0.0, 0.0, -G])


def energy_of(bodies: Bodies, gravity: Floats, start: float, friction: bool) -> ImpulseEnergy:
    """The ledger, in which all that is missing was lost in impacts, or to friction. start: stored at the start."""
    kinetic = float(0.5 * bodies.mass @ (bodies.v**2).sum(axis=1))
    own = np.einsum("nba,nb->na", rotation(bodies.q), bodies.w)
    rotational = float(0.5 * (bodies.inertia * own**2).sum())
    potential = float(-bodies.mass @ (bodies.x @ gravity))
    lost = start - kinetic - rotational - potential if np.isfinite(start) else 0.0
    return ImpulseEnergy(
        kinetic=kinetic,
        rotational=rotational,
        potential=potential,
        restitution=0.0 if friction else lost,
        friction=lost if friction else 0.0,
    )


def write_run(
    path: Path,
    scene: Scene,
    states: Iterable[State],
    *,
    dt: float,
    check: str = "",
    gravity: Floats = DOWN,
    title: str = "made by formula",
    every: tuple[int, int, int] = (1, 10, 100),
    tracks: list[int] | None = None,
    contacts: Callable[[Bodies], BodyContacts] | None = None,
    container_size: tuple[float, float] | None = None,
    friction: bool = False,
    capped: int = 0,
    residual: float = 0.0,
    complete: bool = True,
) -> Path:
    """every: states from one row of tracks, of the series, and from one frame to the next. Returns where the file is."""
    resolved = RESOLVED.format(title=title, check=f'check = "{check}"' if check else "")
    width, breadth = container_size or (None, None)
    with ImpulseWriter(
        path, scenario_text="", resolved_toml=resolved, scenario_hash="0123456789abcdef", seed=7, title=title, scene=scene,
        gravity=gravity, container={"width": width, "breadth": breadth, "height": None},
        tracks=None if tracks is None else np.array(tracks),
    ) as writer:  # fmt: skip
        start, row, steps = np.nan, {}, 0
        all_states = list(states)
        for k, (time, bodies) in enumerate(all_states):
            last = k == len(all_states) - 1
            energy = energy_of(bodies, gravity, start, friction)
            start = energy.stored if k == 0 else start
            frame = BodyFrame(
                step=k, time=time, dt=dt, stage=0, bodies=bodies, ground=np.zeros((3, 3)), energy=energy, residual=residual * k,
                energy_in=start, solving=Solving(k - steps, (k - steps) // 5, 2.0 + k % 3, 6.0, 40 + k, capped, 1e-6, 2, 9),
                due=frozenset(), contacts=none() if contacts is None else contacts(bodies), stage_start=k == 0,
            )  # fmt: skip
            if k % every[1] == 0 or last:
                row, steps = measure_bodies(frame, scene), k
                writer.append_series(row)
            if k == 0:
                writer.begin_stage("run", "run", time, row)
            if k % every[2] == 0 or last:
                writer.append_frame(frame)
            if k % every[0] == 0 or last:
                writer.append_tracks(time, bodies)
        writer.end_stage(all_states[-1][0], "its duration is over", row)
        writer.finish("all stages are done" if complete else "interrupted", complete=complete)
    return path if complete else partial_path(path)


def none() -> BodyContacts:
    empty = np.empty(0, dtype=np.int64)
    return BodyContacts(
        empty, empty, np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty((0, 3)), np.empty(0, dtype=bool)
    )


def bounced(height: float, e: float, dt: float, duration: float) -> list[tuple[float, float, float]]:
    """Time, height over the floor and velocity of a bouncing point, in the engine's split step: half drift, impact, kick, half drift."""
    z, v, found = height, 0.0, [(0.0, height, 0.0)]
    for k in range(1, round(duration / dt) + 1):
        z += 0.5 * dt * v
        if z <= 0.0 and v < 0.0:
            v = -e * v
        v -= G * dt
        z += 0.5 * dt * v
        found.append((k * dt, z, v))
    return found


def drop_file(
    path: Path, e: float = 0.5, dt: float = 5e-4, duration: float = 1.5, every: int = 1, **changes: Any
) -> Path:
    """The article's box, 0.6 m over a floor."""
    shapes = (box_shape((2.0, 1.0, 2.0)),)
    bodies = bodies_at([[0, 0, 1.6]], shapes)
    scene = replace(
        scene_of(bodies, shapes, planes_of(("floor", [0, 0, 0], [0, 0, 1]))), restitution=np.full((2, 2), e)
    )
    states = [
        (t, replace(bodies, x=np.array([[0, 0, 1.0 + z]]), v=np.array([[0, 0, v]])))
        for t, z, v in bounced(0.6, e, dt, duration)
    ]
    return write_run(path, scene, states, dt=dt, check="drop", every=(every, 10, 200), tracks=[0], **changes)


def slope_file(
    path: Path, frictions: tuple[float, ...] = (0.0, 0.1, 0.3, 0.6), error: float = 0.0, **changes: Any
) -> Path:
    """Boxes side by side on a slope of 30 deg, one of each friction. error: share by which they are too fast."""
    angle, dt = np.radians(30.0), 1e-3
    shapes = (box_shape((1.0, 1.0, 1.0)),)
    n = len(frictions)
    normal, along = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([np.cos(angle), 0, -np.sin(angle)])
    start = 0.5 * normal + np.array([[0, 2.0 * k, 0] for k in range(n)])
    q = np.tile(axis_angle([0, 1, 0], angle), (n, 1))
    bodies = bodies_at(start, shapes, q=q, material=np.arange(n))
    table = np.zeros((n + 1, n + 1))
    table[-1, :n] = table[:n, -1] = frictions
    planes = replace(planes_of(("slope", [0, 0, 0], normal.tolist())), material=np.array([n]))
    scene = replace(
        scene_of(bodies, shapes, planes),
        materials=(*(f"m{k}" for k in range(n)), "slope"),
        friction=table,
        restitution=0 * table,
    )
    a = (1.0 + error) * G * np.maximum(0.0, np.sin(angle) - np.array(frictions) * np.cos(angle))
    states = [
        (t, replace(bodies, x=start + 0.5 * a[:, None] * t**2 * along, v=a[:, None] * t * along))
        for t in dt * np.arange(1001)
    ]
    return write_run(path, scene, states, dt=dt, check="slope", tracks=list(range(n)), friction=True, **changes)


def collision_file(
    path: Path, masses: tuple[float, float] = (1.0, 3.0), e: float = 0.5, wrong: float = 0.0, **changes: Any
) -> Path:
    """Two cubes, the first with 2 m/s; wrong [m/s]: added to the second after the impact."""
    shapes = tuple(box_shape((1.0, 1.0, 1.0), name, m) for name, m in zip(("light", "heavy"), masses, strict=True))
    bodies = bodies_at([[-1.1, 0, 0], [0.1, 0, 0]], shapes, [0, 1], v=[[2.0, 0, 0], [0, 0, 0]])
    scene = replace(scene_of(bodies, shapes), restitution=np.full((2, 2), e))
    m = masses[0] * masses[1] / sum(masses)
    after = [2.0 - m * (1 + e) * 2.0 / masses[0], m * (1 + e) * 2.0 / masses[1] + wrong]
    states = []
    for t in 1e-3 * np.arange(301):
        late = max(0.0, t - 0.1)
        x = [[-1.1 + 2.0 * min(t, 0.1) + after[0] * late, 0, 0], [0.1 + after[1] * late, 0, 0]]
        v = [[after[0] if t > 0.1 else 2.0, 0, 0], [after[1] if t > 0.1 else 0.0, 0, 0]]
        states.append((float(t), replace(bodies, x=np.array(x), v=np.array(v))))
    return write_run(path, scene, states, dt=1e-3, check="collision", gravity=np.zeros(3), tracks=[0, 1], **changes)


def row_file(path: Path, n: int = 4, e: float = 1.0, **changes: Any) -> Path:
    """Cubes 1 cm apart, the first with 1 m/s; each hands it on to the next."""
    shapes = (box_shape((1.0, 1.0, 1.0)),)
    start = np.array([[1.01 * k, 0.0, 0.0] for k in range(n)])
    bodies = bodies_at(start, shapes, v=[[1.0, 0, 0], *([[0.0, 0, 0]] * (n - 1))])
    scene = replace(scene_of(bodies, shapes), restitution=np.full((2, 2), e))
    states = []
    for t in 1e-3 * np.arange(101):
        k = min(n - 1, int(t / 0.01 + 1e-9))
        x, v = start.copy(), np.zeros((n, 3))
        x[:k, 0] += 0.01
        x[k, 0] += t - 0.01 * k
        v[k, 0] = 1.0
        states.append((float(t), replace(bodies, x=x, v=v)))
    return write_run(path, scene, states, dt=1e-3, check="row", gravity=np.zeros(3), tracks=list(range(n)), **changes)


def hill(width: float = 12.0, length: float = 40.0) -> Terrain:
    """A slope of 35 deg that runs out on the level, with some roughness, on a grid."""
    x, y = np.meshgrid(np.linspace(0, length, 41), np.linspace(0, width, 13), indexing="ij")
    z = np.maximum(0.0, 14.0 - 0.7 * x) + 0.25 * np.sin(1.3 * x) * np.cos(0.9 * y) * (x < 20)
    vertices = np.stack([x, y, z], axis=2).reshape(-1, 3)
    k = np.arange(41 * 13).reshape(41, 13)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    return Terrain("hill", vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), 1)


def rockfall_file(path: Path, n: int = 30, **changes: Any) -> Path:
    """Blocks and pairs that go down a hill with a speed of their own and stop: run-out of body k is 8 + 0.5 k metres; the last escapes."""
    rng = np.random.default_rng(3)
    shapes = (box_shape((1.0, 0.8, 0.6)), pair_shape(0.35))
    start = np.stack([rng.uniform(1, 3, n), rng.uniform(2, 10, n), rng.uniform(15, 17, n)], axis=1)
    bodies = bodies_at(start, shapes, np.arange(n) % 2, scale=rng.uniform(0.7, 1.6, n))
    scene = scene_of(bodies, shapes, None, hill())
    far, axes = 8.0 + 0.5 * np.arange(n), rng.normal(size=(n, 3))
    states = []
    for t in np.arange(0.0, 4.001, 0.02):
        share = 1.0 - (1.0 - min(1.0, t / 4.0)) ** 2
        rate = 0.5 * (1.0 - min(1.0, t / 4.0))
        x = start + np.stack([far * share, 0.0 * far, -(start[:, 2] - 0.6) * share**0.8], axis=1)
        v = np.stack([far * rate, 0.0 * far, -(start[:, 2] - 0.6) * rate], axis=1)
        q = np.array([axis_angle(axis, 3.0 * share * (1 + k % 5)) for k, axis in enumerate(axes)])
        escaped = (np.arange(n) == n - 1) & (t > 3.0)
        states.append((float(t), replace(bodies, x=x, v=v, q=q, escaped=escaped)))
    return write_run(path, scene, states, dt=0.02, every=(1, 1, 10), tracks=[0, 1, 2, 7], **changes)


def pile_file(path: Path, **changes: Any) -> Path:
    """Layers of cubes and pairs at rest in a container of 4 m x 3 m, three high, with contacts down to the floor."""
    shapes = (box_shape((0.9, 0.9, 0.9)), pair_shape(0.22))
    x = np.array([[0.5 + i, 0.5 + j, 0.45 + 0.9 * k] for k in range(3) for j in range(3) for i in range(4)])
    n = len(x)
    bodies = bodies_at(x, shapes, (np.arange(n) % 5 == 4).astype(int))
    scene = scene_of(bodies, shapes, container(4.0, 3.0))

    def contacts(here: Bodies) -> BodyContacts:
        j = np.where(np.arange(n) >= 12, np.arange(n) - 12, -5)
        i = np.where(j >= 0, j, np.arange(n))
        other = np.where(j >= 0, np.arange(n), -5)
        normal = np.where(other[:, None] >= 0, [0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
        point = here.x[np.arange(n)] - [0.0, 0.0, 0.45]
        weight = (1.0 + (2 - np.arange(n) // 12))[:, None] * normal
        order = np.lexsort((other, i))
        parts = (i, other, normal, point, np.full(n, -1e-4), weight, np.zeros(n, dtype=bool))
        return BodyContacts(*(part[order] for part in parts))

    states = [(0.1 * k, bodies) for k in range(3)]
    return write_run(
        path, scene, states, dt=0.1, every=(1, 1, 1), contacts=contacts, container_size=(4.0, 3.0), **changes
    )
