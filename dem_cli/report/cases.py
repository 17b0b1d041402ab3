"""Runs that differ in their seed only pooled into cases, in the order of shaking and shape."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dem_cli.report.outcome import Outcome

SHAPES = ("disc", "ellipse", "bonded", "clump")


@dataclass(frozen=True)
class Pooled:
    """Mean of `n` values and their standard deviation (of n - 1; NaN for one value)."""

    mean: float
    sd: float
    n: int


@dataclass(frozen=True)
class Case:
    """Runs that differ in their seed only.

    variant: settings in which cases of one shape and shaking differ; told: those of them that are not as in most cases.
    """

    runs: tuple[Outcome, ...]
    variant: dict[str, Any]
    told: tuple[str, ...]
    measures: dict[str, Pooled]
    moved: tuple[dict[str, Pooled], ...]

    @property
    def first(self) -> Outcome:
        return self.runs[0]

    @property
    def kind(self) -> str:
        """Shape, and settings that are told: what is the same whatever the shaking."""
        words = [f"{_short(key)} {_plain(self.variant[key])}" for key in self.told]
        more = [f"and {len(words) - 3} more"] if len(words) > 3 else []
        return ", ".join([self.first.shape, *words[:3], *more])

    @property
    def shaking(self) -> str:
        return self.first.shaking_label

    @property
    def complete(self) -> bool:
        return self.first.complete

    @property
    def sine(self) -> tuple[float, float] | None:
        """Amplitude [m/s^2] and frequency [Hz] where the run is shaken once, by a sine."""
        one = self.first.shaking
        return (one[0].amplitude, one[0].frequency) if len(one) == 1 and not one[0].record else None

    @property
    def who(self) -> str:
        """The run's file, or the seeds of several."""
        if len(self.runs) == 1:
            return Path(self.first.file).name
        return "seeds " + ", ".join(str(run.seed) for run in self.runs)


def pool(runs: Sequence[Outcome], *, each: bool = False) -> tuple[list[Case], list[str]]:
    """Cases of `runs` in the order of shaking and shape, and what was left out, in lines.

    Complete runs of the same settings are pooled, a seed counting once; incomplete ones stand alone, and so do all with `each`.
    """
    groups: dict[str, list[Outcome]] = {}
    said = []
    for k, run in enumerate(runs):
        alone = each or not run.complete
        key = json.dumps(run.settings, sort_keys=True) + (f" {k}" if alone else "")
        twin = next((other for other in groups.get(key, []) if other.seed == run.seed), None)
        if twin is None:
            groups.setdefault(key, []).append(run)
        else:
            said.append(f"{run.file}: the same scenario and seed as {twin.file}; left out")
    ordered = [tuple(sorted(group, key=lambda run: run.seed)) for group in groups.values()]
    variants = _variants([group[0] for group in ordered])
    usual = _usual(variants)
    cases = [
        Case(
            runs=group,
            variant=variant,
            told=tuple(key for key, value in variant.items() if usual.get(key) != json.dumps(value)),
            measures={name: pooled([run.measures[name] for run in group]) for name in group[0].measures},
            moved=_pooled_ways(group),
        )
        for group, variant in zip(ordered, variants, strict=True)
    ]
    return sorted(cases, key=_order), said


def pooled(values: Iterable[float]) -> Pooled:
    """Mean and standard deviation of those values that are defined."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return Pooled(math.nan, math.nan, 0)
    sd = float(np.std(known, ddof=1)) if len(known) > 1 else math.nan
    return Pooled(float(np.mean(known)), sd, len(known))


def _pooled_ways(group: Sequence[Outcome]) -> tuple[dict[str, Pooled], ...]:
    """Stage by stage, of the runs that have tracks there."""
    stages = max(len(run.moved) for run in group)
    found = []
    for k in range(stages):
        means = [run.moved[k].mean for run in group if k < len(run.moved)]
        found.append({name: pooled([mean[name] for mean in means]) for name in means[0]})
    return tuple(found)


def _variants(runs: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Of each run the settings in which any runs of the same shape and shaking differ."""
    groups: dict[tuple[str, str], list[Outcome]] = {}
    for run in runs:
        groups.setdefault((run.shape, run.shaking_label), []).append(run)
    keys: dict[str, None] = {}
    for group in groups.values():
        for key in dict.fromkeys(key for run in group for key in run.settings):
            if len({json.dumps(run.settings.get(key)) for run in group}) > 1:
                keys[key] = None
    return [{key: run.settings.get(key) for key in keys if key in run.settings} for run in runs]


def _usual(variants: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Key -> the value that more than half of those that have the key share, as JSON, where there is one."""
    found = {}
    for key in dict.fromkeys(key for variant in variants for key in variant):
        values = [json.dumps(variant[key]) for variant in variants if key in variant]
        common = max(values, key=values.count)
        if 2 * values.count(common) > len(values):
            found[key] = common
    return found


def _order(case: Case) -> tuple[Any, ...]:
    """By shaking (amplitude, then from high frequency to low; records last), then by shape, the usual first."""
    sines = [
        (one.record, one.amplitude, -one.frequency) if not one.record else (one.record, 0.0, 0.0)
        for one in case.first.shaking
    ]
    shape = case.first.settings.get("grains.shape", "disc")
    place = SHAPES.index(shape) if shape in SHAPES else len(SHAPES)
    return sines, place, len(case.told), case.kind, case.first.seed


def _short(key: str) -> str:
    """A setting without its table: contact.tension is tension, contact.damping_ratio.normal is damping_ratio.normal."""
    return key.partition(".")[2] or key


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
