"""Bodies in 3D for other programs: their surfaces where they are, as a temporal PolyData (VTKHDF) of polygons, and each shape as STL."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from dem_cli.analysis.placed import placed
from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.report.solids import hull, icosphere
from dem_cli.results import BodyResults
from dem_cli.rigid import Shape, Terrain
from dem_cli.state import Floats, Ints
from dem_cli.whole import whole

GROUPS = ("Vertices", "Lines", "Polygons", "Strips")
SPHERE = 2  # subdivisions of the spheres of a clump
CELL_DATA = {"body": "i4", "kind": "i4", "material": "i4", "speed": "f4", "angular_speed": "f4", "escaped": "u1"}


def surface_of(shape: Shape) -> tuple[Floats, Ints]:
    """Points (p, 3) [m] and triangles (t, 3) of a shape of scale 1: its own surface; of a clump its spheres, of a cloud without one its hull."""
    if shape.kind == "spheres":
        points, triangles = icosphere(SPHERE)
        count = len(points)
        every = shape.centers[:, None] + shape.radii[:, None, None] * points
        numbers = triangles + count * np.arange(len(shape.radii))[:, None, None]
        return every.reshape(-1, 3), numbers.reshape(-1, 3)
    if len(shape.triangles):
        return shape.vertices, shape.triangles
    return hull(shape.points)


def write_vtk(results: BodyResults, path: Path, force: bool = False) -> tuple[int, int]:
    """Write the surfaces of all bodies at each frame. Returns the numbers of frames and of triangles.

    Cells are triangles, with the number, kind, material, speed and angular speed of their body; those of escaped bodies have escaped = 1. Points
    change with every step, triangles are written once. The terrain and the planes' pieces, which do not move, are the last triangles, with
    body = -1 and kind = -1.
    """
    check_target(path, force)
    if results.n_frames == 0:
        raise ScenarioError(f"{results.path}: holds no frame")
    bodies = results.frame(0).bodies
    surfaces = [surface_of(shape) for shape in results.scene_shapes]
    fixed_points, fixed_triangles = _fixed(results)
    sizes = np.array([len(points) for points, _ in surfaces], dtype=np.int64)[bodies.shape]
    first = np.concatenate([[0], np.cumsum(sizes)])
    moving = [surfaces[k][1] + first[n] for n, k in enumerate(bodies.shape.tolist())]
    triangles = np.concatenate([*moving, fixed_triangles + first[-1]]).astype(np.int64)
    owner = np.repeat(np.arange(len(bodies)), [len(part) for part in moving])
    try:
        with whole(path) as work, h5py.File(work, "w") as file:
            root = _create(file, results, triangles, len(fixed_points) + int(first[-1]))
            for k in range(results.n_frames):
                _write_frame(root, results, k, surfaces, first, owner, fixed_points)
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror or error}") from None
    return results.n_frames, len(triangles)


def _fixed(results: BodyResults) -> tuple[Floats, Ints]:
    """Points and triangles of the planes' pieces and the terrain."""
    planes = results.planes
    points = planes.edge.reshape(-1, 3)
    corners = 4 * np.arange(len(planes))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    triangles = corners.reshape(-1, 3)
    terrain: Terrain | None = results.terrain
    if terrain is not None:
        triangles = np.concatenate([triangles, terrain.triangles + len(points)])
        points = np.concatenate([points, terrain.vertices])
    return points, triangles.astype(np.int64)


def _create(file: Any, results: BodyResults, triangles: Ints, points: int) -> Any:
    """All but the points and the data of cells, which are made at full length."""
    steps, cells = results.n_frames, len(triangles)
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 0])
    root.attrs.create("Type", np.bytes_("PolyData"))
    root["NumberOfPoints"] = np.full(steps, points)
    root.create_dataset("Points", (steps * points, 3), "f8")
    for name in GROUPS:
        group = root.create_group(name)
        polygons = name == "Polygons"
        count = cells if polygons else 0
        # All steps point at the same triangles; a group without cells has one offset.
        group["NumberOfCells"] = np.full(steps, count)
        group["NumberOfConnectivityIds"] = np.full(steps, 3 * count)
        group["Offsets"] = 3 * np.arange(count + 1)
        group["Connectivity"] = triangles.ravel() if polygons else np.empty(0, dtype=np.int64)
    data, table = root.create_group("CellData"), root.create_group("Steps")
    table.attrs["NSteps"] = steps
    table["Values"] = results.frame_times
    table["PartOffsets"], table["NumberOfParts"] = np.arange(steps), np.ones(steps, dtype=np.int64)
    table["PointOffsets"] = points * np.arange(steps)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        table[name] = np.zeros((steps, 4), dtype=np.int64)
    offsets = table.create_group("CellDataOffsets")
    table.create_group("PointDataOffsets")
    for name, dtype in CELL_DATA.items():
        data.create_dataset(name, (steps * cells,), dtype)
        offsets[name] = cells * np.arange(steps)
    return root


def _write_frame(
    root: Any,
    results: BodyResults,
    k: int,
    surfaces: list[tuple[Floats, Ints]],
    first: Ints,
    owner: Ints,
    fixed: Floats,
) -> None:
    """Points and cell data of frame k. owner: body of each triangle that moves; first: number of the first point of each body."""
    bodies = results.frame(k).bodies
    points = np.empty((int(first[-1]) + len(fixed), 3))
    points[first[-1] :] = fixed
    for shape in np.unique(bodies.shape).tolist():
        some = np.flatnonzero(bodies.shape == shape)
        where = first[some][:, None] + np.arange(len(surfaces[shape][0]))
        points[where] = placed(bodies, some, surfaces[shape][0])
    root["Points"][k * len(points) : (k + 1) * len(points)] = points
    values = {
        "body": bodies.id,
        "kind": bodies.group,
        "material": bodies.material,
        "speed": np.linalg.norm(bodies.v, axis=1),
        "angular_speed": np.linalg.norm(bodies.w, axis=1),
        "escaped": bodies.escaped,
    }
    cells = len(root["CellData/body"]) // results.n_frames
    for name, dtype in CELL_DATA.items():
        column = np.full(cells, -1 if dtype == "i4" else 0, dtype=dtype)
        column[: len(owner)] = values[name][owner]
        root["CellData"][name][k * cells : (k + 1) * cells] = column


def write_stl(results: BodyResults, folder: Path, force: bool = False) -> list[Path]:
    """Each shape of scale 1, in its own axes, and the terrain as binary STL (single precision) in `folder` (made if absent)."""
    parts = [(f"{k}-{shape.name}", *surface_of(shape)) for k, shape in enumerate(results.scene_shapes)]
    if results.terrain is not None:
        parts.append((f"terrain-{results.terrain.name}", results.terrain.vertices, results.terrain.triangles))
    paths = [folder / f"{''.join(c if c.isalnum() or c in '-_' else '_' for c in name)}.stl" for name, _, _ in parts]
    there = [str(path) for path in paths if path.exists()]
    if there and not force:
        raise ResultsError(f"{', '.join(there)} exists; choose another folder or add --force")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, (_, points, triangles) in zip(paths, parts, strict=True):
            path.write_bytes(stl_bytes(points[triangles]))
    except OSError as error:
        raise ResultsError(f"{folder}: cannot be written: {error.strerror}") from None
    return paths


def stl_bytes(corners: Floats) -> bytes:
    """Binary STL of triangles (t, 3, 3): a head of 80 bytes, their number, and of each the normal, the corners and two bytes of nothing."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    rows = np.zeros(len(corners), dtype=[("numbers", "<f4", (4, 3)), ("none", "<u2")])
    rows["numbers"] = np.concatenate([(normal / np.where(length > 0.0, length, 1.0))[:, None], corners], axis=1)
    return b"dem-cli".ljust(80, b" ") + np.uint32(len(corners)).tobytes() + rows.tobytes()


def check_target(path: Path, force: bool) -> None:
    """Raise ResultsError if `path` is a folder, lies in none, or would be overwritten without `force`."""
    if path.is_dir():
        raise ResultsError(f"{path}: is a folder; give the name of a file")
    if not path.parent.is_dir():
        raise ResultsError(f"{path}: the folder {path.parent} does not exist")
    if path.exists() and not force:
        raise ResultsError(f"{path} exists; choose another name with -o or add --force")
