"""Curves of shear tests as in Kishino's figures 7, 9 and 13 to 16: each a panel that a figure of its own or the page of all is made of.

Strains are shown in percent, stresses in kPa; a black dot marks the peak of s1/s2. Where the shear strain goes to and fro, what is no
loop is drawn over the increments of the stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli.report.look import COLORS, footnote, heading, new_figure, stage_label, title
from dem_cli.report.shear_rows import (
    SLOPE_ROWS,
    Rows,
    densities,
    dilatancy,
    is_undrained,
    one_shear_stage,
    principal,
    reverses,
    shear_stages,
    shown_peak,
    stage_rows,
)
from dem_cli.results import Results
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STRAIN = "shear strain e1 - e2 [%]"
INCREMENT = "increment of the stage"
EVENT = "#D55E00"


@dataclass(frozen=True)
class Curve:
    """Rows of a stage that shears the sample, as they are drawn. peak: row of the largest s1/s2, None where the strain reverses."""

    label: str
    rows: Rows
    colour: str
    peak: int | None
    reverses: bool
    undrained: bool
    dash: str = "-"

    @property
    def strain(self) -> Floats:
        return 100.0 * self.rows["shear_strain"]

    @property
    def along(self) -> Floats:
        """Shear strain [%], or the increments of the stage where it reverses."""
        return self.rows["in_stage"] if self.reverses else self.strain


def curve(results: Results, number: int, colour: str = COLORS[0]) -> Curve:
    """Stage `number` (from 1)."""
    rows = stage_rows(results, number)
    name = results.stages[number - 1].name or f"stage {number}"
    return Curve(name, rows, colour, shown_peak(rows), reverses(rows), is_undrained(rows))


def curves(results: Results, number: int | None) -> list[Curve]:
    """The stage that is asked for, or all that shear the sample, each in its colour."""
    first = one_shear_stage(results, number)
    chosen = shear_stages(results) if not number else [first]
    return [curve(results, k, COLORS[n % len(COLORS)]) for n, k in enumerate(chosen)]


def mark_peak(ax: Axes, x: Floats, y: Floats, peak: int | None) -> None:
    if peak is not None:
        ax.plot(x[peak], y[peak], "o", color="black", ms=4.5, zorder=5, label="_peak", clip_on=False)


def mark_events(ax: Axes, x: Floats, rows: Rows, colour: str = EVENT) -> None:
    """Small strokes along the foot of the panel at the increments that passed through a collapse."""
    events = rows["event"] > 0
    if events.any():
        where = ax.get_xaxis_transform()
        ax.plot(
            x[events],
            np.full(np.count_nonzero(events), 0.02),
            "|",
            color=colour,
            ms=7,
            mew=1.2,
            transform=where,
            label="_events",
        )


# ---------------------------------------------------------------------------------------------- panels


def panel_ratio(ax: Axes, some: Sequence[Curve]) -> None:
    """s1/s2 over the shear strain; the sine of the mobilised friction angle on the right."""
    for one in some:
        y = one.rows["stress_ratio"]
        ax.plot(one.strain, y, color=one.colour, ls=one.dash, label=one.label)
        mark_peak(ax, one.strain, y, one.peak)
    ax.set(xlabel=STRAIN, ylabel="stress ratio s1/s2")
    right = ax.secondary_yaxis("right", functions=(_sine, _ratio))  # type: ignore[arg-type]
    right.set_ylabel("(s1 - s2)/(s1 + s2)")
    ax.spines["right"].set_visible(True)


def _sine(ratio: Floats) -> Floats:
    return (ratio - 1.0) / (ratio + 1.0)


def _ratio(sine: Floats) -> Floats:
    return (1.0 + sine) / np.where(sine < 1.0, 1.0 - sine, 1e-12)


def panel_volume(ax: Axes, some: Sequence[Curve]) -> None:
    for one in some:
        y = 100.0 * one.rows["volumetric_strain"]
        ax.plot(one.strain, y, color=one.colour, ls=one.dash, label=one.label)
        mark_peak(ax, one.strain, y, one.peak)
        mark_events(ax, one.strain, one.rows, one.colour if len(some) > 1 else EVENT)
    ax.axhline(0.0, color="0.6", lw=0.6, zorder=0)
    ax.set(xlabel=STRAIN, ylabel="volumetric strain e_v [%]")


def panel_dilatancy(ax: Axes, one: Curve) -> None:
    """Rate of dilatancy -de_v/d(e1 - e2), the sine of the dilatancy angle in 2D, over the shear strain; the angle on the right."""
    rate = dilatancy(one.rows)
    ax.plot(one.along, rate, color=one.colour)
    mark_peak(ax, one.along, rate, one.peak)
    mark_events(ax, one.along, one.rows)
    ax.axhline(0.0, color="0.6", lw=0.6, zorder=0)
    ax.set(xlabel=_label([one]), ylabel="dilatancy -de_v/d(e1 - e2)")
    right = ax.secondary_yaxis("right", functions=(_angle, _sine_of))  # type: ignore[arg-type]
    right.set_ylabel("dilatancy angle [deg]")
    ax.spines["right"].set_visible(True)


def _angle(sine: Floats) -> Floats:
    return np.asarray(np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))))


def _sine_of(angle: Floats) -> Floats:
    return np.asarray(np.sin(np.radians(angle)))


def panel_deviator(ax: Axes, some: Sequence[Curve]) -> None:
    for one in some:
        y = 1e-3 * one.rows["deviator"]
        ax.plot(one.strain, y, color=one.colour, ls=one.dash, label=one.label, lw=_thin(one))
        mark_peak(ax, one.strain, y, one.peak)
    ax.axhline(0.0, color="0.6", lw=0.6, zorder=0)
    ax.set(xlabel=STRAIN, ylabel="deviator s1 - s2 [kPa]")


def panel_path(ax: Axes, some: Sequence[Curve]) -> None:
    """Stress path: s1 - s2 over the effective mean stress; a ring where it starts."""
    for one in some:
        x, y = 1e-3 * one.rows["mean_stress"], 1e-3 * one.rows["deviator"]
        ax.plot(x, y, color=one.colour, ls=one.dash, label=one.label, lw=_thin(one))
        ax.plot(x[0], y[0], "o", mfc="white", mec=one.colour, ms=4.5, zorder=4, label="_start")
        mark_peak(ax, x, y, one.peak)
    ax.axhline(0.0, color="0.6", lw=0.6, zorder=0)
    ax.set_xlim(left=0.0)
    ax.set(xlabel="mean effective stress p' [kPa]", ylabel="deviator s1 - s2 [kPa]")


def panel_water(ax: Axes, some: Sequence[Curve]) -> None:
    for one in some:
        ax.plot(_along(one, some), 1e-3 * one.rows["pore_pressure"], color=one.colour, ls=one.dash, label=one.label)
        mark_peak(ax, _along(one, some), 1e-3 * one.rows["pore_pressure"], one.peak)
    first = some[0].rows["mean_stress"][0]
    if np.isfinite(first):
        ax.axhline(1e-3 * first, color="0.6", lw=0.6, ls=(0, (4, 2)), zorder=0)
    ax.set(xlabel=_label(some), ylabel="pore pressure [kPa]")


def panel_strain(ax: Axes, some: Sequence[Curve]) -> None:
    """Shear strain over the increments."""
    for one in some:
        ax.plot(one.rows["in_stage"], one.strain, color=one.colour, ls=one.dash, label=one.label)
    ax.set(xlabel=INCREMENT, ylabel=STRAIN)


def panel_coordination(ax: Axes, one: Curve) -> None:
    """Principal values of the coordination tensor, Kishino (23), and their sum, as in figure 13."""
    _principal(ax, one, principal(one.rows, "coordination"), "C")
    ax.set(ylabel="contacts per grain")
    ax.set_ylim(bottom=0.0)


def panel_energy(ax: Axes, one: Curve) -> None:
    """Principal values of the tensor of elastic energy, Kishino (24), and their sum, as in figure 14."""
    _principal(ax, one, principal(one.rows, "energy"), "E")
    ax.set(ylabel="elastic energy [J/m³]")
    ax.set_ylim(bottom=0.0)


def _principal(ax: Axes, one: Curve, values: tuple[Floats, Floats], letter: str) -> None:
    found: tuple[tuple[str, Floats, str, Any], ...] = (
        (f"{letter}1 + {letter}2", values[0] + values[1], "black", "-"),
        (f"{letter}1", values[0], COLORS[1], (0, (5, 1.5))),
        (f"{letter}2", values[1], COLORS[0], "-"),
    )
    for label, y, colour, dash in found:
        ax.plot(one.along, y, color=colour, ls=dash, label=label)
        mark_peak(ax, one.along, y, one.peak)
    ax.set_xlabel(_label([one]))
    name_lines(ax)


def panel_dissipation(ax: Axes, one: Curve, depth: float) -> None:
    """Work, dissipation and elastic energy since the stage began over the sample's volume, as in figure 15; what collapses released."""
    found = densities(one.rows, depth)
    lines: list[tuple[str, str, str, Any]] = [
        ("work W", "work", "black", "-"),
        ("friction D", "friction", COLORS[1], (0, (5, 1.5))),
        ("elastic", "elastic", COLORS[0], "-"),
    ]
    if np.abs(found["released"]).max() > 1e-3 * max(np.abs(found["work"]).max(), 1e-300):
        lines.append(("released", "released", COLORS[2], (0, (1, 1))))
    for label, name, colour, dash in lines:
        ax.plot(one.along, found[name], color=colour, ls=dash, label=label)
        if name in ("work", "friction"):
            mark_peak(ax, one.along, found[name], one.peak)
    mark_events(ax, one.along, one.rows)
    ax.axhline(0.0, color="0.6", lw=0.6, zorder=0)
    ax.set(xlabel=_label([one]), ylabel="energy [J/m³]")
    name_lines(ax)


def panel_share(ax: Axes, one: Curve) -> None:
    """Share of the contact that dissipates most in each increment, as in figure 16."""
    step, share = one.rows["in_stage"][1:], 100.0 * one.rows["largest_share"][1:]
    ax.plot(step, share, color=COLORS[0], marker="o" if len(step) <= 120 else "", ms=2.0, lw=0.8)
    if one.peak is not None and one.peak > 0:
        mark_peak(ax, step, share, one.peak - 1)
    mark_events(ax, step, {"event": one.rows["event"][1:]})
    ax.set_ylim(0.0, 100.0)
    ax.set(xlabel=INCREMENT, ylabel="largest share [%]")


def name_lines(ax: Axes) -> None:
    """A row of names above the panel, where no curve can run through it."""
    count = len(ax.get_legend_handles_labels()[1])
    ax.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=min(count, 4),
        handlelength=1.6,
        borderaxespad=0.2,
        columnspacing=1.2,
    )


def _along(one: Curve, some: Sequence[Curve]) -> Floats:
    return one.rows["in_stage"] if any(c.reverses for c in some) else one.strain


def _label(some: Sequence[Curve]) -> str:
    return INCREMENT if any(one.reverses for one in some) else STRAIN


def _thin(one: Curve) -> float:
    return 0.7 if one.reverses else 1.1


# ---------------------------------------------------------------------------------------------- figures


def stress_panels(some: Sequence[Curve]) -> list[str]:
    """Which panels tell of stress and strain in these curves."""
    drained, closed = [one for one in some if not one.undrained], [one for one in some if one.undrained]
    turning = any(one.reverses for one in some)
    names = ["deviator" if turning or not drained else "ratio"]
    if drained:
        names.append("volume")
    if closed:
        names += ["path", "water"]
        if not drained:
            names.append("strain" if turning else "ratio")
    return names


def draw_panel(ax: Axes, name: str, some: Sequence[Curve]) -> None:
    """Panel `name` of `stress_panels`, with the curves that it is about."""
    drained, closed = [one for one in some if not one.undrained], [one for one in some if one.undrained]
    if name == "ratio":
        panel_ratio(ax, some)
    elif name == "deviator":
        panel_deviator(ax, some)
    elif name == "volume":
        panel_volume(ax, drained)
    elif name == "path":
        panel_path(ax, closed)
    elif name == "water":
        panel_water(ax, closed)
    else:
        panel_strain(ax, closed)


def draw_stress_strain(results: Results, number: int | None) -> Figure:
    """Stress and volumetric strain over the shear strain; of closed pores the stress path and the pore pressure, too."""
    some = curves(results, number)
    text = "stages of shearing" if len(some) > 1 else _stage_text(results, number)
    figure = _stress_figure(some)
    heading(figure, results, f"Stress and strain, {text}{_peaks(some)}")
    return figure


def draw_compared(several: Sequence[Results], number: int | None) -> Figure:
    """The same of one stage of each file: stage `number`, or the first that shears the sample."""
    some = [
        replace(
            curve(one, one_shear_stage(one, number), COLORS[k % len(COLORS)]),
            label=one.path.stem,
            dash=("-", "--", ":", "-.")[k // len(COLORS) % 4],
        )
        for k, one in enumerate(several)
    ]
    figure = _stress_figure(some)
    title(figure, f"Stress and strain of {len(some)} tests{_peaks(some)}")
    return figure


def _peaks(some: Sequence[Curve]) -> str:
    words = "\ndots: peak of s1/s2" if any(one.peak is not None for one in some) else ""
    return (
        f"{words}; strokes: collapses"
        if any(np.any(one.rows["event"] > 0) for one in some if not one.undrained)
        else words
    )


def _stress_figure(some: Sequence[Curve]) -> Figure:
    names = stress_panels(some)
    if len(names) == 2:
        figure = new_figure(5.2, 6.0)
        axes = list(figure.subplots(2, 1, sharex=True))
        axes[0].tick_params(labelbottom=False)
    else:
        figure = new_figure(8.6, 6.4)
        axes = list(figure.subplots(2, 2).ravel())
    for ax, name in zip(axes, names, strict=True):
        draw_panel(ax, name, some)
    if len(names) == 2:
        axes[0].set_xlabel("")
    if len(some) > 1:
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(some), 4))
    return figure


def _stage_text(results: Results, number: int | None) -> str:
    found = one_shear_stage(results, number)
    return stage_label(found, results.stages[found - 1])


def draw_one(results: Results, what: str, number: int | None) -> Figure:
    """Figure of one panel about one stage: dilatancy, coordination, energy-tensor, dissipation or largest-share."""
    one = curve(results, one_shear_stage(results, number))
    figure = new_figure(5.6, 4.0)
    ax = figure.add_subplot()
    titles = {
        "dilatancy": "Dilatancy",
        "coordination": "Coordination tensor",
        "energy-tensor": "Tensor of elastic energy",
        "dissipation": "Work, dissipation and elastic energy since the start",
        "largest-share": "Share of the contact that dissipates most",
    }
    if what == "dilatancy":
        panel_dilatancy(ax, one)
    elif what == "coordination":
        panel_coordination(ax, one)
    elif what == "energy-tensor":
        panel_energy(ax, one)
    elif what == "dissipation":
        panel_dissipation(ax, one, results.depth)
    else:
        panel_share(ax, one)
    heading(figure, results, f"{titles[what]}, {_stage_text(results, number)}")
    notes = ["dot: peak of s1/s2"] if one.peak is not None else []
    if what == "dilatancy":
        notes.append(f"slope over {2 * SLOPE_ROWS + 1} increments")
    if what in ("dilatancy", "dissipation", "largest-share") and np.any(one.rows["event"] > 0):
        notes.append("strokes: increments that passed through a collapse")
    if notes:
        footnote(figure, "; ".join(notes))
    return figure
