"""`dem check` on scenarios of the impulse engine: derived numbers against their definitions, lines and warnings."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from impulse_file import write_result_file
from impulse_text import BOX, CLUMP, PLACED, drop, pour
from scenario_text import ABSENT

from dem_cli.cli import main


def check(folder: Path, text: str, *options: str) -> Result:
    (folder / "case.toml").write_text(text)
    return CliRunner().invoke(main, ["check", str(folder / "case.toml"), *options])


def numbers(folder: Path, text: str, *options: str) -> dict[str, Any]:
    result = check(folder, text, "--json", *options)
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert isinstance(found, dict)
    return found


def lines(folder: Path, text: str) -> dict[str, str]:
    result = check(folder, text)
    assert result.exit_code == 0, result.output
    return {line[:18].strip(): line[18:] for line in result.stdout.splitlines()}


def test_numbers_by_their_definitions(tmp_path: Path) -> None:
    found = numbers(tmp_path, drop({"grains.face_points": 2, "container": {"gravity": "10 m/s^2"}, "grains.scale": 2}))
    (box,) = found["kinds"]
    assert (found["engine"], found["bodies"], found["total_mass"]) == ("impulse", 1, pytest.approx(64e3))
    assert (box["name"], box["shape"], box["material"], box["bodies"]) == ("box", "box", "box", 1)
    assert (box["size"], box["mass"], box["volume"]) == ([3.0] * 3, pytest.approx([64e3] * 3), 4.0)
    assert (box["corners"], box["triangles"], box["points"], box["spheres"]) == (8, 12, 24, 0)
    assert (found["planes"], found["terrain"], found["materials"]) == (["floor"], None, ["box", "floor"])
    assert (found["restitution"], found["friction"]) == ([[0.3, 0.3]] * 2, [[0.5, 0.5]] * 2)
    assert (found["size_smallest"], found["fall_height"], found["largest_speed"]) == pytest.approx(
        (3.0, 1.6, math.sqrt(32.0))
    )
    assert found["time_step"] == found["time_step_rule"] == pytest.approx(0.01)
    assert found["time_step_bound"] == "output.interval"
    assert found["steps"] == found["stages"][0]["steps"] == 100
    assert found["warnings"] == []


def test_steps_of_a_given_time_step(tmp_path: Path) -> None:
    found = numbers(tmp_path, drop(), "--set", "integration.time_step=0.3 ms")
    assert (found["time_step"], found["steps"]) == (3e-4, 3334)


def test_lines(tmp_path: Path) -> None:
    said = lines(
        tmp_path,
        drop({"grains.face_points": 3, "solver": {"sweeps": 200, "tolerance": "1e-5 m/s"}, "output.interval": "20 ms"}),
    )
    assert said["bodies"] == "1 body, total mass 8000 kg"
    assert said["box"] == "1 x box of 8 corners, 12 triangles, 54 points on faces, material box"
    assert said["size"] == "radius of the bounding sphere 1.5 m"
    assert said["mass"] == "8000 kg"
    assert said["inertia"] == "3333.3, 5333.3, 3333.3 kg m^2  (principal, of scale 1)"
    assert said["fixed"] == "floor"
    assert said["contact"] == "restitution 0.3, friction 0.5 of all pairs of box, floor"
    assert said["time step"].endswith("s  (by rule)")
    assert said["rule"].endswith(
        "(no body moves by more than 0.05 x 1.5 m, the smallest one's size, at 5.602 m/s, after a fall of up to 1.6 m)"
    )
    assert said["solver"] == "pgs: ends at 1e-05 m/s or 200 sweeps"
    assert said["stage 1"].startswith("run: 1 s, ")


def test_lines_of_kinds_and_pairs(tmp_path: Path) -> None:
    said = lines(
        tmp_path,
        pour({"contact.pairs": [{"between": ["clump", "wall"], "friction": 0.1}], "solver": "energy-tracking"}),
    )
    assert said["clump"] == "20 x clump of 4 spheres, material clump"
    assert said["clump - wall"] == "restitution 0.3, friction 0.1"
    assert said["box - clump" if "box - clump" in said else "clump - box"] == "restitution 0.3, friction 0.5"
    assert "wall - wall" not in said  # they never meet
    assert said["fixed"] == "left, right, front, back, bottom"
    assert said["solver"].startswith("energy-tracking: 50 quanta")
    assert said["stage 1"].startswith("settle: at most 20 s, at most ")
    assert said["stage 2"].startswith("shake: 2 s, ")


def test_sizes_that_differ(tmp_path: Path) -> None:
    radius = {"classes": [{"radius": "1 cm", "count": 1}, {"radius": "3 cm", "count": 1}]}
    grains = {"shape": "sphere", "radius": radius, "density": "1000 kg/m^3"}
    said = lines(tmp_path, pour({"grains": grains}))
    assert said["sphere"] == "2 x sphere, material sphere"
    assert said["size"] == "radius of the bounding sphere 10 mm, 20 mm, 30 mm  (smallest, mean, largest)"


def test_quality_of_a_cloud(tmp_path: Path) -> None:
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in (3, 3, 3)), indexing="ij"), axis=-1).reshape(-1, 3)
    np.savetxt(tmp_path / "rock.csv", cells, delimiter=",", header="x,y,z", comments="")
    text = drop(
        {
            "grains": {"shape": "cloud", "file": "rock.csv", "file_unit": "cm", "density": "2 g/cm^3", "name": "rock"}
            | PLACED
        }
    )
    found = numbers(tmp_path, text)
    assert found["notes"][0].startswith("cloud rock: 27 particles 0.01 m apart, 26 at the surface, 6 of these (23%)")
    assert found["warnings"] == [
        "cloud rock: only 23% of the particles at the surface have a trusted normal: take a finer lattice"
    ]
    assert lines(tmp_path, text)["rock"] == "1 x cloud of 26 points, 6 with a trusted normal, material rock"


def test_bodies_of_a_file(tmp_path: Path) -> None:
    write_result_file(tmp_path / "pile.h5")
    found = numbers(tmp_path, pour({"packing": {"method": "file", "file": "pile.h5"}, "grains": ABSENT}))
    assert [(kind["name"], kind["bodies"], kind["mass"][2]) for kind in found["kinds"]] == [("ball", 2, 4.0)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (drop({"plane": []}), "there is gravity, and nothing below the bodies"),
        (
            drop({"integration": {"time_step": "0.1 s"}}),
            "in a step of 0.1 s the fastest body may move by 37% of the smallest one's size",
        ),
        (drop({"integration": {"time_step": "20 ms"}}), "the time step of 0.02 s is longer than output.interval"),
        (pour({"contact.restitution": 1}), "restitution is 1: impacts lose nothing"),
        (
            pour({"output": {"interval": "0.05 s"}}),
            "stage 2 shakes at 10 Hz, and output.interval gives it less than ten rows a period",
        ),
    ],
    ids=["nothing below", "coarse", "interval", "elastic", "rows"],
)
def test_warnings(tmp_path: Path, text: str, words: str) -> None:
    assert any(one.startswith(words) for one in numbers(tmp_path, text)["warnings"])
    assert f"warning: {words}" in check(tmp_path, text).stderr


def test_bodies_that_do_not_fit_are_a_mistake(tmp_path: Path) -> None:
    result = check(tmp_path, pour({"grains": CLUMP | {"count": 300}, "container.height": "0.5 m"}))
    assert result.exit_code == 2
    assert re.match(r".*case\.toml: \[packing\] method = grid: the bodies do not fit: ", result.stderr)


def test_several_boxes(tmp_path: Path) -> None:
    said = lines(tmp_path, drop({"grains": [BOX | PLACED, BOX | {"position": ["0 m", "0 m", "9 m"]}]}))
    assert said["bodies"] == "2 bodies, total mass 1.6e+04 kg"
    assert "box 2" in said
