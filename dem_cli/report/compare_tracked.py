"""Pictures that set the tracked grains of several runs side by side: a column a case, a row a grain, the same axes for all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.cases import Case
from dem_cli.report.look import (
    COLORS,
    axis_label,
    display_unit,
    largest,
    narrow,
    new_figure,
    stage_label,
    title,
    wrapped,
)
from dem_cli.report.tracked import Paths, draw_path, paths
from dem_cli.results import open_results
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# More columns and rows than these cannot be read on one page.
MOST_COLUMNS = 6
MOST_ROWS = 12


@dataclass(frozen=True)
class Column:
    """One run: its heading, and displacements (t, g) [m], turns (t, g) [rad] of its tracked grains since the stage began at time 0."""

    head: str
    ids: tuple[int, ...]
    time: Floats
    x: Floats
    y: Floats
    turn: Floats


@dataclass(frozen=True)
class Columns:
    columns: tuple[Column, ...]
    title: str

    @property
    def rows(self) -> int:
        return min(max(len(column.ids) for column in self.columns), MOST_ROWS)


def side_by_side(cases: Sequence[Case], stage: int | None = None) -> Columns:
    """Tracked grains of the first run of each case, in stage `stage` (from 1), else in its last stage of shaking or last of all.

    Runs without tracks of it are passed over. Raises ScenarioError if none is left.
    """
    found: list[Column] = []
    labels: dict[str, None] = {}
    left_out = 0
    for case in cases:
        read = _read(case, stage)
        if read is None:
            left_out += 1
        elif len(found) < MOST_COLUMNS:
            found.append(read[0])
            labels[read[1]] = None
        else:
            left_out += 1
    if not found:
        which = f"stage {stage}" if stage else "shaking"
        raise ScenarioError(
            f"none of these files holds tracks of grains in {which}; ask for them with [output] tracks = "
            '{ grains = [0, 1, 2], interval = "1 ms" } and run again'
        )
    note = f"; {left_out} of {len(cases)} cases without tracks, or too many" if left_out else ""
    return Columns(tuple(found), " and ".join(labels) + note)


def _read(case: Case, stage: int | None) -> tuple[Column, str] | None:
    run = case.first
    with open_results(run.file) as results:
        stages = results.stages
        number = stage
        if number is None:
            shaken = [k for k, one in enumerate(stages, start=1) if one.kind == "shake"]
            number = shaken[-1] if shaken else len(stages)
        if not 1 <= number <= len(stages):
            return None
        start, end = stages[number - 1].start, stages[number - 1].end
        try:
            way = paths(results, (start, end if math.isfinite(end) else math.inf))
        except ScenarioError:
            return None
        label = stage_label(number, stages[number - 1])
    seed = f", seed {run.seed}" if len(case.runs) > 1 else ""
    note = "" if case.complete else "\nincomplete"
    return _column(f"{case.kind}\n{case.shaking}{seed}{note}", way), label


def _column(head: str, way: Paths) -> Column:
    return Column(
        head=head,
        ids=tuple(way.ids.tolist()),
        time=way.time - way.time[0],
        x=way.x - way.x[0],
        y=way.y - way.y[0],
        turn=way.angle - way.angle[0],
    )


def _panels(found: Columns, width: float, height: float, *, rigid: bool = False) -> tuple[Figure, list[list[Axes]]]:
    """A figure of a panel for each grain and run, headed, each with its grain's number; where a run tracks fewer, panels are off."""
    rows, columns = found.rows, len(found.columns)
    figure = new_figure(width * columns + 1.3, height * rows + 1.6, rigid=rigid)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    room = max(figure.get_figwidth() - (0.9 if narrow() else 1.3), 1.0) / columns
    for k, column in enumerate(found.columns):
        axes[0, k].set_title(wrapped(column.head, room), parse_math=False)
        for row in range(rows):
            if row >= len(column.ids):
                axes[row, k].set_axis_off()
                continue
            where = axes[row, k].transAxes
            axes[row, k].text(
                0.02, 0.97, f"No. {column.ids[row]}", transform=where, va="top", fontsize=7.5, color="0.35", zorder=5
            )
    return figure, axes.tolist()


def draw_histories(found: Columns) -> Figure:
    """Displacement in x and y (left axis) and rotation (right axis) against time since the stage began."""
    factor, unit = display_unit("m", largest(*(a for c in found.columns for a in (c.x, c.y))))
    turn, turn_unit = display_unit("rad", largest(*(c.turn for c in found.columns)))
    figure, axes = _panels(found, 2.5, 1.05)
    high = 1.06 * max(largest(*(c.turn for c in found.columns)) / turn, 1e-9)
    handles = []
    last = len(found.columns) - 1
    for k, column in enumerate(found.columns):
        for row in range(min(len(column.ids), MOST_ROWS)):
            ax = axes[row][k]
            right = ax.twinx()
            right.spines["right"].set_visible(True)
            right.set_ylim(-high, high)
            handles = [
                *ax.plot(column.time, column.x[:, row] / factor, color=COLORS[0], label="x"),
                *ax.plot(column.time, column.y[:, row] / factor, color=COLORS[1], ls=(0, (5, 1.5)), label="y"),
                *right.plot(column.time, column.turn[:, row] / turn, color=COLORS[2], lw=0.9, ls=(0, (1, 1)), label="rotation (right)"),
            ]  # fmt: skip
            right.tick_params(labelright=k == last)
    size = 1.06 * max(largest(*(a for c in found.columns for a in (c.x, c.y))) / factor, 1e-9)
    axes[0][0].set_ylim(-size, size)
    axes[0][0].set_xlim(0.0, max(float(c.time[-1]) for c in found.columns))
    for ax in axes[-1]:
        ax.set_xlabel("time [s]")
    figure.supylabel(
        f"{axis_label('displacement', unit)}; right: {axis_label('rotation', turn_unit)}", fontsize="medium"
    )
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    title(figure, f"Displacements of grains, {found.title}")
    return figure


def draw_trajectories(found: Columns) -> Figure:
    """Paths in the container from start (ring) to end (dot), coloured by time; all panels show as much, each about its own path."""
    factor, unit = display_unit("m", largest(*(a for c in found.columns for a in (c.x, c.y))))
    half_x, half_y = (
        0.56 * max(float(np.max(np.ptp(a, axis=0))) for a in (getattr(c, name) for c in found.columns)) / factor
        for name in ("x", "y")
    )
    half_x, half_y = max(half_x, 1e-9), max(half_y, 1e-9)
    # A path along one axis alone still gets a panel that is not a slit.
    half_x, half_y = max(half_x, 0.4 * half_y), max(half_y, 0.4 * half_x)
    width = 2.2 * min(1.0, half_x / half_y)
    figure, axes = _panels(found, width + 0.25, width * half_y / half_x + 0.1, rigid=narrow())
    end = max(float(c.time[-1]) for c in found.columns)
    lines = None
    for k, column in enumerate(found.columns):
        for row in range(min(len(column.ids), MOST_ROWS)):
            ax = axes[row][k]
            x, y = column.x[:, row] / factor, column.y[:, row] / factor
            middle_x, middle_y = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
            lines = draw_path(ax, x - middle_x, y - middle_y, column.time)
            lines.set_clim(0.0, end)
            ax.set_aspect("equal")
    if narrow():
        axes[0][0].locator_params(nbins=2, min_n_ticks=1)
    axes[0][0].set_xlim(-half_x, half_x)
    axes[0][0].set_ylim(-half_y, half_y)
    figure.supxlabel(axis_label("x about the middle of the path", unit), fontsize="medium")
    figure.supylabel(axis_label("y about the middle of the path", unit), fontsize="medium")
    if lines is not None:
        flat = [ax for row in axes for ax in row]
        figure.colorbar(lines, ax=flat, aspect=40, pad=0.02).set_label("time since the stage began [s]")
    title(figure, f"Trajectories in the container, {found.title}")
    return figure
