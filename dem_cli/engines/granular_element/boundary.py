"""The boundary while discs move: box and chains of boundary grains, their forces, area, stress, and the servos that hold stresses."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dem_cli.engines.granular_element.contacts import (
    DRIVEN,
    GAP_X,
    GAP_Y,
    MEMBRANE,
    STIFF_X,
    STIFF_Y,
    TIED,
    WALL_X,
    WALL_Y,
    XX,
    YY,
)
from dem_cli.jit import kernel

ADVANCE = 0.01  # most that a servo moves a wall in one iteration, as a share of the mean radius
MOST_SERVOS = 2
# Entries of the ledger of work [J]: of the boundary, of body forces, of the fixing forces, and what sliding has cost in contacts
# that are no longer near.
BOUNDARY, BODY, FIXING, GONE, LEDGER = 0, 1, 2, 3, 4


class Chain(NamedTuple):
    """Boundary grains in a row around the sample, anticlockwise; empty where there are four walls.

    ring (m,): their numbers; unit (n, 2): place of driven discs in units of the box about its centre; string (m,): part of the ring that
    each belongs to (links join neighbours of one part); rest (m,) [m]: length of the link to the next one without force; link [N/m]: its
    stiffness, it only pulls; pressure (1,) [Pa] on membranes; closed: one string around all.
    """

    ring: np.ndarray
    unit: np.ndarray
    string: np.ndarray
    rest: np.ndarray
    link: float
    pressure: np.ndarray
    closed: bool


class Servos(NamedTuple):
    """Stresses that are held by moving the boundary; the first `number` of two rows each.

    direction (2, 2): strains of width and height for a unit of the servo; weight (2, 2): of the stresses across x and y, whose sum is
    to be target (2,) [Pa]; scale [Pa]: what errors are measured by.
    """

    number: int
    direction: np.ndarray
    weight: np.ndarray
    target: np.ndarray
    scale: float


@kernel()
def follow_box(x, box, bodies, chain):
    """Driven boundary grains to their places in the box."""
    for i in range(bodies.grains, x.shape[0]):
        if bodies.kind[i] == DRIVEN:
            x[i, 0] = box[0] + chain.unit[i, 0] * box[2]
        if bodies.kind[i] in (DRIVEN, TIED):
            x[i, 1] = box[1] + chain.unit[i, 1] * box[3]


@kernel()
def area_inside(x, box, bodies, chain):
    """Area of the sample [m^2]: of the box, or of the polygon of the boundary grains' centres less their inner parts."""
    m = chain.ring.size
    if m == 0:
        return 4.0 * box[2] * box[3]
    twice = 0.0
    for k in range(m):
        a, b = chain.ring[k], chain.ring[(k + 1) % m]
        twice += x[a, 0] * x[b, 1] - x[b, 0] * x[a, 1]
    inner = 0.5 * math.pi * bodies.radius[chain.ring[0]] ** 2
    if chain.closed:
        return 0.5 * twice - (m - 2) * inner
    # between the first and last grain of a membrane and the wall there is a strip as high as their radius
    strips = 0.0
    for k in range(m):
        a, b = chain.ring[k], chain.ring[(k + 1) % m]
        if chain.string[k] != chain.string[(k + 1) % m]:
            strips += abs(x[a, 0] - x[b, 0]) * bodies.radius[a]
    return 0.5 * twice + strips - m * inner


@kernel()
def membrane_forces(x, bodies, chain, depth, fixing):
    """Adds pressure and links of membranes to the fixing forces, and sets the pressure's load; returns the energy of the links [J].

    The pressure on a grain acts on half of the way between its neighbours, at right angles to it (a follower load).
    """
    m, energy = chain.ring.size, 0.0
    for k in range(m):
        i = chain.ring[k]
        if bodies.kind[i] == DRIVEN:
            return 0.0
        before, after = (
            k > 0 and chain.string[k - 1] == chain.string[k],
            k + 1 < m and chain.string[k + 1] == chain.string[k],
        )
        a, b = chain.ring[k - 1] if before else i, chain.ring[k + 1] if after else i
        way_x, way_y = 0.5 * (x[b, 0] - x[a, 0]), 0.5 * (x[b, 1] - x[a, 1])
        # the last piece, from the outermost centre to the wall
        if not before or not after:
            way_y += bodies.radius[i] if x[b, 1] > x[a, 1] else -bodies.radius[i]
        push = chain.pressure[0] * depth
        bodies.load[i, 0], bodies.load[i, 1] = -push * way_y, push * way_x
        fixing[i, 0] -= bodies.load[i, 0]
        fixing[i, 1] -= bodies.load[i, 1]
        if after:
            dx, dy = x[b, 0] - x[i, 0], x[b, 1] - x[i, 1]
            length = math.sqrt(dx * dx + dy * dy)
            stretch = length - chain.rest[k]
            if stretch > 0.0:
                pull = chain.link * stretch / length
                energy += 0.5 * chain.link * stretch * stretch
                fixing[i, 0] -= pull * dx
                fixing[i, 1] -= pull * dy
                fixing[b, 0] += pull * dx
                fixing[b, 1] += pull * dy
    return energy


@kernel()
def membrane_stiffness(x, bodies, chain, stiffness):
    """Adds the links to the blocks of their grains (contacts.contact_stiffness); grains of a membrane do not turn."""
    m = chain.ring.size
    for k in range(m):
        i = chain.ring[k]
        if bodies.kind[i] == DRIVEN:
            return
        if k + 1 < m and chain.string[k + 1] == chain.string[k]:
            b = chain.ring[k + 1]
            dx, dy = x[b, 0] - x[i, 0], x[b, 1] - x[i, 1]
            length = math.sqrt(dx * dx + dy * dy)
            if length > chain.rest[k]:
                nx, ny, slack = dx / length, dy / length, 1.0 - chain.rest[k] / length
                for g in (i, b):
                    stiffness[g, 0] += chain.link * (nx * nx + slack * ny * ny)
                    stiffness[g, 1] += chain.link * (1.0 - slack) * nx * ny
                    stiffness[g, 3] += chain.link * (ny * ny + slack * nx * nx)


@kernel()
def stresses(sums, area, depth):
    """Stress across x and y [Pa]: the boundary's forces times their arms about the centre, over the volume."""
    return sums[XX] / (area * depth), sums[YY] / (area * depth)


@kernel()
def servo_errors(servos, sums, area, depth, box, kn, mean_radius, error, force):
    """How far each servo is from its target: error (2,) [strain], and the generalised force behind it, force (2,) [N m]; both are overwritten.

    Where nothing touches the walls they close the smallest gap. Returns the largest error of stress over `scale`.
    """
    worst = 0.0
    sx, sy = stresses(sums, area, depth)
    limit = ADVANCE * mean_radius / max(box[2], box[3])
    for k in range(servos.number):
        missing = servos.target[k] - servos.weight[k, 0] * sx - servos.weight[k, 1] * sy
        dx, dy = servos.direction[k, 0], servos.direction[k, 1]
        stiff = servos.weight[k, 0] * dx * sums[STIFF_X] + servos.weight[k, 1] * dy * sums[STIFF_Y]
        worst = max(worst, abs(missing) / servos.scale)
        if stiff > 0.0:
            move = missing * area * depth / stiff
        else:
            gap = min(sums[GAP_X] if dx > 0.0 else np.inf, sums[GAP_Y] if dy > 0.0 else np.inf)
            move = gap / box[2] + 0.1 * missing * area * depth / (kn * box[2] * box[2])
        error[k] = min(max(move, -limit), limit)
        force[k] = (dx * dx * sums[STIFF_X] + dy * dy * sums[STIFF_Y]) * error[k]
    return worst


@kernel()
def move_box(box, size, servos, step):
    """Moves the boundary by step (2,) of the servos; strains count against size (2,) [m]."""
    for k in range(servos.number):
        box[2] -= size[0] * servos.direction[k, 0] * step[k]
        box[3] -= size[1] * servos.direction[k, 1] * step[k]


@kernel()
def account(x, before, fixing, old_fixing, bodies, old_load, sums, old_sums, box, old_box, ledger):
    """Adds the work of one move to the ledger (LEDGER,) [J]: trapezoids of the forces at both ends."""
    for i in range(x.shape[0]):
        dx, dy = x[i, 0] - before[i, 0], x[i, 1] - before[i, 1]
        wx, wy = 0.5 * (fixing[i, 0] + old_fixing[i, 0]) * dx, 0.5 * (fixing[i, 1] + old_fixing[i, 1]) * dy
        kind = bodies.kind[i]
        ledger[BOUNDARY if kind == DRIVEN else FIXING] += wx
        ledger[BOUNDARY if kind in (DRIVEN, TIED) else FIXING] += wy
        if kind not in (MEMBRANE, TIED, DRIVEN):
            ledger[FIXING] += 0.5 * (fixing[i, 2] + old_fixing[i, 2]) * (x[i, 2] - before[i, 2])
            ledger[BODY] += bodies.load[i, 0] * dx + bodies.load[i, 1] * dy
        else:
            ledger[BOUNDARY] += 0.5 * (
                (bodies.load[i, 0] + old_load[i, 0]) * dx + (bodies.load[i, 1] + old_load[i, 1]) * dy
            )
    ledger[BOUNDARY] -= 0.5 * (sums[WALL_X] + old_sums[WALL_X]) * (box[2] - old_box[2])
    ledger[BOUNDARY] -= 0.5 * (sums[WALL_Y] + old_sums[WALL_Y]) * (box[3] - old_box[3])
