"""Grains at their starting places."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dem_cli.assembly.bodies import Bodies
from dem_cli.assembly.region import Packed, Region, Tell
from dem_cli.assembly.shapes import Sizes, build_grains, draw_sizes, stored_grains
from dem_cli.scenario import Scenario
from dem_cli.state import Bonds, Floats, Grains

MISSED = 1e-3  # a void ratio that is larger than asked for by more than this share of 1 + e is reported


def place_grains(scenario: Scenario, generator: np.random.Generator, tell: Tell) -> tuple[Grains, Bonds, str]:
    """The grains of a scenario before the first step, and their bonds, at rest unless their file gives velocities; and a warning, or
    an empty text.
    """
    packing = scenario.packing
    file = scenario.grain_file() if packing.file else None
    if file and file.stored:
        return *stored_grains(scenario, file.stored), ""
    sizes = draw_sizes(scenario, generator)
    if file:
        return *build_grains(scenario, sizes, file.x, file.y, file.vx, file.vy, file.spin), ""
    if not packing.random:
        return *build_grains(scenario, sizes, *_grid(scenario, len(sizes))), ""
    bodies = bodies_of(scenario, sizes)
    region = region_of(scenario, bodies)
    packed = _pack(scenario, bodies, sizes.angle, region, generator, tell)
    reached = region.void_ratio(packed.height)
    tell(f"{packing.method}: void ratio {reached:.4g} over a height of {packed.height:.4g} m")
    grains, bonds = build_grains(scenario, replace(sizes, angle=packed.angle), packed.x, packed.y)
    return grains, bonds, _warning(scenario, region.void_ratio(region.height), reached)


def bodies_of(scenario: Scenario, sizes: Sizes) -> Bodies:
    """The outlines of the grains, each in its own frame."""
    zero = np.zeros(len(sizes))
    grains, _ = build_grains(scenario, replace(sizes, angle=zero), zero, zero)
    return Bodies.of(grains, np.bincount(grains.body, grains.mass) / (scenario.grains.density * scenario.depth))


def region_of(scenario: Scenario, bodies: Bodies) -> Region:
    """What the packing is to fill. A lid is never exceeded."""
    container = scenario.container
    highest = container.height if container.lid and container.height is not None else math.inf
    height = scenario.packing.region_height(container.width, bodies.solid)
    by_us = scenario.packing.void_ratio is None and scenario.packing.height is None
    region = Region(container.width, min(height, highest) if by_us else height, highest, bodies.solid)
    region.raised(region.height, scenario.packing.method)
    return region


def _pack(
    scenario: Scenario, bodies: Bodies, angle: Floats, region: Region, generator: np.random.Generator, tell: Tell
) -> Packed:
    """By the scenario's method. Kernels are imported here, so that `dem check`, which packs nothing, starts without Numba."""
    from dem_cli.assembly.growth import grow
    from dem_cli.assembly.insertion import insert
    from dem_cli.assembly.moves import lattice, shake_down
    from dem_cli.assembly.rejection import reject

    packing = scenario.packing
    if packing.method == "growth":
        return grow(bodies, angle, region, generator, tell)
    if packing.method == "insertion":
        assert packing.attempts is not None
        return insert(bodies, angle, region, packing.attempts, generator, tell)
    if packing.method == "local-move":
        assert packing.sweeps is not None
        x, y = _grid(scenario, bodies.number) if packing.grid else lattice(bodies, region.width)
        return shake_down(bodies, x, y, angle, region, packing.sweeps, generator, tell)
    assert packing.attempts is not None
    return reject(bodies, angle, region, packing.attempts, generator, tell, packing.method)


def _warning(scenario: Scenario, wanted: float, reached: float) -> str:
    """What to say where a void ratio was asked for and is not reached."""
    packing = scenario.packing
    asked = packing.void_ratio is not None or packing.height is not None
    if not asked or reached <= wanted + MISSED * (1.0 + wanted):
        return ""
    remedies = {
        "falling": "Start from a looser packing",
        "rejection": 'Raise packing.attempts, or take method = "insertion" or "growth" for dense packings',
        "local-move": 'Raise packing.sweeps, or take method = "growth"',
        "growth": "The grains are jammed: ask for more voids",
        "insertion": 'The grains are jammed: ask for more voids, or try method = "growth"',
    }
    return (
        f"packing: method {packing.method} reached a void ratio of {reached:.4g}, {wanted:.4g} was asked for. "
        f"{remedies[packing.method]}"
    )


def _grid(scenario: Scenario, count: int) -> tuple[Floats, Floats]:
    grid = scenario.packing.grid
    assert grid is not None
    return staggered_grid(count, grid.columns, grid.spacing, grid.row_spacing, grid.shift)


def staggered_grid(count: int, columns: int, spacing: float, row_spacing: float, shift: float) -> tuple[Floats, Floats]:
    """Centres (count,) of a grid filled row by row from the bottom left, every second row shifted (thesis 8.1) [m]."""
    row, column = np.divmod(np.arange(count), columns)
    return (column + 0.5) * spacing + (row % 2) * shift, (row + 0.5) * row_spacing
