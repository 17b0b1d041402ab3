"""The numbers of one frame beside its arrays, to the file and back: of an instant (`Frame`) and of an increment (`Increment`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli.results.schema import FRAMES, INCREMENT_FRAMES
from dem_cli.state import (
    BondStrain,
    Contacts,
    Energy,
    Floats,
    Frame,
    Grains,
    Increment,
    Ints,
    QuasiStaticEnergy,
    Slips,
    Walls,
)

ENERGY = {  # field of Energy -> name in the file
    "kinetic": "kinetic",
    "potential": "potential",
    "elastic_normal": "elastic_normal",
    "elastic_tangential": "elastic_tangential",
    "friction": "friction",
    "dashpot_normal": "dashpot_normal",
    "dashpot_tangential": "dashpot_tangential",
    "bonds": "bond_energy",
    "damping": "damping",
    "escaped": "escaped_energy",
    "time_step": "time_step_energy",
    "work": "work",
}
GROUND = ("ground_x", "ground_y", "ground_vx", "ground_vy", "ground_ax", "ground_ay")
# The ledger of a quasi-static test has the same names as the file.
WORK = (
    "work", "body_work", "elastic_normal", "elastic_tangential", "elastic_membrane", "friction", "released", "residual",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class StoredFrame(Frame):
    """A frame read back: as it was written, bit for bit, but for `forces`, `warnings` and `stop_reason`, which are not kept.

    coordination (n,). stress (n, 4) [Pa]: xx, xy, yx, yy, in single precision.
    """

    walls: Walls
    coordination: Ints
    stress: Floats


@dataclass(frozen=True, kw_only=True)
class StoredIncrement(Increment):
    """An increment read back, bit for bit, but for `warnings` and `stop_reason`, which are not kept, and `slips`: only those ranked highest.

    walls: where they were then, drawn from corner to corner. coordination (n,). grain_stress (n, 4) [Pa]: xx, xy, yx, yy of each element,
    in single precision. row: of the series that belongs to it, -1 if there is none.
    """

    coordination: Ints
    grain_stress: Floats
    row: int


def place(state: Frame | Increment) -> float:
    """Where a state lies on the axis of its file: time [s], or the number of increments done."""
    return float(state.number) if isinstance(state, Increment) else state.time


def frame_row(state: Frame | Increment, row: int) -> list[float]:
    """The numbers of a state in the order of the file's columns, that of the axis left out. row: of the series that belongs to it."""
    return _increment_row(state, row) if isinstance(state, Increment) else _instant_row(state)


def _instant_row(frame: Frame) -> list[float]:
    values: dict[str, float] = {
        "step": frame.step,
        "stage": frame.stage,
        "time_step": frame.dt,
        "residual": frame.residual,
        "energy_in": frame.energy_in,
        "unbalanced": frame.unbalanced,
        "stage_start": frame.stage_start,
        "stage_end": frame.stage_end,
        **dict(zip(GROUND, np.ravel(frame.ground).tolist(), strict=True)),
        **{name: getattr(frame.energy, field) for field, name in ENERGY.items()},
    }
    return [values[name] for name in FRAMES if name != "time"]


def _increment_row(increment: Increment, row: int) -> list[float]:
    values: dict[str, float] = {
        "stress_x": increment.stress[0],
        "stress_y": increment.stress[1],
        "strain_x": increment.strain[0],
        "strain_y": increment.strain[1],
        "row": row,
        **{name: getattr(increment.energy, name) for name in WORK},
    }
    return [
        float(values[name] if name in values else getattr(increment, name))
        for name in INCREMENT_FRAMES
        if name != "increment"
    ]


def stored_frame(
    row: Mapping[str, float],
    grains: Grains,
    contacts: Contacts,
    bonds: BondStrain | None,
    walls: Walls,
    coordination: Ints,
    stress: Floats,
) -> StoredFrame:
    """A frame from its numbers and arrays."""
    return StoredFrame(
        step=int(row["step"]),
        time=row["time"],
        dt=row["time_step"],
        stage=int(row["stage"]),
        grains=grains,
        ground=np.array([row[name] for name in GROUND]).reshape(3, 2),
        # What an old file does not know of is 0.
        energy=Energy(**{field: row.get(name, 0.0) for field, name in ENERGY.items()}),
        residual=row["residual"],
        energy_in=row["energy_in"],
        due=frozenset({"frames"}),
        contacts=contacts,
        bonds=bonds,
        unbalanced=row["unbalanced"],
        stage_start=bool(row["stage_start"]),
        stage_end=bool(row["stage_end"]),
        walls=walls,
        coordination=coordination,
        stress=stress,
    )


def stored_increment(
    row: Mapping[str, float],
    grains: Grains,
    contacts: Contacts,
    slips: Slips,
    walls: Walls,
    boundary: int,
    coordination: Ints,
    grain_stress: Floats,
) -> StoredIncrement:
    """An increment from its numbers and arrays."""
    numbers: dict[str, Any] = {
        **{name: int(row[name]) for name in ("stage", "in_stage", "axial", "iterations", "sub_steps", "rung", "row")},
        **{name: row[name] for name in ("width", "height", "area", "pore_pressure", "balance", "unbalanced")},
        **{name: bool(row[name]) for name in ("event", "stage_start", "stage_end")},
    }
    return StoredIncrement(
        number=int(row["increment"]),
        **numbers,
        grains=grains,
        walls=walls,
        contacts=contacts,
        slips=slips,
        stress=np.array([row["stress_x"], row["stress_y"]]),
        strain=np.array([row["strain_x"], row["strain_y"]]),
        energy=QuasiStaticEnergy(**{name: row[name] for name in WORK}),
        boundary=boundary,
        due=frozenset({"frames"}),
        coordination=coordination,
        grain_stress=grain_stress,
    )
