"""Writer of result files."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import time as clock
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np

from dem_cli.errors import ResultsError, RunError
from dem_cli.results.motions import write_motion
from dem_cli.results.provenance import provenance
from dem_cli.results.schema import FORMAT, FORMAT_VERSION, SERIES, STAGES, SURFACE, TRACKS
from dem_cli.results.tables import TEXT, Table, describe, make_scale
from dem_cli.results.vtkhdf import FrameWriter
from dem_cli.state import Bonds, Floats, Frame, Grains, Ints, Walls

FLUSH_BYTES = 4_000_000
FLUSH_SECONDS = 1.0
SPARE_BYTES = 4_000_000  # room for HDF5's own bookkeeping of a flush


def partial_path(path: Path | str) -> Path:
    """Where a result file lies until it is complete: out.h5 -> out.partial.h5."""
    path = Path(path)
    return path.with_name(f"{path.stem}.partial{path.suffix}")


class ResultWriter:
    """Writes one result file; a context manager.

    The file grows under `partial_path(path)` and takes its own name in `finish(..., complete=True)`. Rows are kept back until
    they make 4 MB or 1 s has passed, then they are flushed: a process that is killed leaves a file that opens. Left without
    `finish`, the file stays partial and names the exception that ended the run.
    Raises ResultsError before anything is written if path or its partial file exists and `force` is not given, or if the file
    cannot be made; RunError if a write fails later.

    container: width and height [m]; height None or absent for walls without end. tracks: numbers of the grains (not elements) to
    follow. surface_x: centres of the bins of the free surface [m]. bonds: None where there are none.
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
        surface_x: Floats,
        bonds: Bonds | None = None,
        force: bool = False,
    ) -> None:
        self.path = Path(path)
        self._open = False
        self._finished = False
        check_target(self.path, force=force)
        self._partial = partial_path(path)
        self._started = self._flushed = clock.monotonic()
        self._bytes = 0
        self._stage = -1
        self._last_time = np.nan
        self._stage_needs_row = False
        self._last_row: list[float] | None = None
        self._track_ids = None if tracks is None or len(tracks) == 0 else np.asarray(tracks, dtype=np.int64)
        self._file = _create(self._partial)
        self._open = True
        self._parts: list[Table | FrameWriter] = []
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
        }
        try:
            with self._guard():
                self._create_groups(attributes, grains, walls, surface_x, bonds or Bonds.none())
                self.flush()
        except RunError as error:
            self._partial.unlink(missing_ok=True)
            raise ResultsError(f"{self._partial}: cannot be written ({_cause(error.__cause__)})") from error

    def _create_groups(
        self, attributes: Mapping[str, Any], grains: Grains, walls: Walls, surface_x: Floats, bonds: Bonds
    ) -> None:
        root = {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            **provenance(),
            **attributes,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "wall_time": 0.0,
            "stop_reason": "",
            "complete": 0,
        }
        for name, value in root.items():
            self._file.attrs[name] = value
        self._series = Table(self._file.create_group("series"), SERIES)
        self._create_surface(surface_x)
        self._tracks = self._create_tracks()
        self._stages = self._create_stages()
        self._create_walls(walls)
        self._warnings = self._file.create_dataset("warnings", (0,), TEXT, maxshape=(None,), chunks=(64,))
        self._frames = FrameWriter(self._file, grains, walls, bonds)
        self._parts = [self._series, self._surface, self._frames, *([self._tracks] if self._tracks else [])]

    @property
    def file(self) -> Path:
        """Where the file lies now: the partial name until it is complete."""
        return self._partial if not self._finished else self.path

    def _create_surface(self, x: Floats) -> None:
        group = self._file.create_group("surface")
        unit, definition = SURFACE["x"]
        axis = make_scale(group, "x", np.asarray(x, dtype=np.float64), unit, definition)
        self._surface = Table(group, {"eta": SURFACE["eta"]}, axis)

    def _create_tracks(self) -> Table | None:
        if self._track_ids is None:
            return None
        group = self._file.create_group("tracks")
        return Table(group, TRACKS, make_scale(group, "grain", self._track_ids, "1", "id of the disc or ellipse"))

    def _create_stages(self) -> dict[str, Any]:
        """Columns over `stage`; the series row at its start and end as `before` and `after`, shape (stages, quantities)."""
        group = self._stage_group = self._file.create_group("stages")
        group.attrs["rows"] = 0
        names = [name for name in SERIES if name not in ("time", "step", "stage")]
        quantity = group.create_dataset("quantity", data=names, dtype=TEXT)
        quantity.make_scale("quantity")
        units = group.create_dataset("units", data=[SERIES[name][0] for name in names], dtype=TEXT)
        units.dims[0].attach_scale(quantity)
        self._measures = names
        columns: dict[str, Any] = {}
        for name, (unit, definition) in STAGES.items():
            text, wide = name in ("name", "kind", "reason"), name in ("before", "after")
            inner = (len(names),) if wide else ()
            kind = TEXT if text else ("i8" if name == "stage" else "f8")
            columns[name] = group.create_dataset(name, (0, *inner), kind, maxshape=(None, *inner), chunks=(16, *inner))
            describe(columns[name], unit, definition)
        columns["stage"].make_scale("stage")
        for name, dataset in columns.items():
            if name != "stage":
                dataset.dims[0].attach_scale(columns["stage"])
            if name in ("before", "after"):
                dataset.dims[1].attach_scale(quantity)
        return columns

    def _create_walls(self, walls: Walls) -> None:
        group = self._file.create_group("walls")
        name = group.create_dataset("name", data=list(walls.name), dtype=TEXT, shape=(len(walls),))
        name.make_scale("name")
        for key in ("x0", "y0", "x1", "y1", "friction"):
            dataset = group.create_dataset(key, data=np.asarray(getattr(walls, key), dtype=np.float64))
            describe(dataset, "1" if key == "friction" else "m", "friction" if key == "friction" else "end of the wall")
            dataset.dims[0].attach_scale(name)

    def add_motion(self, number: int, acceleration: Floats, facts: Mapping[str, Any]) -> None:
        """The recorded motion of stage `number`, counted from 1 (`motions.write_motion`)."""
        with self._guard():
            write_motion(self._file, number, acceleration, facts)

    def append_series(self, row: Mapping[str, float], eta: Floats) -> None:
        """row: exactly the names of schema.SERIES. eta: free surface in each bin [m], NaN where there is none."""
        if row.keys() != SERIES.keys():
            wrong = ", ".join(sorted(row.keys() ^ SERIES.keys()))
            raise ValueError(f"a row of series has missing or unknown names: {wrong}")
        values = [row[name] for name in self._series.names]
        time = float(row["time"])
        self._bytes += self._series.append(time, values)
        self._bytes += self._surface.append(time, [eta])
        self._keep_measures(row)
        with self._guard():
            self._flush_if_due()

    def append_frame(self, frame: Frame, coordination: Ints, stress: Floats) -> None:
        """One step of /VTKHDF. coordination (n,); stress of each element (n, 4) [Pa]: xx, xy, yx, yy."""
        with self._guard():
            self._need_room(self._frames.size(frame))
            self._bytes += self._frames.append(frame, coordination, stress)
            self._flush_if_due()

    def append_tracks(self, time: float, grains: Grains) -> None:
        """State of the followed grains; `grains` are all elements of the run. Nothing happens if none is followed."""
        if self._tracks is None:
            return
        row = [getattr(grains, name)[self._track_ids] for name in self._tracks.names]
        self._bytes += self._tracks.append(time, row)
        with self._guard():
            self._flush_if_due()

    def begin_stage(self, name: str, kind: str, time: float, measures: Mapping[str, float] | None = None) -> None:
        """measures: the series row at this instant; if left out, the last row known if it is of this time, else the next one."""
        self._stage += 1
        with self._guard():
            self._put_stage(stage=self._stage, name=name, kind=kind, start=time, end=np.nan, reason="")
            self._put_stage(before=np.nan, after=np.nan)
            self._stage_needs_row = False
            if measures is not None:
                self._keep_measures(measures)
            if self._last_row is not None and (measures is not None or self._last_time == time):
                self._put_stage(before=self._last_row)
            else:
                self._stage_needs_row = True
            self.flush()

    def end_stage(self, time: float, reason: str, measures: Mapping[str, float]) -> None:
        """measures: the series row at this instant."""
        with self._guard():
            self._keep_measures(measures)
            self._put_stage(end=time, reason=reason, after=self._last_row)
            self.flush()

    def _keep_measures(self, row: Mapping[str, float]) -> None:
        self._last_row = [float(row[name]) for name in self._measures]
        self._last_time = float(row["time"])
        if self._stage_needs_row:
            self._stage_needs_row = False
            with self._guard():
                self._put_stage(before=self._last_row)

    def _put_stage(self, **values: Any) -> None:
        for name, value in values.items():
            dataset = self._stages[name]
            dataset.resize(self._stage + 1, axis=0)
            dataset[self._stage] = value

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
            _announce_length(self._file, 2 * self._bytes + SPARE_BYTES)
            self._file.flush()
            for part in self._parts:
                part.commit()
            self._stage_group.attrs.modify("rows", self._stage + 1)
            self._file.flush()
            _announce_length(self._file, SPARE_BYTES)
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
            _announce_length(self._file, 0)
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
                f"{self._partial}: cannot write ({_cause(error)}). What was written until then stays readable there."
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


def check_target(path: Path | str, *, force: bool) -> None:
    """The one guard against overwriting: ResultsError if a run to `path` would replace a file, or cannot write there."""
    path = Path(path)
    if path.is_dir():
        raise ResultsError(f"{path}: is a folder; give the name of a file")
    partial = partial_path(path)
    if not path.parent.is_dir():
        raise ResultsError(f"{path}: the folder {path.parent} does not exist")
    if force:
        return
    if path.exists():
        raise ResultsError(f"{path}: exists already; --force replaces it")
    if partial.exists():
        raise ResultsError(f"{partial}: left by an unfinished run, or one still going on; --force replaces it")


def _create(partial: Path) -> Any:
    """A new file that stays readable whatever happens to this process.

    Superblock 0 has no mark "open for writing" that would lock out readers after a kill, there are no file locks, and
    metadata reach the file only in a flush, not whenever HDF5's cache is full.
    """
    try:
        partial.unlink(missing_ok=True)  # not truncated: a run still writing to the old file keeps its own
        file = h5py.File(partial, "x", libver=("earliest", "v110"), locking=False, rdcc_nbytes=2**20)
    except OSError as error:
        raise ResultsError(f"{partial}: cannot be written ({_cause(error)})") from error
    config = file.id.get_mdc_config()
    config.incr_mode = config.decr_mode = config.flash_incr_mode = 0
    config.evictions_enabled = False
    file.id.set_mdc_config(config)
    return file


def _announce_length(file: Any, extra: int) -> None:
    """Give the file its present length plus `extra` bytes (a hole, no room on disk) and say so in its head.

    HDF5 writes the length last in a flush; a process killed before that, or a reader that opened the file before it, would meet
    links that point beyond the end. The number has 8 bytes at 40 in superblock 0 (HDF5 file format specification, II.A).
    """
    length = file.id.get_filesize() + extra
    handle = file.id.get_vfd_handle()
    if extra:
        os.ftruncate(handle, length)
    os.pwrite(handle, length.to_bytes(8, "little"), 40)
    if not extra:
        os.ftruncate(handle, length)


def _cause(error: BaseException | None) -> str:
    """The operating system's words inside HDF5's message."""
    found = re.search(r"error message = '([^']+)'", str(error))
    if found:
        return found.group(1)
    return str(getattr(error, "strerror", None) or error)
