"""Keys of shapes: defaults, rules and remedies, what overrides displace, room that grains need in the starting grid."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenario_text import ABSENT, small

from dem_cli.errors import ScenarioError
from dem_cli.scenario import Scenario, parse_scenario
from dem_cli.scenario.extent import largest_reach
from dem_cli.scenario.shapes import AspectRatio, Orientation, Template
from dem_cli.scenario.tables import Grains

WIDE = {"packing.grid.spacing": "4 cm", "container.width": "40 cm"}
WIDER = {"packing.grid.spacing": "6 cm", "container.width": "60 cm"}
ELLIPSE = {"grains.shape": "ellipse", "grains.aspect_ratio": 2, **WIDE}
BONDED = {"grains.shape": "bonded", **WIDE}
CLUMP = {"grains.shape": "clump", **WIDE}


def load(changes: dict[str, Any], *overrides: str) -> Scenario:
    return parse_scenario(small(changes), origin="a.toml", overrides=overrides)


def mistakes(changes: dict[str, Any], folder: Path = Path()) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(small(changes), origin="a.toml", folder=folder)
    return str(caught.value).splitlines()


def test_defaults_of_each_shape() -> None:
    disc, ellipse, bonded, clump = (load(changes) for changes in ({}, ELLIPSE, BONDED, CLUMP))
    assert disc.to_dict()["grains"].keys() == {"shape", "count", "density", "radius"}
    assert ellipse.grains.orientation == bonded.grains.orientation == clump.grains.orientation
    assert bonded.grains.orientation is not None
    assert bonded.grains.orientation.uniform == (0.0, pytest.approx(2.0 * math.pi))
    assert ellipse.grains.template is None
    assert [s.contact.ellipse_test for s in (disc, ellipse, bonded)] == [None, "exact", None]
    for s in (bonded, clump):
        assert s.grains.template is not None
        assert (s.grains.template.name, s.grains.equal_area) == ("pair", False)
        assert (s.grain_count, s.element_count) == (30, 60)
    assert clump.grains.bond is None
    bond = bonded.grains.bond
    assert bond is not None
    assert (bond.normal, bond.tangential, bond.rolling, bond.rolling_viscosity) == ("stiff", "stiff", True, None)


@pytest.mark.parametrize(
    "changes",
    [
        {**ELLIPSE, "grains.aspect_ratio": {"mix": [{"ratio": 1, "share": 0.5}, {"ratio": 2, "share": 0.5}]}},
        {**ELLIPSE, "contact.ellipse_test": "enlarged", "grains.orientation": {"uniform": ["-30 deg", "0.1 rad"]}},
        {**BONDED, "grains.template": {"discs": [{"x": 0}, {"x": 1, "y": 1.5, "r": 0.9}], "bonds": [[1, 0]]}},
        {**BONDED, "grains.bond": {"normal": "1e6 N s/m", "rolling": False}},
        {**CLUMP, **WIDER, "grains.equal_area": True, "grains.template": "chain-3"},
    ],
    ids=str,
)
def test_resolved_scenarios_come_back(changes: dict[str, Any]) -> None:
    scenario = load(changes)
    again = parse_scenario(scenario.resolved_toml())
    assert (again, again.hash) == (scenario, scenario.hash)


PAIR = [{"x": -1}, {"x": 1}]
ONE_LINE: list[tuple[dict[str, Any], list[str]]] = [
    # keys of other shapes
    ({"grains.aspect_ratio": 2}, ['[grains] aspect_ratio = 2: is no key of shape = "disc"', 'write shape = "ellipse"']),
    ({"grains.orientation": "random"}, ['is no key of shape = "disc"', '"ellipse" or "bonded" or "clump"']),
    ({"grains.template": "pair"}, ['[grains] template = "pair": is no key of shape = "disc"', '"bonded" or "clump"']),
    ({**ELLIPSE, "grains.equal_area": True}, ["[grains] equal_area = true: is no key of shape", '"bonded" or "clump"']),
    ({**CLUMP, "grains.bond": {"rolling": True}}, ["[grains] bond = ", "is no key of shape", 'write shape = "bonded"']),
    ({"contact.ellipse_test": "exact"}, ['[contact] ellipse_test = "exact": is no key of shape', 'shape = "ellipse"']),
    # ellipses
    (
        {"grains.shape": "ellipse"},
        ["[grains] aspect_ratio: is missing. Add for example aspect_ratio = 2"],
    ),
    ({**ELLIPSE, "grains.aspect_ratio": 0.5}, ["aspect_ratio = 0.5: is out of range, allowed is from 1, up to 5"]),
    ({**ELLIPSE, "grains.aspect_ratio": {"uniform": [1, 5.5]}}, ["aspect_ratio.uniform (2nd value) = 5.5: is out of"]),
    ({**ELLIPSE, "grains.aspect_ratio": {"uniform": [2, 1]}}, ["aspect_ratio.uniform", "must be ascending"]),
    ({**ELLIPSE, "grains.aspect_ratio": {"mix": []}}, ["aspect_ratio.mix = []: is empty"]),
    (
        {**ELLIPSE, "grains.aspect_ratio": {"mix": [{"ratio": 1, "share": 0.5}, {"ratio": 2, "share": 0.6}]}},
        ["aspect_ratio.mix", "has shares that add up to 1.1. Make them add up to 1"],
    ),
    ({**ELLIPSE, "grains.orientation": "30"}, ['orientation = "30": has no unit, an angle is wanted']),
    ({**ELLIPSE, "grains.orientation": {"uniform": ["30 deg", "-30 deg"]}}, ["orientation.uniform", "ascending"]),
    ({**ELLIPSE, "contact.ellipse_test": "enlargd"}, ["must be one of exact, enlarged", '"enlarged"?']),
    # templates
    ({**BONDED, "grains.template": "par"}, ['template = "par": must be one of pair, triangle,', 'mean "pair"?']),
    ({**BONDED, "grains.template": "chain-21"}, ['template = "chain-21": is a chain', "from 2 to 20"]),
    ({**BONDED, "grains.template": 3}, ["template = 3: must be text in quotes, or a table"]),
    ({**BONDED, "grains.template": {"discs": []}}, ["template.discs = []: is empty"]),
    ({**BONDED, "grains.template": {"name": "pair", "discs": PAIR}}, ["template.discs", "contradicts name"]),
    (
        {**BONDED, "grains.template": {"discs": [{"x": 0, "r": 0}]}},
        ["template.discs.r (1st value) = 0: is out of range"],
    ),
    (
        {**BONDED, "grains.template": {"discs": [*PAIR, {"x": 3.01, "y": 0.1}, {"x": 9}]}},
        ["template.discs", "is not one piece: disc 2", "does not touch disc 0"],
    ),
    (
        {**CLUMP, "grains.template": {"discs": [*PAIR, {"x": -1.2, "r": 0.7}]}},
        ["template.discs", "holds disc 2", "wholly inside the others. Leave it out"],
    ),
    (
        {**BONDED, "grains.template": {"name": "pair", "bonds": [[0, 2]]}},
        ["template.bonds (1st value)", "names disc 2"],
    ),
    ({**BONDED, "grains.template": {"name": "pair", "bonds": [[1, 1]]}}, ["joins a disc with itself"]),
    (
        {**BONDED, "grains.template": {"name": "chain-3", "bonds": [[0, 1], [0, 2]]}},
        ["template.bonds (2nd value) = [0, 2]: joins discs that do not touch"],
    ),
    ({**BONDED, "grains.template": {"name": "pair", "bonds": [[0, 1], [1, 0]]}}, ["is there twice. Leave one out"]),
    (
        {**BONDED, **WIDER, "grains.template": {"name": "chain-3", "bonds": [[0, 1]]}},
        ["template.bonds", "does not hold disc 2"],
    ),
    # bonds
    ({**BONDED, "grains.bond": {"normal": 1e6}}, ["bond.normal = 1000000.0: is a bare number, a viscosity needs"]),
    ({**BONDED, "grains.bond": {"normal": "1e6 N/m"}}, ["is a stiffness, a viscosity is wanted"]),
    ({**BONDED, "grains.bond": {"tangential": "0 N s/m"}}, ["bond.tangential", "is out of range"]),
    ({**BONDED, "grains.bond": {"tangential": "stif"}}, ['bond.tangential = "stif": is no number with a unit']),
    (
        {**BONDED, "grains.bond": {"rolling": False, "rolling_viscosity": "1 N m s"}},
        ["bond.rolling_viscosity", "contradicts rolling = false"],
    ),
    # room in the grid: a pair of 1 cm discs at any angle needs 4 cm, an ellipse of ratio 2 needs 2 sqrt(2) cm
    (
        {**BONDED, "packing.grid.spacing": "39 mm"},
        ["grid.spacing", "the largest grain, which is 0.04 m across", "bound"],
    ),
    ({**ELLIPSE, "packing.grid.spacing": "28.2 mm"}, ["grid.spacing", "which is 0.0282843 m across"]),
    (
        {**BONDED, "grains.orientation": {"uniform": ["-30 deg", "31 deg"]}, "packing.grid.row_spacing": "3 cm"},
        ["grid.row_spacing", "which is 0.0303008 m high"],
    ),
    ({**BONDED, "output.tracks": {"grains": [59, 60]}}, ["names grain 60, but there are only 60 ids", "last id is 59"]),
]


@pytest.mark.parametrize(
    ("changes", "words"), ONE_LINE, ids=lambda value: "" if isinstance(value, dict) else value[0][:50]
)
def test_mistake(changes: dict[str, Any], words: list[str]) -> None:
    (line,) = mistakes(changes)
    for word in ["a.toml: [", *words]:
        assert word in line


def test_thesis_grids_hold_their_grains() -> None:
    """8.1: ellipses of a up to sqrt(2) cm at any angle in a grid of 3 cm; 1500 pairs of discs up to 1 cm in 20 columns of 6 cm."""
    thesis = {"container.width": "121.5 cm", "grains.count": 1500}
    grid = {"columns": 40, "spacing": "3 cm", "shift": "1.5 cm"}
    assert load({**thesis, "grains.shape": "ellipse", "grains.aspect_ratio": 2, "packing.grid": dict(grid)})
    grid = {"columns": 20, "spacing": "6 cm", "shift": "1.5 cm", "row_spacing": "3 cm"}
    tilted = {"grains.orientation": {"uniform": ["-30 deg", "30 deg"]}, "grains.shape": "bonded"}
    assert load({**thesis, **tilted, "packing.grid": dict(grid)})
    assert "which is 0.04 m across" in mistakes({**thesis, "grains.shape": "bonded", "packing.grid": dict(grid)})[0]


angles = st.tuples(st.floats(-400.0, 400.0), st.floats(0.0, 400.0)).map(lambda pair: (pair[0], pair[0] + pair[1]))


@given(angles, st.sampled_from(["bonded", "clump"]), st.booleans())
def test_reach_of_templates_is_that_of_their_discs(turns: tuple[float, float], shape: str, equal: bool) -> None:
    """Against all orientations tried: the largest distance from the centre of mass that any disc reaches along an axis."""
    template = {"discs": [{"x": 3}, {"x": 4.2, "y": 0.8, "r": 0.7}, {"x": 3.1, "y": -1.4, "r": 0.5}]}
    raw = {"shape": shape, "radius": "1 m", "density": "1 kg/m^3", "template": template, "equal_area": equal}
    grains = Grains.model_validate({**raw, "orientation": {"uniform": [f"{t!r} deg" for t in turns]}})
    assert grains.template is not None
    x, y, r = (grains.scale * values for values in grains.template.centred())
    angle = np.radians(np.linspace(*turns, 4001))[:, None]
    across = np.abs(x * np.cos(angle) - y * np.sin(angle)) + r
    high = np.abs(x * np.sin(angle) + y * np.cos(angle)) + r
    steps = np.radians(turns[1] - turns[0]) / 4000  # the discs' centres go by arcs of this angle between two tries
    room = 2.0 * steps**2 + 1e-12
    found = largest_reach(grains)
    for reach, tried in zip(found, (across.max(), high.max()), strict=True):
        assert tried - 1e-12 <= reach <= tried + room


@given(angles, st.tuples(st.floats(1.0, 5.0), st.floats(1.0, 5.0)).map(sorted))
def test_reach_of_ellipses_is_that_of_their_outlines(turns: tuple[float, float], ratios: list[float]) -> None:
    raw = {"shape": "ellipse", "radius": "1 m", "density": "1 kg/m^3", "aspect_ratio": {"uniform": ratios}}
    grains = Grains.model_validate({**raw, "orientation": {"uniform": [f"{t!r} deg" for t in turns]}})
    angle = np.radians(np.linspace(*turns, 4001))[:, None]
    k = np.linspace(*ratios, 51)
    across = np.sqrt(k * np.cos(angle) ** 2 + np.sin(angle) ** 2 / k).max()
    high = np.sqrt(k * np.sin(angle) ** 2 + np.cos(angle) ** 2 / k).max()
    room = 5.0 * (np.radians(turns[1] - turns[0]) / 4000) ** 2 + 1e-12
    for reach, tried in zip(largest_reach(grains), (across, high), strict=True):
        assert tried - 1e-12 <= reach <= tried + room


@pytest.mark.parametrize(
    ("name", "discs", "bonds"), [("pair", 2, 1), ("triangle", 3, 3), ("square", 4, 4), ("chain-20", 20, 19)]
)
def test_templates_that_come_along(name: str, discs: int, bonds: int) -> None:
    """Equal touching discs around (0, 0): their areas add up."""
    template = Template.model_validate(name)
    x, y, r = template.outline()
    assert (len(r), len(template.bonded())) == (discs, bonds)
    assert template.area == pytest.approx(discs * math.pi, rel=1e-14)
    assert (x.mean(), y.mean()) == pytest.approx((0.0, 0.0), abs=1e-15)
    i, j = np.array(template.bonded()).T
    assert np.allclose(np.hypot(x[i] - x[j], y[i] - y[j]), 2.0, rtol=1e-15)


def test_equal_area_scales_the_outline() -> None:
    raw = {"shape": "clump", "density": "1 kg/m^3", "template": {"discs": [{"x": 0}, {"x": 1}]}}
    plain, equal = (Grains.model_validate({**raw, "equal_area": value}) for value in (False, True))
    assert plain.scale == 1.0
    lens = 2.0 * math.pi / 3.0 - math.sqrt(3.0) / 2.0
    assert equal.scale == pytest.approx(math.sqrt(math.pi / (2.0 * math.pi - lens)), rel=1e-14)


def test_nothing_is_drawn_for_what_is_fixed() -> None:
    rng = np.random.default_rng(1)
    assert AspectRatio.model_validate(2).draw(rng, 3).tolist() == [2.0] * 3
    assert Orientation.model_validate("90 deg").draw(rng, 2).tolist() == [math.pi / 2] * 2
    assert rng.random() == np.random.default_rng(1).random()


def test_a_shape_displaces_the_keys_of_others() -> None:
    """So a sweep over shapes starts from any of them."""
    ellipse = {**ELLIPSE, "contact.ellipse_test": "enlarged", "grains.orientation": "30 deg"}
    assert load(ellipse, "grains.shape=disc") == load(WIDE)
    bonded = {**BONDED, "grains.bond": {"rolling": False}, "grains.template": "pair", "grains.orientation": "0 deg"}
    clump = load(bonded, "grains.shape=clump").grains
    assert (clump.bond, clump.orientation) == (None, Orientation.model_validate("0 deg"))
    assert load(bonded, "grains.shape=ellipse", "grains.aspect_ratio=3").grains.template is None
    assert load({**BONDED, **WIDER}, "grains.template=triangle").element_count == 90
    assert load(BONDED, "grains.bond.normal=1e6 N s/m").grains.bond.normal == 1e6  # type: ignore[union-attr]


FROM_FILE: dict[str, Any] = {
    "grains.count": ABSENT,
    "grains.radius": ABSENT,
    "packing": {"method": "file", "file": "grains.csv", "file_unit": "cm"},
}


@pytest.mark.parametrize(
    ("text", "changes", "words"),
    [
        ("x,y,r,aspect\n1,2,1,6\n", {"grains.shape": "ellipse"}, ["[packing] file", "line 2", "not from 1 to 5"]),
        ("x,y,r,aspect\n1,2,1,0.5\n", {"grains.shape": "ellipse"}, ["line 2", "not from 1 to 5"]),
        ("x,y,r,aspect\n1,2,1,2\n", {}, ["[packing] file", "has a column aspect", 'shape = "ellipse"']),
        ("x,y,r\n1,2,1\n", {"grains.shape": "ellipse"}, ["[grains] aspect_ratio: is missing", "column aspect to"]),
        (
            "x,y,r,aspect\n1,2,1,2\n",
            {"grains.shape": "ellipse", "grains.aspect_ratio": 2},
            ["[grains] aspect_ratio = 2: contradicts the column aspect"],
        ),
        ("x,y,r,x\n1,2,1,2\n", {}, ["[packing] file", "line 1", "each once"]),
        ("x,y,r,tilt\n1,2,1,2\n", {}, ["[packing] file", "line 1", "angle, aspect and spin may follow"]),
        (
            "x,y,r\n1,2,1\n",
            {"grains.shape": "bonded", "output.tracks": {"grains": [1, 2]}},
            ["[output] tracks.grains", "names grain 2, but there are only 2 ids"],
        ),
    ],
)
def test_mistakes_with_files(tmp_path: Path, text: str, changes: dict[str, Any], words: list[str]) -> None:
    (tmp_path / "grains.csv").write_text(text)
    (line,) = mistakes({**FROM_FILE, **changes}, tmp_path)
    for word in words:
        assert word in line
