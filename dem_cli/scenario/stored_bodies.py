"""Result files of the impulse engine as packings: the bodies of one frame, with their shapes and velocities."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dem_cli.errors import ScenarioError
from dem_cli.scenario.stored_grains import frame_of

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
ENGINE = "impulse"
ARRAYS = ("vertices", "triangles", "centers", "radii", "points", "normals", "trusted", "inertia")
NUMBERS = ("spacing", "mass", "volume", "reach")


@dataclass(frozen=True)
class StoredBodies:
    """Bodies of one frame, first axis (n,), without those that had escaped.

    columns: the fields of `rigid.Bodies` by name, but id, material and escaped; group and shape are indices into `groups` and `shapes`,
    material into `materials`. shapes: the fields of `rigid.Shape` by name.
    """

    groups: tuple[str, ...]
    materials: tuple[str, ...]
    shapes: tuple[dict[str, Any], ...]
    columns: dict[str, Any]

    def __len__(self) -> int:
        return len(self.columns["mass"])


def read_stored_bodies(path: Path, stage: str | None = None) -> StoredBodies:
    """The bodies of a result file at the end of a stage, or in the last frame. ScenarioError if it is none of the impulse engine."""
    import h5py

    if not path.is_file():
        raise ScenarioError(f"{path}: does not exist. The path is taken from the scenario's folder")
    try:
        with h5py.File(path, "r", locking=False) as file:
            engine = str(file.attrs["engine"])
            if engine != ENGINE:
                rule = f'holds grains of engine = "{engine}", which lie in a plane'
                raise ScenarioError(f'{path}: {rule}. Give a result file of engine = "{ENGINE}"')
            root, data = file["VTKHDF"], file["VTKHDF/PointData"]
            frames = int(root["Steps"].attrs["NSteps"])
            if frames == 0:
                raise ScenarioError(f"{path}: holds no frame yet. Wait for its run, or take another file")
            n = int(file.attrs["grains"])
            start = int(root["Steps/PointOffsets"][frame_of(path, file, stage, frames)])
            rows = slice(start, start + n)
            columns: dict[str, Any] = {name: data[name][:n].astype(np.int64) for name in ("group", "shape", "material")}
            columns |= {name: data[name][:n] for name in ("scale", "mass", "inertia")}
            columns |= {"x": root["Points"][rows], "q": data["orientation"][rows]}
            columns |= {"v": data["velocity"][rows], "w": data["angular_velocity"][rows]}
            inside = data["escaped"][rows] == 0
            shapes = tuple(_shape(file["shapes"][str(k)]) for k in range(len(file["shapes"])))
            groups, materials = (
                tuple(str(name) for name in file[table]["name"].asstr()[:]) for table in ("groups", "materials")
            )
    except (KeyError, OSError, ValueError) as error:
        raise ScenarioError(f"{path}: is not a result file of dem run ({error}). Give one of this engine") from None
    if not inside.any():
        raise ScenarioError(f"{path}: all its bodies have left the scene. Take another file")
    columns = {name: values[inside] for name, values in columns.items()}
    used = np.unique(columns["material"])
    columns["material"] = np.searchsorted(used, columns["material"])
    return StoredBodies(groups, tuple(materials[k] for k in used), shapes, columns)


def _shape(group: Any) -> dict[str, Any]:
    return {
        "name": str(group.attrs["name"]),
        "kind": str(group.attrs["kind"]),
        **{name: group[name][()] for name in ARRAYS},
        **{name: float(group.attrs[name]) for name in NUMBERS},
    }
