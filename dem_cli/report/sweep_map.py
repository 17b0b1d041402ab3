"""Map of a sweep's main measure over two axes, a panel for each combination of the others; over one axis curves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.analysis.statistics import LEVEL, Estimate
from dem_cli.errors import ScenarioError
from dem_cli.report import look
from dem_cli.report.look import DIVERGING, SEQUENTIAL, narrow, new_figure
from dem_cli.report.sweep import Sweep, SweepCase
from dem_cli.report.sweep_axes import Axis
from dem_cli.report.sweep_best import best_point, lines
from dem_cli.report.sweep_curves import (
    BARS,
    bars,
    beside,
    by_words,
    ends,
    fit,
    legend_below,
    looks,
    plane,
    varying,
)
from dem_cli.report.sweep_measures import MEASURES, Measure
from dem_cli.report.text import number
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

MOST_WORDY = 3  # columns of a map as wide as a column of a page, beyond which cells hold the mean alone
DARK = 0.5  # luminance below which a cell's text is white

Cells = Mapping[tuple[int, int], SweepCase]


def draw_map(found: Sweep) -> tuple[str, str, Figure]:
    """Title, caption and picture. ScenarioError if no member is done, or nothing but seeds varies."""
    if not found.main:
        raise ScenarioError("--what map: no member of the sweep is done yet")
    if not varying(found):
        raise ScenarioError("--what map: nothing but seeds varies in this sweep")
    axes, measure = plane(found), MEASURES[found.main]
    over = " and ".join(axis.name for axis in axes) or " and ".join(axis.name for axis in varying(found))
    title = f"{_capital(measure.label.partition(' [')[0])} over {over}"
    best = best_point(found)
    said = _capital("; ".join(lines(best))) + "." if best else ""
    if len(axes) == 2:
        figure = _matrices(found, axes, measure)
        caption = (
            f"In each cell the mean, and half of its {100.0 * LEVEL:.0f} % confidence interval where it has several seeds "
            f"(their number in brackets); one scale of colours for all panels. Hatched: nothing is known."
        )
        mark = "Framed"
    else:
        figure = _curves(found, axes, measure)
        caption = f"Mean over seeds; {BARS}, small dots: each run."
        mark = "Ringed"
    if best:
        caption += f" {mark}: the best point. {said}"
    look.title(figure, title)
    return title, caption, figure


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


# ------------------------------------------------------------------------------------------- two axes


def _matrices(found: Sweep, axes: list[Axis], measure: Measure) -> Figure:
    from matplotlib.colors import Normalize

    across, up = axes
    columns, rows = _ascending(across), _ascending(up)
    panels = {
        label: {
            (rows.index(case.places[_at(found, up)]), columns.index(case.places[_at(found, across)])): case
            for case in cases
        }
        for label, cases in by_words(found, axes).items()
    }
    tables = {label: _means(cells, (len(rows), len(columns)), found.main) for label, cells in panels.items()}
    known = np.concatenate([table[np.isfinite(table)] for table in tables.values()]) * measure.factor
    low, high = float(known.min()), float(known.max())
    both = low < 0.0 < high
    if both:
        high = max(-low, high)
        low = -high
    elif high - low < 1e-12:
        low, high = low - 1e-6, high + 1e-6
    norm = Normalize(low, high)
    wide = 1 if narrow() else min(len(panels), max(1, int(12.0 / (1.3 + 0.95 * len(columns)))), 3)
    tall = -(-len(panels) // wide)
    figure = new_figure(max(wide * (0.9 + 0.95 * len(columns)) + 1.3, 4.6), tall * (0.9 + 0.62 * len(rows)) + 0.7)
    grid = figure.subplots(tall, wide, squeeze=False)
    best = best_point(found)
    image = None
    for ax in grid.flat[len(panels) :]:
        ax.set_axis_off()
    for ax, (label, cells) in zip(grid.flat, panels.items(), strict=False):
        image = ax.imshow(
            measure.factor * tables[label],
            cmap=DIVERGING if both else SEQUENTIAL,
            norm=norm,
            origin="lower",
            aspect="auto",
        )
        ax.set_title(label, parse_math=False)
        ax.set_xticks(range(len(columns)), [across.texts[k] for k in columns])
        ax.set_yticks(range(len(rows)), [up.texts[k] for k in rows])
        ax.set_xlabel(across.label)
        ax.set_ylabel(up.label)
        ax.spines[:].set_visible(False)
        ax.tick_params(length=0)
        top = next((place for place, case in cells.items() if best and case is found.cases[best.case]), None)
        _write_cells(ax, image, cells, tables[label].shape, found.main, measure, top)
    if image is not None:
        figure.colorbar(image, ax=grid, aspect=30, pad=0.02).set_label(_sense(found.main), parse_math=False)
    return figure


def _sense(name: str) -> str:
    """Label of a measure's axis; of a change which sign is which."""
    return f"{MEASURES[name].label} (- denser)" if name.endswith("_change") else MEASURES[name].label


def _at(found: Sweep, axis: Axis) -> int:
    return found.axes.index(axis)


def _ascending(axis: Axis) -> list[int]:
    """Numbers of the points of a numeric axis by value."""
    values = axis.values or ()
    return sorted(range(len(values)), key=lambda k: values[k])


def _means(cells: Cells, shape: tuple[int, int], name: str) -> Floats:
    table = np.full(shape, np.nan)
    for place, case in cells.items():
        table[place] = case.estimate(name).mean
    return table


def _write_cells(
    ax: Axes,
    image: AxesImage,
    cells: Cells,
    shape: tuple[int, int],
    name: str,
    measure: Measure,
    best: tuple[int, int] | None,
) -> None:
    """Numbers on the cells that have one, hatches on the others, a frame round the best."""
    for row, column in np.ndindex(*shape):
        case = cells.get((row, column))
        value = case.estimate(name) if case else None
        text, color, pad = cell_text(case, value, measure), "black", None
        if value is not None and value.n:
            red, green, blue, _ = image.to_rgba(np.array([measure.factor * value.mean]))[0]
            color = "white" if 0.2126 * red + 0.7152 * green + 0.0722 * blue < DARK else "black"
        else:
            _hatch(ax, row, column)
            pad = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        if narrow() and shape[1] > MOST_WORDY:
            text = text.split("\n")[0]
        if best == (row, column):
            _frame(ax, best)
            text += "\nbest"
        ax.text(column, row, text, ha="center", va="center", fontsize=6.5 if narrow() else 7.5, color=color, bbox=pad)


def cell_text(case: SweepCase | None, value: Estimate | None, measure: Measure) -> str:
    """Mean, confidence and number of seeds; what became of the members where there is no number."""
    if case is None or value is None:
        return "not in\nthe sweep"
    if not value.n:
        return "no value" if "done" in case.counts else "\n".join(case.counts)
    text = [number(value.mean * measure.factor, measure.form)]
    if value.n > 1:
        text.append(f"± {number(value.half * measure.factor, measure.form.lstrip('+'))} ({value.n})")
    return "\n".join(text)


def _hatch(ax: Axes, row: int, column: int) -> None:
    from matplotlib.patches import Rectangle

    ax.add_patch(
        Rectangle(
            (column - 0.5, row - 0.5), 1.0, 1.0, facecolor="0.97", edgecolor="0.75", hatch="////", lw=0.0, zorder=1
        )
    )


def _frame(ax: Axes, place: tuple[int, int]) -> None:
    """A double frame, seen on dark and on light cells and without colour."""
    from matplotlib.patches import Rectangle

    row, column = place
    for color, width in (("white", 4.5), ("black", 1.8)):
        ax.add_patch(
            Rectangle(
                (column - 0.46, row - 0.46), 0.92, 0.92,
                fill=False, edgecolor=color, lw=width, zorder=4, gid="best" if color == "black" else None,
            )
        )  # fmt: skip


# ------------------------------------------------------------------------------------- one axis, or none


def _curves(found: Sweep, axes: list[Axis], measure: Measure) -> Figure:
    """Over the one numeric axis, a curve for each combination of the others; else over the points of the first axis, side by side."""
    axis = axes[0] if axes else varying(found)[0]
    at, best = _at(found, axis), best_point(found)
    groups = by_words(found, [axis])
    figure = new_figure(6.2, 3.9)
    ax = figure.subplots()
    ax.grid(axis="y", color="0.9", lw=0.6)
    ax.set_axisbelow(True)
    shift = 0.0 if axis.values is not None else 0.5 / max(len(groups), 2)
    reached: list[float] = []
    for k, (label, cases) in enumerate(groups.items()):
        color, marker, line = looks(k)
        step = k - 0.5 * (len(groups) - 1)
        aside = 0.0 if axis.values is None else step * min(9.0, 36.0 / len(groups))
        where = beside(ax, aside)
        points = []
        for case in cases:
            value, place = case.estimate(found.main), case.places[at]
            if not value.n:
                continue
            x = place + shift * step if axis.values is None else axis.values[place]
            points.append((x, measure.factor * value.mean))
            bars(ax, x, value, measure.factor, color, where)
            reached += ends(value, measure.factor)
            if value.n > 1:
                each = [measure.factor * one for one in case.by_seed(found.main).values() if math.isfinite(one)]
                reached += each
                ax.scatter(
                    [x] * len(each), each, s=5.0, color=color, alpha=0.6, lw=0.0, zorder=2, transform=beside(ax, aside + 4.0),
                )  # fmt: skip
            if best is not None and case is found.cases[best.case]:
                ax.plot(
                    *points[-1], ls="", marker="o", ms=13.0, mfc="none", mec="black", mew=1.6, zorder=4, gid="best", transform=where,
                )  # fmt: skip
        points.sort()
        ax.plot(
            [x for x, _ in points], [y for _, y in points], color=color, marker=marker, ms=5.0,
            ls=line if axis.values is not None else "", label=label if points else None, zorder=3, transform=where,
        )  # fmt: skip
    if axis.values is not None:
        ax.set_xticks(axis.values, axis.texts)
        ax.set_xlim(*fit(min(axis.values), max(axis.values)))
    else:
        ax.set_xticks(range(len(axis.points)), list(axis.texts), parse_math=False)
        ax.set_xlim(-0.6, len(axis.points) - 0.4)
    ax.set_ylim(*fit(min(reached), max(reached)))
    ax.set_xlabel(axis.label, parse_math=False)
    ax.set_ylabel(_sense(found.main), parse_math=False)
    legend_below(figure, ax, 1 if len(groups) > 1 else 2)
    return figure
