"""A temporal PolyData under /VTKHDF that grows by steps: points, vertices, lines and their data, whatever they stand for.

Format: VTKHDF 2.0 (docs.vtk.org, "VTKHDF File Format"). What no frame changes (static columns of the schema, connectivity of
the vertices) is written once, and all steps point at it. Columns of vectors that are ever zero (the z of a 2D run) are never written, so
they take no place in the file; nor do the zeros that contact data has on the vertices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from dem_cli.results.schema import Column
from dem_cli.results.tables import ROWS_PER_CHUNK, Rows, describe
from dem_cli.state import Floats

# Column of the schema -> its parts: one array for each of `Column.stored`, or a single one.
Arrays = dict[str, tuple[npt.NDArray[Any], ...]]


class PolyData:
    """Appends steps to /VTKHDF of an open file, after those that it has; `commit` makes them visible to readers of the format.

    n: number of vertices, the first points of every step. point_data, cell_data: columns of the schema; xyz: that of the points.
    once: values of the static columns of the points, (n,) or (n, width) a part.
    """

    def __init__(
        self,
        file: Any,
        n: int,
        point_data: Mapping[str, Column],
        cell_data: Mapping[str, Column],
        xyz: Column,
        once: Arrays,
    ) -> None:
        self.n = n
        self._point_columns, self._cell_columns = point_data, cell_data
        # A quarter of the elements a chunk: small enough that the empty part of contact data falls into chunks never written.
        self._chunk = int(2 ** np.clip(np.ceil(np.log2(max(1, n) / 4)), 8, 16))
        self._spare: list[Rows] = []
        self._pending: list[dict[str, Any]] = []
        self._root = file.require_group("VTKHDF")
        self._root.attrs["Version"] = np.array([2, 0])
        self._root.attrs.create("Type", np.bytes_("PolyData"))
        self._step_data = self._create_steps()
        self._create_topology()
        self._point_data = self._create_columns("PointData", point_data)
        self._cell_data = self._create_columns("CellData", cell_data)
        self._xyz_column, self._xyz = xyz, self._rows(self._root, "Points", xyz)
        self._once = once
        self.steps = self._step_data["times"].rows
        self._points = self._xyz.rows
        self._lines = self._connectivity.rows // 2
        self._cells = n * self.steps + self._lines

    def _column(self, group: Any, name: str, column: Column) -> Any:
        if name in group:
            return group[name]
        wide = column.width > 1
        inner = (column.width,) if wide else ()
        each = (1 if column.stored else column.width,) if wide else ()
        dataset = group.create_dataset(
            name,
            (0, *inner),
            column.dtype,
            maxshape=(None, *inner),
            chunks=(self._chunk, *each),
            fillvalue=column.fill,
        )
        describe(dataset, column.unit, column.definition)
        return dataset

    def _rows(self, group: Any, name: str, column: Column) -> Rows:
        rows = Rows(self._column(group, name, column), spare=not column.static)
        self._spare.append(rows)
        return rows

    def _per_step(self, group: Any, name: str, links: Sequence[str] = (), dtype: str = "i8", width: int = 0) -> Rows:
        """One row a step. `links`: paths under /VTKHDF that always hold the same numbers and are the same dataset."""
        if name in group:
            return Rows(group[name])
        inner = (width,) if width else ()
        dataset = group.create_dataset(
            name, (0, *inner), dtype, maxshape=(None, *inner), chunks=(ROWS_PER_CHUNK, *inner)
        )
        for link in links:
            self._root[link] = dataset
        return Rows(dataset)

    def _create_steps(self) -> dict[str, Rows]:
        root, steps = self._root, self._root.require_group("Steps")
        if "NSteps" not in steps.attrs:
            steps.attrs["NSteps"] = 0
        moving = [f"Steps/PointDataOffsets/{name}" for name, column in self._point_columns.items() if not column.static]
        fixed = [f"Steps/PointDataOffsets/{name}" for name, column in self._point_columns.items() if column.static]
        cells = [f"Steps/CellDataOffsets/{name}" for name in self._cell_columns]
        no_cells = ("Offsets", "NumberOfCells", "NumberOfConnectivityIds")
        fixed += [f"{group}/{name}" for group in ("Polygons", "Strips") for name in no_cells]
        return {
            "times": self._per_step(steps, "Values", dtype="f8"),
            "part": self._per_step(steps, "PartOffsets"),
            "parts": self._per_step(steps, "NumberOfParts"),
            "point": self._per_step(steps, "PointOffsets", moving),
            "cell": self._per_step(steps, "CellOffsets", width=4),
            "connectivity": self._per_step(steps, "ConnectivityIdOffsets", width=4),
            "points": self._per_step(root, "NumberOfPoints"),
            "cell_data": self._per_step(root, cells[0], cells[1:]),
            "zero": self._per_step(root, fixed[0], fixed[1:]),
            "vertices": self._per_step(root, "Vertices/NumberOfCells", ["Vertices/NumberOfConnectivityIds"]),
            "lines": self._per_step(root, "Lines/NumberOfCells"),
            "line_ends": self._per_step(root, "Lines/NumberOfConnectivityIds"),
        }

    def _create_topology(self) -> None:
        root = self._root
        index = Column("1", "number of a point", "i4")
        offset = Column("1", "start of a cell in Connectivity", "i4")
        vertices = Rows(self._column(root, "Vertices/Connectivity", index))
        vertices.put(0, np.arange(self.n))
        self._connectivity = self._rows(root, "Lines/Connectivity", index)
        self._vertex_offsets = self._rows(root, "Vertices/Offsets", offset)
        self._line_offsets = self._rows(root, "Lines/Offsets", offset)
        for name in ("Polygons", "Strips"):
            self._column(root, f"{name}/Connectivity", index._replace(dtype="i8"))  # as its Offsets

    def _create_columns(self, name: str, columns: Mapping[str, Column]) -> dict[str, Rows]:
        group = self._root.require_group(name)
        return {column: self._rows(group, column, columns[column]) for column in columns}

    def append(
        self, place: float, xyz: Sequence[Floats], moving: Arrays, cells: Arrays, pairs: npt.NDArray[np.int32]
    ) -> None:
        """Hand one step to HDF5. place: on the axis of the file. xyz: the columns of the points that are stored, (points,) each, or one
        array (points, 3). moving: point data of the vertices, or of more points. pairs (lines, 2): the points that lines join, at least one
        line: a step with none would make VTK misread the next one. cells: data of the lines, of which there may be fewer.
        """
        points, lines = len(xyz[0]), len(pairs)
        self._put(self._xyz, self._xyz_column, self._points, xyz)
        self._append_static(points)
        self._write(self._point_data, self._point_columns, self._points, points, moving)
        self._write(self._cell_data, self._cell_columns, self._cells + self.n, lines, cells)
        self._connectivity.append(pairs.ravel())
        # One entry more than cells in every step, so that step k starts k entries after the cells before it.
        self._vertex_offsets.append(np.arange(self.n + 1))
        self._line_offsets.append(np.arange(0, 2 * lines + 1, 2))
        self._append_step(place, points, lines)
        self._points += points
        self._cells += self.n + lines
        self._lines += lines
        self.steps += 1

    def _put(self, rows: Rows, column: Column, start: int, parts: Sequence[npt.NDArray[Any]]) -> None:
        for index, part in zip(column.stored or (None,), parts, strict=True):
            rows.put(start, part, index)

    def _write(
        self, datasets: Mapping[str, Rows], columns: Mapping[str, Column], start: int, rows: int, arrays: Arrays
    ) -> None:
        for name, parts in arrays.items():
            self._put(datasets[name], columns[name], start, parts)
            datasets[name].reach(start + rows)

    def _append_static(self, points: int) -> None:
        """The static columns need as many rows as the longest frame has points."""
        if self.steps == 0:
            self._write(self._point_data, self._point_columns, 0, points, self._once)
        for name in self._once:
            self._point_data[name].reach(points)

    def _append_step(self, place: float, points: int, lines: int) -> None:
        self._pending.append(
            {
                "times": place,
                "part": self.steps,
                "parts": 1,
                "point": self._points,
                "cell": [self.n * self.steps, self._lines, 0, 0],
                "connectivity": [0, 2 * self._lines, 0, 0],
                "points": points,
                "cell_data": self._cells,
                "zero": 0,
                "vertices": self.n,
                "lines": lines,
                "line_ends": 2 * lines,
            }
        )

    def flush(self) -> None:
        """Hand over the rows with one entry a step."""
        if self._pending:
            for name, rows in self._step_data.items():
                rows.append(np.array([step[name] for step in self._pending]))
            self._pending.clear()

    def trim(self) -> None:
        """Cut the room kept for more frames, at the end of a run."""
        for rows in self._spare:
            rows.trim()

    def commit(self) -> None:
        """Count the frames handed over so far, once their data have reached the file: readers of VTKHDF go by that."""
        self._root["Steps"].attrs.modify("NSteps", self.steps)
