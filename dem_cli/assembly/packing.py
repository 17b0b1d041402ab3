"""Grains at their starting places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dem_cli.scenario import Scenario
from dem_cli.state import Floats, Grains


def place_grains(scenario: Scenario, generator: np.random.Generator) -> Grains:
    """The grains of a scenario before the first step, at rest unless their file gives velocities."""
    density, depth = scenario.grains.density, scenario.depth
    if scenario.packing.file:
        file = scenario.grain_file()
        grains = Grains.discs(file.x, file.y, file.radius, density, depth)
        return replace(grains, vx=file.vx.copy(), vy=file.vy.copy())
    count, grid = scenario.grain_count, scenario.packing.grid
    assert grid is not None
    assert scenario.grains.radius is not None
    radius = scenario.grains.radius.draw(generator, count)
    x, y = staggered_grid(count, grid.columns, grid.spacing, grid.row_spacing, grid.shift)
    return Grains.discs(x, y, radius, density, depth)


def staggered_grid(count: int, columns: int, spacing: float, row_spacing: float, shift: float) -> tuple[Floats, Floats]:
    """Centres (count,) of a grid filled row by row from the bottom left, every second row shifted (thesis 8.1) [m]."""
    row, column = np.divmod(np.arange(count), columns)
    return (column + 0.5) * spacing + (row % 2) * shift, (row + 0.5) * row_spacing
