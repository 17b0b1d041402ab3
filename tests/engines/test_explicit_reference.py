"""The explicit engine against a plain second one, step by step: all options of the law, both integrators, all dampings."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from engine_samples import box, engine_of, loose_grains
from reference_engine import Reference

from dem_cli.assembly.container import build_walls

STEPS, CHUNK = 2000, 250
CLOSE = 1e-9  # of a radius

LAWS: list[dict[str, Any]] = [
    {"contact.tension": tension, "contact.slider": slider, "integration.integrator": integrator}
    for tension, slider, integrator in product(("none", "damping"), ("total", "spring"), ("leapfrog", "thesis"))
]
# (mass-proportional [1/s], local)
DAMPINGS = [(4.0, 0.0), (0.0, 0.3)]


def compare(changes: dict[str, Any], damping: tuple[float, float] = (0.0, 0.0), shake: float = 0.0) -> None:
    """Twelve grains fall into a box with low walls, spinning, for 2000 steps; some roll over the end of a wall and leave.

    Those that have left are not compared: the engine takes them out, the reference lets them fall.
    """
    width = 0.08
    scenario = box({
        "contact.friction": 0.4,
        "contact.damping_ratio": {"normal": 0.8, "tangential": 0.5},
        "contact.wall_friction": {"left": 0.1, "right": 0.5, "bottom": 0.3},
        "container.width": f"{width} m",
        "container.height": "2.2 cm",
        **changes,
    })  # fmt: skip
    grains = loose_grains(12, seed=4, width=width, speed=0.2)
    engine = engine_of(scenario, grains)
    contact = scenario.contact
    reference = Reference(
        grains, build_walls(scenario), *scenario.stiffness, *contact.damping(), contact.friction, contact.tension,
        contact.slider, scenario.integration.integrator, *damping,
    )  # fmt: skip
    state, dt = engine.state, engine.time_step
    state.first_forces()
    driving = shake * np.sin(2.0 * np.pi * 10.0 * dt * np.arange(STEPS + 1))[:, None] * np.array([0.8, 0.6])
    body = engine.gravity + driving
    apart = []
    for start in range(0, STEPS, CHUNK):
        part = slice(start, start + CHUNK + 1)
        reference.advance(dt, body[part])
        status, _, _ = state.advance(dt, body[part], driving[part] if shake else np.zeros((0, 2)), damping)
        assert status == 0
        now = state.grains()
        here = ~now.escaped
        unit = np.stack([np.ones(12), np.ones(12), now.radius], axis=1)
        place = np.stack([now.x, now.y, now.angle], axis=1)
        velocity = np.stack([now.vx, now.vy, now.spin], axis=1)
        apart.append(float(np.max(np.abs((place - reference.place) * unit / now.radius[:, None])[here])))
        assert np.max(np.abs((velocity - reference.velocity) * unit)[here]) < 100.0 * CLOSE
    assert np.count_nonzero(now.escaped) <= 3
    assert max(apart) < CLOSE, apart
    # The comparison means something: there were contacts of all kinds, and some are loaded and stretched at the end.
    assert len([pair for pair in reference.touched if pair[1] >= 0]) > 10
    assert {pair[1] for pair in reference.touched if pair[1] < 0} == {-1, -2, -3}
    contacts = state.contacts()
    known = {
        pair: force
        for pair, force in reference.stretch_force.items()
        if not now.escaped[list(pair)[: 1 + (pair[1] >= 0)]].any()
    }
    assert {*zip(contacts.i.tolist(), contacts.j.tolist(), strict=True)} == known.keys()
    springs = [abs(known[pair]) for pair in known]
    assert max(springs) > 0.1
    stretched = scenario.stiffness[1] * contacts.stretch
    for i, j, force in zip(contacts.i.tolist(), contacts.j.tolist(), stretched.tolist(), strict=True):
        assert force == pytest.approx(known[i, j], abs=1e-5)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: "-".join(law.values()))
def test_same_motion_as_the_reference(law: dict[str, Any]) -> None:
    compare(law)


@pytest.mark.parametrize("integrator", ["leapfrog", "thesis"])
@pytest.mark.parametrize("damping", DAMPINGS, ids=["mass", "local"])
def test_same_motion_with_extra_damping(damping: tuple[float, float], integrator: str) -> None:
    compare({"integration.integrator": integrator}, damping)


@pytest.mark.parametrize("integrator", ["leapfrog", "thesis"])
def test_same_motion_shaken(integrator: str) -> None:
    compare({"integration.integrator": integrator}, shake=6.0)
