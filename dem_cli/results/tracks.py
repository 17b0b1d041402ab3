"""Tracks of chosen grains: place, turn and velocity of each, whatever number of elements it has."""

from __future__ import annotations

import numpy as np

from dem_cli.results.schema import TRACKS
from dem_cli.state import Floats, Grains, Ints


class GrainTracks:
    """What `grains` (numbers of grains) do, one call an instant; shape (g,) each.

    A grain of one element is tracked as it is, bit for bit. One of several is where its centre of mass is; it turns by the angle that
    best fits its elements' centres to where they were at the start, tan = sum m r0 x r / sum m r0 . r, counted on over full turns (at
    most half a turn between two calls) from the first element's angle, and spins at sum m r x v / sum m r^2. Both are those of the
    body where it is rigid; elements that only roll on each other do not turn the grain.
    """

    def __init__(self, grains: Ints, start: Grains) -> None:
        ends = np.searchsorted(start.body, grains + 1)
        self._elements = [np.arange(a, b) for a, b in zip(np.searchsorted(start.body, grains), ends, strict=True)]
        self._several = [k for k, elements in enumerate(self._elements) if len(elements) > 1]
        self._first = np.array([elements[0] for elements in self._elements], dtype=np.int64)
        self._arms = {k: _arms(start, self._elements[k]) for k in self._several}
        self._turn = dict.fromkeys(self._several, 0.0)
        self._angle = start.angle[self._first].copy()

    def row(self, grains: Grains) -> list[Floats]:
        """Values in the order of schema.TRACKS without time."""
        found = {name: getattr(grains, name)[self._first] for name in TRACKS}
        for k in self._several:
            elements = self._elements[k]
            m = grains.mass[elements]
            for name in ("x", "y", "vx", "vy"):
                found[name][k] = m @ getattr(grains, name)[elements] / m.sum()
            inertia, arms = float(m @ np.sum(self._arms[k] ** 2, axis=1)), _arms(grains, elements)
            if not inertia > 0.0:
                continue  # all centres in one place: any element shows how the grain turns
            found["angle"][k] = self._angle[k] + self._turned(k, m, arms)
            vx, vy = grains.vx[elements] - found["vx"][k], grains.vy[elements] - found["vy"][k]
            found["spin"][k] = m @ (arms[:, 0] * vy - arms[:, 1] * vx) / float(m @ np.sum(arms**2, axis=1))
        return [found[name] for name in TRACKS]

    def _turned(self, k: int, m: Floats, arms: Floats) -> float:
        """Turn [rad] of grain k since the start."""
        before = self._arms[k]
        sine = m @ (before[:, 0] * arms[:, 1] - before[:, 1] * arms[:, 0])
        turn = float(np.arctan2(sine, m @ np.sum(before * arms, axis=1)))
        self._turn[k] += float(np.remainder(turn - self._turn[k] + np.pi, 2.0 * np.pi)) - np.pi
        return self._turn[k]


def _arms(grains: Grains, elements: Ints) -> Floats:
    """From the centre of mass to the centres of `elements`, shape (k, 2) [m]."""
    places = np.stack([grains.x[elements], grains.y[elements]], axis=1)
    mass = grains.mass[elements]
    return np.asarray(places - mass @ places / mass.sum())
