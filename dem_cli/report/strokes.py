"""Lines over grains: outlines of grains of several discs, bonds, marks that show how grains turn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dem_cli.report import bodies
from dem_cli.state import Bonds, Bools, Floats, Grains

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Above this number vector pictures hold the grains and lines as an image: a million paths open in no viewer.
RASTER_ABOVE = 20_000
MOST_PATHS = 4_000
EDGE, EDGE_WIDTH = "0.25", 0.25  # of a grain
BOND, MARK = "#1A1A1A", "black"


def draw_lines(ax: Axes, segments: Floats, width: Floats, colour: str, label: str) -> None:
    """Segments (n, 2, 2) of `width` (n,) points, the widest on top.

    They are gathered into at most MOST_PATHS paths of nearly the same width: a path each would take a minute
    for a million.
    """
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    order = np.argsort(width, kind="stable")
    size = -(-len(order) // MOST_PATHS)
    parts = [order[k : k + size] for k in range(0, len(order), max(size, 1))]
    codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=Path.code_type), size)
    paths = [Path(segments[part].reshape(-1, 2), codes[: 2 * len(part)]) for part in parts]
    lines = PathCollection(
        paths,
        linewidths=[float(width[part].mean()) for part in parts],
        edgecolors=colour,
        facecolors="none",
        capstyle="round",
        rasterized=len(width) > RASTER_ABOVE,
        label=label,
    )
    ax.add_collection(lines)


def draw_outlines(ax: Axes, grains: Grains, factor: float) -> None:
    """One outline around each grain of several discs, without what lies in another disc of the same grain."""
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    members = bodies.several(grains)
    if len(members) == 0:
        return
    x, y, radius = grains.x[members], grains.y[members], grains.radius[members]
    starts = np.flatnonzero(np.diff(grains.body[members], prepend=-1)).tolist()
    arcs, ends = [], []
    for start, stop in zip(starts, [*starts[1:], len(members)], strict=True):
        some = slice(start, stop)
        arcs += [(start + k, low, high) for k, low, high in bodies.open_arcs(x[some], y[some], radius[some])]
        ends.append(len(arcs))
    disc, low, high = (np.array(column) for column in zip(*arcs, strict=True))
    centre = np.stack([x[disc], y[disc]], axis=1)[:, None]
    points = (centre + radius[disc][:, None, None] * _curves(low, high)) / factor
    codes = np.full((len(arcs), points.shape[1]), Path.CURVE4, dtype=Path.code_type)
    codes[:, 0] = Path.MOVETO
    paths = [
        Path(points[one:two].reshape(-1, 2), codes[one:two].ravel()) for one, two in zip([0, *ends], ends, strict=False)
    ]
    ax.add_collection(
        PathCollection(
            paths,
            facecolors="none",
            edgecolors=EDGE,
            linewidths=EDGE_WIDTH,
            rasterized=len(members) > RASTER_ABOVE,
            label="outlines",
        )
    )


def _curves(low: Floats, high: Floats) -> Floats:
    """Arcs (m,) of the unit circle as cubic Bezier curves end to end, of 45 deg at most: shape (m, 1 + 3 * 8, 2)."""
    angle = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, 9)
    on = np.stack([np.cos(angle), np.sin(angle)], axis=2)
    arm = 4.0 / 3.0 * np.tan((high - low) / 32.0)[:, None, None] * np.stack([-on[..., 1], on[..., 0]], axis=2)
    rest = np.stack([on[:, :-1] + arm[:, :-1], on[:, 1:] - arm[:, 1:], on[:, 1:]], axis=2)
    return np.concatenate([on[:, :1], rest.reshape(len(low), -1, 2)], axis=1)


def draw_bonds(ax: Axes, grains: Grains, bonds: Bonds, shown: Bools, factor: float, radius: float) -> None:
    """Bars that join the elements of a grain, a fifth of the mean radius (`radius`, points) wide: between the centres of bonded elements;
    of a rigid clump, from each centre to the centre of mass.
    """
    i, j = bonds.i, bonds.j
    start, end = (np.column_stack([grains.x[k], grains.y[k]]) for k in (i, j))
    if len(bonds) == 0:
        i = j = bodies.several(grains)
        start, end = (np.column_stack([x[i], y[i]]) for x, y in ((grains.x, grains.y), bodies.centers(grains)))
    keep = shown[i] & shown[j]
    if keep.any():
        width = np.full(np.count_nonzero(keep), min(0.2 * radius, 3.0))
        draw_lines(ax, np.stack([start, end], axis=1)[keep] / factor, width, BOND, "bonds")


def draw_marks(ax: Axes, grains: Grains, factor: float, radius: float) -> None:
    """A line from the centre of each element along its semi-axis a: a radius of a disc, half the long axis of an ellipse."""
    centre = np.column_stack([grains.x, grains.y])
    end = centre + grains.a[:, None] * np.column_stack([np.cos(grains.angle), np.sin(grains.angle)])
    if len(grains):
        width = np.full(len(grains), float(np.clip(0.12 * radius, 0.2, 1.0)))
        draw_lines(ax, np.stack([centre, end], axis=1) / factor, width, MARK, "marks")
