"""Three discs between walls with friction (Kishino 1988, Fig. 7): a kink where the lower discs part, and the largest stress ratio there.

Once the lower discs have parted and slide at floor and side walls, equilibrium of rigid discs gives the forces in closed form. With half of
the force of the top wall as unit, the side walls' force P2, the floor's 1 + mu P2 under each lower disc, and the friction at the upper
disc Xt = mu (1 + mu P2) + mu P2 (moments about the centre of a lower disc):

    P2 = Xn cos(theta) - Xt sin(theta) - mu (1 + mu P2),    1 = Xn sin(theta) + Xt cos(theta).
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from dem_cli.assembly import build_assembly
from dem_cli.engines.granular_element.engine import GranularElementEngine
from dem_cli.scenario import QuasiStaticScenario, load_scenario
from dem_cli.scenario.shipped import folder
from dem_cli.state import Floats

ANGLES = (0, 5, 10, 15)
STIFF = ("material.normal_stiffness=1e9 dyn/cm", "material.tangential_stiffness=7e8 dyn/cm", "solver.sub_steps=20")


@cache
def sheared(degrees: int, *changes: str) -> tuple[Floats, Floats, Floats, int]:
    """Shear strain, (s1 - s2)/(s1 + s2) and theta over the increments, and the increment in which the lower discs have parted."""
    scenario = load_scenario(
        folder() / "biaxial-three-discs-wall-friction.toml",
        [f"contact.wall_friction={degrees} deg", "stage.2.shear_strain=0.02", *changes],
    )
    assert isinstance(scenario, QuasiStaticScenario)
    rows, lower = [], []
    for one in GranularElementEngine(scenario, build_assembly(scenario)).increments():
        if one.stage == 1:
            assert not one.event
            x, y = one.grains.x, one.grains.y
            top, s = int(y.argmax()), one.stress
            left, right = (k for k in range(3) if k != top)
            theta = math.atan2(2.0 * y[top] - y[left] - y[right], abs(x[left] - x[right]))
            rows.append((one.strain[1] - one.strain[0], (s[1] - s[0]) / s.sum(), theta))
            lower.append(bool(((one.contacts.i == left) & (one.contacts.j == right)).any()))
    strain, sine, theta = np.array(rows).T
    return strain, sine, theta, lower.index(False)


def rigid(degrees: float, theta: float) -> float:
    """(s1 - s2)/(s1 + s2) of rigid discs at this theta, as the module says; without friction Kishino's (19)."""
    mu, sin, cos = math.tan(math.radians(degrees)), math.sin(theta), math.cos(theta)
    # Xn = (1 - Xt cos)/sin and Xt = mu + (mu^2 + mu) P2 put in: linear in P2
    side = (cos / sin - mu / sin - mu) / (1.0 + mu * mu + (mu * mu + mu) / sin)
    s1 = (2.0 + mu * side) / (1.0 + 2.0 * cos)  # mean of top and floor, over 2 r
    s2 = side / (1.0 + sin)
    return (s1 - s2) / (s1 + s2)


def test_closed_form_is_the_papers_without_friction() -> None:
    for theta in (math.radians(60.0), math.radians(57.0)):
        ratio = 2.0 * math.tan(theta) * (1.0 + math.sin(theta)) / (1.0 + 2.0 * math.cos(theta))
        assert rigid(0.0, theta) == pytest.approx((ratio - 1.0) / (ratio + 1.0), rel=1e-14)


@pytest.mark.parametrize("degrees", ANGLES)
def test_the_largest_ratio_is_where_the_lower_discs_part(degrees: int) -> None:
    """Before it the springs are loaded, steeply; after it the discs move as a mechanism, and the ratio falls slowly."""
    _, sine, _, parted = sheared(degrees)
    peak = int(sine.argmax())
    assert parted <= peak <= parted + 2
    before, after = np.diff(sine)[: parted - 1], np.diff(sine)[peak:]
    assert before.min() > 0.03
    assert (after < 0.0).all()
    assert np.abs(after).max() < 0.001


@pytest.mark.parametrize("degrees", ANGLES)
def test_the_fall_is_that_of_rigid_discs(degrees: int) -> None:
    """Up to the overlaps, which are a tenth with springs of ten times the stiffness; so is what is left."""
    left = []
    for changes in ((), STIFF):
        _, sine, theta, _ = sheared(degrees, *changes)
        peak = int(sine.argmax())
        left.append(max(abs(have - rigid(degrees, one)) for have, one in zip(sine[peak:], theta[peak:], strict=True)))
    assert left[0] < 1e-3
    assert left[1] < 1e-4


def test_the_largest_ratio_grows_with_the_walls_friction() -> None:
    peaks = [float(sheared(degrees)[1].max()) for degrees in ANGLES]
    assert peaks == sorted(peaks)
    assert peaks == pytest.approx([0.524, 0.687, 0.846, 0.998], abs=1e-3)
