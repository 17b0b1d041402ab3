"""Free fall in any direction, and grains in a shaken container (physics.md 1.7)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from few_grains import KN, MASS, RADIUS, G, few_grains, floor, run_for, scenario, series, times

from dem_cli.engines.motion import SineShaking, Still, gravity_of
from dem_cli.scenario import Shake

AMPLITUDE, FREQUENCY = 4.0, 10.0  # 400 gal, 10 Hz
OMEGA = 2.0 * math.pi * FREQUENCY


def shaking(duration: float = 1.0, ramp: float = 0.0, angle: float = 0.0) -> SineShaking:
    """The sine of these tests."""
    return SineShaking(AMPLITUDE, FREQUENCY, duration, ramp, np.array([math.cos(angle), math.sin(angle)]))


@pytest.mark.parametrize("angle", [-90.0, 0.0, 37.0, 180.0, -120.0])
def test_falls_along_gravity(angle):
    model = scenario({"container.gravity": "980.665 gal", "container.gravity_direction": f"{angle!r} deg"})
    gravity = gravity_of(model)
    radians = math.radians(angle)
    np.testing.assert_allclose(gravity, [G * math.cos(radians), G * math.sin(radians)], rtol=0, atol=1e-14)
    start = np.array([0.3, -0.2])
    bench = few_grains([start[0]], [start[1]], vx=0.7, vy=0.1, spin=2.0, gravity=gravity, dt=1e-3)
    # Leapfrog with half kicks is exact under a constant force.
    for frame in run_for(bench, 0.5, every=25):
        t, grains = frame.time, frame.grains
        place = start + np.array([0.7, 0.1]) * t + 0.5 * gravity * t**2
        np.testing.assert_allclose([grains.x[0], grains.y[0]], place, rtol=0, atol=1e-13)
        speed = np.array([0.7, 0.1]) + gravity * t
        np.testing.assert_allclose([grains.vx[0], grains.vy[0]], speed, rtol=0, atol=1e-12)
        np.testing.assert_allclose([grains.angle[0], grains.spin[0]], [2.0 * t, 2.0], rtol=1e-12)
        np.testing.assert_allclose(frame.residual, 0.0, atol=1e-12)


def test_straight_down_is_straight():
    # cos(-90 deg) is not quite zero in floating point: nothing may drift sideways for it.
    assert gravity_of(scenario({"container.gravity": "980 gal"}))[0] == 0.0


def test_sine_is_what_the_stage_says():
    stage = Shake.model_validate({
        "kind": "shake", "amplitude": "400 gal", "frequency": "10 Hz", "cycles": 20, "ramp": "0.5 s", "angle": "30 deg",
    })  # fmt: skip
    ground = SineShaking.of(stage)
    time = np.linspace(0.0, 2.0, 4001)
    a = ground.acceleration(time)
    c, s = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
    np.testing.assert_allclose(a @ [-s, c], 0.0, atol=1e-14)
    along = a @ [c, s]
    full = (time >= 0.5) & (time <= 1.5)
    np.testing.assert_allclose(along[full], 4.0 * np.sin(OMEGA * time[full]), rtol=0, atol=1e-11)
    rises = time < 0.5
    np.testing.assert_allclose(along[rises], 4.0 * time[rises] / 0.5 * np.sin(OMEGA * time[rises]), rtol=0, atol=1e-11)
    np.testing.assert_allclose(along, -along[::-1], rtol=0, atol=1e-11)  # 20 whole cycles
    assert not Still().acceleration(time).any()


@pytest.mark.parametrize("angle", [0.0, 0.5 * math.pi, 0.6])
def test_ground_moves_as_a_table(angle):
    # No drift: velocity -A/w cos(w t), displacement -A/w^2 sin(w t), about rest.
    ground = shaking(angle=angle)
    time = np.linspace(0.0, 1.0, 801)
    motion = np.array([ground.motion(t) for t in time])
    direction = np.array([math.cos(angle), math.sin(angle)])
    np.testing.assert_allclose(motion[:, 2], ground.acceleration(time), rtol=0, atol=1e-12)
    for k, wanted in (
        (1, -AMPLITUDE / OMEGA * np.cos(OMEGA * time)),
        (0, -AMPLITUDE / OMEGA**2 * np.sin(OMEGA * time)),
    ):
        scale = AMPLITUDE / OMEGA ** (2 - k)
        np.testing.assert_allclose(motion[:, k], wanted[:, None] * direction, rtol=0, atol=1e-3 * scale)


@pytest.mark.parametrize(("duration", "ramp"), [(1.0, 0.0), (1.0, 0.25), (1.03, 0.31), (0.5, 0.2), (2.0, 0.01)])
def test_ground_stays_in_place(duration, ramp):
    ground = shaking(duration, ramp)
    time = np.linspace(0.0, duration, 2001)
    motion = np.array([ground.motion(t)[:, 0] for t in time])
    assert np.abs(motion[:, 0]).max() < 2.1 * AMPLITUDE / OMEGA**2
    whole = (time >= 0.5 * duration - 1.0 / FREQUENCY) & (time < 0.5 * duration + 1.0 / FREQUENCY)
    np.testing.assert_allclose(motion[whole, 1].mean(), 0.0, atol=0.1 * AMPLITUDE / OMEGA)
    # velocity and acceleration are the derivatives of what lies above them
    for k in (0, 1):
        slope = np.gradient(motion[:, k], time)[2:-2]
        scale = AMPLITUDE / OMEGA ** (1 - k)
        np.testing.assert_allclose(slope, motion[2:-2, k + 1], rtol=0, atol=0.02 * scale)


@pytest.mark.parametrize("angle", [0.0, 1.2])
def test_free_grain_stays_where_it_is(angle):
    # Nothing touches it, so in the ground's frame it moves uniformly: with the velocity that it had at the start.
    ground = shaking(angle=angle)
    bench = few_grains([0.0], [0.0], ground=ground, dt=1e-5)
    frames = run_for(bench, 0.35, every=500)
    seen = np.stack([series(frames, "x"), series(frames, "y")], axis=1) + np.array([f.ground[0] for f in frames])
    wanted = times(frames)[:, None] * ground.motion(0.0)[1]
    np.testing.assert_allclose(seen, wanted, rtol=0, atol=1e-3 * AMPLITUDE / OMEGA**2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rolling_on_a_shaken_floor(sign):
    # The floor accelerates by a, its friction drives a disc of inertia m r^2/2: F = m (a + b), F r = -(m r^2/2)(b/r) with b the
    # acceleration as the container sees it. So b = -2 a/3, seen from outside a/3, if mu g > a/3.
    ground = SineShaking(AMPLITUDE, FREQUENCY, 1.0, 0.0, np.array([sign, 0.0]))
    stiff = 1e9  # so that the stretch of the spring hardly counts
    bench = few_grains(
        [0.0], [RADIUS - MASS * G / stiff], walls=floor(0.5), ground=ground, gravity=(0.0, -G), contact_friction=0.5,
        contact_damping_ratio=0.3, material={"normal_stiffness": "1e9 N/m", "tangential_stiffness": "1e9 N/m"},
        dt=0.1 * math.sqrt(MASS / stiff),
    )  # fmt: skip
    frames = run_for(bench, 0.35, every=2000)
    t = times(frames)
    v = -sign * 2.0 / 3.0 * AMPLITUDE / OMEGA * (1.0 - np.cos(OMEGA * t))
    x = -sign * 2.0 / 3.0 * AMPLITUDE / OMEGA * (t - np.sin(OMEGA * t) / OMEGA)
    np.testing.assert_allclose(series(frames, "vx"), v, rtol=0, atol=1e-4 * np.abs(v).max())
    np.testing.assert_allclose(series(frames, "x"), x, rtol=0, atol=1e-5 * np.abs(x).max())
    np.testing.assert_allclose(RADIUS * series(frames, "spin"), -v, rtol=0, atol=1e-4 * np.abs(v).max())
    assert not any(frame.contacts.sliding.any() for frame in frames)
    # Work of the shaking: the energy of a disc that rolls with v, and what its spring and dashpot took.
    energy = 0.75 * MASS * v**2
    work = np.array([frame.energy.work for frame in frames])
    np.testing.assert_allclose(work, energy, rtol=0, atol=1e-4 * energy.max())
    np.testing.assert_allclose([frame.residual / energy.max() for frame in frames], 0.0, atol=1e-6)


def test_slips_under_strong_shaking():
    # With mu g < a/3 most of the time the disc slips, and friction takes what the ledger says.
    ground = SineShaking(40.0, FREQUENCY, 1.0, 0.0, np.array([1.0, 0.0]))
    bench = few_grains(
        [0.0], [RADIUS - MASS * G / KN], walls=floor(0.2), ground=ground, gravity=(0.0, -G), contact_friction=0.2,
        dt=0.05 * math.sqrt(MASS / KN), contact_damping_ratio=0.3,
    )  # fmt: skip
    frames = run_for(bench, 0.3, every=50)
    last, scale = frames[-1], max(frame.energy.kinetic for frame in frames)
    assert last.energy.friction > 0.05 * scale
    assert np.all(np.diff([frame.energy.friction for frame in frames]) >= -1e-9 * scale)
    np.testing.assert_allclose([frame.residual / scale for frame in frames], 0.0, atol=1e-6)


def test_vertical_shaking_weighs():
    # Shaken slowly along y, the floor bears m (g + a).
    ground = SineShaking(2.0, 2.0, 2.0, 1.0, np.array([0.0, 1.0]))
    bench = few_grains([0.0], [RADIUS - MASS * G / KN], walls=floor(), ground=ground, gravity=(0.0, -G),
                       dt=0.1 * math.sqrt(MASS / KN), contact_damping_ratio=0.3)  # fmt: skip
    frames = run_for(bench, 1.0, every=200)
    force = np.array([frame.contacts.normal.sum() for frame in frames])
    wanted = MASS * (G + ground.acceleration(times(frames))[:, 1])
    np.testing.assert_allclose(force, wanted, rtol=0, atol=2e-3 * MASS * G)
    np.testing.assert_allclose([frame.residual for frame in frames], 0.0, atol=1e-9)


def test_work_of_shaking_a_free_grain():
    ground = shaking()
    bench = few_grains([0.0], [0.0], vx=0.3, ground=ground, dt=1e-4)
    frames = run_for(bench, 0.25, every=100)
    gained = np.array([frame.energy.kinetic for frame in frames]) - frames[0].energy.kinetic
    np.testing.assert_allclose(
        [frame.energy.work for frame in frames], gained, rtol=0, atol=1e-6 * np.abs(gained).max()
    )
    np.testing.assert_allclose([frame.residual for frame in frames], 0.0, atol=1e-6 * np.abs(gained).max())
