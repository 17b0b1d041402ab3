"""Reader of result files."""

from __future__ import annotations

import math
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from dem_cli.errors import ResultsError
from dem_cli.results.bonds import read_bonds, read_strain
from dem_cli.results.dissipation import Dissipation, read_dissipation, read_slips
from dem_cli.results.files import partial_path
from dem_cli.results.frames import StoredFrame, StoredIncrement, stored_frame, stored_increment
from dem_cli.results.layouts import Layout, layout_in
from dem_cli.results.motions import StoredMotion, read_motions
from dem_cli.results.schema import FORMAT, FORMAT_VERSION, KIND_CONTACT, KIND_WALL_CONTACT
from dem_cli.results.stages import Stage, read_stages
from dem_cli.results.walls import ENDS, read_walls
from dem_cli.state import Bonds, Contacts, Floats, Grains, Ints, Walls

if TYPE_CHECKING:
    from xarray import Dataset


@dataclass(frozen=True)
class Tracks:
    """Followed grains: ids (g,), time (t,) [s], or numbers of increments, arrays: name of the layout's tracks -> (t, g)."""

    ids: Ints
    time: Floats
    arrays: dict[str, Floats]


@dataclass(frozen=True)
class Surface:
    """Free surface: x (b,) [m], time (t,) [s], eta (t, b) [m], NaN where a bin holds no grain."""

    x: Floats
    time: Floats
    eta: Floats


class Series(Mapping[str, Floats]):
    """Name -> values over time or increments, each read when asked for."""

    def __init__(self, group: Any, layout: Layout) -> None:
        self._group = group
        self._names = [name for name in layout.series if name in group]
        self.rows = int(group.attrs["rows"])  # columns may be longer while a flush goes on

    def __getitem__(self, name: str) -> Floats:
        if name not in self._names:
            raise KeyError(name)
        return np.asarray(self._group[name][: self.rows], dtype=np.float64)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def unit(self, name: str) -> str:
        return str(self._group[name].attrs["units"])

    def definition(self, name: str) -> str:
        return str(self._group[name].attrs["definition"])


class Results:
    """One result file, open for reading; a context manager. Made by `open_results`."""

    def __init__(self, path: Path, file: Any) -> None:
        self.path = path
        self._file = file
        self.attrs: dict[str, Any] = {name: _plain(value) for name, value in file.attrs.items()}
        self.complete = bool(self.attrs["complete"])
        self.title = str(self.attrs["title"])
        self.depth = float(self.attrs.get("depth", math.nan))  # bodies in 3D have none
        self.width = float(self.attrs["width"])  # NaN without a container
        height = float(self.attrs["height"])
        self.height = None if math.isnan(height) else height  # None: walls without end
        self.grain_count = int(self.attrs["grains"])
        self.element_count = int(self.attrs.get("elements", self.grain_count))  # format 1 knew discs only
        self.layout = layout_in(self.attrs)
        self.kind = self.layout.kind  # "time", "increment" or "bodies"
        self.axis = self.layout.axis.name  # "time" or "increment"
        self.boundary = int(self.attrs.get("boundary", 0))  # grains of the boundary, the last of the elements
        self.series = Series(file["series"], self.layout)
        self.n_frames = int(file["VTKHDF/Steps"].attrs["NSteps"])

    @property
    def stop_reason(self) -> str:
        return str(self.attrs["stop_reason"]) or "not ended: the run still goes on, or was killed"

    @property
    def status(self) -> str:
        """One line for people: complete or not, and why."""
        return f"{'complete' if self.complete else 'INCOMPLETE'}: {self.stop_reason}"

    @cached_property
    def scenario(self) -> dict[str, Any]:
        """The resolved scenario, parsed."""
        return tomllib.loads(self.attrs["resolved"])

    @cached_property
    def walls(self) -> Walls:
        """Where they were at the start; those of a quasi-static test move, so see `StoredIncrement.walls`."""
        return read_walls(self._file)

    @cached_property
    def bonds(self) -> Bonds:
        return read_bonds(self._file)

    @cached_property
    def stages(self) -> list[Stage]:
        return read_stages(self._file)

    @cached_property
    def warnings(self) -> list[str]:
        return [str(text) for text in self._file["warnings"].asstr()[:]]

    @cached_property
    def motions(self) -> dict[int, StoredMotion]:
        """Recorded motions by the number of their stage, from 1."""
        return read_motions(self._file)

    @cached_property
    def tracks(self) -> Tracks | None:
        if "tracks" not in self._file:
            return None
        group = self._file["tracks"]
        rows = int(group.attrs["rows"])
        arrays = {name: np.asarray(group[name][:rows]) for name in self.layout.tracks}
        return Tracks(ids=np.asarray(group["grain"][:]), time=np.asarray(group[self.axis][:rows]), arrays=arrays)

    @cached_property
    def surface(self) -> Surface:
        """ResultsError in files of quasi-static tests, which have none."""
        if not self.layout.surface:
            raise ResultsError(f"{self.path}: has no free surface, only runs over time of grains in 2D do")
        group = self._file["surface"]
        rows = int(group.attrs["rows"])
        return Surface(np.asarray(group["x"][:]), np.asarray(group["time"][:rows]), np.asarray(group["eta"][:rows]))

    @cached_property
    def dissipation(self) -> Dissipation | None:
        """The contacts that dissipate most, a row for each of the series; None in files of runs over time."""
        return read_dissipation(self._file)

    @cached_property
    def frame_times(self) -> Floats:
        """Where the frames lie on the axis, shape (n_frames,): times [s], or numbers of increments."""
        return np.asarray(self._file["VTKHDF/Steps/Values"][: self.n_frames])

    @cached_property
    def frame_stages(self) -> Ints:
        """Stages (from 0) that the frames belong to, shape (n_frames,)."""
        return np.asarray(self._file["frames/stage"][: self.n_frames]).astype(np.int64)

    def frame(self, k: int) -> Any:
        """Frame k, counted from the end if negative: a StoredFrame, or a StoredIncrement in files over increments. Raises IndexError."""
        return self.increment(k) if self.axis == "increment" else self.instant(k)

    def instant(self, k: int) -> StoredFrame:
        """Frame k of a run over time. Raises IndexError, and ResultsError if the file is over increments."""
        k, row = self._frame_row(k, "time")
        grains, coordination, stress = self._grains(k)
        contacts, strain = self._contacts(k, len(grains)), read_strain(self._file, k)
        return stored_frame(row, grains, contacts, strain, self.walls, coordination, stress)

    def increment(self, k: int) -> StoredIncrement:
        """Frame k of a quasi-static test. Raises IndexError, and ResultsError if the file is over time."""
        k, row = self._frame_row(k, "increment")
        grains, coordination, stress = self._grains(k)
        contacts, slips = self._contacts(k, len(grains)), read_slips(self._file, int(row["row"]))
        walls = self._walls(k, len(grains))
        return stored_increment(row, grains, contacts, slips, walls, self.boundary, coordination, stress)

    @cached_property
    def frame_table(self) -> dict[str, Floats]:
        """The numbers that are kept with the frames: name of the layout's frames -> (n_frames,)."""
        group = self._file["frames"]
        return {name: np.asarray(group[name][: self.n_frames]) for name in self.layout.frames if name in group}

    def to_xarray(self, group: str = "series", frames: int | slice | Sequence[int] | None = None) -> Dataset:
        """A part of the file as an xarray dataset, in memory, with units and definitions as attributes.

        group: "series", "surface", "tracks", "dissipation", "stages" (each measure before and after each stage), "frames" (their
        numbers), "grains" (frames x grains), "contacts" (of one frame, by default the last) or "bonds". frames: those to read, by
        default all: several, a slice, or one (from the end if negative), which leaves no axis of frames. ResultsError for what the file has not.
        """
        from dem_cli.results.datasets import to_xarray

        return to_xarray(self, group, frames)

    def _frame_row(self, k: int, axis: str) -> tuple[int, dict[str, float]]:
        if self.axis != axis:
            raise ResultsError(f"{self.path}: its frames are over {self.axis}, not over {axis}")
        if not -self.n_frames <= k < self.n_frames:
            raise IndexError(f"frame {k} of {self.n_frames}")
        k %= self.n_frames
        group = self._file["frames"]
        return k, {name: float(group[name][k]) for name in self.layout.frames if name in group}

    def _walls(self, k: int, n: int) -> Walls:
        """The walls of frame k, whose ends are the first helper points."""
        first = int(self._file["VTKHDF/Steps/PointOffsets"][k]) + n
        ends = self._file["VTKHDF/Points"][first : first + 2 * len(self.walls), :2].reshape(-1, 4)
        return replace(self.walls, **dict(zip(ENDS, ends.T.copy(), strict=True)))

    def _grains(self, k: int) -> tuple[Grains, Ints, Floats]:
        root, data = self._file["VTKHDF"], self._file["VTKHDF/PointData"]
        n, start = self.element_count, int(root["Steps/PointOffsets"][k])
        rows = slice(start, start + n)
        discs = "body" not in data  # format 1
        grains = Grains(
            id=data["id"][:n].astype(np.int64),
            x=root["Points"][rows, 0],
            y=root["Points"][rows, 1],
            angle=data["angle"][rows],
            vx=data["velocity"][rows, 0],
            vy=data["velocity"][rows, 1],
            spin=data["spin"][rows],
            radius=data["radius"][:n],
            mass=data["mass"][:n],
            inertia=data["inertia"][:n],
            escaped=data["escaped"][rows].astype(bool),
            a=data["radius" if discs else "a"][:n],
            b=data["radius" if discs else "b"][:n],
            body=np.arange(n, dtype=np.int64) if discs else data["body"][:n].astype(np.int64),
        )
        stress = np.stack([data["stress"][rows, column] for column in (0, 1, 3, 4)], axis=1).astype(np.float64)
        return grains, data["coordination"][rows].astype(np.int64), stress

    def _contacts(self, k: int, n: int) -> Contacts:
        root, data = self._file["VTKHDF"], self._file["VTKHDF/CellData"]
        lines = int(root["Lines/NumberOfCells"][k])
        start = int(root["Steps/CellDataOffsets/kind"][k]) + n
        kind = data["kind"][start : start + lines]
        count = int(np.count_nonzero((kind == KIND_CONTACT) | (kind == KIND_WALL_CONTACT)))
        rows = slice(start, start + count)
        first = int(root["Steps/ConnectivityIdOffsets"][k, 1])
        pairs = root["Lines/Connectivity"][first : first + 2 * count].reshape(-1, 2).astype(np.int64)
        wall = data["wall"][rows].astype(np.int64)
        return Contacts(
            i=pairs[:, 0].copy(),
            j=np.where(wall >= 0, -1 - wall, pairs[:, 1]),
            nx=data["normal"][rows, 0],
            ny=data["normal"][rows, 1],
            px=data["contact_point"][rows, 0],
            py=data["contact_point"][rows, 1],
            overlap=data["overlap"][rows],
            normal=data["normal_force"][rows],
            shear=data["shear_force"][rows],
            stretch=data["stretch"][rows],
            sliding=data["sliding"][rows].astype(bool),
        )

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_results(path: Path | str) -> Results:
    """Open a result file, also one that is still being written: a BodyResults if it is of the impulse engine.

    ResultsError, in one line, if it is none that can be read.
    """
    path = Path(path)
    if not path.is_file():
        partial = partial_path(path) if path.name else path
        hint = f"; an unfinished run left {partial}" if partial.is_file() else ""
        raise ResultsError(f"{path}: no such file{hint}")
    file = _open(path)
    try:
        _check_format(path, file)
        if file.attrs["engine"] == "impulse":
            from dem_cli.results.body_reader import BodyResults

            return BodyResults(path, file)
        return Results(path, file)
    except ResultsError:
        file.close()
        raise
    except (KeyError, ValueError, OSError, RuntimeError) as error:
        file.close()
        raise ResultsError(f"{path}: is damaged: {error}") from error


def _open(path: Path, tries: int = 4) -> Any:
    """A running program may be in the middle of a flush, which takes some milliseconds: then try again."""
    try:
        return h5py.File(path, "r", locking=False)
    except PermissionError as error:
        raise ResultsError(f"{path}: may not be read") from error
    except OSError as error:
        if not h5py.is_hdf5(path):
            raise ResultsError(f"{path}: is not a result file of dem-cli (no HDF5 file at all)") from error
        if tries <= 1:
            raise ResultsError(f"{path}: is damaged") from error
    time.sleep(0.05)
    return _open(path, tries - 1)


def _check_format(path: Path, file: Any) -> None:
    if _plain(file.attrs.get("format")) != FORMAT:
        raise ResultsError(f"{path}: an HDF5 file, but not a result file of dem-cli")
    version = int(file.attrs["format_version"])
    if version > FORMAT_VERSION:
        raise ResultsError(
            f"{path}: written by a newer dem-cli (format {version}, this one reads up to {FORMAT_VERSION}); update dem-cli"
        )
    if version < 1:
        raise ResultsError(f"{path}: unknown format version {version}")


def _plain(value: Any) -> Any:
    """An attribute as Python's own type."""
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value
