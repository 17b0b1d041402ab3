"""Rigid bodies and what surrounds them, at the start of a run of the impulse engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dem_cli.assembly.region import Tell
from dem_cli.assembly.shapes3d import Made, make_shape
from dem_cli.assembly.solids import multiply, random_quaternions
from dem_cli.assembly.surroundings import build_planes, limits
from dem_cli.rigid import Bodies, Scene, Terrain
from dem_cli.scenario import BodyKind, ImpulseScenario
from dem_cli.state import Floats


def build_scene(scenario: ImpulseScenario, tell: Tell | None = None) -> Scene:
    """Bodies, planes and terrain of a scenario; the same seed gives the same scene.

    tell: called with words on what a packing is at; may raise KeyboardInterrupt. ScenarioError if a file holds no solid, or the bodies
    find no place.
    """
    generator = np.random.default_rng(scenario.seed)
    tell = tell or (lambda _: None)
    made = [make_shape(kind, scenario.path_of) for kind in scenario.grains]
    rows = [
        _bodies(scenario, number, kind, one, generator)
        for number, (kind, one) in enumerate(zip(scenario.grains, made, strict=True))
    ]
    bodies = _joined(rows)
    shapes = tuple(one.shape for one in made)
    terrain: Terrain | None = None
    low, high = extent(bodies, shapes_reach(bodies, [shape.reach for shape in shapes]), scenario, terrain)
    least, most = limits(scenario.container, terrain, low, high)
    restitution, friction = pair_tables(scenario)
    return Scene(
        groups=tuple(kind.name for kind in scenario.grains),
        shapes=shapes,
        bodies=bodies,
        planes=build_planes(scenario, low, high),
        terrain=terrain,
        materials=scenario.materials,
        restitution=restitution,
        friction=friction,
        low=least,
        high=most,
        warnings=tuple(warning for one in made for warning in one.warnings),
    )


def pair_tables(scenario: ImpulseScenario) -> tuple[Floats, Floats]:
    """Restitution and friction (m, m) of each pair of materials, symmetric."""
    materials, contact = scenario.materials, scenario.contact
    tables = []
    for name in ("restitution", "friction"):
        table = np.full((len(materials), len(materials)), getattr(contact, name))
        for pair in contact.pairs:
            i, j = (materials.index(one) for one in pair.between)
            if (value := getattr(pair, name)) is not None:
                table[i, j] = table[j, i] = value
        tables.append(table)
    return tables[0], tables[1]


def _bodies(scenario: ImpulseScenario, number: int, kind: BodyKind, made: Made, generator: np.random.Generator) -> Bodies:
    """The bodies of a kind; those that a packing is to place lie at NaN."""
    count, shape = kind.count, made.shape
    scale = kind.scale.draw(generator, count)
    if kind.radius is not None:
        scale = scale * kind.radius.draw(generator, count) / made.unit
    fixed = kind.orientation.fixed
    turned = random_quaternions(generator, count) if fixed is None else np.tile(fixed, (count, 1))
    x = np.full((count, 3), np.nan)
    if kind.position is not None:
        x = np.array(kind.position) + np.arange(count)[:, None] * np.array(kind.step or (0.0, 0.0, 0.0))
    return Bodies(
        id=np.arange(count, dtype=np.int64),
        group=np.full(count, number, dtype=np.int64),
        shape=np.full(count, number, dtype=np.int64),
        scale=scale,
        material=np.full(count, scenario.materials.index(kind.material), dtype=np.int64),
        x=x,
        q=multiply(turned, made.turned),
        v=np.tile(np.array(kind.velocity), (count, 1)),
        w=np.tile(np.array(kind.spin), (count, 1)),
        mass=shape.mass * scale**3,
        inertia=shape.inertia * scale[:, None] ** 5,
        escaped=np.zeros(count, dtype=bool),
    )


def _joined(rows: list[Bodies]) -> Bodies:
    """All kinds, their ids counted through."""
    names = [name for name in rows[0].__dataclass_fields__ if name != "id"]
    columns = {name: np.concatenate([getattr(one, name) for one in rows]) for name in names}
    return replace(rows[0], id=np.arange(len(columns["mass"]), dtype=np.int64), **columns)


def shapes_reach(bodies: Bodies, reach: list[float]) -> Floats:
    """Radius (n,) [m] of the bounding sphere of each body."""
    return np.asarray(np.array(reach)[bodies.shape] * bodies.scale)


def extent(bodies: Bodies, reach: Floats, scenario: ImpulseScenario, terrain: Terrain | None) -> tuple[Floats, Floats]:
    """Corners (3,) [m] of a box that holds the bodies, the container, a point of each plane, and the terrain."""
    container = scenario.container
    parts = [bodies.x - reach[:, None], bodies.x + reach[:, None], np.array([plane.point for plane in scenario.planes]).reshape(-1, 3)]
    if container.width is not None and container.breadth is not None:
        parts += [np.array([[0.0, 0.0, 0.0], [container.width, container.breadth, container.height or 0.0]])]
    if terrain is not None:
        parts.append(terrain.vertices)
    points = np.concatenate(parts)
    return points.min(axis=0), points.max(axis=0)
