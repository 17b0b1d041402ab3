"""Result files as xarray datasets: the numbers of the reader, named axes, labels with units."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quasi_static_samples as quasi
import report_samples as made
import scene_samples as scenes
from shape_samples import shaped

from dem_cli import open_results
from dem_cli.errors import ResultsError
from dem_cli.results.datasets import GROUPS

pytest.importorskip("xarray")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("runs")
    made.make_file(root / "time.h5", interval=0.1, columns=5, rows=5, tracks=(1, 2))
    made.make_file(root / "bonded.h5", interval=0.5, sample=shaped("bonded", 4, 3), tracks=None)
    quasi.write_test(root / "increment.h5")
    scenes.write_all(root / "bodies.h5")
    return root


@pytest.fixture(params=["time", "increment", "bodies"])
def run(folder: Path, request: pytest.FixtureRequest) -> Iterator[Any]:
    with open_results(folder / f"{request.param}.h5") as results:
        yield results


def opened(folder: Path, name: str) -> Any:
    return open_results(folder / f"{name}.h5")


def test_series_have_the_axis_of_the_file(run: Any) -> None:
    data = run.to_xarray()
    assert data.void_ratio.dims == (run.axis,)
    for name in run.series:
        wanted = run.series[name] + (name == "stage")
        np.testing.assert_array_equal(data[name], wanted)
    assert set(data.variables) == set(run.series)
    assert {"stage", run.axis} <= set(data.coords)
    assert data.attrs["title"] == run.title
    assert data.attrs["engine"] == run.attrs["engine"]


def test_labels_of_plots_name_quantity_and_unit(folder: Path) -> None:
    """What xarray writes beside its plots."""
    from matplotlib.figure import Figure

    with opened(folder, "time") as run:
        series, surface = run.to_xarray("series"), run.to_xarray("surface")
    found = []
    for array in (series.elastic_normal, series.void_ratio, surface.eta):
        ax = Figure().add_subplot()
        array.plot(ax=ax)
        found.append((ax.get_xlabel(), ax.get_ylabel()))
    assert found == [("time [s]", "elastic normal [J]"), ("time [s]", "void ratio"), ("x [m]", "time [s]")]
    assert series.void_ratio.attrs["definition"].startswith("voids over solids of the whole fill")


def test_surface_and_tracks(folder: Path) -> None:
    with opened(folder, "time") as run:
        surface, tracks = run.to_xarray("surface"), run.to_xarray("tracks")
        np.testing.assert_array_equal(surface.eta, run.surface.eta)
        np.testing.assert_array_equal(surface.x, run.surface.x)
        assert surface.eta.dims == ("time", "x")
        for name, values in run.tracks.arrays.items():
            np.testing.assert_array_equal(tracks[name], values)
        np.testing.assert_array_equal(tracks.vy.sel(grain=2), run.tracks.arrays["vy"][:, 1])
        assert tracks.spin.attrs["units"] == "rad/s"
    with opened(folder, "bodies") as run:
        tracks = run.to_xarray("tracks")
        np.testing.assert_array_equal(tracks.q2.sel(grain=4), run.tracks.arrays["q2"][:, 1])


def test_dissipation_is_over_increments_and_ranks(folder: Path) -> None:
    with opened(folder, "increment") as run:
        data = run.to_xarray("dissipation")
        np.testing.assert_array_equal(data.share, run.dissipation.share)
        np.testing.assert_array_equal(data.energy.sel(rank=2), run.dissipation.energy[:, 1])
        assert data.share.dims == ("increment", "rank")


def test_stages_hold_measures_before_and_after(run: Any) -> None:
    data = run.to_xarray("stages")
    assert data.sizes == {"stage": len(run.stages), "when": 2}
    assert data.kind.values.tolist() == [stage.kind for stage in run.stages]
    np.testing.assert_array_equal(data.end, [stage.end for stage in run.stages])
    for number, stage in enumerate(run.stages, start=1):
        for side in ("before", "after"):
            for name, value in getattr(stage, side).items():
                np.testing.assert_array_equal(data[name].sel(stage=number, when=side), value)
    assert data.elastic_normal.attrs["units"] == "J" if run.kind != "bodies" else data.kinetic.attrs["units"] == "J"


def test_frames_hold_their_numbers(run: Any) -> None:
    data = run.to_xarray("frames")
    assert data.sizes == {"frame": run.n_frames}
    np.testing.assert_array_equal(data[run.axis], run.frame_times)
    np.testing.assert_array_equal(data.stage, run.frame_stages + 1)
    name = "work"
    energies = [run.frame(k).energy.work for k in range(run.n_frames)]
    np.testing.assert_array_equal(data[name], energies)
    assert len(data.data_vars) > 10


def test_grains_over_frames(run: Any) -> None:
    data = run.to_xarray("grains", frames=[0, -1])
    assert data.x.dims == ("frame", "grain")
    assert data.frame.values.tolist() == [0, run.n_frames - 1]
    for k in (0, run.n_frames - 1):
        frame = run.frame(k)
        one = data.sel(frame=k)
        np.testing.assert_array_equal(one.coordination, frame.coordination)
        assert one[run.axis] == run.frame_times[k]
        if run.kind == "bodies":
            np.testing.assert_array_equal(np.stack([one.x, one.y, one.z], axis=1), frame.bodies.x)
            np.testing.assert_array_equal(np.stack([one[f"q{n}"] for n in range(4)], axis=1), frame.bodies.q)
            np.testing.assert_array_equal(one.vz, frame.bodies.v[:, 2])
            np.testing.assert_array_equal(one.wx, frame.bodies.w[:, 0])
            assert one.kind.values.tolist() == [run.groups[k] for k in frame.bodies.group]
            continue
        for name in ("x", "y", "angle", "vx", "vy", "spin", "escaped", "radius", "mass", "a", "b", "body"):
            np.testing.assert_array_equal(one[name], getattr(frame.grains, name))
        stress = frame.grain_stress if run.axis == "increment" else frame.stress
        np.testing.assert_array_equal(
            np.stack([one[f"stress_{part}"] for part in ("xx", "xy", "yx", "yy")], axis=1), stress
        )
        assert one.stress_xy.attrs["units"] == "Pa"
    assert data.radius.dims == ("grain",) if run.kind != "bodies" else data.mass.dims == ("grain",)


def test_frames_are_chosen(run: Any) -> None:
    last = run.n_frames - 1
    asked: list[tuple[Any, list[int]]] = [
        (None, list(range(last + 1))),
        ([1], [1]),
        (slice(1, None), list(range(1, last + 1))),
    ]
    for frames, wanted in asked:
        assert run.to_xarray("grains", frames=frames).frame.values.tolist() == wanted
    one = run.to_xarray("grains", frames=-1)
    assert one.x.dims == ("grain",)
    assert one.frame == last
    with pytest.raises(ResultsError, match=f"frame {last + 1} is none of its {last + 1}"):
        run.to_xarray("grains", frames=last + 1)
    with pytest.raises(ResultsError, match="series has none"):
        run.to_xarray("series", frames=1)


def test_contacts_are_those_of_one_frame(run: Any) -> None:
    data = run.to_xarray("contacts")
    frame = run.frame(-1)
    c = frame.contacts
    assert data.frame == run.n_frames - 1
    assert data[run.axis] == run.frame_times[-1]
    np.testing.assert_array_equal(data.i, c.i)
    np.testing.assert_array_equal(data.j, c.j)
    np.testing.assert_array_equal(data.sliding, c.sliding)
    assert data.normal_force.attrs["units"] == "N"
    if run.kind == "bodies":
        np.testing.assert_array_equal(np.stack([data.nx, data.ny, data.nz], axis=1), c.normal)
        np.testing.assert_array_equal(data.pz, c.point[:, 2])
        np.testing.assert_array_equal(data.impulse_y, c.impulse[:, 1])
        np.testing.assert_allclose(data.normal_force * frame.dt, (c.impulse * c.normal).sum(axis=1))
    else:
        for name, field in (("normal_force", "normal"), ("shear_force", "shear"), ("stretch", "stretch"), ("py", "py")):
            np.testing.assert_array_equal(data[name], getattr(c, field))
    assert run.to_xarray("contacts", frames=0).sizes["contact"] == len(run.frame(0).contacts)
    with pytest.raises(ResultsError, match="of one frame"):
        run.to_xarray("contacts", frames=[0, 1])


def test_bonds_and_what_they_gave(folder: Path) -> None:
    with opened(folder, "bonded") as run:
        data = run.to_xarray("bonds")
        np.testing.assert_array_equal(data.i, run.bonds.i)
        np.testing.assert_array_equal(data["roll"].isel(frame=-1), run.frame(-1).bonds.roll)
        assert data.gap.dims == ("frame", "bond")
        assert data.normal.attrs["units"] == "N s/m"


def test_what_a_file_has_not_is_one_line(folder: Path) -> None:
    for name, group in (
        ("time", "dissipation"), ("time", "bonds"), ("bonded", "tracks"), ("increment", "surface"), ("bodies", "surface"),
        ("bodies", "bonds"), ("time", "grain"),
    ):  # fmt: skip
        with opened(folder, name) as run, pytest.raises(ResultsError) as told:
            run.to_xarray(group)
        assert "\n" not in str(told.value)
    assert all(group in str(told.value) for group in GROUPS)


def test_datasets_outlive_the_file(folder: Path) -> None:
    with opened(folder, "time") as run:
        groups = {
            group: run.to_xarray(group) for group in ("series", "surface", "tracks", "stages", "grains", "contacts")
        }
    for data in groups.values():
        assert all(np.asarray(variable).size >= 0 for variable in data.variables.values())


def test_xarray_is_asked_for_only_when_needed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import sys, dem_cli; dem_cli.open_results; assert 'xarray' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
    monkeypatch.setitem(sys.modules, "xarray", None)
    with opened(folder, "time") as run, pytest.raises(ResultsError, match=r"pip install 'dem-cli\[notebook\]'"):
        run.to_xarray()
