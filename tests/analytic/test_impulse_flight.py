"""Free flight of rigid bodies: angular momentum is kept, energy nearly, and a body turning about its middle axis flips."""

from __future__ import annotations

import numpy as np
import pytest

from dem_cli.engines.impulse.drift import drift, kinetic_energy
from dem_cli.rigid import rotation
from dem_cli.state import Floats

PRESENT = np.ones(1, dtype=bool)


def fly(moments: Floats, spin: Floats, dt: float, steps: int) -> tuple[Floats, Floats, Floats]:
    """Angular momenta (steps + 1, 3), rotational energies and own spins (steps + 1, 3) of a body that starts unturned."""
    inertia, x, q = moments[None], np.zeros((2, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])
    velocity = np.zeros((2, 6))
    velocity[0, 3:] = spin
    momenta, energies, own = [], [], []
    for step in range(steps + 1):
        turn = rotation(q)[0]
        own.append(turn.T @ velocity[0, 3:])
        momenta.append(turn @ (moments * own[-1]))
        energies.append(kinetic_energy(PRESENT, np.ones(1), inertia, q, velocity)[1])
        if step < steps:
            drift(dt, PRESENT, x, q, velocity, inertia)
    return np.array(momenta), np.array(energies), np.array(own)


def test_asymmetric_body_keeps_angular_momentum_and_flips() -> None:
    """Twenty seconds: L to 1e-10, energy to 1e-5 (physics.md 3); about the middle axis the spin turns over, again and again."""
    momenta, energies, own = fly(np.array([1.0, 2.0, 3.0]), np.array([0.01, 3.0, 0.01]), 1e-3, 20000)
    assert np.abs(momenta - momenta[0]).max() < 1e-10 * np.linalg.norm(momenta[0])
    assert np.abs(energies / energies[0] - 1.0).max() < 1e-5
    assert np.count_nonzero(np.diff(np.sign(own[:, 1]))) >= 3


@pytest.mark.parametrize("axis", [0, 2])
def test_smallest_and_largest_axis_are_stable(axis: int) -> None:
    spin = np.full(3, 0.01)
    spin[axis] = 3.0
    own = fly(np.array([1.0, 2.0, 3.0]), spin, 1e-3, 5000)[2]
    assert own[:, axis].min() > 2.99


def test_symmetric_top_precesses_as_in_closed_form() -> None:
    """I1 = I2: in the body's frame the spin across the axis turns with (I3 - I1) / I1 w3."""
    _, _, own = fly(np.array([1.0, 1.0, 2.0]), np.array([0.5, 0.0, 4.0]), 1e-4, 5000)
    angle = (2.0 - 1.0) / 1.0 * 4.0 * 0.5
    # The sense: I1 w1' = (I2 - I3) w2 w3, so w1 + i w2 turns with +(I3 - I1) / I1 w3.
    assert own[-1] == pytest.approx([0.5 * np.cos(angle), 0.5 * np.sin(angle), 4.0], abs=1e-6)


def test_the_error_of_energy_is_of_second_order() -> None:
    errors = []
    for dt in (4e-3, 2e-3):
        _, energies, _ = fly(np.array([1.0, 2.0, 3.0]), np.array([1.0, 3.0, 2.0]), dt, round(4.0 / dt))
        errors.append(float(np.abs(energies / energies[0] - 1.0).max()))
    assert errors[0] > 3.5 * errors[1]
