"""Result files of bodies in 3D: what is written comes back, also to ParaView's reader, and from a run that was cut off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from results_samples import same_arrays
from results_samples import write_all as write_grains
from scene_samples import (
    PAIRS,
    N,
    frame_of,
    moved,
    no_planes,
    open_writer,
    scene_of,
    series_row,
    some_contacts,
    some_frame,
    some_scene,
    write_all,
)

from dem_cli.errors import ResultsError
from dem_cli.results import BodyResults, Results, open_results, partial_path
from dem_cli.results.body_schema import BODY_CELL_DATA, BODY_POINT_DATA, BODY_SERIES, BODY_TRACKS
from dem_cli.rigid import Bodies


@pytest.fixture
def done(tmp_path: Path) -> Path:
    return write_all(tmp_path / "out.h5")


def opened(path: Path) -> BodyResults:
    results = open_results(path)
    assert isinstance(results, BodyResults)
    return results


def test_frames_come_back_exactly(done: Path) -> None:
    with opened(done) as results:
        assert (results.n_frames, results.kind, results.axis) == (4, "bodies", "time")
        assert (results.grain_count, results.attrs["format_version"]) == (N, 4)
        for k, pairs in enumerate(PAIRS):
            given, found = some_frame(k, pairs), results.frame(k)
            assert same_arrays(given.bodies, found.bodies)
            assert given.contacts is not None
            assert same_arrays(given.contacts, found.contacts)
            for name in (
                "step", "time", "dt", "stage", "energy", "residual", "energy_in", "solving", "stage_start", "stage_end",
            ):  # fmt: skip
                assert getattr(given, name) == getattr(found, name), name
            assert np.array_equal(given.ground, found.ground)
        assert results.frame(0).coordination.tolist() == [2, 1, 0, 0, 1]  # two points of one pair are one neighbour
        assert results.frame(2).coordination.tolist() == [0, 2, 1, 3, 1]
        assert results.frame(-1).step == results.frame(3).step
        with pytest.raises(IndexError):
            results.frame(4)


def test_the_scene_comes_back_exactly(done: Path) -> None:
    given = some_scene()
    with opened(done) as results:
        found = results.scene
        assert results.gravity.tolist() == [0.0, 0.0, -9.80665]
        assert not results.has_container
    assert (found.groups, found.materials) == (given.groups, given.materials)
    for name in ("restitution", "friction", "low", "high"):
        assert np.array_equal(getattr(found, name), getattr(given, name)), name
    assert len(found.shapes) == len(given.shapes)
    arrays = ("vertices", "triangles", "centers", "radii", "points", "normals", "trusted", "inertia")
    for a, b in zip(given.shapes, found.shapes, strict=True):
        for name in arrays:
            one, two = getattr(a, name), getattr(b, name)
            assert (one.dtype, one.shape, one.tolist()) == (two.dtype, two.shape, two.tolist()), name
        for name in ("name", "kind", "spacing", "mass", "volume", "reach"):
            assert getattr(a, name) == getattr(b, name), name
    assert found.planes.name == given.planes.name
    for name in ("point", "normal", "material", "edge"):
        assert np.array_equal(getattr(found.planes, name), getattr(given.planes, name)), name
    assert found.terrain is not None
    assert given.terrain is not None
    assert (found.terrain.name, found.terrain.material) == ("hill", 1)
    assert np.array_equal(found.terrain.vertices, given.terrain.vertices)
    assert np.array_equal(found.terrain.triangles, given.terrain.triangles)
    assert same_arrays(found.bodies, some_frame(0, []).bodies)


def test_a_scene_of_bodies_alone_comes_back(tmp_path: Path) -> None:
    given = some_scene()
    alone = scene_of(given.bodies, given.shapes)
    with open_writer(tmp_path / "out.h5", alone, container={"width": 2.0, "breadth": 3.0}, tracks=None) as writer:
        writer.append_frame(frame_of(given.bodies))
        writer.finish("done")
    with opened(tmp_path / "out.h5") as results:
        assert results.terrain is None
        assert len(results.planes) == len(no_planes())
        assert (results.width, results.breadth, results.height, results.has_container) == (2.0, 3.0, None, True)
        assert results.tracks is None
        assert same_arrays(results.frame(0).bodies, given.bodies)


def test_series_tracks_and_stages_come_back(done: Path) -> None:
    with opened(done) as results:
        assert list(results.series) == list(BODY_SERIES)
        for name in BODY_SERIES:
            assert np.array_equal(results.series[name], [series_row(k)[name] for k in range(3)])
            assert (results.series.unit(name), results.series.definition(name)) == BODY_SERIES[name]
        tracks = results.tracks
        assert tracks is not None
        assert tracks.ids.tolist() == [1, 4]
        assert list(tracks.arrays) == list(BODY_TRACKS)
        bodies = [moved(some_scene().bodies, k).take(np.array([1, 4])) for k in range(3)]
        for part, names in (("x", "x y z"), ("q", "q0 q1 q2 q3"), ("v", "vx vy vz"), ("w", "wx wy wz")):
            for column, name in enumerate(names.split()):
                assert np.array_equal(tracks.arrays[name], [getattr(one, part)[:, column] for one in bodies]), name
        fall, go_on = results.stages
        assert (fall.name, fall.kind, fall.end, fall.reason) == ("fall", "settle", 0.2, "at rest")
        assert fall.after["top"] == series_row(2)["top"]
        assert np.isnan(go_on.end)
        assert results.warnings == ["first"]
        with pytest.raises(ResultsError, match="no free surface"):
            _ = results.surface


def test_vtk_steps_through_time(done: Path) -> None:
    """The reader of ParaView, forwards and back again: a step may not depend on the one read before."""
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    reader = pytest.importorskip("vtkmodules.vtkIOHDF").vtkHDFReader()
    reader.SetFileName(str(done))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == len(PAIRS)
    planes = some_scene().planes
    for k in [0, 1, 2, 3, 1, 3, 0]:
        reader.SetStep(k)
        reader.Update()
        data, frame = reader.GetOutputDataObject(0), some_frame(k, PAIRS[k])
        bodies, contacts = frame.bodies, frame.contacts
        assert contacts is not None
        c, feet, edges = len(contacts), contacts.j < 0, 4 * len(planes)
        assert (data.GetNumberOfPoints(), data.GetNumberOfVerts()) == (N + edges + int(feet.sum()), N)
        assert (data.GetNumberOfLines(), data.GetNumberOfCells()) == (c + edges, N + c + edges)
        xyz = support.vtk_to_numpy(data.GetPoints().GetData())
        assert np.array_equal(xyz[:N], bodies.x)
        assert np.array_equal(xyz[N : N + edges], planes.edge.reshape(-1, 3))
        point = {name: support.vtk_to_numpy(data.GetPointData().GetArray(name)) for name in BODY_POINT_DATA}
        cell = {name: support.vtk_to_numpy(data.GetCellData().GetArray(name)) for name in BODY_CELL_DATA}
        for name, want in (("orientation", "q"), ("velocity", "v"), ("angular_velocity", "w"), ("inertia", "inertia")):
            assert np.array_equal(point[name][:N], getattr(bodies, want)), name
        for name in ("id", "group", "shape", "scale", "material", "mass", "escaped"):
            assert np.array_equal(point[name][:N], getattr(bodies, name)), name
        assert np.all(point["id"][N:] == -1)
        assert np.allclose(np.linalg.norm(point["orientation"], axis=1), 1.0)
        assert np.allclose(point["speed"][:N], np.linalg.norm(bodies.v, axis=1))
        at = slice(N, N + c)
        for name, want in (("gap", "gap"), ("normal", "normal"), ("contact_point", "point"), ("impulse", "impulse")):
            assert np.array_equal(cell[name][at], getattr(contacts, want)), name
        along = np.sum(contacts.impulse * contacts.normal, axis=1)
        assert np.allclose(cell["normal_impulse"][at], along)
        assert np.allclose(cell["normal_force"][at], along / frame.dt)
        assert cell["kind"].tolist() == [0] * N + [2 if j < 0 else 1 for j in contacts.j] + [3] * edges
        assert not cell["normal"][:N].any()
        ends = support.vtk_to_numpy(data.GetLines().GetConnectivityArray()).reshape(-1, 2)
        assert np.array_equal(ends[:c, 0], contacts.i)
        assert np.array_equal(ends[:c, 1][~feet], contacts.j[~feet])
        assert np.array_equal(xyz[ends[:c, 1][feet]], contacts.point[feet])
        assert np.array_equal(ends[c : c + 4] - N, [[0, 1], [1, 2], [2, 3], [3, 0]])


def test_a_frame_without_lines_has_one_that_is_none(tmp_path: Path) -> None:
    """A step with no line makes VTK misread the next one."""
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    reader = pytest.importorskip("vtkmodules.vtkIOHDF").vtkHDFReader()
    given = some_scene()
    contacts = [[], [(0, 1)], [], [(2, 3), (0, 4)]]
    with open_writer(tmp_path / "out.h5", scene_of(given.bodies, given.shapes)) as writer:
        for k, pairs in enumerate(contacts):
            writer.append_frame(frame_of(given.bodies, 0.1 * k, some_contacts(pairs, k)))
        writer.finish("done")
    reader.SetFileName(str(tmp_path / "out.h5"))
    for k, pairs in enumerate(contacts):
        reader.SetStep(k)
        reader.Update()
        data = reader.GetOutputDataObject(0)
        kinds = support.vtk_to_numpy(data.GetCellData().GetArray("kind"))
        assert kinds.tolist() == [0] * N + ([1] * len(pairs) or [4])


def test_an_unfinished_run_opens(tmp_path: Path) -> None:
    def cut_off() -> None:
        with open_writer(tmp_path / "out.h5") as writer:
            writer.append_series(series_row(0))
            writer.append_frame(some_frame(0, PAIRS[0]))
            raise RuntimeError("blew up")

    with pytest.raises(RuntimeError, match="blew up"):
        cut_off()
    assert not (tmp_path / "out.h5").exists()
    with opened(partial_path(tmp_path / "out.h5")) as results:
        assert not results.complete
        assert results.stop_reason == "RuntimeError: blew up"
        assert results.n_frames == 1
        assert same_arrays(results.frame(0).bodies, some_frame(0, []).bodies)


def test_a_file_is_read_while_it_grows(tmp_path: Path) -> None:
    with open_writer(tmp_path / "out.h5") as writer:
        writer.append_series(series_row(0))
        writer.append_frame(some_frame(0, PAIRS[0]))
        writer.flush()
        writer.append_frame(some_frame(1, PAIRS[1]))
        with opened(writer.file) as results:
            assert (results.n_frames, len(results.series["time"]), results.complete) == (1, 1, False)
        writer.finish("done")


def test_a_file_without_frames_has_no_scene(tmp_path: Path) -> None:
    with open_writer(tmp_path / "out.h5") as writer:
        writer.finish("done")
    with opened(tmp_path / "out.h5") as results, pytest.raises(ResultsError, match="holds no frame"):
        _ = results.scene


def test_wrong_rows_and_frames_are_refused(tmp_path: Path) -> None:
    with open_writer(tmp_path / "out.h5") as writer:
        row = series_row(0)
        del row["top"]
        with pytest.raises(ValueError, match="top"):
            writer.append_series(row)
        frame = some_frame(0, [])
        other: Bodies = replace(frame.bodies, mass=2.0 * frame.bodies.mass)
        with pytest.raises(ValueError, match="not those"):
            writer.append_frame(replace(frame, bodies=other))
        with pytest.raises(ValueError, match="without contacts"):
            writer.append_frame(replace(frame, contacts=None))


def test_a_newer_format_is_one_clear_line(done: Path) -> None:
    with h5py.File(done, "a") as file:
        file.attrs["format_version"] = 5
    with pytest.raises(ResultsError, match="newer dem-cli"):
        open_results(done)


def test_files_of_grains_are_as_before(tmp_path: Path) -> None:
    """What bodies in 3D brought along is in no file of grains."""
    with open_results(write_grains(tmp_path / "grains.h5")) as results:
        assert type(results) is Results
        assert (results.kind, results.attrs["format_version"]) == ("time", 2)
        names = set(results._file)
    assert names == {"VTKHDF", "frames", "series", "stages", "surface", "tracks", "walls", "warnings"}


@pytest.mark.filterwarnings("ignore:The 'phony_dims' kwarg now defaults:UserWarning")
def test_xarray_opens_series_and_tracks(done: Path) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(done, group="series", engine="h5netcdf") as data:
        assert dict(data.sizes) == {"time": 3}
        assert data.top.attrs["units"] == "m"
    with xarray.open_dataset(done, group="tracks", engine="h5netcdf") as data:
        assert data.q0.dims == ("time", "grain")
    with xarray.open_dataset(done, group="materials", engine="h5netcdf") as data:
        assert data.friction.values.tolist() == [[0.3, 0.6], [0.6, 0.1]]
