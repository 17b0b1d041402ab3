"""Ways of single bodies over time, from their tracks where they are followed, else from the frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dem_cli.analysis.placed import by_shape, outline, placed
from dem_cli.results import BodyResults
from dem_cli.rigid import Bodies, Shape
from dem_cli.state import Floats


@dataclass(frozen=True)
class History:
    """One body over time (t,) [s]: x (t, 3) [m], v (t, 3) [m/s], w (t, 3) [rad/s]."""

    time: Floats
    x: Floats
    v: Floats
    w: Floats


def histories(results: BodyResults, bodies: list[int]) -> dict[int, History]:
    """Number of a body -> its history, for those of `bodies` that have one of at least two instants."""
    found: dict[int, History] = {}
    tracks = results.tracks
    if tracks is not None and len(tracks.time) > 1:
        columns = {int(number): k for k, number in enumerate(tracks.ids)}
        for number in bodies:
            if number in columns:
                parts = [
                    np.stack([tracks.arrays[f"{part}{axis}"][:, columns[number]] for axis in "xyz"], axis=1)
                    for part in ("", "v", "w")
                ]
                found[number] = _of_distinct_times(np.asarray(tracks.time), *parts)
    missing = [number for number in bodies if number not in found]
    if missing and results.n_frames > 1:
        states = [results.frame(k).bodies for k in range(results.n_frames)]
        for number in missing:
            parts = [np.array([getattr(state, name)[number] for state in states]) for name in ("x", "v", "w")]
            found[number] = _of_distinct_times(results.frame_times, *parts)
    return {number: found[number] for number in bodies if number in found}


def _of_distinct_times(time: Floats, *parts: Floats) -> History:
    """The end of one stage and the start of the next may be two rows of the same time."""
    time, row = np.unique(time, return_index=True)
    return History(time, *(part[row] for part in parts))


def depth_along(bodies: Bodies, shapes: tuple[Shape, ...], direction: Floats) -> Floats:
    """How far each body reaches from its centre of mass against the unit vector `direction`, shape (n,) [m]."""
    reach = np.zeros(len(bodies))
    for k, some in by_shape(bodies, np.ones(len(bodies), dtype=bool)):
        shape = shapes[k]
        if shape.kind == "spheres":
            across = (placed(bodies, some, shape.centers) - bodies.x[some, None]) @ direction
            reach[some] = (bodies.scale[some, None] * shape.radii - across).max(axis=1)
        elif len(outline(shape)):
            reach[some] = -((placed(bodies, some, outline(shape)) - bodies.x[some, None]) @ direction).min(axis=1)
    return reach
