"""Result files of quasi-static tests: what is written comes back, walls move, ParaView's reader follows them."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from quasi_static_samples import (
    KT,
    box,
    lattice,
    no_slips,
    open_writer,
    series_row,
    shear_test,
    some_slips,
    write_increment,
    write_test,
)
from results_samples import open_writer as open_writer_over_time
from results_samples import same_arrays, write_all

from dem_cli.errors import ResultsError
from dem_cli.results import StoredIncrement, open_results
from dem_cli.results.schema import DISSIPATION, INCREMENTS, RANKS
from dem_cli.results.walls import box_corners
from dem_cli.state import Increment, Slips

NUMBERS = (
    "number", "stage", "in_stage", "width", "height", "area", "boundary", "axial", "balance", "unbalanced", "iterations",
    "sub_steps", "rung", "event", "stage_start", "stage_end", "energy",
)  # fmt: skip


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_test(tmp_path_factory.mktemp("files") / "out.h5", increments=20)


def written(increments: int = 20) -> list[Increment]:
    """The increments that have a frame in the file."""
    return [one for one in shear_test(increments) if one.in_stage > 0 or one.number == 0]


def test_increments_come_back_exactly(done: Path) -> None:
    with open_results(done) as results:
        given = written()
        assert results.axis == "increment"
        assert results.frame_times.tolist() == [one.number for one in given] == list(range(25))
        for k, one in enumerate(given):
            found = results.frame(k)
            assert isinstance(found, StoredIncrement)
            for name in NUMBERS:
                assert getattr(found, name) == getattr(one, name), name
                assert type(getattr(found, name)) is type(getattr(one, name)), name
            assert np.isnan(found.pore_pressure)
            assert same_arrays(found.grains, one.grains)
            assert same_arrays(found.contacts, one.contacts)
            assert np.array_equal(found.contacts.stretch, -found.contacts.shear / KT)
            assert np.array_equal(found.stress, one.stress)
            assert np.array_equal(found.strain, one.strain)
            assert found.walls.name == one.walls.name
            for name in ("x0", "y0", "x1", "y1", "friction"):
                assert np.array_equal(getattr(found.walls, name), getattr(one.walls, name)), name
            assert found.coordination.tolist() == [4] * len(one.grains)
            assert found.grain_stress.shape == (len(one.grains), 4)
            assert results.series["increment"][found.row] == one.number
            assert results.series["in_stage"][found.row] == one.in_stage
        assert results.frame(-1).number == 24
        with pytest.raises(IndexError):
            results.frame(25)
        with pytest.raises(ResultsError, match="are over increment, not over time"):
            results.instant(0)
        with pytest.raises(ResultsError, match="no free surface"):
            _ = results.surface


def test_a_stored_increment_measures_like_the_one_that_was_written(done: Path) -> None:
    with open_results(done) as results:
        found, given = series_row(results.increment(9)), series_row(written()[9])
        del found["largest_share"], given["largest_share"]  # of the ranked contacts only, in the file
        assert found == pytest.approx(given, rel=0.0, abs=0.0, nan_ok=True)
        for name, value in given.items():
            np.testing.assert_equal(results.series[name][results.increment(9).row], value)


def test_series_stages_and_tracks_come_back(done: Path) -> None:
    states = shear_test(20)
    rows = [series_row(one) for one in states]
    with open_results(done) as results:
        assert list(results.series) == list(INCREMENTS)
        for name in INCREMENTS:
            assert np.array_equal(results.series[name], [row[name] for row in rows], equal_nan=True), name
            assert (results.series.unit(name), results.series.definition(name)) == INCREMENTS[name]
        compress, shear = results.stages
        assert (compress.name, compress.kind, compress.start, compress.end) == ("compress", "compress", 0.0, 4.0)
        assert (shear.start, shear.end, shear.reason) == (4.0, 24.0, "shear strain reached")
        assert compress.after["mean_stress"] == rows[4]["mean_stress"]
        assert shear.before["shear_strain"] == 0.0
        assert shear.after["shear_strain"] == rows[-1]["shear_strain"]
        assert set(shear.after) == INCREMENTS.keys() - {"increment", "stage"}
        tracks = results.tracks
        assert tracks is not None
        assert tracks.arrays.keys() == {"x", "y", "angle"}
        assert np.array_equal(tracks.time, [one.number for one in states])
        assert np.array_equal(tracks.arrays["x"], [one.grains.x[[1, 4]] for one in states])
        assert results.warnings == ["the increment passed through a collapse"]
        assert (results.boundary, results.grain_count, results.complete) == (0, 20, True)
        assert results.scenario["engine"] == "granular-element"
    with h5py.File(done) as file:
        assert (file.attrs["axis"], file.attrs["format_version"]) == ("increment", 3)
        assert "surface" not in file
        assert file["stages/start"].attrs["units"] == "1"


def test_the_contacts_that_dissipate_most_are_ranked(done: Path) -> None:
    states = shear_test(20)
    with open_results(done) as results:
        found = results.dissipation
        assert found is not None
        assert np.array_equal(found.increment, [one.number for one in states])
        assert found.rank.tolist() == list(range(1, RANKS + 1))
        for k, one in enumerate(states):
            order = np.argsort(-one.slips.energy)[:RANKS]
            count = len(order)
            assert np.array_equal(found.i[k, :count], one.slips.i[order])
            assert np.array_equal(found.j[k, :count], one.slips.j[order])
            assert np.array_equal(found.energy[k, :count], one.slips.energy[order])
            if count:
                assert found.share[k, 0] == series_row(one)["largest_share"]
                assert np.all(np.diff(found.share[k]) <= 0.0)
            assert np.all(found.i[k, count:] == -1)
            assert np.isnan(found.energy[k, count:]).all()
        last = results.increment(-1).slips
        assert np.array_equal(last.energy, found.energy[-1])
        assert np.array_equal(last.j, found.j[-1])
    with h5py.File(done) as file:
        for name, (unit, definition) in DISSIPATION.items():
            dataset = file["dissipation"][name]
            assert (dataset.attrs["units"], dataset.attrs["definition"]) == (unit, definition)
            assert [dim.keys() for dim in dataset.dims] == [["increment"], ["rank"]]


def test_few_contacts_that_slid_fill_the_first_ranks(tmp_path: Path) -> None:
    first = lattice()
    few = Slips(np.array([3, 1]), np.array([-1, 2]), np.array([1.0, 3.0]))
    with open_writer(tmp_path / "out.h5", first) as writer:
        for k, slips in enumerate([few, no_slips(), some_slips(first.contacts, 1)]):
            write_increment(writer, replace(first, number=k, in_stage=k, slips=slips))
        writer.finish("done")
    with open_results(tmp_path / "out.h5") as results:
        found = results.dissipation
        assert found is not None
        assert found.i[0, :3].tolist() == [1, 3, -1]
        assert found.j[0, :3].tolist() == [2, -1, -1]
        assert found.share[0, :2].tolist() == [0.75, 0.25]
        assert [len(results.increment(k).slips) for k in range(3)] == [2, 0, RANKS]


def test_a_ring_of_boundary_grains_comes_back(tmp_path: Path) -> None:
    path = write_test(tmp_path / "out.h5", increments=5, ring=True)
    with open_results(path) as results:
        found = results.increment(3)
        assert results.boundary == found.boundary == 18
        assert (results.element_count, len(found.grains), len(found.walls)) == (38, 38, 0)
        assert results.series["coordination"][-1] == 4.0


def test_vtk_shows_the_walls_where_they_were(done: Path) -> None:
    """The reader of ParaView, forwards and back again: each step has the walls of its own increment."""
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(done))
    reader.UpdateInformation()
    given = written()
    assert reader.GetNumberOfSteps() == len(given)
    seen = set()
    for k in (0, 1, 5, 12, 24, 3, 0):
        reader.SetStep(k)
        reader.Update()
        data, one = reader.GetOutputDataObject(0), given[k]
        n, contacts = len(one.grains), one.contacts
        xyz = support.vtk_to_numpy(data.GetPoints().GetData())
        assert np.array_equal(xyz[:n, :2], np.stack([one.grains.x, one.grains.y], axis=1))
        w, h = one.width, one.height
        corners = [(0, 0), (0, h), (w, 0), (w, h), (0, 0), (w, 0), (0, h), (w, h)]
        assert np.array_equal(xyz[n : n + 8, :2], corners)
        feet = contacts.j < 0
        assert np.array_equal(xyz[n + 8 :, :2], np.stack([contacts.px, contacts.py], axis=1)[feet])
        kind = support.vtk_to_numpy(data.GetCellData().GetArray("kind"))
        ends = support.vtk_to_numpy(data.GetLines().GetConnectivityArray()).reshape(-1, 2)
        assert np.array_equal(ends[kind[n:] == 3], n + np.arange(8).reshape(4, 2))
        force = support.vtk_to_numpy(data.GetCellData().GetArray("normal_force"))[n : n + len(contacts)]
        assert np.array_equal(force, contacts.normal)
        velocity = support.vtk_to_numpy(data.GetPointData().GetArray("velocity"))
        assert not velocity.any()
        seen.add((w, h))
    assert len(seen) == 6


# xarray looks at the whole file and finds that the arrays of /VTKHDF have no axes; that is so and says nothing of /series.
@pytest.mark.filterwarnings("ignore:The 'phony_dims' kwarg now defaults:UserWarning")
def test_xarray_opens_all_tables(done: Path) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(done, group="series", engine="h5netcdf") as data:
        assert data.stress_ratio.dims == ("increment",)
        assert data.sizes["increment"] == 26
    with xarray.open_dataset(done, group="dissipation", engine="h5netcdf") as data:
        assert data.energy.dims == ("increment", "rank")
        assert data.j.dtype == np.int32
        assert data.share.sel(rank=1).values[-1] == series_row(shear_test(20)[-1])["largest_share"]
    with xarray.open_dataset(done, group="tracks", engine="h5netcdf") as data:
        assert data.x.dims == ("increment", "grain")
    with xarray.open_dataset(done, group="frames", engine="h5netcdf") as data:
        assert data.area.attrs["units"] == "m^2"
    with xarray.open_dataset(done, group="stages", engine="h5netcdf") as data:
        assert data.after.sel(quantity="increment" if "increment" in data.quantity else "in_stage").values[1] == 20.0


@pytest.mark.parametrize("turned", [False, True], ids=["upwards", "downwards"])
def test_the_walls_of_a_box_end_at_its_corners(turned: bool) -> None:
    """Whatever length they are given with: without end, too long, or too short."""
    sample, walls = lattice(), box(0.03, 0.024)
    ends = np.array([[0, 0, 0, 0.024], [0.03, 0, 0.03, 0.024], [0, 0, 0.03, 0], [0, 0.024, 0.03, 0.024]])
    swap = {"x0": "x1", "y0": "y1", "x1": "x0", "y1": "y0"} if turned else {}
    for far in (np.inf, 1.0, 0.01):
        long = replace(
            walls,
            y0=np.where([1, 1, 0, 0], -far, walls.y0),
            y1=np.where([1, 1, 0, 0], far, walls.y1),
            x0=np.where([0, 0, 1, 1], -far, walls.x0),
            x1=np.where([0, 0, 1, 1], far, walls.x1),
        )
        given = replace(long, **{name: getattr(long, other) for name, other in swap.items()})
        found = box_corners(given, sample.grains).reshape(4, 4)
        assert np.array_equal(found, ends[:, [2, 3, 0, 1]] if turned else ends)


def test_two_plates_keep_their_ends_where_there_is_no_corner() -> None:
    sample = lattice()
    plates = replace(
        box(0.03, 0.024),
        name=("bottom", "top"),
        **{name: getattr(box(0.03, 0.024), name)[2:] for name in ("x0", "y0", "x1", "y1", "friction")},
    )
    assert box_corners(plates, sample.grains).ravel().tolist() == [0.0, 0.0, 0.03, 0.0, 0.0, 0.024, 0.03, 0.024]
    endless = replace(plates, x0=np.full(2, -np.inf), x1=np.full(2, np.inf))
    found = box_corners(endless, sample.grains)
    assert np.isfinite(found).all()
    assert found[:, 1].tolist() == [0.0, 0.0, 0.024, 0.024]
    none = replace(plates, name=(), **{f.name: np.empty(0) for f in fields(plates) if f.name != "name"})
    assert box_corners(none, sample.grains).shape == (0, 2)


def test_the_box_of_walls() -> None:
    assert box(0.03, 0.024).box == (0.0, 0.0, 0.03, 0.024)
    only = replace(box(0.03, 0.024), name=("left", "a", "b", "top"))
    assert only.box == (0.0, -np.inf, np.inf, 0.024)


def test_a_run_that_failed_keeps_its_increments(tmp_path: Path) -> None:
    path = write_test(tmp_path / "out.h5", increments=20, stop_after=9)
    assert path.name == "out.partial.h5"
    with open_results(path) as results:
        assert not results.complete
        assert results.series["increment"].tolist() == [0, 1, 2, 3, 4, 4, 5, 6, 7, 8, 9]
        assert results.stages[1].after == {}
        assert np.isnan(results.stages[1].end)


def test_wrong_rows_walls_and_states_are_refused(tmp_path: Path) -> None:
    first = lattice()
    row = series_row(first)
    with open_writer(tmp_path / "out.h5", first) as writer:
        with pytest.raises(ValueError, match="contacts that slid"):
            writer.append_series(row)
        with pytest.raises(ValueError, match="missing or unknown names: porosity"):
            writer.append_series({name: value for name, value in row.items() if name != "porosity"}, slips=no_slips())
        other = replace(first, walls=replace(first.walls, name=("a",), x0=np.zeros(1)))
        with pytest.raises(ValueError, match="walls"):
            writer.append_frame(other, np.zeros(20, dtype=np.int64), np.zeros((20, 4)))
    with pytest.raises(ValueError, match="free surface"):
        open_writer_over_time(tmp_path / "time.h5", surface_x=None)
    assert not (tmp_path / "time.partial.h5").exists()


def test_files_over_time_have_no_dissipation(tmp_path: Path) -> None:
    """They keep the format that they had, and what does not know of the attribute `axis` reads as before."""
    path = write_all(tmp_path / "out.h5")
    with h5py.File(path, "a") as file:
        assert (file.attrs["axis"], file.attrs["format_version"]) == ("time", 2)
        assert "dissipation" not in file
        del file.attrs["axis"], file.attrs["boundary"]
    with open_results(path) as results:
        assert (results.axis, results.boundary, results.dissipation) == ("time", 0, None)
        assert results.frame(1).time == results.instant(1).time == 0.1
        with pytest.raises(ResultsError, match="are over time, not over increment"):
            results.increment(0)
