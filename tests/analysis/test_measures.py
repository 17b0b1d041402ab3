"""The measures of a whole frame: names, symmetries, and what is undefined."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from analysis_samples import THICKNESS, bed, discs, frame_of, overlaps

from dem_cli.analysis.measures import measure_frame, series_row
from dem_cli.results.schema import SERIES
from dem_cli.state import BondStrain, Contacts

SHEAR = 300.0


def measured(grains, width, contacts=None, bins=10):
    if contacts is None:
        contacts = overlaps(grains.x, grains.y, grains.radius, width, shear=SHEAR)
    return measure_frame(frame_of(grains, contacts), width=width, depth=THICKNESS, surface_bins=bins)


def take(contacts, index):
    return Contacts(**{f.name: getattr(contacts, f.name)[index] for f in fields(contacts)})


def test_row_holds_every_name_of_the_series_once():
    grains, width = bed()
    contacts = overlaps(grains.x, grains.y, grains.radius, width)
    bonds = BondStrain(gap=np.array([0.1, -0.3]), slip=np.array([-0.5, 0.2]), roll=np.array([0.7, 0.6]))
    frame = frame_of(grains, contacts, bonds)
    measures = measured(grains, width, contacts)
    row = series_row(frame, measures)
    assert set(row) == set(SERIES)
    assert all(type(value) is float for value in row.values())
    assert all(math.isfinite(value) for value in row.values())
    assert measures.eta.shape == (10,)
    assert measures.coordination.shape == (len(grains),)
    assert measures.stress.shape == (len(grains), 4)


def test_engine_numbers_are_taken_over():
    grains, width = bed()
    row = series_row(frame_of(grains, None), measured(grains, width))
    assert (row["time"], row["step"], row["stage"], row["time_step"]) == (0.25, 7.0, 1.0, 1e-5)
    energies = "kinetic potential elastic_normal elastic_tangential friction dashpot_normal dashpot_tangential"
    energies += " bond_energy damping escaped_energy time_step_energy work"
    assert [row[name] for name in energies.split()] == [0.5 + k for k in range(12)]
    assert (row["residual"], row["energy_in"], row["unbalanced"]) == (-3.0, 40.0, 0.125)
    ground = [row[f"ground_{name}"] for name in ("x", "y", "vx", "vy", "ax", "ay")]
    assert ground == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_bonds_give_their_largest_strain_in_magnitude():
    grains, width = bed()
    measures = measured(grains, width)
    bonds = BondStrain(gap=np.array([0.1, -0.3]), slip=np.array([-0.5, 0.2]), roll=np.array([0.7, 0.6]))
    row = series_row(frame_of(grains, None, bonds), measures)
    assert (row["bond_gap"], row["bond_slip"], row["bond_roll"]) == (0.3, 0.5, 0.7)
    empty = BondStrain(*(np.empty(0),) * 3)
    for none in (None, empty):
        row = series_row(frame_of(grains, None, none), measures)
        assert all(math.isnan(row[f"bond_{name}"]) for name in ("gap", "slip", "roll"))


def test_bed_of_a_lattice():
    r = 0.01
    grains, width = bed(columns=30, rows=20, r=r)
    row = measured(grains, width, bins=20).row
    # hexagonal with pitch 1.996 r: overlaps are thin, so nearly pi r^2 a cell
    pitch = 1.996 * r
    cell = pitch**2 * math.sqrt(0.75)
    assert row["porosity_inner"] == pytest.approx(1.0 - math.pi * r**2 / cell, abs=3e-3)
    assert row["void_ratio_inner"] == pytest.approx(row["porosity_inner"] / (1 - row["porosity_inner"]))
    assert row["void_ratio"] == pytest.approx(row["porosity"] / (1 - row["porosity"]))
    # walls and floor leave more voids than the inside
    assert row["porosity"] > row["porosity_inner"]
    solid = (1 - row["porosity"]) * row["depth"] * width
    assert solid == pytest.approx(len(grains) * math.pi * r**2, rel=2e-3)
    assert row["airborne"] == row["escaped"] == 0.0
    assert row["coordination"] == pytest.approx(6.0, abs=0.5)
    assert row["center_x"] == pytest.approx(width / 2, rel=1e-3)
    assert row["max_overlap"] == pytest.approx(0.004, rel=1e-6)
    assert row["stress_xx"] > 0 < row["stress_yy"]


def test_renumbered_sample_has_the_same_measures():
    grains, width = bed(seed=3)
    contacts = overlaps(grains.x, grains.y, grains.radius, width, shear=SHEAR)
    first = measured(grains, width, contacts)
    order = np.random.default_rng(5).permutation(len(grains))
    place = np.argsort(order)
    # a pair whose order changes turns its normal; its shear is the same number, as t turns too
    i, j = place[contacts.i], np.where(contacts.j >= 0, place[contacts.j], contacts.j)
    swap = (j >= 0) & (j < i)
    sign = np.where(swap, -1.0, 1.0)
    i, j = np.where(swap, j, i), np.where(swap, i, j)
    turned = replace(contacts, i=i, j=j, nx=sign * contacts.nx, ny=sign * contacts.ny)
    renumbered = replace(grains.take(order), id=grains.id, body=grains.body)
    second = measured(renumbered, width, take(turned, np.lexsort((j, i))))
    for name, value in first.row.items():
        assert second.row[name] == pytest.approx(value, rel=1e-9, abs=1e-9 * scale(name)), name
    np.testing.assert_allclose(second.eta, first.eta, rtol=1e-12)
    np.testing.assert_array_equal(second.coordination, first.coordination[order])
    np.testing.assert_allclose(second.stress, first.stress[order], rtol=1e-9, atol=1e-6)


def test_mirrored_sample_has_mirrored_measures():
    grains, width = bed(seed=4)
    contacts = overlaps(grains.x, grains.y, grains.radius, width, shear=SHEAR)
    first = measured(grains, width, contacts)
    mirror = replace(grains, x=width - grains.x)
    turned = replace(contacts, nx=-contacts.nx, px=width - contacts.px, shear=-contacts.shear)
    second = measured(mirror, width, turned)
    odd = {"mode1", "fabric_xy", "stress_xy", "stress_asymmetry"}
    for name, value in first.row.items():
        wanted = width - value if name == "center_x" else -value if name in odd else value
        assert second.row[name] == pytest.approx(wanted, rel=1e-9, abs=1e-9 * scale(name)), name
    np.testing.assert_allclose(second.eta, first.eta[::-1], rtol=1e-9)
    np.testing.assert_allclose(second.stress, first.stress * [1, -1, -1, 1], rtol=1e-9, atol=1e-6)


def scale(name):
    return 1e6 if name.startswith("stress") else 1.0


def test_falling_grains_have_no_void_ratio_yet():
    k, m = np.meshgrid(np.arange(5.0), np.arange(4.0))
    # two grains of twenty lie on the floor
    y = 3 * m.ravel() + 5.0
    y[:2] = 1.0
    grains = discs(3 * k.ravel() + 1.5, y, 1.0)
    measures = measured(grains, 15.0)
    undefined = {name for name, value in measures.row.items() if math.isnan(value)}
    nowhere = {f"{m}{w}" for m in ("void_ratio", "porosity") for w in ("", "_inner")}
    stresses = {"stress_xx", "stress_xy", "stress_yy", "stress_asymmetry"}
    assert undefined == nowhere | stresses | {"fabric_xx", "fabric_xy", "fabric_yy", "sliding"}
    assert measures.row["airborne"] == 18.0
    assert measures.row["coordination"] == 0.0
    assert 0.0 < measures.row["depth"] < 1.0


def test_escaped_and_lost_grains_are_in_no_measure():
    grains, width = bed(seed=2)
    contacts = overlaps(grains.x, grains.y, grains.radius, width)
    clean = measured(grains, width, contacts).row
    more = discs(
        np.concatenate([grains.x, [3 * width, np.nan]]),
        np.concatenate([grains.y, [-5.0, 0.1]]),
        grains.radius[0],
    )
    more = replace(more, escaped=np.arange(len(more)) == len(grains))
    row = measured(more, width, contacts).row
    assert row["escaped"] == 1.0
    for name in set(row) - {"escaped"}:
        assert row[name] == pytest.approx(clean[name], rel=1e-12, nan_ok=True), name


def test_container_that_everything_has_left():
    grains = replace(discs([5.0, 9.0], [-3.0, -3.0], 0.1), escaped=np.ones(2, bool))
    row = measured(grains, 1.0, overlaps(grains.x, grains.y, grains.radius)).row
    assert row["escaped"] == 2.0
    assert row["depth"] == row["airborne"] == row["max_overlap"] == 0.0
    assert math.isnan(row["void_ratio"])
    assert math.isnan(row["coordination"])
    assert math.isnan(row["center_x"])


def test_frame_without_contacts_is_refused():
    grains, width = bed()
    with pytest.raises(ValueError, match="without contacts"):
        measure_frame(frame_of(grains, None), width=width, depth=1.0)


def test_inner_window_stays_below_a_leaning_surface():
    """A wedge of touching discs: the window lies below the lowest surface between the sides, so no empty corner counts as voids."""
    r, columns = 0.01, 20
    rows = [4 + k for k in range(columns)]
    x = np.concatenate([np.full(n, (2 * k + 1) * r) for k, n in enumerate(rows)])
    y = np.concatenate([(2 * np.arange(n) + 1) * r for n in rows])
    grains = discs(x, y, np.full(len(x), r))
    leaning = measured(grains, 2 * columns * r, bins=columns)
    assert leaning.row["porosity_inner"] == pytest.approx(1.0 - math.pi / 4.0, abs=0.05)
