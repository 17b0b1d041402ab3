"""Void ratio and porosity: lattices, overlaps, and the union of random discs against a raster."""

from __future__ import annotations

import math

import numpy as np
import pytest
from analysis_samples import discs, overlaps
from hypothesis import given, settings
from hypothesis import strategies as st

from dem_cli.analysis.clipping import lens_area
from dem_cli.analysis.void_ratio import (
    Rectangle,
    WindowMargins,
    container,
    inner_window,
    porosity,
    solid_area,
    void_ratio,
)

offset = st.floats(0.0, 2.0)


def solids(x, y, r, window):
    radius = np.full(len(x), r)
    return solid_area(discs(x, y, radius), np.ones(len(x), bool), overlaps(x, y, radius), window)


@settings(max_examples=50, deadline=None)
@given(offset, offset, st.sampled_from([0.0, 0.002, 0.02]))
def test_square_lattice_over_whole_cells(u, v, press):
    # any window of 3 x 2 periods holds the same solids, wherever it cuts the discs and their overlaps
    r, pitch = 1.0, 2.0 * (1.0 - press)
    k, m = np.meshgrid(np.arange(9.0), np.arange(8.0))
    window = Rectangle(2 * pitch + u, 2 * pitch + v, 5 * pitch + u, 4 * pitch + v)
    found = porosity(window.area, solids(k.ravel() * pitch, m.ravel() * pitch, r, window))
    exact = 1.0 - (math.pi - 2.0 * lens_area(pitch, r, r)) / pitch**2
    assert found == pytest.approx(exact, abs=1e-12)
    if press == 0.0:
        assert found == pytest.approx(1.0 - math.pi / 4.0, abs=1e-12)


@settings(max_examples=50, deadline=None)
@given(offset, offset, st.sampled_from([0.0, 0.002, 0.02]))
def test_hexagonal_lattice_over_whole_cells(u, v, press):
    r, pitch = 1.0, 2.0 * (1.0 - press)
    height = pitch * math.sqrt(0.75)
    k, m = np.meshgrid(np.arange(9.0), np.arange(10.0))
    x = (k + 0.5 * (m % 2)).ravel() * pitch
    window = Rectangle(2 * pitch + u, 2 * height + v, 5 * pitch + u, 6 * height + v)
    found = porosity(window.area, solids(x, m.ravel() * height, r, window))
    exact = 1.0 - (math.pi - 3.0 * lens_area(pitch, r, r)) / (pitch * height)
    assert found == pytest.approx(exact, abs=1e-12)
    if press == 0.0:
        assert found == pytest.approx(1.0 - math.pi / (2.0 * math.sqrt(3.0)), abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_union_of_overlapping_discs_against_a_raster(seed):
    # a wavy row of discs of many sizes, each overlapping the next: no spot lies in three of them
    rng = np.random.default_rng(seed)
    n = 12
    radius = rng.uniform(0.5, 1.0, n)
    step = radius[:-1] + radius[1:] - rng.uniform(0.0, 0.2, n - 1)
    turn = rng.uniform(0.0, 0.3, n - 1) * (-1.0) ** np.arange(n - 1)
    x = np.concatenate([[0.0], np.cumsum(step * np.cos(turn))])
    y = np.concatenate([[0.0], np.cumsum(step * np.sin(turn))])
    window = Rectangle(x[2] + 0.3, -0.4, x[9] - 0.2, 0.5)
    spots = 1200
    u = window.x0 + (np.arange(spots) + 0.5) * (window.x1 - window.x0) / spots
    v = window.y0 + (np.arange(spots) + 0.5) * (window.y1 - window.y0) / spots
    covers = np.zeros((spots, spots), int)
    for k in range(n):
        covers += (u[:, None] - x[k]) ** 2 + (v[None, :] - y[k]) ** 2 < radius[k] ** 2
    assert covers.max() == 2
    found = solid_area(discs(x, y, radius), np.ones(n, bool), overlaps(x, y, radius), window)
    assert found == pytest.approx((covers > 0).mean() * window.area, rel=2e-4)


def test_only_members_count():
    x, y, radius = np.array([0.0, 1.5, 3.0]), np.zeros(3), np.ones(3)
    everywhere = Rectangle(-math.inf, -math.inf, math.inf, math.inf)
    area = solid_area(discs(x, y, radius), np.array([True, True, False]), overlaps(x, y, radius), everywhere)
    assert area == pytest.approx(2.0 * math.pi - lens_area(1.5, 1.0, 1.0))


def test_what_is_pressed_into_a_wall_is_no_solid_of_the_container():
    x, y, radius = np.array([0.9, 5.0]), np.array([5.0, 0.0]), np.ones(2)
    area = solid_area(discs(x, y, radius), np.ones(2, bool), overlaps(x, y, radius, width=10.0), container(10.0))
    cap = math.acos(0.9) - 0.9 * math.sqrt(1.0 - 0.81)
    assert area == pytest.approx(1.5 * math.pi - cap, abs=1e-14)


def test_both_ratios_and_their_limits():
    assert void_ratio(5.0, 4.0) == pytest.approx(0.25)
    assert porosity(5.0, 4.0) == pytest.approx(0.2)
    assert math.isnan(void_ratio(5.0, 0.0))
    assert porosity(5.0, 0.0) == 1.0
    assert math.isnan(porosity(0.0, 0.0))


def test_inner_window_keeps_its_margins():
    assert inner_window(2.0, 1.0, WindowMargins(side=0.1, bottom=0.25, top=0.5)) == (0.2, 0.25, 1.8, 0.5)
    assert Rectangle(1.0, 0.0, 0.5, 1.0).area == 0.0
