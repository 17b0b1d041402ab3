"""The table [sweep] and --vary: what they say, which members come of it, and what is a mistake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from sweep_text import sweep_file, sweep_text

from dem_cli.errors import ScenarioError
from dem_cli.scenario import load_scenario, parse_scenario
from dem_cli.scenario.sweep import Sweep, overrides_of, varied


def sweep(**table: Any) -> Sweep:
    return Sweep.model_validate(table)


def test_a_grid_combines_all_with_all_and_the_last_key_varies_fastest() -> None:
    members = list(sweep(grid={"a.b": [1, 2], "c": ["x", "y", "z"]}).members())
    assert [(one["a.b"], one["c"]) for one in members] == [(1, "x"), (1, "y"), (1, "z"), (2, "x"), (2, "y"), (2, "z")]


def test_a_zip_goes_row_by_row_within_each_point_of_the_grid() -> None:
    found = sweep(grid={"g": [1, 2]}, zip={"a": [10, 20, 30], "b": ["x", "y", "z"]}, seeds=[7, 9])
    members = list(found.members())
    assert found.count == len(members) == 12
    assert members[:3] == [
        {"g": 1, "a": 10, "b": "x", "seed": 7},
        {"g": 1, "a": 10, "b": "x", "seed": 9},
        {"g": 1, "a": 20, "b": "y", "seed": 7},
    ]


def test_scenarios_are_the_first_axis() -> None:
    found = sweep(scenarios=["discs.toml", "pairs.toml"], grid={"g": [1, 2]})
    assert [(one["scenario"], one["g"]) for one in found.members()] == [
        ("discs.toml", 1), ("discs.toml", 2), ("pairs.toml", 1), ("pairs.toml", 2),
    ]  # fmt: skip
    assert [kind for kind, _ in found.axes] == ["scenario", "grid"]


def test_a_number_of_seeds_stands_for_that_many() -> None:
    assert sweep(seeds=4).seeds == (1, 2, 3, 4)


def test_keys_without_quotes_are_tables_in_tables() -> None:
    assert sweep(grid={"stage": {"shake": {"amplitude": ["1 gal"]}}}).grid == {"stage.shake.amplitude": ("1 gal",)}


@pytest.mark.parametrize(
    ("given", "values"),
    [
        ({"from": "1 Hz", "to": "3 Hz", "count": 3}, ("1 Hz", "2 Hz", "3 Hz")),
        ({"from": "2 Hz", "to": "1 Hz", "count": 3}, ("2 Hz", "1.5 Hz", "1 Hz")),
        ({"from": "0.1 s", "to": "0.5 s", "step": "0.2 s"}, ("0.1 s", "0.3 s", "0.5 s")),
        ({"from": "0.1 s", "to": "0.6 s", "step": "0.2 s"}, ("0.1 s", "0.3 s", "0.5 s")),
        ({"from": "1 Hz", "to": "100 Hz", "count": 3, "spacing": "log"}, ("1 Hz", "10 Hz", "100 Hz")),
        ({"from": 0.1, "to": 0.3, "step": 0.1}, (0.1, 0.2, 0.3)),
        ({"from": 100, "to": 300, "count": 3}, (100, 200, 300)),
        ({"from": 1, "to": 2, "count": 3}, (1.0, 1.5, 2.0)),
        ({"from": "-30 deg", "to": "30 deg", "count": 2}, ("-30 deg", "30 deg")),
    ],
)
def test_ranges_stand_for_their_values(given: dict[str, Any], values: tuple[Any, ...]) -> None:
    found = sweep(grid={"key": given}).grid["key"]
    assert found == values
    assert [type(one) for one in found] == [type(one) for one in values]


MISTAKES: list[tuple[dict[str, Any], str]] = [
    ({"grid": {"a": []}}, '[sweep] grid = { a = [] }: is empty at a. Give at least one value'),
    ({"grid": {"a": 3}}, "[sweep] grid = { a = 3 }: must hold lists of values, a has none. Write for example \"a\" = [3]"),
    ({"grid": 3}, "[sweep] grid = 3: must be a table."),
    ({"grids": {"a": [1]}}, '[sweep] grids = { a = [1] }: unknown key. Did you mean "grid"?'),
    ({"seeds": 0}, "[sweep] seeds = 0: must be seeds, or how many."),
    ({"seeds": []}, "[sweep] seeds = []: must be seeds, or how many."),
    ({"seeds": [1.5]}, "[sweep] seeds = [1.5]: must be seeds, or how many."),
    ({"zip": {"a": [1], "b": [1, 2]}}, "has lists of different lengths: 1 of a, 2 of b. Give each key as many values"),
    ({"grid": {"a": [1]}, "zip": {"a": [1]}}, "[sweep] zip.a = [1]: stands in the grid, too. Leave one of them out"),
    ({"grid": {"seed": [1]}, "seeds": 2}, "[sweep] seeds = 2: contradicts seed, which is varied already."),
    ({"grid": {"a": {"from": "1 Hz", "to": "2 s", "count": 2}}}, "has two units at a, Hz and s."),
    ({"grid": {"a": {"from": "1 Hz", "to": "2 Hz"}}}, "has no range at a. Write { from ="),
    ({"grid": {"a": {"from": 1, "to": 2, "count": 2, "step": 1}}}, "has no range at a."),
    ({"grid": {"a": {"from": 1, "to": 2, "step": -1}}}, "has no step from one end to the other at a."),
    ({"grid": {"a": {"from": 1, "to": 2, "step": 0}}}, "has no step from one end to the other at a."),
    ({"grid": {"a": {"from": 1, "to": 2, "count": 1}}}, "has no number of values at a."),
    ({"grid": {"a": {"from": 0, "to": 2, "count": 3, "spacing": "log"}}}, "has no ratio at a."),
    ({"grid": {"a": {"from": 1, "to": 2, "count": 3, "spacing": "wide"}}}, "has an unknown spacing at a."),
    ({"grid": {"a": {"from": "one", "to": 2, "count": 3}}}, "has an end that is no number at a."),
]  # fmt: skip


@pytest.mark.parametrize(("table", "said"), MISTAKES)
def test_mistakes_are_lines_that_name_the_key(tmp_path: Path, table: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError) as error:
        load_scenario(sweep_file(tmp_path, table))
    assert str(error.value).startswith(f"{tmp_path / 'box.toml'}: [sweep]")
    assert said in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_sweep_is_no_part_of_the_run(tmp_path: Path) -> None:
    """dem run of a scenario with a sweep runs the scenario as it stands: the same hash."""
    with_sweep = load_scenario(sweep_file(tmp_path, {"seeds": 3}))
    assert with_sweep.sweep == sweep(seeds=3)
    assert with_sweep.hash == parse_scenario(sweep_text()).hash
    assert "sweep" not in with_sweep.resolved_toml()


def test_a_file_that_sweeps_others_cannot_be_run(tmp_path: Path) -> None:
    path = tmp_path / "all.toml"
    path.write_text('title = "all"\n[sweep]\nscenarios = ["box.toml"]\n')
    with pytest.raises(ScenarioError, match=r"sweeps other files.*Run it with dem sweep"):
        load_scenario(path)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a.b=400 gal,800 gal", {"a.b": ("400 gal", "800 gal")}),
        ("a = 1, 2.5 ,true", {"a": (1, 2.5, True)}),
        ("seed=3..6", {"seed": (3, 4, 5, 6)}),
        ('a=["1 cm", "2 cm"],["3 cm", "4 cm"]', {"a": (["1 cm", "2 cm"], ["3 cm", "4 cm"])}),
        ('a={ uniform = ["1 cm", "2 cm"] },7 mm', {"a": ({"uniform": ["1 cm", "2 cm"]}, "7 mm")}),
        ('a="x, y",z', {"a": ("x, y", "z")}),
    ],
)
def test_vary_splits_at_commas_outside_of_quotes_and_brackets(text: str, found: dict[str, Any]) -> None:
    assert varied(text) == found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a", "is not KEY=VALUE"),
        ("=1", "is not KEY=VALUE"),
        ("a=", "has no value"),
        ("a=1,,2", "has no value"),
        ("a=5..3", "is no range"),
    ],
)
def test_vary_refuses(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        varied(text)


def test_varied_keys_take_the_place_of_those_in_the_table() -> None:
    found = sweep(grid={"a": [1, 2], "b": [3]}, zip={"c": [1], "d": [2]}, seeds=3).with_varied(
        {"a": (9,), "c": (8, 9), "seed": (5,)}
    )
    assert found.grid == {"a": (9,), "b": (3,), "c": (8, 9), "seed": (5,)}
    assert found.zip == {"d": (2,)}
    assert found.seeds == ()


def test_settings_are_overrides_as_on_the_command_line() -> None:
    settings = {"scenario": "x.toml", "a": "400 gal", "b": 3, "c": ["1 cm", "2 cm"], "d": {"uniform": ["1 cm", "2 cm"]}}
    assert overrides_of(settings) == [
        'a="400 gal"', "b=3", 'c=["1 cm", "2 cm"]', 'd={ uniform = ["1 cm", "2 cm"] }',
    ]  # fmt: skip
