"""No contact is missed while grains move: the engine's contacts against every pair, at many instants of moving runs."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from engine_samples import all_pairs, all_wall_contacts, box, engine_of, heavy, loose_grains, resultants

from dem_cli.engines.explicit.engine import ExplicitEngine
from dem_cli.engines.explicit.forces import CHUNK
from dem_cli.scenario import Scenario
from dem_cli.state import Frame, Grains

ROUNDING = 1e-14  # m: overlaps this small may count as a contact or not


def check_contacts(frame: Frame, scenario: Scenario) -> int:
    """The frame's contacts are those of all pairs, with their overlap; number of them."""
    contacts = frame.contacts
    assert contacts is not None
    found = dict(
        zip(zip(contacts.i.tolist(), contacts.j.tolist(), strict=True), contacts.overlap.tolist(), strict=True)
    )
    assert len(found) == len(contacts)
    assert list(found) == sorted(found)
    wanted = all_pairs(frame.grains) | all_wall_contacts(frame.grains, scenario)
    for pair in found.keys() | wanted.keys():
        assert found.get(pair, 0.0) == pytest.approx(wanted.get(pair, 0.0), abs=ROUNDING), pair
    return len(found)


def check_forces(frame: Frame, engine: ExplicitEngine) -> None:
    """The force that moves a grain is that of the contacts that are shown: so the step saw each of them, and no other."""
    assert frame.forces is not None
    wanted = resultants(frame, engine.gravity)
    scale = max(float(np.abs(wanted).max()), 1.0)
    assert np.abs(frame.forces - wanted).max() < 1e-10 * scale


HARD = {"normal_stiffness": "5e7 N/m", "tangential_stiffness": "1.6e7 N/m"}
MOVING: dict[str, dict[str, Any]] = {
    "shaken hard": {
        "stage": [{"kind": "shake", "amplitude": "1200 gal", "frequency": "1 Hz", "duration": "1.5 s"}],
        "output.interval": "7 ms",
    },
    "shaken at 10 Hz, stage after stage": {  # the grains are sorted anew at the start of each
        "stage": [{"kind": "shake", "amplitude": "8 m/s^2", "frequency": "10 Hz", "duration": "37 ms"}] * 12,
        "output.interval": "5 ms",
    },
    "a box turned over": {
        "material": HARD,
        "container.gravity_direction": "70 deg", "container.lid": True, "container.height": "50 cm",
        "stage": [{"kind": "run", "duration": "0.6 s"}],
        "output.interval": "5 ms",
    },
    "thrown over low walls": {
        "material": HARD,
        "container.height": "8 cm",
        "stage": [{"kind": "shake", "amplitude": "3000 gal", "frequency": "4 Hz", "duration": "1 s", "angle": "60 deg"}],
        "output.interval": "10 ms",
    },
}  # fmt: skip


@pytest.mark.parametrize("motion", MOVING)
def test_no_contact_is_missed(motion: str, settled_box: Callable[[int, int], Grains]) -> None:
    scenario = box(MOVING[motion])
    engine = engine_of(scenario, settled_box(60, 1))
    counts = []
    for frame in heavy(engine.frames()):
        counts.append(check_contacts(frame, scenario))
        check_forces(frame, engine)
    assert len(counts) > 80
    assert max(counts) > 60
    assert len(set(counts)) > 5


@pytest.mark.parametrize("speed", [5.0, 60.0])
def test_no_contact_is_missed_at_any_speed(speed: float) -> None:
    """A gas of grains that fly up to half a radius a step, without gravity; every step is looked at."""
    scenario = box({
        "material.normal_stiffness": "1e9 N/m",
        "material.tangential_stiffness": "3e8 N/m",
        "contact.damping_ratio": 0.05,
        "container": {"width": "16 cm", "gravity": "1e-9 m/s^2", "height": "16 cm", "lid": True},
        "integration.max_overlap": 1.0,
    })  # fmt: skip
    engine = engine_of(scenario, loose_grains(50, seed=2, width=0.16, speed=speed))
    state, dt = engine.state, engine.time_step
    state.first_forces()
    body = np.tile(engine.gravity, (2, 1))
    everything = frozenset({"series"})
    met = 0
    for _ in range(400):
        assert state.advance(dt, body, np.zeros((0, 2)))[0] == 0
        frame = state.frame(engine.gravity, np.zeros((3, 2)), everything, 0, heavy=True)
        met += check_contacts(frame, scenario)
        check_forces(frame, engine)
    assert met > 50
    # The same in one call: lists that are made anew only when they must be change nothing.
    again = engine_of(scenario, loose_grains(50, seed=2, width=0.16, speed=speed))
    again.state.first_forces()
    again.state.advance(dt, np.tile(engine.gravity, (401, 1)), np.zeros((0, 2)))
    one, two = state.grains(), again.state.grains()
    assert np.abs(one.x - two.x).max() < 1e-6 * one.radius.min()
    assert np.abs(one.y - two.y).max() < 1e-6 * one.radius.min()


def test_memory_is_carried_over_rebuilds(settled_box: Callable[[int, int], Grains]) -> None:
    """Lists made anew and grains sorted anew at every turn leave the stretch of all contacts as it would have been."""
    scenario = box({"container.gravity_direction": "-80 deg"})
    left_alone, disturbed = (engine_of(scenario, settled_box(60, 1)) for _ in range(2))
    dt, body = left_alone.time_step, np.tile(left_alone.gravity, (26, 1))
    for engine in (left_alone, disturbed):
        engine.state.first_forces()
    for turn in range(60):
        left_alone.state.advance(dt, body, np.zeros((0, 2)))
        disturbed.state.travelled[0] = np.inf if turn % 2 else disturbed.state.travelled[0]
        disturbed.state.sort()
        disturbed.state.advance(dt, body, np.zeros((0, 2)))
    one, two = left_alone.state.contacts(), disturbed.state.contacts()
    assert one.i.tolist() == two.i.tolist()
    assert one.j.tolist() == two.j.tolist()
    kn, ks = scenario.stiffness
    weight = float(left_alone.state.mass.mean()) * 9.8
    assert ks * np.abs(one.stretch).max() > 0.5 * weight
    assert np.count_nonzero(np.abs(one.shear) > 1e-3 * weight) > 60
    assert np.abs(one.stretch - two.stretch).max() * ks < 1e-6 * weight
    assert np.abs(one.overlap - two.overlap).max() * kn < 1e-6 * weight


def test_many_grains_in_any_order(settled_box: Callable[[int, int], Grains]) -> None:
    """More grains than the step takes at a time (forces.CHUNK): their order in memory is of no matter, nor are calls of one step."""
    copies, width = 160, 0.16
    one = settled_box(60, 1)
    side_by_side = Grains.discs(
        np.concatenate([one.x + k * width for k in range(copies)]), np.tile(one.y, copies), np.tile(one.radius, copies),
        2480.0, 1.0,
    )  # fmt: skip
    n = len(side_by_side)
    assert n > 2 * CHUNK
    shuffled = np.random.default_rng(6).permutation(n)
    scenario = box({"container.width": f"{copies * width} m"})
    steps, body = 40, np.tile([3.0, -9.8], (41, 1))
    whole, mixed, single = (engine_of(scenario, side_by_side.take(k)) for k in (np.arange(n), shuffled, np.arange(n)))
    for engine in (whole, mixed, single):
        engine.state.first_forces()
    dt = whole.time_step
    whole.state.advance(dt, body, np.zeros((0, 2)))
    mixed.state.advance(dt, body, np.zeros((0, 2)))
    for _ in range(steps):
        single.state.advance(dt, body[:2], np.zeros((0, 2)))
    for engine in (mixed, single):
        seen, wanted = engine.state.grains(), whole.state.grains()
        for name in ("x", "y", "vx", "vy", "angle"):
            assert np.abs(getattr(seen, name) - getattr(wanted, name)).max() < 1e-12, name
        frame = engine.state.frame(engine.gravity, np.zeros((3, 2)), frozenset({"series"}), 0, heavy=True)
        assert frame.contacts is not None
        assert len(frame.contacts) > n
        check_forces(frame, engine)


def test_sorting_moves_nothing(settled_box: Callable[[int, int], Grains]) -> None:
    """Sorting changes the order in memory, and nothing that is shown."""
    scenario = box()
    engine = engine_of(scenario, settled_box(60, 1))
    state = engine.state
    state.first_forces()
    state.advance(engine.time_step, np.tile([1.0, -9.8], (301, 1)), np.zeros((0, 2)))
    before = copy.deepcopy((state.grains(), state.contacts()))
    order = state.order.copy()
    state.sort()
    assert order.tolist() != state.order.tolist()
    after = (state.grains(), state.contacts())
    for one, two in zip(before, after, strict=True):
        for name, value in vars(one).items():
            if name in {"nx", "ny", "px", "py", "overlap"}:  # seen from the other side: rounding
                assert np.abs(value - getattr(two, name)).max() < 1e-15
            else:
                assert np.array_equal(value, getattr(two, name)), name
