"""Discs that dashpots hold together (thesis ch. 5): creep, stability, laws of conservation, shape, and the code for four pairs at a time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from body_samples import (
    BENT,
    CHAIN,
    PAIR,
    TRIANGLE,
    UNEQUAL,
    angular_momentum,
    bodies,
    bonds_of,
    centres,
    momentum,
    set_in_motion,
    swing,
)
from few_grains import KN, MASS, RADIUS, Bench, G, bench_of, floor

from dem_cli.engines.explicit.bodies import BOND, MOMENT, PULL
from dem_cli.engines.explicit.forces import MOBILITY
from dem_cli.state import Bonds, Floats

DT = math.pi * math.sqrt(MASS / KN) / 50
STIFF = 1e12  # N s/m
SCALES = [0.01, 0.1, 1.0, 10.0, 1e3, 1e5]  # C dt/m_eff
ROLLING = pytest.mark.parametrize("rolling", [0.0, 1e4], ids=["gears", "rolling"])


def column(count: int) -> tuple[tuple[float, float, float], ...]:
    """Discs that hang one under the other."""
    return tuple((0.0, -2.0 * k, 1.0) for k in range(count))


def hung(count: int, viscosity: float, rolling: float = 0.0, angle: float = 0.0) -> Bench:
    """A row of discs under gravity whose first one is held."""
    grains = bodies([column(count)], [0.0], [0.0], angle)
    bench = bench_of(grains, bonds=bonds_of(grains, viscosity, rolling), dt=DT, gravity=(0.0, -G))
    bench.state.rows[0, MOBILITY] = 0.0
    return bench


# -- creep -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", SCALES)
def test_pair_creeps_by_force_over_viscosity(scale: float) -> None:
    """Whatever C dt/m is, the lower disc sinks at exactly F/C once it has come to its speed."""
    viscosity = scale * 0.5 * MASS / DT
    bench = hung(2, viscosity)
    settling = math.ceil(40.0 * MASS / viscosity / DT) + 10
    assert bench.steps(settling) == 0
    start = bench.state.bond_strain().gap[0]
    assert bench.steps(200) == 0
    frame = bench.frame()
    speed = MASS * G / viscosity
    assert -frame.grains.vy[1] == pytest.approx(speed, rel=1e-12)
    crept = frame.bonds.gap[0] - start
    assert crept == pytest.approx(speed * 200 * DT, rel=1e-10, abs=200 * 1e-17)
    assert abs(frame.bonds.slip[0]) < 1e-12 * RADIUS
    assert bench.steps(50, dt=0.6 * DT) == 0  # the time step may change between calls
    assert -bench.frame().grains.vy[1] == pytest.approx(speed, rel=1e-12)


@pytest.mark.parametrize("scale", SCALES)
def test_chain_creeps_by_force_over_viscosity(scale: float) -> None:
    """Each of nine bonds carries what hangs below it: one sweep a step follows the whole chain."""
    viscosity = scale * 0.5 * MASS / DT
    bench = hung(10, viscosity)
    settling = max(math.ceil(700.0 * MASS / viscosity / DT), 6000)  # the slowest motion fades as exp(-0.027 C t/m)
    assert bench.steps(settling) == 0
    vy = bench.frame().grains.vy
    wanted = np.arange(9, 0, -1) * MASS * G / viscosity
    error = np.abs((vy[:-1] - vy[1:]) / wanted - 1.0).max()
    print(f"C dt/m = {scale:g}: error of the creep rates of a chain {error:.1e}")
    assert error < 1e-6


@pytest.mark.parametrize("scale", SCALES)
def test_beam_creeps_in_shear_and_bending(scale: float) -> None:
    """A disc held out sideways: its bond slips at F/C, and turns at F r/Cr under the moment of the weight."""
    viscosity = scale * 0.5 * MASS / DT
    rolling = 5.0 * viscosity * RADIUS**2
    bench = hung(2, viscosity, rolling, angle=0.5 * math.pi)
    settling = math.ceil(60.0 * MASS / viscosity / DT) + 300
    if scale < 1.0:  # it would hang down before it has come to its speed: lighter
        bench.gravity *= 1e-6
    assert bench.steps(settling) == 0
    before = bench.state.bond_strain()
    slip, roll = before.slip[0], before.roll[0]
    assert bench.steps(100) == 0
    after = bench.frame().bonds
    force, span = MASS * abs(bench.gravity[1]), 100 * DT
    lean = abs(roll) + abs(slip) / RADIUS
    assert abs(after.slip[0] - slip) == pytest.approx(force / viscosity * span, rel=1e-6 + 10.0 * lean)
    assert abs(after.roll[0] - roll) == pytest.approx(force * RADIUS / rolling * span, rel=1e-6 + 10.0 * lean)
    assert abs(after.gap[0]) < 0.1 * abs(after.slip[0]) + 1e-14


@pytest.mark.parametrize("shape", ["pair", "unequal", "bent", "triangle"])
@pytest.mark.parametrize("viscosity", [1e-6, 1.0, 1e3, 1e6, 1e15])
def test_any_viscosity_is_stable(viscosity: float, shape: str) -> None:
    """A body that falls askew on a floor: its energy only falls, whatever its bonds' viscosity."""
    form = {"pair": PAIR, "unequal": UNEQUAL, "bent": BENT, "triangle": TRIANGLE}[shape]
    grains = set_in_motion(bodies([form], [0.0], [3.5 * RADIUS], 0.4), vy=-0.5, spin=3.0)
    bench = bench_of(grains, bonds=bonds_of(grains, viscosity, viscosity * RADIUS**2), dt=DT, walls=floor(0.3),
                     gravity=(0.0, -G), contact_friction=0.3)  # fmt: skip
    start, last = bench.frame(), np.inf
    for _ in range(60):
        assert bench.steps(25) == 0
        frame = bench.frame()
        energy = frame.energy.stored - frame.energy.time_step
        assert (
            energy < last + 1e-3 * start.energy.stored
        )  # in a contact of fifty steps the springs' share is right to this
        last = energy
        assert abs(frame.residual) < 1e-3 * frame.energy_in
    assert frame.energy.bonds > -2e-5 * frame.energy_in
    assert len(frame.contacts) > 0 or frame.energy.friction > 0.0


# -- free flight -------------------------------------------------------------------------------------------------------


@ROLLING
@pytest.mark.parametrize("viscosity", [1.0, 1e4, STIFF])
@pytest.mark.parametrize("shape", [PAIR, UNEQUAL, BENT, TRIANGLE], ids=["pair", "unequal", "bent", "triangle"])
def test_free_body_keeps_momentum(shape: Any, viscosity: float, rolling: float) -> None:
    """Over 10 000 steps, spinning, with discs that move against each other at the start."""
    grains = set_in_motion(bodies([shape], [0.1], [0.2], 0.3), vx=0.3, vy=-0.2, spin=20.0)
    grains.vx[0] += 0.05
    grains.spin[1] -= 10.0
    bench = bench_of(grains, bonds=bonds_of(grains, viscosity, rolling), dt=DT)
    before = bench.frame()
    assert bench.steps(10_000) == 0
    after = bench.frame()
    moved, scale = momentum(after.grains) - momentum(grains), grains.mass.sum() * 0.4
    assert np.abs(moved).max() < 1e-12 * scale
    assert abs(angular_momentum(after.grains) - angular_momentum(grains)) < 1e-12 * swing(grains)
    (x0,), (y0,) = centres(grains)
    (x1,), (y1,) = centres(after.grains)
    drift = momentum(grains) / grains.mass.sum() * after.time
    np.testing.assert_allclose([x1 - x0, y1 - y0], drift, rtol=0, atol=1e-12)
    assert after.energy.bonds > 0.0
    # Balance: what is not kinetic any more went to the bonds; their geometry is that of the middle of a step, an error of second order.
    assert abs(after.residual) < 1e-6 * before.energy.kinetic


@ROLLING
def test_stiff_pair_that_turns_fast_keeps_its_length(rolling: float) -> None:
    """Direction and length of the bond are those of the middle of the step, so a pair grows by only (w dt)^3/4 of its length a radian; with
    those of the step's begin it would be w dt/2.
    """
    spin, lengths = 200.0, []
    for parts in (1, 2, 4):
        grains = set_in_motion(bodies([UNEQUAL], [0.0], [0.0]), spin=spin)
        bench = bench_of(grains, bonds=bonds_of(grains, STIFF, rolling), dt=DT / parts)
        bench.steps(round(10.0 / spin / DT) * parts)
        lengths.append(abs(bench.frame().bonds.gap[0]) / (1.6 * RADIUS))
    print(f"stretch of a pair after 10 radians, {spin * DT:.3g} rad a step and half, a quarter of it: {lengths}")
    assert lengths[0] < 0.3 * 10.0 * (spin * DT) ** 3
    assert lengths[1] < 0.14 * lengths[0]
    assert lengths[2] < 0.14 * lengths[1]
    grains = set_in_motion(bodies([UNEQUAL], [0.0], [0.0]), spin=spin)
    bench = bench_of(grains, bonds=bonds_of(grains, STIFF, rolling), dt=DT)
    bench.steps(round(2000.0 / spin / DT))
    frame = bench.frame()
    assert abs(frame.bonds.gap[0]) < 0.3 * 2000.0 * (spin * DT) ** 3 * 1.6 * RADIUS
    assert abs(frame.bonds.slip[0]) < 1e-9 * RADIUS
    np.testing.assert_allclose(frame.grains.spin, spin, rtol=2e-3)  # it grows, so it slows


def test_gears_roll_freely() -> None:
    """Without `rolling` two discs may turn against each other like gears: for ever, and without loss."""
    grains = bodies([PAIR], [0.0], [0.0])
    grains.spin[:] = (50.0, -50.0)
    bench = bench_of(grains, bonds=bonds_of(grains, STIFF), dt=DT)
    bench.steps(5000)
    frame = bench.frame()
    np.testing.assert_allclose(frame.grains.spin, [50.0, -50.0], rtol=1e-12)
    np.testing.assert_allclose(frame.grains.angle, np.array([50.0, -50.0]) * frame.time, rtol=1e-12)
    assert frame.energy.bonds == pytest.approx(0.0, abs=1e-12 * frame.energy.kinetic)
    assert frame.bonds.roll[0] == pytest.approx(-100.0 * frame.time, rel=1e-10)
    assert abs(frame.bonds.slip[0]) < 1e-10 * RADIUS
    # Of unequal ones the rims have the same speed.
    grains = bodies([UNEQUAL], [0.0], [0.0])
    grains.spin[:] = (30.0, -50.0)
    bench = bench_of(grains, bonds=bonds_of(grains, STIFF), dt=DT)
    bench.steps(5000)
    np.testing.assert_allclose(bench.frame().grains.spin, [30.0, -50.0], rtol=1e-10)
    # With it, they turn as one: here not at all.
    grains = bodies([PAIR], [0.0], [0.0])
    grains.spin[:] = (50.0, -50.0)
    bench = bench_of(grains, bonds=bonds_of(grains, STIFF, STIFF), dt=DT)
    before = bench.frame()
    bench.steps(10)
    frame = bench.frame()
    assert np.abs(frame.grains.spin).max() < 1e-6
    assert frame.energy.bonds == pytest.approx(before.energy.kinetic, rel=1e-6)


@pytest.mark.parametrize("direction", ["normal", "tangential", "rolling"])
def test_dashpot_slows_by_its_own_rate(direction: str) -> None:
    """A soft dashpot: the relative motion of a free pair falls as exp(-C t/m_eff), and the others do nothing."""
    rate = 20.0  # 1/s
    none, inertia = 1e-280, 0.5 * MASS * RADIUS**2
    effective = {
        "normal": 0.5 * MASS,
        "tangential": 1.0 / (2.0 / MASS + 2.0 * RADIUS**2 / inertia),
        "rolling": 0.5 * inertia,
    }
    grains = bodies([PAIR], [0.0], [0.0])
    if direction == "rolling":
        grains.spin[:] = (5.0, -5.0)
    elif direction == "tangential":
        grains.spin[:], grains.vy[:] = 0.5, (0.25 * RADIUS, -0.25 * RADIUS)
    else:
        grains.vx[:] = (-0.01, 0.01)
    one = [np.array([effective[name] * rate if name == direction else none]) for name in effective]
    errors = []
    for parts in (1, 2):
        bench = bench_of(grains, bonds=Bonds(np.array([0]), np.array([1]), *one), dt=DT / parts)
        before = bench.frame().energy.kinetic
        bench.steps(400 * parts)
        frame = bench.frame()
        errors.append(abs(frame.energy.kinetic / before / math.exp(-2.0 * rate * frame.time) - 1.0))
        assert frame.energy.bonds == pytest.approx(before - frame.energy.kinetic, rel=1e-6)
    assert errors[0] < 0.05
    assert errors[1] < 0.55 * errors[0] + 1e-9  # backward Euler


@pytest.mark.parametrize("every", [1, 2, 7, 20])
@pytest.mark.parametrize("shape", [PAIR, CHAIN, column(12)], ids=["pair", "chain", "long"])
def test_calls_do_not_matter(shape: Any, every: int) -> None:
    """Velocities are brought to the instant of the places at the end of each call: two half kicks are as the whole one, so that many
    calls do what one does, and the energy of a stiff body never rises.
    """
    runs = []
    for steps in (every, 4200):
        grains = set_in_motion(bodies([shape], [0.0], [0.0], 0.7), vx=1.0, spin=30.0)
        grains.vy[0] += 0.02
        bench = bench_of(grains, bonds=bonds_of(grains, STIFF, STIFF), dt=DT)
        start = bench.frame()
        for _ in range(4200 // steps):
            assert bench.steps(steps) == 0
        runs.append(bench.frame())
        assert runs[-1].energy.kinetic < start.energy.kinetic
        assert np.abs(runs[-1].bonds.roll).max() < 0.02
    for name in ("x", "y", "vx", "vy", "angle", "spin"):
        np.testing.assert_allclose(getattr(runs[0].grains, name), getattr(runs[1].grains, name), rtol=1e-3, atol=1e-4)


# -- four pairs at a time ----------------------------------------------------------------------------------------------


def five_pairs(
    shapes: list[Any], where: slice = slice(None), box: tuple[float, float, float] = (-1e6, 1e6, -1e6)
) -> Bench:
    """Some of five different pairs, far from each other, that fall on a floor."""
    places = np.arange(5) * 1.0
    turned, speed = np.array([0.3, -0.5, 1.1, 0.0, 2.0]), np.array([0.4, -0.2, 0.3, 0.1, -0.6])
    grains = set_in_motion(
        bodies(shapes[where], places[where], np.full(5, 0.025)[where], turned[where]),
        speed[where], -0.5, 10.0 * speed[where],
    )  # fmt: skip
    bonds = bonds_of(grains, 2000.0, 0.3)
    return bench_of(grains, bonds=bonds, dt=DT, walls=floor(0.3, length=40.0), gravity=(0.0, -G), box=box,
                    contact_friction=0.3)  # fmt: skip


def seen(bench: Bench, pair: int) -> Floats:
    """Place, motion, strain and forces of a pair."""
    frame, own = bench.frame(), slice(2 * pair, 2 * pair + 2)
    g, b = frame.grains, frame.bonds
    values = [getattr(g, name)[own] for name in ("x", "y", "angle", "vx", "vy", "spin")]
    bond = bench.state.bonds.data.reshape(-1, BOND)[np.argsort(bench.state.bond_order)[pair], PULL : MOMENT + 1]
    return np.concatenate([*values, [b.gap[pair], b.slip[pair], b.roll[pair]], bond])


def test_four_at_a_time_are_as_one_by_one() -> None:
    """The first four of five go through the vector code, the fifth and each one alone do not: all end the same."""
    shapes = [PAIR, UNEQUAL, PAIR, UNEQUAL, UNEQUAL]
    together = five_pairs(shapes)
    alone = [five_pairs(shapes, slice(k, k + 1)) for k in range(5)]
    assert together.state.bonds.paired
    for _ in range(8):
        for bench in (together, *alone):
            assert bench.steps(150) == 0
        for k, bench in enumerate(alone):
            np.testing.assert_allclose(seen(together, k), seen(bench, 0), rtol=1e-9, atol=1e-11)
    lost = sum(bench.frame().energy.bonds for bench in alone)
    assert together.frame().energy.bonds == pytest.approx(lost, rel=1e-9)
    assert lost > 1e-3
    assert np.abs(together.frame().bonds.roll).max() > 1e-3


def test_four_at_a_time_with_one_that_has_left() -> None:
    """A pair that is out of the box stays where it is; the three beside it do not notice."""
    shapes, box = [PAIR, UNEQUAL, PAIR, UNEQUAL, PAIR], (-0.5, 2.9, -1.0)
    together = five_pairs(shapes, box=box)
    alone = [five_pairs(shapes, slice(k, k + 1), box) for k in range(5)]
    together.frame()
    for bench in (together, *alone):
        assert bench.steps(1500) == 0
    gone = together.frame().grains.escaped
    assert gone.tolist() == [False] * 6 + [True] * 4
    for k in range(3):
        np.testing.assert_allclose(seen(together, k), seen(alone[k], 0), rtol=1e-9, atol=1e-11)
    # When one that goes is taken out depends on how far others move; but it stays there, and its bond rests.
    before = seen(together, 3)
    assert together.steps(100) == 0
    np.testing.assert_array_equal(seen(together, 3)[:15], before[:15])
    assert np.all(np.isfinite(seen(together, 3)))
    frame = together.frame()
    assert np.isfinite(frame.energy.bonds)
    assert abs(frame.residual) < 1e-4 * frame.energy_in


def test_paths_with_and_without_extra_damping_agree() -> None:
    """Extra damping of nothing leads through the scalar code: the same motion as four at a time."""
    shapes = [PAIR, UNEQUAL, PAIR, UNEQUAL, UNEQUAL]
    one, two = five_pairs(shapes), five_pairs(shapes)
    one.steps(1000)
    two.steps(1000, damping=(1e-300, 0.0))
    for k in range(5):
        np.testing.assert_allclose(seen(one, k), seen(two, k), rtol=1e-9, atol=1e-11)
