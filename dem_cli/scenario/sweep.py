"""The table [sweep] of a scenario: what is varied, and the members that come of it, as overrides of the scenario."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import core_schema

from dem_cli.scenario.quantities import JsonSchema, mistake
from dem_cli.scenario.table import Given, Mistake, Table, key, toml_text

Value = str | int | float | bool | list[Any] | dict[str, Any]
Points = dict[str, tuple[Any, ...]]  # key of the scenario -> its values
MOST = 100_000  # values of a range, and seeds

_QUANTITY = re.compile(r"\s*([+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D.*?)?\s*")


@dataclass(frozen=True)
class Varied:
    """Annotation of a table of keys with a list of values each; a range stands for its values."""

    example: str = "stage.shake.amplitude"
    words: ClassVar[str] = "table of: list of values, or range"

    def validate(self, value: Any) -> Points:
        if not isinstance(value, dict):
            raise mistake("must be a table", f'Write for example {{ "{self.example}" = ["400 gal", "800 gal"] }}')
        return {name: _values(name, values) for name, values in _flat(value)}

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.validate)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> JsonSchema:
        end: JsonSchema = {"type": ["string", "number"]}
        spaced = {"from": end, "to": end, "count": {"type": "integer", "minimum": 2}, "step": end}
        spacing = {"spacing": {"enum": ["linear", "log"]}}
        of_range = {"type": "object", "properties": spaced | spacing, "required": ["from", "to"]}
        return {
            "type": "object",
            "additionalProperties": {"anyOf": [{"type": "array", "minItems": 1}, {"type": "object"}, of_range]},
            "$comment": "keys as for --set, each with a list of values or a range",
        }


@dataclass(frozen=True)
class Seeds:
    """Annotation of seeds: a list of them, or how many, which are then 1, 2, ..."""

    words: ClassVar[str] = "whole number from 1, or list of: whole number from 0"

    def validate(self, value: Any) -> tuple[int, ...]:
        if value == ():  # the default
            return ()
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MOST:
            return tuple(range(1, value + 1))
        if isinstance(value, list) and value and all(_is_whole(one) and one >= 0 for one in value):
            return tuple(value)
        raise mistake("must be seeds, or how many", "Write for example seeds = [1, 2, 3], or seeds = 3 for the same")

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.validate)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> JsonSchema:
        whole: JsonSchema = {"type": "integer", "minimum": 0}
        return {"anyOf": [whole, {"type": "array", "items": whole, "minItems": 1}]}


class Sweep(Table):
    """What `dem sweep` varies. Each combination of scenario, point of the grid, row of the zip and seed is a member, which is run and
    reported like a scenario of its own. `dem run` leaves this table aside. A file with nothing else but a title may sweep other files.
    """

    scenarios: tuple[str, ...] = key(
        (), "scenario files to be swept in place of this one, from its folder", example=["discs.toml", "pairs.toml"]
    )
    grid: Annotated[Points, Varied()] = key(
        {},
        "every value of each with every value of the others: keys as for --set, each with a list of values, or a range "
        '{ from, to, count } or { from, to, step }; spacing = "log" for equal ratios',
        example={"stage.shake.amplitude": ["400 gal", "800 gal"]},
    )
    zip: Annotated[Points, Varied("grains.count")] = key(
        {},
        "values that go together: lists of one length, the first of each, the second of each, ...",
        example={"grains.count": [500, 1000], "container.width": ["30 cm", "60 cm"]},
    )
    seeds: Annotated[tuple[int, ...], Seeds()] = key(
        (), "seeds, each of which every member is run with; or how many, which are then 1, 2, ...", example=[1, 2, 3]
    )

    short_form: ClassVar[JsonSchema | None] = None

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        grid, rows = given.good.get("grid") or {}, given.good.get("zip") or {}
        lengths = {name: len(values) for name, values in rows.items()}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{count} of {name}" for name, count in lengths.items())
            yield Mistake(("zip",), f"has lists of different lengths: {said}", "Give each key as many values")
        for name in grid.keys() & rows.keys():
            yield Mistake(("zip", name), "stands in the grid, too", "Leave one of them out")
        if "seed" in grid.keys() | rows.keys() and given.good.get("seeds"):
            yield Mistake(("seeds",), "contradicts seed, which is varied already", "Leave one of them out")

    @property
    def axes(self) -> list[tuple[str, Points]]:
        """Kind of axis (scenario, grid, zip) and its keys with their values, in the order of the members: the last one varies fastest."""
        found: list[tuple[str, Points]] = [("scenario", {"scenario": self.scenarios})] if self.scenarios else []
        found += [("grid", {name: values}) for name, values in self.grid.items()]
        found += [("zip", self.zip)] if self.zip else []
        return found + ([("grid", {"seed": self.seeds})] if self.seeds else [])

    @property
    def count(self) -> int:
        """How many members there are."""
        return math.prod(len(next(iter(points.values()))) for _, points in self.axes) if self.axes else 0

    def members(self) -> Iterator[dict[str, Any]]:
        """Settings of each member: key -> value, the scenario's file under "scenario"."""
        each = [
            [dict(zip(points, row, strict=True)) for row in zip(*points.values(), strict=True)]
            for _, points in self.axes
        ]
        for parts in itertools.product(*each):
            yield {name: value for part in parts for name, value in part.items()}

    def with_varied(self, varied: Points) -> Sweep:
        """Keys varied from the command line as well; they take the place of those of the same name."""
        rows = {name: values for name, values in self.zip.items() if name not in varied}
        seeds = () if "seed" in varied else self.seeds
        return self.model_copy(update={"grid": {**self.grid, **varied}, "zip": rows, "seeds": seeds})


def overrides_of(settings: Mapping[str, Any]) -> list[str]:
    """Settings of a member as overrides."""
    return [f"{name}={toml_text(value)}" for name, value in settings.items() if name != "scenario"]


def varied(text: str) -> Points:
    """KEY=VALUE,VALUE,... of the command line; commas within quotes and brackets do not part values, and 1..8 is a range of whole numbers.

    ValueError with rule and remedy if it is none.
    """
    from dem_cli.scenario.overrides import read_value

    name, sign, values = text.partition("=")
    if not sign or not name.strip():
        raise ValueError('is not KEY=VALUE,VALUE. Write for example --vary "stage.amplitude=400 gal,800 gal"')
    parts = [part.strip() for part in _split(values)]
    if not parts or not all(parts):
        raise ValueError(f"has no value for {name.strip()}. Write values with commas between them")
    if len(parts) == 1 and (ends := re.fullmatch(r"(-?\d+)\.\.(-?\d+)", parts[0])):
        low, high = int(ends[1]), int(ends[2])
        if not 0 <= high - low < MOST:
            raise ValueError(f"is no range with up to {MOST} values. Write the smaller number first")
        return {name.strip(): tuple(range(low, high + 1))}
    return {name.strip(): tuple(read_value(part) for part in parts)}


def _split(text: str) -> list[str]:
    """At commas that stand outside of quotes and brackets."""
    parts, depth, quote = [""], 0, ""
    for sign in text:
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        depth += (sign in "[{(") - (sign in "]})") if not quote else 0
        if sign == "," and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += sign
    return parts


def _flat(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Keys with dots, also where the TOML has tables in tables: stage.shake.amplitude without quotes is such."""
    for name, value in table.items():
        path = f"{before}{name}"
        if isinstance(value, dict) and not {"from", "to"} & value.keys():
            yield from _flat(value, f"{path}.")
        else:
            yield path, value


def _values(name: str, value: Any) -> tuple[Any, ...]:
    if isinstance(value, dict):
        return tuple(_of_range(name, value))
    if not isinstance(value, list):
        raise mistake(f"must hold lists of values, {name} has none", f'Write for example "{name}" = [{_one(value)}]')
    if not value:
        raise mistake(f"is empty at {name}", "Give at least one value")
    return tuple(value)


def _one(value: Any) -> str:
    return toml_text(value) if isinstance(value, str | int | float) else "1, 2"


def _of_range(name: str, table: Mapping[str, Any]) -> Iterator[Any]:
    """The values of { from, to, count | step, spacing }, written in the unit of the ends."""
    unknown = table.keys() - {"from", "to", "count", "step", "spacing"}
    if unknown or not {"from", "to"} <= table.keys() or len({"count", "step"} & table.keys()) != 1:
        raise mistake(
            f"has no range at {name}", 'Write { from = "1 Hz", to = "10 Hz", count = 10 }, or step = "1 Hz" for count'
        )
    low, unit = _number(name, table["from"])
    high, other = _number(name, table["to"])
    if unit != other:
        raise mistake(f"has two units at {name}, {unit or 'none'} and {other or 'none'}", "Write both ends in one unit")
    logarithmic = table.get("spacing", "linear") == "log"
    if table.get("spacing", "linear") not in ("linear", "log"):
        raise mistake(f"has an unknown spacing at {name}", 'Write spacing = "linear" or "log"')
    if "step" in table:
        step, own = _number(name, table["step"])
        if own != unit or step == 0.0 or (high - low) / step < 0.0 or (high - low) / step >= MOST or logarithmic:
            raise mistake(f"has no step from one end to the other at {name}", "Give a step in the unit of the ends")
        count = math.floor((high - low) / step * (1.0 + 1e-12) + 1e-9) + 1
        numbers = [low + step * k for k in range(count)]
    else:
        count = table["count"]
        if not _is_whole(count) or not 2 <= count <= MOST:
            raise mistake(f"has no number of values at {name}", "Write for example count = 10")
        if logarithmic and (low <= 0.0 or high <= 0.0):
            raise mistake(f"has no ratio at {name}", 'Ends above 0 are wanted for spacing = "log"')
        way: Callable[[float], float] = (
            (lambda s: low * (high / low) ** s) if logarithmic else (lambda s: low + (high - low) * s)
        )
        numbers = [way(k / (count - 1)) for k in range(count)]
    whole = all(_is_whole(table[end]) for end in ("from", "to")) and all(
        abs(number - round(number)) < 1e-9 for number in numbers
    )
    for number in numbers:
        yield f"{number:.6g} {unit}" if unit else round(number) if whole else float(f"{number:.10g}")


def _number(name: str, value: Any) -> tuple[float, str]:
    """A number and its unit, which is empty for a plain one."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value), ""
    found = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if not found or not found[2]:
        raise mistake(f"has an end that is no number at {name}", 'Write for example from = "1 Hz"')
    return float(found[1].replace("_", "")), found[2].strip()


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
