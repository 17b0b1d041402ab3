"""Bonds in a result file: /bonds with what they are over `bond`, and what they have given over `time` (a row a frame) and `bond`."""

from __future__ import annotations

from typing import Any

import numpy as np

from dem_cli.results.schema import BOND_STRAIN, BONDS
from dem_cli.results.tables import TIME, Table, describe, make_scale
from dem_cli.state import Bonds, BondStrain


def create_bonds(file: Any, bonds: Bonds) -> Table | None:
    """The table of strains, to be appended to at every frame; None, and no group, where there are no bonds."""
    if len(bonds) == 0:
        return None
    begun = "bonds" in file
    group = file.require_group("bonds")
    axis = make_scale(group, "bond", np.arange(len(bonds)), "1", "number of the bond")
    for name, (unit, definition) in () if begun else BONDS.items():
        dataset = group.create_dataset(name, data=getattr(bonds, name))
        describe(dataset, unit, definition)
        dataset.dims[0].attach_scale(axis)
    return Table(group, BOND_STRAIN, TIME, axis)


def append_strain(table: Table | None, time: float, strain: BondStrain | None) -> None:
    """One row of the table; ValueError if a frame tells of bonds that the file has not, or the other way round."""
    if (table is None) != (strain is None):
        raise ValueError("the bonds of a frame are not those that the file was begun with")
    if table is not None and strain is not None:
        table.append(time, [getattr(strain, name) for name in table.names])


def read_bonds(file: Any) -> Bonds:
    if "bonds" not in file:
        return Bonds.none()
    return Bonds(**{name: np.asarray(file["bonds"][name][:]) for name in BONDS})


def read_strain(file: Any, k: int) -> BondStrain | None:
    """What the bonds had given at frame k."""
    if "bonds" not in file:
        return None
    return BondStrain(**{name: np.asarray(file["bonds"][name][k]) for name in BOND_STRAIN})
