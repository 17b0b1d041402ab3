"""The quasi-static scenarios that come along: the numbers of Kishino 1988 in those that say so, and what each is to show."""

from __future__ import annotations

import math
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from dem_cli.assembly import build_assembly
from dem_cli.scenario import Compress, Cyclic, QuasiStaticScenario, Shear, load_scenario

FOLDER = Path(__file__).parent.parent / "scenarios"
DYN = 1e-5  # N
DYN_PER_CM = 1e-3  # N/m
DYN_PER_CM2 = 0.1  # Pa


def shipped(name: str, *overrides: str) -> QuasiStaticScenario:
    scenario = load_scenario(FOLDER / f"{name}.toml", overrides)
    assert isinstance(scenario, QuasiStaticScenario)
    return scenario


def angle(friction: float) -> float:
    return math.degrees(math.atan(friction))


def test_constants_of_the_122_discs() -> None:
    """Kishino 1988, Table 3, at a depth of 1 cm; the counts are the only split of 122 into equal areas."""
    s = shipped("biaxial-kishino")
    grains = build_assembly(s).grains
    sizes, counts = np.unique(2000.0 * grains.radius, return_counts=True)
    assert (sizes.tolist(), counts.tolist()) == ([6.0, 9.0, 12.0], [72, 32, 18])
    areas = [count * size**2 for size, count in zip(sizes, counts, strict=True)]
    assert areas == pytest.approx([areas[0]] * 3)
    assert s.depth == 0.01
    assert s.grains.density * 9.80665 * s.depth == pytest.approx(1500 * DYN / 1e-4, rel=1e-6)
    assert s.container.gravity == 0.0
    assert s.stiffness == (pytest.approx(1e8 * DYN_PER_CM), pytest.approx(7e7 * DYN_PER_CM))
    assert angle(s.contact.friction) == pytest.approx(25.0)
    assert (s.contact.wall_friction.left, s.contact.cohesion) == (0.0, 0.0)
    compress, shear = s.stages
    assert isinstance(compress, Compress)
    assert isinstance(shear, Shear)
    assert compress.stress == pytest.approx(1.5e5 * DYN_PER_CM2)
    assert (shear.hold, shear.axial, shear.shear_strain, shear.increment) == ("mean-stress", "y", 0.03, 0.0005)
    paper = shipped("biaxial-kishino", "solver=kishino", "solver.accuracy=100 dyn").solver
    assert (paper.alpha, paper.alpha_prime, paper.beta, paper.beta_prime) == (0.75, 0.5, 20.0, 20.0)
    assert paper.accuracy == pytest.approx(100 * DYN)


CASES = {1: (1e8, 7e7, 100), 2: (1e8, 7e7, 1), 3: (1e10, 7e9, 100), 4: (1e10, 7e9, 1)}


@pytest.mark.parametrize("case", CASES)
def test_cases_of_the_three_discs(case: int) -> None:
    """Kishino 1988, Table 1, by the switches that the scenario's comments name."""
    kn, ks, accuracy = CASES[case]
    stiff = ("material.normal_stiffness=1e10 dyn/cm", "material.tangential_stiffness=7e9 dyn/cm")
    s = shipped("biaxial-three-discs", *(stiff if case > 2 else ()), *(() if case % 2 else ("solver.accuracy=1 dyn",)))
    text = (FOLDER / "biaxial-three-discs.toml").read_text()
    assert all(switch in text.replace('"', "") for switch in (*stiff, "solver.accuracy=1 dyn"))
    assert s.stiffness == (pytest.approx(kn * DYN_PER_CM), pytest.approx(ks * DYN_PER_CM))
    assert s.solver.accuracy == pytest.approx(accuracy * DYN)
    assert not any(s.contact.wall_friction.model_dump().values())
    compress, shear = s.stages
    assert isinstance(compress, Compress)
    assert isinstance(shear, Shear)
    assert compress.stress == pytest.approx(1.5e5 * DYN_PER_CM2)
    assert (shear.hold, shear.shear_strain, shear.increment) == ("mean-stress", 0.05, 0.0005)


@pytest.mark.parametrize("name", ["biaxial-three-discs", "biaxial-three-discs-wall-friction"])
def test_three_discs_and_walls_touch(name: str) -> None:
    """theta0 = 60 deg, Fig. 5: all contacts are there, and none bears a force."""
    assembly = build_assembly(shipped(name))
    grains, walls = assembly.grains, assembly.walls
    assert grains.radius.tolist() == [0.01] * 3
    for i, j in combinations(range(3), 2):
        distance = math.hypot(grains.x[i] - grains.x[j], grains.y[i] - grains.y[j])
        assert distance == pytest.approx(0.02, rel=1e-14)
    assert walls.x1[1] == pytest.approx(2 * 0.01 * (1.0 + 2.0 * math.cos(math.radians(60.0))), rel=1e-14)
    assert walls.y1[3] == pytest.approx(2 * 0.01 * (1.0 + math.sin(math.radians(60.0))), rel=1e-14)
    assert (grains.x - 0.01).min() == pytest.approx(0.0, abs=1e-17)
    assert (grains.y - 0.01).min() == pytest.approx(0.0, abs=1e-17)


def test_three_discs_between_rough_walls() -> None:
    s = shipped("biaxial-three-discs-wall-friction")
    assert [angle(mu) for mu in s.contact.wall_friction.model_dump().values()] == pytest.approx([5.0] * 4)
    assert angle(s.contact.friction) == pytest.approx(25.0)


@pytest.mark.parametrize(("name", "ratio"), [("loose", 0.10), ("dense", 0.15)])
def test_undrained_cycles(name: str, ratio: float) -> None:
    s = shipped(f"undrained-cyclic-{name}")
    cyclic = s.stages[-1]
    assert isinstance(cyclic, Cyclic)
    assert (cyclic.hold, cyclic.limit.stress_ratio, cyclic.total) == ("volume", ratio, "mean-stress")


def test_loose_is_looser_than_dense() -> None:
    loose, dense = shipped("undrained-cyclic-loose"), shipped("undrained-cyclic-dense")
    assert (loose.packing.void_ratio or 0.0) > (dense.packing.void_ratio or 1.0)
    first, second = loose.stages[0], dense.stages[0]
    assert isinstance(first, Compress)
    assert isinstance(second, Compress)
    assert (first.friction or 0.0) > (second.friction or 1.0)


def test_drained_tests_hold_the_lateral_stress() -> None:
    for name in ("biaxial-2000", "biaxial-membrane"):
        shear = shipped(name).stages[-1]
        assert isinstance(shear, Shear)
        assert shear.hold == "lateral-stress"
    assert shipped("biaxial-2000").grain_count == 2000
    assert shipped("biaxial-membrane").boundary.kind == "membrane"
    assert shipped("biaxial-membrane", "boundary.kind=walls").boundary.radius is None
