"""Mistakes in scenarios of the granular element method, and keys that are of the other engine: a line each, with rule and remedy."""

from __future__ import annotations

import tomllib
from typing import Any

import jsonschema
import pytest
from quasi_static_text import quick
from scenario_text import ABSENT, small

from dem_cli.errors import ScenarioError
from dem_cli.scenario import parse_scenario
from dem_cli.scenario.reference import json_schema

SCHEMA = jsonschema.Draft202012Validator(json_schema())
OF_EXPLICIT = 'belongs to engine = "explicit". '
OF_GEM = 'belongs to engine = "granular-element". '


def lines_of(text: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text, origin="a.toml")
    return str(caught.value).splitlines()


COMPRESS = {"kind": "compress", "stress": "15 kPa"}
SHEAR = {"kind": "shear", "hold": "mean-stress", "shear_strain": 0.03}
CYCLIC = {"kind": "cyclic", "hold": "volume", "limit": {"strain": 0.01}, "cycles": 1}
LOAD = {"kind": "load", "x": {"stress": "1 kPa"}, "y": {"stress": "1 kPa"}}
MEMBRANE = {"boundary": {"kind": "membrane"}}

# changes of the small scenario -> the only line
ONE_LINE: list[tuple[dict[str, Any], str]] = [
    # keys of the other engine
    (
        {"contact.damping_ratio": 0.3},
        "[contact] damping_ratio = 0.3: " + OF_EXPLICIT + "Leave it out: a quasi-static test has no damping",
    ),
    ({"contact.restitution": 0.3}, "[contact] restitution = 0.3: " + OF_EXPLICIT),
    ({"contact.tension": "none"}, '[contact] tension = "none": ' + OF_EXPLICIT),
    (
        {"container.height": "1 m"},
        '[container] height = "1 m": ' + OF_EXPLICIT + "Leave it out: the top wall lies on the packing",
    ),
    ({"container.lid": True}, "[container] lid = true: " + OF_EXPLICIT),
    ({"integration": {"safety": 0.5}}, "[integration] = { safety = 0.5 }: " + OF_EXPLICIT),
    ({"output.interval": "1 s"}, '[output] interval = "1 s": ' + OF_EXPLICIT),
    (
        {"output.frames": "0.1 s"},
        '[output] frames = "0.1 s": must be a whole number. Write for example 1, a frame each increment',
    ),
    ({"output.window": {"side": 0.1}}, "[output] window = { side = 0.1 }: " + OF_EXPLICIT),
    (
        {"stage.1": {"kind": "shake"}},
        '[[stage]] 2 (shake) kind = "shake": '
        + OF_EXPLICIT
        + 'Write engine = "explicit", or one of compress, shear, load, cyclic',
    ),
    (
        {"stage.1": {"kind": "sheer"}},
        '[[stage]] 2 kind = "sheer": must be one of compress, shear, load, cyclic. Did you mean "shear"?',
    ),
    ({"stage.1.kind": ABSENT}, "[[stage]] 2 kind: is missing. Write kind = one of compress, shear, load, cyclic"),
    ({"stage": []}, 'stage = []: is empty. Add at least one stage: [[stage]] with kind = "compress"'),
    (
        {"engine": "granular"},
        'engine = "granular": must be one of explicit, granular-element, impulse. Did you mean "granular-element"?',
    ),
    ({"engine": 3}, "engine = 3: must be one of explicit, granular-element, impulse"),
    # units
    (
        {"stage.0.stress": 15},
        '[[stage]] 1 (compress) stress = 15: is a bare number, a stress needs its unit. Write "15 kPa"',
    ),
    ({"stage.0.stress": "15 N"}, '[[stage]] 1 (compress) stress = "15 N": is a force, a stress is wanted'),
    ({"solver": {"accuracy": "1 Pa"}}, '[solver] accuracy = "1 Pa": is a stress, a force is wanted'),
    ({"contact.cohesion": "-1 N"}, '[contact] cohesion = "-1 N": is out of range, allowed is from 0 N'),
    (
        {"contact.friction": "95 deg"},
        '[contact] friction = "95 deg": is out of range, allowed is from 0 deg, below 90 deg',
    ),
    ({"contact.friction": "25"}, '[contact] friction = "25": must be a plain number. Write 25 without quotes'),
    (
        {"contact.friction": "25 mm"},
        '[contact] friction = "25 mm": is a length, an angle is wanted. Write a plain number, or a friction angle',
    ),
    ({"contact.friction": -0.1}, "[contact] friction = -0.1: is out of range, allowed is from 0"),
    ({"contact.wall_friction": {"left": "-5 deg"}}, '[contact] wall_friction.left = "-5 deg": is out of range'),
    # grains and packing
    (
        {"grains.shape": "clump", "grains.count": 30},
        '[grains] shape = "clump": is not for engine = "granular-element", which moves discs. Write shape = "disc"',
    ),
    (
        {"grains.count": 31, "grains.radius": {"classes": [{"radius": "3 mm", "count": 30}]}},
        "[grains] count = 31: differs from the 30 grains of the classes",
    ),
    ({"grains.radius": {"classes": []}}, "[grains] radius.classes = []: is empty"),
    (
        {"container.width": "11 mm"},
        '[container] width = "11 mm": is narrower than the largest grain, which is up to 0.012 m across',
    ),
    (
        {"packing": {"method": "falling", "grid": {"columns": 8, "spacing": "11 mm"}}},
        '[packing] grid.spacing = "11 mm": is smaller than the largest grain',
    ),
    ({"output.tracks": {"grains": [30]}}, "[output] tracks.grains = [30]: names grain 30, but there are only 30 ids"),
    ({"output.tracks": {"grains": [3, 3]}}, "[output] tracks.grains = [3, 3]: names grain 3 twice"),
    # boundary and solver
    (
        {"boundary": {"radius": "3 mm"}},
        '[boundary] radius = "3 mm": is no key of kind = "walls". Leave it out, or write kind = "chain" or "membrane"',
    ),
    (
        {"boundary": {"kind": "chain", "link_stiffness": "1 N/m"}},
        '[boundary] link_stiffness = "1 N/m": is no key of kind = "chain"',
    ),
    (
        {"solver": {"beta": 20}},
        '[solver] beta = 20: is no key of method = "momentum", whose steps follow from the stiffness. Leave it out, or write method = "kishino"',
    ),
    ({"solver": "jacobi"}, '[solver] = "jacobi": must be one of momentum, kishino'),
    # stages
    ({"stage.0.levels": [0.5, 0.2, 1.0]}, "[[stage]] 1 (compress) levels = [0.5, 0.2, 1.0]: must be ascending"),
    ({"stage.0.levels": [0.5]}, "[[stage]] 1 (compress) levels = [0.5]: must end with 1, the whole stress"),
    ({"stage.0.levels": []}, "[[stage]] 1 (compress) levels = []: is empty"),
    ({"stage.1.hold": ABSENT}, '[[stage]] 2 (shear) hold: is missing. Add for example hold = "mean-stress"'),
    ({"stage.1.hold": "mean stress"}, '[[stage]] 2 (shear) hold = "mean stress": must be one of mean-stress, '),
    (
        {"stage.1.total": "mean-stress"},
        '[[stage]] 2 (shear) total = "mean-stress": is a key of hold = "volume", which closes the pores, not of "mean-stress"',
    ),
    (
        {"stage.3.hold": "lateral-strain", "stage.3.total": "mean-stress"},
        '[[stage]] 4 (cyclic) total = "mean-stress": is a key of hold = "volume"',
    ),
    ({"stage.1.increment": 0.04}, "[[stage]] 2 (shear) increment = 0.04: is larger than shear_strain, 0.03"),
    ({"stage.1.shear_strain": -0.03}, "[[stage]] 2 (shear) shear_strain = -0.03: is out of range, allowed is above 0"),
    (
        {"stage.2.x.strain": 0.1},
        "[[stage]] 3 (load) x.strain = 0.1: contradicts stress. Give only one of: stress or strain",
    ),
    ({"stage.2.x": {}}, "[[stage]] 3 (load) x.stress: is missing. Give one of: stress or strain"),
    ({"stage.2.y": ABSENT}, "[[stage]] 3 (load) y: is missing. Add for example y = { strain = 0.01 }"),
    (
        {"stage.3.limit": {"stress": "1 kPa", "strain": 0.1}},
        "[[stage]] 4 (cyclic) limit.strain = 0.1: contradicts stress. Give only one of: stress or stress_ratio or strain",
    ),
    ({"stage.3.limit": {"strain": 1e-5}}, "[[stage]] 4 (cyclic) increment: is larger than limit.strain, 1e-05"),
    (
        {"stage.3.limit": {"strain": 0.03}, "stage.3.max_strain": 0.05},
        "[[stage]] 4 (cyclic) max_strain = 0.05: is less than from one limit to the other, which is 0.06",
    ),
    ({"stage.3.from": "shaer"}, '[[stage]] 4 (cyclic) from = "shaer": names no earlier stage. Did you mean "shear"?'),
    ({"stage.0.from": "compress"}, '[[stage]] 1 (compress) from = "compress": names no earlier stage. Leave it out'),
    (
        {"stage": [COMPRESS, COMPRESS, {**SHEAR, "from": "compress"}]},
        '[[stage]] 3 (shear) from = "compress": names several earlier stages',
    ),
    (
        {"stage": [SHEAR]},
        '[[stage]] 1 (shear) hold = "mean-stress": nothing has compressed the sample before: there is no stress to hold. Put a stage',
    ),
    ({"stage": [SHEAR, SHEAR]}, '[[stage]] 1 (shear) hold = "mean-stress": nothing has compressed'),
    (
        {"stage": [CYCLIC]},
        '[[stage]] 1 (cyclic) hold = "volume": nothing has compressed the sample before: there is no stress to begin with',
    ),
    # a membrane gives pressure on the sides
    (
        {**MEMBRANE, "stage": [COMPRESS, {**SHEAR, "hold": "lateral-stress", "axial": "x"}]},
        '[[stage]] 2 (shear) axial = "x": contradicts boundary.kind = membrane',
    ),
    (
        {**MEMBRANE, "stage": [COMPRESS, CYCLIC]},
        '[[stage]] 2 (cyclic) hold = "volume": contradicts boundary.kind = membrane',
    ),
    (
        {**MEMBRANE, "stage": [COMPRESS, SHEAR]},
        '[[stage]] 2 (shear) hold = "mean-stress": contradicts boundary.kind = membrane, which holds its pressure on the sides and nothing '
        'else. Write hold = "lateral-stress", or take boundary.kind = "walls" or "chain"',
    ),
    (
        {**MEMBRANE, "stage": [{**LOAD, "x": {"strain": 0.1}}]},
        "[[stage]] 1 (load) x.strain = 0.1: contradicts boundary.kind = membrane",
    ),
]


def test_set_tells_whose_key_it_is() -> None:
    with pytest.raises(
        ScenarioError, match=r'contact\.restitution=0\.5: belongs to engine = "explicit"\. Leave it out'
    ):
        parse_scenario(quick({}), overrides=["contact.restitution=0.5"])


@pytest.mark.parametrize(("changes", "line"), ONE_LINE, ids=lambda value: str(value)[:60])
def test_mistake(changes: dict[str, Any], line: str) -> None:
    found = lines_of(quick(changes))
    assert len(found) == 1
    assert found[0].startswith(f"a.toml: {line}")
    assert found[0].count(". ") >= 1  # a rule and a remedy


# The same in scenarios of the explicit engine, of keys of this one.
OF_THIS_ENGINE: list[tuple[dict[str, Any], str]] = [
    ({"contact.cohesion": "1 N"}, '[contact] cohesion = "1 N": ' + OF_GEM),
    ({"boundary": {"kind": "chain"}}, '[boundary] = { kind = "chain" }: ' + OF_GEM),
    ({"solver": "kishino"}, '[solver] = "kishino": ' + OF_GEM),
    (
        {"stage.1": SHEAR},
        '[[stage]] 2 (shear) kind = "shear": '
        + OF_GEM
        + 'Write engine = "granular-element", or one of settle, shake, run',
    ),
    (
        {"packing": {"method": "overlapping"}},
        '[packing] method = "overlapping": belongs to engine = "granular-element", which',
    ),
    ({"container.width": ABSENT}, '[container] width: is missing. Add for example width = "121.5 cm"'),
]


@pytest.mark.parametrize(("changes", "line"), OF_THIS_ENGINE, ids=lambda value: str(value)[:60])
def test_mistake_in_the_other_engine(changes: dict[str, Any], line: str) -> None:
    found = lines_of(small(changes))
    assert len(found) == 1
    assert found[0].startswith(f"a.toml: {line}")


@pytest.mark.parametrize(
    "changes",
    [
        {"stage": [LOAD, SHEAR]},
        {"stage": [{**SHEAR, "hold": "lateral-strain"}]},
        {"stage": [COMPRESS, {**SHEAR, "name": "a"}, {**CYCLIC, "from": "a"}]},
        {**MEMBRANE, "stage": [COMPRESS, {**SHEAR, "hold": "lateral-stress"}]},
        {"packing": {"method": "falling", "grid": {"columns": 8, "spacing": "12 mm"}}},
        {"solver": {"method": "kishino", "beta": 0}},
        {"contact.friction": 0.3, "contact.wall_friction": "5 deg"},
    ],
    ids=lambda value: str(value)[:60],
)
def test_no_mistake(changes: dict[str, Any]) -> None:
    parse_scenario(quick(changes))
    assert SCHEMA.is_valid(tomllib.loads(quick(changes)))


def test_schema_takes_what_the_model_takes() -> None:
    for text in (quick(), small(), parse_scenario(quick()).resolved_toml(), parse_scenario(small()).resolved_toml()):
        assert SCHEMA.is_valid(tomllib.loads(text))


@pytest.mark.parametrize(
    "changes",
    [
        {"contact.damping_ratio": 0.3},
        {"stage.1": {"kind": "settle"}},
        {"integration": {"safety": 0.5}},
        {"engine": "explicit"},
        {"engine": "impulse"},
        {"engine": ABSENT},
        {"stage.2.x.strain": 0.1},
        {"stage.3.limit": {}},
        {"stage.0.stress": 15},
        {"contact.friction": "steep"},
        {"solver": "jacobi"},
        {"grains.radius": {"classes": [{"radius": "3 mm"}]}},
    ],
    ids=str,
)
def test_schema_refuses_what_the_model_refuses(changes: dict[str, Any]) -> None:
    assert not SCHEMA.is_valid(tomllib.loads(quick(changes)))
    lines_of(quick(changes))


def test_schema_of_the_other_engine_knows_its_own_keys_only() -> None:
    for changes in (
        {"solver": "kishino"},
        {"contact.cohesion": "1 N"},
        {"stage.1": SHEAR},
        {"container.width": ABSENT},
    ):
        assert not SCHEMA.is_valid(tomllib.loads(small(changes)))
