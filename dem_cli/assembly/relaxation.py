"""Grains that overlap are pushed apart: a minimum of the overlaps' energy by FIRE, for packings by growth and insertion.

Every overlap d pushes with the force d (stiffness and masses are 1; no friction, no gravity), between floor, ceiling and side walls. Bitzek et
al., Phys. Rev. Lett. 97, 170201 (2006), with the half steps of symplectic Euler.
"""

from __future__ import annotations

import math

import numpy as np

from dem_cli.assembly.overlap import PLACED, A, M, P, Q, X, Y, place_all
from dem_cli.geometry.cells import neighbour_list
from dem_cli.geometry.ellipse import gap_slopes, support, widest_gap
from dem_cli.jit import kernel

STEP = 0.1  # first time step; in units of the period of a grain on one contact over 2 pi
SHORTEST, LONGEST = 0.02, 0.3
MIX = 0.1  # share of the velocity that is turned into the direction of the force
BALANCED = 5e-3  # forces that are left over, as a share of the largest overlap: jammed
SKIN = 0.25  # of the mean size


@kernel()
def _push(force, lever, g, x, y, px, py, fx, fy):
    """A force (fx, fy) at (px, py) on grain g with its origin at (x, y)."""
    force[g, 0] += fx
    force[g, 1] += fy
    force[g, 2] += ((px - x) * fy - (py - y) * fx) / lever[g]


@kernel()
def _wall_forces(bodies, x, y, lever, placed, width, height, force):
    """Forces of the four walls; returns the largest overlap [m]."""
    deepest = 0.0
    for e in range(placed.shape[0]):
        g, m, p, q = bodies.owner[e], placed[e, M], placed[e, P], placed[e, Q]
        hx, hy = math.sqrt(m + p), math.sqrt(m - p)
        cx, cy = placed[e, X], placed[e, Y]
        # The outline is furthest in x at (hx, q / hx) from its centre, and in y at (q / hy, hy).
        if hx > cx:
            _push(force, lever, g, x[g], y[g], cx - hx, cy - q / hx, hx - cx, 0.0)
            deepest = max(deepest, hx - cx)
        if cx + hx > width:
            _push(force, lever, g, x[g], y[g], cx + hx, cy + q / hx, width - cx - hx, 0.0)
            deepest = max(deepest, cx + hx - width)
        if hy > cy:
            _push(force, lever, g, x[g], y[g], cx - q / hy, cy - hy, 0.0, hy - cy)
            deepest = max(deepest, hy - cy)
        if cy + hy > height:
            _push(force, lever, g, x[g], y[g], cx + q / hy, cy + hy, 0.0, height - cy - hy)
            deepest = max(deepest, cy + hy - height)
    return deepest


@kernel()
def _gap(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny):
    """Direction and size of the widest gap if that is below zero, else of some gap that is not: any direction's is a lower bound.

    nx, ny: where it was last, or (0, 0). Returns (nx, ny, gap).
    """
    known = nx != 0.0 or ny != 0.0
    if not known:
        distance = math.sqrt(dx * dx + dy * dy)
        nx, ny = dx / distance, dy / distance
    gap, g1, g2 = gap_slopes(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny)
    if gap >= 0.0:
        return nx, ny, gap
    if known:
        for _ in range(6):
            if g2 >= 0.0 or abs(g1) > -0.2 * g2:
                break
            turn = -g1 / g2
            length = math.sqrt(1.0 + turn * turn)
            nx, ny = (nx - turn * ny) / length, (ny + turn * nx) / length
            gap, g1, g2 = gap_slopes(dx, dy, mi, pi, qi, mj, pj, qj, nx, ny)
            if abs(turn) < 1e-5 or gap >= 0.0:  # the gap's error goes with its square
                return nx, ny, gap
    return widest_gap(dx, dy, mi, pi, qi, mj, pj, qj, 0.0, 0.0)


@kernel()
def _pair_forces(bodies, x, y, lever, placed, start, neighbour, direction, force):
    """Forces between elements of different grains; direction (pairs, 2): where their gap was widest, for the next time.

    Returns the largest overlap [m].
    """
    deepest = 0.0
    for i in range(placed.shape[0]):
        gi = bodies.owner[i]
        disc = placed[i, P] == 0.0 and placed[i, Q] == 0.0
        for k in range(start[i], start[i + 1]):
            j = neighbour[k]
            gj = bodies.owner[j]
            dx, dy, reach = placed[j, X] - placed[i, X], placed[j, Y] - placed[i, Y], placed[i, A] + placed[j, A]
            square = dx * dx + dy * dy
            if gi == gj or square >= reach * reach or square == 0.0:
                continue
            mi, pi, qi = placed[i, M], placed[i, P], placed[i, Q]
            if disc and placed[j, P] == 0.0 and placed[j, Q] == 0.0:
                distance = math.sqrt(square)
                nx, ny, gap = dx / distance, dy / distance, distance - reach
                px, py = placed[i, X] + nx * placed[i, A], placed[i, Y] + ny * placed[i, A]
            else:
                nx, ny, gap = _gap(
                    dx, dy, mi, pi, qi, placed[j, M], placed[j, P], placed[j, Q], direction[k, 0], direction[k, 1]
                )
                direction[k, 0], direction[k, 1] = nx, ny
                if gap >= 0.0:
                    continue
                h, h1, _ = support(mi, pi, qi, nx, ny)
                px, py = placed[i, X] + h * nx - h1 * ny, placed[i, Y] + h * ny + h1 * nx
            if gap < 0.0:
                px, py = px + 0.5 * gap * nx, py + 0.5 * gap * ny
                _push(force, lever, gi, x[gi], y[gi], px, py, gap * nx, gap * ny)
                _push(force, lever, gj, x[gj], y[gj], px, py, -gap * nx, -gap * ny)
                deepest = max(deepest, -gap)
    return deepest


@kernel()
def relax(bodies, x, y, angle, scale, swell, width, height, tolerance, most, velocity, pace):
    """Moves and turns grains until no overlap, of one another or a wall, is above `tolerance` [m].

    x, y, angle (g,) change in place. scale (g,): of whole grains; swell: elements are larger by this share. Stops after `most` steps, or when
    the forces balance: the grains are jammed. velocity (g, 3) and pace (time step, mixing, steps downhill) are those to go on with; zeros at
    the start. Returns (largest overlap [m], steps).
    """
    n, elements = x.size, bodies.a.size
    placed = np.empty((elements, PLACED))
    lever = np.empty(n)
    for g in range(n):
        lever[g] = scale[g] * bodies.reach[g]
    skin = SKIN * lever.mean()
    force = np.empty((n, 3))
    alive = np.ones(elements, np.bool_)
    start, neighbour = np.zeros(elements + 1, np.int64), np.empty(0, np.int32)
    direction = np.zeros((0, 2))
    old = np.empty((elements, 2))
    stale = True
    if pace[0] == 0.0:
        pace[0], pace[1], pace[2] = STEP, MIX, 0.0
    deepest, done = np.inf, 0
    for done in range(most + 1):
        place_all(bodies, x, y, angle, scale, swell, placed)
        if not stale:
            for e in range(elements):
                if (placed[e, X] - old[e, 0]) ** 2 + (placed[e, Y] - old[e, 1]) ** 2 > 0.25 * skin * skin:
                    stale = True
                    break
        if stale:
            old[:, 0], old[:, 1] = placed[:, X], placed[:, Y]
            start, neighbour = neighbour_list(old[:, 0].copy(), old[:, 1].copy(), placed[:, A].copy(), alive, skin)
            direction = np.zeros((neighbour.size, 2))
            stale = False
        force[:] = 0.0
        deepest = _wall_forces(bodies, x, y, lever, placed, width, height, force)
        deepest = max(deepest, _pair_forces(bodies, x, y, lever, placed, start, neighbour, direction, force))
        power, speed, push, strongest = 0.0, 0.0, 0.0, 0.0
        for g in range(n):
            one = 0.0
            for c in range(3):
                power += force[g, c] * velocity[g, c]
                speed += velocity[g, c] ** 2
                one += force[g, c] ** 2
            push += one
            strongest = max(strongest, one)
        if deepest <= tolerance or (done > 20 and strongest < (BALANCED * deepest) ** 2):
            break
        if power > 0.0:
            mix = pace[1]
            along = mix * math.sqrt(speed / push) if push > 0.0 else 0.0
            for g in range(n):
                for c in range(3):
                    velocity[g, c] = (1.0 - mix) * velocity[g, c] + along * force[g, c]
            pace[2] += 1.0
            if pace[2] > 5.0:
                pace[0], pace[1] = min(pace[0] * 1.1, LONGEST), mix * 0.99
        elif done > 0:
            velocity[:] = 0.0
            pace[0], pace[1], pace[2] = max(pace[0] * 0.5, SHORTEST), MIX, 0.0
        dt = pace[0]
        for g in range(n):
            for c in range(3):
                velocity[g, c] += dt * force[g, c]
            x[g] += dt * velocity[g, 0]
            y[g] += dt * velocity[g, 1]
            angle[g] += dt * velocity[g, 2] / lever[g]
    return deepest, done
