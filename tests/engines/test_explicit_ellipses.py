"""Ellipses in the explicit engine: the disc as a limit, laws of conservation, forces that do not jump, and what is shown of contacts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from body_samples import angular_momentum, ellipses, momentum, swing
from engine_samples import box, engine_of, loose_grains
from few_grains import KN, MASS, RADIUS, Bench, bench_of, few_grains, segments
from hypothesis import given, settings
from hypothesis import strategies as st

from dem_cli.engines.explicit import build
from dem_cli.engines.explicit.ellipses import Outlines, enlarged_overlap
from dem_cli.engines.explicit.forces import FX, FY, MOBILITY, TURN
from dem_cli.engines.explicit.state import ExplicitState, no_lists
from dem_cli.geometry.ellipse import outline, wall_gap, widest_gap
from dem_cli.state import Floats, Grains

DT = math.pi * math.sqrt(MASS / KN) / 50
NOTHING = np.zeros((0, 2))
EVERY = 5


def as_ellipses(state: ExplicitState) -> None:
    """Make a state of discs go the way of ellipses."""
    n = len(state.mass)
    fours = build.aligned(4 * (n + 2)).reshape(-1, 4)
    fours[:n, 0], fours[:n, 3] = state.radius**2, 1.0 / state.radius
    fours[n:, 0] = fours[n:, 3] = 1.0
    state.outlines, state.lists = Outlines(fours.reshape(-1), np.zeros(n), False), no_lists(n, True)


# -- discs are a limit -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("settled", [True, False], ids=["heap", "impacts"])
def test_discs_as_ellipses(settled: bool, settled_box: Callable[[int, int], Grains]) -> None:
    """Friction, damping, walls and spins: the code for ellipses moves discs as that for discs does."""
    scenario = box({"contact.damping_ratio": 0.4, "contact.friction": 0.3})
    grains = settled_box(60, 1) if settled else loose_grains(60, seed=5, width=0.16, speed=0.15)
    one, two = engine_of(scenario, grains), engine_of(scenario, grains)
    as_ellipses(two.state)
    field = np.tile(one.gravity + np.array([2.0, 0.0]), (401 if settled else 801, 1))
    for engine in (one, two):
        engine.state.first_forces()
        engine.state.advance(engine.time_step, field, NOTHING)
    a, b = one.state.grains(), two.state.grains()
    # Where a contact turns by t in a step, one step of Newton's method leaves t^4/8 of the distance, and impacts make more of it.
    size, close = a.radius.min(), 1e-12 if settled else 1e-10
    for name in ("x", "y", "vx", "vy"):
        assert np.abs(getattr(a, name) - getattr(b, name)).max() < close, name
    for name in ("angle", "spin"):
        assert np.abs(getattr(a, name) - getattr(b, name)).max() * size < close, name
    ours, theirs = one.state.contacts(), two.state.contacts()
    assert (ours.i.tolist(), ours.j.tolist()) == (theirs.i.tolist(), theirs.j.tolist())
    struck = np.abs(a.spin - grains.spin) > 1e-3
    assert len(ours) > 60 if settled else np.count_nonzero(struck) > 8
    for name in ("nx", "ny", "px", "py", "overlap", "stretch"):
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), rtol=0, atol=1e-11)
    for name in ("normal", "shear"):
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), rtol=0, atol=1e-5)
    np.testing.assert_allclose(two.state.ledger, one.state.ledger, rtol=1e-9, atol=1e-12)


def test_ratio_of_one_among_ellipses() -> None:
    """Two discs far from the only ellipse of a sample collide as two discs do."""
    dt, speed = DT, 0.3
    plain = few_grains([0.0, 2.2 * RADIUS], [0.0, 0.7 * RADIUS], vx=[speed, 0.0], spin=[5.0, -3.0], dt=dt,
                       contact_friction=0.3)  # fmt: skip
    mixed = ellipses([0.0, 2.2 * RADIUS, 1.0], [0.0, 0.7 * RADIUS, 0.0], np.array([1.0, 1.0, 2.0]))
    mixed.vx[0], mixed.spin[:2] = speed, (5.0, -3.0)
    among = bench_of(mixed, dt=dt, contact_friction=0.3)
    for bench in (plain, among):
        bench.steps(300)
    one, two = plain.frame().grains, among.frame().grains
    assert abs(one.vy[1]) > 0.05
    for name in ("x", "y", "angle", "vx", "vy", "spin"):
        np.testing.assert_allclose(getattr(two, name)[:2], getattr(one, name), rtol=1e-12, atol=1e-13)


# -- laws of conservation ----------------------------------------------------------------------------------------------


def cloud(ratio: float, seed: int = 1, count: int = 48) -> Grains:
    """Ellipses and discs that fly into each other about the origin."""
    rng = np.random.default_rng(seed)
    side = math.isqrt(count - 1) + 1
    step = 2.2 * RADIUS * math.sqrt(ratio)
    x, y = step * (np.arange(count) % side - 0.5 * side), step * (np.arange(count) // side - 0.5 * side)
    grains = ellipses(x, y, np.where(np.arange(count) % 5 == 0, 1.0, ratio), rng.uniform(0.0, 6.3, count))
    grains.vx[:], grains.vy[:] = -4.0 * x + rng.uniform(-0.3, 0.3, count), -4.0 * y + rng.uniform(-0.3, 0.3, count)
    grains.spin[:] = rng.uniform(-30.0, 30.0, count)
    return grains


@pytest.mark.parametrize("ratio", [1.3, 2.0, 5.0])
def test_smooth_ellipses_keep_momentum(ratio: float) -> None:
    """Momentum and angular momentum to rounding; energy to the error of the time step, of the second order."""
    errors = []
    for dt in (DT, DT / 2.0):
        bench = bench_of(cloud(ratio), dt=dt)
        start, seen = bench.frame(), 0
        for _ in range(20):
            assert bench.steps(round(0.008 / dt)) == 0
            seen += len(bench.state.contacts())
        now = bench.frame()
        mass_speed = (start.grains.mass * np.hypot(start.grains.vx, start.grains.vy)).sum()
        assert np.abs(momentum(now.grains) - momentum(start.grains)).max() < 1e-12 * mass_speed
        turned = angular_momentum(now.grains) - angular_momentum(start.grains)
        assert abs(turned) < 1e-12 * swing(start.grains)
        assert seen > 40
        assert np.abs(now.grains.spin - start.grains.spin).max() > 10.0
        errors.append(abs(now.energy.stored / start.energy.stored - 1.0))
        assert abs(now.residual) < 1e-3 * start.energy.stored
    assert errors[0] < 2e-3
    print(f"ratio {ratio}: relative change of energy {errors[0]:.1e} and, with half the time step, {errors[1]:.1e}")


def test_energy_of_a_glancing_pair_is_of_second_order() -> None:
    """One smooth collision of two turning ellipses: the error of the energy falls by four with half the time step."""
    errors = []
    for parts in (1, 2, 4):
        grains = ellipses([0.0, 4.0 * RADIUS], [0.0, 0.8 * RADIUS], 2.5, np.array([0.4, 2.0]))
        grains.vx[:], grains.spin[:] = (1.0, -1.0), (20.0, -35.0)
        bench = bench_of(grains, dt=DT / parts)
        before = bench.frame().energy.stored
        worst = 0.0
        for _ in range(500):
            bench.steps(parts)
            worst = max(worst, abs(bench.frame().energy.stored / before - 1.0))
        assert np.abs(bench.frame().grains.vx[0]) < 0.9
        errors.append(worst)
    assert errors[0] < 1e-2
    assert errors[1] < 0.35 * errors[0]
    assert errors[2] < 0.35 * errors[1]


# -- forces do not jump ------------------------------------------------------------------------------------------------


def turning(bench: Bench, looks: int) -> Floats:
    """Force and turn (x, y, moment over the radius) on element 0 over kn after every EVERY steps, (looks, 3) [m].

    In the first step of a call normals are searched anew; the later ones follow them.
    """
    out = np.empty((looks, 3))
    for s in range(looks):
        assert bench.steps(EVERY) == 0
        out[s] = bench.state.rows[0, [FX, FY, TURN]]
    return out


def held(grains: Grains, **more: Any) -> Bench:
    """Elements that move as they do whatever pushes them."""
    bench = bench_of(grains, integration_max_overlap=1.0, **more)
    bench.state.rows[:, MOBILITY] = 1e-300
    return bench


@pytest.mark.parametrize("ratio", [1.5, 5.0])
@pytest.mark.parametrize("other", ["disc", "ellipse", "end of a wall"])
def test_force_of_a_turning_contact_is_continuous(ratio: float, other: str) -> None:
    """An ellipse is turned past a neighbour through several contacts: what changes in a step halves with the step, and at every
    instant the force is that of the largest gap as it is found without any history.
    """
    jumps = []
    a, b = RADIUS * math.sqrt(ratio), RADIUS / math.sqrt(ratio)
    spin, distance = 40.0, 0.5 * (a + b) + RADIUS
    for steps in (2000, 4000):
        dt = 2.0 * math.pi / spin / (EVERY * steps)
        if other == "end of a wall":
            # Within b^2/a of the tip, else two sides compete.
            grains, walls = ellipses([0.0], [0.0], ratio, 0.2), segments([(a - 0.1 * b, 0.1 * b, 3.0 * a, -a)])
        else:
            k = np.array([ratio, 1.0 if other == "disc" else ratio])
            grains, walls = ellipses([0.0, distance], [0.0, 0.2 * RADIUS], k, np.array([0.2, 1.1])), None
            grains.spin[1] = -0.7 * spin
        grains.spin[0] = spin
        bench = held(grains, dt=dt, walls=walls)
        force = turning(bench, steps)
        assert np.count_nonzero(force[:, 0]) > 0.01 * steps
        jumps.append(np.abs(np.diff(force, axis=0)).max() / np.abs(force).max())
        if steps == 2000:
            compare_with_no_history(grains, walls, dt, force)
    assert jumps[0] < (0.4 if other == "end of a wall" else 0.1)  # a tip of ratio 5 is past it in some thirty steps
    assert jumps[1] < 0.6 * jumps[0]


def compare_with_no_history(grains: Grains, walls: Any, dt: float, force: Floats) -> None:
    for s in range(0, len(force), 7):
        angle = grains.angle + EVERY * (s + 1) * dt * grains.spin
        shapes = [outline(*each) for each in zip(grains.a, grains.b, angle, strict=True)]
        if walls is None:
            dx, dy = grains.x[1] - grains.x[0], grains.y[1] - grains.y[0]
            nx, ny, gap = widest_gap(dx, dy, *shapes[0], *shapes[1], 0.0, 0.0)
        else:
            ends = (float(w[0]) for w in (walls.x0, walls.y0, walls.x1, walls.y1))
            nx, ny, gap = wall_gap(grains.x[0], grains.y[0], *shapes[0], *ends)
        push = max(-gap, 0.0)
        # Half a milliradian a step, and the normal up to five times that: its error is of the second order, that of the overlap smaller.
        assert math.hypot(force[s, 0], force[s, 1]) == pytest.approx(push, abs=1e-8 * RADIUS)
        np.testing.assert_allclose(force[s, :2], [-push * nx, -push * ny], rtol=0, atol=1e-5 * push + 1e-8 * RADIUS)


@pytest.mark.parametrize(("spin", "close"), [(3.0, 1e-12), (30.0, 1e-10)])
def test_one_step_of_newton_follows_the_normal(spin: float, close: float) -> None:
    """At the speeds of a run the remembered normal, bettered by one step of Newton's method a step, gives the overlap to rounding."""
    angle = np.array([1.2, 1.9])
    grains = ellipses([0.0, 1.4 * RADIUS], [0.0, 0.3 * RADIUS], 3.0, angle)
    grains.spin[:] = (spin, -0.7 * spin)
    dt = DT / 4.0
    force = turning(held(grains, dt=dt), 80)
    assert np.count_nonzero(force[:, 0]) > 50
    for s in range(4, 80, 4):
        turned = grains.angle + EVERY * (s + 1) * dt * grains.spin
        one, two = (outline(*each) for each in zip(grains.a, grains.b, turned, strict=True))
        nx, ny, gap = widest_gap(grains.x[1] - grains.x[0], grains.y[1] - grains.y[0], *one, *two, 0.0, 0.0)
        push = max(-gap, 0.0)
        assert math.hypot(force[s, 0], force[s, 1]) == pytest.approx(push, abs=close * RADIUS)
        np.testing.assert_allclose(force[s, :2], [-push * nx, -push * ny], rtol=0, atol=20.0 * close * RADIUS)


# -- the thesis' enlarged ellipse ----------------------------------------------------------------------------------------

angles = st.floats(0.0, 6.3)
shapes = st.tuples(st.floats(0.5, 2.0), st.floats(1.0, 5.0), angles)


@settings(max_examples=300, deadline=None)
@given(shapes, shapes, angles, st.floats(0.7, 1.1))
def test_enlarged_sees_no_more_than_there_is(one: Any, two: Any, place: float, nearness: float) -> None:
    """Its overlap is never above the exact one; for two discs it is the same."""
    (a, b), (c, d) = ((r * math.sqrt(k), r / math.sqrt(k)) for r, k, _ in (one, two))
    first, second = outline(a, b, one[2]), outline(c, d, two[2])
    ux, uy = math.cos(place), math.sin(place)
    _, _, reached = widest_gap(100.0 * ux, 100.0 * uy, *first, *second, 0.0, 0.0)
    distance = nearness * (100.0 - reached)
    nx, ny, gap = widest_gap(distance * ux, distance * uy, *first, *second, 0.0, 0.0)
    along = distance * (nx * ux + ny * uy)
    seen = enlarged_overlap(distance * ux, distance * uy, *first, *second, along)
    assert seen <= -gap + 1e-12 * (a + c)
    r, s = outline(one[0], one[0], 0.0), outline(two[0], two[0], 0.0)
    reach = nearness * (one[0] + two[0])
    assert enlarged_overlap(reach * ux, reach * uy, *r, *s, reach) == pytest.approx(
        one[0] + two[0] - reach, abs=1e-13 * (one[0] + two[0])
    )


def test_enlarged_is_exact_on_the_axes() -> None:
    """Two equal, parallel ellipses make a contact of two discs in the frame where they are circles; and one that lies along or across
    another's axes is met where the enlarged ellipse is right.
    """
    a, b = 2.0, 1.0
    for place in (0.0, 0.5 * math.pi):
        ux, uy = math.cos(place), math.sin(place)
        reach = 0.99 * 2.0 * (a if place == 0.0 else b)
        seen = enlarged_overlap(reach * ux, reach * uy, *outline(a, b, 0.0), *outline(a, b, 0.0), reach)
        assert seen == pytest.approx(reach / 0.99 - reach, rel=1e-12)
    crossed = enlarged_overlap(2.9, 0.0, *outline(a, b, 0.0), *outline(a, b, 0.5 * math.pi), 2.9)
    assert crossed == pytest.approx(0.1, rel=1e-9)
    # Off the axes of crossed ellipses it is blind to shallow contacts: here to one of a hundredth of b.
    dx, dy = 2.0, 2.0
    first, second = outline(a, b, 0.0), outline(a, b, 0.5 * math.pi)
    nx, ny, gap = widest_gap(dx, dy, *first, *second, 0.0, 0.0)
    scale = (0.01 * b + gap) / (nx * dx + ny * dy)
    dx, dy = dx * (1.0 - scale), dy * (1.0 - scale)
    nx, ny, gap = widest_gap(dx, dy, *first, *second, 0.0, 0.0)
    assert gap == pytest.approx(-0.01 * b, rel=1e-2)
    assert enlarged_overlap(dx, dy, *first, *second, nx * dx + ny * dy) < 0.0
