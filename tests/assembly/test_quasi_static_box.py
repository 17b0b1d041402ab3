"""Where quasi-static tests begin: every packing lies in its box, whose walls touch, have names, and the friction that they are given."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from packing_samples import worst_overlap
from quasi_static_text import quick
from scenario_text import ABSENT

from dem_cli.assembly import Assembly, build_assembly, build_loose
from dem_cli.scenario import QuasiStaticScenario, load_scenario, parse_scenario

METHODS = ("overlapping", "falling", "rejection", "local-move", "growth", "insertion")
USUAL = {"overlapping": 0.28, "falling": 2.0, "rejection": 1.2}


def assembly_of(changes: dict[str, Any] | None = None) -> Assembly:
    return build_assembly(parse_scenario(quick(changes)))


def box_of(assembly: Assembly) -> tuple[float, float]:
    """Width and height, after a look at the walls."""
    walls = assembly.walls
    assert walls.name == ("left", "right", "bottom", "top")
    width, height = walls.x1[1], walls.y1[3]
    assert walls.x0.tolist() == [0.0, width, 0.0, 0.0]
    assert walls.x1.tolist() == [0.0, width, width, width]
    assert walls.y0.tolist() == [0.0, 0.0, 0.0, height]
    assert walls.y1.tolist() == [height, height, 0.0, height]
    return float(width), float(height)


def void_ratio(assembly: Assembly) -> float:
    width, height = box_of(assembly)
    return width * height / float(np.sum(np.pi * assembly.grains.radius**2)) - 1.0


@pytest.mark.parametrize("method", METHODS)
def test_every_packing_lies_in_its_box(method: str) -> None:
    assembly = assembly_of({"packing": {"method": method}})
    grains, (width, height) = assembly.grains, box_of(assembly)
    slack = 1e-9 * width
    assert np.all(grains.x - grains.a > -slack)
    assert np.all(grains.y - grains.a > -slack)
    assert np.all(grains.x + grains.a < width + slack)
    assert np.all(grains.y + grains.a < height + slack)
    assert not np.any([grains.vx, grains.vy, grains.spin])
    if method == "overlapping":
        assert worst_overlap(assembly, width, height) > 0.1 * float(grains.a.mean())
    else:
        assert worst_overlap(assembly, width, height) < slack


@pytest.mark.parametrize(("method", "usual"), USUAL.items())
def test_box_is_square_at_the_usual_void_ratio(method: str, usual: float) -> None:
    assembly = assembly_of({"packing": {"method": method}})
    width, height = box_of(assembly)
    assert width == pytest.approx(height, rel=1e-12)
    assert void_ratio(assembly) == pytest.approx(usual, rel=1e-12)


@pytest.mark.parametrize(("method", "aim"), [("growth", 0.2), ("local-move", 0.2), ("insertion", 0.25)])
def test_as_dense_as_it_gets_is_about_square(method: str, aim: float) -> None:
    """The width is that of a square at a usual void ratio; the ceiling goes where it must, far up for 30 discs."""
    assembly = assembly_of({"packing": {"method": method}})
    width, height = box_of(assembly)
    solid = float(np.sum(np.pi * assembly.grains.radius**2))
    assert width == pytest.approx(math.sqrt((1.0 + aim) * solid), rel=1e-12)
    assert 0.9 < height / width < 1.3


def test_width_and_void_ratio_give_the_height() -> None:
    asked = {"container.width": "20 cm", "packing": {"method": "overlapping", "void_ratio": 0.5}}
    assembly = assembly_of(asked)
    assert box_of(assembly)[0] == 0.2
    assert void_ratio(assembly) == pytest.approx(0.5, rel=1e-12)


def test_height_gives_the_width() -> None:
    assert box_of(assembly_of({"packing": {"method": "overlapping", "height": "7 cm"}})) == (0.07, 0.07)
    assert box_of(assembly_of({"container.width": "5 cm", "packing": {"method": "overlapping", "height": "7 cm"}})) == (
        0.05,
        0.07,
    )


def test_grid() -> None:
    """8 columns of 15 mm and the shift; four rows for 30 grains."""
    grid = {"columns": 8, "spacing": "15 mm", "shift": "3 mm"}
    width, height = box_of(assembly_of({"packing": {"method": "falling", "grid": grid}}))
    assert (width, height) == (pytest.approx(0.123), pytest.approx(0.06))


def test_walls_have_their_friction() -> None:
    assert not assembly_of().walls.friction.any()
    friction = assembly_of({"contact.wall_friction": {"right": "30 deg", "top": 0.5}}).walls.friction
    assert friction.tolist() == [0.0, pytest.approx(1.0 / math.sqrt(3.0)), 0.0, 0.5]


def test_places_follow_the_seed() -> None:
    one, same, other = assembly_of(), assembly_of(), assembly_of({"seed": 4})
    assert one.grains.x.tolist() == same.grains.x.tolist()
    assert one.grains.x.tolist() != other.grains.x.tolist()


def test_overlapping_places_are_even() -> None:
    """Each disc anywhere between the walls: over many, the mean place is the middle and the spread that of an even distribution."""
    assembly = assembly_of({"grains.count": 4000, "grains.radius": "0.1 mm"})
    width, height = box_of(assembly)
    for place, size in ((assembly.grains.x, width), (assembly.grains.y, height)):
        free = (place - 1e-4) / (size - 2e-4)
        assert free.mean() == pytest.approx(0.5, abs=4.0 * math.sqrt(1.0 / 12.0 / 4000.0))
        assert free.var() == pytest.approx(1.0 / 12.0, rel=0.05)
    assert abs(np.corrcoef(assembly.grains.x, assembly.grains.y)[0, 1]) < 0.06


@pytest.mark.parametrize("method", METHODS)
def test_loose_form_knows_grains_and_box(method: str) -> None:
    scenario = parse_scenario(quick({"packing": {"method": method}}))
    loose, packed = build_loose(scenario), build_assembly(scenario)
    assert loose.grains.radius.tolist() == packed.grains.radius.tolist()
    assert box_of(loose)[0] == box_of(packed)[0]
    assert box_of(loose)[1] == pytest.approx(box_of(packed)[1], rel=0.25)


CSV = {
    "grains.count": ABSENT,
    "grains.radius": ABSENT,
    "packing": {"method": "file", "file": "g.csv", "file_unit": "cm"},
}
TEXT = "x,y,r,vx,vy\n-1,5,1,2,3\n2,5.5,0.5,2,3\n"


def of_csv(folder: Path, changes: dict[str, Any]) -> QuasiStaticScenario:
    (folder / "g.csv").write_text(TEXT)
    (folder / "case.toml").write_text(quick({**CSV, **changes}))
    scenario = load_scenario(folder / "case.toml")
    assert isinstance(scenario, QuasiStaticScenario)
    return scenario


def test_walls_touch_the_grains_of_a_file(tmp_path: Path) -> None:
    assembly = build_assembly(of_csv(tmp_path, {}))
    assert box_of(assembly) == (pytest.approx(0.045), pytest.approx(0.02))
    assert assembly.grains.x.tolist() == [pytest.approx(0.01), pytest.approx(0.04)]
    assert assembly.grains.y.tolist() == [pytest.approx(0.01), pytest.approx(0.015)]
    assert not np.any([assembly.grains.vx, assembly.grains.vy])


def test_a_width_leaves_the_grains_of_a_file_where_they_are(tmp_path: Path) -> None:
    assembly = build_assembly(of_csv(tmp_path, {"container.width": "10 cm"}))
    assert box_of(assembly) == (0.1, pytest.approx(0.06))
    assert assembly.grains.x.tolist() == [-0.01, 0.02]
