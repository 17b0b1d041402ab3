"""Result files made by formula, for tests of reports and pictures: every number in them is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from dem_cli.results import ResultWriter, partial_path
from dem_cli.results.schema import SERIES
from dem_cli.state import Bonds, BondStrain, Contacts, Energy, Floats, Frame, Grains, Walls

RADIUS = 0.007
DRIVING = 0.1  # period of shaking [s]
SLOSH = 0.4  # second period in the surface mode [s]
SLOSH_AMPLITUDE = 0.004
SETTLED, END = 1.0, 5.0
VOID_RATIOS = (0.9, 0.2141, 0.1993)  # at the start, settled, shaken
DEPTHS = (0.5, 0.40, 0.39)

RESOLVED = """
title = "{title}"
engine = "explicit"
[grains]
shape = "{shape}"
density = "2480 kg/m^3"
[container]
width = "{width} m"
gravity = "9.80665 m/s^2"
gravity_direction = "-90 deg"
[[stage]]
kind = "settle"
[[stage]]
kind = "shake"
amplitude = "4.0 m/s^2"
frequency = "10.0 Hz"
duration = "4.0 s"
"""

# shape, elements, walls, contacts, width [m], bonds
Sample = tuple[str, Grains, Walls, Contacts, float, Bonds]


def grid(columns: int, rows: int) -> tuple[Grains, Walls, Contacts, float]:
    """Discs on a hexagonal lattice in a container, contacts to the right, up and the floor."""
    k = np.arange(columns * rows)
    row, column = k // columns, k % columns
    x = RADIUS * (1.0 + 2.0 * column + row % 2)
    y = RADIUS * (1.0 + np.sqrt(3.0) * row)
    width = RADIUS * (2.0 * columns + 1.0)
    radius = RADIUS * (0.8 + 0.2 * np.cos(3.0 * k))
    grains = Grains.discs(x, y, radius, 2480.0, 1.0)
    walls = Walls(
        ("left", "bottom", "right"),
        np.array([0.0, 0.0, width]),
        np.array([np.inf, 0.0, 0.0]),
        np.array([0.0, width, width]),
        np.array([0.0, 0.0, np.inf]),
        np.array([0.25, 0.25, 0.25]),
    )
    right = k[column < columns - 1]
    # The grain of the same column one row up touches: rows are shifted by one radius in turn.
    up = k[row < rows - 1]
    floor = k[row == 0]
    i = np.concatenate([right, up, floor])
    j = np.concatenate([right + 1, up + columns, np.full(len(floor), -2)])
    order = np.lexsort((j, i))
    i, j = i[order], j[order]
    target_x = np.where(j < 0, x[i], x[j])
    target_y = np.where(j < 0, 0.0, y[j])
    distance = np.hypot(target_x - x[i], target_y - y[i])
    nx, ny = (target_x - x[i]) / distance, (target_y - y[i]) / distance
    weight = 100.0 * (rows - row[i])
    contacts = Contacts(
        i, j, nx, ny, x[i] + radius[i] * nx, y[i] + radius[i] * ny,
        np.full(len(i), 1e-6), weight * (0.1 + np.abs(ny)), 0.1 * weight * nx, -1e-7 * nx, np.abs(nx) > 0.9,
    )  # fmt: skip
    return grains, walls, contacts, width


def series_row(time: float, step: int, stage: int, residual: float = 0.0) -> dict[str, float]:
    """A row of series in which every quantity has a value of its own."""
    row = {name: 0.5 + 0.01 * k for k, name in enumerate(SERIES)}
    row.update(time=time, step=step, stage=stage, time_step=1e-5, escaped=0.0, airborne=0.0)
    share = min(time / SETTLED, 1.0)
    later = max(time - SETTLED, 0.0) / (END - SETTLED)
    row["void_ratio"] = np.interp(share + later, [0, 1, 2], VOID_RATIOS)
    row["porosity"] = row["void_ratio"] / (1.0 + row["void_ratio"])
    row["depth"] = np.interp(share + later, [0, 1, 2], DEPTHS)
    t = max(time - SETTLED, 0.0)
    row["mode1"] = 0.0 if t == 0.0 else SLOSH_AMPLITUDE * np.sin(2 * np.pi * t / SLOSH)
    row["mode1"] += 0.0 if t == 0.0 else 0.001 * np.sin(2 * np.pi * t / DRIVING)
    row["coordination"] = 3.0 + share
    row["max_overlap"] = 1e-3 * (1.0 + np.sin(7.0 * time))
    row["fabric_xy"] = float("nan")
    fall = 100.0 * (1.0 - (1.0 - share) ** 2)
    row.update(
        potential=300.0 - fall,
        kinetic=fall * (1.0 - share),
        elastic_normal=2.0 * share,
        elastic_tangential=0.5 * share,
    )
    row.update(work=20.0 * later, energy_in=fall + 20.0 * later, residual=residual * share, damping=0.0)
    row.update(time_step_energy=0.01 * share, escaped_energy=0.0)
    lost = 300.0 - row["potential"] - row["kinetic"] - 2.5 * share + row["work"] + 0.01 * share - row["residual"]
    row.update(friction=0.5 * lost, dashpot_normal=0.4 * lost, dashpot_tangential=0.1 * lost, bond_energy=0.0)
    return row


def make_file(
    path: Path,
    *,
    columns: int = 12,
    rows: int = 15,
    tracks: tuple[int, ...] | None = (3, 50, 77, 120),
    stop_after: float = np.inf,
    residual: float = 0.0,
    title: str = "Discs by formula",
    frames: int = 6,
    interval: float = 0.01,
    double_row: bool = False,
    sample: Sample | None = None,
    strain: tuple[float, float, float] = (1e-6, 2e-6, 3e-4),
) -> Path:
    """Two stages, settle (to 1 s) and shake (to 5 s); `stop_after` [s] cuts the run off there.

    double_row: the row between the stages is written once for each. sample: in place of discs on a grid. strain: largest gap [m],
    slip [m] and roll [rad] of its bonds, reached in the last row.
    """
    shape, bonds = "disc", Bonds.none()
    grains, walls, contacts, width = grid(columns, rows)
    if sample is not None:
        shape, grains, walls, contacts, width, bonds = sample
    n = len(grains)
    places = (np.arange(40) + 0.5) / 40 * width
    complete = stop_after == np.inf
    frame_times = np.linspace(0.0, END, frames)
    with ResultWriter(
        path,
        scenario_text="",
        resolved_toml=RESOLVED.format(title=title.replace('"', ""), width=width, shape=shape),
        scenario_hash="0123456789abcdef",
        seed=7,
        engine="explicit",
        title=title,
        grains=grains,
        walls=walls,
        bonds=bonds,
        depth=1.0,
        container={"width": width, "height": None},
        tracks=None if tracks is None else np.array(tracks),
        surface_x=places,
    ) as writer:
        times = np.round(np.arange(0.0, END + 0.5 * interval, interval), 9)
        for step, time in enumerate(times):
            stage = int(time >= SETTLED)
            if time > stop_after:
                break
            row = series_row(float(time), 1000 * step, stage, residual)
            row.update(
                zip(("bond_gap", "bond_slip", "bond_roll"), (time / END * value for value in strain), strict=True)
            )
            if time == 0.0:
                writer.begin_stage("settle", "settle", 0.0, row)
            eta = row["depth"] + row["mode1"] * np.cos(np.pi * places / width) + 0.003 * np.sin(5.0 * places / width)
            eta[0] = np.nan
            writer.append_series(row, eta)
            if time == SETTLED:
                writer.end_stage(SETTLED, "at rest", row)
                writer.begin_stage("shake", "shake", SETTLED, row)
                if double_row:
                    writer.append_series(row, eta)
            moved = _moved(grains, float(time))
            if tracks is not None:
                writer.append_tracks(float(time), moved)
            if np.abs(frame_times - time).min() < 1e-9:
                frame = Frame(
                    step=1000 * step, time=float(time), dt=1e-5, stage=stage, grains=moved, ground=np.zeros((3, 2)),
                    energy=Energy(), residual=0.0, energy_in=1.0, due=frozenset({"frames"}),
                    contacts=contacts, forces=np.zeros((n, 2)), bonds=_strain(bonds, strain, float(time)),
                )  # fmt: skip
                writer.append_frame(frame, np.arange(n) % 7, _stress(n))
            if time == times[-1]:
                writer.end_stage(END, "duration reached", row)
        writer.warn("the fourth grain is shy")
        writer.finish("all stages done" if complete else "interrupted", complete=complete)
    return path if complete else partial_path(path)


def _strain(bonds: Bonds, largest: tuple[float, float, float], time: float) -> BondStrain | None:
    """Evenly spread over the bonds, from 0 to the largest."""
    share = np.linspace(0.0, time / END, len(bonds))
    return BondStrain(*(value * share for value in largest)) if len(bonds) else None


def _moved(grains: Grains, time: float) -> Grains:
    """Grains fall until 1 s, then go round on circles that grow with height, and turn, each as a rigid body."""
    lift = 0.3 * max(SETTLED - time, 0.0) ** 2
    t = max(time - SETTLED, 0.0)
    number, count = grains.body, np.bincount(grains.body)
    middle_x, middle_y = (np.bincount(number, place)[number] / count[number] for place in (grains.x, grains.y))
    size = 0.02 * middle_y
    phase = 2.0 * np.pi * t / SLOSH
    turn = 0.2 * t * np.cos(number * 1.0) + (0.05 * number if len(count) == len(grains) else 0.0)
    dx, dy, c, s = grains.x - middle_x, grains.y - middle_y, np.cos(turn), np.sin(turn)
    return replace(
        grains,
        x=middle_x + c * dx - s * dy + size * np.sin(phase) + 0.3 * size * t,
        y=middle_y * (1.0 + lift) + s * dx + c * dy + size * (np.cos(phase) - 1.0) - 0.01 * t * middle_y,
        angle=grains.angle + turn,
        vx=size * 2.0 * np.pi / SLOSH * np.cos(phase),
        vy=np.full(len(grains), -0.6 * max(SETTLED - time, 0.0)),
        spin=0.2 * np.cos(number * 1.0),
    )


def _stress(n: int) -> Floats:
    depth = np.arange(n, 0, -1, dtype=float)
    return np.stack([50.0 * depth, 5.0 * np.cos(depth), 5.0 * np.cos(depth), 100.0 * depth], axis=1)
