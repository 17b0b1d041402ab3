"""Free surface, bed and airborne grains, and the numbers of the surface."""

from __future__ import annotations

import math

import numpy as np
import pytest
from analysis_samples import bed, discs, ellipses, hexagonal, overlaps, touching
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from dem_cli.analysis import surface
from dem_cli.analysis.bodies import outlines
from dem_cli.analysis.clusters import joined_to_bed
from dem_cli.geometry.ellipse import outline


def surface_of(x, y, r, width, bins=10, present=None):
    x, y = np.asarray(x, float), np.asarray(y, float)
    radius = np.broadcast_to(r, x.shape).astype(float)
    present = np.ones(len(x), bool) if present is None else present
    return surface.find_surface(discs(x, y, radius), present, overlaps(x, y, radius), width, bins)


def test_level_of_a_flat_hexagonal_bed():
    # the mean of sqrt(r^2 - x^2) over a disc of the top row is pi/4 r; a bin is two of its discs
    r = 0.01
    x, y = hexagonal(21, 7, r, 2.0 * r)
    found = surface_of(x, y, r, 40 * r)
    np.testing.assert_allclose(found.eta, y.max() + math.pi / 4 * r, atol=2e-3 * r)
    assert found.fill.all()
    assert not found.airborne.any()


@pytest.mark.parametrize("seed", range(4))
def test_outline_is_the_highest_disc_at_every_place(seed):
    rng = np.random.default_rng(seed)
    n, width = 150, 1.0
    x, y, r = rng.uniform(0, width, n), rng.uniform(0, 0.4, n), rng.uniform(0.01, 0.08, n)
    found = surface_of(x, y, r, width, bins=8)
    xs = (np.arange(80_000) + 0.5) / 80_000
    top = np.zeros(len(xs))
    for k in np.flatnonzero(found.fill):
        inside = np.abs(xs - x[k]) < r[k]
        top[inside] = np.maximum(top[inside], y[k] + np.sqrt(r[k] ** 2 - (xs[inside] - x[k]) ** 2))
    np.testing.assert_allclose(found.eta, top.reshape(8, -1).mean(axis=1), atol=0.01 * r.mean())


@pytest.mark.parametrize("seed", range(4))
def test_outline_is_the_highest_ellipse_at_every_place(seed):
    rng = np.random.default_rng(seed)
    n, width = 150, 1.0
    r, k = rng.uniform(0.01, 0.08, n), rng.choice([1.0, 1.3, 3.0, 5.0], n)
    grains = ellipses(
        rng.uniform(0, width, n), rng.uniform(0, 0.4, n), r * np.sqrt(k), r / np.sqrt(k), rng.uniform(0, math.pi, n)
    )
    found = surface.find_surface(grains, np.ones(n, bool), touching(grains), width, 8)
    assert found.fill.sum() > 100
    # every ellipse as a dense polygon, its height at the same samples by interpolation along its upper half
    samples = 8 * math.ceil(width / 8 / (surface.SAMPLE * grains.radius.mean()))
    xs = (np.arange(samples) + 0.5) / samples
    top = np.zeros(len(xs))
    t = np.linspace(0.0, math.tau, 20_001)
    for g in np.flatnonzero(found.fill):
        u, v = grains.a[g] * np.cos(t), grains.b[g] * np.sin(t)
        c, s = math.cos(grains.angle[g]), math.sin(grains.angle[g])
        x, y = grains.x[g] + u * c - v * s, grains.y[g] + u * s + v * c
        left, right = int(np.argmin(x[:-1])), int(np.argmax(x[:-1]))
        upper = np.arange(right, left + (len(t) - 1) * (left < right) + 1) % (len(t) - 1)
        inside = (xs > x[left]) & (xs < x[right])
        top[inside] = np.maximum(top[inside], np.interp(xs[inside], x[upper][::-1], y[upper][::-1]))
    np.testing.assert_allclose(found.eta, top.reshape(8, -1).mean(axis=1), rtol=1e-6)


@settings(max_examples=200, deadline=None)
@given(st.floats(0.3, 1.5), st.booleans(), st.floats(3.0, 4.0), st.floats(0.001, 0.2), st.floats(0.0, 1.0))
def test_nothing_above_a_steep_ellipse_is_taken_for_hidden(angle, falling, x, inwards, above):
    """A small disc above the end of a steep ellipse, where the outline rises most within a column of samples."""
    angle = -angle if falling else angle
    m, p, q = outline(3.0, 0.6, angle)
    end = math.copysign(math.sqrt(m + p), -q)
    at = end - math.copysign(inwards, end)
    disc_y = 5.0 + q / (m + p) * at + above
    grains = ellipses([x, x + at], [5.0, disc_y], [3.0, 0.05], [0.6, 0.05], [angle, 0.0])
    spacing = 1 / 32
    top = np.zeros(256)
    surface._raise_outline(grains.x, grains.y, grains.radius, *outlines(grains), np.ones(2, bool), spacing, top)
    d = (np.arange(256)[:, None] + 0.5) * spacing - grains.x
    m, p, q = outlines(grains)
    reach = m + p - d * d
    height = grains.y + (q * d + grains.a * grains.b * np.sqrt(np.maximum(reach, 0.0))) / (m + p)
    np.testing.assert_allclose(top, np.where(reach > 0.0, height, 0.0).max(axis=1), rtol=1e-12)


def test_ellipses_of_equal_axes_have_the_surface_of_discs():
    grains, width = bed(seed=6)
    contacts = overlaps(grains.x, grains.y, grains.radius, width)
    present = np.ones(len(grains), bool)
    r, angle = grains.radius, np.linspace(0.0, 6.0, len(grains))
    disc = surface.find_surface(grains, present, contacts, width, 10)
    for more in (0.0, 1e-14):
        ellipse = ellipses(grains.x, grains.y, r * (1.0 + more), r, angle)
        found = surface.find_surface(ellipse, present, contacts, width, 10)
        np.testing.assert_allclose(found.eta, disc.eta, rtol=1e-9 if more else 1e-15)
        assert np.array_equal(found.fill, disc.fill)


@pytest.mark.parametrize(("gap", "joined"), [(0.99, True), (1.01, False)])
@pytest.mark.parametrize(("angle", "low"), [(0.0, 0.5), (0.5 * math.pi, 2.0), (0.7, None)])
def test_ellipse_joins_the_floor_with_its_lowest_point(angle, low, gap, joined):
    low = low or math.hypot(2.0 * math.sin(angle), 0.5 * math.cos(angle))
    grains = ellipses([2.0, 7.0, 12.0], [0.5, low + gap * surface.NEAR, 30.0], 2.0, 0.5, [0.0, angle, 0.0])
    found = surface.find_surface(grains, np.ones(3, bool), touching(grains), 14.0, 7)
    assert found.fill.tolist() == [True, joined, False]


def gap_of_ellipses(grains, i, j, directions=5000):
    """Largest n.delta - h_i - h_j over many directions: below the true gap by 1e-6 of the distance at most."""
    t = np.arange(directions) * (math.tau / directions)
    gap = (grains.x[j] - grains.x[i]) * np.cos(t) + (grains.y[j] - grains.y[i]) * np.sin(t)
    for k in (i, j):
        gap -= np.hypot(grains.a[k] * np.cos(t - grains.angle[k]), grains.b[k] * np.sin(t - grains.angle[k]))
    return float(gap.max())


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 25), st.floats(0.5, 8.0), st.floats(0.0, 0.3))
def test_bed_of_ellipses_is_the_graph_of_all_near_pairs(seed, n, spread, gap):
    rng = np.random.default_rng(seed)
    r, k = rng.uniform(0.05, 0.6, n), rng.choice([1.0, 1.5, 5.0], n)
    place = rng.uniform(0, spread, n), rng.uniform(0, 2 * spread, n)
    grains = ellipses(*place, r * np.sqrt(k), r / np.sqrt(k), rng.uniform(0, math.pi, n))
    present = rng.random(n) < 0.85
    near = np.zeros((n, n), bool)
    for i in range(n):
        for j in range(i):
            apart = gap_of_ellipses(grains, i, j)
            assume(abs(apart - gap) > 1e-5)
            near[i, j] = present[i] and present[j] and apart < gap
    label = connected_components(coo_matrix(near), directed=False)[1]
    low = np.hypot(grains.a * np.sin(grains.angle), grains.b * np.cos(grains.angle))
    of_bed = np.isin(label, label[present & (grains.y - low < gap)])
    of_bed |= 2 * np.bincount(label[present], minlength=n)[label] > present.sum()
    c = touching(grains)
    np.testing.assert_array_equal(joined_to_bed(grains, present, c.i, c.j, gap), of_bed & present)


def test_lone_disc_and_empty_bins():
    found = surface_of([0.55], [0.05], 0.05, 1.0)
    assert found.eta[5] == pytest.approx(0.05 + math.pi / 4 * 0.05, rel=1e-2)
    assert np.all(np.delete(found.eta, 5) == 0.0)


def test_disc_that_reaches_over_the_wall_counts_inside_only():
    found = surface_of([0.0], [0.1], 0.1, 1.0)
    assert found.eta[0] == pytest.approx(0.1 + math.pi / 4 * 0.1, rel=1e-2)
    assert np.all(found.eta[1:] == 0.0)


def test_airborne_grain_is_above_the_bed_and_no_part_of_the_surface():
    grains, width = bed()
    r = grains.radius[0]
    level = surface_of(grains.x, grains.y, r, width).eta
    x = np.append(grains.x, 5 * r)
    y = np.append(grains.y, grains.y.max() + 4 * r)
    found = surface_of(x, y, r, width)
    assert np.flatnonzero(found.airborne).tolist() == [len(grains)]
    np.testing.assert_array_equal(found.eta, level)


@pytest.mark.parametrize(("gap", "airborne"), [(0.5, False), (0.99, False), (1.01, True), (3.0, True)])
def test_joined_up_to_the_stated_gap(gap, airborne):
    # two columns on the floor; the second one ends with a grain `gap` NEAR radii above its neighbour
    y = [1.0, 3.0, 1.0, 3.0, 5.0 + gap * surface.NEAR]
    found = surface_of([1.0, 1.0, 5.0, 5.0, 5.0], y, 1.0, 6.0)
    assert found.airborne.tolist() == [False] * 4 + [airborne]


@pytest.mark.parametrize(("gap", "joined"), [(0.99, True), (1.01, False)])
def test_the_floor_joins_up_to_the_stated_gap(gap, joined):
    found = surface_of([1.0, 4.0], [1.0, 1.0 + gap * surface.NEAR], 1.0, 6.0)
    assert found.fill.tolist() == [True, joined]


@pytest.mark.parametrize("turn", np.arange(8) * math.pi / 4)
def test_near_grain_joins_the_largest_cluster_from_every_side(turn):
    # three grains in the middle of a cell of the search grid (side 2.1, first cell about grain 4), one in the cell beside it
    gap, middle = 0.1, 50.0 + 3.5 * 2.1
    x = np.array([middle, middle + 0.01, middle - 0.01, middle + 2.05 * math.cos(turn), 50.0])
    y = np.array([middle, middle, middle, middle + 2.05 * math.sin(turn), 50.0])
    c = overlaps(x[:3], y[:3], np.ones(3))
    joined = joined_to_bed(discs(x, y, 1.0), np.ones(5, bool), c.i, c.j, gap)
    assert joined.tolist() == [True] * 4 + [False]


def test_grains_at_the_same_wall_are_not_joined_by_it():
    x, y, radius = np.array([0.9, 0.9, 0.9]), np.array([1.0, 6.0, 11.0]), np.ones(3)
    c = overlaps(x, y, radius, width=10.0)
    assert c.j.tolist() == [-1, -1, -1]
    found = surface.find_surface(discs(x, y, radius), np.ones(3, bool), c, 10.0, 4)
    assert found.airborne.tolist() == [False, True, True]


def test_loose_grain_in_a_pore_is_of_the_fill():
    # a box of touching discs around a small loose one
    ring = [(1, 1), (3, 1), (5, 1), (1, 3), (5, 3), (1, 5), (3, 5), (5, 5)]
    x, y = np.array([*ring, (3, 3)], float).T
    radius = np.array([1.0] * 8 + [0.3])
    found = surface_of(x, y, radius, 6.0)
    assert found.fill.all()
    assert surface_of(x, y + np.array([0.0] * 8 + [5.0]), radius, 6.0).airborne.tolist() == [False] * 8 + [True]


def test_bed_thrown_up_as_a_whole_stays_the_bed():
    grains, width = bed()
    found = surface_of(grains.x, grains.y + 0.5, grains.radius[0], width)
    assert found.fill.all()


def test_falling_grid_is_airborne():
    k, m = np.meshgrid(np.arange(6.0), np.arange(5.0))
    found = surface_of(3 * k.ravel() + 1.5, 3 * m.ravel() + 1.5, 1.0, 18.0)
    assert found.airborne.all()
    assert np.all(found.eta == 0.0)


def test_absent_grains_are_neither_fill_nor_airborne():
    present = np.array([True, False, True, False])
    # the first absent one would join its neighbours, the other is below the surface
    found = surface_of([1.0, 1.0, 1.0, 1.0], [1.0, 3.0, 5.0, 0.5], 1.0, 2.0, present=present)
    assert found.fill.tolist() == [True, False, False, False]
    assert found.airborne.tolist() == [False, False, True, False]
    nothing = surface_of([1.0], [1.0], 1.0, 2.0, present=np.array([False]))
    assert not nothing.fill.any()
    assert not nothing.airborne.any()
    assert np.all(nothing.eta == 0.0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 80), st.floats(0.5, 12.0), st.floats(0.0, 0.3))
def test_bed_is_the_graph_of_all_near_pairs(seed, n, spread, gap):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, spread, n), rng.uniform(0, 2 * spread, n)
    radius = rng.uniform(0.05, 0.6, n)
    present = rng.random(n) < 0.85
    near = np.hypot(x[:, None] - x, y[:, None] - y) < radius[:, None] + radius + gap
    near &= present[:, None] & present
    label = connected_components(coo_matrix(near), directed=False)[1]
    floor = present & (y - radius < gap)
    of_bed = np.isin(label, label[floor])
    of_bed |= 2 * np.bincount(label[present], minlength=n)[label] > present.sum()
    c = overlaps(x, y, radius)
    np.testing.assert_array_equal(joined_to_bed(discs(x, y, radius), present, c.i, c.j, gap), of_bed & present)


def test_grains_far_apart_need_no_huge_grid():
    x, y = np.array([0.0, 1e9, 1e9 + 1.5]), np.array([0.5, 1e12, 1e12])
    none = np.zeros(0, np.int64)
    joined = joined_to_bed(discs(x, y, 1.0), np.ones(3, bool), none, none, 0.1)
    assert joined.tolist() == [True, True, True]


@pytest.mark.parametrize("bins", [8, 40, 41])
def test_antisymmetric_mode_of_known_shapes(bins):
    # means over bins, exact
    edge = np.linspace(0.0, 1.0, bins + 1)
    cos1 = np.diff(np.sin(np.pi * edge)) / np.pi * bins
    cos2 = np.diff(np.sin(2 * np.pi * edge)) / (2 * np.pi) * bins
    assert surface.antisymmetric_mode(0.3 + 0.02 * cos1) == pytest.approx(0.02, rel=1e-12)
    assert surface.antisymmetric_mode(0.3 + 0.02 * cos2) == pytest.approx(0.0, abs=1e-15)
    slope = 0.5 * (edge[1:] + edge[:-1])
    assert surface.antisymmetric_mode(slope) == pytest.approx(-4.0 / math.pi**2, rel=3.0 / bins**2)


def test_mirrored_surface_has_the_opposite_mode_and_the_same_roughness():
    eta = np.random.default_rng(1).uniform(0.2, 0.4, 40)
    assert surface.antisymmetric_mode(eta[::-1]) == pytest.approx(-surface.antisymmetric_mode(eta), rel=1e-12)
    assert surface.roughness(eta[::-1]) == pytest.approx(surface.roughness(eta), rel=1e-12)


def test_roughness_is_taken_about_the_line():
    t = np.arange(40.0)
    assert surface.roughness(0.2 + 0.03 * t) == pytest.approx(0.0, abs=1e-15)
    waves = np.cos(2 * np.pi * 5 * (t + 0.5) / 40)
    assert surface.roughness(0.2 + 0.03 * t + 0.01 * waves) == pytest.approx(0.01 / math.sqrt(2), rel=1e-12)
    assert surface.roughness(np.array([0.3])) == 0.0


def test_bin_centers_and_depth():
    np.testing.assert_allclose(surface.bin_centers(2.0, 4), [0.25, 0.75, 1.25, 1.75])
    assert surface.mean_depth(np.array([0.2, 0.4])) == pytest.approx(0.3)
