"""Leapfrog, the printed scheme of the thesis, and the limit of the time step (physics.md 0, 1.5)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from few_grains import KN, MASS, RADIUS, Bench, G, few_grains, floor, run_for, segments, series

from dem_cli.engines.explicit.lists import FINE
from dem_cli.engines.explicit.timestep import critical_time_step, disc_modes, thesis_time_step

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
    size = v**2 - 0.5 * OMEGA * omega_dt * x * v + (OMEGA * x) ** 2
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
    dt = 0.05 * math.sqrt(MASS / KN)
    bench = few_grains([0.0], [RADIUS + height], walls=floor(), gravity=(0.0, -G), dt=dt)
    frames = run_for(bench, 103 * 2.0 * math.sqrt(2.0 * height / G), every=100)
    vy = series(frames, "vy")
    energy = np.array([frame.energy.stored for frame in frames]) / (MASS * G * height)
    flying = np.array([len(frame.contacts) == 0 for frame in frames])
    assert np.count_nonzero((vy[:-1] < 0.0) & (vy[1:] >= 0.0)) >= 100
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


def lattice_limit(ks: float, h: float) -> float:
    """Largest stable step [s] of an endless hexagonal lattice, from its two fastest modes; at most 11 % below the truth.

    A mode with stiffness K, dashpots C and mass m has w^2 = K/m, z = C/(2 m w) and the limit (2/w) (sqrt(1 + z^2) - z).
    Neighbours that move against each other: K = 6 (kn + ks), C = 6 (cn + cs). All turn in one sense: K = 24 ks, C = 24 cs.
    """
    cn, cs = (2.0 * h * math.sqrt(0.5 * MASS * k) for k in (KN, ks))
    limits = []
    for stiffness, dashpots in ((6.0 * (KN + ks), 6.0 * (cn + cs)), (24.0 * ks, 24.0 * cs)):
        omega = math.sqrt(stiffness / MASS)
        z = dashpots / (2.0 * MASS * omega)
        limits.append(2.0 / omega * (math.sqrt(1.0 + z * z) - z))
    return min(limits)


def lattice(h: float, ks: float) -> Bench:
    """A hexagonal patch squeezed in a box and at rest there."""
    overlap = 1e-3 * RADIUS
    side, row = 2.0 * RADIUS - overlap, (2.0 * RADIUS - overlap) * 0.5 * math.sqrt(3.0)
    x = np.concatenate([np.arange(SIZE - k % 2) * side + (k % 2) * 0.5 * side for k in range(SIZE + 1)])
    y = np.concatenate([np.full(SIZE - k % 2, k * row) for k in range(SIZE + 1)])
    edge = RADIUS - 0.5 * overlap
    left, right, bottom, top = -edge, x.max() + edge, -edge, y.max() + edge
    walls = segments(
        [
            (left, bottom, left, top),
            (right, bottom, right, top),
            (left, bottom, right, bottom),
            (left, top, right, top),
        ],
        1e3,
    )
    omega = math.sqrt(KN / MASS)
    bench = few_grains(
        x, y, walls=walls, dt=0.02 / omega, contact_friction=1e3, contact_damping_ratio=h, contact_tension="damping",
        material_tangential_stiffness=f"{ks!r} N/m",
    )  # fmt: skip
    assert bench.steps(5000, damping=(0.3 * omega, 0.0)) == FINE
    return bench


def loudness(bench: Bench, dt: float, steps: int) -> float:
    """Kinetic energy after many steps over that of a small disturbance at the start; infinite where the run broke down."""
    state = bench.state
    n = len(state.mass)
    size = 1e-7 * RADIUS * math.sqrt(KN / MASS) * state.dt
    state.rows[:n, 2:5] = np.random.default_rng(5).normal(0.0, size, (n, 3))
    start = bench.frame().energy.kinetic
    return bench.frame().energy.kinetic / start if bench.steps(steps, dt) == FINE else math.inf


@pytest.mark.parametrize("ks", [KN / 3.0, KN, 0.1 * KN])
@pytest.mark.parametrize("h", [0.0, 0.3, 1.0])
def test_limit_of_the_time_step_is_sharp(h, ks):
    limit = lattice_limit(ks, h)
    quiet = loudness(lattice(h, ks), 0.9 * limit, 3000)
    loud = loudness(lattice(h, ks), 1.35 * limit, 3000)
    assert quiet < (2.0 if h == 0.0 else 1e-6)
    assert loud > 100.0


@pytest.mark.parametrize("h", [0.0, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("ratio", [1.0, 0.5, 1.0 / 3.0])
def test_engine_stays_below_the_limit_of_a_lattice(ratio, h):
    found = critical_time_step(KN, ratio * KN, h, h, disc_modes(np.array([MASS])))
    assert 0.8 * lattice_limit(ratio * KN, h) < found < 1.001 * lattice_limit(ratio * KN, h)


def test_time_steps_in_closed_form():
    np.testing.assert_allclose(thesis_time_step(KN, MASS), 2.0 * math.pi * math.sqrt(MASS / KN) / 8.0, rtol=1e-14)
    # without dashpots 2/w of the fastest mode: w^2 = 8 kn/m for ks = kn/3
    np.testing.assert_allclose(
        critical_time_step(KN, KN / 3.0, 0.0, 0.0, disc_modes(np.array([MASS]))),
        2.0 / math.sqrt(8.0 * KN / MASS),
        rtol=1e-14,
    )
