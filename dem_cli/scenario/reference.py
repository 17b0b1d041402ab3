"""The model as a manual: JSON Schema for editors, tables of keys for the README."""

from __future__ import annotations

import types
import typing
from collections.abc import Iterator, Sequence
from typing import Any

from pydantic.fields import FieldInfo

from dem_cli import units
from dem_cli.scenario.base import AnyScenario
from dem_cli.scenario.engines import ENGINES
from dem_cli.scenario.model import Scenario
from dem_cli.scenario.quantities import FrictionNumber, Number, Quantity, Range, Whole
from dem_cli.scenario.sweep import Seeds, Sweep, Varied
from dem_cli.scenario.table import Table, toml_text

# Tables that stand before the stages in the part of their engine.
BEFORE = ("[[grains]]", "[contact]", "[container]", "[[plane]]", "[terrain]", "[packing]")
HEAD = "| key | value | default | meaning |\n|---|---|---|---|\n"


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of scenario files: one of the engines' schemas, as `engine` says."""
    sweep = _tidy(Sweep.model_json_schema(by_alias=True, mode="validation"))
    of_files = {
        "type": "object",
        "description": "A sweep of other files.",
        "properties": {"title": {"type": "string"}, "sweep": {**sweep, "required": ["scenarios"]}},
        "required": ["sweep"],
        "additionalProperties": False,
    }
    tables: dict[str, Any] = {"Sweep": sweep, "SweepOfFiles": of_files}
    for scenario in ENGINES.values():
        schema = _tidy(scenario.model_json_schema(by_alias=True, mode="validation"))
        schema["properties"]["sweep"] = {"$ref": "#/$defs/Sweep"}
        for name, table in (*schema.pop("$defs").items(), (scenario.__name__, schema)):
            assert tables.setdefault(name, table) == table, f"two tables are called {name}"
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "dem-cli scenario",
        "description": "A scenario of dem-cli. Values with a dimension are strings with their unit.",
        "oneOf": [
            {"$ref": f"#/$defs/{name}"} for name in (*(one.__name__ for one in ENGINES.values()), "SweepOfFiles")
        ],
        "$defs": tables,
    }


def _tidy(node: Any) -> Any:
    """Without what pydantic adds for Python: titles made from names, and null as an alternative to leaving a key out."""
    if isinstance(node, list):
        return [_tidy(one) for one in node]
    if not isinstance(node, dict):
        return node
    clean = {
        k: _tidy(v)
        for k, v in node.items()
        if not (k == "title" and isinstance(v, str)) and (k, v) != ("default", None)
    }
    options = clean.get("anyOf")
    if isinstance(options, list) and {"type": "null"} in options:
        rest = [one for one in options if one != {"type": "null"}]
        del clean["anyOf"]
        clean = {**(rest[0] if len(rest) == 1 else {"anyOf": rest}), **clean}
    if "description" in clean and "$comment" in clean:  # unit and range, where editors show them
        clean["description"] += f" [{clean.pop('$comment')}]"
    return clean


def reference_markdown() -> str:
    """The reference of scenario files: a Markdown table of keys for each table of the TOML, those that engines share once."""
    of_engine = {engine: set(_tables(scenario)) for engine, scenario in ENGINES.items()}
    shared = {one for one in _tables(Scenario) if sum(one in tables for tables in of_engine.values()) > 1}
    sections = [_section("Top level", Scenario, top=True)]
    for name, table in _tables(Scenario):
        if (name, table) in shared:
            without = [engine for engine, tables in of_engine.items() if (name, table) not in tables]
            sections.append(_section(f"`{name}`", table, without=without))
    sections.append(_section("`[sweep]`", Sweep))
    for engine, scenario in ENGINES.items():
        sections.append(f'### Only with `engine = "{engine}"`\n')
        own = [(name, table) for name, table in _tables(scenario) if (name, table) not in shared]
        before = [(name, table) for name, table in own if name in BEFORE]
        sections += [_section(f"`{name}`", table, level=4) for name, table in before]
        for kind, stage in scenario.stage_kinds.items():
            sections.append(_section(f'`[[stage]]` with `kind = "{kind}"`', stage, level=4))
        sections += [_section(f"`{name}`", table, level=4) for name, table in own if (name, table) not in before]
    return "\n".join(sections)


def _tables(scenario: type[AnyScenario]) -> list[tuple[str, type[Table]]]:
    """The tables of a scenario but its stages, by their heads: [name], or [[name]] where there may be several."""
    fields = scenario.model_fields.items()
    found = (
        (field.alias or name, _table(field), _depth(field.annotation)) for name, field in fields if name != "stages"
    )
    return [(f"[[{name}]]" if several else f"[{name}]", table) for name, table, several in found if table is not None]


def _section(title: str, table: type[Table], *, top: bool = False, level: int = 3, without: Sequence[str] = ()) -> str:
    """without: engines that do not have the table, or have another one of its name."""
    words = " or ".join(f'`engine = "{engine}"`' for engine in without)
    others = f" Not with {words}." if without else ""
    about = "" if top else f"{' '.join((table.__doc__ or '').split())}{others}\n\n"
    rows = "".join(f"| `{k}` | {_words_of_engine(k, v, top)} | {d} | {m} |\n" for k, v, d, m in _rows(table, "", top))
    return f"{'#' * level} {title}\n\n{about}{HEAD}{rows}"


def _words_of_engine(key: str, value: str, top: bool) -> str:
    """What may stand at a key; at `engine` what any scenario has there."""
    return " or ".join(f'`"{name}"`' for name in ENGINES) if top and key == "engine" else value


def _rows(table: type[Table], before: str, top: bool = False) -> Iterator[tuple[str, str, str, str]]:
    """key, value, default, meaning of each key, with the keys of inner tables after their own."""
    for name, field in table.model_fields.items():
        key = f"{before}{field.alias or name}"
        inner = _table(field)
        if top and (inner is not None or name == "stages"):
            continue
        if key == "kind" and field.is_required():
            continue  # of a stage: the section's title says it
        yield key, _value(field, inner), _default(field), _cell(field.description or "")
        if inner is not None:
            yield from _rows(inner, f"{key}.")


def _table(field: FieldInfo) -> type[Table] | None:
    """The table that a key holds, also in a list."""

    def walk(kind: Any) -> Iterator[type[Table]]:
        if isinstance(kind, type) and issubclass(kind, Table):
            yield kind
        for inner in typing.get_args(kind):
            yield from walk(inner)

    return next(walk(field.annotation), None)


def _value(field: FieldInfo, inner: type[Table] | None) -> str:
    """What may stand there: a quantity, a range of numbers, words, text."""
    example = f", e.g. `{toml_text(field.examples[0])}`" if field.examples else ""
    words = [
        w
        for kind in _parts(field.annotation)
        for w in typing.get_args(kind)
        if typing.get_origin(kind) is typing.Literal
    ]
    bounds = next(_bounds(field), None)
    own = next((extra.words for extra in field.metadata if isinstance(extra, Varied | Seeds)), None)
    if own is not None:
        return _cell(own + example)
    if inner is not None:
        said = "table" if inner.short_form is None else f"{_short(inner)} or table"
    elif isinstance(bounds, Quantity):
        said = " ".join([units.dimension(bounds.unit), bounds.words(bounds.unit)]).strip()
        said = " or ".join([*(f'`"{w}"`' for w in bounds.words_allowed), said])
    elif isinstance(bounds, FrictionNumber):
        said = "number from 0, or angle"
    elif isinstance(bounds, Number):
        said = " ".join(["whole number" if isinstance(bounds, Whole) else "number", bounds.words()]).strip()
    elif words:
        return " or ".join(f'`"{w}"`' for w in words)
    else:
        said = "`true` or `false`" if bool in map(_bare, _parts(field.annotation)) else "text"
        example = "" if said != "text" else example
    return _cell("list of: " * _depth(field.annotation) + said + example)


def _depth(kind: Any) -> int:
    """How many lists are around a value: 1 for a list, 2 for a list of lists."""
    first = _bare(next(iter(_parts(kind))))
    return 1 + _depth(typing.get_args(first)[0]) if typing.get_origin(first) is tuple else 0


def _short(table: type[Table]) -> str:
    """What the short form of a table is; of texts, those with a least length are names, and the others quantities."""
    form = table.short_form or {}
    usual = ("text" if "minLength" in form else "length") if form.get("type") == "string" else "number"
    return table.short_words or usual


def _parts(kind: Any) -> list[Any]:
    """The alternatives of a union, without None."""
    if isinstance(kind, types.UnionType) or typing.get_origin(kind) is typing.Union:
        return [one for one in typing.get_args(kind) if one is not type(None)]
    return [kind]


def _bare(kind: Any) -> Any:
    """A type without what it is annotated with."""
    return typing.get_args(kind)[0] if typing.get_origin(kind) is typing.Annotated else kind


def _bounds(field: FieldInfo) -> Iterator[Range]:
    """Units and ranges anywhere in the type of a field."""

    def walk(kind: Any) -> Iterator[Range]:
        yield from (extra for extra in getattr(kind, "__metadata__", ()) if isinstance(extra, Range))
        for inner in typing.get_args(kind):
            yield from walk(inner)

    yield from (extra for extra in field.metadata if isinstance(extra, Range))
    yield from walk(field.annotation)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    if field.default_factory is not None or field.default is None or field.default == {}:
        return ""
    return f"`{toml_text(field.default)}`"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
