"""One disc on one wall: gross slip, from sliding to rolling, inclines (physics.md 1.9)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from few_grains import KN, KS, MASS, RADIUS, Bench, G, few_grains, floor, run_for, series, times

from dem_cli.scenario.restitution import restitution

OMEGA = math.sqrt(KN / MASS)  # rad/s, of a disc on a wall
DT = math.pi / OMEGA / 200


def turned(x: float, y: float, angle: float) -> np.ndarray:
    """(x, y) in axes that are turned by `angle`: x along a slope, y out of it."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * x - s * y, s * x + c * y])


def on_slope(friction: float, angle: float, gravity: float, *, dt: float = DT, u: float = 0.0, **changes) -> Bench:
    """A disc that lies in balance on a floor turned by `angle`, under gravity with the angle `gravity` to its normal [rad].

    u [m/s]: speed along the floor. Its overlap carries the normal part of its weight.
    """
    overlap = MASS * G * math.cos(gravity) / KN
    x, y = turned(0.0, RADIUS - overlap, angle)
    vx, vy = turned(u, 0.0, angle)
    pull = turned(G * math.sin(gravity), -G * math.cos(gravity), angle)
    return few_grains(
        [x], [y], vx=vx, vy=vy, walls=floor(friction, angle), gravity=pull, dt=dt, contact_friction=friction, **changes
    )


def along(frames, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Speed along the floor, and the spin of a disc that would roll at it is -u/r: u and r w."""
    vx, vy = series(frames, "vx"), series(frames, "vy")
    return vx * math.cos(angle) + vy * math.sin(angle), RADIUS * series(frames, "spin")


def impact(u: float, v: float, mu: float, h: float, slider: str) -> tuple[float, float, float]:
    """Speeds (vx, vy) and spin after an impact on a floor at (u, -v)."""
    dt = DT / 10
    bench = few_grains(
        [0.0], [1.5 * RADIUS], vx=u, vy=-v, walls=floor(mu), dt=dt,
        contact_damping_ratio=h, contact_slider=slider,
    )  # fmt: skip
    bench.steps(round((0.6 * RADIUS / v + 2.0 * math.pi / OMEGA) / dt))
    grains = bench.state.grains()
    return grains.vx[0], grains.vy[0], grains.spin[0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("h", "slider"), [(0.0, "total"), (0.0, "spring"), (0.2, "total"), (0.7, "total")])
@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_oblique_gross_slip(mu, h, slider, sign):
    e = restitution(h, "none")
    v_n = 0.5
    v_t = 1.2 * 3.0 * mu * (1.0 + e) * v_n
    vx, vy, spin = impact(sign * v_t, v_n, mu, h, slider)
    # With the restitution that is found, the laws of the impact hold to rounding; with that of the formula as well as it does.
    for back, tolerance in ((vy / v_n, 1e-11), (e, 5e-4)):
        np.testing.assert_allclose(vx, sign * (v_t - mu * (1.0 + back) * v_n), rtol=tolerance)
        # anticlockwise is positive: a disc that slides to the right is spun clockwise
        np.testing.assert_allclose(spin, -sign * 2.0 * mu * (1.0 + back) * v_n / RADIUS, rtol=tolerance)


def test_oblique_gross_slip_beyond_the_limit():
    # slider = "spring": the dashpot comes on top of the limit, so more than mu of the normal impulse acts along the wall.
    vx, vy, spin = impact(2.0, 0.5, 0.2, 0.3, "spring")
    assert (2.0 - vx) / (0.2 * (0.5 + vy)) > 1.5
    np.testing.assert_allclose(spin, -2.0 * (2.0 - vx) / RADIUS, rtol=1e-11)


@pytest.mark.parametrize("angle", [0.0, 1.1])
@pytest.mark.parametrize("h", [0.0, 0.3])
def test_sliding_comes_to_roll(h, angle):
    mu, u0 = 0.2, 0.5
    bench = on_slope(mu, angle, 0.0, u=u0, contact_damping_ratio=h)
    until = u0 / (3.0 * mu * G)
    frames = run_for(bench, 2.0 * until, every=20)
    u, rw = along(frames, angle)
    t = times(frames)
    slides = t < 0.98 * until
    # The spring is at its limit at once: it takes mu m g / ks of a path to get there.
    np.testing.assert_allclose(u[slides], u0 - mu * G * t[slides], rtol=0, atol=4e-5 * u0)
    np.testing.assert_allclose(rw[slides], -2.0 * mu * G * t[slides], rtol=0, atol=8e-5 * u0)
    # The point of contact conserves m u - I w / r, whatever the friction does.
    np.testing.assert_allclose(u - 0.5 * rw, u0, rtol=1e-11)
    stopped = t[np.argmax(u + rw < 1e-3 * u0)]
    np.testing.assert_allclose(stopped, until, rtol=3e-3)
    if h > 0.0:
        np.testing.assert_allclose(u[-1], 2.0 / 3.0 * u0, rtol=1e-9)
        np.testing.assert_allclose(-rw[-1], 2.0 / 3.0 * u0, rtol=1e-9)
    else:  # the spring that was stretched swings on
        rolls = t > 1.2 * until
        np.testing.assert_allclose(u[rolls].mean(), 2.0 / 3.0 * u0, rtol=1e-4)
    # A third of the energy is lost, nearly all of it to friction.
    first, last = frames[0].energy, frames[-1].energy
    brought = first.kinetic + first.elastic_tangential
    lost = last.friction + last.dashpot_tangential
    np.testing.assert_allclose((lost + last.elastic_tangential + last.kinetic) / brought, 1.0, rtol=1e-7)
    np.testing.assert_allclose(lost / brought, 1.0 / 3.0, rtol=1e-4)
    np.testing.assert_allclose([frame.residual / brought for frame in frames], 0.0, atol=1e-7)


@pytest.mark.parametrize("angle", [0.0, -0.3, 2.0])
@pytest.mark.parametrize("steepness", [0.3, 0.9, 1.1, 2.0])
def test_incline(steepness, angle):
    # Gravity turned against a level floor (angle 0), or a floor built with a slope; the slope tan q = steepness * 3 mu.
    mu = 0.25
    q = math.atan(steepness * 3.0 * mu)
    bench = on_slope(mu, angle, q, contact_damping_ratio=0.3)
    settle, duration = 0.05, 0.1
    bench.steps(round(settle / DT))
    frames = run_for(bench, duration, every=50)
    u, rw = along(frames, angle)
    t = times(frames) - frames[0].time
    if steepness < 1.0:
        rate, turn = 2.0 / 3.0 * G * math.sin(q), -2.0 / 3.0 * G * math.sin(q)
        np.testing.assert_allclose(rw, -u, rtol=1e-6)
        assert not frames[-1].contacts.sliding.any()
    else:
        rate, turn = G * (math.sin(q) - mu * math.cos(q)), -2.0 * mu * G * math.cos(q)
        assert frames[-1].contacts.sliding.all()
    np.testing.assert_allclose((u[1:] - u[0]) / t[1:], rate, rtol=1e-6)
    np.testing.assert_allclose((rw[1:] - rw[0]) / t[1:], turn, rtol=1e-6)
    # Since the start, the little path that the spring took to build up is all that is missing.
    np.testing.assert_allclose(u[-1], rate * frames[-1].time, rtol=0, atol=3.0 * mu * G * math.sqrt(MASS / KS))


def test_slope_and_turned_gravity_agree():
    # The slope built as a wall and the slope made by gravity give the same motion, seen in their own axes.
    frames = [run_for(on_slope(0.2, a, 0.5, contact_damping_ratio=0.2), 0.05, every=100) for a in (0.0, 0.5, -2.5)]
    u = [along(part, a) for part, a in zip(frames, (0.0, 0.5, -2.5), strict=True)]
    np.testing.assert_allclose(u[1], u[0], rtol=0, atol=1e-10)
    np.testing.assert_allclose(u[2], u[0], rtol=0, atol=1e-10)


def test_rolls_on_without_end():
    # Rolling without slip on a level floor costs nothing: no moment acts against it.
    bench = few_grains([0.0], [RADIUS - MASS * G / KN], vx=0.3, spin=-0.3 / RADIUS, walls=floor(0.5), dt=DT,
                       gravity=(0.0, -G), contact_friction=0.5, contact_damping_ratio=0.5)  # fmt: skip
    frames = run_for(bench, 2.0, every=4000)
    np.testing.assert_allclose(series(frames, "vx"), 0.3, rtol=1e-12)
    np.testing.assert_allclose(series(frames, "x"), 0.3 * times(frames), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(series(frames, "angle"), -0.3 / RADIUS * times(frames), rtol=1e-9, atol=1e-12)
