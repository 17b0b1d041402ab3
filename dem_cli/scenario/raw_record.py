"""A record as its file holds it, and what all readers of records share: errors, text, numbers, units."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dem_cli import units
from dem_cli.errors import ScenarioError

Floats = npt.NDArray[np.float64]
FEWEST = 4  # samples: fewer are no motion, and a parabola would pass through them
FETCH_AGAIN = "The file is damaged or cut off: fetch it again"


class RecordError(ScenarioError):
    """A record that cannot be used. `rule` says where and what is wrong, `remedy` what to do, `key` which key is at fault."""

    def __init__(self, rule: str, remedy: str, key: str = "file") -> None:
        super().__init__(f"{rule}. {remedy}")
        self.rule = rule
        self.remedy = remedy
        self.key = key


@dataclass(frozen=True)
class RawRecord:
    """One component of a motion, as recorded.

    acceleration (n,) [m/s^2] every `interval` [s]; format "csv", "at2" or "knet"; component: direction or column as the file names
    it; understood: in words, what was taken from the file and what was assumed; offset [m/s^2]: the instrument's zero, which the
    peak is counted from (K-NET; 0 elsewhere).
    """

    name: str
    format: str
    component: str
    interval: float
    acceleration: Floats
    understood: str
    offset: float = 0.0

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return self.interval * (len(self.acceleration) - 1)

    @property
    def peak(self) -> float:
        """Largest magnitude [m/s^2], from the instrument's zero."""
        return float(np.abs(self.acceleration - self.offset).max())


def read_lines(path: Path) -> list[str]:
    """The lines of a text file: UTF-8, or the Japanese code page of older files."""
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise RecordError("does not exist", "The path is taken from the scenario's folder") from None
    except OSError as error:
        raise RecordError(f"cannot be read ({error.strerror})", "Name a file that can be read") from None
    if b"\0" in raw:
        raise RecordError("is no text file", "Give the record as text: CSV, PEER AT2 or K-NET ASCII")
    for encoding in ("utf-8-sig", "cp932"):
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            continue
        break
    else:
        text = raw.decode("latin-1")
    if not text.strip():
        raise RecordError("is empty", FETCH_AGAIN)
    return text.splitlines()


def number(text: str, line: int, remedy: str = FETCH_AGAIN) -> float:
    """A finite number that stands on a line (from 1)."""
    try:
        value = float(text)
    except ValueError:
        shown = text if len(text) <= 24 else text[:20] + " ..."
        raise RecordError(f'line {line}: "{shown}" is no number', remedy) from None
    if not math.isfinite(value):
        raise RecordError(f'line {line}: "{text}" is not a finite number', remedy)
    return value


def numbers(numbered: Iterable[tuple[int, str]]) -> tuple[list[float], list[int]]:
    """Numbers separated by blanks, and the line of each."""
    values: list[float] = []
    places: list[int] = []
    for line, text in numbered:
        for word in text.split():
            values.append(number(word, line))
            places.append(line)
    return values, places


def enough(values: list[float] | Floats, line: int) -> Floats:
    """The samples as an array, if they are FEWEST or more; `line` is the last one."""
    if len(values) < FEWEST:
        plural = "" if len(values) == 1 else "s"
        raise RecordError(f"line {line}: the record ends after {len(values)} sample{plural}", FETCH_AGAIN)
    return np.array(values, dtype=np.float64)


_SPELLINGS = ((r"sec\b", "s"), (r"\bs(ec)?2\b", "s^2"), (r"²", "^2"), (r"%\s*g\b", "0.01*gn"))


def unit_value(text: str, unit: str) -> float | None:
    """How many `unit` ("m/s^2", "s", "Hz") one `text` is, None if it does not measure that. Spellings of record files count:
    cm/s/s, cm/sec2, g for gravity, gal(cm/s/s)."""
    name = re.sub(r"[(\[].*$", "", text.strip().strip("()[]").strip())
    name = name.replace("/sec", "/s").strip(" .")
    for pattern, plain in _SPELLINGS:
        name = re.sub(pattern, plain, name)
    if unit == "m/s^2" and re.fullmatch(r"m?[gG]('?s)?", name):
        name = ("m" if name[0] == "m" else "") + "gn"
    if unit == "m/s^2" and name.lower() in ("gal", "gals"):
        name = "gal"
    if unit == "Hz" and name.lower() in ("hz", "sps", "samples/s"):
        name = "Hz"
    if not name:
        return None
    try:
        return units.parse(f"1 {name.replace('0.01*', '')}", unit) * (0.01 if name.startswith("0.01*") else 1.0)
    except units.UnitError:
        return None


def acceleration_unit(text: str, where: str, key: str) -> float:
    """SI value of a unit of acceleration. where: begin of the rule, for example "line 3: "."""
    value = unit_value(text, "m/s^2")
    if value is None:
        other = {"m/s": "a velocity", "m": "a displacement", "s": "a time"}
        is_kind = next((said for unit, said in other.items() if unit_value(text, unit) is not None), "no unit I know")
        raise RecordError(
            f"{where}{text.strip()} is {is_kind}, an acceleration is wanted",
            "Give accelerations, in gal, cm/s^2, m/s^2 or g",
            key,
        )
    return value
