"""README keeps its word: its tables are those of the program, and its examples run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dem_cli.cli import COMMANDS
from dem_cli.scenario.reference import reference_markdown

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
SHIPPED = ROOT / "scenarios"


def block(mark: str) -> str:
    """The fenced block under `<!-- mark -->`."""
    found = re.search(rf"<!-- {mark} -->\n```\w*\n(.*?)\n```", README, re.DOTALL)
    assert found, mark
    return found.group(1)


def test_scenario_reference_is_that_of_the_model():
    assert reference_markdown().strip() in README


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_shown(command):
    assert f"dem {command}" in README


@pytest.mark.parametrize("mark", ["run", "test"])
def test_set_up_is_one_line(mark):
    assert block(mark).count("\n") == 0
    assert block(mark).startswith("python3 -m venv .venv && .venv/bin/pip install")


def test_scenarios_are_listed():
    for path in SHIPPED.glob("*.toml"):
        assert f"`{path.stem}`" in README


def test_notebook_example_runs(tmp_path, monkeypatch):
    example = re.search(r"In a notebook:\n\n```python\n(.*?)```", README, re.DOTALL)
    assert example
    short = SHIPPED.joinpath("shake-quick.toml").read_text()
    short = short.replace('duration  = "1 s"', 'duration  = "0.02 s"').replace(
        'kind = "settle"', 'kind = "settle"\nlimit = "0.05 s"'
    )
    (tmp_path / "mine.toml").write_text(short)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(example.group(1), "README", "exec"), names)
    with names["results"] as results:
        assert results.complete
        assert results.stages[-1].kind == "shake"
    monkeypatch.setenv("MPLBACKEND", "Agg")
    three = re.search(r"Three lines to a labelled plot.*?```python\n(.*?)```", README, re.DOTALL)
    assert three
    exec(compile(three.group(1), "README", "exec"), names)
    drawn = re.findall(r"`(run\.to_xarray\(.*?)`", README)
    assert len(drawn) == 2
    for line in drawn:
        assert eval(line, names) is not None
    with names["run"] as run:
        assert run.to_xarray("grains", frames=-1).sizes["grain"] == 500
