"""The sample in its testing apparatus: where a test is, its account of energy, what is observed and what is refused."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from dem_cli.assembly import Assembly
from dem_cli.engines.granular_element.boundary import Servos
from dem_cli.engines.granular_element.chains import build_sample
from dem_cli.engines.granular_element.controls import ShearControl, is_membrane
from dem_cli.engines.granular_element.observe import grains_of, slips_of, walls_of
from dem_cli.engines.granular_element.sample import Sample
from dem_cli.engines.granular_element.step import Done, Solver, Way, sub_step
from dem_cli.engines.pausing import Pausable
from dem_cli.errors import RunError
from dem_cli.scenario import QuasiStaticScenario
from dem_cli.state import Floats, Increment, QuasiStaticEnergy

ACCURACY = 1e-5  # of mean stress x mean diameter x depth
LEAST = 0.01  # of the stress at the start of a stage: the accuracy does not follow the stress below
USUAL = 20  # sub-steps over which the usual work is averaged
AMISS_AT_FIRST = 0.01  # mean resultant force over mean contact force of a packing, above which it is told
NO_LIMIT = 2**62  # of iterations but those of the ladder
SHORT = 2.0  # times the accuracy: what is left above it is told


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


def amiss_at_first(start: Increment) -> tuple[str, ...]:
    """A warning if the packing, which has no shear forces, is not in balance: a result file's grains at stress are not."""
    if start.unbalanced <= AMISS_AT_FIRST:
        return ()
    return (
        f"the packing is not in balance: the mean resultant force is {start.unbalanced:.2g} of the mean contact force, as a file gives "
        "no shear forces. The first increment brings it into balance, and what that takes counts as a collapse. Begin with a stage "
        'kind = "compress", or do all stages in one run',
    )


class Apparatus(Pausable):
    """The sample, moved and observed. `place` is all that moves; stage, in_stage, number: where the run is."""

    def __init__(self, scenario: QuasiStaticScenario, assembly: Assembly) -> None:
        self.scenario = scenario
        self.assembly = assembly
        self.place = Place(build_sample(scenario, assembly))
        self.check: Callable[[], None] = lambda: None  # called between sub-steps; may raise KeyboardInterrupt
        self.stage = self.in_stage = self.number = 0
        self.ends: dict[str, Place] = {}  # of the stages that are over, from which later ones may branch
        self.works: deque[float] = deque(maxlen=USUAL)
        self.way: Way | None = None
        self.first_stress = 0.0
        self.mean_diameter = 2.0 * float(assembly.grains.radius.mean())

    @property
    def sample(self) -> Sample:
        return self.place.sample

    def sub_step(self, goal: Floats, servos: Servos) -> Done:
        """One sub-step, and its energies on the account."""
        self.check()
        sample = self.sample
        mean = float(self.stress().mean())
        solver = self.solver(self.accuracy(mean), self.scenario.solver.stress_tolerance)
        strain = float(np.abs(goal / sample.box[2:] - 1.0).sum())
        usual = max(
            float(np.mean(self.works)) if self.works else 0.0,
            0.1 * max(mean, LEAST * self.first_stress) * sample.area * sample.depth * strain,
        )
        done, self.way = sub_step(sample, goal, servos, solver, usual, self.way)
        if not done.event:
            self.works.append(abs(done.work))
        self.enter(done)
        return done

    def enter(self, done: Done) -> None:
        """Energies of a sub-step, on the account of the run."""
        sums = {
            name: getattr(self.place.energy, name) + getattr(done, name)
            for name in ("work", "body_work", "friction", "released", "residual")
        }
        self.place.energy = replace(self.stored(), **sums)

    def stored(self) -> QuasiStaticEnergy:
        normal, tangential, membrane = self.sample.look().energy.tolist()
        return replace(
            self.place.energy, elastic_normal=normal, elastic_tangential=tangential, elastic_membrane=membrane
        )

    def next(
        self,
        done: Done,
        reason: str,
        control: ShearControl | None = None,
        total: str | None = None,
        *,
        warn: bool = True,
    ) -> Increment:
        """The increment that has been done; with a reason it is the last of its stage."""
        self.refuse_overlap()
        self.in_stage += 1
        self.number += 1
        warnings = []
        accuracy = self.accuracy(float(self.stress().mean()))
        if warn and done.balance > SHORT * accuracy:
            warnings.append(
                f"{self.where}: not in balance, {done.balance:.2g} N are left on grain {done.disc} (accuracy {accuracy:.2g} N)"
            )
        pressure = math.nan
        if control is not None and control.hold == "volume":
            weight, held = control.total_pressure(total)
            pressure = held - float(weight @ self.stress())
        return replace(
            self.observe(done),
            pore_pressure=pressure,
            due=self.due(last=bool(reason)),
            stage_end=bool(reason),
            stop_reason=reason,
            warnings=tuple(warnings),
        )

    def due(self, *, first: bool = False, last: bool = False) -> frozenset[str]:
        """Outputs of an increment; a stage that goes on where the last one ended has nothing new to show."""
        if first and self.number > 0:
            return frozenset({"series"})
        frame = first or last or self.in_stage % self.scenario.output.frames == 0
        return frozenset({"series", "tracks", *(["frames"] if frame else [])})

    def observe(self, done: Done) -> Increment:
        sample, place = self.sample, self.place
        view = sample.look()
        width, height = self.extent()
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
            strain=self.strain(),
            energy=place.energy,
            boundary=len(sample.chain.ring),
            axial=place.axial,
            balance=done.balance,
            unbalanced=resultant / mean_force if mean_force > 0.0 else 0.0,
            iterations=done.iterations,
            sub_steps=done.sub_steps,
            rung=done.rung,
            event=done.event,
        )

    # -- what there is now

    def stress(self) -> Floats:
        return self.sample.stress(self.sample.look())

    def extent(self) -> tuple[float, float]:
        """Mean inner width and height [m]."""
        height = 2.0 * float(self.sample.box[3])
        return (self.sample.area / height if is_membrane(self.sample) else 2.0 * float(self.sample.box[2])), height

    def set_reference(self) -> None:
        """Strains count from here."""
        self.sample.size = self.sample.box[2:].copy()
        self.place.width, self.place.height = self.extent()

    def strain(self) -> Floats:
        """Strain of width and height against the reference; 0 before there is one."""
        width, height = self.extent()
        if math.isnan(self.place.width):
            return np.zeros(2)
        return np.array([1.0 - width / self.place.width, 1.0 - height / self.place.height])

    def shear_strain(self) -> float:
        strain, axial = self.strain(), self.place.axial
        return float(strain[axial] - strain[1 - axial])

    # -- how it is solved

    @property
    def sub_steps(self) -> int:
        return self.scenario.solver.sub_steps

    def accuracy(self, stress: float) -> float:
        """Largest fixing force that counts as none [N] at this mean stress [Pa]."""
        if self.scenario.solver.accuracy is not None:
            return self.scenario.solver.accuracy
        return ACCURACY * max(stress, LEAST * self.first_stress) * self.mean_diameter * self.sample.depth

    def solver(self, accuracy: float, stress: float, *, momentum: bool | None = None) -> Solver:
        given = self.scenario.solver
        by_momentum = given.method == "momentum" if momentum is None else momentum
        factors = {
            name: value
            for name in ("alpha", "alpha_prime", "beta", "beta_prime")
            if (value := getattr(given, name)) is not None
        }
        factors["most"] = NO_LIMIT if given.max_iterations is None else given.max_iterations
        return Solver(by_momentum, accuracy, stress, **factors)

    # -- what is refused

    @property
    def where(self) -> str:
        return self.at(0)

    def at(self, later: int) -> str:
        """The increment `later` than the last one that is done, for messages."""
        return f"stage {self.stage + 1} ({self.scenario.stages[self.stage].name}), increment {self.in_stage + later}"

    def refuse_overlap(self) -> None:
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
                f"{self.at(1)}: grain {contacts.i[worst]} and {with_what} overlap by {share[worst]:.2g} of a radius, {most:g} is the most "
                "([solver] max_overlap): the stress is too high for the stiffness. Raise the stiffness, or lower the stress"
            )
