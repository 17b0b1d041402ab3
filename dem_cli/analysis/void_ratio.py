"""Solid area, void ratio and porosity of grains in a rectangle, with exact clipping (physics.md 1.8).

Both definitions of the void ratio are `void_ratio(total, solid)`:
whole fill    total = container width x mean surface height, solid = grains of the fill inside the container;
inner window  total = area of the window, solid = grains of the fill clipped by the window.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from dem_cli.analysis.bodies import outlines, single
from dem_cli.analysis.covered import covered_by_discs, covered_by_grains, shared_at_contacts
from dem_cli.state import Bools, Contacts, Grains


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


def solid_area(grains: Grains, member: Bools, contacts: Contacts, window: Rectangle) -> float:
    """Area [m^2] that the grains with member = True cover inside the window; member (n,) is the same for all elements of a grain.

    Exact for discs, for ellipses and for bodies of overlapping discs. Where two grains overlap the lens counts once: exactly for
    discs, for ellipses as in `clipping.lens_at_contact`. `contacts` must hold every pair that overlaps. Spots common to three grains
    would be taken off too often; between equal discs they need overlaps beyond 13 % of the diameter.
    """
    c, x, y, radius, body = contacts, grains.x, grains.y, grains.radius, grains.body
    outline = outlines(grains)
    sides = tuple(map(float, window))
    if single(grains) and not outline[1].any() and not outline[2].any():
        return float(covered_by_discs(x, y, radius, member, c.i, c.j, *sides))
    solid = covered_by_grains(x, y, radius, *outline, body, member, *sides)
    shared = shared_at_contacts(
        x, y, radius, *outline, body, member, c.i, c.j, c.nx, c.ny, c.px, c.py, c.overlap, *sides
    )
    return float(solid - shared)


def void_ratio(total: float, solid: float) -> float:
    """Voids over solids; NaN without solids."""
    return (total - solid) / solid if solid > 0.0 else math.nan


def porosity(total: float, solid: float) -> float:
    """Voids over total; NaN without a total."""
    return (total - solid) / total if total > 0.0 else math.nan
