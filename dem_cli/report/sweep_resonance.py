"""Resonance of the surface in a sweep: its motion at the driving frequency over the driving period by the theory's T1."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from dem_cli.errors import ScenarioError
from dem_cli.report import look
from dem_cli.report.look import new_figure
from dem_cli.report.sweep import Sweep, SweepCase
from dem_cli.report.sweep_axes import Axis
from dem_cli.report.sweep_curves import BARS, bars, by_words, ends, fit, legend_below, looks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

APART = 1.05  # ratio of the longest period over T1 to the shortest below which there is no curve
LINE, SHORT = 0.3, 2  # height [inch] for each curve that the legend names beyond a few
WIDE = 4.0  # ratio of the longest period to the shortest from which their axis is logarithmic
CAPTION = (
    "Amplitude of the first antisymmetric mode of the free surface, cos(pi x/l), at the driving frequency: the sine that fits it best "
    "in the second half of the last stage of shaking (whole driving periods, ramps left out), over the driving period T. Below, the same "
    "over the amplitude of the ground's displacement, that of its acceleration over (2 pi/T)^2. T1 is the first period of a liquid as "
    "wide (l) and as deep (h) as the fill before the shaking, (2 pi/T1)^2 = (pi g/l) tanh(pi h/l); the line marks T = T1. "
    "It is a reference, no prediction for grains."
)


def draw_resonance(found: Sweep) -> tuple[str, str, Figure]:
    """Title, caption and picture: a curve for each amplitude, shape and whatever else varies. ScenarioError without any such amplitude."""
    if not found.has("driven_amplitude"):
        raise ScenarioError(f"--what resonance: {_why(found)}")
    frequency = [axis for axis in found.axes if axis.name.rpartition(".")[2] == "frequency"]
    groups = {
        label: [case for case in cases if case.estimate("driven_amplitude").n]
        for label, cases in by_words(found, frequency).items()
    }
    groups = {label: cases for label, cases in groups.items() if cases}
    ratios = [case.estimate("period_ratio").mean for cases in groups.values() for case in cases]
    if max(ratios) < APART * min(ratios):
        raise ScenarioError("--what resonance: all members are shaken at the same period over T1; vary the frequency")
    figure = new_figure(6.4, 6.2 + LINE * max(0, len(groups) - SHORT))
    top, bottom = figure.subplots(2, 1, sharex=True)
    panels = ((top, "driven_amplitude", 1e3), (bottom, "driven_ratio", 1.0))
    for k, (label, cases) in enumerate(groups.items()):
        for ax, name, factor in panels:
            _curve(ax, cases, name, factor, label, k)
    quiet = max(case.estimate("quiet").mean for cases in groups.values() for case in cases)
    top.axhline(1e3 * quiet, color="0.6", lw=0.8, ls=":", zorder=1)
    top.annotate(
        "still", (1.0, 1e3 * quiet), xycoords=top.get_yaxis_transform(), xytext=(3.0, 0.0), textcoords="offset points",
        ha="left", va="center", fontsize=7, color="0.4",
    )  # fmt: skip
    top.set_ylabel("amplitude of the surface [mm]")
    bottom.set_ylabel("over that of the ground")
    bottom.set_xlabel("driving period over T1 of a liquid as deep")
    for ax, name, factor in panels:
        ax.axvline(1.0, color="0.35", lw=1.0, ls="--", zorder=1)
        highest = max(ends(case.estimate(name), factor)[1] for cases in groups.values() for case in cases)
        ax.set_ylim(0.0, fit(0.0, highest)[1])
        ax.grid(axis="y", color="0.92", lw=0.6)
        ax.set_axisbelow(True)
    top.annotate(
        "T = T1", (1.0, 1.0), xycoords=top.get_xaxis_transform(), xytext=(3.0, -2.0), textcoords="offset points",
        ha="left", va="top", fontsize=8, color="0.35",
    )  # fmt: skip
    _periods(bottom, ratios)
    legend_below(figure, top, 1)
    title = "Resonance of the surface"
    look.title(figure, title)
    return title, f"{CAPTION} {BARS[0].upper()}{BARS[1:]}. {_left_out(found, frequency)}".strip(), figure


def _curve(ax: Axes, cases: list[SweepCase], name: str, factor: float, label: str, k: int) -> None:
    color, marker, line = looks(k)
    points = []
    for case in cases:
        value, x = case.estimate(name), case.estimate("period_ratio").mean
        points.append((x, factor * value.mean))
        bars(ax, x, value, factor, color)
    points.sort()
    ax.plot(
        [x for x, _ in points], [y for _, y in points],
        color=color, marker=marker, ms=4.5, ls=line, label=label or "all runs", zorder=3,
    )  # fmt: skip


def _periods(ax: Axes, ratios: list[float]) -> None:
    """Logarithmic over a wide range, with plain numbers at the ticks."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    low, high = min(ratios), max(ratios)
    ax.set_xlim(*fit(min(low, 1.0), max(high, 1.0)))
    if high < WIDE * low:
        return
    ax.set_xscale("log")
    low, high = 0.85 * min(low, 1.0), 1.18 * max(high, 1.0)
    ax.set_xlim(low, high)
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ax.xaxis.set_major_locator(
        FixedLocator([m * 10.0**k for k in decades for m in (1, 2, 5) if low <= m * 10.0**k <= high])
    )
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _why(found: Sweep) -> str:
    if not found.kinds:
        return "no member of the sweep is done yet"
    reasons = [one.numbers.undriven for one in found.entries if one.numbers and one.numbers.undriven]
    return reasons[0] if reasons else "no member shakes a container of grains in 2D by a sine"


def _left_out(found: Sweep, frequency: list[Axis]) -> str:
    """Members that are done and shaken by a sine, but have no amplitude, in a sentence."""
    missing = [one.numbers.undriven for one in found.entries if one.numbers and one.numbers.undriven]
    return f"Left out: {len(missing)} run{'s' if missing[1:] else ''} ({missing[0]})." if missing and frequency else ""
