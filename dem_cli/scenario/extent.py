"""How far grains reach from their centres, over all sizes and orientations that can occur: what a starting grid must leave room for."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.scenario.shapes import FULL_TURN, Floats
from dem_cli.scenario.tables import Grains


def largest_reach(grains: Grains) -> tuple[float, float]:
    """The furthest that the largest grain can reach from its centre of mass, (to the left or right, up or down) [m].

    A grid whose spacing and row spacing are twice that keeps all grains apart, and off the walls.
    """
    assert grains.radius is not None
    size = grains.radius.bounds[1]
    low, high = grains.orientation.bounds if grains.orientation else (0.0, 0.0)
    if grains.aspect_ratio:
        # The reach h^2 = r^2 (k cos^2 + sin^2/k) is convex in the aspect ratio k, so its ends are enough.
        return tuple(  # type: ignore[return-value]
            max(_ellipse(size, ratio, low - turn, high - turn) for ratio in grains.aspect_ratio.bounds)
            for turn in (0.0, 0.5 * math.pi)
        )
    if not grains.template:
        return size, size
    x, y, r = grains.template.centred()
    size *= grains.scale
    right, up, left, down = (
        size * _template(x, y, r, low - turn, high - turn) for turn in 0.5 * math.pi * np.arange(4.0)
    )
    return max(left, right), max(up, down)


def _ellipse(radius: float, ratio: float, low: float, high: float) -> float:
    """Largest reach [m], along the direction that angles are counted from, of an ellipse turned by low to high [rad]."""
    furthest = 1.0 if _passes(low, high, 0.0, math.pi) else max(math.cos(low) ** 2, math.cos(high) ** 2)
    return radius * math.sqrt(ratio * furthest + (1.0 - furthest) / ratio)


def _template(x: Floats, y: Floats, r: Floats, low: float, high: float) -> float:
    """Largest reach, along the direction that angles are counted from, of discs turned together by low to high [rad]."""
    reach = -math.inf
    for cx, cy, own in zip(x, y, r, strict=True):
        angle, distance = math.atan2(cy, cx), math.hypot(cx, cy)
        ends = max(math.cos(angle + low), math.cos(angle + high))
        reach = max(reach, own + distance * (1.0 if _passes(low, high, -angle, FULL_TURN) else ends))
    return reach


def _passes(low: float, high: float, angle: float, period: float) -> bool:
    """Whether an angle, or one that differs by whole periods, lies from low to high."""
    return low + (angle - low) % period <= high
