"""Frames of a file by stage and increment, and what is in their view."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dem_cli.errors import ScenarioError
from dem_cli.results import Results, StoredFrame, StoredIncrement

AnyFrame = StoredFrame | StoredIncrement
Box = tuple[float, float, float, float]
BOUNDARY = "#B9C7D6"  # colour of boundary grains


def frames_of_stage(results: Results, number: int) -> npt.NDArray[np.int64]:
    """Indices of the frames of stage `number` (from 1) of a quasi-static test, with that of the state it starts from, if that is stored.

    ScenarioError if there is none.
    """
    found = np.flatnonzero(results.frame_stages == number - 1)
    start = results.stages[number - 1].start
    at = results.frame_times
    if len(found) == 0 or at[found[0]] > start:
        before = np.flatnonzero((results.frame_stages == number - 2) & (at == start))
        found = np.concatenate([before[-1:], found])
    if len(found) == 0:
        raise ScenarioError(
            f"{results.path}: holds no frame of stage {number}; choose smaller [output] frames and run again"
        )
    return found


def frame_at(results: Results, increment: int, number: int | None) -> int:
    """Index of the frame nearest to an increment of the run, or of stage `number` (from 1). ScenarioError outside of it."""
    if number:
        stage = results.stages[number - 1]
        frames, start = frames_of_stage(results, number), stage.start
        last = results.series["in_stage"][results.series["stage"] == number - 1].max(initial=0.0)
    else:
        frames, start, last = np.arange(results.n_frames), 0.0, results.series["increment"].max(initial=0.0)
    if not 0 <= increment <= last:
        where = f"stage {number}" if number else "the run"
        raise ScenarioError(f"{results.path}: {where} has no increment {increment}, only 0 to {last:.0f}")
    return int(frames[np.argmin(np.abs(results.frame_times[frames] - start - increment))])


def frame_box(frame: AnyFrame) -> Box:
    """x0, x1, y0, y1 [m] of the grains and of walls that have ends."""
    g, w = frame.grains, frame.walls
    found: list[float] = []
    for place, ends in ((g.x, (w.x0, w.x1)), (g.y, (w.y0, w.y1))):
        wall = np.concatenate(ends)
        wall = wall[np.isfinite(wall)]
        found.append(min(float((place - g.radius).min()), float(wall.min(initial=np.inf))))
        found.append(max(float((place + g.radius).max()), float(wall.max(initial=-np.inf))))
    return found[0], found[1], found[2], found[3]
