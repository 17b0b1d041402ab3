"""What follows from a scenario of the impulse engine before it is run. For `dem check`."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dem_cli.assembly import build_scene
from dem_cli.cli.derived import Spread, StagePlan, about_shaking, spread_of
from dem_cli.engines.impulse.timestep import (
    choose_time_step,
    coarse,
    fall_height,
    largest_speed,
    smallest_size,
    time_step_limits,
)
from dem_cli.rigid import Scene, Shape
from dem_cli.scenario import ImpulseScenario, ImpulseSettle, ImpulseShake, Run

CONTACTS = 4.0  # contact points a body, for estimates only
FRAME_BYTES, CONTACT_BYTES = 116, 140  # a body and a contact point in a frame of the result file
ROW_BYTES, TRACK_BYTES = 8 * 62, 8 * 13  # a row of the series; a followed body in a row of the tracks


@dataclass(frozen=True)
class KindPlan:
    """Bodies of one kind.

    size [m]: radius of their bounding spheres; a spread is (smallest, mean, largest). inertia [kg m^2]: principal moments of scale 1. spheres,
    corners, triangles, points, trusted: what contacts are found with, a body.
    """

    name: str
    shape: str
    material: str
    bodies: int
    size: Spread
    mass: Spread
    volume: float
    inertia: list[float]
    spheres: int
    corners: int
    triangles: int
    points: int
    trusted: int


@dataclass(frozen=True)
class DerivedImpulse:
    """Derived numbers in SI units; see KindPlan.

    time_step_rule: the step that auto takes, time_step_bound: what it follows from. largest_speed: that it reckons with, fall_height: of the
    highest body, over what is below it. low, high: where bodies count as escaped. notes: on the quality of clouds.
    """

    title: str
    hash: str
    engine: str
    bodies: int
    total_mass: float
    kinds: list[KindPlan]
    planes: list[str]
    terrain: str | None
    terrain_triangles: int
    materials: list[str]
    restitution: list[list[float]]
    friction: list[list[float]]
    low: list[float]
    high: list[float]
    size_smallest: float
    fall_height: float
    largest_speed: float
    time_step: float
    time_step_rule: float
    time_step_bound: str
    method: str
    stages: list[StagePlan]
    steps: int
    file_bytes: int
    notes: list[str]
    warnings: list[str]

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def derive_impulse(scenario: ImpulseScenario) -> DerivedImpulse:
    """All derived numbers. ScenarioError if a file holds no solid, or the bodies find no place."""
    told: list[str] = []
    scene = build_scene(scenario, told.append)
    dt, limits = choose_time_step(scenario, scene), time_step_limits(scenario, scene)
    bound = min(limits, key=lambda name: limits[name])
    stages = [
        StagePlan(number, stage.kind, stage.name, stage.longest, stage.longest, math.ceil(stage.longest / dt - 1e-9))
        for number, stage in enumerate(scenario.stages, 1)
    ]
    steps = sum(stage.steps for stage in stages)
    return DerivedImpulse(
        title=scenario.title,
        hash=scenario.hash,
        engine=scenario.engine,
        bodies=len(scene.bodies),
        total_mass=float(scene.bodies.mass.sum()),
        kinds=[_kind(scenario, scene, number) for number in range(len(scene.groups))],
        planes=list(scene.planes.name),
        terrain=scene.terrain.name if scene.terrain else None,
        terrain_triangles=len(scene.terrain.triangles) if scene.terrain else 0,
        materials=list(scene.materials),
        restitution=scene.restitution.tolist(),
        friction=scene.friction.tolist(),
        low=scene.low.tolist(),
        high=scene.high.tolist(),
        size_smallest=smallest_size(scene),
        fall_height=fall_height(scenario, scene),
        largest_speed=largest_speed(scenario, scene),
        time_step=dt,
        time_step_rule=limits[bound],
        time_step_bound=bound,
        method=scenario.solver.method,
        stages=stages,
        steps=steps,
        file_bytes=file_bytes(scenario, scene),
        notes=[one for one in told if one.startswith("cloud ")],
        warnings=[*scene.warnings, *_warnings(scenario, scene, dt)],
    )


def _kind(scenario: ImpulseScenario, scene: Scene, number: int) -> KindPlan:
    bodies = scene.bodies.take(scene.bodies.group == number)
    if not len(bodies):  # of a packing's file, where all of them have left
        return KindPlan(scene.groups[number], "", "", 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, [0.0] * 3, *(0,) * 5)
    shape: Shape = scene.shapes[int(bodies.shape[0])]
    before = len(scene.groups) - len(scenario.grains)
    return KindPlan(
        name=scene.groups[number],
        shape=scenario.grains[number - before].shape if number >= before else shape.kind,
        material=scene.materials[int(bodies.material[0])],
        bodies=len(bodies),
        size=spread_of(shape.reach * bodies.scale),
        mass=spread_of(bodies.mass),
        volume=shape.volume,
        inertia=shape.inertia.tolist(),
        spheres=len(shape.radii),
        corners=len(shape.vertices) if shape.kind == "polyhedron" else 0,
        triangles=len(shape.triangles) if shape.kind == "polyhedron" else 0,
        points=len(shape.points),
        trusted=int(np.sum(shape.trusted)) if shape.kind == "cloud" else len(shape.points),
    )


def file_bytes(scenario: ImpulseScenario, scene: Scene) -> int:
    """Expected size of the result file, if all stages take their longest time."""
    output, time = scenario.output, sum(stage.longest for stage in scenario.stages)
    n = len(scene.bodies)
    frames = (time / output.frames + 2 * len(scenario.stages)) * n * (FRAME_BYTES + CONTACTS * CONTACT_BYTES)
    rows = time / output.interval * ROW_BYTES
    tracks = time / output.tracks.interval * len(output.tracks.grains) * TRACK_BYTES if output.tracks else 0.0
    shapes = sum(shape.vertices.nbytes + shape.triangles.nbytes + 2 * shape.points.nbytes for shape in scene.shapes)
    return int(frames + rows + tracks + shapes) + 200_000


def _warnings(scenario: ImpulseScenario, scene: Scene, dt: float) -> list[str]:
    """What is allowed but seldom meant."""
    said = [*coarse(scenario, scene, dt)]
    if dt > scenario.output.interval:
        said.append(f"the time step of {dt:.3g} s is longer than output.interval: rows of the series shorten it")
    if scenario.container.gravity > 0.0 and not len(scene.planes) and scene.terrain is None:
        said.append("there is gravity, and nothing below the bodies: add [[plane]], [container] or [terrain]")
    if float(scene.restitution.min()) == 1.0 and any(isinstance(stage, ImpulseSettle) for stage in scenario.stages):
        said.append("restitution is 1: impacts lose nothing, so a settle stage ends at its limit only")
    for number, stage in enumerate(scenario.stages, 1):
        if isinstance(stage, ImpulseShake):
            said += [f"stage {number} {words}" for words in about_shaking(stage, scenario.output.interval)]
        elif isinstance(stage, Run) and stage.duration < dt:
            said.append(f"stage {number} is shorter than one time step")
    return said
