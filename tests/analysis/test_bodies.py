"""A grain of several elements is one grain: centre, counts, stress, fill and air."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from analysis_samples import THICKNESS, bed, bodies_of, discs, ellipses, frame_of, overlaps, rotated, touching
from hypothesis import given, settings
from hypothesis import strategies as st

from dem_cli.analysis import bodies, stress, surface
from dem_cli.analysis.clipping import lens_area
from dem_cli.analysis.measures import measure_frame
from dem_cli.analysis.void_ratio import Rectangle
from dem_cli.state import Contacts, Grains

PAIR = [(0.0, 0.0, 1.0), (2.0, 0.0, 1.0)]


def on_a_wall(k, px, py, nx, ny, fx, fy) -> Contacts:
    """Contacts of elements k with wall 0 at given points, which press on the wall with (fx, fy); (nx, ny) is arbitrary."""
    k, px, py, nx, ny, fx, fy = (np.asarray(v, float) for v in (k, px, py, nx, ny, fx, fy))
    zero = np.zeros(len(k))
    normal, shear = fx * nx + fy * ny, -fx * ny + fy * nx
    return Contacts(
        k.astype(np.int64), np.full(len(k), -1), nx, ny, px, py, zero + 1e-6, normal, shear, zero, zero > 0.0
    )


def paired(grains: Grains, contacts: Contacts) -> tuple[Grains, Contacts]:
    """The same elements two by two in a grain; contacts between the two of a grain are gone."""
    body = grains.id // 2
    kept = (contacts.j < 0) | (body[contacts.i] != body[contacts.j])
    names = contacts.__dataclass_fields__
    return replace(grains, body=body), Contacts(**{name: getattr(contacts, name)[kept] for name in names})


def measured(grains, contacts, width, bins=10):
    return measure_frame(frame_of(grains, contacts), width=width, depth=THICKNESS, surface_bins=bins)


def test_centres_are_centres_of_mass():
    grains = bodies_of([(0.0, 0.0, 1.0), (3.0, 0.0, 2.0)], [(5.0, 5.0, 1.0)], [(0.0, 1.0, 1.0), (1.0, 1.0, 1.0)])
    x, y = bodies.centres(grains)
    np.testing.assert_allclose(x, [2.4, 2.4, 5.0, 0.5, 0.5], rtol=1e-15)
    np.testing.assert_allclose(y, [0.0, 0.0, 5.0, 1.0, 1.0], rtol=1e-15)
    assert bodies.first_elements(grains).tolist() == [0, 2, 3]
    flags = np.array([True, False, True, True, True])
    assert bodies.whole(grains, flags).tolist() == [False, False, True, True, True]


def test_pair_between_two_plates():
    # squeezed along its axis with F at both ends, 4 r apart: stress F 4 r over the area of both discs
    grains, force = bodies_of(PAIR), 50.0
    c = on_a_wall([0, 1], [-1.0, 3.0], [0.0, 0.0], [-1.0, 1.0], [0.0, 0.0], [-force, force], [0.0, 0.0])
    found = stress.grain_stress(grains, c, THICKNESS)
    expected = [4.0 * force / (2.0 * math.pi * THICKNESS), 0.0, 0.0, 0.0]
    np.testing.assert_allclose(found, [expected] * 2, atol=1e-12)
    # across the axis each disc carries its own: F 2 r each
    c = on_a_wall([0, 0, 1, 1], [0, 0, 2, 2], [-1, 1] * 2, [0] * 4, [-1, 1] * 2, [0] * 4, [-force, force] * 2)
    found = stress.grain_stress(grains, c, THICKNESS)
    np.testing.assert_allclose(found, [[0, 0, 0, 4 * force / (2 * math.pi * THICKNESS)]] * 2, atol=1e-12)


def test_stress_is_over_the_area_counted_once():
    grains = bodies_of([(0.0, 0.0, 1.0), (1.0, 0.0, 1.0)])
    c = on_a_wall([0, 1], [-1.0, 2.0], [0.0, 0.0], [-1.0, 1.0], [0.0, 0.0], [-7.0, 7.0], [0.0, 0.0])
    area = 2.0 * math.pi - lens_area(1.0, 1.0, 1.0)
    assert stress.grain_stress(grains, c, 1.0)[0, 0] == pytest.approx(21.0 / area, rel=1e-13)


def test_stress_of_an_ellipse_is_over_its_area():
    grains = ellipses([0.0], [0.0], 2.0, 1.0, 0.5 * math.pi)
    c = on_a_wall([0, 0], [-1.0, 1.0], [0.0, 0.0], [-1.0, 1.0], [0.0, 0.0], [-7.0, 7.0], [0.0, 0.0])
    assert stress.grain_stress(grains, c, 1.0)[0, 0] == pytest.approx(14.0 / (2.0 * math.pi), rel=1e-13)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_stress_of_a_grain_in_equilibrium_is_symmetric(seed):
    """Any forces at any points of any elements that balance in force and moment."""
    rng = np.random.default_rng(seed)
    grains = bodies_of([*PAIR, (1.0, 1.7, 0.8)])
    n = 6
    k = rng.integers(0, 3, n)
    px, py = grains.x[k] + rng.uniform(-1, 1, n), grains.y[k] + rng.uniform(-1, 1, n)
    turn = rng.uniform(0, 6, n)
    # three unknown force components balance the rest
    rows = np.zeros((3, 2 * n))
    rows[0, :n] = rows[1, n:] = 1.0
    rows[2] = np.concatenate([-py, px])
    forces = rng.uniform(-5, 5, 2 * n)
    forces -= np.linalg.pinv(rows) @ (rows @ forces)
    c = on_a_wall(k, px, py, np.cos(turn), np.sin(turn), forces[:n], forces[n:])
    _, xy, yx, _ = stress.grain_stress(grains, c, 1.0)[0]
    assert xy == pytest.approx(yx, abs=1e-12)


def test_stress_of_bodies_adds_up_to_that_of_the_sample():
    rng = np.random.default_rng(6)
    x, y, radius = rng.uniform(1, 9, 80), rng.uniform(1, 9, 80), rng.uniform(0.3, 0.9, 80)
    grains, c = paired(discs(x, y, radius), overlaps(x, y, radius, width=10.0, shear=3e4))
    box = Rectangle(-9.0, -9.0, 19.0, 19.0)
    sample = stress.window_stress(*bodies.centres(grains), c, box, 0.3) * box.area
    share = bodies.areas(grains)[grains.body] / 2.0
    total = (stress.grain_stress(grains, c, 0.3) * share[:, None]).sum(axis=0)
    np.testing.assert_allclose(total.reshape(2, 2), sample, rtol=1e-10)


@pytest.mark.parametrize("turn", [0.4, 2.0, -1.3])
def test_turned_sample_has_turned_stress_and_fabric(turn):
    rng = np.random.default_rng(7)
    grains = ellipses(
        rng.uniform(0, 6, 30), rng.uniform(0, 6, 30), 0.9, rng.uniform(0.3, 0.9, 30), rng.uniform(0, 3, 30)
    )
    grains = replace(grains, body=grains.id // 3)
    _, contacts = paired(replace(grains, body=grains.id), touching(grains, shear=2e5))
    turned, contacts_turned = rotated(grains, contacts, turn)
    r = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    everywhere = Rectangle(-20.0, -20.0, 20.0, 20.0)
    first, second = (
        (stress.window_stress(*bodies.centres(g), c, everywhere, 1.0), stress.fabric(c))
        for g, c in ((grains, contacts), (turned, contacts_turned))
    )
    for before, after in zip(first, second, strict=True):
        np.testing.assert_allclose(after, r @ before @ r.T, rtol=1e-9, atol=1e-9 * np.abs(before).max())


def test_coordination_of_a_pair():
    # a disc in the notch of a pair touches it twice, another touches its end once
    h = math.sqrt(3.0)
    grains = bodies_of(PAIR, [(1.0, h * 0.999, 1.0)], [(3.999, 0.0, 1.0)])
    assert stress.coordination(grains, touching(grains)).tolist() == [3, 3, 2, 1]
    # and walls: the pair lies on the floor with both discs
    lying = bodies_of([(1.0, 0.999, 1.0), (3.0, 0.999, 1.0)])
    assert stress.coordination(lying, overlaps(lying.x, lying.y, lying.radius, width=9.0)).tolist() == [2, 2]


def test_bed_of_pairs_against_the_same_bed_of_discs():
    grains, width = bed(seed=5)
    contacts = overlaps(grains.x, grains.y, grains.radius, width, shear=300.0)
    pairs, between = paired(grains, contacts)
    assert len(between) < len(contacts)
    alone, joined = measured(grains, contacts, width), measured(pairs, between, width)
    same = (
        "void_ratio void_ratio_inner porosity porosity_inner depth mode1 roughness center_x center_y airborne escaped"
    )
    for name in same.split():
        assert joined.row[name] == pytest.approx(alone.row[name], rel=1e-12, abs=1e-15), name
    ends = 2 * np.count_nonzero(between.j >= 0) + np.count_nonzero(between.j < 0)
    assert joined.row["coordination"] == pytest.approx(ends / (len(grains) / 2), rel=1e-14)
    assert joined.coordination.shape == (len(grains),)
    assert np.array_equal(joined.coordination[::2], joined.coordination[1::2])
    assert np.array_equal(joined.stress[::2], joined.stress[1::2])


def test_pair_in_the_air_is_one_airborne_grain():
    grains, width = bed()
    r, top = grains.radius[0], grains.y.max()
    x, y = np.append(grains.x, [5 * r, 7 * r]), np.append(grains.y, [top + 4 * r, top + 4 * r])
    body = np.append(grains.body, [len(grains)] * 2)
    pair = replace(discs(x, y, r), body=body)
    row = measured(pair, overlaps(grains.x, grains.y, grains.radius, width), width).row
    assert row["airborne"] == 1.0
    # once one of its discs touches the bed the whole pair is of the fill, however high the other one is
    y[-2], y[-1] = top + 1.9 * r, top + 3.9 * r
    x[-2:] = grains.x[-3]
    standing = replace(discs(x, y, r), body=body)
    contacts = touching(standing)
    found = surface.find_surface(standing, np.ones(len(x), bool), contacts, width, 100)
    assert found.fill.all()
    assert found.eta.max() == pytest.approx(top + 4.9 * r, abs=0.03 * r)
    assert measured(standing, contacts, width).row["airborne"] == 0.0


def test_pair_near_the_bed_joins_as_a_whole_and_joins_others():
    # the pair's discs are half a radius apart: one is near a grain on the floor, the other carries the next; apart none is joined
    column = [[(1.0, 1.0, 1.0)], [(1.0, 3.05, 1.0), (3.5, 3.05, 1.0)], [(5.55, 3.05, 1.0)], [(9.0, 9.0, 1.0)]]
    grains = bodies_of(*column)
    present = np.ones(5, bool)
    assert surface.find_surface(grains, present, touching(grains), 10.0, 5).airborne.tolist() == [False] * 4 + [True]
    apart = replace(grains, body=grains.id)
    assert surface.find_surface(apart, present, touching(apart), 10.0, 5).airborne.tolist() == [False] * 2 + [True] * 3


def test_bed_is_told_by_grains_not_by_elements():
    # aloft: a chain of five discs is one grain of four, so no cluster holds more than half of the grains
    chain = [(2.0 * k, 50.0, 1.0) for k in range(5)]
    singles = [[(20.0 + 4.0 * k, 50.0, 1.0)] for k in range(3)]
    grains = bodies_of(chain, *singles)
    found = surface.find_surface(grains, np.ones(8, bool), touching(grains), 40.0, 5)
    assert found.airborne.all()
    row = measured(grains, touching(grains), 40.0).row
    assert row["airborne"] == 4.0


def test_loose_pair_in_a_pore_is_told_by_its_centre():
    # an overhang that ends at x = 3.9; one disc of the pair is below it in either case
    bed_of_three = [[(1.0, 1.0, 1.0)], [(1.0, 2.99, 1.0)], [(2.9, 3.59, 1.0)]]
    for x, airborne in ((3.9, False), (4.5, True)):
        grains = bodies_of(*bed_of_three, [(3.5, 1.5, 0.2), (x, 1.5, 0.2)])
        found = surface.find_surface(grains, np.ones(5, bool), touching(grains), 6.0, 4)
        assert found.airborne.tolist() == [False] * 3 + [airborne] * 2


def test_pair_with_an_escaped_or_lost_element_is_in_no_measure():
    grains, width = bed(seed=2)
    contacts = overlaps(grains.x, grains.y, grains.radius, width)
    clean = measured(grains, contacts, width).row
    r, n = grains.radius[0], len(grains)
    x, y = np.append(grains.x, [5 * r, 2 * width, 3 * r, np.nan]), np.append(grains.y, [0.5, -9.0, 0.5, np.nan])
    more = replace(discs(x, y, r), body=np.append(grains.body, [n, n, n + 1, n + 1]))
    more = replace(more, escaped=np.arange(n + 4) == n + 1)
    row = measured(more, contacts, width).row
    assert row["escaped"] == 1.0
    for name in set(row) - {"escaped"}:
        assert row[name] == pytest.approx(clean[name], rel=1e-12, abs=1e-9), name


def test_overlap_of_an_ellipse_is_over_its_smaller_axis():
    grains = ellipses([2.0, 2.0], [1.0, 2.9], [2.0, 1.5], [1.0, 1.0], [0.0, 0.0])
    row = measured(grains, touching(grains), 4.0).row
    assert row["max_overlap"] == pytest.approx(0.1, rel=1e-12)
