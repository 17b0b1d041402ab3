"""Body force and ground motion of a stage: gravity, and the inertia of a container that is shaken."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from dem_cli.scenario import Scenario, Shake
from dem_cli.state import Floats

SAMPLES_PER_CYCLE = 400


class Ground(Protocol):
    """Motion of the container over a stage, time counted from its start."""

    moves: bool

    def acceleration(self, time: Floats) -> Floats:
        """Acceleration (t, 2) [m/s^2] at the times (t,) [s]."""

    def motion(self, time: float) -> Floats:
        """Displacement, velocity and acceleration since the start of the stage, shape (3, 2)."""


class Still:
    """A container at rest."""

    moves = False

    def acceleration(self, time: Floats) -> Floats:
        """Zero, (t, 2)."""
        return np.zeros((len(time), 2))

    def motion(self, time: float) -> Floats:
        """Zero, (3, 2)."""
        del time
        return np.zeros((3, 2))


@dataclass(frozen=True)
class SineShaking:
    """Ground acceleration A r(t) sin(2 pi f t) along a direction; r rises from 0 to 1 over the ramp and falls so at the end.

    The velocity at the start is the one that leaves no drift over a cycle between the ramps (-A/(2 pi f) without ramp): the
    grains, seen from the container, do not know the difference, and the ground stays in place as on a shaking table.
    """

    amplitude: float
    frequency: float
    duration: float
    ramp: float
    direction: Floats

    moves = True

    @classmethod
    def of(cls, stage: Shake) -> SineShaking:
        """The shaking that a stage asks for."""
        direction = np.array([np.cos(stage.angle), np.sin(stage.angle)])
        return cls(stage.amplitude, stage.frequency, stage.longest, stage.ramp, direction)

    def _scalar(self, time: Floats) -> Floats:
        wave = self.amplitude * np.sin(2.0 * np.pi * self.frequency * time)
        if self.ramp > 0.0:
            wave = wave * np.clip(np.minimum(time, self.duration - time) / self.ramp, 0.0, 1.0)
        return np.asarray(wave)

    def acceleration(self, time: Floats) -> Floats:
        """(t, 2) [m/s^2]."""
        return self._scalar(time)[:, None] * self.direction

    @cached_property
    def _table(self) -> tuple[Floats, Floats, Floats]:
        """Times, displacements and velocities by the trapezoidal rule on SAMPLES_PER_CYCLE points a cycle."""
        step = 1.0 / self.frequency / SAMPLES_PER_CYCLE
        grid: Floats = np.arange(max(math.ceil(self.duration / step), SAMPLES_PER_CYCLE) + 1, dtype=np.float64) * step
        velocity = _integral(grid, self._scalar(grid))
        middle = (len(grid) - 1 - SAMPLES_PER_CYCLE) // 2  # a whole cycle, where the ramps are over
        cycle = velocity[middle : middle + SAMPLES_PER_CYCLE + 1]
        velocity = velocity - 0.5 * (cycle[1:] + cycle[:-1]).mean()
        return grid, _integral(grid, velocity), velocity

    def motion(self, time: float) -> Floats:
        """(3, 2) at a time [s] of the stage."""
        grid, place, velocity = self._table
        now = (np.interp(time, grid, place), np.interp(time, grid, velocity), self._scalar(np.array([time]))[0])
        return np.array(now)[:, None] * self.direction


def _integral(x: Floats, y: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(x))])


def gravity_of(scenario: Scenario) -> Floats:
    """Acceleration of gravity, (2,) [m/s^2]."""
    angle, size = scenario.container.gravity_direction, scenario.container.gravity
    # The cosine of -90 degrees is 6e-17 and would push every grain sideways.
    return np.array([size * round(math.cos(angle), 15), size * round(math.sin(angle), 15)])
