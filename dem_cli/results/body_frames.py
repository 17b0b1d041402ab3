"""Frames of bodies in 3D, to the file and back: /VTKHDF, with bodies as vertices and contacts and edges of planes as lines, and /frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli.results.body_schema import BODY_CELL_DATA, BODY_FRAMES, BODY_POINT_DATA, CONTACT_KINDS, FIXED
from dem_cli.results.layouts import IMPULSE
from dem_cli.results.polydata import Arrays, PolyData
from dem_cli.results.schema import KIND_CONTACT, KIND_NOTHING, KIND_WALL, KIND_WALL_CONTACT, Column
from dem_cli.results.tables import Table
from dem_cli.rigid import Bodies, BodyContacts, BodyFrame, ImpulseEnergy, Planes, Solving, coordination
from dem_cli.state import Floats, Ints

ENERGY = {  # field of ImpulseEnergy -> name in the file
    "kinetic": "kinetic",
    "rotational": "rotational",
    "potential": "potential",
    "restitution": "restitution_energy",
    "friction": "friction",
    "escaped": "escaped_energy",
    "projection": "projection",
    "work": "work",
}
SOLVING = {  # field of Solving -> name in the file
    "steps": "steps",
    "impacts": "impacts",
    "impact_iterations": "impact_iterations",
    "load_sweeps": "load_sweeps",
    "most": "most_iterations",
    "capped": "capped",
    "residual": "solver_residual",
    "islands": "islands",
    "largest_island": "largest_island",
}
WHOLE = ("steps", "impacts", "most", "capped", "islands", "largest_island")  # fields of Solving
GROUND = tuple(f"ground_{kind}{axis}" for kind in ("", "v", "a") for axis in "xyz")


@dataclass(frozen=True, kw_only=True)
class StoredBodyFrame(BodyFrame):
    """A frame read back: as it was written, bit for bit, but for `warnings` and `stop_reason`, which are not kept.

    coordination (n,): bodies, planes and terrain that each body touches.
    """

    contacts: BodyContacts
    coordination: Ints


class BodyFrameWriter:
    """Appends frames to /VTKHDF and /frames of an open file; `commit` makes them visible to readers of the format."""

    def __init__(self, file: Any, bodies: Bodies, planes: Planes) -> None:
        self._bodies = bodies
        self._corners = np.asarray(planes.edge, dtype=np.float64).reshape(-1, 3)
        first = len(bodies) + 4 * np.arange(len(planes))[:, None]
        around = first + np.arange(4)
        self._edges = np.stack([around, np.roll(around, -1, axis=1)], axis=2).reshape(-1, 2)
        once: Arrays = {name: (getattr(bodies, name),) for name in FIXED}
        xyz = Column("m", "centre of mass", "f8", 3)
        self._data = PolyData(file, len(bodies), BODY_POINT_DATA, BODY_CELL_DATA, xyz, once)
        self._table = Table(file.require_group("frames"), BODY_FRAMES, IMPULSE.axis)

    def size(self, frame: BodyFrame) -> int:
        """Bytes that a frame takes, to within a few percent."""
        return 130 * len(self._bodies) + 120 * (0 if frame.contacts is None else len(frame.contacts))

    def append(self, frame: BodyFrame) -> int:
        """Hand one frame to HDF5. Returns its bytes."""
        bodies, contacts, n = frame.bodies, frame.contacts, len(self._bodies)
        if contacts is None:
            raise ValueError("a frame without contacts cannot be written")
        if any(not np.array_equal(getattr(bodies, name), getattr(self._bodies, name)) for name in FIXED):
            raise ValueError("the bodies of a frame are not those that the file was begun with")
        feet = np.flatnonzero(contacts.j < 0)
        points = n + len(self._corners) + len(feet)
        # a step with no line would make VTK misread the next one
        lines = max(1, len(contacts) + len(self._edges))
        pairs = np.zeros((lines, 2), dtype=np.int32)
        pairs[: len(contacts), 0] = contacts.i
        pairs[: len(contacts), 1] = contacts.j
        pairs[feet, 1] = n + len(self._corners) + np.arange(len(feet))
        pairs[len(contacts) : len(contacts) + len(self._edges)] = self._edges
        xyz = np.concatenate([bodies.x, self._corners, contacts.point[feet]])
        cells = _of_contacts(contacts, frame.dt, lines, len(self._edges))
        self._data.append(frame.time, [xyz], _of_bodies(bodies, contacts, points), cells, pairs)
        self._table.append(frame.time, _numbers(frame))
        return self.size(frame)

    def flush(self) -> None:
        """Hand over the rows with one entry a step."""
        self._table.flush()
        self._data.flush()

    def trim(self) -> None:
        """Cut the room kept for more frames, at the end of a run."""
        self._data.trim()

    def commit(self) -> None:
        """Count the frames handed over so far, once their data have reached the file: readers of VTKHDF go by that."""
        self._table.commit()
        self._data.commit()


def _of_bodies(bodies: Bodies, contacts: BodyContacts, points: int) -> Arrays:
    turned = np.zeros((points, 4))
    turned[:, 0] = 1.0  # helper points are not turned: glyphs need a unit quaternion
    turned[: len(bodies)] = bodies.q
    return {
        "orientation": (turned,),
        "velocity": (bodies.v,),
        "angular_velocity": (bodies.w,),
        "speed": (np.linalg.norm(bodies.v, axis=1),),
        "coordination": (coordination(contacts, len(bodies)),),
        "escaped": (bodies.escaped,),
    }


def _of_contacts(contacts: BodyContacts, dt: float, lines: int, edges: int) -> Arrays:
    c = len(contacts)
    kind = np.full(lines, KIND_NOTHING, dtype=np.uint8)
    kind[:c] = np.where(contacts.j < 0, KIND_WALL_CONTACT, KIND_CONTACT)
    kind[c : c + edges] = KIND_WALL
    wall = np.full(lines, -1, dtype=np.int16)
    wall[:c] = np.where(contacts.j < 0, -1 - contacts.j, -1)
    wall[c : c + edges] = np.arange(edges) // 4
    along = np.einsum("ck,ck->c", contacts.impulse, contacts.normal)
    return {
        "kind": (kind,),
        "wall": (wall,),
        "sliding": (contacts.sliding,),
        "gap": (contacts.gap,),
        "normal": (contacts.normal,),
        "contact_point": (contacts.point,),
        "impulse": (contacts.impulse,),
        "normal_impulse": (along,),
        "normal_force": (along / dt if dt > 0.0 else np.full(c, np.nan),),
    }


def _numbers(frame: BodyFrame) -> list[float]:
    """The numbers of a frame in the order of the file's columns, time left out."""
    values: dict[str, float] = {
        "step": frame.step,
        "stage": frame.stage,
        "time_step": frame.dt,
        **dict(zip(GROUND, np.ravel(frame.ground).tolist(), strict=True)),
        **{name: getattr(frame.energy, field) for field, name in ENERGY.items()},
        "residual": frame.residual,
        "energy_in": frame.energy_in,
        **{name: getattr(frame.solving, field) for field, name in SOLVING.items()},
        "stage_start": frame.stage_start,
        "stage_end": frame.stage_end,
    }
    return [values[name] for name in BODY_FRAMES if name != "time"]


# ------------------------------------------------------------------------------------------------ back


def read_bodies(root: Any, k: int, n: int) -> tuple[Bodies, Ints]:
    """Bodies of frame k and their coordination; root: the group /VTKHDF, n: number of bodies."""
    data, start = root["PointData"], int(root["Steps/PointOffsets"][k])
    rows = slice(start, start + n)
    whole = {name: data[name][:n].astype(np.int64) for name in ("id", "group", "shape", "material")}
    bodies = Bodies(
        **whole,
        scale=data["scale"][:n],
        x=root["Points"][rows],
        q=data["orientation"][rows],
        v=data["velocity"][rows],
        w=data["angular_velocity"][rows],
        mass=data["mass"][:n],
        inertia=data["inertia"][:n],
        escaped=data["escaped"][rows].astype(bool),
    )
    return bodies, data["coordination"][rows].astype(np.int64)


def read_contacts(root: Any, k: int, n: int) -> BodyContacts:
    """Contacts of frame k."""
    data = root["CellData"]
    lines, start = int(root["Lines/NumberOfCells"][k]), int(root["Steps/CellDataOffsets/kind"][k]) + n
    count = int(np.count_nonzero(np.isin(data["kind"][start : start + lines], CONTACT_KINDS)))
    rows = slice(start, start + count)
    first = int(root["Steps/ConnectivityIdOffsets"][k, 1])
    pairs = root["Lines/Connectivity"][first : first + 2 * count].reshape(-1, 2).astype(np.int64)
    wall = data["wall"][rows].astype(np.int64)
    return BodyContacts(
        i=pairs[:, 0].copy(),
        j=np.where(wall >= 0, -1 - wall, pairs[:, 1]),
        normal=data["normal"][rows],
        point=data["contact_point"][rows],
        gap=data["gap"][rows],
        impulse=data["impulse"][rows],
        sliding=data["sliding"][rows].astype(bool),
    )


def stored_body_frame(
    row: Mapping[str, float], bodies: Bodies, contacts: BodyContacts, touched: Ints
) -> StoredBodyFrame:
    """A frame from its numbers and arrays. touched: coordination of the bodies."""
    solving: dict[str, Any] = {
        field: int(row[name]) if field in WHOLE else row[name] for field, name in SOLVING.items()
    }
    ground: Floats = np.array([row[name] for name in GROUND]).reshape(3, 3)
    return StoredBodyFrame(
        step=int(row["step"]),
        time=row["time"],
        dt=row["time_step"],
        stage=int(row["stage"]),
        bodies=bodies,
        ground=ground,
        energy=ImpulseEnergy(**{field: row[name] for field, name in ENERGY.items()}),
        residual=row["residual"],
        energy_in=row["energy_in"],
        solving=Solving(**solving),
        due=frozenset({"frames"}),
        contacts=contacts,
        stage_start=bool(row["stage_start"]),
        stage_end=bool(row["stage_end"]),
        coordination=touched,
    )
