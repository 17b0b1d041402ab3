"""A comparison as tables of text."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

from dem_cli.report.cases import Case, Pooled
from dem_cli.report.compare import Comparison
from dem_cli.report.moved import Moved
from dem_cli.report.text import NOTHING, Block, number
from dem_cli.report.thesis_checks import text

WIDTH = 118  # of running text
HEAD = ("case", "shaking")


def blocks(found: Comparison, *, grains: bool = False) -> list[Block]:
    """The tables of a comparison; with `grains` a row for each tracked grain too."""
    shown = [_void_ratios(found.cases), _contacts(found.cases), _motion(found.cases)]
    if grains:
        shown.append(_grains(found.cases))
    if found.effects:
        shown.append(_effects(found))
    if found.beside:
        shown.append(_beside(found))
    if found.checks or found.uncovered:
        shown.append(_checks(found))
    if found.why:
        shown.append(Block("Where the thesis and these runs part", (), tuple(_wrapped(found.why))))
    if found.said:
        shown.append(Block("Warnings", (), tuple((line,) for line in found.said)))
    return [block for block in shown if block.rows]


def _wrapped(lines: Sequence[str]) -> list[tuple[str, ...]]:
    return [
        (part,)
        for line in lines
        for part in textwrap.wrap(line, WIDTH, initial_indent="- ", subsequent_indent="  ", break_long_words=False)
    ]


def _void_ratios(cases: Sequence[Case]) -> Block:
    def row(case: Case) -> tuple[str, ...]:
        first, m = case.first, case.measures
        return (
            case.kind,
            case.shaking,
            case.who,
            f"{first.grains}/{first.elements}" if first.elements != first.grains else str(first.grains),
            *(text(m[f"void_ratio_{state}"], form) for state, form in ENDS),
            *(text(m[f"inner_{state}"], form) for state, form in ENDS),
            "complete" if case.complete else f"INCOMPLETE: {first.stop_reason}",
        )

    header = (
        *HEAD, "run", "grains/elements", "void ratio packed", "shaken", "change", "inner window packed", "shaken", "change", "state",
    )  # fmt: skip
    return Block("Void ratio before and after shaking", header, tuple(map(row, cases)), left=3)


ENDS = (("packed", ".4f"), ("shaken", ".4f"), ("change", "+.4f"))


def _contacts(cases: Sequence[Case]) -> Block:
    def row(case: Case) -> tuple[str, ...]:
        m = case.measures
        return (
            *_head(case),
            _pair(m["coordination_packed"], m["coordination_shaken"], ".2f"),
            _pair(m["sliding_packed"], m["sliding_shaken"], ".2g", 100.0),
            _pair(m["roughness_packed"], m["roughness_shaken"], ".3g", 1e3),
            text(m["tilt"], ".3f"),
            text(m["displaced"], ".3g", 1e3),
            text(m["speed"], ".3g", 1e3),
            text(m["airborne_most"], ".4g"),
            text(m["escaped"], ".4g"),
            text(m["bond_gap"], ".1e"),
        )

    header = (
        *HEAD, "coordination", "sliding [%]", "roughness [mm]", "tilt/depth", "displaced [mm]",
         "velocity [mm/s]", "most airborne", "escaped", "bond gap/radius",
    )  # fmt: skip
    title = "Contacts and surface, packed -> shaken; while shaken: tilt of the surface, rms displacement and velocity of all grains"
    return Block(title, header, tuple(map(row, cases)), left=2)


def _head(case: Case) -> tuple[str, str]:
    return case.kind, case.shaking


def _pair(before: Pooled, after: Pooled, form: str, factor: float = 1.0) -> str:
    if not (before.n or after.n):
        return NOTHING
    return f"{text(before, form, factor)} -> {text(after, form, factor)}"


MOVED = (
    ("x", "|x| [mm]", 1e3),
    ("y", "y [mm]", 1e3),
    ("turn", "|turn| [deg]", math.degrees(1.0)),
    ("excursion", "furthest [mm]", 1e3),
    ("path", "path [mm]", 1e3),
    ("speed", "rms velocity [mm/s]", 1e3),
    ("speed_start", "in first second", 1e3),
)


def _motion(cases: Sequence[Case]) -> Block:
    rows = []
    for case in cases:
        stages = next((run.moved for run in case.runs if run.moved), ())
        for one, mean in zip(stages, case.moved, strict=False):
            label = f"{case.shaking}, stage {one.stage}" if len(stages) > 1 else case.shaking
            cells = (text(mean[name], ".3g", factor) for name, _, factor in MOVED)
            rows.append((case.kind, label, str(len(one.ways)), *cells))
    header = (*HEAD, "grains", *(label for _, label, _ in MOVED))
    return Block("Tracked grains, mean over them: net displacement, and what led to it", header, tuple(rows), left=2)


def _grains(cases: Sequence[Case]) -> Block:
    def row(case: Case, file: str, one: Moved, k: int) -> tuple[str, ...]:
        way = one.ways[k]
        return (
            *_head(case),
            file,
            str(one.stage),
            str(way.grain),
            *(number(getattr(way, name) * factor, ".3g") for name, _, factor in MOVED),
        )

    rows = [
        row(case, run.file, one, k)
        for case in cases
        for run in case.runs
        for one in run.moved
        for k in range(len(one.ways))
    ]
    header = (*HEAD, "file", "stage", "No.", *(label.replace("|", "") for _, label, _ in MOVED))
    return Block("Each tracked grain", header, tuple(rows), left=3)


def _effects(found: Comparison) -> Block:
    rows = tuple(
        (
            one.setting,
            f"{NOTHING if one.one is None else one.one} -> {NOTHING if one.other is None else one.other}",
            one.of,
            text(one.packed, "+.4f"),
            text(one.shaken, "+.4f"),
        )
        for one in found.effects
    )
    header = ("setting", "", "of", "void ratio packed", "shaken")
    return Block("What one setting does, all else and the seeds equal", header, rows, left=3)


def _beside(found: Comparison) -> Block:
    """Two rows a case: void ratio and porosity, each packed, shaken and what changed."""
    rows = []
    for k in range(0, len(found.beside), 3):
        three = found.beside[k : k + 3]
        percent = three[0].quantity == "porosity"
        factor, form, printed = (100.0, ".2f", ".2f") if percent else (1.0, ".4f", ".3f")
        cells = []
        for one in three:
            sign = "+" if one.state == "change" else ""
            cells += [text(one.here, sign + form, factor), number(one.thesis * factor, sign + printed)]
            cells.append(number(one.difference * factor, "+" + form))
        rows.append((three[0].kind, f"{three[0].quantity}{' [%]' if percent else ''}", *cells, three[0].figures))
    header = (
        "case",
        "",
        *(name for state in ("packed", "shaken", "change") for name in (state, "thesis", "diff.")),
        "figures",
    )
    return Block("Beside the thesis, 400 gal 10 Hz", header, tuple(rows), left=2)


def _checks(found: Comparison) -> Block:
    """Two rows a statement: what the thesis says, and what is measured."""
    rows: list[tuple[str, ...]] = []
    for one in found.checks:
        rows.append(("holds" if one.holds else "does not hold", one.source, one.statement))
        rows.append(("", "", f"    {one.numbers}  ({one.of})"))
    rows += [("not covered", *line.split(", ", 1)) for line in found.uncovered]
    return Block("What the thesis says", (), tuple(rows), left=3)
