"""Restitution and damping ratio against the closed forms of physics.md 1.1 and against the equation of motion itself."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from dem_cli.scenario.restitution import Tension, damping_ratio, restitution


def integrated(h: float, tension: Tension) -> float:
    """Definition: speed at which two bodies part over the speed at which they met, d'' + 2 h d' + d = 0, d = 0, d' = 1."""

    def motion(_: float, y: list[float]) -> list[float]:
        return [y[1], -y[0] - 2.0 * h * y[1]]

    def force_or_overlap(_: float, y: list[float]) -> float:
        return y[0] + 2.0 * h * y[1] if tension == "none" else y[0]

    force_or_overlap.terminal = True  # type: ignore[attr-defined]
    force_or_overlap.direction = -1.0  # type: ignore[attr-defined]
    # With tension, d starts at the event's own zero: begin a little later.
    start = 1e-9
    done = solve_ivp(
        motion, (start, 100.0), [start, 1.0 - 2.0 * h * start], events=force_or_overlap, rtol=1e-11, atol=1e-14
    )
    return float(-done.y_events[0][0][1])


@pytest.mark.parametrize("tension", ["none", "damping"])
@pytest.mark.parametrize("h", [0.01, 0.2, 0.5, 0.9, 0.999])
def test_formula_is_the_motion(h: float, tension: Tension) -> None:
    assert restitution(h, tension) == pytest.approx(integrated(h, tension), rel=1e-6)


@pytest.mark.parametrize("h", [1.0, 1.001, 1.5, 3.0])
def test_overdamped_bodies_part_without_tension(h: float) -> None:
    assert restitution(h, "none") == pytest.approx(integrated(h, "none"), rel=1e-6)


def test_printed_values() -> None:
    """physics.md 1.1: the two formulas differ, h = 0.2 gives 0.5717 without and 0.5266 with tension."""
    assert restitution(0.2, "none") == pytest.approx(0.5717, abs=5e-5)
    assert restitution(0.2, "damping") == pytest.approx(0.5266, abs=5e-5)


def test_limits() -> None:
    assert restitution(0.0, "none") == restitution(0.0, "damping") == 1.0
    assert restitution(1.0, "none") == pytest.approx(math.exp(-2.0), rel=1e-15)
    for h in (1.0 - 1e-7, 1.0 + 1e-7):  # both branches meet at critical damping
        assert restitution(h, "none") == pytest.approx(math.exp(-2.0), rel=1e-6)
    assert restitution(1.0, "damping") == restitution(5.0, "damping") == 0.0
    assert restitution(1e4, "none") == pytest.approx(0.25e-8, rel=1e-6)  # e -> 1/(4 h^2)


@given(st.floats(1e-6, 1.0), st.sampled_from(["none", "damping"]))
def test_inverse(e: float, tension: Tension) -> None:
    assert restitution(damping_ratio(e, tension), tension) == pytest.approx(e, rel=1e-9)


@pytest.mark.parametrize("e", [0.01, 0.1, math.exp(-2.0), 0.5, 0.99])
def test_inverse_is_that_of_a_root_finder(e: float) -> None:
    h = brentq(lambda x: restitution(x, "none") - e, 0.0, 100.0, xtol=1e-15)
    assert damping_ratio(e, "none") == pytest.approx(h, rel=1e-9)
