"""`dem render` from the command line."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import report_samples as made
from click.testing import CliRunner, Result

from dem_cli.cli.render import command
from dem_cli.errors import DemError
from dem_cli.report.figures import KINDS
from dem_cli.report.sample import QUANTITIES


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make_file(tmp_path_factory.mktemp("run") / "run.h5", interval=0.1, columns=5, rows=5, tracks=(1, 2))


@pytest.fixture
def path(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(original, tmp_path))


def call(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def test_picture_lies_beside_the_file(path: Path) -> None:
    result = call(path, "--dpi", 40)
    assert result.exit_code == 0
    assert result.stdout == f"{path.with_name('run-sample.png')}\n"
    assert path.with_name("run-sample.png").stat().st_size > 1000


def test_picture_is_not_overwritten_unasked(path: Path) -> None:
    target = path.with_name("mine.svg")
    target.write_text("mine")
    result = call(path, "-o", target)
    assert isinstance(result.exception, DemError)
    assert target.read_text() == "mine"
    assert call(path, "-o", target, "--force").exit_code == 0
    assert target.read_text().startswith("<?xml")


def test_series_imply_their_kind(path: Path) -> None:
    result = call(path, "--series", "depth, void_ratio", "--dpi", 40)
    assert result.stdout.endswith("run-series.png\n")


def test_what_is_drawn_over_the_grains_is_asked_for(path: Path) -> None:
    pictures = []
    for k, options in enumerate(([], ["--marks"], ["--no-chains"])):
        assert call(path, "-o", path.with_name(f"{k}.png"), "--dpi", 40, *options).exit_code == 0
        pictures.append(path.with_name(f"{k}.png").read_bytes())
    assert len(set(pictures)) == 3
    assert call(path, "--what", "rose", "--frame", 0, "--dpi", 40).stdout.endswith("run-rose.png\n")


def test_nearest_frame_is_told(path: Path) -> None:
    assert "nearest frame: t = 2 s" in call(path, "--time", 2.2, "--dpi", 40).stderr
    assert call(path, "--time", 2.0, "--dpi", 40, "--force").stderr == ""


def test_incomplete_run_is_told(tmp_path: Path) -> None:
    cut = made.make_file(tmp_path / "cut.h5", stop_after=2.0, interval=0.1)
    result = call(cut, "--dpi", 40)
    assert result.exit_code == 0
    assert "incomplete" in result.stderr


@pytest.mark.parametrize(
    "options",
    [
        ["--what", "movie"],
        ["--color", "colour"],
        ["--color", "speed", "--what", "energy"],
        ["--series", "depth", "--what", "energy"],
        ["--series", "deepth"],
        ["--grains", "1", "--what", "surface"],
        ["--grains", "one", "--what", "histories"],
        ["--grains", "7", "--what", "histories"],
        ["--range", "1", "--what", "sample"],
        ["--range", "2,1"],
        ["--range", "0,inf"],
        ["--range", "0,1", "--what", "series"],
        ["--time", "9"],
        ["--time", "1", "--frame", "1"],
        ["--time", "1", "--what", "surface"],
        ["--marks", "--what", "rose"],
        ["--no-bonds", "--what", "energy"],
        ["--no-chains", "--what", "rose"],
        ["--color", "radius", "--what", "rose"],
        ["--frame", "99"],
        ["--stage", "7"],
        ["-o", "picture.bmp"],
    ],
)
def test_mistakes_leave_no_picture(path: Path, options: list[str]) -> None:
    result = call(path, *options)
    assert isinstance(result.exception, DemError)
    assert result.exception.exit_code == 2
    assert "\n" not in str(result.exception)
    assert result.stdout == ""
    assert [file.name for file in path.parent.iterdir()] == ["run.h5"]


@pytest.mark.parametrize(
    "options",
    [
        ["--dpi", "nan"],
        ["-o", "a.gif", "--fps", "nan"],
        ["-o", "a.gif", "--speed", "nan"],
        ["-o", "a.gif", "--speed", "inf"],
    ],
)
def test_what_is_no_finite_number_is_refused(path: Path, options: list[str]) -> None:
    result = call(path, *options)
    assert result.exit_code == 2
    assert f"{options[-1]} is no finite number" in result.stderr
    assert [file.name for file in path.parent.iterdir()] == ["run.h5"]


def test_endings_that_a_sample_may_have_are_named(path: Path) -> None:
    assert ".png, .svg, .pdf, .gif, .mp4" in str(call(path, "-o", "a.avi").exception)
    assert ".gif" not in str(call(path, "--what", "rose", "-o", "a.avi").exception)


def test_help_is_light_and_lists_everything() -> None:
    code = (
        "import sys, click\n"
        "from dem_cli.cli.render import command\n"
        "from dem_cli.cli.report import command as other\n"
        "for c in (command, other):\n"
        "    try: c(['--help'])\n"
        "    except SystemExit: pass\n"
        "heavy = {'matplotlib', 'numpy', 'h5py', 'numba', 'rich', 'pint'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    words = re.findall(r"[\w-]+", done.stdout)
    assert set(KINDS) <= set(words)
    assert set(QUANTITIES) <= set(words)


def test_rendering_needs_no_compiler(path: Path) -> None:
    code = (
        "import sys\n"
        "from dem_cli.cli.render import command\n"
        "from dem_cli.cli.report import command as other\n"
        f"command([{str(path)!r}, '--dpi', '40'], standalone_mode=False)\n"
        f"other([{str(path)!r}], standalone_mode=False)\n"
        "heavy = {name for name in sys.modules if name == 'numba' or name.startswith('dem_cli.engines')\n"
        "         or name == 'matplotlib.pyplot'}\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
