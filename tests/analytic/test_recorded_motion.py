"""Ground motion from samples: its integrals in closed form, and grains in a container that it shakes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from few_grains import KN, MASS, RADIUS, G, few_grains, floor, run_for, series, times
from hypothesis import given
from hypothesis import strategies as st

from dem_cli.engines.motion import Recorded, SineShaking, Still, ground_of
from dem_cli.scenario import Run, Shake

STEP = 0.01
SAMPLES = np.stack(
    [
        4.0 * np.sin(2 * np.pi * 3.0 * STEP * np.arange(41)) * np.hanning(41),
        1.5 * np.cos(2 * np.pi * 5.0 * STEP * np.arange(41)) * np.hanning(41) ** 2,
    ],
    axis=1,
)  # fmt: skip


def recorded(begin: float = 0.0, seed: int | None = None) -> Recorded:
    samples = SAMPLES if seed is None else np.random.default_rng(seed).normal(size=(17, 2))
    return Recorded(STEP, begin, samples)


def test_straight_lines_between_samples():
    ground = recorded(begin=0.05)
    time = 0.05 + STEP * np.arange(41)
    np.testing.assert_allclose(ground.acceleration(time), SAMPLES, atol=1e-13)
    middle = ground.acceleration(time[:-1] + 0.3 * STEP)
    np.testing.assert_allclose(middle, 0.7 * SAMPLES[:-1] + 0.3 * SAMPLES[1:], atol=1e-13)
    assert not ground.acceleration(np.array([0.0, 0.0499, 0.4501, 7.0])).any()


@given(st.integers(0, 2**31), st.floats(-0.1, 0.4), st.floats(1e-6, 0.2))
def test_motion_is_the_integral(seed, start, span):
    """Over any time: the change of velocity and displacement is what Gauss' rule, exact here, gives on the pieces between samples."""
    ground = recorded(begin=0.03, seed=seed)
    end = start + span
    cuts = np.unique(np.clip(np.concatenate([[start, end], 0.03 + STEP * np.arange(17)]), start, end))
    nodes, weights = np.polynomial.legendre.leggauss(3)
    velocity, place = ground.motion(start)[1], ground.motion(start)[0]
    for left, right in pairwise(cuts):
        half = 0.5 * (right - left)
        # away from the ends, where the acceleration may jump
        t = left + half * (nodes + 1.0)
        a = ground.acceleration(t)
        place = place + velocity * 2.0 * half + half * ((right - t) * weights) @ a
        velocity = velocity + half * weights @ a
    found = ground.motion(end)
    np.testing.assert_allclose(found[1], velocity, atol=1e-11)
    np.testing.assert_allclose(found[0], place, atol=1e-12)
    np.testing.assert_allclose(found[2], ground.acceleration(np.array([end]))[0], atol=1e-12)


def test_at_rest_before_and_uniform_after():
    ground = recorded(begin=0.2, seed=3)
    assert not ground.motion(0.1).any()
    assert not ground.motion(0.2)[:2].any()
    end = ground.motion(0.2 + 16 * STEP)
    later = ground.motion(0.2 + 16 * STEP + 0.7)
    np.testing.assert_allclose(later[1], end[1], rtol=1e-12)
    np.testing.assert_allclose(later[0], end[0] + 0.7 * end[1], rtol=1e-12)
    assert not later[2].any()


def test_finely_sampled_sine_is_the_sine():
    omega, a = 2 * np.pi * 2.0, 3.0
    fine = 1e-4 * np.arange(10001)
    ground = Recorded(1e-4, 0.0, np.stack([a * np.sin(omega * fine), 0.0 * fine], axis=1))
    for t in (0.013, 0.25, 0.77777, 1.0):
        x, v, _ = ground.motion(t)[:, 0]
        np.testing.assert_allclose(v, a / omega * (1.0 - math.cos(omega * t)), atol=1e-6)
        np.testing.assert_allclose(x, a / omega * (t - math.sin(omega * t) / omega), atol=1e-6)


def test_kind_of_ground_of_a_stage(tmp_path):
    (tmp_path / "a.csv").write_text("t [s],x [m/s^2],y [m/s^2]\n0,0,0\n0.1,1,2\n0.2,-1,1\n0.3,0,0\n0.4,0,0\n")
    assert isinstance(ground_of(Run.model_validate({"kind": "run", "duration": "1 s"})), Still)
    sine = {"kind": "shake", "amplitude": "1 gal", "frequency": "1 Hz", "duration": "1 s"}
    assert isinstance(ground_of(Shake.model_validate(sine)), SineShaking)
    record = {"file": "a.csv", "baseline": "none", "second": {"column": "y"}}
    stage = Shake.model_validate({"kind": "shake", "record": record, "angle": "30 deg"})
    with pytest.raises(ValueError, match="has not been read"):
        ground_of(stage)
    stage.read_record(tmp_path)
    ground = ground_of(stage)
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    # the second component stands at right angles to the first, anticlockwise
    wanted = [1.0 * c - 2.0 * s, 1.0 * s + 2.0 * c]
    np.testing.assert_allclose(ground.acceleration(np.array([0.1]))[0], wanted, rtol=1e-13)


@pytest.mark.parametrize("begin", [0.0, 0.033])
def test_free_grain_stays_where_it_is(begin):
    # Seen from outside nothing touches it; the leapfrog's own error is that of the trapezoidal rule on each step.
    ground = recorded(begin=begin)
    bench = few_grains([0.0], [0.0], ground=ground, dt=1e-5)
    frames = run_for(bench, 0.5, every=500)
    seen = np.stack([series(frames, "x"), series(frames, "y")], axis=1) + np.array([f.ground[0] for f in frames])
    moved = max(np.abs(f.ground[0]).max() for f in frames)
    assert moved > 0.005
    np.testing.assert_allclose(seen, 0.0, atol=1e-6 * moved)
    np.testing.assert_allclose([frame.residual for frame in frames], 0.0, atol=1e-9 * MASS)


def test_rolling_on_a_shaken_floor():
    # As under a sine: the floor's friction gives the disc a third of its acceleration, so v = -2/3 of the ground's velocity.
    ground = Recorded(STEP, 0.0, SAMPLES * [1.0, 0.0])
    stiff = 1e9
    bench = few_grains(
        [0.0], [RADIUS - MASS * G / stiff], walls=floor(0.5), ground=ground, gravity=(0.0, -G), contact_friction=0.5,
        contact_damping_ratio=0.3, material={"normal_stiffness": "1e9 N/m", "tangential_stiffness": "1e9 N/m"},
        dt=0.1 * math.sqrt(MASS / stiff),
    )  # fmt: skip
    frames = run_for(bench, 0.42, every=1000)
    velocity = -2.0 / 3.0 * np.array([ground.motion(t)[1, 0] for t in times(frames)])
    place = -2.0 / 3.0 * np.array([ground.motion(t)[0, 0] for t in times(frames)])
    np.testing.assert_allclose(series(frames, "vx"), velocity, rtol=0, atol=2e-4 * np.abs(velocity).max())
    np.testing.assert_allclose(series(frames, "x"), place, rtol=0, atol=1e-4 * np.abs(place).max())
    energy = 0.75 * MASS * velocity**2
    work = np.array([frame.energy.work for frame in frames])
    np.testing.assert_allclose(work, energy, rtol=0, atol=2e-4 * energy.max())
    np.testing.assert_allclose([frame.residual / energy.max() for frame in frames], 0.0, atol=1e-6)


def test_ledger_closes_where_it_slips_and_hops():
    # Both components, ten and thirty times as strong: the disc slides, and leaves the floor.
    ground = Recorded(STEP, 0.01, SAMPLES * [10.0, 30.0])
    bench = few_grains(
        [0.0], [RADIUS - MASS * G / KN], walls=floor(0.2), ground=ground, gravity=(0.0, -G), contact_friction=0.2,
        dt=0.02 * math.sqrt(MASS / KN), contact_damping_ratio=0.3,
    )  # fmt: skip
    frames = run_for(bench, 0.45, every=50)
    scale = max(frame.energy.kinetic for frame in frames)
    assert frames[-1].energy.friction > 0.01 * scale
    assert any(len(frame.contacts) == 0 for frame in frames)
    np.testing.assert_allclose([frame.residual / scale for frame in frames], 0.0, atol=1e-5)


def test_vertical_component_weighs():
    # A slow record along y: the floor bears m (g + a).
    time = 0.1 * np.arange(21)
    ground = Recorded(0.1, 0.0, np.stack([0.0 * time, 2.0 * np.sin(np.pi * time / 2.0) ** 2], axis=1))
    bench = few_grains([0.0], [RADIUS - MASS * G / KN], walls=floor(), ground=ground, gravity=(0.0, -G),
                       dt=0.1 * math.sqrt(MASS / KN), contact_damping_ratio=0.3)  # fmt: skip
    frames = run_for(bench, 1.0, every=200)
    force = np.array([frame.contacts.normal.sum() for frame in frames])
    wanted = MASS * (G + ground.acceleration(times(frames))[:, 1])
    np.testing.assert_allclose(force, wanted, rtol=0, atol=2e-3 * MASS * G)
