"""Numbers of one stage of a quasi-static test, from its rows alone (`shear_rows`): turn of volume change, peak, residual state, energy.

All values are SI; NaN where a quantity is not defined. Strains count from the start of the shearing, as in the series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli.report.shear_rows import (
    Rows,
    densities,
    half_cycles,
    is_undrained,
    row_of_contraction,
    row_of_peak,
    row_of_turn,
)

LIQUEFIED = 0.01  # p'/p0 below which a sample counts as liquefied, where the scenario says nothing
RESIDUAL_SHARE = 0.2  # of a stage's increments, the last ones, that the residual state is the mean of


@dataclass(frozen=True)
class Point:
    """A row of a stage: increment in the stage and of the run, and what the series hold there."""

    in_stage: int
    increment: int
    shear_strain: float
    volumetric_strain: float
    stress_ratio: float
    sine: float
    void_ratio: float


@dataclass(frozen=True)
class Residual:
    """Mean over the last fifth of a stage's increments (`increments` of them)."""

    increments: int
    stress_ratio: float
    sine: float
    void_ratio: float
    volumetric_strain: float


@dataclass(frozen=True)
class Ledger:
    """Energies from the start of a stage to its end over the sample's volume [J/m^3].

    work (with that of gravity) = elastic + friction + released + residual. put_in: sum of |work| of the increments;
    closure: |residual| over put_in; released_share: released over put_in.
    """

    work: float
    elastic: float
    friction: float
    released: float
    residual: float
    put_in: float
    closure: float
    released_share: float


@dataclass(frozen=True)
class Share:
    """Share of the contact that dissipates most in its increment's dissipation: largest, the increment in the stage of it, median."""

    largest: float
    at: int
    median: float


@dataclass(frozen=True)
class Solver:
    """How the increments of a stage were solved. events: increments in the stage that passed through a collapse.

    iterations: median and largest of an increment; per_sub_step: median over the increments of iterations per sub-step; fallbacks:
    increments that needed one, and the highest rung; balance_largest [N].
    """

    events: tuple[int, ...]
    iterations_median: float
    iterations_largest: float
    per_sub_step: float
    fallbacks: int
    rung_highest: int
    balance_largest: float


@dataclass(frozen=True)
class Cycle:
    """One cycle: two stretches of the shear strain, there and back. last: increment in the stage; whole: False if the second is missing.

    amplitude: half the range of the shear strain; mean_stress, pore_pressure [Pa]: at its end; mean_stress_least, pore_pressure_largest.
    """

    number: int
    last: int
    whole: bool
    amplitude: float
    mean_stress: float
    mean_stress_least: float
    pore_pressure: float
    pore_pressure_largest: float


@dataclass(frozen=True)
class Undrained:
    """Pores closed. pore_pressure_largest [Pa]; least p'/p0 (p0: at the start) and its increment in the stage; liquefied: p'/p0 fell
    below `limit`, in cycle `cycle` of a cyclic stage (0 if none).
    """

    pore_pressure_largest: float
    ratio_least: float
    at: int
    limit: float
    liquefied: bool
    cycle: int


@dataclass(frozen=True)
class Shearing:
    """What a stage of shearing did. turn: largest contraction up to the peak, in row 0 where the sample dilates from the start, in that of
    the peak where it contracts up to it; contraction: the largest of the stage; both None where the volume is held. peak: of s1/s2;
    end: the last row.
    """

    turn: Point | None
    contraction: Point | None
    peak: Point | None
    end: Point
    residual: Residual
    energy: Ledger
    share: Share
    undrained: Undrained | None
    cycles: tuple[Cycle, ...]


def solver_of(rows: Rows) -> Solver:
    """How the increments of a stage were solved; row 0 is none of them."""
    inner = {name: values[1:] for name, values in rows.items()}
    needed = inner["rung"] > 0
    sub_steps = np.where(inner["sub_steps"] > 0, inner["sub_steps"], np.nan)
    return Solver(
        events=tuple(inner["in_stage"][inner["event"] > 0].astype(int).tolist()),
        iterations_median=_of(np.median, inner["iterations"]),
        iterations_largest=_of(np.max, inner["iterations"]),
        per_sub_step=_of(np.median, inner["iterations"] / sub_steps),
        fallbacks=int(np.count_nonzero(needed)),
        rung_highest=int(_of(np.max, inner["rung"][needed])) if needed.any() else 0,
        balance_largest=_of(np.max, inner["balance"]),
    )


def shearing_of(rows: Rows, depth: float, kind: str = "shear", limit: float | None = None) -> Shearing:
    """What a stage of `kind` did; row 0 is the state it starts from. limit: p'/p0 at which a sample counts as liquefied."""
    turn, peak, contraction = row_of_turn(rows), row_of_peak(rows), row_of_contraction(rows)
    last = len(rows["in_stage"]) - 1
    cycles = cycles_of(rows) if kind == "cyclic" else ()
    return Shearing(
        turn=None if turn is None else point(rows, turn),
        contraction=None if contraction is None else point(rows, contraction),
        peak=None if peak is None else point(rows, peak),
        end=point(rows, last),
        residual=residual_of(rows),
        energy=ledger_of(rows, depth),
        share=share_of(rows),
        undrained=undrained_of(rows, cycles, LIQUEFIED if limit is None else float(limit)),
        cycles=cycles,
    )


def point(rows: Rows, k: int) -> Point:
    """Row `k`."""
    increment = rows["increment"][k]
    return Point(
        in_stage=int(rows["in_stage"][k]),
        increment=-1 if math.isnan(increment) else int(increment),
        **{
            name: float(rows[name][k])
            for name in ("shear_strain", "volumetric_strain", "stress_ratio", "sine", "void_ratio")
        },
    )


def residual_of(rows: Rows) -> Residual:
    count = len(rows["in_stage"]) - 1
    some = max(1, round(RESIDUAL_SHARE * count))
    names = ("stress_ratio", "sine", "void_ratio", "volumetric_strain")
    return Residual(some, **{name: _of(np.mean, rows[name][1:][-some:]) for name in names})


def ledger_of(rows: Rows, depth: float) -> Ledger:
    found = densities(rows, depth)
    put_in = float(np.abs(np.diff(found["work"])).sum())
    end = {name: float(values[-1]) for name, values in found.items()}
    scale = put_in if put_in > 0.0 else math.nan
    return Ledger(**end, put_in=put_in, closure=abs(end["residual"]) / scale, released_share=end["released"] / scale)


def share_of(rows: Rows) -> Share:
    share = rows["largest_share"][1:]
    if not np.isfinite(share).any():
        return Share(math.nan, 0, math.nan)
    at = int(np.nanargmax(share))
    return Share(float(share[at]), int(rows["in_stage"][1:][at]), float(np.nanmedian(share)))


def undrained_of(rows: Rows, cycles: tuple[Cycle, ...], limit: float) -> Undrained | None:
    """None where pores are drained."""
    if not is_undrained(rows):
        return None
    ratio = rows["mean_stress"] / rows["mean_stress"][0]
    known = np.isfinite(ratio)
    at = int(np.nanargmin(ratio)) if known.any() else 0
    below = np.flatnonzero(ratio < limit)
    first = int(rows["in_stage"][below[0]]) if len(below) else 0
    cycle = next((one.number for one in cycles if one.last >= first), 0) if len(below) else 0
    return Undrained(
        pore_pressure_largest=_of(np.max, rows["pore_pressure"]),
        ratio_least=float(ratio[at]),
        at=int(rows["in_stage"][at]),
        limit=limit,
        liquefied=len(below) > 0,
        cycle=cycle,
    )


def cycles_of(rows: Rows) -> tuple[Cycle, ...]:
    halves = half_cycles(rows)
    found = []
    for k in range(0, len(halves), 2):
        pair = halves[k : k + 2]
        first, last = pair[0][0], pair[-1][1]
        strain, stress, water = (
            rows[name][first : last + 1] for name in ("shear_strain", "mean_stress", "pore_pressure")
        )
        found.append(
            Cycle(
                number=k // 2 + 1,
                last=int(rows["in_stage"][last]),
                whole=len(pair) == 2,
                amplitude=0.5 * float(np.ptp(strain)),
                mean_stress=float(stress[-1]),
                mean_stress_least=_of(np.min, stress),
                pore_pressure=float(water[-1]),
                pore_pressure_largest=_of(np.max, water),
            )
        )
    return tuple(found)


def _of(measure: Any, values: Any) -> float:
    """`measure` of the finite values, NaN if there is none."""
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    return float(measure(finite)) if len(finite) else math.nan
