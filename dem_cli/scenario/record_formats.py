"""Readers of recorded motions: which format a file has, PEER NGA AT2 and K-NET ASCII. CSV: `record_csv`."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dem_cli.scenario.raw_record import (
    FETCH_AGAIN,
    RawRecord,
    RecordError,
    acceleration_unit,
    enough,
    number,
    numbers,
    read_lines,
)
from dem_cli.scenario.record_csv import read_csv

FORMATS = {"csv": "CSV", "at2": "PEER AT2", "knet": "K-NET ASCII"}
HEADER_LINES = 20  # in which a format shows itself
_KNET_SUFFIX = re.compile(r"\.(ns|ew|ud)[12]?$", re.IGNORECASE)


def read_record(
    path: Path,
    kind: str = "auto",
    *,
    column: str | None = None,
    unit: str | None = None,
    interval: float | None = None,
) -> RawRecord:
    """One component of a motion from a file.

    kind: "auto" looks at the file. column, unit and interval [s] say what a CSV leaves open. RecordError: what is wrong, in
    which line, and what to do about it.
    """
    lines = read_lines(path)
    if kind == "auto":
        kind = recognise(path.name, lines)
    if kind == "csv":
        return read_csv(path.name, lines, column=column, unit=unit, interval=interval)
    for key, given in (("column", column), ("unit", unit), ("interval", interval)):
        if given is not None:
            raise RecordError(f"has no meaning for {FORMATS[kind]}, whose file says it all", "Leave it out", key)
    return read_at2(path.name, lines) if kind == "at2" else read_knet(path.name, lines)


def recognise(name: str, lines: list[str]) -> str:
    """The format that a file has, from its head, and from its name where the head is damaged."""
    head = "\n".join(lines[:HEADER_LINES])
    if re.search(r"^\s*(Scale Factor|Sampling Freq|Station Code)", head, re.MULTILINE):
        return "knet"
    if re.search(r"\bNPTS\b", head):
        return "at2"
    if _KNET_SUFFIX.search(name):
        return "knet"
    return "at2" if name.lower().endswith(".at2") else "csv"


def read_at2(name: str, lines: list[str]) -> RawRecord:
    """PEER NGA: three lines of text, a line with NPTS and DT, then the accelerations, several a line, in g.

    The fourth line is written as `NPTS=  4000, DT= .0050 SEC`, and as `4000  0.0050  NPTS, DT` in older files.
    """
    at = next((k for k, text in enumerate(lines[:HEADER_LINES]) if "NPTS" in text.upper()), None)
    if at is None:
        raise RecordError("line 4: NPTS and DT are missing, which head a PEER AT2 file", FETCH_AGAIN)
    count, interval = _npts_and_dt(lines[at], at + 1)
    unit, said = _at2_unit(lines[:at])
    values, places = numbers((k, text) for k, text in enumerate(lines[at + 1 :], at + 2))
    if len(values) != count:
        where = places[count] if len(values) > count else (places[-1] if places else at + 1)
        more = f"goes on beyond the {count}" if len(values) > count else f"ends after {len(values)} of the {count}"
        raise RecordError(f"line {where}: the record {more} samples that line {at + 1} announces", FETCH_AGAIN)
    title = " ".join(lines[1].split()) if at >= 2 else ""
    understood = f"{count} samples of line {at + 1}, every {interval:g} s, {said}"
    component = title.rsplit(",", 1)[-1].strip() if "," in title else ""
    return RawRecord(name, "at2", component, interval, enough(values, len(lines)) * unit, understood)


def _npts_and_dt(text: str, line: int) -> tuple[int, float]:
    """NPTS [-] and DT [s] of the fourth line of an AT2 file, `line` from 1."""
    wanted = 'A line like "NPTS= 4000, DT= .0050 SEC" is wanted'
    value = r"([+-]?[\d.]+(?:[eEdD][+-]?\d+)?)"
    new = re.search(rf"NPTS\s*=\s*{value}.*?\bDT\s*=\s*{value}", text, re.IGNORECASE)
    old = re.match(rf"\s*{value}[\s,]+{value}[\s,]+NPTS", text, re.IGNORECASE)
    found = new or old
    if not found:
        raise RecordError(f'line {line}: NPTS and DT cannot be read from "{" ".join(text.split())[:50]}"', wanted)
    count, interval = (number(word.upper().replace("D", "E"), line, wanted) for word in found.groups())
    if count != int(count) or count < 1 or interval <= 0.0:
        raise RecordError(f"line {line}: NPTS = {count:g} and DT = {interval:g} s are no record", wanted)
    return int(count), interval


def _at2_unit(header: list[str]) -> tuple[float, str]:
    """SI value of the unit of an AT2 file, and how it was found out."""
    for line, text in enumerate(header, 1):
        found = re.search(r"UNITS?\s+(?:OF|IN)\s*:?\s*([^\s,;]+)", text, re.IGNORECASE)
        if found:
            return acceleration_unit(found[1].lower(), f"line {line}: ", "file"), f"in {found[1].lower()}"
        if re.search(r"\b(VELOCITY|DISPLACEMENT)\b", text, re.IGNORECASE):
            raise RecordError(f"line {line}: is no acceleration", "Take the .AT2 file, not .VT2 or .DT2")
    return acceleration_unit("g", "", "file"), "in g, as PEER writes them"


def read_knet(name: str, lines: list[str]) -> RawRecord:
    """K-NET and KiK-net ASCII: a header of keywords up to `Memo.`, then counts, eight a line.

    acceleration = count * scale; the instrument's zero is still in it. The peak, as NIED's own Max. Acc., counts from the mean of
    all samples; baseline = "mean" takes that mean off.
    """
    memo = next((k for k, text in enumerate(lines[:HEADER_LINES]) if text.startswith("Memo")), None)
    if memo is None:
        raise RecordError("line 17: the line Memo. is missing, which ends the header of a K-NET file", FETCH_AGAIN)
    header = dict(enumerate(lines[:memo], 1))

    def value(keyword: str, expected: int) -> tuple[int, str]:
        for line, text in header.items():
            if text.startswith(keyword):
                return line, text[18:].strip() or re.sub(r"^.*?\)\s*|^\S+\s+", "", text).strip()
        raise RecordError(f"line {expected}: {keyword} is missing in the header of a K-NET file", FETCH_AGAIN)

    line, text = value("Scale Factor", 14)
    found = re.fullmatch(r"([\d.]+)\s*\(([^)]+)\)\s*/\s*([\d.]+)", text)
    if not found or not float(found[3]):
        raise RecordError(f'line {line}: "{text}" is no scale factor', "A factor like 3920(gal)/6182761 is wanted")
    scale = float(found[1]) * acceleration_unit(found[2], f"line {line}: ", "file") / float(found[3])
    line, text = value("Sampling Freq", 11)
    rate = number(re.sub(r"\s*Hz$", "", text, flags=re.IGNORECASE), line)
    if rate <= 0.0:
        raise RecordError(f"line {line}: a sampling frequency of {rate:g} Hz is none", FETCH_AGAIN)
    line, text = value("Duration Time", 12)
    wanted = round(number(text, line) * rate)
    values, places = numbers((k, text) for k, text in enumerate(lines[memo + 1 :], memo + 2))
    if len(values) != wanted:
        where = places[wanted] if len(values) > wanted else (places[-1] if places else memo + 1)
        more = f"goes on beyond the {wanted}" if len(values) > wanted else f"ends after {len(values)} of the {wanted}"
        raise RecordError(f"line {where}: the record {more} samples that line {line} announces", FETCH_AGAIN)
    acceleration = enough(values, len(lines)) * scale
    direction, station = (
        next((t[18:].strip() for t in header.values() if t.startswith(w)), "") for w in ("Dir.", "Station Code")
    )
    mean = float(acceleration.mean())
    understood = f"{wanted} samples at {rate:g} Hz, scale factor {found[0]}, zero at {mean * 100.0:.4g} gal"
    if said := _other_maximum(header, float(np.abs(acceleration - mean).max())):
        understood += f"; {said}"
    component = f"{station} {direction}".strip()
    return RawRecord(name, "knet", component, 1.0 / rate, acceleration, understood, mean)


def _other_maximum(header: dict[int, str], peak: float) -> str:
    """A remark if the header's own maximum differs from that of the samples by more than 1 % [m/s^2]."""
    for text in header.values():
        found = re.match(r"Max\.? Acc\. \(gal\)\s+([\d.]+)", text)
        if found and abs(float(found[1]) - 100.0 * peak) > 0.01 * max(float(found[1]), 100.0 * peak):
            return f"its header says a maximum of {found[1]} gal, the samples {100.0 * peak:.4g} gal"
    return ""
