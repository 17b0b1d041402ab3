"""What one result file says, as one tree of numbers. Text, JSON and comparisons are made from it and from
nothing else.

All values are SI; NaN where a quantity is not defined. `as_dict` gives the tree as `dem report --json` prints
it: the keys are the names of the fields here, NaN becomes null. Measures keep the names they have under
/series.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli import units
from dem_cli.analysis.sloshing import surface_period, theory_period, thesis_period
from dem_cli.report.cautions import cautions, largest_of
from dem_cli.report.motions import Motion, motion_of
from dem_cli.report.tree import plain
from dem_cli.results import Results, Stage
from dem_cli.state import Floats, Grains

FORMAT = "dem-cli summary"
FORMAT_VERSION = 2

# Measures of the sample shown before and after a stage.
MEASURES = (
    "void_ratio",
    "porosity",
    "void_ratio_inner",
    "porosity_inner",
    "depth",
    "roughness",
    "coordination",
    "airborne",
    "escaped",
    "max_overlap",
)
STORED = ("kinetic", "potential", "elastic_normal", "elastic_tangential")
LOST = ("friction", "dashpot_normal", "dashpot_tangential", "bond_energy", "damping", "escaped_energy")


@dataclass(frozen=True)
class Run:
    """What was run. width, height (NaN: walls without end), depth (of the cylinders) [m]; wall_time [s] of
    computing.

    shape: as the scenario names it; grains: of `elements` discs or ellipses, held together by `bonds` where those are bonded. mean_radius,
    element_radius [m]: mean radius of the discs of the same area as a grain, and as an element. aspect_ratio: least and
    largest a/b of an element. simulated_time [s]; steps_per_second and element_steps_per_second are per second of wall_time.
    """

    file: str
    title: str
    engine: str
    version: str
    scenario_hash: str
    seed: int
    shape: str
    grains: int
    elements: int
    bonds: int
    mean_radius: float
    element_radius: float
    aspect_ratio: tuple[float, float]
    width: float
    height: float
    depth: float
    complete: bool
    stop_reason: str
    simulated_time: float
    steps: float
    wall_time: float
    steps_per_second: float
    element_steps_per_second: float


@dataclass(frozen=True)
class Sloshing:
    """Motion of the surface in one stage of shaking beside a liquid's of the same depth; periods [s], lengths
    [m].

    depth: before the stage. theory_T1..T3: linear theory at that depth; thesis_T1: the thesis' (7.2).
    driving_period: of the shaking; of a recorded motion the predominant period of its first component, which
    nothing is taken out of the surface's motion for. period, amplitude: strongest oscillation of the surface mode cos(pi x/l);
    resolution [Hz] of the record and period_resolution [s]; ratio: period over driving period; free_period,
    free_amplitude: strongest beside the driving one; mode_largest: largest magnitude of the mode. reason: why
    no period was found, else empty.
    """

    depth: float
    theory_T1: float  # noqa: N815 - the symbol of theory and thesis
    theory_T2: float  # noqa: N815
    theory_T3: float  # noqa: N815
    thesis_T1: float  # noqa: N815
    driving_period: float
    period: float
    amplitude: float
    resolution: float
    period_resolution: float
    ratio: float
    is_driving: bool
    free_period: float
    free_amplitude: float
    mode_largest: float
    reason: str


@dataclass(frozen=True)
class StageSummary:
    """One stage. start, end [s] (NaN: not ended); before, after, change: MEASURES at its ends, `after` of a
    stage that has not ended being its last row; amplitude [m/s^2] and frequency
    [Hz] of a sine; motion: of a record.

    overlap_largest, airborne_largest, bond_gap_largest, bond_slip_largest [m], bond_roll_largest [rad]: largest over all rows of
    the stage's series; those of bonds count from the start of the run and are NaN where there are no bonds.
    """

    number: int
    name: str
    kind: str
    start: float
    end: float
    reason: str
    amplitude: float
    frequency: float
    motion: Motion | None
    before: dict[str, float]
    after: dict[str, float]
    change: dict[str, float]
    overlap_largest: float
    airborne_largest: float
    bond_gap_largest: float
    bond_slip_largest: float
    bond_roll_largest: float
    sloshing: Sloshing | None


@dataclass(frozen=True)
class EnergySummary:
    """Ledger of energy at the end of the series [J]. stored_start: stored at its first row.

    Balance: stored_start + work + time_step_energy = stored_total + lost_total + residual. residual_ratio:
    |residual| over energy_in; residual_largest_ratio: the same for the largest |residual| of the run.
    """

    stored: dict[str, float]
    stored_total: float
    stored_start: float
    lost: dict[str, float]
    lost_total: float
    work: float
    time_step_energy: float
    energy_in: float
    residual: float
    residual_ratio: float
    residual_largest_ratio: float


@dataclass(frozen=True)
class Summary:
    run: Run
    stages: tuple[StageSummary, ...]
    energy: EnergySummary | None
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Tree for JSON: no NaN, no infinity (both null), no tuples."""
        tree: dict[str, Any] = plain(dataclasses.asdict(self))
        return {"format": FORMAT, "format_version": FORMAT_VERSION, **tree}


def summary(results: Results) -> Summary:
    """Summary of a result file, complete or not."""
    run = _run(results)
    energy = _energy(results)
    stages = tuple(_stage(results, run, number, stage) for number, stage in enumerate(results.stages, start=1))
    return Summary(run=run, stages=stages, energy=energy, warnings=tuple(cautions(results, run, energy)))


def _run(results: Results) -> Run:
    attrs = results.attrs
    time, step = (np.asarray(results.series[name], dtype=float) for name in ("time", "step"))
    steps = float(step[-1]) if len(step) else 0.0
    wall = float(attrs.get("wall_time", math.nan))
    rate = steps / wall if wall > 0.0 else math.nan
    grains = results.frame(0).grains if results.n_frames else None
    aspect = (math.nan, math.nan) if grains is None else _ends(grains.a / grains.b)
    return Run(
        file=str(results.path),
        title=results.title,
        engine=str(attrs.get("engine", "")),
        version=str(attrs.get("program_version", "")),
        scenario_hash=str(attrs.get("scenario_hash", "")),
        seed=int(attrs.get("seed", 0)),
        shape=str(results.scenario.get("grains", {}).get("shape", "disc")),
        grains=results.grain_count,
        elements=results.element_count,
        bonds=len(results.bonds),
        mean_radius=math.nan if grains is None else _mean_radius(results, grains),
        element_radius=math.nan if grains is None else float(grains.radius.mean()),
        aspect_ratio=aspect,
        width=float(results.width),
        height=math.nan if results.height is None else float(results.height),
        depth=float(results.depth),
        complete=results.complete,
        stop_reason=results.stop_reason,
        simulated_time=float(time[-1] - time[0]) if len(time) else 0.0,
        steps=steps,
        wall_time=wall,
        steps_per_second=rate,
        element_steps_per_second=rate * results.element_count,
    )


def _mean_radius(results: Results, grains: Grains) -> float:
    """Mean over the grains of the radius of a disc of the same area [m]; the mass of a clump tells its area, overlaps counted once."""
    if results.grain_count == results.element_count:
        return float(grains.radius.mean())
    density = _quantity(results.scenario.get("grains", {}), "density", "kg/m^3")
    area = np.bincount(grains.body, grains.mass) / (density * results.depth)
    return float(np.sqrt(area / np.pi).mean())


def _stage(results: Results, run: Run, number: int, stage: Stage) -> StageSummary:
    inside = _rows_of(results, number)

    def peak(name: str) -> float:
        return largest_of(np.asarray(results.series[name], dtype=float)[inside])

    before = {name: float(stage.before.get(name, math.nan)) for name in MEASURES}
    after = {name: float(stage.after.get(name, math.nan)) for name in MEASURES}
    if not stage.after and inside.any():
        after = {name: float(results.series[name][inside][-1]) for name in MEASURES}
    given = _given(results, number)
    return StageSummary(
        number=number,
        name=stage.name,
        kind=stage.kind,
        start=float(stage.start),
        end=float(stage.end),
        reason=stage.reason,
        amplitude=_quantity(given, "amplitude", "m/s^2"),
        frequency=_quantity(given, "frequency", "Hz"),
        motion=motion_of(results.motions.get(number)),
        before=before,
        after=after,
        change={name: after[name] - before[name] for name in MEASURES},
        overlap_largest=peak("max_overlap"),
        airborne_largest=peak("airborne"),
        bond_gap_largest=peak("bond_gap") if run.bonds else math.nan,
        bond_slip_largest=peak("bond_slip") if run.bonds else math.nan,
        bond_roll_largest=peak("bond_roll") if run.bonds else math.nan,
        sloshing=sloshing_of(results, number) if stage.kind == "shake" else None,
    )


def sloshing_of(results: Results, number: int) -> Sloshing:
    """Of stage `number` (from 1)."""
    depth = float(results.stages[number - 1].before.get("depth", math.nan))
    mean_radius = _mean_radius(results, results.frame(0).grains) if results.n_frames else math.nan
    container = results.scenario.get("container", {})
    gravity = _quantity(container, "gravity", "m/s^2")
    direction = _quantity(container, "gravity_direction", "rad")
    if math.isfinite(direction):
        gravity *= -math.sin(direction)  # what pulls the surface level
    frequency = _quantity(_given(results, number), "frequency", "Hz")
    inside = _rows_of(results, number)
    mode = np.asarray(results.series["mode1"], dtype=float)[inside]
    # The end of one stage and the start of the next may be two rows of the same time.
    time, row = np.unique(np.asarray(results.series["time"], dtype=float)[inside], return_index=True)
    found = surface_period(
        time,
        mode[row],
        mean_radius=0.0 if math.isnan(mean_radius) else mean_radius,
        driving_period=1.0 / frequency if frequency > 0.0 else None,
    )
    motion = motion_of(results.motions.get(number))
    driving = motion.period if motion else (1.0 / frequency if frequency > 0.0 else math.nan)
    width = results.width
    return Sloshing(
        depth=depth,
        theory_T1=theory_period(1, width, depth, gravity),
        theory_T2=theory_period(2, width, depth, gravity),
        theory_T3=theory_period(3, width, depth, gravity),
        thesis_T1=thesis_period(width, depth, gravity),
        driving_period=driving,
        period=found.period,
        amplitude=found.amplitude,
        resolution=found.resolution,
        period_resolution=found.period_resolution,
        ratio=found.period / driving,
        is_driving=found.is_driving,
        free_period=found.free_period,
        free_amplitude=found.free_amplitude,
        mode_largest=largest_of(np.abs(mode)),
        reason=found.reason,
    )


def _energy(results: Results) -> EnergySummary | None:
    if len(results.series["time"]) == 0:
        return None
    end = {
        name: float(results.series[name][-1]) if name in results.series else 0.0  # an old file knows of no bonds
        for name in (*STORED, *LOST, "work", "time_step_energy", "energy_in", "residual")
    }
    largest = largest_of(np.abs(np.asarray(results.series["residual"], dtype=float)))
    scale = end["energy_in"] if end["energy_in"] > 0.0 else math.nan
    return EnergySummary(
        stored={name: end[name] for name in STORED},
        stored_total=sum(end[name] for name in STORED),
        stored_start=sum(float(results.series[name][0]) for name in STORED),
        lost={name: end[name] for name in LOST},
        lost_total=sum(end[name] for name in LOST),
        work=end["work"],
        time_step_energy=end["time_step_energy"],
        energy_in=end["energy_in"],
        residual=end["residual"],
        residual_ratio=abs(end["residual"]) / scale,
        residual_largest_ratio=largest / scale,
    )


def _rows_of(results: Results, number: int) -> Any:
    """Rows of the series within stage `number`, both ends included."""
    stage = results.stages[number - 1]
    time = np.asarray(results.series["time"])
    stop = stage.end if math.isfinite(stage.end) else math.inf
    tiny = 1e-9 * max(1.0, abs(stage.start))
    return (time >= stage.start - tiny) & (time <= stop + tiny)


def _given(results: Results, number: int) -> dict[str, Any]:
    """The stage's table in the scenario, empty if there is none."""
    tables = results.scenario.get("stage", [])
    return dict(tables[number - 1]) if number <= len(tables) else {}


def _quantity(table: dict[str, Any], key: str, unit: str) -> float:
    """`table[key]` in `unit`; NaN where the key is absent."""
    value = table.get(key)
    if isinstance(value, str):
        return units.parse(value, unit)
    return float(value) if isinstance(value, int | float) else math.nan


def _ends(values: Floats) -> tuple[float, float]:
    return (float(values.min()), float(values.max())) if len(values) else (math.nan, math.nan)
