"""`dem report`, `dem render` and `dem compare` of quasi-static shear tests from the command line."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
import quasi_static_samples as made
import report_samples
from click.testing import CliRunner, Result

from dem_cli.cli import compare, render, report
from dem_cli.errors import ScenarioError
from dem_cli.report.shear import shear_summary
from dem_cli.results import open_results


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.write_test(tmp_path_factory.mktemp("shear") / "walls.h5", increments=20)


@pytest.fixture(scope="module")
def over_time(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report_samples.make_file(
        tmp_path_factory.mktemp("run") / "run.h5", interval=0.5, columns=5, rows=5, tracks=(1, 2)
    )


def call(command: object, *arguments: object) -> Result:
    return CliRunner().invoke(command.command, [str(argument) for argument in arguments])  # type: ignore[attr-defined]


def test_report_picks_by_the_axis(path: Path, over_time: Path) -> None:
    assert "peak of s1/s2" in call(report, path).stdout
    assert "Sloshing" in call(report, over_time).stdout


def test_json_is_the_summary(path: Path) -> None:
    with open_results(path) as results:
        want = shear_summary(results).as_dict()
    assert json.loads(call(report, path, "--json").stdout) == json.loads(json.dumps(want))
    assert len(json.loads(call(report, path, path, "--json").stdout)) == 2


def test_table_of_several(path: Path) -> None:
    lines = call(report, path, path).stdout.splitlines()
    assert len(lines) == 3
    assert lines[0].split()[:4] == ["file", "grains", "seed", "e"]


@pytest.mark.parametrize("command", [report, compare], ids=["report", "compare"])
def test_mixed_kinds_are_refused(path: Path, over_time: Path, command: object) -> None:
    result = call(command, over_time, path)
    assert isinstance(result.exception, ScenarioError)
    assert "report them separately" in str(result.exception)
    assert result.stdout == ""


def test_csv(path: Path, tmp_path: Path) -> None:
    assert call(report, path, "--csv", tmp_path / "tables").exit_code == 0
    tables = {file.name: list(csv.reader(file.read_text().splitlines())) for file in (tmp_path / "tables").iterdir()}
    assert set(tables) == {"series.csv", "stages.csv", "dissipation.csv", "tracks.csv"}
    assert tables["series.csv"][0][:2] == ["increment", "stage"]
    assert len(tables["series.csv"]) == 1 + 5 + 21
    assert len(tables["stages.csv"]) == 3
    assert len({len(row) for row in tables["stages.csv"]}) == 1
    assert len(tables["dissipation.csv"]) == 1 + 20 * 20
    assert tables["dissipation.csv"][1][:2] == [f"{made.COMPRESSION + 1}.0", "1"]
    assert tables["tracks.csv"][0][:2] == ["increment", "grain"]


def test_render(path: Path, tmp_path: Path) -> None:
    target = tmp_path / "forces.png"
    result = call(render, path, "--what", "forces", "--stage", 2, "--increment", 3, "-o", target, "--dpi", 40)
    assert result.stdout == f"{target}\n"
    assert result.stderr == ""
    assert target.stat().st_size > 1000


def test_nearest_frame_is_told(tmp_path: Path) -> None:
    """A file whose last increments have no frames."""
    states = made.shear_test(10)
    with made.open_writer(tmp_path / "few.h5", states[0]) as writer:
        for state in states:
            if state.in_stage % 5:
                measures = made.measure_increment(state, made.DEPTH, made.KN, made.KT)
                writer.append_series(measures.row, slips=state.slips)
            else:
                made.write_increment(writer, state)
        writer.finish("done")
    result = call(render, tmp_path / "few.h5", "--what", "forces", "--stage", 2, "--increment", 6, "--dpi", 40)
    assert result.stderr == "nearest frame: increment 9 of the run\n"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--what", "energy"], "choose --what dissipation"),
        (["--time", "1"], "choose a frame with --increment"),
        (["--what", "paper", "--increment", "3"], "--increment has no meaning for --what paper"),
        (["--what", "forces", "--marks"], "--marks has no meaning for --what forces, only for sample"),
        (["--increment", "3", "--frame", "1"], "exclude each other"),
        (["--what", "force"], 'Did you mean "forces"?'),
    ],
    ids=["energy", "time", "idle", "marks", "both", "unknown"],
)
def test_render_refuses_in_one_line(path: Path, options: list[str], words: str) -> None:
    result = call(render, path, *options)
    assert isinstance(result.exception, ScenarioError)
    assert words in str(result.exception)
    assert "\n" not in str(result.exception)


def test_runs_over_time_have_no_shear_pictures(over_time: Path) -> None:
    result = call(render, over_time, "--what", "paper")
    assert isinstance(result.exception, ScenarioError)
    assert "this is a run over time" in str(result.exception)
    assert "choose a frame with --time" in str(call(render, over_time, "--increment", 3).exception)


def test_compare_draws_all_curves(path: Path, tmp_path: Path) -> None:
    target = tmp_path / "both.png"
    result = call(compare, path, path, "-o", target, "--dpi", 40)
    assert target.is_file()
    assert result.stdout == call(report, path, path).stdout
    assert "no meaning" in str(call(compare, path, "--thesis").exception)
    assert "stress-strain" in str(call(compare, path, "--what", "grid").exception)
    assert "add --what" in str(call(compare, path, "--stage", 2).exception)
