"""Ranked dissipation, as in Kishino's figure 17, and a page with all figures of a shear test."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.look import COLORS, footnote, heading, narrow, new_figure
from dem_cli.report.moments import frame_box
from dem_cli.report.shear_curves import (
    Curve,
    curve,
    draw_panel,
    panel_coordination,
    panel_dissipation,
    panel_energy,
    panel_share,
    stress_panels,
)
from dem_cli.report.shear_forces import (
    Moment,
    force_note,
    largest_force,
    panel_forces,
    panel_rose,
    rose,
    stage_text,
    start_and_peak,
    within_text,
)
from dem_cli.report.shear_rows import Rows, one_shear_stage, row_of_turn, shown_peak
from dem_cli.results import Results
from dem_cli.results.schema import RANKS
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes


MOST = 0.99  # of an increment's dissipation
LEAST = 1e-3  # share below which a contact is left out of the picture


def chosen_rows(rows: Rows) -> list[tuple[str, int]]:
    """Rows whose dissipation is shown: the first increment, the turn of the volume change, the peak, the one after it.

    Without a turn or a peak of its own: evenly spread ones.
    """
    last = len(rows["in_stage"]) - 1
    peak = shown_peak(rows)
    turn = row_of_turn(rows) if peak is not None else None
    found = {1: "first"}
    if turn is not None and 0 < turn < last:
        found.setdefault(turn, "turn")
    if peak is not None:
        found.setdefault(peak, "peak")
        if peak < last:
            found.setdefault(peak + 1, "after the peak")
    for k in (last // 2, last, last // 4):
        if len(found) < 4 and k > 0:
            found.setdefault(k, "")
    return [(name, k) for k, name in sorted(found.items())][:4]


def shares(results: Results, increment: float) -> Floats:
    """Shares of the contacts that dissipate most in an increment, falling, without those that are nothing; at most RANKS."""
    table = results.dissipation
    row = np.zeros(0, dtype=np.int64) if table is None else np.flatnonzero(table.increment == increment)
    if table is None or len(row) == 0:
        return np.zeros(0)
    found = table.share[row[0]]
    return np.asarray(found[np.isfinite(found) & (found > 0.0)])


def line_of(share: Floats) -> tuple[float, float] | None:
    """a, b of log N = a + b log P through the points (P_N, N), least squares over the contacts that make MOST of the whole together.

    None for fewer than three.
    """
    share = share[: int(np.count_nonzero(np.cumsum(share) < MOST)) + 1]
    if len(share) < 3 or np.ptp(np.log(share)) == 0.0:
        return None
    b, a = np.polyfit(np.log(share), np.log(np.arange(1, len(share) + 1)), 1)
    return float(a), float(b)


def panel_ranked(ax: Axes, share: Floats, line: tuple[float, float] | None, title: str) -> None:
    """Number of contacts with at least the share P of an increment's dissipation; the line of the first increment."""
    if line is not None:
        n = np.array([0.7, 1.4 * RANKS])
        ax.plot(
            100.0 * np.exp((np.log(n) - line[0]) / line[1]),
            n,
            color="0.5",
            lw=0.9,
            ls=(0, (4, 2)),
            label="first increment",
        )
    ax.plot(
        100.0 * share,
        np.arange(1, len(share) + 1),
        "o",
        color=COLORS[0],
        ms=3.2,
        mec="white",
        mew=0.3,
        label="contacts",
    )
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_ylim(0.8, 1.3 * RANKS)
    ax.set_yticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    ax.set_yticks([], minor=True)
    ax.set_title(title)


def ranked_panels(results: Results, one: Curve) -> list[tuple[Floats, str]]:
    """Shares and titles of the increments that are shown; shares in ascending order of rank."""
    found = []
    for name, k in chosen_rows(one.rows):
        number = int(one.rows["in_stage"][k])
        found.append((shares(results, one.rows["increment"][k]), f"{name + ', ' if name else ''}increment {number}"))
    return found


def draw_ranked(results: Results, number: int | None) -> Figure:
    """Figure 17: four increments, on log-log axes, with the straight line of the first."""
    stage = one_shear_stage(results, number)
    one = curve(results, stage)
    panels = ranked_panels(results, one)
    if not any(len(share) for share, _ in panels):
        raise ScenarioError(f"{results.path}: nothing slides in stage {stage}, there is no dissipation to rank")
    figure = new_figure(6.4, 5.8)
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    _ranked(list(axes.ravel()), panels)
    for ax in axes[-1]:
        ax.set_xlabel("share P [%]" if narrow() else "share P in the dissipation [%]")
    for ax in axes[:, 0]:
        ax.set_ylabel("contacts with share P or more")
    heading(figure, results, f"Ranked dissipation, {stage_text(results, number)}")
    footnote(figure, "dashed: straight line of best fit of the first increment")
    return figure


def _ranked(axes: list[Axes], panels: list[tuple[Floats, str]]) -> None:
    line = line_of(panels[0][0])
    for ax, (share, title) in zip(axes, panels, strict=False):
        panel_ranked(ax, share, line, title)
        ax.set_xlim(70.0 * LEAST, 140.0)
    for ax in axes[len(panels) :]:
        ax.set_visible(False)


# ---------------------------------------------------------------------------------------------- the page


def draw_page(results: Results, number: int | None) -> Figure:
    """All figures of one stage on a page: forces and roses at the start and the peak, curves, ranked dissipation."""
    import matplotlib

    with matplotlib.rc_context(
        {"font.size": 7.0, "axes.titlesize": 7.5, "lines.linewidth": 0.9, "legend.fontsize": 6.5}
    ):
        return _page(results, number)


def _page(results: Results, number: int | None) -> Figure:
    one = curve(results, one_shear_stage(results, number))
    moments = start_and_peak(results, number)
    figure = new_figure(8.27, 11.69, rigid=True, page=True)
    rows = figure.add_gridspec(6, 1, height_ratios=[3.0, 1.75, 1.6, 1.65, 1.65, 1.4])
    boundary = results.boundary
    frames = [m.frame for m in moments]
    largest = largest_force(frames)
    views = [frame_box(frame) for frame in frames]
    size = (max(v[1] - v[0] for v in views), max(v[3] - v[2] for v in views))
    top = rows[0].subgridspec(1, 2)
    for k, m in enumerate(moments):
        ax = figure.add_subplot(top[k])
        panel_forces(ax, m.frame, largest, boundary, size)
        ax.set_title(f"Contact forces: {m.text}")
    _page_roses(figure, rows[1].subgridspec(1, 4), moments, int(one.rows["axial"][-1]))
    names = stress_panels([one])
    stress = rows[2].subgridspec(1, min(len(names), 3))
    for k, name in enumerate(names[:3]):
        draw_panel(figure.add_subplot(stress[k]), name, [one])
    middle, lower = rows[3].subgridspec(1, 2), rows[4].subgridspec(1, 2)
    panel_coordination(figure.add_subplot(middle[0]), one)
    panel_energy(figure.add_subplot(middle[1]), one)
    panel_dissipation(figure.add_subplot(lower[0]), one, results.depth)
    panel_share(figure.add_subplot(lower[1]), one)
    last = rows[5].subgridspec(1, 4)
    axes = [figure.add_subplot(last[k]) for k in range(4)]
    _ranked(axes, ranked_panels(results, one))
    for k, ax in enumerate(axes):
        ax.set_xlabel("share P [%]")
        if k:
            ax.tick_params(labelleft=False)
    axes[0].set_ylabel("contacts with\nshare P or more")
    heading(figure, results, stage_text(results, number))
    note = (
        force_note(largest, boundary)
        + "; dots: peak of s1/s2; strokes: collapses\nroses: percent in sectors of 10°, contacts with walls count half"
    )
    footnote(figure, note, 6.5)
    return figure


def _page_roses(figure: Figure, places: Any, moments: list[Moment], axial: int) -> None:
    """Normals and elastic energy, each at the start and at the peak."""
    for k, energy in enumerate((False, True)):
        found = [rose(m.frame, energy=energy) for m in moments]
        top = 1.08 * max(1e-9, *(float(np.nanmax(values, initial=0.0)) for values in found))
        for n, (m, values) in enumerate(zip(moments, found, strict=True)):
            ax: PolarAxes = figure.add_subplot(places[2 * k + n], projection="polar")  # type: ignore[assignment]
            panel_rose(ax, values, top, found[0] if n else None, small=True)
            ax.set_title(f"{'Energy' if energy else 'Normals'}, {m.name}", pad=5)
            ax.set_xlabel(within_text(m.frame, axial, energy=energy), labelpad=3)
