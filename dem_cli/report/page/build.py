"""Pages of result files and of sweeps, made of the same tables and pictures as `dem report`, `dem compare` and `dem render`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from dem_cli.errors import DemError
from dem_cli.report import (
    compare,
    compare_figures,
    compare_text,
    impulse,
    impulse_text,
    shear,
    shear_curves,
    shear_text,
    sweep_text,
    text,
)
from dem_cli.report import summary as over_time
from dem_cli.report.kinds import WORDS, kind_of
from dem_cli.report.look import style
from dem_cli.report.page.grains import grain_player
from dem_cli.report.page.model import Drawing, Listing, Note, Page, Part, Section
from dem_cli.report.page.pictures import drawing, pictures
from dem_cli.report.page.rigid import body_player
from dem_cli.report.sweep import Entry, Sweep
from dem_cli.report.sweep_best import best_point
from dem_cli.report.sweep_figures import sections as pictures_of
from dem_cli.report.text import NOTHING, Block, with_unit
from dem_cli.results import BodyResults, Results, open_results
from dem_cli.results.manifest import NAME

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BUDGET = 11_000_000  # characters of all players of a page: with pictures and tables it stays below 15 MB
LEAST_BUDGET = 100_000  # of each of many files
MOST_COMPARED = 60  # members of a sweep that are compared run by run; the tables of the sweep hold them all

# Attribute of a file -> what a reader calls it.
PROVENANCE = {
    "program_version": "dem-cli", "git_revision": "git revision", "engine": "engine", "python_version": "Python", "numpy_version": "NumPy",
    "numba_version": "Numba", "h5py_version": "h5py", "platform": "platform", "scenario_hash": "scenario hash", "seed": "seed",
    "started": "started", "stop_reason": "ended", "format_version": "format of the file",
}  # fmt: skip


def file_page(files: Sequence[Path]) -> Page:
    """The page of one result file, or of several of one kind. ResultsError for a file that cannot be read."""
    with ExitStack() as stack:
        opened = [stack.enter_context(open_results(path)) for path in files]
        return _one(opened[0]) if len(opened) == 1 else _several(opened)


# ------------------------------------------------------------------------------------------------ one file


def _one(results: Results) -> Page:
    tables, warnings = _tables(results)
    head, *rest = tables
    sections = [
        Section("Summary", (Block("", head.header, head.rows, head.left),)),
        Section("Grains in motion" if results.kind != "bodies" else "Bodies in motion", player_of(results, BUDGET)),
        Section("Numbers", tuple(rest)),
        Section("Figures", _pictures(results)),
        Section("Scenario and provenance", _sources(results)),
    ]
    return Page(
        title=results.title or results.path.name,
        subtitle=f"{results.path.name}: {WORDS[results.kind]}",
        banners=tuple(_banners(results)),
        warnings=tuple(warnings),
        sections=tuple(section for section in sections if section.parts),
    )


def _tables(results: Results) -> tuple[list[Block], tuple[str, ...]]:
    """The text report's tables, and its other warnings."""
    if isinstance(results, BodyResults):
        body = impulse.body_summary(results)
        found, warnings = impulse_text.blocks(body), body.warnings
    elif results.axis == "increment":
        test = shear.shear_summary(results)
        found, warnings = shear_text.blocks(test), test.warnings
    else:
        run = over_time.summary(results)
        found, warnings = text.blocks(run), run.warnings
    # That it is incomplete stands at the top of the page.
    said = tuple(line for line in warnings if not line.startswith("the run is incomplete"))
    return [block for block in found if block.title != "Warnings"], said


def _banners(results: Results) -> list[str]:
    if results.complete:
        return []
    return [f"Incomplete run: {results.stop_reason}. Numbers and pictures show what was written, up to its last row."]


def player_of(results: Results, budget: int) -> tuple[Part, ...]:
    title = results.title or results.path.name
    found = (
        body_player(results, budget, title)
        if isinstance(results, BodyResults)
        else grain_player(results, budget, title)
    )
    return (Note("The file holds no frames yet."),) if found is None else (found,)


def _pictures(results: Results, *, few: bool = False) -> tuple[Part, ...]:
    with style():
        return tuple(pictures(results, few=few))


def _sources(results: Results) -> tuple[Part, ...]:
    """Scenario and provenance."""
    wall = float(results.attrs.get("wall_time", math.nan))
    rows = [
        (label, str(results.attrs[name])) for name, label in PROVENANCE.items() if results.attrs.get(name, "") != ""
    ]
    rows.append(("computed in", with_unit(wall, "s", ".3g")))
    rows.append(("file", f"{results.path.name}, {results.path.stat().st_size / 1e6:,.1f} MB"))
    rows.append(("state", results.status))
    parts: list[Part] = [Block("Provenance", (), tuple(rows), left=2)]
    for name, title in (("scenario", "Scenario as given"), ("resolved", "Scenario with all defaults")):
        if str(results.attrs.get(name, "")).strip():
            parts.append(Listing(title, str(results.attrs[name])))
    return tuple(parts)


# ------------------------------------------------------------------------------------------------ several files


def _several(opened: Sequence[Results]) -> Page:
    files = [results.path for results in opened]
    blocks, drawings, warnings = comparison(files)
    budget = max(BUDGET // len(opened), LEAST_BUDGET)
    sections = [Section("Comparison", (*blocks, *drawings))]
    for number, results in enumerate(opened, start=1):
        tables, said = _tables(results)
        # A comparison has the warnings of its runs already.
        warnings += [f"{results.path.name}: {line}" for line in said if not any(line in other for other in warnings)]
        parts = (
            *player_of(results, budget),
            *tables[:1],
            *_pictures(results, few=True),
            *_folded(tables[1:]),
            *_sources(results),
        )
        sections.append(Section(f"{number}. {results.path.name}", parts))
    banners = [f"{results.path.name}: {line}" for results in opened for line in _banners(results)]
    return Page(
        title=f"{len(opened)} runs compared",
        subtitle=", ".join(path.name for path in files),
        banners=tuple(banners),
        warnings=tuple(dict.fromkeys(warnings)),
        sections=tuple(sections),
    )


def _folded(blocks: Sequence[Block]) -> list[Part]:
    return [Listing("All numbers", "\n\n".join(text.plain(block) for block in blocks))] if blocks else []


def comparison(files: Sequence[Path]) -> tuple[list[Block], list[Drawing], list[str]]:
    """Tables, pictures and warnings of several complete or incomplete runs of one kind."""
    kind = kind_of(files)
    with ExitStack() as stack:
        opened = [stack.enter_context(open_results(path)) for path in files]
        if kind == "bodies":
            bodies = [impulse.body_summary(results) for results in opened if isinstance(results, BodyResults)]
            return [_titled("The runs", impulse_text.comparison(bodies))], [], []
        if kind == "increment":
            tests = [shear.shear_summary(results) for results in opened]
            with style():
                curves = _tried(lambda: shear_curves.draw_compared(opened, None), "Stress and strain", "a curve a file")
            return [_titled("The tests", shear_text.comparison(tests))], curves, []
        runs = [over_time.summary(results) for results in opened]
    found = compare.compare(files)
    blocks = [_titled("The runs", text.comparison(runs))]
    blocks += [block for block in compare_text.blocks(found) if block.title != "Warnings"]
    with style():
        drawings = _tried(
            lambda: compare_figures.draw_table(found.cases),
            "Before and after shaking",
            "Void ratio and roughness packed (ring) and after shaking (dot), and airborne grains, of each case",
        )
        sines = [case.sine for case in found.cases if case.sine]
        if min((len(set(values)) for values in zip(*sines, strict=True)), default=0) > 1:
            drawings += _tried(
                lambda: compare_figures.draw_grid(found.cases),
                "Change of the void ratio",
                "Over amplitude and frequency of the shaking, a matrix for each kind of grains",
            )
    return blocks, drawings, list(found.said)


def _titled(title: str, block: Block) -> Block:
    return block if block.title else Block(title, block.header, block.rows, block.left)


def _tried(draw: Callable[[], Figure], title: str, caption: str) -> list[Drawing]:
    """The picture, if the files hold what it needs. Call inside `look.style()`."""
    try:
        return [drawing(draw(), title, f"{caption}.", f"{title}: {caption[0].lower()}{caption[1:]}.")]
    except DemError:
        return []


# ------------------------------------------------------------------------------------------------ a sweep


def sweep_page(found: Sweep) -> Page:
    """The page of a sweep: its tables and pictures, a member of the best point in motion, what became of each one, then those that are done
    compared, and where they come from.
    """
    with ExitStack() as stack:
        one, why = shown_member(found)
        results = stack.enter_context(open_results(found.folder / one.file)) if one else None
        return _of_sweep(found, results, f"{one.name}{why}" if one else "")


def shown_member(found: Sweep) -> tuple[Entry | None, str]:
    """The member that stands for the sweep: a run of its best point, else the first one that is done; and why, in words."""
    best = best_point(found)
    if best is not None:
        return next(one for one in found.cases[best.case].entries if one.numbers), ", of the best point"
    return next((one for one in found.entries if one.numbers), None), ""


def _of_sweep(found: Sweep, shown: Results | None, label: str) -> Page:
    head, *tables = [block for block in sweep_text.blocks(found, width=None) if block.title != "Warnings"]
    with style():
        drawings = [
            drawing(figure, title, caption, f"{title}: {caption}") for title, caption, figure in pictures_of(found)
        ]
    sections = [
        Section("Summary", (Block("", head.header, head.rows, head.left),)),
        Section("Figures", tuple(drawings)),
        Section("Tables", tuple(tables)),
        *([Section(f"In motion: {label}", player_of(shown, BUDGET))] if shown else []),
        Section("Members", (members(found),)),
    ]
    done = [found.folder / one.file for one in found.entries if one.state == "done"]
    if len(found.kinds) == 1 and len(done) <= MOST_COMPARED:
        blocks, more, _ = comparison(done)
        sections.append(Section("Runs compared", (*blocks, *more)))
    manifest = Listing("The sweep, sweep.toml", (found.folder / NAME).read_text(encoding="utf-8"))
    sections.append(Section("Scenario and provenance", (*(_sources(shown) if shown else ()), manifest)))
    count = len(found.entries)
    members_text = "1 member" if count == 1 else f"{count} members"
    missing = [f"{found.counts[state]} {state}" for state in ("waiting", "failed") if found.counts[state]]
    return Page(
        title=found.title or found.folder.name,
        subtitle=f"Sweep of {found.scenario}: {members_text}, {found.counts['done']} done",
        banners=(f"Incomplete sweep: of {members_text} {' and '.join(missing)}.",) if missing else (),
        warnings=tuple(found.said),
        sections=tuple(section for section in sections if section.parts),
    )


def members(found: Sweep) -> Block:
    """A row a member: its settings, what became of it, and why."""
    keys = list(dict.fromkeys(key for one in found.entries for key in one.settings))

    def row(one: Entry) -> tuple[str, ...]:
        values = (str(one.settings.get(key, NOTHING)) for key in keys)
        seed = NOTHING if one.seed is None else str(one.seed)
        return (one.name, *values, seed, one.state, with_unit(one.seconds, "s", ".3g"), one.reason)

    header = ("member", *keys, "seed", "state", "computed in", "reason")
    return Block("", header, tuple(row(one) for one in found.entries), left=len(header))
