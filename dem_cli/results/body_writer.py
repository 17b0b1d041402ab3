"""Writer of result files of bodies in 3D."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dem_cli.results.body_frames import BodyFrameWriter
from dem_cli.results.run_file import Part, RunFile
from dem_cli.results.scenes import create_scene
from dem_cli.rigid import Bodies, BodyFrame, Scene
from dem_cli.state import Floats, Ints


class ImpulseWriter(RunFile):
    """Writes one result file of the impulse engine; a context manager (`run_file.RunFile`).

    scene: bodies at the start, and what does not move. gravity (3,) [m/s^2] in the container's axes. container: width (x), breadth (y) and
    height (z) [m], each None or absent where there is none. tracks: numbers of the bodies to follow. base,
    preparation: as in ResultWriter.
    """

    _frames: BodyFrameWriter

    def __init__(
        self,
        path: Path | str,
        *,
        scenario_text: str,
        resolved_toml: str,
        scenario_hash: str,
        seed: int,
        title: str,
        scene: Scene,
        gravity: Floats,
        container: Mapping[str, float | None],
        tracks: Ints | None,
        engine: str = "impulse",
        force: bool = False,
        base: Path | None = None,
        preparation: str = "",
    ) -> None:
        super().__init__(path, engine=engine, tracks=tracks, force=force, base=base)
        attributes: dict[str, Any] = {
            "title": title,
            "scenario": scenario_text,
            "resolved": resolved_toml,
            "scenario_hash": scenario_hash,
            "seed": seed,
            "engine": engine,
            **({"preparation": preparation} if preparation else {}),
            "grains": len(scene.bodies),
            "gravity": np.asarray(gravity, dtype=np.float64),
        }
        for side in ("width", "breadth", "height"):
            length = container.get(side)
            attributes[side] = np.nan if length is None else length
        self._begin(attributes, lambda: self._create_groups(scene))

    def _create_groups(self, scene: Scene) -> Sequence[Part | None]:
        self._series = self._create_series()
        self._tracks = self._create_tracks("id of the body")
        self._stages = self._create_stages()
        create_scene(self._file, scene)
        self._warnings = self._create_warnings()
        self._frames = BodyFrameWriter(self._file, scene.bodies, scene.planes)
        return self._series, self._frames, self._tracks

    def append_series(self, row: Mapping[str, float]) -> None:
        """row: exactly the names of `body_schema.BODY_SERIES`, as `analysis.bodies3d.measure_bodies` has them."""
        self._check_row(row)
        self._keep_row(row)
        self._end_row(row)

    def append_frame(self, frame: BodyFrame) -> None:
        """One step of /VTKHDF, after its row of the series."""
        with self._guard():
            self._need_room(self._frames.size(frame))
            self._bytes += self._frames.append(frame)
            self._flush_if_due()

    def append_tracks(self, time: float, bodies: Bodies) -> None:
        """State of the followed bodies at a time [s]; `bodies` are all of them. Nothing happens if none is followed."""
        if self._tracks is None:
            return
        parts = (bodies.x, bodies.q, bodies.v, bodies.w)
        self._bytes += self._tracks.append(time, list(np.concatenate([part[self._track_ids].T for part in parts])))
        with self._guard():
            self._flush_if_due()
