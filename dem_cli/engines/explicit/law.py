"""The contact law: linear spring, dashpot and slider (physics.md 1.1; thesis (2.3)-(2.17)), for one contact or four at once."""

from __future__ import annotations

import math
from typing import NamedTuple

from dem_cli.geometry.lanes import maximum, minimum, where
from dem_cli.jit import kernel


class Law(NamedTuple):
    """Constants of the law in units of kn (forces are lengths) and of a step (velocities are lengths).

    friction [-] between grains; stiffness_ratio = ks/kn, flexibility_ratio its inverse; dashpot_n, dashpot_s: 2 hn and
    2 hs sqrt(ks/kn), to be multiplied by 1/sqrt(kn dt^2/m_eff) of a contact; pull: lowest normal force, 0 without tension, -inf
    where dashpots may pull; free: 0 where the limit holds for spring and dashpot together, inf where for the spring alone.
    """

    friction: float
    stiffness_ratio: float
    flexibility_ratio: float
    dashpot_n: float
    dashpot_s: float
    pull: float
    free: float


def make_law(friction: float, kn: float, ks: float, hn: float, hs: float, *, tension: str, slider: str) -> Law:
    """Law from SI constants and the scenario's words for `tension` ("none", "damping") and `slider` ("total", "spring")."""
    ratio = ks / kn
    return Law(
        friction=friction,
        stiffness_ratio=ratio,
        flexibility_ratio=1.0 / ratio,
        dashpot_n=2.0 * hn,
        dashpot_s=2.0 * hs * math.sqrt(ratio),
        pull={"none": 0.0, "damping": -math.inf}[tension],
        free={"total": 0.0, "spring": math.inf}[slider],
    )


@kernel(inline=True)
def contact_force(overlap, closing, sliding, spring, inertia_root, friction, law):
    """Normal force N = kn d + cn d' and shear resistance T = ks s + cs s', limited by friction.

    overlap d, closing = d' dt and sliding = s' dt [length]; spring: ks s/kn after the previous step [length]; inertia_root:
    1/sqrt(kn dt^2/m_eff); friction [-]; law: Law. All may be floats or Lanes.
    Returns (normal, shear, spring) in units of kn: normal >= law.pull, |spring| <= mu max(N, 0), and |shear| <= the same unless
    law.free; all are zero when the contact is open (d <= 0).
    With slider = "total" the stretch is cut to the limit before the dashpot is added and the sum is cut again: so the force is
    never above the limit and the spring never takes energy from the dashpot. (Setting the stretch such that spring plus dashpot give
    the limit, as some codes do, stores up to 4 h^2 times the kinetic energy of a fast slide.)
    """
    touching = overlap > 0.0
    normal = where(touching, maximum(overlap + law.dashpot_n * inertia_root * closing, law.pull), 0.0)
    limit = friction * maximum(normal, 0.0)
    spring = maximum(minimum(spring + law.stiffness_ratio * sliding, limit), -limit)
    cap = where(touching, maximum(limit, law.free), 0.0)
    shear = maximum(minimum(spring + law.dashpot_s * inertia_root * sliding, cap), -cap)
    return normal, shear, spring


@kernel(inline=True)
def contact_losses(overlap, closing, sliding, old, new, law):
    """Energy lost by one contact over the step that ends now, exact for forces that vary linearly over it (trapezoidal rule).

    old, new: (normal dashpot force, shear dashpot force, spring) before and after the step, in units of kn.
    Returns twice (normal dashpot, tangential dashpot, friction, time step) in units of kn: the work of the dashpot forces on the relative
    displacement; of the spring force on the slip that did not stretch it; and what the normal spring gains (+) or
    loses (-) since its force acts over a whole step in which the contact opened or closed: d times the gap on its other side.
    """
    slip = sliding - (new[2] - old[2]) * law.flexibility_ratio
    crossing = minimum(overlap * (overlap - closing), 0.0)
    return (
        (old[0] + new[0]) * closing,
        (old[1] + new[1]) * sliding,
        (old[2] + new[2]) * slip,
        where(overlap > 0.0, crossing, -crossing),
    )
