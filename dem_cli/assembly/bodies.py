"""Outlines of grains as packings see them: elements in the frame of each grain, as arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.state import Floats, Grains, Ints


class Bodies(NamedTuple):
    """Grains made of elements (discs and ellipses), each at the origin of its own frame and not turned.

    start (g + 1,): the elements of grain k are start[k]:start[k + 1]. ox oy [m], turn [rad], a b [m] (elements,): place of an element
    in its grain's frame, angle of its semi-axis a, semi-axes a >= b. owner (elements,): its grain. reach (g,) [m]: no point of the
    grain is further from its origin. area (g,) [m^2]: of the solid, what elements share counted once.
    round (g,): the grain is a disc about its origin, turning it changes nothing.
    """

    start: Ints
    ox: Floats
    oy: Floats
    turn: Floats
    a: Floats
    b: Floats
    owner: Ints
    reach: Floats
    area: Floats
    round: Floats

    @classmethod
    def of(cls, grains: Grains, area: Floats) -> Bodies:
        """From elements whose grains all have their origin at (0, 0) and stand at angle 0; area (g,) [m^2] of each grain."""
        count = grains.grain_count
        start = np.searchsorted(grains.body, np.arange(count + 1)).astype(np.int64)
        away = np.hypot(grains.x, grains.y)
        lone = np.diff(start) == 1
        first = start[:-1]
        return cls(
            start=start,
            ox=grains.x.copy(),
            oy=grains.y.copy(),
            turn=grains.angle.copy(),
            a=grains.a.copy(),
            b=grains.b.copy(),
            owner=grains.body.astype(np.int64),
            reach=np.maximum.reduceat(away + grains.a, first),
            area=np.array(area, dtype=float),
            round=(lone & (away[first] == 0.0) & (grains.a[first] == grains.b[first])).astype(float),
        )

    def scaled(self, factor: float) -> Bodies:
        """The same grains, `factor` times as large."""
        lengths = {name: getattr(self, name) * factor for name in ("ox", "oy", "a", "b", "reach")}
        return self._replace(**lengths, area=self.area * factor**2)

    def take(self, grains: Ints) -> Bodies:
        """Only the grains of these numbers, in their order."""
        many = np.diff(self.start)[grains]
        start = np.concatenate([[0], np.cumsum(many)])
        elements = np.repeat(self.start[grains] - start[:-1], many) + np.arange(start[-1])
        return Bodies(
            start=start,
            ox=self.ox[elements],
            oy=self.oy[elements],
            turn=self.turn[elements],
            a=self.a[elements],
            b=self.b[elements],
            owner=np.repeat(np.arange(len(grains)), many),
            reach=self.reach[grains],
            area=self.area[grains],
            round=self.round[grains],
        )

    @property
    def number(self) -> int:
        """Number of grains."""
        return len(self.reach)

    @property
    def solid(self) -> float:
        """Area of all grains [m^2]."""
        return float(self.area.sum())
