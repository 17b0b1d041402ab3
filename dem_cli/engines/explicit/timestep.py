"""The largest time step that keeps the explicit scheme stable (numpy only, so that `dem check` starts quickly)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dem_cli.assembly import Assembly
from dem_cli.errors import ScenarioError
from dem_cli.scenario import Scenario
from dem_cli.state import Floats, Grains

SAMPLES = 64  # of the outline of an ellipse


class Modes(NamedTuple):
    """Fast modes, shape (k,) each: w^2 = (normal kn + tangential ks)/mass; contact [kg]: mass that the dashpots are made for."""

    normal: Floats
    tangential: Floats
    mass: Floats
    contact: Floats


def critical_time_step(kn: float, ks: float, hn: float, hs: float, modes: Modes) -> float:
    """Stability limit [s] of leapfrog with dashpots that see the velocity of half a step ago.

    A mode of frequency w and damping ratio z is stable up to dt = (2/w) (sqrt(1 + z^2) - z); z = (normal cn + tangential cs)/(2 m w) with
    c = 2 h sqrt(m_eff k), m_eff = m/2. kn, ks [N/m]; hn, hs [-]: damping ratios.
    """
    w = np.sqrt((modes.normal * kn + modes.tangential * ks) / modes.mass)
    cn, cs = (2.0 * h * np.sqrt(0.5 * modes.contact * k) for h, k in ((hn, kn), (hs, ks)))
    z = (modes.normal * cn + modes.tangential * cs) / (2.0 * modes.mass * w)
    return float(np.min(2.0 / w * (np.sqrt(1.0 + z**2) - z)))


def disc_modes(mass: Floats, contact: Floats | None = None) -> Modes:
    """The fastest modes that a dense packing of discs can have: those of a hexagonal lattice of its lightest disc.

    Rows that move against each other, w^2 = 6 (kn + ks)/m, and all discs turning in one sense, w^2 = 24 ks/m. So the limit holds for any
    arrangement of the grains; it is within a tenth of the lattice's own limit over all wave vectors. (A rule found by
    trials on one packing lets small clusters jitter at an unchanged void ratio.)
    """
    m = np.array([np.min(mass)])
    c = m if contact is None else contact[[int(np.argmin(mass))]]
    return _joined(Modes(6.0 * m / m, 6.0 * m / m, m, c), Modes(0.0 * m, 24.0 * m / m, m, c))


def ellipse_modes(grains: Grains) -> Modes:
    """The like for ellipses: six neighbours for a disc's length of outline; turning against kn h'^2 + ks h^2, averaged over the outline.

    h, h': how far a contact lies from the centre along its normal and beside it; the disc's modes for a = b.
    """
    ratio = np.unique(grains.a / grains.b)
    mass = np.full(len(ratio), np.inf)
    np.minimum.at(mass, np.searchsorted(ratio, grains.a / grains.b), grains.mass)
    a, b = np.sqrt(ratio), 1.0 / np.sqrt(ratio)  # of unit area radius
    angle = (np.arange(SAMPLES) + 0.5) * (0.5 * np.pi / SAMPLES)
    square = np.outer(a**2, np.cos(angle) ** 2) + np.outer(b**2, np.sin(angle) ** 2)
    side = np.outer((a**2 - b**2) ** 2, (np.cos(angle) * np.sin(angle)) ** 2) / square
    along = square**-1.5  # radius of curvature, length of outline per angle of the normal, as a b = 1
    outline = along.mean(axis=1)
    inertia = 0.25 * (a**2 + b**2)
    normal, tangential = (12.0 * (part * along).mean(axis=1) / inertia for part in (side, square))
    shaking = Modes(6.0 * outline, 6.0 * outline, mass, mass)
    return _joined(shaking, Modes(normal, tangential, mass, mass))


def clump_modes(grains: Grains, disc_mass: Floats) -> Modes:
    """The like for rigid clumps, from how much of each disc's circle is free to touch others.

    Six neighbours for a whole circle; shaking against all of them, and turning against kn |c|^2 + ks (|c| + r)^2, the most that contacts of a
    disc at the distance |c| can resist. disc_mass: of whole discs [kg].
    """
    body, n = grains.body, grains.grain_count

    def total(values: Floats) -> Floats:
        return np.asarray(np.bincount(body, weights=values, minlength=n), dtype=np.float64)

    mass = total(grains.mass)
    cx, cy = (total(grains.mass * center) / mass for center in (grains.x, grains.y))
    far = np.hypot(grains.x - cx[body], grains.y - cy[body])
    inertia = total(grains.inertia + grains.mass * far**2)
    free = free_outline(grains)
    contact = total(disc_mass) / np.bincount(body, minlength=n)
    neighbours = 6.0 * total(free)
    normal, tangential = 12.0 * total(free * far**2), 12.0 * total(free * (far + grains.radius) ** 2)
    share = mass / inertia
    return _joined(
        Modes(neighbours, neighbours, mass, contact), Modes(normal * share, tangential * share, mass, contact)
    )


def free_outline(grains: Grains) -> Floats:
    """Share of each disc's circle that no other disc of its body covers, to within one part in SAMPLES; (n,)."""
    angle = (np.arange(4 * SAMPLES) + 0.5) * (0.5 * np.pi / SAMPLES)
    free = np.ones((len(grains), len(angle)), dtype=bool)
    size = np.bincount(grains.body)
    for apart in range(1, int(size.max(initial=1))):
        i = np.flatnonzero(grains.body[apart:] == grains.body[:-apart])
        for k, m in ((i, i + apart), (i + apart, i)):
            x = grains.x[k, None] + grains.radius[k, None] * np.cos(angle) - grains.x[m, None]
            y = grains.y[k, None] + grains.radius[k, None] * np.sin(angle) - grains.y[m, None]
            free[k] &= x**2 + y**2 >= grains.radius[m, None] ** 2
    return np.asarray(free.mean(axis=1))


def _joined(*parts: Modes) -> Modes:
    return Modes(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def thesis_time_step(kn: float, m_min: float) -> float:
    """The thesis' rule (2.6): an eighth of the natural period T_min = 2 pi sqrt(m_min/kn) of the lightest grain [s]."""
    return 2.0 * math.pi * math.sqrt(m_min / kn) / 8.0


def time_step_limit(scenario: Scenario, assembly: Assembly) -> float:
    """Stability limit of a scenario's grains [s].

    Constraints never raise the highest frequency: rigid clumps of discs that do not overlap, and implicit bonds, are as stable as the discs
    that they are made of. Overlapping ones are bounded in two ways, and the better bound counts.
    """
    grains = assembly.grains
    constants = (*scenario.stiffness, *scenario.contact.damping())
    if not np.array_equal(grains.a, grains.b):
        return critical_time_step(*constants, ellipse_modes(grains))
    if not assembly.rigid:
        return critical_time_step(*constants, disc_modes(grains.mass))
    whole = scenario.grains.density * math.pi * grains.radius**2 * scenario.depth
    by_body = critical_time_step(*constants, clump_modes(grains, whole))
    real = grains.mass > 0.0
    if not real.all() or np.any(grains.inertia[real] < 0.49 * (grains.mass * grains.radius**2)[real]):
        return by_body
    return max(by_body, critical_time_step(*constants, disc_modes(grains.mass, whole)))


def choose_time_step(scenario: Scenario, assembly: Assembly) -> tuple[float, float]:
    """The time step of a run and its stability limit [s]. ScenarioError if it is beyond the limit."""
    limit = time_step_limit(scenario, assembly)
    safety, given = scenario.integration.safety, scenario.integration.time_step
    if isinstance(given, str):
        return safety * limit, limit
    if given > limit:
        raise ScenarioError(
            f'{scenario.path or "scenario"}: [integration] time_step = "{given:g} s": is beyond the stability limit of '
            f'{limit:.4g} s. Write "auto", or at most "{0.9 * limit:.2g} s"'
        )
    return given, limit
