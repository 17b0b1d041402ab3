"""Reader of result files of bodies in 3D."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dem_cli.errors import ResultsError
from dem_cli.results.body_frames import StoredBodyFrame, read_bodies, read_contacts, stored_body_frame
from dem_cli.results.reader import Results
from dem_cli.results.scenes import read_names, read_planes, read_shapes, read_terrain
from dem_cli.rigid import Planes, Scene, Shape, Terrain
from dem_cli.state import Floats


class BodyResults(Results):
    """One result file of the impulse engine, open for reading; a context manager. Made by `open_results`.

    width, breadth [m]: NaN without a container; height [m] or None. gravity (3,) [m/s^2] in the container's axes.
    """

    def __init__(self, path: Path, file: Any) -> None:
        super().__init__(path, file)
        self.breadth = float(self.attrs["breadth"])
        self.gravity: Floats = np.asarray(self.attrs["gravity"], dtype=np.float64)

    @property
    def has_container(self) -> bool:
        return not (math.isnan(self.width) or math.isnan(self.breadth))

    @cached_property
    def scene_shapes(self) -> tuple[Shape, ...]:
        return read_shapes(self._file)

    @cached_property
    def planes(self) -> Planes:
        return read_planes(self._file)

    @cached_property
    def terrain(self) -> Terrain | None:
        return read_terrain(self._file)

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Names of the kinds of bodies."""
        return read_names(self._file, "groups")

    @cached_property
    def materials(self) -> tuple[str, ...]:
        return read_names(self._file, "materials")

    @cached_property
    def restitution(self) -> Floats:
        """Of each pair of materials, shape (m, m)."""
        return np.asarray(self._file["materials/restitution"][()])

    @cached_property
    def friction(self) -> Floats:
        """Of each pair of materials, shape (m, m)."""
        return np.asarray(self._file["materials/friction"][()])

    @cached_property
    def scene(self) -> Scene:
        """The scene with the bodies of the first frame. ResultsError if the file holds no frame yet."""
        if self.n_frames == 0:
            raise ResultsError(f"{self.path}: holds no frame")
        return Scene(
            groups=self.groups,
            shapes=self.scene_shapes,
            bodies=self.instant(0).bodies,
            planes=self.planes,
            terrain=self.terrain,
            materials=self.materials,
            restitution=self.restitution,
            friction=self.friction,
            low=np.asarray(self.attrs["scene_low"]),
            high=np.asarray(self.attrs["scene_high"]),
        )

    def frame(self, k: int) -> StoredBodyFrame:
        """Frame k, counted from the end if negative. Raises IndexError."""
        k, row = self._frame_row(k, "time")
        root = self._file["VTKHDF"]
        bodies, coordination = read_bodies(root, k, self.grain_count)
        return stored_body_frame(row, bodies, read_contacts(root, k, self.grain_count), coordination)

    instant = frame  # type: ignore[assignment]
