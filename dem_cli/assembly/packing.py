"""Grains at their starting places."""

from __future__ import annotations

import numpy as np

from dem_cli.assembly.shapes import build_grains, draw_sizes
from dem_cli.scenario import Scenario
from dem_cli.state import Bonds, Floats, Grains


def place_grains(scenario: Scenario, generator: np.random.Generator) -> tuple[Grains, Bonds]:
    """The grains of a scenario before the first step, and their bonds, at rest unless their file gives velocities."""
    sizes = draw_sizes(scenario, generator)
    if scenario.packing.file:
        file = scenario.grain_file()
        return build_grains(scenario, sizes, file.x, file.y, file.vx, file.vy, file.spin)
    grid = scenario.packing.grid
    assert grid is not None
    x, y = staggered_grid(len(sizes), grid.columns, grid.spacing, grid.row_spacing, grid.shift)
    return build_grains(scenario, sizes, x, y)


def staggered_grid(count: int, columns: int, spacing: float, row_spacing: float, shift: float) -> tuple[Floats, Floats]:
    """Centres (count,) of a grid filled row by row from the bottom left, every second row shifted (thesis 8.1) [m]."""
    row, column = np.divmod(np.arange(count), columns)
    return (column + 0.5) * spacing + (row % 2) * shift, (row + 0.5) * row_spacing
