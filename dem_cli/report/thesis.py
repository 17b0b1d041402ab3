"""What the thesis of 2010 (skeleton particle model, explicit DEM) found in its chapter 8, as data, and what it leaves open.

Ratios are dimensionless, porosities shares (printed in percent), accelerations [m/s^2], frequencies [Hz].
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Found:
    """Void ratio and porosity of a shape when packed and after shaking; `grains` of it; figures they are printed in."""

    grains: int
    packed: float
    shaken: float
    porosity_packed: float
    porosity_shaken: float
    figures: str


# In the order in which the thesis takes them up.
FOUND = {
    "disc": Found(3000, 0.213, 0.198, 0.1756, 0.1656, "8.2, 8.5"),
    "ellipse": Found(3000, 0.160, 0.139, 0.1376, 0.1221, "8.11, 8.14"),
    "pair": Found(1500, 0.220, 0.205, 0.1805, 0.1704, "8.20, 8.23"),
}
DENSER = {"disc": "8.2.4", "ellipse": "8.3.4", "pair": "8.4.4"}  # where it says that shaking compacts the shape
PLURAL = {"disc": "discs", "ellipse": "ellipses", "pair": "bonded pairs"}
WIDTH = 1.215  # of the container [m]
SHAKING = (4.0, 10.0)  # of FOUND
AMPLITUDES = (4.0, 8.0, 12.0)
FREQUENCIES = (10.0, 2.0, 1.0)
LIVELY = ((12.0, 2.0), (8.0, 1.0), (12.0, 1.0))  # the cases that 8.9.2 compares

# Facts of the thesis that bear on a comparison with it.
OPEN = (
    "The thesis does not say how the height of the fill was read, when it called a packing finished, for how long it shook, how radii are "
    "spread between their limits, how ellipses and pairs are turned at the start, or how viscous its bonds are.",
    "Its (2.8) cuts only the spring of a contact that opens, so that the dashpot pulls: falling grains hold together and the bed "
    'stays looser. [contact] tension = "damping" does that here; the default lets no contact pull.',
    "Its (2.16) limits only the spring of the slider, not the dashpot beside it ([contact] slider).",
    "Its test of ellipses (4.32) lies inside the true outline of contact and misses shallow contacts off the axes, so that its "
    'ellipses overlap, and a fill whose grains overlap is lower ([contact] ellipse_test = "enlarged").',
    "Its scheme (3.16)-(3.17) gains energy, 1 + (omega dt)^2/2 a step without damping ([integration] integrator).",
    "Its bonds do not withstand rolling: the discs of a pair turn on each other like gears ([grains.bond] rolling = false).",
)


def is_shaking(amplitude: float, frequency: float, wanted: tuple[float, float]) -> bool:
    """Whether a sine is the `wanted` one, to rounding of units."""
    return math.isclose(amplitude, wanted[0], rel_tol=1e-6) and math.isclose(frequency, wanted[1], rel_tol=1e-6)
