"""Sloshing: periods that theory gives a liquid of the same depth, and the period found in the motion of
the surface.

A liquid's formula is a reference line for a granular bed, no prediction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dem_cli.state import Bools, Floats

QUIET = 0.02
"""Amplitude of the surface mode, in mean radii, below which the surface counts as still."""

FALSE_ALARM = 0.01
"""Chance that white noise alone is taken for a period."""

_STEADY = 0.5
"""Share of a record, at its end, that counts as steady, if it holds _STEADY_PERIODS."""

_STEADY_PERIODS = 2

_SIDELOBE = 1 / 300
"""Share of the strongest power below which a peak may be a side lobe of the Hann window (these stay below
1/1300).
"""

_PADDING = 8
LEAST_SAMPLES = 16


def theory_period(mode: int, width: float, depth: float, gravity: float) -> float:
    """Period [s] of sloshing mode 1, 2, ... by linear theory: omega_n^2 = (n pi g/l) tanh(n pi h/l); NaN
    without depth.

    width l, depth h [m], gravity g [m/s^2].
    """
    k = mode * math.pi / width
    return _period(gravity * k * math.tanh(k * depth))


def thesis_period(width: float, depth: float, gravity: float) -> float:
    """First period [s] as the thesis prints it, (7.2): T = 2 pi [pi g tanh(2 pi h/l)/l]^(-1/2).

    Its tanh holds 2 pi h/l where linear theory has pi h/l; kept to stand beside `theory_period`.
    """
    return _period(math.pi * gravity * math.tanh(2.0 * math.pi * depth / width) / width)


def _period(omega_squared: float) -> float:
    return 2.0 * math.pi / math.sqrt(omega_squared) if omega_squared > 0.0 else math.nan


@dataclass(frozen=True)
class SurfacePeriod:
    """What a record of the surface mode holds. NaN where nothing was found; `reason` then says why, else
    it is empty.

    period [s] and amplitude [m] of the strongest oscillation; resolution [Hz]: 1/T of the record; ratio:
    period over driving period; is_driving: the two frequencies differ by no more than the resolution.
    free_period [s] and free_amplitude [m]: the strongest oscillation beside the driving one and its
    harmonics.
    """

    period: float = math.nan
    amplitude: float = math.nan
    resolution: float = math.nan
    ratio: float = math.nan
    is_driving: bool = False
    free_period: float = math.nan
    free_amplitude: float = math.nan
    reason: str = ""

    @property
    def period_resolution(self) -> float:
        """The resolution as a difference of periods [s]: T^2 times that of the frequency."""
        return self.period**2 * self.resolution


def surface_period(
    time: Floats, mode: Floats, *, mean_radius: float, driving_period: float | None = None
) -> SurfacePeriod:
    """Period of the surface motion from its mode amplitude [m] at rising times [s], shape (samples,) each.

    The record is brought to even times, freed of its straight line and windowed (Hann); the peak of its
    spectrum is interpolated by a parabola through the logarithms. A peak counts if the record holds two
    of its periods or more, its amplitude reaches QUIET mean radii and it stands above noise
    (FALSE_ALARM). Two oscillations closer than 2/T are seen as one.
    """
    finite = np.isfinite(mode)
    time, mode = time[finite], mode[finite]
    if len(time) < LEAST_SAMPLES:
        return SurfacePeriod(reason=f"fewer than {LEAST_SAMPLES} samples of the surface")
    even, signal = _even(time, mode)
    length, count = float(time[-1] - time[0]), len(even)
    resolution = 1.0 / length
    nyquist = 0.5 * (count - 1) / length
    driving = 1.0 / driving_period if driving_period else math.nan
    if length * driving < 2.0:
        text = f"the record of {length:.3g} s is shorter than two driving periods of {driving_period:.3g} s"
        return SurfacePeriod(resolution=resolution, reason=text)
    if driving >= nyquist:
        interval = length / (count - 1)
        text = f"sampled every {interval:.3g} s, too seldom for the driving period of {driving_period:.3g} s"
        return SurfacePeriod(resolution=resolution, reason=text)

    least = QUIET * mean_radius
    frequency, amplitude, reason = _strongest(even, signal, least, math.nan)
    is_driving = abs(frequency - driving) <= resolution
    free, free_amplitude = frequency, amplitude
    if is_driving:
        rest = _detrended(even, signal, driving)
        free, free_amplitude, _ = _strongest(even, rest, least, driving)
    return SurfacePeriod(
        period=1.0 / frequency,
        amplitude=amplitude,
        resolution=resolution,
        ratio=driving / frequency,
        is_driving=is_driving,
        free_period=1.0 / free,
        free_amplitude=free_amplitude,
        reason=reason,
    )


def amplitude_spectrum(time: Floats, mode: Floats) -> tuple[Floats, Floats]:
    """Frequencies [Hz] from 0 on and amplitudes [m] of a record of the surface mode [m] at rising times [s], shape (samples,) each.

    As `surface_period` looks at it: at even times, without its straight line, Hann window, padded by zeros, so that a sine has a peak as
    high as its amplitude. Both empty for fewer than LEAST_SAMPLES finite samples.
    """
    finite = np.isfinite(mode)
    time, mode = time[finite], mode[finite]
    if len(time) < LEAST_SAMPLES:
        return np.zeros(0), np.zeros(0)
    even, signal = _even(time, mode)
    window = np.hanning(len(even))
    size = _PADDING * len(even)
    amplitude = np.asarray(2.0 * np.abs(np.fft.rfft(signal * window, size)) / window.sum(), dtype=np.float64)
    frequency = np.fft.rfftfreq(size, float(even[-1] - even[0]) / (len(even) - 1))
    return np.asarray(frequency, dtype=np.float64), amplitude


def _even(time: Floats, mode: Floats) -> tuple[Floats, Floats]:
    """Even times [s] over the same span, and the record at them less its straight line."""
    length = float(time[-1] - time[0])
    count = 1 + max(LEAST_SAMPLES, round(length / float(np.median(np.diff(time)))))
    even = np.linspace(time[0], time[-1], count)
    return even, _detrended(even, np.interp(even, time, mode))


@dataclass(frozen=True)
class DrivenMotion:
    """Oscillation at the driving frequency in the steady part of a record. NaN where it cannot be told; `reason` then says why.

    amplitude [m]; rest [m]: root mean square of what else moves there, a straight line apart; start, end [s] of the steady part,
    and the whole driving periods in it.
    """

    amplitude: float = math.nan
    rest: float = math.nan
    start: float = math.nan
    end: float = math.nan
    periods: int = 0
    reason: str = ""


def driven_motion(time: Floats, mode: Floats, driving_period: float, ramp: float = 0.0) -> DrivenMotion:
    """Amplitude [m] at the driving frequency of the surface mode [m] at rising times [s], shape (samples,) each.

    The steady part is the second half of the record, but two driving periods at least, cut to whole periods at its start;
    the shaking's `ramp` [s] is left out at both ends. There a straight line and a sine are fitted by least squares.
    """
    finite = np.isfinite(mode)
    time, mode = time[finite], mode[finite]
    if len(time) < LEAST_SAMPLES:
        return DrivenMotion(reason=f"fewer than {LEAST_SAMPLES} samples of the surface")
    first, end = float(time[0]) + ramp, float(time[-1]) - ramp
    tiny = 1e-6 * driving_period
    periods = max(int((_STEADY * (end - first) + tiny) / driving_period), _STEADY_PERIODS)
    start = end - periods * driving_period
    if start < first + driving_period - tiny:
        text = f"shaken for less than {_STEADY_PERIODS + 1} driving periods of {driving_period:.3g} s"
        return DrivenMotion(reason=text)
    inside = (time >= start - tiny) & (time <= end + tiny)
    samples = int(np.count_nonzero(inside))
    if samples < 2.5 * periods or samples < LEAST_SAMPLES:
        return DrivenMotion(reason=f"sampled too seldom for the driving period of {driving_period:.3g} s")
    fit, rest = _fitted(time[inside], mode[inside], 1.0 / driving_period)
    return DrivenMotion(float(np.hypot(fit[2], fit[3])), float(np.sqrt(np.mean(rest**2))), start, end, periods)


def _detrended(time: Floats, signal: Floats, frequency: float | None = None) -> Floats:
    """The signal less its straight line and its oscillation at `frequency` [Hz], by least squares."""
    return _fitted(time, signal, frequency)[1]


def _fitted(time: Floats, signal: Floats, frequency: float | None) -> tuple[Floats, Floats]:
    """Level, slope and, with a `frequency` [Hz], cosine and sine that fit the signal best, and what is left of it."""
    t = time - time.mean()
    columns = [np.ones_like(t), t]
    if frequency is not None:
        columns += [np.cos(2.0 * np.pi * frequency * t), np.sin(2.0 * np.pi * frequency * t)]
    basis = np.stack(columns, axis=1)
    fit: Floats = np.linalg.lstsq(basis, signal, rcond=None)[0]
    return fit, signal - basis @ fit


def _strongest(time: Floats, signal: Floats, least: float, avoid: float) -> tuple[float, float, str]:
    """Frequency [Hz] and amplitude [m] of the strongest peak of an evenly sampled record, or NaN and a
    reason.

    least [m]: smallest amplitude that counts. avoid [Hz]: frequency to keep away from by 2/T, as from its
    multiples.
    """
    length = float(time[-1] - time[0])
    window = np.hanning(len(time))
    size = _PADDING * len(time)
    power = np.abs(np.fft.rfft(signal * window, size)) ** 2
    frequency = np.fft.rfftfreq(size, length / (len(time) - 1))
    if 2.0 * math.sqrt(power.max()) / window.sum() < least:
        return math.nan, math.nan, f"the surface is still: its mode stays below {QUIET} mean radii"

    band = frequency >= 2.0 / length
    if math.isfinite(avoid):
        harmonic = np.maximum(1.0, np.round(frequency / avoid)) * avoid
        band &= np.abs(frequency - harmonic) >= 2.0 / length
    peaks = _local_maxima(power) & band
    significant = peaks & (power >= _noise_level(power, len(time)))
    significant &= (2.0 * np.sqrt(power) / window.sum() >= least) & (power >= _SIDELOBE * power.max())
    if not significant.any():
        text = "no period stands out: noise, or motion slower than half the record"
        return math.nan, math.nan, text
    top = int(np.argmax(np.where(significant, power, 0.0)))
    low, mid, high = np.log(power[top - 1 : top + 2])
    shift = 0.5 * (low - high) / (low - 2.0 * mid + high)
    found = float(frequency[top] + shift * frequency[1])
    wave = np.exp(-2j * np.pi * found * time)
    return found, float(2.0 * abs((signal * window) @ wave) / window.sum()), ""


def _local_maxima(power: Floats) -> Bools:
    inner = (power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])
    return np.concatenate([[False], inner, [False]])


def _noise_level(power: Floats, samples: int) -> float:
    """Power that the largest of samples/2 bins of white noise exceeds with a chance of FALSE_ALARM.

    Each bin is exponential with the mean median / log 2.
    """
    return float(np.median(power)) / math.log(2.0) * math.log(0.5 * samples / FALSE_ALARM)
