"""`dem sweep` as its users meet it."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest
from click.testing import CliRunner, Result
from sweep_text import GAL_HZ, sweep_file
from test_run_prepared import assert_same

from dem_cli.cli import main
from dem_cli.results.manifest import read_manifest

LONG = {"stage.1.duration": "200 s", "output.frames": "10 s", "output.interval": "1 s"}


def dem(*args: object) -> Result:
    return CliRunner().invoke(main, ["sweep", *map(str, args)], catch_exceptions=False)


def states(folder: Path) -> list[str]:
    return [one.state for one in read_manifest(folder).members]


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep of four members that is done; its scenario lies beside it."""
    folder = tmp_path_factory.mktemp("swept")
    found = dem(sweep_file(folder, {"grid": GAL_HZ}), "-o", folder / "out", "--jobs", "2")
    assert found.exit_code == 0, found.stderr
    assert "4 of 4 members are done" in found.stderr
    assert "packing for 4 members: done in" in found.stderr
    return folder


def test_members_are_what_dem_run_gives(swept: Path, tmp_path: Path) -> None:
    """To the last bit, though their packing was made once for all."""
    args = [
        "--set",
        "stage.shake.amplitude=800 gal",
        "--set",
        "stage.shake.frequency=20 Hz",
        "-o",
        str(tmp_path / "one.h5"),
    ]
    found = CliRunner().invoke(main, ["run", str(swept / "box.toml"), *args, "--set", "title=small [800 gal, 20 Hz]"])
    assert found.exit_code == 0
    assert "its table [sweep] is left aside: dem sweep runs that" in found.stderr
    (member,) = (swept / "out").glob("800gal-20Hz-*.h5")
    assert_same(tmp_path / "one.h5", member)


def test_the_same_command_again_does_nothing(swept: Path) -> None:
    times = {path: path.stat().st_mtime_ns for path in (swept / "out").glob("*.h5")}
    found = dem(swept / "box.toml", "-o", swept / "out")
    assert found.exit_code == 0
    assert "4 members are done already; skipped" in found.stderr
    assert {path: path.stat().st_mtime_ns for path in (swept / "out").glob("*.h5")} == times


def test_dry_runs_list_members_states_and_times(swept: Path, tmp_path: Path) -> None:
    found = dem(swept / "box.toml", "-o", swept / "out", "--dry-run", "--vary", "stage.shake.amplitude=400 gal,900 gal")
    lines = found.stdout.splitlines()
    assert lines[0] == f"small: 4 members, 2 done; folder {swept / 'out'}"
    assert lines[1].split() == ["amplitude", "frequency", "state", "time", "file"]
    assert re.fullmatch(r"  400 gal +10 Hz +done +400gal-10Hz-[0-9a-f]{8}\.h5", lines[2])
    assert re.fullmatch(r"  900 gal +20 Hz +to do +about 1 s +900gal-20Hz-[0-9a-f]{8}\.h5", lines[5])
    assert "packing for 4 members" in found.stdout
    assert re.search(
        r"in all, guessed, \S+ times as long as dem check says, as the members that are done", found.stdout
    )
    new = dem(sweep_file(tmp_path, {"grid": GAL_HZ}), "-o", tmp_path / "new", "--dry-run")
    assert new.exit_code == 0
    assert re.search(r"in all, guessed +about 1 s of one core, about 1 s on \d+$", new.stdout.rstrip())
    assert not (tmp_path / "new").exists()


def test_a_changed_scenario_runs_anew_and_keeps_the_old_files(tmp_path: Path) -> None:
    one = {"grid": {"stage.shake.amplitude": ["400 gal"]}}
    assert dem(sweep_file(tmp_path, one), "-o", tmp_path / "out").exit_code == 0
    found = dem(sweep_file(tmp_path, one, {"contact.friction": 0.9}), "-o", tmp_path / "out")
    assert found.exit_code == 0
    assert "1 result file is of members that the sweep no longer has, e.g. 400gal-" in found.stderr
    assert len(list((tmp_path / "out").glob("*.h5"))) == 2
    assert states(tmp_path / "out") == ["done"]


def test_what_fails_is_told_in_a_table_and_the_rest_is_done(tmp_path: Path) -> None:
    """A bad combination, and a run that blows up."""
    grid = {"material.normal_stiffness": ["1e6 N/m", "1e2 N/m"], "container.width": ["16 cm", "9 cm"]}
    path = sweep_file(tmp_path, {"grid": grid})
    found = dem(path, "-o", tmp_path / "out")
    assert found.exit_code == 1
    table = found.stderr[found.stderr.index("3 of 4 members failed") :].splitlines()
    assert [line.split()[0] for line in table[1:5]] == ["member", "1e6Nperm-9cm", "1e2Nperm-9cm", "1e2Nperm-16cm"]
    assert "is too narrow for the starting grid" in table[2]
    assert "overlap by" in table[4]
    assert "more than max_overlap = 0.1" in table[4]
    assert states(tmp_path / "out") == ["done", "failed", "failed", "failed"]
    again = dem(path, "-o", tmp_path / "out")
    assert again.exit_code == 1
    assert "1e2Nperm-16cm: failed" not in again.stderr, "it would fail again"
    assert "1e2Nperm-16cm: failed" in dem(path, "-o", tmp_path / "out", "--retry").stderr


def test_quiet_sweeps_say_nothing_but_what_failed(tmp_path: Path) -> None:
    path = sweep_file(tmp_path, {"grid": {"container.width": ["16 cm", "9 cm"]}})
    found = CliRunner().invoke(main, ["-q", "sweep", str(path), "-o", str(tmp_path / "out")])
    assert found.exit_code == 1
    assert found.stderr.splitlines()[0] == "1 of 2 members failed"
    assert found.stdout == ""


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--vary", "stage.shake.amplitud=1 gal"], '--vary stage.shake.amplitud = "1 gal": unknown key. Did you mean "stage.shake.amplitude"?'),
        (["--vary", "seed"], "--vary seed: is not KEY=VALUE,VALUE. Write for example"),
        (["--set", "contact.fricton=1"], '--set contact.fricton=1: unknown key. Did you mean "contact.friction"?'),
        (["--vary", "seed=1..2600"], "the sweep has 10,400 members, more than 10,000. Give --yes if that is meant"),
        (["--jobs", "2", "--scheduler", "tcp://x:1"], "--jobs and --scheduler exclude each other"),
    ],
)  # fmt: skip
def test_mistakes_are_one_line_and_change_nothing(tmp_path: Path, args: list[str], said: str) -> None:
    found = dem(sweep_file(tmp_path, {"grid": GAL_HZ}), "-o", tmp_path / "out", *args)
    assert (found.exit_code, found.stdout) == (2, "")
    assert len(found.stderr.splitlines()) == 1
    assert said in found.stderr
    assert not (tmp_path / "out").exists()


def test_a_sweep_of_nothing(tmp_path: Path) -> None:
    found = dem(sweep_file(tmp_path))
    assert found.exit_code == 2
    assert found.stderr == (
        f'{tmp_path / "box.toml"}: [sweep]: varies nothing. Add a grid to the table, or give --vary "stage.shake.amplitude=400 gal,800 gal"\n'
    )


def started(folder: Path, *args: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "dem_cli", "sweep", "box.toml", "-o", "out", *args]
    return subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)


def wait_for(condition: Any, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happens"
        time.sleep(0.1)


def test_ctrl_c_keeps_what_is_done_and_the_same_command_goes_on(tmp_path: Path) -> None:
    """One short and one endless member: after the interrupt the short one is skipped, the other one redone, with an end this time."""
    changes = {"output.frames": "10 s", "output.interval": "1 s"}
    sweep_file(tmp_path, {"grid": {"stage.shake.duration": ["0.1 s", "500 s"]}}, changes)
    sweep = started(tmp_path, "--jobs", "1")
    wait_for(lambda: list((tmp_path / "out").glob("500s-*.partial.h5")))
    workers = psutil.Process(sweep.pid).children(recursive=True)
    assert workers
    sweep.send_signal(signal.SIGINT)
    _, said = sweep.communicate(timeout=60)
    assert sweep.returncode == 130, said
    assert (
        said.splitlines()[-1]
        == "interrupted; members that are done are kept, and the same command goes on with the others"
    )
    assert states(tmp_path / "out") == ["done", "waiting"]
    assert not any(one.is_running() for one in workers), "no member goes on by itself"


def test_two_sweeps_in_one_folder_share_the_work(tmp_path: Path) -> None:
    """Each member is run once, by one of them, and both know of all in the end."""
    sweep_file(tmp_path, {"grid": GAL_HZ, "seeds": 2}, {"stage.1.duration": "1 s"})
    both = [started(tmp_path, "--jobs", "1") for _ in range(2)]
    said = [sweep.communicate(timeout=120)[1] for sweep in both]
    assert [sweep.returncode for sweep in both] == [0, 0], said
    done = [re.findall(r"^(\d+gal\S+): done in", text, re.MULTILINE) for text in said]
    assert len(done[0]) + len(done[1]) == len({*done[0], *done[1]}) == 8
    assert all(done), "both had something to do"
    assert states(tmp_path / "out") == ["done"] * 8
    assert sum(text.count("packing for 4 members") for text in said) == 2


def test_help_tells_what_a_sweep_is() -> None:
    text = dem("--help").stdout
    for word in ("--vary", "--jobs", "--scheduler", "--dry-run", "--retry", "--yes", "sweep.toml", "dem report"):
        assert word in text
