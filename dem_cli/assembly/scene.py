"""Rigid bodies and what surrounds them, at the start of a run of the impulse engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dem_cli.assembly.meshes import read_terrain
from dem_cli.assembly.placing import place
from dem_cli.assembly.region import Tell
from dem_cli.assembly.shapes3d import Made, make_shape
from dem_cli.assembly.solids import multiply, random_quaternions
from dem_cli.assembly.surroundings import build_planes, limits, under
from dem_cli.errors import ScenarioError
from dem_cli.rigid import Bodies, Scene, Shape, Terrain
from dem_cli.scenario import BodyKind, ImpulseScenario
from dem_cli.scenario.stored_bodies import StoredBodies
from dem_cli.state import Floats, Ints


def build_scene(scenario: ImpulseScenario, tell: Tell | None = None) -> Scene:
    """Bodies, planes and terrain of a scenario; the same seed gives the same scene.

    tell: called with words on what a packing is at; may raise KeyboardInterrupt. ScenarioError if a file holds no solid, or the bodies
    find no place.
    """
    generator = np.random.default_rng(scenario.seed)
    tell = tell or (lambda _: None)
    made = [make_shape(kind, scenario.path_of) for kind in scenario.grains]
    stored = scenario.stored
    kinds, before = (len(stored.groups), len(stored.shapes)) if stored else (0, 0)
    rows = [_of_file(scenario, stored)] if stored else []
    rows += [
        _bodies(scenario, kinds + number, before + number, kind, one, generator)
        for number, (kind, one) in enumerate(zip(scenario.grains, made, strict=True))
    ]
    for one in made:
        if one.told:
            tell(one.told)
    shapes = (
        (*(Shape(**one) for one in stored.shapes), *(one.shape for one in made))
        if stored
        else tuple(one.shape for one in made)
    )
    bodies = _joined(rows)
    reach = reach_of(bodies, shapes)
    placed = place(scenario, bodies.x, reach, generator, tell)
    bodies = replace(bodies, x=placed)
    terrain, warnings = None, [warning for one in made for warning in one.warnings]
    if scenario.terrain is not None:
        table = scenario.terrain
        material = scenario.materials.index(table.material)
        terrain, said = read_terrain(scenario.path_of(table.file), table.file_unit, table.name, material)
        warnings += [*said, *_buried(under(terrain, bodies.x))]
    low, high = extent(bodies, reach, scenario, terrain)
    least, most = limits(scenario.container, terrain, low, high)
    _all_inside(scenario, bodies, least, most)
    restitution, friction = pair_tables(scenario)
    return Scene(
        groups=(*(stored.groups if stored else ()), *(kind.name for kind in scenario.grains)),
        shapes=shapes,
        bodies=bodies,
        planes=build_planes(scenario, low, high),
        terrain=terrain,
        materials=scenario.materials,
        restitution=restitution,
        friction=friction,
        low=least,
        high=most,
        warnings=tuple(warnings),
    )


def _buried(numbers: Ints) -> list[str]:
    """A warning of bodies that start under the terrain, which holds only what comes from above."""
    if not len(numbers):
        return []
    names = ", ".join(map(str, numbers[:5])) + (", ..." if len(numbers) > 5 else "")
    bodies = "bodies start" if len(numbers) > 1 else "body starts"
    return [
        f"{len(numbers)} {bodies} with the centre under the terrain, through which they fall: {names}. Start them higher"
    ]


def _all_inside(scenario: ImpulseScenario, bodies: Bodies, low: Floats, high: Floats) -> None:
    """ScenarioError if a body counts as escaped before anything has moved."""
    outside = np.flatnonzero(~np.all((bodies.x >= low) & (bodies.x <= high), axis=1))
    if len(outside):
        place = "({:.4g}, {:.4g}, {:.4g}) m".format(*bodies.x[outside[0]])
        key = "[packing] file" if outside[0] < len(scenario.stored or ()) else "[grains] position"
        raise ScenarioError(
            f"{scenario.origin}: {key}: body {outside[0]} starts at {place}, outside of what encloses the scene: "
            "it would count as escaped at once. Move it, or enlarge the container"
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


def _of_file(scenario: ImpulseScenario, stored: StoredBodies) -> Bodies:
    """The bodies of a packing's file, as they lie and move there."""
    columns, count = stored.columns, len(stored)
    material = np.array([scenario.materials.index(name) for name in stored.materials], dtype=np.int64)
    return Bodies(
        **(columns | {"material": material[columns["material"]]}),
        id=np.arange(count, dtype=np.int64),
        escaped=np.zeros(count, dtype=bool),
    )


def _bodies(
    scenario: ImpulseScenario, group: int, number: int, kind: BodyKind, made: Made, generator: np.random.Generator
) -> Bodies:
    """The bodies of a kind; those that a packing is to place lie at NaN."""
    count, shape = kind.count, made.shape
    scale = kind.scale.draw(generator, count)
    if kind.radius is not None:
        scale = scale * kind.radius.draw(generator, count, dimensions=3) / made.unit
    fixed = kind.orientation.fixed
    turned = random_quaternions(generator, count) if fixed is None else np.tile(fixed, (count, 1))
    x = np.full((count, 3), np.nan)
    if kind.position is not None:
        x = np.array(kind.position) + np.arange(count)[:, None] * np.array(kind.step or (0.0, 0.0, 0.0))
    return Bodies(
        id=np.arange(count, dtype=np.int64),
        group=np.full(count, group, dtype=np.int64),
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


def reach_of(bodies: Bodies, shapes: tuple[Shape, ...]) -> Floats:
    """Radius (n,) [m] of the bounding sphere of each body."""
    return np.asarray(np.array([shape.reach for shape in shapes])[bodies.shape] * bodies.scale)


def extent(bodies: Bodies, reach: Floats, scenario: ImpulseScenario, terrain: Terrain | None) -> tuple[Floats, Floats]:
    """Corners (3,) [m] of a box that holds the bodies, the container, a point of each plane, and the terrain."""
    container = scenario.container
    parts = [
        bodies.x - reach[:, None],
        bodies.x + reach[:, None],
        np.array([plane.point for plane in scenario.planes]).reshape(-1, 3),
    ]
    if container.width is not None and container.breadth is not None:
        parts += [np.array([[0.0, 0.0, 0.0], [container.width, container.breadth, container.height or 0.0]])]
    if terrain is not None:
        parts.append(terrain.vertices)
    points = np.concatenate(parts)
    return points.min(axis=0), points.max(axis=0)
