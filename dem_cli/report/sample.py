"""Picture of the sample at one instant: grains to scale and in colour, force chains and walls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli.report import bodies
from dem_cli.report.look import (
    CYCLIC,
    DIVERGING,
    SEQUENTIAL,
    Extend,
    axis_label,
    current,
    display_unit,
    extension,
    footnote,
    heading,
    largest,
    narrow,
    new_figure,
    place_text,
    stage_label,
)
from dem_cli.report.moments import BOUNDARY, AnyFrame, Box, frame_box, frames_of_stage
from dem_cli.report.quantities import QUANTITIES, Quantity
from dem_cli.report.strokes import (
    EDGE,
    EDGE_WIDTH,
    RASTER_ABOVE,
    draw_bonds,
    draw_lines,
    draw_marks,
    draw_outlines,
)
from dem_cli.results import Results
from dem_cli.state import Bools, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.figure import Figure

# Most grains that are drawn with an edge.
MOST_EDGES = 5000
# Colours of numbers that only tell grains apart.
PALETTE = ("#8DD3C7", "#FDDC8C", "#BEBADA", "#FB9A8B", "#80B1D3", "#FDB462", "#B3DE69")
# Of a grain without a value: a colour that the map has not.
UNDEFINED = {"cyclic": "0.65"}
# Mean radius [points] below which a grain is too small to be told from the line through it.
SMALL_RADIUS = 1.5


@dataclass(frozen=True)
class Look:
    """What is drawn, and how: color of QUANTITIES, `limits` of the colours in SI units (rotation: rad), None as the values ask.

    chains, bonds: lines as wide as the normal force, bars between elements of a grain; None: where grains are large enough. marks: a
    radius or half axis of each element.
    """

    color: str = "displacement"
    chains: bool | None = None
    bonds: bool | None = None
    marks: bool = False
    limits: tuple[float, float] | None = None

    @property
    def quantity(self) -> Quantity:
        return QUANTITIES[self.color]


@dataclass(frozen=True)
class Sight:
    """The scales of a picture, or of all pictures of a film. box: x0, x1, y0, y1 [m]; colors; widest: normal force [N] of the widest line."""

    box: Box
    colors: Colors
    widest: float

    @property
    def factor(self) -> float:
        """Unit of the axes [m]."""
        return display_unit("m", max(self.box[1] - self.box[0], self.box[3] - self.box[2]))[0]


def draw_sample(results: Results, index: int, look: Look) -> Figure:
    """Frame `index`. Displacement and rotation count from the first frame of the frame's stage. Escaped grains are left out."""
    frame = results.frame(index)
    begin = begin_of(results, index, frame) if look.quantity.since else frame
    shown = ~frame.grains.escaped
    values = values_of(results, frame, begin, look.quantity)[shown]
    forces = np.zeros(0) if frame.contacts is None else frame.contacts.normal
    box = view(results, frame)
    sight = Sight(box, colors_of(values, look, bounded=bool(results.boundary)), widest_of(forces))
    figure, ax = stage_set(sight, look)
    caption = paint(ax, results, frame, values, look, sight)
    heading(figure, results, text_of(results, index, frame))
    if caption:
        footnote(figure, caption)
    return figure


def text_of(results: Results, index: int, frame: AnyFrame) -> str:
    """When it is, and in which stage."""
    text = place_text(results, index)
    if 0 <= frame.stage < len(results.stages):
        text += f", {stage_label(frame.stage + 1, results.stages[frame.stage])}"
    return text


def values_of(results: Results, frame: AnyFrame, begin: AnyFrame, quantity: Quantity) -> Floats:
    """Of all elements, SI units; NaN of boundary grains. begin: the frame that its stage starts from."""
    values = np.array(quantity.values(frame, begin), dtype=float)  # a copy: what follows changes it
    if results.boundary:
        values[-results.boundary :] = np.nan
    return values


def begin_of(results: Results, index: int, frame: AnyFrame) -> AnyFrame:
    """The frame that the stage of frame `index` starts from."""
    first = first_frame_of_stage(results, frame.stage)
    return frame if first == index else results.frame(first)


def stage_set(sight: Sight, look: Look) -> tuple[Figure, Axes]:
    """A figure with empty axes and the colour bar."""
    from matplotlib.cm import ScalarMappable

    box = sight.box
    factor, unit = display_unit("m", max(box[1] - box[0], box[3] - box[2]))
    figure = new_figure(*_size(box))
    ax = figure.add_subplot()
    ax.set_aspect("equal")
    ax.spines[:].set_visible(False)  # the walls are the frame
    ax.set_xlim(box[0] / factor, box[1] / factor)
    ax.set_ylim(box[2] / factor, box[3] / factor)
    ax.set_xlabel(axis_label("x", unit))
    ax.set_ylabel(axis_label("y", unit))
    if look.quantity.kind != "label":
        _draw_bar(ax, ScalarMappable(sight.colors.norm, sight.colors.cmap), look.quantity, sight.colors)
    return figure, ax


def paint(ax: Axes, results: Results, frame: AnyFrame, values: Floats, look: Look, sight: Sight) -> str:
    """Grains, bonds, chains, marks and walls of a frame; values: of the grains that are shown. Returns the caption of the chains."""
    shown, factor = ~frame.grains.escaped, sight.factor
    _draw_grains(ax, frame, shown, values, look.quantity, sight)
    points = _points_per_meter(sight.box)
    radius = float(np.mean(frame.grains.radius)) * points
    large = radius >= SMALL_RADIUS
    if large if look.bonds is None else look.bonds:
        draw_bonds(ax, frame.grains, results.bonds, shown, factor, radius)
    chains = large if look.chains is None else look.chains
    caption = _draw_chains(ax, frame, factor, points, sight.widest) if chains else ""
    if look.marks:
        draw_marks(ax, frame.grains.take(shown), factor, radius)
    _draw_walls(ax, frame, sight.box, factor)
    return caption


def first_frame_of_stage(results: Results, stage: int) -> int:
    """Index of the frame nearest to the start of `stage` (0-based); 0 where the stage is unknown."""
    if not 0 <= stage < len(results.stages):
        return 0
    if results.axis == "increment":
        return int(frames_of_stage(results, stage + 1)[0])
    return int(np.argmin(np.abs(results.frame_times - results.stages[stage].start)))


def view(results: Results, frame: AnyFrame) -> Box:
    """What is drawn (x0, x1, y0, y1) [m]: the container up to the highest grain, with its top if that is
    near.
    """
    g, shown = frame.grains, ~frame.grains.escaped
    wide, high = bodies.reach(g)
    right = max(results.width, float(np.max((g.x + wide)[shown], initial=0.0)))
    left = min(0.0, float(np.min((g.x - wide)[shown], initial=0.0)))
    top = float(np.max((g.y + high)[shown], initial=0.0))
    bottom = min(0.0, float(np.min((g.y - high)[shown], initial=0.0)))
    if results.height is not None and results.height < 1.5 * top:
        top = max(top, results.height)
    top = max(top, 0.1 * results.width)
    if results.axis == "increment":  # walls move
        left, right, bottom, top = frame_box(frame)
    margin = 0.02 * max(right - left, top - bottom)
    return left - margin, right + margin, bottom - margin, top + margin


def _size(box: tuple[float, float, float, float]) -> tuple[float, float]:
    """Figure size [inch] that fits the view, with room for axes and colour bar."""
    aspect = (box[3] - box[2]) / (box[1] - box[0])
    beside, above = _room()
    own = current().width
    width = min(6.0 if own is None else own - beside, 8.0 / aspect)
    return max(width, 2.6) + beside if own is None else own, min(max(width * aspect, 1.6), 8.0) + above


def _room() -> tuple[float, float]:
    """What axes, colour bar and titles take of the figure's width and height [inch]."""
    return (1.5, 1.3) if current().titles else (0.55, 0.95) if narrow() else (1.1, 0.45)


def _points_per_meter(box: tuple[float, float, float, float]) -> float:
    wide, high = (size - room for size, room in zip(_size(box), _room(), strict=True))
    return (
        72.0
        * (wide if current().width is None else min(wide, high * (box[1] - box[0]) / (box[3] - box[2])))
        / (box[1] - box[0])
    )


@dataclass(frozen=True)
class Colors:
    """How values become colours: scale: SI value of the unit; arrows of the colour bar."""

    scale: float
    unit: str
    norm: Normalize
    cmap: Colormap
    extend: Extend


def colors_of(values: Floats, look: Look, *, bounded: bool = False) -> Colors:
    """For `values` (SI units) of one frame, or of many. bounded: there are boundary grains, which have a colour of their own."""
    quantity, limits = look.quantity, look.limits
    finite = values[np.isfinite(values)]
    if quantity.kind == "label":
        finite = finite % len(PALETTE)
    scale, unit = display_unit(quantity.unit, largest(finite) if limits is None else largest(np.array(limits)))
    ends = None if limits is None else np.array(limits) / scale
    norm, cmap, extend = value_colors(finite / scale, quantity.kind, ends)
    return Colors(scale, unit, norm, cmap.with_extremes(bad=BOUNDARY) if bounded else cmap, extend)


def _draw_grains(ax: Axes, frame: AnyFrame, shown: Bools, values: Floats, quantity: Quantity, sight: Sight) -> None:
    """values: of the grains that are shown; those without one, boundary grains among them, have the map's colour for bad ones."""
    from matplotlib.collections import EllipseCollection

    grains, factor, colors = frame.grains.take(shown), sight.factor, sight.colors
    if quantity.kind == "label":
        values = values % len(PALETTE)
    edges = grains.grain_count <= MOST_EDGES
    widths = np.full(len(grains), EDGE_WIDTH if edges else 0.0)
    widths[bodies.several(grains)] = 0.0
    ellipses: EllipseCollection = EllipseCollection(
        2.0 * grains.a / factor,
        2.0 * grains.b / factor,
        np.where(grains.a == grains.b, 0.0, np.degrees(grains.angle)),
        units="x",
        offsets=np.column_stack([grains.x, grains.y]) / factor,
        offset_transform=ax.transData,
        array=np.ma.masked_invalid(values / colors.scale),
        cmap=colors.cmap,
        norm=colors.norm,
        linewidths=widths,
        edgecolors=EDGE if edges else "none",
        rasterized=len(grains) > RASTER_ABOVE,
    )
    ax.add_collection(ellipses)
    if edges:
        draw_outlines(ax, grains, factor)


def _draw_bar(ax: Axes, mappable: ScalarMappable, quantity: Quantity, colors: Colors) -> None:
    # In a column of a page the label is longer than a low picture is high.
    place: Any = {"location": "bottom", "aspect": 40, "shrink": 0.9} if narrow() else {"aspect": 28, "pad": 0.02}
    bar = ax.figure.colorbar(mappable, ax=ax, extend=colors.extend, **place)
    label = quantity.label + (" since the stage began" if quantity.since else "")
    bar.set_label(axis_label(label, colors.unit))
    bar.outline.set_linewidth(0.5)
    if quantity.kind == "cyclic":
        bar.set_ticks([-90, -45, 0, 45, 90])
    if quantity.kind == "count":
        low, high = int(np.ceil(colors.norm.vmin or 0.0)), int(np.floor(colors.norm.vmax or 0.0))
        bar.set_ticks(list(range(low, high + 1, max(1, (high - low) // 8))))


def value_colors(values: Floats, kind: str, limits: Floats | None) -> tuple[Normalize, Colormap, Extend]:
    """Norm, colour map and arrows of the colour bar. Long tails are cut at the 99.5th percentile, shown by an
    arrow.
    """
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize

    if kind == "label":
        return Normalize(-0.5, len(PALETTE) - 0.5), ListedColormap(PALETTE), "neither"
    if len(values) == 0:
        values = np.zeros(1)
    lowest, highest = float(values.min()), float(values.max())
    if limits is not None:
        low, high = float(limits[0]), float(limits[1])
    elif kind == "cyclic":
        low, high = -90.0, 90.0
    elif kind == "signed":
        high = float(np.percentile(np.abs(values), 99.5))
        low = -high
    elif kind == "from-zero":
        low, high = 0.0, float(np.percentile(values, 99.5))
    else:
        low, high = lowest, highest
        if high - low <= 1e-9 * abs(high):
            low = high  # the same but for the last digits
    extend = extension(values, low, high)
    name = {"signed": DIVERGING, "cyclic": CYCLIC}.get(kind, SEQUENTIAL)
    cmap = colormaps[name].with_extremes(bad=UNDEFINED.get(kind, "white"))
    if kind == "count":
        edges = np.arange(np.floor(low), np.ceil(high) + 2.0) - 0.5
        # One colour a number; the map's 256 colours are spread over the bins.
        return BoundaryNorm(edges, 256, extend=extend), cmap, extend
    return Normalize(low, high), cmap, extend


def widest_of(forces: Floats) -> float:
    """Normal force [N] of the widest line."""
    return float(np.percentile(forces, 99.5)) if len(forces) else 0.0


def _draw_chains(ax: Axes, frame: AnyFrame, factor: float, points_per_meter: float, widest: float) -> str:
    """Lines from centre to centre of the grains (or to the wall), as wide as the normal force is large. Returns their caption.

    `widest` [N], the 99.5th percentile, is as wide as half a mean grain; forces below a fiftieth of it are left out, and where
    grains are drawn too small for a line to have an edge, those below the mean.
    """
    c = frame.contacts
    if c is None or len(c) == 0:
        return ""
    g = frame.grains
    radius = float(np.mean(g.radius)) * points_per_meter
    small = radius < SMALL_RADIUS
    keep = c.normal > (float(c.normal.mean()) if small else 0.02 * widest)
    if widest <= 0.0 or not keep.any():
        return ""
    i, j = c.i[keep], c.j[keep]
    to_wall = j < 0
    x, y = bodies.centers(g)
    other = np.maximum(j, 0)  # the number of a wall may be none of an element
    end_x = np.where(to_wall, c.px[keep], x[other])
    end_y = np.where(to_wall, c.py[keep], y[other])
    segments = np.stack([np.column_stack([x[i], y[i]]), np.column_stack([end_x, end_y])], axis=1) / factor
    width = min(radius, 5.0) * np.minimum(c.normal[keep] / widest, 1.0)
    if not small:
        # Dark lines on light ones stand out from every colour of the grains, in grey print too.
        draw_lines(ax, segments, width + np.minimum(width, 1.0), "white", "edges of chains")
    draw_lines(ax, segments, width, "#B2182B", "chains")
    scale, name = display_unit("N", widest)
    which = "normal forces above the mean" if small else "normal forces"
    return f"lines: {which}, the widest {widest / scale:.3g} {name} or more"


def _draw_walls(ax: Axes, frame: AnyFrame, box: tuple[float, float, float, float], factor: float) -> None:
    """Walls as lines; those without an end (their coordinate is infinite) end beyond the picture."""
    w = frame.walls
    far = 10.0 * max(box[1] - box[0], box[3] - box[2])
    x0, y0, x1, y1 = (np.clip(end, -far, far) / factor for end in (w.x0, w.y0, w.x1, w.y1))
    for k in range(len(w)):
        ax.plot([x0[k], x1[k]], [y0[k], y1[k]], color="black", lw=1.5)
