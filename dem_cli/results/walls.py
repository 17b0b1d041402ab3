"""Walls in a result file: /walls, and their ends as they are drawn with a frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from dem_cli.results.tables import TEXT, describe
from dem_cli.state import Floats, Grains, Walls

ENDS = ("x0", "y0", "x1", "y1")


def create_walls(file: Any, walls: Walls) -> None:
    """/walls over `name`, unless they are there: where they are at the start of the run, and their friction."""
    if "walls" in file:
        return
    group = file.create_group("walls")
    name = group.create_dataset("name", data=list(walls.name), dtype=TEXT, shape=(len(walls),))
    name.make_scale("name")
    for key in (*ENDS, "friction"):
        dataset = group.create_dataset(key, data=np.asarray(getattr(walls, key), dtype=np.float64))
        describe(dataset, "1" if key == "friction" else "m", "friction" if key == "friction" else "end of the wall")
        dataset.dims[0].attach_scale(name)


def read_walls(file: Any) -> Walls:
    group = file["walls"]
    columns = {name: np.asarray(group[name][:]) for name in (*ENDS, "friction")}
    return Walls(name=tuple(group["name"].asstr()[:]), **columns)


def drawn_walls(walls: Walls, grains: Grains) -> Floats:
    """Ends of the walls as they are drawn, shape (2 w, 2) [m]: walls without end are cut where the first grains end."""
    x, y = np.stack([walls.x0, walls.x1], axis=1).ravel(), np.stack([walls.y0, walls.y1], axis=1).ravel()
    ends = np.stack([x, y], axis=1)
    if len(grains) == 0 or len(ends) == 0:
        return np.nan_to_num(ends, posinf=0.0, neginf=0.0)
    for axis, center in ((0, grains.x), (1, grains.y)):
        low, high = float(np.min(center - grains.a)), float(np.max(center + grains.a))
        reach = 10.0 * float(np.ptp(np.concatenate([grains.x, grains.y])) + 2.0 * np.max(grains.a))
        column = ends[:, axis]
        near = column[np.isfinite(column) & (column > low - reach) & (column < high + reach)]
        ends[:, axis] = np.clip(column, min([low, *near]), max([high, *near]))
    return ends


def box_corners(walls: Walls, grains: Grains) -> Floats:
    """Ends of the walls of a box, shape (2 w, 2) [m]: a side that lies between two others ends at their corners, whatever length it has.

    Sides are known by their names left, right, bottom and top. Where there is no corner, an end stays where it is, and one without end is
    cut as in `drawn_walls`.
    """
    column = [np.stack(pair, axis=1).ravel() for pair in ((walls.x0, walls.x1), (walls.y0, walls.y1))]
    ends = np.stack(column, axis=1)
    at = {name: k for k, name in enumerate(walls.name)}
    for axis, sides, between in ((1, ("left", "right"), ("bottom", "top")), (0, ("bottom", "top"), ("left", "right"))):
        if all(name in at for name in between):
            low, high = (ends[2 * at[name], axis] for name in between)
            for k in (at[name] for name in sides if name in at):
                falls = ends[2 * k, axis] > ends[2 * k + 1, axis]
                ends[2 * k : 2 * k + 2, axis] = (high, low) if falls else (low, high)
    return ends if np.isfinite(ends).all() else np.where(np.isfinite(ends), ends, drawn_walls(walls, grains))
