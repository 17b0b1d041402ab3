"""The model as a manual: every key says what it means, and the tables and the schema are complete."""

from __future__ import annotations

import json
import tomllib
from typing import Any

import jsonschema
import pytest
from scenario_text import ABSENT, small

from dem_cli.scenario import parse_scenario
from dem_cli.scenario.engines import ALL_STAGES, ENGINES
from dem_cli.scenario.reference import json_schema, reference_markdown
from dem_cli.scenario.sweep import Sweep
from dem_cli.scenario.table import Table, _good_values

# Keys from which defaults of others follow.
NEEDED = {"friction": 0.1, "hold": "volume", "limit": {"strain": 0.01}}


def all_tables(start: type[Table]) -> set[type[Table]]:
    """Every table class that the scenario can hold."""
    found: set[type[Table]] = set()

    def walk(kind: Any) -> None:
        if isinstance(kind, type) and issubclass(kind, Table) and kind not in found:
            found.add(kind)
            for field in kind.model_fields.values():
                walk(field.annotation)
        for inner in getattr(kind, "__args__", ()):
            walk(inner)

    walk(start)
    return found


TABLES = sorted(
    set.union(all_tables(Sweep), *(all_tables(scenario) for scenario in ENGINES.values())),
    key=lambda table: table.__name__,
)
SCENARIOS = set(ENGINES.values())


def test_all_tables_are_found() -> None:
    assert {
        "Scenario",
        "Radius",
        "Grading",
        "ExtraDamping",
        "Shake",
        "Window",
        "QuasiStaticScenario",
        "Cyclic",
        "Limit",
    } <= {t.__name__ for t in TABLES}


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_every_key_is_described(table: type[Table]) -> None:
    assert table.__doc__
    for name, field in table.model_fields.items():
        assert field.description, name
        if table not in SCENARIOS:
            assert field.examples, name


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_examples_are_valid(table: type[Table]) -> None:
    """What messages suggest to write must be right."""
    for name, field in table.model_fields.items():
        if field.examples:
            assert name in _good_values(table, NEEDED | {field.alias or name: field.examples[0]}), name


def test_reference_names_every_key() -> None:
    text = reference_markdown()
    for table in TABLES:
        if table in SCENARIOS:
            continue
        for name, field in table.model_fields.items():
            key = field.alias or name
            assert f"{key}` |" in text or key == "kind", (table.__name__, key)
    for kind in ALL_STAGES:
        assert f'kind = "{kind}"' in text
    assert '| `density` | density above 0 kg/m^3, e.g. `"2480 kg/m^3"` | required | density of the solid |' in text
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert all(row.count("|") - row.count("\\|") == 5 for row in rows)


SCHEMA = json_schema()


def valid(text: str) -> bool:
    return bool(jsonschema.Draft202012Validator(SCHEMA).is_valid(tomllib.loads(text)))


def test_schema_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


def test_schema_takes_what_the_model_takes() -> None:
    assert valid(small())
    assert valid(parse_scenario(small()).resolved_toml())
    assert valid(
        small({"grains.radius": "7 mm", "contact.wall_friction": {"bottom": 0.1}, "integration.time_step": "auto"})
    )


def test_schema_knows_sweeps() -> None:
    """Beside a scenario, or alone if it names other files."""
    grid = {"stage.shake.amplitude": ["400 gal"], "seed": {"from": 1, "to": 5, "step": 1}}
    assert valid(small({"sweep": {"grid": grid, "seeds": 3, "zip": {"a": [1], "b": [2]}}}))
    assert valid('title = "all"\n[sweep]\nscenarios = ["a.toml"]\nseeds = [1, 2]\n')
    assert not valid('title = "all"\n[sweep]\nseeds = [1, 2]\n')
    assert not valid(small({"sweep": {"grids": grid}}))
    assert not valid(small({"sweep": {"grid": {"a": []}}}))
    assert not valid(small({"sweep": {"seeds": "all"}}))


@pytest.mark.parametrize(
    "changes",
    [
        {"contact.frction": 0.5},
        {"contact.friction": "0.5"},
        {"contact.friction": ABSENT},
        {"contact.restitution": 0.5},
        {"contact.tension": "some"},
        {"container.width": 121.5},
        {"container.width": "121.5"},
        {"container.width": "wide"},
        {"material.poisson_ratio": 0.5},
        {"grains.count": 0},
        {"stage.1.amplitude": ABSENT},
        {"stage.1.cycles": 5},
        {"stage.0.kind": "wait"},
        {"integration.time_step": "autom"},
        {"title": 1},
    ],
    ids=str,
)
def test_schema_refuses_what_the_model_refuses(changes: dict[str, Any]) -> None:
    assert not valid(small(changes))


def test_schema_shows_units_ranges_and_defaults_to_editors() -> None:
    properties = SCHEMA["$defs"]["Container"]["properties"]
    assert (
        "inner width; may be left out with a result file, whose width it then is [length with its unit, above 0 m]"
        in properties["width"]["description"]
    )
    assert properties["gravity"]["default"] == "9.80665 m/s^2"
    assert "null" not in json.dumps(SCHEMA)
