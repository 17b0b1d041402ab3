"""Arrays of the explicit engine from an assembly: outlines of ellipses, bonds, rigid bodies, and chunks of the loop."""

from __future__ import annotations

import numpy as np

from dem_cli.assembly import Assembly
from dem_cli.engines.explicit import bodies
from dem_cli.engines.explicit.bodies import BOND, Bonded, Cores
from dem_cli.engines.explicit.ellipses import Outlines
from dem_cli.engines.explicit.forces import ARC, CHUNK, MOBILITY, RATIO, ROW, Q, R, U, V, X, Y
from dem_cli.state import Bonds, Floats, Grains, Ints


def aligned(n: int) -> Floats:
    """n zeros that begin at a cache line, so that no row lies in two."""
    raw = np.zeros(n + 8)
    skip = -raw.ctypes.data % 64 // 8
    return raw[skip : skip + n]


def realigned(values: Floats) -> Floats:
    """A copy that begins at a cache line."""
    twin = aligned(values.size)
    twin[:] = values.ravel()
    return twin.reshape(values.shape)


def chunk_edges(n: int, body: Ints | None) -> Ints:
    """First element of each chunk of about CHUNK, and n; no body (n,) lies in two."""
    edges = np.arange(0, n, CHUNK)
    if body is not None:
        edges = np.searchsorted(body, body[edges])
    return np.append(np.unique(edges), n).astype(np.int64)


def outlines_of(grains: Grains, *, enlarged: bool) -> Outlines | None:
    """Outlines of the elements and of two dummies; None if all are discs."""
    if np.array_equal(grains.a, grains.b):
        return None
    n = len(grains)
    half = 0.5 * (grains.a - grains.b) * (grains.a + grains.b)
    fours = aligned(4 * (n + 2)).reshape(-1, 4)
    fours[:n, 0] = 0.5 * (grains.a**2 + grains.b**2)
    fours[:n, 1], fours[:n, 2] = half * np.cos(2.0 * grains.angle), half * np.sin(2.0 * grains.angle)
    fours[:n, 3] = 1.0 / grains.radius
    fours[n:, 0] = fours[n:, 3] = 1.0
    return Outlines(fours.reshape(-1), grains.a - grains.b, enlarged)


def bonded_of(grains: Grains, bonds: Bonds, edges: Ints) -> Bonded | None:
    """Bonds sorted by their first disc; None without any."""
    if len(bonds) == 0:
        return None
    data = np.zeros((len(bonds), BOND))
    i, j = bonds.i, bonds.j
    data[:, bodies.SHARE] = grains.radius[i] / (grains.radius[i] + grains.radius[j])
    data[:, bodies.NORMAL], data[:, bodies.TANGENTIAL] = bonds.normal, bonds.tangential
    data[:, bodies.ROLLING] = bonds.rolling
    data[:, bodies.LENGTH] = np.hypot(grains.x[j] - grains.x[i], grains.y[j] - grains.y[i])
    return sort_bonds(i, j, data, edges)[0]


def sort_bonds(i: Ints, j: Ints, data: Floats, edges: Ints) -> tuple[Bonded, Ints]:
    """Bonds between the rows i and j with their data (b, BOND), sorted by i; and the permutation that sorts them."""
    order = np.lexsort((j, i))
    first = np.searchsorted(i[order], edges)
    paired = np.array_equal(np.stack([i[order], j[order]], axis=1).ravel(), np.arange(edges[-1]))
    bonded = Bonded(
        (ROW * i[order]).astype(np.int32), (ROW * j[order]).astype(np.int32), data[order].reshape(-1), first, paired
    )
    return bonded, order


def cores_of(assembly: Assembly, edges: Ints, kn: float, dt: float) -> Cores | None:
    """Rigid bodies of an assembly in units of the engine, each with the sums of its elements; None if it is not rigid."""
    if not assembly.rigid:
        return None
    g, n = assembly.grains, assembly.grains.grain_count

    def total(values: Floats) -> Floats:
        return np.bincount(g.body, weights=values, minlength=n).astype(np.float64)

    mass = total(g.mass)
    x, y = total(g.mass * g.x) / mass, total(g.mass * g.y) / mass
    arms = np.stack([g.x - x[g.body], g.y - y[g.body]], axis=1)
    inertia = total(g.inertia + g.mass * (arms**2).sum(axis=1))
    radius = np.sqrt(total(g.radius**2))
    start = np.searchsorted(g.body, np.arange(n + 1)).astype(np.int64)
    rows = aligned(ROW * n).reshape(-1, ROW)
    rows[:, X], rows[:, Y], rows[:, R] = x, y, radius
    spin, angle = g.spin[start[:-1]], g.angle[start[:-1]]
    rows[:, U], rows[:, V] = total(g.mass * g.vx) / mass * dt, total(g.mass * g.vy) / mass * dt
    rows[:, Q], rows[:, ARC] = spin * radius * dt, angle * radius
    alive = ~g.escaped[start[:-1]]
    rows[:, MOBILITY], rows[:, RATIO] = np.where(alive, kn * dt**2 / mass, 0.0), mass * radius**2 / inertia
    return Cores(rows.reshape(-1), rows[:, U:R].copy(), start, arms, np.searchsorted(start, edges).astype(np.int64))
