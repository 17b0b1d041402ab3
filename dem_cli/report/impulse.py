"""What one result file of bodies in 3D says, as one tree of numbers. Text, JSON, CSV and comparisons are made from it. SI units."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli.report.cautions import RESIDUAL_LIMIT, largest_of
from dem_cli.report.impulse_checks import Check, checks
from dem_cli.report.impulse_runout import SHARES, has_runout, runout
from dem_cli.report.tree import plain
from dem_cli.results import BodyResults
from dem_cli.state import Bools, Floats

FORMAT, FORMAT_VERSION = "dem-cli report of bodies", 1
MEASURES = (
    "kinetic", "rotational", "potential", "center_x", "center_y", "center_z", "top", "contacts", "touching", "coordination",
    "sliding", "penetration", "penetration_mean", "moving", "escaped", "fill_height", "void_ratio",
)  # fmt: skip
STORED = ("kinetic", "rotational", "potential")
LOST = ("restitution_energy", "friction", "escaped_energy")


@dataclass(frozen=True)
class Kind:
    """A kind of bodies: name, how many, their shape's name and form in words, and least and largest scale, mass [kg] and reach [m]."""

    name: str
    count: int
    shape: str
    form: str
    material: str
    scale: tuple[float, float]
    mass: tuple[float, float]
    reach: tuple[float, float]


@dataclass(frozen=True)
class Pair:
    """Contact of two materials."""

    first: str
    second: str
    friction: float
    restitution: float


@dataclass(frozen=True)
class BodyRun:
    """What was run. width, breadth, height of the container [m], NaN where there is none; terrain: its name, "" without; terrain_triangles.

    time_step: least and largest [s]; wall_time [s] of computing.
    """

    file: str
    title: str
    engine: str
    solver: str
    version: str
    scenario_hash: str
    seed: int
    bodies: int
    kinds: tuple[Kind, ...]
    pairs: tuple[Pair, ...]
    planes: tuple[str, ...]
    terrain: str
    terrain_triangles: int
    width: float
    breadth: float
    height: float
    gravity: tuple[float, float, float]
    time_step: tuple[float, float]
    complete: bool
    stop_reason: str
    simulated_time: float
    steps: float
    wall_time: float
    steps_per_second: float
    body_steps_per_second: float


@dataclass(frozen=True)
class Solver:
    """Work of the solver. impacts; impact_iterations, load_sweeps: mean of a step; most_iterations of one solve; capped: solves that hit a cap;
    residual [m/s]: largest that a solve ended with; islands, largest_island: largest numbers seen."""

    steps: float
    impacts: float
    impact_iterations: float
    load_sweeps: float
    most_iterations: float
    capped: float
    residual: float
    islands: float
    largest_island: float


@dataclass(frozen=True)
class BodyStage:
    """One stage: start, end [s] (NaN: not ended), MEASURES at its ends, largest penetration [m] and speed [m/s] in it, and its solver."""

    number: int
    name: str
    kind: str
    start: float
    end: float
    reason: str
    before: dict[str, float]
    after: dict[str, float]
    penetration_largest: float
    speed_largest: float
    solver: Solver


@dataclass(frozen=True)
class BodyEnergy:
    """Ledger at the end of the series [J]: stored_start + work + projection = stored_total + lost_total + residual."""

    stored: dict[str, float]
    stored_total: float
    stored_start: float
    lost: dict[str, float]
    lost_total: float
    work: float
    projection: float
    energy_in: float
    residual: float
    residual_ratio: float
    residual_largest_ratio: float


@dataclass(frozen=True)
class RunoutSummary:
    """Quantiles, at `shares` percent of the bodies, of horizontal distance [m], drop [m] and angle of reach [rad] (`impulse_runout.Runout`)."""

    shares: tuple[float, ...]
    distance: tuple[float, ...]
    drop: tuple[float, ...]
    angle: tuple[float, ...]
    distance_mean: float
    at_rest: int
    escaped: int


@dataclass(frozen=True)
class BodySummary:
    run: BodyRun
    stages: tuple[BodyStage, ...]
    energy: BodyEnergy | None
    solver: Solver
    checks: tuple[Check, ...]
    runout: RunoutSummary | None
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Tree for JSON: no NaN, no infinity (both null), no tuples."""
        tree: dict[str, Any] = plain(dataclasses.asdict(self))
        return {"format": FORMAT, "format_version": FORMAT_VERSION, **tree}


def body_summary(results: BodyResults) -> BodySummary:
    """Summary of a result file, complete or not."""
    run, energy = _run(results), _energy(results)
    everything = np.ones(len(results.series["time"]), dtype=bool)
    solver = solver_of(results, everything)
    return BodySummary(
        run=run,
        stages=tuple(_stage(results, number) for number in range(1, len(results.stages) + 1)),
        energy=energy,
        solver=solver,
        checks=checks(results),
        runout=_runout(results),
        warnings=tuple(_cautions(results, energy, solver)),
    )


def _ends(values: Floats) -> tuple[float, float]:
    return (float(values.min()), float(values.max())) if len(values) else (math.nan, math.nan)


def _run(results: BodyResults) -> BodyRun:
    attrs = results.attrs
    time, step, time_step = (results.series[name] for name in ("time", "step", "time_step"))
    steps = float(step[-1]) if len(step) else 0.0
    wall = float(attrs.get("wall_time", math.nan))
    rate = steps / wall if wall > 0.0 else math.nan
    terrain = results.terrain
    return BodyRun(
        file=str(results.path),
        title=results.title,
        engine=str(attrs["engine"]),
        solver=solver_name(results),
        version=str(attrs.get("program_version", "")),
        scenario_hash=str(attrs.get("scenario_hash", "")),
        seed=int(attrs.get("seed", 0)),
        bodies=results.grain_count,
        kinds=_kinds(results),
        pairs=_pairs(results),
        planes=results.planes.name,
        terrain="" if terrain is None else terrain.name,
        terrain_triangles=0 if terrain is None else len(terrain.triangles),
        width=results.width,
        breadth=results.breadth,
        height=math.nan if results.height is None else results.height,
        gravity=(float(results.gravity[0]), float(results.gravity[1]), float(results.gravity[2])),
        time_step=_ends(time_step[time_step > 0.0]),
        complete=results.complete,
        stop_reason=results.stop_reason,
        simulated_time=float(time[-1] - time[0]) if len(time) else 0.0,
        steps=steps,
        wall_time=wall,
        steps_per_second=rate,
        body_steps_per_second=rate * results.grain_count,
    )


def solver_name(results: BodyResults) -> str:
    """Method of the solver, as the scenario names it."""
    table = results.scenario.get("solver", {})
    return str(table.get("method", "")) if isinstance(table, dict) else str(table)


def _kinds(results: BodyResults) -> tuple[Kind, ...]:
    """Those that have bodies, in the order of the scenario; a kind of several shapes has a row for each."""
    if results.n_frames == 0:
        return ()
    bodies, found = results.scene.bodies, []
    for group, shape in np.unique(np.stack([bodies.group, bodies.shape], axis=1), axis=0).tolist():
        some = bodies.take((bodies.group == group) & (bodies.shape == shape))
        form = results.scene_shapes[shape]
        words = {
            "spheres": f"clump of {len(form.radii)} spheres" if len(form.radii) > 1 else "sphere",
            "polyhedron": f"surface of {len(form.triangles)} triangles",
            "cloud": f"cloud of {len(form.points)} particles",
        }[form.kind]
        materials = [results.materials[k] for k in np.unique(some.material).tolist()]
        found.append(
            Kind(
                results.groups[group], len(some), form.name, words, ", ".join(materials), _ends(some.scale), _ends(some.mass),
                _ends(form.reach * some.scale),
            )
        )  # fmt: skip
    return tuple(found)


def _pairs(results: BodyResults) -> tuple[Pair, ...]:
    """Pairs of materials that can meet: of two bodies, or of a body and what is fixed."""
    if results.n_frames == 0:
        return ()
    names, of_bodies = results.materials, results.scene.bodies.material.tolist()
    fixed = set(results.planes.material.tolist())
    if results.terrain is not None:
        fixed.add(results.terrain.material)
    present = sorted({*of_bodies, *fixed})

    def meet(a: int, b: int) -> bool:
        both = of_bodies.count(a) > 1 if a == b else a in of_bodies and b in of_bodies
        return both or (a in fixed and b in of_bodies) or (b in fixed and a in of_bodies)

    return tuple(
        Pair(names[a], names[b], float(results.friction[a, b]), float(results.restitution[a, b]))
        for a in present
        for b in present
        if a <= b and meet(a, b)
    )


def rows_of(results: BodyResults, number: int) -> Bools:
    """Rows of the series within stage `number`, both ends included."""
    stage = results.stages[number - 1]
    time = results.series["time"]
    stop = stage.end if math.isfinite(stage.end) else math.inf
    tiny = 1e-9 * max(1.0, abs(stage.start))
    return np.asarray((time >= stage.start - tiny) & (time <= stop + tiny))


def _stage(results: BodyResults, number: int) -> BodyStage:
    stage, inside = results.stages[number - 1], rows_of(results, number)
    before = {name: stage.before.get(name, math.nan) for name in MEASURES}
    after = {name: stage.after.get(name, math.nan) for name in MEASURES}
    if not stage.after and inside.any():
        after = {name: float(results.series[name][inside][-1]) for name in MEASURES}
    started = inside & (results.series["time"] > stage.start)  # the row at its start tells of the steps before
    return BodyStage(
        number=number,
        name=stage.name,
        kind=stage.kind,
        start=stage.start,
        end=stage.end,
        reason=stage.reason,
        before=before,
        after=after,
        penetration_largest=largest_of(results.series["penetration"][inside]),
        speed_largest=largest_of(results.series["speed_max"][inside]),
        solver=solver_of(results, started),
    )


def solver_of(results: BodyResults, rows: Bools) -> Solver:
    """Work of the solver in the steps that the chosen rows of the series tell of."""
    column = {
        name: results.series[name][rows]
        for name in (
            "steps", "impacts", "impact_iterations", "load_sweeps", "most_iterations", "capped", "solver_residual", "islands",
            "largest_island",
        )
    }  # fmt: skip
    steps = float(column["steps"].sum())
    capped = column["capped"]
    first = int(np.argmax(rows)) if rows.any() else 0
    base = float(results.series["capped"][first - 1]) if first > 0 else 0.0  # counted from the start of the run

    def mean(name: str) -> float:
        return float(column[name] @ column["steps"]) / steps if steps > 0.0 else math.nan

    return Solver(
        steps=steps,
        impacts=float(column["impacts"].sum()),
        impact_iterations=mean("impact_iterations"),
        load_sweeps=mean("load_sweeps"),
        most_iterations=float(column["most_iterations"].max(initial=0.0)),
        capped=float(capped[-1]) - base if len(capped) else 0.0,
        residual=float(column["solver_residual"].max(initial=0.0)),
        islands=float(column["islands"].max(initial=0.0)),
        largest_island=float(column["largest_island"].max(initial=0.0)),
    )


def _energy(results: BodyResults) -> BodyEnergy | None:
    series = results.series
    if len(series["time"]) == 0:
        return None
    end = {name: float(series[name][-1]) for name in (*STORED, *LOST, "work", "projection", "energy_in", "residual")}
    scale = end["energy_in"] if end["energy_in"] > 0.0 else math.nan
    return BodyEnergy(
        stored={name: end[name] for name in STORED},
        stored_total=sum(end[name] for name in STORED),
        stored_start=sum(float(series[name][0]) for name in STORED),
        lost={name: end[name] for name in LOST},
        lost_total=sum(end[name] for name in LOST),
        work=end["work"],
        projection=end["projection"],
        energy_in=end["energy_in"],
        residual=end["residual"],
        residual_ratio=abs(end["residual"]) / scale,
        residual_largest_ratio=largest_of(np.abs(series["residual"])) / scale,
    )


def _runout(results: BodyResults) -> RunoutSummary | None:
    if not has_runout(results):
        return None
    found = runout(results)
    return RunoutSummary(
        shares=SHARES,
        distance=tuple(found.quantiles(found.distance)),
        drop=tuple(found.quantiles(found.drop)),
        angle=tuple(found.quantiles(found.angle)),
        distance_mean=float(found.distance.mean()),
        at_rest=int(np.count_nonzero(found.at_rest & ~found.escaped)),
        escaped=int(np.count_nonzero(found.escaped)),
    )


def _cautions(results: BodyResults, energy: BodyEnergy | None, solver: Solver) -> list[str]:
    """Lines to read before the numbers, those of the run itself last."""
    lines = []
    if not results.complete:
        lines.append(f"the run is incomplete ({results.stop_reason}); numbers hold up to its last row")
    if energy is None:
        lines.append("the file holds no series yet")
    elif energy.residual_largest_ratio > RESIDUAL_LIMIT:
        lines.append(
            f"energy: the ledger misses {energy.residual_largest_ratio:.2g} of the energy put in "
            f"(limit {RESIDUAL_LIMIT:g}): take a smaller time step"
        )
    if solver.capped:
        lines.append(
            f"solver: {solver.capped:.0f} solves hit their cap of iterations; raise [solver] sweeps or iterations, or take a smaller time step"
        )
    return [*lines, *results.warnings]
