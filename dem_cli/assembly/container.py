"""Walls around the grains: the container of explicit DEM, and the box in which a quasi-static test begins."""

from __future__ import annotations

import numpy as np

from dem_cli.scenario import QuasiStaticScenario, Scenario
from dem_cli.state import Walls


def build_walls(scenario: Scenario) -> Walls:
    """Floor at y = 0, side walls at x = 0 and x = width up to `height` (or without end: y1 = inf), and a lid if asked for."""
    width, height = scenario.container.width, scenario.container.height
    top = np.inf if height is None else height
    sides = {
        "left": (0.0, 0.0, 0.0, top),
        "right": (width, 0.0, width, top),
        "bottom": (0.0, 0.0, width, 0.0),
    }
    if scenario.container.lid:
        sides["top"] = (0.0, top, width, top)
    return _walls(sides, scenario)


def build_box(scenario: QuasiStaticScenario, width: float, height: float) -> Walls:
    """Left, right, bottom and top wall of the box (0..width) x (0..height) [m]."""
    sides = {
        "left": (0.0, 0.0, 0.0, height),
        "right": (width, 0.0, width, height),
        "bottom": (0.0, 0.0, width, 0.0),
        "top": (0.0, height, width, height),
    }
    return _walls(sides, scenario)


def _walls(sides: dict[str, tuple[float, float, float, float]], scenario: Scenario | QuasiStaticScenario) -> Walls:
    ends = np.array(list(sides.values()))
    friction = np.array([getattr(scenario.contact.wall_friction, name) for name in sides], dtype=float)
    return Walls(tuple(sides), ends[:, 0], ends[:, 1], ends[:, 2], ends[:, 3], friction)
