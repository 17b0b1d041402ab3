"""The whole state of an impulse run as arrays, and its translation to and from frames."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dem_cli.engines.impulse.contacts import DEPTH
from dem_cli.engines.impulse.detect import ContactSearch
from dem_cli.engines.impulse.detect import Touching as Found
from dem_cli.engines.impulse.drift import drift, kinetic_energy, turn_inverse
from dem_cli.engines.impulse.impact import PGS, TRACKING
from dem_cli.engines.impulse.islands import split_islands
from dem_cli.engines.impulse.rows import WIDTH, fill_rows
from dem_cli.engines.impulse.step import (
    CAPPED,
    COUNTS,
    ENERGIES,
    FRICTION_LOSS,
    IMPACT_ITERATIONS,
    IMPACTS,
    ISLANDS,
    LARGEST,
    LOAD_SWEEPS,
    MOST,
    PROJECTED,
    RESIDUAL,
    RESTITUTION_LOSS,
    STEPS,
    WORK,
    Moving,
    Rules,
    Touching,
    carry_over,
    solve_step,
    take_back,
)
from dem_cli.rigid import Bodies, BodyContacts, ImpulseEnergy, Scene, Solving
from dem_cli.scenario import ImpulseScenario
from dem_cli.state import Bools, Floats, Ints

QUANTA, QUANTA_AT_MOST = 50, 100000  # of energy tracking where it stands in for sweeps that do not end
# Of the smallest body's reach: bodies further apart than this do not touch; those that touched in the step before may be further apart, so
# that resting contacts do not flicker, while bodies that are a hair apart meet one after the other.
GAP, KEPT_GAP = 1e-10, 1e-6
WHOLE = 2.0  # penetration over the smaller reach that two bodies with the same centre do not exceed


def chosen(found: Found, which: Bools) -> Found:
    """Some of the contacts, copied, so that they outlive the next look."""
    return Found(
        found.i[which], found.j[which], found.key[which], found.point[which], found.normal[which], found.gap[which]
    )


@dataclass
class ImpulseState:
    """Arrays that move, and the constants that they move by.

    dt: the last step [s]. last, found: the contacts of that step, in `found` with i, j as the search has them.
    smallest [m]: reach of the smallest body.
    energies (ENERGIES,) [J], counts (COUNTS,): see `step.py`. start: ledger at the start; lowest: lowest potential energy so far [J]; given:
    positive work so far [J]; escaped: energy carried off [J]; deepest: largest penetration since the last look over the smaller body's reach,
    with its two bodies.
    """

    scene: Scene
    moving: Moving
    rules: Rules
    gravity: Floats
    search: ContactSearch
    smallest: float
    materials: Ints
    time: float = 0.0
    dt: float = 0.0
    steps: int = 0
    last: Touching | None = None
    found: Found | None = None
    energies: Floats = field(default_factory=lambda: np.zeros(ENERGIES))
    counts: Floats = field(default_factory=lambda: np.zeros(COUNTS))
    start: ImpulseEnergy = field(default_factory=ImpulseEnergy)
    lowest: float = np.inf
    given: float = 0.0
    escaped: float = 0.0
    deepest: tuple[float, int, int] = (0.0, 0, 0)

    @classmethod
    def start_of(cls, scenario: ImpulseScenario, scene: Scene, gravity: Floats) -> ImpulseState:
        """The state before the first step."""
        bodies, n = scene.bodies, len(scene.bodies)
        velocity, x = np.zeros((n + 1, 6)), np.zeros((n + 1, 3))
        x[:n], velocity[:n, :3], velocity[:n, 3:] = bodies.x, bodies.v, bodies.w
        reach = np.array([shape.reach for shape in scene.shapes])
        size = reach[bodies.shape] * bodies.scale
        moving = Moving(
            ~bodies.escaped, x, bodies.q.copy(), velocity, bodies.mass.copy(), bodies.inertia.copy(), size, np.zeros((n + 1, 7))
        )  # fmt: skip
        solver = scenario.solver
        rules = Rules(
            TRACKING if solver.method == "energy-tracking" else PGS, float(solver.quanta or QUANTA), solver.rest_speed,
            solver.tolerance, solver.sweeps, solver.iterations or QUANTA_AT_MOST, solver.correction, solver.slop,
        )  # fmt: skip
        fixed = [*scene.planes.material.tolist(), *([scene.terrain.material] if scene.terrain else [])]
        # Wall w, which contacts call -1 - w, is then entry -1 - w of the array, too.
        materials = np.array([*bodies.material.tolist(), *reversed(fixed)], dtype=np.int64)
        state = cls(scene, moving, rules, gravity, ContactSearch(scene), float(size.min()), materials)
        turn_inverse(moving.present, moving.q, moving.mass, moving.inertia, moving.inverse)
        return state

    def look(self, deepest: float = DEPTH) -> Touching:
        """Contacts where the bodies are now, with the load impulses that they had in the step before. deepest: see `ContactSearch.look`."""
        n, moving, last, before = len(self.moving.mass), self.moving, self.last, self.found
        found = self._touching(self.search.look(moving.x[:n], moving.q, KEPT_GAP * self.smallest, deepest))
        of_i, of_j = self.materials[found.i], self.materials[found.j]
        load, left = np.empty((len(found.i), 3)), np.empty((len(found.i), 3))
        if last is not None and before is not None:
            new = carry_over(
                before.i, before.j, before.key, last.load, last.left, found.i, found.j, found.key, load, left
            )
        else:
            load[:], left[:], new = 0.0, 0.0, np.ones(len(load), dtype=bool)
        self.found = found
        self._watch(found)
        return Touching(
            found.i, np.where(found.j < 0, n, found.j), found.point, found.normal, found.gap,
            self.scene.restitution[of_i, of_j], self.scene.friction[of_i, of_j],
            new, load, left, np.zeros_like(load), np.zeros(len(load), dtype=bool),
        )  # fmt: skip

    def _touching(self, near: Found) -> Found:
        """Those of the contacts nearby that touch: closer than GAP, or of two bodies that touched in the step before."""
        touch = near.gap <= GAP * self.smallest
        if not touch.all() and self.found is not None:
            count = len(self.moving.mass) + len(self.scene.planes) + 2
            pairs, before = (one.i * count + (one.j % count) for one in (near, self.found))
            touch |= np.isin(pairs, before)
        return chosen(near, touch)

    def _watch(self, found: Found) -> None:
        """Keeps the largest penetration."""
        if len(found.gap) == 0:
            return
        share = -found.gap / self.smaller(found)
        worst = int(np.argmax(share))
        if share[worst] > self.deepest[0]:
            self.deepest = (float(share[worst]), int(found.i[worst]), int(found.j[worst]))

    def smaller(self, found: Found) -> Floats:
        """Size [m] of the smaller body of each contact, what never moves left out."""
        size = self.moving.size
        other = np.where(found.j < 0, np.inf, size[np.maximum(found.j, 0)])
        return np.asarray(np.minimum(size[found.i], other))

    def advance(self, dt: float, driving: Floats) -> None:
        """One step of dt [s]; driving (3,) [m/s^2]: inertial acceleration of the shaken container."""
        moving = self.moving
        drift(0.5 * dt, moving.present, moving.x, moving.q, moving.velocity, moving.inertia)
        turn_inverse(moving.present, moving.q, moving.mass, moving.inertia, moving.inverse)
        self.last = self.look()
        solve_step(dt, self.gravity, driving, moving, self.last, self.rules, self.energies, self.counts)
        drift(0.5 * dt, moving.present, moving.x, moving.q, moving.velocity, moving.inertia)
        self.steps += 1
        self.time += dt
        self.dt = dt

    def separate(self, most: int) -> tuple[float, int, int]:
        """Moves bodies apart until none penetrates by more than the slop; returns the largest penetration left over the smaller body's reach,
        and its bodies, as `look` numbers them. Velocities stay."""
        rules = self.rules._replace(correction=1.0)
        for _ in range(most):
            self.deepest = (0.0, 0, 0)
            touching = self.look(WHOLE)
            if self.deepest[0] <= 1.001 * rules.slop:
                break
            turn_inverse(self.moving.present, self.moving.q, self.moving.mass, self.moving.inertia, self.moving.inverse)
            order, starts = split_islands(touching.i, touching.j, len(self.moving.mass))
            i, j, rows = touching.i[order], touching.j[order], np.empty((len(order), WIDTH))
            fill_rows(
                i, j, touching.point[order], touching.normal[order], self.moving.x, self.moving.inverse,
                touching.restitution[order], touching.friction[order], rows,
            )  # fmt: skip
            take_back(0.0, starts, i, j, rows, touching.gap[order], self.moving, rules, np.zeros(3))
        left, self.deepest = self.deepest, (0.0, 0, 0)
        return left

    def let_go(self) -> list[int]:
        """Marks bodies that have left the scene as escaped, at rest; returns their ids."""
        n, moving = len(self.moving.mass), self.moving
        x = moving.x[:n]
        outside = moving.present & ~np.all((x >= self.scene.low) & (x <= self.scene.high), axis=1)
        if not outside.any():
            return []
        before = self.energy()
        moving.present[outside] = False
        moving.velocity[:n][outside] = 0.0
        self.search.alive[:] = moving.present
        self.escaped += before.stored - self.energy().stored
        return [int(one) for one in self.scene.bodies.id[outside]]

    def energy(self) -> ImpulseEnergy:
        """The ledger now."""
        n, moving = len(self.moving.mass), self.moving
        kinetic, rotational = kinetic_energy(moving.present, moving.mass, moving.inertia, moving.q, moving.velocity)
        weight = np.where(moving.present, moving.mass, 0.0)
        lost = self.energies
        return ImpulseEnergy(
            kinetic=float(kinetic), rotational=float(rotational), potential=-float(weight @ (moving.x[:n] @ self.gravity)),
            restitution=float(lost[RESTITUTION_LOSS]), friction=float(lost[FRICTION_LOSS]), escaped=self.escaped,
            projection=float(lost[PROJECTED]), work=float(lost[WORK]),
        )  # fmt: skip

    def bodies(self) -> Bodies:
        """The bodies now, copied."""
        n, start, moving = len(self.moving.mass), self.scene.bodies, self.moving
        return Bodies(
            start.id, start.group, start.shape, start.scale, start.material, moving.x[:n].copy(), moving.q.copy(),
            moving.velocity[:n, :3].copy(), moving.velocity[:n, 3:].copy(), start.mass, start.inertia, ~moving.present,
        )  # fmt: skip

    def contacts(self) -> BodyContacts:
        """The contacts of the last step, copied; before the first step those at the start, without impulses."""
        last = self.last if self.last is not None else self.look()
        found = self.found
        assert found is not None
        return BodyContacts(
            found.i.copy(), found.j.copy(), found.normal.copy(), found.point.copy(), found.gap.copy(),
            last.impulse.copy(), last.sliding.copy(),
        )  # fmt: skip

    def solving(self, anew: bool) -> Solving:
        """Counts since they last started anew."""
        counts = self.counts
        steps = max(float(counts[STEPS]), 1.0)
        told = Solving(
            steps=int(counts[STEPS]), impacts=int(counts[IMPACTS]), impact_iterations=float(counts[IMPACT_ITERATIONS]) / steps,
            load_sweeps=float(counts[LOAD_SWEEPS]) / steps, most=int(counts[MOST]), capped=int(counts[CAPPED]),
            residual=float(counts[RESIDUAL]), islands=int(counts[ISLANDS]), largest_island=int(counts[LARGEST]),
        )  # fmt: skip
        if anew:
            counts[:CAPPED] = 0.0
        return told
