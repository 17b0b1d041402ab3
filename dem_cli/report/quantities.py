"""What grains can be coloured by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dem_cli.report import bodies
from dem_cli.report.moments import AnyFrame
from dem_cli.results import StoredIncrement
from dem_cli.state import Floats

Values = Callable[[AnyFrame, AnyFrame], Floats]


@dataclass(frozen=True)
class Quantity:
    """A quantity of grains: label, SI unit, values(frame, frame at the start of its stage) -> (n,), one an element.

    kind: "range" from smallest to largest, "from-zero", "signed" (symmetric about zero), "count" (whole numbers), "cyclic" (angles of
    axes) or "label" (numbers that only tell grains apart). since: counts from the start of the stage.
    """

    label: str
    unit: str
    kind: str
    values: Values
    since: bool = False


def _stress(frame: AnyFrame) -> Floats:
    """Of each element, (n, 4): xx, xy, yx, yy."""
    return frame.grain_stress if isinstance(frame, StoredIncrement) else frame.stress


def _shear_stress(frame: AnyFrame, _: AnyFrame) -> Floats:
    xx, xy, yx, yy = _stress(frame).T
    return np.asarray(np.hypot(0.5 * (xx - yy), 0.5 * (xy + yx)))


def _moved(axis: str) -> Values:
    """Displacement of the grain's centre of mass since the stage began."""
    return lambda f, s: bodies.of_bodies(f.grains, getattr(f.grains, axis) - getattr(s.grains, axis))


def _speed(f: AnyFrame, _: AnyFrame) -> Floats:
    g = f.grains
    return np.asarray(np.hypot(bodies.of_bodies(g, g.vx), bodies.of_bodies(g, g.vy)))


MOVED_X, MOVED_Y = _moved("x"), _moved("y")
QUANTITIES: dict[str, Quantity] = {
    "radius": Quantity("radius", "m", "range", lambda f, _: f.grains.radius),
    "id": Quantity("number of the element", "1", "range", lambda f, _: f.grains.id.astype(float)),
    "body": Quantity("grain", "1", "label", lambda f, _: f.grains.body.astype(float)),
    "aspect": Quantity("aspect ratio", "1", "range", lambda f, _: bodies.axes(f.grains)[0]),
    "orientation": Quantity("long axis, anticlockwise from +x", "rad", "cyclic", lambda f, _: bodies.axes(f.grains)[1]),
    "speed": Quantity("speed", "m/s", "from-zero", _speed),
    "spin": Quantity("angular velocity, anticlockwise", "rad/s", "signed", lambda f, _: f.grains.spin),
    "displacement": Quantity(
        "displacement", "m", "from-zero", lambda f, s: np.hypot(MOVED_X(f, s), MOVED_Y(f, s)), True
    ),
    "displacement_x": Quantity("displacement in x", "m", "signed", MOVED_X, True),
    "displacement_y": Quantity("displacement in y", "m", "signed", MOVED_Y, True),
    "rotation": Quantity(
        "rotation, anticlockwise", "rad", "signed", lambda f, s: f.grains.angle - s.grains.angle, True
    ),
    "coordination": Quantity("contacts of the grain", "1", "count", lambda f, _: f.coordination.astype(float)),
    "pressure": Quantity(
        "mean stress in the grain", "Pa", "from-zero", lambda f, _: 0.5 * (_stress(f)[:, 0] + _stress(f)[:, 3])
    ),
    "shear_stress": Quantity("largest shear stress in the grain", "Pa", "from-zero", _shear_stress),
    "stress_xx": Quantity("stress xx in the grain", "Pa", "from-zero", lambda f, _: _stress(f)[:, 0]),
    "stress_yy": Quantity("stress yy in the grain", "Pa", "from-zero", lambda f, _: _stress(f)[:, 3]),
    "stress_xy": Quantity(
        "stress xy in the grain", "Pa", "signed", lambda f, _: 0.5 * (_stress(f)[:, 1] + _stress(f)[:, 2])
    ),
}
NOT_QUASI_STATIC = ("speed", "spin")  # what a test without time has not
