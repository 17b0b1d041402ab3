"""Measures of increments: closed forms of few discs, traces, rotation, equilibrium."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from quasi_static_samples import (
    DENSITY,
    DEPTH,
    KN,
    KT,
    RADIUS,
    SIGMA,
    lattice,
    make_contacts,
    make_increment,
    no_walls,
    rotated,
    series_row,
    shear_test,
    with_shear,
)

from dem_cli.analysis.quasi_static import (
    branch_stress,
    contact_energy,
    contact_rose,
    coordination_tensor,
    energy_rose,
    energy_tensor,
    measure_increment,
)
from dem_cli.results.schema import INCREMENTS
from dem_cli.state import Grains, Increment, Slips

CLOSE = {"rtol": 1e-13, "atol": 1e-13}


def three_discs(force: float = 2.0) -> Increment:
    """Two discs on the floor and one on top of both, 60 deg apart, pressed by the walls; Kishino Fig. 5.

    The lower discs touch the floor, a side wall each and the upper disc, but not each other; the upper one touches the top.
    `force` [N] is that of the inclined contacts; the others follow from equilibrium, shear 0.
    """
    r, s, c = RADIUS, math.sin(math.pi / 3.0), math.cos(math.pi / 3.0)
    # a hair apart, so that they do not touch each other
    x = np.array([r, 3.0 * r, 2.0 * r])
    y = np.array([r, r, r + 2.0 * r * s])
    width, height = 4.0 * r, y[2] + r
    rows = [
        (0, 2, c, s, x[0] + r * c, y[0] + r * s, force, 0.0),
        (1, 2, -c, s, x[1] - r * c, y[1] + r * s, force, 0.0),
        (0, -1, -1.0, 0.0, 0.0, y[0], force * c, 0.0),
        (1, -2, 1.0, 0.0, width, y[1], force * c, 0.0),
        (0, -3, 0.0, -1.0, x[0], 0.0, force * s, 0.0),
        (1, -3, 0.0, -1.0, x[1], 0.0, force * s, 0.0),
        (2, -4, 0.0, 1.0, x[2], height, 2.0 * force * s, 0.0),
    ]
    grains = Grains.discs(x, y, np.full(3, r), DENSITY, DEPTH)
    stress = np.array([force * c / (height * DEPTH), 2.0 * force * s / (width * DEPTH)])
    return make_increment(grains, make_contacts(rows), width, height, stress=stress)


def four_discs(stress: tuple[float, float] = (SIGMA, 2.0 * SIGMA)) -> Increment:
    return lattice(stress, columns=2, rows=2)


def test_three_discs_in_closed_form() -> None:
    f, increment = 2.0, three_discs(2.0)
    # inclined contacts count for both grains: 2 n n each, n = (1/2, sqrt 3/2) and its mirror; walls once
    tensor = coordination_tensor(increment)
    np.testing.assert_allclose(tensor, np.diag([2 * 2 * 0.25 + 2, 2 * 2 * 0.75 + 3]) / 3.0, **CLOSE)
    e = 0.5 * f**2 / KN  # of an inclined contact; walls: x e/4, floor 3/4 e, top 3 e
    expected = np.diag([4 * 0.25 * e + 2 * 0.25 * e, 4 * 0.75 * e + 2 * 0.75 * e + 3 * e])
    found = energy_tensor(increment, DEPTH, KN, KT)
    np.testing.assert_allclose(found, expected / (2 * increment.area * DEPTH), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(branch_stress(increment, DEPTH), np.diag(increment.stress), rtol=1e-13, atol=1e-9)
    row = series_row(increment)
    assert (row["contacts"], row["rattlers"], row["coordination"]) == (7.0, 0.0, pytest.approx(3.0, rel=1e-14))
    assert row["stress_ratio"] == pytest.approx(increment.stress[1] / increment.stress[0], rel=1e-15)
    assert (row["fabric_xx"], row["fabric_yy"]) == (pytest.approx(0.25), pytest.approx(0.75))
    solid = 3.0 * math.pi * RADIUS**2
    assert row["void_ratio"] == pytest.approx(increment.area / solid - 1.0, rel=1e-9)
    assert row["porosity"] == pytest.approx(1.0 - solid / increment.area, rel=1e-9)


def test_four_discs_in_closed_form() -> None:
    increment = four_discs()
    # each disc has two contacts across and two along, one of each with a wall
    np.testing.assert_allclose(coordination_tensor(increment), 2.0 * np.eye(2), **CLOSE)
    side = 2.0 * RADIUS * DEPTH
    e = np.array([0.5 * (SIGMA * side) ** 2 / KN, 0.5 * (2.0 * SIGMA * side) ** 2 / KN])
    # in each direction 2 contacts between grains, whole, and 4 with walls, half
    np.testing.assert_allclose(
        energy_tensor(increment, DEPTH, KN, KT), np.diag(4.0 * e) / (increment.area * DEPTH), rtol=1e-13, atol=1e-13
    )
    row = series_row(increment)
    assert row["sine"] == pytest.approx(1.0 / 3.0, rel=1e-14)
    assert (row["mean_stress"], row["deviator"]) == (1.5 * SIGMA, SIGMA)


@pytest.mark.parametrize("ring", [False, True], ids=["walls", "ring"])
@pytest.mark.parametrize("strain", [(0.0, 0.0), (-0.02, 0.015)], ids=["unstrained", "strained"])
def test_stress_of_the_boundary_is_that_of_the_branches(ring: bool, strain: tuple[float, float]) -> None:
    increment = lattice((SIGMA, 1.7 * SIGMA), strain, ring=ring)
    np.testing.assert_allclose(branch_stress(increment, DEPTH), np.diag([SIGMA, 1.7 * SIGMA]), rtol=1e-12, atol=1e-9)


def test_a_ring_of_boundary_grains_measures_like_walls() -> None:
    """It is the same sample: boundary grains belong to no measure, and half of their contacts is theirs."""
    by_walls, by_ring = (series_row(lattice((SIGMA, 1.7 * SIGMA), ring=ring)) for ring in (False, True))
    assert by_walls == pytest.approx(by_ring, rel=1e-12, nan_ok=True)
    plain, chained = (contact_rose(lattice(ring=ring)) for ring in (False, True))
    np.testing.assert_allclose(plain, chained, rtol=1e-13)


def test_contacts_within_the_boundary_count_for_nobody() -> None:
    increment = lattice(ring=True)
    c = increment.contacts
    last = len(increment.grains) - 1
    more = make_contacts(
        [
            *zip(c.i, c.j, c.nx, c.ny, c.px, c.py, c.normal, c.shear, strict=True),
            (last - 1, last, 0.6, 0.8, 0.0, 0.0, 5.0, 1.0),
        ]
    )
    touching = replace(increment, contacts=more)
    for tensor in (coordination_tensor, lambda one: energy_tensor(one, DEPTH, KN, KT)):
        np.testing.assert_allclose(tensor(touching), tensor(increment), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(contact_rose(touching), contact_rose(increment), rtol=1e-13)


@given(st.floats(0.0, 0.6), st.integers(0, 50))
def test_traces(share: float, seed: int) -> None:
    increment = with_shear(lattice((SIGMA, 1.4 * SIGMA)), share, seed)
    c = increment.contacts
    counts = np.where(c.j >= 0, 2, 1)
    assert np.trace(coordination_tensor(increment)) == pytest.approx(counts.sum() / len(increment.grains), rel=1e-13)
    energy = contact_energy(c, KN, KT)
    assert energy.sum() == pytest.approx(increment.energy.stored, rel=1e-13)
    density = (energy * counts).sum() / (2.0 * increment.area * DEPTH)
    assert np.trace(energy_tensor(increment, DEPTH, KN, KT)) == pytest.approx(density, rel=1e-13)


@given(st.floats(0.0, 0.6), st.integers(0, 50), st.floats(0.3, 3.0))
def test_a_sample_turned_by_90_degrees_swaps_x_and_y(share: float, seed: int, ratio: float) -> None:
    increment = replace(with_shear(lattice((SIGMA, ratio * SIGMA), (-0.01, 0.02)), share, seed), walls=no_walls())
    row, turned = series_row(increment), series_row(rotated(increment))
    for name in ("coordination", "fabric", "energy", "branch_stress"):
        for one, other in (("xx", "yy"), ("yy", "xx")):
            assert turned[f"{name}_{one}"] == pytest.approx(row[f"{name}_{other}"], rel=1e-12)
        scale = row[f"{name}_xx"] + row[f"{name}_yy"]
        assert turned[f"{name}_xy"] == pytest.approx(-row[f"{name}_xy"], abs=1e-12 * scale)
    for name in ("shear_strain", "volumetric_strain", "mean_stress", "deviator", "stress_ratio", "sine"):
        assert turned[name] == row[name], name
    assert turned["void_ratio"] == pytest.approx(row["void_ratio"], rel=1e-12)
    quarter = np.roll(contact_rose(increment), 9)
    np.testing.assert_allclose(contact_rose(rotated(increment)), quarter, rtol=1e-12)


def test_a_rose_of_few_contacts() -> None:
    """2 inclined contacts count 2 each, 2 side walls and 3 at floor and top 1 each: 9 in all, each in both directions."""
    rose = contact_rose(three_discs())
    expected = np.zeros(36)
    for k, number in ((6, 2), (12, 2), (0, 2), (9, 3)):
        expected[[k, k + 18]] = 50.0 * number / 9.0
    np.testing.assert_allclose(rose, expected, rtol=1e-13)
    assert rose.sum() == pytest.approx(100.0, rel=1e-13)


def test_a_rose_of_energy() -> None:
    """Inclined e each, twice; side walls e/4, floor 3/4 e, top 3 e, once: 4 + 1/2 + 3/2 + 3 = 9 e."""
    rose = energy_rose(three_discs(), KN, KT)
    expected = np.zeros(36)
    for k, energy in ((6, 2.0), (12, 2.0), (0, 0.5), (9, 4.5)):
        expected[[k, k + 18]] = 50.0 * energy / 9.0
    np.testing.assert_allclose(rose, expected, rtol=1e-13)


def test_walls_lie_in_the_middle_of_their_sectors() -> None:
    """Rounding of a normal does not move a contact to the next sector, and opposite ones are alike."""
    increment = three_discs()
    c = increment.contacts
    tilt = 1e-9 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    tilted = replace(increment, contacts=replace(c, nx=c.nx - tilt * c.ny, ny=c.ny + tilt * c.nx))
    for sectors in (12, 24, 36, 72):
        np.testing.assert_allclose(contact_rose(tilted, sectors), contact_rose(increment, sectors), rtol=1e-13)
    with pytest.raises(ValueError, match="even"):
        contact_rose(increment, 35)


def test_without_contacts_there_is_no_rose_and_no_ratio() -> None:
    grains = lattice().grains
    empty = make_increment(grains, make_contacts([]), 0.03, 0.024)
    row = series_row(empty)
    for name in ("stress_ratio", "sine", "sliding", "fabric_xx", "largest_share"):
        assert math.isnan(row[name]), name
    for name in ("coordination", "contacts", "energy_xx", "branch_stress_yy", "max_overlap"):
        assert row[name] == 0.0, name
    assert row["rattlers"] == len(grains)
    assert np.isnan(contact_rose(empty)).all()


def test_contacts_without_force_are_none() -> None:
    """Kishino 4 (3): only contacts that carry force."""
    increment = four_discs()
    first = np.arange(len(increment.contacts)) == 0
    bare = replace(
        increment, contacts=replace(increment.contacts, normal=np.where(first, 0.0, increment.contacts.normal))
    )
    assert series_row(bare)["contacts"] == series_row(increment)["contacts"] - 1.0
    assert series_row(bare)["coordination"] == pytest.approx(
        4.0 - 2.0 / 4.0 * (1 if increment.contacts.j[0] >= 0 else 0.5)
    )
    assert measure_increment(bare, DEPTH, KN, KT).coordination.sum() < 16


def test_the_row_has_all_names_and_those_of_the_increment() -> None:
    increment = shear_test(40)[-3]
    slips = Slips(np.array([0, 1]), np.array([1, -1]), np.array([1.0, 3.0]))
    increment = replace(increment, slips=slips, pore_pressure=300.0, rung=2, event=True)
    row = series_row(increment)
    assert row.keys() == INCREMENTS.keys()
    assert all(type(value) is float for value in row.values())
    assert row["largest_share"] == 0.75
    assert (row["increment"], row["stage"], row["in_stage"], row["axial"]) == (
        increment.number,
        1.0,
        increment.in_stage,
        1.0,
    )
    assert (row["rung"], row["event"], row["pore_pressure"]) == (2.0, 1.0, 300.0)
    assert (row["work"], row["friction"]) == (increment.energy.work, increment.energy.friction)
    e2, e1 = increment.strain
    assert row["shear_strain"] == e1 - e2
    assert row["volumetric_strain"] == pytest.approx(1.0 - (1.0 - e1) * (1.0 - e2), rel=1e-9)
    assert 1.0 - increment.area / shear_test(40)[4].area == pytest.approx(row["volumetric_strain"], rel=1e-9)


def test_axial_along_x_swaps_the_roles() -> None:
    """The same loads and strains across x: every number of axial and lateral is the same."""
    along_y, along_x = (series_row(shear_test(40, axial=axial)[20]) for axial in (1, 0))
    for name in ("shear_strain", "volumetric_strain", "deviator", "stress_ratio", "sine", "mean_stress"):
        assert along_y[name] == along_x[name], name
    assert along_y["stress_x"] == along_x["stress_y"]


def test_overlaps_and_what_is_pressed_into_walls_are_no_solids_twice() -> None:
    """Four discs squeezed by 10 %: the solid area is that of the union inside the walls."""
    increment = lattice((SIGMA, SIGMA), (0.1, 0.1), columns=2, rows=2)
    overlap = 0.1 * 2.0 * RADIUS  # of a pair; half of it at a wall
    c = increment.contacts
    lap = np.where(c.j >= 0, overlap, 0.5 * overlap)
    increment = replace(increment, contacts=replace(c, overlap=lap))
    half = math.acos(1.0 - 0.1)
    segment = RADIUS**2 * (half - math.sin(half) * math.cos(half))  # what a chord at 0.9 r cuts off
    solid = 4.0 * (math.pi * RADIUS**2 - 4.0 * segment)
    assert series_row(increment)["porosity"] == pytest.approx(1.0 - solid / increment.area, rel=1e-12)


def test_stress_of_grains_adds_up_to_that_of_the_sample() -> None:
    increment = lattice((SIGMA, 1.7 * SIGMA))
    measures = measure_increment(increment, DEPTH, KN, KT)
    area = math.pi * increment.grains.radius**2
    mean = (measures.stress * area[:, None]).sum(axis=0) / increment.area
    np.testing.assert_allclose(mean, [SIGMA, 0.0, 0.0, 1.7 * SIGMA], rtol=1e-12, atol=1e-9)
    assert measures.coordination.tolist() == [4] * len(increment.grains)


def test_roses_and_tensors_do_without_the_compiler() -> None:
    code = "import sys, dem_cli.analysis.quasi_static; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
