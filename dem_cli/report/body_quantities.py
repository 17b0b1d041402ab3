"""What bodies in 3D can be coloured by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dem_cli.results import StoredBodyFrame
from dem_cli.rigid import rotation
from dem_cli.state import Floats


@dataclass(frozen=True)
class BodyQuantity:
    """A quantity of bodies: label, SI unit, kind of colours as `quantities.Quantity`, values(frame, frame at the start of its stage) -> (n,)."""

    label: str
    unit: str
    kind: str
    values: Callable[[StoredBodyFrame, StoredBodyFrame], Floats]
    since: bool = False


def _length(vectors: Floats) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=1))


def kinetic_energy(frame: StoredBodyFrame) -> Floats:
    """Of each body, rotation included [J], shape (n,)."""
    b = frame.bodies
    own = np.einsum("nba,nb->na", rotation(b.q), b.w)
    return np.asarray(0.5 * b.mass * (b.v**2).sum(axis=1) + 0.5 * (b.inertia * own**2).sum(axis=1))


def turn(q: Floats, start: Floats) -> Floats:
    """Angle [rad, 0 to pi] between orientations (n, 4) and (n, 4) or (4,)."""
    return np.asarray(2.0 * np.arccos(np.clip(np.abs((q * start).sum(axis=-1)), 0.0, 1.0)))


BODY_QUANTITIES: dict[str, BodyQuantity] = {
    "kind": BodyQuantity("kind", "1", "label", lambda f, _: f.bodies.group.astype(float)),
    "id": BodyQuantity("number of the body", "1", "label", lambda f, _: f.bodies.id.astype(float)),
    "speed": BodyQuantity("speed", "m/s", "from-zero", lambda f, _: _length(f.bodies.v)),
    "spin": BodyQuantity("angular speed", "rad/s", "from-zero", lambda f, _: _length(f.bodies.w)),
    "kinetic": BodyQuantity("kinetic energy of the body", "J", "from-zero", lambda f, _: kinetic_energy(f)),
    "displacement": BodyQuantity(
        "displacement", "m", "from-zero", lambda f, s: _length(f.bodies.x - s.bodies.x), since=True
    ),
    "rotation": BodyQuantity("turned by", "rad", "from-zero", lambda f, s: turn(f.bodies.q, s.bodies.q), since=True),
    "height": BodyQuantity("z of the centre of mass", "m", "range", lambda f, _: f.bodies.x[:, 2]),
    "mass": BodyQuantity("mass", "kg", "range", lambda f, _: f.bodies.mass),
    "coordination": BodyQuantity(
        "bodies, planes and terrain touched", "1", "count", lambda f, _: f.coordination.astype(float)
    ),
}
