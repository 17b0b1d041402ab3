"""Every mistake is reported, all of them together, each in one line: file, table, key, value, rule, remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from scenario_text import ABSENT, small

from dem_cli.errors import ScenarioError
from dem_cli.scenario import load_scenario, parse_scenario


def mistakes(text: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text, origin="a.toml")
    assert caught.value.exit_code == 2
    return str(caught.value).splitlines()


def test_small_scenario_has_none() -> None:
    assert parse_scenario(small()).title == "small"


NORMAL = {"mean": "7 mm", "sd": "1 mm", "min": "5 mm", "max": "9 mm"}
GRADING = {"sieve": ["2 mm", "5 mm", "10 mm"], "passing": [0, 30, 100]}
ONE_LINE: list[tuple[dict[str, Any], list[str]]] = [
    # unknown keys
    ({"contact.frction": 0.5}, ["a.toml: [contact] frction = 0.5: unknown key. ", '"friction"?']),
    ({"titel": "x"}, ['a.toml: titel = "x": unknown key. Did you mean "title"?']),
    ({"stage.1.amplitud": "1 gal"}, ['[[stage]] 2 (shake) amplitud = "1 gal": unknown key. Did you mean "amplitude"?']),
    ({"grains.radius": {"unifrom": ["1 mm", "2 mm"], "fixed": "1 mm"}}, ["[grains] radius.unifrom = ", '"uniform"?']),
    ({"zzz": 1}, ["zzz = 1: unknown key. Known here: title, "]),
    # missing ones
    ({"grains.density": ABSENT}, ['[grains] density: is missing. Add for example density = "2480 kg/m^3"']),
    ({"contact": ABSENT}, ["a.toml: [contact]: is missing. Add the table [contact]"]),
    (
        {"contact.damping_ratio": ABSENT},
        ["[contact] damping_ratio: is missing. Give one of: damping_ratio or restitution"],
    ),
    (
        {"material.poisson_ratio": ABSENT},
        ["[material] poisson_ratio: is missing. Give all of: s_wave_velocity, poisson_ratio"],
    ),
    ({"grains.count": ABSENT}, ["[grains] count: is missing. Add for example count = 3000"]),
    ({"grains.radius": ABSENT}, ["[grains] radius: is missing. Add for example radius = "]),
    ({"packing": {"method": "file"}}, ['[packing] file: is missing. Add for example file = "grains.csv"']),
    ({"stage": ABSENT}, ["a.toml: stage: is missing. Add [[stage]]"]),
    ({"stage": []}, ["stage = []: is empty. Add at least one stage"]),
    ({"stage.0.kind": ABSENT}, ["[[stage]] 1 kind: is missing. Write kind = one of settle, shake, run"]),
    ({"stage.1.duration": ABSENT}, ["[[stage]] 2 (shake) duration: is missing. Give one of: duration or cycles"]),
    # units and types
    (
        {"stage.1.amplitude": 400},
        ["[[stage]] 2 (shake) amplitude = 400: is a bare number, an acceleration", 'Write "400 gal"'],
    ),
    ({"container.width": "400 gal"}, ['[container] width = "400 gal": is an acceleration, a length is wanted']),
    ({"container.width": ["1 m"]}, ['[container] width = ["1 m"]: must be a length in quotes']),
    ({"seed": 1.5}, ["a.toml: seed = 1.5: must be a whole number"]),
    ({"seed": True}, ["a.toml: seed = true: must be a whole number"]),
    ({"grains.count": "30"}, ['[grains] count = "30": must be a whole number. Write 30 without quotes']),
    ({"contact.friction": "0.17"}, ['[contact] friction = "0.17": must be a plain number. Write 0.17 without quotes']),
    ({"contact.friction": True}, ["[contact] friction = true: must be a plain number"]),
    ({"contact.friction": float("inf")}, ["[contact] friction = inf: must be a finite number"]),
    ({"container.lid": "yes"}, ['[container] lid = "yes": must be true or false']),
    ({"title": 5}, ["a.toml: title = 5: must be text in quotes"]),
    ({"contact": 5}, ["[contact] = 5: must be a table. Its keys are friction, "]),
    ({"stage": {"kind": "settle"}}, ["stage = ", "must be a list of tables. Head each stage with [[stage]]"]),
    ({"stage.0": "settle"}, ['[[stage]] 1 = "settle": must be a table']),
    # choices
    (
        {"engine": "explict"},
        ['engine = "explict": must be one of explicit, granular-element, impulse. Did you mean "explicit"?'],
    ),
    ({"contact.tension": "dampng"}, ['[contact] tension = "dampng": must be one of none, damping.', '"damping"?']),
    ({"stage.0.kind": "setle"}, ['[[stage]] 1 kind = "setle": must be one of settle, shake, run.', '"settle"?']),
    # ranges
    (
        {"material.poisson_ratio": 0.5},
        ["[material] poisson_ratio = 0.5: is out of range, allowed is from 0, below 0.5"],
    ),
    ({"material.poisson_ratio": -0.1}, ["[material] poisson_ratio = -0.1: is out of range"]),
    ({"contact.friction": -0.1}, ["[contact] friction = -0.1: is out of range, allowed is from 0"]),
    ({"contact.wall_friction": -0.1}, ["[contact] wall_friction = -0.1: is out of range"]),
    ({"contact.damping_ratio": -1}, ["[contact] damping_ratio = -1: is out of range"]),
    ({"container.width": "0 m"}, ['[container] width = "0 m": is out of range, allowed is above 0 m']),
    ({"container.gravity": "-9.8 m/s^2"}, ["[container] gravity = ", "out of range"]),
    ({"seed": -1}, ["seed = -1: is out of range"]),
    ({"grains.count": 0}, ["[grains] count = 0: is out of range"]),
    ({"integration.safety": 1.1}, ["[integration] safety = 1.1: is out of range, allowed is above 0, up to 1"]),
    (
        {"integration.time_step": 1e-6},
        ['[integration] time_step = 1e-06: is a bare number, a time needs its unit. Write "1e-06 s"'],
    ),
    ({"integration.time_step": "autom"}, ['[integration] time_step = "autom": is no number']),
    ({"output.window": {"bottom": 0.6, "top": 0.4}}, ["[output] window.top = 0.4: leaves nothing of the depth"]),
    # contradictions
    ({"contact.restitution": 0.5}, ["[contact] restitution = 0.5: contradicts damping_ratio. Give only one of"]),
    (
        {"stage.1.cycles": 5},
        ["[[stage]] 2 (shake) cycles = 5: contradicts duration. Give only one of: duration or cycles"],
    ),
    (
        {"stage.1.ramp": "2.1 s"},
        ['[[stage]] 2 (shake) ramp = "2.1 s": is longer than half of the stage, which takes 2 s'],
    ),
    ({"material.normal_stiffness": "1 N/m"}, ["[material] normal_stiffness", "contradicts s_wave_velocity"]),
    ({"packing.file": "a.csv"}, ["[packing] file", "contradicts grid"]),
    (
        {"packing.method": "growth"},
        [
            '[packing] grid = { columns = 8, spacing = "3 cm" }: is no key of method = "growth". ',
            'Leave it out, or write method = "falling" or "local-move"',
        ],
    ),
    (
        {"packing": {"method": "growth", "attempts": 5}},
        [
            '[packing] attempts = 5: is no key of method = "growth". Leave it out, or write method = "falling" or "rejection"'
        ],
    ),
    (
        {"packing": {"method": "insertion", "sweeps": 5}},
        ['[packing] sweeps = 5: is no key of method = "insertion". Leave it out, or write method = "local-move"'],
    ),
    (
        {"packing": {"method": "rejection", "void_ratio": 1.5, "height": "30 cm"}},
        ['[packing] height = "30 cm": contradicts void_ratio. Give only one of: void_ratio or height'],
    ),
    (
        {"packing.void_ratio": 0.25},
        ["[packing] void_ratio = 0.25: contradicts grid, which says where the grains start"],
    ),
    ({"packing": {"method": "growth", "void_ratio": 0}}, ["[packing] void_ratio = 0: is out of range"]),
    ({"packing": {"method": "grwth"}}, ['[packing] method = "grwth": must be one of falling, ', '"growth"?']),
    (
        {"packing": {"method": "growth"}, "container.width": "19 mm"},
        ['[container] width = "19 mm": is narrower than the largest grain, which is up to 0.02 m across. Widen it'],
    ),
    (
        {"packing": {"method": "growth", "height": "1 m"}, "container.height": "50 cm", "container.lid": True},
        ['[packing] height = "1 m": is above the lid, which is at 0.5 m'],
    ),
    (
        {"grains.radius": {"fixed": "7 mm", "uniform": ["5 mm", "7 mm"]}},
        ["[grains] radius.uniform", "contradicts fixed"],
    ),
    ({"container.lid": True}, ["[container] lid = true: needs to know where the lid is. Add for example height"]),
    (
        {"container.width": "25 cm"},
        ['[container] width = "25 cm": is too narrow for the starting grid', "0.255 m", "at most 7 columns"],
    ),
    ({"packing.grid.spacing": "19 mm"}, ["[packing] grid.spacing", "smaller than the largest grain, which is 0.02 m"]),
    ({"packing.grid.row_spacing": "19 mm"}, ["[packing] grid.row_spacing", "smaller than the largest grain"]),
    (
        {"container.height": "11 cm", "container.lid": True},
        ['[container] height = "11 cm": is below the starting grid', "0.12 m"],
    ),
    ({"output.tracks": {"grains": [29, 30]}}, ["[output] tracks.grains = [29, 30]: names grain 30", "last id is 29"]),
    ({"output.tracks": {"grains": []}}, ["[output] tracks.grains = []: is empty"]),
    ({"output.tracks": {"grains": [1, 1]}}, ["[output] tracks.grains = [1, 1]: names grain 1 twice"]),
    # sizes
    ({"grains.radius": 7}, ['[grains] radius = 7: is a bare number, a length needs its unit. Write "7 mm"']),
    (
        {"grains.radius": {}},
        ["[grains] radius.fixed: is missing. Give one of: fixed or uniform or normal or list or grading"],
    ),
    ({"grains.radius": {"uniform": ["9 mm", "5 mm"]}}, ["[grains] radius.uniform", "must be ascending"]),
    ({"grains.radius": {"uniform": ["9 mm"]}}, ["[grains] radius.uniform (2nd value): is missing"]),
    (
        {"grains.radius": {"uniform": ["1 mm", "2 mm", "3 mm"]}},
        ["[grains] radius.uniform", "too many values, 2 are wanted"],
    ),
    ({"grains.radius": {"uniform": ["1 mm", 2]}}, ["[grains] radius.uniform (2nd value) = 2: is a bare number"]),
    ({"grains.radius": {"normal": {**NORMAL, "sd": "0 mm"}}}, ['[grains] radius.normal.sd = "0 mm": is out of range']),
    (
        {"grains.radius": {"normal": {**NORMAL, "min": "9 mm"}}},
        ["[grains] radius.normal.min", "must be smaller than max"],
    ),
    (
        {"grains.radius": {"normal": {**NORMAL, "mean": "20 mm"}}},
        ["[grains] radius.normal.min", "of the normal distribution"],
    ),
    ({"grains.radius": {"list": ["7 mm"] * 4}}, ["[grains] count = 30: differs from the 4 radii of the list"]),
    (
        {"grains.radius": {"grading": {**GRADING, "sieve": ["2 mm", "2 mm", "3 mm"]}}},
        ["radius.grading.sieve", "ascending"],
    ),
    (
        {"grains.radius": {"grading": {**GRADING, "passing": [0, 110, 100]}}},
        ["passing (2nd value) = 110: is out of range"],
    ),
    ({"grains.radius": {"grading": {**GRADING, "passing": [0, 50, 40]}}}, ["radius.grading.passing", "ascending"]),
    ({"grains.radius": {"grading": {**GRADING, "passing": [5, 50, 100]}}}, ["radius.grading.passing", "begin with 0"]),
    (
        {"grains.radius": {"grading": {**GRADING, "passing": [0, 100]}}},
        ["radius.grading.passing", "has 2 values for 3 sieves"],
    ),
    ({"grains.radius": {"grading": {"sieve": ["2 mm"], "passing": [0]}}}, ["radius.grading.sieve", "at least two"]),
    # files
    (
        {"packing": {"method": "falling", "file": "none.csv"}, "grains.radius": ABSENT, "grains.count": ABSENT},
        ['[packing] file = "none.csv": does not exist'],
    ),
]


@pytest.mark.parametrize(
    ("changes", "words"), ONE_LINE, ids=lambda value: str(value)[:60] if isinstance(value, dict) else ""
)
def test_mistake(changes: dict[str, Any], words: list[str]) -> None:
    lines = mistakes(small(changes))
    first = lines[0] if "sieve': ['2 mm']" not in str(changes) else next(k for k in lines if "sieve" in k)
    assert first.startswith("a.toml: ")
    for word in words:
        assert word in first
    # one slip, one line; a lone sieve cannot have both 0 and 100 percent
    assert len(lines) == (2 if "sieve': ['2 mm']" in str(changes) else 1), lines


def test_all_mistakes_come_together() -> None:
    """Also rules between keys of tables that hold other mistakes, and rules between tables."""
    changes = {
        "titel": "x",
        "grains.radius": {"normal": {**NORMAL, "sd": 1, "min": "9 mm"}},
        "contact.frction": 1,
        "contact.friction": ABSENT,
        "contact.restitution": 2,
        "container.width": "25 cm",
        "container.hight": "1 m",
        "stage.0.kind": "setle",
        "stage.1.cycles": 5,
        "output.tracks": {"grains": [30], "intervall": "1 s"},
    }
    lines = mistakes(small(changes))
    for part in (
        "titel = ",
        "[grains] radius.normal.sd = 1: is a bare number",
        '[grains] radius.normal.min = "9 mm": must be smaller',
        '[contact] frction = 1: unknown key. Did you mean "friction"?',
        "[contact] restitution = 2: is out of range",
        "[contact] restitution = 2: contradicts",
        '[container] width = "25 cm": is too narrow',
        "[container] hight",
        "[[stage]] 1 kind",
        "[[stage]] 2 (shake) cycles",
        "[output] tracks.intervall",
    ):
        assert sum(part in line for line in lines) == 1, (part, lines)
    assert len(lines) == 11
    # in the order of the file
    tables = [line.split("[")[1].split("]")[0] for line in lines if ": [" in line and "[[" not in line]
    assert tables == sorted(tables, key=["grains", "contact", "container", "output"].index)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[container]\nwidth = 121.5 cm\n", ["a.toml: line 2: width = 121.5 cm", 'quotes: width = "121.5 cm"']),
        ("a = 1\nb = 400 gal # strong\n", ["line 2", 'b = "400 gal"']),
        ('title = "x\n', ["line 1", "Close the quotes"]),
        ("a = 1\na = 2\n", ["line 2", "Give each key and table once"]),
        ("a =\n", ["line 1", "Write a value"]),
        ("[grains\n", ["line 1"]),
        ("x = { a = 1\n", ["line 1"]),
        ("= 5", ["line 1"]),
    ],
)
def test_syntax(text: str, words: list[str]) -> None:
    lines = mistakes(text)
    assert len(lines) == 1
    for word in words:
        assert word in lines[0]


@pytest.mark.parametrize(
    ("name", "words"), [("none.toml", "does not exist"), ("", "is a folder"), ("latin.toml", "UTF-8")]
)
def test_files_that_cannot_be_read(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "latin.toml").write_bytes('title = "größe"'.encode("latin-1"))
    with pytest.raises(ScenarioError, match=words) as caught:
        load_scenario(tmp_path / name)
    assert len(str(caught.value).splitlines()) == 1


def test_byte_order_mark_is_no_mistake(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(small(), encoding="utf-8-sig")
    assert load_scenario(tmp_path / "a.toml").title == "small"


def test_long_values_are_cut() -> None:
    (line,) = mistakes(small({"title": list(range(1000))}))
    assert len(line) < 160
