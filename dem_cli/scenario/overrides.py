"""Changes to a scenario from the command line: `--set contact.friction=0.3`, `--set "stage.2.amplitude=800 gal"`."""

from __future__ import annotations

import tomllib
import types
import typing
from collections.abc import Iterable
from typing import Any

from dem_cli.scenario.engines import ALL_STAGES, engine_of, stages_of
from dem_cli.scenario.impulse import ImpulseScenario, names_in
from dem_cli.scenario.impulse_bodies import BodyKind
from dem_cli.scenario.impulse_tables import Plane
from dem_cli.scenario.model import Scenario
from dem_cli.scenario.table import Table, keys_of, nearest

LISTED = ("grains", "plane")


class _RefusedError(Exception):
    """Why an override cannot be applied: rule and remedy."""

    def __init__(self, rule: str, remedy: str) -> None:
        super().__init__(rule)
        self.rule = rule
        self.remedy = remedy


def apply_overrides(raw: dict[str, Any], overrides: Iterable[str]) -> list[str]:
    """Changes the TOML data `raw` in place, one KEY=VALUE after the other; the mistakes as lines.

    VALUE is read as TOML where that works (0.3, true, [1, 2]) and is text elsewhere (400 gal). Stages are counted from 1
    (stage.2.amplitude), or named by kind or name (stage.shake.amplitude); the number may be left out where only one stage knows
    the key. A key displaces those that exclude it: cycles takes the place of duration, and a shape drops the keys of others.
    """
    said = []
    for override in overrides:
        try:
            _apply(raw, override)
        except _RefusedError as refused:
            said.append(f"--set {override}: {refused.rule}. {refused.remedy}")
    return said


def _apply(raw: dict[str, Any], override: str) -> None:
    path, sign, text = override.partition("=")
    parts = [p.strip() for p in path.split(".")]
    if not sign or not all(parts):
        raise _RefusedError("is not KEY=VALUE", "Write for example --set contact.friction=0.3")
    value = read_value(text.strip())
    if parts[0] == "stage" and len(parts) > 1:
        for stage in _stages(raw, parts):
            rest = parts[2:] if _is_selector(raw, parts[1]) else parts[1:]
            _set(stages_of(raw)[stage["kind"]], stage, rest, value, parts[: len(parts) - len(rest)])
    elif parts[0] in LISTED and len(parts) > 1 and engine_of(raw) is ImpulseScenario:
        _set_listed(raw, parts, value)
    else:
        _set(engine_of(raw) or Scenario, raw, parts, value, [])


def _set_listed(raw: dict[str, Any], parts: list[str], value: Any) -> None:
    """Sets grains.KEY of the only kind of bodies, or grains.WHICH.KEY by number (from 1) or name; planes alike."""
    name = parts[0]
    listed = raw.get(name, [])
    if isinstance(listed, dict):
        listed = raw[name] = [listed]
    if not isinstance(listed, list) or not all(isinstance(one, dict) for one in listed):
        raise _RefusedError("is not a list of tables in the scenario", f"Write [[{name}]] there")
    names = names_in(name, listed)
    chosen = [k for k, own in enumerate(names) if parts[1] in (str(k + 1), own)]
    rest = parts[2:] if chosen else parts[1:]
    if not chosen and parts[1].isdigit():
        raise _RefusedError(f"there is no {name} {parts[1]}", f"The scenario has {len(listed)}, counted from 1")
    if not chosen and len(listed) != 1:
        full = " or ".join(f"{name}.{own or k}.{'.'.join(rest)}" for k, own in enumerate(names, 1))
        raise _RefusedError(
            "may mean several tables" if listed else "there is none", f"Write {full}" if listed else f"Add [[{name}]]"
        )
    if not rest:
        raise _RefusedError("names a table, but no key of it", f"Write for example --set {name}.{parts[1]}.name=first")
    before = parts[: len(parts) - len(rest)]
    for k in chosen or [0]:
        _set(BodyKind if name == "grains" else Plane, listed[k], rest, value, before)


def read_value(text: str) -> Any:
    """A value as it stands on the command line: TOML where that works, else text."""
    try:
        data = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return data["value"] if len(data) == 1 else text


def _set(table: type[Table], raw: dict[str, Any], parts: list[str], value: Any, before: list[str]) -> None:
    """Sets parts[0].parts[1]... of the table `raw`, whose path is `before`."""
    name, rest = parts[0], parts[1:]
    known = keys_of(table)
    if name not in known:
        if name in table.elsewhere:
            engine, advice = table.elsewhere[name]
            raise _RefusedError(f'belongs to engine = "{engine}"', advice)
        near = nearest(name, known)
        full = ".".join([*before, near, *rest]) if near else ""
        advice = f'Did you mean "{full}"?' if near else f"Known here: {', '.join(known)}"
        raise _RefusedError("unknown key", advice)
    if not rest:
        raw[name] = value
    else:
        inner = _table_of(table, name)
        if inner is None:
            raise _RefusedError(f"{'.'.join([*before, name])} is a value, not a table", f"Leave out .{'.'.join(rest)}")
        content = inner.spell_out(raw[name]) if name in raw else {}
        content = dict(content) if isinstance(content, dict) else {}
        _set(inner, content, rest, value, [*before, name])
        raw[name] = content
    for path in table.displaced(parts, value):
        _drop(raw, path)
    for group in table.alternatives:
        if any(name in option for option in group):
            for rival in (k for option in group if name not in option for k in option):
                raw.pop(rival, None)


def _drop(raw: dict[str, Any], path: tuple[str, ...]) -> None:
    """Leaves out the key at `path`, if it is there."""
    *parents, last = path
    table: Any = raw
    for parent in parents:
        table = table.get(parent) if isinstance(table, dict) else None
    if isinstance(table, dict):
        table.pop(last, None)


def _table_of(table: type[Table], name: str) -> type[Table] | None:
    """The table that key `name` holds, None for a plain value."""
    field = next(f for attribute, f in table.model_fields.items() if (f.alias or attribute) == name)
    kinds = typing.get_args(field.annotation) if isinstance(field.annotation, types.UnionType) else (field.annotation,)
    return next((k for k in kinds if isinstance(k, type) and issubclass(k, Table)), None)


def _usable_stages(raw: dict[str, Any]) -> list[tuple[int, dict[str, Any]]]:
    stages = raw.get("stage")
    listed = stages if isinstance(stages, list) else []
    return [(k, s) for k, s in enumerate(listed, 1) if isinstance(s, dict) and s.get("kind") in ALL_STAGES]


def _is_selector(raw: dict[str, Any], word: str) -> bool:
    return word.isdigit() or any(word in (s["kind"], s.get("name")) for _, s in _usable_stages(raw))


def _stages(raw: dict[str, Any], parts: list[str]) -> list[dict[str, Any]]:
    """The stages that stage.WHICH.KEY or stage.KEY means."""
    stages = _usable_stages(raw)
    which = parts[1]
    if _is_selector(raw, which):
        chosen = [s for k, s in stages if which in (str(k), s["kind"], s.get("name"))]
        if not chosen:
            raise _RefusedError(f"there is no stage {which}", f"The scenario has {len(stages)} stages, counted from 1")
        if len(parts) < 3:
            raise _RefusedError("names a stage, but no key of it", f"Write for example --set stage.{which}.name=first")
        return chosen
    knowing = [(k, s) for k, s in stages if which in keys_of(ALL_STAGES[s["kind"]])]
    if not knowing:
        known = sorted({k for _, s in stages for k in keys_of(ALL_STAGES[s["kind"]])})
        near = nearest(which, known)
        advice = f'Did you mean "stage.{".".join([near, *parts[2:]])}"?' if near else f"Known here: {', '.join(known)}"
        raise _RefusedError("unknown key", advice)
    if len(knowing) > 1:
        options = " or ".join(f"stage.{k}.{'.'.join(parts[1:])}" for k, _ in knowing)
        raise _RefusedError("may mean several stages", f"Write {options}")
    return [knowing[0][1]]
