"""Rows of stages of shearing made by hand: each number in them is known."""

from __future__ import annotations

import numpy as np

from dem_cli.report.shear_rows import Rows
from dem_cli.results.schema import INCREMENTS
from dem_cli.state import Floats

STEP = 0.0005
WIDTH, HEIGHT, DEPTH = 0.1, 0.08, 0.01
P0 = 15.0e3
TURN, PEAK, COLLAPSE, LAST = 7, 20, 35, 50


def blank(count: int) -> Rows:
    """Row 0 and `count` increments in which nothing happens."""
    rows = {name: np.zeros(count + 1) for name in INCREMENTS}
    k = np.arange(count + 1.0)
    rows.update(increment=100.0 + k, in_stage=k, axial=np.ones(count + 1), pore_pressure=np.full(count + 1, np.nan))
    rows.update(width=np.full(count + 1, WIDTH), height=np.full(count + 1, HEIGHT), mean_stress=np.full(count + 1, P0))
    rows.update(shear_strain=STEP * k, stress_ratio=np.ones(count + 1), largest_share=np.full(count + 1, np.nan))
    rows["sub_steps"] = np.where(k > 0, 4.0, 0.0)
    return rows


def sheared() -> Rows:
    """Contracts to TURN, dilates, peaks at PEAK, collapses at COLLAPSE into less volume than ever before, and goes on to LAST."""
    rows = blank(LAST)
    k = rows["in_stage"]
    rows["volumetric_strain"] = 1e-4 * np.where(k <= TURN, k, 2.0 * TURN - k) + 0.01 * (k >= COLLAPSE)
    rows["stress_ratio"] = 1.0 + 0.7 * np.interp(k, [0, PEAK, LAST], [0.0, 1.0, 0.4])
    rows["sine"] = (rows["stress_ratio"] - 1.0) / (rows["stress_ratio"] + 1.0)
    rows["void_ratio"] = 0.26 - rows["volumetric_strain"]
    rows["event"] = (k == COLLAPSE).astype(float)
    rows["deviator"] = 2.0 * P0 * rows["sine"]
    return rows


def triangles(*turns: float) -> Floats:
    """Shear strain that goes from one of `turns` to the next in steps of STEP."""
    found = [turns[0]]
    for goal in turns[1:]:
        count = round(abs(goal - found[-1]) / STEP)
        found += np.linspace(found[-1], goal, count + 1)[1:].tolist()
    return np.array(found)


def cyclic() -> Rows:
    """Undrained: three cycles of 1 % up and down and a half one; p' falls evenly to 0.5 % of P0 at the end of the third and stays there."""
    strain = triangles(0.0, 0.01, -0.01, 0.01, -0.01, 0.01, -0.01, 0.0)
    rows = blank(len(strain) - 1)
    rows["shear_strain"] = strain
    third = 20 + 40 * 5  # increments to the end of the third cycle
    rows["mean_stress"] = P0 * np.interp(rows["in_stage"], [0, third], [1.0, 0.005])
    rows["pore_pressure"] = P0 - rows["mean_stress"]
    rows["deviator"] = 1e3 * strain
    return rows
