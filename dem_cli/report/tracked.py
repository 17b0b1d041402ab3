"""Pictures of tracked grains: displacement histories and trajectories (thesis, figures 8.4 to 8.26)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.look import (
    COLORS,
    SEQUENTIAL,
    axis_label,
    axis_name,
    display_unit,
    heading,
    largest,
    mark_size,
    narrow,
    new_figure,
)
from dem_cli.results import Results
from dem_cli.state import Floats, Ints

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

# More panels than these cannot be read on one page.
MOST_PANELS = 12


@dataclass(frozen=True)
class Paths:
    """Tracked grains in a window of time: ids (g,), time (t,) [s]; x, y [m] and angle [rad], shape (t, g)."""

    ids: Ints
    time: Floats
    x: Floats
    y: Floats
    angle: Floats


def paths(results: Results, window: tuple[float, float], grains: Sequence[int] | None = None) -> Paths:
    """Tracks of `grains` (default: all) within `window` [s].

    Raises ScenarioError if the file holds no tracks, none in the window, or not those grains.
    """
    tracks = results.tracks
    how = 'ask for them with [output] tracks = { grains = [0, 1, 2], interval = "1 ms" } and run again'
    if tracks is None or len(tracks.ids) == 0 or len(tracks.time) == 0:
        raise ScenarioError(f"{results.path}: holds no tracks of grains; {how}")
    known = {int(number): column for column, number in enumerate(tracks.ids)}
    if grains is None:
        grains = list(known)
    unknown = [number for number in grains if number not in known]
    if unknown:
        names = ", ".join(map(str, unknown))
        raise ScenarioError(
            f"{results.path}: holds no track of grain {names}, only of {', '.join(map(str, known))}; {how}"
        )
    inside = (tracks.time >= window[0] - 1e-9) & (tracks.time <= window[1] + 1e-9)
    if np.count_nonzero(inside) < 2:
        unit = "s" if results.axis == "time" else "increments"
        raise ScenarioError(f"{results.path}: holds no tracks between {window[0]:g} and {window[1]:g} {unit}")
    columns = [known[number] for number in grains]
    part = {name: np.asarray(tracks.arrays[name])[inside][:, columns] for name in ("x", "y", "angle")}
    return Paths(ids=np.array(grains, dtype=np.int64), time=np.asarray(tracks.time)[inside], **part)


def draw_histories(results: Results, tracked: Paths, text: str) -> Figure:
    """One panel a grain: displacement in x and y (left axis) and rotation (right axis) from the start of the
    window.
    """
    count = min(len(tracked.ids), MOST_PANELS)
    x, y, angle = (a[:, :count] - a[0, :count] for a in (tracked.x, tracked.y, tracked.angle))
    factor, unit = display_unit("m", largest(x, y))
    turn, turn_unit = display_unit("rad", largest(angle))
    columns = _columns(count)
    rows = -(-count // columns)
    figure = new_figure(2.6 * columns + 1.4, 1.75 * rows + 1.1)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    right_axes: list[Axes] = []
    lines = []
    for k, ax in enumerate(axes.flat):
        if k >= count:
            ax.set_axis_off()
            continue
        right = ax.twinx()
        right_axes.append(right)
        right.spines["right"].set_visible(True)
        lines = [
            *ax.plot(tracked.time, x[:, k] / factor, color=COLORS[0], label="x"),
            *ax.plot(tracked.time, y[:, k] / factor, color=COLORS[1], ls=(0, (5, 1.5)), label="y"),
            *right.plot(tracked.time, angle[:, k] / turn, color=COLORS[2], ls=(0, (1, 1)), label="rotation (right)"),
        ]
        ax.set_title(f"No. {tracked.ids[k]}")
        _outer_labels(ax, k, count, columns, axis_name(results), axis_label("displacement", unit))
        if (k + 1) % columns and k + 1 < count:
            right.tick_params(labelright=False)
        else:
            right.set_ylabel(axis_label("rotation", turn_unit))
    low = min(ax.get_ylim()[0] for ax in right_axes)
    high = max(ax.get_ylim()[1] for ax in right_axes)
    for right in right_axes:
        right.set_ylim(low, high)
    axes.flat[0].set_xlim(tracked.time[0], tracked.time[-1])
    figure.legend(handles=lines, loc="outside lower center", ncols=3)
    heading(figure, results, f"Displacements of grains, {text}{_left_out(tracked)}")
    return figure


def draw_trajectories(results: Results, tracked: Paths, text: str) -> Figure:
    """One panel a grain, all to the same scale: its way from the start (ring) to the end (dot), coloured by
    time.
    """
    count = min(len(tracked.ids), MOST_PANELS)
    x, y = (a[:, :count] - a[0, :count] for a in (tracked.x, tracked.y))
    factor, unit = display_unit("m", largest(x, y))
    x, y = x / factor, y / factor
    columns = _columns(count)
    rows = -(-count // columns)
    middle_x, middle_y = (0.5 * (np.nanmin(a, axis=0) + np.nanmax(a, axis=0)) for a in (x, y))
    half_x, half_y = (0.56 * max(float((np.nanmax(a, axis=0) - np.nanmin(a, axis=0)).max()), 1e-12) for a in (x, y))
    # A path along one axis alone still gets a panel that is not a slit.
    half_x, half_y = max(half_x, 0.4 * half_y), max(half_y, 0.4 * half_x)
    side = 2.1
    shape = (min(side, side * half_x / half_y), min(side, side * half_y / half_x))
    figure = new_figure((shape[0] + 0.55) * columns + 1.5, (shape[1] + 0.4) * rows + 1.2, rigid=True)
    axes = figure.subplots(rows, columns, squeeze=False)
    lines = None
    for k, ax in enumerate(axes.flat):
        if k >= count:
            ax.set_axis_off()
            continue
        lines = draw_path(ax, x[:, k], y[:, k], tracked.time)
        ax.set_aspect("equal")
        ax.set_xlim(middle_x[k] - half_x, middle_x[k] + half_x)
        ax.set_ylim(middle_y[k] - half_y, middle_y[k] + half_y)
        ax.locator_params(**({"nbins": 2, "min_n_ticks": 1} if narrow() else {"nbins": 4}))
        ax.set_title(f"No. {tracked.ids[k]}")
        _outer_labels(ax, k, count, columns, axis_label("x - x$_0$", unit), axis_label("y - y$_0$", unit))
    if lines is not None:
        bar = figure.colorbar(lines, ax=axes, aspect=35, pad=0.02)
        bar.set_label(axis_name(results))
    heading(figure, results, f"Trajectories in the container, {text}{_left_out(tracked)}")
    return figure


def draw_path(ax: Axes, x: Floats, y: Floats, time: Floats) -> LineCollection:
    """Draw a path from its start (ring) to its end (dot), coloured by `time`; returns the lines that carry the colours."""
    from matplotlib.collections import LineCollection

    points = np.column_stack([x, y])
    lines = LineCollection(
        np.stack([points[:-1], points[1:]], axis=1),  # type: ignore[arg-type]
        array=0.5 * (time[:-1] + time[1:]),
        cmap=SEQUENTIAL,
        linewidths=0.9,
        capstyle="round",
    )
    ax.add_collection(lines)
    ax.plot(*points[0], "o", ms=mark_size(5.0), mfc="white", mec="black", mew=0.9)
    ax.plot(*points[-1], "o", ms=mark_size(4.0), color="black")
    return lines


def _columns(count: int) -> int:
    """Three to a row as in the thesis; one or two where there are no more, four from ten on."""
    return min(count, 3) if count <= 9 else 4


def _outer_labels(ax: Axes, k: int, count: int, columns: int, x_label: str, y_label: str) -> None:
    """Label the axes of panel `k` where no panel lies below or left of it."""
    if k + columns >= count:
        ax.set_xlabel(x_label)
        ax.tick_params(labelbottom=True)
    if k % columns == 0:
        ax.set_ylabel(y_label)


def _left_out(tracked: Paths) -> str:
    more = len(tracked.ids) - MOST_PANELS
    return f" (first {MOST_PANELS} of {len(tracked.ids)})" if more > 0 else ""
