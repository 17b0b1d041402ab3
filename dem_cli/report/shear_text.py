"""A quasi-static test as tables of text: one file in blocks, several in one table, seeds pooled."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dem_cli.report.shear import ShearSummary, StageReport, Test
from dem_cli.report.shear_measures import Cycle, Point, Shearing, Solver
from dem_cli.report.text import NOTHING, Block, arrow, number, with_unit

MOST_EVENTS = 12  # that are listed one by one
MOST_CYCLES = 24
POOLED = 3  # files of equal settings from which on their mean is shown
HOLDS = {
    "mean-stress": "mean stress constant",
    "lateral-stress": "lateral stress constant",
    "volume": "volume constant",
    "lateral-strain": "no lateral strain",
}


def blocks(summary: ShearSummary) -> list[Block]:
    """The report of one file."""
    found = [_head(summary.test)]
    for stage in summary.stages:
        found.append(_stage(stage))
        if stage.shearing is not None:
            found.append(_shearing(stage, stage.shearing))
            found.append(_energy(stage, stage.shearing))
            if stage.shearing.cycles:
                found.append(_cycles(stage, stage.shearing))
    if summary.warnings:
        found.append(Block("Warnings", (), tuple((line,) for line in summary.warnings)))
    return found


def _head(test: Test) -> Block:
    state = ("complete" if test.complete else "INCOMPLETE") + (f": {test.stop_reason}" if test.stop_reason else "")
    boundary = f", {test.boundary_elements} boundary grains" if test.boundary_elements else ""
    rows = (
        ("file", test.file),
        ("program", f"dem-cli {test.version}, engine {test.engine}"),
        ("scenario", f"{test.scenario_hash}, seed {test.seed}"),
        ("grains", f"{test.grains} discs, {with_unit(test.depth, 'm')} deep"),
        ("boundary", test.boundary + boundary),
        ("state", state),
        ("computing", f"{test.increments} increments in {with_unit(test.wall_time, 's', '.3g')}"),
    )
    return Block(test.title or test.file, (), rows, left=2)


def _stage(stage: StageReport) -> Block:
    def pair(label: str, name: str, form: str, factor: float = 1.0) -> tuple[str, str]:
        return label, arrow(stage.before[name] * factor, stage.after[name] * factor, form)

    rows = [
        pair("void ratio", "void_ratio", ".4f"),
        pair("porosity [%]", "porosity", ".2f", 100.0),
        pair("coordination number", "coordination", ".3f"),
        pair("grains with fewer than two contacts", "rattlers", ".0f"),
        pair("sliding contacts [%]", "sliding", ".1f", 100.0),
        pair("mean stress [kPa]", "mean_stress", ".5g", 1e-3),
        pair("stress across x [kPa]", "stress_x", ".5g", 1e-3),
        pair("stress across y [kPa]", "stress_y", ".5g", 1e-3),
        pair("largest overlap / radius", "max_overlap", ".1e"),
        *_solver(stage.solver),
    ]
    return Block(_title(stage), ("", "before -> after" if stage.ended else "before -> so far"), tuple(rows), left=2)


def _title(stage: StageReport) -> str:
    own = "" if stage.name in ("", stage.kind) else f" ({stage.name})"
    how = f", {HOLDS.get(stage.hold, stage.hold)}" if stage.hold else ""
    axial = ", axial direction x" if stage.shearing is not None and stage.axial == "x" else ""
    branch = f", from the end of {stage.branch}" if stage.branch else ""
    end = f"; {stage.reason}" if stage.reason else "" if stage.ended else "; not ended"
    return f"Stage {stage.number}: {stage.kind}{own}{how}{axial}{branch}, {stage.increments} increments{end}"


def _solver(s: Solver) -> list[tuple[str, str]]:
    each = f" ({number(s.per_sub_step, '.0f')} a sub-step)" if math.isfinite(s.per_sub_step) else ""
    rung = f", up to rung {s.rung_highest}" if s.fallbacks else ""
    return [
        ("iterations of an increment", f"median {number(s.iterations_median, '.0f')}{each}, largest {number(s.iterations_largest, '.0f')}"),
        ("increments that needed a fallback", f"{s.fallbacks}{rung}"),
        ("events (collapses)", _events(s.events)),
        ("largest fixing force left", with_unit(s.balance_largest, "N", ".2g")),
    ]  # fmt: skip


def _events(events: Sequence[int]) -> str:
    if not events:
        return "none"
    listed = ", ".join(str(k) for k in events[:MOST_EVENTS])
    more = f" and {len(events) - MOST_EVENTS} more" if len(events) > MOST_EVENTS else ""
    return f"{len(events)}: in increment{'s' if len(events) > 1 else ''} {listed}{more}"


def _shearing(stage: StageReport, found: Shearing) -> Block:
    """A row a state: turn of the volume change, peak, end, residual."""

    def row(label: str, p: Point) -> tuple[str, ...]:
        return (
            label,
            str(p.in_stage),
            number(100.0 * p.shear_strain, ".3f"),
            number(100.0 * p.volumetric_strain, "+.4f"),
            number(p.stress_ratio, ".4f"),
            number(p.sine, ".4f"),
            number(p.void_ratio, ".4f"),
        )

    rows = []
    if found.turn is not None:
        label = "turn of the volume change"
        if found.turn.in_stage == 0:
            label = "dilates from the start"
        elif found.peak is not None and found.turn.in_stage == found.peak.in_stage:
            label = "contracts up to the peak"
        rows.append(row(label, found.turn))
    if found.peak is not None:
        rows.append(row("peak of s1/s2", found.peak))
    if found.contraction is not None and found.contraction != found.turn:
        rows.append(row("largest contraction", found.contraction))
    rows.append(row("end", found.end))
    r = found.residual
    if found.cycles:  # a mean over cycles is no state
        return Block("", _points(stage), tuple(rows))
    rows.append(
        (
            f"residual, mean of the last {r.increments}", "", "", number(100.0 * r.volumetric_strain, "+.4f"),
            number(r.stress_ratio, ".4f"), number(r.sine, ".4f"), number(r.void_ratio, ".4f"),
        )
    )  # fmt: skip
    return Block("", _points(stage), tuple(rows))


def _points(stage: StageReport) -> tuple[str, ...]:
    return f"Stage {stage.number}", "increment", "e1 - e2 [%]", "e_v [%]", "s1/s2", "sine", "void ratio"


def _energy(stage: StageReport, found: Shearing) -> Block:
    e, s = found.energy, found.share
    rows = [
        ("work W", number(e.work, ".5g")),
        ("  stored in springs", number(e.elastic, ".5g")),
        ("  dissipated by friction D", number(e.friction, ".5g")),
        ("  released by collapses", f"{number(e.released, '.4g')} ({number(100.0 * e.released_share, '.2g', '%')})"),
        ("  residual", f"{number(e.residual, '.2g')} ({number(e.closure, '.1e')} of sum |dW|)"),
        (
            "largest contact's share in D",
            f"{number(100.0 * s.largest, '.1f', '%')} in increment {s.at}, median {number(100.0 * s.median, '.1f', '%')}"
            if s.at
            else "nothing slides",
        ),
    ]
    if found.undrained is not None:
        u = found.undrained
        rows.append(("largest pore pressure", with_unit(u.pore_pressure_largest, "Pa")))
        rows.append(("least p'/p0", f"{number(u.ratio_least, '.4f')} in increment {u.at}"))
        when = f", in cycle {u.cycle}" if u.cycle else ""
        rows.append(("liquefied (p'/p0 < " + f"{u.limit:g})", f"YES{when}" if u.liquefied else "no"))
    return Block("", (f"Stage {stage.number}", "[J/m³]"), tuple(rows), left=2)


def _cycles(stage: StageReport, found: Shearing) -> Block:
    def row(c: Cycle) -> tuple[str, ...]:
        return (
            f"{c.number}" + ("" if c.whole else " (half)"),
            str(c.last),
            number(100.0 * c.amplitude, ".3g"),
            number(1e-3 * c.mean_stress_least, ".4g"),
            number(1e-3 * c.mean_stress, ".4g"),
            number(1e-3 * c.pore_pressure, ".4g"),
            number(1e-3 * c.pore_pressure_largest, ".4g"),
        )

    cycles = found.cycles
    rows = [row(c) for c in cycles[:MOST_CYCLES]]
    if len(cycles) > MOST_CYCLES:
        rows = [*rows[:-1], (f"... {len(cycles) - MOST_CYCLES} not shown", *[""] * 6), row(cycles[-1])]
    header = (
        f"Stage {stage.number}: cycle", "to increment", "amplitude [%]", "least p' [kPa]", "p' at its end", "pore pressure [kPa]", "largest",
    )  # fmt: skip
    return Block("", header, tuple(rows))


# ---------------------------------------------------------------------------------------------- several files

COLUMNS = (
    "file", "grains", "seed", "e", "coord.", "peak s1/s2", "at step", "turn at", "e_v end [%]", "events", "closure", "state",
)  # fmt: skip


def comparison(summaries: Sequence[ShearSummary], *, each: bool = True) -> Block:
    """One row a file (a stage that shears the sample); three or more of equal settings but the seed get rows of their mean and median.

    each: False leaves out the rows of the files that are in a mean.
    """
    several = any(len(_sheared(one)) > 1 for one in summaries)
    groups: dict[str, list[tuple[ShearSummary, StageReport | None]]] = {}
    for one in summaries:
        found: list[StageReport | None] = [*_sheared(one)]
        for stage in found or [None]:
            key = json.dumps([one.test.settings, stage.number if stage else 0], sort_keys=True, default=str)
            groups.setdefault(key, []).append((one, stage))
    rows = []
    for group in groups.values():
        whole = [(one.test.seed, _values(one, stage)) for one, stage in group if one.test.complete]
        pooled = len({seed for seed, _ in whole}) >= POOLED
        for one, stage in group:
            if each or not pooled or not one.test.complete:
                rows.append(_row(one, stage, several))
        if pooled:
            rows += _pooled(np.array([values for _, values in whole]), str(group[0][0].test.grains))
    return Block("", COLUMNS, tuple(rows))


def _row(one: ShearSummary, stage: StageReport | None, several: bool) -> tuple[str, ...]:
    """several: files of more than one stage of shearing are among them, so that it is named."""
    name = Path(one.test.file).name
    if several and stage is not None:
        name += f", stage {stage.number} {stage.name or stage.kind}"
    state = "complete" if one.test.complete else "incomplete"
    return (name, str(one.test.grains), str(one.test.seed), *_cells(_values(one, stage)), state)


FORMS = (".4f", ".3f", ".3f", ".0f", ".0f", "+.3f", ".0f", ".1e")


def _sheared(one: ShearSummary) -> list[StageReport]:
    return [stage for stage in one.stages if stage.shearing is not None]


def _values(one: ShearSummary, stage: StageReport | None) -> tuple[float, ...]:
    """Numbers of the columns from `e` to `closure`, in the units of the table."""
    nothing = math.nan
    before = stage.before if stage else one.initial
    state = (before.get("void_ratio", nothing), before.get("coordination", nothing))
    if stage is None or stage.shearing is None:
        return (*state, *[nothing] * 6)
    found = stage.shearing
    return (
        *state,
        found.peak.stress_ratio if found.peak else nothing,
        found.peak.in_stage if found.peak else nothing,
        found.turn.in_stage if found.turn else nothing,
        100.0 * found.end.volumetric_strain,
        len(stage.solver.events),
        found.energy.closure,
    )


def _cells(values: Sequence[float]) -> tuple[str, ...]:
    return tuple(number(value, form) for value, form in zip(values, FORMS, strict=True))


def _pooled(values: np.ndarray[tuple[int, int], np.dtype[np.float64]], grains: str) -> list[tuple[str, ...]]:
    """Two rows: mean +- standard deviation (of n - 1), and median, over the files."""
    mean, median = [], []
    for column, form in zip(values.T, FORMS, strict=True):
        known = column[np.isfinite(column)]
        form = form if form != ".0f" else ".1f"
        spread = f" +- {number(float(known.std(ddof=1)), form.lstrip('+'))}" if len(known) > 1 else ""
        mean.append(number(float(known.mean()), form) + spread if len(known) else NOTHING)
        median.append(number(float(np.median(known)), form) if len(known) else NOTHING)
    count = len(values)
    return [(f"mean of {count} +- sd", grains, "", *mean, ""), (f"median of {count}", grains, "", *median, "")]
