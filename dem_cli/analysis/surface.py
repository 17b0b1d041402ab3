"""Free surface of the fill, the grains in the air above it, and the shape of the surface in numbers.

The surface is the top outline of the fill: at each x the highest point of a disc there, the floor y = 0
where there is none. It is sampled at the middles of intervals no longer than SAMPLE mean radii and
averaged over each bin. A single level h thus stands for the area under the outline, which is what
"container width x mean surface height" needs: a flat bed of touching equal discs has its level at pi/4 r
above the centres of its top row.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dem_cli.analysis.clusters import joined_to_bed
from dem_cli.jit import kernel
from dem_cli.state import Bools, Contacts, Floats

NEAR = 0.1
"""Gap, in mean radii, below which a grain counts as joined to its neighbour or to the floor."""

SAMPLE = 1 / 32
"""Longest distance of two samples of the outline in mean radii."""

COLUMN = 16
"""Samples in a column, about half a mean radius, by which hidden grains are told."""


@dataclass(frozen=True)
class Surface:
    """eta [m]: mean height of the outline in each bin, shape (bins,). fill: grains of the fill, airborne:
    grains above it that touch nothing joined to it, shape (n,); the rest have escaped.
    """

    eta: Floats
    fill: Bools
    airborne: Bools


def bin_centers(width: float, bins: int) -> Floats:
    """Middle of each bin of the surface [m], shape (bins,)."""
    return np.asarray((np.arange(bins) + 0.5) * (width / bins), dtype=np.float64)


@kernel(inline=True)
def _samples(x, radius, spacing, count):  # type: ignore[no-untyped-def]
    """First sample within a disc and the one after the last; in range before they become integers."""
    first = max(0.0, math.ceil((x - radius) / spacing - 0.5))
    final = min(count - 1.0, math.floor((x + radius) / spacing - 0.5))
    return int(first), int(final) + 1


@kernel()
def _raise_outline(x, y, radius, member, spacing, top):  # type: ignore[no-untyped-def]
    """Raise heights `top` [m] at x = (k + 1/2) spacing to the discs with member = True; modified in place.

    Discs below the centre of one that spans a whole column of samples are hidden there and passed over.
    """
    count = len(top)
    high = np.full(count // COLUMN + 1, -np.inf)
    for k in range(len(x)):
        if member[k]:
            first, end = _samples(x[k], radius[k], spacing, count)
            for c in range((first + COLUMN - 1) // COLUMN, end // COLUMN):
                high[c] = max(high[c], y[k])
    for k in range(len(x)):
        if not member[k]:
            continue
        cx, cy, r = x[k], y[k], radius[k]
        first, end = _samples(cx, r, spacing, count)
        for c in range(first // COLUMN, (end - 1) // COLUMN + 1):
            if high[c] >= cy + r:
                continue
            for s in range(max(first, c * COLUMN), min(end, (c + 1) * COLUMN)):
                d = (s + 0.5) * spacing - cx
                # below zero by rounding at most
                top[s] = max(top[s], cy + math.sqrt(abs(r * r - d * d)))


def find_surface(
    x: Floats, y: Floats, radius: Floats, present: Bools, contacts: Contacts, width: float, bins: int
) -> Surface:
    """Surface of the grains with present = True (in the container) between x = 0 and `width` [m]; arrays
    of shape (n,).

    A grain is of the fill if it is joined to the bed by contacts and gaps below NEAR mean radii
    (`joined_to_bed`), or if its centre lies below the outline of the joined ones: a loose grain in a pore
    is no airborne one.
    """
    if not present.any():
        none = np.zeros(len(x), dtype=bool)
        return Surface(np.zeros(bins), none, none)
    mean_radius = float(radius[present].mean())
    fill = joined_to_bed(x, y, radius, present, contacts.i, contacts.j, NEAR * mean_radius)
    per_bin = math.ceil(width / bins / (SAMPLE * mean_radius))
    spacing = width / (bins * per_bin)
    top = np.zeros(bins * per_bin)
    _raise_outline(x, y, radius, fill, spacing, top)
    loose = np.flatnonzero(present & ~fill)
    if len(loose):
        place = np.clip(x[loose] / spacing, 0, len(top) - 1).astype(np.int64)
        covered = np.zeros(len(x), dtype=bool)
        covered[loose[y[loose] < top[place]]] = True
        _raise_outline(x, y, radius, covered, spacing, top)
        fill = fill | covered
    return Surface(top.reshape(bins, per_bin).mean(axis=1), fill, present & ~fill)


def mean_depth(eta: Floats) -> float:
    """Mean height of the surface [m]."""
    return float(eta.mean())


def roughness(eta: Floats) -> float:
    """Standard deviation [m] of the surface about its straight line of best fit."""
    t = np.arange(len(eta)) - 0.5 * (len(eta) - 1)
    squares = float(t @ t)
    slope = float(t @ eta) / squares if squares > 0.0 else 0.0
    return float(np.std(eta - slope * t))


def antisymmetric_mode(eta: Floats) -> float:
    """Amplitude a1 = (2/l) integral of eta cos(pi x/l) dx [m] of the first antisymmetric mode over the
    width l.

    A mean over a bin flattens the mode by sin(q)/q, q = pi/(2 bins), which is undone: eta = a cos(pi x/l)
    gives a.
    """
    bins = len(eta)
    shape = np.cos(np.pi * (np.arange(bins) + 0.5) / bins)
    return float(2.0 / bins * (eta @ shape) / np.sinc(0.5 / bins))
