"""`dem init`, and the program around all commands."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

from dem_cli import __version__
from dem_cli.cli import COMMANDS, main
from dem_cli.scenario.shipped import shipped_scenarios

ROOT = Path(__file__).parent.parent


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_list() -> None:
    result = CliRunner().invoke(main, ["init"])
    assert result.exit_code == 0
    for one in shipped_scenarios():
        for text in (one.name, one.title, one.shows[1:], one.takes):
            assert text in result.stdout


def test_writes_a_copy(folder: Path) -> None:
    result = CliRunner().invoke(main, ["init", "shake-quick"])
    assert (result.exit_code, result.stdout) == (0, "shake-quick.toml\n")
    assert (folder / "shake-quick.toml").read_text() == (ROOT / "scenarios" / "shake-quick.toml").read_text()


@pytest.mark.parametrize("target", ["mine.toml", "sub"])
def test_writes_where_it_is_told(folder: Path, target: str) -> None:
    (folder / "sub").mkdir()
    assert CliRunner().invoke(main, ["init", "shake-quick.toml", "-o", target]).exit_code == 0
    written = folder / target if target.endswith(".toml") else folder / target / "shake-quick.toml"
    assert tomllib.loads(written.read_text())["grains"]["count"] == 500


RECORDS = ("synthetic-horizontal.at2", "synthetic-vertical.csv")


def test_writes_the_files_that_a_scenario_reads(folder: Path) -> None:
    (folder / "sub").mkdir()
    result = CliRunner().invoke(main, ["init", "shake-record", "-o", "sub/mine.toml"])
    assert (result.exit_code, result.stdout.splitlines()) == (
        0,
        ["sub/mine.toml", *(f"sub/{name}" for name in RECORDS)],
    )
    for name in RECORDS:
        assert (folder / "sub" / name).read_bytes() == (ROOT / "scenarios" / name).read_bytes()
    assert CliRunner().invoke(main, ["check", "sub/mine.toml"]).exit_code == 0


def test_files_that_are_there_already(folder: Path) -> None:
    """The same file is no obstacle; another one of that name is, and then nothing is written."""
    assert CliRunner().invoke(main, ["init", "shake-record"]).exit_code == 0
    assert CliRunner().invoke(main, ["init", "shake-record", "-o", "mine.toml"]).exit_code == 0
    (folder / RECORDS[0]).write_text("mine")
    result = CliRunner().invoke(main, ["init", "shake-record", "-o", "other.toml"])
    assert (result.exit_code, f"{RECORDS[0]}: exists" in result.stderr) == (2, True)
    assert not (folder / "other.toml").exists()
    assert (folder / RECORDS[0]).read_text() == "mine"
    assert CliRunner().invoke(main, ["init", "shake-record", "-o", "other.toml", "--force"]).exit_code == 0
    assert (folder / RECORDS[0]).read_text() != "mine"


def test_files_of_scenarios_are_shipped() -> None:
    """pyproject.toml lists the suffixes of what goes into the package."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    suffixes = {Path(pattern).suffix for pattern in settings["package-data"]["dem_cli.shipped"]}
    assert {Path(name).suffix for one in shipped_scenarios() for name in one.files} <= suffixes
    assert {path.suffix for path in (ROOT / "scenarios").iterdir() if path.is_file()} <= suffixes


def test_overwrites_only_when_forced(folder: Path) -> None:
    (folder / "shake-quick.toml").write_text("mine")
    result = CliRunner().invoke(main, ["init", "shake-quick"])
    assert result.exit_code == 2
    assert "shake-quick.toml: exists" in result.stderr
    assert "--force" in result.stderr
    assert (folder / "shake-quick.toml").read_text() == "mine"
    assert CliRunner().invoke(main, ["init", "shake-quick", "--force"]).exit_code == 0
    assert (folder / "shake-quick.toml").read_text() != "mine"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["init", "shakequick"], 'Did you mean "shake-quick"?'),
        (["init", "../scenarios/shake-quick"], "there is no scenario"),
        (["init", "shake-quick", "-o", "no/such/folder/a.toml"], "cannot be written"),
        (["chek"], 'Did you mean "check"?'),
        (["check"], "SCENARIO"),
    ],
)
def test_mistakes_end_with_2(folder: Path, arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.output
    assert list(folder.iterdir()) == []


def test_help_and_version() -> None:
    result = CliRunner().invoke(main, ["--help"])
    assert result.exit_code == 0
    for name, text in COMMANDS.items():
        assert name in result.stdout
        assert text in result.stdout
    assert CliRunner().invoke(main, ["--version"]).stdout.strip().endswith(__version__)


def test_short_help_is_that_of_the_commands() -> None:
    """COMMANDS repeats it, so that `dem --help` need not import the commands."""
    import importlib

    for name, text in COMMANDS.items():
        if not (ROOT / "dem_cli" / "cli" / f"{name}.py").exists():
            continue
        command = importlib.import_module(f"dem_cli.cli.{name}").command
        assert (command.name, command.short_help) == (name, text)


@pytest.mark.parametrize(
    ("arguments", "allowed"),
    [
        (["--help"], set()),
        (["--version"], set()),
        (["run", "--help"], set()),
        (["check", "--help"], set()),
        (["init"], {"numpy", "pydantic"}),
    ],
    ids=lambda value: " ".join(sorted(value)),
)
def test_light_commands_import_nothing_heavy(arguments: list[str], allowed: set[str]) -> None:
    code = (
        "import sys; from dem_cli.cli import main\n"
        f"try: main({arguments!r})\nexcept SystemExit: pass\n"
        "print(*{'numba', 'matplotlib', 'pydantic', 'pint', 'scipy', 'numpy', 'h5py'} & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert set(done.stderr.split()) <= allowed


def test_packages_are_listed() -> None:
    """pyproject.toml lists the packages, because scenarios/ goes into one of them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    found = {".".join(p.parent.relative_to(ROOT).parts) for p in (ROOT / "dem_cli").rglob("__init__.py")}
    assert sorted(settings["packages"]) == sorted(found | {"dem_cli.shipped"})
    assert settings["package-dir"] == {"dem_cli.shipped": "scenarios"}
