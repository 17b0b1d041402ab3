"""Rigid clumps of discs: a clump of one is a disc, free flight, impacts, rest, escape, and nothing between discs of one body."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from body_samples import (
    BENT,
    CHAIN,
    PAIR,
    SINGLE,
    TRIANGLE,
    UNEQUAL,
    angular_momentum,
    bodies,
    bonds_of,
    centres,
    momentum,
    set_in_motion,
    sums,
    swing,
)
from engine_samples import box, engine_of
from few_grains import KN, MASS, RADIUS, Bench, G, bench_of, floor, run_for, segments

from dem_cli.assembly import Assembly
from dem_cli.assembly.container import build_walls
from dem_cli.engines.explicit import build
from dem_cli.engines.explicit.bodies import spread_cores
from dem_cli.engines.explicit.engine import ExplicitEngine
from dem_cli.engines.explicit.forces import U, V, X, Y
from dem_cli.engines.explicit.moves import move
from dem_cli.state import Bonds, Floats, Grains

DT = math.pi * math.sqrt(MASS / KN) / 50
SHAPES = {"pair": PAIR, "unequal": UNEQUAL, "triangle": TRIANGLE, "chain": CHAIN, "bent": BENT}
EACH = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)


def arms(grains: Grains) -> Floats:
    """Distance of each element from the centre of mass of its grain [m]."""
    x, y = centres(grains)
    return np.hypot(grains.x - x[grains.body], grains.y - y[grains.body])


@pytest.mark.parametrize("integrator", ["leapfrog", "thesis"])
@pytest.mark.parametrize("damping", [(0.0, 0.0), (3.0, 0.0)], ids=["plain", "damped"])
def test_clump_of_one_is_a_disc(
    integrator: str, damping: tuple[float, float], settled_box: Callable[[int, int], Grains]
) -> None:
    """Friction, dashpots, walls, shaking: a heap of clumps of one disc each moves as the heap of discs."""
    scenario = box({"contact.friction": 0.3, "contact.damping_ratio": 0.5, "integration.integrator": integrator})
    grains = settled_box(60, 1)
    discs = engine_of(scenario, grains)
    clumps = ExplicitEngine(scenario, Assembly(grains, build_walls(scenario), Bonds.none(), True))
    driving = 5.0 * np.sin(0.01 * np.arange(301))[:, None] * np.array([1.0, 0.3])
    for engine in (discs, clumps):
        engine.state.first_forces()
        engine.state.sort()
        for share in (1.0, 0.7):  # of the time step, which may change between calls
            engine.state.advance(share * engine.time_step, engine.gravity + driving, driving, damping)
    a, b = discs.state.grains(), clumps.state.grains()
    for name in ("x", "y", "angle", "vx", "vy"):
        np.testing.assert_allclose(getattr(b, name), getattr(a, name), rtol=0, atol=1e-12)
    np.testing.assert_allclose(b.spin, a.spin, rtol=0, atol=1e-9)
    np.testing.assert_allclose(clumps.state.ledger, discs.state.ledger, rtol=1e-7, atol=1e-12)
    assert np.abs(a.vx).max() > 1e-3
    assert len(discs.state.contacts()) > 60


@EACH
def test_free_flight(shape: Any) -> None:
    """Spin, energy, momentum and the lengths of the arms, to rounding over 10 000 steps; velocities of discs are those of a rigid body."""
    grains = set_in_motion(bodies([shape], [0.1], [0.2], 0.3), vx=0.3, vy=-0.2, spin=20.0)
    bench = bench_of(grains, rigid=True, dt=DT)
    before = bench.frame()
    assert bench.steps(10_000) == 0
    after = bench.frame()
    now = after.grains
    assert np.abs(momentum(now) - momentum(grains)).max() < 1e-12 * grains.mass.sum() * 0.4
    assert abs(angular_momentum(now) - angular_momentum(grains)) < 1e-12 * swing(grains)
    assert after.energy.kinetic == pytest.approx(before.energy.kinetic, rel=1e-12)
    np.testing.assert_allclose(arms(now), arms(grains), rtol=1e-12, atol=1e-13 * RADIUS)
    x0, y0 = centres(grains)
    x, y = centres(now)
    np.testing.assert_allclose([x[0] - x0[0], y[0] - y0[0]], [0.3 * after.time, -0.2 * after.time], rtol=0, atol=1e-12)
    # Turned by spin x time: at once in its angle and in the places of its discs. The turn of a step is exact to (w dt)^5.
    np.testing.assert_allclose(now.angle, grains.angle + 20.0 * after.time, rtol=1e-11)
    far = int(np.argmax(arms(grains)))
    start = math.atan2(grains.y[far] - y0[0], grains.x[far] - x0[0])
    turned = math.atan2(now.y[far] - y[0], now.x[far] - x[0]) - start - 20.0 * after.time
    assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    again = set_in_motion(now, vx=0.3, vy=-0.2, spin=20.0)
    for name in ("vx", "vy", "spin"):
        np.testing.assert_allclose(getattr(now, name), getattr(again, name), rtol=0, atol=1e-10)


@EACH
def test_ways_of_the_discs(shape: Any) -> None:
    """What a disc moved in a step, that its contacts and the work of shaking are counted by, is the difference of its places."""
    grains = set_in_motion(bodies([shape], [0.0], [0.0], 0.3), vx=0.3, vy=-0.2, spin=0.2 / DT)
    state = bench_of(grains, rigid=True, dt=DT).state
    rows, before = state.rows.reshape(-1), state.rows.copy()
    move(state.cores.rows, 0, 1, 0.0, 0.0, 0.0)
    most = spread_cores(rows, state.cores, 0, 1)
    n = len(grains)
    np.testing.assert_allclose(
        state.rows[:n, U : V + 1], (state.rows - before)[:n, X : Y + 1], rtol=0, atol=1e-15 * RADIUS
    )
    assert most == pytest.approx((state.rows[:n, U] ** 2 + state.rows[:n, V] ** 2).max(), rel=1e-12)
    assert most > 0.1 * RADIUS**2 * 0.2**2


@pytest.mark.parametrize("shape", [PAIR, TRIANGLE, CHAIN], ids=["pair", "triangle", "chain"])
def test_elastic_bouncing(shape: Any) -> None:
    """A clump that bounces askew on a smooth floor: the energy after each bounce is that of the start, an error of second order in dt."""
    errors = []
    for parts in (1, 2, 4):
        grains = bodies([shape], [0.0], [6.0 * RADIUS], 0.3)
        bench = bench_of(grains, rigid=True, dt=DT / parts, walls=floor(), gravity=(0.0, -G))
        start, worst, bounces, last = bench.frame(), 0.0, 0, 0
        for _ in range(250):
            assert bench.steps(20 * parts) == 0
            frame = bench.frame()
            worst = max(worst, abs(frame.energy.stored - start.energy.stored) / frame.energy_in)
            assert abs(frame.residual) < 2e-3 * frame.energy_in
            bounces += len(frame.contacts) > last
            last = len(frame.contacts)
            assert momentum(frame.grains)[0] == pytest.approx(0.0, abs=1e-12)
        assert np.abs(frame.grains.spin).max() > 1.0
        errors.append(worst)
    print(f"energy of {bounces} bounces with the time step, half and a quarter of it: {errors}")
    assert errors[2] < 2e-3


@pytest.mark.parametrize("joined", ["rigid", "bonded"])
@pytest.mark.parametrize("angle", [0.05, 0.6, 1.4, -0.7])
def test_pair_comes_to_rest_lying_flat(angle: float, joined: str) -> None:
    """Both discs on the floor, each pressed in by half the weight; no motion is left."""
    grains = bodies([PAIR], [0.0], [3.0 * RADIUS], angle)
    bonds = {"rigid": True} if joined == "rigid" else {"bonds": bonds_of(grains, 1e12, 1e12)}
    bench = bench_of(grains, dt=DT, walls=floor(0.5), gravity=(0.0, -G), contact_friction=0.5,
                     contact_damping_ratio=0.3, **bonds)  # fmt: skip
    assert bench.frame().energy.potential > 0.0
    assert bench.steps(20_000) == 0
    frame = bench.frame()
    np.testing.assert_allclose(frame.grains.y, RADIUS - MASS * G / KN, rtol=0, atol=1e-6 * MASS * G / KN)
    assert math.remainder(frame.grains.angle[0], math.pi) == pytest.approx(0.0, abs=1e-7 if joined == "rigid" else 1e-5)
    assert frame.energy.kinetic < 1e-12 * frame.energy_in
    assert len(frame.contacts) == 2
    np.testing.assert_allclose(frame.contacts.normal, MASS * G, rtol=1e-6)
    of_grain = frame.forces.sum(axis=0)
    assert np.abs(of_grain).max() < 1e-6 * MASS * G
    assert abs(frame.residual) < 1e-4 * frame.energy_in


def cloud(seed: int = 1) -> Grains:
    """Thirty clumps of all kinds that fly into each other about the origin."""
    rng = np.random.default_rng(seed)
    kinds = [*SHAPES.values(), SINGLE]
    chosen = [kinds[k] for k in np.arange(30) % len(kinds)]
    x, y = 0.11 * (np.arange(30) % 6 - 2.5), 0.11 * (np.arange(30) // 6 - 2.0)
    return set_in_motion(
        bodies(chosen, x, y, rng.uniform(0.0, 6.3, 30)),
        -5.0 * x + rng.uniform(-0.2, 0.2, 30), -5.0 * y + rng.uniform(-0.2, 0.2, 30), rng.uniform(-20.0, 20.0, 30),
    )  # fmt: skip


def test_smooth_clumps_keep_momentum() -> None:
    """Collisions of many without friction: momentum and angular momentum to rounding, energy but for the time step's error."""
    bench = bench_of(cloud(), rigid=True, dt=DT / 2.0)
    start, seen = bench.frame(), 0
    for _ in range(60):
        assert bench.steps(100) == 0
        seen += len(bench.state.contacts())
    now = bench.frame()
    scale = (start.grains.mass * np.hypot(start.grains.vx, start.grains.vy)).sum()
    assert np.abs(momentum(now.grains) - momentum(start.grains)).max() < 1e-12 * scale
    assert abs(angular_momentum(now.grains) - angular_momentum(start.grains)) < 1e-12 * swing(start.grains)
    assert seen > 30
    spin = now.grains.spin - start.grains.spin
    assert np.abs(spin).max() > 5.0
    assert now.energy.stored == pytest.approx(start.energy.stored, rel=2e-3)
    np.testing.assert_allclose(arms(now.grains), arms(start.grains), rtol=1e-12, atol=1e-13 * RADIUS)
    # Rigid still: one spin for all discs of a clump, and angles that have turned alike.
    of = now.grains.body
    np.testing.assert_allclose(now.grains.spin, sums(now.grains, now.grains.spin)[of] / np.bincount(of)[of], rtol=1e-14)


def test_clumps_with_friction_balance() -> None:
    """Friction, dashpots, floor: what is lost is found in the ledger, and the forces shown add up to those that move the clumps."""
    grains = cloud(2)
    grains = replace(grains, y=grains.y + 0.35)
    walls = segments([(-0.4, 0.0, 0.4, 0.0), (-0.4, 0.0, -0.4, 1.0), (0.4, 0.0, 0.4, 1.0)], 0.3)
    bench = bench_of(grains, rigid=True, dt=DT, walls=walls, gravity=(0.0, -G), contact_friction=0.3,
                     contact_damping_ratio=0.3)  # fmt: skip
    for _ in range(30):
        assert bench.steps(300) == 0
        frame = bench.frame()
        assert abs(frame.residual) < 1e-4 * frame.energy_in
    assert frame.energy.friction > 0.01 * frame.energy_in
    contacts = frame.contacts
    assert len(contacts) > 20
    between = contacts.j >= 0
    assert np.all(grains.body[contacts.i[between]] != grains.body[contacts.j[between]])
    fx = contacts.normal * contacts.nx - contacts.shear * contacts.ny
    fy = contacts.normal * contacts.ny + contacts.shear * contacts.nx
    total = np.outer(grains.mass, [0.0, -G])
    for axis, force in enumerate((fx, fy)):
        np.subtract.at(total[:, axis], contacts.i, force)
        np.add.at(total[:, axis], contacts.j[between], force[between])
    np.testing.assert_allclose(frame.forces, total, rtol=0, atol=1e-9 * np.abs(total).max())


def test_rolling_and_sliding_need_the_whole_inertia() -> None:
    """A pair that is struck in the middle of one disc turns by the impulse over its own inertia about its centre of mass."""
    grains = bodies([PAIR, SINGLE], [0.0, RADIUS], [0.0, 2.1 * RADIUS], [0.0, 0.0])
    grains.vy[2] = -0.2
    bench = bench_of(grains, rigid=True, dt=DT / 4.0)
    assert bench.steps(800) == 0
    g = bench.frame().grains
    impulse = MASS * (g.vy[2] + 0.2)
    inertia = 2.0 * (0.5 * MASS * RADIUS**2 + MASS * RADIUS**2)
    assert len(bench.frame().contacts) == 0
    assert impulse > 0.1 * MASS * 0.2
    assert 0.5 * (g.vy[0] + g.vy[1]) == pytest.approx(-impulse / (2.0 * MASS), rel=1e-9)
    # The disc slides off a little while they touch: the arm is that of the contact's place, to a percent.
    assert g.spin[0] == pytest.approx(-impulse * RADIUS / inertia, rel=1e-2)


def test_discs_of_one_clump_do_not_touch() -> None:
    """Deeply overlapping discs of one clump: no contact is seen, and none acts."""
    grains = bodies([((0.0, 0.0, 1.0), (0.5, 0.0, 1.0), (1.0, 0.3, 0.7))], [0.0], [0.0])
    bench = bench_of(grains, rigid=True, dt=DT)
    assert bench.steps(300) == 0
    frame = bench.frame()
    assert len(frame.contacts) == 0
    np.testing.assert_allclose(frame.grains.x, grains.x, rtol=0, atol=1e-15)
    assert frame.energy.kinetic == 0.0


@EACH
def test_clump_leaves_as_a_whole(shape: Any) -> None:
    """It is out once its last disc is, and the energy that it had is in the ledger."""
    grains = set_in_motion(
        bodies([shape, SINGLE], [0.0, -0.5], [0.0, 0.0], [3.8, 0.0]), vx=np.array([1.0, 0.0]), spin=3.0
    )
    bench = bench_of(grains, rigid=True, dt=DT, box=(-1.0, 0.05, -1.0))
    brought = 0.5 * (grains.mass * (grains.vx**2 + grains.vy**2) + grains.inertia * grains.spin**2)[:-1].sum()
    first = None
    for frame in run_for(bench, 0.35, every=20):
        gone = frame.grains.escaped
        assert gone[:-1].all() or not gone.any()
        if gone[0] and first is None:
            first = frame
    assert first is not None
    assert not gone[-1]
    assert np.all(first.grains.x[:-1] - first.grains.radius[:-1] > 0.05)
    assert frame.energy.escaped == pytest.approx(brought, rel=1e-5)
    for name in ("x", "y", "angle"):
        np.testing.assert_array_equal(getattr(frame.grains, name)[:-1], getattr(first.grains, name)[:-1])
    assert np.all(frame.grains.spin[:-1] == 0.0)
    np.testing.assert_allclose(frame.grains.spin[-1], 3.0, rtol=1e-12)
    assert abs(frame.residual) < 1e-6 * brought


def test_rigid_limit_of_bonds() -> None:
    """A pair whose bond is a billion times stiffer than a step needs moves as the clump of the same outline: what is left between them
    shrinks with the viscosity and then with the time step.
    """
    apart = {}
    for viscosity in (1e3, 1e4, 1e5, 1e12):
        ends = []
        for rigid in (True, False):
            grains = set_in_motion(bodies([PAIR], [0.0], [3.0 * RADIUS], 0.5), vx=0.1)
            bonds = None if rigid else bonds_of(grains, viscosity, viscosity * RADIUS**2)
            bench = bench_of(grains, rigid=rigid, bonds=bonds, dt=DT / 4.0, walls=floor(0.3), gravity=(0.0, -G),
                             contact_friction=0.3, contact_damping_ratio=0.2)  # fmt: skip
            track = []
            for _ in range(80):
                bench.steps(100)
                g = bench.frame().grains
                track.append(np.concatenate([g.x, g.y, RADIUS * g.angle]))
            ends.append(np.array(track))
        assert np.abs(ends[0][-1] - ends[0][0]).max() > 0.5 * RADIUS
        apart[viscosity] = np.abs(ends[1] - ends[0]).max() / RADIUS
    print("largest distance of a bonded pair from the clump in radii, by viscosity:", apart)
    assert apart[1e4] < 0.2 * apart[1e3]
    assert apart[1e5] < 0.2 * apart[1e4]
    assert apart[1e12] < 2e-3


def heap(grains: Grains, steps: int) -> Bench:
    walls = segments([(-0.2, 0.0, 0.2, 0.0), (-0.2, 0.0, -0.2, 1.0), (0.2, 0.0, 0.2, 1.0)], 0.3)
    bench = bench_of(grains, rigid=True, dt=DT, walls=walls, gravity=(0.0, -G), contact_friction=0.3,
                     contact_damping_ratio=0.3)  # fmt: skip
    bench.state.sort()
    assert bench.steps(steps) == 0
    return bench


def falling() -> Grains:
    grains = cloud(3)
    grains = replace(grains, y=grains.y + 0.3)
    slow = set_in_motion(grains)
    return replace(slow, x=0.6 * grains.x + 0.4 * (grains.x - centres(grains)[0][grains.body]))


def test_same_bits_twice_and_chunks_to_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    grains = falling()
    one, two = heap(grains, 6000), heap(grains, 6000)
    assert one.state.rows.tobytes() == two.state.rows.tobytes()
    assert one.state.cores.rows.tobytes() == two.state.cores.rows.tobytes()
    assert one.state.ledger.tobytes() == two.state.ledger.tobytes()
    grains = one.state.grains()  # a dense sample to go on with
    whole = heap(grains, 200)
    monkeypatch.setattr(build, "CHUNK", 12)
    parts = heap(grains, 200)
    assert len(whole.state.edges) == 2
    assert len(parts.state.edges) > 6
    assert len(whole.state.contacts()) > 8
    for name in ("x", "y", "angle", "vx", "vy"):
        np.testing.assert_allclose(
            getattr(parts.frame().grains, name), getattr(whole.frame().grains, name), rtol=0, atol=1e-9
        )


def test_sorting_in_the_middle() -> None:
    one = heap(falling(), 6000)
    other = Bench(copy.deepcopy(one.state), one.gravity, one.ground)
    order = other.state.order.copy()
    other.state.sort()
    assert order.tolist() != other.state.order.tolist()
    a, b = one.frame(), other.frame()
    for name, value in vars(a.grains).items():
        np.testing.assert_array_equal(getattr(b.grains, name), value)
    for _ in range(3):
        one.steps(60)
        other.state.travelled[0] = np.inf
        other.state.sort()
        other.steps(60)
    a, b = one.frame(), other.frame()
    assert len(a.contacts) > 8
    for name in ("x", "y", "angle", "vx", "vy"):
        np.testing.assert_allclose(getattr(b.grains, name), getattr(a.grains, name), rtol=0, atol=1e-9)
    assert (a.contacts.i.tolist(), a.contacts.j.tolist()) == (b.contacts.i.tolist(), b.contacts.j.tolist())
