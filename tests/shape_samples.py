"""Samples of ellipses, bonded pairs and rigid clumps, small and made by hand, for tests of result files, reports and pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dem_cli.state import Bonds, BondStrain, Contacts, Floats, Frame, Grains, Ints, Walls

DENSITY, DEPTH = 2480.0, 1.0


def some_ellipses(k: int = 0, n: int = 6) -> Grains:
    """Five ellipses and a disc, turned and moving; other ones at each instant k, of the same semi-axes."""
    rng = np.random.default_rng(1000 + k)
    b = np.linspace(0.01, 0.02, n)
    a = b * np.array([1.0, 1.2, 1.5, 2.0, 3.0, 5.0])[:n]
    grains = Grains.ellipses(rng.random(n), rng.random(n), a, b, rng.uniform(-4.0, 4.0, n), DENSITY, DEPTH)
    for name in ("vx", "vy", "spin"):
        getattr(grains, name)[:] = rng.normal(size=n)
    return grains


def in_bodies(grains: Grains, body: list[int]) -> Grains:
    return replace(grains, body=np.array(body, dtype=np.int64))


def pairs(x: Floats, y: Floats, angle: Floats, radius: float) -> tuple[Grains, Bonds]:
    """Bonded pairs of touching discs about (x, y), in the direction `angle` from the first disc to the second."""
    arm = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    places = np.stack([np.stack([x, y], axis=1) - arm, np.stack([x, y], axis=1) + arm], axis=1).reshape(-1, 2)
    discs = Grains.discs(places[:, 0], places[:, 1], np.full(len(places), radius), DENSITY, DEPTH)
    grains = replace(discs, angle=np.repeat(angle, 2), body=np.repeat(np.arange(len(x)), 2))
    i = 2 * np.arange(len(x), dtype=np.int64)
    viscosity = np.full(len(x), 1e6)
    return grains, Bonds(i, i + 1, viscosity, 0.5 * viscosity, 0.0 * viscosity)


def strain(bonds: Bonds, k: int) -> BondStrain:
    rng = np.random.default_rng(k)
    return BondStrain(*(rng.normal(size=len(bonds)) for _ in range(3)))


def triangles(x: Floats, y: Floats, angle: Floats, radius: float, arm: float) -> Grains:
    """Rigid clumps of three discs at the distance `arm` from (x, y); mass and inertia those of discs that do not overlap."""
    at = angle[:, None] + 2.0 * np.pi / 3.0 * np.arange(3)
    discs = Grains.discs(
        (x[:, None] + arm * np.cos(at)).ravel(),
        (y[:, None] + arm * np.sin(at)).ravel(),
        np.full(3 * len(x), radius),
        DENSITY,
        DEPTH,
    )
    return replace(discs, angle=np.repeat(angle, 3), body=np.repeat(np.arange(len(x)), 3))


def turned(grains: Grains, body: int, angle: float, by: tuple[float, float] = (0.0, 0.0)) -> Grains:
    """The grain `body` turned as a rigid body about its centre of mass, then moved."""
    of: Ints = np.flatnonzero(grains.body == body)
    m = grains.mass[of]
    cx, cy = m @ grains.x[of] / m.sum(), m @ grains.y[of] / m.sum()
    c, s = np.cos(angle), np.sin(angle)
    dx, dy = grains.x[of] - cx, grains.y[of] - cy
    x, y, theta = grains.x.copy(), grains.y.copy(), grains.angle.copy()
    x[of], y[of] = cx + by[0] + c * dx - s * dy, cy + by[1] + s * dx + c * dy
    theta[of] += angle
    return replace(grains, x=x, y=y, angle=theta)


def with_shape(
    frame: Frame, grains: Grains, contacts: Contacts | None = None, bonds: BondStrain | None = None
) -> Frame:
    return replace(frame, grains=grains, contacts=contacts or frame.contacts, bonds=bonds)


def shaped(
    shape: str, columns: int = 12, rows: int = 15, cell: float = 0.008
) -> tuple[str, Grains, Walls, Contacts, float, Bonds]:
    """Grains of a shape on a hexagonal lattice in a container, each turned its own way, with a made-up contact to the right, up and
    the floor, where the nearest elements are.

    shape: "ellipse" (with discs among them), "bonded" (pairs), "clump" (triangles of overlapping discs).
    """
    k = np.arange(columns * rows)
    row, column = k // columns, k % columns
    x = cell * (1.0 + 2.0 * column + row % 2)
    y = cell * (1.0 + np.sqrt(3.0) * row)
    width = cell * (2.0 * columns + 1.0)
    angle = np.random.default_rng(5).uniform(-np.pi, np.pi, len(k))
    bonds = Bonds.none()
    if shape == "bonded":
        grains, bonds = pairs(x, y, angle, 0.48 * cell)
    elif shape == "clump":
        grains = triangles(x, y, angle, 0.55 * cell, 0.4 * cell)
    else:
        ratio = 1.0 + 0.25 * (k % 7)
        a = 0.95 * cell * np.ones(len(k))
        grains = Grains.ellipses(x, y, a, a / ratio, angle, DENSITY, DEPTH)
    walls = Walls(
        ("left", "bottom", "right"), np.array([0.0, 0.0, width]), np.array([np.inf, 0.0, 0.0]), np.array([0.0, width, width]),
        np.array([0.0, 0.0, np.inf]), np.array([0.25, 0.25, 0.25]),
    )  # fmt: skip
    some = [(n, n + 1) for n in k[column < columns - 1]] + [(n, n + columns) for n in k[row < rows - 1]]
    touching = sorted([_nearest(grains, *pair) for pair in some] + [(_lowest(grains, n), -2) for n in k[row == 0]])
    i, j = np.array(touching, dtype=np.int64).T
    dx = np.where(j < 0, 0.0, grains.x[j] - grains.x[i])
    dy = np.where(j < 0, -grains.y[i], grains.y[j] - grains.y[i])
    distance = np.hypot(dx, dy)
    nx, ny = dx / distance, dy / distance
    force = 100.0 * (rows - row[grains.body[i]]) * (0.1 + np.abs(ny))
    half = np.where(j < 0, 1.0, 0.5)
    contacts = Contacts(
        i, j, nx, ny, grains.x[i] + half * dx, grains.y[i] + half * dy, np.full(len(i), 1e-6), force, 0.1 * force * nx,
        -1e-7 * nx, np.abs(nx) > 0.9,
    )  # fmt: skip
    return shape, grains, walls, contacts, width, bonds


def _nearest(grains: Grains, first: int, second: int) -> tuple[int, int]:
    """The elements of two grains that are closest to each other."""
    one, two = np.flatnonzero(grains.body == first), np.flatnonzero(grains.body == second)
    distance = np.hypot(grains.x[one][:, None] - grains.x[two], grains.y[one][:, None] - grains.y[two])
    p, q = np.unravel_index(np.argmin(distance), distance.shape)
    return int(one[p]), int(two[q])


def _lowest(grains: Grains, body: int) -> int:
    of = np.flatnonzero(grains.body == body)
    return int(of[np.argmin(grains.y[of])])
