"""Coefficient of restitution e of two bodies that meet head-on, from the damping ratio h of their contact, and back.

Linear spring and dashpot, d'' + 2 h w d' + w^2 d = 0 from d = 0 (physics.md 1.1). Both formulas reach every 0 < e <= 1.
"""

from __future__ import annotations

import math
from typing import Literal

Tension = Literal["none", "damping"]


def restitution(damping_ratio: float, tension: Tension) -> float:
    """e for damping ratio h >= 0.

    "damping": the contact ends at d = 0, so the dashpot may pull: e = exp(-pi h / sqrt(1 - h^2)); h >= 1 never parts, e = 0.
    "none": it ends earlier, once w d + 2 h d' = 0: e = exp(-(pi - 2 phi) tan phi) with phi = asin h, which is
    exp(-2 h acos h / sqrt(1 - h^2)). Beyond critical damping the same condition gives exp(-2 h acosh h / sqrt(h^2 - 1)); both
    branches meet in exp(-2) = 0.135 at h = 1, and e tends to 1/(4 h^2).
    """
    h = damping_ratio
    if tension == "damping":
        return math.exp(-math.pi * h / math.sqrt(1.0 - h * h)) if h < 1.0 else 0.0
    if h == 1.0:
        return math.exp(-2.0)
    root = math.sqrt(abs(1.0 - h) * (1.0 + h))
    return math.exp(-2.0 * h * (math.acos(h) if h < 1.0 else math.acosh(h)) / root)


def damping_ratio(e: float, tension: Tension) -> float:
    """h >= 0 that gives the restitution 0 < e <= 1: the inverse of `restitution`, which falls monotonically with h.

    "damping" has a closed form. "none" is bisected down to neighbouring floats (scipy would take a second to import).
    """
    if tension == "damping":
        log = math.log(e)
        return -log / math.hypot(math.pi, log)
    if e == 1.0:
        return 0.0
    low, high = 0.0, 1.0
    while restitution(high, tension) > e:
        low, high = high, 2.0 * high
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if restitution(middle, tension) > e else (low, middle)
    return middle
