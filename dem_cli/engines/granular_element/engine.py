"""The granular element engine: stages of quasi-static tests, increment by increment (Kishino 1988)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from dem_cli.engines.granular_element.apparatus import Apparatus, amiss_at_first
from dem_cli.engines.granular_element.boundary import Servos
from dem_cli.engines.granular_element.chains import release
from dem_cli.engines.granular_element.controls import (
    LoadControl,
    ShearControl,
    hold_stress,
    is_membrane,
    refuse_unreached,
)
from dem_cli.engines.granular_element.sample import no_servos
from dem_cli.engines.granular_element.step import Done, NotFiniteError, collapse_step, sub_step
from dem_cli.errors import RunError
from dem_cli.scenario import Compress, Cyclic, Load, Shear
from dem_cli.state import Increment
from dem_cli.units import human

ROUGH = 100.0  # times the accuracy: enough for levels of compression before the last
LOW = 0.4  # share of the last level, below which samples are nearly isostatic and equilibrium is not waited for
LOW_ITERATIONS = 8000
GATHER = 0.005  # strain of both directions in which a loose packing is brought together until it bears stress
REVERSAL = 1e-3  # of a limit of stress: how near to it loading is reversed
TINY = 1e-9


class GranularElementEngine(Apparatus):
    """Runs the stages of a scenario; a generator of increments."""

    def increments(self, until: int | None = None) -> Iterator[Increment]:
        """Increments, stage after stage, up to stage `until` (from 0), which is not begun; each stage begins with the state that it starts from.
        RunError where a control cannot be met.
        """
        if not self.done:
            self._push_apart()
        for number, stage in enumerate(self.scenario.stages[self.done : until], self.done):
            self.stage, self.in_stage = number, 0
            if stage.branch:
                self.place = self.ends[stage.branch].copy()
            self.works.clear()
            self.way = None
            if not isinstance(stage, Compress) and math.isnan(self.place.width):
                self.set_reference()
            self.first_stress = float(self.stress().mean())
            if isinstance(stage, Shear | Cyclic):
                self.place.axial = int(stage.axial == "y")
            start = replace(self.observe(Done()), stage_start=True, due=self.due(first=True))
            yield start if number or isinstance(stage, Compress) else replace(start, warnings=amiss_at_first(start))
            try:
                if isinstance(stage, Compress):
                    yield from self._compress(stage)
                elif isinstance(stage, Shear):
                    yield from self._shear(stage)
                elif isinstance(stage, Load):
                    yield from self._load(stage)
                else:
                    yield from self._cycle(stage)
            except NotFiniteError as error:
                raise RunError(f"{self.where}: the force on grain {error.args[0]} is not a finite number") from error
            self.ends[stage.name] = self.place.copy()
            self.done = number + 1

    def _push_apart(self) -> None:
        """Overlapping packings: grains are pushed apart without friction in the box as it is; what that takes is in no ledger."""
        sample, law = self.sample, self.sample.law
        if self.scenario.packing.method == "overlapping":
            sample.with_friction(0.0, 0.0)
            size = float(sample.bodies.radius.mean()) * 1e-4 * law.kn
            solver = self.solver(size, 1e-4, momentum=True)
            collapse_step(sample, sample.box[2:].copy(), no_servos(), solver)
            sample.with_friction(law.friction, law.cohesion)
            sample.near.memory[:] = 0.0
            sample.near.wall_memory[:] = 0.0
            sample.anchor[:] = sample.x
            sample.look()
        release(sample)
        self.place.energy = self.stored()

    def _compress(self, stage: Compress) -> Iterator[Increment]:
        law = self.sample.law
        if stage.friction is not None:
            self.sample.with_friction(stage.friction)
        self._gather(stage.levels[0] * stage.stress)
        for number, level in enumerate(stage.levels):
            last = number == len(stage.levels) - 1
            target = level * stage.stress
            servos = hold_stress(self.sample, {0: target, 1: target}, target)
            done = self._prepare(servos, target, last=last, low=level < LOW)
            if last:
                self.sample.with_friction(law.friction, law.cohesion)
                done.add(self._prepare(servos, target, last=True, low=False))
                refuse_unreached(self.at(1), done.stress_error, f"{human(target, 'Pa')} all round", self.stress())
                self.set_reference()
            yield self.next(done, f"{human(target, 'Pa')} all round" if last else "", warn=last)

    def _prepare(self, servos: Servos, stress: float, *, last: bool, low: bool) -> Done:
        """Equilibrium under the servos, followed iterate by iterate."""
        sample = self.sample
        sample.size = sample.box[2:].copy()
        accuracy = self.accuracy(stress) * (1.0 if last else ROUGH)
        solver = self.solver(accuracy, self.scenario.solver.stress_tolerance * (1.0 if last else ROUGH))
        sample.begin()
        if solver.momentum:
            paces = solver.collapse(len(sample.x))
            if low:
                paces = [paces[0]._replace(most=LOW_ITERATIONS)]
            done = collapse_step(sample, sample.box[2:].copy(), servos, solver, paces)
        else:
            done, _ = sub_step(sample, sample.box[2:].copy(), servos, solver, math.inf)
        self.enter(done)
        self.check()
        return done

    def _gather(self, stress: float) -> None:
        """Brings a loose packing together, evenly, until its walls bear half of the stress."""
        sample = self.sample
        solver = self.solver(ROUGH * self.accuracy(stress), 1e-3, momentum=True)
        if is_membrane(sample):  # without its pressure it would only be pushed out
            hold_stress(sample, {0: stress}, stress)
        while float(self.stress().min()) < 0.5 * stress:
            self.check()
            sample.begin()
            paces = [solver.collapse(len(sample.x))[0]._replace(most=1000)]
            self.enter(collapse_step(sample, sample.box[2:] * (1.0 - GATHER), no_servos(), solver, paces))
            self.refuse_overlap()

    def _shear(self, stage: Shear) -> Iterator[Increment]:
        control = ShearControl.start(self.sample, stage.axial, stage.hold)
        begun, done_so_far = self.shear_strain(), 0.0
        over = False
        while not over:
            if is_membrane(self.sample):  # its lateral strain is what comes; the stage ends with the nearest increment
                done = self._grow(control, stage.increment)
                done_so_far = self.shear_strain() - begun + 0.5 * stage.increment
            else:
                growth = min(stage.increment, stage.shear_strain - done_so_far)
                done = self._grow(control, growth)
                done_so_far += growth
            over = done_so_far >= stage.shear_strain * (1.0 - TINY)
            yield self.next(
                done,
                f"shear strain of {100.0 * stage.shear_strain:.4g} % reached" if over else "",
                control,
                stage.total,
            )

    def _load(self, stage: Load) -> Iterator[Increment]:
        sample, now = self.sample, self.stress()
        stress = [
            None if goal.stress is None else (float(s), goal.stress)
            for goal, s in zip((stage.x, stage.y), now, strict=True)
        ]
        half = [
            None if goal.strain is None else (float(h), float(h - goal.strain * size))
            for goal, h, size in zip((stage.x, stage.y), sample.box[2:], sample.size, strict=True)
        ]
        control = LoadControl(tuple(stress), tuple(half))
        parts = self.sub_steps
        for number in range(1, stage.increments + 1):
            done = Done()
            for part in range(1, parts + 1):
                share = (number - 1 + part / parts) / stage.increments
                done.add(self.sub_step(*control.step(sample, share)))
            wanted = ", ".join(
                f"{human(pair[1], 'Pa')} across {name}" for pair, name in zip(stress, "xy", strict=True) if pair
            )
            refuse_unreached(self.at(1), done.stress_error, wanted, self.stress())
            yield self.next(done, "stresses and strains reached" if number == stage.increments else "")

    def _cycle(self, stage: Cyclic) -> Iterator[Increment]:
        control = ShearControl.start(self.sample, stage.axial, stage.hold)
        limit = stage.limit.strain or stage.limit.stress or (stage.limit.stress_ratio or 0.0) * control.mean
        begun = self.shear_strain()

        def measure() -> float:
            if stage.limit.strain is not None:
                return self.shear_strain() - begun
            stress = self.stress()
            return float(stress[control.axial] - stress[1 - control.axial])

        # each cycle to one limit and the other, and in the end back to where it began
        start = measure()
        for half, goal in enumerate([limit, -limit] * stage.cycles + [start]):
            sense = math.copysign(1.0, goal - measure())
            turned = self.shear_strain()
            while True:
                done, met = self._reach(control, stage, measure, goal, sense)
                far = abs(self.shear_strain() - turned) >= stage.max_strain * (1.0 - TINY)
                ratio = float(self.stress().mean()) / control.mean
                reason = ""
                if ratio < stage.liquefied:
                    reason = f"liquefied in cycle {half // 2 + 1}: the mean stress is {ratio:.2g} of that at the start"
                elif half == 2 * stage.cycles and (met or far):
                    reason = f"{stage.cycles} cycles done"
                yield self.next(done, reason, control, stage.total)
                if reason:
                    return
                if met or far:
                    break

    def _reach(
        self, control: ShearControl, stage: Cyclic, measure: Callable[[], float], goal: float, sense: float
    ) -> tuple[Done, bool]:
        """One increment towards the goal, cut short where it meets it."""
        before, scale = self.place.copy(), max(abs(goal), REVERSAL * abs(control.mean))
        start, growth = measure(), stage.increment
        if stage.limit.strain is not None:
            growth = min(growth, abs(goal - start))
            return self._grow(control, sense * growth), abs(goal - start) <= stage.increment * (1.0 + TINY)
        done = self._grow(control, sense * growth)
        low, high, at_low, at_high = 0.0, growth, start, measure()
        if sense * (at_high - goal) < 0.0:
            return done, abs(at_high - goal) <= REVERSAL * scale
        for _ in range(12):
            now = measure()
            if abs(now - goal) <= REVERSAL * scale:
                break
            if sense * (now - goal) > 0.0:
                high, at_high = growth, now
            else:
                low, at_low = growth, now
            # regula falsi, kept off the ends
            share = min(max((goal - at_low) / (at_high - at_low), 0.05), 0.95)
            growth = low + share * (high - low)
            self.place, self.way = before.copy(), None
            done = self._grow(control, sense * growth)
        return done, True

    def _grow(self, control: ShearControl, growth: float) -> Done:
        """Lets the shear strain grow, in sub-steps."""
        done, parts = Done(), self.sub_steps
        for _ in range(parts):
            done.add(self.sub_step(*control.step(self.sample, growth / parts)))
        if control.hold.endswith("stress"):
            wanted = f"{control.hold.replace('-', ' ')} as at the start of the stage"
            refuse_unreached(self.at(1), done.stress_error, wanted, self.stress())
        return done
