"""From records to the motion of the ground: cutting, resampling, baseline correction, scaling, and what there is to tell of it.

Order: time scale, cut (start, duration), resampling, taper and baseline, scaling to the peak, rest before and after. Between the
samples the acceleration is a straight line, so that velocity and displacement are closed forms (`integrals`), without drift of
their own.

Baseline: a = w (raw - c0 P0 - c1 P1 - ...) with Legendre polynomials P over the record and the taper w. The coefficients make the
velocity at the end zero, from "linear" on also the displacement, and what is left free ("quadratic") makes the sum of the squared
velocities least, as in the parabolic correction of Berg and Housner (1961). The conditions are those of the motion as it is
used, taper, cut and straight lines included; so they hold to rounding.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dem_cli.scenario.motion_facts import arias_intensity, integrals, predominant_period, significant_duration
from dem_cli.scenario.raw_record import FEWEST, Floats, RawRecord, RecordError
from dem_cli.scenario.record_formats import read_record
from dem_cli.scenario.records import Component, Record

DEGREES = {"none": -1, "mean": 0, "linear": 1, "quadratic": 2}
LOBES = 24  # of the kernel of resampling, on each side
BETA = 9.0  # of its Kaiser window: side lobes below -90 dB
PASSED = 0.88  # share of the new Nyquist frequency at which a coarser sampling halves the amplitude


@dataclass(frozen=True)
class ComponentFacts:
    """What there is to tell of one component; SI units.

    recorded_*: of the file, peak counted from the instrument's zero. residual_*_before: at the end of the cut record as it is;
    residual_*: of the used motion, peaks and largest values too. predominant_period, arias [m/s], significant_duration (5 to 95 % of
    the Arias intensity): of the used motion.
    """

    name: str
    format: str
    component: str
    understood: str
    recorded_samples: int
    recorded_interval: float
    recorded_duration: float
    recorded_peak: float
    factor: float
    peak: float
    peak_velocity: float
    peak_displacement: float
    residual_velocity_before: float
    residual_displacement_before: float
    residual_velocity: float
    residual_displacement: float
    predominant_period: float
    arias: float
    significant_duration: float


@dataclass(frozen=True, eq=False)
class GroundMotion:
    """The motion of a stage. acceleration (n, 2) [m/s^2] along the stage's angle and at right angles to it, every `interval` [s]
    from `begin` [s] on; zero before and behind. duration [s]: of the stage. components: one or two."""

    interval: float
    begin: float
    duration: float
    baseline: str
    acceleration: Floats
    components: tuple[ComponentFacts, ...]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, GroundMotion) or self.facts() != other.facts():
            return False
        return bool(np.array_equal(self.acceleration, other.acceleration))

    def __hash__(self) -> int:
        return hash(self.acceleration.tobytes())

    def facts(self) -> dict[str, Any]:
        """What there is to tell, as plain data; None where something is not defined."""
        shared = {"interval": self.interval, "begin": self.begin, "duration": self.duration, "baseline": self.baseline}
        told = [{k: None if v != v else v for k, v in asdict(one).items()} for one in self.components]
        return {**shared, "components": told}


def ground_motion(record: Record, duration: float | None, folder: Path) -> GroundMotion:
    """The motion that a stage asks for. duration [s]: of the stage, None: that of the record and its rest.

    RecordError: a file that cannot be used, or a key that does not fit it.
    """
    wanted: list[Component] = [record] if record.second is None else [record, record.second]
    raws = [_read(one, one.file or record.file, folder, ("", "second.")[k]) for k, one in enumerate(wanted)]
    steps = [raw.interval * record.time_scale for raw in raws]
    step = record.resample or min(steps)
    room = math.inf if duration is None else duration - 2.0 * record.pad
    cuts = [
        _cut(raw, own, step, record, room, ("", "second.")[k])
        for k, (raw, own) in enumerate(zip(raws, steps, strict=True))
    ]
    count = max(map(len, cuts))
    motions = []
    for k, cut in enumerate(cuts):
        prefix = ("", "second.")[k]
        window = _window(len(cut), count, step, record.taper)
        before = np.concatenate([cut, np.zeros(count - len(cut))])
        motions.append((before, _corrected(before, window, step, DEGREES[record.baseline], prefix)))
    factors = _factors(wanted, [used for _, used in motions])
    used = [factor * a for factor, (_, a) in zip(factors, motions, strict=True)]
    facts = tuple(
        _facts(raw, before, a, factor, step)
        for raw, (before, _), a, factor in zip(raws, motions, used, factors, strict=True)
    )
    columns = used if len(used) == 2 else [used[0], np.zeros(count)]
    whole = 2.0 * record.pad + step * (count - 1) if duration is None else duration
    return GroundMotion(step, record.pad, whole, record.baseline, np.stack(columns, axis=1), facts)


def _read(one: Component, file: str, folder: Path, prefix: str) -> RawRecord:
    try:
        return read_record(folder / file, one.format, column=one.column, unit=one.unit, interval=one.interval)
    except RecordError as error:
        raise RecordError(error.rule, error.remedy, prefix + error.key) from None


def _cut(raw: RawRecord, own: float, step: float, record: Record, room: float, prefix: str) -> Floats:
    """Samples from `record.start` on, every `step` [s], as many as have room [s]. own: interval of the record [s]."""
    first = round(record.start / raw.interval)
    left = len(raw.acceleration) - first
    if left < FEWEST:
        rule = f"leaves nothing of {raw.name}, which lasts {raw.duration:g} s"
        raise RecordError(rule, "Begin earlier", "start")
    values = raw.acceleration[first:]
    if abs(step - own) > 1e-9 * own:
        values = resampled(values, own, step)
    if math.isfinite(room):
        values = values[: max(math.floor(room / step * (1.0 + 1e-12) + 1e-9) + 1, 0)]
    if len(values) < FEWEST:
        rule = f"leaves {len(values)} samples, every {step:g} s, of {raw.name}"
        raise RecordError(rule, "Give the stage a longer duration, or sample more finely", prefix + "file")
    if 2.0 * record.taper > step * (len(values) - 1) * (1.0 + 1e-9):
        rule = f"is longer than half of the motion, which lasts {step * (len(values) - 1):g} s"
        raise RecordError(rule, "Shorten the taper", "taper")
    return values


def resampled(values: Floats, old: float, new: float) -> Floats:
    """Samples (n,) every `old` [s] brought to every `new` [s], band-limited: convolved with a sinc under a Kaiser window.

    Finer sampling leaves the old samples as they are and puts between them what the frequencies below Nyquist's ask for; coarser
    sampling first takes out what lies above the new one. The ends are held, and constants stay what they are.
    """
    count = math.floor((len(values) - 1) * old / new * (1.0 + 1e-12) + 1e-9) + 1
    cut = 1.0 if new <= old else PASSED * old / new  # over the old Nyquist frequency
    reach = LOBES / cut
    places = np.arange(count) * (new / old)
    around = np.arange(-math.ceil(reach), math.ceil(reach) + 1)
    lags = np.linspace(0.0, reach + 1.0, 8193)  # the Bessel function takes long: from a table, to 1e-7
    kaiser = np.i0(BETA * np.sqrt(1.0 - (lags / lags[-1]) ** 2))
    out = np.empty(count)
    some = max(400_000 // len(around), 1)  # so that the table of neighbours stays small
    for begin in range(0, count, some):
        here = places[begin : begin + some]
        nearest = np.round(here).astype(np.int64)[:, None] + around
        away = here[:, None] - nearest
        weight = np.sinc(cut * away) * np.interp(np.abs(away), lags, kaiser)
        weight /= weight.sum(axis=1, keepdims=True)
        out[begin : begin + some] = np.sum(weight * values[np.clip(nearest, 0, len(values) - 1)], axis=1)
    return out


def _window(length: int, count: int, step: float, taper: float) -> Floats:
    """1 over the first `length` of `count` samples, faded in and out over `taper` [s] by half a cosine; 0 behind."""
    window = np.zeros(count)
    window[:length] = 1.0
    if taper > 0.0:
        time = step * np.arange(length)
        edge = np.clip(np.minimum(time, time[-1] - time) / taper, 0.0, 1.0)
        window[:length] = 0.5 * (1.0 - np.cos(np.pi * edge))
    return window


def _corrected(raw: Floats, window: Floats, step: float, degree: int, prefix: str) -> Floats:
    """raw (n,) under the window, less the polynomial of the docstring above."""
    motion = raw * window
    if degree < 0:
        return motion
    place = np.linspace(-1.0, 1.0, len(raw))
    basis = np.polynomial.legendre.legvander(place, degree).T * window
    moved = [integrals(step, one) for one in basis]
    velocities = np.array([v for v, _ in moved])
    span = step * (len(raw) - 1)
    ends = np.array([velocities[:, -1] / span, [d[-1] / span**2 for _, d in moved]])[: min(degree, 1) + 1]
    if np.linalg.matrix_rank(ends) < len(ends):
        raise RecordError("has too few samples for this baseline", 'Take baseline = "mean"', f"{prefix}file")
    solve = np.linalg.pinv(ends)

    def at_rest(moving: Floats) -> Floats:
        velocity, displacement = integrals(step, moving)
        left = np.array([velocity[-1] / span, displacement[-1] / span**2])[: len(ends)]
        return np.asarray(moving - (solve @ left) @ basis)

    motion = at_rest(motion)
    free = np.linalg.svd(ends)[2][len(ends) :]  # combinations that leave the ends as they are
    if len(free):
        velocity = integrals(step, motion)[0]
        motion = motion - np.linalg.lstsq((free @ velocities).T, velocity, rcond=None)[0] @ free @ basis
    return at_rest(motion)  # the rounding of what went before


def _factors(wanted: list[Component], motions: list[Floats]) -> list[float]:
    """Factor of each component: its own peak or scale, else that of the first."""
    factors: list[float] = []
    for k, (one, motion) in enumerate(zip(wanted, motions, strict=True)):
        peak = float(np.abs(motion).max())
        if one.peak is not None:
            if peak == 0.0:
                raise RecordError(
                    "cannot be reached: the record is zero", "Take another record", "second.peak" if k else "peak"
                )
            factors.append(one.peak / peak)
        else:
            factors.append(one.scale if one.scale is not None else (factors[0] if k else 1.0))
    return factors


def _facts(raw: RawRecord, before: Floats, used: Floats, factor: float, step: float) -> ComponentFacts:
    recorded = integrals(step, before)
    velocity, displacement = integrals(step, used)
    return ComponentFacts(
        name=raw.name,
        format=raw.format,
        component=raw.component,
        understood=raw.understood,
        recorded_samples=len(raw.acceleration),
        recorded_interval=raw.interval,
        recorded_duration=raw.duration,
        recorded_peak=raw.peak,
        factor=factor,
        peak=float(np.abs(used).max()),
        peak_velocity=float(np.abs(velocity).max()),
        peak_displacement=float(np.abs(displacement).max()),
        residual_velocity_before=float(recorded[0][-1]),
        residual_displacement_before=float(recorded[1][-1]),
        residual_velocity=float(velocity[-1]),
        residual_displacement=float(displacement[-1]),
        predominant_period=predominant_period(used, step),
        arias=arias_intensity(used, step),
        significant_duration=significant_duration(used, step),
    )
