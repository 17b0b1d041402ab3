"""Heaps of bonded discs: shape, ledger, extra damping, escape, and that order, sorting and chunks are of no matter."""

from __future__ import annotations

import copy
import math
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
    bodies,
    bonds_of,
    momentum,
    set_in_motion,
)
from engine_samples import box, last_frame
from few_grains import KN, MASS, RADIUS, Bench, G, bench_of, run_for, segments

from dem_cli.assembly import Assembly
from dem_cli.assembly.container import build_walls
from dem_cli.engines.explicit import build
from dem_cli.engines.explicit.engine import ExplicitEngine
from dem_cli.engines.explicit.forces import ROW
from dem_cli.errors import RunError
from dem_cli.state import Bonds, Grains

DT = math.pi * math.sqrt(MASS / KN) / 50
STIFF = 1e12  # N s/m
ROLLING = pytest.mark.parametrize("rolling", [0.0, 1e4], ids=["gears", "rolling"])

# -- shape, ledger, options --------------------------------------------------------------------------------------------

HEAP = [PAIR, TRIANGLE, CHAIN, BENT, UNEQUAL, SINGLE, TRIANGLE, PAIR]


def heap_grains() -> Grains:
    n = len(HEAP)
    return set_in_motion(
        bodies(HEAP, np.zeros(n), 0.06 + 0.11 * np.arange(n), np.linspace(0.0, 2.0, n)), vx=0.02, vy=-1.0, spin=1.0
    )


def heap(viscosity: float, rolling: float, **changes: Any) -> Bench:
    """Bodies of all kinds that fall into a box and on each other, dashpots and friction included."""
    grains = heap_grains()
    walls = segments([(-0.1, 0.0, 0.1, 0.0), (-0.1, 0.0, -0.1, 2.0), (0.1, 0.0, 0.1, 2.0)], 0.4)
    settings = {"contact_friction": 0.4, "contact_damping_ratio": 0.2, **changes}
    return bench_of(
        grains, bonds=bonds_of(grains, viscosity, rolling), dt=DT, walls=walls, gravity=(0.0, -G), **settings
    )


@pytest.mark.parametrize("viscosity", [1e4, 1e6, 1e8])
def test_templates_keep_their_shape(viscosity: float) -> None:
    """Eight bodies dropped on each other at up to 4 m/s, for a second: what the bonds give falls with their viscosity, down to what a sweep
    a step leaves of an impact in bodies of several bonds.
    """
    bench = heap(viscosity, viscosity * RADIUS**2)
    bonded = np.bincount(bench.state.body_id[bench.state.bonds.first // ROW], minlength=len(HEAP))
    worst = {True: 0.0, False: 0.0}
    for _ in range(90):
        assert bench.steps(200) == 0
        bonds = bench.state.bond_strain()
        most = np.maximum(np.maximum(np.abs(bonds.gap), np.abs(bonds.slip)) / RADIUS, np.abs(bonds.roll))
        for pairs in worst:
            here = (bonded[bench.state.body_id[bonds_of(heap_grains(), 1.0).i]] == 1) == pairs
            worst[pairs] = max(worst[pairs], most[here].max())
    print(
        f"C = {viscosity:g} N s/m: strain of bonds of pairs up to {worst[True]:.1e}, of longer bodies {worst[False]:.1e}"
    )
    assert worst[True] < max(3e3 / viscosity, 1e-3)
    assert worst[False] < max(3e3 / viscosity, 0.1)
    assert len(bench.state.contacts()) > 5


@ROLLING
@pytest.mark.parametrize("viscosity", [30.0, 1e4, STIFF])
def test_ledger_with_bonds(viscosity: float, rolling: float) -> None:
    """What bonds lose closes the balance."""
    bench = heap(viscosity, rolling)
    bench.frame()
    for _ in range(40):
        assert bench.steps(200) == 0
        frame = bench.frame()
        assert abs(frame.residual) < 3e-4 * frame.energy_in
    assert frame.energy.bonds > 1e-4 * frame.energy_in
    assert frame.energy.friction > 0.0


@pytest.mark.parametrize("damping", [(5.0, 0.0), (0.0, 0.3)], ids=["mass", "local"])
@pytest.mark.parametrize("integrator", ["leapfrog", "thesis"])
def test_extra_damping_and_the_thesis_integrator(integrator: str, damping: tuple[float, float]) -> None:
    """With damping and either integrator: momentum of a free, smooth body is kept or falls as it must, and the ledger balances."""
    bench = heap(1e6, 100.0, integration_integrator=integrator)
    start = bench.frame()
    for _ in range(20):
        assert bench.steps(200, damping=damping) == 0
    frame = bench.frame()
    assert abs(frame.residual) < (1e-3 if integrator == "leapfrog" else 2e-2) * frame.energy_in
    assert frame.energy.damping > 1e-2 * frame.energy_in
    # The thesis' scheme moves by the mean of two velocities: bonds that hold the new one give a little.
    assert np.abs(frame.bonds.gap).max() < (5e-3 if integrator == "leapfrog" else 5e-2) * RADIUS
    assert frame.energy.stored < start.energy.stored
    grains = set_in_motion(bodies([PAIR, UNEQUAL], [0.0, 1.0], [0.0, 0.0]), vx=0.3, spin=10.0)
    free = bench_of(grains, bonds=bonds_of(grains, STIFF, STIFF), dt=DT, integration_integrator=integrator)
    assert free.steps(2000, damping=(damping[0], 0.0)) == 0
    after = free.frame()
    kept = math.exp(-damping[0] * after.time)
    np.testing.assert_allclose(momentum(after.grains), momentum(grains) * kept, rtol=1e-3, atol=1e-12)
    np.testing.assert_allclose(after.grains.spin, 10.0 * kept, rtol=1e-3)


def test_discs_of_one_body_do_not_touch() -> None:
    """Bonded discs overlap as they like: no contact between them is seen, and none acts."""
    grains = bodies([((0.0, 0.0, 1.0), (1.2, 0.0, 1.0), (2.4, 0.0, 1.0))], [0.0], [0.0])
    i, one = np.array([0, 1]), np.ones(2)
    bench = bench_of(grains, bonds=Bonds(i, i + 1, one, one, one), dt=DT)
    for _ in range(3):
        assert bench.steps(100) == 0
        frame = bench.frame()
        assert len(frame.contacts) == 0
        np.testing.assert_array_equal(frame.grains.x, grains.x)


@pytest.mark.parametrize("angle", [0.7, 3.8])
@pytest.mark.parametrize("shape", [PAIR, CHAIN], ids=["pair", "chain"])
def test_body_leaves_as_a_whole(shape: Any, angle: float) -> None:
    """A body is out once its last disc is; its discs go together, and their energy with them."""
    grains = set_in_motion(bodies([shape], [0.0], [0.0], angle), vx=1.0, spin=3.0)
    bench = bench_of(grains, bonds=bonds_of(grains, STIFF, STIFF), dt=DT, box=(-1.0, 0.05, -1.0))
    start = bench.frame()
    for frame in run_for(bench, 0.2, every=20):
        gone = frame.grains.escaped
        assert gone.all() or not gone.any()
    assert gone.all()
    assert np.all(frame.grains.x - frame.grains.radius > 0.05)
    assert np.all(frame.grains.x.min() - RADIUS < 0.05 + 0.5 * RADIUS)
    assert frame.energy.escaped == pytest.approx(start.energy.kinetic, rel=1e-6)
    assert frame.energy.kinetic == 0.0


# -- order, chunks, bits -------------------------------------------------------------------------------------------------


def many(seed: int = 2, shapes: list[Any] | None = None) -> Grains:
    """Forty bodies above a floor, in a mixed order."""
    rng = np.random.default_rng(seed)
    kinds = shapes or [PAIR, UNEQUAL, TRIANGLE, BENT]
    chosen = [kinds[k] for k in rng.integers(len(kinds), size=40)]
    place = rng.permutation(40)
    return set_in_motion(
        bodies(chosen, 0.09 * (place % 5) - 0.18, 0.06 + 0.08 * (place // 5), rng.uniform(0.0, 6.0, 40)),
        rng.uniform(-0.3, 0.3, 40), rng.uniform(-1.0, 0.0, 40), rng.uniform(-5.0, 5.0, 40),
    )  # fmt: skip


def fallen(grains: Grains, steps: int) -> Bench:
    walls = segments([(-0.25, 0.0, 0.25, 0.0), (-0.25, 0.0, -0.25, 2.0), (0.25, 0.0, 0.25, 2.0)], 0.3)
    bench = bench_of(grains, bonds=bonds_of(grains, 1e5, 10.0), dt=DT, walls=walls, gravity=(0.0, -G),
                     contact_friction=0.3, contact_damping_ratio=0.3)  # fmt: skip
    bench.state.sort()
    assert bench.steps(steps) == 0
    return bench


@pytest.mark.parametrize("shapes", [None, [PAIR, UNEQUAL]], ids=["mixed", "pairs"])
def test_same_bits_twice_and_chunks_to_rounding(shapes: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    grains = many(shapes=shapes)
    one, two = fallen(grains, 5000), fallen(grains, 5000)
    assert one.state.rows.tobytes() == two.state.rows.tobytes()
    assert one.state.bonds.data.tobytes() == two.state.bonds.data.tobytes()
    assert one.state.ledger.tobytes() == two.state.ledger.tobytes()
    assert len(one.state.contacts()) > 10
    grains = one.state.grains()  # a dense sample to go on with
    whole = fallen(grains, 200)
    monkeypatch.setattr(build, "CHUNK", 10)
    parts = fallen(grains, 200)
    assert len(whole.state.edges) == 2
    assert len(parts.state.edges) > 8
    starts = parts.state.edges[1:-1]
    assert np.all(parts.state.body[starts] != parts.state.body[starts - 1])
    a, b = whole.frame(), parts.frame()
    assert len(a.contacts) > 10
    for name in ("x", "y", "angle", "vx", "vy"):
        np.testing.assert_allclose(getattr(b.grains, name), getattr(a.grains, name), rtol=0, atol=1e-9)
    np.testing.assert_allclose(b.bonds.slip, a.bonds.slip, rtol=0, atol=1e-10)
    # All discs and bonds are still together after sorting.
    rows = parts.state.bonds
    assert np.array_equal(parts.state.body[rows.first // ROW], parts.state.body[rows.second // ROW])


def test_sorting_in_the_middle() -> None:
    """Nothing that is shown changes, and the motion goes on but for rounding."""
    one = fallen(many(), 5000)
    other = Bench(copy.deepcopy(one.state), one.gravity, one.ground)
    order = other.state.order.copy()
    other.state.sort()
    assert order.tolist() != other.state.order.tolist()
    before, after = one.frame(), other.frame()
    for name, value in vars(before.grains).items():
        np.testing.assert_array_equal(getattr(after.grains, name), value)
    for name in ("gap", "slip", "roll"):
        np.testing.assert_allclose(getattr(after.bonds, name), getattr(before.bonds, name), rtol=0, atol=1e-16)
    assert np.abs(before.bonds.slip).max() > 1e-9
    for _ in range(3):
        one.steps(50)
        other.state.travelled[0] = np.inf
        other.state.sort()
        other.steps(50)
    a, b = one.frame(), other.frame()
    assert len(a.contacts) > 10
    for name in ("x", "y", "angle", "vx", "vy"):
        np.testing.assert_allclose(getattr(b.grains, name), getattr(a.grains, name), rtol=0, atol=1e-9)


def test_blow_up_names_grains_not_discs() -> None:
    """A body that goes through another is named by the number of the grain, which all its discs share."""
    grains = set_in_motion(
        bodies([PAIR, TRIANGLE, PAIR], [0.1, 0.2, 0.3], [0.1, 0.1, 0.1]), vx=np.array([0.0, 90.0, -90.0])
    )
    scenario = box({"container.width": "40 cm"})
    engine = ExplicitEngine(scenario, Assembly(grains, build_walls(scenario), bonds_of(grains, 1e5)))
    with pytest.raises(RunError, match=r"grain (1 and grain 2|2 and grain 1) overlap by"):
        last_frame(engine)
