"""Mirrored, turned and renumbered samples move as mirrored, turned and renumbered; state taken out and put back goes on bit by bit."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from engine_samples import box, engine_of, last_frame, loose_grains

from dem_cli.engines.explicit.engine import ExplicitEngine
from dem_cli.engines.explicit.lists import Lists
from dem_cli.engines.explicit.state import ExplicitState, aligned
from dem_cli.state import Contacts, Floats, Frame, Grains

CLOSE = 1e-6  # of a radius: roundings grow from impact to impact
WIDTH = 0.16
# A closed square box, so that it may be turned; each wall has a friction of its own.
CLOSED: dict[str, Any] = {
    "container": {"width": "16 cm", "height": "16 cm", "lid": True},
    "contact.damping_ratio": 0.8,
    "contact.friction": 0.3,
    "stage": [{"kind": "run", "duration": "0.15 s"}],
}


def pair_forces(contacts: Contacts) -> dict[tuple[int, int], tuple[float, float]]:
    """Normal and shear force of contacts between grains."""
    return {
        (int(i), int(j)): (float(n), float(s))
        for i, j, n, s in zip(contacts.i, contacts.j, contacts.normal, contacts.shear, strict=True)
        if j >= 0
    }


def compare(one: Frame, two: Frame, mapped: Callable[[Floats, Floats], tuple[Floats, Floats]], turn: float) -> None:
    """`mapped` takes vectors of one to two; turn: sign of rotations and shear forces."""
    a, b = one.grains, two.grains
    x, y = mapped(a.x - 0.5 * WIDTH, a.y - 0.5 * WIDTH)
    assert np.abs(x + 0.5 * WIDTH - b.x).max() < CLOSE * a.radius.min()
    assert np.abs(y + 0.5 * WIDTH - b.y).max() < CLOSE * a.radius.min()
    vx, vy = mapped(a.vx, a.vy)
    assert np.abs(vx - b.vx).max() < CLOSE
    assert np.abs(vy - b.vy).max() < CLOSE
    assert np.abs(turn * a.angle - b.angle).max() < CLOSE
    assert np.abs((turn * a.spin - b.spin) * a.radius).max() < CLOSE
    assert one.contacts is not None
    assert two.contacts is not None
    forces, others = pair_forces(one.contacts), pair_forces(two.contacts)
    assert forces.keys() == others.keys()
    assert len(forces) > 5
    for pair, (normal, shear) in forces.items():
        assert others[pair] == pytest.approx((normal, turn * shear), abs=1e-3, rel=1e-4)
    assert np.abs(a.angle).max() > 0.05


def moved(grains: Grains, mapped: Callable[[Floats, Floats], tuple[Floats, Floats]], turn: float) -> Grains:
    x, y = mapped(grains.x - 0.5 * WIDTH, grains.y - 0.5 * WIDTH)
    vx, vy = mapped(grains.vx, grains.vy)
    return replace(grains, x=x + 0.5 * WIDTH, y=y + 0.5 * WIDTH, vx=vx, vy=vy, spin=turn * grains.spin)


def motion(changes: dict[str, Any], grains: Grains) -> Frame:
    return last_frame(engine_of(box({**CLOSED, **changes}), grains))


LAWS: dict[str, dict[str, Any]] = {
    "usual": {},
    "thesis": {"contact.tension": "damping", "contact.slider": "spring", "integration.integrator": "thesis"},
    "extra damping": {
        "stage": [{"kind": "settle", "limit": "0.15 s", "unbalanced": 1e-12, "damping": {"mass": "3 1/s"}}]
    },
}


@pytest.mark.parametrize("law", LAWS)
def test_mirrored(law: str) -> None:
    """Left and right exchanged: places, walls' friction, gravity."""
    grains = loose_grains(30, seed=3, width=WIDTH, speed=0.3)
    walls = {"left": 0.1, "right": 0.5, "bottom": 0.3, "top": 0.2}
    mirror = lambda x, y: (-x, y)  # noqa: E731
    one = motion({"contact.wall_friction": walls, "container.gravity_direction": "-70 deg", **LAWS[law]}, grains)
    walls = walls | {"left": 0.5, "right": 0.1}
    two = motion(
        {"contact.wall_friction": walls, "container.gravity_direction": "-110 deg", **LAWS[law]},
        moved(grains, mirror, -1.0),
    )
    compare(one, two, mirror, -1.0)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_turned(quarters: int, law: str) -> None:
    """The box, its walls and gravity turned by 90, 180, 270 degrees."""
    grains = loose_grains(30, seed=3, width=WIDTH, speed=0.3)
    sides = ("bottom", "right", "top", "left")
    values = (0.3, 0.5, 0.2, 0.1)
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters]
    turn = lambda x, y: (cosine * x - sine * y, sine * x + cosine * y)  # noqa: E731
    frames = []
    for angle, sample in ((0, grains), (quarters, moved(grains, turn, 1.0))):
        walls = {sides[(k + angle) % 4]: value for k, value in enumerate(values)}
        gravity = {"container.gravity_direction": f"{-100 + 90 * angle} deg"}
        frames.append(motion({"contact.wall_friction": walls, **gravity, **LAWS[law]}, sample))
    compare(*frames, turn, 1.0)


def test_mirrored_shaking() -> None:
    shake = {"kind": "shake", "amplitude": "600 gal", "frequency": "10 Hz", "duration": "0.15 s", "angle": "30 deg"}
    grains = loose_grains(30, seed=3, width=WIDTH, speed=0.3)
    mirror = lambda x, y: (-x, y)  # noqa: E731
    one = motion({"stage": [shake]}, grains)
    two = motion({"stage": [shake | {"angle": "150 deg"}]}, moved(grains, mirror, -1.0))
    compare(one, two, mirror, -1.0)
    assert two.energy.work == pytest.approx(one.energy.work, rel=1e-6)
    assert two.ground[:, 0] == pytest.approx(-one.ground[:, 0], abs=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_renumbered(law: str) -> None:
    grains = loose_grains(30, seed=3, width=WIDTH, speed=0.3)
    number = np.random.default_rng(1).permutation(30)  # number[k]: old number of grain k
    one = motion(LAWS[law], grains)
    two = motion(LAWS[law], replace(grains.take(number), id=np.arange(30)))
    back = replace(two, grains=two.grains.take(np.argsort(number)))
    assert two.contacts is not None
    i, j = two.contacts.i, two.contacts.j
    between = j >= 0
    old_i, old_j = number[i], np.where(between, number[j], j)
    swap = between & (old_i > old_j)
    assert swap.any()
    contacts = replace(two.contacts, i=np.where(swap, old_j, old_i), j=np.where(swap, old_i, old_j))
    compare(one, replace(back, contacts=contacts), lambda x, y: (x, y), 1.0)


# -- the state is arrays -----------------------------------------------------------------------------------------------


def raw(state: ExplicitState) -> dict[str, bytes]:
    """Everything in a state, as bytes."""
    return {f.name: pickle.dumps(_plain(getattr(state, f.name))) for f in fields(state)}


def _plain(value: Any) -> Any:
    if isinstance(value, Lists):
        return [_plain(array) for array in value]
    return (value.dtype.str, value.shape, value.tobytes()) if isinstance(value, np.ndarray) else value


def put_back(state: ExplicitState) -> ExplicitState:
    """A state from copies of the arrays and numbers of another, as one read from a file would be."""
    rows = aligned(state.rows.size).reshape(state.rows.shape)
    rows[:] = state.rows
    values = {f.name: copy.deepcopy(getattr(state, f.name)) for f in fields(state)}
    return ExplicitState(**{**values, "rows": rows, "lists": Lists(*(array.copy() for array in state.lists))})


def go_on(engine: ExplicitEngine, damping: tuple[float, float], turns: int) -> None:
    dt = engine.time_step
    for turn in range(turns):
        driving = 8.0 * np.sin(0.01 * (50 * turn + np.arange(51)))[:, None] * np.array([1.0, 0.5])
        engine.state.advance(dt * (1.0 - 0.01 * (turn % 3)), engine.gravity + driving, driving, damping)
        if turn % 7 == 6:
            engine.state.sort()


@pytest.mark.parametrize("copied", [copy.deepcopy, put_back], ids=["deepcopy", "arrays put back"])
@pytest.mark.parametrize("integrator", ["leapfrog", "thesis"])
@pytest.mark.parametrize("damping", [(0.0, 0.0), (2.0, 0.2)], ids=["no damping", "extra damping"])
def test_state_taken_out_goes_on_bit_by_bit(
    copied: Callable[[ExplicitState], ExplicitState],
    integrator: str,
    damping: tuple[float, float],
    settled_box: Callable[[int, int], Grains],
) -> None:
    scenario = box({"integration.integrator": integrator, "container.height": "10 cm"})
    engine, other = (engine_of(scenario, settled_box(60, 1)) for _ in range(2))
    engine.state.first_forces()
    go_on(engine, damping, 30)
    before = raw(engine.state)
    other.state = copied(engine.state)
    go_on(engine, damping, 30)
    assert raw(other.state) == before  # a copy shares nothing
    assert raw(engine.state) != before
    go_on(other, damping, 30)
    assert raw(other.state) == raw(engine.state)
    one, two = (
        e.state.frame(e.gravity, np.zeros((3, 2)), frozenset({"series"}), 0, heavy=True) for e in (engine, other)
    )
    assert one.residual == two.residual
    assert one.contacts is not None
    assert len(one.contacts) > 30
