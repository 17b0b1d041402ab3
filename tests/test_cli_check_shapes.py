"""`dem check` on ellipses, bonded discs and clumps."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scenario_text import small

from dem_cli.assembly import build_assembly
from dem_cli.cli import main
from dem_cli.cli.derived import derive
from dem_cli.engines.explicit.timestep import choose_time_step
from dem_cli.scenario import parse_scenario

WIDE = {"packing.grid.spacing": "5 cm", "container.width": "50 cm"}
SHAPES: dict[str, dict[str, Any]] = {
    "disc": {},
    "ellipse": {"grains.aspect_ratio": 2},
    "bonded": {"grains.template": "triangle"},
    "clump": {"grains.template": {"discs": [{"x": 0}, {"x": 1}]}},
}
LENS = 2.0 * math.pi / 3.0 - math.sqrt(3.0) / 2.0


def text(shape: str, changes: dict[str, Any] | None = None) -> str:
    return small({**WIDE, "grains.shape": shape, **SHAPES[shape], **(changes or {})})


def derived(shape: str, changes: dict[str, Any] | None = None) -> dict[str, Any]:
    return derive(parse_scenario(text(shape, changes))).as_dict()


@pytest.mark.parametrize(
    ("shape", "elements", "area"),
    [("disc", 1, math.pi), ("ellipse", 1, math.pi), ("bonded", 3, 3 * math.pi), ("clump", 2, 2 * math.pi - LENS)],
)
def test_counts_areas_and_masses_are_those_of_whole_grains(shape: str, elements: int, area: float) -> None:
    d = derived(shape)
    assert (d["shape"], d["grains"], d["elements"]) == (shape, 30, 30 * elements)
    radius = np.array(derived("disc")["radius"])  # the same radii are drawn
    assert d["area"][::2] == pytest.approx(tuple(area * radius[::2] ** 2), rel=1e-12)
    assert d["mass"] == pytest.approx(tuple(2480.0 * value for value in d["area"]), rel=1e-12)
    assert d["total_mass"] == pytest.approx(30 * d["mass"][1], rel=1e-12)
    assert d["depth_expected"] == pytest.approx(30 * d["area"][1] / 0.82 / 0.5, rel=1e-12)
    assert d["template_area"] == (pytest.approx(area) if shape in ("bonded", "clump") else None)


def test_semi_axes() -> None:
    d = derived("ellipse")
    assert d["semi_major"] == pytest.approx([math.sqrt(2.0) * r for r in d["radius"]])
    assert d["semi_minor"] == pytest.approx([r / math.sqrt(2.0) for r in d["radius"]])
    assert derived("disc")["semi_major"] is derived("clump")["semi_minor"] is None


def test_equal_area_needs_the_depth_of_discs() -> None:
    assert derived("clump", {"grains.equal_area": True})["depth_expected"] == pytest.approx(
        derived("disc", WIDE)["depth_expected"]
    )


def test_bonds() -> None:
    """lambda is C dt over the reduced mass; creep is force over viscosity over the expected time."""
    d = derived("bonded", {"grains.bond": {"normal": "1e6 N s/m", "tangential": "2e6 N s/m", "rolling": False}})
    assert d["bonds"] == 90
    assert d["bond_normal"] == (1e6, 1e6, 1e6)
    assert d["bond_rolling"] == (0.0, 0.0, 0.0)
    mass = build_assembly(parse_scenario(text("bonded"))).grains.mass
    assert d["bond_lambda"][::2] == pytest.approx(
        (2e6 * d["time_step"] / mass.max(), 2e6 * d["time_step"] / mass.min())
    )
    force = d["overlap_expected"] * d["kn"] * d["radius"][1]
    seconds = sum(stage["expected"] for stage in d["stages"])
    assert d["bond_creep"] == pytest.approx(force / 1e6 * seconds / d["radius"][1])
    assert derived("clump")["bond_lambda"] is derived("disc")["bond_creep"] is None


def test_time_step_is_that_of_the_assembly() -> None:
    scenario = parse_scenario(text("clump"))
    d = derived("clump")
    assert (d["time_step"], d["time_step_limit"]) == choose_time_step(scenario, build_assembly(scenario))


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ("ellipse", ["30 ellipses, total mass", "semi-axis a", "semi-axis b"]),
        (
            "bonded",
            [
                "30 bonded grains of 3 discs, 90 in all",
                "of whole grains: 3 pi r^2",
                "bonds",
                "lambda",
                "expected creep",
            ],
        ),
        ("clump", ["30 rigid clumps of 2 discs, 60 in all", "of whole grains: 1.609 pi r^2", "mass"]),
    ],
)
def test_lines(shape: str, words: list[str], tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(text(shape))
    result = CliRunner().invoke(main, ["check", str(tmp_path / "a.toml")])
    assert (result.exit_code, result.stderr) == (0, "")
    for word in words:
        assert word in result.stdout
    as_json = CliRunner().invoke(main, ["check", str(tmp_path / "a.toml"), "--json"])
    assert json.loads(as_json.stdout) == json.loads(json.dumps(derived(shape)))


def test_soft_bonds_are_warned_of() -> None:
    assert derived("bonded")["warnings"] == []
    (line,) = derived("bonded", {"grains.bond": {"normal": "1e4 N s/m"}})["warnings"]
    assert "bonds at the floor will give by about" in line
