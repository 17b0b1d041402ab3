"""Sloshing periods of theory and thesis, and the period found in synthetic surface motion."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dem_cli.analysis.sloshing import driven_motion, surface_period, theory_period, thesis_period

G = 9.80665
RADIUS = 7.5e-3


def record(length, *tones, interval=0.01, drift=0.0, noise=0.0, seed=0):
    """A record with tones (frequency, amplitude, phase), a linear drift and white noise."""
    t = 3.0 + np.arange(round(length / interval) + 1) * interval
    signal = 0.002 + drift * t + noise * np.random.default_rng(seed).standard_normal(len(t))
    for frequency, amplitude, phase in tones:
        signal = signal + amplitude * np.cos(2 * np.pi * frequency * t + phase)
    return t, signal


def test_printed_formula_of_the_thesis():
    # the thesis gives 1.85 s for these numbers, which is h/l
    assert pytest.approx(1.85, abs=0.005) == 2.25 / 1.215
    assert thesis_period(1.215, 2.25, G) == pytest.approx(1.248, abs=5e-4)


def test_theory_of_a_deep_and_a_shallow_liquid():
    deep = 2.0 * math.pi / math.sqrt(2 * math.pi * G / 1.5)
    assert theory_period(2, 1.5, 50.0, G) == pytest.approx(deep, rel=1e-12)
    # shallow: waves run at sqrt(g h), mode n has the wave length 2 l / n
    assert theory_period(3, 1.5, 1e-4, G) == pytest.approx(2 * 1.5 / 3 / math.sqrt(G * 1e-4), rel=1e-6)
    assert theory_period(1, 1.215, 2.25, G) == pytest.approx(1.248, abs=5e-4)
    # pi h/l where the thesis has 2 pi h/l: they differ at the depth that the thesis' grains really fill
    assert theory_period(1, 1.215, 0.549, G) == pytest.approx(1.323, abs=5e-4)
    assert thesis_period(1.215, 0.549, G) == pytest.approx(1.252, abs=5e-4)
    assert math.isnan(theory_period(1, 1.0, 0.0, G))


@pytest.mark.parametrize("frequency", [0.71, 1.0, 3.137, 10.0])
def test_a_tone_is_found_far_below_the_resolution(frequency):
    t, signal = record(10.0, (frequency, 0.02, 0.4), drift=1e-3)
    found = surface_period(t, signal, mean_radius=RADIUS)
    assert found.reason == ""
    assert 1.0 / found.period == pytest.approx(frequency, abs=0.01)
    assert found.amplitude == pytest.approx(0.02, rel=0.02)
    assert found.resolution == pytest.approx(0.1)
    assert found.period_resolution == pytest.approx(0.1 / frequency**2, rel=0.05)
    assert math.isnan(found.ratio)
    assert not found.is_driving


@pytest.mark.parametrize("driving", [0.02, 0.2])
def test_driving_and_free_mode_are_told_apart(driving):
    t, signal = record(20.0, (1.0, driving, 0.3), (0.74, 0.004, 1.1), noise=2e-4)
    found = surface_period(t, signal, mean_radius=RADIUS, driving_period=1.0)
    assert found.is_driving
    assert found.ratio == pytest.approx(1.0, abs=0.01)
    assert 1.0 / found.free_period == pytest.approx(0.74, abs=0.01)
    assert found.free_amplitude == pytest.approx(0.004, rel=0.1)


def test_free_mode_may_be_the_stronger_one():
    t, signal = record(20.0, (10.0, 0.003, 0.3), (0.74, 0.02, 1.1))
    found = surface_period(t, signal, mean_radius=RADIUS, driving_period=0.1)
    assert not found.is_driving
    assert found.ratio == pytest.approx(1 / 0.74 / 0.1, rel=0.01)
    assert (found.free_period, found.free_amplitude) == (found.period, found.amplitude)


def test_driving_alone_has_no_free_mode_beside_it():
    # harmonics and slow changes of the driven motion are no free oscillation
    t, signal = record(10.0, (2.0, 0.02, 0.0), (4.0, 0.004, 1.0))
    found = surface_period(t, signal, mean_radius=RADIUS, driving_period=0.5)
    assert found.is_driving
    assert math.isnan(found.free_period)
    assert math.isnan(found.free_amplitude)


@pytest.mark.parametrize(("offset", "same"), [(0.6, True), (1.6, False)])
def test_driving_is_told_within_the_resolution(offset, same):
    t, signal = record(10.0, (2.0 + 0.1 * offset, 0.02, 0.0))
    found = surface_period(t, signal, mean_radius=RADIUS, driving_period=0.5)
    assert found.is_driving is same


def test_noise_does_not_move_the_peak_far():
    for seed in range(5):
        t, signal = record(10.0, (1.2, 0.02, 0.0), noise=0.01, seed=seed)
        assert 1.0 / surface_period(t, signal, mean_radius=RADIUS).period == pytest.approx(1.2, abs=0.02)


def test_noise_alone_gives_no_period():
    found = 0
    for seed in range(40):
        t, signal = record(10.0, noise=0.01, seed=seed)
        result = surface_period(t, signal, mean_radius=RADIUS)
        assert math.isnan(result.period) == bool(result.reason)
        found += not math.isnan(result.period)
    # one false alarm in a hundred is allowed for
    assert found <= 2


def test_still_surface_gives_none_and_says_so():
    t, signal = record(10.0, (1.0, 1e-5, 0.0))
    found = surface_period(t, signal, mean_radius=RADIUS, driving_period=1.0)
    assert math.isnan(found.period)
    assert "still" in found.reason
    assert "still" in surface_period(t, 0.0 * signal, mean_radius=RADIUS).reason
    assert "still" in surface_period(t, 1e-3 * t, mean_radius=RADIUS).reason


def test_short_records_say_so():
    t, signal = record(1.5, (1.0, 0.02, 0.0))
    found = surface_period(t, signal, mean_radius=RADIUS, driving_period=1.0)
    assert math.isnan(found.period)
    assert "shorter than two driving periods" in found.reason
    assert found.resolution == pytest.approx(1 / 1.5)
    # without a driving period the motion itself is too slow for the record
    found = surface_period(t, signal, mean_radius=RADIUS)
    assert math.isnan(found.period)
    assert "slower than half the record" in found.reason
    for samples in (0, 1, 10):
        found = surface_period(t[:samples], signal[:samples], mean_radius=RADIUS)
        assert "fewer than" in found.reason


def test_coarse_sampling_of_the_driving_is_refused():
    t, signal = record(10.0, (8.0, 0.02, 0.0), interval=0.1)
    found = surface_period(t, signal, mean_radius=RADIUS, driving_period=0.125)
    assert math.isnan(found.period)
    assert "too seldom" in found.reason


def test_uneven_times_and_gaps_are_borne():
    t, signal = record(10.0, (1.2, 0.02, 0.0))
    extra = np.sort(np.append(t, [4.0021, 7.7777]))
    signal = np.interp(extra, t, signal)
    signal[50:53] = np.nan
    found = surface_period(extra, signal, mean_radius=RADIUS)
    assert 1.0 / found.period == pytest.approx(1.2, abs=0.01)


@pytest.mark.parametrize("frequency", [0.71, 1.3, 10.0])
def test_driven_amplitude_of_a_steady_record(frequency):
    t, signal = record(10.0, (frequency, 0.02, 0.4), (2.0 * frequency, 0.005, 1.0), drift=1e-3, noise=1e-4)
    found = driven_motion(t, signal, 1.0 / frequency)
    assert found.reason == ""
    assert found.amplitude == pytest.approx(0.02, rel=0.02)
    assert found.rest == pytest.approx(0.005 / math.sqrt(2.0), rel=0.05)
    assert found.periods == int(5.0 * frequency)
    assert found.end == pytest.approx(13.0)
    assert found.start == pytest.approx(13.0 - found.periods / frequency)


def test_what_dies_away_in_the_first_half_is_no_steady_motion():
    t, signal = record(20.0, (1.0, 0.01, 0.0))
    transient = 0.05 * np.exp(-(t - 3.0) / 1.0) * np.cos(2 * np.pi * 0.9 * t)
    assert driven_motion(t, signal + transient, 1.0).amplitude == pytest.approx(0.01, rel=1e-3)
    early = np.where(t < 13.0, 5.0 * signal, signal)
    assert driven_motion(t, early, 1.0).amplitude == pytest.approx(0.01, rel=0.02)


def test_ramps_are_left_out():
    t, signal = record(20.0, (2.0, 0.01, 0.0))
    ramp = np.clip(np.minimum(t - 3.0, 23.0 - t) / 4.0, 0.0, 1.0)
    found = driven_motion(t, 0.002 + (signal - 0.002) * ramp, 0.5, ramp=4.0)
    assert (found.start, found.end) == (pytest.approx(13.0), pytest.approx(19.0))
    assert found.amplitude == pytest.approx(0.01, rel=1e-6)


def test_another_frequency_is_no_driven_motion():
    t, signal = record(20.0, (0.74, 0.02, 1.1))
    assert driven_motion(t, signal, 0.1).amplitude < 1e-4


def test_driven_motion_that_cannot_be_told():
    t, signal = record(2.9, (1.0, 0.02, 0.0))
    assert "less than 3 driving periods of 1 s" in driven_motion(t, signal, 1.0).reason
    assert driven_motion(*record(3.0, (1.0, 0.02, 0.0)), 1.0).periods == 2
    assert "too seldom" in driven_motion(*record(10.0, (8.0, 0.02, 0.0), interval=0.06), 0.125).reason
    assert "fewer than" in driven_motion(t[:10], signal[:10], 0.01).reason
    assert math.isnan(driven_motion(t, np.full_like(t, math.nan), 1.0).amplitude)
