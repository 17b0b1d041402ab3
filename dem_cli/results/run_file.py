"""What all writers of result files share: how the file grows, is flushed and gets its name, its series, stages, tracks and warnings."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np

from dem_cli.errors import ResultsError, RunError
from dem_cli.results.files import SPARE_BYTES, announce_length, cause, check_target, create_file, partial_path
from dem_cli.results.layouts import layout_of
from dem_cli.results.motions import write_motion
from dem_cli.results.provenance import provenance
from dem_cli.results.schema import FORMAT
from dem_cli.results.stages import StageTable
from dem_cli.results.tables import TEXT, Table, make_scale
from dem_cli.state import Floats, Ints

FLUSH_BYTES = 4_000_000
FLUSH_SECONDS = 1.0
OF_THE_START = (
    "grains",
    "elements",
    "boundary",
    "depth",
    "width",
    "breadth",
    "height",
)  # attributes that a run that goes on keeps


class Part(Protocol):
    """A part of the file that keeps rows back: `flush` hands them to HDF5, `commit` counts them once they have reached the file."""

    def flush(self) -> None: ...

    def commit(self) -> None: ...


class Frames(Part, Protocol):
    def trim(self) -> None: ...


class RunFile:
    """Writes one result file; a context manager. What moves is the subclass's matter.

    The file grows under `partial_path(path)` and takes its own name in `finish(..., complete=True)`. Rows are kept back until
    they make 4 MB or 1 s has passed, then they are flushed: a process that is killed leaves a file that opens. Left without
    `finish`, the file stays partial and names the exception that ended the run.
    Raises ResultsError before anything is written if path or its partial file exists and `force` is not given, or if the file
    cannot be made; RunError if a write fails later.

    base: a complete file of the same grains and engine that this one goes on from, e.g. of the first stages; its wall time counts too.

    The engine's name decides what is in the file (`layouts.layout_of`). A subclass makes its own groups in `_create_groups`, which it hands to
    `_begin`.
    """

    # Made by the subclass when it makes its groups.
    _frames: Frames
    _series: Table
    _tracks: Table | None
    _stages: StageTable
    _warnings: Any

    def __init__(
        self, path: Path | str, *, engine: str, tracks: Ints | None, force: bool, base: Path | None = None
    ) -> None:
        self.path = Path(path)
        self._open = False
        self._finished = False
        self._layout = layout_of(engine)
        self._rows = 0  # of the series
        check_target(self.path, force=force)
        self._partial = partial_path(path)
        self._started = self._flushed = clock.monotonic()
        self._bytes = 0
        self._track_ids = None if tracks is None or len(tracks) == 0 else np.asarray(tracks, dtype=np.int64)
        self._parts: list[Part] = []
        self._file = create_file(self._partial, base)
        self._open = True
        self._goes_on = base is not None
        self._before = float(self._file.attrs.get("wall_time", 0.0))

    def _begin(self, attributes: Mapping[str, Any], create: Callable[[], Sequence[Part | None]]) -> None:
        """Write the attributes of the root, and the groups, by `create`, which returns the parts that keep rows back."""
        root = {
            "format": FORMAT,
            "format_version": self._layout.version,
            "axis": self._layout.axis.name,
            **provenance(),
            **attributes,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "wall_time": self._before,
            "stop_reason": "",
            "complete": 0,
        }
        try:
            with self._guard():
                for name, value in root.items():
                    if not (self._goes_on and name in OF_THE_START):
                        self._file.attrs[name] = value
                self._parts = [part for part in create() if part is not None]
                self._rows = self._series.rows
                self.flush()
        except RunError as error:
            self._partial.unlink(missing_ok=True)
            raise ResultsError(f"{self._partial}: cannot be written ({cause(error.__cause__)})") from error

    @property
    def file(self) -> Path:
        """Where the file lies now: the partial name until it is complete."""
        return self._partial if not self._finished else self.path

    def _create_series(self) -> Table:
        return Table(self._file.require_group("series"), self._layout.series, self._layout.axis)

    def _create_tracks(self, definition: str) -> Table | None:
        """definition: whose number it is."""
        if self._track_ids is None:
            return None
        group = self._file.require_group("tracks")
        across = make_scale(group, "grain", self._track_ids, "1", definition)
        return Table(group, self._layout.tracks, self._layout.axis, across)

    def _create_stages(self) -> StageTable:
        return StageTable(self._file, self._layout)

    def _create_warnings(self) -> Any:
        if "warnings" in self._file:
            return self._file["warnings"]
        return self._file.create_dataset("warnings", (0,), TEXT, maxshape=(None,), chunks=(64,))

    def add_motion(self, number: int, acceleration: Floats, facts: Mapping[str, Any]) -> None:
        """The recorded motion of stage `number`, counted from 1 (`motions.write_motion`)."""
        with self._guard():
            write_motion(self._file, number, acceleration, facts)

    def _check_row(self, row: Mapping[str, float]) -> float:
        """Where a row of the series lies; ValueError if its names are not exactly those of the layout's series."""
        names = self._layout.series.keys()
        if row.keys() != names:
            wrong = ", ".join(sorted(row.keys() ^ names))
            raise ValueError(f"a row of series has missing or unknown names: {wrong}")
        return float(row[self._layout.axis.name])

    def _keep_row(self, row: Mapping[str, float]) -> None:
        """Append a row that was checked to the series."""
        self._bytes += self._series.append(
            float(row[self._layout.axis.name]), [row[name] for name in self._series.names]
        )
        self._rows += 1

    def _end_row(self, row: Mapping[str, float]) -> None:
        """All tables have this row."""
        with self._guard():
            self._stages.keep(row)
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
            self._file.attrs.modify("wall_time", self._before + clock.monotonic() - self._started)
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
            ours = os.fstat(self._file.id.get_vfd_handle())
            self._file.close()
            self._open = False
            if complete:
                if not os.path.samestat(ours, os.stat(self._partial)):  # begun anew by somebody who took us for dead
                    raise OSError(errno.ESTALE, "another run has taken its place")
                os.replace(self._partial, self.path)
                self._finished = True

    def __enter__(self) -> Self:
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
