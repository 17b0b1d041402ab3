"""Contacts of ellipses (thesis ch. 4): exact geometry, the law of `law.py`, four pairs at a time; discs among them are ellipses with a = b.

Rows and units are those of `forces.py`, outlines those of `geometry/ellipse.py`. Each pair remembers its unit normal, and every step
takes one step of Newton's method from it: as grains turn by some 1e-5 rad a step, that is exact to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dem_cli.engines.explicit.forces import FX, FY, MOBILITY, ROW, TURN, Q, R, U, V, X, Y
from dem_cli.engines.explicit.law import contact_force, contact_losses
from dem_cli.engines.explicit.lists import FINE, TOO_DEEP, cut, empty_pairs, fill_up, next_chunk, recall
from dem_cli.geometry.ellipse import support, wall_gap, widest_gap
from dem_cli.geometry.lanes import WIDTH, maximum, root, spread, unpack
from dem_cli.geometry.rows import gather_column, gather_difference, gather_thirds, load, scatter_wrench, store
from dem_cli.jit import kernel

FOUR = 4


class Outlines(NamedTuple):
    """Outlines of n elements and two dummies.

    fours ((n + 2) * FOUR,): m, p, q [m^2] and 1/sqrt(a b) [1/m] of each; sway (n,): a - b [m], by how much a turn of one radian can move
    the outline towards a neighbour; enlarged: contacts are judged by the thesis' enlarged ellipse.
    """

    fours: np.ndarray
    sway: np.ndarray
    enlarged: bool


@kernel(inline=True)
def enlarged_overlap(dx, dy, mi, pi, qi, mj, pj, qj, along):
    """Overlap [m] as the thesis' enlarged ellipse (4.32) sees it: how far apart along delta, seen along n, it would have to be.

    In the frame where ellipse j is the unit circle, ellipse i has the matrix A' = S^-1 A_i S^-1, S = A_j^(1/2), and semi-axes a', b'; the thesis
    asks whether the centre of j lies in the ellipse a' + 1, b' + 1 about that of i. along: n.delta. For discs it is the overlap itself; else
    the enlarged ellipse lies inside the true curve, and contacts are seen too late.
    """
    det_j = root(maximum(mj * mj - pj * pj - qj * qj, 0.0))
    trace = 1.0 / (root(2.0 * (mj + det_j)) * det_j)
    sxx, sxy, syy = (mj - pj + det_j) * trace, -qj * trace, (mj + pj + det_j) * trace
    uxx, uxy, uyx, uyy = (
        (mi + pi) * sxx + qi * sxy,
        (mi + pi) * sxy + qi * syy,
        qi * sxx + (mi - pi) * sxy,
        qi * sxy + (mi - pi) * syy,
    )
    axx, axy, ayy = sxx * uxx + sxy * uyx, sxx * uxy + sxy * uyy, sxy * uxy + syy * uyy
    det = root(maximum(axx * ayy - axy * axy, 0.0))
    scale = 1.0 / root(axx + ayy + 2.0 * det)
    exx, exy, eyy = (axx + det) * scale + 1.0, axy * scale, (ayy + det) * scale + 1.0
    cx, cy = sxx * dx + sxy * dy, sxy * dx + syy * dy
    inverse = 1.0 / (exx * eyy - exy * exy)
    wx, wy = (eyy * cx - exy * cy) * inverse, (exx * cy - exy * cx) * inverse
    return (1.0 / root(wx * wx + wy * wy) - 1.0) * along


@kernel(inline=True)
def _approach(rows, outlines, pairs, k):
    """Geometry and motion of the pairs k..k+3, lanes; their new normals are stored.

    g(n) = n.delta - h_i - h_j is developed about the old normal to the second order: its maximum is the gap, its place the new normal.
    Returns nx, ny, overlap, closing, sliding, and the arms of normal and shear forces over the radius for both bodies.
    """
    dx, dy, du, dv = gather_difference(rows, pairs.first, pairs.second, k, X)
    mi, pi, qi, inverse_i = gather_thirds(outlines.fours, pairs.first, k)
    mj, pj, qj, inverse_j = gather_thirds(outlines.fours, pairs.second, k)
    nx, ny = load(pairs.nx, k), load(pairs.ny, k)
    hi, hi1, hi2 = support(mi, pi, qi, nx, ny)
    hj, hj1, hj2 = support(mj, pj, qj, nx, ny)
    along, across = dx * nx + dy * ny, dy * nx - dx * ny
    slope = across - hi1 - hj1
    turn = slope / (along + hi2 + hj2)
    overlap = hi + hj - along - 0.5 * slope * turn
    hi, hj = (hi + turn * (hi1 + 0.5 * turn * hi2)) * inverse_i, (hj + turn * (hj1 + 0.5 * turn * hj2)) * inverse_j
    hi1, hj1 = hi1 + turn * hi2, hj1 + turn * hj2
    nx, ny = nx - turn * ny, ny + turn * nx
    scale = 1.5 - 0.5 * (nx * nx + ny * ny)
    nx, ny = nx * scale, ny * scale
    # What one step of Newton's method leaves is shared out: so the normal forces keep the angular momentum whatever the turn.
    left = 0.5 * (dy * nx - dx * ny - hi1 - hj1)
    hi1, hj1 = (hi1 + left) * inverse_i, (hj1 + left) * inverse_j
    store(pairs.nx, k, nx)
    store(pairs.ny, k, ny)
    if outlines.enlarged:
        overlap = enlarged_overlap(dx, dy, mi, pi, qi, mj, pj, qj, dx * nx + dy * ny)
    spin_i, spin_j = gather_column(rows, pairs.first, k, Q), gather_column(rows, pairs.second, k, Q)
    closing = -(du * nx + dv * ny) - (spin_i * hi1 + spin_j * hj1)
    sliding = dv * nx - du * ny - (spin_i * hi + spin_j * hj)
    return nx, ny, overlap, closing, sliding, hi1, hi, hj1, hj


@kernel(inline=True)
def _contact(pairs, k, approach, law, lost):
    """Law and memory of the pairs k..k+3: forces on the second body (x, y), turns of both over their radii, losses so far, lanes."""
    nx, ny, overlap, closing, sliding, normal_arm_i, arm_i, normal_arm_j, arm_j = approach
    spring = load(pairs.spring, k)
    normal, shear, stretched = contact_force(
        overlap, closing, sliding, spring, load(pairs.inertia_root, k), law.friction, law
    )
    old = (load(pairs.dashpot_n, k), load(pairs.dashpot_s, k), spring)
    new = (normal - maximum(overlap, 0.0), shear - stretched, stretched)
    n, s, f, c = contact_losses(overlap, closing, sliding, old, new, law)
    store(pairs.spring, k, stretched)
    store(pairs.dashpot_n, k, new[0])
    store(pairs.dashpot_s, k, new[1])
    forces = (
        normal * nx + shear * ny,
        normal * ny - shear * nx,
        arm_i * shear + normal_arm_i * normal,
        arm_j * shear + normal_arm_j * normal,
    )
    return forces, (lost[0] + n, lost[1] + s, lost[2] + f, lost[3] + c)


@kernel()
def ellipse_pair_forces(rows, outlines, pairs, begin, end, law, losses):
    """Forces of the pairs begin..end-1 of ellipses on their grains; rows, memory and losses change in place as in `pair_forces`.

    The next group's geometry is under way while this one's law waits for its results.
    """
    if begin == end:
        return
    zero = spread(0.0)
    lost = (zero, zero, zero, zero)
    coming = _approach(rows, outlines, pairs, begin)
    for k in range(begin, end - WIDTH, WIDTH):
        later = _approach(rows, outlines, pairs, k + WIDTH)
        forces, lost = _contact(pairs, k, coming, law, lost)
        scatter_wrench(rows, pairs.first, pairs.second, k, FX, *forces)
        coming = later
    forces, lost = _contact(pairs, end - WIDTH, coming, law, lost)
    scatter_wrench(rows, pairs.first, pairs.second, end - WIDTH, FX, *forces)
    for m in range(4):
        a, b, c, d = unpack(lost[m])
        losses[m] += a + b + c + d


@kernel(inline=True)
def wall_contact(rows, outlines, a, walls, w):
    """Unit normal from the element of row offset a to wall w, gap [m], and how far the outline reaches along and beside it: h, h'."""
    o = a // 3
    m, p, q = outlines.fours[o], outlines.fours[o + 1], outlines.fours[o + 2]
    nx, ny, gap = wall_gap(rows[a + X], rows[a + Y], m, p, q, walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3])
    h, h1, _ = support(m, p, q, nx, ny)
    return nx, ny, gap, h, h1


@kernel()
def ellipse_wall_forces(rows, outlines, pairs, begin, end, walls, law, losses):
    """Forces of walls on ellipses, as `wall_forces`."""
    for k in range(begin, end):
        a, w = np.int64(pairs.first[k]), pairs.second[k]
        nx, ny, gap, h, h1 = wall_contact(rows, outlines, a, walls, w)
        inverse = outlines.fours[a // 3 + 3]
        turning = rows[a + Q] * inverse
        overlap = -gap
        closing = rows[a + U] * nx + rows[a + V] * ny - turning * h1
        sliding = rows[a + U] * ny - rows[a + V] * nx - turning * h
        spring = pairs.spring[k]
        normal, shear, stretched = contact_force(
            overlap, closing, sliding, spring, pairs.inertia_root[k], walls[w, 4], law
        )
        rows[a + FX] -= normal * nx + shear * ny
        rows[a + FY] -= normal * ny - shear * nx
        rows[a + TURN] += (h * shear + h1 * normal) * inverse
        old = (pairs.dashpot_n[k], pairs.dashpot_s[k], spring)
        new = (normal - max(overlap, 0.0), shear - stretched, stretched)
        n, s, f, c = contact_losses(overlap, closing, sliding, old, new, law)
        losses[0] += n
        losses[1] += s
        losses[2] += f
        losses[3] += c
        pairs.spring[k], pairs.dashpot_n[k], pairs.dashpot_s[k] = stretched, new[0], new[1]


@kernel()
def turn_outlines(rows, outlines, begin, end):
    """Turn the outlines of the elements begin..end-1 by their spin over one step.

    Returns the largest way that an outline may have moved by that towards a neighbour [m]. The turn by 2 theta keeps p^2 + q^2 to rounding.
    """
    most = 0.0
    for i in range(begin, end):
        o = FOUR * i
        turning = rows[ROW * i + Q] * outlines.fours[o + 3]
        tangent = turning + turning * turning * turning / 3.0
        share = 1.0 / (1.0 + tangent * tangent)
        c, s = (1.0 - tangent * tangent) * share, 2.0 * tangent * share
        p, q = outlines.fours[o + 1], outlines.fours[o + 2]
        outlines.fours[o + 1], outlines.fours[o + 2] = p * c - q * s, p * s + q * c
        most = max(most, abs(turning) * outlines.sway[i])
    return most


@kernel(inline=True)
def pair_gap(rows, outlines, i, j, nx, ny):
    """Unit normal from element i to element j and the gap [m], from a normal that may be near, or 0, 0."""
    a, b, o, e = ROW * i, ROW * j, FOUR * i, FOUR * j
    f = outlines.fours
    return widest_gap(
        rows[b + X] - rows[a + X], rows[b + Y] - rows[a + Y],
        f[o], f[o + 1], f[o + 2], f[e], f[e + 1], f[e + 2], nx, ny,
    )  # fmt: skip


@kernel()
def inner_ellipse_pairs(rows, outlines, lists, edges, skin, deepest):
    """Pairs of ellipses closer than `skin` [m], as `inner_pairs`; the outer lists keep the normals found."""
    n = lists.start.size - 1
    pairs = empty_pairs(edges.size - 1, lists.neighbour.size + WIDTH * edges.size, True)
    count, chunk, status, bad_i, bad_j = 0, 0, FINE, -1, -1
    f = outlines.fours
    for i in range(n):
        a, o = ROW * i, FOUR * i
        for k in range(lists.start[i], lists.start[i + 1]):
            j = np.int64(lists.neighbour[k])
            b, e = ROW * j, FOUR * j
            dx, dy = rows[b + X] - rows[a + X], rows[b + Y] - rows[a + Y]
            # The gap seen in any direction is no larger than the gap: first the one between the centres.
            inverse = 1.0 / np.sqrt(dx * dx + dy * dy)
            nx, ny = dx * inverse, dy * inverse
            hi, _, _ = support(f[o], f[o + 1], f[o + 2], nx, ny)
            hj, _, _ = support(f[e], f[e + 1], f[e + 2], nx, ny)
            if dx * nx + dy * ny - hi - hj > skin:
                lists.memory[k, 3] = lists.memory[k, 4] = 0.0  # a normal that nobody follows is none
                continue
            nx, ny, gap = pair_gap(rows, outlines, i, j, lists.memory[k, 3], lists.memory[k, 4])
            lists.memory[k, 3], lists.memory[k, 4] = nx, ny
            if gap < skin:
                pairs.first[count], pairs.second[count] = a, b
                pairs.inertia_root[count] = 1.0 / np.sqrt(rows[a + MOBILITY] + rows[b + MOBILITY])
                pairs.nx[count], pairs.ny[count] = nx, ny
                recall(pairs, count, lists.memory, k)
                count += 1
                if -gap > deepest * min(rows[a + R], rows[b + R]) and status == FINE:
                    status, bad_i, bad_j = TOO_DEEP, i, j
        if i + 1 == edges[chunk + 1]:
            count = fill_up(pairs, count, n)
            chunk += 1
            pairs.chunk[chunk] = count
    return cut(pairs, count), status, bad_i, bad_j


@kernel()
def inner_ellipse_walls(rows, outlines, lists, edges, walls, skin, deepest):
    """Contacts of ellipses with walls closer than `skin` [m], as `inner_walls`."""
    pairs = empty_pairs(edges.size - 1, lists.wall_grain.size, False)
    count, chunk, status, bad_i, bad_j = 0, 0, FINE, -1, -1
    for k in range(lists.wall_grain.size):
        i, w = np.int64(lists.wall_grain[k]), lists.wall_number[k]
        chunk = next_chunk(pairs, edges, chunk, i, count)
        a = ROW * i
        _, _, gap, _, _ = wall_contact(rows, outlines, a, walls, w)
        if gap < skin:
            pairs.first[count], pairs.second[count] = a, w
            pairs.inertia_root[count] = 1.0 / np.sqrt(rows[a + MOBILITY])
            recall(pairs, count, lists.wall_memory, k)
            count += 1
            if -gap > deepest * rows[a + R] and status == FINE:
                status, bad_i, bad_j = TOO_DEEP, i, w
    next_chunk(pairs, edges, chunk, edges[-1], count)
    return cut(pairs, count), status, bad_i, bad_j
