"""Head-on impacts against the closed forms of a linear spring and dashpot (physics.md 1.1, 1.9)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from few_grains import DENSITY, KN, RADIUS, Bench, few_grains, floor, run_for, series, times

from dem_cli.scenario.restitution import restitution

SPEED = 1.0  # m/s
PHASES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.999)  # of a step: when contact begins within one


def reduced_mass(*radii: float) -> float:
    """m_eff of discs of these radii, of a disc on a wall for one radius [kg]."""
    return 1.0 / sum(1.0 / (DENSITY * math.pi * r**2) for r in radii)


def towards(radii: tuple[float, ...], steps: int, phase: float, angle: float = 0.0, **changes) -> tuple[Bench, float]:
    """Two discs, or a disc and a floor, that meet at SPEED along `angle`, and the contact time; `steps` of dt make up one."""
    contact_time = math.pi * math.sqrt(reduced_mass(*radii) / KN)
    dt = contact_time / steps
    gap = phase * SPEED * dt
    c, s = math.cos(angle), math.sin(angle)
    if len(radii) == 1:
        x, v = [radii[0] + gap], [-SPEED]
        walls = floor(angle=angle - 0.5 * math.pi)
    else:
        x, v = [0.0, sum(radii) + gap], [0.7 * SPEED, -0.3 * SPEED]
        walls = None
    x, v = np.array(x), np.array(v)
    return few_grains(x * c, x * s, vx=v * c, vy=v * s, radius=radii, dt=dt, walls=walls, **changes), contact_time


def rebound(bench: Bench, angle: float) -> float:
    """Speed at which the bodies part, along `angle`, over SPEED."""
    grains = bench.state.grains()
    v = grains.vx * math.cos(angle) + grains.vy * math.sin(angle)
    return float(v[-1] - (v[0] if len(v) > 1 else 0.0)) / SPEED


@pytest.mark.parametrize("radii", [(RADIUS,), (RADIUS, RADIUS), (RADIUS, 3.0 * RADIUS)])
@pytest.mark.parametrize("angle", [0.0, 0.7, math.pi / 2])
def test_elastic_impact(radii, angle):
    steps = 400
    bench, contact_time = towards(radii, steps, 0.5, angle)
    momentum = bench.state.mass @ bench.state.rows[: len(radii), 2:4] / bench.state.dt
    frames = run_for(bench, 1.5 * contact_time)
    m = reduced_mass(*radii)
    overlap = np.array([frame.contacts.overlap.sum() for frame in frames])
    force = np.array([frame.contacts.normal.sum() for frame in frames])
    t = times(frames)
    np.testing.assert_allclose(overlap.max(), SPEED * math.sqrt(m / KN), rtol=2e-5)
    np.testing.assert_allclose(force.max(), SPEED * math.sqrt(KN * m), rtol=2e-5)
    # Contact lasts from where its first overlaps meet zero to where its last ones do.
    inside = np.flatnonzero(overlap > 0.0)
    lasted = t[inside[-1]] - t[inside[0]] + (overlap[inside[0]] + overlap[inside[-1]]) / SPEED
    np.testing.assert_allclose(lasted, contact_time, rtol=1e-5)
    np.testing.assert_allclose(rebound(bench, angle), 1.0, rtol=1e-7)
    if len(radii) == 2:
        grains = bench.state.grains()
        moved = grains.mass @ np.stack([grains.vx, grains.vy], axis=1)
        np.testing.assert_allclose(moved, momentum, rtol=0, atol=1e-12 * math.hypot(*momentum))


@pytest.mark.parametrize("tension", ["none", "damping"])
@pytest.mark.parametrize("radii", [(RADIUS,), (RADIUS, 2.0 * RADIUS)])
@pytest.mark.parametrize("h", [0.05, 0.2, 0.5, 0.9])
def test_restitution(h, radii, tension):
    # The dashpot acts from the first step in contact on, and with the velocity half a step ago, so the error is of first
    # order: below a quarter of w dt, whatever part of a step contact begins at.
    for steps in (200, 800, 8000):
        for phase in PHASES if steps < 8000 else (0.0, 0.6, 0.999):
            bench, _ = towards(radii, steps, phase, contact_damping_ratio=h, contact_tension=tension)
            bench.steps(6 * steps)
            assert not len(bench.frame().contacts)
            bound = 1e-4 if steps == 8000 else 0.25 * math.pi / steps
            np.testing.assert_allclose(rebound(bench, 0.0), restitution(h, tension), rtol=0, atol=bound)


@pytest.mark.parametrize("h", [0.05, 0.2, 0.5, 0.9])
def test_restitution_extrapolated(h):
    # From tc/200 and tc/400 the term of first order can be removed; without tension it is smooth in the time step.
    for phase in PHASES:
        found = []
        for steps in (200, 400):
            bench, _ = towards((RADIUS,), steps, phase, contact_damping_ratio=h)
            bench.steps(6 * steps)
            found.append(rebound(bench, 0.0))
        np.testing.assert_allclose(2.0 * found[1] - found[0], restitution(h, "none"), rtol=0, atol=1e-4)


@pytest.mark.parametrize("tension", ["none", "damping"])
@pytest.mark.parametrize("e", [0.95, 0.5, 0.2])
def test_restitution_given(e, tension):
    bench, _ = towards((RADIUS, RADIUS), 8000, 0.5, contact_restitution=e, contact_tension=tension)
    bench.steps(6 * 8000)
    np.testing.assert_allclose(rebound(bench, 0.0), e, rtol=0, atol=1e-4)


def test_ledger_of_an_impact():
    # All that is lost goes through the dashpot: (1 - e^2) of m_eff v^2 / 2.
    bench, contact_time = towards((RADIUS, RADIUS), 4000, 0.5, contact_damping_ratio=0.3)
    frames = run_for(bench, 1.2 * contact_time, every=100)
    brought = 0.5 * reduced_mass(RADIUS, RADIUS) * SPEED**2
    lost = (1.0 - rebound(bench, 0.0) ** 2) * brought
    np.testing.assert_allclose(frames[-1].energy.dashpot_normal / brought, lost / brought, rtol=1e-6)
    np.testing.assert_allclose([frame.residual / brought for frame in frames], 0.0, atol=2e-6)
    assert np.all(np.diff([frame.energy.dashpot_normal for frame in frames]) >= 0.0)
    assert frames[-1].energy.friction == frames[-1].energy.dashpot_tangential == 0.0


@pytest.mark.parametrize("tension", ["none", "damping"])
def test_pull_only_where_allowed(tension):
    bench, contact_time = towards((RADIUS,), 400, 0.5, contact_damping_ratio=0.4, contact_tension=tension)
    lowest = min(frame.contacts.normal.min(initial=0.0) for frame in run_for(bench, 2.0 * contact_time))
    if tension == "none":
        assert lowest == 0.0
    else:
        # As the contact ends, d = 0 and the dashpot pulls with cn e v.
        pull = 2.0 * 0.4 * math.sqrt(reduced_mass(RADIUS) * KN) * restitution(0.4, tension) * SPEED
        np.testing.assert_allclose(lowest, -pull, rtol=0.02)


def test_newtons_row():
    # An elastic disc hits the first of three that do not quite touch: the last one leaves with all of its speed.
    gap = 0.1 * RADIUS
    contact_time = math.pi * math.sqrt(reduced_mass(RADIUS, RADIUS) / KN)
    x = (2.0 * RADIUS + gap) * np.arange(4)
    bench = few_grains(x, np.zeros(4), vx=[0.2, 0.0, 0.0, 0.0], dt=contact_time / 200)
    frames = run_for(bench, 3.5 * (gap / 0.2 + contact_time), every=20)
    np.testing.assert_allclose(frames[-1].grains.vx, [0.0, 0.0, 0.0, 0.2], atol=1e-7)
    total = sum(series(frames, "vx", k) for k in range(4))
    np.testing.assert_allclose(total, 0.2, rtol=1e-13)
