"""Elements that grains are built from: sums of mass and inertia, bonds, places and motion, and the order of random draws."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenario_text import ABSENT, small

from dem_cli.assembly import Assembly, build_assembly
from dem_cli.assembly.packing import staggered_grid
from dem_cli.geometry.union import pieces
from dem_cli.scenario import parse_scenario
from dem_cli.state import Grains

RHO, DEPTH = 2480.0, 0.5
ROOM = {"packing.grid": {"columns": 3, "spacing": "20 cm"}, "container.width": "90 cm", "depth": "0.5 m"}


def assembly(shape: str, changes: dict[str, Any] | None = None, folder: Path = Path()) -> Assembly:
    extra = {"aspect_ratio": 2} if shape == "ellipse" and "packing.file" not in (changes or {}) else {}
    keys = {f"grains.{name}": value for name, value in {"shape": shape, **extra}.items()}
    return build_assembly(parse_scenario(small(copy.deepcopy({**ROOM, **keys, **(changes or {})})), folder=folder))


def sums(grains: Grains) -> tuple[np.ndarray, ...]:
    """Mass, centre x, y and moment of inertia about it of each grain, shape (g,) each."""

    def add(values: np.ndarray) -> np.ndarray:
        return np.bincount(grains.body, values)

    mass = add(grains.mass)
    x, y = add(grains.mass * grains.x) / mass, add(grains.mass * grains.y) / mass
    off = (grains.x - x[grains.body]) ** 2 + (grains.y - y[grains.body]) ** 2
    return mass, x, y, add(grains.inertia + grains.mass * off)


def centres(count: int) -> tuple[np.ndarray, np.ndarray]:
    return staggered_grid(count, 3, 0.2, 0.2, 0.1)


def test_discs_are_drawn_as_ever() -> None:
    """To the bit: the only numbers drawn are radii."""
    scenario = parse_scenario(small())
    assert scenario.grains.radius is not None
    radius = scenario.grains.radius.draw(np.random.default_rng(3), 30)
    x, y = staggered_grid(30, 8, 0.03, 0.03, 0.015)
    built = build_assembly(scenario)
    expected = Grains.discs(x, y, radius, RHO, 1.0)
    for name in vars(expected):
        assert np.array_equal(getattr(built.grains, name), getattr(expected, name)), name
    assert (len(built.bonds), built.rigid) == (0, False)


def test_radii_come_first_then_ratios_then_orientations() -> None:
    """So shapes are compared on the same radii, and whatever the ratios, angles are drawn after them."""
    rng = np.random.default_rng(3)
    radius, ratio, angle = rng.uniform(0.005, 0.01, 30), rng.uniform(1.0, 3.0, 30), rng.uniform(0.0, 2.0 * math.pi, 30)
    grains = assembly("ellipse", {"grains.aspect_ratio": {"uniform": [1, 3]}}).grains
    assert np.allclose(grains.radius, radius, rtol=1e-15)
    assert np.allclose(grains.a / grains.b, ratio, rtol=1e-14)
    assert np.array_equal(grains.angle, angle)
    pairs = assembly("bonded").grains
    assert np.array_equal(pairs.radius[::2], radius)


def test_ellipses_have_the_area_of_discs() -> None:
    grains, discs = assembly("ellipse").grains, assembly("disc").grains
    assert np.allclose(grains.mass, discs.mass, rtol=1e-14)
    assert np.allclose(grains.a, math.sqrt(2.0) * discs.radius, rtol=1e-15)
    assert np.allclose(grains.inertia, 0.25 * grains.mass * (grains.a**2 + grains.b**2), rtol=1e-15)
    assert np.array_equal(grains.body, grains.id)


def test_ellipses_of_ratio_one_are_discs() -> None:
    grains, discs = assembly("ellipse", {"grains.aspect_ratio": 1, "grains.orientation": "0 deg"}), assembly("disc")
    for name in vars(discs.grains):
        assert np.array_equal(getattr(grains.grains, name), getattr(discs.grains, name)), name


def test_mixtures_hold_their_shares() -> None:
    mix = [{"ratio": 1, "share": 0.3}, {"ratio": 2, "share": 0.45}, {"ratio": 4, "share": 0.25}]
    grains = assembly("ellipse", {"grains.aspect_ratio": {"mix": mix}, "grains.count": 41}).grains
    ratio = np.round(grains.a / grains.b, 12)
    assert [int(np.sum(ratio == k)) for k in (1.0, 2.0, 4.0)] == [12, 19, 10]
    assert len(set(np.flatnonzero(ratio == 1.0)) - set(range(12))) > 3  # in random order


@pytest.mark.parametrize("shape", ["bonded", "clump"])
def test_pairs_of_the_thesis(shape: str) -> None:
    """Two discs of the grain's radius, each rho pi r^2 L and m r^2/2, that touch at the grain's place."""
    built = assembly(shape)
    grains, (x, y) = built.grains, centres(30)
    assert (len(grains), grains.grain_count, built.rigid) == (60, 30, shape == "clump")
    assert np.array_equal(grains.body, np.repeat(np.arange(30), 2))
    assert np.allclose(grains.mass, RHO * np.pi * grains.radius**2 * DEPTH, rtol=1e-14)
    assert np.allclose(grains.inertia, 0.5 * grains.mass * grains.radius**2, rtol=1e-14)
    first, second = grains.take(np.arange(0, 60, 2)), grains.take(np.arange(1, 60, 2))
    assert np.array_equal(first.radius, second.radius)
    dx, dy = second.x - first.x, second.y - first.y
    assert np.allclose(np.hypot(dx, dy), 2.0 * first.radius, rtol=1e-13)
    assert np.allclose(np.arctan2(dy, dx) % (2 * np.pi), first.angle % (2 * np.pi), atol=1e-12)
    assert np.array_equal(first.angle, second.angle)
    assert np.ptp(first.angle) > 5.0  # random, as the default says
    assert np.allclose([0.5 * (first.x + second.x), 0.5 * (first.y + second.y)], [x, y], atol=1e-15)
    assert len(built.bonds) == (30 if shape == "bonded" else 0)


@pytest.mark.parametrize("shape", ["bonded", "clump"])
def test_one_disc_is_a_disc(shape: str) -> None:
    one = assembly(shape, {"grains.template": {"discs": [{"x": 5, "y": -3, "r": 1}]}, "grains.orientation": "0 deg"})
    disc = assembly("disc").grains
    for name in vars(disc):
        assert np.array_equal(getattr(one.grains, name), getattr(disc, name)), name
    assert len(one.bonds) == 0


def template(rows: list[tuple[float, float, float]]) -> dict[str, Any]:
    return {"discs": [{"x": x, "y": y, "r": r} for x, y, r in rows]}


def grown(steps: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Discs of radius r, each put against the one before it under some angle, between touching and overlapped by half."""
    rows = [(0.3, -0.2, 1.0)]
    for angle, r, depth in steps:
        x, y, last = rows[-1]
        reach = last + r - depth * min(last, r)
        rows.append((x + reach * math.cos(angle), y + reach * math.sin(angle), r))
    return rows


chains = st.lists(st.tuples(st.floats(0.0, 6.2), st.floats(0.3, 1.5), st.floats(0.0, 1.0)), min_size=1, max_size=5).map(
    grown
)


def is_template(rows: list[tuple[float, float, float]]) -> bool:
    x, y, r = np.array(rows).T
    return bool(np.all(pieces(x, y, r).area > 1e-6 * r**2))


@settings(max_examples=40, deadline=None)
@given(chains.filter(is_template), st.booleans())
def test_clumps_add_up_to_the_union_of_their_discs(rows: list[tuple[float, float, float]], equal: bool) -> None:
    """Contract of `Grains`: mass, centre of mass and moment of inertia of the exact union are the sums over the elements."""
    grains = assembly(
        "clump",
        {
            "grains.template": template(rows),
            "grains.equal_area": equal,
            "grains.count": 3,
            "grains.radius": {"list": ["7 mm", "5 mm", "9 mm"]},
            "packing.grid.spacing": "1 m",
            "container.width": "10 m",
        },
    ).grains
    radius = np.array([0.007, 0.005, 0.009])
    mass, x, y, inertia = sums(grains)
    at = np.array(staggered_grid(3, 3, 1.0, 1.0, 0.5))
    assert np.allclose([x, y], at, atol=1e-14)
    assert grains.mass.min() > 0.0
    assert grains.inertia.min() > 0.0
    for k in range(3):
        own = grains.take(grains.body == k)
        area, cx, cy, polar = pieces(own.x, own.y, own.radius).whole
        assert mass[k] == pytest.approx(RHO * DEPTH * area, rel=1e-12)
        assert (cx, cy) == pytest.approx(tuple(at[:, k]), abs=1e-12)
        assert inertia[k] == pytest.approx(RHO * DEPTH * polar, rel=1e-9)
        if equal:
            assert area == pytest.approx(math.pi * radius[k] ** 2, rel=1e-12)


@settings(max_examples=30, deadline=None)
@given(chains.filter(is_template))
def test_bonded_discs_carry_their_own_pieces(rows: list[tuple[float, float, float]]) -> None:
    grains = assembly(
        "bonded",
        {
            "grains.template": template(rows),
            "grains.count": 2,
            "packing.grid.spacing": "40 cm",
            "container.width": "4 m",
        },
    ).grains
    for k in range(2):
        own = grains.take(grains.body == k)
        assert np.allclose(own.mass, RHO * DEPTH * pieces(own.x, own.y, own.radius).area, rtol=1e-9)
    assert np.allclose(grains.inertia, 0.5 * grains.mass * grains.radius**2, rtol=1e-14)
    _, x, y, _ = sums(grains)
    assert np.allclose([x, y], staggered_grid(2, 3, 0.4, 0.4, 0.2), atol=1e-13)


def test_bonds_of_every_grain() -> None:
    """All touching pairs, grain after grain; stiff is 1e5 sqrt(m kn) of the lighter disc, rolling is Cs r_i r_j."""
    rows = [{"x": 0, "r": 1}, {"x": 1.5, "r": 0.5}, {"x": 2.5, "r": 0.5}]
    built = assembly("bonded", {"grains.template": {"discs": rows}, "grains.count": 4})
    bonds, grains = built.bonds, built.grains
    assert bonds.i.tolist() == [0, 1, 3, 4, 6, 7, 9, 10]
    assert bonds.j.tolist() == [1, 2, 4, 5, 7, 8, 10, 11]
    kn = math.pi / 4 * DEPTH * RHO * 150.0**2 * 3.0
    lighter = np.minimum(grains.mass[bonds.i], grains.mass[bonds.j])
    assert np.allclose(bonds.normal, 1e5 * np.sqrt(lighter * kn), rtol=1e-12)
    assert np.array_equal(bonds.tangential, bonds.normal)
    assert np.allclose(bonds.rolling, bonds.tangential * grains.radius[bonds.i] * grains.radius[bonds.j], rtol=1e-15)


def test_bonds_as_given() -> None:
    bond = {"normal": "2e6 N s/m", "tangential": "3 kN s/m", "rolling_viscosity": "7 N m s"}
    square = {"grains.template": {"name": "square", "bonds": [[2, 1], [0, 1], [0, 3]]}, "grains.count": 1}
    bonds = assembly("bonded", {**square, "grains.bond": bond}).bonds
    assert list(zip(bonds.i, bonds.j, strict=True)) == [(0, 1), (0, 3), (1, 2)]
    assert [set(values) for values in (bonds.normal, bonds.tangential, bonds.rolling)] == [{2e6}, {3e3}, {7.0}]
    free = assembly("bonded", {"grains.bond": {"rolling": False}}).bonds
    assert np.all(free.rolling == 0.0)
    assert np.all(free.tangential > 0.0)


FROM_FILE = {
    "grains.count": ABSENT,
    "grains.radius": ABSENT,
    "packing": {"method": "file", "file": "a.csv", "file_unit": "cm"},
}


def test_grains_of_a_file(tmp_path: Path) -> None:
    """A row is a grain, with its own angle (degrees), ratio and spin (rad/s); velocities are those of the rigid motion."""
    (tmp_path / "a.csv").write_text("x,y,r,vx,vy,angle,spin\n10,20,1,3,4,90,5\n30,20,2,0,0,0,0\n")
    for shape in ("bonded", "clump"):
        changes: dict[str, Any] = {**FROM_FILE, "grains.shape": shape}
        grains = build_assembly(parse_scenario(small(changes), folder=tmp_path)).grains
        assert np.allclose(grains.x, [0.10, 0.10, 0.28, 0.32], atol=1e-15)
        assert np.allclose(grains.y, [0.19, 0.21, 0.20, 0.20], atol=1e-15)
        assert np.allclose(grains.vx, [0.03 + 0.05, 0.03 - 0.05, 0, 0], atol=1e-15)
        assert np.allclose(grains.vy, [0.04, 0.04, 0, 0], atol=1e-15)
        assert grains.spin.tolist() == [5, 5, 0, 0]
        assert np.allclose(grains.angle, [math.pi / 2, math.pi / 2, 0, 0])
    (tmp_path / "a.csv").write_text("x,y,r,aspect,angle\n10,20,1,4,30\n30,20,2,1,0\n")
    grains = build_assembly(parse_scenario(small({**FROM_FILE, "grains.shape": "ellipse"}), folder=tmp_path)).grains
    assert np.allclose(grains.a, [0.02, 0.02])
    assert np.allclose(grains.b, [0.005, 0.02])
    assert np.allclose(grains.angle, [math.pi / 6, 0.0])
