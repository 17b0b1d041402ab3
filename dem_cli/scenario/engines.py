"""Which scenario belongs to which engine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dem_cli.scenario.base import AnyScenario
from dem_cli.scenario.impulse import ImpulseScenario
from dem_cli.scenario.impulse_stages import IMPULSE_STAGES
from dem_cli.scenario.loads import LOADS
from dem_cli.scenario.model import Scenario
from dem_cli.scenario.quasi_static import QuasiStaticScenario
from dem_cli.scenario.stages import STAGES
from dem_cli.scenario.table import Mistake, Table, did_you_mean

EngineScenario = Scenario | QuasiStaticScenario | ImpulseScenario
ENGINES: dict[str, type[EngineScenario]] = {
    "explicit": Scenario,
    "granular-element": QuasiStaticScenario,
    "impulse": ImpulseScenario,
}
ALL_STAGES: dict[str, type[Table]] = {**IMPULSE_STAGES, **STAGES, **LOADS}


def engine_of(raw: Mapping[str, Any]) -> type[EngineScenario] | None:
    """The class of a scenario's TOML data; None for an engine that there is not."""
    said = raw.get("engine", "explicit")
    return ENGINES.get(said) if isinstance(said, str) else None


def stages_of(raw: Mapping[str, Any]) -> Mapping[str, type[Table]]:
    """The stages, by kind, of a scenario's TOML data, and those of other engines where it has none of that kind."""
    return {**ALL_STAGES, **((engine_of(raw) or Scenario).stage_kinds)}


def missing_engine(raw: Mapping[str, Any]) -> Mistake | None:
    """What to say of a scenario that names no engine, and has kinds of bodies, of which only one engine knows."""
    if "engine" in raw or not isinstance(raw.get("grains"), list):
        return None
    return Mistake(
        ("engine",),
        'is missing, and [[grains]] belongs to engine = "impulse"',
        'Add engine = "impulse", or write [grains] once, in single brackets',
    )


def unknown_engine(raw: Mapping[str, Any]) -> Mistake:
    """What to say of an engine that there is not."""
    rule = f"must be one of {', '.join(ENGINES)}"
    return Mistake(("engine",), rule, did_you_mean(str(raw.get("engine")), list(ENGINES)))


__all__ = [
    "ALL_STAGES",
    "ENGINES",
    "AnyScenario",
    "EngineScenario",
    "engine_of",
    "missing_engine",
    "stages_of",
    "unknown_engine",
]
