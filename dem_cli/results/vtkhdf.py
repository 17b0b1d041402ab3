"""The temporal PolyData of grains in 2D: elements as vertices, contacts, walls and bonds as lines. One frame is one step.

The tensor of a sample of discs alone is written once; where there are ellipses it turns with them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from dem_cli.results.bonds import append_strain, create_bonds
from dem_cli.results.frames import frame_row, place
from dem_cli.results.layouts import Layout
from dem_cli.results.polydata import Arrays, PolyData
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
from dem_cli.results.tables import Table
from dem_cli.results.walls import box_corners, drawn_walls
from dem_cli.state import Bonds, Contacts, Floats, Frame, Grains, Increment, Ints, Walls


class FrameWriter:
    """Appends frames to /VTKHDF and /frames of an open file; `commit` makes them visible to readers of the format."""

    def __init__(self, file: Any, layout: Layout, grains: Grains, walls: Walls, bonds: Bonds) -> None:
        self._layout = layout
        self._n = len(grains)
        self._fixed = {name: getattr(grains, name).copy() for name in ("radius", "a", "b", "body")}
        self._turning = bool(np.any(grains.a != grains.b))
        self._walls = box_corners(walls, grains) if layout.moving else drawn_walls(walls, grains)
        self._bonds = np.stack([bonds.i, bonds.j], axis=1)
        once: Arrays = {
            name: (getattr(grains, name),) for name in ("id", "body", "radius", "a", "b", "mass", "inertia")
        }
        if not self._turning:
            once["shape"] = (2.0 * grains.radius, 2.0 * grains.radius)
        columns = {**POINT_DATA, **({"shape": TURNING_SHAPE} if self._turning else {})}
        self._data = PolyData(file, self._n, columns, CELL_DATA, Column("m", "position", "f8", 3, (0, 1)), once)
        self._strain = create_bonds(file, bonds)
        self._table = Table(file.require_group("frames"), layout.frames, layout.axis)

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
        # a step with no line would make VTK misread the next one
        lines = max(1, len(contacts) + ends // 2 + len(self._bonds))
        xyz = [
            np.concatenate([center, self._walls[:, axis], foot[feet]])
            for axis, center, foot in ((0, grains.x, contacts.px), (1, grains.y, contacts.py))
        ]
        moving = _of_grains(grains, coordination, stress)
        if self._turning:
            moving["shape"] = _shape(grains)
        cells = _of_contacts(contacts, lines, ends // 2, len(self._bonds))
        self._data.append(place(frame), xyz, moving, cells, self._pairs(contacts, feet, lines))
        self._table.append(place(frame), frame_row(frame, row))
        return self.size(frame)

    def _pairs(self, contacts: Contacts, feet: Ints, lines: int) -> npt.NDArray[np.int32]:
        """Contacts, then walls, then bonds, as pairs of points."""
        ends = len(self._walls)
        pairs = np.zeros((lines, 2), dtype=np.int32)
        pairs[: len(contacts), 0] = contacts.i
        pairs[: len(contacts), 1] = contacts.j
        pairs[feet, 1] = self._n + ends + np.arange(len(feet))
        walls = slice(len(contacts), len(contacts) + ends // 2)
        pairs[walls] = self._n + np.arange(ends).reshape(-1, 2)
        pairs[walls.stop : walls.stop + len(self._bonds)] = self._bonds
        return pairs

    def flush(self) -> None:
        """Hand over the rows with one entry a step."""
        self._table.flush()
        if self._strain is not None:
            self._strain.flush()
        self._data.flush()

    def trim(self) -> None:
        """Cut the room kept for more frames, at the end of a run."""
        self._data.trim()

    def commit(self) -> None:
        """Count the frames handed over so far, once their data have reached the file: readers of VTKHDF go by that."""
        self._table.commit()
        if self._strain is not None:
            self._strain.commit()
        self._data.commit()


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
