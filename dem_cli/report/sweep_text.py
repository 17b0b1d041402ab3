"""A sweep as tables of text and CSV: a row a case, seeds pooled; failed members apart."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

from dem_cli.analysis.statistics import Estimate
from dem_cli.report.export import Row, write_tables
from dem_cli.report.sweep import Entry, Sweep, SweepCase, tables_of
from dem_cli.report.sweep_axes import Axis
from dem_cli.report.sweep_best import best_point, lines
from dem_cli.report.sweep_measures import MEASURES
from dem_cli.report.text import Block, number, with_unit
from dem_cli.results.layouts import Kind

WIDTH = 118  # of running text
CONFIDENCE = "mean +- half of its 95 % interval"


def blocks(found: Sweep, *, each: bool = False, width: int | None = WIDTH) -> list[Block]:
    """The tables of a sweep; with `each` a row for every member too, if there are several in a case. width: letters that running text is
    folded to, None for lines as long as they are.
    """
    shown = [_head(found)]
    best = best_point(found)
    if best is not None:
        shown.append(Block("Best point", (), _wrapped(lines(best), width)))
    for kind in found.kinds:
        for title, names in tables_of(found, kind):
            shown.append(_pooled(found, kind, title, names))
            if each and found.repeated:
                shown.append(_each(found, kind, f"{title}: each run", names))
    shown += [
        _failed(found),
        _waiting(found),
        Block("Warnings", (), _wrapped([f"- {line}" for line in found.said], width)),
    ]
    return [block for block in shown if block.rows]


def _wrapped(texts: Sequence[str], width: int | None) -> tuple[tuple[str], ...]:
    if width is None:
        return tuple((text,) for text in texts)
    return tuple(
        (part,)
        for text in texts
        for part in textwrap.wrap(text, width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    )


def _head(found: Sweep) -> Block:
    counts = ", ".join(f"{n} {state}" for state, n in found.counts.items() if n) or "none"
    begun = sum(one.begun for one in found.entries)
    begun_text = f" ({begun} begun)" if begun else ""
    seeds = sorted({one.seed for one in found.entries if one.seed is not None})
    rows = [("sweep", str(found.folder)), ("scenario", found.scenario)]
    for axis in found.axes:
        rows.append((f"{'varies' if axis.varies else 'all with'} {axis.label}", " | ".join(axis.with_others)))
    if found.repeated:
        rows.append(("seeds", ", ".join(map(str, seeds))))
    members = "1 member" if len(found.entries) == 1 else f"{len(found.entries)} members"
    rows.append((members, counts + begun_text))
    if found.seconds > 0.0:
        rows.append(("computing", duration(found.seconds)))
    return Block(found.title or found.folder.name, (), tuple(rows), left=2)


def duration(seconds: float) -> str:
    """In s, min or h, whichever reads well."""
    if seconds < 120.0:
        return with_unit(seconds, "s", ".3g")
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


def _axes(found: Sweep) -> list[tuple[int, Axis]]:
    """Those that say which case is which, with their number."""
    return [(k, axis) for k, axis in enumerate(found.axes) if axis.varies]


def _names(found: Sweep, case: SweepCase) -> list[str]:
    return [axis.texts[case.places[k]] for k, axis in _axes(found)] or [case.label]


def _heads(found: Sweep) -> list[str]:
    return [axis.label for _, axis in _axes(found)] or ["case"]


def _left(found: Sweep) -> int:
    """Columns of text before the first one of numbers; numbers of an axis are flush right, the columns of all axes being one."""
    axes = [axis.values is None for _, axis in _axes(found)]
    return len(axes) if all(axes) else max(1, axes.index(False))


def _pooled(found: Sweep, kind: Kind, title: str, names: Sequence[str]) -> Block:
    """Cases of this kind that a member is done of."""
    cases = [case for case in found.cases if case.kind == kind]
    spread = found.repeated and found.main in names
    header, rows = _heads(found), []
    for name in names:
        header.append(MEASURES[name].head)
        if spread and name == found.main:
            header.append("sd")
    for case in cases:
        cells = _names(found, case)
        for name in names:
            value = case.estimate(name)
            cells.append(estimate_text(value, name))
            if spread and name == found.main:
                cells.append(number(value.sd * MEASURES[name].factor, MEASURES[name].form.lstrip("+")))
        rows.append((*cells, case.state))
    head = f"{title} ({CONFIDENCE} over seeds)" if found.repeated else title
    return Block(head, (*header, "runs" if found.repeated else "state"), tuple(rows), left=_left(found))


def estimate_text(value: Estimate, name: str) -> str:
    """`0.2041 +- 0.0012`; the mean alone of one run."""
    measure = MEASURES[name]
    text = number(value.mean * measure.factor, measure.form)
    if value.n < 2 or not measure.spread:
        return text
    return f"{text} +- {number(value.half * measure.factor, measure.form.lstrip('+'))}"


def _each(found: Sweep, kind: Kind, title: str, names: Sequence[str]) -> Block:
    rows = [
        (
            *_names(found, case),
            str(one.seed),
            *(number(one.value(name) * MEASURES[name].factor, MEASURES[name].form) for name in names),
            one.file,
        )
        for case in found.cases
        for one in case.entries
        if one.numbers and one.numbers.kind == kind
    ]
    header = (*_heads(found), "seed", *(MEASURES[name].head for name in names), "file")
    return Block(title, header, tuple(rows), left=_left(found))


def _failed(found: Sweep) -> Block:
    rows = [
        (one.name, *_names(found, case), "-" if one.seed is None else str(one.seed), one.reason or "no reason is known")
        for case in found.cases
        for one in case.entries
        if one.state == "failed"
    ]
    return Block(
        "Failed members", ("member", *_heads(found), "seed", "reason"), tuple(rows), left=len(_heads(found)) + 3
    )


def _waiting(found: Sweep) -> Block:
    count = found.counts["waiting"]
    points = sum("done" not in case.counts for case in found.cases)
    text = f"{count} of {len(found.entries)} members have not been run; the same dem sweep goes on"
    if points and found.repeated:
        text += f". Points without any result: {points} of {len(found.cases)}"
    return Block("Waiting", (), ((text,),) if count else ())


def write_csv(found: Sweep, folder: Path, force: bool = False) -> list[Path]:
    """cases.csv and members.csv in `folder`: SI units, every bit of every number, values of the axes as the manifest has them, NaN as nan.

    ResultsError if one of them exists and `force` is not set; then nothing is written.
    """
    return write_tables({"cases.csv": _cases_table(found), "members.csv": _members_table(found)}, folder, force)


def _known(found: Sweep) -> list[str]:
    return [name for name in MEASURES if found.has(name)]


def _keys(found: Sweep) -> list[str]:
    return list(dict.fromkeys(key for case in found.cases for key in case.settings))


def _cases_table(found: Sweep) -> Iterator[Row]:
    names = _known(found)
    parts = [f"{name} {part}" for name in names for part in ("mean", "sd", "half", "n")]
    yield [*_keys(found), "done", "failed", "waiting", *parts]
    for case in found.cases:
        numbers = [getattr(case.estimate(name), part) for name in names for part in ("mean", "sd", "half", "n")]
        counts = [case.counts.get(state, 0) for state in ("done", "failed", "waiting")]
        yield [*(case.settings.get(key, "") for key in _keys(found)), *counts, *numbers]


def _members_table(found: Sweep) -> Iterator[Row]:
    names = _known(found)
    yield ["member", "file", *_keys(found), "seed", "state", "reason", *names]

    def row(one: Entry) -> Row:
        settings = [one.settings.get(key, "") for key in _keys(found)]
        seed = "" if one.seed is None else one.seed
        return [one.name, one.file, *settings, seed, one.state, one.reason, *(one.value(name) for name in names)]

    yield from map(row, found.entries)
