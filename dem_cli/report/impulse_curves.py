"""Curves of runs of bodies in 3D: velocities beside the closed form, as in the article on impulse-based DEM, and the run-out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.impulse_checks import (
    MOST_BODIES,
    check_of,
    collided,
    drop_setting,
    pair_value,
    slide_setting,
)
from dem_cli.report.impulse_histories import History, histories
from dem_cli.report.impulse_runout import runout
from dem_cli.report.look import COLORS, axis_label, display_unit, heading, new_figure, small
from dem_cli.results import BodyResults
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLOSED = {"color": "black", "lw": 1.0, "ls": (0, (4, 2)), "zorder": 3}


def draw_check(results: BodyResults) -> Figure:
    """Velocity over time of the bodies of the check that the scenario names, with the closed form dashed."""
    kind = check_of(results)
    if not kind:
        raise ScenarioError(
            f'{results.path}: no closed form is known for this run; [output] check = "drop", "slope", "collision" or "row" names one'
        )
    if results.n_frames == 0 or not histories(results, [0]):
        raise ScenarioError(
            f"{results.path}: holds too little to draw; ask for [output] tracks or frames and run again"
        )
    if kind in ("drop", "slope") and len(results.planes) == 0:
        raise ScenarioError(f"{results.path}: has no plane to {'fall' if kind == 'drop' else 'slide'} on")
    figure = new_figure(6.6, 4.2)
    ax = figure.add_subplot()
    ax.axhline(0.0, color="0.7", lw=0.6, zorder=0)
    draw = {"drop": _drop, "slope": _slope, "collision": _collision, "row": _row}[kind]
    ylabel, text = draw(ax, results)
    ax.set_xlabel("t [s]")
    ax.set_ylabel(ylabel)
    ax.margins(x=0.0)
    ax.legend(fontsize=small())
    heading(figure, results, text)
    return figure


def _drop(ax: Axes, results: BodyResults) -> tuple[str, str]:
    closed, normal, plane = drop_setting(results, 0)
    history = histories(results, [0])[0]
    fine = np.linspace(0.0, float(history.time[-1] - history.time[0]), 4000)
    ax.plot(history.time, history.v @ normal, color=COLORS[0], label="body 0")
    ax.plot(history.time[0] + fine, closed.velocity(fine), label="closed form", **CLOSED)  # type: ignore[arg-type]
    return (
        "velocity along the normal [m/s]",
        f"Drop on {results.planes.name[plane]}, restitution {closed.restitution:g}",
    )


def _slope(ax: Axes, results: BodyResults) -> tuple[str, str]:
    angle = 0.0
    for k, (body, history) in enumerate(histories(results, list(range(min(results.grain_count, MOST_BODIES)))).items()):
        slide = slide_setting(results, body)
        angle = slide.angle
        ax.plot(
            history.time,
            history.v @ slide.along,
            color=COLORS[k % len(COLORS)],
            lw=2.0,
            alpha=0.8,
            label=f"body {body}, friction {slide.friction:g}",
        )
        label = "g (sin q - mu cos q) t" if k == 0 else None
        ax.plot(history.time, slide.velocity(history.time - history.time[0]), label=label, **CLOSED)  # type: ignore[arg-type]
    return "velocity downhill [m/s]", f"Slope of {math.degrees(angle):.4g} deg"


def _collision(ax: Axes, results: BodyResults) -> tuple[str, str]:
    found = histories(results, [0, 1])
    if len(found) < 2:
        raise ScenarioError(f"{results.path}: a collision needs two bodies")
    closing = found[0].v[0] - found[1].v[0]
    along = closing / max(float(np.linalg.norm(closing)), 1e-300)
    mass = results.scene.bodies.mass
    e = pair_value(results, results.restitution, 0, 1)
    after = collided((mass[0], mass[1]), (float(found[0].v[0] @ along), float(found[1].v[0] @ along)), e)
    for k in (0, 1):
        ax.plot(found[k].time, found[k].v @ along, color=COLORS[k], label=f"body {k}, {mass[k]:.4g} kg")
        ax.axhline(after[k], label="closed form after" if k == 0 else None, **CLOSED)  # type: ignore[arg-type]
    return "velocity along the approach [m/s]", f"Collision, restitution {e:g}"


def _row(ax: Axes, results: BodyResults) -> tuple[str, str]:
    last = results.grain_count - 1
    found = histories(results, [0, last])
    if len(found) < 2:
        raise ScenarioError(f"{results.path}: holds no histories of the first and the last body")
    along = _direction(found[0])
    for k, body in enumerate(found):
        label = "first body" if k == 0 else f"last body (no. {body})"
        ax.plot(found[body].time, found[body].v @ along, color=COLORS[k], label=label)
    return "velocity along that of the first [m/s]", f"Row of {results.grain_count} bodies"


def _direction(history: History) -> Floats:
    speed = float(np.linalg.norm(history.v[0]))
    return history.v[0] / speed if speed > 0.0 else np.array([1.0, 0.0, 0.0])


# ------------------------------------------------------------------------------------------------ run-out


def draw_runout(results: BodyResults) -> Figure:
    """Histogram of the horizontal distance of the bodies from where they started, its quantiles, and the share that went farther."""
    from matplotlib.ticker import MaxNLocator

    if results.n_frames < 2:
        raise ScenarioError(f"{results.path}: holds fewer than two frames; there is no way to measure")
    found = runout(results)
    scale, unit = display_unit("m", float(found.distance.max(initial=0.0)))
    distance = found.distance / scale
    figure = new_figure(6.8, 4.4)
    ax = figure.add_subplot()
    edges = np.histogram_bin_edges(distance, bins=min(30, max(5, round(math.sqrt(2.0 * len(distance))))))
    parts = [distance[~found.escaped], distance[found.escaped]]
    labels = [f"in the scene ({len(parts[0])})", f"escaped ({len(parts[1])}), where they left"]
    kept = [k for k in (0, 1) if len(parts[k])]
    ax.hist(
        [parts[k] for k in kept], edges.tolist(), stacked=True, color=[("#6BAED6", "#BDBDBD")[k] for k in kept], edgecolor="white",
        linewidth=0.5, label=[labels[k] for k in kept],
    )  # fmt: skip
    ax.set_xlabel(axis_label("horizontal distance from the start", unit))
    ax.set_ylabel("bodies")
    # One below the other, as both may be at one place.
    for share, height in ((50, 1.0), (90, 0.93)):
        value = float(np.percentile(distance, share))
        ax.axvline(value, color=COLORS[1], lw=1.0, ls=(0, (4, 2)))
        ax.annotate(
            f" {share} %",
            (value, height),
            xycoords=("data", "axes fraction"),
            va="top",
            color=COLORS[1],
            fontsize=small(),
        )
    right = ax.twinx()
    right.spines["right"].set_visible(True)
    order = np.sort(distance)
    right.step(
        np.concatenate([[edges[0]], order]),
        100.0 * (1.0 - np.arange(len(order) + 1) / len(order)),
        where="post",
        color="black",
        lw=0.9,
    )
    right.set_ylim(0.0, 105.0)
    right.set_ylabel("went farther [%] (line)")
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    figure.legend(loc="outside lower center", ncols=2, fontsize=small())
    angle = found.angle[np.isfinite(found.angle)]
    reach = f", angle of reach {math.degrees(float(np.median(angle))):.3g} deg (median)" if len(angle) else ""
    heading(figure, results, f"Run-out until t = {found.time:.6g} s{reach}")
    return figure
