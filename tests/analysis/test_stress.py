"""Stress, fabric and contact numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from analysis_samples import RHO, THICKNESS, discs, hexagonal, overlaps

from dem_cli.analysis import stress
from dem_cli.analysis.void_ratio import Rectangle

G = 9.80665


def column(n=20, r=0.01):
    """A stack of discs in equilibrium under gravity: contact k carries the weight of the n - k grains above it."""
    x, y = np.full(n, r), r * (1 + 2 * np.arange(n)) * (1 - 1e-9)
    c = overlaps(x, y, np.full(n, r), width=2 * r)
    c = replace(c, normal=np.where(np.abs(c.ny) > 0.5, 0.0, c.normal))
    grains = discs(x, y, r)
    above = np.where(c.j < 0, n - c.i, n - np.maximum(c.i, c.j))
    return grains, replace(c, normal=np.where(np.abs(c.ny) > 0.5, above * grains.mass[0] * G, 0.0))


def test_single_contact_closed_form():
    # force (3, 4): 5 N along the normal; shear -2 N along t = (-ny, nx)
    nx, ny, d = 0.6, 0.8, 1.9
    x, y = np.array([0.0, d * nx]), np.array([0.0, d * ny])
    c = replace(overlaps(x, y, np.ones(2)), normal=np.array([5.0]), shear=np.array([-2.0]))
    f = 5.0 * np.array([nx, ny]) - 2.0 * np.array([-ny, nx])
    branch = d * np.array([nx, ny])
    window = Rectangle(-2.0, -2.0, 3.0, 4.0)
    found = stress.window_stress(x, y, c, window, 0.25)
    np.testing.assert_allclose(found, np.outer(f, branch) / (30.0 * 0.25), rtol=1e-13)
    # a window that ends in the middle of the branch holds half of it
    half = Rectangle(-2.0, -2.0, 0.5 * branch[0], 4.0)
    np.testing.assert_allclose(
        stress.window_stress(x, y, c, half, 0.25) * half.area,
        0.5 * np.outer(f, branch) / 0.25,
        rtol=1e-13,
    )


def test_compression_is_positive_in_every_direction():
    x, y = hexagonal(4, 4, 1.0, 1.99)
    radius = np.ones(len(x))
    found = stress.window_stress(x, y, overlaps(x, y, radius), Rectangle(2.0, 2.0, 5.0, 5.0), 1.0)
    assert found[0, 0] > 0.0
    assert found[1, 1] > 0.0
    assert np.all(stress.grain_stress(discs(x, y, radius), overlaps(x, y, radius), 1.0)[:, [0, 3]] > 0.0)


def test_hydrostatic_column():
    r, n = 0.01, 20
    grains, c = column(n, r)
    bulk = RHO * math.pi * r**2 / (2 * r) ** 2
    for low, high in ((0.0, n), (4.0, 9.0), (10.5, 13.5)):
        window = Rectangle(0.0, 2 * r * low, 2 * r, 2 * r * high)
        found = stress.window_stress(grains.x, grains.y, c, window, THICKNESS)
        depth = 2 * r * (n - 0.5 * (low + high))
        # the free top of the column carries no branch: half a grain is missing
        edge = 0.5 / n if high == n else 0.0
        assert found[1, 1] == pytest.approx(bulk * G * depth, rel=1e-6 + 2 * edge)
        assert abs(found[0, 1]) + abs(found[1, 0]) + abs(found[0, 0]) < 1e-9 * found[1, 1]


def test_column_by_grains_is_hydrostatic_too():
    r, n = 0.01, 20
    grains, c = column(n, r)
    found = stress.grain_stress(grains, c, THICKNESS)
    # mean of the forces below and above a grain, over its area
    weight = grains.mass[0] * G
    expected = weight * (n - np.arange(n) - 0.5) * 2 * r / (math.pi * r**2 * THICKNESS)
    np.testing.assert_allclose(found[:, 3], expected, rtol=1e-6)


def test_windows_side_by_side_add_up():
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, 10, 120), rng.uniform(0, 10, 120)
    c = overlaps(x, y, np.full(120, 0.8), shear=1e5)
    whole, left, right = Rectangle(2, 3, 8, 7), Rectangle(2, 3, 4.5, 7), Rectangle(4.5, 3, 8, 7)
    total = [stress.window_stress(x, y, c, w, 0.3) * w.area for w in (whole, left, right)]
    np.testing.assert_allclose(total[0], total[1] + total[2], rtol=1e-12)


def test_stress_of_grains_adds_up_to_that_of_the_sample():
    rng = np.random.default_rng(4)
    x, y, radius = rng.uniform(1, 9, 80), rng.uniform(1, 9, 80), rng.uniform(0.3, 0.9, 80)
    c = overlaps(x, y, radius, width=10.0, shear=3e4)
    box = Rectangle(-5.0, -5.0, 15.0, 15.0)
    sample = stress.window_stress(x, y, c, box, 0.3) * box.area
    grains = (stress.grain_stress(discs(x, y, radius), c, 0.3) * (math.pi * radius**2)[:, None]).sum(axis=0)
    np.testing.assert_allclose(grains.reshape(2, 2), sample, rtol=1e-10)


def test_asymmetry_is_the_moment_of_the_shear_forces():
    # four neighbours around a disc, all turning it the same way: no equilibrium, and the stress shows it
    x, y = np.array([0.0, 2.0, -2.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 2.0, -2.0])
    radius = np.full(5, 1.0 + 1e-9)
    c = overlaps(x, y, radius, shear=7.0)
    turned = stress.grain_stress(discs(x, y, radius), c, 1.0)[0]
    # sum of r x f over the contacts is 4 * 7 * 1 N m, for f on the neighbour (moment xy part: l_x f_y - l_y f_x)
    assert (turned[2] - turned[1]) * math.pi == pytest.approx(28.0, rel=1e-6)
    # shear of opposite signs on the two axes: balanced moments, pure shear stress
    signs = np.where(np.abs(c.nx) > 0.5, 1.0, -1.0)
    balanced = stress.grain_stress(discs(x, y, radius), replace(c, shear=7.0 * signs), 1.0)[0]
    assert balanced[2] == pytest.approx(balanced[1], rel=1e-6)
    assert abs(balanced[1]) * math.pi == pytest.approx(14.0, rel=1e-6)


def test_empty_window_has_no_stress():
    x, y = np.array([0.0, 1.9]), np.zeros(2)
    c = overlaps(x, y, np.ones(2))
    assert np.isnan(stress.window_stress(x, y, c, Rectangle(0.0, 0.0, 1.0, 0.0), 1.0)).all()
    assert np.all(stress.window_stress(x, y, c, Rectangle(5.0, 5.0, 6.0, 6.0), 1.0) == 0.0)


def test_fabric_of_a_hexagonal_lattice_is_isotropic_and_walls_are_left_out():
    # one disc and its six neighbours: three directions 60 degrees apart, twice
    turn = np.arange(6) * math.pi / 3
    x, y = np.append(0.0, 1.99 * np.cos(turn)), np.append(0.0, 1.99 * np.sin(turn))
    c = overlaps(x, y, np.ones(7))
    centre = (c.i == 0) | (c.j == 0)
    star = type(c)(**{name: getattr(c, name)[centre] for name in c.__dataclass_fields__})
    np.testing.assert_allclose(stress.fabric(star), 0.5 * np.eye(2), atol=1e-14)
    # a pair along x that presses on the floor and on a wall as well
    pair = overlaps([0.9, 2.8], [0.9, 0.9], [1.0, 1.0], width=10.0)
    assert len(pair) == 4
    np.testing.assert_allclose(stress.fabric(pair), [[1.0, 0.0], [0.0, 0.0]], atol=1e-15)
    assert np.isnan(stress.fabric(overlaps([1.0], [0.9], [1.0], width=10.0))).all()


def test_coordination_counts_a_pair_twice_and_a_wall_once():
    grains = discs([0.9, 2.8, 9.0], [0.9, 0.9, 9.0], [1.0, 1.0, 0.5])
    found = stress.coordination(grains, overlaps(grains.x, grains.y, grains.radius, width=20.0))
    assert found.tolist() == [3, 2, 0]
    assert found.dtype == np.int64


def test_sliding_share():
    c = overlaps([0.9, 2.8], [0.9, 0.9], [1.0, 1.0], width=10.0)
    assert stress.sliding_share(replace(c, sliding=np.array([True, False, False, False]))) == 0.25
    assert math.isnan(stress.sliding_share(overlaps([0.0], [5.0], [1.0])))


def test_largest_overlap_is_over_the_smaller_radius():
    c = overlaps([5.0, 6.4], [5.0, 5.0], [1.0, 0.5])
    assert stress.max_overlap_ratio(np.array([1.0, 0.5]), c) == pytest.approx(0.2)
    # the number of a wall, -3 for the floor, is no index of a radius
    wall = overlaps([5.0], [0.9], [1.0], width=10.0)
    assert stress.max_overlap_ratio(np.array([1.0]), wall) == pytest.approx(0.1)
    assert stress.max_overlap_ratio(np.array([1.0, 1e-3, 1e-3]), wall) == pytest.approx(0.1)
    assert stress.max_overlap_ratio(np.array([1.0]), overlaps([5.0], [5.0], [1.0])) == 0.0
