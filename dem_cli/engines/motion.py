"""Body force and ground motion of a stage: gravity, and the inertia of a container that is shaken."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from dem_cli.scenario import ImpulseSettle, Run, Scenario, Settle, Shake
from dem_cli.scenario.motion_facts import integrals
from dem_cli.state import Bools, Floats, Ints

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
        """The shaking that a stage with amplitude and frequency asks for."""
        assert stage.amplitude is not None
        assert stage.frequency is not None
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


@dataclass(frozen=True)
class Recorded:
    """Ground acceleration given by samples (n, 2) [m/s^2] every `interval` [s] from `begin` [s] on, begun at rest.

    Straight lines between the samples, nothing before the first and behind the last. Velocity and displacement are their closed
    integrals in each interval, so the three always belong together, whatever the time step.
    """

    interval: float
    begin: float
    samples: Floats

    moves = True

    @classmethod
    def of(cls, stage: Shake) -> Recorded:
        """The motion of a stage whose record has been read, turned into the stage's direction."""
        motion = stage.motion
        assert motion is not None
        c, s = np.cos(stage.angle), np.sin(stage.angle)
        return cls(motion.interval, motion.begin, motion.acceleration @ np.array([[c, s], [-s, c]]))

    def acceleration(self, time: Floats) -> Floats:
        """(t, 2) [m/s^2]."""
        k, rest, inside = self._place(np.asarray(time, dtype=np.float64))
        share = (rest / self.interval)[:, None]
        between = (1.0 - share) * self.samples[k] + share * self.samples[k + 1]
        return np.asarray(np.where(inside[:, None], between, 0.0))

    def _place(self, time: Floats) -> tuple[Ints, Floats, Bools]:
        """Interval that a time lies in, time since its start [s], and whether the record goes on then."""
        since = time - self.begin
        last = len(self.samples) - 2
        end = (last + 1) * self.interval
        # Sums of time steps meet the ends of the record to rounding.
        tiny = 1e-9 * self.interval
        k = np.clip(np.floor((since + tiny) / self.interval), 0, last).astype(np.int64)
        rest = np.clip(since - k * self.interval, 0.0, self.interval)
        return k, rest, (since >= -tiny) & (since <= end + tiny)

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        """Velocities and displacements (n, 2) at the samples."""
        both = [integrals(self.interval, self.samples[:, axis]) for axis in (0, 1)]
        return np.stack([v for v, _ in both], axis=1), np.stack([d for _, d in both], axis=1)

    def motion(self, time: float) -> Floats:
        """(3, 2) at a time [s] of the stage."""
        velocity, place = self._table
        since = time - self.begin
        end = (len(self.samples) - 1) * self.interval
        acceleration = self.acceleration(np.array([time]))[0]
        if since <= 0.0:
            return np.array([np.zeros(2), np.zeros(2), acceleration])
        if since >= end:  # it goes on as the record leaves it
            return np.array([place[-1] + velocity[-1] * (since - end), velocity[-1], acceleration])
        k, rest, _ = (one[0] for one in self._place(np.array([time])))
        slope = (self.samples[k + 1] - self.samples[k]) / self.interval
        v = velocity[k] + (self.samples[k] + 0.5 * slope * rest) * rest
        x = place[k] + (velocity[k] + (0.5 * self.samples[k] + slope * rest / 6.0) * rest) * rest
        return np.array([x, v, acceleration])


def ground_of(stage: Settle | ImpulseSettle | Shake | Run) -> Ground:
    """What the container does in a stage."""
    if not isinstance(stage, Shake):
        return Still()
    return SineShaking.of(stage) if stage.record is None else Recorded.of(stage)


def _integral(x: Floats, y: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(x))])


def gravity_of(scenario: Scenario) -> Floats:
    """Acceleration of gravity, (2,) [m/s^2]."""
    angle, size = scenario.container.gravity_direction, scenario.container.gravity
    # The cosine of -90 degrees is 6e-17 and would push every grain sideways.
    return np.array([size * round(math.cos(angle), 15), size * round(math.sin(angle), 15)])
