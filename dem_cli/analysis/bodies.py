"""Grains of one or more elements: where they begin, their centres of mass and their areas; the outlines of elements."""

from __future__ import annotations

import numpy as np

from dem_cli.analysis.covered import grain_areas
from dem_cli.state import Bools, Floats, Grains, Ints


def single(grains: Grains) -> bool:
    """Whether each grain is one element."""
    return grains.grain_count == len(grains)


def first_elements(grains: Grains) -> Ints:
    """Index of the first element of each grain, shape (grains,)."""
    return np.flatnonzero(np.diff(grains.body, prepend=-1))


def whole(grains: Grains, flag: Bools) -> Bools:
    """Which elements belong to a grain all of whose elements have the flag, shape (n,)."""
    if single(grains):
        return flag
    return np.asarray(np.logical_and.reduceat(flag, first_elements(grains))[grains.body])


def centres(grains: Grains) -> tuple[Floats, Floats]:
    """Centre of mass x, y [m] of the grain that each element belongs to, shape (n,) each."""
    if single(grains):
        return grains.x, grains.y
    body, mass = grains.body, grains.mass
    total = np.bincount(body, mass)
    x, y = (np.bincount(body, mass * place) / total for place in (grains.x, grains.y))
    return x[body], y[body]


def areas(grains: Grains) -> Floats:
    """Area [m^2] of each grain, shape (grains,), what its discs share counted once; an ellipse has pi a b."""
    if single(grains):
        return np.pi * grains.radius**2
    return np.asarray(grain_areas(grains.x, grains.y, grains.radius, *outlines(grains), grains.body))


def outlines(grains: Grains) -> tuple[Floats, Floats, Floats]:
    """m, p, q [m^2] of each element, shape (n,) each, as `geometry.ellipse.outline`; p = q = 0 for discs and for them only.

    The outline reaches sqrt(m + p) to either side and sqrt(m - p) up and down: for discs the radius to the last digit.
    """
    a, b = grains.a, grains.b
    if np.array_equal(a, b):
        return a * a, np.zeros(len(a)), np.zeros(len(a))
    half = 0.5 * (a - b) * (a + b)
    return 0.5 * (a * a + b * b), half * np.cos(2.0 * grains.angle), half * np.sin(2.0 * grains.angle)
