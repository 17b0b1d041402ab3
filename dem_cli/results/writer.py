"""Writer of result files."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import time as clock
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from dem_cli.errors import ResultsError, RunError
from dem_cli.results.dissipation import create_dissipation, ranked
from dem_cli.results.files import SPARE_BYTES, announce_length, cause, check_target, create_file, partial_path
from dem_cli.results.layouts import layout_of
from dem_cli.results.motions import write_motion
from dem_cli.results.provenance import provenance
from dem_cli.results.schema import FORMAT, SURFACE
from dem_cli.results.stages import StageTable
from dem_cli.results.tables import TEXT, Table, make_scale
from dem_cli.results.vtkhdf import FrameWriter
from dem_cli.results.walls import create_walls
from dem_cli.state import Bonds, Floats, Frame, Grains, Increment, Ints, Slips, Walls

FLUSH_BYTES = 4_000_000
FLUSH_SECONDS = 1.0


class ResultWriter:
    """Writes one result file; a context manager.

    The file grows under `partial_path(path)` and takes its own name in `finish(..., complete=True)`. Rows are kept back until
    they make 4 MB or 1 s has passed, then they are flushed: a process that is killed leaves a file that opens. Left without
    `finish`, the file stays partial and names the exception that ended the run.
    Raises ResultsError before anything is written if path or its partial file exists and `force` is not given, or if the file
    cannot be made; RunError if a write fails later.

    The engine's name decides what is in the file (`layouts.layout_of`): runs over time have a free surface, quasi-static tests go over
    increments and have the contacts that dissipate most, and walls that move.

    container: width and height [m]; height None or absent for walls without end. tracks: numbers of the grains (not elements) to
    follow. surface_x: centres of the bins of the free surface [m]. bonds: None where there are none. boundary: number of boundary grains, the
    last of the elements.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        scenario_text: str,
        resolved_toml: str,
        scenario_hash: str,
        seed: int,
        engine: str,
        title: str,
        grains: Grains,
        walls: Walls,
        depth: float,
        container: Mapping[str, float | None],
        tracks: Ints | None,
        surface_x: Floats | None = None,
        bonds: Bonds | None = None,
        boundary: int = 0,
        force: bool = False,
    ) -> None:
        self.path = Path(path)
        self._open = False
        self._finished = False
        self._layout = layout_of(engine)
        if (surface_x is None) == self._layout.surface:
            raise ValueError("a run over time needs the bins of its free surface, and no other run has them")
        self._rows = 0  # of the series
        check_target(self.path, force=force)
        self._partial = partial_path(path)
        self._started = self._flushed = clock.monotonic()
        self._bytes = 0
        self._track_ids = None if tracks is None or len(tracks) == 0 else np.asarray(tracks, dtype=np.int64)
        self._file = create_file(self._partial)
        self._open = True
        attributes = {
            "title": title,
            "scenario": scenario_text,
            "resolved": resolved_toml,
            "scenario_hash": scenario_hash,
            "seed": seed,
            "engine": engine,
            "grains": grains.grain_count,
            "elements": len(grains),
            "depth": depth,
            "width": container["width"],
            "height": np.nan if container.get("height") is None else container["height"],
            "boundary": boundary,
        }
        try:
            with self._guard():
                self._create_groups(attributes, grains, walls, surface_x, bonds or Bonds.none())
                self.flush()
        except RunError as error:
            self._partial.unlink(missing_ok=True)
            raise ResultsError(f"{self._partial}: cannot be written ({cause(error.__cause__)})") from error

    def _create_groups(
        self, attributes: Mapping[str, Any], grains: Grains, walls: Walls, surface_x: Floats | None, bonds: Bonds
    ) -> None:
        root = {
            "format": FORMAT,
            "format_version": self._layout.version,
            "axis": self._layout.axis.name,
            **provenance(),
            **attributes,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "wall_time": 0.0,
            "stop_reason": "",
            "complete": 0,
        }
        for name, value in root.items():
            self._file.attrs[name] = value
        layout, file = self._layout, self._file
        self._series = Table(file.create_group("series"), layout.series, layout.axis)
        self._surface = self._create_surface(surface_x)
        self._dissipation = create_dissipation(file, layout)
        self._tracks = self._create_tracks()
        self._stages = StageTable(file, layout)
        create_walls(file, walls)
        self._warnings = file.create_dataset("warnings", (0,), TEXT, maxshape=(None,), chunks=(64,))
        self._frames = FrameWriter(file, layout, grains, walls, bonds)
        parts = (self._series, self._surface, self._dissipation, self._frames, self._tracks)
        self._parts: list[Table | FrameWriter] = [part for part in parts if part is not None]

    @property
    def file(self) -> Path:
        """Where the file lies now: the partial name until it is complete."""
        return self._partial if not self._finished else self.path

    def _create_surface(self, x: Floats | None) -> Table | None:
        if x is None:
            return None
        group = self._file.create_group("surface")
        unit, definition = SURFACE["x"]
        across = make_scale(group, "x", np.asarray(x, dtype=np.float64), unit, definition)
        return Table(group, {"eta": SURFACE["eta"]}, self._layout.axis, across)

    def _create_tracks(self) -> Table | None:
        if self._track_ids is None:
            return None
        group = self._file.create_group("tracks")
        across = make_scale(group, "grain", self._track_ids, "1", "id of the disc or ellipse")
        return Table(group, self._layout.tracks, self._layout.axis, across)

    def add_motion(self, number: int, acceleration: Floats, facts: Mapping[str, Any]) -> None:
        """The recorded motion of stage `number`, counted from 1 (`motions.write_motion`)."""
        with self._guard():
            write_motion(self._file, number, acceleration, facts)

    def append_series(self, row: Mapping[str, float], eta: Floats | None = None, slips: Slips | None = None) -> None:
        """row: exactly the names of the layout's series. eta: free surface in each bin [m], NaN where there is none, for runs over time;
        slips: the contacts that slid, for increments.
        """
        names = self._layout.series.keys()
        if row.keys() != names:
            wrong = ", ".join(sorted(row.keys() ^ names))
            raise ValueError(f"a row of series has missing or unknown names: {wrong}")
        if (eta is None) != (self._surface is None) or (slips is None) != (self._dissipation is None):
            raise ValueError("a row of series needs the free surface over time, the contacts that slid over increments")
        place = float(row[self._layout.axis.name])
        self._bytes += self._series.append(place, [row[name] for name in self._series.names])
        self._rows += 1
        if self._surface is not None:
            self._bytes += self._surface.append(place, [eta])
        if self._dissipation is not None and slips is not None:
            self._bytes += self._dissipation.append(place, ranked(slips))
        with self._guard():
            self._stages.keep(row)
            self._flush_if_due()

    def append_frame(self, frame: Frame | Increment, coordination: Ints, stress: Floats) -> None:
        """One step of /VTKHDF, after its row of the series. coordination (n,); stress of each element (n, 4) [Pa]: xx, xy, yx, yy."""
        with self._guard():
            self._need_room(self._frames.size(frame))
            self._bytes += self._frames.append(frame, coordination, stress, self._rows - 1)
            self._flush_if_due()

    def append_tracks(self, place: float, grains: Grains) -> None:
        """State of the followed grains at a time [s] or an increment; `grains` are all elements. Nothing happens if none is followed."""
        if self._tracks is None:
            return
        row = [getattr(grains, name)[self._track_ids] for name in self._tracks.names]
        self._bytes += self._tracks.append(place, row)
        with self._guard():
            self._flush_if_due()

    def begin_stage(self, name: str, kind: str, place: float, measures: Mapping[str, float] | None = None) -> None:
        """place: time [s] or number of increments. measures: the series row there; if left out, the last row known if it is of this place,
        else the next one.
        """
        with self._guard():
            self._stages.begin(name, kind, place, measures)
            self.flush()

    def end_stage(self, place: float, reason: str, measures: Mapping[str, float]) -> None:
        """measures: the series row at this place."""
        with self._guard():
            self._stages.end(place, reason, measures)
            self.flush()

    def warn(self, text: str) -> None:
        """Keep a warning of the run under /warnings."""
        with self._guard():
            self._warnings.resize(len(self._warnings) + 1, axis=0)
            self._warnings[-1] = text

    def _flush_if_due(self) -> None:
        if self._bytes >= FLUSH_BYTES or clock.monotonic() - self._flushed >= FLUSH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Bring everything to the file now: first the data, then the counts of rows and frames that readers go by."""
        with self._guard():
            self._need_room(2 * self._bytes)
            for part in self._parts:
                part.flush()
            self._file.attrs.modify("wall_time", clock.monotonic() - self._started)
            announce_length(self._file, 2 * self._bytes + SPARE_BYTES)
            self._file.flush()
            for part in self._parts:
                part.commit()
            self._stages.commit()
            self._file.flush()
            announce_length(self._file, SPARE_BYTES)
        self._bytes = 0
        self._flushed = clock.monotonic()

    def _need_room(self, size: int) -> None:
        """Fail before the disk is full: HDF5 fails in the middle of its work and cannot go back."""
        if shutil.disk_usage(self._partial.parent).free < size + SPARE_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def finish(self, stop_reason: str, complete: bool = True) -> None:
        """Write the last attributes and close; a complete file takes its own name, another one keeps the partial one."""
        if not self._open:
            return
        self.flush()
        with self._guard():
            self._frames.trim()
            self._file.attrs["stop_reason"] = stop_reason
            self._file.attrs.modify("complete", int(complete))
            self._file.flush()
            announce_length(self._file, 0)
            self._file.close()
            self._open = False
            if complete:
                os.replace(self._partial, self.path)
                self._finished = True

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._open:
            return
        if kind is None:
            reason = "the run ended without a reason"
        elif issubclass(kind, KeyboardInterrupt):
            reason = "interrupted"
        else:
            reason = f"{kind.__name__}: {error}"
        if error is None:
            self.finish(reason, complete=False)
        else:
            with contextlib.suppress(RunError):  # what ended the run is the error to show
                self.finish(reason, complete=False)

    @contextlib.contextmanager
    def _guard(self) -> Iterator[None]:
        """Turn a failed write into one clear line and let go of the file without writing more."""
        try:
            yield
        except (OSError, RuntimeError) as error:
            self._abandon()
            raise RunError(
                f"{self._partial}: cannot write ({cause(error)}). What was written until then stays readable there."
            ) from error

    def _abandon(self) -> None:
        """Close without writing more. HDF5 itself would try again and take the whole process down at its end."""
        if not self._open:
            return
        self._open = False
        with contextlib.suppress(OSError, RuntimeError):
            nowhere = os.open(os.devnull, os.O_RDWR)
            os.dup2(nowhere, self._file.id.get_vfd_handle())
            os.close(nowhere)
        with contextlib.suppress(OSError, RuntimeError):
            self._file.close()
