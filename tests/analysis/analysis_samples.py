"""Small samples for the tests of measures: lattices, their contacts and frames, built without the engine."""

from __future__ import annotations

import math

import numpy as np

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
