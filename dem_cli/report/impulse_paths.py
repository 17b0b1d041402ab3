"""Pictures of followed bodies in 3D: their ways in plan and in section, and their displacement and turn over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.body_quantities import turn
from dem_cli.report.look import COLORS, axis_label, display_unit, heading, largest, mark_size, narrow, new_figure, small
from dem_cli.report.tracked import MOST_PANELS
from dem_cli.results import BodyResults
from dem_cli.rigid import Terrain
from dem_cli.state import Floats, Ints

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DASHES = ("-", (0, (5, 1.5)), (0, (5, 1, 1, 1)))  # of x, y and z
MOST_PATHS = 200  # of bodies followed by frames alone


@dataclass(frozen=True)
class BodyPaths:
    """Followed bodies: ids (g,), time (t,) [s], x (t, g, 3) [m], q (t, g, 4)."""

    ids: Ints
    time: Floats
    x: Floats
    q: Floats


def body_paths(results: BodyResults, window: tuple[float, float], bodies: Sequence[int] | None) -> BodyPaths:
    """Of `bodies` within `window` [s], by default those with tracks, or the first MOST_PATHS, by frames, where there are none.

    ScenarioError if the file does not hold them.
    """
    tracks = results.tracks
    followed = [] if tracks is None or len(tracks.time) == 0 else tracks.ids.tolist()
    wanted = list(bodies) if bodies is not None else followed or list(range(min(results.grain_count, MOST_PATHS)))
    strange = [number for number in wanted if not 0 <= number < results.grain_count]
    if strange:
        raise ScenarioError(
            f"{results.path}: has no body {', '.join(map(str, strange))}, only 0 to {results.grain_count - 1}"
        )
    if tracks is not None and set(wanted) <= set(followed):
        columns = [followed.index(number) for number in wanted]
        time = np.asarray(tracks.time)
        x, q = (
            np.stack([tracks.arrays[name][:, columns] for name in names], axis=2)
            for names in (("x", "y", "z"), ("q0", "q1", "q2", "q3"))
        )
    else:
        states = [results.frame(k).bodies for k in range(results.n_frames)]
        time = results.frame_times
        x, q = (np.array([getattr(state, name)[wanted] for state in states]) for name in ("x", "q"))
    inside = (time >= window[0] - 1e-9) & (time <= window[1] + 1e-9)
    if np.count_nonzero(inside) < 2:
        raise ScenarioError(
            f"{results.path}: holds fewer than two instants of bodies between {window[0]:g} and {window[1]:g} s"
        )
    return BodyPaths(np.array(wanted, dtype=np.int64), time[inside], x[inside], q[inside])


def draw_trajectories(
    results: BodyResults, window: tuple[float, float], text: str, bodies: Sequence[int] | None = None
) -> Figure:
    """Ways in plan (left, over height lines of the terrain) and in section along the mean way (right, over the terrain's profile)."""
    found = body_paths(results, window, bodies)
    plan = found.x[..., :2]
    way = (plan[-1] - plan[0]).mean(axis=0)
    along = way / np.linalg.norm(way) if np.linalg.norm(way) > 1e-12 else np.array([1.0, 0.0])
    origin = plan[0].mean(axis=0)
    section = (plan - origin) @ along
    figure = new_figure(*((5.0, 7.0) if narrow() else (10.0, 4.6)))
    left, right = figure.subplots(2, 1) if narrow() else figure.subplots(1, 2)
    if results.terrain is not None:
        _draw_terrain(left, right, results.terrain, origin, along, section)
    for k, number in enumerate(found.ids.tolist()):
        color = COLORS[k % len(COLORS)] if len(found.ids) <= len(COLORS) else COLORS[0]
        label = f"No. {number}" if len(found.ids) <= len(COLORS) else None
        _draw_way(left, plan[:, k, 0], plan[:, k, 1], color, label)
        _draw_way(right, section[:, k], found.x[:, k, 2], color, None)
    for ax, across, up in ((left, "x", "y"), (right, "distance along the mean way", "z")):
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_xlabel(f"{across} [m]")
        ax.set_ylabel(f"{up} [m]")
    left.set_title("plan")
    right.set_title("section")
    if len(found.ids) <= len(COLORS):
        left.legend(fontsize=small())
    heading(figure, results, f"Trajectories of {len(found.ids)} {'body' if len(found.ids) == 1 else 'bodies'}, {text}")
    return figure


def _draw_way(ax: Axes, x: Floats, y: Floats, color: str, label: str | None) -> None:
    """A way from its ring to its dot."""
    ax.plot(x, y, color=color, lw=0.9, label=label)
    ax.plot(x[0], y[0], "o", ms=mark_size(4.5), mfc="white", mec=color, mew=0.9)
    ax.plot(x[-1], y[-1], "o", ms=mark_size(3.5), color=color)


def _draw_terrain(left: Axes, right: Axes, terrain: Terrain, origin: Floats, along: Floats, section: Floats) -> None:
    """Height lines in plan; in section the profile under the mean way."""
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    x, y, z = terrain.vertices.T
    corners = terrain.vertices[terrain.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    flat = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-12 * np.ptp(x) * np.ptp(y)
    grid = Triangulation(x, y, terrain.triangles[flat])
    left.tricontour(grid, z, levels=12, colors="0.72", linewidths=0.5, zorder=0)
    margin = 0.05 * float(np.ptp(section)) + 1e-9
    places = np.linspace(section.min() - margin, section.max() + margin, 400)
    try:
        heights = LinearTriInterpolator(grid, z)(*(origin[:, None] + along[:, None] * places))
    except RuntimeError:  # an overhanging surface has no single height
        return
    profile = np.ma.filled(heights, np.nan)
    right.plot(places, profile, color="0.45", lw=1.0, zorder=0)
    if np.isfinite(profile).any():
        right.fill_between(places, profile, np.nanmin(profile) - 0.03 * np.ptp(z), color="#E4DFD6", lw=0, zorder=0)


def draw_histories(
    results: BodyResults, window: tuple[float, float], text: str, bodies: Sequence[int] | None = None
) -> Figure:
    """One panel a body: displacement in x, y and z (left axis) and the angle it has turned by (right axis) from the start of the window."""
    found = body_paths(results, window, bodies)
    count = min(len(found.ids), MOST_PANELS)
    moved = (found.x - found.x[0])[:, :count]
    turned = np.degrees(turn(found.q, found.q[0])[:, :count])
    factor, unit = display_unit("m", largest(moved))
    columns = min(count, 3)
    rows = -(-count // columns)
    figure = new_figure(2.9 * columns + 1.2, 1.8 * rows + 1.1)
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    lines = []
    for k, ax in enumerate(axes.flat):
        if k >= count:
            ax.set_axis_off()
            continue
        right = ax.twinx()
        right.spines["right"].set_visible(True)
        right.set_ylim(0.0, 190.0)
        right.set_yticks([0, 90, 180])
        lines = [
            *(
                ax.plot(found.time, moved[:, k, n] / factor, color=COLORS[n], ls=DASHES[n], label=name)[0]
                for n, name in enumerate("xyz")
            ),
            *right.plot(found.time, turned[:, k], color="0.45", ls=(0, (1, 1)), label="turned by (right)"),
        ]
        ax.set_title(f"No. {found.ids[k]}")
        if k % columns == 0:
            ax.set_ylabel(axis_label("displacement", unit))
        if k + columns >= count:
            ax.set_xlabel("t [s]")
            ax.tick_params(labelbottom=True)
        if (k + 1) % columns and k + 1 < count:
            right.tick_params(labelright=False)
        else:
            right.set_ylabel("turned by [deg]")
    axes.flat[0].set_xlim(found.time[0], found.time[-1])
    figure.legend(handles=lines, loc="outside lower center", ncols=4)
    more = f" (first {count} of {len(found.ids)})" if len(found.ids) > count else ""
    heading(figure, results, f"Displacements of bodies, {text}{more}")
    return figure
