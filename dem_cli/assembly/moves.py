"""Packing by local moves (thesis 2.7 b): grains on a lattice make small random moves and turns, which are kept where nothing overlaps.

Moves up are kept with the probability exp(-dy / l) of heavy grains in a heat bath (Metropolis), so that the grains sink; a ceiling follows
the highest one down.
"""

from __future__ import annotations

import math

import numpy as np

from dem_cli.assembly.bodies import Bodies
from dem_cli.assembly.overlap import (
    PLACED,
    X,
    Y,
    cell_of,
    extents,
    is_free,
    link,
    link_all,
    place,
    place_all,
    unlink,
)
from dem_cli.assembly.region import Packed, Region, Tell
from dem_cli.jit import kernel
from dem_cli.state import Floats

LIFT = 0.05  # l of the Metropolis rule, in mean radii
ROOM = 1e-9  # share of their size that is kept between grains, against rounding
LONGER, SHORTER = (
    1.1,
    0.96,
)  # a grain's own step after a move that was kept, and one that was not: 0.3 of them are in the long run
LONGEST, WIDEST, SHORTEST = 2.0, 0.5, 1e-4  # steps in mean radii, turns in rad
TRIALS = 100000  # between two looks at the ceiling and the step, at least one sweep
STALLED = (
    2e-4  # the fill's middle sinks by less than this share of its height in LOOK sweeps: it will not get much denser
)
LOOK = 100


@kernel()
def move(
    bodies, x, y, angle, width, ceiling, size, step, turn, lift, numbers, placed, cell, head, following, before, largest
):
    """One trial for each row of `numbers` (n, 5), uniform in 0..1: which grain, shift or turn, how far, whether up is kept.

    step, turn (g,): how far each grain moves, in `size` [m], and turns [rad]. They, x, y, angle, placed and the cells change in place.
    """
    trial = np.empty((placed.shape[0], PLACED))
    for t in range(numbers.shape[0]):
        k = min(int(numbers[t, 0] * x.size), x.size - 1)
        first, end = bodies.start[k], bodies.start[k + 1]
        tx, ty, ta = x[k], y[k], angle[k]
        turning = bodies.round[k] == 0.0 and numbers[t, 1] < 0.5
        if turning:
            ta += (2.0 * numbers[t, 2] - 1.0) * turn[k]
            place(bodies, k, tx, ty, ta, 1.0, ROOM, trial, 0)
        else:
            far = step[k] * size
            dx, dy = (2.0 * numbers[t, 2] - 1.0) * far, (2.0 * numbers[t, 3] - 1.0) * far
            if dy > 0.0 and numbers[t, 4] >= math.exp(-dy / lift):
                continue
            tx, ty = tx + dx, ty + dy
            for e in range(first, end):
                trial[e - first] = placed[e]
                trial[e - first, X] += dx
                trial[e - first, Y] += dy
        left, right, bottom, top = extents(trial, 0, end - first)
        inside = left >= 0.0 and right <= width and bottom >= 0.0 and top <= ceiling
        free = inside and is_free(bodies, k, trial, tx, ty, x, y, placed, cell, head, following, largest)
        pace, most = (turn, WIDEST) if turning else (step, LONGEST)
        pace[k] = min(max(pace[k] * (LONGER if free else SHORTER), SHORTEST), most)
        if not free:
            continue
        column, row = cell_of(x[k], y[k], cell, head.shape[0], head.shape[1])
        to_column, to_row = cell_of(tx, ty, cell, head.shape[0], head.shape[1])
        if column != to_column or row != to_row:
            unlink(k, column, row, head, following, before)
            link(k, to_column, to_row, head, following, before)
        x[k], y[k], angle[k] = tx, ty, ta
        placed[first:end] = trial[: end - first]


def lattice(bodies: Bodies, width: float) -> tuple[Floats, Floats]:
    """Rows of as many places as the width has for circles around the largest grain, every second row shifted by half a place."""
    room = 2.0 * float(bodies.reach.max()) * (1.0 + 1e-6)
    columns = max(int((width - 0.5 * room) / room), 1)
    spacing = (width - (0.5 * room if columns > 1 or width >= 1.5 * room else 0.0)) / columns
    row, column = np.divmod(np.arange(bodies.number), columns)
    shift = 0.5 * room if columns > 1 or width >= 1.5 * room else 0.0
    return (column + 0.5) * spacing + (row % 2) * shift, (row + 0.5) * room


def shake_down(
    bodies: Bodies,
    x: Floats,
    y: Floats,
    angle: Floats,
    region: Region,
    sweeps: int,
    rng: np.random.Generator,
    tell: Tell,
) -> Packed:
    """Local moves from places that do not overlap, until all grains are below the region's height, or get no closer, or after `sweeps`
    trials a grain.
    """
    x, y, angle = x.copy(), y.copy(), angle.copy()
    placed = np.zeros((len(bodies.a), PLACED))
    place_all(bodies, x, y, angle, np.ones(bodies.number), ROOM, placed)
    mean = math.sqrt(bodies.solid / (bodies.number * math.pi))
    ceiling = max(float(extents(placed, 0, len(placed))[3]), 0.0)
    cell = 2.0 * float(bodies.reach.mean())
    head = np.empty((int(region.width / cell) + 1, int(ceiling / cell) + 1), dtype=np.int64)
    following, before = np.empty((2, bodies.number), dtype=np.int64)
    link_all(np.arange(bodies.number), x, y, cell, head, following, before)
    step, turn = np.full((2, bodies.number), WIDEST)
    done, looked, middle = 0.0, 0.0, math.inf
    while ceiling > region.height and done < sweeps:
        tell(f"local moves: sweep {done:.0f}, void ratio {region.void_ratio(ceiling):.3f}")
        trials = max(min(TRIALS, 5 * bodies.number), 1)
        move(
            bodies, x, y, angle, region.width, ceiling, mean, step, turn, LIFT * mean, rng.random((trials, 5)), placed,
            cell, head, following, before, float(bodies.reach.max()),
        )  # fmt: skip
        done += trials / bodies.number
        ceiling = max(region.height, float(extents(placed, 0, len(placed))[3]))
        if done >= looked + LOOK:
            new = float(bodies.area @ y) / bodies.solid
            if new > (1.0 - STALLED) * middle:
                break
            looked, middle = done, new
    return Packed(x, y, angle, ceiling)
