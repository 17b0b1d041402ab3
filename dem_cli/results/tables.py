"""Growing datasets of a result file: rows over a dimension scale, kept back until a flush, written without compression.

Chunks without a filter keep their place in the file: what was flushed once is never moved again, so a process killed while it
writes leaves older rows as they were. Compression was measured: mantissas of moving grains shrink by 15 to 30 %, at ten
times the time of writing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import h5py
import numpy as np
import numpy.typing as npt

ROWS_PER_CHUNK = 512
TEXT = h5py.string_dtype("utf-8")


class Axis(NamedTuple):
    """What the rows of a table are counted by."""

    name: str
    unit: str
    definition: str


TIME = Axis("time", "s", "simulated time")
INCREMENT = Axis("increment", "1", "number of increments done, 0 the start")


class Rows:
    """A dataset that grows by rows, shape (rows,) or (rows, width).

    Uses HDF5's own interface: h5py's slicing costs several times the write of a short row. With `spare` the dataset is kept
    longer than it is filled, so that it need not be resized at every write; `trim` ends that.
    """

    def __init__(self, dataset: Any, *, spare: bool = False) -> None:
        self._id = dataset.id
        self._inner = tuple(dataset.shape[1:])
        self._dtype = dataset.dtype
        self._spare = spare
        self._extent = len(dataset)
        self._space = self._id.get_space()
        self.rows = self._extent  # filled

    def put(self, start: int, values: npt.NDArray[Any], column: int | None = None) -> None:
        """Write `values` from row `start` on: (rows,), (rows, width), or (rows,) into one column of several."""
        values = np.ascontiguousarray(values, dtype=self._dtype)
        count = len(values)
        self.reach(start + count)
        if values.size == 0:
            return
        inner, corner = self._inner, (0,) * len(self._inner)
        if column is not None:
            inner, corner = (1,), (column,)
        # The shape in memory must be that of the selection: HDF5 copies element by element otherwise, 30 times slower.
        self._space.select_hyperslab((start, *corner), (count, *inner))
        self._id.write(h5py.h5s.create_simple((count, *inner)), self._space, values)

    def append(self, values: npt.NDArray[Any]) -> None:
        self.put(self.rows, values)

    def reach(self, rows: int) -> None:
        """Make the dataset at least `rows` long; new rows hold the fill value."""
        self.rows = max(self.rows, rows)
        if rows > self._extent:
            self._resize(rows + rows // 4 + ROWS_PER_CHUNK if self._spare else rows)

    def trim(self) -> None:
        if self._extent > self.rows:
            self._resize(self.rows)

    def _resize(self, extent: int) -> None:
        self._id.set_extent((extent, *self._inner))
        self._extent = extent
        self._space = self._id.get_space()


def describe(dataset: Any, unit: str, definition: str) -> None:
    dataset.attrs["units"] = unit
    dataset.attrs["definition"] = definition


def make_scale(group: Any, name: str, values: Any, unit: str, definition: str) -> Any:
    """A dimension scale of fixed length, unless it is there: the axis that xarray and netCDF tools look for."""
    if name in group:
        return group[name]
    dataset = group.create_dataset(name, data=values)
    dataset.make_scale(name)
    describe(dataset, unit, definition)
    return dataset


class Table:
    """Named columns over time, or over increments, in one group; each a dataset of shape (rows,) or (rows, len(across)). A group that has
    them is gone on with.

    columns: name -> (unit, definition); `axis` is a column of its own, made first. across: scale of the second dimension.
    whole: columns of whole numbers.
    """

    def __init__(
        self,
        group: Any,
        columns: Mapping[str, tuple[str, str]],
        axis: Axis,
        across: Any = None,
        whole: Sequence[str] = (),
    ) -> None:
        self.names = tuple(name for name in columns if name != axis.name)
        self._across = across
        self._width = 1 if across is None else len(across)
        self._pending: list[npt.NDArray[np.float64]] = []
        self._places: list[float] = []
        self._attrs = group.attrs
        if axis.name in group:
            self._scale = Rows(group[axis.name])
            self._columns = [Rows(group[name]) for name in self.names]
            return
        scale = group.create_dataset(axis.name, (0,), "f8", maxshape=(None,), chunks=(ROWS_PER_CHUNK,))
        scale.make_scale(axis.name)
        describe(scale, axis.unit, axis.definition)
        self._columns = [
            self._column(group, name, *columns[name], scale, "i4" if name in whole else "f8") for name in self.names
        ]
        self._scale = Rows(scale)
        self._attrs["rows"] = 0

    def _column(self, group: Any, name: str, unit: str, definition: str, scale: Any, dtype: str) -> Rows:
        inner = () if self._across is None else (self._width,)
        per_chunk = max(1, min(ROWS_PER_CHUNK, 65536 // (8 * max(1, self._width))))
        chunks = (per_chunk, *(max(1, width) for width in inner))
        dataset = group.create_dataset(name, (0, *inner), dtype, maxshape=(None, *inner), chunks=chunks)
        describe(dataset, unit, definition)
        dataset.dims[0].attach_scale(scale)
        if self._across is not None:
            dataset.dims[1].attach_scale(self._across)
        return Rows(dataset)

    def append(self, place: float, values: Sequence[Any]) -> int:
        """Keep one row until the next flush: a number, or an array across, for each column. Returns its bytes.

        place: on the axis of the table.
        """
        row = np.array(values, dtype=np.float64).reshape(len(self.names), self._width)
        self._pending.append(row)
        self._places.append(float(place))
        return row.nbytes

    @property
    def rows(self) -> int:
        """Rows handed to HDF5."""
        return self._scale.rows

    def flush(self) -> None:
        """Hand the kept rows to HDF5."""
        if not self._pending:
            return
        block = np.stack(self._pending, axis=1)  # (columns, rows, width)
        places = np.array(self._places)
        self._pending.clear()
        self._places.clear()
        for column, values in zip(self._columns, block, strict=True):
            column.append(values[:, 0] if self._across is None else values)
        self._scale.append(places)

    def commit(self) -> None:
        """Count the rows handed over so far, once they have reached the file: what a reader may trust after a kill."""
        self._attrs.modify("rows", self._scale.rows)
