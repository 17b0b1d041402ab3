"""Solid area, void ratio and porosity of discs in a rectangle, with exact clipping (physics.md 1.8).

Both definitions of the void ratio are `void_ratio(total, solid)`:
whole fill    total = container width x mean surface height, solid = grains of the fill inside the container;
inner window  total = area of the window, solid = grains of the fill clipped by the window.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from dem_cli.analysis.clipping import disc_in_rectangle, lens_in_rectangle
from dem_cli.jit import kernel
from dem_cli.state import Bools, Contacts, Floats


class Rectangle(NamedTuple):
    """x0 <= x <= x1, y0 <= y <= y1 [m]; sides may be infinite."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def area(self) -> float:
        return max(0.0, self.x1 - self.x0) * max(0.0, self.y1 - self.y0)


class WindowMargins(NamedTuple):
    """Distance of the inner window from side walls (share of the width), floor and surface (shares of the
    fill depth).
    """

    side: float = 0.1
    bottom: float = 0.1
    top: float = 0.2


def container(width: float) -> Rectangle:
    """The inside of the container, open at the top: what grains have pressed into a wall is no solid of
    the fill.
    """
    return Rectangle(0.0, 0.0, width, math.inf)


def inner_window(width: float, depth: float, margins: WindowMargins) -> Rectangle:
    """The window away from walls and surface of a fill that is at least `depth` [m] high."""
    side = margins.side * width
    return Rectangle(side, margins.bottom * depth, width - side, (1.0 - margins.top) * depth)


@kernel()
def _solid_area(x, y, radius, member, i, j, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    solid = 0.0
    for k in range(len(x)):
        if member[k]:
            solid += disc_in_rectangle(x[k], y[k], radius[k], x0, y0, x1, y1)
    for c in range(len(i)):
        a, b = i[c], j[c]
        if b >= 0 and member[a] and member[b]:
            solid -= lens_in_rectangle(x[a], y[a], radius[a], x[b], y[b], radius[b], x0, y0, x1, y1)
    return solid


def solid_area(x: Floats, y: Floats, radius: Floats, member: Bools, contacts: Contacts, window: Rectangle) -> float:
    """Area [m^2] that the grains with member = True cover inside the window; arrays of shape (n,).

    Where two grains overlap the lens counts once. `contacts` must hold every pair that overlaps. Spots
    common to three discs would be taken off too often; between equal discs they need overlaps beyond 13 %
    of the diameter.
    """
    return float(_solid_area(x, y, radius, member, contacts.i, contacts.j, *map(float, window)))


def void_ratio(total: float, solid: float) -> float:
    """Voids over solids; NaN without solids."""
    return (total - solid) / solid if solid > 0.0 else math.nan


def porosity(total: float, solid: float) -> float:
    """Voids over total; NaN without a total."""
    return (total - solid) / total if total > 0.0 else math.nan
