"""Small synthetic frames and a result file made of them, for the tests of dem_cli.results."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from dem_cli.results import ResultWriter
from dem_cli.results.schema import SERIES
from dem_cli.state import Contacts, Energy, Floats, Frame, Grains, Ints, Walls

N = 6


def some_grains(seed: int = 1) -> Grains:
    rng = np.random.default_rng(seed)
    grains = Grains.discs(rng.random(N), rng.random(N), np.linspace(0.01, 0.02, N), density=2480.0, depth=1.0)
    for name in ("x", "y", "angle", "vx", "vy", "spin"):
        getattr(grains, name)[:] = rng.normal(size=N)
    grains.escaped[2] = seed % 2 == 0
    return grains


def box(top: float = np.inf) -> Walls:
    """Two side walls (without end by default) and a floor."""
    return Walls(
        name=("left", "right", "bottom"),
        x0=np.array([0.0, 1.0, 0.0]),
        y0=np.array([0.0, 0.0, 0.0]),
        x1=np.array([0.0, 1.0, 1.0]),
        y1=np.array([top, top, 0.0]),
        friction=np.array([0.1, 0.2, 0.3]),
    )


def no_walls() -> Walls:
    none = np.empty(0)
    return Walls(name=(), x0=none, y0=none, x1=none, y1=none, friction=none)


def some_contacts(pairs: list[tuple[int, int]], seed: int = 2) -> Contacts:
    rng = np.random.default_rng(seed)
    i, j = (np.array([pair[k] for pair in pairs], dtype=np.int64) for k in (0, 1))
    numbers = {
        name: rng.normal(size=len(pairs)) for name in ("nx", "ny", "px", "py", "overlap", "normal", "shear", "stretch")
    }
    return Contacts(i=i, j=j, sliding=rng.random(len(pairs)) < 0.5, **numbers)


def some_frame(k: int, pairs: list[tuple[int, int]]) -> Frame:
    rng = np.random.default_rng(100 + k)
    energy = Energy(*rng.normal(size=len(fields(Energy))).tolist())
    return Frame(
        step=1000 * k,
        time=0.1 * k,
        dt=1e-5,
        stage=k // 2,
        grains=some_grains(k),
        ground=rng.normal(size=(3, 2)),
        energy=energy,
        residual=1e-9 * k,
        energy_in=3.0 + k,
        due=frozenset({"frames"}),
        contacts=some_contacts(pairs, seed=k),
        unbalanced=0.01 * k,
        stage_start=k == 0,
        stage_end=k == 2,
    )


# Contacts of each frame: with walls (-1 - w), without any, with grains only.
PAIRS: list[list[tuple[int, int]]] = [[(0, -3), (0, 1), (4, 5)], [], [(1, -1), (1, -3), (2, 3), (3, -2)], [(0, 5)]]


def coordination(k: int) -> Ints:
    return np.arange(N, dtype=np.int64) + k


def stress(k: int) -> Floats:
    return np.arange(4.0 * N).reshape(N, 4) * 0.5 + k


def open_writer(path: Path, **changes: Any) -> ResultWriter:
    arguments: dict[str, Any] = {
        "scenario_text": 'title = "test"  # as given\n',
        "resolved_toml": 'title = "test"\nseed = 7\n',
        "scenario_hash": "0123456789abcdef",
        "seed": 7,
        "engine": "explicit",
        "title": "test",
        "grains": some_grains(),
        "walls": box(),
        "depth": 0.5,
        "container": {"width": 1.0, "height": None},
        "tracks": np.array([1, 4]),
        "surface_x": np.array([0.25, 0.5, 0.75]),
    }
    return ResultWriter(path, **{**arguments, **changes})


def series_row(k: int) -> dict[str, float]:
    return {**{name: 10.0 * k + index for index, name in enumerate(SERIES)}, "time": 0.1 * k}


def write_all(path: Path, **changes: Any) -> Path:
    """Four frames, three series rows, two stages."""
    with open_writer(path, **changes) as writer:
        writer.begin_stage("fall", "settle", 0.0)
        for k in range(3):
            writer.append_series(series_row(k), np.array([1.0, np.nan, 3.0]) + k)
            writer.append_tracks(0.05 * k, some_grains(k))
        writer.end_stage(0.2, "at rest", series_row(2))
        writer.begin_stage("shake it", "shake", 0.2)
        for k, pairs in enumerate(PAIRS):
            writer.append_frame(some_frame(k, pairs), coordination(k), stress(k))
        writer.warn("first")
        writer.warn("zweite: µ")
        writer.finish("all stages done")
    return path


def same_arrays(a: Any, b: Any) -> bool:
    """Every field equal, bit for bit, and of the same type."""
    return all(
        getattr(a, f.name).dtype == getattr(b, f.name).dtype and np.array_equal(getattr(a, f.name), getattr(b, f.name))
        for f in fields(a)
    )


def as_format_1(path: Path) -> None:
    """Take away what format 1 did not have."""
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 1
        del file.attrs["elements"]
        for name in ("body", "a", "b"):
            del file["VTKHDF/PointData"][name]
            del file["VTKHDF/Steps/PointDataOffsets"][name]
        del file["frames/bond_energy"]
        for name in ("bond_energy", "bond_gap", "bond_slip", "bond_roll"):
            del file["series"][name]
        group = file["stages"]
        keep = ~np.char.startswith(group["quantity"].asstr()[:].astype(str), "bond_")
        for name in ("quantity", "units", "before", "after"):
            values = group[name][:]
            del group[name]
            shorter = values[keep] if values.ndim == 1 else values[:, keep]
            group.create_dataset(name, data=shorter, dtype=values.dtype)
