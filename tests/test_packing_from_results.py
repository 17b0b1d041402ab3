"""Result files as packings: any run may begin where another one ended."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from dem_cli.assembly import build_assembly
from dem_cli.cli import main
from dem_cli.errors import ScenarioError
from dem_cli.results import open_results
from dem_cli.run import run_scenario
from dem_cli.scenario import Scenario, load_scenario
from dem_cli.state import Grains

TEXT = """
[grains]
shape = "{shape}"
count = 12
radius = {{ uniform = ["0.5 cm", "1 cm"] }}
density = "2480 kg/m^3"
[material]
normal_stiffness = "1e7 N/m"
tangential_stiffness = "3e6 N/m"
[contact]
friction = 0.3
damping_ratio = 0.5
[container]
width = "16.2 cm"
[packing]
method = "falling"
grid = {{ columns = 3, spacing = "5 cm", shift = "1 cm" }}
[[stage]]
kind = "settle"
name = "first"
[[stage]]
kind = "run"
duration = "0.05 s"
"""
SHAPES = {"disc": "", "ellipse": "aspect_ratio=2", "bonded": 'template="pair"', "clump": 'template="pair"'}
AGAIN = ("packing.method=file", "packing.file=packed.h5", "seed=77")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario and its packed result for each shape."""
    root = tmp_path_factory.mktemp("packed")
    for shape in SHAPES:
        place = root / shape
        place.mkdir()
        (place / "case.toml").write_text(TEXT.format(shape=shape))
        run_scenario(first(place, shape), place / "packed.h5")
    return root


def first(place: Path, shape: str) -> Scenario:
    own = [f"grains.{SHAPES[shape]}"] if SHAPES[shape] else []
    return load_scenario(place / "case.toml", own)


def again(place: Path, shape: str, *changes: str) -> Scenario:
    own = [f"grains.{SHAPES[shape]}"] if SHAPES[shape] else []
    return load_scenario(place / "case.toml", [*own, *AGAIN, *changes])


@pytest.mark.parametrize("shape", SHAPES)
def test_grains_lie_as_they_lay(folder: Path, shape: str) -> None:
    """Every element is where the last frame has it, with its velocity, and it weighs the same; the sample is at rest at once."""
    place = folder / shape
    scenario = again(place, shape)
    grains = build_assembly(scenario).grains
    with open_results(place / "packed.h5") as results:
        last = results.frame(-1).grains
    for name in ("x", "y", "angle", "vx", "vy", "spin", "a", "b", "body"):
        np.testing.assert_array_equal(getattr(grains, name), getattr(last, name), err_msg=name)
    np.testing.assert_allclose(grains.mass, last.mass, rtol=1e-14)
    np.testing.assert_allclose(grains.inertia, last.inertia, rtol=1e-14)
    with open_results(run_scenario(scenario, place / "again.h5")) as results:
        moved = np.hypot(results.frame(-1).grains.x - last.x, results.frame(-1).grains.y - last.y)
        assert moved.max() < 2e-3 * last.radius.max()
        assert results.stages[0].reason.startswith("at rest")
        assert results.stages[0].end < 0.3


def test_the_end_of_a_stage(folder: Path) -> None:
    """Not where the run ended, but where the stage did."""
    place = folder / "disc"
    found = build_assembly(again(place, "disc", "packing.stage=first")).grains
    with open_results(place / "packed.h5") as results:
        wanted = results.frame(int(np.flatnonzero(results.frame_times == results.stages[0].end)[0])).grains
        assert results.frame(-1).time > results.stages[0].end
    np.testing.assert_array_equal(found.x, wanted.x)
    np.testing.assert_array_equal(found.vy, wanted.vy)
    assert not np.array_equal(found.vy, results_last(place).vy)


def results_last(place: Path) -> Grains:
    with open_results(place / "packed.h5") as results:
        return results.frame(-1).grains


def test_bonded_grains_may_become_rigid(folder: Path) -> None:
    assembly = build_assembly(again(folder / "bonded", "bonded", "grains.shape=clump"))
    assert assembly.rigid
    assert len(assembly.bonds) == 0
    assert assembly.grains.grain_count == 12


def test_another_density_gives_another_mass(folder: Path) -> None:
    light = build_assembly(again(folder / "disc", "disc", "grains.density=1240 kg/m^3")).grains
    usual = build_assembly(again(folder / "disc", "disc")).grains
    np.testing.assert_allclose(light.mass, 0.5 * usual.mass, rtol=1e-14)


@pytest.mark.parametrize(
    ("shape", "changes", "said"),
    [
        ("disc", ("packing.file=none.h5",), "none.h5.*: does not exist"),
        ("disc", ("packing.file=text.h5",), "is not a result file of dem run"),
        ("disc", ("packing.stage=second",), 'no stage "second" has ended there'),
        ("bonded", ("grains.template=triangle",), "has 3 discs a grain, those of packed.h5 have 2"),
        ("ellipse", ("grains.shape=disc",), 'is not the shape of the grains of packed.h5, which is "ellipse"'),
    ],
)
def test_what_does_not_fit_is_refused(folder: Path, shape: str, changes: tuple[str, ...], said: str) -> None:
    (folder / shape / "text.h5").write_text("no HDF5")
    with pytest.raises(ScenarioError, match=said):
        again(folder / shape, shape, *changes)


def test_the_file_enters_the_hash(folder: Path) -> None:
    place = folder / "disc"
    shutil.copy(place / "packed.h5", place / "other.h5")
    with h5py.File(place / "other.h5", "r+") as file:
        file["VTKHDF/PointData/spin"][-1] += 1.0
    hashes = {again(place, "disc", f"packing.file={name}.h5").hash for name in ("packed", "other")}
    assert len(hashes) == 2


@pytest.mark.parametrize("shape", SHAPES)
def test_dem_check_knows_it(folder: Path, shape: str) -> None:
    own = [f"--set=grains.{SHAPES[shape]}"] if SHAPES[shape] else []
    done = CliRunner().invoke(
        main, ["check", str(folder / shape / "case.toml"), *own, *(f"--set={one}" for one in AGAIN)]
    )
    assert done.exit_code == 0, done.output
    assert "12 " in done.output.splitlines()[1]
