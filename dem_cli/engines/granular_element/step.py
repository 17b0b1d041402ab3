"""One sub-step to the next equilibrium: the ladder of fallbacks, collapses, and the ledger of energy."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from dem_cli.engines.granular_element.boundary import BODY, BOUNDARY, FIXING, GONE, LEDGER, Servos, account
from dem_cli.engines.granular_element.contacts import LOST
from dem_cli.engines.granular_element.ledger import lose, lose_in_step
from dem_cli.engines.granular_element.relax import AWAY, BALANCED, NOT_A_NUMBER, Pace, relax
from dem_cli.engines.granular_element.sample import Sample, View, no_servos
from dem_cli.state import Floats, Ints

FAR = 10.0  # a disc that moves this many times the affine displacement has collapsed
NEAR_BY = 1e-3  # of the mean radius: no smaller move counts as far
AMISS = 0.05  # as has a sub-step whose ledger misses this share of its usual work
HALF, STEP = (
    0.5,
    0.6,
)  # of the block move, while a sample is prepared and afterwards: much more locks contacts in a cycle of opening and closing
PLAIN = 0.75  # the same without momentum
QUIET = 10_000  # iterations, and four a disc, until a sub-step counts as a collapse
NO_GUESS = np.empty((0, 3))


@dataclass(frozen=True)
class Solver:
    """How equilibrium is found. accuracy [N] and stress [-]: when it is; momentum: the momentum iteration, else Kishino's; most:
    iterations on a rung of the ladder, which has limits of its own too.
    """

    momentum: bool
    accuracy: float
    stress: float
    alpha: float = 0.75
    alpha_prime: float = 0.5
    beta: float = 20.0
    beta_prime: float = 20.0
    most: int = 100_000

    def pace(
        self, n: int, step: float, cap: float, most: int, *, follow: bool, far: float = math.inf, keen: bool = False
    ) -> Pace:
        patience = int(250 + 25 * math.sqrt(n))
        return Pace(
            self.momentum, keen and self.momentum, step, cap, min(most, self.most), follow, self.accuracy, self.stress, far, patience,
            self.alpha_prime, self.beta, self.beta_prime,
        )  # fmt: skip

    def quiet(self, n: int, far: float) -> list[Pace]:
        """While the path is smooth: the slider from the start of the sub-step."""
        return [self.pace(n, STEP, _cap(n), QUIET + 4 * n, follow=False, far=far, keen=True)]

    def collapse(self, n: int) -> list[Pace]:
        """Through a collapse, or to equilibrium from any place, iterate by iterate: the slider goes with it; in the end without momentum."""
        return [
            self.pace(n, HALF, max(1.0 - 0.55 / math.sqrt(n), 0.5), QUIET + 4 * n, follow=True),
            self.pace(n, PLAIN, 0.0, 2 * QUIET, follow=True),
        ]


def _cap(n: int) -> float:
    """Largest momentum for n discs; where it does not help, `relax` lowers it."""
    return max(min(1.0 - 0.55 / math.sqrt(n), 1.0 - 0.2 / math.cbrt(n)), 0.5)


@dataclass
class Done:
    """What one sub-step, or several, came to. Energies [J] as in state.QuasiStaticEnergy, here of these sub-steps alone."""

    balanced: bool = True
    sub_steps: int = 0
    iterations: int = 0
    rung: int = 0
    event: bool = False
    balance: float = 0.0
    disc: int = -1
    stress_error: float = 0.0
    work: float = 0.0
    body_work: float = 0.0
    friction: float = 0.0
    released: float = 0.0
    residual: float = 0.0
    first: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    second: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    lost: Floats = field(default_factory=lambda: np.empty(0))

    def add(self, other: Done) -> None:
        """Another sub-step after this one."""
        self.balanced = self.balanced and other.balanced
        self.event = self.event or other.event
        self.rung = max(self.rung, other.rung)
        for name in ("sub_steps", "iterations", "work", "body_work", "friction", "released", "residual"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name in ("balance", "disc", "stress_error"):
            setattr(self, name, getattr(other, name))
        for name in ("first", "second", "lost"):
            setattr(self, name, np.concatenate([getattr(self, name), getattr(other, name)]))


class NotFiniteError(ArithmeticError):
    """A fixing force is not a finite number; args: the disc."""


@dataclass(frozen=True)
class Way:
    """How the last sub-step went, from which the next one is guessed: strain (2,) [m]: prescribed growth of the half sizes, servo (2,) [m]:
    what the servos added, moves (n, 3) [m] of the discs.
    """

    strain: Floats
    servo: Floats
    moves: Floats

    def alike(self, strain: Floats) -> bool:
        """Whether this sub-step goes on in the same way."""
        return bool(np.abs(strain - self.strain).max() <= 0.01 * np.abs(self.strain).max(initial=0.0))

    def of(self, sample: Sample, before: View, goal: Floats) -> Floats:
        """Moves for a sub-step to `goal`: those of the last one; of discs that nothing holds, the affine ones."""
        affine = np.zeros_like(self.moves)
        affine[:, :2] = (sample.x[:, :2] - sample.box[:2]) * (goal / sample.box[2:] - 1.0)
        return np.where((before.room.touching > 1)[:, None], self.moves, affine)


def _iterate(
    sample: Sample,
    goal: Floats,
    servos: Servos,
    paces: list[Pace],
    done: Done,
    ledger: Floats,
    guess: Floats = NO_GUESS,
) -> bool:
    """Climbs a ladder from where the sample is; True once it is in balance. done: iterations and what is left are noted."""
    for pace in paces:
        near, status, count, worst, disc, stress = relax(
            sample.x, sample.anchor, sample.box, goal, guess, sample.size, sample.near, sample.bodies, sample.law, sample.chain,
            servos, sample.depth, sample.skin, pace, ledger,
        )  # fmt: skip
        sample.near = near
        done.iterations += count
        done.balance, done.disc, done.stress_error = worst, disc, stress
        if status == NOT_A_NUMBER:
            raise NotFiniteError(disc)
        if status == BALANCED:
            return True
        if status == AWAY:
            return False
        done.rung += 1
        goal, guess = sample.box[2:].copy(), NO_GUESS
    return False


def quiet_step(
    sample: Sample, goal: Floats, servos: Servos, solver: Solver, usual: float, way: Way | None = None
) -> Done | None:
    """A sub-step along a smooth path; None, and the sample as it was, where it finds no equilibrium near by.

    usual [J]: work of such a sub-step; way: of one like it, from which this one is guessed.
    """
    done, before = Done(sub_steps=1), sample.copy()
    start = before.look()
    guess = NO_GUESS
    if way is not None:
        guess, goal = way.of(sample, start, goal), goal + way.servo
    affine = float(np.abs(goal - sample.box[2:]).max())
    far = max(FAR * affine, NEAR_BY * float(sample.bodies.radius.mean()))
    if _iterate(sample, goal, servos, solver.quiet(len(sample.x), far), done, np.zeros(LEDGER), guess):
        end = sample.look()
        lose(sample.near, False)
        _settle_up(before, sample, start, end, done, follow=None)
        if abs(done.residual) <= AMISS * usual:
            return done
    sample.restore(before)
    return None


def collapse_step(
    sample: Sample, goal: Floats, servos: Servos, solver: Solver, paces: list[Pace] | None = None
) -> Done:
    """A sub-step whose path is followed iterate by iterate; what the fixing forces take out is energy released."""
    done, before, ledger = Done(sub_steps=1), sample.copy(), np.zeros(LEDGER)
    start = before.look()
    done.balanced = _iterate(sample, goal, servos, paces or solver.collapse(len(sample.x)), done, ledger)
    _settle_up(before, sample, start, sample.look(), done, follow=ledger)
    return done


def sub_step(
    sample: Sample, goal: Floats, servos: Servos, solver: Solver, usual: float, way: Way | None = None
) -> tuple[Done, Way | None]:
    """Strain to half sizes goal (2,) [m] and to the servos' stresses: along a smooth path if there is one, else through a collapse.

    way: of the last sub-step, if that was alike. Returns it for the next one; None after a collapse.
    """
    sample.begin()
    if not solver.momentum:
        return _kishino_step(sample, goal, servos, solver, usual), None
    strain, began = goal - sample.box[2:], sample.x.copy()
    alike = way if way is not None and way.alike(strain) else None
    done = quiet_step(sample, goal, servos, solver, usual, alike)
    if done is not None:
        return done, Way(strain, sample.box[2:] - goal, sample.x - began)
    done = collapse_step(sample, goal, servos, solver)
    done.event = True
    done.rung += 1
    return done, None


def _kishino_step(sample: Sample, goal: Floats, servos: Servos, solver: Solver, usual: float) -> Done:
    """The paper's step: the strain, equilibrium under it, then the stresses (section 2 (6)).

    Its ledger is that of (25)-(29); what that misses in a collapse counts as released.
    """
    done, before = Done(sub_steps=1), sample.copy()
    start = before.look()
    paces = [solver.pace(len(sample.x), solver.alpha, 0.0, solver.most, follow=True)]
    done.balanced = _iterate(sample, goal, no_servos(), paces, done, np.zeros(LEDGER))
    if servos.number:
        done.balanced = _iterate(sample, sample.box[2:].copy(), servos, paces, done, np.zeros(LEDGER))
    end = sample.look()
    lose_in_step(sample.x, before.x, sample.near, sample.law)
    _settle_up(before, sample, start, end, done, follow=None)
    if abs(done.residual) > AMISS * usual:
        done.event, done.released, done.residual = True, done.residual, 0.0
    return done


def _settle_up(before: Sample, sample: Sample, start: View, end: View, done: Done, *, follow: Floats | None) -> None:
    """The energies of a sub-step: work from the forces at both ends, or as it was followed."""
    ledger = np.zeros(LEDGER) if follow is None else follow
    if follow is None:
        account(
            sample.x, before.x, end.room.fixing, start.room.fixing, sample.bodies, before.bodies.load, end.sums, start.sums,
            sample.box, before.box, ledger,
        )  # fmt: skip
    near = sample.near
    lost = np.concatenate([near.memory[LOST], near.wall_memory[LOST]])
    first = np.concatenate([near.first, near.disc]).astype(np.int64)
    numbers = np.cumsum(sample.law.wall)[near.side] - 1
    second = np.concatenate([near.second, -1 - numbers]).astype(np.int64)
    some = lost != 0.0
    done.first, done.second, done.lost = first[some], second[some], lost[some]
    done.work, done.body_work = float(ledger[BOUNDARY]), float(ledger[BODY])
    done.friction = float(lost.sum() + ledger[GONE])
    done.released = 0.0 if follow is None else -float(ledger[FIXING])
    gained = float((end.energy - start.energy).sum())
    done.residual = done.work + done.body_work - gained - done.friction - done.released
