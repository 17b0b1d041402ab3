"""Stress, fabric and contact numbers of a sample. Compression is positive; stress_ab = f_a l_b.

Grains may consist of several elements (state.Grains): the forces on any of them act on the grain, branches run between centres of
mass of grains, and contacts are counted by grains.
"""

from __future__ import annotations

import math

import numpy as np

from dem_cli.analysis.bodies import areas, centres, single
from dem_cli.analysis.void_ratio import Rectangle
from dem_cli.jit import kernel
from dem_cli.state import Contacts, Floats, Grains, Ints


@kernel()
def _share_inside(ax, ay, bx, by, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Share of the segment from a to b inside the rectangle (clipping after Liang and Barsky)."""
    t0, t1 = 0.0, 1.0
    for a, d, low, high in ((ax, bx - ax, x0, x1), (ay, by - ay, y0, y1)):
        if d == 0.0:
            if a < low or a >= high:
                return 0.0
            continue
        s, t = (low - a) / d, (high - a) / d
        t0, t1 = max(t0, min(s, t)), min(t1, max(s, t))
    return max(0.0, t1 - t0)


@kernel()
def _window_sum(x, y, i, j, nx, ny, px, py, normal, shear, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Sum of share x force (x) branch over contacts [N m]: xx, xy, yx, yy."""
    xx = xy = yx = yy = 0.0
    for c in range(len(i)):
        ax, ay = x[i[c]], y[i[c]]
        bx, by = (x[j[c]], y[j[c]]) if j[c] >= 0 else (px[c], py[c])
        share = _share_inside(ax, ay, bx, by, x0, y0, x1, y1)
        if share > 0.0:
            fx = share * (normal[c] * nx[c] - shear[c] * ny[c])
            fy = share * (normal[c] * ny[c] + shear[c] * nx[c])
            xx += fx * (bx - ax)
            xy += fx * (by - ay)
            yx += fy * (bx - ax)
            yy += fy * (by - ay)
    return xx, xy, yx, yy


def window_stress(x: Floats, y: Floats, contacts: Contacts, window: Rectangle, thickness: float) -> Floats:
    """Mean stress [Pa] of a window, shape (2, 2): (1/(A L)) sum of force (x) branch (physics.md 0).

    x, y [m]: centre of mass of the grain that each element belongs to (`bodies.centres`), shape (n,). The branch runs from centre to
    centre, to a wall from centre to contact point. Each contact carries
    its force along its branch, so it counts with the share of the branch inside the window: exact for the
    mean of that field, and windows side by side add up. NaN for an empty window. Asymmetric only as far
    as grains are not in equilibrium.
    """
    if not window.area > 0.0:
        return np.full((2, 2), math.nan)
    c = contacts
    total = _window_sum(x, y, c.i, c.j, c.nx, c.ny, c.px, c.py, c.normal, c.shear, *(float(side) for side in window))
    return np.array(total).reshape(2, 2) / (window.area * thickness)


@kernel()
def _grain_sums(x, y, body, i, j, nx, ny, px, py, normal, shear, out):  # type: ignore[no-untyped-def]
    """Add force (x) (contact point - centre) of each contact to its grains: out (grains, 4), modified in place.

    x, y (n,): centre of the grain of each element.
    """
    for c in range(len(i)):
        fx = normal[c] * nx[c] - shear[c] * ny[c]
        fy = normal[c] * ny[c] + shear[c] * nx[c]
        for side in range(2 if j[c] >= 0 else 1):
            # the force of j on i is the opposite one, and so is its arm for a pair in line
            k = j[c] if side else i[c]
            sign = -1.0 if side else 1.0
            lx, ly = sign * (px[c] - x[k]), sign * (py[c] - y[k])
            grain = body[k]
            out[grain, 0] += fx * lx
            out[grain, 1] += fx * ly
            out[grain, 2] += fy * lx
            out[grain, 3] += fy * ly


def grain_stress(grains: Grains, contacts: Contacts, thickness: float) -> Floats:
    """Mean stress [Pa] in the grain of each element, shape (n, 4) as xx, xy, yx, yy: sum of force (x) arm over its area times L.

    The arm runs from the grain's centre of mass to the contact point; the area is that of the grain, overlaps of its elements
    counted once. All elements of a grain have the same stress.
    """
    out = np.zeros((grains.grain_count, 4))
    c = contacts
    _grain_sums(*centres(grains), grains.body, c.i, c.j, c.nx, c.ny, c.px, c.py, c.normal, c.shear, out)
    out /= (thickness * areas(grains))[:, None]
    return out if single(grains) else out[grains.body]


def fabric(contacts: Contacts) -> Floats:
    """Fabric tensor <n (x) n> of the contacts between grains, shape (2, 2), trace 1; NaN without one."""
    pairs = contacts.j >= 0
    number = np.count_nonzero(pairs)
    if number == 0:
        return np.full((2, 2), math.nan)
    nx, ny = np.where(pairs, contacts.nx, 0.0), np.where(pairs, contacts.ny, 0.0)
    xy = nx @ ny
    return np.array([[nx @ nx, xy], [xy, ny @ ny]]) / number


def coordination(grains: Grains, contacts: Contacts) -> Ints:
    """Contacts of the grain of each element, shape (n,): one with a wall counts like one with a grain.

    Those on all elements of a grain are added up, so two contacts between the same two grains count as two.
    """
    count = np.bincount(contacts.i, minlength=len(grains))
    count += np.bincount(contacts.j[contacts.j >= 0], minlength=len(grains))
    if not single(grains):
        # whole numbers far below 2^53, which floats add up exactly
        count = np.bincount(grains.body, count)[grains.body]
    return count.astype(np.int64, copy=False)


def sliding_share(contacts: Contacts) -> float:
    """Share of contacts at the friction limit; NaN without contacts."""
    return float(contacts.sliding.mean()) if len(contacts) else math.nan


def max_overlap_ratio(size: Floats, contacts: Contacts) -> float:
    """Largest overlap over the smaller `size` [m] of the two elements (of the one, at a wall); 0 without contacts.

    size (n,): radius of a disc, smaller semi-axis b of an ellipse, half of its least thickness.
    """
    if not len(contacts):
        return 0.0
    other = np.where(contacts.j >= 0, contacts.j, contacts.i)
    smaller = np.minimum(size[contacts.i], size[other])
    return float(np.max(contacts.overlap / smaller))
