"""Numbers that describe a motion of samples at even times, joined by straight lines."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.scenario.raw_record import Floats

GRAVITY = 9.80665  # m/s^2, in the definition of the Arias intensity
SMOOTHING = 40.0  # b of Konno and Ohmachi (1998)
POINTS = 400  # frequencies at which the smoothed spectrum is looked at


def integrals(step: float, acceleration: Floats) -> tuple[Floats, Floats]:
    """Velocity [m/s] and displacement [m] at the samples (n,), from rest: exact for straight lines between them."""
    a, b = acceleration[:-1], acceleration[1:]
    velocity = np.concatenate([[0.0], np.cumsum(0.5 * step * (a + b))])
    displacement = np.concatenate([[0.0], np.cumsum(step * velocity[:-1] + step**2 * (2.0 * a + b) / 6.0)])
    return velocity, displacement


def predominant_period(acceleration: Floats, step: float) -> float:
    """Period [s] at which the Fourier amplitude spectrum is largest, smoothed after Konno and Ohmachi (1998); NaN for no motion.

    Their window (sin(b log10(f/fc)) / (b log10(f/fc)))^4 is as wide in the logarithm of the frequency everywhere, so that the
    period of a motion in a model's time is that of the prototype, scaled. Looked at from 2/T to Nyquist's frequency.
    """
    count = len(acceleration)
    size = 1 << math.ceil(math.log2(4 * count))
    amplitude = np.abs(np.fft.rfft(acceleration, size))[1:]
    frequency = np.fft.rfftfreq(size, step)[1:]
    if not amplitude.max() > 0.0:
        return math.nan
    centres = np.geomspace(min(2.0 / (step * count), 0.25 / step), 0.5 / step, POINTS)
    smooth = np.empty(POINTS)
    for k, centre in enumerate(centres):
        near = (frequency > centre * 10.0 ** (-3.0 / SMOOTHING)) & (frequency < centre * 10.0 ** (3.0 / SMOOTHING))
        weight = np.sinc(SMOOTHING / np.pi * np.log10(frequency[near] / centre)) ** 4
        smooth[k] = (weight * amplitude[near]).sum() / weight.sum()
    return 1.0 / float(centres[int(np.argmax(smooth))])


def arias_intensity(acceleration: Floats, step: float) -> float:
    """pi / (2 g) times the integral of the squared acceleration [m/s]."""
    return math.pi / (2.0 * GRAVITY) * float(_squares(acceleration, step)[-1])


def significant_duration(acceleration: Floats, step: float) -> float:
    """Time [s] in which the squared acceleration grows from 5 to 95 % of its integral; NaN for no motion."""
    grown = _squares(acceleration, step)
    if not grown[-1] > 0.0:
        return math.nan
    first, last = np.interp([0.05, 0.95], grown / grown[-1], step * np.arange(len(grown)))
    return float(last - first)


def _squares(acceleration: Floats, step: float) -> Floats:
    """Integral of the squared acceleration up to each sample; exact for straight lines."""
    a, b = acceleration[:-1], acceleration[1:]
    return np.concatenate([[0.0], np.cumsum(step / 3.0 * (a * a + a * b + b * b))])
