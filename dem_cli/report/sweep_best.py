"""The best point of a sweep, and which other points it cannot be told from.

The best is picked from the same runs that it is judged by, so its mean flatters it a little; other seeds would tell.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

from dem_cli.analysis.statistics import LEVEL, Difference, Estimate, difference, holm
from dem_cli.report.sweep import Sweep
from dem_cli.report.sweep_measures import MEASURES
from dem_cli.report.text import number

NAMED = 4  # rivals that are named


@dataclass(frozen=True)
class Rival:
    """Another case: how far it is from the best one, and p after Holm's correction for all rivals that can be compared (else NaN)."""

    label: str
    difference: Difference
    p: float

    @property
    def told_apart(self) -> bool | None:
        """None where there are too few runs to say."""
        return None if math.isnan(self.p) else self.p < 1.0 - LEVEL


@dataclass(frozen=True)
class Best:
    """The case with the best mean of `measure`, and all other cases that have it, the nearest first. case: its number in the sweep.

    single: cases of one run whose value is better still, while this one has several.
    """

    measure: str
    case: int
    label: str
    estimate: Estimate
    rivals: tuple[Rival, ...]
    single: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        return dataclasses.asdict(self)


def best_point(found: Sweep, measure: str | None = None) -> Best | None:
    """By `measure`, or the sweep's main one. None where no case has it, or only one is in the sweep.

    A case of one run is not taken while others have several: it would be the best by luck too often.
    """
    name = measure or found.main
    known = [(k, case, case.estimate(name)) for k, case in enumerate(found.cases) if case.kind in found.kinds[:1]]
    known = [one for one in known if one[2].n]
    if not name or len(found.cases) < 2 or not known:
        return None
    sign = -1.0 if MEASURES[name].best[0] == "largest" else 1.0
    known.sort(key=lambda one: sign * one[2].mean)
    chosen = next((one for one in known if one[2].n > 1), known[0])
    k, case, top = chosen
    others = [one for one in known if one is not chosen]
    apart = [difference(case.by_seed(name), other.by_seed(name)) for _, other, _ in others]
    corrected = holm([one.p for one in apart])
    rivals = tuple(Rival(other.label, one, p) for (_, other, _), one, p in zip(others, apart, corrected, strict=True))
    single = tuple(other.label for _, other, _ in known[: known.index(chosen)])
    return Best(name, k, case.label, top, rivals, single)


def lines(best: Best) -> list[str]:
    """What to say of it: itself with its confidence, the rivals, and how they were compared."""
    measure, one = MEASURES[best.measure], best.estimate
    value = number(one.mean * measure.factor, measure.form)
    if one.n > 1:
        half = number(one.half * measure.factor, measure.form.lstrip("+"))
        value += f" +- {half} ({100.0 * LEVEL:.0f} %, {one.n} seeds)"
    else:
        value += " (one run, so there is no confidence)"
    found = [f"best ({measure.best[1]}): {best.label}: {measure.label} {value}"]
    alike = [rival.label for rival in best.rivals if rival.told_apart is False]
    unknown = [rival.label for rival in best.rivals if rival.told_apart is None and rival.label not in best.single]
    tested = [rival for rival in best.rivals if rival.told_apart is not None]
    if alike:
        found.append(f"not distinguishable from {_some(alike, '; ')}")
    elif tested:
        found.append(
            f"distinguishable from all {len(tested)} others"
            if tested[1:]
            else f"distinguishable from {tested[0].label}"
        )
    if best.single:
        found.append(f"better still, but in one run only: {_some(list(best.single), '; ')}")
    if unknown:
        each = "the others" if len(unknown) == len(best.rivals) else _some(unknown, "; ")
        found.append(f"too few seeds to tell it from {each}")
    if tested:
        ways = {rival.difference.test for rival in tested}
        how = {"paired": "paired differences over common seeds", "welch": "Welch's t"}
        told = " and ".join(how[way] for way in sorted(ways))
        found.append(
            f"by {told}; Holm's correction for {len(tested)} comparison{'s' if tested[1:] else ''}, {100.0 * (1.0 - LEVEL):.0f} %"
        )
    return found


def _some(labels: list[str], between: str) -> str:
    more = f" and {len(labels) - NAMED} more" if len(labels) > NAMED else ""
    return between.join(labels[:NAMED]) + more
