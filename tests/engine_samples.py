"""Small samples for tests of the engine: scenarios with soft and heavy grains, so that a second takes some thousand steps."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scenario_text import ABSENT, small

from dem_cli.assembly import Assembly, build_assembly
from dem_cli.assembly.container import build_walls
from dem_cli.engines.explicit.engine import ExplicitEngine
from dem_cli.scenario import Scenario, parse_scenario
from dem_cli.state import Floats, Frame, Grains

# kn 1e6 N/m with grains of 0.2 to 0.8 kg: a time step of some 1e-4 s; their weight presses them in by 1e-3 of a radius at most.
SOFT: dict[str, Any] = {
    "material": {"normal_stiffness": "1e6 N/m", "tangential_stiffness": "3.3e5 N/m"},
    "output.interval": "10 ms",
    "output.frames": "100 ms",
}


def soft(changes: dict[str, Any] | None = None) -> Scenario:
    """`scenario_text.small` with soft contacts, and keys changed."""
    return parse_scenario(text_of(changes))


def text_of(changes: dict[str, Any] | None = None) -> str:
    """The TOML of `soft`."""
    wanted = {**SOFT, **(changes or {})}
    return small({name: value if value is ABSENT else copy.deepcopy(value) for name, value in wanted.items()})


def engine_of(scenario: Scenario, grains: Grains | None = None) -> ExplicitEngine:
    """An engine for a scenario, with grains of our own in the place of those that it describes."""
    if grains is None:
        return ExplicitEngine(scenario, build_assembly(scenario))
    return ExplicitEngine(scenario, Assembly(grains, build_walls(scenario)))


def last_frame(engine: ExplicitEngine) -> Frame:
    """The frame at the end of all stages."""
    *_, frame = engine.frames()
    return frame


def settle(count: int, seed: int, changes: dict[str, Any] | None = None) -> Grains:
    """Grains at rest in a box 16 cm wide: fallen, with their contacts' overlaps, velocities set to zero."""
    grid = {"columns": 5, "spacing": "3 cm", "shift": "1 cm"}
    base = {"seed": seed, "grains.count": count, "container.width": "16 cm", "packing.grid": grid}
    scenario = soft({**base, "stage": [{"kind": "settle"}], **(changes or {})})
    grains = last_frame(engine_of(scenario)).grains
    still = np.zeros(count)
    return replace(grains, angle=still, vx=still.copy(), vy=still.copy(), spin=still.copy())


def box(changes: dict[str, Any] | None = None) -> Scenario:
    """The scenario in whose box `settle` leaves its grains, with one stage that runs for 0.3 s."""
    base = {
        "packing.grid": ABSENT, "packing.file": "none.csv", "grains.count": ABSENT, "grains.radius": ABSENT,
        "container.width": "16 cm", "stage": [{"kind": "run", "duration": "0.3 s"}],
    }  # fmt: skip
    return parse_scenario_without_file(text_of({**base, **(changes or {})}))


def parse_scenario_without_file(text: str) -> Scenario:
    """A scenario whose packing file is not there, since a test brings its own grains."""
    from dem_cli.scenario import loader

    original = loader._packing_file
    loader._packing_file = lambda *_: []  # type: ignore[assignment]
    try:
        return parse_scenario(text)
    finally:
        loader._packing_file = original


def loose_grains(count: int, seed: int, width: float, speed: float = 0.0) -> Grains:
    """Polydisperse grains of 4 to 8 mm on a grid of 2 cm over a width [m], with random velocities and spins up to `speed` [m/s]."""
    rng = np.random.default_rng(seed)
    columns = int(width / 0.02)
    row, column = np.divmod(np.arange(count), columns)
    x = 0.01 + 0.02 * column + rng.uniform(-1e-3, 1e-3, count)
    y = 0.01 + 0.02 * row + rng.uniform(-1e-3, 1e-3, count)
    grains = Grains.discs(x, y, rng.uniform(0.004, 0.008, count), 2480.0, 1.0)
    vx, vy = rng.uniform(-speed, speed, (2, count))
    return replace(grains, vx=vx, vy=vy, spin=rng.uniform(-speed, speed, count) / grains.radius)


def all_pairs(grains: Grains) -> dict[tuple[int, int], float]:
    """Overlap [m] of each pair of grains i < j that have not escaped and overlap, found by looking at every pair."""
    n = len(grains)
    dx, dy = grains.x[None, :] - grains.x[:, None], grains.y[None, :] - grains.y[:, None]
    overlap = grains.radius[None, :] + grains.radius[:, None] - np.hypot(dx, dy)
    here = ~grains.escaped
    touching = (overlap > 0.0) & here[:, None] & here[None, :] & (np.arange(n)[:, None] < np.arange(n)[None, :])
    return {(int(i), int(j)): float(overlap[i, j]) for i, j in np.argwhere(touching)}


def all_wall_contacts(grains: Grains, scenario: Scenario) -> dict[tuple[int, int], float]:
    """Overlap [m] of each grain with each wall, as (i, -1 - wall), from the distance to a segment."""
    walls = build_walls(scenario)
    found = {}
    for w in range(len(walls)):
        x0, y0 = float(walls.x0[w]), float(walls.y0[w])
        x1, y1 = (max(min(float(v), 1e3), -1e3) for v in (walls.x1[w], walls.y1[w]))
        for i in np.flatnonzero(~grains.escaped):
            along = ((grains.x[i] - x0) * (x1 - x0) + (grains.y[i] - y0) * (y1 - y0)) / (
                (x1 - x0) ** 2 + (y1 - y0) ** 2
            )
            along = min(max(float(along), 0.0), 1.0)
            distance = math.hypot(x0 + along * (x1 - x0) - grains.x[i], y0 + along * (y1 - y0) - grains.y[i])
            if distance < grains.radius[i]:
                found[(int(i), -1 - w)] = float(grains.radius[i] - distance)
    return found


def heavy(frames: Iterator[Frame]) -> Iterator[Frame]:
    """Those frames that come with contacts."""
    return (frame for frame in frames if frame.contacts is not None)


def resultants(frame: Frame, gravity: Floats) -> Floats:
    """Force on each grain, (n, 2) [N], as the sum of the frame's contact forces and weight."""
    contacts, grains = frame.contacts, frame.grains
    assert contacts is not None
    fx = contacts.normal * contacts.nx - contacts.shear * contacts.ny
    fy = contacts.normal * contacts.ny + contacts.shear * contacts.nx
    total = grains.mass[:, None] * gravity
    for axis, force in enumerate((fx, fy)):
        np.subtract.at(total[:, axis], contacts.i, force)
        of_grains = contacts.j >= 0
        np.add.at(total[:, axis], contacts.j[of_grains], force[of_grains])
    total[grains.escaped] = 0.0
    return total
