"""Leapfrog, the printed scheme of the thesis, and the limit of the time step (physics.md 0, 1.5)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from few_grains import KN, KS, MASS, RADIUS, G, Bench, few_grains, floor, run_for, segments, series

from dem_cli.engines.explicit.lists import FINE
from dem_cli.engines.explicit.timestep import critical_time_step, thesis_time_step

OMEGA = math.sqrt(2.0 * KN / MASS)  # rad/s: a disc between two walls that both press on it
SQUEEZE = 1e-3 * RADIUS


def squeezed(dt: float, integrator: str, **changes) -> Bench:
    """A disc in a gap that is too narrow for it by SQUEEZE a side, off its middle by a third of that: a linear oscillator."""
    gap = RADIUS - SQUEEZE
    walls = segments([(-gap, -1.0, -gap, 1.0), (gap, -1.0, gap, 1.0)])
    return few_grains([SQUEEZE / 3.0], [0.0], walls=walls, dt=dt, integration_integrator=integrator, **changes)


@pytest.mark.parametrize("omega_dt", [0.02, 0.3, 1.0, 1.9])
def test_leapfrog_keeps_its_invariant(omega_dt):
    dt = omega_dt / OMEGA
    frames = run_for(squeezed(dt, "leapfrog"), 2000 * dt, every=7)
    x, v = series(frames, "x"), series(frames, "vx")
    # v^2 + w^2 x^2 (1 - (w dt)^2/4) is what the scheme conserves of an oscillator, exactly.
    shadow = v**2 + (OMEGA * x) ** 2 * (1.0 - 0.25 * omega_dt**2)
    np.testing.assert_allclose(shadow / shadow[0], 1.0, rtol=2e-9)


@pytest.mark.parametrize("omega_dt", [0.02, 0.1, 0.3])
def test_thesis_scheme_amplifies(omega_dt):
    # v' = v - w^2 x dt, x' = x + (v + v') dt/2: determinant 1 + (w dt)^2/2 is the growth of the squared amplitude a step.
    dt = omega_dt / OMEGA
    growth = 1.0 + 0.5 * omega_dt**2
    steps = int(math.log(4.0) / math.log(growth))  # the amplitude doubles: both walls still press
    frames = run_for(squeezed(dt, "thesis"), steps * dt)
    x, v = series(frames, "x"), series(frames, "vx")
    size = v**2 - OMEGA * omega_dt / 2.0 * OMEGA * x * v / OMEGA + (OMEGA * x) ** 2
    np.testing.assert_allclose(size[1:] / size[:-1], growth, rtol=1e-9)
    assert size[-1] / size[0] > 3.0


def test_thesis_scheme_is_tamed_by_damping():
    # A dashpot of ratio h takes 2 h w dt a step: more than (w dt)^2/2 as long as w dt < 4 h.
    dt = 0.1 / OMEGA
    for h, shrinks in ((0.1, True), (0.01, False)):
        frames = run_for(squeezed(dt, "thesis", contact_damping_ratio=h), 300 * dt, every=300)
        energy = [frame.energy.kinetic + frame.energy.elastic_normal - KN * SQUEEZE**2 for frame in frames]
        assert (energy[-1] < 0.1 * energy[0]) is shrinks


def test_thesis_scheme_falls_exactly():
    dt, steps = 1e-3, 1000
    bench = few_grains([0.0], [5.0], gravity=(0.0, -G), dt=dt, integration_integrator="thesis")
    bench.steps(steps)
    grains = bench.state.grains()
    np.testing.assert_allclose(grains.y[0], 5.0 - 0.5 * G, rtol=1e-12)
    np.testing.assert_allclose(grains.vy[0], -G, rtol=1e-12)


def test_leapfrog_bounces_a_hundred_times():
    height = 2.0 * RADIUS
    dt = 0.1 * math.sqrt(MASS / KN)
    bench = few_grains([0.0], [RADIUS + height], walls=floor(), gravity=(0.0, -G), dt=dt)
    period = 2.0 * math.sqrt(2.0 * height / G)
    frames = run_for(bench, 103 * period, every=5)
    y, vy = series(frames, "y"), series(frames, "vy")
    energy = np.array([frame.energy.stored for frame in frames]) / (MASS * G * height)
    flying = np.array([len(frame.contacts) == 0 for frame in frames])
    bounces = np.count_nonzero((vy[:-1] < 0.0) & (vy[1:] >= 0.0) & (y[1:] < 1.5 * RADIUS))
    assert bounces >= 100
    drift = energy - energy[0]
    np.testing.assert_allclose(drift[flying], 0.0, atol=2e-3)
    # What the opening and closing within a step does to the energy is known; nothing else happens to it.
    gain = np.array([frame.energy.time_step for frame in frames]) / (MASS * G * height)
    np.testing.assert_allclose((drift - gain)[flying], 0.0, atol=1e-9)


def test_step_may_change_between_calls():
    # Halves of steps at both ends: a run in pieces of unlike steps is as good as one.
    bench = few_grains([0.0], [1.0], gravity=(0.0, -G), vx=0.2, dt=1e-3)
    for steps, dt in ((7, 1e-3), (1, 3.7e-4), (100, 2e-3), (3, 1e-6)):
        bench.steps(steps, dt)
    grains, t = bench.state.grains(), bench.state.time
    np.testing.assert_allclose(t, 7e-3 + 3.7e-4 + 0.2 + 3e-6, rtol=1e-12)
    np.testing.assert_allclose([grains.x[0], grains.y[0]], [0.2 * t, 1.0 - 0.5 * G * t**2], rtol=1e-12)
    np.testing.assert_allclose([grains.vx[0], grains.vy[0]], [0.2, -G * t], rtol=1e-12)


def test_order_of_the_scheme():
    # Errors of a swing around an even number of steps fall by four as the step is halved.
    error = []
    for omega_dt in (0.1, 0.05):
        dt = omega_dt / OMEGA
        bench = squeezed(dt, "leapfrog")
        bench.steps(round(20.0 / omega_dt))
        error.append(bench.state.grains().x[0] - SQUEEZE / 3.0 * math.cos(20.0))
    np.testing.assert_allclose(error[0] / error[1], 4.0, rtol=0.02)


def test_mass_damping_decays():
    # Settling with -c m v: a free disc slows as exp(-c t).
    bench = few_grains([0.0], [0.0], vx=1.0, vy=-2.0, spin=3.0, dt=1e-4)
    frames = run_for(bench, 0.5, every=500, damping=(4.0, 0.0))
    decay = np.exp(-4.0 * np.array([frame.time for frame in frames]))
    for name, start in (("vx", 1.0), ("vy", -2.0), ("spin", 3.0)):
        np.testing.assert_allclose(series(frames, name), start * decay, rtol=1e-3)
    brought = frames[0].energy.kinetic
    np.testing.assert_allclose([frame.energy.damping for frame in frames], brought * (1.0 - decay**2), rtol=0,
                               atol=1e-3 * brought)  # fmt: skip


def test_local_damping_shares_the_force():
    # Cundall's: a disc that falls has (1 - a) g, one that rises (1 + a) g.
    for sign in (1.0, -1.0):
        bench = few_grains([0.0], [0.0], vy=sign * 3.0, gravity=(0.0, -G), dt=1e-4)
        bench.steps(1000, damping=(0.0, 0.3))
        change = bench.state.grains().vy[0] - sign * 3.0
        np.testing.assert_allclose(change, -(1.0 + 0.3 * sign) * G * 0.1, rtol=1e-9)


# -- stability ----------------------------------------------------------------------------------------------------

SIZE = 12


def lattice(h: float, ks: float, share: float) -> Bench:
    """A hexagonal patch squeezed in a box, slightly shaken, moved by `share` of the critical time step."""
    overlap = 1e-3 * RADIUS
    side, row = 2.0 * RADIUS - overlap, (2.0 * RADIUS - overlap) * 0.5 * math.sqrt(3.0)
    x = np.concatenate([np.arange(SIZE - k % 2) * side + (k % 2) * 0.5 * side for k in range(SIZE + 1)])
    y = np.concatenate([np.full(SIZE - k % 2, k * row) for k in range(SIZE + 1)])
    edge = RADIUS - 0.5 * overlap
    left, right, bottom, top = -edge, x.max() + edge, -edge, y.max() + edge
    walls = segments(
        [(left, bottom, left, top), (right, bottom, right, top), (left, bottom, right, bottom), (left, top, right, top)],
        1e3,
    )
    dt = share * critical_time_step(KN, ks, MASS, h, h)
    generator = np.random.default_rng(5)
    vx, vy, spin = generator.normal(0.0, 1e-4 * overlap / math.sqrt(MASS / KN), (3, len(x)))
    return few_grains(
        x, y, vx=vx, vy=vy, spin=spin / RADIUS, walls=walls, dt=dt, contact_friction=1e3,
        contact_damping_ratio=h, contact_tension="damping", material_tangential_stiffness=f"{ks!r} N/m",
    )  # fmt: skip


def loudness(bench: Bench, steps: int) -> float:
    """Kinetic energy after many steps over the one at the start; infinite where the run broke down."""
    start = bench.frame().energy.kinetic
    return bench.frame().energy.kinetic / start if bench.steps(steps) == FINE else math.inf


@pytest.mark.parametrize("ks", [KN / 3.0, KN, 0.05 * KN])
@pytest.mark.parametrize("h", [0.0, 0.3, 1.0])
def test_limit_of_the_time_step_is_sharp(h, ks):
    for share in (0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7, 2.0):
        print("LOUD", h, ks / KN, share, loudness(lattice(h, ks, share), 3000))


def test_time_steps_in_closed_form():
    np.testing.assert_allclose(thesis_time_step(KN, MASS), 2.0 * math.pi * math.sqrt(MASS / KN) / 8.0, rtol=1e-14)
    # without dashpots 2/w of the fastest mode: w^2 = 8 kn/m for ks = kn/3
    np.testing.assert_allclose(critical_time_step(KN, KN / 3.0, MASS, 0.0, 0.0), 2.0 / math.sqrt(8.0 * KN / MASS), rtol=1e-14)
