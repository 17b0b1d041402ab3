"""Energies of the granular element engine: work = stored + dissipated + released + residual, and the residual is small."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from granular_samples import COMPRESS, DEPTH, pairs, run, stages

from dem_cli.state import Increment

SHEAR = {"kind": "shear", "hold": "mean-stress", "shear_strain": 0.005}
FORTY = {"grains.count": 40, "stage": [COMPRESS, SHEAR]}
LATERAL = {**FORTY, "stage.1.hold": "lateral-stress"}
CASES: dict[str, dict[str, Any]] = {
    "walls": {"seed": 7},
    "rough walls": {"seed": 4, "contact.wall_friction": 0.3},
    "cohesion": {"seed": 3, "contact.cohesion": "0.02 N"},
    "gravity": {"seed": 5, "container.gravity": "9.81 m/s^2"},
    "chain": {"seed": 1, "boundary.kind": "chain", "boundary.radius": "4 mm"},
    "membrane": {"seed": 4, "boundary.kind": "membrane", "boundary.radius": "4 mm", "stage.1.hold": "lateral-stress"},
}
_KEPT: dict[str, list[Increment]] = {}


def sheared(name: str, **more: Any) -> list[Increment]:
    """The shear stage of a case, run once."""
    label = f"{name} {sorted(more.items())}"
    if label not in _KEPT:
        _KEPT[label] = stages(run({**FORTY, **CASES[name], **more}))[1]
    return _KEPT[label]


def changes_of(found: list[Increment], name: str) -> np.ndarray[Any, Any]:
    return np.diff([getattr(one.energy, name) for one in found])


@pytest.mark.parametrize("name", CASES)
def test_every_increment_is_accounted_for(name: str) -> None:
    """Work and body work are stored, dissipated, released, or said to be the residual; slips are the friction."""
    for before, one in pairs(sheared(name)):
        a, b = before.energy, one.energy
        put_in = b.work - a.work + b.body_work - a.body_work
        gone = b.friction - a.friction + b.released - a.released + b.residual - a.residual
        assert put_in == pytest.approx(b.stored - a.stored + gone, abs=1e-9 * max(abs(b.work), b.stored))
        assert b.friction - a.friction == pytest.approx(one.slips.energy.sum(), rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("name", CASES)
def test_quiet_increments_close(name: str) -> None:
    """With four sub-steps the median residual is below 1e-4 of the mean work of an increment, of no increment above 1e-2."""
    found = sheared(name)
    quiet = np.array([not one.event for one in found[1:]])
    mean = np.abs(changes_of(found, "work")).mean()
    left = np.abs(changes_of(found, "residual"))[quiet] / mean
    assert len(left) >= 5
    assert np.median(left) < 1e-4
    assert left.max() < 1e-2
    assert not np.any(changes_of(found, "released")[quiet])
    friction = changes_of(found, "friction")[quiet]
    assert np.all(friction >= -1e-6 * mean)
    assert friction.max() > 0.01 * mean  # what closes is no trifle


@pytest.mark.parametrize("name", ["walls", "gravity", "chain", "membrane"])
def test_finer_sub_steps_close_better(name: str) -> None:
    """Sixteen sub-steps leave less than a quarter of what four leave, where forces are accurate enough to see it."""
    sums = []
    for parts in (4, 16):
        fine = {"solver.sub_steps": parts, "solver.accuracy": "1e-6 N", "solver.stress_tolerance": 1e-8}
        found = sheared(name, **fine)
        assert not any(one.event for one in found)
        sums.append(np.abs(changes_of(found, "residual")).sum())
    assert sums[1] < 0.25 * sums[0]


def test_work_of_walls_is_stress_times_strain() -> None:
    """In one sub-step: mean of the walls' forces at both ends times their way."""
    found = sheared("walls", **{"solver.sub_steps": 1})
    for a, b in pairs(found):
        if not b.event:
            force = np.array([(one.stress * [one.height, one.width]) * DEPTH for one in (a, b)]).mean(axis=0)
            expected = float(force @ [a.width - b.width, a.height - b.height])
            assert b.energy.work - a.energy.work == pytest.approx(expected, rel=1e-9)


def test_body_work_is_weight_times_sinking() -> None:
    found = sheared("gravity", **{"solver.sub_steps": 1})
    for a, b in pairs(found):
        sunk = float((a.grains.mass * (a.grains.y - b.grains.y)).sum())
        if not b.event:
            assert b.energy.body_work - a.energy.body_work == pytest.approx(9.81 * sunk, rel=1e-9)
    assert found[-1].energy.body_work != found[0].energy.body_work


@pytest.mark.parametrize(
    "changes",
    [
        {"seed": 2, "grains.count": 30, "stage.1.shear_strain": 0.0075},
        {"seed": 11, "grains.count": 30, "stage.1.shear_strain": 0.0075, "container.gravity": "9.81 m/s^2"},
    ],
    ids=["without weight", "with weight"],
)
def test_collapses_close(changes: dict[str, Any]) -> None:
    """Followed iterate by iterate: what fixing forces take out is released, and the rest misses by 1e-3 of what is turned over.

    Increments are one sub-step each, so that nothing else is in an event.
    """
    found = stages(run({"solver.sub_steps": 1, "stage": [COMPRESS, {**SHEAR, "increment": 0.000125}], **changes}))[1]
    events = [(a.energy, b.energy) for a, b in pairs(found) if b.event]
    assert events
    for a, b in events:
        turned = sum(abs(getattr(b, name) - getattr(a, name)) for name in ("work", "body_work", "friction", "released"))
        assert abs(b.residual - a.residual) < 1e-3 * turned
    assert max(b.released - a.released for a, b in events) > 1e-8


def test_ledger_of_the_papers_solver() -> None:
    """(25)-(29) on steps of 0.05 %: within a few percent of the work."""
    found = sheared("walls", solver="kishino", **{"stage.1.shear_strain": 0.003})
    work, left = changes_of(found, "work"), changes_of(found, "residual")
    assert np.abs(left).sum() < 0.03 * np.abs(work).sum()
    assert found[-1].energy.friction > found[0].energy.friction
