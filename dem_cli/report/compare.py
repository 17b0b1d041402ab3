"""Result files compared: cases, what a single setting does, and the thesis beside them, as one tree of numbers."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

from dem_cli.report import thesis
from dem_cli.report.cases import Case, Pooled, pool, pooled
from dem_cli.report.outcome import Outcome, outcome
from dem_cli.report.thesis_checks import Beside, Check, beside, checks
from dem_cli.report.tree import plain
from dem_cli.results import open_results

FORMAT = "dem-cli comparison"
FORMAT_VERSION = 1


@dataclass(frozen=True)
class Effect:
    """What one setting does, all else equal: mean change of the void ratio, packed and shaken, over the seeds that both cases have."""

    setting: str
    one: Any
    other: Any
    of: str
    packed: Pooled
    shaken: Pooled


@dataclass(frozen=True)
class Comparison:
    """cases: as they are shown; beside, checks, uncovered: empty unless the thesis was asked for. said: what to know first, in lines."""

    cases: tuple[Case, ...]
    effects: tuple[Effect, ...]
    beside: tuple[Beside, ...]
    checks: tuple[Check, ...]
    uncovered: tuple[str, ...]
    why: tuple[str, ...]
    said: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Tree for JSON: SI units, null where a quantity is not defined."""
        tree = {
            "cases": [{"kind": case.kind, "shaking": case.shaking, **dataclasses.asdict(case)} for case in self.cases],
            **{
                name: [dataclasses.asdict(one) for one in getattr(self, name)]
                for name in ("effects", "beside", "checks")
            },
            "uncovered": self.uncovered,
            "why": self.why,
            "warnings": self.said,
        }
        found: dict[str, Any] = plain(tree)
        return {"format": FORMAT, "format_version": FORMAT_VERSION, **found}


def compare(files: Sequence[Path], *, with_thesis: bool = False, each: bool = False) -> Comparison:
    """Compare result files. Those that differ in their seed only are one case, but for `each`.

    Raises ResultsError for a file that cannot be read.
    """
    runs: list[Outcome] = []
    for path in files:
        with open_results(path) as results:
            runs.append(outcome(results))
    cases, said = pool(runs)
    shown = pool(runs, each=True)[0] if each else cases
    versions = sorted({run.version for run in runs})
    if len(versions) > 1:
        said.append(f"the files were written by different versions of the program: {', '.join(versions)}")
    lines = [*said, *(line for run in runs for line in run.said)]
    found, missing = checks(cases) if with_thesis else ([], [])
    return Comparison(
        cases=tuple(shown),
        effects=tuple(effects(cases)),
        beside=tuple(beside(cases)) if with_thesis else (),
        checks=tuple(found),
        uncovered=tuple(missing),
        why=tuple(why(cases)) if with_thesis else (),
        said=tuple(lines),
    )


def effects(cases: Sequence[Case]) -> list[Effect]:
    """Of each two complete cases that differ in one setting other than the shaking, bonded and rigid grains counting as one."""
    found = []
    for one, other in combinations([case for case in cases if case.complete], 2):
        if one.shaking != other.shaking:
            continue
        a, b = one.first.settings, other.first.settings
        keys = [key for key in {**a, **b} if json.dumps(a.get(key)) != json.dumps(b.get(key))]
        if "grains.shape" in keys:
            keys = [key for key in keys if not key.startswith("grains.bond.")]
        if len(keys) != 1:
            continue
        theirs = {run.seed: run for run in other.runs}
        pairs = [(run, theirs[run.seed]) for run in one.runs if run.seed in theirs]
        if not pairs:
            continue
        change = {
            name: pooled([second.measures[name] - first.measures[name] for first, second in pairs])
            for name in ("void_ratio_packed", "void_ratio_shaken")
        }
        of = one.shaking if keys == ["grains.shape"] else f"{one.first.shape}, {one.shaking}"
        found.append(Effect(keys[0], a.get(keys[0]), b.get(keys[0]), of, *change.values()))
    return found


def why(cases: Sequence[Case]) -> list[str]:
    """Where these runs are not the thesis' and what it leaves open: facts of its text and of the files alone."""
    complete = [case for case in cases if case.complete and case.first.family]
    if not complete:
        return []
    lines = list(thesis.OPEN)
    sizes = {(case.first.family, case.first.grains, round(case.first.width, 6)) for case in complete}
    other = sorted(
        f"{grains} {thesis.PLURAL[family]} in {width:.4g} m (thesis: {thesis.FOUND[family].grains} in {thesis.WIDTH:.4g} m)"
        for family, grains, width in sizes
        if grains != thesis.FOUND[family].grains or not math.isclose(width, thesis.WIDTH, rel_tol=1e-3)
    )
    if other:
        lines.append(f"Size of these samples: {'; '.join(other)}. Walls and surface weigh more in a small sample.")
    overlap = max((case.measures["overlap"].mean for case in complete), default=math.nan)
    if math.isfinite(overlap):
        lines.append(f"The largest overlap at the end of these runs is {overlap:.1e} of the smaller radius.")
    return lines
