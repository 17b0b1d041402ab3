"""Grains at their starting places."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from dem_cli.assembly.bodies import Bodies
from dem_cli.assembly.region import Packed, Region, Tell
from dem_cli.assembly.shapes import Sizes, build_grains, draw_sizes, stored_grains
from dem_cli.scenario import QuasiStaticScenario, Scenario
from dem_cli.state import Bonds, Floats, Grains

DENSEST = 0.2  # void ratio that packings "as dense as they get" come near to: where the box is to be about square
MISSED = 1e-3  # a void ratio that is larger than asked for by more than this share of 1 + e is reported


@dataclass(frozen=True)
class Placed:
    """Grains at their places, and what holds them: width and height [m], measured from the left wall and the floor.

    warning: what the packing could not do as it was asked to, or an empty text.
    """

    grains: Grains
    bonds: Bonds
    width: float
    height: float
    warning: str = ""


def place_grains(scenario: Scenario | QuasiStaticScenario, generator: np.random.Generator, tell: Tell) -> Placed:
    """The grains of a scenario before the first step, and their bonds, at rest unless their file gives velocities."""
    packing, width = scenario.packing, scenario.container.width
    file = scenario.grain_file() if packing.file else None
    if file and file.stored:
        return Placed(*stored_grains(scenario, file.stored), width or file.stored.width, file.stored.height)
    sizes = draw_sizes(scenario, generator)
    if file:
        left, floor = 0.0, 0.0
        if width is None:  # the walls touch the outermost grains
            left, floor = float(np.min(file.x - file.radius)), float(np.min(file.y - file.radius))
            width = float(np.max(file.x + file.radius)) - left
        grains, bonds = build_grains(scenario, sizes, file.x - left, file.y - floor, file.vx, file.vy, file.spin)
        return Placed(grains, bonds, width, float(np.max(grains.y + grains.a)))
    if not packing.random:
        grid = packing.grid
        assert grid is not None
        width = width or grid.columns * grid.spacing + grid.shift
        return Placed(
            *build_grains(scenario, sizes, *_grid(scenario, len(sizes))),
            width,
            grid.rows(len(sizes)) * grid.row_spacing,
        )
    bodies = bodies_of(scenario, sizes)
    region = region_of(scenario, bodies)
    packed = _pack(scenario, bodies, sizes.angle, region, generator, tell)
    reached = region.void_ratio(packed.height)
    tell(f"{packing.method}: void ratio {reached:.4g} over a height of {packed.height:.4g} m")
    grains, bonds = build_grains(scenario, replace(sizes, angle=packed.angle), packed.x, packed.y)
    warning = _warning(scenario, region.void_ratio(region.height), reached)
    return Placed(grains, bonds, region.width, packed.height, warning)


def starting_width(scenario: Scenario | QuasiStaticScenario, solid: float) -> float:
    """Width [m] of what a random packing of grains of the area `solid` [m^2] fills; where none is given, that of a square."""
    if scenario.container.width is not None:
        return scenario.container.width
    return scenario.packing.height or math.sqrt(scenario.packing.region_height(1.0, solid, DENSEST))


def bodies_of(scenario: Scenario | QuasiStaticScenario, sizes: Sizes) -> Bodies:
    """The outlines of the grains, each in its own frame."""
    zero = np.zeros(len(sizes))
    grains, _ = build_grains(scenario, replace(sizes, angle=zero), zero, zero)
    return Bodies.of(grains, np.bincount(grains.body, grains.mass) / (scenario.grains.density * scenario.depth))


def region_of(scenario: Scenario | QuasiStaticScenario, bodies: Bodies) -> Region:
    """What the packing is to fill. A lid is never exceeded."""
    highest = math.inf
    if isinstance(scenario, Scenario) and scenario.container.lid and scenario.container.height is not None:
        highest = scenario.container.height
    width = starting_width(scenario, bodies.solid)
    height = scenario.packing.region_height(width, bodies.solid)
    by_us = scenario.packing.void_ratio is None and scenario.packing.height is None
    region = Region(width, min(height, highest) if by_us else height, highest, bodies.solid)
    region.raised(region.height, scenario.packing.method)
    return region


def _pack(
    scenario: Scenario | QuasiStaticScenario,
    bodies: Bodies,
    angle: Floats,
    region: Region,
    generator: np.random.Generator,
    tell: Tell,
) -> Packed:
    """By the scenario's method. Kernels are imported here, so that `dem check`, which packs nothing, starts without Numba."""
    from dem_cli.assembly.growth import grow
    from dem_cli.assembly.insertion import insert
    from dem_cli.assembly.moves import lattice, shake_down
    from dem_cli.assembly.rejection import reject

    packing = scenario.packing
    if packing.method == "overlapping":
        return overlap(bodies, angle, region, generator)
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


def overlap(bodies: Bodies, angle: Floats, region: Region, generator: np.random.Generator) -> Packed:
    """Random places between the walls, whatever lies there already; the granular element method pushes them apart."""
    places = generator.random((bodies.number, 2))
    x, y = (
        bodies.reach + places[:, k] * (size - 2.0 * bodies.reach)
        for k, size in enumerate((region.width, region.height))
    )
    return Packed(x, y, angle, region.height)


def _warning(scenario: Scenario | QuasiStaticScenario, wanted: float, reached: float) -> str:
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


def _grid(scenario: Scenario | QuasiStaticScenario, count: int) -> tuple[Floats, Floats]:
    grid = scenario.packing.grid
    assert grid is not None
    return staggered_grid(count, grid.columns, grid.spacing, grid.row_spacing, grid.shift)


def staggered_grid(count: int, columns: int, spacing: float, row_spacing: float, shift: float) -> tuple[Floats, Floats]:
    """Centres (count,) of a grid filled row by row from the bottom left, every second row shifted (thesis 8.1) [m]."""
    row, column = np.divmod(np.arange(count), columns)
    return (column + 0.5) * spacing + (row % 2) * shift, (row + 0.5) * row_spacing
