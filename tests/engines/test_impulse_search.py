"""Which bodies may touch: the neighbour list of spheres against all pairs, and when it is made anew."""

from __future__ import annotations

import time

import numpy as np
import pytest
from contact_samples import TINY, about, ball, box, clump, contacts, scene

from dem_cli.engines.impulse.detect import ContactSearch
from dem_cli.engines.impulse.search import neighbour_list, neighbour_list_all_pairs, order_of
from dem_cli.errors import RunError


def spread(n: int, seed: int, largest: float) -> tuple[np.ndarray, np.ndarray]:
    """Spheres of radius 1 to `largest` (most of them small) at a density of some neighbours each."""
    random = np.random.default_rng(seed)
    radius = np.exp(random.uniform(0.0, 1.0, n) ** 4 * np.log(largest))
    return random.uniform(0.0, 1.0, (n, 3)) * 2.2 * np.cbrt((radius**3).sum()), radius


@pytest.mark.parametrize("largest", [1.0, 1.7, 40.0])
@pytest.mark.parametrize("n", [0, 1, 2, 60, 400])
def test_list_holds_the_pairs_that_all_pairs_holds(n: int, largest: float) -> None:
    x, radius = spread(n, n, largest)
    alive = np.arange(n) % 7 != 3
    expected = neighbour_list_all_pairs(x, radius, alive, 0.2)
    start, neighbour = neighbour_list(x, radius, alive, 0.2)
    np.testing.assert_array_equal(start, expected[0])
    np.testing.assert_array_equal(neighbour, expected[1])


def test_a_body_thrown_far_away_costs_no_pair() -> None:
    x, radius = spread(80, 3, 5.0)
    x[7], x[30] = [1e12, -1e15, 3.0], [1e12, -1e15, 3.5]
    alive = np.ones(80, dtype=bool)
    expected = neighbour_list_all_pairs(x, radius, alive, 0.2)
    start, neighbour = neighbour_list(x, radius, alive, 0.2)
    np.testing.assert_array_equal(start, expected[0])
    np.testing.assert_array_equal(neighbour, expected[1])
    assert 30 in neighbour[start[7] : start[8]]


def test_time_grows_as_the_number_of_bodies() -> None:
    """Sixteen times the bodies take far less than 256 times as long, with sizes of 1 to 40 in one sample."""

    def least(n: int) -> float:
        x, radius = spread(n, 1, 40.0)
        alive, times = np.ones(n, dtype=bool), []
        for _ in range(3):
            start = time.perf_counter()
            neighbour_list(x, radius, alive, 0.1)
            times.append(time.perf_counter() - start)
        return min(times)

    least(100)
    assert least(16_000) < 80.0 * least(1_000)


def test_order_is_stable() -> None:
    key = np.random.default_rng(0).integers(0, 9, 101)
    np.testing.assert_array_equal(order_of(key), np.argsort(key, kind="stable"))


def test_list_is_kept_until_bodies_have_moved_half_the_skin() -> None:
    given = scene([ball()], [[0.0, 0.0, 0.0], [1.04, 0.0, 0.0], [9.0, 0.0, 0.0]])
    search = ContactSearch(given, skin=0.2)  # 0.1 m
    x, q = given.bodies.x.copy(), given.bodies.q
    assert len(search.look(x, q, TINY).i) == 0
    x[1, 0] -= 0.045
    assert len(search.look(x, q, TINY).i) == 1
    assert search.rebuilds == 1
    x[1, 0], x[2, 0] = 1.5, 1.99
    found = search.look(x, q, TINY)
    assert list(zip(found.i, found.j, strict=True)) == [(1, 2)]
    assert search.rebuilds == 2


def test_moving_bodies_have_the_contacts_of_a_fresh_search() -> None:
    random = np.random.default_rng(4)
    x = random.uniform(0.0, 3.0, (40, 3))
    given = scene([ball(0.4)], x, scale=random.uniform(0.2, 1.5, 40))
    search = ContactSearch(given)
    for step in range(30):
        x = x + random.normal(size=x.shape) * 0.002
        found = search.look(x, given.bodies.q, TINY)
        fresh = ContactSearch(given).look(x, given.bodies.q, TINY)
        for a, b in zip(found, fresh, strict=True):
            np.testing.assert_array_equal(a, b)
        assert len(found.i) > 20, step
    assert 1 < search.rebuilds < 30


def test_escaped_bodies_touch_nothing() -> None:
    given = scene([ball()], [[0.0, 0.0, 0.0], [0.9, 0.0, 0.0], [1.8, 0.0, 0.0]], planes=[([0, 0, -0.5], [0, 0, 1])])
    search = ContactSearch(given)
    assert len(search.look(given.bodies.x, given.bodies.q, TINY).i) == 5
    search.alive = np.array([True, False, True])
    found = search.look(given.bodies.x, given.bodies.q, TINY)
    assert found.i.tolist() == [0, 2]
    assert found.j.tolist() == [-1, -1]


def test_place_that_is_no_number_is_refused() -> None:
    given = scene([ball()], [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    search = ContactSearch(given)
    x = given.bodies.x.copy()
    x[1, 2] = np.nan
    with pytest.raises(RunError, match="body 1"):
        search.look(x, given.bodies.q, TINY)
    search.look(given.bodies.x, given.bodies.q, TINY)
    with pytest.raises(RunError, match="body 1"):
        search.look(x, given.bodies.q, TINY)


def test_buffers_grow() -> None:
    """Far more contacts than the first buffer holds, all of them written."""
    many = clump(
        np.stack([np.repeat(np.arange(20), 20), np.tile(np.arange(20), 20), np.zeros(400)], axis=1) - 9.5,
        np.full(400, 0.5),
    )
    given = scene([many], [[0.0, 0.0, 10.0]], planes=[([0, 0, 0], [0, 0, 1])])
    found = contacts(given)
    assert len(found.i) == 400
    assert len(set(found.key.tolist())) == 400
    np.testing.assert_allclose(found.gap, 0.0, atol=1e-12)


def test_contacts_are_sorted_and_named_once() -> None:
    random = np.random.default_rng(2)
    x = random.uniform(0.0, 3.2, (40, 3))
    q = np.array([about(random.normal(size=3), angle) for angle in random.uniform(0, 6, 40)])
    given = scene(
        [box(), ball()], x, which=np.arange(40) % 2, q=q, planes=[([0, 0, 0], [0, 0, 1]), ([0, 0, 0], [1, 0, 0])]
    )
    found = contacts(given)
    rows = list(zip(found.i.tolist(), found.j.tolist(), found.key.tolist(), strict=True))
    assert rows == sorted(rows)
    assert len(set(rows)) == len(rows)
    assert len(rows) > 100
    assert np.all((found.j < 0) | (found.j > found.i))
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, atol=1e-12)


def test_the_same_look_gives_the_same_bits() -> None:
    x, _ = spread(60, 9, 1.0)
    given = scene([box()], x * 0.15)
    for a, b in zip(contacts(given), contacts(given), strict=True):
        np.testing.assert_array_equal(a, b)
