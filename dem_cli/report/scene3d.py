"""Picture of bodies in 3D at one instant: shaded surfaces, planes, terrain, and chains of impulses."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.analysis.placed import by_shape, extent
from dem_cli.report.body_quantities import BODY_QUANTITIES, BodyQuantity
from dem_cli.report.camera import DEFAULT_VIEW, Camera, Paint, faces, strokes
from dem_cli.report.look import (
    axis_label,
    display_unit,
    footnote,
    heading,
    largest,
    new_figure,
    place_text,
    small,
    stage_label,
)
from dem_cli.report.pieces import draw_planes, lowered
from dem_cli.report.sample import PALETTE, first_frame_of_stage, value_colors
from dem_cli.report.solids import solid_of, subdivided
from dem_cli.report.strokes import draw_lines
from dem_cli.results import BodyResults, StoredBodyFrame
from dem_cli.rigid import Bodies, Shape, Terrain, rotation
from dem_cli.state import Bools, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

EARTH = np.array([0.80, 0.77, 0.71])
FLOOR = "#EEF0F2"
INK = "0.25"
RASTER_ABOVE = 8_000  # polygons of a vector picture
FINE = (
    (3, 40_000),
    (2, 250_000),
)  # subdivisions of spheres, and the triangles of all bodies together that they may make
CHAIN = "#B2182B"


@dataclass(frozen=True)
class View:
    """Camera, the window on its screen: left, right, bottom, top [m], and the height [m] at which walls end."""

    camera: Camera
    window: tuple[float, float, float, float]
    ceiling: float = math.inf


def draw_scene(
    results: BodyResults,
    index: int,
    *,
    color: str | None = None,
    chains: bool = False,
    limits: tuple[float, float] | None = None,
    view: View | None = None,
) -> Figure:
    """Frame `index`, bodies coloured by BODY_QUANTITIES[color]; `limits` of the colours in SI units. Escaped bodies are left out.

    view: by default as `view_of` has it for this frame. chains: contacts as lines, as wide as their normal impulse, through bodies that are
    then translucent.
    """
    frame = results.frame(index)
    view = view_of(results, [index]) if view is None else view
    shown = ~frame.bodies.escaped & np.isfinite(frame.bodies.x).all(axis=1)
    color = default_color(results) if color is None else color
    quantity = BODY_QUANTITIES[color]
    values, scale, unit = values_of(results, index, frame, quantity, limits)
    low, high, bottom, top = view.window
    width, height = _size(view.window)
    figure = new_figure(width + (0.0 if quantity.kind == "label" else 1.0), height + 0.55)
    ax = figure.add_subplot()
    ax.set_aspect("equal")
    ax.set_xlim(low, high)
    ax.set_ylim(bottom, top)
    ax.set_axis_off()
    grid = draw_planes(ax, lowered(results.planes, view.ceiling), view.camera)
    colors = _body_colors(figure, ax, results, quantity, values, scale, unit, shown, limits)
    painted = _paint_bodies(frame.bodies, results.scene_shapes, view.camera, shown, colors)
    if results.terrain is not None:
        painted.append(paint_terrain(results.terrain, view.camera, _mean_size(frame.bodies, results.scene_shapes)))
    _show(ax, Paint.together(painted), alpha=0.3 if chains else 1.0)
    notes = [grid] if grid else []
    if chains:
        notes.append(_draw_chains(ax, frame, shown, view))
    _draw_axes(ax, view)
    text = place_text(results, index)
    if 0 <= frame.stage < len(results.stages):
        text += f", {stage_label(frame.stage + 1, results.stages[frame.stage])}"
    heading(figure, results, text)
    if any(notes):
        caption = textwrap.fill("; ".join(note for note in notes if note), int(14.0 * figure.get_figwidth()))
        footnote(figure, caption)
    return figure


def default_color(results: BodyResults) -> str:
    """Kinds where there are several, else the displacement."""
    return "kind" if len(np.unique(results.scene.bodies.group)) > 1 else "displacement"


def values_of(
    results: BodyResults,
    index: int,
    frame: StoredBodyFrame,
    quantity: BodyQuantity,
    limits: tuple[float, float] | None,
) -> tuple[Floats, float, str]:
    """Values (n,) of a quantity in a frame, in the unit that they are shown in: its SI value and its name."""
    begin = frame
    if quantity.since:
        first = first_frame_of_stage(results, frame.stage)
        begin = frame if first == index else results.frame(first)
    values = np.asarray(quantity.values(frame, begin), dtype=float)
    scale, unit = display_unit(quantity.unit, largest(values if limits is None else np.array(limits)))
    return values / scale, scale, unit


def view_of(results: BodyResults, frames: list[int], angles: tuple[float, float] | None = None) -> View:
    """A view that holds the bodies of some frames, the planes' pieces and the terrain. angles: azimuth and elevation [deg]."""
    camera = Camera.at(*(DEFAULT_VIEW if angles is None else angles))
    corners = [] if results.terrain is None else [results.terrain.vertices]
    top = -math.inf
    for k in frames:
        bodies = results.frame(k).bodies
        present = bodies.take(~bodies.escaped & np.isfinite(bodies.x).all(axis=1))
        if len(present):
            low, high = extent(present, results.scene_shapes)
            ends = np.stack([low, high], axis=1)
            top = max(top, float(high[:, 2].max()))
            corners += [ends[:, [a, b, c]][:, [0, 1, 2], [0, 1, 2]] for a in (0, 1) for b in (0, 1) for c in (0, 1)]
    bottom = float(results.planes.edge[..., 2].min(initial=top))
    ceiling = top + 0.15 * (top - bottom) if top > bottom else math.inf
    corners.append(lowered(results.planes, ceiling).edge.reshape(-1, 3))
    points = camera.screen(np.concatenate(corners)) if sum(map(len, corners)) else np.array([[-1.0, -1.0], [1.0, 1.0]])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.03 * float((high - low).max()) + 1e-12
    return View(camera, (low[0] - margin, high[0] + margin, low[1] - margin, high[1] + margin), ceiling)


def _size(window: tuple[float, float, float, float]) -> tuple[float, float]:
    """Size of the axes [inch] that fits a window of the screen."""
    aspect = (window[3] - window[2]) / (window[1] - window[0])
    width = min(7.5, 6.0 / aspect)
    return max(width, 3.2), min(max(width * aspect, 1.6), 6.0)


def _mean_size(bodies: Bodies, shapes: tuple[Shape, ...]) -> float:
    return (
        float(np.mean(np.array([shape.reach for shape in shapes])[bodies.shape] * bodies.scale)) if len(bodies) else 1.0
    )


# ------------------------------------------------------------------------------------------------ bodies


def _body_colors(
    figure: Figure,
    ax: Axes,
    results: BodyResults,
    quantity: BodyQuantity,
    values: Floats,
    scale: float,
    unit: str,
    shown: Bools,
    limits: tuple[float, float] | None,
) -> Floats:
    """Colours (n, 3) of the bodies; adds the colour bar, or the names of the kinds."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.patches import Patch

    label = quantity.kind == "label"
    values = values % len(PALETTE) if label else values
    ends = None if limits is None else np.array(limits) / scale
    if ends is None and quantity.kind == "from-zero" and not largest(values[shown]) > 0.0:
        ends = np.array([0.0, 1.0])
    norm, cmap, extend = value_colors(values[shown & np.isfinite(values)], quantity.kind, ends)
    mapped = ScalarMappable(norm, cmap)
    if not label:
        bar = figure.colorbar(mapped, ax=ax, extend=extend, aspect=28, pad=0.02, shrink=0.85)
        bar.set_label(axis_label(quantity.label + (" since the stage began" if quantity.since else ""), unit))
        bar.outline.set_linewidth(0.5)
        if quantity.kind == "count":
            lowest, highest = int(np.ceil(norm.vmin or 0.0)), int(np.floor(norm.vmax or 0.0))
            bar.set_ticks(list(range(lowest, highest + 1, max(1, (highest - lowest) // 8))))
    elif quantity is BODY_QUANTITIES["kind"] and len(results.groups) > 1:
        handles = [Patch(color=PALETTE[k % len(PALETTE)], label=name) for k, name in enumerate(results.groups)]
        ax.legend(handles=handles, loc="upper right", fontsize=small())
    return np.asarray(mapped.to_rgba(np.ma.masked_invalid(values)), dtype=float)[:, :3]


def _paint_bodies(
    bodies: Bodies, shapes: tuple[Shape, ...], camera: Camera, shown: Bools, colors: Floats
) -> list[Paint]:
    found = []
    for k, some in by_shape(bodies, shown):
        shape = shapes[k]
        spheres = len(bodies) * len(shape.radii)
        fine = next((level for level, most in FINE if 20 * 4**level * spheres <= most), 1)
        solid = solid_of(shape, fine if shape.kind == "spheres" else (2 if len(bodies) < 2000 else 1))
        matrix, scale, x = rotation(bodies.q[some]), bodies.scale[some], bodies.x[some]

        def place(points: Floats, matrix: Floats = matrix, scale: Floats = scale, x: Floats = x) -> Floats:
            turned = np.einsum("mab,tcb->mtca", matrix, points)
            return np.asarray(x[:, None, None] + scale[:, None, None, None] * turned).reshape(-1, *points.shape[1:])

        normals = np.einsum("mab,tb->mta", matrix, solid.normals).reshape(-1, 3)
        found.append(
            faces(camera, place(solid.triangles), normals, np.repeat(colors[some], len(solid.triangles), axis=0))
        )
        if len(solid.edges):
            beside = np.einsum("mab,teb->mtea", matrix, solid.beside).reshape(-1, 2, 3)
            seen = (beside @ camera.toward > 1e-9).any(axis=1)
            forward = 0.25 * np.repeat(scale, len(solid.edges))[seen] * shape.reach
            found.append(strokes(camera, place(solid.edges)[seen], INK, 0.5, forward))
    return found


def paint_terrain(terrain: Terrain, camera: Camera, size: float) -> Paint:
    """A surface of earth under hill-shade, pushed back so that bodies of `size` [m] that lie on it are before it."""
    corners = terrain.vertices[terrain.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    normals = cross / np.where(area > 0.0, area, 1.0)[:, None]
    # The back of a surface is seen where one looks from below it; it is darker.
    behind = normals @ camera.toward < 0.0
    colors = np.tile(EARTH, (len(corners), 1)) * np.where(behind, 0.6, 1.0)[:, None]
    normals = np.where(behind[:, None], -normals, normals)
    cut, owner = subdivided(corners, max(4.0 * size, 0.01 * float(np.ptp(terrain.vertices, axis=0).max())))
    reach = np.linalg.norm(cut - cut.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    return faces(camera, cut, normals[owner], colors[owner], reach + size)


def _show(ax: Axes, paint: Paint, alpha: float) -> None:
    from matplotlib.collections import PolyCollection

    face, edge = paint.face.copy(), paint.edge.copy()
    if alpha < 1.0:
        face[:, 3] *= alpha
        edge[:, 3] *= np.where(paint.face[:, 3] > 0.0, 0.0, alpha)
    polygons = PolyCollection(
        paint.corners,  # type: ignore[arg-type]
        closed=True,
        facecolors=face,
        edgecolors=edge,
        linewidths=paint.width,
        rasterized=len(paint.corners) > RASTER_ABOVE,
        zorder=2,
        label="bodies",
    )
    ax.add_collection(polygons)


# ------------------------------------------------------------------------------------------------ what does not move


def _draw_axes(ax: Axes, view: View) -> None:
    """A small cross of axes in the lower left corner."""
    low, high, bottom, top = view.window
    size = 0.06 * max(high - low, top - bottom)
    origin = np.array([low + 1.2 * size, bottom + 1.2 * size])
    for k, name in enumerate("xyz"):
        way = view.camera.screen(np.eye(3)[k])
        if np.linalg.norm(way) < 0.15:
            continue
        end, place = origin + size * way, origin + 1.3 * size * way
        arrow = {"arrowstyle": "-|>", "lw": 0.8, "color": "0.2", "shrinkA": 0, "shrinkB": 0}
        ax.annotate(
            "", (float(end[0]), float(end[1])), (float(origin[0]), float(origin[1])), arrowprops=arrow, zorder=5
        )
        ax.text(
            float(place[0]), float(place[1]), name, fontsize=small(), ha="center", va="center", color="0.2", zorder=5
        )


def _draw_chains(ax: Axes, frame: StoredBodyFrame, shown: Bools, view: View) -> str:
    """Lines from centre to centre, or to the contact point on what does not move, as wide as the normal impulse. Returns their caption."""
    c, x = frame.contacts, frame.bodies.x
    if len(c) == 0:
        return "no contacts"
    along = np.einsum("ck,ck->c", c.impulse, c.normal)
    widest = float(np.percentile(along, 99.5))
    keep = (along > 0.02 * widest) & shown[c.i] & ((c.j < 0) | shown[np.maximum(c.j, 0)])
    if widest <= 0.0 or not keep.any():
        return "no impulses"
    end = np.where(c.j[:, None] < 0, c.point, x[np.maximum(c.j, 0)])
    segments = view.camera.screen(np.stack([x[c.i], end], axis=1)[keep])
    draw_lines(ax, segments, 4.0 * np.minimum(along[keep] / widest, 1.0), CHAIN, "chains")
    ax.collections[-1].set_zorder(4)
    force = widest / frame.dt if frame.dt > 0.0 else math.nan
    scale, unit = display_unit("N", force)
    return f"lines: mean normal forces of the step, the widest {force / scale:.3g} {unit} or more"
