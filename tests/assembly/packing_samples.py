"""Scenarios of every packing and shape, and a check of overlaps that shares nothing with the packings' own."""

from __future__ import annotations

from typing import Any

import numpy as np
from engine_samples import soft

from dem_cli.assembly import Assembly
from dem_cli.scenario import Scenario
from dem_cli.state import Floats, Grains

SHAPES: dict[str, dict[str, Any]] = {
    "discs": {},
    "ellipses": {"grains.shape": "ellipse", "grains.aspect_ratio": {"uniform": [1.0, 5.0]}},
    "discs and ellipses": {
        "grains.shape": "ellipse",
        "grains.aspect_ratio": {"mix": [{"ratio": 1.0, "share": 0.5}, {"ratio": 3.0, "share": 0.5}]},
    },
    "pairs": {"grains.shape": "bonded", "grains.equal_area": True},
    "squares": {"grains.shape": "clump", "grains.template": "square", "grains.equal_area": True},
}
METHODS = ("falling", "rejection", "local-move", "growth", "insertion")


def packing(method: str, changes: dict[str, Any] | None = None) -> Scenario:
    """60 grains of 5 to 10 mm in a box of 20 cm, packed by a method from its defaults."""
    base = {"grains.count": 60, "container.width": "20 cm", "packing": {"method": method}}
    return soft({**base, **(changes or {})})


def worst_overlap(assembly: Assembly, width: float, height: float) -> float:
    """Largest overlap [m] of two grains, or of one and a wall or the ceiling; below zero if nothing touches. By all directions of all pairs: a
    gap is never larger than the one found, and smaller by 2e-6 of a semi-axis at most.
    """
    grains = assembly.grains
    theta = np.linspace(0.0, 2.0 * np.pi, 1440, endpoint=False)
    nx, ny = np.cos(theta), np.sin(theta)
    reach = reaches(grains, theta)
    quarter = len(theta) // 4
    sides = np.stack([
        reach[:, 2 * quarter] - grains.x, grains.x + reach[:, 0] - width,
        reach[:, 3 * quarter] - grains.y, grains.y + reach[:, quarter] - height,
    ])  # fmt: skip
    worst = float(sides.max())
    for i in range(len(grains)):
        for j in range(i + 1, len(grains)):
            dx, dy = grains.x[j] - grains.x[i], grains.y[j] - grains.y[i]
            if grains.body[i] == grains.body[j] or np.hypot(dx, dy) > grains.a[i] + grains.a[j]:
                continue
            back = np.roll(reach[j], -2 * quarter)
            worst = max(worst, float(np.min(reach[i] + back - (nx * dx + ny * dy))))
    return worst


def reaches(grains: Grains, theta: Floats) -> Floats:
    """How far each element reaches from its centre in the directions theta, (elements, directions) [m]."""
    turned = theta[None, :] - grains.angle[:, None]
    found: Floats = np.hypot(grains.a[:, None] * np.cos(turned), grains.b[:, None] * np.sin(turned))
    return found


def solid(scenario: Scenario, assembly: Assembly) -> float:
    """Area of the grains [m^2]."""
    return float(assembly.grains.mass.sum()) / (scenario.grains.density * scenario.depth)


def top(assembly: Assembly) -> float:
    """The highest point of all grains [m]."""
    grains = assembly.grains
    return float(np.max(grains.y + reaches(grains, np.array([0.5 * np.pi]))[:, 0]))
