"""One entry for all pictures: what is asked for is checked against the file and drawn."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.look import stage_label
from dem_cli.results import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("sample", "rose", "histories", "trajectories", "surface", "energy", "motion", "series")
DEFAULT_SERIES = ("void_ratio", "depth", "coordination", "kinetic")


@dataclass(frozen=True)
class Picture:
    """What to draw. All quantities SI; None picks the default described in `dem render --help`.

    time [s], frame (0-based, negative from the end), stage (1-based, 0 is the whole run), color: a quantity
    of a grain, chains, bonds, marks: what is drawn over the grains, limits of the colours, series: names, grains: numbers of tracked grains.
    """

    what: str = "sample"
    time: float | None = None
    frame: int | None = None
    stage: int | None = None
    color: str = "displacement"
    chains: bool | None = None
    bonds: bool | None = None
    marks: bool = False
    limits: tuple[float, float] | None = None
    series: Sequence[str] = DEFAULT_SERIES
    grains: Sequence[int] | None = None


def draw(results: Results, picture: Picture) -> Figure:
    """Figure of `picture`. Raises ScenarioError if the file does not hold what it needs. Call inside
    `look.style()`.
    """
    # Imported here so that one kind of picture does not load what only another needs.
    from dem_cli.report import curves, motions, rose, sample, tracked

    check_request(picture)
    _check_file(results, picture)
    if picture.what == "sample":
        return sample.draw_sample(
            results,
            choose_frame(results, picture),
            color=picture.color,
            chains=picture.chains,
            bonds=picture.bonds,
            marks=picture.marks,
            limits=picture.limits,
        )
    if picture.what == "rose":
        return rose.draw_rose(results, choose_frame(results, picture))
    window, text = choose_window(results, picture)
    if picture.what == "histories":
        return tracked.draw_histories(results, tracked.paths(results, window, picture.grains), text)
    if picture.what == "trajectories":
        return tracked.draw_trajectories(results, tracked.paths(results, window, picture.grains), text)
    time = np.asarray(results.series["time"])
    if np.count_nonzero((time >= window[0] - 1e-9) & (time <= window[1] + 1e-9)) < 2:
        raise ScenarioError(
            f"{results.path}: holds fewer than two rows of series between {window[0]:g} s and {window[1]:g} s"
        )
    if picture.what == "surface":
        return curves.draw_surface(results, window, text, picture.limits)
    if picture.what == "motion":
        return motions.draw_motion(results, window, text)
    if picture.what == "energy":
        return curves.draw_energy(results, window, text)
    return curves.draw_series(results, picture.series, window, text)


def choose_frame(results: Results, picture: Picture) -> int:
    """Index of the stored frame that is asked for: by index, nearest to a time, last of a stage, or last of
    all.
    """
    count = results.n_frames
    if count == 0:
        raise ScenarioError(f"{results.path}: holds no frames; choose a shorter [output] frames and run again")
    times = results.frame_times
    if picture.frame is not None:
        if not -count <= picture.frame < count:
            raise ScenarioError(f"{results.path}: frame {picture.frame} is none of its {count} (0 to {count - 1})")
        return picture.frame % count
    if picture.time is not None:
        first, last = float(times[0]), float(times[-1])
        if not first - 1e-9 <= picture.time <= last + 1e-9:
            raise ScenarioError(
                f"{results.path}: time {picture.time:g} s lies outside its frames ({first:g} s to {last:g} s)"
            )
        return int(np.argmin(np.abs(times - picture.time)))
    if picture.stage:
        stage = results.stages[picture.stage - 1]
        until = stage.end if np.isfinite(stage.end) else np.inf
        within = np.flatnonzero((times >= stage.start - 1e-9) & (times <= until + 1e-9))
        if len(within) == 0:
            raise ScenarioError(f"{results.path}: holds no frame of stage {picture.stage}")
        return int(within[-1])
    return count - 1


def choose_window(results: Results, picture: Picture) -> tuple[tuple[float, float], str]:
    """Window of time [s] for a picture over time, and its description.

    Without a stage: the whole run for series and energy, else the last stage (of shaking, if there is one).
    """
    stages = results.stages
    time = np.asarray(results.series["time"])
    end = float(time[-1]) if len(time) else 0.0
    number = picture.stage
    if number is None:
        number = 0
        if picture.what not in ("series", "energy") and len(stages) > 1:
            shaken = [k for k, stage in enumerate(stages, start=1) if stage.kind == "shake"]
            number = shaken[-1] if shaken else len(stages)
    if number == 0:
        return (float(time[0]) if len(time) else 0.0, end), "whole run"
    stage = stages[number - 1]
    stop = stage.end if np.isfinite(stage.end) else end
    return (stage.start, stop), stage_label(number, stage)


def check_request(picture: Picture) -> None:
    """Raise ScenarioError for what no file could give: an unknown kind of picture or quantity, colour limits
    upside down.
    """
    from dem_cli.report.quantities import QUANTITIES

    if picture.what not in KINDS:
        raise ScenarioError(unknown("kind of picture", picture.what, KINDS))
    if picture.what == "sample" and picture.color not in QUANTITIES:
        raise ScenarioError(unknown("quantity of a grain", picture.color, QUANTITIES))
    if picture.limits is not None and not picture.limits[1] > picture.limits[0]:
        low, high = picture.limits
        raise ScenarioError(f"--range {low:g},{high:g}: the second number must be the larger")


def _check_file(results: Results, picture: Picture) -> None:
    if picture.what == "series":
        for name in picture.series:
            if name not in results.series:
                raise ScenarioError(f"{results.path}: " + unknown("series", name, results.series))
    if picture.stage is not None and not 0 <= picture.stage <= len(results.stages):
        count = len(results.stages)
        raise ScenarioError(
            f"{results.path}: stage {picture.stage} is none of its {count} (1 to {count}; 0: whole run)"
        )


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """One line: what is unknown, the nearest name, and all names."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f' Did you mean "{near[0]}"?' if near else ""
    return f'unknown {kind} "{name}".{hint} Known: {", ".join(names)}'
