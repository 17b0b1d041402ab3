"""`dem check` on quasi-static tests: derived numbers against their definitions, and warnings."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from quasi_static_text import quick
from scenario_text import ABSENT

from dem_cli.cli import main


def check(folder: Path, changes: dict[str, Any] | None = None, *options: str) -> Result:
    (folder / "case.toml").write_text(quick(changes))
    return CliRunner().invoke(main, ["check", str(folder / "case.toml"), *options])


def numbers(folder: Path, changes: dict[str, Any] | None = None) -> dict[str, Any]:
    result = check(folder, changes, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert isinstance(found, dict)
    return found


def lines(folder: Path, changes: dict[str, Any] | None = None) -> dict[str, str]:
    result = check(folder, changes)
    assert result.exit_code == 0, result.output
    return {line[:18].strip(): line[18:] for line in result.stdout.splitlines()}


DISCS = {"grains.count": 50, "grains.radius": "4 mm", "grains.density": "2000 kg/m^3"}


def test_numbers_by_their_definitions(tmp_path: Path) -> None:
    """50 discs of 4 mm, 1 cm deep; 15 kPa first, 20 kPa at most; kn 1e5 N/m."""
    found = numbers(tmp_path, {**DISCS, "contact.wall_friction": {"top": 0.5}, "container.gravity": "10 m/s^2"})
    area = 50 * math.pi * 0.004**2
    assert found["radius"] == [0.004, 0.004, 0.004]
    assert found["mass"][1] == pytest.approx(2000 * math.pi * 0.004**2 * 0.01)
    assert found["total_mass"] == pytest.approx(2000 * area * 0.01)
    assert found["width"] == pytest.approx(math.sqrt(1.28 * area))
    assert found["void_ratio"] == pytest.approx(0.28)
    assert (found["kn"], found["ks"]) == (pytest.approx(1e5), pytest.approx(7e4))
    assert found["friction_angle"] == pytest.approx(25.0)
    assert found["wall_friction_angles"]["top"] == pytest.approx(math.degrees(math.atan(0.5)))
    assert found["wall_friction_angles"]["left"] == 0.0
    assert (found["first_stress"], found["largest_stress"]) == (15e3, 20e3)
    assert found["accuracy"] == pytest.approx(1e-5 * 15e3 * 0.008 * 0.01)
    # a disc between two others bears sigma d depth; its overlap with each is that over kn
    assert found["overlap_expected"] == pytest.approx(20e3 * 0.008 * 0.01 / 1e5 / 0.004)
    assert found["floor_stress"] == pytest.approx(2000 * area * 10.0 / found["width"])
    assert found["increments"] == 486
    assert [one["increments"] for one in found["stages"]] == [6, 60, 20, 400]
    # in a sub-step neighbours move by half of a quarter of an increment of their distance
    moved = 0.5 * 0.0005 / 4 * 0.008 / (15e3 * 0.008 * 0.01 / 1e5)
    assert found["stages"][1]["moved"] == pytest.approx(moved)
    assert found["stages"][3]["moved"] == pytest.approx(moved / 5)
    assert found["run_seconds"] == pytest.approx(24e-3 * (50 / 122) ** 1.15 * 4 * 486)


def test_accuracy_that_is_given(tmp_path: Path) -> None:
    assert numbers(tmp_path, {"solver": {"accuracy": "100 dyn"}})["accuracy"] == pytest.approx(1e-3)


def test_without_any_stress(tmp_path: Path) -> None:
    alone = {"stage": [{"kind": "shear", "hold": "lateral-strain", "shear_strain": 0.01}]}
    found = numbers(tmp_path, alone)
    assert [found[name] for name in ("first_stress", "accuracy", "overlap_expected")] == [None, None, None]
    assert "1e-5 of mean stress" in lines(tmp_path, alone)["solver"]


def test_file_grows_with_frames(tmp_path: Path) -> None:
    every, fifth = (numbers(tmp_path, {**DISCS, "output": {"frames": k}})["file_bytes"] for k in (1, 5))
    assert every - fifth == pytest.approx(0.8 * 486 * 50 * (71 + 2 * 88), rel=0.01)


def test_lines(tmp_path: Path) -> None:
    found = lines(tmp_path)
    assert "30 discs" in found["grains"]
    assert "void ratio 0.28" in found["box"]
    assert found["boundary"] == "four rigid walls"
    assert found["friction"] == "25 deg between grains, walls smooth"
    assert (found["cohesion"], found["gravity"]) == ("none", "none")
    assert found["solver"].startswith("momentum, 4 sub-steps an increment")
    assert found["stage 1"] == "compress: to 15 kPa in 6 levels, 6 increments"
    assert found["stage 2"] == "shear: to a shear strain of 0.03 along y, mean stress held, 60 increments"
    assert found["stage 3"] == "load: x to 20 kPa, y to a strain of 0.01, 20 increments"
    assert found["stage 4"].startswith(
        'cyclic from the end of "compress": 10 cycles between limits of q = 0.15 of the mean stress'
    )
    assert "volume held, about 400 increments" in found["stage 4"]
    assert found["expected"].startswith("486 increments, result file ")


@pytest.mark.parametrize(
    ("changes", "label", "words"),
    [
        ({"boundary": {"kind": "chain", "radius": "4 mm"}}, "boundary", "a ring of grains, radius 4 mm"),
        ({"boundary": {"kind": "chain"}}, "friction", "walls none"),
        ({"contact.wall_friction": "5 deg"}, "friction", "walls 5 deg"),
        ({"contact.wall_friction": {"left": "5 deg"}}, "friction", "5 deg left, 0 deg right"),
        ({"contact.cohesion": "0.25 N"}, "cohesion", "0.25 N a contact"),
        ({"solver": "kishino"}, "solver", "kishino, 1 sub-step an increment"),
        (
            {"stage.3.limit": {"strain": 0.01}},
            "stage 4",
            "limits of a shear strain of 0.01, volume held, 4000 increments",
        ),
        ({"stage.3.limit": {"stress": "2 kPa"}}, "stage 4", "limits of q = 2 kPa"),
        ({"container.gravity": "1 m/s^2"}, "gravity", "1 m/s^2, "),
        ({"packing": {"method": "growth"}}, "packing", "growth: takes about 1 s"),
        (
            {"boundary": {"kind": "membrane"}, "stage.3": ABSENT, "stage.2": ABSENT, "stage.1.hold": "lateral-stress"},
            "boundary",
            "links of 1e+04 N/m",
        ),
    ],
    ids=lambda value: str(value)[:50],
)
def test_line(tmp_path: Path, changes: dict[str, Any], label: str, words: str) -> None:
    assert words in lines(tmp_path, changes)[label]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"material.normal_stiffness": "1e7 dyn/cm"}, "overlap by about 4.0% of their radius at 20 kPa"),
        (
            {"stage.1.increment": 0.03, "solver": "kishino"},
            "stage 2 moves neighbours by about 10 overlaps in a sub-step",
        ),
        ({"container.gravity": "1000 m/s^2"}, "more than the first stress of 15 kPa"),
    ],
    ids=lambda value: str(value)[:50],
)
def test_warnings(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    assert check(tmp_path).stderr == ""
    assert words in check(tmp_path, changes).stderr


def test_resolved_loads_back(tmp_path: Path) -> None:
    once = check(tmp_path, {}, "--resolved").stdout
    (tmp_path / "again.toml").write_text(once)
    assert CliRunner().invoke(main, ["check", str(tmp_path / "again.toml"), "--resolved"]).stdout == once
