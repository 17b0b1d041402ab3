"""The manifest of a sweep, `sweep.toml` in its folder: the axes, each member's settings, result file, and what became of it.

The result files are what counts: a member is done if its file is complete and of its hash, whatever the manifest says.
So a manifest that is lost or behind costs nothing but the reasons of failures.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import tomli_w

from dem_cli.errors import ResultsError
from dem_cli.whole import whole

NAME = "sweep.toml"
FORMAT, FORMAT_VERSION = "dem-cli sweep", 1
HEAD = "# Written by dem sweep, read by dem report. Result files lie beside it; it can be made anew from them.\n"


class NewerManifestError(ResultsError):
    """A manifest of a version of the program that this one does not know: not to be written over."""


State = Literal["waiting", "done", "failed"]
Kind = Literal["grid", "zip", "scenario"]


@dataclass(frozen=True)
class SweepAxis:
    """What varies: `keys` of the scenario, and for each point of the axis a value of every key, as TOML has them.

    kind: grid, one key whose values are combined with all others; zip, keys that go together; scenario, the key is "scenario" and its values
    are names of scenario files.
    """

    keys: tuple[str, ...]
    points: tuple[tuple[Any, ...], ...]
    kind: Kind = "grid"


@dataclass(frozen=True)
class Member:
    """One run of a sweep. file: its result file, within the sweep's folder. settings: key -> value as on the axes.

    reason: why it failed. seconds: wall time of the run, NaN if unknown. program: version that made or refused it.
    """

    name: str
    file: str
    hash: str
    settings: Mapping[str, Any]
    state: State = "waiting"
    reason: str = ""
    seconds: float = float("nan")
    program: str = ""

    def with_state(self, state: State, **known: Any) -> Member:
        return replace(self, state=state, **known)


@dataclass(frozen=True)
class Manifest:
    """A sweep. scenario: name of the file that it was started from. former: result files of members that the sweep no longer has."""

    title: str
    scenario: str
    axes: tuple[SweepAxis, ...]
    members: tuple[Member, ...]
    former: tuple[str, ...] = ()
    folder: Path = field(default=Path(), compare=False)

    def path(self, member: Member) -> Path:
        """Where a member's result file lies."""
        return self.folder / member.file


def brief_names(files: Sequence[str]) -> dict[str, str]:
    """Scenario files by what tells them apart: of thesis-discs-10hz.toml and thesis-pairs-10hz.toml discs and pairs."""
    stems = {file: Path(file).stem for file in files}
    words = [stem.split("-") for stem in stems.values()]
    first = last = 0
    if len(words) > 1:
        shortest = min(map(len, words))
        while first < shortest - 1 and len({one[first] for one in words}) == 1:
            first += 1
        while last < shortest - 1 - first and len({one[-1 - last] for one in words}) == 1:
            last += 1
    brief = {file: "-".join(stem.split("-")[first : len(stem.split("-")) - last]) for file, stem in stems.items()}
    return brief if len(set(brief.values())) == len(set(stems.values())) else stems


def is_sweep(path: Path | str) -> bool:
    """Whether a path is the folder of a sweep, or its manifest."""
    path = Path(path)
    return (path / NAME).is_file() or (path.name == NAME and path.is_file())


def read_manifest(path: Path | str) -> Manifest:
    """The manifest in a folder, or the file itself. ResultsError, in one line, if there is none or it cannot be read."""
    path = Path(path)
    file = path if path.name == NAME else path / NAME
    try:
        with file.open("rb") as handle:
            raw = tomllib.load(handle)
    except FileNotFoundError:
        raise ResultsError(f"{path}: is no folder of a sweep; it has no {NAME}") from None
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ResultsError(
            f"{file}: cannot be read ({error}). Move it away and run dem sweep again: it is made anew from the result files"
        ) from None
    if raw.get("format") != FORMAT or not isinstance(raw.get("format_version"), int):
        raise ResultsError(f"{file}: is no manifest of a sweep")
    if raw["format_version"] > FORMAT_VERSION:
        raise NewerManifestError(f"{file}: written by a newer dem-cli (format {raw['format_version']}); update dem-cli")
    try:
        return Manifest(
            title=str(raw["title"]),
            scenario=str(raw["scenario"]),
            axes=tuple(
                SweepAxis(tuple(axis["values"]), tuple(zip(*axis["values"].values(), strict=True)), axis["kind"])
                for axis in raw.get("axis", [])
            ),
            members=tuple(Member(**member) for member in raw.get("member", [])),
            former=tuple(raw.get("former", [])),
            folder=file.parent,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ResultsError(f"{file}: is damaged ({error}). Move it away and run dem sweep again") from None


def write_manifest(manifest: Manifest) -> None:
    """Write it into its folder, in one step: whoever reads sees the old one or the new one. OSError if that fails; the old one stays."""
    content: dict[str, Any] = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "title": manifest.title,
        "scenario": manifest.scenario,
        **({"former": list(manifest.former)} if manifest.former else {}),
        "axis": [
            {"kind": axis.kind, "values": {key: [point[k] for point in axis.points] for k, key in enumerate(axis.keys)}}
            for axis in manifest.axes
        ],
        "member": [_of_member(member) for member in manifest.members],
    }
    with whole(manifest.folder / NAME) as fresh, fresh.open("w", encoding="utf-8") as handle:
        handle.write(HEAD + tomli_w.dumps(content))
        handle.flush()
        os.fsync(handle.fileno())


def _of_member(member: Member) -> dict[str, Any]:
    """Without what is not known."""
    known = {"name": member.name, "file": member.file, "hash": member.hash, "state": member.state}
    more = {"reason": member.reason, "program": member.program}
    seconds = {"seconds": member.seconds} if member.seconds == member.seconds else {}
    return (
        known | {name: value for name, value in more.items() if value} | seconds | {"settings": dict(member.settings)}
    )
