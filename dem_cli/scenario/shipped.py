"""The scenarios that come along with the program."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import dem_cli
from dem_cli.errors import ScenarioError
from dem_cli.scenario.base import files_named


@dataclass(frozen=True)
class Shipped:
    """A scenario that comes along: its name, title, what its comments say about it, and the files that it reads, by name: also scenarios that
    it sweeps.
    """

    name: str
    title: str
    shows: str
    takes: str
    text: str
    files: tuple[str, ...] = ()

    @property
    def sweeps(self) -> bool:
        """Whether it is there to be swept."""
        return "sweep" in tomllib.loads(self.text)


def folder() -> Path:
    """Where they lie: in the installed package, or beside it in a checkout."""
    package = Path(dem_cli.__file__).parent
    installed = package / "shipped"
    return installed if installed.is_dir() else package.parent / "scenarios"


def shipped_scenarios() -> list[Shipped]:
    """All of them, by name."""
    return [_read(path) for path in sorted(folder().glob("*.toml"))]


def shipped_scenario(name: str) -> Shipped:
    """The one of that name, with or without .toml. ScenarioError names the nearest."""
    wanted = name.removesuffix(".toml")
    path = folder() / f"{wanted}.toml"
    if re.fullmatch(r"[\w.-]+", wanted) and path.is_file():
        return _read(path)
    from dem_cli.scenario.table import did_you_mean

    known = [p.stem for p in sorted(folder().glob("*.toml"))]
    raise ScenarioError(f"there is no scenario {name} to copy. {did_you_mean(wanted, known)}")


def _read(path: Path) -> Shipped:
    text = path.read_text(encoding="utf-8")
    raw = tomllib.loads(text)
    files = list(files_named(raw))
    for name in raw.get("sweep", {}).get("scenarios", []):
        files += [name, *files_named(tomllib.loads((path.parent / name).read_text(encoding="utf-8")))]
    return Shipped(path.stem, raw["title"], _comment(text, "Shows"), _comment(text, "Takes"), text, tuple(files))


def _comment(text: str, word: str) -> str:
    """What the comment "# Word: ..." says, up to the next one of its kind or the end of the comment."""
    found = re.search(rf"^# {word}: (.*(?:\n#  .*)*)", text, re.MULTILINE)
    return " ".join(found[1].replace("\n#", " ").split()) if found else ""
