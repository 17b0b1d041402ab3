"""Mistakes of a scenario as lines to read: `file: [table] key = value: rule. Remedy`."""

from __future__ import annotations

import datetime
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from dem_cli.scenario.engines import ALL_STAGES
from dem_cli.scenario.impulse import names_in
from dem_cli.scenario.table import NOTHING, toml_text

LONGEST = 60  # characters of a value that a line shows


def line(origin: str, loc: Sequence[str | int], value: Any, rule: str, remedy: str, raw: Mapping[str, Any]) -> str:
    """One mistake in one line. raw: the whole scenario as TOML data, from which stages are named."""
    shown = "" if value is NOTHING else f" = {_short(value)}"
    return f"{origin}: {place(loc, raw)}{shown}: {rule}. {remedy}"


def place(loc: Sequence[str | int], raw: Mapping[str, Any]) -> str:
    """Where a key is: `[contact] damping_ratio.normal`, `[[stage]] 2 (shake) amplitude`, `seed`."""
    parts = list(loc)
    if parts[0] == "stage" and len(parts) > 1 and isinstance(parts[1], int):
        number = parts[1]
        stages = raw.get("stage")
        stage = stages[number] if isinstance(stages, list) and number < len(stages) else None
        kind = stage.get("kind") if isinstance(stage, dict) else None
        if len(parts) > 2 and parts[2] in ALL_STAGES:  # the model names the kind that it took the stage for
            del parts[2]
        return f"[[stage]] {number + 1}{f' ({kind})' if kind in ALL_STAGES else ''} {_path(parts[2:])}".rstrip()
    if parts[0] in LISTED and len(parts) > 1 and isinstance(parts[1], int) and isinstance(raw.get(str(parts[0])), list):
        listed = raw[str(parts[0])]
        name = names_in(str(parts[0]), listed)[parts[1]] if parts[1] < len(listed) else ""
        return f"[[{parts[0]}]] {parts[1] + 1}{f' ({name})' if name else ''} {_path(parts[2:])}".rstrip()
    if parts[0] in LISTED and len(parts) > 1 and isinstance(parts[1], int):
        del parts[1]  # a single table, which the model holds as a list of one
    if len(parts) == 1:
        table = parts[0] in TABLES
        return f"[{parts[0]}]" if table else str(parts[0])
    return f"[{parts[0]}] {_path(parts[1:])}"


LISTED = ("grains", "plane")
TABLES = (
    "grains",
    "material",
    "contact",
    "container",
    "packing",
    "integration",
    "boundary",
    "solver",
    "output",
    "terrain",
    "sweep",
)


def _path(parts: Sequence[str | int]) -> str:
    """a.b, and `a (2nd value)` for an entry of a list."""
    keys = ".".join(str(p) for p in parts if isinstance(p, str))
    numbers = [p + 1 for p in parts if isinstance(p, int)]
    endings = {1: "st", 2: "nd", 3: "rd"}
    said = [f"{n}{'th' if n % 100 in (11, 12, 13) else endings.get(n % 10, 'th')} value" for n in numbers]
    return f"{keys} ({', '.join(said)})" if said else keys


def _short(value: Any) -> str:
    text = value.isoformat() if isinstance(value, (datetime.date, datetime.time)) else toml_text(value)
    text = " ".join(text.split())
    return text if len(text) <= LONGEST else text[: LONGEST - 4] + " ..."


_UNQUOTED = re.compile(r"([A-Za-z_]\w*)\s*=\s*([+-]?[\d.][\d.eE+-]*\s*(?:[A-Za-z%°µ][^\s,#}\]]*|1/s))")


def syntax(origin: str, text: str, error: tomllib.TOMLDecodeError) -> str:
    """A line for TOML that cannot be read, with the advice that fits the commonest slips."""
    found = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
    rule = re.sub(r"\s*\(at .*\)$", "", str(error))
    lines = text.splitlines()
    number = int(found[1]) if found else len(lines)
    content = lines[number - 1].strip() if 0 < number <= len(lines) else ""
    remedy = "Correct the line"
    if unquoted := _UNQUOTED.search(content):
        remedy = f'Put values with a unit in quotes: {unquoted[1]} = "{unquoted[2].strip()}"'
    elif content.count('"') % 2:
        remedy = "Close the quotes"
    elif "overwrite" in rule.lower() or "twice" in rule.lower():
        remedy = "Give each key and table once; stages have double brackets: [[stage]]"
    elif re.fullmatch(r"[\w.-]+\s*=", content):
        remedy = "Write a value behind the sign ="
    return f"{origin}: line {number}: {_short_line(content)}: {rule[:1].lower()}{rule[1:]}. {remedy}"


def _short_line(content: str) -> str:
    return content if len(content) <= LONGEST else content[: LONGEST - 4] + " ..."
