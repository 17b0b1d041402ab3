"""Frames of bodies in 3D packed for the player: shapes once, places and orientations of each frame, contacts, planes and terrain."""

from __future__ import annotations

from typing import Any

import numpy as np

from dem_cli.report.body_quantities import BODY_QUANTITIES
from dem_cli.report.camera import DEFAULT_VIEW
from dem_cli.report.page import codes
from dem_cli.report.page.frames import add_contacts, most_frames, player, readouts, spread
from dem_cli.report.page.model import Player
from dem_cli.report.pieces import lowered, piece
from dem_cli.report.sample import first_frame_of_stage
from dem_cli.report.scene3d import default_color, view_of
from dem_cli.report.solids import hull, solid_of, subdivided
from dem_cli.results import BodyResults, StoredBodyFrame
from dem_cli.rigid import Shape
from dem_cli.state import Floats, Ints

LOGS = ("speed", "spin", "kinetic", "displacement", "rotation")
TOLD = {
    "ground_x": "displacement of the container in x", "ground_ax": "acceleration of the container in x",
    "ground_z": "displacement of the container in z", "ground_az": "acceleration of the container in z",
    "kinetic": "kinetic energy", "contacts": "contact points", "coordination": "touching neighbours of a body",
    "moving": "moving bodies", "fill_height": "fill height", "void_ratio": "void ratio of the fill",
}  # fmt: skip
BYTES_A_BODY, BYTES_A_CONTACT = 26, 17
MOST_TRIANGLES = 40_000  # of all bodies together that a browser paints in time
MOST_TERRAIN = 20_000


def body_player(results: BodyResults, budget: int, title: str) -> Player | None:
    """The frames of a file in at most `budget` characters; None where it holds no frame."""
    if results.n_frames == 0:
        return None
    last = results.frame(-1)
    raw = BYTES_A_BODY * len(last.bodies) + BYTES_A_CONTACT * len(last.contacts)
    indices = spread(results.n_frames, most_frames(raw, budget))
    return player(results, indices, _Read(results, indices).pack, budget, title)


class _Read:
    """Frames of a file as arrays (frames, bodies, ...)."""

    def __init__(self, results: BodyResults, indices: list[int]) -> None:
        self.results, self.indices = results, indices
        self.frames: list[StoredBodyFrame] = [results.frame(k) for k in indices]
        starts = {stage: first_frame_of_stage(results, stage) for stage in {frame.stage for frame in self.frames}}
        begin = {stage: results.frame(first) for stage, first in starts.items()}
        self.values: dict[str, list[Floats]] = {
            name: [
                np.asarray(BODY_QUANTITIES[name].values(frame, begin[frame.stage]), dtype=float)
                for frame in self.frames
            ]
            for name in LOGS
        }
        self.form = forms(results)
        self.ceiling = view_of(results, indices).ceiling

    def pack(self, keep: list[int]) -> tuple[codes.Packer, dict[str, Any]]:
        """Sections and facts of the frames at `keep`."""
        packer, frames = codes.Packer(), [self.frames[k] for k in keep]
        b = frames[0].bodies
        for name in ("scale", "mass"):
            packer.add(name, getattr(b, name).astype(np.float32))
        for name in ("id", "group", "shape"):
            packer.add(name, getattr(b, name).astype(np.uint32))
        shown = np.stack([~f.bodies.escaped & np.isfinite(f.bodies.x).all(axis=1) for f in frames])
        packer.add("shown", shown.astype(np.uint8))
        for axis, name in enumerate("xyz"):
            values = np.stack([f.bodies.x[:, axis] for f in frames])
            known = values[shown]
            low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
            packer.add(name, codes.linear(values, low, high), delta=True, code="linear", low=low, high=high)
        for axis in range(4):
            values = np.stack([f.bodies.q[:, axis] for f in frames])
            packer.add(f"q{axis}", codes.linear(values, -1.0, 1.0), delta=True, code="linear", low=-1.0, high=1.0)
        for name in LOGS:
            values = np.stack([self.values[name][k] for k in keep])
            largest = float(np.abs(values[shown & np.isfinite(values)]).max(initial=0.0))
            packer.add(name, codes.log(values, largest), code="log", largest=largest)
        packer.add("coordination", np.stack([np.minimum(f.coordination, 255).astype(np.uint8) for f in frames]))
        add_contacts(packer, [_contacts(f) for f in frames], len(b), len(self.results.planes) + 1)
        self._add_scene(packer)
        return packer, self._facts(keep)

    def _add_scene(self, packer: codes.Packer) -> None:
        """Triangles, normals and edges or spheres of each shape, planes cut where they meet, terrain."""
        for k, arrays in enumerate(self.form):
            for name, array in arrays.items():
                packer.add(f"{name}{k}", array.astype(np.float32))
        planes = lowered(self.results.planes, self.ceiling)
        for w in range(len(planes)):
            packer.add(f"plane{w}", piece(planes, w).astype(np.float32))
        packer.add("planeNormals", planes.normal.astype(np.float32))
        terrain = self.results.terrain
        if terrain is not None:
            corners = terrain.vertices[terrain.triangles]
            if len(corners) < MOST_TERRAIN // 4:
                corners = subdivided(corners, 0.06 * float(np.ptp(terrain.vertices, axis=0).max()))[0]
            packer.add("terrain", corners.astype(np.float32).reshape(-1, 9))

    def _facts(self, keep: list[int]) -> dict[str, Any]:
        results = self.results
        known = [name for name in BODY_QUANTITIES if name != "kind" or len(results.groups) > 1]
        return {
            "kind": "bodies",
            "count": results.grain_count,
            "shapes": len(self.form),
            "groups": list(results.groups),
            "planes": len(results.planes),
            "view": list(DEFAULT_VIEW),
            "quantities": [_fact(name) for name in known],
            "color": default_color(results),
            "readouts": readouts(results, [self.indices[k] for k in keep], TOLD),
        }


def _fact(name: str) -> dict[str, Any]:
    quantity = BODY_QUANTITIES[name]
    label = quantity.label + (" since the stage began" if quantity.since else "")
    return {"name": name, "label": label, "unit": quantity.unit, "kind": quantity.kind, "of": None}


def forms(results: BodyResults) -> list[dict[str, Floats]]:
    """What is painted of each shape: spheres (s, 4), or triangles (t, 9) with normals (t, 3) and sharp edges (e, 6) with the normals
    (e, 6) of the faces beside them; of meshes with too many triangles, their hulls."""
    shapes, number = results.scene_shapes, np.bincount(results.scene.bodies.shape, minlength=len(results.scene_shapes))
    found = [_form(shape, 2 if len(results.scene.bodies) < 300 else 1) for shape in shapes]
    total = sum(len(form.get("triangles", ())) * int(n) for form, n in zip(found, number, strict=True))
    return found if total <= MOST_TRIANGLES else [_coarse(shape) for shape in shapes]


def _form(shape: Shape, fine: int) -> dict[str, Floats]:
    if shape.kind == "spheres":
        return {"spheres": np.column_stack([shape.centers, shape.radii])}
    solid = solid_of(shape, fine)
    edges = {"edges": solid.edges.reshape(-1, 6), "beside": solid.beside.reshape(-1, 6)} if len(solid.edges) else {}
    return {"triangles": solid.triangles.reshape(-1, 9), "normals": solid.normals, **edges}


def _coarse(shape: Shape) -> dict[str, Floats]:
    if shape.kind == "spheres":
        return _form(shape, 1)
    points, triangles = hull(shape.vertices if len(shape.vertices) else shape.points)
    if not 0 < len(triangles) <= 100:
        return {"spheres": np.array([[0.0, 0.0, 0.0, shape.reach]])}
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return {"triangles": corners.reshape(-1, 9), "normals": normals / np.where(length > 0.0, length, 1.0)}


def _contacts(frame: StoredBodyFrame) -> tuple[Ints, Ints, Floats, Floats]:
    """i, j, normal force as mean of the last step [N], and point of each contact."""
    c = frame.contacts
    along = np.einsum("ck,ck->c", c.impulse, c.normal) / (frame.dt if frame.dt > 0.0 else np.inf)
    return c.i, c.j, along, c.point
