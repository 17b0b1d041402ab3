"""Small samples for the tests of measures: lattices, their contacts and frames, built without the engine."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dem_cli.geometry.ellipse import outline, support, widest_gap
from dem_cli.state import BondStrain, Contacts, Energy, Floats, Frame, Grains

RHO, THICKNESS, KN = 2480.0, 0.5, 1.0e7


def overlaps(x, y, radius, width=None, kn=KN, shear=0.0):
    """Contacts of all overlapping pairs, and of walls 0 (left), 1 (right), 2 (floor) if a width is given; N = kn d."""
    x, y, radius = (np.asarray(a, float) for a in (x, y, radius))
    rows = []
    for i in range(len(x)):
        for j in range(i + 1, len(x)):
            d = math.hypot(x[j] - x[i], y[j] - y[i])
            if 0.0 < d < radius[i] + radius[j]:
                nx, ny, lap = (x[j] - x[i]) / d, (y[j] - y[i]) / d, radius[i] + radius[j] - d
                arm = radius[i] - 0.5 * lap
                rows.append((i, j, nx, ny, x[i] + arm * nx, y[i] + arm * ny, lap))
        if width is not None:
            gaps = ((-1.0, 0.0, x[i]), (1.0, 0.0, width - x[i]), (0.0, -1.0, y[i]))
            for wall, (nx, ny, gap) in enumerate(gaps):
                if gap < radius[i]:
                    rows.append((i, -1 - wall, nx, ny, x[i] + gap * nx, y[i] + gap * ny, radius[i] - gap))
    table = np.array(sorted(rows), float).reshape(-1, 7)
    columns = np.ascontiguousarray(table.T)
    lap = columns[6]
    return Contacts(
        i=columns[0].astype(np.int64),
        j=columns[1].astype(np.int64),
        nx=columns[2],
        ny=columns[3],
        px=columns[4],
        py=columns[5],
        overlap=lap,
        normal=kn * lap,
        shear=np.full(len(lap), shear),
        stretch=np.zeros(len(lap)),
        sliding=np.zeros(len(lap), dtype=bool),
    )


def frame_of(grains: Grains, contacts: Contacts | None, bonds: BondStrain | None = None) -> Frame:
    return Frame(
        step=7,
        time=0.25,
        dt=1e-5,
        stage=1,
        grains=grains,
        ground=np.arange(6.0).reshape(3, 2),
        energy=Energy(*(0.5 + k for k in range(12))),
        residual=-3.0,
        energy_in=40.0,
        due=frozenset({"series"}),
        contacts=contacts,
        forces=np.zeros((len(grains), 2)),
        bonds=bonds,
        unbalanced=0.125,
    )


def discs(x, y, radius) -> Grains:
    x = np.asarray(x, float)
    return Grains.discs(x, np.asarray(y, float), np.broadcast_to(radius, x.shape).astype(float), RHO, THICKNESS)


def ellipses(x, y, a, b, angle) -> Grains:
    x = np.asarray(x, float)
    y, a, b, angle = (np.broadcast_to(np.asarray(v, float), x.shape).copy() for v in (y, a, b, angle))
    return Grains.ellipses(x, y, a, b, angle, RHO, THICKNESS)


def bodies_of(*bodies) -> Grains:
    """Grains of several discs, each a list of (x, y, r)."""
    x, y, radius = np.array([disc for body in bodies for disc in body], float).T
    number = np.repeat(np.arange(len(bodies)), [len(body) for body in bodies])
    return replace(discs(x, y, radius), body=number)


def touching(grains: Grains, kn=KN, shear=0.0) -> Contacts:
    """Contacts of all elements of different grains that overlap, discs or ellipses; N = kn d."""
    rows = []
    for i in range(len(grains)):
        for j in range(i + 1, len(grains)):
            dx, dy = grains.x[j] - grains.x[i], grains.y[j] - grains.y[i]
            if grains.body[i] == grains.body[j] or math.hypot(dx, dy) >= grains.a[i] + grains.a[j]:
                continue
            shape_i, shape_j = (outline(grains.a[k], grains.b[k], grains.angle[k]) for k in (i, j))
            nx, ny, gap = widest_gap(dx, dy, *shape_i, *shape_j, 0.0, 0.0)
            if gap < 0.0:
                h, h1, _ = support(*shape_i, nx, ny)
                out = h + 0.5 * gap
                px, py = grains.x[i] + out * nx - h1 * ny, grains.y[i] + out * ny + h1 * nx
                rows.append((i, j, nx, ny, px, py, -gap))
    columns = np.ascontiguousarray(np.array(rows, float).reshape(-1, 7).T)
    zeros = np.zeros(len(rows))
    return Contacts(
        *(column.astype(np.int64) for column in columns[:2]),
        *columns[2:],
        normal=kn * columns[6],
        shear=zeros + shear,
        stretch=zeros,
        sliding=zeros != 0.0,
    )


def rotated(grains: Grains, contacts: Contacts, turn: float) -> tuple[Grains, Contacts]:
    """A sample turned by `turn` [rad] about the origin; forces turn with it."""
    c, s = math.cos(turn), math.sin(turn)
    x, y = c * grains.x - s * grains.y, s * grains.x + c * grains.y
    nx, ny = c * contacts.nx - s * contacts.ny, s * contacts.nx + c * contacts.ny
    px, py = c * contacts.px - s * contacts.py, s * contacts.px + c * contacts.py
    return replace(grains, x=x, y=y, angle=grains.angle + turn), replace(contacts, nx=nx, ny=ny, px=px, py=py)


def union_in_rectangle(grains: Grains, window, slices=100_000) -> float:
    """Area that all elements cover inside a finite rectangle, common parts once: vertical slices, each a union of intervals.

    Where an outline is upright a slice of width w is wrong by about sqrt(r) w^1.5: 1e-6 for an element of size 1 in a window of 10.
    """
    x0, y0, x1, y1 = window
    width = (x1 - x0) / slices
    d = (x0 + (np.arange(slices) + 0.5) * width)[:, None] - grains.x
    m, p, q = (np.array(v) for v in zip(*map(outline, grains.a, grains.b, grains.angle), strict=True))
    across = m + p
    half = grains.a * grains.b / across * np.sqrt(np.maximum(across - d * d, 0.0))
    middle = grains.y + q / across * d
    low, high = np.clip(middle - half, y0, y1), np.clip(middle + half, y0, y1)
    order = np.argsort(low, axis=1)
    low, high = np.take_along_axis(low, order, 1), np.take_along_axis(high, order, 1)
    before = np.hstack([np.full((slices, 1), y0), np.maximum.accumulate(high, axis=1)[:, :-1]])
    return float(np.maximum(0.0, high - np.maximum(low, before)).sum() * width)


def hexagonal(columns: int, rows: int, r: float, pitch: float) -> tuple[Floats, Floats]:
    """Centres of a hexagonal lattice of the given pitch on the floor; odd rows are shifted by half."""
    k, m = np.meshgrid(np.arange(columns), np.arange(rows))
    x = r + pitch * (k + 0.5 * (m % 2))
    y = r + pitch * math.sqrt(0.75) * m
    return x.ravel().astype(float), y.ravel().astype(float)


def bed(columns=12, rows=6, r=0.01, seed=None):
    """Grains and width of a slightly pressed staggered bed that touches floor and walls; `seed` shakes it a little."""
    x, y = hexagonal(columns, rows, r, 1.996 * r)
    y = y - 0.001 * r
    x = x - 0.001 * r
    if seed is not None:
        rng = np.random.default_rng(seed)
        x = x + rng.uniform(-0.05, 0.05, len(x)) * r
        y = y + rng.uniform(-0.05, 0.05, len(x)) * r
    return discs(x, y, r), 1.996 * r * (columns + 0.5)
