"""The parts that packings are made of: tests of overlap, gaps, and grains that push each other apart."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dem_cli.assembly.bodies import Bodies
from dem_cli.assembly.insertion import choose, clearances
from dem_cli.assembly.moves import lattice, move
from dem_cli.assembly.overlap import PLACED, extents, link_all, place, place_all, separate, unlink
from dem_cli.assembly.rejection import large_first
from dem_cli.assembly.relaxation import relax
from dem_cli.state import Floats, Grains


def ellipses(a: list[float], b: list[float]) -> Bodies:
    zero = np.zeros(len(a))
    return Bodies.of(Grains.ellipses(zero, zero, np.array(a), np.array(b), zero, 1.0, 1.0), np.pi * np.array(a) * b)


def pairs(count: int, radius: float = 1.0) -> Bodies:
    """Grains of two touching discs side by side."""
    x = np.tile([-radius, radius], count)
    grains = Grains.discs(x, np.zeros(2 * count), np.full(2 * count, radius), 1.0, 1.0)
    return Bodies.of(replace(grains, body=np.repeat(np.arange(count), 2)), np.full(count, 2.0 * np.pi * radius**2))


def placed_at(bodies: Bodies, x: list[float], y: list[float], angle: list[float], swell: float = 0.0) -> Floats:
    placed = np.zeros((len(bodies.a), PLACED))
    place_all(bodies, np.array(x), np.array(y), np.array(angle), np.ones(bodies.number), swell, placed)
    return placed


SIZE = st.floats(0.3, 2.0)
ANGLE = st.floats(-4.0, 4.0)


@settings(max_examples=200, deadline=None)
@given(SIZE, st.floats(1.0, 5.0), SIZE, st.floats(1.0, 5.0), ANGLE, ANGLE, ANGLE, st.floats(0.1, 6.0))
def test_separate_is_a_gap_in_some_direction(
    a: float, k: float, c: float, m: float, i: float, j: float, way: float, far: float
) -> None:
    """Compared with the widest of the gaps in 4000 directions, except where that is nearly zero."""
    bodies = ellipses([a, c], [a / k, c / m])
    dx, dy = far * math.cos(way), far * math.sin(way)
    placed = placed_at(bodies, [0.0, dx], [0.0, dy], [i, j])
    theta = np.linspace(0.0, 2.0 * np.pi, 4000)
    reach = np.hypot(a * np.cos(theta - i), a / k * np.sin(theta - i)) + np.hypot(
        c * np.cos(theta - j), c / m * np.sin(theta - j)
    )
    widest = float(np.max(dx * np.cos(theta) + dy * np.sin(theta) - reach))
    if abs(widest) > 1e-4:
        assert separate(placed, 0, placed, 1) == (widest > 0.0)
        assert separate(placed, 1, placed, 0) == (widest > 0.0)


def test_bodies_are_measured_in_their_own_frame() -> None:
    bodies = pairs(3, 0.5)
    assert bodies.number == 3
    assert bodies.reach.tolist() == [1.0] * 3
    assert not bodies.round.any()
    assert ellipses([2.0, 1.0], [1.0, 1.0]).round.tolist() == [0.0, 1.0]
    placed = placed_at(bodies, [0.0, 5.0, 0.0], [0.0, 0.0, 7.0], [0.0, 0.5 * math.pi, 0.0])
    assert placed[2:4, :2] == pytest.approx(np.array([[5.0, -0.5], [5.0, 0.5]]))
    assert extents(placed, 2, 4) == pytest.approx((4.5, 5.5, -1.0, 1.0))
    some = bodies.take(np.array([2, 0]))
    assert (some.start.tolist(), some.owner.tolist()) == ([0, 2, 4], [0, 0, 1, 1])
    small = bodies.scaled(0.1)
    assert (small.solid, small.ox[0], small.reach[0]) == pytest.approx((0.01 * bodies.solid, -0.05, 0.1))


def test_take_keeps_each_grain_whole() -> None:
    """Grains of one and of several elements, in another order."""
    x = np.array([0.0, -1.0, 1.0, 0.0])
    grains = Grains.discs(x, np.zeros(4), np.array([3.0, 1.0, 1.1, 4.0]), 1.0, 1.0)
    bodies = Bodies.of(replace(grains, body=np.array([0, 1, 1, 2])), np.array([9.0, 2.0, 16.0]))
    some = bodies.take(np.array([2, 1]))
    assert (some.a.tolist(), some.ox.tolist()) == ([4.0, 1.0, 1.1], [0.0, -1.0, 1.0])
    assert (some.area.tolist(), some.start.tolist(), some.owner.tolist()) == ([16.0, 2.0], [0, 1, 3], [0, 1, 1])
    assert large_first(bodies).tolist() == [2, 0, 1]


def test_swollen_elements_keep_their_centres() -> None:
    bodies = pairs(1)
    placed = np.zeros((2, PLACED))
    place(bodies, 0, 3.0, 4.0, 0.0, 2.0, 0.1, placed, 0)
    assert placed[:, 0].tolist() == [1.0, 5.0]
    assert placed[:, 5] == pytest.approx([2.2, 2.2])


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.integers(0, 19)), max_size=60), st.integers(0, 2**32 - 1))
def test_chains_of_cells(changes: list[tuple[bool, int]], seed: int) -> None:
    """After any removals the chains hold exactly those that are left, each in its cell."""
    x, y = np.random.default_rng(seed).random((2, 20)) * 4.0
    head = np.empty((4, 4), dtype=np.int64)
    following, before = np.empty((2, 20), dtype=np.int64)
    link_all(np.arange(20), x, y, 1.0, head, following, before)
    left = set(range(20))
    for _, k in changes:
        if k in left:
            unlink(k, int(x[k]), int(y[k]), head, following, before)
            left.remove(k)
    found = set()
    for column in range(4):
        for row in range(4):
            k = head[column, row]
            while k >= 0:
                assert (int(x[k]), int(y[k])) == (column, row)
                found.add(int(k))
                k = following[k]
    assert found == left


# -- pushing apart -----------------------------------------------------------------------------------------------------------------


def pushed(
    bodies: Bodies, x: list[float], y: list[float], angle: list[float], width: float, height: float, most: int = 5000
):  # type: ignore[no-untyped-def]
    """(largest overlap, steps, x, y, angle) after relaxing to 1e-9."""
    places = [np.array(values, dtype=float) for values in (x, y, angle)]
    scale, velocity, pace = np.ones(len(x)), np.zeros((len(x), 3)), np.zeros(3)
    deepest, steps = relax(bodies, *places, scale, 0.0, width, height, 1e-9, most, velocity, pace)
    return deepest, steps, *places


def test_two_discs_part_about_their_middle() -> None:
    deepest, _, x, y, angle = pushed(
        ellipses([1.0, 2.0], [1.0, 2.0]), [9.0, 10.0], [10.0, 10.5], [0.3, 0.4], 20.0, 20.0
    )
    assert deepest <= 1e-9
    assert math.hypot(x[1] - x[0], y[1] - y[0]) >= 3.0 - 1e-9
    assert (x.mean(), y.mean()) == pytest.approx((9.5, 10.25), abs=1e-12)  # equal masses
    assert angle == pytest.approx([0.3, 0.4], abs=1e-12)
    assert (y[1] - y[0]) / (x[1] - x[0]) == pytest.approx(0.5)


def test_what_does_not_fit_is_jammed_not_tried_for_ever() -> None:
    """Two discs in a slot of three radii share its deficit between the three overlaps."""
    deepest, steps, x, _, _ = pushed(ellipses([1.0, 1.0], [1.0, 1.0]), [1.0, 2.2], [1.0, 1.0], [0.0, 0.0], 3.0, 2.0)
    assert deepest == pytest.approx(1.0 / 3.0, rel=0.02)
    assert steps < 1000
    assert x == pytest.approx([2.0 / 3.0, 7.0 / 3.0], abs=0.02)


@pytest.mark.parametrize("which", ["left", "right", "floor", "ceiling"])
def test_walls_push_and_turn_ellipses(which: str) -> None:
    """An ellipse that leans into a wall is pushed out, and its overlap turns it towards lying along the wall."""
    x, y = {"left": (1.2, 5.0), "right": (8.8, 5.0), "floor": (5.0, 1.2), "ceiling": (5.0, 8.8)}[which]
    start = 0.6 if which in ("floor", "ceiling") else 0.5 * math.pi + 0.6
    deepest, _, px, py, angle = pushed(ellipses([2.0], [1.0]), [x], [y], [start], 10.0, 10.0)
    assert deepest <= 1e-9
    assert angle[0] < start
    inward = {"left": px[0] - x, "right": x - px[0], "floor": py[0] - y, "ceiling": y - py[0]}[which]
    assert inward > 0.0


def test_crowded_ellipses_part() -> None:
    """A box filled to 60 % at random places ends without overlaps, whatever the aspect ratios."""
    rng = np.random.default_rng(3)
    a = np.sqrt(rng.uniform(1.0, 5.0, 40))
    bodies = ellipses(list(a), list(1.0 / a))
    side = math.sqrt(40.0 * math.pi / 0.6)
    deepest, _, x, y, angle = pushed(bodies, *(rng.random((2, 40)) * side), rng.uniform(0.0, 6.0, 40), side, side)
    assert deepest <= 1e-9
    placed = placed_at(bodies, x, y, angle, swell=-1e-8)
    assert all(separate(placed, i, placed, j) for i in range(40) for j in range(i))
    left, right, bottom, top = extents(placed, 0, 40)
    assert min(left, bottom) > -1e-8
    assert max(right, top) < side + 1e-8


def test_elements_of_a_grain_do_not_push_each_other() -> None:
    bodies = pairs(1)._replace(ox=np.array([-0.5, 0.5]))
    deepest, steps, x, y, _ = pushed(bodies, [5.0], [5.0], [0.2], 10.0, 10.0)
    assert (deepest, steps, x[0], y[0]) == (0.0, 0, 5.0, 5.0)


# -- gaps and moves ---------------------------------------------------------------------------------------------------------------


def test_clearances() -> None:
    """Between two discs, beside an ellipse, at a wall, under the ceiling, inside a grain, and far from all."""
    bodies = ellipses([1.0, 1.0, 2.0], [1.0, 1.0, 1.0])
    x, y, angle = np.array([2.0, 6.0, 4.0]), np.array([3.0, 3.0, 9.0]), np.array([0.0, 0.0, 0.5 * math.pi])
    points = np.array([[4.0, 3.0], [5.5, 9.0], [0.2, 6.0], [8.0, 19.7], [2.0, 3.5], [15.0, 12.0], [4.0, 6.0]])
    head = np.empty((11, 11), dtype=np.int64)
    following, before = np.empty((2, 3), dtype=np.int64)
    link_all(np.arange(3), x, y, 2.0, head, following, before)
    found = clearances(points, bodies, x, y, placed_at(bodies, x, y, angle), 20.0, 20.0, 2.0, head, following, 3.0)
    assert found == pytest.approx([1.0, 0.5, 0.2, 0.3, -0.5, 3.0, 1.0], abs=1e-9)
    order = np.argsort(-found, kind="stable")
    assert choose(points, found, order, 2).tolist() == [5, 0]
    assert choose(points, found, order, 99).tolist() == [5, 0, 6, 1, 3, 2]
    assert choose(points, np.array([2.0, 2.5, 0.0, 0.0, 0.0, 0.0, 0.0]), np.array([1, 0]), 9).tolist() == [1, 0]
    assert choose(points, np.array([4.0, 4.5, 0.0, 0.0, 0.0, 0.0, 0.0]), np.array([1, 0]), 9).tolist() == [1]


@pytest.mark.parametrize(("lift", "sinks"), [(1e-9, True), (1e9, False)])
def test_moves_sink_as_heavy_grains_do(lift: float, sinks: bool) -> None:
    """A lone disc in a tall box: without heat it only sinks, to the floor; with much heat it wanders all over the box."""
    bodies = ellipses([1.0], [1.0])
    x, y, angle = np.array([5.0]), np.array([50.0]), np.array([0.0])
    placed = placed_at(bodies, list(x), list(y), list(angle))
    head, following, before = np.full((6, 51), -1, dtype=np.int64), np.array([-1]), np.array([-1])
    link_all(np.arange(1), x, y, 2.0, head, following, before)
    heights = []
    rng = np.random.default_rng(1)
    step, turn = np.full((2, 1), 0.5)
    for _ in range(60):
        move(
            bodies,
            x,
            y,
            angle,
            10.0,
            100.0,
            2.0,
            step,
            turn,
            lift,
            rng.random((500, 5)),
            placed,
            2.0,
            head,
            following,
            before,
            1.0,
        )
        heights.append(y[0])
    if sinks:
        assert np.all(np.diff(heights) <= 30.0 * lift)
        assert 1.0 <= heights[-1] < 1.01
        assert step[0] < 0.01  # only small moves are kept at the floor
    else:
        assert np.ptp(heights) > 40.0
        assert step[0] == 2.0
    assert angle[0] == 0.0
    assert placed[0, :2].tolist() == [x[0], y[0]]


def test_height_of_a_grain_in_a_heat_bath() -> None:
    """Metropolis: heights above the floor are distributed as exp(-y / l), so their mean and standard deviation are l."""
    bodies, lift = ellipses([1.0], [1.0]), 20.0
    x, y, angle = np.array([5.0]), np.array([21.0]), np.array([0.0])
    placed = placed_at(bodies, list(x), list(y), list(angle))
    head, following, before = np.full((6, 201), -1, dtype=np.int64), np.array([-1]), np.array([-1])
    link_all(np.arange(1), x, y, 2.0, head, following, before)
    rng, heights = np.random.default_rng(2), []
    step, turn = np.full((2, 1), 2.0)
    for _ in range(20000):
        move(
            bodies, x, y, angle, 10.0, 400.0, 2.0, step, turn, lift, rng.random((20, 5)), placed, 2.0,
            head, following, before, 1.0,
        )  # fmt: skip
        heights.append(y[0] - 1.0)
    assert np.mean(heights) == pytest.approx(lift, rel=0.15)
    assert np.std(heights) == pytest.approx(lift, rel=0.2)


@pytest.mark.parametrize("width", [2.1, 2.9, 3.2, 7.0, 40.0])
def test_lattice_fits_between_the_walls(width: float) -> None:
    bodies = ellipses([1.0] * 30, [1.0] * 30)
    x, y = lattice(bodies, width)
    assert x.min() >= 1.0 - 1e-12
    assert x.max() <= width - 1.0 + 1e-12
    assert y.min() >= 1.0
    distance = np.hypot(x[:, None] - x, y[:, None] - y) + 9.0 * np.eye(30)
    assert distance.min() >= 2.0
