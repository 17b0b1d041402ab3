"""Result files of ellipses, bonded discs and clumps: what is written comes back, and ParaView's reader draws it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from results_samples import (
    PAIRS,
    N,
    as_format_1,
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
from shape_samples import in_bodies, some_ellipses, strain, with_shape

from dem_cli.results import open_results
from dem_cli.results.schema import BOND_STRAIN, KIND_BOND, KIND_CONTACT, KIND_NOTHING, KIND_WALL
from dem_cli.state import Bonds, Frame

BODIES = [0, 0, 1, 2, 2, 2]
BONDS = Bonds(
    np.array([0, 3, 4]),
    np.array([1, 4, 5]),
    np.array([1e5, 2e5, 3e5]),
    np.array([4e5, 5e5, 6e5]),
    np.array([0.0, 7.0, 8.0]),
)


def bonded_frame(k: int) -> Frame:
    grains = in_bodies(some_grains(k), BODIES)
    return with_shape(some_frame(k, PAIRS[k]), grains, bonds=strain(BONDS, k))


def write_frames(path: Path, frames: list[Frame], bonds: Bonds | None = None, **changes: Any) -> Path:
    """`flush` after every second frame, so that tables come in pieces."""
    with open_writer(path, grains=frames[0].grains, bonds=bonds, tracks=None, **changes) as writer:
        for k, frame in enumerate(frames):
            n = len(frame.grains)
            writer.append_frame(frame, np.arange(n) + k, np.arange(4.0 * n).reshape(n, 4))
            if k % 2:
                writer.flush()
        writer.finish("done")
    return path


def ellipse_file(path: Path) -> Path:
    return write_frames(path, [with_shape(some_frame(k, p), some_ellipses(k)) for k, p in enumerate(PAIRS)])


def bonded_file(path: Path, **changes: Any) -> Path:
    return write_frames(path, [bonded_frame(k) for k in range(len(PAIRS))], BONDS, **changes)


# ------------------------------------------------------------------------------------------ round trips


def test_ellipses_come_back_exactly(tmp_path: Path) -> None:
    with open_results(ellipse_file(tmp_path / "out.h5")) as results:
        assert (results.grain_count, results.element_count, len(results.bonds)) == (N, N, 0)
        for k in (3, 0, 1, 2):
            found = results.frame(k)
            assert same_arrays(found.grains, some_ellipses(k))
            assert found.bonds is None
            assert same_arrays(found.contacts, some_frame(k, PAIRS[k]).contacts)


def test_bodies_and_bonds_come_back_exactly(tmp_path: Path) -> None:
    with open_results(bonded_file(tmp_path / "out.h5")) as results:
        assert (results.attrs["grains"], results.attrs["elements"]) == (3, 6)
        assert (results.grain_count, results.element_count) == (3, 6)
        assert same_arrays(results.bonds, BONDS)
        for k in (3, 0, 1, 2):
            found = results.frame(k)
            assert same_arrays(found.grains, bonded_frame(k).grains)
            assert same_arrays(found.bonds, strain(BONDS, k))
            assert same_arrays(found.contacts, bonded_frame(k).contacts)
            assert found.energy == bonded_frame(k).energy


def test_discs_have_no_group_of_bonds_and_a_static_shape(tmp_path: Path) -> None:
    path = write_all(tmp_path / "out.h5")
    with h5py.File(path) as file:
        assert "bonds" not in file
        assert len(file["VTKHDF/PointData/shape"]) < 2 * len(file["VTKHDF/PointData/id"])
        assert not file["VTKHDF/Steps/PointDataOffsets/shape"][:].any()
    with open_results(path) as results:
        assert results.attrs["elements"] == results.attrs["grains"] == N
        assert same_arrays(results.bonds, Bonds.none())
        assert results.frame(0).bonds is None


def test_a_frame_of_other_bodies_or_bonds_is_refused(tmp_path: Path) -> None:
    good = bonded_frame(0)
    wrong = [
        replace(good, grains=in_bodies(good.grains, [0, 0, 1, 1, 1, 1])),
        replace(good, grains=replace(good.grains, a=2.0 * good.grains.a)),
        replace(good, bonds=None),
    ]
    with open_writer(tmp_path / "out.h5", grains=good.grains, bonds=BONDS, tracks=None) as writer:
        for frame in wrong:
            with pytest.raises(ValueError, match="not those"):
                writer.append_frame(frame, coordination(0), stress(0))
        writer.append_frame(good, coordination(0), stress(0))
    with (
        open_writer(tmp_path / "none.h5", grains=good.grains, tracks=None) as writer,
        pytest.raises(ValueError, match="not those"),
    ):
        writer.append_frame(good, coordination(0), stress(0))


def test_a_cut_off_run_keeps_its_bonds(tmp_path: Path) -> None:
    """Frames and the strain of their bonds reach the file together."""
    with open_writer(tmp_path / "out.h5", grains=bonded_frame(0).grains, bonds=BONDS, tracks=None) as writer:
        for k in range(3):
            writer.append_frame(bonded_frame(k), coordination(k), stress(k))
        writer.flush()
        with open_results(tmp_path / "out.partial.h5") as results:  # as another process would
            assert results.n_frames == 3
            assert same_arrays(results.frame(2).bonds, strain(BONDS, 2))


# ------------------------------------------------------------------------------------------- old files


def test_a_file_of_format_1_opens(tmp_path: Path) -> None:
    path = write_all(tmp_path / "old.h5")
    as_format_1(path)
    with open_results(path) as results:
        assert (results.grain_count, results.element_count) == (N, N)
        assert same_arrays(results.bonds, Bonds.none())
        frame, given = results.frame(2), some_frame(2, PAIRS[2])
        assert same_arrays(frame.grains, given.grains)
        assert same_arrays(frame.contacts, given.contacts)
        assert frame.energy == replace(given.energy, bonds=0.0)
        assert "bond_gap" not in results.series
        assert results.stages[0].before["depth"] == series_row(0)["depth"]


# ---------------------------------------------------------------------------------- ParaView's reader


def vtk_steps(path: Path, order: list[int]) -> Iterator[tuple[int, Any]]:
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for k in order:
        reader.SetStep(k)
        reader.Update()
        yield k, reader.GetOutputDataObject(0)


def test_vtk_tensors_turn_with_the_ellipses(tmp_path: Path) -> None:
    """Definition: the tensor times the direction of a semi-axis is that direction times the diameter."""
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    for k, data in vtk_steps(ellipse_file(tmp_path / "out.h5"), [0, 2, 3, 1, 0]):
        grains = some_ellipses(k)
        tensor = support.vtk_to_numpy(data.GetPointData().GetArray("shape"))[:N].reshape(N, 3, 3)
        along = np.stack([np.cos(grains.angle), np.sin(grains.angle), np.zeros(N)], axis=1)
        across = np.stack([-along[:, 1], along[:, 0], np.zeros(N)], axis=1)
        for direction, semi_axis in ((along, grains.a), (across, grains.b)):
            image = np.einsum("nij,nj->ni", tensor, direction)
            np.testing.assert_allclose(image, 2.0 * semi_axis[:, None] * direction, atol=1e-7 * grains.a.max())
        assert not tensor[:, 2].any()
        point = {name: support.vtk_to_numpy(data.GetPointData().GetArray(name))[:N] for name in ("a", "b", "body")}
        assert np.array_equal(point["a"], grains.a)
        assert np.array_equal(point["b"], grains.b)
        assert np.array_equal(point["body"], grains.body)


def test_tensor_glyph_draws_the_ellipse(tmp_path: Path) -> None:
    """ParaView's filter with its sphere: the glyph spans what an ellipse of these semi-axes and this angle spans."""
    core = pytest.importorskip("vtkmodules.vtkFiltersCore")
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    sources = pytest.importorskip("vtkmodules.vtkFiltersSources")
    grains = some_ellipses(0, 1)
    one = replace(grains, a=np.array([0.06]), b=np.array([0.02]), angle=np.array([0.5]))
    path = write_frames(tmp_path / "out.h5", [with_shape(some_frame(0, []), one, some_contacts([]))], walls=no_walls())
    ((_, data),) = vtk_steps(path, [0])
    data.GetPointData().SetActiveTensors("shape")
    sphere = sources.vtkSphereSource()  # of diameter 1, as ParaView's
    sphere.SetThetaResolution(90)
    sphere.SetPhiResolution(90)
    glyph = core.vtkTensorGlyph()
    glyph.SetInputData(data)
    glyph.SetSourceConnection(sphere.GetOutputPort())
    glyph.ColorGlyphsOff()
    glyph.Update()
    x0, x1, y0, y1, _, _ = glyph.GetOutput().GetBounds()
    c, s = np.cos(0.5), np.sin(0.5)
    half = np.hypot(0.06 * c, 0.02 * s), np.hypot(0.06 * s, 0.02 * c)
    assert (x1 - x0, y1 - y0) == pytest.approx((2.0 * half[0], 2.0 * half[1]), rel=2e-3)
    assert (x0 + x1, y0 + y1) == pytest.approx((2.0 * one.x[0], 2.0 * one.y[0]), rel=1e-3)
    points = support.vtk_to_numpy(glyph.GetOutput().GetPoints().GetData())
    top = points[np.argmax(points[:, 1])]
    assert top[0] - one.x[0] == pytest.approx((0.06**2 - 0.02**2) * c * s / half[1], rel=0.1)


@pytest.mark.parametrize("walls", [box(), no_walls()], ids=["walls", "none"])
def test_vtk_reads_bonds_as_lines_of_their_own_kind(tmp_path: Path, walls: Any) -> None:
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    touching = [[(i, j) for i, j in some if j >= -len(walls)] for some in PAIRS]
    frames = [replace(bonded_frame(k), contacts=some_contacts(p, seed=k)) for k, p in enumerate(touching)]
    path = write_frames(tmp_path / "out.h5", frames, BONDS, walls=walls)
    for k, data in vtk_steps(path, [0, 1, 2, 3, 1]):
        contacts = frames[k].contacts
        assert contacts is not None
        kind = support.vtk_to_numpy(data.GetCellData().GetArray("kind"))[N:]
        assert np.array_equal(kind[len(contacts) :], [KIND_WALL] * len(walls) + [KIND_BOND] * len(BONDS))
        assert np.count_nonzero(kind == KIND_CONTACT) == np.count_nonzero(contacts.j >= 0)
        ends = support.vtk_to_numpy(data.GetLines().GetConnectivityArray()).reshape(-1, 2)
        assert np.array_equal(ends[kind == KIND_BOND], np.stack([BONDS.i, BONDS.j], axis=1))
        assert support.vtk_to_numpy(data.GetCellData().GetArray("wall"))[N:][kind == KIND_BOND].tolist() == [-1] * 3
        assert not support.vtk_to_numpy(data.GetCellData().GetArray("normal_force"))[N:][kind == KIND_BOND].any()
        assert KIND_NOTHING not in kind


@pytest.mark.filterwarnings("ignore:The 'phony_dims' kwarg now defaults:UserWarning")
def test_xarray_opens_the_bonds(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(bonded_file(tmp_path / "out.h5"), group="bonds", engine="h5netcdf") as data:
        assert data.gap.dims == ("time", "bond")
        assert data["rolling"].dims == ("bond",)
        for name in BOND_STRAIN:
            assert np.array_equal(data[name].values[2], getattr(strain(BONDS, 2), name))
        assert data.slip.attrs["units"] == "m"


def test_tracks_follow_elements(tmp_path: Path) -> None:
    """As in the thesis, which numbers the discs of its pairs: ids are those of discs, whatever they are joined to."""
    moving = bonded_frame(1).grains
    with open_writer(tmp_path / "out.h5", grains=moving, bonds=BONDS, tracks=np.array([1, 0])) as writer:
        writer.append_tracks(0.0, moving)
        writer.finish("done")
    with open_results(tmp_path / "out.h5") as results:
        assert results.tracks is not None
        assert results.tracks.ids.tolist() == [1, 0]
        for name in ("x", "y", "angle", "vx", "vy", "spin"):
            np.testing.assert_array_equal(results.tracks.arrays[name], getattr(moving, name)[[1, 0]][None])
