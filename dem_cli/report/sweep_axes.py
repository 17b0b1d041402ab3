"""What varies in a sweep, as reports show it: names and units of the axes, texts and numbers of their points.

Seeds are no axis: runs that differ in them only are repeats of one case.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dem_cli import units
from dem_cli.results.manifest import Manifest, SweepAxis, brief_names

SEED, SCENARIO = "seed", "scenario"
SHAKING = ("amplitude", "frequency")
UNIT = re.compile(r"\s*[+-]?[\d_.]+(?:[eE][+-]?\d+)?\s*(.*?)\s*", re.DOTALL)


@dataclass(frozen=True)
class Axis:
    """One thing that varies. keys: of the scenario, several where they go together; points: a value of each key, as TOML has it.

    name: for people, without unit; texts: each point; values: as numbers in `unit`, None where some are no numbers. Keys that go together
    are named and numbered by one of them that tells the points apart, if there is one; with_others: texts with the others.
    """

    keys: tuple[str, ...]
    points: tuple[tuple[Any, ...], ...]
    name: str
    unit: str
    texts: tuple[str, ...]
    values: tuple[float, ...] | None
    with_others: tuple[str, ...]

    @property
    def label(self) -> str:
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @property
    def varies(self) -> bool:
        return len(self.points) > 1

    def place(self, settings: Mapping[str, Any]) -> int:
        """Number of the point that `settings` lie on."""
        wanted = _token([settings.get(key) for key in self.keys])
        return [_token(point) for point in self.points].index(wanted)

    def words(self, k: int) -> str:
        """Point k so that it says what it is: 400 gal, friction 0.3, ellipse."""
        text = f"{self.texts[k]} {self.unit}".rstrip()
        named = self.values is not None or self.texts[k] in ("on", "off")
        if not named or (self.unit and self.name in SHAKING):
            return text
        return f"{self.name.rpartition('.')[2].replace('_', ' ')} {text}"


def axes_of(manifest: Manifest) -> tuple[Axis, ...]:
    """In the order of the manifest, seeds left out. Keys that go together are one axis, but amplitude and frequency are always two."""
    groups: list[tuple[tuple[str, ...], list[tuple[Any, ...]]]] = []
    for axis in manifest.axes:
        keys = [k for k, key in enumerate(axis.keys) if key != SEED]
        for some in _apart(axis, keys):
            groups.append((tuple(axis.keys[k] for k in some), [tuple(point[k] for k in some) for point in axis.points]))
    names = [_short(key) for keys, _ in groups for key in keys]
    return tuple(_axis(keys, _with_members(keys, points, manifest), names) for keys, points in groups)


def _apart(axis: SweepAxis, keys: list[int]) -> list[list[int]]:
    """Which keys of an axis make an axis here; what goes with amplitude and frequency only if these do not tell the points apart."""
    shaking = [k for name in SHAKING for k in keys if _last(axis.keys[k]) == name]
    if len(shaking) != 2:
        return [keys] if keys else []
    others = [k for k in keys if k not in shaking]
    told = {_token([point[k] for k in keys]) for point in axis.points}
    pairs = {_token([point[k] for k in shaking]) for point in axis.points}
    return [[shaking[0]], [shaking[1]], *([others] if others and len(pairs) < len(told) else [])]


def _with_members(
    keys: tuple[str, ...], points: Sequence[tuple[Any, ...]], manifest: Manifest
) -> tuple[tuple[Any, ...], ...]:
    """Each point once, and those that only members have, so that all of these have a place."""
    theirs = [tuple(member.settings.get(key) for key in keys) for member in manifest.members]
    return tuple({_token(point): point for point in [*points, *theirs]}.values())


def _axis(keys: tuple[str, ...], points: tuple[tuple[Any, ...], ...], names: Sequence[str]) -> Axis:
    shown = [_short(key) if names.count(_short(key)) == 1 else key for key in keys]
    columns = [tuple(point[k] for point in points) for k in range(len(keys))]
    chief = _chief(keys, columns)
    every = tuple(
        ", ".join(f"{name} {_text(value)}" for name, value in zip(shown, point, strict=True)) for point in points
    )
    if chief is None:
        return Axis(keys, points, " & ".join(shown), "", every, None, every)
    column = columns[chief]
    unit, values = _numbers(column)
    texts = tuple(f"{value:.6g}" for value in values) if values is not None else tuple(_text(value) for value in column)
    if keys == (SCENARIO,):
        brief = brief_names([str(value) for value in column])
        texts = tuple(brief[str(value)] for value in column)
    if len(set(texts)) < len(texts):
        texts = tuple(str(value) for value in values or column)
    return Axis(keys, points, shown[chief], unit, texts, values, every if len(keys) > 1 else texts)


def _chief(keys: tuple[str, ...], columns: Sequence[tuple[Any, ...]]) -> int | None:
    """Of keys that go together the one that the axis is named and numbered by: it has other numbers at each point."""
    if len(keys) == 1:
        return 0
    found = []
    for k, column in enumerate(columns):
        values = _numbers(column)[1]
        if values is not None and len(set(values)) == len(values):
            found.append(k)
    return next(
        (k for name in ("frequency", "amplitude") for k in found if _last(keys[k]) == name), next(iter(found), None)
    )


def _numbers(column: Sequence[Any]) -> tuple[str, tuple[float, ...] | None]:
    """Unit of the first value and all values in it, where all are numbers of one dimension."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in column):
        return "", tuple(float(value) for value in column)
    match = UNIT.fullmatch(column[0]) if all(isinstance(value, str) for value in column) and column else None
    unit = match.group(1) if match else ""
    if not unit:
        return "", None
    try:
        return unit, tuple(units.parse(value, unit) for value in column)
    except units.UnitError:
        return "", None


def _text(value: Any) -> str:
    """A value of TOML on one line."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_text(inner)}" for key, inner in value.items())
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_text(inner) for inner in value) + "]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _short(key: str) -> str:
    """A key of a stage without the stage: stage.2.amplitude is amplitude. Others stay whole, as grains.count says more than count."""
    return _last(key) if key.startswith("stage.") else key


def _last(key: str) -> str:
    return key.rpartition(".")[2]


def _token(point: Sequence[Any]) -> str:
    return json.dumps(list(point), sort_keys=True, default=str)
