"""A run of bodies in 3D as tables of text: one file in blocks, several in one table."""

from __future__ import annotations

import math
from collections.abc import Sequence

from dem_cli.report.impulse import BodyEnergy, BodyRun, BodyStage, BodySummary, Kind, RunoutSummary, Solver
from dem_cli.report.impulse_checks import Check
from dem_cli.report.look import display_unit
from dem_cli.report.text import NOTHING, Block, arrow, number, with_unit

LABELS = {
    "kinetic": "kinetic",
    "rotational": "rotational",
    "potential": "potential",
    "restitution_energy": "impacts (restitution)",
    "friction": "friction",
    "escaped_energy": "escaped bodies",
}
# Column of a check -> how its numbers are shown.
FORMS = {
    "bounce": ".0f", "body": ".0f", "time": ".6g", "time_closed": ".6g", "time_error": "+.2f", "impact": ".6f", "rebound": ".6f",
    "rebound_closed": ".6f", "rebound_error": "+.1e", "ratio": ".7f", "spin": ".1e", "friction": ".4g", "velocity": ".7f",
    "closed": ".7f", "error": "+.1e", "off_plane": "+.1e", "sideways": "+.1e", "mass": ".5g", "before": ".7f", "after": ".7f",
}  # fmt: skip


def blocks(summary: BodySummary) -> list[Block]:
    """The report of one run."""
    found = [_head(summary.run), _pairs(summary.run)]
    found += [_stage(stage) for stage in summary.stages]
    if summary.energy is not None:
        found.append(_energy(summary.energy))
    found.append(_solver(summary.solver))
    for check in summary.checks:
        found += _check(check)
    if summary.runout is not None:
        found.append(_runout(summary.runout))
    if summary.warnings:
        found.append(Block("Warnings", (), tuple((line,) for line in summary.warnings)))
    return [block for block in found if block.rows]


def comparison(summaries: Sequence[BodySummary]) -> Block:
    """One row a run: the bodies at the end, and what the solver did."""
    header = (
        "file", "bodies", "solver", "dt", "simulated", "kinetic end", "coord.", "penetration", "fill height", "void ratio", "moving",
        "esc.", "run-out 50 %", "capped", "residual", "wall", "state",
    )  # fmt: skip
    return Block("", header, tuple(_row(summary) for summary in summaries))


def _row(summary: BodySummary) -> tuple[str, ...]:
    run, solver, energy = summary.run, summary.solver, summary.energy
    after = summary.stages[-1].after if summary.stages else {}

    def last(name: str, form: str, unit: str = "") -> str:
        value = after.get(name, math.nan)
        return with_unit(value, unit, form) if unit else number(value, form)

    median = summary.runout.distance[2] if summary.runout is not None else math.nan
    deepest = max((stage.penetration_largest for stage in summary.stages), default=math.nan)
    kinetic = after.get("kinetic", math.nan) + after.get("rotational", math.nan)
    return (
        run.file,
        str(run.bodies),
        run.solver or NOTHING,
        with_unit(run.time_step[1], "s", ".3g"),
        number(run.simulated_time, ".4g", "s"),
        with_unit(kinetic, "J", ".3g"),
        last("coordination", ".2f"),
        with_unit(deepest, "m", ".2g"),
        last("fill_height", ".4g", "m"),
        last("void_ratio", ".3f"),
        last("moving", ".0f"),
        last("escaped", ".0f"),
        with_unit(median, "m", ".4g"),
        number(solver.capped, ".0f"),
        number(energy.residual_largest_ratio if energy else math.nan, ".1e"),
        with_unit(run.wall_time, "s", ".3g"),
        "complete" if run.complete else "incomplete",
    )


def _head(run: BodyRun) -> Block:
    pace = f", {number(run.steps_per_second, ',.0f')} steps/s, {number(run.body_steps_per_second / 1e3, '.3g')} thousand body-steps/s"
    state = ("complete" if run.complete else "INCOMPLETE") + (f": {run.stop_reason}" if run.stop_reason else "")
    rows = [
        ("file", run.file),
        ("program", f"dem-cli {run.version}, engine {run.engine}" + (f", solver {run.solver}" if run.solver else "")),
        ("scenario", f"{run.scenario_hash}, seed {run.seed}"),
        ("bodies", str(run.bodies)),
        *(("", kind_text(kind)) for kind in run.kinds),
    ]
    if math.isfinite(run.width):
        sides = [with_unit(side, "m") for side in (run.width, run.breadth)]
        height = f" x {with_unit(run.height, 'm')}" if math.isfinite(run.height) else ", walls without end"
        rows.append(("container", " x ".join(sides) + height))
    if run.planes:
        rows.append(("planes", ", ".join(run.planes)))
    if run.terrain:
        rows.append(("terrain", f"{run.terrain}, {run.terrain_triangles} triangles"))
    low, high = run.time_step
    rows += [
        ("state", state),
        ("time", f"{run.simulated_time:.5g} s simulated in {run.steps:,.0f} steps"),
        ("time step", with_unit(high, "s") + ("" if low >= 0.999 * high else f", shortened to {with_unit(low, 's')}")),
        ("computing", NOTHING if math.isnan(run.wall_time) else with_unit(run.wall_time, "s", ".3g") + pace),
    ]
    return Block(run.title or run.file, (), tuple(rows), left=2)


def kind_text(kind: Kind) -> str:
    """How many bodies of which shape, material, mass and size."""

    def span(ends: tuple[float, float], unit: str) -> str:
        low, high = ends
        one = with_unit(high, unit) if unit else number(high)
        return (
            one
            if math.isclose(low, high, rel_tol=1e-9)
            else f"{with_unit(low, unit) if unit else number(low)} to {one}"
        )

    same = "" if kind.shape == kind.name else f" ({kind.shape})"
    scale = "" if kind.scale == (1.0, 1.0) else f", scale {span(kind.scale, '')}"
    return f"{kind.count} x {kind.name}{same}: {kind.form}{scale}, {span(kind.mass, 'kg')}, reach {span(kind.reach, 'm')}, {kind.material}"


def _pairs(run: BodyRun) -> Block:
    rows = tuple(
        (f"{pair.first} - {pair.second}", number(pair.friction), number(pair.restitution)) for pair in run.pairs
    )
    return Block("Contacts", ("", "friction", "restitution"), rows)


def _stage(stage: BodyStage) -> Block:
    own = "" if stage.name in ("", stage.kind) else f" ({stage.name})"
    ended = math.isfinite(stage.end)
    span = f"{stage.start:.5g} s to {stage.end:.5g} s" if ended else f"from {stage.start:.5g} s, not ended"
    title = f"Stage {stage.number}: {stage.kind}{own}, {span}" + (f"; {stage.reason}" if stage.reason else "")

    def pair(label: str, name: str, form: str, unit: str = "") -> tuple[str, str]:
        before, after = stage.before[name], stage.after[name]
        largest = max((abs(v) for v in (before, after) if math.isfinite(v)), default=0.0)
        scale, shown = display_unit(unit, largest) if unit else (1.0, "")
        return f"{label} [{shown}]" if shown else label, arrow(before / scale, after / scale, form)

    rows = [
        pair("kinetic energy", "kinetic", ".4g", "J"),
        pair("rotational energy", "rotational", ".4g", "J"),
        pair("potential energy", "potential", ".5g", "J"),
        pair("centre of mass x", "center_x", ".4g", "m"),
        pair("centre of mass y", "center_y", ".4g", "m"),
        pair("centre of mass z", "center_z", ".4g", "m"),
        pair("highest point", "top", ".4g", "m"),
        pair("contact points", "contacts", ".0f"),
        pair("touching pairs", "touching", ".0f"),
        pair("touching neighbours of a body", "coordination", ".2f"),
        pair("largest penetration", "penetration", ".2g", "m"),
        pair("moving bodies (over 1 mm/s)", "moving", ".0f"),
        pair("escaped bodies", "escaped", ".0f"),
    ]
    if any(math.isfinite(state["fill_height"]) for state in (stage.before, stage.after)):
        rows += [pair("fill height", "fill_height", ".4g", "m"), pair("void ratio of the fill", "void_ratio", ".3f")]
    rows += [
        ("largest penetration in the stage", with_unit(stage.penetration_largest, "m", ".2g")),
        ("largest speed in the stage", with_unit(stage.speed_largest, "m/s")),
        ("solver", _work(stage.solver)),
    ]
    return Block(title, ("", "before -> " + ("after" if ended else "so far")), tuple(rows), left=2)


def _work(solver: Solver) -> str:
    capped = f", {solver.capped:.0f} capped" if solver.capped else ""
    return (
        f"{solver.steps:,.0f} steps, {solver.impacts:,.0f} impacts, a step {number(solver.impact_iterations, '.3g')} iterations "
        f"and {number(solver.load_sweeps, '.3g')} sweeps{capped}"
    )


def _solver(solver: Solver) -> Block:
    rows = (
        ("steps", f"{solver.steps:,.0f}"),
        ("groups with an impact solved", f"{solver.impacts:,.0f}"),
        ("iterations for impacts, mean of a step", number(solver.impact_iterations, ".4g")),
        ("sweeps for lasting contacts, mean of a step", number(solver.load_sweeps, ".4g")),
        ("most iterations of one solve", number(solver.most_iterations, ",.0f")),
        ("solves that hit a cap", number(solver.capped, ",.0f")),
        ("largest change that a solve ended with", with_unit(solver.residual, "m/s", ".2g")),
        ("most groups of touching bodies", number(solver.islands, ",.0f")),
        ("contact points of the largest group", number(solver.largest_island, ",.0f")),
    )
    return Block("Solver", (), rows)


def _energy(e: BodyEnergy) -> Block:
    scale, unit = display_unit("J", max(abs(e.stored_start), abs(e.energy_in), abs(e.stored_total)))

    def row(label: str, value: float) -> tuple[str, str]:
        return label, number(value / scale, ".5g")

    rows = [
        row("stored at the start", e.stored_start),
        row("work of the shaking", e.work),
        row("gained (+) or lost (-) where penetrating bodies are moved apart", e.projection),
        row("stored at the end", e.stored_total),
        *(row(f"  {LABELS[name]}", value) for name, value in e.stored.items()),
        row("lost", e.lost_total),
        *(row(f"  {LABELS[name]}", value) for name, value in e.lost.items()),
        row("residual", e.residual),
        row("energy put in", e.energy_in),
        ("residual over energy put in", number(e.residual_ratio, ".1e")),
        ("  largest of the run", number(e.residual_largest_ratio, ".1e")),
    ]
    return Block("Energy", ("", f"[{unit}]"), tuple(rows))


def _check(check: Check) -> list[Block]:
    header = tuple(head for head, _ in check.columns.values())
    rows = tuple(tuple(number(row[name], FORMS[name]) for name in check.columns) for row in check.rows)
    found = [Block(check.title, header, rows, left=0)] if rows else []
    notes = tuple((note,) for note in check.notes)
    return [*found, Block("" if found else check.title, (), notes)] if notes else found


def _runout(found: RunoutSummary) -> Block:
    header = ("", *(f"{share:g} %" for share in found.shares))
    scale, unit = display_unit("m", found.distance[-1])
    rows = (
        (f"horizontal distance [{unit}]", *(number(value / scale, ".4g") for value in found.distance)),
        (f"drop [{unit}]", *(number(value / scale, ".4g") for value in found.drop)),
        ("angle of reach [deg]", *(number(math.degrees(value), ".3g") for value in found.angle)),
    )
    counts = f"{found.at_rest} at rest, {found.escaped} escaped"
    title = f"Run-out of the bodies from where they started, quantiles; mean distance {with_unit(found.distance_mean, 'm')}; {counts}"
    return Block(title, header, rows)
