"""A result file of the impulse engine as far as a packing reads it, made by hand: two frames, two bodies, one of which may have escaped."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

NAMES = ("vertices", "triangles", "centers", "radii", "points", "normals", "trusted", "inertia")


def write_result_file(
    path: Path, *, escaped: tuple[int, int] = (0, 0), engine: str = "impulse", frames: int = 2
) -> None:
    """Spheres of 0.1 m ("ball", of "rubber" and "steel") at x = 0.3 and 0.6 m, and a metre higher after stage "first"."""
    text = h5py.string_dtype()
    with h5py.File(path, "w") as file:
        file.attrs["engine"], file.attrs["grains"] = engine, 2
        for table, names in (("groups", ["ball"]), ("materials", ["unused", "rubber", "steel"])):
            file.create_group(table).create_dataset("name", data=names, dtype=text)
        stages = file.create_group("stages")
        stages.attrs["rows"] = 2
        stages.create_dataset("name", data=["first", "second"], dtype=text)
        table = file.create_group("frames")
        table["stage"], table["stage_end"] = np.array([0, 1]), np.array([1, 0])
        shape = file.create_group("shapes/0")
        shape.attrs.update(
            {"name": "ball", "kind": "spheres", "spacing": 0.0, "mass": 4.0, "volume": 4e-3, "reach": 0.1}
        )
        arrays = dict.fromkeys(NAMES, np.empty((0, 3))) | {"radii": np.array([0.1]), "centers": np.zeros((1, 3))}
        for name, array in (arrays | {"triangles": np.empty((0, 3), dtype=int), "inertia": np.full(3, 0.016)}).items():
            shape[name] = array
        root = file.create_group("VTKHDF")
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = frames
        steps["PointOffsets"] = np.array([0, 3])
        x = np.array([[0.3, 0.5, 1.2], [0.6, 0.5, 1.2], [9.0, 9.0, 9.0], [0.3, 0.5, 0.2], [0.6, 0.5, 0.2]])
        root["Points"] = x
        data = root.create_group("PointData")
        for name, column in (("group", [0, 0]), ("shape", [0, 0]), ("material", [1, 2])):
            data[name] = np.array([*column, -1], dtype="i4")
        data["scale"], data["mass"] = np.array([1.0, 0.5]), np.array([4.0, 0.5])
        data["inertia"] = np.full((2, 3), 0.016)
        data["orientation"] = np.tile([0.6, 0.8, 0.0, 0.0], (5, 1))
        data["velocity"] = np.arange(15.0).reshape(5, 3)
        data["angular_velocity"] = -np.arange(15.0).reshape(5, 3)
        data["escaped"] = np.array([0, 0, 0, *escaped], dtype="u1")
