"""Grains, walls and slips of a sample, as writers and measures know them."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from dem_cli.engines.granular_element.sample import Sample
from dem_cli.engines.granular_element.step import Done
from dem_cli.state import Grains, Slips, Walls

NAMES = ("left", "right", "bottom", "top")


def grains_of(sample: Sample, start: Grains, density: float) -> Grains:
    """Grains where they are now, at rest, and after them those of the boundary."""
    n, total = sample.bodies.grains, len(sample.x)
    x, radius = sample.x, sample.bodies.radius
    still = np.zeros(total)
    chain = Grains.discs(x[n:, 0], x[n:, 1], radius[n:], density, sample.depth)
    chain = replace(chain, id=chain.id + n, body=chain.body + n)
    both = {f.name: np.concatenate([getattr(start, f.name), getattr(chain, f.name)]) for f in fields(Grains)}
    moved = {
        "x": x[:, 0].copy(),
        "y": x[:, 1].copy(),
        "angle": x[:, 2] / radius,
        "vx": still,
        "vy": still,
        "spin": still,
    }
    return Grains(**(both | moved))


def walls_of(sample: Sample) -> Walls:
    """The walls that there are, where they are now."""
    (cx, cy, hx, hy), there = sample.box.tolist(), np.flatnonzero(sample.law.wall)
    left, right, bottom, top = cx - hx, cx + hx, cy - hy, cy + hy
    ends = np.array(
        [(left, bottom, left, top), (right, bottom, right, top), (left, bottom, right, bottom), (left, top, right, top)]
    )[there]
    return Walls(
        tuple(NAMES[k] for k in there), ends[:, 0], ends[:, 1], ends[:, 2], ends[:, 3], sample.law.wall_friction[there]
    )


def slips_of(done: Done) -> Slips:
    """What each contact has dissipated in the sub-steps of an increment."""
    pairs, where = np.unique(np.column_stack([done.first, done.second]), axis=0, return_inverse=True)
    energy = np.bincount(where.ravel(), weights=done.lost, minlength=len(pairs)).astype(np.float64)
    return Slips(pairs[:, 0], pairs[:, 1], energy)
