"""How far bodies ran: horizontally from where they started, how deep they fell, and under which angle of reach."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dem_cli.results import BodyResults
from dem_cli.state import Bools, Floats

SHARES = (0.0, 10.0, 50.0, 90.0, 100.0)  # percent


@dataclass(frozen=True)
class Runout:
    """Of each body (n,) from the first frame to the last: horizontal distance [m], drop [m] of its centre of mass, and the angle of reach
    [rad], that of the straight line from start to end below the horizontal (NaN without a distance). heading [rad]: in plan, from +x towards +y.

    escaped: those that left the scene, at the place where they did. at_rest: slower than 1 mm/s. time [s]: of the last frame.
    """

    distance: Floats
    drop: Floats
    angle: Floats
    heading: Floats
    escaped: Bools
    at_rest: Bools
    time: float

    def quantiles(self, values: Floats) -> list[float]:
        """At SHARES percent of the bodies, values (n,) that are not defined left out."""
        known = values[np.isfinite(values)]
        return np.percentile(known, SHARES).tolist() if len(known) else [math.nan] * len(SHARES)


def has_runout(results: BodyResults) -> bool:
    """Whether bodies go downhill: there is a terrain, or a plane between level and upright."""
    normal = results.planes.normal
    tilted = (normal[:, 2] > 1e-6) & (normal[:, 2] < 1.0 - 1e-6)
    return results.n_frames > 1 and (results.terrain is not None or bool(tilted.any()))


def runout(results: BodyResults) -> Runout:
    """Between the first frame and the last."""
    first, last = results.frame(0), results.frame(-1)
    way = last.bodies.x - first.bodies.x
    distance, drop = np.hypot(way[:, 0], way[:, 1]), -way[:, 2]
    return Runout(
        distance=distance,
        drop=drop,
        angle=np.where(distance > 1e-9, np.arctan2(drop, distance), math.nan),
        heading=np.arctan2(way[:, 1], way[:, 0]),
        escaped=last.bodies.escaped,
        at_rest=np.linalg.norm(last.bodies.v, axis=1) < 1e-3,
        time=last.time,
    )
