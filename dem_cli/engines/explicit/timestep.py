"""The largest time step that keeps the explicit scheme stable (numpy only, so that `dem check` starts quickly)."""

from __future__ import annotations

import math

from dem_cli.errors import ScenarioError
from dem_cli.scenario import Scenario


def critical_time_step(kn: float, ks: float, m_min: float, hn: float, hs: float) -> float:
    """Stability limit [s] of leapfrog with dashpots that see the velocity of half a step ago.

    A mode of frequency w and damping ratio z is stable up to dt = (2/w) (sqrt(1 + z^2) - z). The fastest modes that a dense
    packing of discs can have are those of a hexagonal lattice of its lightest grain, with c = 2 h sqrt(m_eff k), m_eff = m/2:
    rows that move against each other, w^2 = 6 (kn + ks)/m, z = sqrt(3) (hn sqrt(kn) + hs sqrt(ks))/sqrt(kn + ks); and all
    discs turning in one sense, w^2 = 24 ks/m, z = sqrt(12) hs. So the limit holds for any arrangement of the grains; it is within
    a tenth of the lattice's own limit over all wave vectors. (A rule found by trials on one packing lets small clusters jitter
    at an unchanged void ratio.)

    kn, ks [N/m]; m_min [kg]: lightest grain; hn, hs [-]: damping ratios.
    """
    both = kn + ks
    shaking = math.sqrt(3.0 / both) * (hn * math.sqrt(kn) + hs * math.sqrt(ks))
    modes = [(math.sqrt(6.0 * both / m_min), shaking), (math.sqrt(24.0 * ks / m_min), math.sqrt(12.0) * hs)]
    return min(2.0 / w * (math.sqrt(1.0 + z**2) - z) for w, z in modes)


def thesis_time_step(kn: float, m_min: float) -> float:
    """The thesis' rule (2.6): an eighth of the natural period T_min = 2 pi sqrt(m_min/kn) of the lightest grain [s]."""
    return 2.0 * math.pi * math.sqrt(m_min / kn) / 8.0


def choose_time_step(scenario: Scenario, m_min: float) -> tuple[float, float]:
    """The time step of a run and its stability limit [s]; m_min [kg]: lightest grain. ScenarioError if it is beyond the limit."""
    kn, ks = scenario.stiffness
    limit = critical_time_step(kn, ks, m_min, *scenario.contact.damping())
    safety, given = scenario.integration.safety, scenario.integration.time_step
    if isinstance(given, str):
        return safety * limit, limit
    if given > limit:
        raise ScenarioError(
            f'{scenario.path or "scenario"}: [integration] time_step = "{given:g} s": is beyond the stability limit of '
            f'{limit:.4g} s. Write "auto", or at most "{0.9 * limit:.2g} s"'
        )
    return given, limit
