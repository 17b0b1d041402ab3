"""Keys of [packing]: defaults by method, what an override displaces, and what `dem check` and `dem run` say about packings."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from scenario_text import small

from dem_cli.cli import main
from dem_cli.cli.progress import PACKING_EVERY, Progress
from dem_cli.scenario import Scenario, load_scenario, parse_scenario

METHODS = ("falling", "rejection", "local-move", "growth", "insertion")


def packed(method: str, **keys: object) -> Scenario:
    return parse_scenario(small({"packing": {"method": method, **keys}}))


def test_defaults() -> None:
    told = {method: packed(method).packing for method in METHODS}
    assert {m: p.attempts for m, p in told.items() if p.attempts} == dict.fromkeys(
        ("falling", "rejection", "insertion"), 1000
    )
    assert {m: p.sweeps for m, p in told.items() if p.sweeps} == {"local-move": 3000}
    heights = {m: p.region_height(0.3, 0.06) for m, p in told.items()}
    assert heights == pytest.approx(
        {"falling": 0.6, "rejection": 0.44, "local-move": 0.2, "growth": 0.2, "insertion": 0.25}
    )
    assert packed("growth", void_ratio=0.3).packing.region_height(0.3, 0.06) == pytest.approx(0.26)
    assert packed("growth", height="7 cm").packing.region_height(0.3, 0.06) == 0.07
    assert all(p.random for p in told.values())
    assert not parse_scenario(small()).packing.random


@pytest.mark.parametrize("method", METHODS)
def test_resolved_form_loads_back(method: str) -> None:
    scenario = packed(method)
    again = parse_scenario(scenario.resolved_toml())
    assert again == scenario
    assert again.hash == scenario.hash


@pytest.mark.parametrize(
    ("before", "override", "left"),
    [
        (
            {"method": "falling", "grid": {"columns": 8, "spacing": "3 cm"}},
            "packing.method=growth",
            {"method", "file_unit"},
        ),
        (
            {"method": "local-move", "grid": {"columns": 8, "spacing": "3 cm"}},
            "packing.method=falling",
            {"method", "file_unit", "grid"},
        ),
        ({"method": "growth", "height": "9 cm"}, "packing.void_ratio=0.3", {"method", "file_unit", "void_ratio"}),
        ({"method": "growth", "void_ratio": 0.3}, "packing.height=9 cm", {"method", "file_unit", "height"}),
        ({"method": "rejection", "attempts": 9}, "packing.method=local-move", {"method", "file_unit", "sweeps"}),
    ],
)
def test_overrides_displace_what_has_no_meaning_any_more(
    before: dict[str, object], override: str, left: set[str]
) -> None:
    scenario = parse_scenario(small({"packing": before}), overrides=[override])
    assert set(scenario.to_dict()["packing"]) == left


def test_check_says_what_is_filled_and_packs_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    for keys, said in (
        ({"method": "growth"}, "packing           growth: as dense as it gets, takes about 1 s"),
        ({"method": "rejection"}, "packing           rejection: void ratio 1.2 over a height of "),
        ({"method": "insertion", "height": "10 cm"}, "over a height of 100 mm"),
    ):
        path.write_text(small({"packing": keys}), encoding="utf-8")
        done = CliRunner().invoke(main, ["check", str(path)])
        assert done.exit_code == 0, done.output
        assert said in done.output
    path.write_text(small(), encoding="utf-8")
    assert "\npacking " not in CliRunner().invoke(main, ["check", str(path)]).output


def test_run_shows_packings_that_take_their_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.toml").write_text(small({"packing": {"method": "growth"}}), encoding="utf-8")
    now = 100.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    with Progress(load_scenario(tmp_path / "a.toml")) as progress:
        progress.packing("growth: first")
        now += 0.9 * PACKING_EVERY
        progress.packing("growth: early")
        now += 0.2 * PACKING_EVERY
        progress.packing("growth: late")
        progress.packing("growth: at once after it")
        now += 1.1 * PACKING_EVERY
        progress.packing("growth: later")
    assert capsys.readouterr().err.splitlines() == ["[packing] growth: late", "[packing] growth: later"]
