"""Result files that are unfinished, killed, in use, in the way, or none at all."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from results_samples import (
    PAIRS,
    coordination,
    open_writer,
    same_arrays,
    series_row,
    some_frame,
    some_grains,
    stress,
    write_all,
)

from dem_cli.errors import ResultsError, RunError
from dem_cli.results import open_results, partial_path, run_file
from dem_cli.results.schema import FORMAT_VERSION, SERIES


@pytest.fixture
def done(tmp_path: Path) -> Path:
    return write_all(tmp_path / "out.h5")


def test_an_unfinished_file_says_so(tmp_path: Path) -> None:
    path = tmp_path / "out.h5"
    with open_writer(path) as writer:
        writer.append_series(series_row(0), np.zeros(3))
        writer.finish("blew up at grain 3", complete=False)
        assert writer.file == partial_path(path) == tmp_path / "out.partial.h5"
    assert not path.exists()
    with open_results(partial_path(path)) as results:
        assert not results.complete
        assert results.status == "INCOMPLETE: blew up at grain 3"
        assert results.series.rows == 1
    with pytest.raises(ResultsError, match=r"out\.h5: no such file; an unfinished run left .*out\.partial\.h5"):
        open_results(path)


@pytest.mark.parametrize(
    ("error", "reason"),
    [(KeyboardInterrupt(), "interrupted"), (RunError("grain 3 flew off"), "RunError: grain 3 flew off")],
)
def test_an_exception_is_the_stop_reason(tmp_path: Path, error: BaseException, reason: str) -> None:
    def run() -> None:
        with open_writer(tmp_path / "out.h5") as writer:
            writer.append_series(series_row(0), np.zeros(3))
            raise error

    with pytest.raises(type(error)):
        run()
    with open_results(tmp_path / "out.partial.h5") as results:
        assert (results.complete, results.stop_reason, results.series.rows) == (False, reason, 1)


def test_rows_appear_with_a_flush_and_not_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_file, "FLUSH_SECONDS", 1e9)

    def seen() -> tuple[int, int, int]:
        with open_results(tmp_path / "out.partial.h5") as results:
            assert results.tracks is not None
            return results.series.rows, results.n_frames, len(results.tracks.time)

    with open_writer(tmp_path / "out.h5") as writer:
        writer.append_series(series_row(0), np.zeros(3))
        writer.append_frame(some_frame(0, PAIRS[0]), coordination(0), stress(0))
        writer.append_tracks(0.0, some_grains())
        assert seen() == (0, 0, 0)
        writer.flush()
        assert seen() == (1, 1, 1)
        monkeypatch.setattr(run_file, "FLUSH_BYTES", 3 * 8 * len(SERIES))
        for k in range(1, 4):
            writer.append_series(series_row(k), np.zeros(3))
        assert seen()[0] > 1
        monkeypatch.setattr(run_file, "FLUSH_SECONDS", 0.0)
        writer.append_series(series_row(4), np.zeros(3))
        assert seen() == (5, 1, 1)


CHILD = """
import sys
from pathlib import Path
sys.path[:0] = {path!r}
from results_samples import *
from dem_cli.errors import RunError
with open_writer(Path({target!r})) as writer:
    writer.begin_stage("fall", "settle", 0.0)
    for k in range(10**9):
        writer.append_series(series_row(k), np.zeros(3))
        writer.append_frame(some_frame(k, PAIRS[k % 4]), coordination(k), stress(k))
        if k % 10 == 9:
            writer.flush()
        if k == 50:
            print("going", flush=True)
"""


def start_child(target: Path) -> subprocess.Popen[str]:
    code = textwrap.dedent(CHILD).format(path=[str(Path(__file__).parent), os.getcwd()], target=str(target))
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "going\n"
    return child


def test_a_killed_run_leaves_a_file_that_opens(tmp_path: Path) -> None:
    child = start_child(tmp_path / "out.h5")
    try:
        with open_results(tmp_path / "out.partial.h5") as results:  # while the other process writes
            assert results.series.rows >= 50
            assert not results.complete
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()
        assert child.stdout is not None
        child.stdout.close()
    with open_results(tmp_path / "out.partial.h5") as results:
        assert results.n_frames >= 50
        assert results.series.rows >= 50
        assert results.status.startswith("INCOMPLETE: not ended")
        k = 49
        given = some_frame(k, PAIRS[k % 4])
        assert same_arrays(given.grains, results.frame(k).grains)
        assert np.array_equal(results.series["step"][:50], [series_row(k)["step"] for k in range(50)])
    with h5py.File(tmp_path / "out.partial.h5") as file:  # with locks and all the checks of HDF5's own
        assert len(file["series/time"]) >= 50


def test_nothing_is_replaced_without_force(tmp_path: Path) -> None:
    path = write_all(tmp_path / "out.h5")
    with pytest.raises(ResultsError, match=r"out\.h5: exists already; --force"):
        open_writer(path)
    partial_path(path).write_text("left over")
    path.unlink()
    with pytest.raises(ResultsError, match=r"out\.partial\.h5: left by an unfinished run.*--force"):
        open_writer(path)
    assert partial_path(path).read_text() == "left over"
    write_all(path, force=True)
    assert not partial_path(path).exists()


def test_the_old_file_stays_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = write_all(tmp_path / "out.h5")
    with open_writer(path, force=True) as writer:
        with open_results(path) as results:
            assert results.complete
        writer.finish("second")
    with open_results(path) as results:
        assert results.stop_reason == "second"


def test_a_run_that_was_taken_for_dead_does_not_put_its_name_on_anothers_file(tmp_path: Path) -> None:
    """Two runs to one file, the second with --force: the partial file is its, and so is the name."""
    path = tmp_path / "out.h5"
    with open_writer(path) as first, open_writer(path, force=True) as second:
        with pytest.raises(RunError, match="another run has taken its place"):
            first.finish("first")
        second.finish("second")
    with open_results(path) as results:
        assert results.stop_reason == "second"


def test_a_folder_that_is_missing_or_the_target_itself(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match=r"the folder .*nowhere does not exist"):
        open_writer(tmp_path / "nowhere" / "out.h5")
    with pytest.raises(ResultsError, match="is a folder"):
        open_writer(tmp_path)
    (tmp_path / "out.partial.h5").mkdir()
    with pytest.raises(ResultsError, match=r"cannot be written \(Is a directory\)"):
        open_writer(tmp_path / "out.h5", force=True)


FULL = """
import resource, signal, sys
from pathlib import Path
sys.path[:0] = {path!r}
from results_samples import *
from dem_cli.errors import RunError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (6_000_000, 6_000_000))
try:
    with open_writer(Path({target!r})) as writer:
        for k in range(10**6):
            writer.append_series(series_row(k), np.zeros(3))
            writer.append_frame(some_frame(k, PAIRS[k % 4]), coordination(k), stress(k))
            if k % 10 == 9:
                writer.flush()
except RunError as error:
    print(error)
"""


def test_a_full_disk_is_one_clear_line_and_leaves_what_was_written(tmp_path: Path) -> None:
    """A limit on the size of files fails like a full disk."""
    code = FULL.format(path=[str(Path(__file__).parent), os.getcwd()], target=str(tmp_path / "out.h5"))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.count("\n") == 1, done.stderr
    assert "out.partial.h5: cannot write (File too large). What was written" in done.stdout
    assert (done.returncode, done.stderr) == (0, "")
    with open_results(tmp_path / "out.partial.h5") as results:
        assert results.n_frames >= 10
        k = results.n_frames - 1
        assert same_arrays(some_frame(k, PAIRS[k % 4]).grains, results.frame(k).grains)


def test_a_disk_that_is_nearly_full_stops_the_run_before_hdf5_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "out.h5"
    writer = open_writer(path)
    writer.append_series(series_row(0), np.zeros(3))
    writer.flush()
    usage = run_file.shutil.disk_usage(tmp_path)._replace(free=1000)
    monkeypatch.setattr(run_file.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(RunError, match=r"out\.partial\.h5: cannot write \(No space left on device\)"):
        writer.append_frame(some_frame(0, PAIRS[0]), coordination(0), stress(0))
    writer.finish("too late")  # nothing more is written and nothing is raised
    with open_results(partial_path(path)) as results:
        assert (results.series.rows, results.n_frames, results.complete) == (1, 0, False)
    with pytest.raises(ResultsError, match=r"cannot be written \(No space left on device\)"):
        open_writer(tmp_path / "second.h5")
    assert not partial_path(tmp_path / "second.h5").exists()


@pytest.mark.parametrize(
    ("attrs", "words"),
    [
        ({}, "not a result file of dem-cli"),
        ({"format": "something else", "format_version": 1}, "not a result file of dem-cli"),
        ({"format": "dem-cli results", "format_version": FORMAT_VERSION + 1}, "newer dem-cli .*update"),
        ({"format": "dem-cli results"}, "is damaged"),
        ({"format": "dem-cli results", "format_version": 1}, "is damaged"),
    ],
)
def test_other_hdf5_files_are_refused(tmp_path: Path, attrs: dict[str, Any], words: str) -> None:
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file.attrs.update(attrs)
    with pytest.raises(ResultsError, match=words) as caught:
        open_results(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_hdf5(tmp_path: Path, done: Path) -> None:
    garbage = tmp_path / "garbage.h5"
    garbage.write_bytes(b"\x00garbage" * 500)
    with pytest.raises(ResultsError, match="no HDF5 file at all"):
        open_results(garbage)
    garbage.write_bytes(b"")
    with pytest.raises(ResultsError, match="no HDF5 file at all"):
        open_results(garbage)
    garbage.write_bytes(done.read_bytes()[:20_000])
    with pytest.raises(ResultsError, match="is damaged"):
        open_results(garbage)
    with pytest.raises(ResultsError, match="no such file"):
        open_results(tmp_path / "none.h5")
    with pytest.raises(ResultsError, match="no such file"):
        open_results(tmp_path)
