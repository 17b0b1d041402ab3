"""What all engines, writers and measures share: arrays of grains, contacts and walls, and the ledger of energy.

SI units throughout. Compression, anticlockwise rotation and a normal from body i to body j are positive
(physics.md 0). An array called `x` has one entry a grain (or a contact) unless its meaning says otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Grains:
    """Grains in the order of their `id`, shape (n,) each.

    id [-], x y [m], angle [rad], vx vy [m/s], spin [rad/s], radius [m], mass [kg], inertia [kg m^2] (2D: of the
    cylinder of the scenario's depth), escaped (True once a grain has left the container; it is kept, at rest).
    """

    id: Ints
    x: Floats
    y: Floats
    angle: Floats
    vx: Floats
    vy: Floats
    spin: Floats
    radius: Floats
    mass: Floats
    inertia: Floats
    escaped: Bools

    def __len__(self) -> int:
        return len(self.id)

    @classmethod
    def discs(cls, x: Floats, y: Floats, radius: Floats, density: float, depth: float) -> Grains:
        """Discs at rest: mass rho pi r^2 L, inertia m r^2 / 2 (physics.md 0)."""
        n = len(x)
        mass = density * np.pi * radius**2 * depth
        zero = np.zeros(n)
        return cls(
            id=np.arange(n, dtype=np.int64),
            x=np.array(x, dtype=float),
            y=np.array(y, dtype=float),
            angle=zero.copy(),
            vx=zero.copy(),
            vy=zero.copy(),
            spin=zero.copy(),
            radius=np.array(radius, dtype=float),
            mass=mass,
            inertia=0.5 * mass * radius**2,
            escaped=np.zeros(n, dtype=bool),
        )

    def take(self, index: Ints | Bools) -> Grains:
        """The grains at `index`, copied."""
        return replace(self, **{f.name: getattr(self, f.name)[index] for f in fields(self)})


@dataclass(frozen=True)
class Walls:
    """Flat walls as line segments, shape (w,) each: from (x0, y0) to (x1, y1) [m], friction [-], a name each."""

    name: tuple[str, ...]
    x0: Floats
    y0: Floats
    x1: Floats
    y1: Floats
    friction: Floats

    def __len__(self) -> int:
        return len(self.name)


@dataclass(frozen=True)
class Contacts:
    """Contacts that touch (overlap > 0), shape (c,) each, sorted by (i, j).

    i [-]: index of a grain. j [-]: index of the other grain, or -1 - w for wall w. nx ny [-]: unit normal from i to j.
    px py [m]: contact point. overlap [m]. normal [N]: compression > 0. shear [N]: force on j along t = (-ny, nx).
    stretch [m]: elastic tangential stretch, whose spring gives shear = -ks * stretch. sliding: friction limit reached.
    The force of i on j is normal*n + shear*t.
    """

    i: Ints
    j: Ints
    nx: Floats
    ny: Floats
    px: Floats
    py: Floats
    overlap: Floats
    normal: Floats
    shear: Floats
    stretch: Floats
    sliding: Bools

    def __len__(self) -> int:
        return len(self.i)


@dataclass(frozen=True)
class Energy:
    """Ledger of energy in joules, all counted from the start of the run.

    Stored now: kinetic, potential (of gravity, zero at y = 0), elastic_normal, elastic_tangential.
    Lost so far, each >= 0: friction, dashpot_normal, dashpot_tangential, damping (extra damping while settling),
    escaped (carried off by grains that left). `time_step`: gained (+) or lost (-) since a contact opens and closes within a
    step, known exactly from the overlaps on both sides. `work`: done on the grains by the shaking.
    """

    kinetic: float = 0.0
    potential: float = 0.0
    elastic_normal: float = 0.0
    elastic_tangential: float = 0.0
    friction: float = 0.0
    dashpot_normal: float = 0.0
    dashpot_tangential: float = 0.0
    damping: float = 0.0
    escaped: float = 0.0
    time_step: float = 0.0
    work: float = 0.0

    @property
    def stored(self) -> float:
        return self.kinetic + self.potential + self.elastic_normal + self.elastic_tangential

    @property
    def lost(self) -> float:
        return self.friction + self.dashpot_normal + self.dashpot_tangential + self.damping + self.escaped


@dataclass(frozen=True)
class Frame:
    """The state at one instant of a run, made by an engine and read by measures and writers.

    step [-], time [s], dt [s] (step in use), stage (0-based). ground: displacement (x, y) [m], velocity [m/s] and acceleration
    [m/s^2] of the container, shape (3, 2); the grains' own coordinates are those of the container.
    contacts and forces (shape (n, 2), resultant of contacts and gravity on each grain [N]) belong to the same instant
    as the positions; both are None in a frame that is due for tracks only.
    residual [J]: what the ledger cannot account for; energy_in [J]: what was put in so far (potential energy set free and
    positive work), the scale that the residual is judged by.
    due: which outputs this frame is for, a subset of {"series", "frames", "tracks"}; stage_start and stage_end mark the frames
    at which a stage begins or ends.
    """

    step: int
    time: float
    dt: float
    stage: int
    grains: Grains
    ground: Floats
    energy: Energy
    residual: float
    energy_in: float
    due: frozenset[str]
    contacts: Contacts | None = None
    forces: Floats | None = None
    unbalanced: float = float("nan")
    stage_start: bool = False
    stage_end: bool = False
    stop_reason: str = ""
    warnings: tuple[str, ...] = field(default=())
