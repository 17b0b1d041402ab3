"""Rows of a quasi-static test, stage by stage, with the row that each stage starts from.

Strains are those of the series: they count from the start of the shearing, compression and contraction > 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.results.schema import INCREMENTS
from dem_cli.state import Floats

if TYPE_CHECKING:
    from dem_cli.results import Results

Rows = dict[str, Floats]
SLOPE_ROWS = 3  # rows on either side over which a slope is taken, as single increments are noisy
SHEARS = ("shear", "load", "cyclic")  # kinds of stages that shear the sample


def is_quasi_static(results: Results) -> bool:
    """Whether the file counts increments in place of time."""
    return results.axis == "increment"


def stage_rows(results: Results, number: int) -> Rows:
    """All INCREMENTS of stage `number` (from 1); row 0 is the state that the stage starts from, NaN where that is not known.

    A file says what a stage starts from in a row of its own (in_stage = 0), or in /stages alone.
    """
    series = results.series
    inside = np.asarray(series["stage"]) == number - 1
    rows = {name: np.asarray(series[name], dtype=float)[inside] for name in INCREMENTS if name in series}
    if len(rows["in_stage"]) and rows["in_stage"][0] == 0.0:
        return rows
    before = results.stages[number - 1].before
    start = {name: float(before.get(name, math.nan)) for name in rows}
    start.update(in_stage=0.0, stage=number - 1.0)
    return {name: np.concatenate([[start[name]], values]) for name, values in rows.items()}


def shear_stages(results: Results) -> list[int]:
    """Numbers (from 1) of the stages that shear the sample and have at least one increment."""
    done = np.asarray(results.series["stage"])[np.asarray(results.series["in_stage"]) > 0.0]
    return [k for k, stage in enumerate(results.stages, start=1) if stage.kind in SHEARS and np.any(done == k - 1)]


def one_shear_stage(results: Results, number: int | None) -> int:
    """Stage `number`, or the first that shears the sample. ScenarioError if there is none, or it has no increments."""
    found = shear_stages(results)
    if not found:
        raise ScenarioError(f"{results.path}: holds no increment of a stage that shears the sample ({_or(SHEARS)})")
    if number is None or number == 0:
        return found[0]
    if number not in found:
        which = _or([str(k) for k in found])
        raise ScenarioError(f"{results.path}: stage {number} does not shear the sample; choose --stage {which}")
    return number


def is_undrained(rows: Rows) -> bool:
    return bool(np.isfinite(rows["pore_pressure"]).any())


def row_of_contraction(rows: Rows, last: int | None = None) -> int | None:
    """Row of the largest contraction, up to row `last`; None where the volume is held or not known."""
    volume = rows["volumetric_strain"][: None if last is None else last + 1]
    finite = volume[np.isfinite(volume)]
    # A volume that is held constant wanders by rounding alone.
    if len(finite) < 2 or np.ptp(finite) < 1e-10:
        return None
    return int(np.nanargmax(volume))


def row_of_turn(rows: Rows) -> int | None:
    """Row at which contraction turns to dilation: the largest contraction up to the peak, as collapses after it may contract the sample more.

    Of the whole stage where the shear strain goes to and fro.
    """
    return row_of_contraction(rows, None if reverses(rows) else row_of_peak(rows))


def reverses(rows: Rows) -> bool:
    """Whether the shear strain goes to and fro."""
    return len(half_cycles(rows)) > 1


def shown_peak(rows: Rows) -> int | None:
    """The row that pictures call the peak: none where the shear strain goes to and fro."""
    return None if reverses(rows) else row_of_peak(rows)


def row_of_peak(rows: Rows) -> int | None:
    """Row of the largest s1/s2 after the start; None where there is none."""
    ratio = np.where(np.isfinite(rows["stress_ratio"]), rows["stress_ratio"], -np.inf)[1:]
    return int(np.argmax(ratio)) + 1 if len(ratio) and np.isfinite(ratio).any() else None


def densities(rows: Rows, depth: float) -> dict[str, Floats]:
    """Energies since the stage began over the sample's volume [J/m^3]: work (with that of gravity), elastic, friction, released, residual.

    Each increment's share is divided by the area of that increment, so that work = elastic + friction + released + residual.
    """
    area = rows["width"] * rows["height"]
    middle = np.concatenate([area[:1], 0.5 * (area[1:] + area[:-1])]) * depth

    def sum_of(names: Iterable[str]) -> Floats:
        total = np.sum([rows[name] for name in names], axis=0)
        return np.asarray(np.cumsum(np.diff(total, prepend=total[0]) / middle))

    elastic = ("elastic_normal", "elastic_tangential", "elastic_membrane")
    return {
        "work": sum_of(("work", "body_work")),
        "elastic": sum_of(elastic),
        "friction": sum_of(("friction",)),
        "released": sum_of(("released",)),
        "residual": sum_of(("residual",)),
    }


def principal(rows: Rows, name: str) -> tuple[Floats, Floats]:
    """Larger and smaller principal value of the symmetric tensor `name`_xx, _xy, _yy."""
    xx, xy, yy = (rows[f"{name}_{end}"] for end in ("xx", "xy", "yy"))
    mean, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return mean + radius, mean - radius


def half_cycles(rows: Rows) -> list[tuple[int, int]]:
    """First and last row of each stretch in which the shear strain goes one way."""
    way = np.sign(np.diff(rows["shear_strain"]))
    ends = [0]
    last = 0.0
    for k, sign in enumerate(way):
        if sign and last and sign != last:
            ends.append(k)
        last = sign or last
    ends.append(len(way))
    return [(a, b) for a, b in pairwise(ends) if b > a]


def _or(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} or {last}" if most else last


def dilatancy(rows: Rows) -> Floats:
    """-de_v/d(e1 - e2) at each row: slope of the straight line of best fit over SLOPE_ROWS rows before and after it; NaN where nothing is
    sheared.
    """
    x, y = rows["shear_strain"], rows["volumetric_strain"]
    found = np.full(len(x), np.nan)
    for k in range(len(x)):
        part = slice(max(k - SLOPE_ROWS, 0), k + SLOPE_ROWS + 1)
        dx = x[part] - x[part].mean()
        squares = float(dx @ dx)
        if squares > 0.0:
            found[k] = -float(dx @ y[part]) / squares
    return found
