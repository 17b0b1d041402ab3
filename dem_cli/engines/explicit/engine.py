"""The explicit DEM engine: stages, outputs and checks around the compiled loop of `step.py`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from dem_cli.assembly import Assembly
from dem_cli.engines.explicit.checks import Watch, blown_up
from dem_cli.engines.explicit.lists import FINE
from dem_cli.engines.explicit.state import ExplicitState
from dem_cli.engines.explicit.timestep import choose_time_step
from dem_cli.engines.motion import Ground, gravity_of, ground_of
from dem_cli.engines.pausing import Pausable
from dem_cli.engines.schedule import Schedule
from dem_cli.scenario import Run, Scenario, Settle, Shake
from dem_cli.state import Frame

QUIET_ROWS = 3  # rows of the series in which a bed must be at rest: one instant of a vibration may look like it
STEPS_PER_CALL = 4e7  # grain-steps between two chances to interrupt: about a second


class ExplicitEngine(Pausable):
    """Runs the stages of a scenario; a generator of frames.

    The state that moves is `state` (arrays only), the place in the list of stages is (stage, stage_started).
    """

    def __init__(self, scenario: Scenario, assembly: Assembly) -> None:
        self.scenario, self.assembly = scenario, assembly
        self.time_step, _ = choose_time_step(scenario, assembly)
        self.gravity = gravity_of(scenario)
        self.state = ExplicitState.start_of(scenario, assembly, self.time_step)
        self.stage = 0
        self.stage_started = 0.0
        self._ground_place = np.zeros(2)
        self._watch = Watch()
        self.check: Callable[[], None] = lambda: None  # called about every second of work; may raise KeyboardInterrupt

    def frames(self, until: int | None = None) -> Iterator[Frame]:
        """Frames that are due, stage after stage, up to stage `until` (from 0), which is not begun. RunError if the run blows up."""
        if not self.done:
            self.state.first_forces()
        for number, stage in enumerate(self.scenario.stages[self.done : until], self.done):
            self.stage = number
            self.stage_started = self.state.time
            ground = ground_of(stage)
            damping = (stage.damping.mass, stage.damping.local) if isinstance(stage, Settle) else (0.0, 0.0)
            yield from self._run_stage(stage, ground, damping)
            self._ground_place = self._ground_place + ground.motion(stage.longest)[0]
            self.done = number + 1

    def _run_stage(self, stage: Settle | Shake | Run, ground: Ground, damping: tuple[float, float]) -> Iterator[Frame]:
        schedule = Schedule(self.scenario.output, self.stage_started, stage.longest)
        self.state.sort()
        quiet = 0
        everything = frozenset({"series", "frames", "tracks"})
        # A later stage begins where the last one ended, and that frame has been written.
        yield self._frame(ground, everything if self.stage == 0 else frozenset(), stage_start=True)
        while not schedule.over(self.state.time):
            moment, due = schedule.next(self.state.time)
            self._advance_to(moment, ground, damping)
            at_rest = ""
            frame = self._frame(ground, due)
            if "series" in due and isinstance(stage, Settle):
                at_rest = self._rest(stage, frame)
                quiet = quiet + 1 if at_rest else 0
                at_rest = at_rest if quiet >= QUIET_ROWS or schedule.over(moment) else ""
            if at_rest or schedule.over(moment):
                reason = at_rest or (
                    f"still moving after {stage.limit:g} s: {self._restlessness(frame)}"
                    if isinstance(stage, Settle)
                    else "its time was over"
                )
                if isinstance(stage, Settle) and not at_rest and self._jitters(stage, frame):
                    reason += (
                        ". Forces jump though nothing moves: the time step is unstable here, lower [integration] safety"
                    )
                warnings = () if at_rest or not isinstance(stage, Settle) else (f"stage {stage.name}: {reason}",)
                frame = self._frame(ground, everything)
                yield replace(frame, stage_end=True, stop_reason=reason, warnings=warnings)
                return
            yield frame
            del frame  # a large one must not wait here while the next is made

    def _advance_to(self, moment: float, ground: Ground, damping: tuple[float, float]) -> None:
        """Equal steps, none longer than the time step, that end exactly at `moment` [s]."""
        start = self.state.time
        steps = max(math.ceil((moment - start) / self.time_step * (1.0 - 1e-9)), 1)
        dt = (moment - start) / steps
        most = max(int(STEPS_PER_CALL / max(len(self.state.mass), 1)), 16)
        done = 0
        while done < steps:
            now = min(most, steps - done)
            moments = np.arange(done, done + now + 1, dtype=np.float64) * dt + (start - self.stage_started)
            driving = -ground.acceleration(moments)
            status, i, j = self.state.advance(
                dt, self.gravity + driving, driving if ground.moves else np.zeros((0, 2)), damping
            )
            done += now
            self.check()
            if status != FINE:
                raise blown_up(self.scenario, self.state, status, i, j, self.time_step)
        self.state.time = moment

    def _frame(self, ground: Ground, due: frozenset[str], *, stage_start: bool = False) -> Frame:
        state = self.state
        motion = ground.motion(state.time - self.stage_started)
        motion[0] += self._ground_place
        frame = state.frame(self.gravity, motion, due, self.stage, heavy=due != {"tracks"} or stage_start)
        if frame.contacts is not None:
            self._watch.look(self.scenario, frame, self.time_step)
        return replace(frame, stage_start=stage_start)

    def _kinetic_per_grain(self, frame: Frame) -> float:
        """Mean kinetic energy of a grain over its weight times its radius [-]; over kn r^2 without gravity."""
        grains = frame.grains
        present = ~grains.escaped
        if not present.any():
            return 0.0
        weight = grains.mass[present] * float(np.hypot(*self.gravity)) * grains.radius[present]
        scale = float(weight.mean()) or self.state.kn * float(grains.radius.mean()) ** 2 * 1e-6
        return frame.energy.kinetic / int(present.sum()) / scale

    def _rest(self, stage: Settle, frame: Frame) -> str:
        """Why the sample counts as at rest, or an empty text."""
        kinetic = self._kinetic_per_grain(frame)
        lonely = frame.contacts is None or len(frame.contacts) == 0
        quiet = lonely or frame.unbalanced < stage.unbalanced
        still_falling = lonely and float(np.hypot(*self.gravity)) > 0.0
        if kinetic < stage.kinetic and quiet and not still_falling:
            return f"at rest: {self._restlessness(frame)}"
        return ""

    def _jitters(self, stage: Settle, frame: Frame) -> bool:
        return frame.unbalanced > 10.0 * stage.unbalanced and self._kinetic_per_grain(frame) < stage.kinetic

    def _restlessness(self, frame: Frame) -> str:
        return (
            f"unbalanced force ratio {frame.unbalanced:.2g}, kinetic energy {self._kinetic_per_grain(frame):.2g} m g r"
        )
