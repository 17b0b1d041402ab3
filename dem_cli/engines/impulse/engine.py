"""The impulse engine: stages, outputs and checks around the compiled steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from dem_cli.engines.impulse.state import WHOLE, ImpulseState
from dem_cli.engines.impulse.step import WORK
from dem_cli.engines.impulse.timestep import choose_time_step, coarse
from dem_cli.engines.motion import Ground, ground_of
from dem_cli.engines.pausing import Pausable
from dem_cli.engines.schedule import Schedule
from dem_cli.errors import RunError, ScenarioError
from dem_cli.rigid import BodyFrame, Scene
from dem_cli.scenario import ImpulseScenario, ImpulseSettle, ImpulseShake, Run
from dem_cli.state import Floats

QUIET_ROWS = 3  # rows of the series in which bodies must be at rest: one instant of a bounce may look like it
LEFT = 1e-3  # penetration over the smaller reach that a run may leave, and that is no overlap at the start: steps take it back
SEPARATING = 1000  # rounds in which overlapping bodies are moved apart at the start


class ImpulseEngine(Pausable):
    """Runs the stages of a scenario; a generator of frames."""

    def __init__(self, scenario: ImpulseScenario, scene: Scene) -> None:
        self.scenario, self.scene = scenario, scene
        self.time_step = choose_time_step(scenario, scene)
        self.gravity = np.array(scenario.gravity)
        self.state = ImpulseState.start_of(scenario, scene, self.gravity)
        self.stage = 0
        self.stage_started = 0.0
        self._ground_place = np.zeros(3)
        self._warnings: list[str] = [*coarse(scenario, scene, self.time_step), *self._part_bodies()]
        self.state.start = self.state.energy()
        self.check: Callable[[], None] = lambda: None  # called at every output; may raise KeyboardInterrupt

    def _part_bodies(self) -> list[str]:
        """Moves bodies that overlap at the start apart, or refuses them; returns what there is to tell."""
        state = self.state
        state.look(WHOLE)
        (share, i, j), state.deepest = state.deepest, (0.0, 0, 0)
        most = max(LEFT, state.rules.slop)
        if share <= most:
            return []
        found = state.found
        assert found is not None
        deep = -found.gap > most * state.smaller(found)
        pairs = len(set(zip(found.i[deep].tolist(), found.j[deep].tolist(), strict=True)))
        said = f"{self.name(i)} and {self.name(j)} overlap at the start by {share:.2g} of the smaller one's radius"
        if self.scenario.packing.overlaps == "refuse":
            raise ScenarioError(
                f'{self.scenario.origin}: {said}. Move them apart, or write [packing] overlaps = "separate"'
            )
        before = state.moving.x.copy()
        left, i, j = state.separate(SEPARATING)
        if left > 2.0 * state.rules.slop:
            said = f"{self.name(i)} and {self.name(j)} overlap by {left:.2g} of the smaller one's radius"
            raise ScenarioError(f"{self.scenario.origin}: {said}, and could not be pushed apart. Give them more room")
        moved = float(np.linalg.norm(state.moving.x - before, axis=1).max())
        state.last = state.found = None
        return [f"{said}; {pairs} such pair{'s were' if pairs > 1 else ' was'} pushed apart, by {moved:.3g} m at most"]

    def name(self, k: int) -> str:
        """What messages call body k, or wall -1 - k."""
        if k >= 0:
            return f"body {int(self.scene.bodies.id[k])} ({self.scene.groups[int(self.scene.bodies.group[k])]})"
        wall, planes = -1 - k, self.scene.planes
        if wall < len(planes):
            return planes.name[wall]
        return self.scene.terrain.name if self.scene.terrain else "the terrain"

    def frames(self, until: int | None = None) -> Iterator[BodyFrame]:
        """Frames that are due, stage after stage, up to stage `until` (from 0), which is not begun. RunError if the run blows up."""
        for number, stage in enumerate(self.scenario.stages[self.done : until], self.done):
            self.stage, self.stage_started = number, self.state.time
            ground, turn = ground_of(stage), _directions(stage)
            yield from self._run_stage(stage, ground, turn)
            self._ground_place = self._ground_place + ground.motion(stage.longest)[0] @ turn
            self.done = number + 1

    def _run_stage(
        self, stage: ImpulseSettle | ImpulseShake | Run, ground: Ground, turn: Floats
    ) -> Iterator[BodyFrame]:
        schedule = Schedule(self.scenario.output, self.stage_started, stage.longest)
        everything = frozenset({"series", "frames", "tracks"})
        first = self._frame(ground, turn, everything if self.stage == 0 else frozenset())
        yield replace(first, stage_start=True, warnings=(*self._warnings, *first.warnings))
        self._warnings, quiet = [], 0
        while not schedule.over(self.state.time):
            moment, due = schedule.next(self.state.time)
            warnings = self._advance_to(moment, ground, turn)
            over, rest = schedule.over(moment), ""
            if "series" in due and isinstance(stage, ImpulseSettle):
                rest = self._rest(stage)
                quiet = quiet + 1 if rest else 0
            at_rest = rest if rest and (quiet >= QUIET_ROWS or over) else ""
            if not (at_rest or over):
                yield replace(self._frame(ground, turn, due), warnings=warnings)
                continue
            reason = at_rest or "its time was over"
            if isinstance(stage, ImpulseSettle) and not at_rest:
                reason = f"still moving after {stage.limit:g} s: {self._restlessness()}"
                warnings = (*warnings, f"stage {stage.name}: {reason}")
            frame = self._frame(ground, turn, everything)
            yield replace(frame, stage_end=True, stop_reason=reason, warnings=warnings)
            return

    def _advance_to(self, moment: float, ground: Ground, turn: Floats) -> tuple[str, ...]:
        """Equal steps, none longer than the time step, that end exactly at `moment` [s]; returns warnings."""
        state, start = self.state, self.state.time
        steps = max(math.ceil((moment - start) / self.time_step * (1.0 - 1e-9)), 1)
        dt = (moment - start) / steps
        middles = (np.arange(steps, dtype=np.float64) + 0.5) * dt + (start - self.stage_started)
        driving = -ground.acceleration(middles) @ turn if ground.moves else np.zeros((steps, 3))
        for k in range(steps):
            before = state.energies.copy() if ground.moves else state.energies
            state.advance(dt, driving[k])
            if ground.moves:
                state.given += max(float(state.energies[WORK] - before[WORK]), 0.0)
            if k % 256 == 255:
                self.check()
        state.time = moment
        self.check()
        self._look_for_blow_up()
        gone = state.let_go()
        if not gone:
            return ()
        names = ", ".join(str(one) for one in gone[:5]) + (", ..." if len(gone) > 5 else "")
        return (
            f"t = {moment:.6g} s: {len(gone)} bod{'ies have' if len(gone) > 1 else 'y has'} left the scene: {names}",
        )

    def _look_for_blow_up(self) -> None:
        state, limit = self.state, self.scenario.solver.max_penetration
        when = f"t = {state.time:.6g} s"
        broken = np.flatnonzero(
            ~np.isfinite(state.moving.x[:-1]).all(axis=1) | ~np.isfinite(state.moving.velocity[:-1]).all(axis=1)
        )
        advice = f"Take a smaller time step than {self.time_step:.3g} s ([integration] time_step)"
        if len(broken):
            raise RunError(f"{when}: the position of {self.name(int(broken[0]))} is no longer a number. {advice}")
        share, i, j = state.deepest
        if share > limit:
            raise RunError(
                f"{when}: {self.name(i)} and {self.name(j)} penetrate by {share:.2g} of the smaller one's radius, more than "
                f"max_penetration = {limit:g}. {advice}, or let them start slower or further apart"
            )
        state.deepest = (0.0, 0, 0)

    def _frame(self, ground: Ground, turn: Floats, due: frozenset[str]) -> BodyFrame:
        state = self.state
        motion = ground.motion(state.time - self.stage_started) @ turn
        motion[0] += self._ground_place
        energy = state.energy()
        state.lowest = min(state.lowest, energy.potential)
        start = state.start
        put_in = start.kinetic + start.rotational + max(start.potential - state.lowest, 0.0) + state.given
        heavy = due != {"tracks"}
        return BodyFrame(
            step=state.steps, time=state.time, dt=state.dt or self.time_step, stage=self.stage, bodies=state.bodies(), ground=motion,
            energy=energy,
            residual=energy.stored + energy.lost - energy.projection - energy.work - start.stored, energy_in=put_in,
            solving=state.solving("series" in due), due=due, contacts=state.contacts() if heavy else None,
        )  # fmt: skip

    def _kinetic_per_body(self) -> float:
        """Mean kinetic energy of a body over its weight times its size [-]; over the square of 1 m/s without gravity."""
        state, energy = self.state, self.state.energy()
        present, g = state.moving.present, float(np.linalg.norm(self.gravity))
        if not present.any():
            return 0.0
        weight = state.moving.mass[present] * (g * state.moving.size[present] if g > 0.0 else 1.0)
        return (energy.kinetic + energy.rotational) / int(present.sum()) / float(weight.mean())

    def _rest(self, stage: ImpulseSettle) -> str:
        """Why the bodies count as at rest, or an empty text."""
        falling = bool(np.any(self.gravity)) and (self.state.last is None or len(self.state.last.i) == 0)
        return f"at rest: {self._restlessness()}" if self._kinetic_per_body() < stage.kinetic and not falling else ""

    def _restlessness(self) -> str:
        return f"kinetic energy {self._kinetic_per_body():.2g} of weight times size"


def _directions(stage: ImpulseSettle | ImpulseShake | Run) -> Floats:
    """(2, 3): where the two components of a ground motion point: along the heading in plan, and up."""
    heading = stage.heading if isinstance(stage, ImpulseShake) else 0.0
    return np.array([[math.cos(heading), math.sin(heading), 0.0], [0.0, 0.0, 1.0]])
