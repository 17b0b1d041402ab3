"""Scenarios: the typed model of the TOML file, and what reads, changes, describes and ships them."""

from dem_cli.scenario.loader import load_scenario, parse_scenario
from dem_cli.scenario.model import Scenario
from dem_cli.scenario.stages import Run, Settle, Shake

__all__ = ["Run", "Scenario", "Settle", "Shake", "load_scenario", "parse_scenario"]
