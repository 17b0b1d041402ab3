"""Runs that go wrong: what is noticed, and what the user is told."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.engines.explicit.lists import NOT_A_NUMBER
from dem_cli.engines.explicit.state import ExplicitState
from dem_cli.errors import RunError
from dem_cli.scenario import Scenario
from dem_cli.state import Energy, Frame

GAIN = 0.02  # of the energy put in: more than this out of nothing between two looks is not the physics
FEEDING = 1e-3  # of the energy put in: dashpots and friction may not give back more than this


def blown_up(scenario: Scenario, state: ExplicitState, status: int, i: int, j: int, time_step: float) -> RunError:
    """The error for a status of `advance` that is not FINE: grain, time, cause and remedy."""
    grain = int(state.body_id[state.order[i]])
    when = f"t = {state.time:.6g} s"
    if status == NOT_A_NUMBER:
        cause = f"the position of grain {grain} is no longer a number"
        remedy = f"Take a smaller time step than {time_step:.3g} s ([integration] time_step or safety)"
        return RunError(f"{when}: {cause}. {remedy}")
    n, overlap = len(state.mass), state.overlap(i, j)
    least = float(state.radius[i] if j >= n else min(state.radius[i], state.radius[j]))
    other = f"the {state.wall_names[j - n]} wall" if j >= n else f"grain {int(state.body_id[state.order[j]])}"
    limit = scenario.integration.max_overlap
    return RunError(
        f"{when}: grain {grain} and {other} overlap by {overlap / least:.2g} of the smaller radius, more than "
        f"max_overlap = {limit:g}. The contacts are too soft for the load (raise the stiffness), the grains start too close or too "
        f"fast, or the time step of {time_step:.3g} s is too long"
    )


class Watch:
    """Looks at every frame for energy that comes from nowhere: without tension an unstable step is otherwise silent."""

    def __init__(self) -> None:
        self._last: tuple[Energy, int] | None = None

    def look(self, scenario: Scenario, frame: Frame, time_step: float) -> None:
        """RunError if kinetic energy rises without work, or a loss turns into a gain, since the last frame."""
        last, self._last = self._last, (frame.energy, len(frame.contacts or ()))
        if last is None or frame.energy_in <= 0.0:
            return
        now, (before, contacts) = frame.energy, last
        for name, value in vars(now).items():
            if not math.isfinite(value):
                raise RunError(f"t = {frame.time:.6g} s: the energy ({name}) is no longer a number{_remedy(time_step)}")
        given = (now.work - before.work) - (now.stored - before.stored) - (now.escaped - before.escaped)
        unstable = scenario.integration.integrator == "leapfrog" and -given > GAIN * frame.energy_in
        for name in ("friction", "dashpot_normal", "dashpot_tangential"):
            unstable = unstable or getattr(before, name) - getattr(now, name) > FEEDING * frame.energy_in
        if unstable:
            fastest = int(np.argmax(np.hypot(frame.grains.vx, frame.grains.vy)))
            raise RunError(
                f"t = {frame.time:.6g} s: kinetic energy rose from {before.kinetic:.3g} to {now.kinetic:.3g} J with {-given:.3g} J "
                f"out of nothing, contacts went from {contacts} to {len(frame.contacts or ())}, grain "
                f"{int(frame.grains.body[fastest])} is the fastest: the time step is unstable{_remedy(time_step)}"
            )


def _remedy(time_step: float) -> str:
    return f". Take a smaller one than {time_step:.3g} s ([integration] time_step or safety)"
