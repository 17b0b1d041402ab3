"""Reads a scenario: TOML text -> data -> overrides -> model, with all mistakes of the user in one error."""

from __future__ import annotations

import contextlib
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from dem_cli import units
from dem_cli.errors import OverrideError, ScenarioError
from dem_cli.scenario import mistakes
from dem_cli.scenario.base import AnyScenario, DiscScenario, tracked_exist
from dem_cli.scenario.engines import EngineScenario, engine_of, missing_engine, stages_of, unknown_engine
from dem_cli.scenario.grain_file import SCALE, read_grain_file
from dem_cli.scenario.impulse import ImpulseScenario
from dem_cli.scenario.model import Scenario
from dem_cli.scenario.overrides import apply_overrides
from dem_cli.scenario.quasi_static import QuasiStaticScenario, unprepared
from dem_cli.scenario.raw_record import RecordError
from dem_cli.scenario.stages import Shake
from dem_cli.scenario.stored_grains import StoredGrains, is_result_file, read_stored_grains
from dem_cli.scenario.sweep import Sweep
from dem_cli.scenario.table import NOTHING, value_at

Found = tuple[tuple[str | int, ...], Any, str, str]  # a mistake: place, value, rule, remedy


def load_scenario(path: str | Path, overrides: Iterable[str] = ()) -> EngineScenario:
    """The scenario of a TOML file, changed by `overrides` ("contact.friction=0.3"). ScenarioError holds a line per mistake."""
    path = Path(path)
    scenario = parse_scenario(read_text(path), origin=str(path), folder=path.parent, overrides=overrides)
    scenario._path = path
    return scenario


def read_text(path: Path) -> str:
    """The text of a scenario file. ScenarioError if it cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ScenarioError(f"{path}: does not exist. List the scenarios that come along with: dem init") from None
    except IsADirectoryError:
        raise ScenarioError(f"{path}: is a folder. Name a scenario file in it") from None
    except UnicodeDecodeError:
        raise ScenarioError(f"{path}: is not text in UTF-8. Save it in this encoding") from None
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror}). Check the path and its permissions") from None


def parse_scenario(
    text: str, origin: str = "<text>", folder: str | Path = ".", overrides: Iterable[str] = ()
) -> EngineScenario:
    """The scenario that `text` holds. origin: its name in messages. folder: where paths in it start."""
    raw = read_toml(text, origin)
    folder = Path(folder)
    sweep, in_sweep = read_sweep(raw)
    lines = apply_overrides(raw, overrides)
    refused = bool(lines)
    lines += [mistakes.line(origin, *one, raw) for one in in_sweep]
    if sweep and sweep.scenarios:
        rule = "sweeps other files, and is no scenario of its own"
        lines.append(
            mistakes.line(origin, ("sweep", "scenarios"), list(sweep.scenarios), rule, "Run it with dem sweep", raw)
        )
        raise ScenarioError("\n".join(lines))
    kind, missing = engine_of(raw), missing_engine(raw)
    if kind is None or missing:
        loc, rule, remedy = missing or unknown_engine(raw)
        lines.append(mistakes.line(origin, loc, raw.get("engine", NOTHING), rule, remedy, raw))
        raise ScenarioError("\n".join(lines))
    _width_of_file(raw, folder, kind)
    scenario: EngineScenario | None = None
    found: list[Found] = []
    try:
        scenario = kind.model_validate(raw)
    except ValidationError as error:
        for one in error.errors(include_url=False):
            ctx = one["ctx"]
            found.append((one["loc"], one["input"], ctx["rule"], ctx["remedy"]))
    from_file: list[Found] = []
    if kind is ImpulseScenario:
        assert scenario is None or isinstance(scenario, ImpulseScenario)
        said = [one[0] for one in found]
        from_file += [one for one in _missing_files(raw, folder) if one[0] not in said]
        from_file += [] if from_file else _stored_bodies(folder, scenario)
    elif not any(one[0] == ("packing", "file") for one in found):
        assert not isinstance(scenario, ImpulseScenario)
        from_file += _packing_file(raw, folder, scenario)
    from_file += _records(raw, folder, scenario)
    order = list(raw)
    found.sort(key=lambda one: order.index(str(one[0][0])) if one[0][0] in order else len(order))
    lines += [mistakes.line(origin, *one, raw) for one in found]
    lines += [mistakes.line(origin, *one, raw) for one in from_file]
    if lines or scenario is None:
        raise (OverrideError if refused else ScenarioError)("\n".join(dict.fromkeys(lines)))
    scenario._source, scenario._sweep = text, sweep
    scenario._folder = folder
    return scenario


def read_toml(text: str, origin: str) -> dict[str, Any]:
    """The data that TOML text holds. ScenarioError, with advice, if it is none."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(mistakes.syntax(origin, text, error)) from None


def read_sweep(raw: dict[str, Any]) -> tuple[Sweep | None, list[Found]]:
    """Takes the table [sweep] out of TOML data, with its mistakes: it belongs to no run."""
    if "sweep" not in raw:
        return None, []
    table = raw.pop("sweep")
    try:
        return Sweep.model_validate(table), []
    except ValidationError as error:
        found = [
            (("sweep", *one["loc"]), one["input"], one["ctx"]["rule"], one["ctx"]["remedy"])
            for one in error.errors(include_url=False)
        ]
        return None, found


def _width_of_file(raw: dict[str, Any], folder: Path, kind: type[AnyScenario]) -> None:
    """Fills in the width of an explicit scenario's container, where it is left out, from the result file that gives the grains."""
    packing, container = raw.get("packing"), raw.get("container")
    name = packing.get("file") if isinstance(packing, dict) else None
    given = container if isinstance(container, dict) else {} if container is None else None
    if kind is not Scenario or given is None or "width" in given or not isinstance(name, str):
        return
    stage = packing.get("stage") if isinstance(packing, dict) else None
    if not is_result_file(name):
        return
    with contextlib.suppress(ScenarioError):  # said with the other mistakes
        stored = read_stored_grains(folder / name, stage if isinstance(stage, str) else None)
        raw["container"] = {**given, "width": units.write(stored.width, "m")}


def _records(raw: dict[str, Any], folder: Path, scenario: EngineScenario | None) -> list[Found]:
    """Reads the records of shaking into their stages; their mistakes, also where the scenario has others."""
    found: list[Found] = []
    tables = raw.get("stage")
    for number, table in enumerate(tables if isinstance(tables, list) else []):
        if not (isinstance(table, dict) and table.get("kind") == "shake" and "record" in table):
            continue
        try:
            stage: Any = scenario.stages[number] if scenario else stages_of(raw)["shake"].model_validate(table)
        except ValidationError:
            continue
        assert isinstance(stage, Shake)
        try:
            stage.read_record(folder)
        except RecordError as error:
            keys: tuple[str, ...] = ("record", *error.key.split("."))
            keys = keys[:1] if isinstance(table["record"], str) else keys
            value: Any = table
            for key in keys:
                value = value.get(key, NOTHING) if isinstance(value, dict) else NOTHING
            found.append((("stage", number, *keys), value, error.rule, error.remedy))
    return found


def _missing_files(raw: dict[str, Any], folder: Path) -> list[Found]:
    """Files of bodies, terrain and packing that are named and not there."""
    grains = raw.get("grains")
    kinds = grains if isinstance(grains, list) else [grains]
    places: list[tuple[tuple[str | int, ...], Any]] = [(("grains", k, "file"), kind) for k, kind in enumerate(kinds)]
    places += [((name, "file"), raw.get(name)) for name in ("terrain", "packing")]
    found: list[Found] = []
    for loc, table in places:
        name = table.get("file") if isinstance(table, dict) else None
        if isinstance(name, str) and not (folder / name).is_file():
            found.append((loc, name, "does not exist", "The path is taken from the scenario's folder"))
    return found


def _stored_bodies(folder: Path, scenario: ImpulseScenario | None) -> list[Found]:
    """Reads the bodies of a packing's file; mistakes of it, and of what disagrees with it."""
    if scenario is None or scenario.packing.file is None:
        return []
    scenario._folder = folder
    try:
        scenario.read_packing()
    except ScenarioError as error:
        rule, _, remedy = str(error).removeprefix(f"{folder / scenario.packing.file}: ").rpartition(". ")
        return [(("packing", "file"), scenario.packing.file, rule, remedy)]
    return [(one.loc, value_at(scenario.to_dict(), one.loc), one.rule, one.remedy) for one in scenario.rules_of_file()]


def _stored_shape(stored: StoredGrains, name: str, scenario: DiscScenario) -> list[Found]:
    """Grains of a result file are of the scenario's shape; bonded grains and clumps of one template may stand for each other."""
    shape, elements = scenario.grains.shape, scenario.grains.elements
    alike = {"bonded": "clump", "clump": "bonded"}
    if stored.shape != shape and stored.shape != alike.get(shape):
        rule = f'is not the shape of the grains of {name}, which is "{stored.shape}"'
        return [(("grains", "shape"), shape, rule, f'Write shape = "{stored.shape}", or take another file')]
    if any(np.bincount(stored.body) != elements):
        rule = f"has {elements} discs a grain, those of {name} have {np.bincount(stored.body).max()}"
        return [(("grains", "template"), NOTHING, rule, "Write the template of the run that made the file")]
    return []


def _packing_file(raw: dict[str, Any], folder: Path, scenario: Scenario | QuasiStaticScenario | None) -> list[Found]:
    """Mistakes of the file of grains, and of keys that disagree with it."""
    packing = raw.get("packing")
    name = packing.get("file") if isinstance(packing, dict) else None
    if not isinstance(name, str):
        return []
    unit = packing.get("file_unit", "m") if isinstance(packing, dict) else "m"
    try:
        stage = packing.get("stage") if isinstance(packing, dict) else None
        grains = read_grain_file(
            folder / name, unit if unit in SCALE else "m", stage if isinstance(stage, str) else None
        )
    except ScenarioError as error:
        rule, _, remedy = str(error).removeprefix(f"{folder / name}: ").rpartition(". ")
        return [(("packing", "file"), name, rule, remedy)]
    if scenario is None:
        return []
    found: list[Found] = []
    count = scenario.grains.count
    if count is not None and count != len(grains.x):
        rule = f"differs from the {len(grains.x)} grains of {name}"
        found.append((("grains", "count"), count, rule, "Leave count out: the file gives it"))
    shape, ratio = scenario.grains.shape, scenario.grains.aspect_ratio
    if grains.stored:
        found += _stored_shape(grains.stored, name, scenario)
        if isinstance(scenario, QuasiStaticScenario) and grains.stored.engine != scenario.engine:
            table = raw["stage"]
            found += [(m.loc, table[m.loc[1]].get("hold"), m.rule, m.remedy) for m in unprepared(scenario.stages)]
    if grains.aspect is not None and shape != "ellipse":
        rule = f'has a column aspect, which is none of shape = "{shape}"'
        found.append((("packing", "file"), name, rule, 'Leave the column out, or write shape = "ellipse"'))
    elif grains.aspect is not None and ratio:
        rule = f"contradicts the column aspect of {name}"
        found.append((("grains", "aspect_ratio"), raw["grains"]["aspect_ratio"], rule, "Leave one of them out"))
    elif shape == "ellipse" and grains.aspect is None and not ratio:
        remedy = f"Add for example aspect_ratio = 2, or a column aspect to {name}"
        found.append((("grains", "aspect_ratio"), NOTHING, "is missing", remedy))
    if scenario.output.tracks:
        ids, count = list(scenario.output.tracks.grains), len(grains.x) * scenario.grains.elements
        found += [(m.loc, ids, m.rule, m.remedy) for m in tracked_exist(scenario.output.tracks, count)]
    return found
