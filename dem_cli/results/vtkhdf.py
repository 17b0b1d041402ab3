"""The temporal PolyData under /VTKHDF: elements as vertices, contacts, walls and bonds as lines. One frame is one step.

Format: VTKHDF 2.0 (docs.vtk.org, "VTKHDF File Format"). What no frame changes (static columns of the schema, connectivity of
the vertices) is written once, and all steps point at it. Vectors are chunked column by column, so that the zero z of a 2D run
takes no place in the file; nor do the zeros that contact data has on the elements' vertices. The tensor of a sample of discs alone
is written once too; where there are ellipses it turns with them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from dem_cli.results.bonds import append_strain, create_bonds
from dem_cli.results.frames import frame_row, place
from dem_cli.results.layouts import Layout
from dem_cli.results.schema import (
    CELL_DATA,
    KIND_BOND,
    KIND_CONTACT,
    KIND_NOTHING,
    KIND_WALL,
    KIND_WALL_CONTACT,
    POINT_DATA,
    TURNING_SHAPE,
    Column,
)
from dem_cli.results.tables import ROWS_PER_CHUNK, Rows, Table, describe
from dem_cli.results.walls import box_corners, drawn_walls
from dem_cli.state import Bonds, Contacts, Floats, Frame, Grains, Increment, Ints, Walls

Arrays = dict[str, tuple[npt.NDArray[Any], ...]]


class FrameWriter:
    """Appends frames to /VTKHDF and /frames of an open file; `commit` makes them visible to readers of the format."""

    def __init__(self, file: Any, layout: Layout, grains: Grains, walls: Walls, bonds: Bonds) -> None:
        self._layout = layout
        self._n = len(grains)
        self._fixed = {name: getattr(grains, name).copy() for name in ("radius", "a", "b", "body")}
        self._turning = bool(np.any(grains.a != grains.b))
        self._columns = {**POINT_DATA, **({"shape": TURNING_SHAPE} if self._turning else {})}
        self._walls = box_corners(walls, grains) if layout.moving else drawn_walls(walls, grains)
        self._bonds = np.stack([bonds.i, bonds.j], axis=1)
        # A quarter of the elements a chunk: small enough that the empty part of contact data falls into chunks never written.
        self._chunk = int(2 ** np.clip(np.ceil(np.log2(max(1, self._n) / 4)), 8, 16))
        self._points = self._cells = self._lines = self.steps = 0
        self._spare: list[Rows] = []
        self._pending: list[dict[str, Any]] = []
        self._root = file.create_group("VTKHDF")
        self._root.attrs["Version"] = np.array([2, 0])
        self._root.attrs.create("Type", np.bytes_("PolyData"))
        self._step_data = self._create_steps()
        self._create_topology()
        self._point_data = self._create_columns("PointData", self._columns)
        self._cell_data = self._create_columns("CellData", CELL_DATA)
        self._xyz = self._rows(self._root, "Points", Column("m", "position", "f8", 3, (0, 1)))
        self._once: Arrays = {
            name: (getattr(grains, name),) for name in ("id", "body", "radius", "a", "b", "mass", "inertia")
        }
        if not self._turning:
            self._once["shape"] = (2.0 * grains.radius, 2.0 * grains.radius)
        self._strain = create_bonds(file, bonds)
        self._table = Table(file.create_group("frames"), layout.frames, layout.axis)

    def _column(self, group: Any, name: str, column: Column) -> Any:
        wide = column.width > 1
        inner = (column.width,) if wide else ()
        dataset = group.create_dataset(
            name,
            (0, *inner),
            column.dtype,
            maxshape=(None, *inner),
            chunks=(self._chunk, 1) if wide else (self._chunk,),
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
        inner = (width,) if width else ()
        dataset = group.create_dataset(
            name, (0, *inner), dtype, maxshape=(None, *inner), chunks=(ROWS_PER_CHUNK, *inner)
        )
        for link in links:
            self._root[link] = dataset
        return Rows(dataset)

    def _create_steps(self) -> dict[str, Rows]:
        root, steps = self._root, self._root.create_group("Steps")
        steps.attrs["NSteps"] = 0
        moving = [f"Steps/PointDataOffsets/{name}" for name, column in self._columns.items() if not column.static]
        fixed = [f"Steps/PointDataOffsets/{name}" for name, column in self._columns.items() if column.static]
        cells = [f"Steps/CellDataOffsets/{name}" for name in CELL_DATA]
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
        vertices.append(np.arange(self._n))
        self._connectivity = self._rows(root, "Lines/Connectivity", index)
        self._vertex_offsets = self._rows(root, "Vertices/Offsets", offset)
        self._line_offsets = self._rows(root, "Lines/Offsets", offset)
        for name in ("Polygons", "Strips"):
            self._column(root, f"{name}/Connectivity", index._replace(dtype="i8"))  # as its Offsets

    def _create_columns(self, name: str, columns: Mapping[str, Column]) -> dict[str, Rows]:
        group = self._root.create_group(name)
        return {column: self._rows(group, column, columns[column]) for column in columns}

    def size(self, frame: Frame | Increment) -> int:
        """Bytes that a frame takes, to within a few percent."""
        elements = (87 if self._turning else 71) * self._n
        return elements + 90 * (0 if frame.contacts is None else len(frame.contacts)) + 43 * len(self._bonds)

    def append(self, frame: Frame | Increment, coordination: Ints, stress: Floats, row: int = -1) -> int:
        """Hand one frame to HDF5. coordination (n,), stress (n, 4) [Pa]: xx, xy, yx, yy. row: of /series. Returns its bytes."""
        grains, contacts = frame.grains, frame.contacts
        if contacts is None:
            raise ValueError("a frame without contacts cannot be written")
        if not all(np.array_equal(getattr(grains, name), values) for name, values in self._fixed.items()):
            raise ValueError("the grains of a frame are not those that the file was begun with")
        if isinstance(frame, Increment):
            if 2 * len(frame.walls) != len(self._walls):
                raise ValueError("the walls of a frame are not those that the file was begun with")
            self._walls = box_corners(frame.walls, grains)
        else:
            append_strain(self._strain, frame.time, frame.bonds)
        feet = np.flatnonzero(contacts.j < 0)
        ends = len(self._walls)
        points = self._n + ends + len(feet)
        # a step with no line would make VTK misread the next one
        lines = max(1, len(contacts) + ends // 2 + len(self._bonds))

        for axis, center, foot in ((0, grains.x, contacts.px), (1, grains.y, contacts.py)):
            column = np.concatenate([center, self._walls[:, axis], foot[feet]])
            self._xyz.put(self._points, column, axis)
        self._append_static(points)
        moving = _of_grains(grains, coordination, stress)
        if self._turning:
            moving["shape"] = _shape(grains)
        self._write(self._point_data, self._columns, self._points, points, moving)
        first = self._cells + self._n
        contact_arrays = _of_contacts(contacts, lines, ends // 2, len(self._bonds))
        self._write(self._cell_data, CELL_DATA, first, lines, contact_arrays)
        self._append_lines(contacts, feet, lines)
        self._append_step(place(frame), points, lines)
        self._table.append(place(frame), frame_row(frame, row))
        self._points += points
        self._cells += self._n + lines
        self._lines += lines
        self.steps += 1
        return self.size(frame)

    def _write(
        self, datasets: Mapping[str, Rows], columns: Mapping[str, Column], start: int, rows: int, arrays: Arrays
    ) -> None:
        for name, parts in arrays.items():
            for index, part in zip(columns[name].stored or (None,), parts, strict=True):
                datasets[name].put(start, part, index)
            datasets[name].reach(start + rows)

    def _append_static(self, points: int) -> None:
        """The static columns need as many rows as the longest frame has points."""
        if self.steps == 0:
            self._write(self._point_data, self._columns, 0, points, self._once)
        for name in self._once:
            self._point_data[name].reach(points)

    def _append_lines(self, contacts: Contacts, feet: Ints, lines: int) -> None:
        """Contacts, then walls, then bonds, as pairs of points."""
        ends = len(self._walls)
        pairs = np.zeros((lines, 2), dtype=np.int32)
        pairs[: len(contacts), 0] = contacts.i
        pairs[: len(contacts), 1] = contacts.j
        pairs[feet, 1] = self._n + ends + np.arange(len(feet))
        walls = slice(len(contacts), len(contacts) + ends // 2)
        pairs[walls] = self._n + np.arange(ends).reshape(-1, 2)
        pairs[walls.stop : walls.stop + len(self._bonds)] = self._bonds
        self._connectivity.append(pairs.ravel())
        # One entry more than cells in every step, so that step k starts k entries after the cells before it.
        self._vertex_offsets.append(np.arange(self._n + 1))
        self._line_offsets.append(np.arange(0, 2 * lines + 1, 2))

    def _append_step(self, time: float, points: int, lines: int) -> None:
        self._pending.append(
            {
                "times": time,
                "part": self.steps,
                "parts": 1,
                "point": self._points,
                "cell": [self._n * self.steps, self._lines, 0, 0],
                "connectivity": [0, 2 * self._lines, 0, 0],
                "points": points,
                "cell_data": self._cells,
                "zero": 0,
                "vertices": self._n,
                "lines": lines,
                "line_ends": 2 * lines,
            }
        )

    def flush(self) -> None:
        """Hand over the rows with one entry a step."""
        self._table.flush()
        if self._strain is not None:
            self._strain.flush()
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
        self._table.commit()
        if self._strain is not None:
            self._strain.commit()
        self._root["Steps"].attrs.modify("NSteps", self.steps)


def _of_grains(grains: Grains, coordination: Ints, stress: Floats) -> Arrays:
    return {
        "angle": (grains.angle,),
        "velocity": (grains.vx, grains.vy),
        "spin": (grains.spin,),
        "coordination": (coordination,),
        "stress": (stress[:, 0], stress[:, 1], stress[:, 2], stress[:, 3]),
        "escaped": (grains.escaped,),
    }


def _shape(grains: Grains) -> tuple[Floats, ...]:
    """xx, xy, yx, yy of the tensor whose principal values are the diameters 2a, along `angle`, and 2b, shape (n,) each [m]."""
    c, s = np.cos(grains.angle), np.sin(grains.angle)
    mixed = 2.0 * (grains.a - grains.b) * c * s
    return 2.0 * (grains.a * c**2 + grains.b * s**2), mixed, mixed, 2.0 * (grains.a * s**2 + grains.b * c**2)


def _of_contacts(contacts: Contacts, lines: int, walls: int, bonds: int) -> Arrays:
    kind = np.full(lines, KIND_NOTHING, dtype=np.uint8)
    kind[: len(contacts)] = np.where(contacts.j < 0, KIND_WALL_CONTACT, KIND_CONTACT)
    kind[len(contacts) : len(contacts) + walls] = KIND_WALL
    kind[len(contacts) + walls : len(contacts) + walls + bonds] = KIND_BOND
    wall = np.full(lines, -1, dtype=np.int16)
    wall[: len(contacts)] = np.where(contacts.j < 0, -1 - contacts.j, -1)
    wall[len(contacts) : len(contacts) + walls] = np.arange(walls)
    return {
        "kind": (kind,),
        "wall": (wall,),
        "sliding": (contacts.sliding,),
        "normal_force": (contacts.normal,),
        "shear_force": (contacts.shear,),
        "overlap": (contacts.overlap,),
        "stretch": (contacts.stretch,),
        "normal": (contacts.nx, contacts.ny),
        "contact_point": (contacts.px, contacts.py),
    }
