"""The granular element engine: stages of quasi-static tests, increment by increment (Kishino 1988)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from dem_cli.assembly import Assembly
from dem_cli.engines.granular_element.boundary import Servos
from dem_cli.engines.granular_element.chains import build_sample, release
from dem_cli.engines.granular_element.controls import (
    LoadControl,
    ShearControl,
    hold_stress,
    is_membrane,
    refuse_unreached,
)
from dem_cli.engines.granular_element.observe import grains_of, slips_of, walls_of
from dem_cli.engines.granular_element.sample import Sample, no_servos
from dem_cli.engines.granular_element.step import (
    Done,
    NotFiniteError,
    Solver,
    Way,
    collapse_step,
    sub_step,
)
from dem_cli.errors import RunError
from dem_cli.scenario import Compress, Cyclic, Load, QuasiStaticScenario, Shear
from dem_cli.state import Increment, QuasiStaticEnergy

ACCURACY = 1e-5  # of mean stress x mean diameter x depth
LEAST = 0.01  # of the stress at the start of a stage: the accuracy does not follow the stress below
USUAL = 20  # sub-steps over which the usual work is averaged
ROUGH = 100.0  # times the accuracy: enough for levels of compression before the last
LOW = 0.4  # share of the last level, below which samples are nearly isostatic and equilibrium is not waited for
LOW_ITERATIONS = 8000
GATHER = 0.005  # strain of both directions in which a loose packing is brought together until it bears stress
REVERSAL = 1e-3  # of a limit of stress: how near to it loading is reversed
TINY = 1e-9


@dataclass
class Place:
    """Where a test is: the sample, its energies so far [J], and size and area that strains count against."""

    sample: Sample
    energy: QuasiStaticEnergy = field(default_factory=QuasiStaticEnergy)
    width: float = math.nan
    height: float = math.nan
    axial: int = 1

    def copy(self) -> Place:
        return replace(self, sample=self.sample.copy())


class GranularElementEngine:
    """Runs the stages of a scenario; a generator of increments. `place` is all that moves."""

    def __init__(self, scenario: QuasiStaticScenario, assembly: Assembly) -> None:
        self.scenario = scenario
        self.assembly = assembly
        self.place = Place(build_sample(scenario, assembly))
        self.check: Callable[[], None] = lambda: None  # called between sub-steps; may raise KeyboardInterrupt
        self.stage = self.in_stage = self.number = 0
        self._ends: dict[str, Place] = {}
        self._works: deque[float] = deque(maxlen=USUAL)
        self._way: Way | None = None
        self._first_stress = 0.0
        self._mean_diameter = 2.0 * float(assembly.grains.radius.mean())

    @property
    def sample(self) -> Sample:
        return self.place.sample

    def increments(self) -> Iterator[Increment]:
        """Increments, stage after stage; each begins with the state that it starts from. RunError where a control cannot be met."""
        branched = {stage.branch for stage in self.scenario.stages if stage.branch}
        self._push_apart()
        for number, stage in enumerate(self.scenario.stages):
            self.stage, self.in_stage = number, 0
            if stage.branch:
                self.place = self._ends[stage.branch].copy()
            self._works.clear()
            self._way = None
            if not isinstance(stage, Compress) and math.isnan(self.place.width):
                self._reference()
            self._first_stress = float(self._stress().mean())
            yield replace(self._observe(Done()), stage_start=True, due=self._due(first=True))
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
                raise RunError(f"{self._where}: the force on grain {error.args[0]} is not a finite number") from error
            if stage.name in branched:
                self._ends[stage.name] = self.place.copy()

    # -- stages

    def _push_apart(self) -> None:
        """Overlapping packings: grains are pushed apart without friction in the box as it is; what that takes is in no ledger."""
        sample, law = self.sample, self.sample.law
        if self.scenario.packing.method == "overlapping":
            sample.with_friction(0.0, 0.0)
            size = float(sample.bodies.radius.mean()) * 1e-4 * law.kn
            solver = self._solver(size, 1e-4, momentum=True)
            collapse_step(sample, sample.box[2:].copy(), no_servos(), solver)
            sample.with_friction(law.friction, law.cohesion)
            sample.near.memory[:] = 0.0
            sample.near.wall_memory[:] = 0.0
            sample.anchor[:] = sample.x
            sample.look()
        release(sample)
        self.place.energy = self._stored()

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
                refuse_unreached(self._at(1), done.stress_error, f"{target:.4g} Pa all round", self._stress())
                self._reference()
            yield self._next(done, f"{target:.4g} Pa all round" if last else "", warn=last)

    def _prepare(self, servos: Servos, stress: float, *, last: bool, low: bool) -> Done:
        """Equilibrium under the servos, followed iterate by iterate."""
        sample = self.sample
        sample.size = sample.box[2:].copy()
        accuracy = self._accuracy(stress) * (1.0 if last else ROUGH)
        solver = self._solver(accuracy, self.scenario.solver.stress_tolerance * (1.0 if last else ROUGH))
        sample.begin()
        if solver.momentum:
            paces = solver.collapse(len(sample.x))
            if low:
                paces = [paces[0]._replace(most=LOW_ITERATIONS)]
            done = collapse_step(sample, sample.box[2:].copy(), servos, solver, paces)
        else:
            done, _ = sub_step(sample, sample.box[2:].copy(), servos, solver, math.inf)
        self._add(done)
        self.check()
        return done

    def _gather(self, stress: float) -> None:
        """Brings a loose packing together, evenly, until its walls bear half of the stress."""
        sample = self.sample
        solver = self._solver(ROUGH * self._accuracy(stress), 1e-3, momentum=True)
        while float(self._stress().min()) < 0.5 * stress:
            self.check()
            sample.begin()
            paces = [solver.collapse(len(sample.x))[0]._replace(most=1000)]
            self._add(collapse_step(sample, sample.box[2:] * (1.0 - GATHER), no_servos(), solver, paces))
            self._refuse_overlap()

    def _shear(self, stage: Shear) -> Iterator[Increment]:
        control = ShearControl.start(self.sample, stage.axial, stage.hold)
        self.place.axial = control.axial
        begun, done_so_far = self._shear_strain(), 0.0
        while done_so_far < stage.shear_strain * (1.0 - TINY):
            growth = min(stage.increment, stage.shear_strain - done_so_far)
            done = self._grow(control, growth)
            done_so_far = self._shear_strain() - begun if is_membrane(self.sample) else done_so_far + growth
            over = done_so_far >= stage.shear_strain * (1.0 - TINY)
            yield self._next(
                done, f"shear strain of {stage.shear_strain:.4g} reached" if over else "", control, stage.total
            )

    def _load(self, stage: Load) -> Iterator[Increment]:
        sample, now = self.sample, self._stress()
        stress = [
            None if goal.stress is None else (float(s), goal.stress)
            for goal, s in zip((stage.x, stage.y), now, strict=True)
        ]
        half = [
            None if goal.strain is None else (float(h), float(h - goal.strain * size))
            for goal, h, size in zip((stage.x, stage.y), sample.box[2:], sample.size, strict=True)
        ]
        control = LoadControl(tuple(stress), tuple(half))
        parts = self._sub_steps
        for number in range(1, stage.increments + 1):
            done = Done()
            for part in range(1, parts + 1):
                share = (number - 1 + part / parts) / stage.increments
                done.add(self._sub_step(*control.step(sample, share)))
            wanted = ", ".join(
                f"{pair[1]:.4g} Pa across {name}" for pair, name in zip(stress, "xy", strict=True) if pair
            )
            refuse_unreached(self._at(1), done.stress_error, wanted, self._stress())
            yield self._next(done, "stresses and strains reached" if number == stage.increments else "")

    def _cycle(self, stage: Cyclic) -> Iterator[Increment]:
        control = ShearControl.start(self.sample, stage.axial, stage.hold)
        self.place.axial = control.axial
        limit = stage.limit.strain or stage.limit.stress or (stage.limit.stress_ratio or 0.0) * control.mean
        begun = self._shear_strain()

        def measure() -> float:
            if stage.limit.strain is not None:
                return self._shear_strain() - begun
            stress = self._stress()
            return float(stress[control.axial] - stress[1 - control.axial])

        # each cycle to one limit and the other, and in the end back to where it began
        start = measure()
        for half, goal in enumerate([limit, -limit] * stage.cycles + [start]):
            sense = math.copysign(1.0, goal - measure())
            turned = self._shear_strain()
            while True:
                done, met = self._reach(control, stage, measure, goal, sense)
                far = abs(self._shear_strain() - turned) >= stage.max_strain * (1.0 - TINY)
                ratio = float(self._stress().mean()) / control.mean
                reason = ""
                if ratio < stage.liquefied:
                    reason = f"liquefied in cycle {half // 2 + 1}: the mean stress is {ratio:.2g} of that at the start"
                elif half == 2 * stage.cycles and (met or far):
                    reason = f"{stage.cycles} cycles done"
                yield self._next(done, reason, control, stage.total)
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
            self.place, self._way = before.copy(), None
            done = self._grow(control, sense * growth)
        return done, True

    # -- increments

    def _grow(self, control: ShearControl, growth: float) -> Done:
        """Lets the shear strain grow, in sub-steps."""
        done, parts = Done(), self._sub_steps
        for _ in range(parts):
            done.add(self._sub_step(*control.step(self.sample, growth / parts)))
        if control.hold.endswith("stress"):
            wanted = f"{control.hold.replace('-', ' ')} as at the start of the stage"
            refuse_unreached(self._at(1), done.stress_error, wanted, self._stress())
        return done

    def _sub_step(self, goal: np.ndarray, servos: Servos) -> Done:
        """One sub-step, and its energies on the account."""
        self.check()
        sample = self.sample
        mean = float(self._stress().mean())
        solver = self._solver(self._accuracy(mean), self.scenario.solver.stress_tolerance)
        strain = float(np.abs(goal / sample.box[2:] - 1.0).sum())
        usual = max(
            float(np.mean(self._works)) if self._works else 0.0,
            0.1 * max(mean, LEAST * self._first_stress) * sample.area * sample.depth * strain,
        )
        done, self._way = sub_step(sample, goal, servos, solver, usual, self._way)
        if not done.event:
            self._works.append(abs(done.work))
        self._add(done)
        return done

    def _add(self, done: Done) -> None:
        """Energies of a sub-step, on the account of the run."""
        sums = {
            name: getattr(self.place.energy, name) + getattr(done, name)
            for name in ("work", "body_work", "friction", "released", "residual")
        }
        self.place.energy = replace(self._stored(), **sums)

    def _stored(self) -> QuasiStaticEnergy:
        normal, tangential, membrane = self.sample.look().energy.tolist()
        return replace(
            self.place.energy, elastic_normal=normal, elastic_tangential=tangential, elastic_membrane=membrane
        )

    def _next(
        self,
        done: Done,
        reason: str,
        control: ShearControl | None = None,
        total: str | None = None,
        *,
        warn: bool = True,
    ) -> Increment:
        """The increment that has been done; with a reason it is the last of its stage."""
        self._refuse_overlap()
        self.in_stage += 1
        self.number += 1
        warnings = []
        if warn and not done.balanced:
            accuracy = self._accuracy(float(self._stress().mean()))
            warnings.append(
                f"{self._where}: not in balance, {done.balance:.2g} N are left on grain {done.disc} (accuracy {accuracy:.2g} N)"
            )
        pressure = math.nan
        if control is not None and control.hold == "volume":
            weight, held = control.total_pressure(total)
            pressure = held - float(weight @ self._stress())
        return replace(
            self._observe(done),
            pore_pressure=pressure,
            due=self._due(last=bool(reason)),
            stage_end=bool(reason),
            stop_reason=reason,
            warnings=tuple(warnings),
        )

    def _due(self, *, first: bool = False, last: bool = False) -> frozenset[str]:
        """Outputs of an increment; a stage that goes on where the last one ended has nothing new to show."""
        if first and self.number > 0:
            return frozenset({"series"})
        frame = first or last or self.in_stage % self.scenario.output.frames == 0
        return frozenset({"series", "tracks", *(["frames"] if frame else [])})

    def _observe(self, done: Done) -> Increment:
        sample, place = self.sample, self.place
        view = sample.look()
        width, height = self._extent()
        fixing = view.room.fixing[: sample.bodies.grains]
        contacts = sample.contacts()
        mean_force = float(np.hypot(contacts.normal, contacts.shear).mean()) if len(contacts) else 0.0
        resultant = float(np.hypot(fixing[:, 0], fixing[:, 1]).mean())
        return Increment(
            number=self.number,
            stage=self.stage,
            in_stage=self.in_stage,
            grains=grains_of(sample, self.assembly.grains, self.scenario.grains.density),
            walls=walls_of(sample),
            contacts=contacts,
            slips=slips_of(done),
            width=width,
            height=height,
            area=sample.area,
            stress=sample.stress(view),
            strain=self._strain(),
            energy=place.energy,
            boundary=len(sample.chain.ring),
            axial=place.axial,
            balance=done.balance,
            unbalanced=resultant / mean_force if mean_force > 0.0 else 0.0,
            iterations=done.iterations,
            sub_steps=1 if self.in_stage == 0 else self._sub_steps,
            rung=done.rung,
            event=done.event,
        )

    # -- what there is now

    def _stress(self) -> np.ndarray:
        return self.sample.stress(self.sample.look())

    def _extent(self) -> tuple[float, float]:
        """Mean inner width and height [m]."""
        height = 2.0 * float(self.sample.box[3])
        return (self.sample.area / height if is_membrane(self.sample) else 2.0 * float(self.sample.box[2])), height

    def _reference(self) -> None:
        """Strains count from here."""
        self.sample.size = self.sample.box[2:].copy()
        self.place.width, self.place.height = self._extent()

    def _strain(self) -> np.ndarray:
        """Strain of width and height against the reference; 0 before there is one."""
        width, height = self._extent()
        if math.isnan(self.place.width):
            return np.zeros(2)
        return np.array([1.0 - width / self.place.width, 1.0 - height / self.place.height])

    def _shear_strain(self) -> float:
        strain, axial = self._strain(), self.place.axial
        return float(strain[axial] - strain[1 - axial])

    # -- how it is solved

    @property
    def _sub_steps(self) -> int:
        return self.scenario.solver.sub_steps

    def _accuracy(self, stress: float) -> float:
        """Largest fixing force that counts as none [N] at this mean stress [Pa]."""
        if self.scenario.solver.accuracy is not None:
            return self.scenario.solver.accuracy
        return ACCURACY * max(stress, LEAST * self._first_stress) * self._mean_diameter * self.sample.depth

    def _solver(self, accuracy: float, stress: float, *, momentum: bool | None = None) -> Solver:
        given = self.scenario.solver
        by_momentum = given.method == "momentum" if momentum is None else momentum
        factors = {
            name: value
            for name in ("alpha", "alpha_prime", "beta", "beta_prime")
            if (value := getattr(given, name)) is not None
        }
        if given.max_iterations is not None:
            factors["most"] = given.max_iterations
        return Solver(by_momentum, accuracy, stress, **factors)

    # -- what is refused

    @property
    def _where(self) -> str:
        return self._at(0)

    def _at(self, later: int) -> str:
        """The increment `later` than the last one that is done, for messages."""
        return f"stage {self.stage + 1} ({self.scenario.stages[self.stage].name}), increment {self.in_stage + later}"

    def _refuse_overlap(self) -> None:
        contacts, radius = self.sample.contacts(), self.sample.bodies.radius
        if not len(contacts):
            return
        other = np.where(contacts.j >= 0, contacts.j, contacts.i)
        share = contacts.overlap / np.minimum(radius[contacts.i], radius[other])
        worst = int(share.argmax())
        most = self.scenario.solver.max_overlap
        if share[worst] > most:
            with_what = f"grain {contacts.j[worst]}" if contacts.j[worst] >= 0 else "a wall"
            raise RunError(
                f"{self._at(1)}: grain {contacts.i[worst]} and {with_what} overlap by {share[worst]:.2g} of a radius, {most:g} is the most "
                "([solver] max_overlap): the stress is too high for the stiffness. Raise the stiffness, or lower the stress"
            )
