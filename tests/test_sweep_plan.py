"""From a sweep to its members: names, hashes, what they share, and what cannot be run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from impulse_text import pour
from sweep_text import GAL_HZ, sweep_file, sweep_text

from dem_cli.errors import OverrideError, ScenarioError
from dem_cli.results.manifest import brief_names
from dem_cli.scenario import load_scenario, parse_scenario
from dem_cli.sweep.plan import Plan, make_plan, prefixes, slug

REST = {"kind": "settle", "limit": "0.1 s", "name": "rest"}


def plan_of(folder: Path, sweep: dict[str, Any], changes: dict[str, Any] | None = None) -> Plan:
    return make_plan(sweep_file(folder, sweep, changes))


def test_members_are_the_scenarios_that_dem_run_would_run(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, {"grid": GAL_HZ})
    last = plan.members[-1]
    same = load_scenario(tmp_path / "box.toml", ["stage.shake.amplitude=800 gal", "stage.shake.frequency=20 Hz"])
    assert len(plan.members) == 4
    assert last.hash == same.hash == last.load().hash
    assert last.file == f"800gal-20Hz-{same.hash[:8]}.h5"
    assert last.load().title == "small [800 gal, 20 Hz]"


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        ({"scenario": "a/discs.toml", "stage.shake.amplitude": "400 gal", "seed": 2}, "discs-400gal-seed2"),
        ({"contact.friction": 0.3, "grains.shape": "clump"}, "friction0.3-shapeclump"),
        ({"material.normal_stiffness": "1e8 N/m"}, "1e8Nperm"),
        ({"grains.radius": {"uniform": ["5 mm", "1 cm"]}}, "radiusuniform5mm1cm"),
        ({"a": "x/../y"}, "axper..pery"),
        ({"a": "?"}, "a"),
        ({"k": "v" * 100}, "k" + "v" * 59),
    ],
)
def test_names_of_files_tell_the_settings(settings: dict[str, Any], name: str) -> None:
    assert slug(settings, {"a/discs.toml": "discs"}) == name


@pytest.mark.parametrize(
    ("files", "names"),
    [
        (["thesis-discs-10hz.toml", "thesis-pairs-10hz.toml"], ["discs", "pairs"]),
        (["a/thesis-discs.toml", "b/thesis-bonded-pairs.toml"], ["discs", "bonded-pairs"]),
        (["discs.toml"], ["discs"]),
        (["thesis-discs.toml"], ["thesis-discs"]),
        (["a.toml", "a-b.toml"], ["a", "a-b"]),
        (["x-a-x.toml", "x-x.toml"], ["a-x", "x"]),
        (["a/box.toml", "b/box.toml"], ["box", "box"]),
        ([], []),
    ],
)
def test_scenario_files_are_called_by_what_tells_them_apart(files: list[str], names: list[str]) -> None:
    assert list(brief_names(files).values()) == names


def test_one_packing_serves_all_ways_of_shaking(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, {"grid": GAL_HZ, "seeds": 2})
    assert [(one.stages, one.members, one.parent, one.common) for one in plan.shared.values()] == [
        (1, 4, None, "seed1"),
        (1, 4, None, "seed2"),
    ]
    assert [one.label for one in plan.shared.values()] == [
        "packing for 4 members (seed1)", "packing for 4 members (seed2)",
    ]  # fmt: skip
    assert len({plan.start[one.hash] for one in plan.members if one.settings["seed"] == 1}) == 1
    assert all(plan.begin(one) == 1 for one in plan.members)


def test_preparations_go_on_from_each_other_where_members_part_later(tmp_path: Path) -> None:
    """Two ways of shaking, each followed by two ways of coming to rest: the packing once, each shaking once."""
    stages = [*parse_raw()["stage"], REST]
    grid = {"stage.shake.amplitude": ["400 gal", "800 gal"], "stage.rest.limit": ["0.1 s", "0.2 s"]}
    plan = plan_of(tmp_path, {"grid": grid}, {"stage": stages})
    packing, *shaken = plan.shared.values()
    assert (packing.stages, packing.members, packing.parent) == (1, 4, None)
    assert [(one.stages, one.members, one.parent) for one in shaken] == [(2, 2, packing.key)] * 2
    assert {plan.start[one.hash] for one in plan.members} == {one.key for one in shaken}


def test_stages_that_all_go_on_alike_are_one_preparation(tmp_path: Path) -> None:
    stages = [*parse_raw()["stage"], REST]
    plan = plan_of(tmp_path, {"grid": {"stage.rest.limit": ["0.1 s", "0.2 s"]}}, {"stage": stages})
    assert [(one.stages, one.members) for one in plan.shared.values()] == [(2, 2)]


def test_nothing_is_shared_where_the_packings_differ(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, {"grid": {"contact.friction": [0.1, 0.2]}})
    assert not plan.shared
    assert all(plan.begin(one) == 0 for one in plan.members)


def parse_raw() -> dict[str, Any]:
    import tomllib

    return tomllib.loads(sweep_text())


def test_what_identifies_the_first_stages(tmp_path: Path) -> None:
    """Everything but the title and the stages to come; files by their content."""
    (tmp_path / "quake.csv").write_text("t,a\n" + "".join(f"{k},{k % 3}\n" for k in range(9)))
    record = {"kind": "shake", "record": {"file": "quake.csv", "unit": "gal"}, "name": "quake"}

    def of(changes: dict[str, Any]) -> list[str]:
        stages = [*parse_raw()["stage"], record, REST]
        return list(prefixes(parse_scenario(sweep_text(None, {"stage": stages, **changes}), folder=tmp_path)))

    first = of({})
    assert len(first) == 3
    assert of({"title": "another"}) == first
    assert of({"stage.3.limit": "1 s"}) == first
    shaken = of({"stage.1.amplitude": "1 gal"})
    assert (shaken[0], shaken[1] != first[1]) == (first[0], True)
    assert of({"output.interval": "20 ms"})[0] != first[0]
    (tmp_path / "quake.csv").write_text("t,a\n" + "".join(f"{k},{k % 4}\n" for k in range(9)))
    assert [one == other for one, other in zip(of({}), first, strict=True)] == [True, True, False]


def test_another_program_prepares_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = parse_scenario(sweep_text())
    ours = list(prefixes(scenario))
    monkeypatch.setattr("dem_cli.sweep.plan.program_identity", lambda: "dem-cli 9")
    assert set(prefixes(scenario)).isdisjoint(ours)


def test_the_impulse_engine_shares_where_the_time_step_is_given() -> None:
    """Else it follows from the fastest motion of all stages, so that the packing itself is another one."""
    for step, alike in (("2 ms", True), ("auto", False)):
        first, second = (
            next(iter(prefixes(parse_scenario(pour({"integration.time_step": step, "stage.1.amplitude": gal})))))
            for gal in ("100 gal", "200 gal")
        )
        assert (first == second) == alike


def test_members_with_the_same_scenario_are_one(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, {"grid": {"stage.shake.amplitude": ["400 gal", "4 m/s^2", "800 gal"]}})
    assert (len(plan.members), plan.twins) == (2, 1)


def test_bad_combinations_are_kept_with_their_reason(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, {"grid": {"container.width": ["16 cm", "9 cm"]}})
    assert [one.settings["container.width"] for one in plan.members] == ["16 cm"]
    assert [one.name for one in plan.invalid] == ["9cm"]
    assert "is too narrow for the starting grid" in plan.invalid[0].error
    manifest = plan.manifest(tmp_path)
    assert [(one.state, one.name) for one in manifest.members] == [("waiting", "16cm"), ("failed", "9cm")]


def test_a_sweep_of_which_nothing_can_be_run_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as error:
        plan_of(tmp_path, {"grid": {"container.width": ["9 cm", "8 cm"]}})
    assert len(str(error.value).splitlines()) == 2


@pytest.mark.parametrize(
    ("sweep", "said"),
    [
        ({"grid": {"stage.shake.amplitud": ["1 gal"]}}, '[sweep] stage.shake.amplitud = "1 gal": unknown key. Did you mean "stage.shake.amp'),
        ({"grid": {"stage.name": ["x"]}}, '[sweep] stage.name = "x": may mean several stages. Write stage.1.name or stage.2.name'),
        ({"grid": {}}, "[sweep]: varies nothing. Add a grid to the table, or give --vary"),
        ({"scenarios": ["none.toml"]}, "[sweep] scenarios = [\"none.toml\"]: sweeps other files, but this one has seed,"),
    ],
)  # fmt: skip
def test_axes_that_name_no_key_are_refused(tmp_path: Path, sweep: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError) as error:
        plan_of(tmp_path, sweep)
    assert said in str(error.value)
    assert str(error.value).startswith(str(tmp_path / "box.toml"))


def test_a_key_of_the_command_line_is_named_as_it_was_given(tmp_path: Path) -> None:
    with pytest.raises(OverrideError) as error:
        make_plan(sweep_file(tmp_path), (), {"contact.frictio": (0.1,)})
    assert str(error.value) == '--vary contact.frictio = 0.1: unknown key. Did you mean "contact.friction"?'


def test_a_key_is_set_or_varied(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"^--set seed=5: the sweep varies seed\. Leave one of them out$"):
        make_plan(sweep_file(tmp_path, {"seeds": 2}), ["seed=5"])


def test_several_scenarios_with_the_same_grid(tmp_path: Path) -> None:
    sweep_file(tmp_path, {"seeds": 5}, name="one.toml")  # its own sweep is left aside
    sweep_file(tmp_path, None, {"contact.friction": 0.5}, name="two.toml")
    path = tmp_path / "both.toml"
    path.write_text('title = "both"\n[sweep]\nscenarios = ["one.toml", "two.toml"]\ngrid.seed = [1, 2]\n')
    plan = make_plan(path, ["grains.count=10"])
    assert plan.title == "both"
    assert [one.name for one in plan.members] == ["one-seed1", "one-seed2", "two-seed1", "two-seed2"]
    assert {one.load().grain_count for one in plan.members} == {10}
    path.write_text('[sweep]\nscenarios = ["one.toml", "three.toml"]\n')
    with pytest.raises(ScenarioError, match=r'\[sweep\] scenarios = "three.toml": does not exist'):
        make_plan(path)


def test_large_sweeps_want_to_be_meant(tmp_path: Path) -> None:
    path = sweep_file(tmp_path, {"seeds": 101})
    with pytest.raises(ScenarioError, match=r"the sweep has 101 members, more than 100\. Give --yes"):
        make_plan(path, most=100)
    assert len(make_plan(path, most=101).members) == 101
