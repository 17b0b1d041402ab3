"""Result files: what is written comes back."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from results_samples import (
    PAIRS,
    box,
    coordination,
    open_writer,
    same_arrays,
    series_row,
    some_frame,
    some_grains,
    stress,
    write_all,
)

from dem_cli.results import open_results
from dem_cli.results.provenance import git_revision
from dem_cli.results.schema import SERIES, TRACKS


@pytest.fixture
def done(tmp_path: Path) -> Path:
    return write_all(tmp_path / "out.h5")


def test_frames_come_back_exactly(done: Path) -> None:
    with open_results(done) as results:
        assert results.n_frames == 4
        assert results.frame_times == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=1e-15)
        for k, pairs in enumerate(PAIRS):
            given, found = some_frame(k, pairs), results.frame(k)
            # The static columns are those of the first frame's grains; all grains here have the same.
            assert same_arrays(given.grains, found.grains)
            assert given.contacts is not None
            assert found.contacts is not None
            assert same_arrays(given.contacts, found.contacts)
            for name in ("step", "time", "dt", "stage", "energy", "residual", "energy_in", "unbalanced"):
                assert getattr(given, name) == getattr(found, name), name
            assert (given.stage_start, given.stage_end) == (found.stage_start, found.stage_end)
            assert np.array_equal(given.ground, found.ground)
            assert np.array_equal(found.coordination, coordination(k))
            assert np.array_equal(found.stress, stress(k))
        assert results.frame(-1).step == results.frame(3).step
        with pytest.raises(IndexError):
            results.frame(4)


def test_walls_without_end_come_back_without_end(done: Path) -> None:
    with open_results(done) as results:
        assert results.walls.name == box().name
        for name in ("x0", "y0", "x1", "y1", "friction"):
            assert np.array_equal(getattr(results.walls, name), getattr(box(), name))
        assert (results.width, results.height, results.depth) == (1.0, None, 0.5)


def test_series_tracks_and_surface_come_back(done: Path) -> None:
    with open_results(done) as results:
        assert list(results.series) == list(SERIES)
        assert len(results.series) == len(SERIES)
        for name in SERIES:
            assert np.array_equal(results.series[name], [series_row(k)[name] for k in range(3)])
            assert (results.series.unit(name), results.series.definition(name)) == SERIES[name]
        with pytest.raises(KeyError):
            results.series["nonsense"]
        tracks = results.tracks
        assert tracks is not None
        assert np.array_equal(tracks.ids, [1, 4])
        assert np.array_equal(tracks.time, 0.05 * np.arange(3))
        for name in TRACKS:
            assert np.array_equal(tracks.arrays[name], [getattr(some_grains(k), name)[[1, 4]] for k in range(3)])
        assert np.array_equal(results.surface.x, [0.25, 0.5, 0.75])
        assert np.array_equal(results.surface.eta, [[1 + k, np.nan, 3 + k] for k in range(3)], equal_nan=True)


def test_stages_hold_the_rows_at_their_ends(done: Path) -> None:
    with open_results(done) as results:
        fall, shake = results.stages
    assert (fall.name, fall.kind, fall.start, fall.end, fall.reason) == ("fall", "settle", 0.0, 0.2, "at rest")
    assert fall.before["void_ratio"] == series_row(0)["void_ratio"]  # the first row after the start
    assert fall.after["kinetic"] == series_row(2)["kinetic"]
    assert (shake.name, shake.kind, shake.start, shake.reason) == ("shake it", "shake", 0.2, "")
    assert np.isnan(shake.end)
    assert shake.before == fall.after  # of the same instant
    assert shake.after == {}


def test_a_stage_that_begins_later_waits_for_its_own_row(tmp_path: Path) -> None:
    with open_writer(tmp_path / "out.h5") as writer:
        writer.append_series(series_row(0), np.zeros(3))
        writer.begin_stage("a", "run", 0.1)
        writer.append_series(series_row(1), np.zeros(3))
        writer.end_stage(0.1, "", series_row(1))
        writer.begin_stage("b", "run", 0.7, measures=series_row(5))
        writer.finish("done")
    with open_results(tmp_path / "out.h5") as results:
        assert results.stages[0].before["depth"] == series_row(1)["depth"]
        assert results.stages[1].before["depth"] == series_row(5)["depth"]


def test_provenance_is_complete(done: Path) -> None:
    with open_results(done) as results:
        attrs = results.attrs
        assert results.complete
        assert results.stop_reason == "all stages done"
        assert results.status == "complete: all stages done"
        assert results.scenario == {"title": "test", "seed": 7}
        assert results.warnings == ["first", "zweite: µ"]
    assert attrs["scenario"] == 'title = "test"  # as given\n'
    assert (attrs["scenario_hash"], attrs["seed"], attrs["engine"]) == ("0123456789abcdef", 7, "explicit")
    assert attrs["h5py_version"] == h5py.__version__
    assert attrs["numpy_version"] == np.__version__
    assert attrs["python_version"] == ".".join(map(str, sys.version_info[:3]))
    for name in ("program_version", "numba_version", "platform", "started"):
        assert attrs[name], name
    assert attrs["wall_time"] > 0.0


def test_a_scenario_of_any_length_is_kept(tmp_path: Path) -> None:
    """HDF5 limits the attributes of an object to 64 kB unless they are of variable length."""
    text = "radius = [" + '"1.234567 cm", ' * 20_000 + "]"
    with open_results(write_all(tmp_path / "out.h5", scenario_text=text)) as results:
        assert results.attrs["scenario"] == text


def test_git_revision_only_of_a_checkout_that_tracks_the_package(tmp_path: Path) -> None:
    (tmp_path / "__init__.py").touch()
    assert git_revision(tmp_path) == ""

    def git(*args: str) -> None:
        identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
        subprocess.run(["git", "-C", str(tmp_path), *identity, *args], check=True, capture_output=True)

    git("init")
    assert git_revision(tmp_path) == ""
    git("add", "__init__.py")
    git("commit", "-m", "x")
    clean = git_revision(tmp_path)
    assert len(clean) == 40
    (tmp_path / "__init__.py").write_text("changed")
    assert git_revision(tmp_path) == f"{clean}-dirty"


def test_wrong_rows_are_refused(tmp_path: Path) -> None:
    with open_writer(tmp_path / "out.h5") as writer:
        row = series_row(0)
        del row["depth"]
        with pytest.raises(ValueError, match="depth"):
            writer.append_series(row, np.zeros(3))
        other = some_frame(0, [])
        other.grains.radius[0] *= 2.0
        with pytest.raises(ValueError, match="not those"):
            writer.append_frame(other, coordination(0), stress(0))
