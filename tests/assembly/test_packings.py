"""Every packing of every shape: nothing overlaps, the void ratio is the one asked for or said, and the same seed repeats it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from packing_samples import METHODS, SHAPES, packing, solid, top, worst_overlap

from dem_cli.assembly import build_assembly, build_loose
from dem_cli.errors import ScenarioError
from dem_cli.state import Grains


def arrays(grains: Grains) -> list[bytes]:
    return [a.tobytes() for a in (grains.x, grains.y, grains.angle, grains.a, grains.b, grains.body)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("method", METHODS)
def test_grains_lie_apart_between_the_walls(method: str, shape: str) -> None:
    scenario = packing(method, SHAPES[shape])
    said: list[str] = []
    assembly = build_assembly(scenario, said.append)
    assert assembly.grains.grain_count == 60
    assert assembly.warnings == ()
    height = top(assembly)
    assert worst_overlap(assembly, 0.2, height * (1.0 + 1e-12)) <= 1e-15
    reached, over = (float(said[-1].split(word)[1].split()[0]) for word in ("void ratio ", "height of "))
    assert said[-1].startswith(f"{method}: void ratio ")
    assert 0.2 * over / solid(scenario, assembly) - 1.0 == pytest.approx(reached, abs=2e-3)
    assert over * 0.85 < height <= over * 1.001
    densest = {"falling": 1.99, "rejection": 1.19, "local-move": 0.2, "growth": 0.1, "insertion": 0.24}[method]
    loosest = {"falling": 2.01, "rejection": 1.3, "local-move": 1.0, "growth": 0.5, "insertion": 0.5}[method]
    assert densest < reached < loosest


@pytest.mark.parametrize("method", METHODS)
def test_same_seed_same_bits(method: str) -> None:
    changes = {**SHAPES["discs and ellipses"], "grains.count": 30, "seed": 5}
    one, two = (arrays(build_assembly(packing(method, changes)).grains) for _ in range(2))
    assert one == two
    other = arrays(build_assembly(packing(method, {**changes, "seed": 6})).grains)
    assert one[0] != other[0]


@pytest.mark.parametrize("method", METHODS)
def test_sizes_do_not_depend_on_the_packing(method: str) -> None:
    """Those of `dem check`, which packs nothing, are those of the run."""
    scenario = packing(method, SHAPES["ellipses"])
    loose, packed = build_loose(scenario).grains, build_assembly(scenario).grains
    for name in ("radius", "mass", "inertia", "a", "b", "body"):
        assert np.array_equal(getattr(loose, name), getattr(packed, name)), name
    assert not loose.x.any()


@pytest.mark.parametrize("method", ["rejection", "growth", "insertion", "local-move"])
@pytest.mark.parametrize("target", [{"void_ratio": 1.5}, {"void_ratio": 0.6}, {"height": "12 cm"}])
def test_what_is_asked_for_is_filled(method: str, target: dict[str, Any]) -> None:
    """The region's height is that of the void ratio: no grain is above it, and a grain is near it."""
    if method == "rejection" and target == {"void_ratio": 0.6}:
        return  # beyond what it can reach: below
    scenario = packing(method, {"packing": {"method": method, **target}})
    assembly = build_assembly(scenario)
    wanted = 0.12 if "height" in target else (1.0 + float(target["void_ratio"])) * solid(scenario, assembly) / 0.2
    assert wanted - 0.02 < top(assembly) <= wanted * (1.0 + 1e-12)
    assert assembly.warnings == ()


@pytest.mark.parametrize(
    ("method", "void_ratio", "least", "remedy"),
    [
        ("rejection", 0.3, 0.4, "growth"),
        ("local-move", 0.1, 0.2, "sweeps"),
        ("growth", 0.05, 0.15, "jammed"),
        ("insertion", 0.05, 0.15, "jammed"),
        ("falling", 0.3, 0.4, "looser"),
    ],
)
def test_what_cannot_be_reached_is_said(method: str, void_ratio: float, least: float, remedy: str) -> None:
    scenario = packing(method, {"packing": {"method": method, "void_ratio": void_ratio}})
    assembly = build_assembly(scenario)
    (warning,) = assembly.warnings
    assert warning.startswith(f"packing: method {method} reached a void ratio of 0.")
    assert f"{void_ratio:g} was asked for" in warning
    assert remedy in warning
    reached = float(warning.split("ratio of ")[1].split(",")[0])
    assert reached > least
    assert top(assembly) <= (1.0 + reached) * solid(scenario, assembly) / 0.2 * 1.001
    assert worst_overlap(assembly, 0.2, top(assembly) * (1.0 + 1e-12)) <= 1e-15


@pytest.mark.parametrize("method", ["rejection", "growth", "insertion", "falling"])
def test_a_lid_is_not_passed(method: str) -> None:
    """A lid that leaves a void ratio of 0.1 is too low; one above the densest packing bounds a packing's own height."""
    area = solid(packing(method), build_loose(packing(method)))
    lid = {"container.lid": True, "container.height": f"{1.1 * area / 0.2} m"}
    with pytest.raises(
        ScenarioError, match=rf"\[packing\] method = {method}: the grains do not fit: .*0\.1\. Raise the lid"
    ):
        build_assembly(packing(method, lid))
    room = 1.5 if method in ("growth", "insertion") else 2.1
    under = {"container.lid": True, "container.height": f"{room * area / 0.2} m"}
    assert top(build_assembly(packing(method, under))) <= room * area / 0.2


def test_local_moves_begin_at_a_grid_that_is_given() -> None:
    """One sweep moves each grain by less than half a mean radius; discs do not turn."""
    grid = {"columns": 9, "spacing": "2.1 cm", "shift": "1 cm"}
    scenario = packing("local-move", {"packing": {"method": "local-move", "grid": grid, "sweeps": 1}})
    grains = build_assembly(scenario).grains
    row, column = np.divmod(np.arange(60), 9)
    x, y = (column + 0.5) * 0.021 + (row % 2) * 0.01, (row + 0.5) * 0.021
    moved = np.hypot(grains.x - x, grains.y - y)
    assert 0.0 < moved.max() < 0.05
    assert np.count_nonzero(moved == 0.0) < 60
    assert not grains.angle.any()


def test_more_sweeps_pack_more_densely() -> None:
    heights = [
        top(build_assembly(packing("local-move", {"packing": {"method": "local-move", "sweeps": n}})))
        for n in (1, 50, 2000)
    ]
    assert heights[0] > 1.1 * heights[1] > 1.2 * heights[2]


def test_rejection_keeps_orientations_and_fills_the_region() -> None:
    changes = {"grains.shape": "ellipse", "grains.aspect_ratio": 3.0, "grains.orientation": "20 deg"}
    grains = build_assembly(packing("rejection", changes)).grains
    assert set(grains.angle) == {np.deg2rad(20.0)}
    assert np.ptp(grains.x) > 0.15
    assert 0.0 < grains.y.min() < 0.02
