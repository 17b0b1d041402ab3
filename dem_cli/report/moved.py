"""How far the tracked grains went in a stage, in numbers (thesis, figures 8.4 to 8.26 and 8.5.2, 8.5.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.tracked import paths
from dem_cli.results import Results
from dem_cli.state import Floats

MEANS = ("x", "y", "turn", "excursion", "path", "speed", "speed_start")


@dataclass(frozen=True)
class Way:
    """What one tracked grain did in a stage, in the container's frame.

    start_x, start_y: where it was [m]; level: its height in the first record of all [m], which tells rows of the starting grid;
    x, y [m], turn [rad]: net displacement; excursion: largest distance from the start [m]; path: length of the polygon through
    its records [m]; speed, speed_start: root mean square of its velocity over the stage, and over the beginning of it [m/s].
    """

    grain: int
    start_x: float
    start_y: float
    level: float
    x: float
    y: float
    turn: float
    excursion: float
    path: float
    speed: float
    speed_start: float


@dataclass(frozen=True)
class Moved:
    """Tracked grains in stage `stage` (from 1), and `mean` over them of MEANS: of the size of x and turn, of all others as they are."""

    stage: int
    ways: tuple[Way, ...]
    mean: dict[str, float]


def moved(results: Results, number: int, begins: float) -> Moved | str:
    """Ways of the tracked grains in stage `number` (from 1), of which the first `begins` seconds are the beginning.

    Where there are no tracks of it, the reason in a line.
    """
    stage = results.stages[number - 1]
    stop = stage.end if math.isfinite(stage.end) else math.inf
    try:
        way = paths(results, (stage.start, stop))
    except ScenarioError:
        # What the error advises is in its line; a comparison goes on without.
        return f"holds no tracks of stage {number} ({stage.kind}): nothing is said of single grains"
    tracks = results.tracks
    assert tracks is not None
    inside = (tracks.time >= stage.start - 1e-9) & (tracks.time <= stop + 1e-9)
    squares = np.asarray(tracks.arrays["vx"] ** 2 + tracks.arrays["vy"] ** 2)[inside]
    first = way.time <= stage.start + begins + 1e-9
    x, y, turn = (a - a[0] for a in (way.x, way.y, way.angle))
    columns: dict[str, Floats] = {
        "start_x": way.x[0],
        "start_y": way.y[0],
        "level": np.asarray(tracks.arrays["y"])[0],
        "x": x[-1],
        "y": y[-1],
        "turn": turn[-1],
        "excursion": np.hypot(x, y).max(axis=0),
        "path": np.hypot(np.diff(x, axis=0), np.diff(y, axis=0)).sum(axis=0),
        "speed": np.sqrt(squares.mean(axis=0)),
        "speed_start": np.sqrt(squares[first].mean(axis=0)),
    }
    ways = tuple(
        Way(int(grain), *(float(columns[one.name][k]) for one in fields(Way)[1:])) for k, grain in enumerate(way.ids)
    )
    mean = {name: float(np.mean(np.abs(columns[name]) if name in ("x", "turn") else columns[name])) for name in MEANS}
    return Moved(number, ways, mean)


def as_rows(one: Moved) -> list[list[Way]]:
    """Grains that started at one height of the grid, from the lowest, each row from left to right; tells rows apart where they are
    further apart than a tenth of the spread of heights.
    """
    ordered: Any = sorted(one.ways, key=lambda way: way.level)
    apart = 0.1 * (ordered[-1].level - ordered[0].level)
    rows: list[list[Way]] = [[ordered[0]]]
    for way in ordered[1:]:
        if way.level - rows[-1][-1].level > apart:
            rows.append([])
        rows[-1].append(way)
    return [sorted(row, key=lambda way: way.start_x) for row in rows]
