"""The whole state of an explicit run as arrays, and its translation to and from frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli.assembly import Assembly
from dem_cli.engines.explicit import bodies, step
from dem_cli.engines.explicit.bodies import BOND, Bonded, Cores
from dem_cli.engines.explicit.build import aligned, bonded_of, chunk_edges, cores_of, outlines_of, realigned, sort_bonds
from dem_cli.engines.explicit.ellipses import Outlines, pair_gap, wall_contact
from dem_cli.engines.explicit.forces import ARC, FX, MOBILITY, RATIO, ROW, Q, R, U, V, X, Y, wall_direction
from dem_cli.engines.explicit.law import Law, make_law
from dem_cli.engines.explicit.lists import Lists
from dem_cli.engines.explicit.moves import LEAPFROG, THESIS, Box, Motion
from dem_cli.engines.explicit.observe import touching_contacts
from dem_cli.geometry.cells import order_by_columns
from dem_cli.scenario import Scenario
from dem_cli.state import BondStrain, Bools, Contacts, Energy, Floats, Frame, Grains, Ints, Walls

SKIN = 0.2  # of the mean radius of the elements
FAR = 1e6  # m: where walls without end are cut off


@dataclass
class ExplicitState:
    """Arrays that move, in the engine's own order of elements, and the constants that they move by.

    rows (n + 2, ROW) as in `forces.py`, for the step `dt`; velocity (n, 3) of the thesis' scheme; mass, inertia, radius, a, b,
    alive, order (n,): order[k] is the id of the element in row k. body (n,): number of its body in the engine's order, None where each is its
    own; body_id: the same numbers by id. edges, outlines, bonds, cores: see `step.advance`; bond_order: which bond of the assembly is
    the k-th here. lists, travelled: see `lists.py`. ledger (step.LEDGER,) [J].
    start: stored energy at the start of the run [J]; lowest: lowest potential energy so far [J]; given: positive work so far [J].
    """

    time: float
    steps: int
    dt: float
    rows: Floats
    velocity: Floats
    mass: Floats
    inertia: Floats
    radius: Floats
    a: Floats
    b: Floats
    alive: Bools
    order: Ints
    body: Ints | None
    body_id: Ints
    edges: Ints
    outlines: Outlines | None
    bonds: Bonded | None
    bond_order: Ints
    cores: Cores | None
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
        # In a contact a disc counts with the mass of its own circle, whatever it is joined to.
        mass = grains.mass if not assembly.rigid else disc_mass(scenario, grains.radius)
        rows[:n, MOBILITY], rows[:n, ARC] = kn * dt**2 / mass, grains.angle * grains.radius
        rows[:n, RATIO] = np.where(grains.inertia > 0.0, grains.mass * grains.radius**2 / grains.inertia, 2.0)
        rows[n, X], rows[n + 1, X] = -FAR, FAR
        body = grains.body.copy() if assembly.rigid or grains.grain_count < n else None
        edges = chunk_edges(n, body)
        outlines = outlines_of(grains, enlarged=scenario.contact.ellipse_test == "enlarged")
        return cls(
            time=0.0,
            steps=0,
            dt=dt,
            rows=rows,
            velocity=rows[:n, U:R].copy(),
            mass=grains.mass.copy(),
            inertia=grains.inertia.copy(),
            radius=grains.radius.copy(),
            a=grains.a.copy(),
            b=grains.b.copy(),
            alive=~grains.escaped,
            order=grains.id.copy(),
            body=body,
            body_id=grains.body,
            edges=edges,
            outlines=outlines,
            bonds=bonded_of(grains, assembly.bonds, edges),
            bond_order=np.lexsort((assembly.bonds.j, assembly.bonds.i)),
            cores=cores_of(assembly, edges, kn, dt),
            lists=no_lists(n, outlines is not None),
            travelled=np.array([np.inf]),
            ledger=np.zeros(step.LEDGER),
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

    def __setstate__(self, state: dict[str, Any]) -> None:
        """As from a file: what begins at a cache line does so again."""
        vars(self).update(state, rows=realigned(state["rows"]))
        if self.outlines is not None:
            self.outlines = self.outlines._replace(fours=realigned(self.outlines.fours))
        if self.cores is not None:
            self.cores = self.cores._replace(rows=realigned(self.cores.rows))

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
            self.rows.reshape(-1), self.velocity, self.mass, self.inertia, self.a, self.alive,
            self.lists, self.travelled, self.walls, self.law, motion, self.kn, dt, self.skin, self.deepest, self.box,
            self.ledger, self.edges, self.outlines, self.body, self.bonds, self.cores,
        )  # fmt: skip
        self.steps += done
        self.time += done * dt
        return int(status), int(i), int(j)

    def first_forces(self) -> None:
        """Forces of the contacts that exist before the first step; their tangential springs begin unstretched."""
        law = self.law._replace(stiffness_ratio=0.0)
        self.lists = step.evaluate(
            self.rows.reshape(-1), self.a, self.alive, self.lists, self.walls, law, self.skin, self.edges,
            self.outlines, self.body,
        )  # fmt: skip
        self.travelled[0] = 0.0

    def _use_time_step(self, dt: float) -> None:
        if dt != self.dt:
            ratio = dt / self.dt
            self.rows[:, U:R] *= ratio
            self.velocity *= ratio
            self.rows[:, MOBILITY] *= ratio**2
            if self.cores is not None:
                cores = self.cores.rows.reshape(-1, ROW)
                cores[:, U:R] *= ratio
                cores[:, MOBILITY] *= ratio**2
                self.cores.velocity[:] *= ratio
            self.dt = dt

    def sort(self) -> None:
        """Bring the grains into columns from left to right, so that those that touch lie close in memory."""
        n = len(self.mass)
        cell = 2.0 * float(self.a.max()) + self.skin
        first = np.arange(n) if self.body is None else np.flatnonzero(np.diff(self.body, prepend=-1))
        by_body = order_by_columns(self.rows[first, X].copy(), self.rows[first, Y].copy(), cell)
        new = by_body
        if self.body is not None:
            rank = np.empty(len(first), dtype=np.int64)
            rank[by_body] = np.arange(len(first))
            new = np.argsort(rank[self.body], kind="stable")
            self.body = rank[self.body][new]
        place = np.empty(n, dtype=np.int64)
        place[new] = np.arange(n)
        self.rows[:n] = self.rows[new]
        self.velocity = self.velocity[new]
        for name in ("mass", "inertia", "radius", "a", "b", "alive", "order"):
            setattr(self, name, getattr(self, name)[new])
        self.edges = chunk_edges(n, self.body)
        if self.outlines is not None:
            fours = self.outlines.fours.reshape(-1, 4)
            fours[:n] = fours[new]
            self.outlines = self.outlines._replace(sway=self.outlines.sway[new])
        if self.bonds is not None:
            i, j = place[self.bonds.first // ROW], place[self.bonds.second // ROW]
            self.bonds, order = sort_bonds(i, j, self.bonds.data.reshape(-1, BOND), self.edges)
            self.bond_order = self.bond_order[order]
        if self.cores is not None:
            self._sort_cores(by_body, new)
        self._sort_lists(place)

    def _sort_cores(self, by_body: Ints, new: Ints) -> None:
        assert self.cores is not None
        cores = self.cores.rows.reshape(-1, ROW)
        cores[:] = cores[by_body]
        start = np.append(0, np.cumsum(np.diff(self.cores.start)[by_body])).astype(np.int64)
        edges = np.searchsorted(start, self.edges).astype(np.int64)
        self.cores = Cores(
            cores.reshape(-1), self.cores.velocity[by_body].copy(), start, self.cores.arms[new].copy(), edges
        )

    def _sort_lists(self, place: Ints) -> None:
        """Lists after the element of row k has moved to row place[k]."""
        n = len(self.mass)
        i, j, memory = self._pairs()
        i, j = place[i], place[j]
        memory[i > j, 3:] *= -1.0  # normals point from the first to the second
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
        """Rows i, j of the pairs of the outer list, and their memory, see `Lists`."""
        i = np.repeat(np.arange(len(self.mass)), np.diff(self.lists.start))
        return i, self.lists.neighbour.astype(np.int64), self.lists.memory

    def overlap(self, i: int, j: int) -> float:
        """Overlap of the elements in rows i and j, or of the one in row i and wall j - n, as their outlines tell [m]."""
        rows, n = self.rows.reshape(-1), len(self.mass)
        if self.outlines is not None and j >= n:
            return -float(wall_contact(rows, self.outlines, ROW * i, self.walls, j - n)[2])
        if self.outlines is not None:
            return -float(pair_gap(rows, self.outlines, i, j, 0.0, 0.0)[2])
        if j >= n:
            return float(self.radius[i] - wall_direction(self.rows[i, X], self.rows[i, Y], self.walls, j - n)[2])
        apart = np.hypot(*(self.rows[j, X : Y + 1] - self.rows[i, X : Y + 1]))
        return float(self.radius[i] + self.radius[j] - apart)

    def grains(self) -> Grains:
        """The grains in the order of their ids."""
        n = len(self.mass)
        row = np.empty(n, dtype=np.int64)
        row[self.order] = np.arange(n)
        speed = self.velocity if self.integrator == THESIS else self.rows[:n, U:R]
        u, v, q = (np.where(self.alive, column, 0.0)[row] / self.dt for column in speed.T)
        radius = self.radius[row]
        return Grains(
            id=np.arange(n, dtype=np.int64),
            x=self.rows[row, X],
            y=self.rows[row, Y],
            angle=self.rows[row, ARC] / radius,
            vx=u,
            vy=v,
            spin=q / radius,
            radius=radius,
            mass=self.mass[row],
            inertia=self.inertia[row],
            escaped=~self.alive[row],
            a=self.a[row],
            b=self.b[row],
            body=self.body_id,
        )

    def contacts(self) -> Contacts:
        """Contacts that touch now, by ids, sorted."""
        i, j, columns, sliding = touching_contacts(
            self.rows.reshape(-1),
            self.outlines,
            self.lists,
            self.walls,
            self.order,
            self.law.friction,
            self.kn,
            self.ks,
        )
        names = ("nx", "ny", "px", "py", "overlap", "normal", "shear", "stretch")
        return Contacts(i=i, j=j, sliding=sliding, **dict(zip(names, columns, strict=True)))

    def bond_strain(self) -> BondStrain | None:
        """What the bonds have given, in the order of the assembly's; None without any."""
        if self.bonds is None:
            return None
        data = np.empty((len(self.bond_order), BOND))
        data[self.bond_order] = self.bonds.data.reshape(-1, BOND)
        ends = np.empty((2, len(self.bond_order)), dtype=np.int64)
        ends[:, self.bond_order] = self.bonds.first // ROW, self.bonds.second // ROW
        apart = np.hypot(*(self.rows[ends[1], X : Y + 1] - self.rows[ends[0], X : Y + 1]).T)
        return BondStrain(apart - data[:, bodies.LENGTH], data[:, bodies.SLIP], data[:, bodies.ROLL])

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
        # Forces between the elements of a grain keep it together; what moves it is their sum.
        of_grain = [np.bincount(grains.body, weights=component) for component in resultant.T]
        count = len(np.unique(grains.body[~grains.escaped]))
        lag = float(np.hypot(*of_grain).sum()) / count if count else 0.0
        return Frame(
            step=self.steps, time=self.time, dt=self.dt, stage=stage, grains=grains, ground=ground, energy=energy,
            residual=residual, energy_in=put_in, due=due, contacts=contacts, forces=resultant, bonds=self.bond_strain(),
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
            bonds=float(ledger[step.BONDS]),
            damping=float(ledger[step.DAMPING]),
            escaped=float(ledger[step.ESCAPED]),
            time_step=float(ledger[step.TIME_STEP]),
            work=float(ledger[step.WORK]),
        )


def disc_mass(scenario: Scenario, radius: Floats) -> Floats:
    """Mass of whole discs [kg]."""
    return np.asarray(scenario.grains.density * np.pi * radius**2 * scenario.depth)


def no_lists(n: int, normals: bool) -> Lists:
    """Lists of n elements without a pair; with room for normals where there are ellipses."""
    none, memory = np.empty(0, dtype=np.int32), np.empty((0, 5 if normals else 3))
    return Lists(np.zeros(n + 1, dtype=np.int64), none, memory, none, none, np.empty((0, 3)))


def _wall_table(walls: Walls) -> Floats:
    ends = np.stack([walls.x0, walls.y0, walls.x1, walls.y1, walls.friction], axis=1)
    return np.ascontiguousarray(np.clip(ends, -FAR, FAR))
