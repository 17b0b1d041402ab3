"""From records to the motion of the ground: correction, scaling, cutting, resampling, and the keys of a stage."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenario_text import ABSENT, small

from dem_cli.errors import ScenarioError
from dem_cli.scenario import Scenario, Shake, parse_scenario
from dem_cli.scenario.ground_motion import DEGREES, GroundMotion, resampled
from dem_cli.scenario.motion_facts import arias_intensity, integrals, predominant_period, significant_duration
from dem_cli.scenario.record_formats import read_record

STEP, COUNT = 0.01, 801
TIME = STEP * np.arange(COUNT)
# A motion of some gal with an offset, a slope and a jump in its zero.
WAVE = 300.0 * np.sin(2 * np.pi * 1.7 * TIME) * np.exp(-((TIME - 3.0) ** 2)) + 4.0 - 0.7 * TIME + 3.0 * (TIME > 5.0)
OTHER = 120.0 * np.cos(2 * np.pi * 4.0 * TIME) * np.exp(-((TIME - 2.0) ** 2))
BY_RECORD: dict[str, Any] = {"stage.1.amplitude": ABSENT, "stage.1.frequency": ABSENT, "stage.1.duration": ABSENT}


def csv(*columns: Any, step: float = STEP) -> str:
    head = ",".join(["t [s]", *(f"a{k} [gal]" for k in range(len(columns)))])
    rows = zip(step * np.arange(len(columns[0])), *columns, strict=True)
    return head + "\n" + "\n".join(",".join(repr(float(v)) for v in row) for row in rows) + "\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.csv").write_text(csv(WAVE, OTHER))
    (tmp_path / "short.csv").write_text(csv(OTHER[:500]))
    (tmp_path / "coarse.csv").write_text(csv(OTHER[::2], step=0.02))
    (tmp_path / "zero.csv").write_text(csv(0.0 * WAVE))
    return tmp_path


def scenario(folder: Path, record: Any, **stage: Any) -> Scenario:
    changes = {**BY_RECORD, "stage.1.record": record, **{f"stage.1.{k}": v for k, v in stage.items()}}
    return parse_scenario(small(changes), origin="a.toml", folder=folder)


def motion(folder: Path, record: dict[str, Any] | None = None, **stage: Any) -> GroundMotion:
    shake = scenario(folder, {"file": "a.csv", **(record or {})}, **stage).stages[1]
    assert isinstance(shake, Shake)
    assert shake.motion is not None
    assert shake.longest == shake.motion.duration
    return shake.motion


def refused(folder: Path, record: Any, **stage: Any) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        scenario(folder, record, **stage)
    assert caught.value.exit_code == 2
    return str(caught.value).splitlines()


# -------------------------------------------------------------------------------------------- integrals


@given(st.integers(2, 60), st.floats(1e-3, 1.0), st.integers(0, 2**31))
def test_integrals_are_those_of_straight_lines(count: int, step: float, seed: int) -> None:
    """Against Simpson's rule on each half interval for v, exact for parabolas, and on cubics for d."""
    a = np.random.default_rng(seed).normal(size=count)
    v, d = integrals(step, a)
    assert (v[0], d[0]) == (0.0, 0.0)
    middle = 0.5 * (a[1:] + a[:-1])
    np.testing.assert_allclose(np.diff(v), step * (a[:-1] + 4 * middle + a[1:]) / 6.0, atol=1e-13 * step * count)
    v_middle = v[:-1] + 0.5 * step * (a[:-1] + middle) / 2.0
    np.testing.assert_allclose(np.diff(d), step * (v[:-1] + 4 * v_middle + v[1:]) / 6.0, atol=1e-12 * step**2 * count)


# --------------------------------------------------------------------------------------------- baseline


@pytest.mark.parametrize("taper", ["0 s", "0.4 s"])
@pytest.mark.parametrize("baseline", ["mean", "linear", "quadratic"])
@pytest.mark.parametrize("cut", [{}, {"duration": "4.321 s"}, {"duration": "20 s"}])
def test_ground_ends_at_rest(folder: Path, baseline: str, taper: str, cut: dict[str, str]) -> None:
    found = motion(folder, {"baseline": baseline, "taper": taper, "peak": "400 gal"}, **cut)
    a = found.acceleration[:, 0]
    v, d = integrals(found.interval, a)
    assert abs(v[-1]) < 1e-12 * np.abs(v).max()
    if baseline != "mean":
        assert abs(d[-1]) < 1e-12 * np.abs(d).max()
    one = found.components[0]
    assert (one.residual_velocity, one.residual_displacement) == (v[-1], d[-1])
    assert one.peak == np.abs(a).max() == pytest.approx(4.0, rel=1e-14)
    if taper != "0 s":
        assert a[0] == 0.0
        assert abs(a[-1]) < 1e-12


def test_none_leaves_the_record_as_it_is(folder: Path) -> None:
    found = motion(folder, {"baseline": "none"})
    np.testing.assert_allclose(found.acceleration[:, 0], 0.01 * WAVE, rtol=1e-14)
    assert not found.acceleration[:, 1].any()
    v, d = integrals(STEP, 0.01 * WAVE)
    one = found.components[0]
    assert one.residual_velocity == one.residual_velocity_before == pytest.approx(v[-1])
    assert one.residual_displacement == one.residual_displacement_before == pytest.approx(d[-1])
    assert found.duration == pytest.approx(8.0)


@pytest.mark.parametrize("baseline", ["mean", "linear", "quadratic"])
def test_takes_off_a_polynomial_of_its_degree(folder: Path, baseline: str) -> None:
    """What is taken off is such a polynomial; and one that was put on a motion at rest at both ends is found."""
    degree = DEGREES[baseline]
    off = 0.01 * WAVE - motion(folder, {"baseline": baseline}).acceleration[:, 0]
    fitted = np.polynomial.Polynomial.fit(TIME, off, degree)
    np.testing.assert_allclose(fitted(TIME), off, atol=1e-12)
    assert np.abs(off).max() > 0.01
    drift = sum(0.03 * (0.5 * TIME / TIME[-1]) ** k for k in range(degree + 1))
    # a motion that ends at rest where it began: the same pulses to and fro, with their mirror image
    pulse = np.sin(np.pi * TIME / TIME[-1]) ** 2 * np.cos(6 * np.pi * TIME / TIME[-1])
    clean = (
        pulse - pulse * (integrals(STEP, pulse)[0][-1] / integrals(STEP, pulse)[0][-1]) if degree == 0 else 0.0 * TIME
    )
    (folder / "b.csv").write_text(csv(100.0 * (clean + drift)))
    left = motion(folder, {"file": "b.csv", "baseline": baseline}).acceleration[:, 0]
    np.testing.assert_allclose(left, clean, atol=1e-13)


def test_quadratic_makes_velocities_least(folder: Path) -> None:
    """Any other parabola that leaves the ground at rest where it began has larger squared velocities."""
    a = motion(folder, {"baseline": "quadratic"}).acceleration[:, 0]
    place = np.linspace(-1.0, 1.0, COUNT)
    basis = np.polynomial.legendre.legvander(place, 2).T
    ends = np.array([[integrals(STEP, one)[k][-1] for one in basis] for k in (0, 1)])
    shape = np.linalg.svd(ends)[2][-1] @ basis
    squares = [np.sum(integrals(STEP, a + amount * shape)[0] ** 2) for amount in (-1e-3, 0.0, 1e-3)]
    assert squares[1] < min(squares[0], squares[2])
    assert squares[0] == pytest.approx(squares[2], rel=1e-6)


# ---------------------------------------------------------------------------- scaling, cutting, padding


def test_scaling(folder: Path) -> None:
    plain = motion(folder).acceleration
    np.testing.assert_allclose(motion(folder, {"scale": -2.5}).acceleration, -2.5 * plain, rtol=1e-14)
    found = motion(folder, {"peak": "1.5 m/s^2"})
    assert found.components[0].factor == pytest.approx(1.5 / np.abs(plain).max())
    np.testing.assert_allclose(found.acceleration, found.components[0].factor * plain, rtol=1e-14)
    assert found.components[0].recorded_peak == pytest.approx(0.01 * np.abs(WAVE).max())


def test_start_and_duration_cut(folder: Path) -> None:
    found = motion(folder, {"baseline": "none", "start": "1.2 s"}, duration="2.5 s")
    np.testing.assert_allclose(found.acceleration[:, 0], 0.01 * WAVE[120:371], rtol=1e-14)
    assert found.duration == 2.5
    between = motion(folder, {"baseline": "none"}, duration="2.507 s")
    assert (len(between.acceleration), between.duration) == (251, 2.507)


def test_rest_before_and_after(folder: Path) -> None:
    found = motion(folder, {"baseline": "none", "pad": "0.5 s"})
    assert (found.begin, found.duration) == (0.5, pytest.approx(9.0))
    assert len(found.acceleration) == COUNT
    cut = motion(folder, {"baseline": "none", "pad": "0.5 s"}, duration="3 s")
    assert (cut.begin, cut.duration, len(cut.acceleration)) == (0.5, 3.0, 201)
    long = motion(folder, {"baseline": "none"}, duration="12 s")
    assert (long.duration, len(long.acceleration)) == (12.0, COUNT)


def test_time_scale(folder: Path) -> None:
    """A model's time: the same accelerations, closer together; start counts in the record's own time."""
    found = motion(folder, {"baseline": "none", "time_scale": 0.1, "start": "1.2 s"}, duration="0.25 s")
    assert found.interval == pytest.approx(0.001)
    np.testing.assert_allclose(found.acceleration[:, 0], 0.01 * WAVE[120:371], rtol=1e-14)
    whole = motion(folder)
    fast = motion(folder, {"time_scale": 0.1})
    assert fast.components[0].predominant_period == pytest.approx(0.1 * whole.components[0].predominant_period)


def test_two_components(folder: Path) -> None:
    base = {"baseline": "none", "second": {"column": "a1"}}
    found = motion(folder, {**base, "scale": 2})
    np.testing.assert_allclose(found.acceleration, 0.02 * np.stack([WAVE, OTHER], axis=1), rtol=1e-14)
    assert [one.component for one in found.components] == ["a0", "a1"]
    # the second takes the factor of the first, unless it has its own
    of_first = 4.0 / np.abs(0.01 * WAVE).max()
    own = {"peak": "2.4 m/s^2"}
    for given_, factor in (({}, of_first), ({"scale": 3}, 3.0), (own, 2.4 / np.abs(0.01 * OTHER).max())):
        found = motion(folder, {**base, "peak": "400 gal", "second": {"column": "a1", **given_}})
        np.testing.assert_allclose(found.acceleration[:, 1], 0.01 * factor * OTHER, rtol=1e-13)
        assert found.components[1].factor == pytest.approx(factor)


def test_components_of_other_lengths_and_intervals(folder: Path) -> None:
    found = motion(folder, {"second": {"file": "short.csv"}, "baseline": "linear"})
    assert not found.acceleration[500:, 1].any()
    v, d = integrals(STEP, found.acceleration[:, 1])
    assert abs(v[-1]) < 1e-12 * np.abs(v).max()
    assert abs(d[-1]) < 1e-12 * np.abs(d).max()
    found = motion(folder, {"second": {"file": "coarse.csv"}, "baseline": "none"})
    assert (found.interval, len(found.acceleration)) == (pytest.approx(0.01), COUNT)
    np.testing.assert_allclose(found.acceleration[::2, 1], 0.01 * OTHER[::2], atol=1e-14)
    # 4 Hz from samples at 50 Hz: as far as the kernel's side lobes of -90 dB allow
    slack = 10.0 ** (-90.0 / 20.0) * 0.01 * np.abs(OTHER).max()
    np.testing.assert_allclose(found.acceleration[50:-50, 1], 0.01 * OTHER[50:-50], rtol=0, atol=slack)


# ------------------------------------------------------------------------------------------- resampling


def test_resampling_is_band_limited() -> None:
    time = 0.01 * np.arange(1001)
    wave = np.sin(2 * np.pi * 30.0 * time + 0.3)  # Nyquist: 50 Hz; straight lines would lose a third
    fine = resampled(wave, 0.01, 0.001)
    np.testing.assert_allclose(fine[::10], wave, atol=1e-13)
    inner = slice(500, -500)
    np.testing.assert_allclose(fine[inner], np.sin(2 * np.pi * 30.0 * 0.001 * np.arange(10001) + 0.3)[inner], atol=1e-4)
    # coarser: 5 Hz passes, 30 Hz would come back as 10 Hz at 40 samples a second and is taken out
    slow = np.sin(2 * np.pi * 5.0 * time)
    coarse = resampled(slow + wave, 0.01, 0.025)
    np.testing.assert_allclose(coarse[100:-100], np.sin(2 * np.pi * 5.0 * 0.025 * np.arange(401))[100:-100], atol=1e-3)


@settings(deadline=None)
@given(st.floats(0.02, 50.0), st.integers(4, 400))
def test_resampling_keeps_constants(ratio: float, count: int) -> None:
    values = resampled(np.full(count, 3.7), 1.0, ratio)
    assert len(values) == math.floor((count - 1) / ratio * (1 + 1e-12) + 1e-9) + 1
    np.testing.assert_allclose(values, 3.7, rtol=1e-12)


def test_resampled_stage_ends_at_rest(folder: Path) -> None:
    for interval in ("1 ms", "3.3 ms", "25 ms"):
        found = motion(folder, {"resample": interval, "baseline": "quadratic"})
        assert found.interval == pytest.approx(float(interval.split()[0]) / 1000.0)
        v, d = integrals(found.interval, found.acceleration[:, 0])
        assert abs(v[-1]) < 1e-12 * np.abs(v).max()
        assert abs(d[-1]) < 1e-12 * np.abs(d).max()


# ------------------------------------------------------------------------------------------------ facts


@pytest.mark.parametrize("frequency", [0.7, 2.0, 11.0])
def test_predominant_period(frequency: float) -> None:
    time = 0.005 * np.arange(6001)
    assert predominant_period(np.sin(2 * np.pi * frequency * time), 0.005) == pytest.approx(1.0 / frequency, rel=0.02)
    two = np.sin(2 * np.pi * frequency * time) + 0.5 * np.sin(2 * np.pi * 2.7 * frequency * time)
    assert predominant_period(two, 0.005) == pytest.approx(1.0 / frequency, rel=0.02)


def test_intensity_and_duration() -> None:
    box = np.full(1001, 2.0)  # constant squares: 5 to 95 % is nine tenths
    assert arias_intensity(box, 0.01) == pytest.approx(math.pi / (2 * 9.80665) * 40.0)
    assert significant_duration(box, 0.01) == pytest.approx(9.0)
    line = np.array([0.0, 3.0])  # a straight line: the integral of its square is 3
    assert arias_intensity(line, 1.0) == pytest.approx(math.pi / (2 * 9.80665) * 3.0)


def test_record_without_motion(folder: Path) -> None:
    one = motion(folder, {"file": "zero.csv"}).components[0]
    assert (one.peak, one.arias) == (0.0, 0.0)
    assert math.isnan(one.predominant_period)
    assert math.isnan(one.significant_duration)
    facts = motion(folder, {"file": "zero.csv"}).facts()
    assert facts["components"][0]["predominant_period"] is None
    (line,) = refused(folder, {"file": "zero.csv", "peak": "1 gal"})
    assert '[[stage]] 2 (shake) record.peak = "1 gal": cannot be reached: the record is zero' in line


# ----------------------------------------------------------------------------------------- keys, mistakes


def test_short_form_is_the_file(folder: Path) -> None:
    shake = scenario(folder, "a.csv").stages[1]
    table = scenario(folder, {"file": "a.csv"}).stages[1]
    assert shake == table
    assert isinstance(shake, Shake)
    assert (shake.amplitude, shake.frequency, shake.longest) == (None, None, pytest.approx(8.0))


@pytest.mark.parametrize(
    ("record", "stage", "words"),
    [
        ("none.csv", {}, 'record = "none.csv": does not exist'),
        ({"file": "none.csv"}, {}, 'record.file = "none.csv": does not exist'),
        ({"file": "a.csv", "second": {"file": "none.at2"}}, {}, 'record.second.file = "none.at2": does not exist'),
        ({"file": "a.csv", "column": "zz"}, {}, 'record.column = "zz": is no column of the file'),
        ({"file": "a.csv", "unit": "m/s^2"}, {}, 'record.unit = "m/s^2": contradicts the gal of line 1'),
        ({"file": "a.csv", "second": {"column": "t"}}, {}, 'record.second.column = "t": is the time'),
        ({"file": "a.csv", "start": "8 s"}, {}, 'record.start = "8 s": leaves nothing of a.csv, which lasts 8 s'),
        ({"file": "a.csv"}, {"duration": "0.02 s"}, "record.file = \"a.csv\": leaves 3 samples, every 0.01 s"),
        ({"file": "a.csv", "taper": "4.1 s"}, {}, 'record.taper = "4.1 s": is longer than half of the motion, which lasts 8 s'),
        ({"file": "a.csv", "pad": "1 s"}, {"duration": "2 s"}, 'record.pad = "1 s": leaves nothing of the stage'),
        ({"file": "a.csv", "peak": "1 gal", "scale": 2}, {}, "record.scale = 2: contradicts peak. Give only one of: peak or scale"),
        ({"file": "a.csv", "scale": 0}, {}, "record.scale = 0: takes all of the motion away"),
        ({"file": "a.csv", "peak": 400}, {}, 'record.peak = 400: is a bare number, an acceleration needs its unit. Write "400 gal"'),
        ({"file": "a.csv", "baseline": "cubic"}, {}, 'record.baseline = "cubic": must be one of none, mean, linear, quadratic'),
        ({"file": "a.csv", "format": "smc"}, {}, 'record.format = "smc": must be one of auto, csv, at2, knet'),
        ({"file": "a.csv", "format": "at2"}, {}, 'record.file = "a.csv": line 4: NPTS and DT are missing'),
        ({"file": "a.csv", "second": {}}, {}, "record.second.file: is missing. Give the file of the second component"),
        ({"peak": "400 gal"}, {}, "record.file: is missing"),
        ({"file": "a.csv", "bassline": "mean"}, {}, 'record.bassline = "mean": unknown key. Did you mean "baseline"?'),
        ("a.csv", {"amplitude": "400 gal"}, "contradicts amplitude. Give only one of: amplitude + frequency or record"),
        ("a.csv", {"cycles": 5}, "cycles = 5: is of a sine, and contradicts record. Write duration in its place"),
        ("a.csv", {"ramp": "1 s"}, 'ramp = "1 s": is of a sine, and contradicts record. Write taper'),
    ],
)  # fmt: skip
def test_mistakes(folder: Path, record: Any, stage: dict[str, Any], words: str) -> None:
    (line,) = refused(folder, record, **stage)
    assert line.startswith("a.toml: [[stage]] 2 (shake) ")
    assert words in line


def test_damaged_line_is_named(folder: Path) -> None:
    (folder / "bad.csv").write_text((folder / "a.csv").read_text().replace("0.05,", "0.05,x", 1))
    (line,) = refused(folder, {"file": "bad.csv"})
    assert line.startswith('a.toml: [[stage]] 2 (shake) record.file = "bad.csv": line 7: "x')
    assert line.endswith(". Correct the line: one sample a line, without gaps")


def test_comes_together_with_other_mistakes(folder: Path) -> None:
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(small({**BY_RECORD, "stage.1.record": "none.csv", "titel": "x"}), folder=folder)
    assert len(str(caught.value).splitlines()) == 2


def test_override_displaces_the_sine(folder: Path) -> None:
    text = small({"stage.1.duration": "2 s"})
    shake = parse_scenario(text, folder=folder, overrides=["stage.record=a.csv"]).stages[1]
    assert isinstance(shake, Shake)
    assert (shake.amplitude, shake.frequency, shake.duration) == (None, None, 2.0)
    by_record = small({**BY_RECORD, "stage.1.record": "a.csv"})
    shake = parse_scenario(by_record, folder=folder, overrides=["stage.record.peak=400 gal"]).stages[1]
    assert isinstance(shake, Shake)
    assert shake.record is not None
    assert (shake.record.file, shake.record.peak) == ("a.csv", 4.0)
    both = ["stage.record.scale=2", "stage.record.peak=1 gal"]
    shake = parse_scenario(by_record, folder=folder, overrides=both).stages[1]
    assert isinstance(shake, Shake)
    assert shake.record is not None
    assert shake.record.scale is None


def test_resolved_form_loads_back(folder: Path) -> None:
    first = scenario(folder, {"file": "a.csv", "peak": "400 gal", "second": {"file": "short.csv"}, "taper": "0.1 s"})
    again = parse_scenario(first.resolved_toml(), folder=folder)
    assert (again, again.hash) == (first, first.hash)
    assert again.resolved_toml() == first.resolved_toml()


def test_hash_covers_the_records(folder: Path) -> None:
    record = {"file": "a.csv", "second": {"file": "short.csv"}}
    before = scenario(folder, record).hash
    assert scenario(folder, record).hash == before
    assert scenario(folder, {**record, "peak": "1 gal"}).hash != before
    for name in ("a.csv", "short.csv"):
        text = (folder / name).read_text()
        (folder / name).write_text(text + "\n")
        assert scenario(folder, record).hash != before
        (folder / name).write_text(text)
    assert scenario(folder, record).hash == before


def test_shipped_record_is_its_formula() -> None:
    import synthetic_record

    for name, make in synthetic_record.FILES.items():
        assert (synthetic_record.FOLDER / name).read_text(encoding="utf-8") == make()
        assert (synthetic_record.FOLDER / name).stat().st_size < 60_000
        assert read_record(synthetic_record.FOLDER / name).duration == pytest.approx(9.99)
