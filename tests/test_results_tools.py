"""Result files in the hands of others: ParaView's reader, xarray and pandas."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from results_samples import (
    PAIRS,
    N,
    box,
    coordination,
    no_walls,
    open_writer,
    same_arrays,
    series_row,
    some_contacts,
    some_frame,
    some_grains,
    stress,
    write_all,
)

from dem_cli.results import open_results
from dem_cli.results.schema import CELL_DATA, POINT_DATA, SERIES
from dem_cli.state import Energy, Frame, Grains, Walls


@pytest.fixture
def done(tmp_path: Path) -> Path:
    return write_all(tmp_path / "out.h5")


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
