"""Packing by growth (thesis 2.7 e): grains grow from random centres until they touch, or fill the region as asked."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.assembly.bodies import Bodies
from dem_cli.assembly.region import Packed, Region, Tell
from dem_cli.assembly.rejection import Scatter
from dem_cli.assembly.relaxation import relax
from dem_cli.state import Floats

SWELL = 2e-4  # grains are packed larger by this share: what overlaps then does not overlap any more at their own size
SMALL = 0.2  # share of the region that the grains cover when they begin to grow
ATTEMPTS = 10000  # places that a small grain tries at the start
GROW = 1.03  # factor of size from one relaxation to the next
LOOSE = 0.3  # void ratio at which they reach their size; from there on the ceiling comes down
FIRST, LAST = (
    0.01,
    2e-3,
)  # step of the ceiling as a share of its height, and the step at which the grains count as jammed
STEPS = 1500  # of a relaxation at most
PART = 250  # steps between two chances to interrupt


class Pile:
    """Grains at present places and sizes, between walls and a ceiling; pushed apart after each change."""

    def __init__(self, bodies: Bodies, x: Floats, y: Floats, angle: Floats, width: float, height: float) -> None:
        self.bodies, self.width, self.height = bodies, width, height
        self.x, self.y, self.angle = x.copy(), y.copy(), angle.copy()
        self.scale = np.ones(bodies.number)
        self.steps = 0
        # An overlap of swollen grains below this is none of the grains themselves: each is smaller by SWELL * b on its side.
        self.tolerance = SWELL * float(bodies.b.min())

    def relax(self, tell: Tell, words: str) -> bool:
        """Whether all overlaps could be pushed out."""
        tolerance = self.tolerance * float(self.scale.min())
        velocity, pace = np.zeros((self.bodies.number, 3)), np.zeros(3)
        for _ in range(STEPS // PART):
            tell(words)
            overlap, steps = relax(
                self.bodies, self.x, self.y, self.angle, self.scale, SWELL, self.width, self.height, tolerance, PART,
                velocity, pace,
            )  # fmt: skip
            self.steps += steps
            if overlap <= tolerance:
                return True
            if steps < PART:
                return False
        return False

    def lift(self, height: float) -> None:
        """A new height of the ceiling [m]; grains move with it as on a rubber sheet."""
        self.y *= height / self.height
        self.height = height

    def raise_until_free(self, region: Region, tell: Tell, words: str, method: str) -> None:
        """Raises the ceiling until no overlap is left. ScenarioError where it must not go."""
        while not self.relax(tell, words):
            self.lift(region.raised(self.height * (1.0 + FIRST), method))

    def lower(self, target: float, tell: Tell, words: str) -> None:
        """Lowers the ceiling to `target` [m], or until the grains are jammed below it."""
        step = FIRST
        while self.height > target and step > LAST:
            kept = self.x.copy(), self.y.copy(), self.angle.copy(), self.height
            self.lift(max(target, self.height * (1.0 - step)))
            if not self.relax(tell, words):
                self.x, self.y, self.angle, self.height = kept
                step *= 0.5


def grow(bodies: Bodies, angle: Floats, region: Region, rng: np.random.Generator, tell: Tell) -> Packed:
    """Growth from random centres, with the grains turning and giving way; ends at the region's height, or jammed above it.

    The small grains at the start do not overlap: grains of several discs that cross would stay hooked into each other.
    """
    loose = (1.0 + LOOSE) * bodies.solid / region.width
    height = max(region.height, min(loose, region.highest))
    size = min(math.sqrt(SMALL * region.width * height / bodies.solid), 1.0)
    scatter = Scatter(bodies.scaled(size), angle, region.width, rng, tell)
    while not scatter.fill(height, ATTEMPTS):
        height = region.raised(height * (1.0 + FIRST), "growth")
    pile = Pile(bodies, scatter.x, scatter.y, angle, region.width, height)
    while size < 1.0:
        size = min(size * GROW, 1.0)
        pile.scale[:] = size
        pile.raise_until_free(region, tell, f"growth: grains at {size:.0%} of their size", "growth")
    pile.lower(region.height, tell, "growth: pressing together")
    return Packed(pile.x, pile.y, pile.angle, pile.height)
