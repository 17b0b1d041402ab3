"""What the file of a quasi-static shear test says, as one tree of numbers: text, JSON and tables are made from it.

All values are SI; NaN where a quantity is not defined. Compression and contraction > 0; strains count from the start of the
shearing, as in the series; 1 is the axial direction of a stage and 2 the lateral one.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli.report.shear_measures import Shearing, Solver, shearing_of, solver_of
from dem_cli.report.shear_rows import SHEARS, stage_rows
from dem_cli.report.tree import plain

if TYPE_CHECKING:
    from dem_cli.results import Results, Stage

FORMAT = "dem-cli shear summary"
FORMAT_VERSION = 1
STATE = (
    "void_ratio",
    "porosity",
    "coordination",
    "rattlers",
    "sliding",
    "mean_stress",
    "stress_x",
    "stress_y",
    "max_overlap",
)
CLOSURE_LIMIT = 0.01  # largest share of the work that the ledger may miss before a reader is told


@dataclass(frozen=True)
class Test:
    """What was run. width [m]: at the start; depth [m]; increments: done in all stages; boundary_elements: of chains; wall_time [s]."""

    file: str
    title: str
    engine: str
    version: str
    scenario_hash: str
    seed: int
    grains: int
    boundary: str
    boundary_elements: int
    depth: float
    complete: bool
    stop_reason: str
    increments: int
    wall_time: float
    settings: dict[str, Any] = dataclasses.field(repr=False)


@dataclass(frozen=True)
class StageReport:
    """One stage. branch: name of the stage that it starts from, if it is not the one before. before, after: STATE at its ends (so far,
    if it has not ended). shearing: None for stages that compress.
    """

    number: int
    name: str
    kind: str
    hold: str
    axial: str
    branch: str
    ended: bool
    reason: str
    increments: int
    before: dict[str, float]
    after: dict[str, float]
    solver: Solver
    shearing: Shearing | None


@dataclass(frozen=True)
class ShearSummary:
    test: Test
    stages: tuple[StageReport, ...]
    warnings: tuple[str, ...]

    @property
    def initial(self) -> dict[str, float]:
        """STATE at the start of the first stage that shears; of the first stage if none does; {} without stages."""
        for stage in self.stages:
            if stage.shearing is not None:
                return stage.before
        return self.stages[0].before if self.stages else {}

    def as_dict(self) -> dict[str, Any]:
        """Tree for JSON: no NaN, no infinity (both null), no tuples."""
        tree = dataclasses.asdict(self)
        del tree["test"]["settings"]
        found: dict[str, Any] = plain({"initial": self.initial, **tree})
        return {"format": FORMAT, "format_version": FORMAT_VERSION, **found}


def shear_summary(results: Results) -> ShearSummary:
    """Summary of the file of a quasi-static test, complete or not."""
    stages = tuple(_stage(results, number, stage) for number, stage in enumerate(results.stages, start=1))
    test = _test(results)
    return ShearSummary(test, stages, tuple(_warnings(results, test, stages)))


def _test(results: Results) -> Test:
    attrs = results.attrs
    number = np.asarray(results.series["increment"])
    scenario = results.scenario
    return Test(
        file=str(results.path),
        title=results.title,
        engine=str(attrs.get("engine", "")),
        version=str(attrs.get("program_version", "")),
        scenario_hash=str(attrs.get("scenario_hash", "")),
        seed=int(attrs.get("seed", 0)),
        grains=results.grain_count - results.boundary,
        boundary=str(scenario.get("boundary", {}).get("kind", "walls")),
        boundary_elements=results.boundary,
        depth=results.depth,
        complete=results.complete,
        stop_reason=results.stop_reason,
        increments=int(number[-1]) if len(number) else 0,
        wall_time=float(attrs.get("wall_time", math.nan)),
        settings={key: value for key, value in scenario.items() if key not in ("title", "seed", "output")},
    )


def _stage(results: Results, number: int, stage: Stage) -> StageReport:
    rows = stage_rows(results, number)
    tables = results.scenario.get("stage", [])
    given = tables[number - 1] if number <= len(tables) else {}
    done = len(rows["in_stage"]) > 1
    axial = rows["axial"][-1]
    return StageReport(
        number=number,
        name=stage.name,
        kind=stage.kind,
        hold=str(given.get("hold", "")),
        axial="" if math.isnan(axial) else "xy"[int(axial)],
        branch=str(given.get("from", "")),
        ended=math.isfinite(stage.end),
        reason=stage.reason,
        increments=len(rows["in_stage"]) - 1,
        before={name: float(rows[name][0]) for name in STATE},
        after={name: float(rows[name][-1]) for name in STATE},
        solver=solver_of(rows),
        shearing=shearing_of(rows, results.depth, stage.kind, given.get("liquefied"))
        if done and stage.kind in SHEARS
        else None,
    )


def _warnings(results: Results, test: Test, stages: tuple[StageReport, ...]) -> list[str]:
    """Lines to read before the numbers, those of the run itself last."""
    lines = []
    if not test.complete:
        lines.append(f"the run is incomplete ({test.stop_reason}); numbers hold up to its last increment")
    for stage in stages:
        if stage.shearing is not None and stage.shearing.energy.closure > CLOSURE_LIMIT:
            lines.append(
                f"stage {stage.number}: the ledger misses {stage.shearing.energy.closure:.2g} of the work "
                f"(limit {CLOSURE_LIMIT:g}): take a smaller increment or more sub_steps"
            )
    return [*lines, *results.warnings]
