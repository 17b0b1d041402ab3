"""From a scenario with a sweep to its members, and to the preparations that several of them start from."""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from dem_cli.errors import OverrideError, ScenarioError
from dem_cli.results.manifest import Manifest, Member, SweepAxis, brief_names
from dem_cli.results.provenance import program_identity
from dem_cli.scenario import EngineScenario, ImpulseScenario, parse_scenario
from dem_cli.scenario.base import files_named
from dem_cli.scenario.loader import read_sweep, read_text, read_toml
from dem_cli.scenario.mistakes import line
from dem_cli.scenario.sweep import Points, Sweep, overrides_of
from dem_cli.scenario.table import toml_text

LONGEST_NAME = 60  # characters of a member's settings in the name of its file


@dataclass(frozen=True)
class Planned:
    """A member before it is run. base: its scenario file; overrides: what makes the member of it.

    hash and prefixes are empty where `error` says why the scenario cannot be run. prefixes: of the first one, two, ... stages what identifies
    all that they come to, up to the last but one.
    """

    name: str
    settings: Mapping[str, Any]
    base: Path
    overrides: tuple[str, ...]
    hash: str = ""
    prefixes: tuple[str, ...] = ()
    error: str = ""

    @property
    def file(self) -> str:
        """Name of its result file, which changes with the member."""
        return f"{self.name}-{self.hash[:8]}.h5"

    def load(self) -> EngineScenario:
        """Its scenario. ScenarioError as `error`."""
        return parse_scenario(text_of(self.base), str(self.base), self.base.parent, self.overrides)


@dataclass(frozen=True)
class Shared:
    """The first `stages` of the member `of`, which others begin with as well. parent: key of the one that this goes on from.

    common: the settings that all `members` of them share, as in names of files; names: of the stages.
    """

    key: str
    stages: int
    of: Planned
    parent: str | None
    members: int
    common: str
    names: tuple[str, ...]

    @property
    def label(self) -> str:
        """What it is, in words: packing for 9 members of discs."""
        return f"{', '.join(self.names)} for {self.members} members{f' ({self.common})' if self.common else ''}"


@dataclass(frozen=True)
class Plan:
    """What a sweep comes to. start: key of the preparation that a member starts from, by the member's hash.

    twins: number of members that were left out, as another one has the same scenario.
    """

    title: str
    scenario: Path
    axes: tuple[SweepAxis, ...]
    members: tuple[Planned, ...]
    shared: Mapping[str, Shared]
    start: Mapping[str, str]
    twins: int = 0
    invalid: tuple[Planned, ...] = field(default=())

    def manifest(self, folder: Path) -> Manifest:
        """Before anything is run."""
        whole = [Member(one.name, one.file, one.hash, one.settings) for one in self.members]
        wrong = [
            Member(one.name, "", "", one.settings, "failed", one.error, program=program_identity())
            for one in self.invalid
        ]
        return Manifest(self.title, self.scenario.name, self.axes, (*whole, *wrong), folder=folder)

    def begin(self, member: Planned) -> int:
        """Stages of a member that its preparation has run."""
        key = self.start.get(member.hash)
        return self.shared[key].stages if key else 0


@lru_cache(maxsize=32)
def text_of(path: Path) -> str:
    """The text of a scenario file, read once: members of one sweep are of one text."""
    return read_text(path)


def read_plan(path: Path, overrides: Iterable[str], varied: Points) -> tuple[Sweep, str]:
    """The sweep of a scenario file, with keys varied from the command line, and the title. ScenarioError in one line per mistake."""
    text_of.cache_clear()
    origin = str(path)
    raw = read_toml(text_of(path), origin)
    sweep, found = read_sweep(raw)
    if found:
        raise ScenarioError("\n".join(line(origin, *one, raw) for one in found))
    sweep = (sweep or Sweep()).with_varied(varied)
    if sweep.scenarios and (more := [name for name in raw if name != "title"]):
        loc, rule = ("sweep", "scenarios"), f"sweeps other files, but this one has {', '.join(more)}, too"
        raise ScenarioError(
            line(origin, loc, list(sweep.scenarios), rule, "Take that out, or leave scenarios out", raw)
        )
    for kind, points in sweep.axes:
        if kind != "scenario" and "scenario" in points:
            raise ScenarioError(
                f'{origin}: [sweep] scenario: is no key of a scenario. Name other files in a list of their own: scenarios = ["discs.toml"]'
            )
    for override in overrides:
        if (key := override.partition("=")[0].strip()) in {name for _, points in sweep.axes for name in points}:
            raise ScenarioError(f"--set {override}: the sweep varies {key}. Leave one of them out")
    if not sweep.axes:
        raise ScenarioError(
            f'{origin}: [sweep]: varies nothing. Add a grid to the table, or give --vary "stage.shake.amplitude=400 gal,800 gal"'
        )
    return sweep, str(raw.get("title") or path.stem)


def make_plan(path: Path, overrides: Iterable[str] = (), varied: Points | None = None, most: int | None = None) -> Plan:
    """All members of the sweep in a scenario file, each with its hash, and what they share.

    overrides: as of --set, for all members. varied: as of --vary. ScenarioError where an axis names no key, where no member can be
    run, and where there are more than `most` members.
    """
    sweep, title = read_plan(path, overrides, varied or {})
    if most is not None and sweep.count > most:
        raise ScenarioError(
            f"{path}: the sweep has {sweep.count:,} members, more than {most:,}. Give --yes if that is meant"
        )
    axes = tuple(
        SweepAxis(tuple(points), tuple(zip(*points.values(), strict=True)), kind)  # type: ignore[arg-type]
        for kind, points in sweep.axes
    )
    brief = brief_names(sweep.scenarios)
    valid: dict[str, Planned] = {}
    invalid: list[Planned] = []
    twins = 0
    for settings in sweep.members():
        member = _planned(path, settings, tuple(overrides), varied or {}, brief)
        if member.error:
            invalid.append(member)
        elif member.hash in valid:
            twins += 1
        else:
            valid[member.hash] = member
    if not valid:
        raise ScenarioError("\n".join(dict.fromkeys(error for one in invalid for error in one.error.splitlines())))
    shared, start = _shared(list(valid.values()), brief)
    return Plan(title, path, axes, tuple(valid.values()), shared, start, twins, tuple(invalid))


def _planned(
    path: Path, settings: Mapping[str, Any], overrides: tuple[str, ...], varied: Points, brief: Mapping[str, str]
) -> Planned:
    """A member by its settings. ScenarioError if these name no key of the scenario, or no file."""
    base = path.parent / settings["scenario"] if "scenario" in settings else path
    own = overrides_of(settings)
    name, words = (
        slug(settings, brief),
        ", ".join(_said(key, value) for key, value in settings.items() if key != "scenario"),
    )
    try:
        scenario = parse_scenario(text_of(base), str(base), base.parent, (*overrides, *own))
    except OverrideError as error:
        said = str(error)
        for override in own:
            key, _, value = override.partition("=")
            place = f"--vary {key}" if key in varied else f"{path}: [sweep] {key}"
            said = said.replace(f"--set {override}:", f"{place} = {value}:")
        raise OverrideError(said) from None
    except ScenarioError as error:
        if not base.is_file():
            raise ScenarioError(
                line(
                    str(path),
                    ("sweep", "scenarios"),
                    settings["scenario"],
                    "does not exist",
                    "Paths start from this file",
                    {},
                )
            ) from None
        return Planned(name, settings, base, (*overrides, *own), error=str(error))
    title = [f"title={toml_text(f'{scenario.title} [{words}]')}"] if words else []
    return Planned(name, settings, base, (*overrides, *own, *title), scenario.hash, tuple(prefixes(scenario)))


def slug(settings: Mapping[str, Any], brief: Mapping[str, str]) -> str:
    """Settings as the name of a file: discs-400gal-10Hz-seed1. brief: names of scenario files."""
    parts = []
    for key, value in settings.items():
        if key == "scenario":
            parts.append(brief[str(value)])
        elif isinstance(value, str) and re.match(r"[+-]?[\d.]", value):
            parts.append(value)
        else:
            parts.append(key.rpartition(".")[2] + _plain(value))
    text = "-".join(re.sub(r"[^\w.+-]+", "", part.replace("/", "per")) for part in parts)
    return text[:LONGEST_NAME].strip("-.") or "member"


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else toml_text(value)


def _said(key: str, value: Any) -> str:
    """A setting in a title: 400 gal; friction 0.3."""
    quantity = isinstance(value, str) and re.match(r"[+-]?[\d.]", value)
    return str(value) if quantity else f"{key.rpartition('.')[2]} {_plain(value)}"


def prefixes(scenario: EngineScenario) -> Iterator[str]:
    """For the first one, two, ... stages, up to the last but one, what identifies all that they come to: the program, and their keys."""
    content = {name: value for name, value in scenario.to_dict().items() if name != "title"}
    stages = content.pop("stage")
    begun = hashlib.sha256(json.dumps([program_identity(), content, _step_facts(scenario)], sort_keys=True).encode())
    for count in range(1, len(stages)):
        digest = begun.copy()
        digest.update(json.dumps(stages[:count], sort_keys=True).encode())
        for name in files_named({**content, "stage": stages[:count]}):
            digest.update((scenario.folder / name).read_bytes())
        yield digest.hexdigest()[:16]


def _step_facts(scenario: EngineScenario) -> list[Any]:
    """What later stages have to say in the time step of the earlier ones: the impulse engine looks at the fastest of all."""
    if not isinstance(scenario, ImpulseScenario) or scenario.integration.time_step != "auto":
        return []
    return [stage.model_dump(mode="json") for stage in scenario.stages]


def _shared(members: list[Planned], brief: Mapping[str, str]) -> tuple[dict[str, Shared], dict[str, str]]:
    """Preparations, each before those that go on from it, and what each member starts from.

    Stages are worth a preparation of their own where several members begin with them and these do not all go on alike.
    """
    having: dict[str, list[Planned]] = defaultdict(list)
    for member in members:
        for key in member.prefixes:
            having[key].append(member)
    shared: dict[str, Shared] = {}
    start: dict[str, str] = {}
    for member in members:
        parent: str | None = None
        keys = member.prefixes
        for stages, key in enumerate(keys, 1):
            alike, longer = having[key], len(having[keys[stages]]) if stages < len(keys) else 0
            if len(alike) >= 2 and len(alike) > longer:
                if key not in shared:
                    common = {
                        name: value
                        for name, value in member.settings.items()
                        if all(one.settings[name] == value for one in alike)
                    }
                    names = tuple(stage.name for stage in member.load().stages[:stages])
                    shared[key] = Shared(
                        key, stages, member, parent, len(alike), slug(common, brief) if common else "", names
                    )
                parent = key
        if parent:
            start[member.hash] = parent
    return shared, start
