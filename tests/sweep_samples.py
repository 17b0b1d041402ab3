"""Folders of sweeps made by formula: a manifest, and small result files whose void ratios and surfaces are known."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import report_samples as made

from dem_cli.results.manifest import Manifest, Member, SweepAxis, write_manifest

GAL, HERTZ, SHAPE, SEED = "stage.shake.amplitude", "stage.shake.frequency", "grains.shape", "seed"
PACKED = {"disc": 0.21, "ellipse": 0.19}
SHARE = {1.0: 0.5, 2.0: 2.0, 5.0: 1.0}  # of the change and of the surface's motion at each frequency [Hz]
DEPTH, SETTLED_DEPTH = 0.40, 0.39
T1 = 0.4736  # of a liquid in these containers [s]

Axes = Mapping[str, tuple[Any, ...]]
GRID: Axes = {
    SHAPE: ("disc", "ellipse"),
    GAL: ("400 gal", "800 gal"),
    HERTZ: ("1 Hz", "2 Hz", "5 Hz"),
    SEED: (1, 2, 3),
}


def number(text: Any) -> float:
    return float(str(text).split()[0])


def change(settings: Mapping[str, Any]) -> float:
    """Of the void ratio: grows with the amplitude, is largest at 2 Hz, and differs a little from seed to seed."""
    gal, hertz, seed = number(settings.get(GAL, "400 gal")), number(settings.get(HERTZ, "2 Hz")), settings.get(SEED, 1)
    return -0.004 * gal / 400.0 * SHARE[hertz] + 2e-4 * math.sin(7.0 * seed + gal + hertz)


def packed(settings: Mapping[str, Any]) -> float:
    return PACKED[str(settings.get(SHAPE, "disc"))] + 1e-3 * (int(settings.get(SEED, 1)) - 2)


def surface(settings: Mapping[str, Any]) -> float:
    """Amplitude [m] of the surface at the driving frequency."""
    return 0.005 * number(settings.get(GAL, "400 gal")) / 400.0 * SHARE[number(settings.get(HERTZ, "2 Hz"))]


def name_of(settings: Mapping[str, Any]) -> str:
    return "-".join(str(value).split()[0].removesuffix(".toml") for value in settings.values())


def grid(axes: Axes) -> list[dict[str, Any]]:
    return [dict(zip(axes, point, strict=True)) for point in product(*axes.values())]


@cache
def base() -> bytes:
    """A result file that those of members are made from."""
    with tempfile.TemporaryDirectory() as folder:
        path = made.make_file(Path(folder) / "base.h5", columns=12, rows=4, interval=0.02, tracks=None, frames=2)
        return path.read_bytes()


def make_sweep(
    folder: Path,
    axes: Axes = GRID,
    *,
    failed: Iterable[str] = (),
    waiting: Iterable[str] = (),
    change: Callable[[Mapping[str, Any]], float] = change,
    former: tuple[str, ...] = (),
    write: Callable[[Path, Mapping[str, Any]], object] | None = None,
) -> Path:
    """A sweep over all combinations of `axes`; members named in `failed` or `waiting` have no file.

    change: of the void ratio. write: writes a member's file, in place of a shaken one.
    """
    folder.mkdir()
    members = []
    for k, settings in enumerate(grid(axes)):
        name = name_of(settings) or "only"
        member = Member(name, f"{name}.h5", f"{k:016x}", settings, program="1.2")
        if name in failed:
            reason = "grain 17 left the container at 1.2 s; take a smaller dt"
            member = member.with_state("failed", reason=reason, seconds=3.0)
        elif name not in waiting:
            if write is None:
                (folder / member.file).write_bytes(base())
                edit(folder / member.file, member.hash, settings, change(settings))
            else:
                write(folder / member.file, settings)
                sign(folder / member.file, member.hash, settings)
            member = member.with_state("done", seconds=30.0 + k)
        members.append(member)
    write_manifest(
        Manifest(
            title="Discs and ellipses over amplitude and frequency",
            scenario="shake.toml",
            axes=tuple(
                SweepAxis((key,), tuple((value,) for value in values), "scenario" if key == "scenario" else "grid")
                for key, values in axes.items()
            ),
            members=tuple(members),
            former=former,
            folder=folder,
        )
    )
    return folder


def sign(path: Path, scenario_hash: str, settings: Mapping[str, Any]) -> None:
    """Make a file that of a member, by its attributes."""
    with h5py.File(path, "a") as file:
        file.attrs["scenario_hash"] = scenario_hash
        file.attrs["seed"] = settings.get(SEED, 1)
        file.attrs["wall_time"] = 30.0


def edit(path: Path, scenario_hash: str, settings: Mapping[str, Any], change: float) -> None:
    """Make a copied file that of a member, and its numbers."""
    sign(path, scenario_hash, settings)
    hertz, gal = number(settings.get(HERTZ, "2 Hz")), number(settings.get(GAL, "400 gal"))
    before = packed(settings)
    with h5py.File(path, "a") as file:
        resolved = str(file.attrs["resolved"])
        for old, new in (
            ('amplitude = "4.0 m/s^2"', f'amplitude = "{gal / 100.0} m/s^2"'),
            ('frequency = "10.0 Hz"', f'frequency = "{hertz} Hz"'),
        ):
            assert old in resolved
            resolved = resolved.replace(old, new)
        file.attrs["resolved"] = resolved
        time = file["series/time"][:]
        shaken = np.maximum(time - made.SETTLED, 0.0)
        file["series/mode1"][:] = surface(settings) * np.sin(2.0 * np.pi * hertz * shaken)
        names = list(file["stages/quantity"].asstr()[:])
        ends = {
            ("before", 1): (before, DEPTH), ("after", 0): (before, DEPTH), ("after", 1): (before + change, SETTLED_DEPTH),
        }  # fmt: skip
        for (when, stage), (void_ratio, depth) in ends.items():
            values = {"void_ratio": void_ratio, "porosity": void_ratio / (1.0 + void_ratio), "depth": depth}
            for name, value in values.items():
                file[f"stages/{when}"][stage, names.index(name)] = value
