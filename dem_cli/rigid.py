"""What the impulse engine, its writer and its measures share: rigid bodies in three dimensions, their shapes, contacts and energy.

SI units, z up. Compression and a normal from body i to body j are positive; vectors are in the container's frame unless said
otherwise. An array called `x` has one row a body (or a contact).
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Literal

import numpy as np

from dem_cli.state import Bools, Floats, Ints

ShapeKind = Literal["spheres", "polyhedron", "cloud"]


@dataclass(frozen=True, eq=False)
class Shape:
    """The form of bodies of scale 1, in their own frame: origin at the centre of mass, axes along the principal axes of inertia.

    kind: what contacts are looked for with. "spheres": `centers` (s, 3), `radii` (s,) [m]. "polyhedron": the closed surface `vertices`
    (v, 3) [m], `triangles` (t, 3) (anticlockwise seen from outside), and `points` (p, 3) [m] with outward `normals` (p, 3) inside its
    faces, beside its corners. "cloud": particles of the surface at `points` with outward `normals`, `spacing` [m] apart; `trusted` (p,):
    whether a particle's normal is one, not so near edges and corners.
    vertices, triangles are there for all kinds, to draw them (of a cloud they may be empty). mass [kg], inertia (3,) [kg m^2]: principal
    moments, volume [m^3], reach [m]: radius of the smallest sphere about the centre of mass that holds the body.
    """

    name: str
    kind: ShapeKind
    vertices: Floats
    triangles: Ints
    centers: Floats
    radii: Floats
    points: Floats
    normals: Floats
    trusted: Bools
    spacing: float
    mass: float
    inertia: Floats
    volume: float
    reach: float


@dataclass(frozen=True)
class Bodies:
    """Rigid bodies in the order of their `id`, first axis (n,).

    id [-], group [-]: index of the scenario's [[grains]] table, shape [-]: index into `Scene.shapes`, scale [-]: factor of all its lengths,
    material [-]: index into `Scene.materials`; x (n, 3) [m]: centre of mass, v (n, 3) [m/s], q (n, 4): unit quaternion w, x, y, z that turns
    the shape's frame into the container's, w (n, 3) [rad/s]: angular velocity in the container's frame; mass [kg], inertia (n, 3) [kg m^2]:
    principal moments, escaped: True once a body has left the scene; it is kept, at rest, where it was.
    """

    id: Ints
    group: Ints
    shape: Ints
    scale: Floats
    material: Ints
    x: Floats
    q: Floats
    v: Floats
    w: Floats
    mass: Floats
    inertia: Floats
    escaped: Bools

    def __len__(self) -> int:
        return len(self.id)

    def take(self, index: Ints | Bools) -> Bodies:
        """The bodies at `index`, copied."""
        return replace(self, **{f.name: getattr(self, f.name)[index] for f in fields(self)})


@dataclass(frozen=True)
class Planes:
    """Floors, walls and slopes without end, first axis (w,).

    name, point (w, 3) [m] on it, unit normal (w, 3) to the side of the bodies, material [-]: index into `Scene.materials`, edge (w, 4, 3) [m]:
    corners of the piece that pictures show, anticlockwise seen from the bodies.
    """

    name: tuple[str, ...]
    point: Floats
    normal: Floats
    material: Ints
    edge: Floats

    def __len__(self) -> int:
        return len(self.name)


@dataclass(frozen=True)
class Terrain:
    """A fixed triangulated surface, open or closed: vertices (v, 3) [m], triangles (t, 3), anticlockwise seen from the side of the bodies;
    material [-]: index into `Scene.materials`."""

    name: str
    vertices: Floats
    triangles: Ints
    material: int


@dataclass(frozen=True)
class Scene:
    """Bodies at the start, and what does not move.

    groups: names of the kinds of bodies, in the order of `Bodies.group`. materials: names; restitution, friction (m, m) [-]: of each pair,
    symmetric. terrain: None where there is none; contacts call it wall number len(planes). low, high (3,) [m]: corners of the box outside which
    a body counts as escaped, infinite where there is no end. warnings: what assembling had to tell.
    """

    groups: tuple[str, ...]
    shapes: tuple[Shape, ...]
    bodies: Bodies
    planes: Planes
    terrain: Terrain | None
    materials: tuple[str, ...]
    restitution: Floats
    friction: Floats
    low: Floats
    high: Floats
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class BodyContacts:
    """Contacts of one step, shape (c,) each, sorted by (i, j); two bodies may touch at several points.

    i [-]: index of a body. j [-]: index of the other, or -1 - w for plane w, or -1 - len(planes) for the terrain. normal (c, 3) [-]: unit, from
    i to j; point (c, 3) [m]: common contact point; gap [m]: < 0 is penetration; impulse (c, 3) [N s]: of i on j in this step, all phases;
    sliding: friction limit reached. impulse . normal >= 0.
    """

    i: Ints
    j: Ints
    normal: Floats
    point: Floats
    gap: Floats
    impulse: Floats
    sliding: Bools

    def __len__(self) -> int:
        return len(self.i)


def touching_pairs(contacts: BodyContacts) -> Ints:
    """Distinct pairs (i, j) of the contacts, shape (p, 2); j < 0 is a plane or the terrain."""
    return np.unique(np.stack([contacts.i, contacts.j], axis=1), axis=0)


def coordination(contacts: BodyContacts, n: int) -> Ints:
    """Bodies, planes and terrain that each of n bodies touches, shape (n,)."""
    pairs = touching_pairs(contacts)
    others = pairs[pairs[:, 1] >= 0, 1]
    return np.bincount(pairs[:, 0], minlength=n) + np.bincount(others, minlength=n)


@dataclass(frozen=True)
class ImpulseEnergy:
    """Ledger of energy in joules, all counted from the start of the run.

    Stored now: kinetic (of centres of mass), rotational, potential (of gravity, zero at the origin). Lost so far: restitution (work of the
    normal impulses), friction (of the tangential ones), escaped (carried off by bodies that left). projection: gained (+) or lost (-)
    where penetrating bodies are moved apart. work: done on the bodies by the shaking.
    """

    kinetic: float = 0.0
    rotational: float = 0.0
    potential: float = 0.0
    restitution: float = 0.0
    friction: float = 0.0
    escaped: float = 0.0
    projection: float = 0.0
    work: float = 0.0

    @property
    def stored(self) -> float:
        return self.kinetic + self.rotational + self.potential

    @property
    def lost(self) -> float:
        return self.restitution + self.friction + self.escaped


@dataclass(frozen=True)
class Solving:
    """What the solvers did since the row of the series before, and caps since the start.

    steps [-]; impacts: steps x islands that had an impact to solve; impact_iterations, load_sweeps: mean of a step (sum over islands);
    most: largest of one solve; capped: solves that hit a cap of iterations, since the start of the run; residual [m/s]: largest that a solve
    ended with; islands, largest_island [-]: groups of bodies that touch, and contacts of the largest, in the last step.
    """

    steps: int = 0
    impacts: int = 0
    impact_iterations: float = 0.0
    load_sweeps: float = 0.0
    most: int = 0
    capped: int = 0
    residual: float = 0.0
    islands: int = 0
    largest_island: int = 0


@dataclass(frozen=True)
class BodyFrame:
    """The state at one instant of an impulse run, made by the engine and read by measures and writers.

    step [-], time [s], dt [s], stage (0-based). ground (3, 3): displacement [m], velocity [m/s] and acceleration [m/s^2] of the container,
    x, y, z each; bodies are in the container's frame. contacts: of the last step, whose middle is half a step before the positions; None in a
    frame that is due for tracks only. residual [J]: what the ledger cannot account for (rotation of bodies in free flight); energy_in [J]:
    what was put in so far (kinetic energy at the start, potential energy set free, positive work). due, stage_start, stage_end, stop_reason,
    warnings as in `state.Frame`.
    """

    step: int
    time: float
    dt: float
    stage: int
    bodies: Bodies
    ground: Floats
    energy: ImpulseEnergy
    residual: float
    energy_in: float
    solving: Solving
    due: frozenset[str]
    contacts: BodyContacts | None = None
    stage_start: bool = False
    stage_end: bool = False
    stop_reason: str = ""
    warnings: tuple[str, ...] = field(default=())


def rotation(q: Floats) -> Floats:
    """Matrices (n, 3, 3) of unit quaternions (n, 4): w, x, y, z."""
    w, x, y, z = np.asarray(q, dtype=float).reshape(-1, 4).T
    return np.stack(
        [
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
        ],
        axis=1,
    ).reshape(-1, 3, 3)  # fmt: skip
