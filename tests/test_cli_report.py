"""`dem report` from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import report_samples as made
from click.testing import CliRunner

from dem_cli.cli.report import command
from dem_cli.errors import DemError
from dem_cli.report.summary import summary
from dem_cli.results import open_results


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make_file(tmp_path_factory.mktemp("run") / "run.h5", interval=0.05)


def test_one_file(path: Path) -> None:
    result = CliRunner().invoke(command, [str(path)])
    assert result.exit_code == 0
    assert "0.214 -> 0.199" in result.stdout
    assert "Energy" in result.stdout
    assert result.stderr == ""


def test_several_files_give_one_table_only(path: Path) -> None:
    result = CliRunner().invoke(command, [str(path), str(path), str(path)])
    lines = result.stdout.splitlines()
    assert len(lines) == 4
    assert lines[1].count("0.214 -> 0.199") == 1


def test_json_is_the_summary(path: Path) -> None:
    with open_results(path) as results:
        want = summary(results).as_dict()
    assert json.loads(CliRunner().invoke(command, [str(path), "--json"]).stdout) == want
    assert json.loads(CliRunner().invoke(command, [str(path), str(path), "--json"]).stdout) == [want, want]


def test_csv_goes_where_it_is_told(path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "tables"
    result = CliRunner().invoke(command, [str(path), "--csv", str(folder), "--json"])
    names = {"series.csv", "stages.csv", "surface.csv", "tracks.csv"}
    assert {file.name for file in folder.iterdir()} == names
    assert json.loads(result.stdout)
    assert all(name in result.stderr for name in names)
    again = CliRunner().invoke(command, [str(path), "--csv", str(folder)])
    assert isinstance(again.exception, DemError)
    assert again.stdout == ""
    assert CliRunner().invoke(command, [str(path), "--csv", str(folder), "--force"]).exit_code == 0


def test_file_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("no HDF5")
    for name in ("text.h5", "absent.h5"):
        result = CliRunner().invoke(command, [str(tmp_path / name)])
        assert isinstance(result.exception, DemError)
        assert result.exception.exit_code == 2
        assert "\n" not in str(result.exception)
