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
    """Elements (discs and ellipses) that grains are made of, in the order of their `id`, shape (n,) each.

    A grain is one element, or several that are bonded or rigid together: `body` is the number of the grain that an element belongs
    to; it counts from 0 and never falls from one element to the next. An element moves as the disc or ellipse that it is, so
    momentum, energy and centre of mass of a grain are sums over its elements, whatever holds them together: those of
    a rigid clump carry masses and inertias that add up to the clump's own.

    id [-], x y [m], angle [rad] of the semi-axis a, anticlockwise from +x, vx vy [m/s], spin [rad/s], radius [m] of the disc of equal area
    sqrt(a b), mass [kg], inertia [kg m^2] (2D: of the cylinder of the scenario's depth), escaped (True once a grain has left the container;
    it is kept, at rest), a b [m]: semi-axes, a >= b, equal for discs, body [-].
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
    a: Floats
    b: Floats
    body: Ints

    def __len__(self) -> int:
        return len(self.id)

    @classmethod
    def discs(cls, x: Floats, y: Floats, radius: Floats, density: float, depth: float) -> Grains:
        """Discs at rest, each a grain: mass rho pi r^2 L, inertia m r^2 / 2 (physics.md 0)."""
        return cls.ellipses(x, y, radius, radius, np.zeros(len(x)), density, depth)

    @classmethod
    def ellipses(
        cls, x: Floats, y: Floats, a: Floats, b: Floats, angle: Floats, density: float, depth: float
    ) -> Grains:
        """Ellipses at rest, each a grain: mass rho pi a b L, inertia m (a^2 + b^2) / 4 (thesis (4.54))."""
        n = len(x)
        a, b = np.array(a, dtype=float), np.array(b, dtype=float)
        mass = density * np.pi * a * b * depth
        return cls(
            id=np.arange(n, dtype=np.int64),
            x=np.array(x, dtype=float),
            y=np.array(y, dtype=float),
            angle=np.array(angle, dtype=float),
            vx=np.zeros(n),
            vy=np.zeros(n),
            spin=np.zeros(n),
            radius=np.where(a == b, a, np.sqrt(a * b)),
            mass=mass,
            inertia=0.25 * mass * (a**2 + b**2),
            escaped=np.zeros(n, dtype=bool),
            a=a,
            b=b,
            body=np.arange(n, dtype=np.int64),
        )

    @property
    def grain_count(self) -> int:
        """Number of grains, each of one or more elements."""
        return int(self.body[-1]) + 1 if len(self) else 0

    def take(self, index: Ints | Bools) -> Grains:
        """The elements at `index`, copied; grains are numbered anew, neighbours of one body stay one."""
        taken = replace(self, **{f.name: getattr(self, f.name)[index] for f in fields(self)})
        return replace(taken, body=np.cumsum(np.diff(taken.body, prepend=taken.body[:1]) != 0))


@dataclass(frozen=True)
class Bonds:
    """Dashpots that hold elements of a grain together (thesis ch. 5; physics.md 1.4), shape (b,) each.

    i j [-]: indices of the elements, i < j of the same grain; normal and tangential viscosity Cn, Cs [N s/m], rolling [N m s]:
    viscosity against turning of one element against the other, 0 where they may roll on each other.
    """

    i: Ints
    j: Ints
    normal: Floats
    tangential: Floats
    rolling: Floats

    def __len__(self) -> int:
        return len(self.i)

    @classmethod
    def none(cls) -> Bonds:
        """No bond."""
        empty, numbers = np.empty(0, dtype=np.int64), np.empty(0)
        return cls(empty, empty, numbers, numbers, numbers)


@dataclass(frozen=True)
class BondStrain:
    """What the bonds have given since the start of the run, shape (b,) each, as in `Bonds`.

    gap [m]: centres further apart (+) or closer (-); slip [m]: sliding at the common point; roll [rad]: turn of j against i.
    """

    gap: Floats
    slip: Floats
    roll: Floats


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

    @property
    def box(self) -> tuple[float, float, float, float]:
        """x of the wall left, y of bottom, x of right, y of top [m]; infinite, outwards, where there is no wall of that name."""
        x, y = (dict(zip(self.name, ends.tolist(), strict=True)) for ends in (self.x0, self.y0))
        far = float("inf")
        return x.get("left", -far), y.get("bottom", -far), x.get("right", far), y.get("top", far)


@dataclass(frozen=True)
class Contacts:
    """Contacts that touch (overlap > 0), shape (c,) each, sorted by (i, j); elements of one grain make none with each other.

    i [-]: index of an element. j [-]: index of the other element, or -1 - w for wall w. nx ny [-]: unit normal from i to j.
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
    Lost so far, each >= 0: friction, dashpot_normal, dashpot_tangential, bonds, damping (extra damping while settling),
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
    bonds: float = 0.0
    damping: float = 0.0
    escaped: float = 0.0
    time_step: float = 0.0
    work: float = 0.0

    @property
    def stored(self) -> float:
        return self.kinetic + self.potential + self.elastic_normal + self.elastic_tangential

    @property
    def lost(self) -> float:
        return self.friction + self.dashpot_normal + self.dashpot_tangential + self.bonds + self.damping + self.escaped


@dataclass(frozen=True)
class Frame:
    """The state at one instant of a run, made by an engine and read by measures and writers.

    step [-], time [s], dt [s] (step in use), stage (0-based). ground: displacement (x, y) [m], velocity [m/s] and acceleration
    [m/s^2] of the container, shape (3, 2); the grains' own coordinates are those of the container.
    contacts and forces (shape (n, 2), resultant of contacts and gravity on each element [N]) belong to the same instant
    as the positions; both are None in a frame that is due for tracks only. bonds: None where there is no bond, or for tracks only.
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
    bonds: BondStrain | None = None
    unbalanced: float = float("nan")
    stage_start: bool = False
    stage_end: bool = False
    stop_reason: str = ""
    warnings: tuple[str, ...] = field(default=())


@dataclass(frozen=True)
class Slips:
    """Contacts that dissipated energy in one increment of a quasi-static test, shape (s,) each.

    i, j as in `Contacts`; they may have opened since. energy [J]: lost to friction in this increment.
    """

    i: Ints
    j: Ints
    energy: Floats

    def __len__(self) -> int:
        return len(self.i)


@dataclass(frozen=True)
class QuasiStaticEnergy:
    """Ledger of a quasi-static test in joules, all counted from the start of the run.

    work: done by the boundary (walls, chains, membrane pressure) on the grains, compression > 0; body_work: by gravity.
    Stored now: elastic_normal, elastic_tangential, elastic_membrane. friction: dissipated by sliding, >= 0.
    released: energy that collapses have set free, which a quasi-static method has no inertia to hold.
    Balance: work + body_work = change of what is stored + friction + released + residual.
    """

    work: float = 0.0
    body_work: float = 0.0
    elastic_normal: float = 0.0
    elastic_tangential: float = 0.0
    elastic_membrane: float = 0.0
    friction: float = 0.0
    released: float = 0.0
    residual: float = 0.0

    @property
    def stored(self) -> float:
        return self.elastic_normal + self.elastic_tangential + self.elastic_membrane


@dataclass(frozen=True)
class Increment:
    """The sample in equilibrium after one increment of a quasi-static test, made by an engine and read by measures and writers.

    number: increments done since the start of the run, 0 the start; stage (0-based); in_stage: increments done in the stage.
    grains: the last `boundary` of its elements are chains of boundary grains; they belong to no measure of the grains.
    walls: where they are now. width, height [m]: mean inner size; area [m^2]: of the sample, inside walls or chains.
    stress (2,) [Pa]: on the boundaries across x and y, compression > 0, the effective one where pores are closed; strain (2,): of width and
    height against their size at the start of the shearing, compression > 0; pore_pressure [Pa], NaN where pores are drained.
    slips: what slid in this increment. balance [N]: largest fixing force that is left (Kishino (14)); iterations, sub_steps: of this increment;
    rung: highest step of the ladder of fallbacks that was needed, 0 for none; event: the increment passed through a collapse.
    axial: 1 where the prescribed compression is along y, 0 along x. unbalanced [-]: mean resultant force on a grain over mean contact force.
    """

    number: int
    stage: int
    in_stage: int
    grains: Grains
    walls: Walls
    contacts: Contacts
    slips: Slips
    width: float
    height: float
    area: float
    stress: Floats
    strain: Floats
    energy: QuasiStaticEnergy
    boundary: int = 0
    pore_pressure: float = float("nan")
    axial: int = 1
    balance: float = 0.0
    unbalanced: float = 0.0
    iterations: int = 0
    sub_steps: int = 0
    rung: int = 0
    event: bool = False
    due: frozenset[str] = frozenset()
    stage_start: bool = False
    stage_end: bool = False
    stop_reason: str = ""
    warnings: tuple[str, ...] = field(default=())
