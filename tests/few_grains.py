"""A few grains between chosen walls, moved by the engine's own step: what many tests start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import tomli_w

from dem_cli.assembly import Assembly
from dem_cli.engines.explicit.lists import FINE
from dem_cli.engines.explicit.state import ExplicitState
from dem_cli.engines.motion import Ground, Still
from dem_cli.scenario import Scenario, parse_scenario
from dem_cli.state import Bonds, Floats, Frame, Grains, Walls

KN, KS = 1.0e6, 0.5e6  # N/m
RADIUS, DENSITY = 0.01, 2500.0  # m, kg/m^3
MASS = DENSITY * np.pi * RADIUS**2  # kg, at a depth of 1 m
G = 9.80665
DUE = frozenset({"series"})


def scenario(changes: dict[str, Any] | None = None) -> Scenario:
    """A scenario without gravity, damping and friction, with keys set ("contact.friction")."""
    data: dict[str, Any] = {
        "grains": {"density": f"{DENSITY!r} kg/m^3", "radius": "1 cm", "count": 1},
        "material": {"normal_stiffness": f"{KN!r} N/m", "tangential_stiffness": f"{KS!r} N/m"},
        "contact": {"friction": 0.0, "damping_ratio": 0.0},
        "container": {"width": "1000 km", "gravity": "0 m/s^2"},
        "packing": {"method": "falling", "grid": {"columns": 1, "spacing": "3 cm"}},
        "integration": {"max_overlap": 1.0},
        "stage": [{"kind": "run", "duration": "1 s"}],
    }
    for path, value in (changes or {}).items():
        *parents, last = path.split(".")
        table = data
        for parent in parents:
            table = table[parent]
        table[last] = value
    if "restitution" in data["contact"]:
        del data["contact"]["damping_ratio"]
    return parse_scenario(tomli_w.dumps(data))


def floor(friction: float = 0.0, angle: float = 0.0, length: float = 20.0) -> Walls:
    """A floor through the origin, turned by `angle` [rad]."""
    x, y = 0.5 * length * np.cos(angle), 0.5 * length * np.sin(angle)
    return segments([(-x, -y, x, y)], friction)


def segments(ends: Sequence[tuple[float, float, float, float]], friction: float = 0.0) -> Walls:
    """Walls from (x0, y0) to (x1, y1) [m]."""
    x0, y0, x1, y1 = np.array(ends, dtype=float).reshape(-1, 4).T
    return Walls(tuple(f"wall {k}" for k in range(len(x0))), x0, y0, x1, y1, np.full(len(x0), friction))


@dataclass
class Bench:
    """A state and what pushes it."""

    state: ExplicitState
    gravity: Floats
    ground: Ground

    def frame(self) -> Frame:
        """The present instant."""
        return self.state.frame(self.gravity, self.ground.motion(self.state.time), DUE, 0, heavy=True)

    def steps(self, steps: int, dt: float | None = None, damping: tuple[float, float] = (0.0, 0.0)) -> int:
        """Advance by `steps` of `dt` [s] (default: as before); the status of the run."""
        dt = dt or self.state.dt
        driving = -self.ground.acceleration(self.state.time + dt * np.arange(steps + 1))
        status, _, _ = self.state.advance(
            dt, self.gravity + driving, driving if self.ground.moves else np.zeros((0, 2)), damping
        )
        return status


def few_grains(
    x: Sequence[float] | Floats,
    y: Sequence[float] | Floats,
    *,
    dt: float,
    radius: float | Sequence[float] = RADIUS,
    vx: float | Sequence[float] | Floats = 0.0,
    vy: float | Sequence[float] | Floats = 0.0,
    spin: float | Sequence[float] | Floats = 0.0,
    walls: Walls | None = None,
    gravity: Sequence[float] = (0.0, 0.0),
    ground: Ground | None = None,
    box: tuple[float, float, float] = (-1e6, 1e6, -1e6),
    **changes: Any,
) -> Bench:
    """Discs with these positions, velocities and spins (SI), and their first forces.

    gravity: (x, y) [m/s^2]; box: left, right, bottom beyond which grains have escaped [m]; changes: keys of the scenario with _ for
    the dot behind the table (contact_friction=0.3).
    """
    n = len(x)
    grains = Grains.discs(np.array(x), np.array(y), np.broadcast_to(radius, n).astype(float), DENSITY, 1.0)
    for name, value in (("vx", vx), ("vy", vy), ("spin", spin)):
        getattr(grains, name)[:] = value
    return bench_of(grains, dt=dt, walls=walls, gravity=gravity, ground=ground, box=box, **changes)


def bench_of(
    grains: Grains,
    *,
    dt: float,
    walls: Walls | None = None,
    bonds: Bonds | None = None,
    rigid: bool = False,
    gravity: Sequence[float] = (0.0, 0.0),
    ground: Ground | None = None,
    box: tuple[float, float, float] = (-1e6, 1e6, -1e6),
    **changes: Any,
) -> Bench:
    """Any grains, see `few_grains`; rigid: those of several elements are clumps."""
    model = scenario({key.replace("_", ".", 1): value for key, value in changes.items()})
    walls = segments([]) if walls is None else walls
    assembly = Assembly(grains, walls, Bonds.none() if bonds is None else bonds, rigid)
    state = ExplicitState.start_of(model, assembly, dt)
    state.box = state.box._replace(left=box[0], right=box[1], bottom=box[2])
    state.first_forces()
    return Bench(state, np.array(gravity, dtype=float), Still() if ground is None else ground)


def run_for(bench: Bench, duration: float, *, every: int = 1, damping: tuple[float, float] = (0.0, 0.0)) -> list[Frame]:
    """Frames of the start and of each `every` steps of the bench's own time step until `duration` [s] is over."""
    out = [bench.frame()]
    for _ in range(round(duration / bench.state.dt / every)):
        assert bench.steps(every, damping=damping) == FINE
        out.append(bench.frame())
    return out


def series(frames: list[Frame], name: str, grain: int = 0) -> Floats:
    """One quantity of a grain in all frames."""
    return np.array([getattr(frame.grains, name)[grain] for frame in frames])


def times(frames: list[Frame]) -> Floats:
    """Times of the frames [s]."""
    return np.array([frame.time for frame in frames])
