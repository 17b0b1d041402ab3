"""Mistakes in scenarios of the impulse engine, and its keys in those of others: a line each, with rule and remedy."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from impulse_text import BOX, PLACED, drop, pour
from quasi_static_text import quick
from scenario_text import ABSENT, small

from dem_cli.errors import ScenarioError
from dem_cli.scenario import parse_scenario
from dem_cli.scenario.reference import json_schema

SCHEMA = jsonschema.Draft202012Validator(json_schema())
OF_EXPLICIT, OF_GEM, OF_IMPULSE = (
    f'belongs to engine = "{name}". ' for name in ("explicit", "granular-element", "impulse")
)
RANDOM = {"uniform": [1, 2]}
REGION = {"from": ["0 m", "0 m", "0 m"], "to": ["1 m", "1 m", "1 m"]}


def lines_of(text: str, folder: Path | str = ".") -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text, origin="a.toml", folder=folder)
    return str(caught.value).splitlines()


# changes of the box above a floor -> the only line
OF_DROP: list[tuple[dict[str, Any], str]] = [
    # bodies
    ({"grains.sise": "1 m"}, '[grains] sise = "1 m": unknown key. Did you mean "size"?'),
    ({"grains.size": 2}, '[grains] size = 2: is a bare number, a length needs its unit. Write "2 m"'),
    ({"grains.size": "2"}, '[grains] size = "2": has no unit, a length is wanted'),
    ({"grains.size": ["1 m", "2 m"]}, "[grains] size (3rd value): is missing. Give all values"),
    ({"grains.size": ["1 m", "0 m", "1 m"]}, '[grains] size (2nd value) = "0 m": is out of range, allowed is above 0 m'),
    ({"grains.size": ABSENT}, "[grains] size: is missing. Add for example size = "),
    ({"grains.radius": "1 m"}, '[grains] radius = "1 m": is no key of shape = "box". Leave it out, or write shape = "sphere" or "clump"'),
    ({"grains.template": "cube"}, '[grains] template = "cube": is no key of shape = "box"'),
    ({"grains.file": "x"}, '[grains] file = "x": is no key of shape = "box". Leave it out, or write shape = "cloud" or "mesh"'),
    ({"grains.spacing": "1 m"}, '[grains] spacing = "1 m": is no key of shape = "box"'),
    ({"grains.face_points": -1}, "[grains] face_points = -1: is out of range"),
    ({"grains.density": "0 kg/m^3"}, '[grains] density = "0 kg/m^3": is out of range'),
    ({"grains.shape": "disc"}, '[grains] shape = "disc": ' + OF_EXPLICIT + 'Write shape = "sphere"'),
    ({"grains.shape": "cylinder"}, '[grains] shape = "cylinder": must be one of box, sphere, clump, cloud, mesh'),
    ({"grains.aspect_ratio": 2}, "[grains] aspect_ratio = 2: " + OF_EXPLICIT),
    ({"grains.scale": 0}, "[grains] scale = 0: is out of range, allowed is above 0"),
    ({"grains.scale": -1.5}, "[grains] scale = -1.5: is out of range"),
    ({"grains.scale": {"uniform": [2, 1]}}, "[grains] scale.uniform = [2, 1]: must be ascending. Write the smaller factor first"),
    ({"grains.scale": {"list": []}}, "[grains] scale.list = []: is empty"),
    (
        {"grains.scale": {"normal": {"mean": 1, "sd": 0.1, "min": 2, "max": 1}}},
        "[grains] scale.normal.min = 2: must be smaller than max. Swap them, or raise max above 2",
    ),
    ({"grains.name": 3}, "[grains] name = 3: must be text in quotes"),
    ({"grains": 3}, "[grains] = 3: must be a table, or a list of tables. Head it with [grains], or each one with [[grains]]"),
    ({"grains": []}, "[grains] = []: is empty. Add the table [grains]"),
    ({"grains": ABSENT}, "[grains]: is missing. Add the table [grains]"),
    # where they start
    ({"grains.count": 3}, "[grains] step: is missing: all 3 bodies would start at the same place. Add for example step = "),
    ({"grains.count": 3, "grains.step": ["0 m"] * 3}, "[grains] step = " + '["0 m", "0 m", "0 m"]: puts all bodies at the same place'),
    (
        {"grains.step": ["0 m", "0 m", "1 m"], "grains.position": ABSENT, "packing": {"region": REGION}},
        "[grains] step = " + '["0 m", "0 m", "1 m"]: has no position that it goes on from',
    ),
    ({"grains.position": ABSENT}, "[grains] position: is missing, and there is neither container nor region"),
    ({"grains.position": "1 m"}, '[grains] position = "1 m": must be a list. Write it in square brackets'),
    ({"grains.orientation": "randm"}, '[grains] orientation = "randm": must be "random", or a table. Write for example { axis'),
    (
        {"grains.orientation": {"axis": [0, 0, 0], "angle": "3 deg"}},
        "[grains] orientation.axis = [0, 0, 0]: is all zeros, which is no direction",
    ),
    ({"grains.orientation": {"axis": [0, 0, 1]}}, "[grains] orientation.angle: is missing. Give all of: axis, angle"),
    ({"grains.orientation": {"quaternion": [0, 0, 0, 0]}}, "[grains] orientation.quaternion = [0, 0, 0, 0]: is all zeros"),
    ({"grains.velocity": ["1 m", "0 m/s", "0 m/s"]}, '[grains] velocity (1st value) = "1 m": is a length, a velocity is wanted'),
    (
        {"grains.spin": ["1 Hz", "0 rad/s", "0 rad/s"]},
        '[grains] spin (1st value) = "1 Hz": is a frequency, an angular velocity is wanted',
    ),
    # contact
    ({"contact.restitution": 1.2}, "[contact] restitution = 1.2: is out of range, allowed is from 0, up to 1"),
    ({"contact.restitution": ABSENT}, "[contact] restitution: is missing"),
    ({"contact.friction": -1}, "[contact] friction = -1: is out of range, allowed is from 0"),
    ({"contact.damping_ratio": 0.3}, "[contact] damping_ratio = 0.3: " + OF_EXPLICIT + "Give restitution in its place"),
    ({"contact.wall_friction": 0.3}, "[contact] wall_friction = 0.3: " + OF_EXPLICIT + "Give it in pairs"),
    ({"contact.cohesion": "1 N"}, '[contact] cohesion = "1 N": ' + OF_GEM),
    (
        {"contact.pairs": [{"between": ["box", "flor"], "friction": 0.1}]},
        '[contact] pairs.between (1st value, 2nd value) = "flor": is no material here. Did you mean "floor"?',
    ),
    ({"contact.pairs": [{"between": ["box", "floor"]}]}, "[contact] pairs.friction (1st value): is missing. Give friction, restitution"),
    (
        {"contact.pairs": [{"between": names, "friction": 0.1} for names in (["box", "floor"], ["floor", "box"])]},
        "[contact] pairs (2nd value) = { between = " + '["floor", "box"], friction = 0.1 }: names the same two materials',
    ),
    # planes, container, terrain
    ({"plane.0.normal": [0, 0, 0]}, "[[plane]] 1 (floor) normal = [0, 0, 0]: is all zeros, which is no direction"),
    ({"plane.0.normal": [0, 0, 1], "plane.0.slope": "3 deg"}, '[[plane]] 1 (floor) slope = "3 deg": contradicts normal'),
    ({"plane.0.slope": "100 deg"}, '[[plane]] 1 (floor) slope = "100 deg": is out of range, allowed is from 0 deg up to 90 deg'),
    ({"plane.0.heading": "3 deg"}, '[[plane]] 1 (floor) heading = "3 deg": is of a slope'),
    ({"plane": [{"name": "a"}, {"name": "a"}]}, '[[plane]] 2 (a) name = "a": is the name of one before it'),
    ({"plane.0.tilt": 1}, "[[plane]] 1 (floor) tilt = 1: unknown key"),
    ({"container": {"width": "1 m"}}, '[container] breadth: is missing, width is given. Add for example breadth = "1 m"'),
    ({"container": {"height": "1 m"}}, '[container] height = "1 m": is of walls, and there are none'),
    ({"container": {"lid": True}}, "[container] lid = true: needs to know where the lid is"),
    ({"container": {"gravity_direction": [0, 0, 0]}}, "[container] gravity_direction = [0, 0, 0]: is all zeros"),
    (
        {"container": {"width": "9 m", "breadth": "9 m"}, "plane.0.name": "left"},
        '[[plane]] 1 (left) name = "left": is the name of a wall of the container',
    ),
    ({"terrain": {"file": "no.obj"}}, '[terrain] file = "no.obj": does not exist'),
    ({"terrain": {}}, "[terrain] file: is missing"),
    (
        {"grains": {"shape": "mesh", "density": "1 kg/m^3", "file": "no.stl"} | PLACED, "contact.pairs": []},
        '[grains] file = "no.stl": does not exist. The path is taken from the scenario\'s folder',
    ),
    # tables of others
    ({"depth": "1 m"}, 'depth = "1 m": ' + OF_EXPLICIT),
    ({"material": {"poisson_ratio": 0.3}}, "[material] = { poisson_ratio = 0.3 }: " + OF_EXPLICIT),
    ({"boundary": {}}, "[boundary] = { }: " + OF_GEM),
    ({"integration": {"safety": 0.3}}, "[integration] safety = 0.3: " + OF_EXPLICIT),
    ({"integration": {"time_step": 5}}, "[integration] time_step = 5: is a bare number"),
    ({"solver": "pgss"}, '[solver] = "pgss": must be one of pgs, energy-tracking. Did you mean "pgs"?'),
    ({"solver": "kishino"}, '[solver] = "kishino": ' + OF_GEM + 'Write method = "pgs" or "energy-tracking"'),
    ({"solver": {"quanta": 3}}, '[solver] quanta = 3: is no key of method = "pgs". Leave it out, or write method = "energy-tracking"'),
    ({"solver": {"max_overlap": 0.1}}, "[solver] max_overlap = 0.1: " + OF_GEM + "Give max_penetration in its place"),
    ({"solver": {"tolerance": "1e-5 m"}}, '[solver] tolerance = "1e-5 m": is a length, a velocity is wanted'),
    (
        {"stage.0": {"kind": "compress", "stress": "1 Pa"}},
        '[[stage]] 1 (compress) kind = "compress": ' + OF_GEM + 'Write engine = "granular-element", or one of settle, shake, run',
    ),
    ({"stage.0": {"kind": "settle", "unbalanced": 0.1}}, "[[stage]] 1 (settle) unbalanced = 0.1: " + OF_EXPLICIT),
    ({"stage.0": {"kind": "wait"}}, '[[stage]] 1 kind = "wait": must be one of settle, shake, run'),
    ({"stage": []}, 'stage = []: is empty. Add at least one stage: [[stage]] with kind = "settle"'),
    # packing and output
    ({"packing": {"method": "growth"}}, '[packing] method = "growth": ' + OF_EXPLICIT + 'Write method = "grid" or "rejection"'),
    ({"packing": {"method": "overlapping"}}, '[packing] method = "overlapping": ' + OF_GEM),
    ({"packing": {"attempts": 3}}, '[packing] attempts = 3: is no key of method = "grid". Leave it out, or write method = "rejection"'),
    ({"packing": {"method": "file"}}, '[packing] file: is missing. Add for example file = "pile.h5"'),
    ({"packing": {"method": "file", "file": "a.csv"}}, '[packing] file = "a.csv": is no result file, by its name'),
    ({"packing": {"void_ratio": 0.3}}, "[packing] void_ratio = 0.3: " + OF_EXPLICIT),
    ({"packing": {"region": REGION | {"to": ["1 m", "0 m", "1 m"]}}}, "[packing] region.to = " + '["1 m", "0 m", "1 m"]: is not above from'),
    ({"output": {"tracks": {"grains": [1]}}}, "[output] tracks.grains = [1]: names grain 1, but there are only 1 ids"),
    ({"output": {"check": "collision"}}, '[output] check = "collision": is of two bodies; here: bodies 1, planes 1'),
    ({"output": {"check": "row"}}, '[output] check = "row": is of three bodies or more, without gravity'),
    (
        {"output": {"check": "slope"}, "container": {"gravity": "0 m/s^2"}},
        '[output] check = "slope": is of one body on one plane, with gravity; here: bodies 1, planes 1, gravity 0 m/s^2',
    ),
    ({"output": {"window": {"side": 0.1}}}, "[output] window = { side = 0.1 }: " + OF_EXPLICIT),
    ({"output": {"check": "drop"}, "plane": []}, '[output] check = "drop": is of one body above one plane'),
]  # fmt: skip
# changes of the clumps poured over a box -> the only line
OF_POUR: list[tuple[dict[str, Any], str]] = [
    ({"container": ABSENT}, "[[grains]] 1 (clump) position: is missing, and there is neither container nor region"),
    ({"grains.1.name": "a", "grains.0.name": "a"}, '[[grains]] 2 (a) name = "a": is the name of one before it'),
    ({"grains.0.template": "ring"}, '[[grains]] 1 (clump) template = "ring": must be one of pair, triangle, tetrahedron, cube'),
    ({"grains.0.template": [[0, 0, 0, 1], [5, 0, 0, 1]]}, "[[grains]] 1 (clump) template = [[0, 0, 0, 1], [5, 0, 0, 1]]: is not one piece"),
    (
        {"grains.0.template": [[0, 0, 0, 1], [0.1, 0, 0, 0.2]]},
        "[[grains]] 1 (clump) template = [[0, 0, 0, 1], [0.1, 0, 0, 0.2]]: holds sphere 1 (they count from 0), which lies wholly inside",
    ),
    ({"grains.0.template": []}, "[[grains]] 1 (clump) template = []: is empty"),
    ({"grains.0.template": [[0, 0, 0]]}, "[[grains]] 1 (clump) template = [[0, 0, 0]]: is missing. Give all values"),
    ({"grains.0.template": [[0, 0, 0, 0]]}, "[[grains]] 1 (clump) template = [[0, 0, 0, 0]]: is out of range"),
    ({"grains.0.radius": {"list": ["1 cm"]}}, "[[grains]] 1 (clump) count = 20: differs from the 1 bodies of radius"),
    (
        {"grains.0.radius": {"uniform": ["1 cm", "2 cm"]}, "grains.0.scale": {"uniform": [1, 2]}},
        "[[grains]] 1 (clump) scale = { uniform = [1, 2] }: varies, and so does radius",
    ),
    ({"grains.0.radius": ABSENT}, '[[grains]] 1 (clump) radius: is missing. Add for example radius = "5 cm"'),
    ({"grains.0.size": "3 m"}, '[[grains]] 1 (clump) size = "3 m": is no key of shape = "clump"'),
    ({"stage.1.heading": "3 m"}, '[[stage]] 2 (shake) heading = "3 m": is a length, an angle is wanted'),
    ({"packing.region": REGION | {"to": ["2 m", "1 m", "1 m"]}}, "[packing] region = { from = "),
    ({"output.tracks": {"grains": [20, 21]}}, "[output] tracks.grains = [20, 21]: names grain 21, but there are only 21 ids"),
    ({"output.tracks": {"grains": [3, 3]}}, "[output] tracks.grains = [3, 3]: names grain 3 twice"),
]  # fmt: skip
# changes of the small explicit scenario -> the only line
OF_SMALL: list[tuple[dict[str, Any], str]] = [
    ({"grains.size": "1 m"}, '[grains] size = "1 m": ' + OF_IMPULSE),
    ({"grains.shape": "box"}, '[grains] shape = "box": ' + OF_IMPULSE + 'Write engine = "impulse"'),
    ({"contact.pairs": []}, "[contact] pairs = []: " + OF_IMPULSE),
    ({"container.breadth": "1 m"}, '[container] breadth = "1 m": ' + OF_IMPULSE),
    ({"packing": {"method": "grid"}}, '[packing] method = "grid": ' + OF_IMPULSE),
    ({"packing.gap": "1 m"}, '[packing] gap = "1 m": ' + OF_IMPULSE),
    ({"plane": [{}]}, "plane = [{ }]: " + OF_IMPULSE),
    ({"terrain": {}}, "[terrain] = { }: " + OF_IMPULSE),
    ({"stage.1.heading": "1 deg"}, '[[stage]] 2 (shake) heading = "1 deg": ' + OF_IMPULSE),
    ({"output": {"check": "row"}}, '[output] check = "row": ' + OF_IMPULSE),
]
OF_QUICK: list[tuple[dict[str, Any], str]] = [
    ({"solver": "pgs"}, '[solver] = "pgs": ' + OF_IMPULSE + 'Write method = "momentum" or "kishino"'),
    ({"solver": {"slop": 0.1}}, "[solver] slop = 0.1: " + OF_IMPULSE),
    ({"plane": [{}]}, "plane = [{ }]: " + OF_IMPULSE),
    ({"contact.pairs": []}, "[contact] pairs = []: " + OF_IMPULSE),
    ({"container": {"breadth": "1 m"}}, '[container] breadth = "1 m": ' + OF_IMPULSE),
    ({"grains.spin": []}, "[grains] spin = []: " + OF_IMPULSE),
    ({"output": {"check": "row"}}, '[output] check = "row": ' + OF_IMPULSE),
]
EVERY = [
    *((drop, *one) for one in OF_DROP),
    *((pour, *one) for one in OF_POUR),
    *((small, *one) for one in OF_SMALL),
    *((quick, *one) for one in OF_QUICK),
]


@pytest.mark.parametrize(
    ("text", "changes", "line"), EVERY, ids=lambda value: getattr(value, "__name__", str(value)[:60])
)
def test_mistake(text: Any, changes: dict[str, Any], line: str) -> None:
    found = lines_of(text(changes))
    assert [one[: len(line) + 8] for one in found] == [f"a.toml: {line}"]
    assert ". " in found[0][len("a.toml: ") :]  # rule and remedy


def test_all_mistakes_are_told_together() -> None:
    changes = {"grains.size": 2, "contact.restitution": 2, "plane.0.normal": [0, 0, 0], "output": {"check": "fall"}}
    assert len(lines_of(drop(changes))) == 4


def test_bodies_of_a_file_have_no_place_of_their_own() -> None:
    lines = lines_of(pour({"packing": {"method": "file", "file": "a.h5"}}))
    assert lines[0].startswith('a.toml: [[grains]] 1 (clump) position: is missing: with [packing] method = "file"')
    assert lines[1:] == [
        'a.toml: [packing] file = "a.h5": does not exist. The path is taken from the scenario\'s folder'
    ]


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("grains.3.count=2", "there is no grains 3. The scenario has 2, counted from 1"),
        ("grains.count=2", "may mean several tables. Write grains.clump.count or grains.box.count"),
        ("grains.clump=2", "names a table, but no key of it. Write for example --set grains.clump.name=first"),
        ("grains.clump.sise=2", 'unknown key. Did you mean "grains.clump.size"?'),
        ("plane.1.slope=3 deg", "there is no plane 1"),
    ],
    ids=str,
)
def test_wrong_overrides(override: str, line: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(pour(), overrides=[override])
    assert str(caught.value).startswith(f"--set {override}: {line}")


@pytest.mark.parametrize(
    "changes",
    [
        {"grains": [BOX | PLACED]},
        {"grains.size": "1 m"},
        {"plane": {"slope": "3 deg"}},
        {"plane": []},
        {"grains.orientation": "random"},
        {"grains.orientation": {"axis": [0, 1, 1], "angle": "30 deg"}},
        {"solver": "energy-tracking"},
        {"contact.pairs": [{"between": ["box", "box"], "restitution": 0}]},
        {"grains.scale": {"list": [2]}},
        {"grains.position": ABSENT, "packing": {"region": REGION}},
        {"output": {"check": "drop", "tracks": {"grains": [0]}}},
    ],
    ids=str,
)
def test_no_mistake(changes: dict[str, Any]) -> None:
    parse_scenario(drop(changes))
    assert SCHEMA.is_valid(tomllib.loads(drop(changes)))


def test_kinds_of_bodies_without_engine_are_one_mistake() -> None:
    (line,) = lines_of(pour({"engine": ABSENT}))
    assert line.startswith(
        'a.toml: engine: is missing, and [[grains]] belongs to engine = "impulse". Add engine = "impulse", or'
    )


def test_schema_takes_what_the_model_takes() -> None:
    for text in (drop(), pour(), parse_scenario(drop()).resolved_toml(), parse_scenario(pour()).resolved_toml()):
        assert SCHEMA.is_valid(tomllib.loads(text))


@pytest.mark.parametrize(
    "changes",
    [
        {"contact.damping_ratio": 0.3},
        {"contact.restitution": 2},
        {"grains.size": ["1 m", "2 m"]},
        {"grains.shape": "disc"},
        {"grains.scale": 0},
        {"engine": "explicit"},
        {"depth": "1 m"},
        {"stage.0": {"kind": "compress", "stress": "1 Pa"}},
        {"plane.0.normal": [0, 1]},
        {"solver": "momentum"},
        {"container": {"gravity_direction": "-90 deg"}},
    ],
    ids=str,
)
def test_schema_refuses_what_the_model_refuses(changes: dict[str, Any]) -> None:
    assert not SCHEMA.is_valid(tomllib.loads(drop(changes)))
    lines_of(drop(changes))
