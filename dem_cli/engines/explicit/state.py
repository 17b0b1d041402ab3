"""The whole state of an explicit run as arrays, and its translation to and from frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dem_cli.assembly import Assembly
from dem_cli.engines.explicit import step
from dem_cli.engines.explicit.forces import ARC, FX, MOBILITY, ROW, Q, R, U, V, X, Y, wall_direction
from dem_cli.engines.explicit.law import Law, make_law
from dem_cli.engines.explicit.lists import Lists
from dem_cli.engines.explicit.observe import touching_contacts
from dem_cli.engines.explicit.step import DISC_INERTIA, LEAPFROG, LEDGER, THESIS, Box, Motion
from dem_cli.geometry.cells import order_by_columns
from dem_cli.scenario import Scenario
from dem_cli.state import Bools, Contacts, Energy, Floats, Frame, Grains, Ints, Walls

SKIN = 0.2  # of the mean radius
FAR = 1e6  # m: where walls without end are cut off


@dataclass
class ExplicitState:
    """Arrays that move, in the engine's own order of grains, and the constants that they move by.

    rows (n + 2, ROW) as in `forces.py`, for the step `dt`; velocity (n, 3) of the thesis' scheme; mass, radius,
    alive, order (n,): order[k] is the id of the grain in row k. lists, travelled: see `lists.py`. ledger (step.LEDGER,) [J].
    start: stored energy at the start of the run [J]; lowest: lowest potential energy so far [J]; given: positive work so far [J].
    """

    time: float
    steps: int
    dt: float
    rows: Floats
    velocity: Floats
    mass: Floats
    radius: Floats
    alive: Bools
    order: Ints
    lists: Lists
    travelled: Floats
    ledger: Floats
    walls: Floats
    wall_names: tuple[str, ...]
    law: Law
    kn: float
    ks: float
    integrator: int
    deepest: float
    skin: float
    box: Box
    start: Energy | None = None
    lowest: float = np.inf
    given: float = 0.0

    @classmethod
    def start_of(cls, scenario: Scenario, assembly: Assembly, dt: float) -> ExplicitState:
        """The state before the first step."""
        grains, n = assembly.grains, len(assembly.grains)
        kn, ks = scenario.stiffness
        hn, hs = scenario.contact.damping()
        contact = scenario.contact
        rows = aligned(ROW * (n + 2)).reshape(-1, ROW)
        rows[:n, X], rows[:n, Y], rows[:n, R] = grains.x, grains.y, grains.radius
        rows[:n, U], rows[:n, V], rows[:n, Q] = grains.vx * dt, grains.vy * dt, grains.spin * grains.radius * dt
        rows[:n, MOBILITY] = kn * dt**2 / grains.mass
        rows[n, X], rows[n + 1, X] = -FAR, FAR
        return cls(
            time=0.0,
            steps=0,
            dt=dt,
            rows=rows,
            velocity=rows[:n, U:R].copy(),
            mass=grains.mass.copy(),
            radius=grains.radius.copy(),
            alive=~grains.escaped,
            order=grains.id.copy(),
            lists=no_lists(n),
            travelled=np.array([np.inf]),
            ledger=np.zeros(LEDGER),
            walls=_wall_table(assembly.walls),
            wall_names=assembly.walls.name,
            law=make_law(contact.friction, kn, ks, hn, hs, tension=contact.tension, slider=contact.slider),
            kn=kn,
            ks=ks,
            integrator={"leapfrog": LEAPFROG, "thesis": THESIS}[scenario.integration.integrator],
            deepest=scenario.integration.max_overlap,
            skin=SKIN * float(grains.radius.mean()),
            box=Box(0.0, scenario.container.width, 0.0),
        )

    # -- motion -----------------------------------------------------------------------------------------------------

    def advance(
        self, dt: float, field: Floats, driving: Floats, damping: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[int, int, int]:
        """Advance by the steps of `field`, (steps + 1, 2) [m/s^2], of `dt` [s] each; see `step.advance`.

        Returns (status, i, j) with rows of grains, j >= n for wall j - n. `time` grows with it.
        """
        self._use_time_step(dt)
        motion = Motion(np.ascontiguousarray(field), np.ascontiguousarray(driving), *damping, self.integrator)
        self.lists, status, i, j, done = step.advance(
            self.rows.reshape(-1), self.velocity, self.mass, self.radius, self.alive,
            self.lists, self.travelled, self.walls, self.law, motion, self.kn, dt, self.skin, self.deepest, self.box,
            self.ledger,
        )  # fmt: skip
        self.steps += done
        self.time += done * dt
        return int(status), int(i), int(j)

    def first_forces(self) -> None:
        """Forces of the contacts that exist before the first step; their tangential springs begin unstretched."""
        law = self.law._replace(stiffness_ratio=0.0)
        self.lists = step.evaluate(
            self.rows.reshape(-1), self.radius, self.alive, self.lists, self.walls, law, self.skin
        )
        self.travelled[0] = 0.0

    def _use_time_step(self, dt: float) -> None:
        if dt != self.dt:
            ratio = dt / self.dt
            self.rows[:, U:R] *= ratio
            self.velocity *= ratio
            self.rows[:, MOBILITY] *= ratio**2
            self.dt = dt

    def sort(self) -> None:
        """Bring the grains into columns from left to right, so that those that touch lie close in memory."""
        n = len(self.mass)
        cell = 2.0 * float(self.radius.max()) + self.skin
        new = order_by_columns(self.rows[:n, X].copy(), self.rows[:n, Y].copy(), cell)
        place = np.empty(n, dtype=np.int64)
        place[new] = np.arange(n)
        self.rows[:n] = self.rows[new]
        self.velocity = self.velocity[new]
        self.mass, self.radius, self.alive, self.order = (
            a[new] for a in (self.mass, self.radius, self.alive, self.order)
        )
        i, j, memory = self._pairs()
        i, j = place[i], place[j]
        first, second = np.minimum(i, j), np.maximum(i, j)
        by_first = np.lexsort((second, first))
        count = np.bincount(first, minlength=n)
        wall_grain = place[self.lists.wall_grain]
        by_grain = np.lexsort((self.lists.wall_number, wall_grain))
        self.lists = Lists(
            np.concatenate([[0], np.cumsum(count)]),
            second[by_first].astype(np.int32),
            memory[by_first],
            wall_grain[by_grain].astype(np.int32),
            self.lists.wall_number[by_grain],
            self.lists.wall_memory[by_grain],
        )

    # -- what can be seen -------------------------------------------------------------------------------------------

    def _pairs(self) -> tuple[Ints, Ints, Floats]:
        """Rows i, j of the pairs of the outer list, and their memory (pairs, 3)."""
        i = np.repeat(np.arange(len(self.mass)), np.diff(self.lists.start))
        return i, self.lists.neighbour.astype(np.int64), self.lists.memory

    def wall_distance(self, i: int, w: int) -> float:
        """Distance of the centre of the grain in row i from wall w [m]."""
        return float(wall_direction(self.rows[i, X], self.rows[i, Y], self.walls, w)[2])

    def grains(self) -> Grains:
        """The grains in the order of their ids."""
        n = len(self.mass)
        row = np.empty(n, dtype=np.int64)
        row[self.order] = np.arange(n)
        speed = self.velocity if self.integrator == THESIS else self.rows[:n, U:R]
        u, v, q = (np.where(self.alive, column, 0.0)[row] / self.dt for column in speed.T)
        mass, radius = self.mass[row], self.radius[row]
        return Grains(
            id=np.arange(n, dtype=np.int64),
            x=self.rows[row, X],
            y=self.rows[row, Y],
            angle=self.rows[row, ARC] / radius,
            vx=u,
            vy=v,
            spin=q / radius,
            radius=radius,
            mass=mass,
            inertia=mass * radius**2 / DISC_INERTIA,
            escaped=~self.alive[row],
            a=radius,
            b=radius,
            body=np.arange(n, dtype=np.int64),
        )

    def contacts(self) -> Contacts:
        """Contacts that touch now, by ids, sorted."""
        i, j, columns, sliding = touching_contacts(
            self.rows.reshape(-1), self.lists, self.walls, self.order, self.law.friction, self.kn, self.ks
        )
        names = ("nx", "ny", "px", "py", "overlap", "normal", "shear", "stretch")
        return Contacts(i=i, j=j, sliding=sliding, **dict(zip(names, columns, strict=True)))

    def positions(self) -> tuple[Floats, Floats]:
        """Centres by row [m]."""
        n = len(self.mass)
        return self.rows[:n, X], self.rows[:n, Y]

    def frame(self, gravity: Floats, ground: Floats, due: frozenset[str], stage: int, *, heavy: bool) -> Frame:
        """The frame of this instant; without `heavy` it has grains only."""
        grains = self.grains()
        if not heavy:
            nothing = float("nan")
            return Frame(self.steps, self.time, self.dt, stage, grains, ground, Energy(), nothing, nothing, due)
        contacts = self.contacts()
        n = len(self.mass)
        resultant = np.empty((n, 2))
        resultant[self.order] = self.kn * self.rows[:n, FX : FX + 2] + self.mass[:, None] * gravity
        resultant[grains.escaped] = 0.0
        energy = self._energy(grains, contacts, gravity)
        if self.start is None:
            self.start = energy
        self.lowest = min(self.lowest, energy.potential + energy.escaped)
        self.given = max(self.given, energy.work)
        residual = self.start.stored + energy.work + energy.time_step - energy.stored - energy.lost
        put_in = self.start.stored - self.start.potential + self.start.potential - self.lowest + self.given
        pushes = np.hypot(contacts.normal, contacts.shear)
        push = float(pushes.mean()) if len(contacts) else 0.0
        present = ~grains.escaped
        lag = float(np.hypot(resultant[present, 0], resultant[present, 1]).mean()) if present.any() else 0.0
        return Frame(
            step=self.steps, time=self.time, dt=self.dt, stage=stage, grains=grains, ground=ground, energy=energy,
            residual=residual, energy_in=put_in, due=due, contacts=contacts, forces=resultant,
            unbalanced=lag / push if push > 0.0 else float("nan"),
        )  # fmt: skip

    def _energy(self, grains: Grains, contacts: Contacts, gravity: Floats) -> Energy:
        present = ~grains.escaped
        swing = grains.mass * (grains.vx**2 + grains.vy**2) + grains.inertia * grains.spin**2
        height = grains.mass * (gravity[0] * grains.x + gravity[1] * grains.y)
        ledger = self.ledger
        return Energy(
            kinetic=0.5 * float(swing[present].sum()),
            potential=-float(height[present].sum()),
            elastic_normal=0.5 * self.kn * float((contacts.overlap**2).sum()),
            elastic_tangential=0.5 * self.ks * float((contacts.stretch**2).sum()),
            friction=float(ledger[step.FRICTION]),
            dashpot_normal=float(ledger[step.DASHPOT_N]),
            dashpot_tangential=float(ledger[step.DASHPOT_S]),
            damping=float(ledger[step.DAMPING]),
            escaped=float(ledger[step.ESCAPED]),
            time_step=float(ledger[step.TIME_STEP]),
            work=float(ledger[step.WORK]),
        )


def aligned(n: int) -> Floats:
    """n zeros that begin at a cache line, so that no row lies in two."""
    raw = np.zeros(n + 8)
    skip = -raw.ctypes.data % 64 // 8
    return raw[skip : skip + n]


def no_lists(n: int) -> Lists:
    """Lists of n grains without a pair."""
    none = np.empty(0, dtype=np.int32)
    return Lists(np.zeros(n + 1, dtype=np.int64), none, np.empty((0, 3)), none, none, np.empty((0, 3)))


def _wall_table(walls: Walls) -> Floats:
    ends = np.stack([walls.x0, walls.y0, walls.x1, walls.y1, walls.friction], axis=1)
    return np.ascontiguousarray(np.clip(ends, -FAR, FAR))
