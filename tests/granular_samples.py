"""Samples of the granular element engine: a few discs set by hand, and short tests of small packings, run once a session. SI units."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from quasi_static_samples import box as walls_of_box
from quasi_static_text import quick

from dem_cli.assembly import Assembly, build_assembly
from dem_cli.engines.granular_element.boundary import Chain
from dem_cli.engines.granular_element.contacts import DRIVEN, GRAIN, Bodies, Law
from dem_cli.engines.granular_element.engine import GranularElementEngine
from dem_cli.engines.granular_element.sample import Sample
from dem_cli.engines.granular_element.step import Solver
from dem_cli.scenario import QuasiStaticScenario, load_scenario, parse_scenario
from dem_cli.scenario.shipped import folder
from dem_cli.state import Floats, Grains, Increment

KN, KT = 1.0e5, 0.7e5  # N/m: 1e8 and 7e7 dyn/cm
DEPTH, RADIUS = 0.01, 0.01  # m
DYN = 1e-5  # N
SIGMA = 15.0e3  # Pa
FIRM = Solver(momentum=True, accuracy=1e-7, stress=1e-9)
COMPRESS = {"kind": "compress", "stress": "15 kPa", "friction": "15 deg"}


def no_chain() -> Chain:
    none = np.empty(0, dtype=np.int64)
    return Chain(none, np.empty((0, 2)), none, np.empty(0), 0.0, np.zeros(1), False)


def few(
    places: Sequence[Sequence[float]] | Floats,
    half: tuple[float, float] = (1.0, 1.0),
    *,
    radius: Sequence[float] | Floats | float = RADIUS,
    friction: float = 0.0,
    cohesion: float = 0.0,
    wall_friction: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    load: Sequence[float] = (0.0, 0.0),
    driven: Sequence[int] = (),
) -> Sample:
    """Discs in a box about the origin. driven: numbers of discs, the last ones, that move with the box, and then there are no walls."""
    x = np.zeros((len(places), 3))
    x[:, :2] = np.asarray(places, dtype=float)
    n, m = len(x), len(driven)
    assert list(driven) == list(range(n - m, n))
    kind = np.full(n, GRAIN, dtype=np.int64)
    kind[n - m :] = DRIVEN
    box = np.array([0.0, 0.0, *half])
    body = np.tile(np.array(load, dtype=float), (n, 1))
    body[n - m :] = 0.0
    bodies = Bodies(np.broadcast_to(np.asarray(radius, dtype=float), n).copy(), body, kind, n - m)
    law = Law(KN, KT, friction, cohesion, np.array(wall_friction, dtype=float), np.full(4, m == 0))
    unit = np.zeros((n, 2))
    unit[n - m :] = x[n - m :, :2] / box[2:]
    ring = np.arange(n - m, n)
    chain = Chain(ring, unit, 0 * ring, np.ones(m), 0.1 * KN, np.zeros(1), True) if m else no_chain()
    return Sample(x, box, box[2:].copy(), bodies, law, chain, DEPTH)


def cluster(seed: int, n: int = 12, overlap: float = 0.02) -> Floats:
    """Places of n discs of radius RADIUS in a patch of a hexagonal lattice, each a little off its place, all in contact about as drawn."""
    rng = np.random.default_rng(seed)
    row, column = np.divmod(np.arange(n), 4)
    step = 2.0 * RADIUS * (1.0 - overlap)
    places = np.column_stack([step * (column + 0.5 * (row % 2)), step * math.sqrt(0.75) * row])
    return places - places.mean(axis=0) + rng.uniform(-0.4, 0.4, (n, 2)) * overlap * RADIUS


# -- whole tests


def scenario(changes: dict[str, Any] | None = None) -> QuasiStaticScenario:
    """24 discs, compressed with less friction than they are sheared with, then 5 increments of shear; keys changed as in `quick`."""
    short = {"kind": "shear", "hold": "mean-stress", "shear_strain": 0.0025}
    given = copy.deepcopy(
        {"grains.count": 24, "stage": [COMPRESS, short], **(changes or {})}
    )  # keys are set within stages
    made = parse_scenario(quick(given))
    assert isinstance(made, QuasiStaticScenario)
    return made


def run(changes: dict[str, Any] | None = None, assembly: Assembly | None = None) -> list[Increment]:
    """All increments of `scenario(changes)`, of its own packing or another."""
    one = scenario(changes)
    return list(GranularElementEngine(one, assembly or build_assembly(one)).increments())


def stages(increments: list[Increment]) -> list[list[Increment]]:
    """Increments by stage, each with the state that it starts from."""
    return [[one for one in increments if one.stage == k] for k in range(increments[-1].stage + 1)]


@cache
def three_discs(*overrides: str) -> list[Increment]:
    """The shipped test of three discs."""
    return shipped("biaxial-three-discs", *overrides)


@cache
def shipped(name: str, *overrides: str) -> list[Increment]:
    """A shipped test, with keys changed."""
    one = load_scenario(folder() / f"{name}.toml", list(overrides))
    assert isinstance(one, QuasiStaticScenario)
    return list(GranularElementEngine(one, build_assembly(one)).increments())


@cache
def prepared(seed: int = 3, count: int = 24) -> Assembly:
    """Discs compressed to 15 kPa, and the box around them, from (0, 0): the start of other tests. Not to be changed."""
    last = run({"seed": seed, "grains.count": count, "stage": [COMPRESS]})[-1]
    left, bottom, right, top = last.walls.box
    grains = last.grains
    discs = Grains.discs(grains.x - left, grains.y - bottom, grains.radius, 2480.0, DEPTH)
    return Assembly(discs, walls_of_box(right - left, top - bottom))


def turned(assembly: Assembly) -> Assembly:
    """The same packing turned by 90 degrees anticlockwise, in its box from (0, 0)."""
    _, _, width, height = assembly.walls.box
    grains = assembly.grains
    discs = Grains.discs(height - grains.y, grains.x.copy(), grains.radius, 2480.0, DEPTH)
    return Assembly(discs, walls_of_box(height, width))


def pairs(increments: list[Increment]) -> Iterator[tuple[Increment, Increment]]:
    """Each increment of one stage with the one before it."""
    yield from pairwise(increments)
