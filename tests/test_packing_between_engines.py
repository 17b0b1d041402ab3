"""Result files as packings of another engine: the grains lie as they lay, and the box is that of the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from quasi_static_samples import RADIUS, write_test
from quasi_static_text import quick
from results_samples import open_writer, some_frame, stress
from scenario_text import ABSENT, small

from dem_cli.assembly import build_assembly
from dem_cli.errors import ScenarioError
from dem_cli.results import open_results
from dem_cli.scenario import QuasiStaticScenario, Scenario, load_scenario

FROM_FILE = {"grains.count": ABSENT, "grains.radius": ABSENT}
GRAINS = 20  # of the quasi-static sample


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A quasi-static test between walls, one in a ring, and a run of the explicit engine."""
    place = tmp_path_factory.mktemp("files")
    write_test(place / "walls.h5")
    write_test(place / "ring.h5", ring=True)
    _write_explicit(place / "explicit.h5")
    return place


def _write_explicit(path: Path) -> None:
    resolved = 'title = "x"\nengine = "explicit"\n[grains]\nshape = "disc"\n'
    with open_writer(path, resolved_toml=resolved, container={"width": 0.3, "height": None}) as writer:
        frame = some_frame(0, [])
        writer.begin_stage("fall", "settle", 0.0)
        writer.append_frame(frame, np.zeros(len(frame.grains), dtype=np.int64), stress(0)[: len(frame.grains)])
        writer.finish("all stages are done")


def of_file(
    folder: Path, text: Any, name: str, changes: dict[str, Any] | None = None
) -> Scenario | QuasiStaticScenario:
    packing = {"packing": {"method": "file", "file": name}}
    (folder / "case.toml").write_text(text({**FROM_FILE, **packing, **(changes or {})}))
    return load_scenario(folder / "case.toml")


@pytest.mark.parametrize("name", ["walls.h5", "ring.h5"])
@pytest.mark.parametrize("stage", [None, "compress"])
def test_quasi_static_file_in_a_quasi_static_test(folder: Path, name: str, stage: str | None) -> None:
    """The box is that of the frame, not of the start of the run; boundary grains are left out. There is no need to compress it first."""
    changes: dict[str, Any] = {"stage": [{"kind": "shear", "hold": "mean-stress", "shear_strain": 0.01}]}
    if stage:
        changes["packing.stage"] = stage
    scenario = of_file(folder, quick, name, changes)
    assembly = build_assembly(scenario)
    assert scenario.grain_count == len(assembly.grains) == GRAINS
    with open_results(folder / name) as results:
        ends = [k for k in range(results.n_frames) if results.increment(k).stage_end]
        frame = results.increment(ends[0] if stage else -1)
    kept = frame.grains.x[:GRAINS], frame.grains.y[:GRAINS]
    left = 0.0 if name == "walls.h5" else float(np.min(kept[0])) - RADIUS
    floor = 0.0 if name == "walls.h5" else float(np.min(kept[1])) - RADIUS
    np.testing.assert_array_equal(assembly.grains.x, kept[0] - left)
    np.testing.assert_array_equal(assembly.grains.y, kept[1] - floor)
    width, height = assembly.walls.x1[1], assembly.walls.y1[3]
    if name == "walls.h5":
        assert (width, height) == (frame.walls.x1[1], frame.walls.y1[3])
        assert stage or height < 0.99 * 8.0 * RADIUS  # it has been sheared by 3 %
    else:
        assert width == pytest.approx(np.ptp(kept[0]) + 2.0 * RADIUS, rel=1e-12)
        assert height == pytest.approx(np.ptp(kept[1]) + 2.0 * RADIUS, rel=1e-12)


def test_walls_that_have_moved_are_the_origin(folder: Path, tmp_path: Path) -> None:
    """Left wall and floor need not be at 0 in the file: everything shifted by (3 cm, -1 cm) is the same packing."""
    (tmp_path / "walls.h5").write_bytes((folder / "walls.h5").read_bytes())
    with h5py.File(tmp_path / "walls.h5", "r+") as file:
        file["VTKHDF/Points"][:, 0] += 0.03
        file["VTKHDF/Points"][:, 1] -= 0.01
    for text in (quick, small):
        changes = {"container.width": ABSENT} if text is small else {}
        here, there = (build_assembly(of_file(place, text, "walls.h5", changes)) for place in (folder, tmp_path))
        np.testing.assert_allclose(there.grains.x, here.grains.x, rtol=0, atol=1e-15)
        np.testing.assert_allclose(there.grains.y, here.grains.y, rtol=0, atol=1e-15)
        np.testing.assert_allclose(there.walls.x1, here.walls.x1, rtol=0, atol=1e-15)


def test_quasi_static_file_in_explicit_dem(folder: Path) -> None:
    """The width is that of the file unless it is given."""
    scenario = of_file(folder, small, "walls.h5", {"container.width": ABSENT})
    assert isinstance(scenario, Scenario)
    with open_results(folder / "walls.h5") as results:
        width = results.increment(-1).walls.x1[1]
    assert scenario.container.width == width
    assembly = build_assembly(scenario)
    assert assembly.walls.name == ("left", "right", "bottom")
    assert assembly.walls.x1[1] == width
    assert len(assembly.grains) == GRAINS
    assert of_file(folder, small, "walls.h5").to_dict()["container"]["width"] == "0.3 m"
    again = of_file(folder, small, "walls.h5", {"container": ABSENT})
    assert again.container.width == width
    again = of_file(folder, small, "walls.h5", {"container.width": ABSENT})
    assert again.hash == scenario.hash


def test_explicit_file_in_a_quasi_static_test(folder: Path) -> None:
    """As wide as the container, as high as the highest grain; velocities are left behind, and it must be compressed first."""
    assembly = build_assembly(of_file(folder, quick, "explicit.h5"))
    with open_results(folder / "explicit.h5") as results:
        grains = results.frame(-1).grains
    inside = ~grains.escaped.astype(bool)
    assert assembly.walls.x1[1] == 0.3
    assert assembly.walls.y1[3] == np.max((grains.y + grains.a)[inside])
    np.testing.assert_array_equal(assembly.grains.x, grains.x[inside])
    assert not np.any([assembly.grains.vx, assembly.grains.vy, assembly.grains.spin])
    with pytest.raises(
        ScenarioError, match=r"\[\[stage\]\] 1 \(shear\) hold = .*nothing has compressed the sample before"
    ):
        of_file(folder, quick, "explicit.h5", {"stage": [{"kind": "shear", "hold": "volume", "shear_strain": 0.01}]})


def test_width_is_needed_where_the_file_cannot_be_read(folder: Path) -> None:
    with pytest.raises(ScenarioError, match=r"(?s)container\] width: is missing.*none.h5.*does not exist"):
        of_file(folder, small, "none.h5", {"container.width": ABSENT})
