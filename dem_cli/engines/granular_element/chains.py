"""Chains of boundary grains around the packing, and the arrays of a sample from an assembly."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.assembly import Assembly
from dem_cli.engines.granular_element.boundary import Chain
from dem_cli.engines.granular_element.contacts import DRIVEN, GRAIN, MEMBRANE, TIED, Bodies, Law
from dem_cli.engines.granular_element.sample import Sample
from dem_cli.scenario import QuasiStaticScenario
from dem_cli.state import Floats, Ints

SIDES = ("left", "right", "bottom", "top")


def build_sample(scenario: QuasiStaticScenario, assembly: Assembly) -> Sample:
    """The sample at the start. Membranes are still fixed: `release` lets them go."""
    grains, n = assembly.grains, len(assembly.grains)
    left, bottom, right, top = assembly.walls.box
    box = np.array([0.5 * (left + right), 0.5 * (bottom + top), 0.5 * (right - left), 0.5 * (top - bottom)])
    kind = scenario.boundary.kind
    kn, kt = scenario.stiffness
    radius = scenario.boundary.radius or float(np.median(grains.radius))
    places, string = np.empty((0, 2)), np.empty(0, dtype=np.int64)
    if kind == "chain":
        places, string = ring_around(box, radius)
    elif kind == "membrane":
        places, string = membranes(box, radius)
    m = len(places)
    x = np.zeros((n + m, 3))
    x[:n, 0], x[:n, 1], x[:n, 2] = grains.x, grains.y, grains.radius * grains.angle
    x[n:, :2] = places
    gravity, angle = scenario.container.gravity, scenario.container.gravity_direction
    load = np.zeros((n + m, 2))
    load[:n] = grains.mass[:, None] * gravity * np.array([math.cos(angle), math.sin(angle)])
    bodies = Bodies(
        np.concatenate([grains.radius, np.full(m, radius)]),
        load,
        np.concatenate([np.full(n, GRAIN), np.full(m, DRIVEN)]).astype(np.int64),
        n,
    )
    rough = scenario.contact.wall_friction
    law = Law(
        kn, kt, scenario.contact.friction, scenario.contact.cohesion,
        np.array([getattr(rough, side) for side in SIDES]),
        np.array([kind == "walls", kind == "walls", kind != "chain", kind != "chain"]),
    )  # fmt: skip
    unit = np.zeros((n + m, 2))
    unit[n:] = (places - box[:2]) / box[2:]
    link = scenario.boundary.link_stiffness or 0.1 * kn
    after = np.roll(places, -1, axis=0) - places
    chain = Chain(
        np.arange(n, n + m), unit, string, np.hypot(after[:, 0], after[:, 1]), link, np.zeros(1), kind == "chain"
    )
    return Sample(x, box, box[2:].copy(), bodies, law, chain, scenario.depth)


def ring_around(box: Floats, radius: float) -> tuple[Floats, Ints]:
    """Centres (m, 2) [m] of grains that touch the box from outside and each other, or overlap a little, anticlockwise; all one string."""
    half = box[2:] + radius
    corners = box[:2] + half * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(math.ceil(float(np.hypot(*(b - a))) / (2.0 * radius) * (1.0 - 1e-9)), 1)
        sides.append(a + np.arange(count)[:, None] / count * (b - a))
    places = np.concatenate(sides)
    return places, np.zeros(len(places), dtype=np.int64)


def membranes(box: Floats, radius: float) -> tuple[Floats, Ints]:
    """Centres (m, 2) [m] and strings: 0 the right membrane from the bottom up, 1 the left one from the top down, between the walls."""
    reach = float(box[3]) - radius
    count = max(math.ceil(reach / radius * (1.0 - 1e-9)) + 1, 3)
    up = box[1] + np.linspace(-reach, reach, count)
    right = np.column_stack([np.full(count, box[0] + box[2] + radius), up])
    left = np.column_stack([np.full(count, box[0] - box[2] - radius), up[::-1]])
    return np.concatenate([right, left]), np.repeat([0, 1], count)


def release(sample: Sample) -> None:
    """Membranes give way from now on, their outermost grains along x only. Links have no force where they are."""
    chain, kind = sample.chain, sample.bodies.kind
    if chain.closed or not len(chain.ring):
        return
    first = np.flatnonzero(np.diff(chain.string, prepend=-1))
    last = np.flatnonzero(np.diff(chain.string, append=-1))
    kind[chain.ring] = MEMBRANE
    kind[chain.ring[np.concatenate([first, last])]] = TIED
    ahead = sample.x[np.roll(chain.ring, -1), :2] - sample.x[chain.ring, :2]
    chain.rest[:] = np.hypot(ahead[:, 0], ahead[:, 1])
