"""What a sweep says, as one tree of numbers: members as their files tell, seeds pooled into cases, and the best point.

The result files are what counts, not the manifest: a member is done if its file is complete and of its hash.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dem_cli.analysis.statistics import Estimate, estimate
from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.report.sweep_axes import SEED, Axis, axes_of
from dem_cli.report.sweep_measures import MAIN, MEASURES, TABLES, Numbers, numbers_of
from dem_cli.report.tree import plain
from dem_cli.results import open_results, partial_path
from dem_cli.results.layouts import Kind
from dem_cli.results.manifest import Manifest, Member, State, read_manifest

FORMAT, FORMAT_VERSION = "dem-cli sweep report", 1
STATES: tuple[State, ...] = ("done", "failed", "waiting")
NAMED = 3  # members that are named in a line about several


@dataclass(frozen=True)
class Entry:
    """A member as its file tells. settings: without the seed; numbers: None unless done; begun: an unfinished file lies there."""

    name: str
    file: str
    state: State
    reason: str
    program: str
    seconds: float
    seed: int | None
    settings: Mapping[str, Any]
    numbers: Numbers | None
    begun: bool

    def value(self, measure: str) -> float:
        return float("nan") if self.numbers is None else self.numbers.values.get(measure, float("nan"))


@dataclass(frozen=True)
class SweepCase:
    """Members that differ in their seed only. places: number of the point on each axis; label: those points in words."""

    places: tuple[int, ...]
    label: str
    settings: Mapping[str, Any]
    entries: tuple[Entry, ...]

    @property
    def kind(self) -> Kind | None:
        """None until a member is done."""
        return next((one.numbers.kind for one in self.entries if one.numbers), None)

    @property
    def counts(self) -> dict[State, int]:
        found = Counter(one.state for one in self.entries)
        return {state: found[state] for state in STATES if found[state]}

    @property
    def state(self) -> str:
        """`3 done, 1 failed`; the number is left out where there is one member."""
        return ", ".join(state if len(self.entries) == 1 else f"{n} {state}" for state, n in self.counts.items())

    def estimate(self, measure: str) -> Estimate:
        return estimate(one.value(measure) for one in self.entries)

    def by_seed(self, measure: str) -> dict[int, float]:
        """Values of the members that are done."""
        return {one.numbers.seed: one.value(measure) for one in self.entries if one.numbers}


@dataclass(frozen=True)
class Sweep:
    """A sweep as its files tell. cases: in the order of the axes; main: measure that cases are ranked and mapped by, "" while none is done;
    said: what to know before the numbers, in lines.
    """

    title: str
    scenario: str
    folder: Path
    axes: tuple[Axis, ...]
    entries: tuple[Entry, ...]
    cases: tuple[SweepCase, ...]
    main: str
    said: tuple[str, ...]

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Of the members that are done, the most common first."""
        return tuple(kind for kind, _ in Counter(one.numbers.kind for one in self.entries if one.numbers).most_common())

    @property
    def counts(self) -> dict[State, int]:
        found = Counter(one.state for one in self.entries)
        return {state: found[state] for state in STATES}

    @property
    def seconds(self) -> float:
        """Computing of the members that are done [s]; as the manifest has it, without the preparations that they share, else as their files."""
        times = [
            one.seconds if one.seconds == one.seconds else one.value("wall_time") for one in self.entries if one.numbers
        ]
        return float(sum(time for time in times if time == time))

    @property
    def repeated(self) -> bool:
        """Whether a case has several members."""
        return any(len(case.entries) > 1 for case in self.cases)

    def has(self, measure: str, kind: Kind | None = None) -> bool:
        """Whether a member (of a kind) that is done has this measure."""
        return any(
            one.value(measure) == one.value(measure)
            for one in self.entries
            if one.numbers and kind in (None, one.numbers.kind)
        )

    def by(self, measure: str) -> Sweep:
        """The same, ranked and mapped by another measure. ScenarioError if no member has it."""
        from dem_cli.report.figures import unknown

        known = [name for name in MEASURES if self.has(name)]
        if measure not in known:
            raise ScenarioError(unknown("measure", measure, known))
        return dataclasses.replace(self, main=measure)

    def as_dict(self) -> dict[str, Any]:
        """Tree for JSON: SI units, null where a quantity is not defined; values of the axes as the manifest has them."""
        from dem_cli.report.sweep_best import best_point

        best = best_point(self)
        tree = {
            "title": self.title,
            "scenario": self.scenario,
            "counts": self.counts,
            "seconds": self.seconds,
            "axes": [
                {"keys": axis.keys, "unit": axis.unit, "points": axis.points, "values": axis.values}
                for axis in self.axes
            ],
            "main": self.main,
            "best": best and best.as_dict(),
            "cases": [
                {
                    "label": case.label,
                    "settings": dict(case.settings),
                    "kind": case.kind,
                    "members": [one.name for one in case.entries],
                    "counts": case.counts,
                    "measures": {
                        name: dataclasses.asdict(case.estimate(name)) for name in MEASURES if case.estimate(name).n
                    },
                }
                for case in self.cases
            ],
            "members": [
                {
                    **{
                        name: getattr(one, name)
                        for name in ("name", "file", "state", "reason", "program", "seed", "seconds")
                    },
                    "settings": dict(one.settings),
                    "kind": one.numbers and one.numbers.kind,
                    "measures": one.numbers and one.numbers.values,
                }
                for one in self.entries
            ],
            "warnings": self.said,
        }
        found: dict[str, Any] = plain(tree)
        return {"format": FORMAT, "format_version": FORMAT_VERSION, **found}


def read_sweep(path: Path | str) -> Sweep:
    """The sweep in a folder, or of a manifest. ResultsError if there is none, or it cannot be read."""
    manifest = read_manifest(path)
    entries, said = [], []
    for member in manifest.members:
        entry, remark = _entry(manifest, member)
        entries.append(entry)
        if remark:
            said.append(f"{member.name}: {remark}")
    if manifest.former:
        count = len(manifest.former)
        said.append(
            f"left out: {count} result file{'s' if count > 1 else ''} of members that the sweep no longer has "
            f"({_some(manifest.former)})"
        )
    versions = sorted({one.numbers.version for one in entries if one.numbers})
    if len(versions) > 1:
        said.append(f"the files were written by different versions of the program: {', '.join(versions)}")
    axes = axes_of(manifest)
    found = Sweep(
        title=manifest.title,
        scenario=manifest.scenario,
        folder=manifest.folder,
        axes=axes,
        entries=tuple(entries),
        cases=_cases(entries, axes),
        main="",
        said=(*said, *_gathered(entries)),
    )
    kind = next(iter(found.kinds), None)
    main = next((name for name in MAIN[kind] if found.has(name, kind)), "") if kind else ""
    return dataclasses.replace(found, main=main)


def _entry(manifest: Manifest, member: Member) -> tuple[Entry, str]:
    """The member, and what is wrong with its file in a line."""
    numbers, remark = _numbers(manifest.path(member), member)
    state: State = "done" if numbers else "failed" if member.state == "failed" else "waiting"
    if state == "waiting" and remark:
        remark += "; the member counts as waiting"
    seed = member.settings.get(SEED)
    entry = Entry(
        name=member.name,
        file=member.file,
        state=state,
        reason=member.reason if state == "failed" else "",
        program=member.program,
        seconds=member.seconds,
        seed=numbers.seed if numbers else seed if isinstance(seed, int) else None,
        settings={key: value for key, value in member.settings.items() if key != SEED},
        numbers=numbers,
        begun=state == "waiting" and partial_path(manifest.path(member)).is_file(),
    )
    return entry, remark


def _numbers(path: Path, member: Member) -> tuple[Numbers | None, str]:
    if not path.is_file():
        return None, "its file is missing, though the manifest has it as done" if member.state == "done" else ""
    try:
        with open_results(path) as results:
            theirs = str(results.attrs.get("scenario_hash", ""))
            if theirs != member.hash:
                return None, f"its file is of another scenario (hash {theirs or 'unknown'}, not {member.hash})"
            if not results.complete:
                return None, f"its file is incomplete ({results.stop_reason})"
            return numbers_of(results), ""
    except ResultsError as error:
        return None, f"its file cannot be read ({str(error).removeprefix(f'{path}: ')})"


def _cases(entries: Sequence[Entry], axes: Sequence[Axis]) -> tuple[SweepCase, ...]:
    groups: dict[str, list[Entry]] = {}
    for one in entries:
        groups.setdefault(json.dumps(one.settings, sort_keys=True, default=str), []).append(one)
    cases = []
    for group in groups.values():
        settings = group[0].settings
        places = tuple(axis.place(settings) for axis in axes)
        words = [axis.words(place) for axis, place in zip(axes, places, strict=True) if axis.varies]
        cases.append(SweepCase(places, ", ".join(words) or "all runs", settings, tuple(group)))
    return tuple(sorted(cases, key=lambda case: case.places))


def _gathered(entries: Sequence[Entry]) -> list[str]:
    """Warnings of the runs, those that differ in numbers only in one line."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for one in entries:
        for line in one.numbers.warnings if one.numbers else ():
            groups.setdefault(re.sub(r"[-+\d.e]+", "#", line), []).append((one.name, line))
    return [
        f"{_some([name for name, _ in group])}: {'for example, ' if len({line for _, line in group}) > 1 else ''}{group[0][1]}"
        for group in groups.values()
    ]


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def tables_of(found: Sweep, kind: Kind) -> list[tuple[str, tuple[str, ...]]]:
    """Titles and measures of the tables of one kind of runs: what no run has is left out."""
    every = [(title, tuple(name for name in names if found.has(name, kind))) for title, names in TABLES[kind]]
    return [(title, names) for title, names in every if set(names) - {"wall_time"}]
