"""Ellipses in the explicit engine: the disc as a limit, laws of conservation, forces that do not jump, and what is shown of contacts."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from body_samples import angular_momentum, ellipses, momentum, swing, wrenches
from engine_samples import box, engine_of, last_frame, loose_grains, resultants
from few_grains import KN, MASS, RADIUS, Bench, bench_of, few_grains, segments
from hypothesis import given, settings
from hypothesis import strategies as st

from dem_cli.assembly.container import build_walls
from dem_cli.engines.explicit import build
from dem_cli.engines.explicit.ellipses import Outlines, enlarged_overlap
from dem_cli.engines.explicit.forces import FX, FY, MOBILITY, TURN
from dem_cli.engines.explicit.state import ExplicitState, no_lists
from dem_cli.errors import RunError
from dem_cli.geometry.ellipse import outline, wall_gap, widest_gap
from dem_cli.state import Floats, Grains

DT = math.pi * math.sqrt(MASS / KN) / 50
NOTHING = np.zeros((0, 2))


def as_ellipses(state: ExplicitState) -> None:
    """Make a state of discs go the way of ellipses."""
    n = len(state.mass)
    fours = build.aligned(4 * (n + 2)).reshape(-1, 4)
    fours[:n, 0], fours[:n, 3] = state.radius**2, 1.0 / state.radius
    fours[n:, 0] = fours[n:, 3] = 1.0
    state.outlines, state.lists = Outlines(fours.reshape(-1), np.zeros(n), False), no_lists(n, True)


def loose_ellipses(count: int, seed: int, ratio: float, speed: float = 0.0) -> Grains:
    """Ellipses of any direction and, a quarter, discs, apart from each other in a box 32 cm wide."""
    rng = np.random.default_rng(seed)
    spacing = 0.019 * math.sqrt(ratio)
    discs = loose_grains(count, seed, 0.02 * int(0.3 / spacing) + 1e-9, speed)
    k = np.where(np.arange(count) % 4 == 0, 1.0, ratio)
    a, b = discs.radius * np.sqrt(k), discs.radius / np.sqrt(k)
    scale = spacing / 0.02
    angle = rng.uniform(0.0, 2.0 * math.pi, count)
    grains = Grains.ellipses(scale * discs.x + 0.005, scale * discs.y + 0.005, a, b, angle, 2480.0, 1.0)
    return replace(grains, vx=discs.vx, vy=discs.vy, spin=discs.spin)


@cache
def heap_of(ratio: float, count: int = 40, seed: int = 2) -> Grains:
    """Fallen on the floor and nearly at rest; its contacts' springs are forgotten."""
    grains = run_of(loose_ellipses(count, seed, ratio, 0.3), 8000).state.grains()
    return replace(grains, vx=0.0 * grains.vx, vy=0.0 * grains.vy, spin=0.0 * grains.spin)


def walled(changes: dict[str, Any] | None = None) -> Any:
    return box({"container.width": "32 cm", "contact.friction": 0.3, **(changes or {})})


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


def turning(bench: Bench, steps: int) -> Floats:
    """Force and turn (x, y, moment over the radius) on element 0 over kn at each step, (steps, 3) [m]."""
    out = np.empty((steps, 3))
    for s in range(steps):
        assert bench.steps(1) == 0
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
        dt = 2.0 * math.pi / spin / steps
        if other == "end of a wall":
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
        angle = grains.angle + (s + 1) * dt * grains.spin
        shapes = [outline(*each) for each in zip(grains.a, grains.b, angle, strict=True)]
        if walls is None:
            dx, dy = grains.x[1] - grains.x[0], grains.y[1] - grains.y[0]
            nx, ny, gap = widest_gap(dx, dy, *shapes[0], *shapes[1], 0.0, 0.0)
        else:
            ends = (float(w[0]) for w in (walls.x0, walls.y0, walls.x1, walls.y1))
            nx, ny, gap = wall_gap(grains.x[0], grains.y[0], *shapes[0], *ends)
        push = max(-gap, 0.0)
        np.testing.assert_allclose(force[s, :2], [-push * nx, -push * ny], rtol=0, atol=1e-6 * RADIUS)


def test_one_step_of_newton_follows_the_normal() -> None:
    """At the speeds of a run the remembered normal, bettered by one step of Newton's method a step, gives the overlap to rounding."""
    angle = np.array([1.2, 1.9])
    grains = ellipses([0.0, 1.4 * RADIUS], [0.0, 0.3 * RADIUS], 3.0, angle)
    grains.spin[:] = (3.0, -2.0)
    dt = DT / 4.0
    force = turning(held(grains, dt=dt), 400)
    assert np.count_nonzero(force[:, 0]) == 400
    for s in range(20, 400, 20):
        one, two = (
            outline(a, b, angle)
            for a, b, angle in zip(grains.a, grains.b, grains.angle + (s + 1) * dt * grains.spin, strict=True)
        )
        nx, ny, gap = widest_gap(grains.x[1] - grains.x[0], grains.y[1] - grains.y[0], *one, *two, 0.0, 0.0)
        np.testing.assert_allclose(force[s, :2], [gap * nx, gap * ny], rtol=0, atol=1e-12 * RADIUS)


# -- what is shown -----------------------------------------------------------------------------------------------------


def run_of(
    grains: Grains, steps: int, changes: dict[str, Any] | None = None, damping: float = 0.5, enlarged: bool = False
) -> Any:
    engine = engine_of(walled({"contact.damping_ratio": damping, **(changes or {})}), grains)
    engine.state.outlines = engine.state.outlines._replace(enlarged=enlarged)
    engine.state.first_forces()
    assert engine.state.advance(engine.time_step, np.tile(engine.gravity, (steps + 1, 1)), NOTHING)[0] == 0
    return engine


@pytest.mark.parametrize("ratio", [1.5, 5.0])
@pytest.mark.parametrize("test", ["exact", "enlarged"])
def test_contacts_agree_with_forces(ratio: float, test: str) -> None:
    """Every overlap that a search over all pairs finds is shown; forces and moments of contacts add up to those of the step."""
    engine = run_of(heap_of(ratio), 300, {"integration.max_overlap": 1.0}, enlarged=test == "enlarged")
    state, grains = engine.state, engine.state.grains()
    frame = state.frame(engine.gravity, np.zeros((3, 2)), frozenset({"series"}), 0, heavy=True)
    contacts = frame.contacts
    known = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(contacts.i, contacts.j, strict=True))}
    shapes = [outline(*each) for each in zip(grains.a, grains.b, grains.angle, strict=True)]
    for i in range(40):
        for j in range(i + 1, 40):
            dx, dy = grains.x[j] - grains.x[i], grains.y[j] - grains.y[i]
            nx, ny, gap = widest_gap(dx, dy, *shapes[i], *shapes[j], 0.0, 0.0)
            depth = enlarged_overlap(dx, dy, *shapes[i], *shapes[j], dx * nx + dy * ny) if test == "enlarged" else -gap
            if abs(depth) > 1e-12:
                assert ((i, j) in known) == (depth > 0.0)
            if (i, j) in known:
                k = known[i, j]
                assert contacts.overlap[k] == pytest.approx(depth, abs=1e-12)
                np.testing.assert_allclose([contacts.nx[k], contacts.ny[k]], [nx, ny], rtol=0, atol=1e-9)
    walls = build_walls(engine.scenario)
    between = contacts.j >= 0
    assert between.sum() > 15
    assert np.count_nonzero(~between) > 5
    assert np.abs(contacts.shear).max() > 1.0
    for i, j, overlap in zip(contacts.i[~between], contacts.j[~between], contacts.overlap[~between], strict=True):
        w = -1 - j
        ends = np.clip([walls.x0[w], walls.y0[w], walls.x1[w], walls.y1[w]], -1e3, 1e3)
        assert -wall_gap(grains.x[i], grains.y[i], *shapes[i], *ends)[2] == pytest.approx(overlap, abs=1e-11)
    # Sums of contact forces; with the point on the outline instead of in the middle of the overlap they give the moments too.
    wanted = resultants(frame, engine.gravity)
    close = (
        1e-8 if test == "exact" else 1e-5
    )  # the exact overlap does not feel a small error of the normal, the enlarged one does
    np.testing.assert_allclose(frame.forces, wanted, rtol=0, atol=close * contacts.normal.max())
    moved = wrenches(grains, replace(contacts, shear=0.0 * contacts.shear))[:, 2]
    rows = state.rows[:40]
    turn = np.empty(40)
    turn[state.order] = state.kn * rows[:, TURN] * state.radius
    sheared = np.zeros(40)
    for k, (i, j) in enumerate(zip(contacts.i, contacts.j, strict=True)):
        for body in (int(i), int(j)) if j >= 0 else (int(i),):
            direction = math.atan2(contacts.ny[k], contacts.nx[k]) - grains.angle[body]
            sheared[body] -= contacts.shear[k] * math.hypot(
                grains.a[body] * math.cos(direction), grains.b[body] * math.sin(direction)
            )
    np.testing.assert_allclose(turn, moved + sheared, rtol=0, atol=close * contacts.normal.max() * grains.a.max())


def test_points_of_contact_lie_on_both_outlines() -> None:
    """A contact's point is half the overlap inside either outline, along the normal."""
    engine = run_of(heap_of(2.0), 300)
    grains, contacts = engine.state.grains(), engine.state.contacts()
    seen = 0
    for k, (i, j) in enumerate(zip(contacts.i, contacts.j, strict=True)):
        for body, sign in ((int(i), 1.0), (int(j), -1.0)):
            if body < 0:
                continue
            x = contacts.px[k] + sign * 0.5 * contacts.overlap[k] * contacts.nx[k] - grains.x[body]
            y = contacts.py[k] + sign * 0.5 * contacts.overlap[k] * contacts.ny[k] - grains.y[body]
            c, s = math.cos(grains.angle[body]), math.sin(grains.angle[body])
            level = math.hypot((x * c + y * s) / grains.a[body], (y * c - x * s) / grains.b[body])
            assert level == pytest.approx(1.0, abs=1e-9)
            seen += 1
    assert seen > 50


def test_order_of_ids_does_not_matter() -> None:
    grains = heap_of(2.0)
    number = np.random.default_rng(1).permutation(40)
    one = run_of(grains, 300)
    two = run_of(replace(grains.take(number), id=np.arange(40), body=np.arange(40)), 300)
    a, b = one.state.grains().take(number), two.state.grains()
    for name in ("x", "y", "angle", "vx", "vy"):
        np.testing.assert_allclose(getattr(b, name), getattr(a, name), rtol=0, atol=1e-9)
    p, q = one.state.contacts(), two.state.contacts()
    place = np.argsort(number)  # place[old id]: new id

    def pairs(contacts: Any, name: Callable[[int], int]) -> dict[tuple[int, int], tuple[float, float, float, float]]:
        out = {}
        for i, j, nx, ny, n, s in zip(
            contacts.i, contacts.j, contacts.nx, contacts.ny, contacts.normal, contacts.shear, strict=True
        ):
            one, two = name(i), (name(j) if j >= 0 else int(j))
            sign = -1.0 if two >= 0 and one > two else 1.0
            out[(min(one, two), max(one, two)) if two >= 0 else (one, two)] = (sign * nx, sign * ny, n, s)
        return out

    ours, theirs = pairs(p, lambda k: int(place[k])), pairs(q, int)
    assert ours.keys() == theirs.keys()
    assert len(ours) > 15
    for key, values in ours.items():
        assert theirs[key] == pytest.approx(values, abs=1e-4)


@pytest.mark.parametrize("ratio", [2.0, 5.0])
def test_sorting_in_the_middle(ratio: float) -> None:
    """Rows sorted and lists made anew between calls: nothing that is shown changes, and the motion goes on but for rounding."""
    one = run_of(heap_of(ratio), 300)
    before = copy.deepcopy((one.state.grains(), one.state.contacts()))
    order = one.state.order.copy()
    other = copy.deepcopy(one.state)
    other.sort()
    assert order.tolist() != other.order.tolist()
    for shown, after in zip(before, (other.grains(), other.contacts()), strict=True):
        for name, value in vars(shown).items():
            if name in {"nx", "ny", "px", "py", "overlap"}:
                np.testing.assert_allclose(getattr(after, name), value, rtol=0, atol=1e-14)
            else:
                np.testing.assert_allclose(getattr(after, name), value, rtol=1e-12, atol=1e-12)
    field = np.tile(one.gravity, (101, 1))
    for turn in range(4):
        one.state.advance(one.time_step, field, NOTHING)
        other.travelled[0] = np.inf if turn % 2 else other.travelled[0]
        other.sort()
        other.advance(one.time_step, field, NOTHING)
    a, b = one.state.grains(), other.grains()
    for name in ("x", "y", "angle", "vx", "vy"):
        np.testing.assert_allclose(getattr(b, name), getattr(a, name), rtol=0, atol=1e-9 if ratio < 5.0 else 1e-8)
    p, q = one.state.contacts(), other.contacts()
    assert len(p) > 15
    assert (p.i.tolist(), p.j.tolist()) == (q.i.tolist(), q.j.tolist())
    np.testing.assert_allclose(q.stretch, p.stretch, rtol=0, atol=1e-10)


# -- chunks and bits ---------------------------------------------------------------------------------------------------


def test_same_bits_twice_and_chunks_to_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = (run_of(loose_ellipses(50, 6, 2.5, 0.5), 2000) for _ in range(2))
    assert one.state.rows.tobytes() == two.state.rows.tobytes()
    assert one.state.ledger.tobytes() == two.state.ledger.tobytes()
    assert one.state.lists.memory.tobytes() == two.state.lists.memory.tobytes()
    grains = heap_of(2.5, 50, 6)
    whole = run_of(grains, 300)
    monkeypatch.setattr(build, "CHUNK", 8)
    parts = run_of(grains, 300)
    assert len(whole.state.edges) == 2
    assert len(parts.state.edges) == 8
    assert len(whole.state.contacts()) > 20
    for name in ("x", "y", "angle", "vx", "vy"):
        np.testing.assert_allclose(
            getattr(parts.state.grains(), name), getattr(whole.state.grains(), name), rtol=0, atol=1e-9
        )


# -- runs that go wrong ------------------------------------------------------------------------------------------------


def test_grains_that_go_through_each_other_are_named() -> None:
    for left, right in ((7, 2), (3, 11)):
        grains = loose_ellipses(12, 4, 2.0)
        grains.x[left], grains.x[right], grains.y[left], grains.y[right] = 0.10, 0.14, 0.25, 0.25
        grains.vx[left], grains.vx[right] = 40.0, -40.0
        with pytest.raises(
            RunError, match=rf"grain ({left} and grain {right}|{right} and grain {left}) overlap by 0\.\d"
        ):
            last_frame(engine_of(walled(), grains))


def test_grain_that_goes_through_a_wall_is_named() -> None:
    grains = loose_ellipses(12, 4, 2.0)
    grains.x[5], grains.y[5], grains.vx[5] = 0.03, 0.25, -90.0
    with pytest.raises(RunError, match=r"grain 5 and the left wall overlap by 0\.\d+ of"):
        last_frame(engine_of(walled(), grains))


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
