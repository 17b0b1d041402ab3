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


@dataclass(frozen=True)
class StoredGrains:
    """Elements of one frame of a result file, shape (n,) each, without what had left the container.

    x, y, a, b [m], angle [rad], vx, vy [m/s], spin [rad/s], body as in state.Grains; shape: key of the run that made them.
    """

    shape: str
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
            start = int(root["Steps/PointOffsets"][_frame_of(path, file, stage, frames)])
            rows = slice(start, start + n)
            shape = tomllib.loads(str(file.attrs["resolved"]))["grains"]["shape"]
            radius = data["radius"][:n]
            a, b = (data[name][:n] if name in data else radius for name in ("a", "b"))
            body = data["body"][:n].astype(np.int64) if "body" in data else np.arange(n, dtype=np.int64)
            inside = data["escaped"][rows] == 0
            moving = {
                "x": root["Points"][rows, 0],
                "y": root["Points"][rows, 1],
                "angle": data["angle"][rows],
                "vx": data["velocity"][rows, 0],
                "vy": data["velocity"][rows, 1],
                "spin": data["spin"][rows],
            }
    except (KeyError, OSError, ValueError) as error:
        raise ScenarioError(f"{path}: is not a result file of dem run ({error}). Give one, or a CSV file") from None
    if not inside.any():
        raise ScenarioError(f"{path}: all its grains have left the container. Take another file")
    columns = {name: values[inside] for name, values in (moving | {"a": a, "b": b}).items()}
    kept = body[inside]
    return StoredGrains(shape=shape, body=np.cumsum(np.diff(kept, prepend=kept[0]) != 0), **columns)


def _frame_of(path: Path, file: Any, stage: str | None, frames: int) -> int:
    """Number of the frame at the end of a stage; the last one of all without."""
    if stage is None:
        return frames - 1
    names = [str(name) for name in file["stages/name"].asstr()[: int(file["stages"].attrs["rows"])]]
    number, ends = file["frames/stage"][:frames], file["frames/stage_end"][:frames]
    for k in np.flatnonzero(ends):
        if names[int(number[k])] == stage:
            return int(k)
    raise ScenarioError(f'{path}: no stage "{stage}" has ended there. Its stages are {", ".join(names)}')
