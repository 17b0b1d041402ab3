"""Pictures of a comparison: all cases in one figure, and the change of the void ratio over amplitude and frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report import thesis
from dem_cli.report.cases import Case, Pooled
from dem_cli.report.compare import Comparison
from dem_cli.report.figures import unknown
from dem_cli.report.look import (
    COLORS,
    DIVERGING,
    LETTERS,
    current,
    describe,
    largest,
    new_figure,
    small,
    title,
    wrapped,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = ("table", "grid", "histories", "trajectories")
APART = 0.17  # of packed and shaken from the middle of their case
MARK = 30.0  # area of a dot [points^2]


def check_request(what: str, *, stage: bool = False) -> None:
    """Raise ScenarioError for an unknown kind of picture, or a stage where it has no meaning."""
    if what not in KINDS:
        raise ScenarioError(unknown("kind of picture", what, KINDS))
    if stage and what not in ("histories", "trajectories"):
        raise ScenarioError(f"--stage has no meaning for --what {what}, only for histories and trajectories")


def draw(found: Comparison, what: str, *, stage: int | None = None, with_thesis: bool = False) -> Figure:
    """The picture `what` of KINDS. Raises ScenarioError if no file holds what it needs. Call inside `look.style()`."""
    check_request(what, stage=stage is not None)
    if what == "table":
        return draw_table(found.cases, with_thesis=with_thesis)
    if what == "grid":
        return draw_grid(found.cases)
    # Imported here as only these read files again.
    from dem_cli.report.compare_tracked import draw_histories, draw_trajectories, side_by_side

    columns = side_by_side(found.cases, stage)
    return draw_histories(columns) if what == "histories" else draw_trajectories(columns)


def draw_table(cases: Sequence[Case], *, with_thesis: bool = False) -> Figure:
    """Void ratio and roughness packed (ring) and after shaking (dot), and airborne grains, of each case, in groups of one shaking.

    Bars: standard deviation of several seeds, small dots: each of them. Black bars: the thesis.
    """
    colors = _colors(cases)
    at = _places(cases)
    figure = new_figure(min(max(1.6 + 0.55 * (max(at) + 1.0), 5.6), 15.0), 7.2)
    top, middle, bottom = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": (2.3, 1.4, 1.0)})
    for x, case in zip(at, cases, strict=True):
        _before_after(top, x, case, "void_ratio", 1.0, colors[case.kind])
        _before_after(middle, x, case, "roughness", 1e3, colors[case.kind])
        share = [100.0 * run.measures["airborne_most"] / run.grains for run in case.runs]
        _point(bottom, x, case.measures["airborne_most"], share, 100.0 / case.first.grains, colors[case.kind])
        if with_thesis and case.sine and case.first.family and thesis.is_shaking(*case.sine, thesis.SHAKING):
            known = thesis.FOUND[case.first.family]
            for side, value in ((-APART, known.packed), (APART, known.shaken)):
                top.plot(
                    [x + side - 0.14, x + side + 0.14], [value, value], color="black", lw=2.0, solid_capstyle="butt"
                )
        if not case.complete:
            top.text(
                x,
                0.02,
                "incomplete",
                rotation=90,
                transform=top.get_xaxis_transform(),
                ha="center",
                fontsize=7,
                color="0.4",
            )
    for ax, label in ((top, "void ratio"), (middle, "surface roughness [mm]"), (bottom, "most airborne [%]")):
        ax.set_ylabel(label)
        ax.grid(axis="y", color="0.9", lw=0.6)
        ax.set_axisbelow(True)
    bottom.set_ylim(bottom=min(-0.04 * bottom.get_ylim()[1], -0.02))
    _name_groups(bottom, at, cases)
    figure.align_ylabels()
    longest = max(len(kind) for kind in colors) / LETTERS[current().titles] + 0.5
    ncols = min(4, len(colors) + 2 + with_thesis, max(int(figure.get_figwidth() / longest), 1))
    room = figure.get_figwidth() / ncols - 0.5
    note = "Void ratio and surface roughness, packed (ring) and after shaking (dot), and most airborne grains; bars: standard deviation"
    describe(figure, note + ("; black bars: the thesis" if with_thesis else ""))
    figure.legend(handles=_legend(colors, with_thesis, room), loc="outside upper center", ncols=ncols)
    return figure


def _places(cases: Sequence[Case]) -> list[float]:
    """Where each case stands: one apart, groups of one shaking half a place more."""
    at: list[float] = []
    for k, case in enumerate(cases):
        at.append(0.0 if k == 0 else at[-1] + (1.0 if case.shaking == cases[k - 1].shaking else 1.6))
    return at


def _colors(cases: Sequence[Case]) -> dict[str, str]:
    kinds = list(dict.fromkeys(case.kind for case in cases))
    return {kind: COLORS[k % len(COLORS)] for k, kind in enumerate(kinds)}


def _before_after(ax: Axes, x: float, case: Case, name: str, factor: float, color: str) -> None:
    before, after = (case.measures[f"{name}_{state}"] for state in ("packed", "shaken"))
    ax.plot([x - APART, x + APART], [factor * before.mean, factor * after.mean], color=color, lw=0.8, zorder=1)
    for side, state, value in ((-APART, "packed", before), (APART, "shaken", after)):
        each = [factor * run.measures[f"{name}_{state}"] for run in case.runs]
        _point(ax, x + side, value, each, factor, color, ring=state == "packed")


def _point(
    ax: Axes, x: float, value: Pooled, each: Sequence[float], factor: float, color: str, *, ring: bool = False
) -> None:
    """A mean with its bar, and beside it the single values `each` (to scale already)."""
    if value.n > 1:
        ax.errorbar(x, factor * value.mean, factor * value.sd, color=color, lw=1.0, capsize=2.5, zorder=2)
        ax.scatter(np.full(len(each), x + 0.11), each, s=4.0, color=color, alpha=0.6, linewidths=0.0, zorder=2)
    ax.scatter(
        [x], [factor * value.mean], s=MARK, color="white" if ring else color, edgecolors=color, linewidths=1.2, zorder=3
    )


def _name_groups(ax: Axes, at: Sequence[float], cases: Sequence[Case]) -> None:
    """Each group's shaking below its cases."""
    ticks, labels = [], []
    for label, group in groupby(zip(at, cases, strict=True), key=lambda one: one[1].shaking):
        places = [x for x, _ in group]
        ticks.append(0.5 * (places[0] + places[-1]))
        labels.append(label.replace(" gal ", " gal\n").replace("; ", "\n"))
    ax.set_xticks(ticks, labels, parse_math=False)
    ax.tick_params(axis="x", length=0)
    ax.set_xlim(min(at) - 0.8, max(at) + 0.8)


def _legend(colors: dict[str, str], with_thesis: bool, room: float) -> list[Any]:
    """room: width of a name [inch]."""
    from matplotlib.lines import Line2D

    def mark(label: str, color: str, face: str) -> Line2D:
        return Line2D([], [], ls="", marker="o", ms=5.5, mec=color, mfc=face, label=label)

    shown = [mark(wrapped(kind, room).replace("$", r"\$"), color, color) for kind, color in colors.items()]
    shown += [mark("packed", "0.4", "white"), mark("after shaking", "0.4", "0.4")]
    return [*shown, Line2D([], [], color="black", lw=2.0, label="thesis")] if with_thesis else shown


def draw_grid(cases: Sequence[Case]) -> Figure:
    """Change of the void ratio over amplitude and frequency of the sine, a matrix for each kind of grains; one scale of colours.

    Raises ScenarioError if no run is shaken once, by a sine.
    """
    kinds: dict[str, dict[tuple[float, float], Case]] = {}
    for case in cases:
        if case.sine and case.measures["void_ratio_change"].n:
            kinds.setdefault(case.kind, {}).setdefault(case.sine, case)
    if not kinds:
        raise ScenarioError("--what grid: no run of these is shaken by one sine and has a void ratio before and after")
    amplitudes = sorted({sine[0] for grid in kinds.values() for sine in grid})
    frequencies = sorted({sine[1] for grid in kinds.values() for sine in grid}, reverse=True)
    change = {
        kind: np.array(
            [
                [grid[a, f].measures["void_ratio_change"].mean if (a, f) in grid else math.nan for f in frequencies]
                for a in amplitudes
            ]
        )
        for kind, grid in kinds.items()
    }
    reach = max(largest(*change.values()), 1e-6)
    columns = min(len(kinds), 3)
    rows = -(-len(kinds) // columns)
    figure = new_figure(columns * (1.0 + 1.05 * len(frequencies)) + 1.2, rows * (0.9 + 0.75 * len(amplitudes)) + 0.8)
    axes = figure.subplots(rows, columns, squeeze=False)
    image = None
    for ax in axes.flat[len(kinds) :]:
        ax.set_axis_off()
    for ax, (kind, grid) in zip(axes.flat, kinds.items(), strict=False):
        image = ax.imshow(change[kind], cmap=DIVERGING, vmin=-reach, vmax=reach, origin="lower", aspect="auto")
        ax.set_title(wrapped(kind, figure.get_figwidth() / columns - 0.4), parse_math=False)
        ax.set_xticks(range(len(frequencies)), [f"{f:.4g}" for f in frequencies])
        ax.set_yticks(range(len(amplitudes)), [f"{100.0 * a:.4g}" for a in amplitudes])
        ax.set_xlabel("frequency [Hz]")
        ax.set_ylabel("amplitude [gal]")
        for (row, column), value in np.ndenumerate(change[kind]):
            cell = _cell(grid.get((amplitudes[row], frequencies[column])))
            dark = math.isfinite(value) and abs(value) > 0.62 * reach
            ax.text(column, row, cell, ha="center", va="center", fontsize=small(), color="white" if dark else "black")
    if image is not None:
        figure.colorbar(image, ax=axes, aspect=30, pad=0.02).set_label("change of the void ratio")
    title(figure, "Change of the void ratio, before shaking to after it (- denser)")
    return figure


def _cell(case: Case | None) -> str:
    if case is None:
        return "-"
    value = case.measures["void_ratio_change"]
    lines = [f"{value.mean:+.4f}"]
    if value.n > 1:
        lines.append(f"± {value.sd:.4f} ({value.n})")
    if not case.complete:
        lines.append("incomplete")
    return "\n".join(lines)
