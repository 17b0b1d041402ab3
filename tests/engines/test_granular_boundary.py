"""Boundaries of the granular element engine: chains, membranes, their area, and what servos are told."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from granular_samples import DEPTH, KN, RADIUS, few
from hypothesis import given
from hypothesis import strategies as st

from dem_cli.engines.granular_element.boundary import (
    Chain,
    area_inside,
    follow_box,
    membrane_forces,
    membrane_stiffness,
    servo_errors,
)
from dem_cli.engines.granular_element.chains import membranes, release, ring_around
from dem_cli.engines.granular_element.contacts import DRIVEN, MEMBRANE, TIED, XX, YY, Bodies, Law
from dem_cli.engines.granular_element.sample import Sample, servos
from dem_cli.state import Floats

HALF = (7.3 * RADIUS, 5.2 * RADIUS)
PRESSURE, LINK = 12.0e3, 0.1 * KN
SEEDS = st.integers(0, 10**6)


def surrounded(closed: bool) -> Sample:
    """A box without grains in a ring, or between two membranes, which are still held."""
    box = np.array([0.01, -0.02, *HALF])
    places, string = ring_around(box, RADIUS) if closed else membranes(box, RADIUS)
    n = len(places)
    x = np.zeros((n, 3))
    x[:, :2] = places
    bodies = Bodies(np.full(n, RADIUS), np.zeros((n, 2)), np.full(n, DRIVEN, dtype=np.int64), 0)
    law = Law(KN, KN, 0.0, 0.0, np.zeros(4), np.array([False, False, not closed, not closed]))
    after = np.roll(places, -1, axis=0) - places
    chain = Chain(
        np.arange(n), (places - box[:2]) / box[2:], string, np.hypot(*after.T), LINK, np.full(1, PRESSURE), closed
    )
    return Sample(x, box, box[2:].copy(), bodies, law, chain, DEPTH)


def bulged(seed: int) -> Sample:
    """Membranes that are free and have moved at random, their ends along x only."""
    sample = surrounded(False)
    release(sample)
    tied = sample.bodies.kind == TIED
    push = np.random.default_rng(seed).uniform(-0.1, 0.1, (len(sample.x), 2)) * RADIUS
    push[tied, 1] = 0.0
    sample.x[:, :2] += push
    sample.x[:, :2] *= [1.0, 1.03]  # so that most of the links pull
    return sample


def free_moves(sample: Sample, seed: int) -> Floats:
    move = np.random.default_rng(seed + 1).uniform(-1.0, 1.0, (len(sample.x), 2)) * 1e-6 * RADIUS
    move[sample.bodies.kind == TIED, 1] = 0.0
    return move


def links(sample: Sample, move: Any = 0.0, pressure: float = 0.0) -> tuple[float, Floats]:
    """Energy of the links and fixing forces of the membrane, moved."""
    sample.chain.pressure[0] = pressure
    x, fixing = sample.x.copy(), np.zeros_like(sample.x)
    x[:, :2] += move
    return membrane_forces(x, sample.bodies, sample.chain, DEPTH, fixing), fixing


def area(sample: Sample, move: Any = 0.0) -> float:
    x = sample.x.copy()
    x[:, :2] += move
    return float(area_inside(x, sample.box, sample.bodies, sample.chain))


def test_ring_lies_around_the_box() -> None:
    """Grains touch the box from outside, and their neighbours, anticlockwise from the lower left corner."""
    sample = surrounded(True)
    places = (sample.x[:, :2] - sample.box[:2]) / (sample.box[2:] + RADIUS)
    np.testing.assert_allclose(np.abs(places).max(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(places[0], -1.0)
    step = np.roll(sample.x, -1, axis=0) - sample.x
    length = np.hypot(step[:, 0], step[:, 1])
    assert np.all((length > RADIUS) & (length < 2.0 * RADIUS * (1.0 + 1e-6)))
    turn = np.cross(np.append(step[:, :2], np.zeros((len(step), 1)), axis=1), np.roll(step, -1, axis=0))[:, 2]
    assert np.sum(turn > 1e-9) == 4
    assert np.all(turn > -1e-12)


def test_area_in_a_ring() -> None:
    """The rectangle through the centres, less half a disc for each on a side and a quarter in each corner."""
    sample, m = surrounded(True), len(surrounded(True).x)
    wide, high = 2.0 * (sample.box[2:] + RADIUS)
    assert area(sample) == pytest.approx(wide * high - (0.5 * (m - 4) + 0.25 * 4) * math.pi * RADIUS**2, rel=1e-12)
    assert sample.area == area(sample)


def test_ring_moves_with_the_box() -> None:
    """Affinely, about the centre."""
    sample = surrounded(True)
    before = sample.x[:, :2] - sample.box[:2]
    sample.box[2:] *= [1.01, 0.98]
    follow_box(sample.x, sample.box, sample.bodies, sample.chain)
    np.testing.assert_allclose(sample.x[:, :2] - sample.box[:2], before * [1.01, 0.98], rtol=1e-12, atol=1e-15)


def test_area_between_membranes() -> None:
    """At the start the box between the centres of both chains, less half a disc for each grain."""
    sample = surrounded(False)
    expected = 4.0 * (sample.box[2] + RADIUS) * sample.box[3] - 0.5 * len(sample.x) * math.pi * RADIUS**2
    assert area(sample) == pytest.approx(expected, rel=1e-12)


@given(SEEDS)
def test_pressure_does_the_work_of_the_area(seed: int) -> None:
    """A follower load: p times the change of area, times depth, for any small move of the membrane."""
    sample = bulged(seed)
    sample.chain = sample.chain._replace(rest=sample.chain.rest + 1.0)  # links are slack
    move = free_moves(sample, seed)
    _, fixing = links(sample, 0.0, PRESSURE)
    work = float((sample.bodies.load * move).sum())
    np.testing.assert_array_equal(fixing[:, :2], -sample.bodies.load)
    gained = 0.5 * (area(sample, move) - area(sample, -move))
    assert work == pytest.approx(-PRESSURE * DEPTH * gained, rel=1e-6, abs=1e-12 * PRESSURE * DEPTH * RADIUS**2)


def test_pressure_pushes_inwards() -> None:
    """On a straight membrane p times height times depth in all."""
    sample = surrounded(False)
    release(sample)
    links(sample, 0.0, PRESSURE)
    right, load = sample.x[:, 0] > sample.box[0], sample.bodies.load
    for side, sign in ((right, -1.0), (~right, 1.0)):
        assert load[side, 0].sum() == pytest.approx(sign * PRESSURE * DEPTH * 2.0 * sample.box[3], rel=1e-12)
        assert np.all(sign * load[side, 0] > 0.0)
    np.testing.assert_allclose(load[:, 1], 0.0, atol=1e-12)


@given(SEEDS)
def test_links_are_the_slope_of_their_energy(seed: int) -> None:
    sample = bulged(seed)
    move = free_moves(sample, seed)
    _, fixing = links(sample)
    energy = [links(sample, sign * move)[0] for sign in (1.0, -1.0)]
    assert energy[0] - energy[1] == pytest.approx(2.0 * float((fixing[:, :2] * move).sum()), rel=1e-4, abs=1e-15)
    assert np.abs(fixing.sum(axis=0)).max() < 1e-12 * LINK * RADIUS


def test_links_only_pull() -> None:
    """And none joins the two membranes."""
    sample = surrounded(False)
    release(sample)
    energy, fixing = links(sample)
    assert energy < 1e-20 * LINK * RADIUS**2  # nothing but rounding
    assert np.abs(fixing).max() < 1e-12 * LINK * RADIUS
    middle = len(sample.x) // 4
    up = sample.x[:, 0] > sample.box[0]
    sample.x[middle:, 1] += np.where(up[middle:], 1e-3, 0.0)
    energy, fixing = links(sample)
    assert energy == pytest.approx(0.5 * LINK * 1e-6, rel=1e-9)
    assert fixing[middle, 1] == pytest.approx(LINK * 1e-3, rel=1e-9)
    assert fixing[middle - 1, 1] == pytest.approx(-LINK * 1e-3, rel=1e-9)
    sample.x[middle:, 1] -= np.where(up[middle:], 2e-3, 0.0)
    assert links(sample)[0] < 1e-20 * LINK * RADIUS**2
    sample.x[~up, 0] -= 1.0
    assert links(sample)[0] < 1e-20 * LINK * RADIUS**2


@pytest.mark.parametrize("seed", range(3))
def test_membrane_stiffness_is_the_change_of_the_links(seed: int) -> None:
    sample = bulged(seed)
    blocks = np.zeros((len(sample.x), 6))
    membrane_stiffness(sample.x, sample.bodies, sample.chain, blocks)
    step = 1e-7 * RADIUS
    for i in range(1, len(sample.x), 3):
        for k in range(2):
            move = np.zeros((len(sample.x), 2))
            move[i, k] = step
            slope = (links(sample, move)[1][i, :2] - links(sample, -move)[1][i, :2]) / (2.0 * step)
            np.testing.assert_allclose(blocks[i, [0, 1]] if k == 0 else blocks[i, [1, 3]], slope, atol=1e-5 * LINK)


def test_release() -> None:
    """Ends are tied to their height, the others free, and links without force where they are; a ring is never let go."""
    sample = surrounded(False)
    sample.x[:, 0] *= 1.1
    release(sample)
    m = len(sample.x) // 2
    assert np.flatnonzero(sample.bodies.kind == TIED).tolist() == [0, m - 1, m, 2 * m - 1]
    assert np.sum(sample.bodies.kind == MEMBRANE) == 2 * (m - 2)
    assert links(sample)[0] == 0.0
    ring = surrounded(True)
    release(ring)
    assert np.all(ring.bodies.kind == DRIVEN)


def test_stress_of_a_ring_counts_arms_to_the_contacts() -> None:
    """One disc between two driven ones along x: force times the width between its contacts, over the area."""
    d = 1.99 * RADIUS
    sample = few([(0.0, 0.0), (d, 0.0), (0.0, d), (-d, 0.0), (0.0, -d)], driven=[1, 2, 3, 4])
    sample.x[[2, 4], 1] *= 1.1  # those do not touch
    view = sample.look()
    force = KN * 0.01 * RADIUS
    assert view.sums[XX] == pytest.approx(force * d, rel=1e-12)
    assert view.sums[YY] == 0.0
    np.testing.assert_allclose(sample.stress(view), [force * d / (sample.area * DEPTH), 0.0])


def test_servo_errors() -> None:
    """A servo's error closes the gap of stress in one go where only walls give way; gaps are closed where nothing touches."""
    half = (3.0 * RADIUS, RADIUS - 1e-4)
    sample = few([(-2.0 * RADIUS + 1e-6, 0.0), (0.0, 0.0), (2.0 * RADIUS - 1e-6, 0.0)], half)
    sample.box[2] -= 1e-5
    sample.look()
    kn, r, error, push = KN, RADIUS, np.zeros(2), np.zeros(2)
    now = sample.stress(sample.look())
    target = now + np.array([50.0, -70.0])
    both = servos([(1.0, 0.0), (0.0, 1.0)], [(1.0, 0.0), (0.0, 1.0)], target.tolist(), 100.0)
    worst = servo_errors(both, sample.look().sums, sample.area, DEPTH, sample.box, kn, r, error, push)
    assert worst == pytest.approx(0.7, rel=1e-9)
    hx, hy = sample.box[2:]
    # two contacts across x, six across y: dp = kn * h * e on each; stress is the mean of both sides over side and depth
    np.testing.assert_allclose(
        error, [50.0 * 2.0 * hy * DEPTH / (kn * hx), -70.0 * 2.0 * hx * DEPTH / (3.0 * kn * hy)], rtol=1e-9
    )
    np.testing.assert_allclose(push, [2.0 * KN * hx * hx * error[0], 6.0 * KN * hy * hy * error[1]], rtol=1e-9)
    sample.box[2] += 1e-3
    gap = sample.look().sums
    servo_errors(both, gap, sample.area, DEPTH, sample.box, kn, r, error, push)
    assert error[0] == pytest.approx(0.01 * r / max(sample.box[2:]), rel=1e-9)  # no further in one iteration
