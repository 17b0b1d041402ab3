"""What can be seen of a picture's text: whether it lies on the page, and whether labels run into each other."""

from __future__ import annotations

from itertools import combinations
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

SLACK = 1.0  # points that boxes of two texts may share, as they hold the room of accents and descenders


def texts(figure: Figure) -> list[tuple[str, Bbox]]:
    """Every text that is drawn and its box [pixels], tick labels of what is in view among them."""
    figure.draw_without_rendering()
    found = [*figure.texts]  # titles of the figure among them
    for legend in figure.legends:
        found += legend.get_texts()
    for ax in figure.axes:
        found += _of_axes(ax)
        for child in ax.child_axes:
            found += _of_axes(child)
    return [
        (one.get_text(), one.get_window_extent())
        for one in found
        if one is not None and one.get_visible() and one.get_text().strip()
    ]


def _of_axes(ax: Any) -> list[Any]:
    if not ax.get_visible():
        return []
    found = [*ax.texts, ax.title]
    legend = ax.get_legend() if isinstance(ax, Axes) else None
    found += [] if legend is None else legend.get_texts()
    if not ax.axison:
        return found
    for axis in (ax.xaxis, ax.yaxis):
        if not axis.get_visible():
            continue
        low, high = sorted(axis.get_view_interval())
        room = 1e-6 * (high - low)
        shown = [tick for tick in axis.get_major_ticks() if low - room <= tick.get_loc() <= high + room]
        found += [label for tick in shown for label in (tick.label1, tick.label2)]
        found.append(axis.label)
    return found


def clashes(figure: Figure) -> list[str]:
    """Texts that reach over the edge of the page, and pairs of them that overlap."""
    found = texts(figure)
    page = figure.bbox
    slack = SLACK * figure.dpi / 72.0
    wrong = [
        f"over the edge: {text!r}"
        for text, box in found
        if box.x0 < page.x0 - slack or box.y0 < page.y0 - slack or box.x1 > page.x1 + slack or box.y1 > page.y1 + slack
    ]
    for (one, a), (two, b) in combinations(found, 2):
        wide = min(a.x1, b.x1) - max(a.x0, b.x0)
        high = min(a.y1, b.y1) - max(a.y0, b.y0)
        if wide > slack and high > slack:
            wrong.append(f"{one!r} on {two!r}")
    return wrong
