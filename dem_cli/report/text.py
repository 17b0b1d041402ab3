"""A summary as text: aligned columns, plain for pipes and files, with rich's looks on a terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import IO

from dem_cli.report.look import display_unit
from dem_cli.report.motions import FORMATS, Motion, Record
from dem_cli.report.summary import EnergySummary, Run, Sloshing, StageSummary, Summary

NOTHING = "-"
LOST_LABELS = {
    "friction": "friction",
    "dashpot_normal": "dashpot, normal",
    "dashpot_tangential": "dashpot, tangential",
    "bond_energy": "bonds",
    "damping": "damping",
    "escaped_energy": "escaped grains",
}


@dataclass(frozen=True)
class Block:
    """A table: title, header (may be empty) and rows of cells. The first `left` columns are flush left, the
    others right.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    left: int = 1


def number(value: float, form: str = ".4g", unit: str = "") -> str:
    """`value` in `form` with its unit; a dash if it is not defined."""
    if not math.isfinite(value):
        return NOTHING
    text = format(value, form)
    if text.startswith("-") and text[1:] == format(0.0, form).lstrip("+"):
        text = text[1:]  # no -0.000
    return f"{text} {unit}" if unit else text


def with_unit(value: float, unit: str, form: str = ".4g") -> str:
    """A value in SI `unit`, shown in the unit that it reads well in."""
    scale, name = display_unit(unit, abs(value))
    return number(value / scale, form, name)


def arrow(before: float, after: float, form: str) -> str:
    return f"{number(before, form)} -> {number(after, form)}"


def blocks(summary: Summary) -> list[Block]:
    """The report of one run."""
    found = [_head(summary.run)]
    for stage in summary.stages:
        found.append(_stage(stage, summary.run))
        if stage.motion is not None:
            found.append(_motion(stage.motion))
        if stage.sloshing is not None:
            found.append(_sloshing(stage.sloshing, recorded=stage.motion is not None))
    if summary.energy is not None:
        found.append(_energy(summary.energy))
    if summary.warnings:
        found.append(Block("Warnings", (), tuple((line,) for line in summary.warnings)))
    return found


def comparison(summaries: Sequence[Summary]) -> Block:
    """One row a run: the sample after the first stage (before it, if it is the only one) and at the end."""
    header = (
        "file",
        "grains",
        "shape",
        "seed",
        "shaking",
        "void ratio",
        "inner",
        "depth [m]",
        "coord.",
        "esc.",
        "residual",
        "wall",
        "state",
    )
    return Block("", header, tuple(_row(s) for s in summaries))


def _row(summary: Summary) -> tuple[str, ...]:
    run = summary.run
    shaken = [s for s in summary.stages if s.kind == "shake"]
    pairs = [NOTHING] * 4
    escaped = math.nan
    if summary.stages:
        first, last = summary.stages[0], summary.stages[-1]
        before = first.after if len(summary.stages) > 1 else first.before
        forms = {"void_ratio": ".3f", "void_ratio_inner": ".3f", "depth": ".4g", "coordination": ".2f"}
        pairs = [arrow(before[name], last.after[name], form) for name, form in forms.items()]
        escaped = last.after["escaped"]
    return (
        run.file,
        str(run.grains),
        run.shape,
        str(run.seed),
        "; ".join(_shaking(s) for s in shaken) or NOTHING,
        *pairs,
        number(escaped, ".0f"),
        number(summary.energy.residual_largest_ratio if summary.energy else math.nan, ".1e"),
        with_unit(run.wall_time, "s", ".3g"),
        "complete" if run.complete else "incomplete",
    )


def _shaking(stage: StageSummary) -> str:
    if stage.motion is not None:
        return ", ".join(f"{one.name} {number(100.0 * one.peak, '.4g')} gal" for one in stage.motion.components)
    return f"{number(stage.amplitude * 100.0, '.4g')} gal {number(stage.frequency, '.4g')} Hz"


def _head(run: Run) -> Block:
    height = f", {with_unit(run.height, 'm')} high" if math.isfinite(run.height) else ", walls without end"
    pace = f", {number(run.steps_per_second, ',.0f')} steps/s, {number(run.element_steps_per_second / 1e6, '.3g')} million element-steps/s"
    rows = (
        ("file", run.file),
        ("program", f"dem-cli {run.version}, engine {run.engine}"),
        ("scenario", f"{run.scenario_hash}, seed {run.seed}"),
        ("grains", grains_text(run)),
        ("container", f"{with_unit(run.width, 'm')} wide{height}, {with_unit(run.depth, 'm')} deep"),
        (
            "state",
            ("complete" if run.complete else "INCOMPLETE") + (f": {run.stop_reason}" if run.stop_reason else ""),
        ),
        ("time", f"{run.simulated_time:.5g} s simulated in {run.steps:,.0f} steps"),
        ("computing", NOTHING if math.isnan(run.wall_time) else with_unit(run.wall_time, "s", ".3g") + pace),
    )
    return Block(run.title or run.file, (), rows, left=2)


def grains_text(run: Run) -> str:
    """How many grains of which shape, and of how many elements."""
    if run.bonds:
        return f"{run.grains}, made of {run.elements} discs and {run.bonds} bonds"
    if run.elements > run.grains:
        return f"{run.grains} rigid clumps, made of {run.elements} discs"
    low, high = run.aspect_ratio
    if not high > 1.0:
        return f"{run.grains} discs"
    kinds = "ellipses" if low > 1.0 else "discs and ellipses"
    ratio = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
    return f"{run.grains} {kinds}, aspect ratio {ratio}"


def _stage(stage: StageSummary, run: Run) -> Block:
    own = "" if stage.name in ("", stage.kind) else f" ({stage.name})"
    shaking = f", {_shaking(stage)}" if stage.kind == "shake" else ""
    ended = math.isfinite(stage.end)
    span = f"{stage.start:.5g} s to {stage.end:.5g} s" if ended else f"from {stage.start:.5g} s, not ended"
    title = f"Stage {stage.number}: {stage.kind}{own}{shaking}, {span}"
    if stage.reason:
        title += f"; {stage.reason}"
    depths = (stage.before["depth"], stage.after["depth"])
    scale, unit = display_unit("m", max((v for v in depths if not math.isnan(v)), default=0.0))
    shown = (
        ("void ratio, whole fill", "void_ratio", ".3f", 1.0, "+.4f"),
        ("void ratio, inner window", "void_ratio_inner", ".3f", 1.0, "+.4f"),
        ("porosity, whole fill [%]", "porosity", ".2f", 100.0, "+.2f"),
        ("porosity, inner window [%]", "porosity_inner", ".2f", 100.0, "+.2f"),
        (f"fill depth [{unit}]", "depth", "#.4g", 1.0 / scale, "+.3g"),
        (f"surface roughness [{unit}]", "roughness", "#.3g", 1.0 / scale, "+.3g"),
        ("coordination number", "coordination", ".2f", 1.0, "+.2f"),
        ("airborne grains", "airborne", ".0f", 1.0, "+.0f"),
        ("escaped grains", "escaped", ".0f", 1.0, "+.0f"),
        ("largest overlap / radius", "max_overlap", ".1e", 1.0, "+.1e"),
    )
    afters = [number(stage.after[name] * factor, form) for _, name, form, factor, _ in shown]
    width = max(map(len, afters))
    rows = []
    for (label, name, form, factor, change), after in zip(shown, afters, strict=True):
        before = stage.before[name]
        share = ""
        if name in ("void_ratio", "void_ratio_inner", "porosity", "porosity_inner", "depth", "coordination"):
            share = number(100.0 * stage.change[name] / before if before else math.nan, "+.1f", "%")
        pair = f"{number(before * factor, form)} -> {after.ljust(width)}"
        rows.append((label, pair, number(stage.change[name] * factor, change), share))
    rows.append(("most airborne in the stage", number(stage.airborne_largest, ".0f").ljust(width), "", ""))
    rows.append(("largest overlap in the stage", number(stage.overlap_largest, ".1e").ljust(width), "", ""))
    if math.isfinite(stage.bond_gap_largest):
        strains = (
            ("largest bond gap / radius", stage.bond_gap_largest / run.element_radius),
            ("largest bond slip / radius", stage.bond_slip_largest / run.element_radius),
            ("largest bond roll [deg]", math.degrees(stage.bond_roll_largest)),
        )
        rows += [(label, number(value, ".1e").ljust(width), "", "") for label, value in strains]
    head = "before -> " + ("after" if ended else "so far").ljust(width)
    return Block(title, ("", head, "change", ""), tuple(rows))


def _motion(m: Motion) -> Block:
    """Recorded and used motion, a column for each component."""

    def row(label: str, *cells: str) -> tuple[str, ...]:
        return (label, *cells)

    def both(one: Record, when: str) -> str:
        """Velocity and displacement at the end; what is rounding alone is zero."""
        velocity, place = (getattr(one, f"residual_{what}{when}") for what in ("velocity", "displacement"))
        velocity = 0.0 if abs(velocity) < 1e-9 * one.peak_velocity else velocity
        place = 0.0 if abs(place) < 1e-9 * one.peak_displacement else place
        return f"{number(100.0 * velocity, '.3g')} cm/s, {number(100.0 * place, '.3g')} cm"

    parts = m.components
    rows = (
        row("component", *(one.component or NOTHING for one in parts)),
        row("format", *(FORMATS.get(one.format, one.format) for one in parts)),
        row("understood", *(one.understood for one in parts)),
        row(
            "recorded",
            *(f"{in_seconds(one.recorded_duration)} every {in_seconds(one.recorded_interval)}" for one in parts),
        ),
        row("used", *(f"{in_seconds(m.duration)} every {in_seconds(m.interval)}" for _ in parts)),
        row("peak, recorded", *(number(100.0 * one.recorded_peak, ".4g", "gal") for one in parts)),
        row("peak, used", *(number(100.0 * one.peak, ".4g", "gal") for one in parts)),
        row("  factor", *(number(one.factor, ".4g") for one in parts)),
        row("  velocity", *(number(100.0 * one.peak_velocity, ".3g", "cm/s") for one in parts)),
        row("  displacement", *(number(100.0 * one.peak_displacement, ".3g", "cm") for one in parts)),
        row("left at the end, as recorded", *(both(one, "_before") for one in parts)),
        row(f"left at the end, baseline {m.baseline}", *(both(one, "") for one in parts)),
        row("predominant period", *(in_seconds(one.predominant_period) for one in parts)),
        row("Arias intensity", *(number(one.arias, ".3g", "m/s") for one in parts)),
        row("  5 to 95 % of it within", *(in_seconds(one.significant_duration) for one in parts)),
    )
    return Block("Recorded motion", ("", *(one.name for one in parts)), rows, left=1 + len(parts))


def in_seconds(value: float) -> str:
    return with_unit(value, "s")


def _sloshing(s: Sloshing, *, recorded: bool = False) -> Block:
    def seconds(value: float) -> str:
        return number(value, ".4g", "s")

    amplitude = with_unit(s.amplitude, "m", ".3g")
    found = f"{seconds(s.period)} +- {number(s.period_resolution, '.2g', 's')}, amplitude {amplitude}"
    if s.is_driving:
        found += " (the driving)"
    free = f"{seconds(s.free_period)}, amplitude {with_unit(s.free_amplitude, 'm', '.3g')}"
    rows = [
        (
            f"liquid {with_unit(s.depth, 'm')} deep",
            f"T1 {seconds(s.theory_T1)}, T2 {seconds(s.theory_T2)}, T3 {seconds(s.theory_T3)}",
        ),
        ("thesis' formula (7.2)", f"T1 {seconds(s.thesis_T1)}"),
        ("predominant period of the ground" if recorded else "driving period", seconds(s.driving_period)),
        ("period of the surface", found if math.isfinite(s.period) else f"none: {s.reason}"),
        ("  over that of the ground" if recorded else "  over driving period", number(s.ratio, ".3f")),
        ("  beside the driving", free if math.isfinite(s.free_period) else "none"),
        ("largest mode amplitude", with_unit(s.mode_largest, "m", ".3g")),
    ]
    if recorded:  # no single oscillation drives it, and none was taken out
        del rows[-2]
    return Block("Sloshing (a liquid's formula is a reference line for grains)", (), tuple(rows), left=2)


def _energy(e: EnergySummary) -> Block:
    scale, unit = display_unit("J", max(abs(e.stored_start), abs(e.energy_in), abs(e.stored_total)))

    def row(label: str, value: float) -> tuple[str, str]:
        return label, number(value / scale, ".5g")

    rows = [
        row("stored at the start", e.stored_start),
        row("work of the shaking", e.work),
        row("gained (+) or lost (-) by the time step", e.time_step_energy),
        row("stored at the end", e.stored_total),
        *(row(f"  {name.replace('_', ', ')}", value) for name, value in e.stored.items()),
        row("lost", e.lost_total),
        *(row(f"  {LOST_LABELS[name]}", value) for name, value in e.lost.items()),
        row("residual", e.residual),
        row("energy put in", e.energy_in),
        ("residual over energy put in", number(e.residual_ratio, ".1e")),
        ("  largest of the run", number(e.residual_largest_ratio, ".1e")),
    ]
    return Block("Energy", ("", f"[{unit}]"), tuple(rows))


def plain(block: Block) -> str:
    """Aligned text without colour or rules, one line a row."""
    lines = [block.header, *block.rows] if block.header else list(block.rows)
    count = max((len(line) for line in lines), default=0)
    widths = [max(len(line[k]) for line in lines if k < len(line)) for k in range(count)]
    out = [block.title] if block.title else []
    indent = "  " if block.title else ""
    for line in lines:
        cells = (
            cell.ljust(w) if k < block.left else cell.rjust(w)
            for k, (cell, w) in enumerate(zip(line, widths, strict=False))
        )
        out.append((indent + "  ".join(cells)).rstrip())
    return "\n".join(out)


def show(found: Sequence[Block], stream: IO[str]) -> None:
    """Print blocks to `stream`: with rich if it is a terminal, else plain."""
    if not stream.isatty():
        stream.write("\n\n".join(plain(block) for block in found) + "\n")
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(file=stream, highlight=False)
    for block in found:
        loud = "yellow" if block.title == "Warnings" else ""
        if block.title:
            console.print(Text(block.title, style=loud or "bold"))
        table = Table(
            box=None, show_header=bool(block.header), padding=(0, 2, 0, 0), header_style="dim", pad_edge=False
        )
        columns = max((len(row) for row in block.rows), default=1)
        for k in range(columns):
            head = block.header[k] if block.header else ""
            table.add_column(Text(head), justify="left" if k < block.left else "right", overflow="fold")
        for row in block.rows:
            table.add_row(*[Text(cell, style=loud) for cell in row])
        console.print(table)
        console.print()
