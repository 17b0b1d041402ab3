"""`dem export`: surfaces for ParaView and STL, read back by VTK's reader and by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import impulse_runs as made
import numpy as np
import pytest
from click.testing import CliRunner, Result
from results_samples import write_all as write_grains

from dem_cli.analysis.placed import extent
from dem_cli.cli import main
from dem_cli.report.surfaces import surface_of
from dem_cli.results import BodyResults, open_results


@pytest.fixture(scope="module")
def rocks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.rockfall_file(tmp_path_factory.mktemp("run") / "rocks.h5", n=8)


def dem(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(part) for part in arguments])


def test_vtk_shows_the_bodies_at_every_frame(rocks: Path, tmp_path: Path) -> None:
    """Forwards and back: the corners of each body's triangles reach as far as the body does."""
    support = pytest.importorskip("vtkmodules.util.numpy_support")
    reader = pytest.importorskip("vtkmodules.vtkIOHDF").vtkHDFReader()
    target = tmp_path / "out.vtkhdf"
    done = dem("export", rocks, "--to", "vtk", "-o", target)
    assert (done.exit_code, done.stdout.strip()) == (0, str(target)), done.stderr
    reader.SetFileName(str(target))
    reader.UpdateInformation()
    with open_results(rocks) as results:
        assert isinstance(results, BodyResults)
        assert reader.GetNumberOfSteps() == results.n_frames
        for k in (0, results.n_frames - 1, 3, 1):
            reader.SetStep(k)
            reader.Update()
            data: Any = reader.GetOutputDataObject(0)
            bodies = results.frame(k).bodies
            low, high = extent(bodies, results.scene_shapes)
            cells = 4 * 12 + 4 * 2 * 320
            assert data.GetNumberOfPolys() == data.GetNumberOfCells() == cells + 960
            xyz = support.vtk_to_numpy(data.GetPoints().GetData())
            corners = support.vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3)
            column = {
                name: support.vtk_to_numpy(data.GetCellData().GetArray(name))
                for name in ("body", "kind", "speed", "escaped")
            }
            for n in range(8):
                mine = corners[column["body"] == n]
                assert len(mine) == (640 if n % 2 else 12)
                close = 0.03 if n % 2 else 1e-12  # an icosphere lies within its sphere
                assert xyz[mine].min(axis=(0, 1)) == pytest.approx(low[n], abs=close)
                assert xyz[mine].max(axis=(0, 1)) == pytest.approx(high[n], abs=close)
                assert set(column["kind"][column["body"] == n]) == {n % 2}
                assert column["speed"][column["body"] == n][0] == pytest.approx(np.linalg.norm(bodies.v[n]), rel=1e-6)
                assert set(column["escaped"][column["body"] == n]) == {int(bodies.escaped[n])}
            hill = corners[column["body"] == -1]
            assert np.array_equal(xyz[hill], made.hill().vertices[made.hill().triangles])


def test_stl_of_each_shape(rocks: Path, tmp_path: Path) -> None:
    done = dem("export", rocks, "--to", "stl", "-o", tmp_path / "stl")
    assert done.exit_code == 0
    assert [Path(line).name for line in done.stdout.split()] == ["0-box.stl", "1-pair.stl", "terrain-hill.stl"]
    data = (tmp_path / "stl" / "0-box.stl").read_bytes()
    assert (len(data), int.from_bytes(data[80:84], "little")) == (84 + 50 * 12, 12)
    rows = np.frombuffer(data[84:], dtype=[("numbers", "<f4", (4, 3)), ("none", "<u2")])["numbers"]
    a, b, c = rows[:, 1], rows[:, 2], rows[:, 3]
    assert np.einsum("tk,tk->t", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(1.0 * 0.8 * 0.6, rel=1e-5)
    assert np.einsum("tk,tk->t", rows[:, 0], np.cross(b - a, c - a)).min() > 0.0


def test_surfaces_of_clumps_are_spheres() -> None:
    from scene_samples import pair_shape

    points, triangles = surface_of(pair_shape(0.5))
    assert (len(points), len(triangles), triangles.max()) == (324, 640, 323)
    assert np.linalg.norm(points[:162] - [-0.5, 0, 0], axis=1) == pytest.approx(np.full(162, 0.5))


def test_nothing_is_overwritten_and_grains_are_refused(rocks: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.vtkhdf"
    target.write_text("mine")
    refused = dem("export", rocks, "--to", "vtk", "-o", target)
    assert (refused.exit_code, target.read_text()) == (2, "mine")
    assert "exists" in refused.stderr
    assert dem("export", rocks, "--to", "vtk", "-o", target, "--force").exit_code == 0
    assert dem("export", rocks, "--to", "vtk", "-o", tmp_path / "none" / "a.vtkhdf").exit_code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["out.vtkhdf"]
    grains = dem("export", write_grains(tmp_path / "grains.h5"), "--to", "vtk")
    assert (grains.exit_code, "grains in 2D have no surfaces" in grains.stderr) == (2, True)
