"""What one run gives to the report of its sweep: a few numbers of its series and stages, by the kind of run.

All values are SI; NaN where a quantity is not defined.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dem_cli.analysis.sloshing import QUIET, driven_motion
from dem_cli.report.impulse import BodySummary, body_summary
from dem_cli.report.shear import ShearSummary, shear_summary
from dem_cli.report.summary import StageSummary, Summary, summary
from dem_cli.results import BodyResults, Results
from dem_cli.results.layouts import Kind


@dataclass(frozen=True)
class Measure:
    """A number of a run. label: with its unit; form, factor: how it is shown. best: which end of it is worth naming, and how to say so.

    column: its head in a table, where that is less; spread: whether the confidence of its mean is worth a place there.
    """

    label: str
    form: str = ".4g"
    factor: float = 1.0
    best: tuple[Literal["least", "largest"], str] = ("largest", "largest")
    column: str = ""
    spread: bool = True

    @property
    def head(self) -> str:
        return self.column or self.label


DENSER: tuple[Literal["least", "largest"], str] = ("least", "largest densification")
DENSE: tuple[Literal["least", "largest"], str] = ("least", "densest")
# All measures by name; those of one name mean the same in all kinds of runs.
MEASURES: dict[str, Measure] = {
    "void_ratio_packed": Measure("void ratio packed", ".4f", best=DENSE),
    "void_ratio_shaken": Measure("void ratio shaken", ".4f", best=DENSE, column="shaken"),
    "void_ratio_change": Measure("change of the void ratio", "+.4f", best=DENSER, column="change"),
    "porosity_packed": Measure("porosity packed [%]", ".2f", 100.0, DENSE),
    "porosity_shaken": Measure("porosity shaken [%]", ".2f", 100.0, DENSE, column="shaken"),
    "porosity_change": Measure("change of the porosity [%]", "+.2f", 100.0, DENSER, column="change"),
    "inner_packed": Measure("inner void ratio packed", ".4f", best=DENSE),
    "inner_shaken": Measure("inner void ratio shaken", ".4f", best=DENSE),
    "inner_change": Measure("change of the inner void ratio", "+.4f", best=DENSER),
    "depth_packed": Measure("depth packed [cm]", ".4g", 100.0, spread=False),
    "settlement": Measure("settlement/depth [%]", ".2f", 100.0),
    "driven_amplitude": Measure("amplitude of the surface at the driving frequency [mm]", ".3g", 1e3, column="mode at driving [mm]"),
    "driven_ratio": Measure("amplitude of the surface over that of the ground", ".3g", column="over ground", spread=False),
    "driven_rest": Measure("rest of the surface's motion [mm]", ".3g", 1e3),
    "period_ratio": Measure("driving period over T1", ".3f", column="T/T1", spread=False),
    "period": Measure("strongest period of the surface [s]", ".3f", column="strongest period [s]", spread=False),
    "amplitude": Measure("its amplitude [mm]", ".3g", 1e3, column="amplitude [mm]", spread=False),
    "theory_T1": Measure("T1 [s]", ".3f", spread=False),
    "driving_period": Measure("driving period [s]", ".3g", spread=False),
    "driving_amplitude": Measure("amplitude of the shaking [gal]", ".4g", 100.0, spread=False),
    "quiet": Measure("amplitude of a still surface, at most [mm]", ".2g", 1e3, spread=False),
    "escaped": Measure("escaped", ".3g", spread=False),
    "overlap": Measure("largest overlap/radius", ".1e", column="overlap/radius", spread=False),
    "wall_time": Measure("wall time [s]", ".3g", spread=False),
    "void_ratio": Measure("void ratio at the start", ".4f", best=DENSE),
    "peak_ratio": Measure("peak s1/s2", ".4f", best=("largest", "highest peak")),
    "peak_strain": Measure("e1 - e2 at the peak [%]", ".3f", 100.0, column="e1 - e2 there [%]"),
    "peak_angle": Measure("friction angle at the peak [deg]", ".2f", math.degrees(1.0), column="friction angle [deg]"),
    "turn_strain": Measure("e1 - e2 at the turn of the volume [%]", ".3f", 100.0, column="e1 - e2 at the turn [%]", spread=False),
    "residual_ratio": Measure("residual s1/s2", ".4f"),
    "volumetric_strain": Measure("e_v at the end [%]", "+.3f", 100.0),
    "pressure_least": Measure("least p'/p0", ".4f", best=("least", "nearest to liquefaction")),
    "events": Measure("events", ".3g", spread=False),
    "runout_50": Measure("run-out of 50 % [m]", ".4g", best=("largest", "furthest run-out")),
    "runout_90": Measure("run-out of 90 % [m]", ".4g", best=("largest", "furthest run-out")),
    "runout_most": Measure("furthest run-out [m]", ".4g", best=("largest", "furthest run-out"), column="furthest [m]"),
    "drop": Measure("drop of 50 % [m]", ".4g", spread=False),
    "fill_void_ratio": Measure("void ratio of the fill", ".4f", best=DENSE),
    "fill_height": Measure("fill height [m]", ".4g"),
    "coordination": Measure("touching neighbours of a body", ".2f", column="neighbours", spread=False),
    "penetration": Measure("largest penetration [mm]", ".2g", 1e3, column="penetration [mm]", spread=False),
    "moving": Measure("moving bodies", ".3g", column="moving", spread=False),
    "capped": Measure("solves that hit their cap", ".3g", column="capped", spread=False),
}  # fmt: skip
# Kind of run -> measures that its cases are ranked and mapped by: the first that any run has.
MAIN: dict[Kind, tuple[str, ...]] = {
    "time": ("void_ratio_change", "void_ratio_packed"),
    "increment": ("peak_ratio", "pressure_least", "void_ratio"),
    "bodies": ("void_ratio_change", "runout_50", "fill_void_ratio", "fill_height", "coordination"),
}
# Kind of run -> title of a table and its columns; those that no run has are left out.
TABLES: dict[Kind, tuple[tuple[str, tuple[str, ...]], ...]] = {
    "time": (
        ("Void ratio and settlement", ("void_ratio_packed", "void_ratio_shaken", "void_ratio_change", "settlement")),
        (
            "Porosity",
            ("porosity_packed", "porosity_shaken", "porosity_change", "depth_packed", "escaped", "overlap", "wall_time"),
        ),
        (
            "Surface: mode cos(pi x/l) in the last shaking, T1 of a liquid as deep",
            ("period_ratio", "driven_amplitude", "driven_ratio", "period", "amplitude"),
        ),
    ),
    "increment": (
        (
            "Shear tests, the last stage that shears the sample",
            (
                "void_ratio", "peak_ratio", "peak_strain", "peak_angle", "turn_strain", "residual_ratio", "volumetric_strain",
                "pressure_least", "events", "wall_time",
            ),
        ),
    ),
    "bodies": (
        ("Void ratio, before and after shaking", ("void_ratio_packed", "void_ratio_shaken", "void_ratio_change")),
        (
            "Bodies at the end",
            (
                "runout_50", "runout_90", "runout_most", "drop", "fill_void_ratio", "fill_height", "coordination", "penetration",
                "moving", "escaped", "capped", "wall_time",
            ),
        ),
    ),
}  # fmt: skip
IN_MOTION = (
    "no stage follows the shaking, so the fill was still in motion when its void ratio was taken as shaken; "
    'add [[stage]] kind = "settle" to have it at rest'
)


@dataclass(frozen=True)
class Numbers:
    """Of one run: its kind, seed, program version, measures by name, what its own report warns of, and why no amplitude at the driving
    frequency was found, if it was looked for.
    """

    kind: Kind
    seed: int
    version: str
    values: dict[str, float]
    warnings: tuple[str, ...]
    undriven: str = ""


def numbers_of(results: Results) -> Numbers:
    """What a complete file gives. Frames are not read, but for the first one (sizes of the grains), and the last one of bodies."""
    if isinstance(results, BodyResults):
        bodies = body_summary(results)
        return Numbers("bodies", bodies.run.seed, bodies.run.version, _of_bodies(bodies), bodies.warnings)
    if results.kind == "increment":
        test = shear_summary(results)
        return Numbers("increment", test.test.seed, test.test.version, _of_test(test), test.warnings)
    found = summary(results)
    shaken = [stage for stage in found.stages if stage.kind == "shake"]
    values, undriven, warnings = _of_run(found, shaken), "", list(found.warnings)
    if shaken:
        moved, undriven = _surface(results, found, shaken[-1])
        values |= moved
        if found.stages[-1].kind == "shake" and moved.get("driven_amplitude", 0.0) > moved.get("quiet", math.inf):
            warnings.append(IN_MOTION)
    return Numbers("time", found.run.seed, found.run.version, values, tuple(warnings), undriven)


def _of_run(found: Summary, shaken: list[StageSummary]) -> dict[str, float]:
    """Sample before the first shaking and at the end; without shaking the end is that of the packing."""
    end = found.stages[-1].after if found.stages else {}
    packed, last = (shaken[0].before, end) if shaken else (end, {})
    values = _ends(packed, last, {"void_ratio": "void_ratio", "porosity": "porosity", "inner": "void_ratio_inner"})
    before, after = packed.get("depth", math.nan), last.get("depth", math.nan)
    return values | {
        "depth_packed": before,
        "settlement": (before - after) / before if before > 0.0 else math.nan,
        "escaped": end.get("escaped", math.nan),
        "overlap": max((stage.overlap_largest for stage in found.stages), default=math.nan),
        "wall_time": found.run.wall_time,
    }


def _ends(packed: dict[str, float], last: dict[str, float], names: dict[str, str]) -> dict[str, float]:
    values: dict[str, float] = {}
    for name, stored in names.items():
        before, after = packed.get(stored, math.nan), last.get(stored, math.nan)
        values |= {f"{name}_packed": before, f"{name}_shaken": after, f"{name}_change": after - before}
    return values


def _surface(results: Results, found: Summary, stage: StageSummary) -> tuple[dict[str, float], str]:
    """Motion of the surface in the last stage of shaking, and why there is no amplitude at the driving frequency.

    Only a sine has one driving frequency, and an amplitude of the ground's displacement, that of its acceleration over omega^2.
    """
    sloshing = stage.sloshing
    if sloshing is None:
        return {}, ""
    quiet = QUIET * found.run.mean_radius
    values = {name: getattr(sloshing, name) for name in ("period", "amplitude", "theory_T1", "driving_period")}
    values |= {"period_ratio": sloshing.driving_period / sloshing.theory_T1, "quiet": quiet}
    if not stage.frequency > 0.0:
        return values, "a recorded motion has no single driving frequency"
    time, mode = (np.asarray(results.series[name], dtype=float) for name in ("time", "mode1"))
    inside = (time >= stage.start - 1e-9) & (time <= stage.end + 1e-9)
    driven = driven_motion(time[inside], mode[inside], 1.0 / stage.frequency, _ramp(results, stage.number))
    ground = stage.amplitude / (2.0 * math.pi * stage.frequency) ** 2
    values |= {
        "driving_amplitude": stage.amplitude,
        "driven_amplitude": driven.amplitude,
        "driven_ratio": driven.amplitude / ground,
        "driven_rest": driven.rest,
    }
    return values, driven.reason


def _ramp(results: Results, number: int) -> float:
    """Over which the stage's shaking grows and falls [s]."""
    from dem_cli import units

    tables = results.scenario.get("stage", [])
    given = tables[number - 1].get("ramp", "0 s") if number <= len(tables) else "0 s"
    return units.parse(given, "s")


def _of_test(found: ShearSummary) -> dict[str, float]:
    nothing = math.nan
    stage = next((stage for stage in reversed(found.stages) if stage.shearing is not None), None)
    values = {"void_ratio": found.initial.get("void_ratio", nothing), "wall_time": found.test.wall_time}
    if stage is None or stage.shearing is None:
        return values
    done = stage.shearing
    return {
        **values,
        "void_ratio": stage.before["void_ratio"],
        "peak_ratio": done.peak.stress_ratio if done.peak else nothing,
        "peak_strain": done.peak.shear_strain if done.peak else nothing,
        "peak_angle": math.asin(max(-1.0, min(1.0, done.peak.sine))) if done.peak else nothing,
        "turn_strain": done.turn.shear_strain if done.turn else nothing,
        "residual_ratio": nothing if done.cycles else done.residual.stress_ratio,
        "volumetric_strain": done.end.volumetric_strain,
        "pressure_least": done.undrained.ratio_least if done.undrained else nothing,
        "events": float(len(stage.solver.events)),
    }


def _of_bodies(found: BodySummary) -> dict[str, float]:
    nothing = math.nan
    end = found.stages[-1].after if found.stages else {}
    shaken = [stage for stage in found.stages if stage.kind == "shake"]
    values = _ends(shaken[0].before, end, {"void_ratio": "void_ratio"}) if shaken else {}
    distance, drop = (found.runout.distance, found.runout.drop) if found.runout else ((nothing,) * 5, (nothing,) * 5)
    return values | {
        "runout_50": distance[2],
        "runout_90": distance[3],
        "runout_most": distance[4],
        "drop": drop[2],
        "fill_void_ratio": end.get("void_ratio", nothing),
        "fill_height": end.get("fill_height", nothing),
        "coordination": end.get("coordination", nothing),
        "penetration": max((stage.penetration_largest for stage in found.stages), default=nothing),
        "moving": end.get("moving", nothing),
        "escaped": end.get("escaped", nothing),
        "capped": found.solver.capped,
        "wall_time": found.run.wall_time,
    }
