"""Where grains and walls are before anything moves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dem_cli.assembly.container import build_walls
from dem_cli.assembly.packing import place_grains
from dem_cli.scenario import Scenario
from dem_cli.state import Bonds, Grains, Walls

__all__ = ["Assembly", "build_assembly"]


@dataclass(frozen=True)
class Assembly:
    """Grains and walls at the start of a run; bonds within grains; rigid: grains of several elements are rigid clumps."""

    grains: Grains
    walls: Walls
    bonds: Bonds = field(default_factory=Bonds.none)
    rigid: bool = False


def build_assembly(scenario: Scenario) -> Assembly:
    """Grains and walls of a scenario; the same seed gives the same assembly. ScenarioError if a packing file is wrong."""
    generator = np.random.default_rng(scenario.seed)
    grains, bonds = place_grains(scenario, generator)
    return Assembly(grains, build_walls(scenario), bonds, rigid=scenario.grains.shape == "clump")
