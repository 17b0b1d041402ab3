"""Runs to compare, made by formula: outcomes without files, and files whose scenario and seed are edited in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import report_samples as made

from dem_cli.report.moved import MEANS, Moved, Way
from dem_cli.report.outcome import ENDS, Outcome, Shaking

SETTINGS = {
    "disc": {"grains.shape": "disc", "grains.count": 3000},
    "ellipse": {"grains.shape": "ellipse", "grains.count": 3000, "grains.aspect_ratio.fixed": 2.0},
    "pair": {"grains.shape": "bonded", "grains.count": 1500, "grains.bond.rolling": True},
}
SHAPE = {"disc": "disc", "ellipse": "ellipse 2", "pair": "bonded pair"}
GRAINS = {"disc": 3000, "ellipse": 3000, "pair": 1500}


def an_outcome(
    family: str = "disc",
    seed: int = 1,
    packed: float = 0.21,
    shaken: float = 0.20,
    *,
    gal: float = 400.0,
    hertz: float = 10.0,
    settings: dict[str, Any] | None = None,
    complete: bool = True,
    moved: tuple[Moved, ...] = (),
    **measures: float,
) -> Outcome:
    """A run of a family of the thesis; measures that are not given are 1."""
    known = {f"{name}_{state}": 1.0 for name in ENDS for state in ("packed", "shaken")}
    others = (
        "escaped",
        "overlap",
        "airborne_most",
        "airborne_mean",
        "scattered",
        "tilt",
        "displaced",
        "speed",
        "bond_gap",
    )
    known |= dict.fromkeys((*others, "speed_start", "tracked_start"), 1.0)
    for name, before, after in (
        ("void_ratio", packed, shaken),
        ("porosity", packed / (1 + packed), shaken / (1 + shaken)),
        ("inner", packed, shaken),
    ):
        known |= {f"{name}_packed": before, f"{name}_shaken": after, f"{name}_change": after - before}
    given = {
        "stage.2.amplitude": f"{gal / 100} m/s^2",
        "stage.2.frequency": f"{float(hertz)} Hz",
        "contact.tension": "none",
        "container.width": "1.215 m",
    }
    return Outcome(
        file=f"{family}-{gal:g}-{hertz:g}-{seed}.h5",
        seed=seed,
        version="1",
        complete=complete,
        stop_reason="all stages are done" if complete else "interrupted",
        shape=SHAPE[family],
        family=family,
        grains=GRAINS[family],
        elements=3000,
        width=1.215,
        radius=0.01,
        shaking=(Shaking(gal / 100.0, float(hertz)),),
        settings={**SETTINGS[family], **given, **(settings or {})},
        measures={**known, **measures},
        moved=moved,
        said=(),
    )


def ways(*moves: tuple[float, float, float, float]) -> Moved:
    """Tracked grains: (x at the start, level, net x, net y) of each."""
    way = Way(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    every = tuple(
        replace(way, grain=k, start_x=x0, start_y=level, level=level, x=x, y=y)
        for k, (x0, level, x, y) in enumerate(moves)
    )
    mean = dict.fromkeys(MEANS, 0.0) | {"x": sum(abs(move[2]) for move in moves) / len(moves)}
    return Moved(2, every, mean)


def a_file(
    path: Path,
    *,
    seed: int = 7,
    scenario: tuple[tuple[str, str], ...] = (),
    series: dict[str, Any] | None = None,
    after: dict[str, float] | None = None,
    **how: Any,
) -> Path:
    """A small file of `report_samples`; scenario: texts to put in the place of others; series: columns; after: of the last stage."""
    path = made.make_file(path, **{"columns": 6, "rows": 6, "interval": 0.05, "tracks": (1, 8, 15), **how})
    with h5py.File(path, "a") as file:
        file.attrs["seed"] = seed
        resolved = file.attrs["resolved"]
        for old, new in scenario:
            assert old in resolved
            resolved = resolved.replace(old, new)
        file.attrs["resolved"] = resolved
        for name, values in (series or {}).items():
            file["series"][name][: len(values)] = values
        names = list(file["stages/quantity"].asstr()[:])
        for name, value in (after or {}).items():
            file["stages/after"][-1, names.index(name)] = value
    return path
