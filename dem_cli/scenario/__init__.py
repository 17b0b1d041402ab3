"""Scenarios: the typed model of the TOML file, and what reads, changes, describes and ships them."""

from dem_cli.scenario.base import AnyScenario, DiscScenario
from dem_cli.scenario.engines import EngineScenario
from dem_cli.scenario.impulse import ImpulseScenario
from dem_cli.scenario.impulse_bodies import BodyKind
from dem_cli.scenario.impulse_stages import ImpulseSettle, ImpulseShake
from dem_cli.scenario.loader import load_scenario, parse_scenario
from dem_cli.scenario.loads import Compress, Cyclic, Load, Shear
from dem_cli.scenario.model import Scenario
from dem_cli.scenario.quasi_static import QuasiStaticScenario
from dem_cli.scenario.stages import Run, Settle, Shake

__all__ = [
    "AnyScenario",
    "BodyKind",
    "Compress",
    "Cyclic",
    "DiscScenario",
    "EngineScenario",
    "ImpulseScenario",
    "ImpulseSettle",
    "ImpulseShake",
    "Load",
    "QuasiStaticScenario",
    "Run",
    "Scenario",
    "Settle",
    "Shake",
    "Shear",
    "load_scenario",
    "parse_scenario",
]
