"""Small increments of a quasi-static test, made by hand and in equilibrium, and a result file of them.

`lattice` is a square array of equal discs between four walls, or in a ring of boundary grains: its contact forces follow from the stresses
asked for, so they are in equilibrium with them whatever the strains.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dem_cli.analysis.quasi_static import measure_increment
from dem_cli.results import ResultWriter, partial_path
from dem_cli.state import Contacts, Floats, Grains, Increment, QuasiStaticEnergy, Slips, Walls

KN, KT = 1.0e5, 0.7e5  # N/m
DEPTH, RADIUS, DENSITY = 0.01, 0.003, 2500.0  # m, m, kg/m^3
SIGMA = 15.0e3  # Pa
COLUMNS, ROWS = 5, 4
COMPRESSION, PEAK = 4, 0.6  # increments of the first stage; share of the second at which the stress ratio is largest
RESOLVED = """title = "{title}"
engine = "granular-element"
seed = 7
depth = "0.01 m"

[grains]
shape = "disc"
count = {count}
density = "2500 kg/m^3"
radius = "3 mm"

[material]
normal_stiffness = "1e5 N/m"
tangential_stiffness = "0.7e5 N/m"

[contact]
friction = 0.466

[boundary]
kind = "{kind}"

[packing]
method = "overlapping"

[[stage]]
kind = "compress"
name = "compress"
stress = "15 kPa"
levels = [0.25, 0.5, 0.75, 1.0]

[[stage]]
kind = "shear"
name = "shear"
hold = "mean-stress"
axial = "y"
shear_strain = {shear_strain}
increment = 0.0005

[solver]
method = "momentum"
sub_steps = 4
"""


def box(width: float, height: float, friction: float = 0.0) -> Walls:
    """Left, right, bottom and top wall from (0, 0) to (width, height), from corner to corner."""
    return Walls(
        name=("left", "right", "bottom", "top"),
        x0=np.array([0.0, width, 0.0, 0.0]),
        y0=np.array([0.0, 0.0, 0.0, height]),
        x1=np.array([0.0, width, width, width]),
        y1=np.array([height, height, 0.0, height]),
        friction=np.full(4, friction),
    )


def no_walls() -> Walls:
    none = np.empty(0)
    return Walls((), none, none, none, none, none)


def make_contacts(rows: list[tuple[float, ...]]) -> Contacts:
    """Rows of i, j, nx, ny, px, py, normal force, shear force; overlap and stretch as their springs have them; sorted by (i, j)."""
    table = np.array(sorted(rows), dtype=float).reshape(-1, 8)
    nx, ny, px, py, normal, shear = (table[:, k].copy() for k in range(2, 8))
    i, j = (table[:, k].astype(np.int64) for k in (0, 1))
    return Contacts(i, j, nx, ny, px, py, normal / KN, normal, shear, -shear / KT, np.zeros(len(i), dtype=bool))


def no_slips() -> Slips:
    none = np.empty(0, dtype=np.int64)
    return Slips(none, none, np.empty(0))


def some_slips(contacts: Contacts, seed: int, count: int = 30) -> Slips:
    """Chosen contacts, each of which dissipates less than the one before it by a fifth or so."""
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(len(contacts))[:count]
    energy = 1e-8 * 0.8 ** np.arange(len(chosen)) * rng.uniform(0.9, 1.1, len(chosen))
    return Slips(contacts.i[chosen], contacts.j[chosen], energy)


def make_increment(grains: Grains, contacts: Contacts, width: float, height: float, **changes: Any) -> Increment:
    """An increment at the start of a run, without strain, between the walls of a box; anything can be changed."""
    given: dict[str, Any] = {
        "number": 0,
        "stage": 0,
        "in_stage": 0,
        "walls": box(width, height),
        "slips": no_slips(),
        "area": width * height,
        "stress": np.zeros(2),
        "strain": np.zeros(2),
        "energy": elastic(contacts),
        "due": frozenset({"series", "frames"}),
    }
    return Increment(grains=grains, contacts=contacts, width=width, height=height, **{**given, **changes})


def elastic(contacts: Contacts, **others: float) -> QuasiStaticEnergy:
    """What the springs of contacts hold."""
    normal, tangential = (0.5 * float(v @ v) / k for v, k in ((contacts.normal, KN), (contacts.shear, KT)))
    return QuasiStaticEnergy(elastic_normal=normal, elastic_tangential=tangential, **others)


def lattice(
    stress: tuple[float, float] = (SIGMA, SIGMA),
    strain: tuple[float, float] = (0.0, 0.0),
    *,
    columns: int = COLUMNS,
    rows: int = ROWS,
    ring: bool = False,
    **changes: Any,
) -> Increment:
    """columns x rows discs under `stress` (x, y) [Pa] after `strain` (x, y). ring: boundary grains in place of walls, one at each contact.

    Numbered row by row from the lower left; each contact of a column carries sigma_y W L/columns, of a row sigma_x H L/rows.
    """
    width, height = 2.0 * RADIUS * columns * (1.0 - strain[0]), 2.0 * RADIUS * rows * (1.0 - strain[1])
    column, row = (a.ravel() for a in np.meshgrid(np.arange(columns), np.arange(rows)))
    x, y = width * (column + 0.5) / columns, height * (row + 0.5) / rows
    n = len(x)
    fx, fy = stress[0] * height * DEPTH / rows, stress[1] * width * DEPTH / columns
    half_x, half_y = 0.5 * width / columns, 0.5 * height / rows
    found: list[tuple[float, ...]] = []
    ends: list[tuple[float, float]] = []  # centres of boundary grains

    def at_boundary(k: int, wall: int, nx: float, ny: float, normal: float) -> None:
        px, py = x[k] + nx * half_x, y[k] + ny * half_y
        found.append((k, n + len(ends) if ring else -1 - wall, nx, ny, px, py, normal, 0.0))
        ends.append((px + nx * RADIUS, py + ny * RADIUS))

    for k in range(n):
        if column[k] + 1 < columns:
            found.append((k, k + 1, 1.0, 0.0, x[k] + half_x, y[k], fx, 0.0))
        else:
            at_boundary(k, 1, 1.0, 0.0, fx)
        if column[k] == 0:
            at_boundary(k, 0, -1.0, 0.0, fx)
        if row[k] + 1 < rows:
            found.append((k, k + columns, 0.0, 1.0, x[k], y[k] + half_y, fy, 0.0))
        else:
            at_boundary(k, 3, 0.0, 1.0, fy)
        if row[k] == 0:
            at_boundary(k, 2, 0.0, -1.0, fy)
    if ring:
        x, y = np.append(x, [end[0] for end in ends]), np.append(y, [end[1] for end in ends])
        changes = {"boundary": len(ends), "walls": no_walls(), **changes}
    grains = Grains.discs(x, y, np.full(len(x), RADIUS), DENSITY, DEPTH)
    given = {"stress": np.array(stress), "strain": np.array(strain), **changes}
    return make_increment(grains, make_contacts(found), width, height, **given)


def with_shear(increment: Increment, share: float, seed: int = 1) -> Increment:
    """With shear forces up to `share` of the normal ones, as drawn; those above 0.8 of that slide. No equilibrium any more."""
    rng = np.random.default_rng(seed)
    contacts = increment.contacts
    part = rng.uniform(-share, share, len(contacts))
    contacts = replace(
        contacts,
        shear=part * contacts.normal,
        stretch=-part * contacts.normal / KT,
        sliding=np.abs(part) > 0.8 * share,
    )
    return replace(increment, contacts=contacts, energy=elastic(contacts))


def open_writer(path: Path, first: Increment | None = None, **changes: Any) -> ResultWriter:
    """A file begun with the grains and walls of `first`, a `lattice` if left out."""
    first = first or lattice()
    arguments: dict[str, Any] = {
        "scenario_text": 'title = "test"  # as given\n',
        "resolved_toml": resolved(first),
        "scenario_hash": "0123456789abcdef",
        "seed": 7,
        "engine": "granular-element",
        "title": "test",
        "grains": first.grains,
        "walls": first.walls,
        "depth": DEPTH,
        "container": {"width": first.width, "height": first.height},
        "tracks": np.array([1, 4]),
        "boundary": first.boundary,
    }
    return ResultWriter(path, **{**arguments, **changes})


def resolved(first: Increment, title: str = "test", increments: int = 60) -> str:
    kind, count = "chain" if first.boundary else "walls", len(first.grains) - first.boundary
    return RESOLVED.format(title=title.replace('"', ""), kind=kind, count=count, shear_strain=0.0005 * increments)


def shear_test(increments: int = 60, *, ring: bool = False, peak: float = 1.75, axial: int = 1) -> list[Increment]:
    """A whole test: compression in 4 levels, then shear at constant mean stress by 0.05 % an increment.

    The stress ratio rises to `peak` at 0.6 of the shear and falls to 0.8 of the way; volume shrinks first and then grows; one increment in
    twenty is an event. Each stage begins with an increment of number of its own stage, in_stage 0.
    """
    found, pressed = [], 0.002  # strain by the compression, undone in the count of the shear
    energy = QuasiStaticEnergy()
    for k in range(COMPRESSION + 1):
        level = max(0.05, k / COMPRESSION)
        back = pressed * (level - 1.0)
        one = lattice((level * SIGMA, level * SIGMA), (back, back), ring=ring)
        energy = elastic(one.contacts, work=elastic(one.contacts).stored)
        found.append(
            replace(
                one, number=k, in_stage=k, energy=energy, axial=axial, iterations=200 + 10 * k, sub_steps=1,
                stage_start=k == 0, stage_end=k == COMPRESSION, stop_reason="stress reached" if k == COMPRESSION else "",
            )
        )  # fmt: skip
    friction = released = 0.0
    for k in range(increments + 1):
        part = k / increments
        rise = min(part / PEAK, 1.0)
        ratio = 1.0 + (peak - 1.0) * (rise * (2.0 - rise) - 0.2 * max(0.0, part - PEAK) / (1.0 - PEAK))
        s2 = 2.0 * SIGMA / (1.0 + ratio)
        shear, volume = 0.0005 * k, 0.0004 * math.sin(2.0 * math.pi * min(part, 0.25)) - 0.002 * max(0.0, part - 0.25)
        e1, e2 = 0.5 * (volume + shear), 0.5 * (volume - shear)
        sides, strains = (s2, 2.0 * SIGMA - s2), (e2, e1)
        if axial == 0:
            sides, strains = sides[::-1], strains[::-1]
        one = with_shear(lattice(sides, strains, ring=ring), 0.4 * (ratio - 1.0) + 1e-3, seed=k)
        event, slips = k > 0 and k % 20 == 0, some_slips(one.contacts, k) if k else no_slips()
        friction += float(slips.energy.sum())
        released += 1e-7 * event
        stored = one.energy.stored
        work = stored + friction + released + 1e-10 * k
        found.append(
            replace(
                one, number=COMPRESSION + k, stage=1, in_stage=k, slips=slips, axial=axial, event=event,
                energy=elastic(one.contacts, work=work, friction=friction, released=released, residual=1e-10 * k),
                balance=1e-6 * (k + 1), unbalanced=1e-7, iterations=700 + 7 * (k % 13) + 4000 * event, sub_steps=4,
                rung=2 * event, stage_start=k == 0, stage_end=k == increments,
                stop_reason="shear strain reached" if k == increments else "",
                warnings=("the increment passed through a collapse",) if event else (),
            )
        )  # fmt: skip
    return found


def series_row(increment: Increment) -> dict[str, float]:
    return measure_increment(increment, DEPTH, KN, KT).row


def stage_names(stage: int) -> tuple[str, str]:
    return (("compress", "compress"), ("shear", "shear"))[stage]


def write_increment(writer: ResultWriter, increment: Increment) -> None:
    """All of an increment, whatever is due, as `dem_cli.run` does."""
    measures = measure_increment(increment, DEPTH, KN, KT)
    writer.append_series(measures.row, slips=increment.slips)
    if increment.stage_start:
        writer.begin_stage(*stage_names(increment.stage), increment.number, measures.row)
    if increment.in_stage > 0 or increment.number == 0:
        writer.append_frame(increment, measures.coordination, measures.stress)
    writer.append_tracks(increment.number, increment.grains)
    for warning in increment.warnings:
        writer.warn(warning)
    if increment.stage_end:
        writer.end_stage(increment.number, increment.stop_reason, measures.row)


def write_test(
    path: Path,
    title: str = "test",
    increments: int = 60,
    *,
    ring: bool = False,
    stop_after: int | None = None,
    **test: Any,
) -> Path:
    """A result file of `shear_test`; stop_after: number of the last increment, after which the run fails. Returns where the file is."""
    states = shear_test(increments, ring=ring, **test)
    first = states[0]
    with open_writer(path, first, title=title, resolved_toml=resolved(first, title, increments)) as writer:
        for increment in states:
            if stop_after is not None and increment.number > stop_after:
                writer.finish("RunError: no equilibrium", complete=False)
                return partial_path(path)
            write_increment(writer, increment)
        writer.finish("all stages are done")
    return path


def rotated(increment: Increment) -> Increment:
    """The same sample turned by 90 degrees anticlockwise about the origin; without walls, whose names would be wrong."""

    def turned(values: Any, x: str, y: str) -> Any:
        return replace(values, **{x: -getattr(values, y), y: getattr(values, x)})

    contacts = turned(turned(increment.contacts, "nx", "ny"), "px", "py")
    swapped: dict[str, Floats] = {name: getattr(increment, name)[::-1].copy() for name in ("stress", "strain")}
    return replace(
        increment,
        grains=turned(increment.grains, "x", "y"),
        contacts=contacts,
        walls=no_walls(),
        width=increment.height,
        height=increment.width,
        axial=1 - increment.axial,
        **swapped,
    )
