"""Elasticity of a hexagonal lattice by the granular element engine: physics.md 1.9.

The outermost discs of a patch are driven with the box, so the strain is affine; inside, each disc has six contacts whose changes of
force cancel in pairs. So the affine field is in equilibrium, and the stress from the contacts of one disc is that of the whole lattice.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from granular_samples import DEPTH, FIRM, KN, KT, RADIUS, few

from dem_cli.engines.granular_element.sample import Sample, no_servos
from dem_cli.engines.granular_element.step import sub_step
from dem_cli.state import Floats

SPACING = 2.0 * RADIUS * (1.0 - 1e-5)
STRAIN = 1e-7
YOUNG = 2.0 * math.sqrt(3.0) * KN * (KN + KT) / (3.0 * KN + KT)
POISSON = (KN - KT) / (3.0 * KN + KT)


def patch(angle: float) -> Sample:
    """All lattice points in a circle, rows turned by `angle`, those with fewer than six neighbours driven; the first one in the middle."""
    a, b = (k.ravel() for k in np.meshgrid(np.arange(-5, 6), np.arange(-5, 6)))
    places = SPACING * np.column_stack([a + 0.5 * b, math.sqrt(0.75) * b])
    far = np.hypot(*places.T)
    places = places[far < 3.6 * SPACING]
    places = places[np.argsort(np.round(np.hypot(*places.T) / RADIUS, 6), kind="stable")]
    apart = np.hypot(*(places[:, None, :] - places[None, :, :]).transpose(2, 0, 1))
    inner = np.sum(apart < 1.1 * SPACING, axis=1) == 7
    places = np.concatenate([places[inner], places[~inner]])
    turn = np.array([(math.cos(angle), math.sin(angle)), (-math.sin(angle), math.cos(angle))])
    first = int(inner.sum())
    driven = range(first, len(places))
    return few(places @ turn, (4.0 * SPACING, 4.0 * SPACING), friction=1e6, driven=list(driven))


def stress(sample: Sample) -> Floats:
    """(2, 2), of the cell around the first disc: half of force times branch of its six contacts over the area of a lattice cell."""
    contacts, place = sample.contacts(), sample.x[:, :2]
    of = (contacts.i == 0) | (contacts.j == 0)
    assert np.sum(of) == 6
    n = np.stack([contacts.nx[of], contacts.ny[of]])
    force = contacts.normal[of] * n + contacts.shear[of] * np.stack([-n[1], n[0]])
    branch = (place[contacts.j[of]] - place[contacts.i[of]]).T
    return np.asarray(0.5 * force @ branch.T / (math.sqrt(0.75) * SPACING**2 * DEPTH))


@pytest.mark.parametrize("angle", [0.0, 0.3, math.pi / 2.0])
@pytest.mark.parametrize("strain", [(1.0, 0.0), (0.0, 1.0), (0.5, -0.5)])
def test_stiffness_of_the_lattice(angle: float, strain: tuple[float, float]) -> None:
    """E/(1 - nu^2) (e + nu e'), the same in all directions."""
    sample = patch(angle)
    before, places = stress(sample), sample.x.copy()
    done, _ = sub_step(sample, sample.box[2:] * (1.0 - STRAIN * np.array(strain)), no_servos(), FIRM, 1.0)
    assert done.balanced
    assert not done.event
    np.testing.assert_allclose(
        sample.x[:, :2], places[:, :2] * (1.0 - STRAIN * np.array(strain)), atol=1e-4 * STRAIN * RADIUS
    )
    e = np.array(strain) * STRAIN
    modulus = YOUNG / (1.0 - POISSON**2) / DEPTH
    expected = modulus * (e + POISSON * e[::-1])
    found = stress(sample) - before
    np.testing.assert_allclose(np.diag(found), expected, atol=1e-4 * modulus * STRAIN)
    np.testing.assert_allclose(found[[0, 1], [1, 0]], 0.0, atol=1e-4 * modulus * STRAIN)


def test_young_modulus_and_poisson_ratio() -> None:
    """Uniaxial stress: the ratio of strains that leaves no lateral stress."""
    changes = []
    for strain in ((1.0, 0.0), (0.0, 1.0)):
        sample = patch(0.0)
        before = stress(sample)
        sub_step(sample, sample.box[2:] * (1.0 - STRAIN * np.array(strain)), no_servos(), FIRM, 1.0)
        changes.append(np.diag(stress(sample) - before) / STRAIN)
    compliance = np.linalg.inv(np.array(changes).T)
    assert 1.0 / compliance[1, 1] * DEPTH == pytest.approx(YOUNG, rel=1e-4)
    assert -compliance[0, 1] / compliance[1, 1] == pytest.approx(POISSON, rel=1e-3)
