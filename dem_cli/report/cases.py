"""Runs to compare: what each is and what came out of it, and runs that differ in their seed only pooled into cases.

All values are SI; NaN where a quantity is not defined.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dem_cli import units
from dem_cli.report.cautions import largest_of
from dem_cli.report.moved import Moved, moved
from dem_cli.report.summary import Summary, summary
from dem_cli.results import Results
from dem_cli.state import Bools, Floats

SHAPES = ("disc", "ellipse", "bonded", "clump")
START = 1.0  # how long after its beginning shaking counts as just begun [s]

# Measures before (`_packed`) and after (`_shaken`) all shaking: their name here -> in the series.
ENDS = {
    "void_ratio": "void_ratio",
    "porosity": "porosity",
    "inner": "void_ratio_inner",
    "depth": "depth",
    "coordination": "coordination",
    "sliding": "sliding",
    "roughness": "roughness",
}
# Settings that leave the physics alone.
ASIDE = ("title", "seed", "output.tracks", "output.frames")


@dataclass(frozen=True)
class Shaking:
    """One stage of shaking: a sine of `amplitude` [m/s^2] and `frequency` [Hz], or (both NaN) a recorded motion."""

    amplitude: float
    frequency: float
    record: str = ""

    @property
    def label(self) -> str:
        return self.record or f"{100.0 * self.amplitude:.4g} gal {self.frequency:.4g} Hz"


@dataclass(frozen=True)
class Outcome:
    """One run. shape: words for its grains; family: "disc", "ellipse" (of 2 to 1) or "pair" (bonded) where the thesis has
    the like, else empty. settings: the resolved scenario, flat, without ASIDE.

    measures: ENDS packed and shaken, and `_change` of void ratios and porosity; `escaped` and `overlap` (over the smaller radius) at
    the end; and over all stages of shaking `airborne_most`, `airborne_mean`, `scattered`: airborne_most and escaped, `tilt`: largest
    amplitude of the surface mode cos(pi x/l) over the depth packed, `displaced`: root mean square of the net displacement of the
    grains that are left in the container [m], `speed`: root of the mean of 2 x kinetic energy / mass [m/s],
    `speed_start`: the same in the first second (START), `tracked_start`: the same of the tracked grains without their turning;
    `bond_gap`: largest of the run over the elements' mean radius.
    moved: tracked grains in each stage of shaking. said: what to know before the numbers, in lines.
    """

    file: str
    seed: int
    version: str
    complete: bool
    stop_reason: str
    shape: str
    family: str
    grains: int
    elements: int
    width: float
    radius: float
    shaking: tuple[Shaking, ...]
    settings: dict[str, Any]
    measures: dict[str, float]
    moved: tuple[Moved, ...]
    said: tuple[str, ...]

    @property
    def shaking_label(self) -> str:
        return "; ".join(one.label for one in self.shaking) or "none"


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


def outcome(results: Results) -> Outcome:
    """What a result file, complete or not, has to say in a comparison."""
    found = summary(results)
    scenario = results.scenario
    shape, family = _shape(scenario, found)
    ways, said = [], list(found.warnings)
    for number in (k for k, stage in enumerate(results.stages, start=1) if stage.kind == "shake"):
        one = moved(results, number, START)
        if isinstance(one, str):
            said.append(one)
        else:
            ways.append(one)
    return Outcome(
        file=found.run.file,
        seed=found.run.seed,
        version=found.run.version,
        complete=found.run.complete,
        stop_reason=found.run.stop_reason,
        shape=shape,
        family=family,
        grains=found.run.grains,
        elements=found.run.elements,
        width=found.run.width,
        radius=found.run.mean_radius,
        shaking=tuple(_shakings(scenario)),
        settings={key: value for key, value in _flat(scenario) if not key.startswith(ASIDE)},
        measures={**_measures(results, found), "tracked_start": ways[0].mean["speed_start"] if ways else math.nan},
        moved=tuple(ways),
        said=tuple(f"{results.path}: {line}" for line in dict.fromkeys(said)),
    )


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
    """By shaking (amplitude, then from high frequency to low; records last), then by shape."""
    sines = [(one.record, one.amplitude, -one.frequency) if not one.record else (one.record, 0.0, 0.0) for one in case.first.shaking]
    shape = case.first.settings.get("grains.shape", "disc")
    place = SHAPES.index(shape) if shape in SHAPES else len(SHAPES)
    return sines, place, case.kind, case.first.seed


def _shape(scenario: Mapping[str, Any], found: Summary) -> tuple[str, str]:
    """Words for the grains, and the family of the thesis they belong to."""
    grains = scenario.get("grains", {})
    kind = str(grains.get("shape", "disc"))
    if kind == "ellipse":
        low, high = found.run.aspect_ratio
        alike = math.isclose(low, high, rel_tol=1e-9)
        ratio = f"{low:.3g}" if alike else "mixed" if "mix" in grains.get("aspect_ratio", {}) else f"{low:.2g} to {high:.2g}"
        return f"ellipse {ratio}", "ellipse" if alike and math.isclose(low, 2.0, rel_tol=1e-6) else ""
    if kind in ("bonded", "clump"):
        template = grains.get("template", {"name": "pair"})
        name = template.get("name") or f"of {len(template.get('discs', ()))} discs"
        return f"{kind} {name}", "pair" if (kind, name) == ("bonded", "pair") else ""
    return kind, "disc" if kind == "disc" else ""


def _shakings(scenario: Mapping[str, Any]) -> Iterable[Shaking]:
    """The stages of shaking that the scenario asks for, whether the run came to them or not."""
    for stage in scenario.get("stage", []):
        if stage.get("kind") != "shake":
            continue
        if "record" in stage:
            record = stage["record"]
            yield Shaking(math.nan, math.nan, Path(str(record.get("file", "record") if isinstance(record, dict) else record)).name)
        else:
            yield Shaking(units.parse(stage["amplitude"], "m/s^2"), units.parse(stage["frequency"], "Hz"))


def _flat(tree: Any, name: str = "") -> Iterable[tuple[str, Any]]:
    """Keys of nested tables, joined by points; items of a list of tables by their number from 1; other lists are values."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from _flat(value, f"{name}.{key}" if name else key)
    elif isinstance(tree, list) and tree and all(isinstance(item, dict) for item in tree):
        for k, item in enumerate(tree, start=1):
            yield from _flat(item, f"{name}.{k}")
    else:
        yield name, tree


def _short(key: str) -> str:
    """A setting without its table: contact.tension is tension, contact.damping_ratio.normal is damping_ratio.normal."""
    return key.partition(".")[2] or key


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _measures(results: Results, found: Summary) -> dict[str, float]:
    stages = results.stages
    shaken = [k for k, stage in enumerate(stages) if stage.kind == "shake"]
    if shaken:
        packed, last = stages[shaken[0]].before, stages[-1].after or _last_row(results)
    else:
        # Without shaking the end is that of the packing, if it came to it.
        packed, last = stages[-1].after if stages and results.complete else {}, {}
    known = {}
    for name, stored in ENDS.items():
        known[f"{name}_packed"] = packed.get(stored, math.nan)
        known[f"{name}_shaken"] = last.get(stored, math.nan)
    for name in ("void_ratio", "porosity", "inner"):
        known[f"{name}_change"] = known[f"{name}_shaken"] - known[f"{name}_packed"]
    known["escaped"] = (last or packed).get("escaped", math.nan)
    known["overlap"] = (last or packed).get("max_overlap", math.nan)
    rows = {k: _rows(results, k) for k in shaken}
    inside = np.logical_or.reduce(list(rows.values())) if rows else np.zeros(len(results.series["time"]), dtype=bool)
    airborne = _series(results, "airborne")[inside]
    known["airborne_most"] = largest_of(airborne)
    known["scattered"] = known["airborne_most"] + known["escaped"]
    known["airborne_mean"] = float(airborne.mean()) if len(airborne) else math.nan
    known["tilt"] = largest_of(np.abs(_series(results, "mode1")[inside])) / known["depth_packed"]
    known["speed"] = _speed(results, inside)
    known["displaced"] = _displaced(results, shaken)
    begun = np.zeros_like(inside)
    if shaken:
        begun = rows[shaken[0]] & (_series(results, "time") <= stages[shaken[0]].start + START + 1e-9)
    known["speed_start"] = _speed(results, begun)
    gap = largest_of(_series(results, "bond_gap")) if found.run.bonds else math.nan
    known["bond_gap"] = gap / found.run.element_radius
    return known


def _series(results: Results, name: str) -> Floats:
    return np.asarray(results.series[name], dtype=float)


def _rows(results: Results, k: int) -> Bools:
    """Rows of the series within stage k, from 0, both ends included."""
    time, stage = _series(results, "time"), results.stages[k]
    stop = stage.end if math.isfinite(stage.end) else math.inf
    return np.asarray((time >= stage.start - 1e-9) & (time <= stop + 1e-9))


def _last_row(results: Results) -> dict[str, float]:
    return {name: float(results.series[name][-1]) for name in results.series} if len(results.series["time"]) else {}


def _speed(results: Results, inside: Bools) -> float:
    """Root mean square speed of the grains against the container [m/s], turning counted as the kinetic energy counts it."""
    if not inside.any() or not results.n_frames:
        return math.nan
    kinetic = _series(results, "kinetic")[inside]
    return math.sqrt(2.0 * float(kinetic.mean()) / float(results.frame(0).grains.mass.sum()))


def _displaced(results: Results, shaken: Sequence[int]) -> float:
    """Root mean square of the way from where grains were before the first shaking to where they are after the last [m]."""
    times = results.frame_times
    if not shaken or not len(times):
        return math.nan
    stop = results.stages[shaken[-1]].end
    ends = (results.stages[shaken[0]].start, stop if math.isfinite(stop) else math.inf)
    places = []
    for end in ends:
        before = np.flatnonzero(times <= end + 1e-9)
        if not len(before):
            return math.nan
        grains = results.frame(int(before[-1])).grains
        mass = np.bincount(grains.body, grains.mass)
        places.append([np.bincount(grains.body, grains.mass * place) / mass for place in (grains.x, grains.y)])
    inside = np.bincount(grains.body, grains.escaped) == 0
    squares = (places[1][0] - places[0][0]) ** 2 + (places[1][1] - places[0][1]) ** 2
    return math.sqrt(float(squares[inside].mean())) if inside.any() else math.nan
