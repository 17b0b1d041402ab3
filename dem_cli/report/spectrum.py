"""Amplitude spectrum of the free surface's modes, beside the driving frequency and what theory gives a liquid of the same depth."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.analysis.sloshing import LEAST_SAMPLES, amplitude_spectrum
from dem_cli.errors import ScenarioError
from dem_cli.report.look import COLORS, axis_label, display_unit, footnote, heading, largest, narrow, new_figure, small
from dem_cli.report.summary import Sloshing, sloshing_of
from dem_cli.results import Results
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODES = 3  # as many as reports tell of
# Of each mode: in colour and dash, as prints are grey.
LOOKS = ((COLORS[0], "-", 1.2), (COLORS[2], (0, (4, 1.5)), 0.8), (COLORS[1], (0, (1, 1)), 0.9))
LEAST_FRACTION = 3.0  # highest frequency shown: this many times the fastest that is marked


def surface_modes(eta: Floats) -> Floats:
    """Amplitudes [m] of the modes cos(n pi x/l), n = 1 to MODES, of a surface (t, b) given as means over b equal bins: (t, MODES).

    The first is `dem_cli.analysis.surface.antisymmetric_mode`. Bins without grains take the height between their neighbours.
    """
    place = np.arange(eta.shape[1])
    full = np.full(eta.shape, np.nan)
    for row, heights in zip(full, eta, strict=True):
        known = np.isfinite(heights)
        if known.any():
            row[:] = np.interp(place, place[known], heights[known])
    n = np.arange(1, MODES + 1)
    shapes = np.cos(np.pi * n * (place[:, None] + 0.5) / len(place))
    return np.asarray(2.0 / len(place) * (full @ shapes) / np.sinc(0.5 * n / len(place)))


def draw_spectrum(results: Results, number: int, text: str) -> Figure:
    """Spectra of the modes in stage `number` (from 1); theory is that of the report: linear waves at the depth before the stage.

    Dot and ring: the strongest oscillation of the first mode and the strongest beside the driving one, as the report has them.
    ScenarioError where the stage holds too few rows of the surface.
    """
    stage = results.stages[number - 1]
    window = stage.start, stage.end if math.isfinite(stage.end) else math.inf
    first = _record(np.asarray(results.series["time"]), np.asarray(results.series["mode1"]), window)
    others = _record(results.surface.time, surface_modes(np.asarray(results.surface.eta, dtype=float)), window)
    spectra = [amplitude_spectrum(*first), *(amplitude_spectrum(others[0], others[1][:, k]) for k in range(1, MODES))]
    if any(len(frequency) == 0 for frequency, _ in spectra):
        raise ScenarioError(
            f"{results.path}: {text} holds fewer than {LEAST_SAMPLES} rows of the surface; choose another --stage, or a "
            "shorter [output] interval and run again"
        )
    report = sloshing_of(results, number)
    theory = [1.0 / period for period in (report.theory_T1, report.theory_T2, report.theory_T3)]
    marked = [f for f in (*theory, 1.0 / report.driving_period) if math.isfinite(f)]
    least = min([1.0 / float(np.ptp(first[0])), *(0.8 * f for f in theory if math.isfinite(f))])
    top = min(float(spectra[0][0][-1]), max([LEAST_FRACTION * f for f in marked], default=math.inf))
    factor, unit = display_unit("m", largest(*(amplitude for _, amplitude in spectra)))
    figure = new_figure(7.0, 4.6)
    ax = figure.add_subplot()
    for k, (frequency, amplitude) in enumerate(spectra):
        color, dash, width = LOOKS[k]
        name = "cos(πx/l)" if k == 0 else f"cos({k + 1}πx/l)"
        label = f"mode {k + 1}, {name}"
        ax.plot(frequency[1:], amplitude[1:] / factor, color=color, ls=dash, lw=width, label=label, zorder=3 - 0.1 * k)
    _mark(ax, report, theory, factor)
    ax.set_xscale("log")
    ax.set_xlim(least, top)
    seen = [amplitude[(frequency >= least) & (frequency <= top)] for frequency, amplitude in spectra]
    ax.set_ylim(
        0.0, 1.1 * max(largest(*seen), report.amplitude if math.isfinite(report.amplitude) else 0.0) / factor or None
    )
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel(axis_label("amplitude of the surface mode", unit))
    _plain_ticks(ax)
    if narrow():
        figure.legend(loc="outside lower center", ncols=2, fontsize=small())
    else:
        figure.legend(loc="outside right center", fontsize=small())
    depth, depth_unit = display_unit("m", report.depth)
    heading(figure, results, f"Spectrum of the free surface, {text}")
    note = f"fn: linear theory of a liquid as deep as the fill was before the stage, {report.depth / depth:.4g} {depth_unit}"
    note += f"\nfn² = (n g/4πl) tanh(nπh/l); Hann window, resolution {1.0 / float(np.ptp(first[0])):.3g} Hz"
    footnote(figure, note + (f"\n{report.reason}" if report.reason else ""))
    return figure


def _record(time: Floats, values: Floats, window: tuple[float, float]) -> tuple[Floats, Floats]:
    """Rows within the window of time [s]; the end of one stage and the start of the next may be two of the same time."""
    inside = (time >= window[0] - 1e-9) & (time <= window[1] + 1e-9)
    time, row = np.unique(time[inside], return_index=True)
    return time, np.asarray(values, dtype=float)[inside][row]


def _mark(ax: Axes, report: Sloshing, theory: list[float], factor: float) -> None:
    """Lines at the frequencies of theory and of the shaking, and the oscillations that the report tells of."""
    for k, frequency in enumerate(theory):
        if math.isfinite(frequency):
            label = f"f{k + 1} = {frequency:.3g} Hz, linear theory"
            ax.axvline(frequency, color=LOOKS[k][0], ls=LOOKS[k][1], lw=0.8, alpha=0.55, label=label, zorder=1)
    if math.isfinite(report.thesis_T1):
        f = 1.0 / report.thesis_T1
        ax.axvline(f, color="0.45", ls=(0, (5, 2, 1, 2)), lw=0.8, label=f"{f:.3g} Hz, (7.2) of the thesis", zorder=1)
    if math.isfinite(report.driving_period):
        f = 1.0 / report.driving_period
        ax.axvline(f, color="black", lw=1.0, label=f"shaking, {f:.3g} Hz", zorder=1)
    if math.isfinite(report.period):
        label = f"strongest, {1.0 / report.period:.3g} Hz"
        ax.plot(1.0 / report.period, report.amplitude / factor, "o", color="black", ms=4.5, zorder=5, label=label)
    if math.isfinite(report.free_period) and report.free_period != report.period:
        label = f"strongest beside it, {1.0 / report.free_period:.3g} Hz"
        ax.plot(
            1.0 / report.free_period, report.free_amplitude / factor, "o", mfc="white", mec="black", ms=4.5, zorder=5, label=label
        )  # fmt: skip


def _plain_ticks(ax: Axes) -> None:
    """1, 2 and 5 of each decade, written as numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
