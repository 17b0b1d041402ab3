"""Where grains and walls are before anything moves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dem_cli.assembly.container import build_walls
from dem_cli.assembly.packing import place_grains
from dem_cli.assembly.region import Tell
from dem_cli.assembly.shapes import build_grains, draw_sizes
from dem_cli.scenario import Scenario
from dem_cli.state import Bonds, Grains, Walls

__all__ = ["Assembly", "build_assembly", "build_loose"]


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


def build_assembly(scenario: Scenario, tell: Tell | None = None) -> Assembly:
    """Grains and walls of a scenario; the same seed gives the same assembly.

    tell: called with words on what a packing is at, some times a second; may raise KeyboardInterrupt. ScenarioError if a packing file is
    wrong or the grains do not fit below the lid.
    """
    generator = np.random.default_rng(scenario.seed)
    grains, bonds, warning = place_grains(scenario, generator, tell or (lambda _: None))
    rigid = scenario.grains.shape == "clump"
    return Assembly(grains, build_walls(scenario), bonds, rigid, (warning,) if warning else ())


def build_loose(scenario: Scenario) -> Assembly:
    """The grains of `build_assembly` before they are packed, each at (0, 0) but those of a grid or file: what takes no time."""
    if not scenario.packing.random:
        return build_assembly(scenario)
    sizes = draw_sizes(scenario, np.random.default_rng(scenario.seed))
    zero = np.zeros(len(sizes))
    grains, bonds = build_grains(scenario, sizes, zero, zero)
    return Assembly(grains, build_walls(scenario), bonds, scenario.grains.shape == "clump")
