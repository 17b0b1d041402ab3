"""The largest time step that keeps the explicit scheme stable (numpy only, so that `dem check` starts quickly)."""

from __future__ import annotations

import math

from dem_cli.errors import ScenarioError
from dem_cli.scenario import Scenario


def critical_time_step(kn: float, ks: float, m_min: float, hn: float, hs: float) -> float:
    """Stability limit [s] of leapfrog with dashpots that see the velocity of half a step ago.

    A mode of frequency w and damping ratio z is stable up to dt = (2/w) (sqrt(1 + z^2) - z). The fastest mode that a dense
    packing of discs can have is that of a hexagonal lattice of its lightest grain: neighbours that move against each other,
    w^2 = 6 (kn + ks)/m, or all discs that turn in one sense, w^2 = 24 ks/m. With w^2 = kappa kn/m and as many dashpots,
    z = h sqrt(kappa/2) since c = 2 h sqrt(m_eff kn) and m_eff = m/2. (kappa = 6, found by trials on one packing, lets single
    clusters of small grains jitter at an unchanged void ratio: seen in the thesis' sample at 0.8 of that limit.)

    kn, ks [N/m]; m_min [kg]: lightest grain; hn, hs [-]: damping ratios.
    """
    ratio = ks / kn
    kappa = max(6.0 * (1.0 + ratio), 24.0 * ratio)
    damping = max(hn, hs) * math.sqrt(kappa / 2.0)
    frequency = math.sqrt(kappa * kn / m_min)
    return 2.0 / frequency * (math.sqrt(1.0 + damping**2) - damping)


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
