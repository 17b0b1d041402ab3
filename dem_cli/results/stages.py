"""/stages of a result file: what each stage was, when it began and ended, and the series rows at its ends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli.results.layouts import Layout
from dem_cli.results.tables import TEXT, describe
from dem_cli.state import Floats


@dataclass(frozen=True)
class Stage:
    """One stage of the run: `before` and `after` are the series rows at its ends, {} where there is none; end NaN if it goes on.

    start, end: on the axis of the file, so s, or the number of increments done.
    """

    name: str
    kind: str
    start: float
    end: float
    reason: str
    before: dict[str, float]
    after: dict[str, float]


class StageTable:
    """Columns over `stage`; the series row at its start and end as `before` and `after`, shape (stages, quantities). Stages that are in the
    file, all of them over, are gone on with.
    """

    def __init__(self, file: Any, layout: Layout) -> None:
        self._axis = layout.axis.name
        self._measures = layout.measures
        self._stage = -1
        self._last_place = np.nan
        self._needs_row = False
        self._last_row: list[float] | None = None
        self._columns: dict[str, Any] = {}
        if "stages" in file:
            self._group = file["stages"]
            self._columns = {name: self._group[name] for name in layout.stages}
            self._stage = int(self._group.attrs["rows"]) - 1
            self._last_row = self._columns["after"][self._stage].tolist()
            self._last_place = float(self._columns["end"][self._stage])
            return
        self._group = group = file.create_group("stages")
        group.attrs["rows"] = 0
        quantity = group.create_dataset("quantity", data=self._measures, dtype=TEXT)
        quantity.make_scale("quantity")
        units = group.create_dataset("units", data=[layout.series[name][0] for name in self._measures], dtype=TEXT)
        units.dims[0].attach_scale(quantity)
        for name, (unit, definition) in layout.stages.items():
            text, wide = name in ("name", "kind", "reason"), name in ("before", "after")
            inner = (len(self._measures),) if wide else ()
            kind = TEXT if text else ("i8" if name == "stage" else "f8")
            dataset = group.create_dataset(name, (0, *inner), kind, maxshape=(None, *inner), chunks=(16, *inner))
            describe(dataset, unit, definition)
            self._columns[name] = dataset
        self._columns["stage"].make_scale("stage")
        for name, dataset in self._columns.items():
            if name != "stage":
                dataset.dims[0].attach_scale(self._columns["stage"])
            if name in ("before", "after"):
                dataset.dims[1].attach_scale(quantity)

    def begin(self, name: str, kind: str, place: float, measures: Mapping[str, float] | None) -> None:
        """measures: the series row at the start; if left out, the last row known if it is of this place, else the next one."""
        self._stage += 1
        self._put(stage=self._stage, name=name, kind=kind, start=place, end=np.nan, reason="")
        self._put(before=np.nan, after=np.nan)
        self._needs_row = False
        if measures is not None:
            self.keep(measures)
        if self._last_row is not None and (measures is not None or self._last_place == place):
            self._put(before=self._last_row)
        else:
            self._needs_row = True

    def end(self, place: float, reason: str, measures: Mapping[str, float]) -> None:
        self.keep(measures)
        self._put(end=place, reason=reason, after=self._last_row)

    def keep(self, row: Mapping[str, float]) -> None:
        """Remember a row of the series; it is the `before` of a stage that waits for one."""
        self._last_row = [float(row[name]) for name in self._measures]
        self._last_place = float(row[self._axis])
        if self._needs_row:
            self._needs_row = False
            self._put(before=self._last_row)

    def _put(self, **values: Any) -> None:
        for name, value in values.items():
            dataset = self._columns[name]
            dataset.resize(self._stage + 1, axis=0)
            dataset[self._stage] = value

    def commit(self) -> None:
        self._group.attrs.modify("rows", self._stage + 1)


def read_stages(file: Any) -> list[Stage]:
    group = file["stages"]
    names = list(group["quantity"].asstr()[:])
    count = int(group.attrs["rows"])
    texts = {name: group[name].asstr()[:count] for name in ("name", "kind", "reason")}
    numbers = {name: group[name][:count] for name in ("start", "end", "before", "after")}

    def measures(row: Floats) -> dict[str, float]:
        return {} if np.all(np.isnan(row)) else dict(zip(names, row.tolist(), strict=True))

    return [
        Stage(
            name=str(texts["name"][k]),
            kind=str(texts["kind"][k]),
            start=float(numbers["start"][k]),
            end=float(numbers["end"][k]),
            reason=str(texts["reason"][k]),
            before=measures(numbers["before"][k]),
            after=measures(numbers["after"][k]),
        )
        for k in range(count)
    ]
