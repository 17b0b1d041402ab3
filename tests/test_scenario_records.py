"""Readers of recorded motions: what good files hold, and the line and remedy for each kind of damage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dem_cli.scenario.raw_record import RawRecord, RecordError, unit_value
from dem_cli.scenario.record_formats import read_record

G = 9.80665
WAVE = np.round(100.0 * np.sin(np.arange(50) * 0.7), 3)  # gal


def record(folder: Path, text: str, name: str = "a.csv", **options: Any) -> RawRecord:
    (folder / name).write_text(text, encoding="utf-8")
    return read_record(folder / name, **options)


def refused(folder: Path, text: str, name: str = "a.csv", **options: Any) -> RecordError:
    with pytest.raises(RecordError) as caught:
        record(folder, text, name, **options)
    assert caught.value.remedy
    assert "\n" not in str(caught.value)
    return caught.value


def csv(header: str = "time [s],ax [gal]", step: float = 0.01, separator: str = ",") -> str:
    rows = [f"{step * k:.4g}{separator}{a:g}" for k, a in enumerate(WAVE)]
    return "\n".join([*([header] if header else []), *rows]) + "\n"


# ------------------------------------------------------------------------------------------------ units


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("gal", 0.01), ("Gal", 0.01), ("GAL", 0.01), ("cm/s^2", 0.01), ("cm/s2", 0.01), ("cm/s/s", 0.01), ("cm/sec^2", 0.01),
        ("cm/sec/sec", 0.01), ("cm/sec2", 0.01), ("cm/s²", 0.01), ("cm/s**2", 0.01), ("m/s^2", 1.0), ("m/s2", 1.0),
        ("mm/s^2", 1e-3), ("g", G), ("G", G), ("mg", 1e-3 * G), ("%g", 1e-2 * G), ("gal(cm/s/s)", 0.01), ("[gal]", 0.01), ("mgal", 1e-5),
        ("cm/s", None), ("s", None), ("parrots", None), ("", None), ("kg", None),
    ],
)  # fmt: skip
def test_units_of_acceleration(text: str, value: float | None) -> None:
    assert unit_value(text, "m/s^2") == (None if value is None else pytest.approx(value, rel=1e-14))


# -------------------------------------------------------------------------------------------------- CSV


@pytest.mark.parametrize(
    "text",
    [
        csv(),
        csv("Time (sec), Acc. (cm/s^2)"),
        csv("t,acc_gal"),
        csv("t;ns in gal", separator=";"),
        csv("time [s]\tax [gal]", separator="\t"),
        csv("time [s] ax [gal]", separator="  "),
        csv("# time [s], ax [gal]"),
        csv("% a record of nowhere\n\ntime [s], ax [gal]"),
        csv("# unit = gal\ntime,ax"),
        csv("unit: gal\nt,ax"),
        csv("# units of gal"),
        csv("時刻(s),加速度(gal)"),
        csv() + "\n\n# the end\n",
        csv().replace("\n", ",\n"),
        csv().replace("\n", "\r\n"),
        "\ufeff" + csv(),
    ],
)
def test_csv_with_times(tmp_path: Path, text: str) -> None:
    found = record(tmp_path, text)
    np.testing.assert_allclose(found.acceleration, 0.01 * WAVE, rtol=1e-15)
    assert found.interval == pytest.approx(0.01, rel=1e-12)
    assert (found.name, found.format) == ("a.csv", "csv")
    assert found.peak == pytest.approx(0.01 * np.abs(WAVE).max())
    assert found.duration == pytest.approx(0.49)
    for word in ("50 samples", "gal" if "cm/s" not in text else "cm/s^2", "0.01 s"):
        assert word in found.understood


COLUMN = "\n".join(f"{a:g}" for a in WAVE) + "\n"


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("# dt = 0.01 s\nax [gal]\n" + COLUMN, {}),
        ("# dt [s] = 0.01, unit = gal\n" + COLUMN, {}),
        ("# interval: 10 ms\nacc (gal)\n" + COLUMN, {}),
        ("# sampling frequency = 100 Hz\nax [gal]\n" + COLUMN, {}),
        ("SITE CODE= 51231\nSAMPLING RATE= 100Hz\nUNIT  = gal(cm/s/s)\nINITIAL TIME = 2011 03 11 14 46 16\nNS\n" + COLUMN, {}),
        ("ax [gal]\n" + COLUMN, {"interval": 0.01}),
        (COLUMN, {"interval": 0.01, "unit": "gal"}),
        (COLUMN, {"interval": 0.01, "unit": "cm/s^2"}),
        ("ax [gal]\n" + COLUMN, {"interval": 0.01, "unit": "cm/s/s"}),  # says the same twice
    ],
)  # fmt: skip
def test_csv_without_times(tmp_path: Path, text: str, options: dict[str, Any]) -> None:
    found = record(tmp_path, text, **options)
    np.testing.assert_allclose(found.acceleration, 0.01 * WAVE, rtol=1e-15)
    assert found.interval == pytest.approx(0.01, rel=1e-12)


def test_csv_times_in_other_units_and_steps(tmp_path: Path) -> None:
    assert record(tmp_path, csv("t [ms], a [g]", step=5.0)).interval == pytest.approx(0.005)
    found = record(tmp_path, csv("t [s], a [g]"))
    np.testing.assert_allclose(found.acceleration, WAVE * G, rtol=1e-15)
    # a third of a hundredth, rounded to 4 digits, is even within its digits
    rows = "".join(f"{k / 300.0:.4f},{a}\n" for k, a in enumerate(WAVE))
    assert record(tmp_path, "t [s],a [gal]\n" + rows).interval == pytest.approx(1.0 / 300.0, rel=1e-3)


def test_csv_chooses_columns(tmp_path: Path) -> None:
    text = "time [s],NS [gal],UD [m/s^2]\n" + "".join(f"{0.02 * k:.2f},{a},{-a}\n" for k, a in enumerate(WAVE))
    for column, wanted, name in ((None, 0.01, "NS"), ("ns", 0.01, "NS"), ("UD", -1.0, "UD"), ("3", -1.0, "UD")):
        found = record(tmp_path, text, column=column)
        np.testing.assert_allclose(found.acceleration, wanted * WAVE, rtol=1e-15)
        assert found.component == name
    for column, words in (
        ("N", 'is no column of the file. Did you mean "NS"?'),
        ("time", "is the time"),
        ("4", "no column"),
    ):
        error = refused(tmp_path, text, column=column)
        assert error.key == "column"
        assert words in str(error)


def test_csv_of_numbers_alone(tmp_path: Path) -> None:
    """A first column that rises is taken for the time, and that is said."""
    found = record(tmp_path, csv(""), unit="gal")
    assert found.interval == pytest.approx(0.01)
    assert "the first column was taken for the time" in found.understood


ROWS = csv().splitlines()


def damaged(line: int, text: str) -> str:
    """The good CSV with a line (from 1) replaced; an empty text leaves it out."""
    return "\n".join([*ROWS[: line - 1], *([text] if text else []), *ROWS[line:]]) + "\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["is empty"]),
        (" \n\n", ["is empty"]),
        ("time [s], ax [gal]\n", ["holds no line of numbers"]),
        (csv("t,ax"), ["line 1: the unit of the acceleration is missing", 'unit = "gal"']),
        (csv("t [s],vx [cm/s]"), ["line 1: cm/s is a velocity"]),
        (csv("t [s],ux [cm]"), ["line 1: cm is a displacement"]),
        (csv("t [s],x [parrots]"), ["line 1: parrots is no unit I know"]),
        ("ax [gal]\n" + COLUMN, ["line 1: neither times nor an interval are given", 'interval = "0.01 s"']),
        ("# dt = 0 s\nax [gal]\n" + COLUMN, ["line 1", "gives no interval"]),
        (damaged(10, "0.08,1o.5"), ['line 10: "1o.5" is no number']),
        (damaged(10, "0.08,nan"), ['line 10: "nan" is not a finite number']),
        (damaged(10, "0.08,inf"), ["line 10", "not a finite"]),
        (damaged(10, "0.08"), ["line 10: has 1 of 2 values"]),
        (damaged(10, "0.08,1,2"), ["line 10: has 3 of 2 values"]),
        (damaged(10, "0.08,,1"), ["line 10: has 3 of 2 values"]),
        (damaged(10, ""), ["line 10: 0.02 after the time before, where 0.01 is usual", "even times"]),
        (damaged(10, "0.085,1"), ["line 10: 0.015 after"]),
        (damaged(10, "0.07,1"), ["line 10: the time does not rise"]),
        (damaged(10, "0.01,1"), ["line 10: the time does not rise"]),
        ("t [s],a [gal]\n0,1\n0.01,2\n", ["line 3: the record ends after 2 samples"]),
        ("t [s],a [gal]\n0,1\n", ["line 2: the record ends after 1 sample."]),
        ("t;a [gal]\n0,00;1,5\n0,01;1,5\n", ["line 2: has decimal commas"]),
        ("time [s]\n0\n1\n2\n3\n", ["holds times alone"]),
        ("# dt = 0.02 s\n" + csv(), ["line 1: an interval of 0.02 s, where the times have 0.01 s"]),
    ],
)  # fmt: skip
def test_damaged_csv(tmp_path: Path, text: str, words: list[str]) -> None:
    error = refused(tmp_path, text)
    for word in words:
        assert word in str(error)
    assert error.key == "file"


def test_csv_and_keys_that_disagree(tmp_path: Path) -> None:
    for options, key, words in (
        ({"unit": "m/s^2"}, "unit", "contradicts the gal of line 1"),
        ({"unit": "cm"}, "unit", "cm is a displacement"),
        ({"interval": 0.02}, "interval", "contradicts the file, which has 0.01 s"),
    ):
        error = refused(tmp_path, csv(), **options)
        assert (error.key, words in str(error)) == (key, True)


@given(st.floats(1e-4, 0.1), st.integers(4, 300), st.integers(0, 2**31))
def test_csv_of_any_even_times_is_read(step: float, count: int, seed: int) -> None:
    from dem_cli.scenario.record_csv import read_csv

    values = np.random.default_rng(seed).normal(size=count)
    lines = ["t [s],a [m/s^2]", *(f"{step * k!r},{float(a)!r}" for k, a in enumerate(values))]
    found = read_csv("a.csv", lines)
    assert found.interval == pytest.approx(step, rel=1e-9)
    assert found.acceleration.tolist() == values.tolist()


# -------------------------------------------------------------------------------------------------- AT2

AT2_HEAD = ["PEER NGA STRONG MOTION DATABASE RECORD", "Imperial Valley-02, 5/19/1940, El Centro Array #9, 180"]
AT2_HEAD += ["ACCELERATION TIME SERIES IN UNITS OF G"]


def at2(npts: str = "NPTS=  50, DT= .0050 SEC", head: list[str] | None = None, values: Any = WAVE) -> str:
    words = [f"{a / 1000.0:15.7E}" for a in values]
    rows = ["".join(words[k : k + 5]) for k in range(0, len(words), 5)]
    return "\n".join([*(AT2_HEAD if head is None else head), npts, *rows]) + "\n"


@pytest.mark.parametrize(
    "npts",
    [
        "NPTS=  50, DT= .0050 SEC",
        "NPTS=     50, DT=   .00500 SEC,",
        "NPTS= 50, DT= 5.0E-03 SEC",
        "NPTS=50,DT=0.005",
        "   50   0.0050   NPTS, DT",
        "50    .005    NPTS, DT",
    ],
)
def test_at2(tmp_path: Path, npts: str) -> None:
    for name in ("a.at2", "ELC180.AT2", "a.txt"):
        found = record(tmp_path, at2(npts), name)
        np.testing.assert_allclose(found.acceleration, WAVE / 1000.0 * G, rtol=1e-15)
        assert (found.interval, found.format, found.component, found.offset) == (0.005, "at2", "180", 0.0)
        assert "50 samples of line 4" in found.understood


def test_at2_units_of_the_header(tmp_path: Path) -> None:
    head = [*AT2_HEAD[:2], "ACCELERATION TIME HISTORY IN UNITS OF CM/SEC/SEC"]
    found = record(tmp_path, at2(head=head), "a.at2")
    np.testing.assert_allclose(found.acceleration, WAVE / 1e5, rtol=1e-14)
    found = record(tmp_path, at2(head=[*AT2_HEAD[:2], "no word on units"]), "a.at2")
    np.testing.assert_allclose(found.acceleration, WAVE / 1000.0 * G, rtol=1e-15)
    assert "in g, as PEER writes them" in found.understood


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (at2(values=WAVE[:-1]), ["line 14: the record ends after 49 of the 50 samples that line 4 announces"]),
        (at2(values=[*WAVE, 1, 2]), ["line 15: the record goes on beyond the 50 samples"]),
        (at2(values=[]), ["line 4: the record ends after 0 of the 50"]),
        (at2().replace("E-0", "X-0", 1), ["line 5: ", "is no number"]),
        (at2().replace(at2().split()[-1], "NaN"), ["line 14: ", "not a finite number"]),
        (at2("NPTS=  50"), ["line 4: NPTS and DT cannot be read"]),
        (at2("NPTS=  50, DT= fast SEC"), ["line 4: NPTS and DT cannot be read"]),
        (at2("NPTS=  50, DT= 0.0 SEC"), ["line 4: NPTS = 50 and DT = 0 s are no record"]),
        (at2("NPTS=  5.5, DT= 0.01 SEC"), ["line 4: NPTS = 5.5"]),
        (at2("nothing"), ["line 4: NPTS and DT are missing"]),
        (at2("NPTS= 3, DT= 0.01", values=WAVE[:3]), ["line 5: the record ends after 3 samples"]),
        (at2(head=[*AT2_HEAD[:2], "VELOCITY TIME SERIES IN UNITS OF CM/S"]), ["line 3: cm/s is a velocity"]),
        (at2(head=[*AT2_HEAD[:2], "DISPLACEMENT TIME SERIES"]), ["line 3: is no acceleration", ".AT2"]),
        ("", ["is empty"]),
    ],
)
def test_damaged_at2(tmp_path: Path, text: str, words: list[str]) -> None:
    error = refused(tmp_path, text, "a.at2")
    for word in words:
        assert word in str(error)


# ------------------------------------------------------------------------------------------------ K-NET

COUNTS = np.round(8000 + 5000.0 * np.sin(np.arange(200) * 0.3) * np.hanning(200)).astype(int)
SCALE = 39.2 / 6182761  # m/s^2 a count
KNET_HEAD = {
    "Origin Time": "2006/01/18 23:25:00", "Lat.": "37.798", "Long.": "142.200", "Depth. (km)": "36", "Mag.": "5.7",
    "Station Code": "MYG002", "Station Lat.": "38.7262", "Station Long.": "141.5109", "Station Height(m)": "79",
    "Record Time": "2006/01/18 23:25:46", "Sampling Freq(Hz)": "100Hz", "Duration Time(s)": "2", "Dir.": "N-S",
    "Scale Factor": "3920(gal)/6182761", "Max. Acc. (gal)": f"{100.0 * SCALE * np.abs(COUNTS - COUNTS.mean()).max():.3f}",
    "Last Correction": "2006/01/18 23:25:31", "Memo.": "",
}  # fmt: skip


def knet(changes: dict[str, str | None] | None = None, counts: Any = COUNTS) -> str:
    head = {k: v for k, v in {**KNET_HEAD, **(changes or {})}.items() if v is not None}
    lines = [f"{key:<18}{value}" for key, value in head.items()]
    rows = ["".join(f"{c:>9}" for c in counts[k : k + 8]) for k in range(0, len(counts), 8)]
    return "\n".join([*lines, *rows]) + "\n"


def test_knet(tmp_path: Path) -> None:
    for name in ("MYG0020601182325.NS", "a.txt"):
        found = record(tmp_path, knet(), name)
        np.testing.assert_allclose(found.acceleration, SCALE * COUNTS, rtol=1e-14)
        assert (found.format, found.component, found.interval) == ("knet", "MYG002 N-S", 0.01)
        # the peak counts from the mean of all samples, as NIED's own
        assert found.offset == pytest.approx(SCALE * COUNTS.mean())
        assert 100.0 * found.peak == pytest.approx(float(KNET_HEAD["Max. Acc. (gal)"]), abs=6e-4)
        assert "header says" not in found.understood


def test_kik_net(tmp_path: Path) -> None:
    found = record(tmp_path, knet({"Sampling Freq(Hz)": "200Hz", "Duration Time(s)": "1", "Dir.": "6"}), "A.UD2")
    assert (found.interval, found.component) == (0.005, "MYG002 6")


def test_knet_maximum_that_differs_is_told(tmp_path: Path) -> None:
    found = record(tmp_path, knet({"Max. Acc. (gal)": "99.9"}), "a.NS")
    assert "its header says a maximum of 99.9 gal, the samples 3." in found.understood


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (knet({"Scale Factor": None}), ["line 14: Scale Factor is missing"]),
        (knet({"Scale Factor": "3920"}), ['line 14: "3920" is no scale factor', "3920(gal)/6182761"]),
        (knet({"Scale Factor": "3920(gal)/0"}), ["line 14", "is no scale factor"]),
        (knet({"Scale Factor": "3920(cm/s)/6182761"}), ["line 14: cm/s is a velocity"]),
        (knet({"Sampling Freq(Hz)": None}), ["line 11: Sampling Freq is missing"]),
        (knet({"Sampling Freq(Hz)": "fastHz"}), ['line 11: "fast" is no number']),
        (knet({"Sampling Freq(Hz)": "0Hz"}), ["line 11: a sampling frequency of 0 Hz"]),
        (knet({"Duration Time(s)": None}), ["line 12: Duration Time is missing"]),
        (knet({"Memo.": None}), ["line 17: the line Memo. is missing"]),
        (knet(counts=COUNTS[:-3]), ["line 42: the record ends after 197 of the 200 samples that line 12 announces"]),
        (knet(counts=[*COUNTS, 1]), ["line 43: the record goes on beyond the 200"]),
        (knet(counts=[*COUNTS[:9], "80x6", *COUNTS[10:]]), ['line 19: "80x6" is no number']),
        (knet(counts=[*COUNTS[:9], "nan", *COUNTS[10:]]), ["line 19", "not a finite"]),
        (knet(counts=[]), ["line 17: the record ends after 0 of the 200"]),
        ("", ["is empty"]),
    ],
)
def test_damaged_knet(tmp_path: Path, text: str, words: list[str]) -> None:
    error = refused(tmp_path, text, "a.NS")
    for word in words:
        assert word in str(error)


# ------------------------------------------------------------------------------------------------ files


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"does not exist\. The path is taken from the scenario's folder"):
        read_record(tmp_path / "none.at2")
    with pytest.raises(RecordError, match="cannot be read"):
        read_record(tmp_path)
    (tmp_path / "a.at2").write_bytes(b"\x89HDF\r\n\0\0")
    with pytest.raises(RecordError, match="is no text file"):
        read_record(tmp_path / "a.at2")


def test_japanese_code_page(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(csv("# 仙台\n時刻(s),南北(gal)").encode("cp932"))
    assert read_record(tmp_path / "a.csv").component == "南北"


def test_format_may_be_told(tmp_path: Path) -> None:
    """A format that is told is taken at its word; keys of CSV have no meaning for others."""
    assert "line 4: NPTS" in str(refused(tmp_path, csv(), kind="at2"))
    assert "line 17: the line Memo." in str(refused(tmp_path, csv(), kind="knet"))
    for key, value in (("column", "ax"), ("unit", "gal"), ("interval", 0.01)):
        error = refused(tmp_path, at2(), "a.at2", **{key: value})
        assert (error.key, error.rule) == (key, "has no meaning for PEER AT2, whose file says it all")
