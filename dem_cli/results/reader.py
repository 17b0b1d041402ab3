"""Reader of result files."""

from __future__ import annotations

import math
import time
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from dem_cli.errors import ResultsError
from dem_cli.results.bonds import read_bonds, read_strain
from dem_cli.results.motions import StoredMotion, read_motions
from dem_cli.results.schema import FORMAT, FORMAT_VERSION, FRAMES, KIND_CONTACT, KIND_WALL_CONTACT, SERIES, TRACKS
from dem_cli.results.vtkhdf import GROUND, read_energy
from dem_cli.results.writer import partial_path
from dem_cli.state import Bonds, Contacts, Floats, Frame, Grains, Ints, Walls


@dataclass(frozen=True, kw_only=True)
class StoredFrame(Frame):
    """A frame read back: as it was written, bit for bit, but for `forces`, `warnings` and `stop_reason`, which are not kept.

    coordination (n,). stress (n, 4) [Pa]: xx, xy, yx, yy, in single precision.
    """

    walls: Walls
    coordination: Ints
    stress: Floats


@dataclass(frozen=True)
class Stage:
    """One stage of the run: `before` and `after` are the series rows at its ends, {} where there is none; end NaN if it goes on."""

    name: str
    kind: str
    start: float
    end: float
    reason: str
    before: dict[str, float]
    after: dict[str, float]


@dataclass(frozen=True)
class Tracks:
    """Followed grains: ids (g,), time (t,) [s], arrays: name of schema.TRACKS -> (t, g)."""

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
    """Name -> values over time, each read when asked for."""

    def __init__(self, group: Any) -> None:
        self._group = group
        self._names = [name for name in SERIES if name in group]
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
        self.depth = float(self.attrs["depth"])
        self.width = float(self.attrs["width"])
        height = float(self.attrs["height"])
        self.height = None if math.isnan(height) else height  # None: walls without end
        self.grain_count = int(self.attrs["grains"])
        self.element_count = int(self.attrs.get("elements", self.grain_count))  # format 1 knew discs only
        self.series = Series(file["series"])
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
        group = self._file["walls"]
        ends = {name: np.asarray(group[name][:]) for name in ("x0", "y0", "x1", "y1", "friction")}
        return Walls(name=tuple(group["name"].asstr()[:]), **ends)

    @cached_property
    def bonds(self) -> Bonds:
        return read_bonds(self._file)

    @cached_property
    def stages(self) -> list[Stage]:
        group = self._file["stages"]
        names = list(group["quantity"].asstr()[:])
        count = int(group.attrs["rows"])
        texts = {name: group[name].asstr()[:count] for name in ("name", "kind", "reason")}
        numbers = {name: group[name][:count] for name in ("start", "end", "before", "after")}

        def measures(row: Floats) -> dict[str, float]:
            return {} if np.all(np.isnan(row)) else dict(zip(names, row.tolist(), strict=True))

        return [
            Stage(
                name=str(texts["name"][k]),
                kind=str(texts["kind"][k]),
                start=float(numbers["start"][k]),
                end=float(numbers["end"][k]),
                reason=str(texts["reason"][k]),
                before=measures(numbers["before"][k]),
                after=measures(numbers["after"][k]),
            )
            for k in range(count)
        ]

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
        arrays = {name: np.asarray(group[name][:rows]) for name in TRACKS}
        return Tracks(ids=np.asarray(group["grain"][:]), time=np.asarray(group["time"][:rows]), arrays=arrays)

    @cached_property
    def surface(self) -> Surface:
        group = self._file["surface"]
        rows = int(group.attrs["rows"])
        return Surface(np.asarray(group["x"][:]), np.asarray(group["time"][:rows]), np.asarray(group["eta"][:rows]))

    @cached_property
    def frame_times(self) -> Floats:
        """Times of the frames, shape (n_frames,) [s]."""
        return np.asarray(self._file["VTKHDF/Steps/Values"][: self.n_frames])

    def frame(self, k: int) -> StoredFrame:
        """Frame k, counted from the end if negative. Raises IndexError."""
        if not -self.n_frames <= k < self.n_frames:
            raise IndexError(f"frame {k} of {self.n_frames}")
        k %= self.n_frames
        row = {name: float(self._file["frames"][name][k]) for name in FRAMES if name in self._file["frames"]}
        grains, coordination, stress = self._grains(k)
        return StoredFrame(
            step=int(row["step"]),
            time=row["time"],
            dt=row["time_step"],
            stage=int(row["stage"]),
            grains=grains,
            ground=np.array([row[name] for name in GROUND]).reshape(3, 2),
            energy=read_energy(row),
            residual=row["residual"],
            energy_in=row["energy_in"],
            due=frozenset({"frames"}),
            contacts=self._contacts(k, len(grains)),
            bonds=read_strain(self._file, k),
            unbalanced=row["unbalanced"],
            stage_start=bool(row["stage_start"]),
            stage_end=bool(row["stage_end"]),
            walls=self.walls,
            coordination=coordination,
            stress=stress,
        )

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
    """Open a result file, also one that is still being written. ResultsError, in one line, if it is none that can be read."""
    path = Path(path)
    if not path.is_file():
        partial = partial_path(path) if path.name else path
        hint = f"; an unfinished run left {partial}" if partial.is_file() else ""
        raise ResultsError(f"{path}: no such file{hint}")
    file = _open(path)
    try:
        _check_format(path, file)
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
