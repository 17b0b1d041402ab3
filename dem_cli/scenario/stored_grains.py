"""Result files as packings: the grains of one frame, element by element."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dem_cli.errors import ScenarioError

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
SUFFIXES = (".h5", ".hdf5")
RESULT_FILE = r"\.([hH]5|[hH][dD][fF]5)$"  # the same as a pattern of JSON Schema


@dataclass(frozen=True)
class StoredGrains:
    """Elements of one frame of a result file, shape (n,) each, without what had left the container.

    x, y, a, b [m], angle [rad], vx, vy [m/s], spin [rad/s], body as in state.Grains; x and y count from the left wall and the floor.
    Chains of boundary grains are left out. engine and shape: of the run that made them. width, height [m]: of what holds the grains;
    where its top is open, up to the highest of them.
    """

    engine: str
    shape: str
    width: float
    height: float
    x: Floats
    y: Floats
    angle: Floats
    vx: Floats
    vy: Floats
    spin: Floats
    a: Floats
    b: Floats
    body: Ints

    def means(self, values: Floats) -> Floats:
        """Mean over the elements of each grain, weighted by their areas."""
        area = self.a * self.b
        return np.asarray(np.bincount(self.body, area * values) / np.bincount(self.body, area))


def is_result_file(path: Path | str) -> bool:
    """Whether a packing file is a result file, by its name."""
    return Path(path).suffix.lower() in SUFFIXES


def read_stored_grains(path: Path, stage: str | None = None) -> StoredGrains:
    """The grains of a result file at the end of a stage, or in the last frame. ScenarioError if it is none, or holds no such frame."""
    import tomllib

    import h5py

    if not path.is_file():
        raise ScenarioError(f"{path}: does not exist. The path is taken from the scenario's folder")
    try:
        with h5py.File(path, "r", locking=False) as file:
            root, data = file["VTKHDF"], file["VTKHDF/PointData"]
            frames = int(root["Steps"].attrs["NSteps"])
            if frames == 0:
                raise ScenarioError(f"{path}: holds no frame yet. Wait for its run, or take another file")
            n = int(file.attrs["elements" if "elements" in file.attrs else "grains"])
            start = int(root["Steps/PointOffsets"][frame_of(path, file, stage, frames)])
            rows = slice(start, start + n)
            resolved = tomllib.loads(str(file.attrs["resolved"]))
            radius = data["radius"][:n]
            a, b = (data[name][:n] if name in data else radius for name in ("a", "b"))
            body = data["body"][:n].astype(np.int64) if "body" in data else np.arange(n, dtype=np.int64)
            inside = data["escaped"][rows] == 0 if "escaped" in data else np.ones(n, dtype=bool)
            inside[n - int(file.attrs.get("boundary", 0)) :] = False
            walls = _moved_walls(file, root["Points"], start + n)
            width = float(file.attrs["width"])
            moving = {
                "x": root["Points"][rows, 0],
                "y": root["Points"][rows, 1],
                "angle": data["angle"][rows],
                "vx": data["velocity"][rows, 0] if "velocity" in data else np.zeros(n),
                "vy": data["velocity"][rows, 1] if "velocity" in data else np.zeros(n),
                "spin": data["spin"][rows] if "spin" in data else np.zeros(n),
            }
    except (KeyError, OSError, ValueError) as error:
        raise ScenarioError(f"{path}: is not a result file of dem run ({error}). Give one, or a CSV file") from None
    if not inside.any():
        raise ScenarioError(f"{path}: all its grains have left the container. Take another file")
    columns = {name: values[inside] for name, values in (moving | {"a": a, "b": b}).items()}
    kept = body[inside]
    if str(file_engine := resolved.get("engine", "explicit")) == "explicit":
        sides = {"left": 0.0, "bottom": 0.0, "right": width, "top": float(np.max(columns["y"] + columns["a"]))}
    else:
        sides = _box(walls, columns["x"], columns["y"], columns["a"])
    columns["x"], columns["y"] = columns["x"] - sides["left"], columns["y"] - sides["bottom"]
    return StoredGrains(
        engine=str(file_engine),
        shape=resolved["grains"]["shape"],
        width=sides["right"] - sides["left"],
        height=sides["top"] - sides["bottom"],
        body=np.cumsum(np.diff(kept, prepend=kept[0]) != 0),
        **columns,
    )


def _moved_walls(file: Any, points: Any, start: int) -> dict[str, float]:
    """Where the walls of a frame are [m], by name: x of left and right, y of bottom and top; its points begin at `start`, two a wall."""
    names = [str(name) for name in file["walls/name"].asstr()[:]]
    ends = points[start : start + 2 * len(names)].reshape(-1, 2, points.shape[1])
    return {name: float(ends[k, :, 0 if name in ("left", "right") else 1].mean()) for k, name in enumerate(names)}


def _box(walls: dict[str, float], x: Floats, y: Floats, r: Floats) -> dict[str, float]:
    """The walls, and where there is none the outermost grain."""
    edges = {"left": np.min(x - r), "right": np.max(x + r), "bottom": np.min(y - r), "top": np.max(y + r)}
    return {name: walls.get(name, float(edge)) for name, edge in edges.items()}


def frame_of(path: Path, file: Any, stage: str | None, frames: int) -> int:
    """Number of the frame at the end of a stage; the last one of all without."""
    if stage is None:
        return frames - 1
    names = [str(name) for name in file["stages/name"].asstr()[: int(file["stages"].attrs["rows"])]]
    number, ends = file["frames/stage"][:frames], file["frames/stage_end"][:frames]
    for k in np.flatnonzero(ends):
        if names[int(number[k])] == stage:
            return int(k)
    raise ScenarioError(f'{path}: no stage "{stage}" has ended there. Its stages are {", ".join(names)}')
