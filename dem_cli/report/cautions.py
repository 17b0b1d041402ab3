"""What a reader of a run must know before its numbers: cut off, energy astray, grains that lost their shape."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.results import Results
from dem_cli.state import Floats

if TYPE_CHECKING:
    from dem_cli.report.summary import EnergySummary, Run

# Share of the energy put in that the ledger may fail to account for.
RESIDUAL_LIMIT = 1e-3
# A bonded grain keeps its shape up to these: gap and slip over the elements' mean radius, and roll [rad].
STRAIN_LIMIT = 0.01
ROLL_LIMIT = math.radians(1.0)


def cautions(results: Results, run: Run, energy: EnergySummary | None) -> list[str]:
    """Lines to read before the numbers, those of the run itself last."""
    lines = []
    if not run.complete:
        lines.append(f"the run is incomplete ({run.stop_reason or 'it was cut off'}); numbers hold up to its last row")
    if energy is None:
        lines.append("the file holds no series yet")
    elif energy.residual_largest_ratio > RESIDUAL_LIMIT:
        lines.append(
            f"energy: the ledger misses {energy.residual_largest_ratio:.2g} of the energy put in "
            f"(limit {RESIDUAL_LIMIT:g}): take a smaller time step"
        )
    lines += _bond_warnings(results, run)
    return [*lines, *results.warnings]


def _bond_warnings(results: Results, run: Run) -> list[str]:
    """One line if bonded grains have lost their shape; free rolling is none of it."""
    if not run.bonds or not len(results.series["time"]):
        return []
    gap, slip, roll = (largest_of(results.series[f"bond_{name}"]) for name in ("gap", "slip", "roll"))
    stiff = bool(np.all(results.bonds.rolling > 0.0))
    found = []
    if gap > STRAIN_LIMIT * run.element_radius:
        found.append(f"the largest gap is {gap / run.element_radius:.2g} of the mean radius")
    if slip > STRAIN_LIMIT * run.element_radius:
        found.append(f"the largest slip is {slip / run.element_radius:.2g} of the mean radius")
    keys = ["normal and tangential viscosity"] if found else []
    if stiff and roll > ROLL_LIMIT:
        found.append(f"the largest roll is {math.degrees(roll):.2g} deg")
        keys.append("rolling_viscosity")
    if not found:
        return []
    return [
        f"bonds: {', '.join(found)}: the grains no longer keep their shape; raise {' and '.join(keys)} in [grains.bond]"
    ]


def largest_of(values: Floats) -> float:
    """Largest finite value, NaN if there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.max()) if len(finite) else math.nan
