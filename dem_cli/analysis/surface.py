"""Free surface of the fill, the grains in the air above it, and the shape of the surface in numbers.

The surface is the top outline of the fill: at each x the highest point of a disc or ellipse there, the floor y = 0
where there is none. It is sampled at the middles of intervals no longer than SAMPLE mean radii and
averaged over each bin. A single level h thus stands for the area under the outline, which is what
"container width x mean surface height" needs: a flat bed of touching equal discs has its level at pi/4 r
above the centres of its top row.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dem_cli.analysis.bodies import centres, outlines
from dem_cli.analysis.clusters import joined_to_bed
from dem_cli.jit import kernel
from dem_cli.state import Bools, Contacts, Floats, Grains

NEAR = 0.1
"""Gap, in mean radii of the elements, below which a grain counts as joined to its neighbour or to the floor."""

SAMPLE = 1 / 32
"""Longest distance of two samples of the outline in mean radii."""

COLUMN = 16
"""Samples in a column, about half a mean radius, by which hidden grains are told."""


@dataclass(frozen=True)
class Surface:
    """eta [m]: mean height of the outline in each bin, shape (bins,). fill: elements of grains of the fill, airborne:
    those of grains above it that touch nothing joined to it, shape (n,); the rest have escaped. A grain is of one kind as a whole.
    """

    eta: Floats
    fill: Bools
    airborne: Bools


def bin_centers(width: float, bins: int) -> Floats:
    """Middle of each bin of the surface [m], shape (bins,)."""
    return np.asarray((np.arange(bins) + 0.5) * (width / bins), dtype=np.float64)


@kernel(inline=True)
def _reach(radius, square):  # type: ignore[no-untyped-def]
    """Square root of m + p or m - p: for discs the radius, which is faster."""
    return radius if square == radius * radius else math.sqrt(square)


@kernel(inline=True)
def _samples(x, reach, spacing, count):  # type: ignore[no-untyped-def]
    """First sample within `reach` of x and the one after the last; in range before they become integers."""
    first = max(0.0, math.ceil((x - reach) / spacing - 0.5))
    final = min(count - 1.0, math.floor((x + reach) / spacing - 0.5))
    return int(first), int(final) + 1


@kernel()
def _raise_outline(x, y, radius, m, p, q, member, spacing, top):  # type: ignore[no-untyped-def]
    """Raise heights `top` [m] at x = (k + 1/2) spacing to the elements with member = True; modified in place.

    An ellipse reaches w = sqrt(m + p) to either side, and at the distance d from its centre up to q/w^2 d + a b/w^2 sqrt(w^2 - d^2):
    for discs sqrt(r^2 - d^2). Elements below the middle of one that spans a whole column of samples are hidden there and passed over.
    """
    count = len(top)
    high = np.full(count // COLUMN + 1, -np.inf)
    for k in range(len(x)):
        if member[k]:
            ww = m[k] + p[k]
            first, end = _samples(x[k], _reach(radius[k], ww), spacing, count)
            for c in range((first + COLUMN - 1) // COLUMN, end // COLUMN):
                low = y[k]
                if q[k] != 0.0:
                    left, right = (c * COLUMN + 0.5) * spacing, ((c + 1) * COLUMN - 0.5) * spacing
                    low += min(q[k] / ww * (left - x[k]), q[k] / ww * (right - x[k]))
                high[c] = max(high[c], low)
    for k in range(len(x)):
        if not member[k]:
            continue
        cx, cy, ww, highest = x[k], y[k], m[k] + p[k], y[k] + _reach(radius[k], m[k] - p[k])
        first, end = _samples(cx, _reach(radius[k], ww), spacing, count)
        for c in range(first // COLUMN, (end - 1) // COLUMN + 1):
            if high[c] >= highest:
                continue
            slope, height = q[k] / ww, radius[k] * radius[k] / ww
            for s in range(max(first, c * COLUMN), min(end, (c + 1) * COLUMN)):
                d = (s + 0.5) * spacing - cx
                # below zero by rounding at most
                top[s] = max(top[s], cy + slope * d + height * math.sqrt(abs(ww - d * d)))


def find_surface(grains: Grains, present: Bools, contacts: Contacts, width: float, bins: int) -> Surface:
    """Surface of the elements with present = True (in the container) between x = 0 and `width` [m]; shape (n,), the same for
    all elements of a grain.

    A grain is of the fill if it is joined to the bed by contacts and gaps below NEAR mean radii
    (`joined_to_bed`), or if its centre of mass lies below the outline of the joined ones: a loose grain in a pore
    is no airborne one.
    """
    if not present.any():
        none = np.zeros(len(grains), dtype=bool)
        return Surface(np.zeros(bins), none, none)
    mean_radius = float(grains.radius[present].mean())
    fill = joined_to_bed(grains, present, contacts.i, contacts.j, NEAR * mean_radius)
    per_bin = math.ceil(width / bins / (SAMPLE * mean_radius))
    spacing = width / (bins * per_bin)
    top = np.zeros(bins * per_bin)
    elements = (grains.x, grains.y, grains.radius, *outlines(grains))
    _raise_outline(*elements, fill, spacing, top)
    loose = np.flatnonzero(present & ~fill)
    if len(loose):
        x, y = (place[loose] for place in centres(grains))
        place = np.clip(x / spacing, 0, len(top) - 1).astype(np.int64)
        covered = np.zeros(len(fill), dtype=bool)
        covered[loose[y < top[place]]] = True
        _raise_outline(*elements, covered, spacing, top)
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
