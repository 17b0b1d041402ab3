"""Result files: what is written comes back, from our reader and from the tools that users open it with."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from dem_cli.errors import ResultsError, RunError
from dem_cli.results import ResultWriter, open_results, partial_path
from dem_cli.results import writer as writer_module
from dem_cli.results.provenance import git_revision
from dem_cli.results.schema import CELL_DATA, FORMAT_VERSION, POINT_DATA, SERIES, TRACKS
from dem_cli.state import Contacts, Energy, Floats, Frame, Grains, Ints, Walls

N = 6


def some_grains(seed: int = 1) -> Grains:
    rng = np.random.default_rng(seed)
    grains = Grains.discs(rng.random(N), rng.random(N), np.linspace(0.01, 0.02, N), density=2480.0, depth=1.0)
    for name in ("x", "y", "angle", "vx", "vy", "spin"):
        getattr(grains, name)[:] = rng.normal(size=N)
    grains.escaped[2] = seed % 2 == 0
    return grains


def box(top: float = np.inf) -> Walls:
    """Two side walls (without end by default) and a floor."""
    return Walls(
        name=("left", "right", "bottom"),
        x0=np.array([0.0, 1.0, 0.0]),
        y0=np.array([0.0, 0.0, 0.0]),
        x1=np.array([0.0, 1.0, 1.0]),
        y1=np.array([top, top, 0.0]),
        friction=np.array([0.1, 0.2, 0.3]),
    )


def no_walls() -> Walls:
    none = np.empty(0)
    return Walls(name=(), x0=none, y0=none, x1=none, y1=none, friction=none)


def some_contacts(pairs: list[tuple[int, int]], seed: int = 2) -> Contacts:
    rng = np.random.default_rng(seed)
    i, j = (np.array([pair[k] for pair in pairs], dtype=np.int64) for k in (0, 1))
    numbers = {
        name: rng.normal(size=len(pairs)) for name in ("nx", "ny", "px", "py", "overlap", "normal", "shear", "stretch")
    }
    return Contacts(i=i, j=j, sliding=rng.random(len(pairs)) < 0.5, **numbers)


def some_frame(k: int, pairs: list[tuple[int, int]]) -> Frame:
    rng = np.random.default_rng(100 + k)
    energy = Energy(*rng.normal(size=len(fields(Energy))).tolist())
    return Frame(
        step=1000 * k,
        time=0.1 * k,
        dt=1e-5,
        stage=k // 2,
        grains=some_grains(k),
        ground=rng.normal(size=(3, 2)),
        energy=energy,
        residual=1e-9 * k,
        energy_in=3.0 + k,
        due=frozenset({"frames"}),
        contacts=some_contacts(pairs, seed=k),
        unbalanced=0.01 * k,
        stage_start=k == 0,
        stage_end=k == 2,
    )


# Contacts of each frame: with walls (-1 - w), without any, with grains only.
PAIRS: list[list[tuple[int, int]]] = [[(0, -3), (0, 1), (4, 5)], [], [(1, -1), (1, -3), (2, 3), (3, -2)], [(0, 5)]]


def coordination(k: int) -> Ints:
    return np.arange(N, dtype=np.int64) + k


def stress(k: int) -> Floats:
    return np.arange(4.0 * N).reshape(N, 4) * 0.5 + k


def open_writer(path: Path, **changes: Any) -> ResultWriter:
    arguments: dict[str, Any] = {
        "scenario_text": 'title = "test"  # as given\n',
        "resolved_toml": 'title = "test"\nseed = 7\n',
        "scenario_hash": "0123456789abcdef",
        "seed": 7,
        "engine": "explicit",
        "title": "test",
        "grains": some_grains(),
        "walls": box(),
        "depth": 0.5,
        "container": {"width": 1.0, "height": None},
        "tracks": np.array([1, 4]),
        "surface_x": np.array([0.25, 0.5, 0.75]),
    }
    return ResultWriter(path, **{**arguments, **changes})


def series_row(k: int) -> dict[str, float]:
    return {**{name: 10.0 * k + index for index, name in enumerate(SERIES)}, "time": 0.1 * k}


def write_all(path: Path, **changes: Any) -> Path:
    """Four frames, three series rows, two stages."""
    with open_writer(path, **changes) as writer:
        writer.begin_stage("fall", "settle", 0.0)
        for k in range(3):
            writer.append_series(series_row(k), np.array([1.0, np.nan, 3.0]) + k)
            writer.append_tracks(0.05 * k, some_grains(k))
        writer.end_stage(0.2, "at rest", series_row(2))
        writer.begin_stage("shake it", "shake", 0.2)
        for k, pairs in enumerate(PAIRS):
            writer.append_frame(some_frame(k, pairs), coordination(k), stress(k))
        writer.warn("first")
        writer.warn("zweite: µ")
        writer.finish("all stages done")
    return path


@pytest.fixture
def done(tmp_path: Path) -> Path:
    return write_all(tmp_path / "out.h5")


def same_arrays(a: Any, b: Any) -> bool:
    """Every field equal, bit for bit, and of the same type."""
    return all(
        getattr(a, f.name).dtype == getattr(b, f.name).dtype and np.array_equal(getattr(a, f.name), getattr(b, f.name))
        for f in fields(a)
    )


# --- what is written comes back -------------------------------------------------------------------------------------


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


# --- what other tools see -------------------------------------------------------------------------------------------


def vtk_steps(path: Path, order: list[int]) -> Iterator[tuple[int, Any]]:
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == len(PAIRS)
    for k in order:
        reader.SetStep(k)
        reader.Update()
        yield k, reader.GetOutputDataObject(0)


@pytest.mark.parametrize("walls", [box(), box(top=2.0), no_walls()], ids=["endless", "finite", "none"])
def test_vtk_steps_through_time(tmp_path: Path, walls: Walls) -> None:
    """The reader of ParaView, forwards and back again: a step may not depend on the one read before."""
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    pairs_of = [[(i, j) for i, j in pairs if j >= -len(walls)] for pairs in PAIRS]
    path = tmp_path / "out.h5"
    with open_writer(path, walls=walls) as writer:
        for k, pairs in enumerate(pairs_of):
            writer.append_frame(some_frame(k, pairs), coordination(k), stress(k))
        writer.finish("done")
    for k, data in vtk_steps(path, [0, 1, 2, 3, 1, 3, 0]):
        frame = some_frame(k, pairs_of[k])
        contacts = frame.contacts
        assert contacts is not None
        feet, drawn = int(np.sum(contacts.j < 0)), len(walls)
        lines = max(1, len(contacts) + drawn)
        assert data.GetNumberOfPoints() == N + 2 * drawn + feet
        assert data.GetNumberOfVerts() == N
        assert data.GetNumberOfLines() == lines
        assert data.GetNumberOfCells() == N + lines
        xyz = support.vtk_to_numpy(data.GetPoints().GetData())
        assert np.array_equal(xyz[:N], np.stack([frame.grains.x, frame.grains.y, np.zeros(N)], axis=1))
        assert np.all(np.isfinite(xyz))

        point = {name: support.vtk_to_numpy(data.GetPointData().GetArray(name))[:N] for name in POINT_DATA}
        assert np.array_equal(point["id"], np.arange(N))
        assert np.array_equal(point["radius"], frame.grains.radius)
        assert np.array_equal(point["velocity"], np.stack([frame.grains.vx, frame.grains.vy, np.zeros(N)], axis=1))
        assert np.array_equal(point["coordination"], coordination(k))
        assert np.array_equal(point["escaped"], frame.grains.escaped)
        tensor = point["stress"].reshape(N, 3, 3)
        assert np.array_equal(tensor[:, :2, :2], stress(k).reshape(N, 2, 2))
        assert not tensor[:, 2, :].any()
        assert not tensor[:, :, 2].any()
        assert np.array_equal(point["shape"][:, 0], 2 * frame.grains.radius)
        helpers = support.vtk_to_numpy(data.GetPointData().GetArray("id"))[N:]
        assert np.all(helpers == -1)

        cell = {name: support.vtk_to_numpy(data.GetCellData().GetArray(name)) for name in CELL_DATA}
        assert np.array_equal(cell["normal_force"][N : N + len(contacts)], contacts.normal)
        assert np.array_equal(cell["normal"][N : N + len(contacts), 1], contacts.ny)
        assert np.array_equal(cell["sliding"][N : N + len(contacts)], contacts.sliding)
        assert not cell["normal_force"][:N].any()
        kinds = [0] * N + [2 if j < 0 else 1 for j in contacts.j] + [3] * drawn
        assert np.array_equal(cell["kind"], kinds if len(kinds) > N else [*kinds, 4])

        ends = support.vtk_to_numpy(data.GetLines().GetConnectivityArray()).reshape(-1, 2)[: len(contacts)]
        assert np.array_equal(ends[:, 0], contacts.i)
        assert np.array_equal(ends[contacts.j >= 0, 1], contacts.j[contacts.j >= 0])
        foot = np.stack([contacts.px, contacts.py], axis=1)[contacts.j < 0]
        assert np.array_equal(xyz[ends[contacts.j < 0, 1], :2], foot)


def test_vtk_with_many_grains_and_frames(tmp_path: Path) -> None:
    """Enough rows for several chunks and several flushes; lines vary from step to step."""
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
    rng = np.random.default_rng(0)
    n, path = 1500, tmp_path / "out.h5"
    grains = Grains.discs(rng.random(n), rng.random(n), rng.uniform(0.01, 0.02, n), 2480.0, 1.0)
    counts = [0, 2900, 7, 2500, 0, 1]
    contacts = [some_contacts([(q % n, (q + 1) % n) for q in range(count)], seed=count) for count in counts]
    with open_writer(path, grains=grains, walls=no_walls(), tracks=None) as writer:
        for k, touching in enumerate(contacts):
            frame = Frame(k, 1.0 * k, 1e-5, 0, grains, np.zeros((3, 2)), Energy(), 0.0, 0.0, frozenset(), touching)
            writer.append_frame(frame, np.zeros(n, dtype=np.int64), np.zeros((n, 4)))
            if k % 2:
                writer.flush()
        writer.finish("done")
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(path))
    for k in (5, 0, 1, 2, 3, 4):
        reader.SetStep(k)
        reader.Update()
        data = reader.GetOutputDataObject(0)
        assert data.GetNumberOfLines() == max(1, counts[k])
        force = support.vtk_to_numpy(data.GetCellData().GetArray("normal_force"))
        assert np.array_equal(force[n : n + counts[k]], contacts[k].normal)
        assert not force[:n].any()
        ends = support.vtk_to_numpy(data.GetLines().GetConnectivityArray()).reshape(-1, 2)
        assert np.array_equal(ends[: counts[k], 1], contacts[k].j)
    with open_results(path) as results:
        assert results.tracks is None
        found = results.frame(3).contacts
        assert found is not None
        assert same_arrays(found, contacts[3])


# xarray looks at the whole file and finds that the arrays of /VTKHDF have no axes; that is so and says nothing of /series.
@pytest.mark.filterwarnings("ignore:The 'phony_dims' kwarg now defaults:UserWarning")
def test_xarray_opens_series_tracks_surface_frames_and_stages(done: Path) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(done, group="series", engine="h5netcdf") as data:
        assert dict(data.sizes) == {"time": 3}
        assert set(data.variables) == set(SERIES)
        assert data.void_ratio.dims == ("time",)
        assert data.void_ratio.attrs["units"] == "1"
        assert data.stress_xx.attrs["definition"] == SERIES["stress_xx"][1]
        assert data.kinetic.sel(time=0.2).item() == series_row(2)["kinetic"]
    with xarray.open_dataset(done, group="tracks", engine="h5netcdf") as data:
        assert data.x.dims == ("time", "grain")
        assert data.vx.sel(grain=4).values[1] == some_grains(1).vx[4]
    with xarray.open_dataset(done, group="surface", engine="h5netcdf") as data:
        assert data.eta.dims == ("time", "x")
        assert data.eta.sel(x=0.75).values.tolist() == [3.0, 4.0, 5.0]
    with xarray.open_dataset(done, group="frames", engine="h5netcdf") as data:
        assert data.step.values.tolist() == [0.0, 1000.0, 2000.0, 3000.0]
    with xarray.open_dataset(done, group="stages", engine="h5netcdf") as data:
        assert data.before.sel(quantity="void_ratio").values[0] == series_row(0)["void_ratio"]
        assert list(data.kind.values) == ["settle", "shake"]


def test_pandas_takes_the_series_in_a_plain_loop(done: Path) -> None:
    pandas = pytest.importorskip("pandas")
    with h5py.File(done) as file:
        table = pandas.DataFrame({name: data[:] for name, data in file["series"].items()}).set_index("time")
    assert table.shape == (3, len(SERIES) - 1)
    assert table["kinetic"].iloc[2] == series_row(2)["kinetic"]


# --- unfinished, killed, in use, in the way -------------------------------------------------------------------------


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
    with pytest.raises(type(error)), open_writer(tmp_path / "out.h5") as writer:
        writer.append_series(series_row(0), np.zeros(3))
        raise error
    with open_results(tmp_path / "out.partial.h5") as results:
        assert (results.complete, results.stop_reason, results.series.rows) == (False, reason, 1)


def test_rows_appear_with_a_flush_and_not_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writer_module, "FLUSH_SECONDS", 1e9)

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
        monkeypatch.setattr(writer_module, "FLUSH_BYTES", 3 * 8 * len(SERIES))
        for k in range(1, 4):
            writer.append_series(series_row(k), np.zeros(3))
        assert seen()[0] > 1
        monkeypatch.setattr(writer_module, "FLUSH_SECONDS", 0.0)
        writer.append_series(series_row(4), np.zeros(3))
        assert seen() == (5, 1, 1)


CHILD = """
import sys
from pathlib import Path
sys.path[:0] = {path!r}
from test_results import *
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


def test_a_folder_that_is_missing_or_the_target_itself(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="the folder .*nowhere does not exist"):
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
from test_results import *
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
