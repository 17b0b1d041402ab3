"""Packing by rejection (thesis 2.7 a): grains are dropped at random places, large ones first, and kept where they overlap none."""

from __future__ import annotations

import numpy as np

from dem_cli.assembly.bodies import Bodies
from dem_cli.assembly.overlap import PLACED, X, Y, cell_of, extents, is_free, link, link_all, place
from dem_cli.assembly.region import Packed, Region, Tell
from dem_cli.jit import kernel
from dem_cli.state import Floats, Ints

CHUNK = 65536  # random places drawn at a time
RAISE = 1.02  # the ceiling goes up by this factor when a grain finds no place
ROOM = 1e-9  # share of the mean reach that is kept between neighbours, against rounding


@kernel()
def drop(
    bodies,
    order,
    done,
    tried,
    attempts,
    x,
    y,
    angle,
    width,
    height,
    numbers,
    placed,
    cell,
    head,
    following,
    before,
    largest,
):
    """Drops the grains of `order` from number `done` on at the places of `numbers` (n, 2), uniform in 0..1.

    tried: places that the present grain has tried already. Returns (grains done, places tried by the next one); it stops
    when all are placed, one has tried `attempts` places, or the numbers are used up.
    """
    trial = np.empty((placed.shape[0], PLACED))
    used = 0
    while done < order.size and tried < attempts and used < numbers.shape[0]:
        k = order[done]
        elements = bodies.start[k + 1] - bodies.start[k]
        place(bodies, k, 0.0, 0.0, angle[k], 1.0, ROOM, trial, 0)
        left, right, bottom, top = extents(trial, 0, elements)
        tx = -left + numbers[used, 0] * (width - right + left)
        ty = -bottom + numbers[used, 1] * (height - top + bottom)
        used += 1
        tried += 1
        if top - bottom > height:
            tried = attempts
            break
        for e in range(elements):
            trial[e, X] += tx
            trial[e, Y] += ty
        if is_free(bodies, k, trial, tx, ty, x, y, placed, cell, head, following, largest):
            x[k], y[k] = tx, ty
            placed[bodies.start[k] : bodies.start[k + 1]] = trial[:elements]
            column, row = cell_of(tx, ty, cell, head.shape[0], head.shape[1])
            link(k, column, row, head, following, before)
            done, tried = done + 1, 0
    return done, tried


def large_first(bodies: Bodies) -> Ints:
    """Grains in the order in which they are placed: large areas first, equal ones as they come."""
    return np.argsort(-bodies.area, kind="stable").astype(np.int64)


class Scatter:
    """Grains dropped at random places of a region, one after the other, none over another."""

    def __init__(self, bodies: Bodies, angle: Floats, width: float, rng: np.random.Generator, tell: Tell) -> None:
        self.bodies, self.angle, self.width, self.rng, self.tell = bodies, angle, width, rng, tell
        self.order = large_first(bodies)
        self.x, self.y = np.zeros(bodies.number), np.zeros(bodies.number)
        self.placed = np.zeros((len(bodies.a), PLACED))
        self.done = 0

    def fill(self, height: float, attempts: int) -> bool:
        """Goes on in a region of this height [m] until all grains are placed or one has found no place in `attempts`."""
        bodies, tried = self.bodies, 0
        cell = 2.0 * float(bodies.reach.mean())
        head = np.empty((int(self.width / cell) + 1, int(height / cell) + 1), dtype=np.int64)
        following, before = np.empty((2, bodies.number), dtype=np.int64)
        link_all(self.order[: self.done], self.x, self.y, cell, head, following, before)
        while self.done < bodies.number and tried < attempts:
            self.tell(f"placing: {self.done} of {bodies.number} grains placed")
            self.done, tried = drop(
                bodies, self.order, self.done, tried, attempts, self.x, self.y, self.angle, self.width, height,
                self.rng.random((CHUNK, 2)), self.placed, cell, head, following, before, float(bodies.reach.max()),
            )  # fmt: skip
        return self.done == bodies.number


def reject(
    bodies: Bodies,
    angle: Floats,
    region: Region,
    attempts: int,
    rng: np.random.Generator,
    tell: Tell,
    method: str = "rejection",
) -> Packed:
    """Random sequential addition; angles stay as they are. method: its name in messages.

    Where a grain finds no place in `attempts` the ceiling is raised and the packing becomes looser. ScenarioError where it must not be.
    """
    scatter, height = Scatter(bodies, angle, region.width, rng, tell), region.height
    while not scatter.fill(height, attempts):
        height = region.raised(max(height * RAISE, height + 0.1 * float(bodies.reach.mean())), method)
    return Packed(scatter.x, scatter.y, angle, height)
