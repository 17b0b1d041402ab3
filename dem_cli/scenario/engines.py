"""Which scenario belongs to which engine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dem_cli.scenario.base import AnyScenario
from dem_cli.scenario.loads import LOADS
from dem_cli.scenario.model import Scenario
from dem_cli.scenario.quasi_static import QuasiStaticScenario
from dem_cli.scenario.stages import STAGES
from dem_cli.scenario.table import Mistake, Table, did_you_mean

ENGINES: dict[str, type[Scenario] | type[QuasiStaticScenario]] = {
    "explicit": Scenario,
    "granular-element": QuasiStaticScenario,
}
ALL_STAGES: dict[str, type[Table]] = {**STAGES, **LOADS}


def engine_of(raw: Mapping[str, Any]) -> type[Scenario] | type[QuasiStaticScenario] | None:
    """The class of a scenario's TOML data; None for an engine that there is not."""
    said = raw.get("engine", "explicit")
    return ENGINES.get(said) if isinstance(said, str) else None


def unknown_engine(raw: Mapping[str, Any]) -> Mistake:
    """What to say of an engine that there is not."""
    rule = f"must be one of {', '.join(ENGINES)}"
    return Mistake(("engine",), rule, did_you_mean(str(raw.get("engine")), list(ENGINES)))


__all__ = ["ALL_STAGES", "ENGINES", "AnyScenario", "engine_of", "unknown_engine"]
