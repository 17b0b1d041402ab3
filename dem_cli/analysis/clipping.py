"""Areas of discs, of ellipses, and of the lenses in which two overlap, inside rectangles: closed forms, no sampling.

Absolute errors are of the order of 1e-15 r^2, whatever the position; sides of a rectangle may be infinite. The lens of two ellipses
alone is an approximation, for shallow contacts (`lens_at_contact`).
"""

from __future__ import annotations

import math

import numpy as np

from dem_cli.jit import kernel


@kernel(inline=True)
def _left_part(x):  # type: ignore[no-untyped-def]
    """Area of the unit disc with X <= x, for -1 <= x <= 1."""
    return x * math.sqrt(1.0 - x * x) + math.asin(x) + 0.5 * math.pi


@kernel()
def _lower_left_part(x, y):  # type: ignore[no-untyped-def]
    """Area of the unit disc with X <= x and Y <= y, for x and y in [-1, 1].

    With the corner (x, y) inside the disc it is x y + (A(x) + A(y))/2 - pi/4, A as in `_left_part`
    (differentiate, and compare on the circle). With the corner outside, the parts cut off by the two
    sides do not meet.
    """
    if x * x + y * y < 1.0:
        return x * y + 0.5 * (_left_part(x) + _left_part(y)) - 0.25 * math.pi
    if x < 0.0 and y < 0.0:
        return 0.0
    if x < 0.0:
        return _left_part(x)
    if y < 0.0:
        return _left_part(y)
    return _left_part(x) + _left_part(y) - math.pi


@kernel(inline=True)
def _unit(value):  # type: ignore[no-untyped-def]
    return min(1.0, max(-1.0, value))


@kernel()
def disc_in_rectangle(cx, cy, r, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Area [m^2] of the disc of centre (cx, cy) and radius r inside x0 <= x <= x1, y0 <= y <= y1."""
    if cx - r >= x0 and cx + r <= x1 and cy - r >= y0 and cy + r <= y1:
        return math.pi * r * r
    if cx + r <= x0 or cx - r >= x1 or cy + r <= y0 or cy - r >= y1:
        return 0.0
    a0 = _unit((x0 - cx) / r)
    a1 = _unit((x1 - cx) / r)
    b0 = _unit((y0 - cy) / r)
    b1 = _unit((y1 - cy) / r)
    area = _lower_left_part(a1, b1) - _lower_left_part(a0, b1) - _lower_left_part(a1, b0)
    return r * r * max(0.0, area + _lower_left_part(a0, b0))


@kernel()
def _sector(ax, ay, bx, by, r):  # type: ignore[no-untyped-def]
    """Signed area between the rays to a and b and the arc of radius r about the origin."""
    return 0.5 * r * r * math.atan2(ax * by - ay * bx, ax * bx + ay * by)


@kernel()
def disc_in_polygon(cx, cy, r, px, py, n):  # type: ignore[no-untyped-def]
    """Area [m^2] of a disc inside the simple polygon of the first n corners px, py (anticlockwise).

    Green's theorem about the centre: each side gives its triangle where it runs inside the disc and a
    sector elsewhere.
    """
    area = 0.0
    for k in range(n):
        ax, ay = px[k] - cx, py[k] - cy
        m = k + 1 if k + 1 < n else 0
        bx, by = px[m] - cx, py[m] - cy
        dx, dy = bx - ax, by - ay
        dd = dx * dx + dy * dy
        if dd == 0.0:
            continue
        # |a + t d| = r; h: squared distance from centre to the line of the side
        t_near = -(ax * dx + ay * dy) / dd
        cross = ax * by - ay * bx
        reach = r * r - cross * cross / dd
        half = math.sqrt(reach / dd) if reach > 0.0 else 0.0
        t0 = max(0.0, t_near - half)
        t1 = min(1.0, t_near + half)
        if t0 >= t1:
            area += _sector(ax, ay, bx, by, r)
            continue
        qx, qy = ax + t0 * dx, ay + t0 * dy
        sx, sy = ax + t1 * dx, ay + t1 * dy
        area += 0.5 * (qx * sy - qy * sx)
        if t0 > 0.0:
            area += _sector(ax, ay, qx, qy, r)
        if t1 < 1.0:
            area += _sector(sx, sy, bx, by, r)
    return max(0.0, area)


@kernel()
def cut(px, py, n, nx, ny, a, qx, qy):  # type: ignore[no-untyped-def]
    """Cut a convex polygon with the half plane nx x + ny y <= a; corners go to qx, qy; returns the number, n + 1 at most."""
    m = 0
    for k in range(n):
        j = k + 1 if k + 1 < n else 0
        s = nx * px[k] + ny * py[k] - a
        t = nx * px[j] + ny * py[j] - a
        if s <= 0.0:
            qx[m], qy[m] = px[k], py[k]
            m += 1
        if (s < 0.0 and t > 0.0) or (s > 0.0 and t < 0.0):
            w = s / (s - t)
            qx[m] = px[k] + w * (px[j] - px[k])
            qy[m] = py[k] + w * (py[j] - py[k])
            m += 1
    return m


@kernel(inline=True)
def _segment(r, a):  # type: ignore[no-untyped-def]
    """Area of the part of a disc beyond a chord at signed distance a from its centre.

    Thin ones, as at most contacts, by the series of asin s - s sqrt(1 - s^2): faster, and nothing cancels.
    """
    c = _unit(a / r)
    ss = (1.0 - c) * (1.0 + c)
    s = math.sqrt(ss)
    if c > 0.995:
        series = 2 / 3 + ss * (1 / 5 + ss * (3 / 28 + ss * (5 / 72 + ss * (35 / 704))))
        return r * r * s * ss * series
    return r * r * (math.acos(c) - c * s)


@kernel()
def lens_area(d, ri, rj):  # type: ignore[no-untyped-def]
    """Area [m^2] common to two discs of radii ri, rj whose centres are d apart."""
    if d >= ri + rj:
        return 0.0
    if d <= abs(ri - rj):
        r = min(ri, rj)
        return math.pi * r * r
    a = 0.5 * (d + (ri - rj) * (ri + rj) / d)
    return _segment(ri, a) + _segment(rj, d - a)


@kernel()
def lens_in_polygon(xi, yi, ri, xj, yj, rj, px, py, n):  # type: ignore[no-untyped-def]
    """Area [m^2] common to two discs and the convex polygon of the first n corners px, py (anticlockwise).

    The common chord splits the lens: on the side of j it is bounded by disc i alone, on the side of i by
    disc j alone (the chord is where the powers of a point with respect to the circles are equal). Each
    part is a disc in a convex polygon.
    """
    dx, dy = xj - xi, yj - yi
    dd = dx * dx + dy * dy
    if dd >= (ri + rj) ** 2:
        return 0.0
    if dd <= (ri - rj) ** 2:
        if ri < rj:
            return disc_in_polygon(xi, yi, ri, px, py, n)
        return disc_in_polygon(xj, yj, rj, px, py, n)
    chord = dx * xi + dy * yi + 0.5 * (dd + (ri - rj) * (ri + rj))
    qx, qy = np.empty(n + 1), np.empty(n + 1)
    m = cut(px, py, n, dx, dy, chord, qx, qy)
    area = disc_in_polygon(xj, yj, rj, qx, qy, m)
    m = cut(px, py, n, -dx, -dy, -chord, qx, qy)
    return area + disc_in_polygon(xi, yi, ri, qx, qy, m)


@kernel()
def lens_in_rectangle(xi, yi, ri, xj, yj, rj, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Area [m^2] common to two discs and the rectangle x0..x1, y0..y1."""
    # a box about the lens: inside the rectangle nothing is to be cut, outside nothing is left
    u0, u1 = max(xi - ri, xj - rj), min(xi + ri, xj + rj)
    v0, v1 = max(yi - ri, yj - rj), min(yi + ri, yj + rj)
    if u0 >= x1 or u1 <= x0 or v0 >= y1 or v1 <= y0:
        return 0.0
    dx, dy = xj - xi, yj - yi
    d = math.sqrt(dx * dx + dy * dy)
    if d >= ri + rj:
        return 0.0
    if u0 >= x0 and u1 <= x1 and v0 >= y0 and v1 <= y1:
        return lens_area(d, ri, rj)
    u0, u1, v0, v1 = max(u0, x0), min(u1, x1), max(v0, y0), min(v1, y1)
    return lens_in_polygon(xi, yi, ri, xj, yj, rj, np.array((u0, u1, u1, u0)), np.array((v0, v0, v1, v1)), 4)


@kernel()
def ellipse_in_rectangle(cx, cy, area, m, p, q, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Area [m^2] of the ellipse of centre (cx, cy), area pi a b and outline (m, p, q) inside x0 <= x <= x1, y0 <= y <= y1.

    x = cx + w u, y = cy + q/w u + a b/w v with w^2 = m + p takes the unit disc to the ellipse; so its share inside is that of the
    disc in a parallelogram. Nothing here is singular for a = b.
    """
    w, h = math.sqrt(m + p), math.sqrt(m - p)
    if cx - w >= x0 and cx + w <= x1 and cy - h >= y0 and cy + h <= y1:
        return area
    if cx + w <= x0 or cx - w >= x1 or cy + h <= y0 or cy - h >= y1:
        return 0.0
    tilt, scale = q / w, area / (math.pi * w)
    u0, u1 = (max(x0, cx - w) - cx) / w, (min(x1, cx + w) - cx) / w
    v0, v1 = (max(y0, cy - h) - cy) / scale, (min(y1, cy + h) - cy) / scale
    shift0, shift1 = tilt * u0 / scale, tilt * u1 / scale
    px = np.array((u0, u1, u1, u0))
    py = np.array((v0 - shift0, v0 - shift1, v1 - shift1, v1 - shift0))
    return area / math.pi * disc_in_polygon(0.0, 0.0, 1.0, px, py, 4)


@kernel()
def curvature_radius(area, m, p, q, nx, ny):  # type: ignore[no-untyped-def]
    """Radius of curvature a^2 b^2 / h^3 [m] of an ellipse of area pi a b where its outward normal is (nx, ny)."""
    hh = m + p * (nx * nx - ny * ny) + 2.0 * q * nx * ny
    return (area / math.pi) ** 2 / (hh * math.sqrt(hh))


@kernel()
def lens_at_contact(nx, ny, px, py, overlap, ri, rj, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Area [m^2] common to the rectangle and two grains in contact, as if their outlines were circles of curvature ri, rj [m].

    nx, ny: normal from i to j; px, py [m]: contact point, in the middle of the overlap. For ellipses the error is below
    0.2 overlap / r of the lens, r the smaller of b^2/a of the two (their sharpest curves); measured up to aspect ratio 5, overlap r/2.
    """
    back_i, back_j = ri - 0.5 * overlap, rj - 0.5 * overlap
    return lens_in_rectangle(
        px - back_i * nx, py - back_i * ny, ri, px + back_j * nx, py + back_j * ny, rj, x0, y0, x1, y1
    )
