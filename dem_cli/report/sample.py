"""Picture of the sample at one instant: grains to scale and in colour, force chains and walls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.report.look import (
    DIVERGING,
    SEQUENTIAL,
    Extend,
    axis_label,
    display_unit,
    extension,
    heading,
    largest,
    new_figure,
    stage_label,
)
from dem_cli.results import Results, StoredFrame
from dem_cli.state import Bools, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import EllipseCollection
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

# Above this number vector pictures hold the grains and chains as an image: a million paths open in no viewer.
RASTER_ABOVE = 20_000
MOST_PATHS = 4_000
# Mean radius [points] below which a grain is too small to be told from the line through it.
SMALL_RADIUS = 1.5


@dataclass(frozen=True)
class Quantity:
    """What grains can be coloured by: label, SI unit, values(frame, frame at the start of its stage) -> (n,).

    kind: "range" from smallest to largest, "from-zero", "signed" (symmetric about zero) or "count" (whole
    numbers).
    """

    label: str
    unit: str
    kind: str
    values: Callable[[StoredFrame, StoredFrame], Floats]
    since: bool = False


def _shear_stress(frame: StoredFrame, _: StoredFrame) -> Floats:
    xx, xy, yx, yy = frame.stress.T
    return np.asarray(np.hypot(0.5 * (xx - yy), 0.5 * (xy + yx)))


QUANTITIES: dict[str, Quantity] = {
    "radius": Quantity("radius", "m", "range", lambda f, _: f.grains.radius),
    "id": Quantity("number of the grain", "1", "range", lambda f, _: f.grains.id.astype(float)),
    "speed": Quantity("speed", "m/s", "from-zero", lambda f, _: np.hypot(f.grains.vx, f.grains.vy)),
    "spin": Quantity("angular velocity, anticlockwise", "rad/s", "signed", lambda f, _: f.grains.spin),
    "displacement": Quantity(
        "displacement",
        "m",
        "from-zero",
        lambda f, s: np.hypot(f.grains.x - s.grains.x, f.grains.y - s.grains.y),
        True,
    ),
    "displacement_x": Quantity("displacement in x", "m", "signed", lambda f, s: f.grains.x - s.grains.x, True),
    "displacement_y": Quantity("displacement in y", "m", "signed", lambda f, s: f.grains.y - s.grains.y, True),
    "rotation": Quantity(
        "rotation, anticlockwise", "rad", "signed", lambda f, s: f.grains.angle - s.grains.angle, True
    ),
    "coordination": Quantity("contacts of the grain", "1", "count", lambda f, _: f.coordination.astype(float)),
    "pressure": Quantity(
        "mean stress in the grain", "Pa", "from-zero", lambda f, _: 0.5 * (f.stress[:, 0] + f.stress[:, 3])
    ),
    "shear_stress": Quantity("largest shear stress in the grain", "Pa", "from-zero", _shear_stress),
    "stress_xx": Quantity("stress xx in the grain", "Pa", "from-zero", lambda f, _: f.stress[:, 0]),
    "stress_yy": Quantity("stress yy in the grain", "Pa", "from-zero", lambda f, _: f.stress[:, 3]),
    "stress_xy": Quantity(
        "stress xy in the grain", "Pa", "signed", lambda f, _: 0.5 * (f.stress[:, 1] + f.stress[:, 2])
    ),
}


def draw_sample(
    results: Results,
    index: int,
    *,
    color: str = "displacement",
    chains: bool | None = None,
    limits: tuple[float, float] | None = None,
) -> Figure:
    """Frame `index`, grains coloured by QUANTITIES[color]; `limits` of the colours in SI units (rotation:
    rad).

    Displacement and rotation count from the first frame of the frame's stage. Escaped grains are left out.
    """
    frame = results.frame(index)
    quantity = QUANTITIES[color]
    begin = frame
    if quantity.since:
        first = first_frame_of_stage(results, frame.stage)
        begin = frame if first == index else results.frame(first)
    shown = ~frame.grains.escaped
    values = np.asarray(quantity.values(frame, begin), dtype=float)[shown]

    box = _view(results, frame, shown)
    factor, unit = display_unit("m", max(box[1] - box[0], box[3] - box[2]))
    figure = new_figure(*_size(box))
    ax = figure.add_subplot()
    ax.set_aspect("equal")
    ax.spines[:].set_visible(False)  # the walls are the frame
    ax.set_xlim(box[0] / factor, box[1] / factor)
    ax.set_ylim(box[2] / factor, box[3] / factor)
    ax.set_xlabel(axis_label("x", unit))
    ax.set_ylabel(axis_label("y", unit))
    _draw_grains(ax, frame, shown, values, quantity, factor, limits)
    points = _points_per_meter(box)
    if chains is None:
        chains = float(np.mean(frame.grains.radius)) * points >= SMALL_RADIUS
    caption = _draw_chains(ax, frame, factor, points) if chains else ""
    _draw_walls(ax, frame, box, factor)
    text = f"t = {frame.time:.6g} s"
    if 0 <= frame.stage < len(results.stages):
        text += f", {stage_label(frame.stage + 1, results.stages[frame.stage])}"
    heading(figure, results, text)
    if caption:
        figure.supxlabel(caption, fontsize=8)
    return figure


def first_frame_of_stage(results: Results, stage: int) -> int:
    """Index of the frame nearest to the start of `stage` (0-based); 0 where the stage is unknown."""
    if not 0 <= stage < len(results.stages):
        return 0
    return int(np.argmin(np.abs(results.frame_times - results.stages[stage].start)))


def _view(results: Results, frame: StoredFrame, shown: Bools) -> tuple[float, float, float, float]:
    """What is drawn (x0, x1, y0, y1) [m]: the container up to the highest grain, with its top if that is
    near.
    """
    g = frame.grains
    right = max(results.width, float(np.max((g.x + g.radius)[shown], initial=0.0)))
    left = min(0.0, float(np.min((g.x - g.radius)[shown], initial=0.0)))
    top = float(np.max((g.y + g.radius)[shown], initial=0.0))
    bottom = min(0.0, float(np.min((g.y - g.radius)[shown], initial=0.0)))
    if results.height is not None and results.height < 1.5 * top:
        top = max(top, results.height)
    top = max(top, 0.1 * results.width)
    margin = 0.02 * max(right - left, top - bottom)
    return left - margin, right + margin, bottom - margin, top + margin


def _size(box: tuple[float, float, float, float]) -> tuple[float, float]:
    """Figure size [inch] that fits the view, with room for axes and colour bar."""
    aspect = (box[3] - box[2]) / (box[1] - box[0])
    width = min(6.0, 8.0 / aspect)
    return max(width, 2.6) + 1.5, min(max(width * aspect, 1.6), 8.0) + 1.3


def _points_per_meter(box: tuple[float, float, float, float]) -> float:
    width, _ = _size(box)
    return 72.0 * (width - 1.5) / (box[1] - box[0])


def _draw_grains(
    ax: Axes,
    frame: StoredFrame,
    shown: Bools,
    values: Floats,
    quantity: Quantity,
    factor: float,
    limits: tuple[float, float] | None,
) -> None:
    from matplotlib.collections import EllipseCollection

    grains = frame.grains.take(shown)
    finite = values[np.isfinite(values)]
    scale, unit = display_unit(quantity.unit, largest(finite) if limits is None else largest(np.array(limits)))
    norm, cmap, extend = _colors(finite / scale, quantity.kind, None if limits is None else np.array(limits) / scale)
    diameter = 2.0 * grains.radius / factor
    discs: EllipseCollection = EllipseCollection(
        diameter,
        diameter,
        np.zeros(len(grains)),
        units="x",
        offsets=np.column_stack([grains.x, grains.y]) / factor,
        offset_transform=ax.transData,
        array=np.ma.masked_invalid(values / scale),
        cmap=cmap,
        norm=norm,
        linewidths=0.25 if len(grains) <= 5000 else 0.0,
        edgecolors="0.25" if len(grains) <= 5000 else "none",
        rasterized=len(grains) > RASTER_ABOVE,
    )
    ax.add_collection(discs)
    bar = ax.figure.colorbar(discs, ax=ax, extend=extend, aspect=28, pad=0.02)
    label = quantity.label + (" since the stage began" if quantity.since else "")
    bar.set_label(axis_label(label, unit))
    bar.outline.set_linewidth(0.5)
    if quantity.kind == "count":
        low, high = int(np.ceil(norm.vmin or 0.0)), int(np.floor(norm.vmax or 0.0))
        bar.set_ticks(list(range(low, high + 1, max(1, (high - low) // 8))))


def _colors(values: Floats, kind: str, limits: Floats | None) -> tuple[Normalize, str, Extend]:
    """Norm, colour map and arrows of the colour bar. Long tails are cut at the 99.5th percentile, shown by an
    arrow.
    """
    from matplotlib.colors import BoundaryNorm, Normalize

    if len(values) == 0:
        values = np.zeros(1)
    lowest, highest = float(values.min()), float(values.max())
    if limits is not None:
        low, high = float(limits[0]), float(limits[1])
    elif kind == "signed":
        high = float(np.percentile(np.abs(values), 99.5))
        low = -high
    elif kind == "from-zero":
        low, high = 0.0, float(np.percentile(values, 99.5))
    else:
        low, high = lowest, highest
    extend = extension(values, low, high)
    cmap = DIVERGING if kind == "signed" else SEQUENTIAL
    if kind == "count":
        edges = np.arange(np.floor(low), np.ceil(high) + 2.0) - 0.5
        # One colour a number; the map's 256 colours are spread over the bins.
        return BoundaryNorm(edges, 256, extend=extend), cmap, extend
    return Normalize(low, high), cmap, extend


def _draw_chains(ax: Axes, frame: StoredFrame, factor: float, points_per_meter: float) -> str:
    """Lines from grain to grain (or to the wall), as wide as the normal force is large. Returns their caption.

    The 99.5th percentile is as wide as half a mean grain; forces below a fiftieth of it are left out, and where
    grains are drawn too small for a line to have an edge, those below the mean.
    """
    c = frame.contacts
    if c is None or len(c) == 0:
        return ""
    g = frame.grains
    radius = float(np.mean(g.radius)) * points_per_meter
    small = radius < SMALL_RADIUS
    widest = float(np.percentile(c.normal, 99.5))
    keep = c.normal > (float(c.normal.mean()) if small else 0.02 * widest)
    if widest <= 0.0 or not keep.any():
        return ""
    i, j = c.i[keep], c.j[keep]
    to_wall = j < 0
    end_x = np.where(to_wall, c.px[keep], g.x[j])
    end_y = np.where(to_wall, c.py[keep], g.y[j])
    segments = np.stack([np.column_stack([g.x[i], g.y[i]]), np.column_stack([end_x, end_y])], axis=1) / factor
    width = min(radius, 5.0) * np.minimum(c.normal[keep] / widest, 1.0)
    if not small:
        # Dark lines on light ones stand out from every colour of the grains, in grey print too.
        _draw_lines(ax, segments, width + np.minimum(width, 1.0), "white")
    _draw_lines(ax, segments, width, "#B2182B")
    scale, name = display_unit("N", widest)
    which = "normal forces above the mean" if small else "normal forces"
    return f"lines: {which}, the widest {widest / scale:.3g} {name} or more"


def _draw_lines(ax: Axes, segments: Floats, width: Floats, colour: str) -> None:
    """Segments (n, 2, 2) of `width` (n,) points, the widest on top.

    They are gathered into at most MOST_PATHS paths of nearly the same width: a path each would take a minute
    for a million.
    """
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    order = np.argsort(width, kind="stable")
    size = -(-len(order) // MOST_PATHS)
    parts = [order[k : k + size] for k in range(0, len(order), size)]
    codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=Path.code_type), size)
    paths = [Path(segments[part].reshape(-1, 2), codes[: 2 * len(part)]) for part in parts]
    lines = PathCollection(
        paths,
        linewidths=[float(width[part].mean()) for part in parts],
        edgecolors=colour,
        facecolors="none",
        capstyle="round",
        rasterized=len(width) > RASTER_ABOVE,
    )
    ax.add_collection(lines)


def _draw_walls(ax: Axes, frame: StoredFrame, box: tuple[float, float, float, float], factor: float) -> None:
    """Walls as lines; those without an end (their coordinate is infinite) end beyond the picture."""
    w = frame.walls
    far = 10.0 * max(box[1] - box[0], box[3] - box[2])
    x0, y0, x1, y1 = (np.clip(end, -far, far) / factor for end in (w.x0, w.y0, w.x1, w.y1))
    for k in range(len(w)):
        ax.plot([x0[k], x1[k]], [y0[k], y1[k]], color="black", lw=1.5)
