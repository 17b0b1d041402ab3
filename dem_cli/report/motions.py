"""Recorded motions in a summary, and the picture of what the ground did."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli import units
from dem_cli.report.look import COLORS, axis_label, display_unit, heading, largest, mark_stages, new_figure
from dem_cli.results import Results
from dem_cli.results.motions import StoredMotion
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = {"csv": "CSV", "at2": "PEER AT2", "knet": "K-NET ASCII"}


@dataclass(frozen=True)
class Record:
    """One component of a recorded motion; SI units.

    recorded_*: of the file. residual_*_before: velocity and displacement at the end of the cut record as it is, integrated from
    rest; all others are of the motion as it was used. arias [m/s]; significant_duration: from 5 to 95 % of it.
    """

    name: str
    format: str
    component: str
    understood: str
    recorded_samples: float
    recorded_interval: float
    recorded_duration: float
    recorded_peak: float
    factor: float
    peak: float
    peak_velocity: float
    peak_displacement: float
    residual_velocity_before: float
    residual_displacement_before: float
    residual_velocity: float
    residual_displacement: float
    predominant_period: float
    arias: float
    significant_duration: float


@dataclass(frozen=True)
class Motion:
    """A stage's recorded motion. interval: between samples as used; begin: rest before; duration: of the stage [s]."""

    interval: float
    begin: float
    duration: float
    baseline: str
    components: tuple[Record, ...]

    @property
    def period(self) -> float:
        """Predominant period of the first component [s]."""
        return self.components[0].predominant_period


def motion_of(stored: StoredMotion | None) -> Motion | None:
    """What a result file tells of a stage's record."""
    if stored is None:
        return None
    facts = stored.facts
    records = tuple(Record(*(_known(given.get(one.name)) for one in fields(Record))) for given in facts["components"])
    return Motion(facts["interval"], facts["begin"], facts["duration"], facts["baseline"], records)


def _known(value: Any) -> Any:
    return math.nan if value is None else value


def draw_motion(results: Results, window: tuple[float, float], text: str) -> Figure:
    """Acceleration, velocity and displacement of the container over time, along x and y where it moves so.

    From the series; the accelerations of a recorded motion from its own samples, which may lie closer.
    """
    time = np.asarray(results.series["time"])
    inside = (time >= window[0] - 1e-9) & (time <= window[1] + 1e-9)
    moment, own = _accelerations(results, window)
    columns = {
        "acceleration": {axis: np.asarray(results.series[f"ground_a{axis}"])[inside] for axis in "xy"},
        "velocity": {axis: np.asarray(results.series[f"ground_v{axis}"])[inside] for axis in "xy"},
        "displacement": {axis: np.asarray(results.series[f"ground_{axis}"])[inside] for axis in "xy"},
    }
    # What rounding leaves of a direction is no motion.
    sizes = {axis: [largest(one[axis]) for one in columns.values()] for axis in "xy"}
    moving = [k for k in "xy" if any(a > 1e-9 * max(b) for a, *b in zip(sizes[k], *sizes.values(), strict=True))] or [
        "x"
    ]
    figure = new_figure(7.0, 6.0)
    panels = figure.subplots(3, 1, sharex=True)
    for panel, (name, values) in zip(panels, columns.items(), strict=True):
        size = max(largest(values[axis]) for axis in moving)
        unit = {"acceleration": (0.01, "gal")}.get(name) or display_unit({"velocity": "m/s"}.get(name, "m"), size)
        for k, axis in enumerate(moving):
            t, shown = time[inside], values[axis]
            if name == "acceleration" and own is not None:
                t, shown = moment, own[:, "xy".index(axis)]
            panel.plot(t, shown / unit[0], color=COLORS[k], label=axis, lw=0.9)
        panel.axhline(0.0, color="0.6", lw=0.6, zorder=0)
        panel.set_ylabel(axis_label(name, unit[1]))
    if len(moving) > 1:
        panels[0].legend(loc="upper right", ncols=2)
    panels[-1].set_xlabel("t [s]")
    panels[-1].set_xlim(*window)
    within = [s for s in results.stages if s.start < window[1] - 1e-9 and not s.end <= window[0] + 1e-9]
    if len(within) > 1:
        mark_stages(list(panels), results.stages, window[1])
    figure.align_ylabels()
    heading(figure, results, f"Motion of the container, {text}")
    return figure


def _accelerations(results: Results, window: tuple[float, float]) -> tuple[Floats, Floats | None]:
    """Times (t,) [s] and accelerations (t, 2) [m/s^2] of the recorded motion that fills the window, None if there is none."""
    for number, motion in results.motions.items():
        if number > len(results.stages):
            continue
        start = results.stages[number - 1].start
        if abs(start - window[0]) > 1e-9:
            continue
        table = results.scenario.get("stage", [])[number - 1]
        angle = units.parse(str(table.get("angle", "0 rad")), "rad")
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        time = start + motion.time
        shown = time <= window[1] + 1e-9
        return time[shown], (motion.acceleration @ turn)[shown]
    return np.zeros(0), None
