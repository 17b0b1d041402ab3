"""The time step of the impulse engine: there is no stability limit, so it follows from how far bodies may move in a step."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.rigid import Scene
from dem_cli.scenario import ImpulseScenario, ImpulseShake

MOVED = 0.05  # of the smallest body's size, in a step at the largest speed
COARSE = 0.25  # of the smallest body's size: a motion in a step that is warned of
PERIODS = 100.0  # steps at least in a period of the shaking


def choose_time_step(scenario: ImpulseScenario, scene: Scene) -> float:
    """The given time step [s], or that of the rule."""
    given = scenario.integration.time_step
    return given if isinstance(given, float) else min(time_step_limits(scenario, scene).values())


def time_step_limits(scenario: ImpulseScenario, scene: Scene) -> dict[str, float]:
    """What the rule takes the smallest of [s], by its reason.

    "motion": in a step, at the largest speed to expect, no point of a body moves by more than MOVED of the smallest body's size, which is its
    reach. The others: the intervals of output, PERIODS steps in a period of a sine.
    """
    size, output = smallest_size(scene), scenario.output
    limits = {
        "motion": MOVED * size / largest_speed(scenario, scene),
        "output.interval": output.interval,
        "output.frames": output.frames,
    }
    if output.tracks:
        limits["output.tracks.interval"] = output.tracks.interval
    for number, stage in enumerate(scenario.stages, 1):
        if isinstance(stage, ImpulseShake) and stage.frequency:
            limits[f"a hundredth of the period of stage {number}"] = 1.0 / (PERIODS * stage.frequency)
    return limits


def coarse(scenario: ImpulseScenario, scene: Scene, dt: float) -> tuple[str, ...]:
    """The warning of a step in which bodies may pass through each other, where it is one."""
    share = dt * largest_speed(scenario, scene) / smallest_size(scene)
    if share <= COARSE:
        return ()
    return (
        f"in a step of {dt:.3g} s the fastest body may move by {share:.0%} of the smallest one's size: bodies may pass through each other",
    )


def smallest_size(scene: Scene) -> float:
    """Reach [m] of the smallest body."""
    return float(np.min(np.array([shape.reach for shape in scene.shapes])[scene.bodies.shape] * scene.bodies.scale))


def largest_speed(scenario: ImpulseScenario, scene: Scene) -> float:
    """Speed [m/s] that the fastest point of a body comes to: as given, from the fall, and from the shaking.

    At least that of a fall through half of the smallest body's reach; where nothing moves, one body size in the time of the run.
    """
    reach = np.array([shape.reach for shape in scene.shapes])[scene.bodies.shape] * scene.bodies.scale
    given = float(np.max(np.linalg.norm(scene.bodies.v, axis=1) + reach * np.linalg.norm(scene.bodies.w, axis=1)))
    g, size = scenario.container.gravity, smallest_size(scene)
    time = sum(stage.longest for stage in scenario.stages)
    fall = min(math.sqrt(2.0 * g * fall_height(scenario, scene)), g * time)
    shaken = max((_ground_speed(stage) for stage in scenario.stages if isinstance(stage, ImpulseShake)), default=0.0)
    return max(math.hypot(given, fall) + shaken, math.sqrt(g * size)) or size / time


def _ground_speed(stage: ImpulseShake) -> float:
    """Largest speed of the ground [m/s]."""
    if stage.motion is not None:
        return max(component.peak_velocity for component in stage.motion.components)
    if not stage.amplitude or not stage.frequency:
        return 0.0
    return stage.amplitude / (math.pi * stage.frequency)  # a sine from rest: twice a/(2 pi f)


def fall_height(scenario: ImpulseScenario, scene: Scene) -> float:
    """How far [m] the highest body can fall: to the nearest plane below it, or the lowest point of the terrain; 0 with nothing below it."""
    down, x = np.array(scenario.container.gravity_direction), scene.bodies.x
    ways = []
    towards = scene.planes.normal @ down
    for point, normal, slope in zip(scene.planes.point, scene.planes.normal, towards, strict=True):
        if slope < -1e-9:
            ways.append(np.maximum(((x - point) @ normal) / -slope, 0.0))
    if scene.terrain is not None:
        ways.append(np.maximum(np.max(scene.terrain.vertices @ down) - x @ down, 0.0))
    return float(np.max(np.min(ways, axis=0))) if ways else 0.0
