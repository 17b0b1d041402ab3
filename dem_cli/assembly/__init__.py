"""Where grains and walls are before anything moves."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dem_cli.assembly.container import build_box, build_walls
from dem_cli.assembly.packing import DENSEST, place_grains, starting_width
from dem_cli.assembly.region import Tell
from dem_cli.assembly.scene import build_scene
from dem_cli.assembly.shapes import build_grains, draw_sizes
from dem_cli.scenario import QuasiStaticScenario, Scenario
from dem_cli.state import Bonds, Grains, Walls

__all__ = ["Assembly", "build_assembly", "build_loose", "build_scene"]


@dataclass(frozen=True)
class Assembly:
    """Grains and walls at the start of a run; bonds within grains; rigid: grains of several elements are rigid clumps.

    warnings: what the packing could not do as it was asked to.
    """

    grains: Grains
    walls: Walls
    bonds: Bonds = field(default_factory=Bonds.none)
    rigid: bool = False
    warnings: tuple[str, ...] = ()


def build_assembly(scenario: Scenario | QuasiStaticScenario, tell: Tell | None = None) -> Assembly:
    """Grains and walls of a scenario; the same seed gives the same assembly.

    Explicit DEM has its container; a quasi-static test the box (0..width) x (0..height) in which it begins, with the walls left, right,
    bottom and top, and grains that do not move. tell: called with words on what a packing is at, some times a second; may raise
    KeyboardInterrupt. ScenarioError if a packing file is wrong or the grains do not fit below the lid.
    """
    generator = np.random.default_rng(scenario.seed)
    placed = place_grains(scenario, generator, tell or (lambda _: None))
    warnings = (placed.warning,) if placed.warning else ()
    if isinstance(scenario, QuasiStaticScenario):
        still = np.zeros(len(placed.grains))
        grains = replace(placed.grains, vx=still, vy=still.copy(), spin=still.copy())
        return Assembly(grains, build_box(scenario, placed.width, placed.height), warnings=warnings)
    return Assembly(placed.grains, build_walls(scenario), placed.bonds, scenario.grains.shape == "clump", warnings)


def build_loose(scenario: Scenario | QuasiStaticScenario) -> Assembly:
    """The grains of `build_assembly` before they are packed, each at (0, 0) but those of a grid or file: what takes no time.

    The box of a quasi-static test is that which its packing is to fill.
    """
    if not scenario.packing.random:
        return build_assembly(scenario)
    sizes = draw_sizes(scenario, np.random.default_rng(scenario.seed))
    zero = np.zeros(len(sizes))
    grains, bonds = build_grains(scenario, sizes, zero, zero)
    if isinstance(scenario, QuasiStaticScenario):
        solid = float(np.sum(np.pi * grains.radius**2))
        width = starting_width(scenario, solid)
        height = scenario.packing.region_height(width, solid, DENSEST)
        return Assembly(grains, build_box(scenario, width, height))
    return Assembly(grains, build_walls(scenario), bonds, scenario.grains.shape == "clump")
