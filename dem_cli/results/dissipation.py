"""The contacts that dissipate most in a result file of a quasi-static test: /dissipation over `increment` and `rank`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli.results.layouts import Layout
from dem_cli.results.schema import DISSIPATION, RANKS
from dem_cli.results.tables import Table, make_scale
from dem_cli.state import Floats, Ints, Slips


@dataclass(frozen=True)
class Dissipation:
    """Ranked contacts: increment (t,), a row for each of /series; rank (r,) from 1; i, j, energy [J], share of the increment, (t, r) each.

    Beyond the last contact that slid i and j are -1, energy and share NaN. j is -1 - w for wall w, so only i tells.
    """

    increment: Floats
    rank: Ints
    i: Ints
    j: Ints
    energy: Floats
    share: Floats


def create_dissipation(file: Any, layout: Layout) -> Table | None:
    """The table, to be appended to with every row of the series; None, and no group, where nothing of the kind is kept."""
    if not layout.dissipation:
        return None
    group = file.require_group("dissipation")
    rank = make_scale(group, "rank", np.arange(1, RANKS + 1), "1", "1 is the contact that dissipates most")
    return Table(group, DISSIPATION, layout.axis, rank, whole=("i", "j"))


def ranked(slips: Slips) -> list[Floats]:
    """Columns of DISSIPATION for one increment, (RANKS,) each; contacts that dissipate alike keep their order."""
    order = np.argsort(-slips.energy, kind="stable")[:RANKS]
    total = float(slips.energy[slips.energy > 0.0].sum())
    columns = [np.full(RANKS, fill) for fill in (-1.0, -1.0, np.nan, np.nan)]
    share = slips.energy / total if total > 0.0 else np.full(len(slips), np.nan)
    for column, values in zip(columns, (slips.i, slips.j, slips.energy, share), strict=True):
        column[: len(order)] = values[order]
    return columns


def read_dissipation(file: Any) -> Dissipation | None:
    if "dissipation" not in file:
        return None
    group = file["dissipation"]
    rows = int(group.attrs["rows"])
    return Dissipation(
        increment=np.asarray(group["increment"][:rows]),
        rank=np.asarray(group["rank"][:], dtype=np.int64),
        i=np.asarray(group["i"][:rows], dtype=np.int64),
        j=np.asarray(group["j"][:rows], dtype=np.int64),
        energy=np.asarray(group["energy"][:rows]),
        share=np.asarray(group["share"][:rows]),
    )


def read_slips(file: Any, row: int) -> Slips:
    """The ranked contacts of one row of the series; none for row -1."""
    group = file["dissipation"]
    if not 0 <= row < int(group.attrs["rows"]):
        return Slips(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0))
    i = np.asarray(group["i"][row], dtype=np.int64)
    slid = i >= 0
    return Slips(i[slid], np.asarray(group["j"][row], dtype=np.int64)[slid], np.asarray(group["energy"][row])[slid])
