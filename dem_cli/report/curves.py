"""Pictures of quantities over time: any series, the ledger of energy, and the free surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.report.look import (
    COLORS,
    DIVERGING,
    axis_label,
    axis_name,
    display_unit,
    extension,
    heading,
    largest,
    mark_stages,
    narrow,
    new_figure,
    small,
)
from dem_cli.results import Results
from dem_cli.state import Bools, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Window = tuple[float, float]

# Ledger of energy from the bottom up: series -> (label, colour). Blues are stored, browns are lost.
STORED = {
    "potential": ("potential, above its lowest", "#C6DBEF"),
    "kinetic": ("kinetic", "#6BAED6"),
    "elastic_normal": ("elastic, normal", "#2171B5"),
    "elastic_tangential": ("elastic, tangential", "#08306B"),
}
LOST = {
    "friction": ("lost to friction", "#8C510A"),
    "dashpot_normal": ("lost to normal dashpots", "#D8A04A"),
    "dashpot_tangential": ("lost to tangential dashpots", "#F6E0B5"),
    "bond_energy": ("lost to bonds", "#BF6F8F"),
    "damping": ("lost to extra damping", "#BDBDBD"),
    "escaped_energy": ("carried off by escaped grains", "#737373"),
}


@dataclass(frozen=True)
class Ledger:
    """What is stored and lost: series -> (label, colour), from the bottom up; given: series that the stack must follow, and their label."""

    stored: Mapping[str, tuple[str, str]]
    lost: Mapping[str, tuple[str, str]]
    given: tuple[str, ...]
    label: str


LEDGER = Ledger(STORED, LOST, ("work", "time_step_energy"), "start + work + time step")


def _inside(time: Floats, window: Window) -> Bools:
    return np.asarray((time >= window[0] - 1e-9) & (time <= window[1] + 1e-9))


def draw_series(results: Results, names: Sequence[str], window: Window, text: str) -> Figure:
    """One panel a series, all over the same time axis."""
    time = np.asarray(results.series[results.axis])
    inside = _inside(time, window)
    figure = new_figure(7.0, 1.0 + 1.7 * len(names))
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for k, (ax, name) in enumerate(zip(axes, names, strict=True)):
        values = np.asarray(results.series[name], dtype=float)[inside]
        factor, unit = display_unit(results.series.unit(name), largest(values))
        ax.plot(time[inside], values / factor, color=COLORS[k % len(COLORS)])
        ax.set_ylabel(axis_label(name.replace("_", " "), unit))
        if not np.isfinite(values).any():
            ax.text(0.5, 0.5, "not defined here", transform=ax.transAxes, ha="center", color="0.35")
    figure.align_ylabels()
    _time_axis(results, list(axes), time[inside])
    heading(figure, results, text)
    return figure


def draw_energy(results: Results, window: Window, text: str, ledger: Ledger = LEDGER) -> Figure:
    """Stored and lost energy since the start of the window, stacked; the line is what the stack must reach:
    the start, plus work, plus time-step error.
    """
    inside = _inside(np.asarray(results.series["time"]), window)

    def column(name: str) -> Floats:
        if name not in results.series:  # a file from before there were bonds
            return np.zeros(np.count_nonzero(inside))
        return np.nan_to_num(np.asarray(results.series[name])[inside])

    time = column("time")
    parts = {name: column(name) for name in ledger.stored} | {
        name: column(name) - column(name)[0] for name in ledger.lost
    }
    parts["potential"] = parts["potential"] - parts["potential"].min()
    given = np.sum([column(name) for name in ledger.given], axis=0)
    must = sum(parts[name][0] for name in parts) + given - given[0]
    factor, unit = display_unit("J", largest(must))
    figure = new_figure(7.5, 5.4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
    kept = [name for name in parts if parts[name].max() > 0.0]
    looks = {**ledger.stored, **ledger.lost}
    areas = upper.stackplot(
        time,
        *[parts[name] / factor for name in kept],
        colors=[looks[name][1] for name in kept],
        labels=[looks[name][0] for name in kept],
        edgecolor="white",
        linewidth=0.3,
    )
    line = upper.plot(time, must / factor, color="black", lw=1.0, ls=(0, (4, 2)), label=ledger.label)
    upper.set_ylabel(axis_label("energy", unit))
    upper.set_ylim(bottom=0.0)
    handles = [*line, *reversed(areas)]
    if narrow():
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    else:
        upper.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=small())
    residual = column("residual")
    factor, unit = display_unit("J", largest(residual))
    lower.plot(time, residual / factor, color="black", lw=0.9)
    lower.set_ylabel(axis_label("residual", unit))
    _time_axis(results, [upper, lower], time)
    heading(figure, results, f"Ledger of energy, {text}")
    return figure


def draw_surface(results: Results, window: Window, text: str, limits: tuple[float, float] | None = None) -> Figure:
    """Rise of the free surface over place and time since the start of the window, and the antisymmetric mode
    below.
    """
    surface = results.surface
    inside = _inside(np.asarray(surface.time), window)
    time, eta = np.asarray(surface.time)[inside], np.asarray(surface.eta, dtype=float)[inside]
    finite = np.isfinite(eta).any(axis=1)
    level = float(np.nanmean(eta[finite][0])) if finite.any() else 0.0
    start = np.where(np.isfinite(eta[0]), eta[0], level)
    rise = np.ma.masked_invalid(eta - start)
    size = np.percentile(np.abs(rise.compressed()), 99.5) if rise.count() else 0.0
    factor, unit = display_unit("m", float(size) if limits is None else largest(np.array(limits)))
    low, high = (-size, size) if limits is None else limits
    if not high > low:
        low, high = -factor, factor
    extend = extension(rise.compressed(), low, high)
    place, place_unit = display_unit("m", results.width)
    figure = new_figure(7.5, 5.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2) if narrow() else (2, 1))
    image = upper.pcolormesh(
        _edges(time),
        _edges(np.asarray(surface.x)) / place,
        rise.T / factor,
        cmap=DIVERGING,
        vmin=low / factor,
        vmax=high / factor,
        rasterized=True,
    )
    upper.set_facecolor("0.8")
    upper.set_ylabel(axis_label("x", place_unit))
    bar = figure.colorbar(image, ax=upper, aspect=20, pad=0.02, extend=extend)
    bar.set_label(axis_label("rise since the start", unit))
    series_time = np.asarray(results.series["time"])
    mode = np.asarray(results.series["mode1"], dtype=float)
    chosen = _inside(series_time, window)
    factor, unit = display_unit("m", largest(mode[chosen]))
    lower.plot(series_time[chosen], mode[chosen] / factor, color=COLORS[0])
    lower.axhline(0.0, color="0.6", lw=0.6, zorder=0)
    lower.set_ylabel(axis_label(r"mode cos($\pi$x/l)", unit))
    _time_axis(results, [upper, lower], time)
    level_factor, level_unit = display_unit("m", level)
    heading(figure, results, f"Free surface, {text}; mean at its start {level / level_factor:.4g} {level_unit}")
    return figure


def _edges(middles: Floats) -> Floats:
    """Edges of cells around `middles` (n,): (n + 1,), halfway between neighbours."""
    if len(middles) == 1:
        return np.array([middles[0] - 0.5, middles[0] + 0.5])
    inner = 0.5 * (middles[1:] + middles[:-1])
    return np.concatenate([[2 * middles[0] - inner[0]], inner, [2 * middles[-1] - inner[-1]]])


def _time_axis(results: Results, axes: Sequence[Axes], time: Floats) -> None:
    """Label the time axis under the last of `axes`, set its limits and show the stages."""
    axes[-1].set_xlabel(axis_name(results))
    low, high = float(time[0]), float(time[-1])
    if high > low:
        axes[-1].set_xlim(low, high)
    within = [s for s in results.stages if s.start < high - 1e-9 and not s.end <= low + 1e-9]
    if len(within) > 1:
        mark_stages(axes, results.stages, high)
