"""How long the stages of a scenario will take, before they are run: what `dem check` says, by stages. Guesses within a factor of three."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from dem_cli.cli.check import derive_any
from dem_cli.cli.derived import RATE_GRAIN_STEPS, Derived
from dem_cli.cli.derived_impulse import DerivedImpulse
from dem_cli.results.manifest import Member
from dem_cli.scenario import EngineScenario
from dem_cli.sweep.plan import Plan

BODY_STEP = 1e-5  # s that a step takes a body of the impulse engine: a clump of four spheres in a pile that still moves


def stage_seconds(scenario: EngineScenario) -> list[float]:
    """Computing time of each stage on one core [s]; the packing belongs to the first one."""
    derived, _ = derive_any(scenario)
    if isinstance(derived, Derived):
        rate = RATE_GRAIN_STEPS[derived.shape]
        seconds = [plan.steps * derived.elements / rate for plan in derived.stages]
        seconds[0] += derived.packing_seconds
    elif isinstance(derived, DerivedImpulse):
        seconds = [plan.steps * derived.bodies * BODY_STEP for plan in derived.stages]
    else:
        planned = [plan.increments for plan in derived.stages]
        seconds = [derived.run_seconds * own / max(sum(planned), 1) for own in planned]
        seconds[0] += derived.packing_seconds
    return seconds


@dataclass(frozen=True)
class SweepEstimate:
    """Seconds on one core: of each member, by hash, without what it shares; and of each preparation, by key.

    pace: by how much members that were run here took longer than guessed, which the others are multiplied by; None before the first one.
    """

    members: dict[str, float]
    preparations: dict[str, float]
    pace: float | None


def estimate_sweep(plan: Plan, records: Mapping[str, Member]) -> SweepEstimate:
    """records: what is known of members, by hash."""
    stages: dict[str, list[float]] = {}
    by_content: dict[str, list[float]] = {}  # seeds make no difference
    for member in plan.members:
        scenario = member.load()
        content = scenario.to_dict() | {"title": "", "seed": 0}
        key = json.dumps(content, sort_keys=True)
        if key not in by_content:
            by_content[key] = stage_seconds(scenario)
        stages[member.hash] = by_content[key]
    own = {one.hash: sum(stages[one.hash][plan.begin(one) :]) for one in plan.members}
    shared = {
        key: sum(stages[one.of.hash][plan.shared[one.parent].stages if one.parent else 0 : one.stages])
        for key, one in plan.shared.items()
    }
    ran = [one for one in records.values() if one.state == "done" and one.seconds > 0.0 and one.hash in own]
    guessed = sum(own[one.hash] for one in ran)
    pace = sum(one.seconds for one in ran) / guessed if guessed > 0.0 else None
    factor = pace or 1.0
    return SweepEstimate(
        {key: factor * value for key, value in own.items()},
        {key: factor * value for key, value in shared.items()},
        pace,
    )
