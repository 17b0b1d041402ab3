"""Recorded motions from CSV: columns with or without time, units in the header, read liberally and said so.

What is understood: cells divided by commas, semicolons, tabs or blanks; a header `time [s], ax [gal]` or `NS(cm/s^2)`, `acc_g`;
comments (#, %, //, !) and lines of text above the numbers, and in them `dt = 0.01 s`, `SAMPLING RATE= 100Hz`, `UNIT = gal`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from decimal import Decimal

import numpy as np

from dem_cli.scenario.raw_record import (
    Floats,
    RawRecord,
    RecordError,
    acceleration_unit,
    enough,
    number,
    unit_value,
)
from dem_cli.scenario.table import did_you_mean

_COMMENT = re.compile(r"^\s*(#|%|//|!)+\s?")
_TIME = re.compile(r"t|times?|sec|seconds|elapsed.*|time\b.*|時刻|時間|経過時間", re.IGNORECASE)
_NUMBER = r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
_BRACKET = r"\s*(?:[\[(]([^\])]*)[\])])?"
_INTERVAL = re.compile(
    rf"\b(?:dt|delta|time[ _]step|(?:sampling[ _])?(?:interval|period))\b{_BRACKET}\s*[=:,]?\s*{_NUMBER}\s*([a-zA-Z]*)",
    re.IGNORECASE,
)
_RATE = re.compile(
    rf"\b(?:fs|sampling[ _](?:rate|freq\w*)){_BRACKET}\s*[=:,]?\s*{_NUMBER}\s*([a-zA-Z]*)", re.IGNORECASE
)
_UNIT = re.compile(r"\bunits?\s*(?:[=:]|of\b|in\b)\s*([^\s,;]+)", re.IGNORECASE)
SLACK = 1e-3  # of an interval: unevenness of times that a file may have beyond the rounding of its digits


@dataclass
class _Head:
    """What stands above the numbers. names and units of columns, unit of all, interval [s], each with its line; start: of data."""

    start: int = 0
    separator: str = " "
    names: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    line: int = 0
    unit: str = ""
    unit_line: int = 0
    interval: float | None = None
    interval_line: int = 0
    said: list[str] = field(default_factory=list)


def read_csv(
    name: str, lines: list[str], *, column: str | None = None, unit: str | None = None, interval: float | None = None
) -> RawRecord:
    """The record of a CSV file. column: name or number (from 1) of the one to take; unit, interval [s]: what the file leaves out."""
    head = _head(lines)
    table, texts, places = _rows(lines, head)
    columns = table.shape[1]
    names = head.names or [f"column {k + 1}" for k in range(columns)]
    units = head.units or [""] * columns
    time = _time_column(names, units, table, head, told=interval is not None or head.interval is not None)
    chosen = _chosen(column, names, time)
    values = enough(table[:, chosen], places[-1])
    value, said_unit = _unit_of(units[chosen], head, unit)
    step, said_step = _interval(table, time, texts, places, units, head, interval)
    label = names[chosen] if head.names else f"column {chosen + 1}"
    understood = "; ".join([f"{len(table)} samples of {label} in {said_unit}", said_step, *head.said])
    return RawRecord(name, "csv", label, step, values * value, understood)


def _cells(text: str, separator: str) -> list[str]:
    if separator == " ":
        return text.split()
    cells = [cell.strip().strip('"').strip() for cell in text.split(separator)]
    while len(cells) > 1 and not cells[-1]:
        cells.pop()
    return cells


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _head(lines: list[str]) -> _Head:
    head = _Head(start=-1)
    for k, text in enumerate(lines):
        if not text.strip() or _COMMENT.match(text):
            continue
        separator = next((one for one in ";,\t" if one in text), " ")
        cells = _cells(text, separator)
        if all(_is_number(cell) for cell in cells):
            head.start, head.separator = k, separator
            break
        if separator == ";" and all(_is_number(cell.replace(",", ".", 1)) for cell in cells):
            raise RecordError(f"line {k + 1}: has decimal commas", "Write points: 0.01;1.5")
    if head.start < 0:
        raise RecordError("holds no line of numbers", "Write a header such as time [s], ax [gal], and a line a sample")
    width = len(_cells(lines[head.start], head.separator))
    for k, text in enumerate(lines[: head.start], 1):
        commented = bool(_COMMENT.match(text))
        text = _COMMENT.sub("", text).strip()
        known = _meta(text, k, head)
        cells = _header_cells(text, head.separator)
        if len(cells) == width and not known and any(re.search(r"[^\W\d]", cell) for cell in cells):
            named = [_name_and_unit(cell) for cell in cells]
            if width > 1 or not commented or named[0][1]:
                head.names, head.units, head.line = [n for n, _ in named], [u for _, u in named], k
    return head


def _header_cells(text: str, separator: str) -> list[str]:
    return _cells(re.sub(r"\s+([\[(])", r"\1", text) if separator == " " else text, separator)


def _meta(text: str, line: int, head: _Head) -> bool:
    """Takes interval and unit from a line of text above the numbers; whether there were any."""
    known = False
    for pattern, unit, assumed in ((_INTERVAL, "s", "s"), (_RATE, "Hz", "Hz")):
        if found := pattern.search(text):
            given = found[1] or found[3] or assumed
            factor, amount = unit_value(given, unit), float(found[2])
            if factor is None or amount <= 0.0:
                raise RecordError(
                    f'line {line}: "{found[0].strip()}" gives no interval', "Write for example dt = 0.01 s"
                )
            head.interval = amount * factor if unit == "s" else 1.0 / (amount * factor)
            head.interval_line = line
            known = True
    if found := _UNIT.search(text):
        head.unit, head.unit_line = found[1], line
        known = True
    return known


def _name_and_unit(cell: str) -> tuple[str, str]:
    """A header cell such as `ax [gal]`, `NS(cm/s^2)`, `acc_gal`, `time, s`."""
    if found := re.fullmatch(r"(.*?)\s*[\[(]([^\])]*)[\])]\s*", cell):
        return found[1].strip() or cell, found[2].strip()
    if (found := re.fullmatch(r"(.+?)(?:_|,|/|\s+in\s+|\s+)\s*([A-Za-z%][^\s_]*)", cell)) and (
        unit_value(found[2], "m/s^2") is not None or found[2] in ("s", "sec", "ms")
    ):
        return found[1].strip(), found[2]
    return cell, ""


def _rows(lines: list[str], head: _Head) -> tuple[Floats, list[list[str]], list[int]]:
    """Numbers (samples, columns), the same as texts, and the line of each sample."""
    texts: list[list[str]] = []
    places: list[int] = []
    for k, text in enumerate(lines[head.start :], head.start + 1):
        if text.strip() and not _COMMENT.match(text):
            texts.append(_cells(text, head.separator))
            places.append(k)
    width = len(texts[0])
    remedy = "Correct the line: one sample a line, without gaps"
    rows: list[list[float]] = []
    for cells, place in zip(texts, places, strict=True):
        if len(cells) != width:
            raise RecordError(f"line {place}: has {len(cells)} of {width} values", remedy)
        rows.append([number(cell, place, remedy) for cell in cells])
    return np.array(rows, dtype=np.float64), texts, places


def _time_column(names: list[str], units: list[str], table: Floats, head: _Head, *, told: bool) -> int | None:
    """The column that holds the time. told: the interval is known from elsewhere."""
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        if (_TIME.fullmatch(name) and unit_value(unit or "s", "s") is not None) or (
            unit and unit_value(unit, "s") is not None
        ):
            return k
    if not head.names and not told and table.shape[1] > 1 and len(table) > 1 and np.all(np.diff(table[:, 0]) > 0.0):
        head.said.append("the first column was taken for the time in s, because it rises")
        return 0
    return None


def _chosen(column: str | None, names: list[str], time: int | None) -> int:
    """Index of the column of accelerations."""
    others = [k for k in range(len(names)) if k != time]
    if not others:
        raise RecordError("holds times alone", "Add a column of accelerations")
    if column is None:
        return others[0]
    named = [k for k, name in enumerate(names) if name.casefold() == column.strip().casefold()]
    counted = column.strip().isdigit() and 1 <= int(column) <= len(names)
    if not named and not counted:
        raise RecordError("is no column of the file", did_you_mean(column, [names[k] for k in others]), "column")
    k = named[0] if named else int(column) - 1
    if k == time:
        raise RecordError("is the time", f"Take {' or '.join(names[n] for n in others)}", "column")
    return k


def _unit_of(of_column: str, head: _Head, told: str | None) -> tuple[float, str]:
    """SI value of the unit of the chosen column, and how it was found out."""
    inside, line = (of_column, head.line) if of_column else (head.unit, head.unit_line)
    own = acceleration_unit(inside, f"line {line}: ", "file") if inside else None
    if told is None:
        if own is None:
            rule = f"line {head.line or head.start + 1}: the unit of the acceleration is missing"
            raise RecordError(rule, 'Write it in the header, as in ax [gal], or in the scenario: unit = "gal"')
        return own, f"{inside}"
    value = acceleration_unit(told, "", "unit")
    if own is not None and abs(own - value) > 1e-9 * value:
        raise RecordError(f"contradicts the {inside} of line {line} of the file", "Leave it out", "unit")
    return value, told


def _interval(
    table: Floats,
    time: int | None,
    texts: list[list[str]],
    places: list[int],
    units: list[str],
    head: _Head,
    told: float | None,
) -> tuple[float, str]:
    """Time between samples [s], and how it was found out."""
    found, said = head.interval, f"every {head.interval:g} s (line {head.interval_line})" if head.interval else ""
    if time is not None and len(table) > 1:
        scale = unit_value(units[time] or "s", "s") or 1.0
        step = _even(table[:, time], [row[time] for row in texts], places) * scale
        if found is not None and abs(found - step) > 0.01 * step:
            rule = f"line {head.interval_line}: an interval of {found:g} s, where the times have {step:g} s"
            raise RecordError(rule, "Correct the one that is wrong")
        found, said = step, f"every {step:g} s by its times" + ("" if units[time] else ", taken for seconds")
    if told is None:
        if found is None:
            raise RecordError(
                f"line {head.line or head.start + 1}: neither times nor an interval are given",
                'Add a column time [s], a comment dt = 0.01 s, or in the scenario: interval = "0.01 s"',
            )
        return found, said
    if found is not None and abs(found - told) > 0.01 * told:
        raise RecordError(f"contradicts the file, which has {found:g} s", "Leave it out", "interval")
    return (told, f"every {told:g} s as told") if found is None else (found, said)


def _even(time: Floats, texts: list[str], places: list[int]) -> float:
    """The interval of even times. Uneven by more than their digits explain, they are refused: a gap cannot be filled in."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    if (back := np.flatnonzero(steps <= 0.0)).size:
        k = int(back[0])
        rule = f"line {places[k + 1]}: the time does not rise, {time[k]:g} is followed by {time[k + 1]:g}"
        raise RecordError(rule, "Put the samples in order, one a line")
    mean = float(time[-1] - time[0]) / (len(time) - 1)
    digit = max(_last_digit(text) for text in texts)
    allowed = max(SLACK * mean, min(1.1 * digit, 0.25 * mean))
    off = np.abs(time - (time[0] + mean * np.arange(len(time))))
    if off.max() > allowed:
        uneven = np.flatnonzero(np.abs(steps - usual) > max(0.5 * allowed, 0.01 * usual))
        k = int(uneven[0]) if uneven.size else int(np.argmax(off)) - 1
        rule = f"line {places[k + 1]}: {steps[k]:.6g} after the time before, where {usual:.6g} is usual"
        raise RecordError(rule, "Give samples at even times; fill the gap or resample the record")
    return mean


def _last_digit(text: str) -> float:
    """What the last digit of a number as written stands for."""
    exponent = Decimal(text.strip()).as_tuple().exponent
    return 10.0 ** int(exponent) if isinstance(exponent, int) else 0.0
