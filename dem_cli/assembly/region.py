"""The region that a packing fills, and what it made of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dem_cli.errors import ScenarioError
from dem_cli.state import Floats

# Told about every quarter of a second of work what a packing is at; may raise KeyboardInterrupt.
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Region:
    """The container's width, the height that is asked for, the height that must not be exceeded [m], and the area of all grains [m^2]."""

    width: float
    height: float
    highest: float
    solid: float

    def raised(self, height: float, method: str) -> float:
        """`height`, which a packing cannot do without. ScenarioError if it is beyond the highest."""
        if height <= self.highest * (1.0 + 1e-12):
            return height
        raise ScenarioError(
            f"[packing] method = {method}: the grains do not fit: the height is {self.highest:g} m, which would be a void ratio of "
            f"{self.void_ratio(self.highest):.3g}. Raise the lid, or take fewer grains or a denser method (growth)"
        )

    def void_ratio(self, height: float) -> float:
        """Voids over solids of the container up to `height` [m]."""
        return self.width * height / self.solid - 1.0


@dataclass(frozen=True)
class Packed:
    """Origins x, y [m] and angles [rad] of the grains (g,), and the height [m] of the region that holds them all."""

    x: Floats
    y: Floats
    angle: Floats
    height: float
