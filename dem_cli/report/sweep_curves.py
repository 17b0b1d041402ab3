"""What the pictures of a sweep share: which axes they go over, cases by curve, and points with bars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from dem_cli.analysis.statistics import LEVEL, Estimate
from dem_cli.report.look import COLORS
from dem_cli.report.sweep import Sweep, SweepCase
from dem_cli.report.sweep_axes import Axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Transform

MARKERS = ("o", "s", "^", "D", "v", "P", "X")
LINES = ("-", "--", ":", "-.")
BARS = f"bars: {100.0 * LEVEL:.0f} % confidence of the mean over seeds (Student's t)"


def varying(found: Sweep) -> list[Axis]:
    return [axis for axis in found.axes if axis.varies]


def plane(found: Sweep) -> list[Axis]:
    """The two numeric axes that a map goes over, x first: frequency and amplitude where both vary, else the first two; or one, or none."""
    numeric = [axis for axis in varying(found) if axis.values is not None]
    shaking = [axis for name in ("frequency", "amplitude") for axis in numeric if axis.name == name]
    return shaking if len(shaking) == 2 else numeric[:2]


def words(found: Sweep, case: SweepCase, without: Sequence[Axis]) -> str:
    """The case's points on all axes that vary but for those in `without`; "" if there are none."""
    return ", ".join(
        axis.words(place)
        for axis, place in zip(found.axes, case.places, strict=True)
        if axis.varies and axis not in without
    )


def by_words(found: Sweep, without: Sequence[Axis]) -> dict[str, list[SweepCase]]:
    """Cases in groups that differ on the axes `without` only, in the order of the sweep."""
    groups: dict[str, list[SweepCase]] = {}
    for case in found.cases:
        groups.setdefault(words(found, case, without), []).append(case)
    return groups


def bars(ax: Axes, x: float, value: Estimate, factor: float, color: str, where: Transform | None = None) -> None:
    """Half width of the confidence interval of a mean, where there is one. where: in place of the data's own coordinates."""
    if math.isfinite(value.half):
        mean, half = factor * value.mean, factor * value.half
        ax.errorbar(x, mean, half, color=color, lw=1.0, capsize=2.5, zorder=2, transform=where or ax.transData)


def ends(value: Estimate, factor: float) -> tuple[float, float]:
    """Of the bar of a mean, or the mean twice."""
    half = value.half if math.isfinite(value.half) else 0.0
    return factor * (value.mean - half), factor * (value.mean + half)


def fit(low: float, high: float, margin: float = 0.06) -> tuple[float, float]:
    """Limits of an axis with room at both ends; set by hand, as matplotlib leaves out what is shifted on the paper."""
    room = margin * (high - low) or 0.1 * abs(high) or 1.0
    return low - room, high + room


def beside(ax: Axes, points: float) -> Transform:
    """The data's coordinates, shifted to the right on the paper, so that bars at one place do not hide each other."""
    from matplotlib.transforms import offset_copy

    return offset_copy(ax.transData, ax.get_figure(root=True), x=points, units="points")


def looks(k: int) -> tuple[str, str, str]:
    """Colour, marker and line of curve k: told apart without colour too."""
    return COLORS[k % len(COLORS)], MARKERS[k % len(MARKERS)], LINES[(k // len(COLORS)) % len(LINES)]


def legend_below(figure: Figure, ax: Axes, least: int = 2) -> None:
    """The labels of `ax` below all panels, if there are `least` of them; a $ in a name is no formula."""
    handles, labels = ax.get_legend_handles_labels()
    if len(labels) >= least:
        most = max(1, int(figure.get_figwidth() / (0.5 + 0.085 * max(map(len, labels)))))
        figure.legend(
            handles,
            [label.replace("$", r"\$") for label in labels],
            loc="outside lower center",
            ncols=min(len(labels), most),
        )
