"""Packing by insertion (thesis 2.7 c): a loose bed of the large grains, and the others pushed into its widest gaps, a few at a time."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.assembly.bodies import Bodies
from dem_cli.assembly.growth import Pile
from dem_cli.assembly.overlap import PLACED, A, M, P, Q, X, Y, cell_of, link_all, place_all
from dem_cli.assembly.region import Packed, Region, Tell
from dem_cli.assembly.rejection import RAISE, Scatter
from dem_cli.geometry.ellipse import widest_gap
from dem_cli.jit import kernel
from dem_cli.state import Floats

BATCH = 0.05  # grains that are pushed in at a time, as a share of those that are there
PROBES = 200  # random points, for each grain of a batch, among which the widest gaps are chosen
SMALLEST = 0.1  # size at which a grain is put into a gap, at least
GROW = 1.15  # factor from one size to the next until it has pushed its neighbours away


@kernel()
def clearances(points, bodies, x, y, placed, width, height, cell, head, following, farthest):
    """Radius [m] of the largest disc around each of `points` (n, 2) that meets neither a grain nor a wall, `farthest` at most; below zero
    within a grain.
    """
    found = np.empty(points.shape[0])
    reach = farthest + bodies.reach.max()
    for t in range(points.shape[0]):
        px, py = points[t, 0], points[t, 1]
        best = min(farthest, px, width - px, py, height - py)
        left, bottom = cell_of(px - reach, py - reach, cell, head.shape[0], head.shape[1])
        right, top = cell_of(px + reach, py + reach, cell, head.shape[0], head.shape[1])
        for column in range(left, right + 1):
            for row in range(bottom, top + 1):
                g = head[column, row]
                while g >= 0:
                    if math.hypot(x[g] - px, y[g] - py) - bodies.reach[g] < best:
                        for e in range(bodies.start[g], bodies.start[g + 1]):
                            dx, dy = placed[e, X] - px, placed[e, Y] - py
                            gap = math.hypot(dx, dy) - placed[e, A]
                            m, p, q = placed[e, M], placed[e, P], placed[e, Q]
                            if gap < best and (p != 0.0 or q != 0.0) and (dx != 0.0 or dy != 0.0):
                                gap = widest_gap(dx, dy, 0.0, 0.0, 0.0, m, p, q, 0.0, 0.0)[2]
                            best = min(best, gap)
                    g = following[g]
        found[t] = best
    return found


@kernel()
def choose(points, clearance, order, wanted):
    """Up to `wanted` points, widest gap first, none within the disc of one that is chosen already; order: indices by falling clearance."""
    chosen = np.empty(wanted, np.int64)
    many = 0
    for t in order:
        if many == wanted or clearance[t] <= 0.0:
            break
        free = True
        for c in chosen[:many]:
            if math.hypot(points[t, 0] - points[c, 0], points[t, 1] - points[c, 1]) < clearance[t] + clearance[c]:
                free = False
                break
        if free:
            chosen[many] = t
            many += 1
    return chosen[:many]


def widest_gaps(bodies: Bodies, pile: Pile, wanted: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Centres (up to wanted, 2) of the widest gaps between the grains of a pile, and their clearances [m]; at least one is found."""
    placed = np.zeros((len(bodies.a), PLACED))
    place_all(bodies, pile.x, pile.y, pile.angle, np.ones(bodies.number), 0.0, placed)
    mean = float(bodies.reach.mean())
    cell = 2.0 * mean
    head = np.empty((int(pile.width / cell) + 1, int(pile.height / cell) + 1), dtype=np.int64)
    following, before = np.empty((2, bodies.number), dtype=np.int64)
    link_all(np.arange(bodies.number), pile.x, pile.y, cell, head, following, before)
    while True:
        points = rng.random((PROBES * wanted, 2)) * np.array([pile.width, pile.height])
        free = clearances(
            points, bodies, pile.x, pile.y, placed, pile.width, pile.height, cell, head, following, 4.0 * mean
        )
        chosen = choose(points, free, np.argsort(-free, kind="stable"), wanted)
        if len(chosen):
            return points[chosen], free[chosen]


def insert(
    bodies: Bodies, angle: Floats, region: Region, attempts: int, rng: np.random.Generator, tell: Tell
) -> Packed:
    """Large grains at random places until one finds none in `attempts`; then the others into the widest gaps, as small grains that grow and
    push their neighbours away. The ceiling is raised where they cannot be pushed away any further.
    """
    scatter, height = Scatter(bodies, angle, region.width, rng, tell), region.height
    while not scatter.fill(height, attempts) and scatter.done == 0:
        height = region.raised(height * RAISE, "insertion")
    order, done = scatter.order, scatter.done
    x, y, angle = scatter.x.copy(), scatter.y.copy(), angle.copy()
    while done < bodies.number:
        there = bodies.take(order[:done])
        wanted = min(math.ceil(BATCH * done), bodies.number - done)
        pile = Pile(there, x[order[:done]], y[order[:done]], angle[order[:done]], region.width, height)
        points, free = widest_gaps(there, pile, wanted, rng)
        new = order[done : done + len(points)]
        done += len(points)
        x[new], y[new] = points.T
        now = order[:done]
        pile = Pile(bodies.take(now), x[now], y[now], angle[now], region.width, height)
        scale = np.minimum(np.maximum(free / bodies.reach[new], SMALLEST), 1.0)
        words = f"insertion: {done} of {bodies.number} grains placed"
        while True:
            pile.scale[-len(new) :] = scale
            pile.raise_until_free(region, tell, words, "insertion")
            if scale.min() == 1.0:
                break
            scale = np.minimum(scale * GROW, 1.0)
        x[now], y[now], angle[now], height = pile.x, pile.y, pile.angle, pile.height
    return Packed(x, y, angle, height)
