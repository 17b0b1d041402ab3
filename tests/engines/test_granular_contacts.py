"""Contacts of the granular element engine: forces, contact stiffness, sliders, walls and what sliding dissipates."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from granular_samples import KN, KT, RADIUS, cluster, few
from hypothesis import given
from hypothesis import strategies as st

from dem_cli.engines.granular_element.contacts import LOST, SHEAR, contact_stiffness, is_stale, renew
from dem_cli.engines.granular_element.ledger import lose, lose_in_step, lost_so_far
from dem_cli.engines.granular_element.sample import Sample
from dem_cli.state import Floats

SEEDS = st.integers(0, 10**6)


def fixing(sample: Sample) -> Floats:
    return sample.look().room.fixing


def shaken(seed: int, share: float, **law: Any) -> Sample:
    """A cluster whose discs have moved at random since the anchor, by up to `share` of their overlap."""
    sample = few(cluster(seed), **law)
    rng = np.random.default_rng(seed + 1)
    sample.x += rng.uniform(-share, share, sample.x.shape) * 0.02 * RADIUS
    sample.look()
    return sample


def pair(overlap: float = 1e-4, **law: Any) -> Sample:
    """Two discs of different radius in touch along x, by `overlap` [m]."""
    radius = np.array([RADIUS, 0.6 * RADIUS])
    return few([(0.0, 0.0), (radius.sum() - overlap, 0.0)], radius=radius, **law)


def stiffness_of(sample: Sample) -> Floats:
    """Blocks (n, 3, 3) of contact_stiffness."""
    six, last = np.empty((len(sample.x), 6)), np.zeros((len(sample.x), 2))
    contact_stiffness(sample.x, sample.near, sample.law, sample.box, six, last)
    return six[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)


@pytest.mark.parametrize("rough", [0.0, 50.0])
def test_contact_stiffness_is_the_change_of_the_fixing_force(rough: float) -> None:
    """(8) by central differences, at overlaps so small that turning the normal changes nothing; discs in touch with others and two walls."""
    overlap = 1e-6 * RADIUS
    d = 2.0 * RADIUS - overlap
    corner = RADIUS - overlap - 1.0
    places = corner + np.array([(0.0, 0.0), (d, 0.0), (0.5 * d, math.sqrt(0.75) * d)])
    sample = few(places, friction=50.0, wall_friction=[rough] * 4)
    assert sample.look().room.touching.tolist() == [
        4,
        3,
        2,
    ]  # the lower ones also touch the floor, the first one the wall left
    blocks, step = stiffness_of(sample), 0.01 * overlap
    for i in range(3):
        measured = np.empty((3, 3))
        for k in range(3):
            ends = []
            for sign in (1.0, -1.0):
                moved = sample.copy()
                moved.x[i, k] += sign * step
                ends.append(fixing(moved)[i])
            measured[:, k] = (ends[0] - ends[1]) / (2.0 * step)
        np.testing.assert_allclose(blocks[i], measured, atol=1e-5 * KN)
        assert np.linalg.eigvalsh(blocks[i]).min() > 0.01 * KN


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, 4.0])
def test_contact_stiffness_of_one_contact(angle: float) -> None:
    """T' diag(kn, kt) T with rows n and (t, 1) of T; the normal of the last contact is told, outwards."""
    n, t = np.array([math.cos(angle), math.sin(angle), 0.0]), np.array([-math.sin(angle), math.cos(angle), 1.0])
    sample = few([(0.0, 0.0), n[:2] * 1.99 * RADIUS])
    np.testing.assert_allclose(stiffness_of(sample)[0], KN * np.outer(n, n) + KT * np.outer(t, t), atol=1e-9 * KN)
    six, last = np.empty((2, 6)), np.zeros((2, 2))
    contact_stiffness(sample.x, sample.near, sample.law, sample.box, six, last)
    np.testing.assert_allclose(last, [n[:2], -n[:2]], atol=1e-12)


def test_a_disc_without_contacts_has_no_stiffness() -> None:
    assert not stiffness_of(few([(0.0, 0.0), (3.0 * RADIUS, 0.0)])).any()


@given(SEEDS, st.floats(0.0, 2.0), st.floats(0.0, 3.0))
def test_action_is_reaction(seed: int, friction: float, cohesion: float) -> None:
    """Forces cancel. Moments cancel but for shear times overlap in each contact: the arm of the shear force is the radius."""
    sample = shaken(seed, 0.5, friction=friction, cohesion=cohesion)
    found, near = fixing(sample), sample.near
    scale = np.abs(found).max() + KN * 1e-9
    assert np.abs(found[:, :2].sum(axis=0)).max() <= 1e-12 * scale
    moment = (sample.x[:, 0] * found[:, 1] - sample.x[:, 1] * found[:, 0] + RADIUS * found[:, 2]).sum()
    assert moment == pytest.approx((near.shear * near.normal / KN).sum(), abs=1e-12 * scale)


@given(SEEDS, st.floats(0.0, 1.0), st.floats(0.0, 3.0))
def test_no_pull_and_within_the_limit(seed: int, friction: float, cohesion: float) -> None:
    sample = shaken(seed, 3.0, friction=friction, cohesion=cohesion)
    near = sample.near
    apart = np.hypot(*(sample.x[near.second, :2] - sample.x[near.first, :2]).T)
    np.testing.assert_allclose(near.normal, KN * np.maximum(2.0 * RADIUS - apart, 0.0), atol=1e-9)
    assert np.all(near.normal >= 0.0)
    limit = np.where(near.normal > 0.0, friction * near.normal + cohesion, 0.0)
    assert np.all(np.abs(near.shear) <= limit * (1.0 + 1e-12))
    never = (near.normal == 0.0) & (near.memory[SHEAR] == 0.0)
    assert np.all(near.slip[never] == 0.0)  # of one that opened all that its spring had


@given(SEEDS)
def test_normal_forces_are_the_slope_of_the_stored_energy(seed: int) -> None:
    """Without friction the fixing force is the work of a small move over its length, (22) with (5)."""
    sample = shaken(seed, 0.3)
    move = np.random.default_rng(seed).uniform(-1.0, 1.0, sample.x.shape) * 1e-8 * RADIUS
    ahead, behind = sample.copy(), sample.copy()
    ahead.x += move
    behind.x -= move
    gained = ahead.look().energy.sum() - behind.look().energy.sum()
    assert gained == pytest.approx(2.0 * (fixing(sample) * move).sum(), rel=1e-4, abs=1e-15)


def test_stored_energy_of_a_pair() -> None:
    sample = pair(friction=10.0)
    sample.x[1, 1] += 2e-6
    energy = sample.look().energy
    near = sample.near
    assert energy[0] == pytest.approx(0.5 * near.normal[0] ** 2 / KN, rel=1e-12)
    assert energy[1] == pytest.approx(0.5 * near.shear[0] ** 2 / KT, rel=1e-12)
    assert energy[2] == 0.0


@pytest.mark.parametrize("move", [(0, 1, -1.0), (1, 1, 1.0), (0, 2, -1.0), (1, 2, -1.0)])
def test_shear_force_of_a_pair(move: tuple[int, int, float]) -> None:
    """By kt times the sliding of disc 1 on disc 2, against it: the second one pushed up, or turned clockwise, is held back."""
    sample, slide = pair(friction=10.0), 1e-7
    disc, part, sense = move
    sample.x[disc, part] += sense * slide
    found = fixing(sample)
    assert sample.near.shear[0] == pytest.approx(-KT * slide, rel=1e-5)
    # fixing force: what holds the discs. The first is drawn up with the second, so it is held down
    tilt = sample.near.normal[0] * (sample.x[1, 1] - sample.x[0, 1]) / (1.6 * RADIUS)
    np.testing.assert_allclose(found[:, 1] - [tilt, -tilt], [-KT * slide, KT * slide], rtol=1e-3)
    np.testing.assert_allclose(found[:, 2], -KT * slide, rtol=1e-5)


def test_turning_as_one_body_costs_nothing() -> None:
    """The tangent in the middle of the way: after a turn by 0.01 what is left is of order overlap times angle."""
    sample, angle = pair(1e-9, friction=1e9), 0.01
    c, s = math.cos(angle), math.sin(angle)
    sample.x[:, :2] = sample.x[:, :2] @ np.array([(c, s), (-s, c)])
    sample.x[:, 2] += sample.bodies.radius * angle
    sample.look()
    assert abs(sample.near.shear[0]) < 1e-5 * KT * 1.6 * RADIUS * angle


def test_gears_roll_freely() -> None:
    sample = pair(friction=10.0)
    sample.x[0, 2] += 1e-4
    sample.x[1, 2] -= 1e-4
    sample.look()
    assert abs(sample.near.shear[0]) < 1e-9
    assert sample.near.normal[0] > 0.0


def test_slider_goes_back_the_way_it_came() -> None:
    """From the anchor: pt = clip(pt0 + kt u), whatever was in between, with 0.5 pn + 2 N as the limit."""
    sample = pair(1e-4, friction=0.5, cohesion=2.0)
    limit = 0.5 * KN * 1e-4 + 2.0
    for slide in (1e-5, 2e-4, -3e-4, 5e-5, 0.0):
        sample.x[1, 2] = -slide
        sample.look()
        expected = min(max(-KT * slide, -limit), limit)
        assert sample.near.shear[0] == pytest.approx(expected, rel=1e-12, abs=1e-12)
        assert sample.near.slip[0] == pytest.approx((-KT * slide - expected) / KT, abs=1e-15)
    sample.x[1, 2] = -2e-4
    sample.look()
    sample.begin()  # now the slider starts from its limit: back by a tenth of the slide it is off it
    sample.x[1, 2] = -1.8e-4
    sample.look()
    assert sample.near.shear[0] == pytest.approx(-limit + KT * 2e-5, rel=1e-12)


def test_cohesion_only_while_touching() -> None:
    sample = pair(1e-6, friction=0.0, cohesion=3.0)
    sample.x[1, 2] = -1e-3
    sample.look()
    assert sample.near.shear[0] == -3.0
    assert sample.contacts().sliding.tolist() == [True]
    sample.begin()
    sample.x[1, 0] += 2e-6
    assert not fixing(sample).any()
    assert len(sample.contacts()) == 0
    sample.x[1, 0] -= 2e-6
    sample.begin()
    sample.look()
    assert sample.near.shear[0] == 0.0  # forgotten


@pytest.mark.parametrize("side", range(4))
def test_friction_of_each_wall(side: int) -> None:
    """Sliding along a wall by u gives -kt u up to that wall's friction; rolling on it gives none. The sliding of contacts is told."""
    rough = [0.1, 0.2, 0.3, 0.4]
    out = np.array([(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)][side])
    along = np.array([-out[1], out[0]])
    overlap = 1e-4
    start = few([out * (1.0 - RADIUS + overlap)], wall_friction=rough)
    for slide, expected in ((1e-6, KT * 1e-6), (-1e-6, -KT * 1e-6), (1e-3, rough[side] * KN * overlap)):
        sample = start.copy()
        sample.x[0, :2] += slide * along
        found = fixing(sample)[0]
        np.testing.assert_allclose(found[:2], KN * overlap * out + expected * along, rtol=1e-9)
        assert found[2] == pytest.approx(expected, rel=1e-9)
        contact = sample.contacts()
        assert contact.j.tolist() == [-1 - side]
        assert contact.sliding.tolist() == [slide == 1e-3]
    rolled = start.copy()
    rolled.x[0, :2] += 1e-5 * along
    rolled.x[0, 2] -= 1e-5
    np.testing.assert_allclose(fixing(rolled)[0], [*(KN * overlap * out), 0.0], atol=1e-9)


def test_sums_of_the_walls() -> None:
    """Stress across x and y is the mean of both walls' forces over side and depth."""
    half, overlap = (2.0 * RADIUS, 3.0 * RADIUS), 1e-4
    sample = few([(-half[0] + RADIUS - overlap, 0.0), (half[0] - RADIUS, half[1] - RADIUS + 2.0 * overlap)], half)
    np.testing.assert_allclose(
        sample.stress(sample.look()) * sample.depth,
        [0.5 * KN * overlap / (2.0 * half[1]), 0.5 * KN * 2.0 * overlap / (2.0 * half[0])],
        rtol=1e-9,
    )


def test_body_force_is_taken_off() -> None:
    """F = sum T' P - B (5)."""
    np.testing.assert_array_equal(fixing(few([(0.0, 0.0)], load=(1.0, -2.0))), [[-1.0, 2.0, 0.0]])


def test_what_sliding_costs() -> None:
    """(28): mean shear force times slip where there was force at both ends, and nothing where one end is free."""
    sample = pair(1e-4, friction=0.5)
    limit = 0.5 * KN * 1e-4
    sample.x[1, 2] = -5e-4
    sample.look()
    lose(sample.near, False)
    slip = 5e-4 - limit / KT
    assert lost_so_far(sample.near) == pytest.approx(0.5 * limit * slip, rel=1e-9)
    began = sample.anchor.copy()
    lose_in_step(sample.x, began, sample.near, sample.law)
    assert lost_so_far(sample.near) == pytest.approx(0.5 * limit * slip, rel=1e-9)
    sample.begin()
    assert lost_so_far(sample.near) == 0.0
    sample.x[1, 0] += 1e-3  # opens
    sample.x[1, 2] -= 1e-3
    sample.look()
    lose(sample.near, False)
    lose_in_step(sample.x, began, sample.near, sample.law)
    assert lost_so_far(sample.near) == 0.0


@pytest.mark.parametrize("side", range(4))
def test_what_sliding_along_a_wall_costs(side: int) -> None:
    out = np.array([(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)][side])
    sample = few([out * (1.0 - RADIUS + 1e-4)], wall_friction=[0.5] * 4)
    began, limit = sample.x.copy(), 0.5 * KN * 1e-4
    sample.x[0, :2] += 3e-4 * np.array([-out[1], out[0]])
    sample.x[0, 2] += 2e-4
    sample.look()
    lose(sample.near, False)
    both = [sample.near.wall_memory[LOST, 0]]
    lose_in_step(sample.x, began, sample.near, sample.law)
    both.append(sample.near.wall_memory[LOST, 0])
    np.testing.assert_allclose(both, 0.5 * limit * (5e-4 - limit / KT), rtol=1e-6)


@given(SEEDS)
def test_a_new_list_changes_no_force(seed: int) -> None:
    """Sliders keep what they have, found or not by both lists; discs at walls too."""
    sample = few(cluster(seed), (4.0 * RADIUS, 2.75 * RADIUS), friction=0.4, wall_friction=[0.3] * 4)
    rng = np.random.default_rng(seed)
    sample.x += rng.uniform(-0.01, 0.01, sample.x.shape) * RADIUS
    sample.look()
    sample.begin()
    before = fixing(sample).copy()
    sample.near.memory[LOST] = 1.0
    kept = sample.copy()
    kept.near = renew(kept.x, kept.bodies, kept.law, kept.box, 2.0 * kept.skin, kept.near)
    np.testing.assert_allclose(fixing(kept), before, rtol=0, atol=1e-12 * KN * RADIUS)
    assert kept.near.memory[LOST].sum() == sample.near.first.size
    assert np.any(kept.near.wall_normal > 0.0)
    kept.near = renew(kept.x, kept.bodies, kept.law, kept.box, 1e-6 * kept.skin, kept.near)
    np.testing.assert_allclose(fixing(kept), before, rtol=0, atol=1e-12 * KN * RADIUS)


def test_the_list_holds_while_nothing_moves_half_a_skin() -> None:
    sample = few(cluster(1))
    assert not is_stale(sample.x, sample.box, sample.near, sample.skin)
    for moved in ("x", "y", "wide", "high"):
        other = sample.copy()
        for share, stale in ((0.49, False), (0.51, True)):
            shift = share * sample.skin
            other.x, other.box = sample.x.copy(), sample.box.copy()
            if moved in "xy":
                other.x[5, "xy".index(moved)] -= shift
            else:
                other.box[2 + (moved == "high")] += shift
            assert is_stale(other.x, other.box, other.near, other.skin) == stale
