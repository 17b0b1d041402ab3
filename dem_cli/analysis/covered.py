"""Area that grains cover inside a rectangle: discs, ellipses and bodies of overlapping discs, what they share counted once.

Elements of one grain may overlap at will, three and more in a spot: each counts with the part of its disc whose power with respect
to its circle is the least among them (its power cell, bounded by radical axes), and these parts neither overlap nor leave a gap. A
grain of several elements consists of discs; arrays are those of state.Grains and `bodies.outlines`.
"""

from __future__ import annotations

import math

import numpy as np

from dem_cli.analysis.clipping import (
    curvature_radius,
    cut,
    disc_in_polygon,
    disc_in_rectangle,
    ellipse_in_rectangle,
    lens_area,
    lens_at_contact,
    lens_in_polygon,
    lens_in_rectangle,
)
from dem_cli.jit import kernel


@kernel(inline=True)
def _end_of_grain(body, first):  # type: ignore[no-untyped-def]
    """One after the last element of the grain that begins with element `first`."""
    end = first + 1
    while end < len(body) and body[end] == body[first]:
        end += 1
    return end


@kernel()
def _first_of_grain(body, k):  # type: ignore[no-untyped-def]
    """First element of the grain of element k."""
    while k > 0 and body[k - 1] == body[k]:
        k -= 1
    return k


@kernel()
def _to_power_cell(x, y, radius, k, first, end, px, py, n, qx, qy):  # type: ignore[no-untyped-def]
    """Cut a convex polygon to the power cell of disc k among the discs first..end - 1; px, py are modified in place.

    A disc that does not reach the polygon cuts nothing off that lies in disc k. Returns the number of corners.
    """
    for m in range(first, end):
        if m == k or n == 0:
            continue
        dx, dy = x[m] - x[k], y[m] - y[k]
        dd = dx * dx + dy * dy
        if dd >= (radius[k] + radius[m]) ** 2:
            continue
        if dd == 0.0:
            # one disc within the other: of two equal ones the first counts
            if radius[m] > radius[k] or (radius[m] == radius[k] and m < k):
                return 0
            continue
        axis = dx * x[k] + dy * y[k] + 0.5 * (dd + (radius[k] - radius[m]) * (radius[k] + radius[m]))
        n = cut(px, py, n, dx, dy, axis, qx, qy)
        for c in range(n):
            px[c], py[c] = qx[c], qy[c]
    return n


@kernel()
def _discs_in_rectangle(x, y, radius, first, end, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Area [m^2] that the discs first..end - 1 cover inside a rectangle."""
    if end == first + 2:
        k, m = first, first + 1
        solid = disc_in_rectangle(x[k], y[k], radius[k], x0, y0, x1, y1)
        solid += disc_in_rectangle(x[m], y[m], radius[m], x0, y0, x1, y1)
        return solid - lens_in_rectangle(x[k], y[k], radius[k], x[m], y[m], radius[m], x0, y0, x1, y1)
    # each cut adds one corner, and where discs coincide rounding may add another
    most = 4 + 2 * (end - first)
    px, py, qx, qy = np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    solid = 0.0
    for k in range(first, end):
        r = radius[k]
        u0, u1, v0, v1 = max(x0, x[k] - r), min(x1, x[k] + r), max(y0, y[k] - r), min(y1, y[k] + r)
        if u0 < u1 and v0 < v1:
            px[0], px[1], px[2], px[3] = u0, u1, u1, u0
            py[0], py[1], py[2], py[3] = v0, v0, v1, v1
            n = _to_power_cell(x, y, radius, k, first, end, px, py, 4, qx, qy)
            solid += disc_in_polygon(x[k], y[k], r, px, py, n)
    return solid


@kernel(inline=True)
def _grain_in_rectangle(x, y, radius, m, p, q, first, end, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Area [m^2] of the grain of elements first..end - 1 inside a rectangle."""
    if end > first + 1:
        return _discs_in_rectangle(x, y, radius, first, end, x0, y0, x1, y1)
    k = first
    if p[k] == 0.0 and q[k] == 0.0:
        return disc_in_rectangle(x[k], y[k], radius[k], x0, y0, x1, y1)
    return ellipse_in_rectangle(x[k], y[k], math.pi * radius[k] ** 2, m[k], p[k], q[k], x0, y0, x1, y1)


@kernel()
def _lens_of_cells(x, y, radius, body, k, m, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Area [m^2] common to the rectangle and discs k and m of two grains, each cut to its power cell in its own grain.

    So a spot that belongs to two discs of one grain and to another grain is taken off once.
    """
    u0, u1 = max(x0, x[k] - radius[k], x[m] - radius[m]), min(x1, x[k] + radius[k], x[m] + radius[m])
    v0, v1 = max(y0, y[k] - radius[k], y[m] - radius[m]), min(y1, y[k] + radius[k], y[m] + radius[m])
    if u0 >= u1 or v0 >= v1:
        return 0.0
    first_k, first_m = _first_of_grain(body, k), _first_of_grain(body, m)
    end_k, end_m = _end_of_grain(body, first_k), _end_of_grain(body, first_m)
    # a lens whose chord runs between the centres lies in the circle about the chord
    dx, dy = x[m] - x[k], y[m] - y[k]
    dd = dx * dx + dy * dy
    along = 0.5 + 0.5 * (radius[k] - radius[m]) * (radius[k] + radius[m]) / dd if dd > 0.0 else -1.0
    alone = 0.0 <= along <= 1.0
    half = math.sqrt(max(0.0, radius[k] ** 2 - along * along * dd))
    for first, end in ((first_k, end_k), (first_m, end_m)):
        for other in range(first, end):
            if alone and other not in (k, m):
                ox, oy = x[k] + along * dx - x[other], y[k] + along * dy - y[other]
                alone = ox * ox + oy * oy >= (radius[other] + half) ** 2
    if alone:
        return lens_in_rectangle(x[k], y[k], radius[k], x[m], y[m], radius[m], x0, y0, x1, y1)
    most = 4 + 2 * (end_k - first_k + end_m - first_m)
    px, py, qx, qy = np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    px[0], px[1], px[2], px[3] = u0, u1, u1, u0
    py[0], py[1], py[2], py[3] = v0, v0, v1, v1
    n = _to_power_cell(x, y, radius, k, first_k, end_k, px, py, 4, qx, qy)
    n = _to_power_cell(x, y, radius, m, first_m, end_m, px, py, n, qx, qy)
    return lens_in_polygon(x[k], y[k], radius[k], x[m], y[m], radius[m], px, py, n)


@kernel()
def grain_areas(x, y, radius, m, p, q, body):  # type: ignore[no-untyped-def]
    """Area [m^2] of each grain, shape (grains,)."""
    areas = np.empty(body[-1] + 1)
    first = 0
    while first < len(x):
        end = _end_of_grain(body, first)
        areas[body[first]] = _grain_in_rectangle(
            x, y, radius, m, p, q, first, end, -math.inf, -math.inf, math.inf, math.inf
        )
        first = end
    return areas


@kernel()
def covered_by_grains(x, y, radius, m, p, q, body, member, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Sum of the areas [m^2] inside a rectangle of the grains with member = True; grains in contact are counted in full."""
    solid = 0.0
    first = 0
    while first < len(x):
        end = _end_of_grain(body, first)
        if member[first]:
            solid += _grain_in_rectangle(x, y, radius, m, p, q, first, end, x0, y0, x1, y1)
        first = end
    return solid


@kernel()
def covered_by_discs(x, y, radius, member, i, j, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Area [m^2] inside a rectangle of grains with member = True, less what they share at contacts, where every grain is one disc."""
    solid = 0.0
    for k in range(len(x)):
        if member[k]:
            solid += disc_in_rectangle(x[k], y[k], radius[k], x0, y0, x1, y1)
    for c in range(len(i)):
        k, l = i[c], j[c]  # noqa: E741
        if l >= 0 and member[k] and member[l]:
            solid -= lens_in_rectangle(x[k], y[k], radius[k], x[l], y[l], radius[l], x0, y0, x1, y1)
    return solid


@kernel()
def shared_at_contacts(  # type: ignore[no-untyped-def]
    x, y, radius, m, p, q, body, member, i, j, nx, ny, px, py, overlap, x0, y0, x1, y1
):
    """Sum of the areas [m^2] inside a rectangle that grains with member = True share at their contacts."""
    shared = 0.0
    for c in range(len(i)):
        k, l = i[c], j[c]  # noqa: E741
        if l < 0 or not (member[k] and member[l]):
            continue
        if p[k] == 0.0 and q[k] == 0.0 and p[l] == 0.0 and q[l] == 0.0:
            shared += _lens_of_cells(x, y, radius, body, k, l, x0, y0, x1, y1)
        else:
            area_k, area_l = math.pi * radius[k] ** 2, math.pi * radius[l] ** 2
            rk = curvature_radius(area_k, m[k], p[k], q[k], nx[c], ny[c])
            rl = curvature_radius(area_l, m[l], p[l], q[l], nx[c], ny[c])
            lens = lens_at_contact(nx[c], ny[c], px[c], py[c], overlap[c], rk, rl, x0, y0, x1, y1)
            # deep in each other, circles of curvature may share more than an ellipse has
            most, all_of_it = min(area_k, area_l), lens_area(abs(rk + rl - overlap[c]), rk, rl)
            shared += lens if all_of_it <= most else lens * most / all_of_it
    return shared
