"""What one run has to say in a comparison: what its grains and shaking are, and what came out.

All values are SI; NaN where a quantity is not defined.
"""

from __future__ import annotations

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


def _shape(scenario: Mapping[str, Any], found: Summary) -> tuple[str, str]:
    """Words for the grains, and the family of the thesis they belong to."""
    grains = scenario.get("grains", {})
    kind = str(grains.get("shape", "disc"))
    if kind == "ellipse":
        low, high = found.run.aspect_ratio
        alike = math.isclose(low, high, rel_tol=1e-9)
        ratio = (
            f"{low:.3g}"
            if alike
            else "mixed"
            if "mix" in grains.get("aspect_ratio", {})
            else f"{low:.2g} to {high:.2g}"
        )
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
            yield Shaking(
                math.nan, math.nan, Path(str(record.get("file", "record") if isinstance(record, dict) else record)).name
            )
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


def _measures(results: Results, found: Summary) -> dict[str, float]:
    stages = results.stages
    shaken = [k for k, stage in enumerate(stages) if stage.kind == "shake"]
    if shaken:
        packed, last = stages[shaken[0]].before, stages[-1].after or _last_row(results)
    else:
        # Without shaking the end is that of the packing, if it came to it.
        packed, last = stages[-1].after if stages else {}, {}
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
