"""Neighbour lists from the cell grid against every pair, and the memory that goes from one list to the next."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dem_cli.geometry.cells import carry_memory, neighbour_list, neighbour_list_all_pairs, order_by_columns
from dem_cli.state import Bools, Floats, Ints

Sample = tuple[Floats, Floats, Floats, Bools, float]


def place(shape: str, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Centres (n,) [m] of grains some centimetres wide."""
    size = 0.02 * np.sqrt(n)
    x, y = rng.uniform(0.0, size, (2, n))
    if shape == "row":
        y[:] = 0.3
    elif shape == "column":
        x[:] = -2.0
    elif shape == "diagonal":
        y = -x
    elif shape == "far-flung":
        far = rng.random(n) < 0.2
        x[far] += rng.choice([-1.0, 1.0], int(far.sum())) * 10.0 ** rng.uniform(0.0, 9.0, int(far.sum()))
        y[far] += rng.choice([-1.0, 1.0], int(far.sum())) * 10.0 ** rng.uniform(0.0, 9.0, int(far.sum()))
    elif shape == "two clouds":
        x[n // 2 :] += 1e6
    elif shape == "one spot":
        x[:], y[:] = 0.1, 0.2
    elif shape == "lattice":
        x, y = 0.01 * (np.arange(n) % 7), 0.01 * (np.arange(n) // 7)
    return x, y


SHAPES = ("box", "row", "column", "diagonal", "far-flung", "two clouds", "one spot", "lattice")


@st.composite
def samples(draw: st.DrawFn) -> Sample:
    n = draw(st.integers(1, 60))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    x, y = place(draw(st.sampled_from(SHAPES)), n, rng)
    smallest = draw(st.sampled_from([1.0, 0.5, 0.02]))
    radius = 0.01 * rng.uniform(smallest, 1.0, n)
    alive = rng.random(n) >= draw(st.sampled_from([0.0, 0.3, 1.0]))
    return x, y, radius, alive, 0.01 * draw(st.sampled_from([1e-6, 0.2, 3.0]))


def pairs(start: Ints, neighbour: Ints) -> list[tuple[int, int]]:
    assert start[0] == 0
    assert start[-1] == len(neighbour)
    owner = np.repeat(np.arange(len(start) - 1), np.diff(start))
    return list(zip(owner.tolist(), neighbour.tolist(), strict=True))


def line(n: int) -> Sample:
    """Grains of one size in a row whose surfaces just touch."""
    return 0.02 * np.arange(n), np.zeros(n), np.full(n, 0.01), np.ones(n, dtype=bool), 1e-6


@settings(max_examples=300, deadline=None)
@given(samples())
@example(line(1))
@example(line(50))
def test_cells_find_what_all_pairs_find(sample: Sample) -> None:
    found, wanted = pairs(*neighbour_list(*sample)), pairs(*neighbour_list_all_pairs(*sample))
    assert len(set(found)) == len(found)
    assert set(found) == set(wanted)
    assert all(i < j for i, j in found)


@settings(max_examples=100, deadline=None)
@given(samples())
def test_all_pairs_is_the_definition(sample: Sample) -> None:
    x, y, radius, alive, skin = sample
    gap = np.hypot(x[None] - x[:, None], y[None] - y[:, None]) - radius[None] - radius[:, None]
    near = (gap < skin) & alive[None] & alive[:, None] & (np.arange(len(x))[:, None] < np.arange(len(x))[None])
    unclear = np.abs(gap - skin) < 1e-12 * (1.0 + np.abs(x[:, None]) + np.abs(y[:, None]))
    found = np.zeros_like(near)
    for i, j in pairs(*neighbour_list_all_pairs(*sample)):
        found[i, j] = True
    assert (found == near)[~unclear].all()


def test_a_dense_sample_has_many_pairs() -> None:
    """More pairs than the list has room for at first: it grows."""
    n = 200
    rng = np.random.default_rng(5)
    sample = (*rng.uniform(0.0, 0.05, (2, n)), np.full(n, 0.01), np.ones(n, dtype=bool), 0.002)
    found = pairs(*neighbour_list(*sample))
    assert len(found) > 4 * n + 64
    assert set(found) == set(pairs(*neighbour_list_all_pairs(*sample)))


@settings(max_examples=100, deadline=None)
@given(samples(), st.integers(0, 2**32 - 1))
def test_memory_goes_with_its_pair(sample: Sample, seed: int) -> None:
    """Grains move a little: pairs that stay keep their three numbers, new ones have none."""
    x, y, radius, alive, skin = sample
    rng = np.random.default_rng(seed)
    start, neighbour = neighbour_list(*sample)
    memory = rng.normal(size=(len(neighbour), 3)) * (rng.random((len(neighbour), 1)) < 0.7)
    moved = x + rng.normal(scale=0.005, size=len(x)), y + rng.normal(scale=0.005, size=len(y))
    still_alive = alive & (rng.random(len(x)) < 0.9)
    new_start, new_neighbour = neighbour_list(*moved, radius, still_alive, skin)
    carried = carry_memory(start, neighbour, memory, new_start, new_neighbour)
    known = dict(zip(pairs(start, neighbour), memory.tolist(), strict=True))
    wanted = [known.get(pair, [0.0, 0.0, 0.0]) for pair in pairs(new_start, new_neighbour)]
    assert carried.tolist() == wanted


@pytest.mark.parametrize("shape", SHAPES)
def test_order_is_by_columns(shape: str) -> None:
    n, cell = 40, 0.02
    x, y = place(shape, n, np.random.default_rng(3))
    order = order_by_columns(x, y, cell)
    assert sorted(order.tolist()) == list(range(n))
    column = np.floor((x - x.min()) / cell)[order]
    assert (np.diff(column) >= 0).all()
    if shape != "far-flung":  # there the heights of one column are lost beside those of the columns
        same = np.diff(column) == 0
        assert (np.diff(y[order])[same] >= -1e-12).all()
