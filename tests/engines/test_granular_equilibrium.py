"""Equilibrium of the granular element engine: discs with one contact and none, body forces, and forces in balance with the stresses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from granular_samples import FIRM, KN, RADIUS, SIGMA, few, prepared, run
from scenario_text import ABSENT

from dem_cli.analysis.quasi_static import branch_stress
from dem_cli.engines.granular_element.sample import no_servos, servos
from dem_cli.engines.granular_element.step import Solver, collapse_step, quiet_step, sub_step

BOTH = pytest.mark.parametrize("momentum", [True, False], ids=["momentum", "kishino"])
HOLD_MEAN = ([(1.0, 1.0)], [(0.5, 0.5)])


@BOTH
@pytest.mark.parametrize("side", [(1.0, 0.0), (0.0, -1.0)])
def test_a_disc_with_one_contact_is_driven_out_by_the_wall(momentum: bool, side: tuple[float, float]) -> None:
    """It must not keep its fixing force while walls close: in each of 20 steps it ends below the accuracy, in touch with that wall alone."""
    half = 3.0 * RADIUS
    sample = few([np.array(side) * (half - RADIUS + 1e-6)], (half, half), friction=0.4)
    solver = Solver(momentum=momentum, accuracy=1e-4, stress=1e-6)
    assert np.abs(sample.look().room.fixing).max() > 100.0 * solver.accuracy
    for _ in range(20):
        done, _ = sub_step(sample, sample.box[2:] * 0.99, no_servos(), solver, 1.0)
        assert done.balanced
        assert np.linalg.norm(sample.look().room.fixing) <= solver.accuracy
    assert sample.x[0, :2] @ side == pytest.approx(sample.box[2] - RADIUS, abs=1e-7)
    assert sample.box[2] == pytest.approx(half * 0.99**20)


@BOTH
def test_a_disc_without_contacts_stays(momentum: bool) -> None:
    """In units of the box with the momentum iteration, whose guess is affine; where it was in the paper's way."""
    sample = few([(0.3 * RADIUS, -0.2 * RADIUS)], (3.0 * RADIUS, 3.0 * RADIUS))
    solver = Solver(momentum=momentum, accuracy=1e-4, stress=1e-6)
    done, _ = sub_step(sample, sample.box[2:] * [0.9, 1.0], no_servos(), solver, 1.0)
    assert done.balanced
    assert done.iterations <= 1
    expected = [0.27 if momentum else 0.3, -0.2, 0.0]
    np.testing.assert_allclose(sample.x[0] / RADIUS, expected, rtol=1e-12)


@BOTH
def test_a_heavy_disc_falls_and_rests(momentum: bool) -> None:
    """(13): without contact along the body force; on the floor it bears its weight; the whole way down is body work, released."""
    sample = few([(0.0, 0.5 * RADIUS)], (3.0 * RADIUS, 3.0 * RADIUS), load=(0.0, -0.5))
    solver = Solver(momentum=momentum, accuracy=1e-6, stress=1e-6)
    done = collapse_step(
        sample, sample.box[2:].copy(), no_servos(), solver, [solver.pace(1, 0.75, 0.0, 20000, follow=True)]
    )
    assert done.balanced
    assert sample.near.wall_normal.sum() == pytest.approx(0.5, rel=1e-5)
    assert sample.x[0, 0] == 0.0
    assert sample.x[0, 1] == pytest.approx(-2.0 * RADIUS - 0.5 / KN, abs=1e-9)
    assert done.body_work == pytest.approx(0.5 * 2.5 * RADIUS, rel=1e-3)
    assert done.work == 0.0
    assert done.released == pytest.approx(done.body_work, rel=1e-2)


def test_rolling_down_to_rest() -> None:
    """(11): a heavy disc on one other rolls over it without sliding, and comes to rest beside it; the lower one cannot move."""
    lower = (0.0, -2.0 * RADIUS)
    sample = few(
        [(0.2 * RADIUS, -0.021 * RADIUS), lower],
        (3.0 * RADIUS, 3.0 * RADIUS),
        friction=5.0,
        wall_friction=[5.0] * 4,
        load=(0.0, -0.5),
    )
    sample.bodies.load[1] = 0.0
    solver = Solver(momentum=False, accuracy=1e-4, stress=1e-6, most=20_000)
    before = sample.x.copy()
    pace = solver.pace(2, 0.75, 0.0, 20, follow=True)
    collapse_step(sample, sample.box[2:].copy(), no_servos(), solver, [pace])
    moved = sample.x[0] - before[0]
    assert moved[0] > 20 * 1e-7
    assert moved[2] < 0.0  # clockwise, to the right
    assert abs(sample.near.shear[0]) < 0.5 * 0.5  # the misprinted sign slips by twice the way
    assert moved[2] == pytest.approx(-np.hypot(*moved[:2]), rel=0.2)


@BOTH
def test_stress_above_and_strain_aside(momentum: bool) -> None:
    """Two smooth discs between four walls, the line of centres at 50 degrees, 15 kPa held above: every force follows from statics."""
    angle = np.radians(50.0)
    half = RADIUS * np.array([1.0 + np.cos(angle), 1.0 + np.sin(angle)])
    places = RADIUS * np.array([(-np.cos(angle), -np.sin(angle)), (np.cos(angle), np.sin(angle))])
    sample = few(places, (half[0] - 1e-6, half[1] - 1e-6))
    solver = Solver(momentum=momentum, accuracy=1e-5, stress=1e-6)
    done = collapse_step(sample, sample.box[2:].copy(), servos([(0.0, 1.0)], [(0.0, 1.0)], [SIGMA], SIGMA), solver)
    assert done.balanced
    high = SIGMA * 2.0 * sample.box[2] * sample.depth
    branch = sample.x[1] - sample.x[0]
    np.testing.assert_allclose(sample.near.normal, high * np.hypot(*branch[:2]) / branch[1], rtol=1e-5)
    by_side = dict(zip(sample.near.side.tolist(), sample.near.wall_normal.tolist(), strict=True))
    aside = high * branch[0] / branch[1]
    assert [by_side[side] for side in range(4)] == pytest.approx([aside, aside, high, high], rel=1e-5)


def test_servos_meet_both_stresses() -> None:
    """In a packing: stresses as asked for, all fixing forces below the accuracy, contact forces in balance with the walls."""
    last = run({"stage": [{"kind": "compress", "stress": "15 kPa", "friction": "15 deg"}]})[-1]
    np.testing.assert_allclose(last.stress, SIGMA, rtol=2e-6)
    accuracy = 1e-5 * SIGMA * 2.0 * float(last.grains.radius.mean()) * 0.01
    assert last.balance <= accuracy
    found = branch_stress(last, 0.01)
    np.testing.assert_allclose(np.diag(found), SIGMA, rtol=1e-5)
    assert found[0, 1] == pytest.approx(found[1, 0], abs=1e-4 * SIGMA)


@pytest.mark.parametrize("kind", ["walls", "chain", "membrane"])
def test_stress_on_the_boundary_is_that_of_the_contacts(kind: str) -> None:
    """Whatever the boundary: without gravity its mean stress is the sum of force times branch over the area; friction acts."""
    changes: dict[str, Any] = {"boundary.kind": kind, "boundary.radius": "4 mm" if kind != "walls" else ABSENT}
    if kind == "walls":
        changes = {"contact.wall_friction": 0.0}
    if kind == "membrane":
        changes["stage.1.hold"] = "lateral-stress"
    last = run(changes)[-1]
    found = branch_stress(last, 0.01)
    np.testing.assert_allclose(np.diag(found), last.stress, rtol=1e-4)
    assert abs(found[0, 1] - found[1, 0]) < 2e-3 * SIGMA  # arms of shear forces are radii
    assert last.stress[1] > 1.02 * last.stress[0]


def test_accuracy_is_what_is_asked_for() -> None:
    """By default 1e-5 of mean stress times mean diameter times depth; never more is left on a grain, and no less needed."""
    for given in (None, "1e-5 N", "1e-2 N"):
        states = run({"solver.accuracy": given or ABSENT}, prepared()) if given else run(None, prepared())
        last = states[-1]
        asked = float(given.split()[0]) if given else 1e-5 * SIGMA * 2.0 * float(last.grains.radius.mean()) * 0.01
        assert last.balance <= asked * (1.0 + 1e-9)
        assert last.balance > 0.01 * asked


def test_a_smooth_path_needs_no_collapse() -> None:
    """quiet_step gives None, and only then the way is followed, where a disc leaves the neighbourhood: buckling of a column of three."""
    step = 2.0 * RADIUS - 1e-5
    sample = few([(0.0, -step), (1e-3 * RADIUS, 0.0), (0.0, step)], (3.0 * RADIUS, step + RADIUS - 1e-5))
    twin = sample.copy()
    goal = sample.box[2:] * [1.0, 0.99]
    assert quiet_step(twin, goal, no_servos(), FIRM, 1e-12) is None
    done, way = sub_step(sample, goal, no_servos(), FIRM, 1e-12)
    assert done.event
    assert way is None
    assert done.rung >= 1
    assert done.released > 0.0
    assert sample.x[1, 0] - sample.x[0, 0] > 0.34 * RADIUS  # what rigid discs need at this height
    assert abs(done.residual) < 1e-3 * done.released
