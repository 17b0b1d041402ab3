"""Unions of overlapping discs: exact area, centre and polar moment, every part counted once (numpy only: read before anything is compiled).

Each point of a union belongs to the disc whose power |p - c|^2 - r^2 is the smallest. That parts the union into one convex piece a
disc, bounded by arcs of its own circle and by chords on the radical lines to other discs; what is wanted of a piece are integrals
around its edge (Green's theorem), so any number of discs may overlap in any way, holes included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pieces:
    """What each disc has of the union, shape (n,) each: area [m^2], its centre x, y [m] (that of the disc where the area is 0), and its
    polar moment of area about that centre [m^4].

    The areas, put at the centres of the discs, have the centre of the union: the first moment of a piece about its disc's centre is
    half the integral of n times the power around its edge; the power is 0 on arcs, and the same on both sides of a chord.
    """

    area: Floats
    x: Floats
    y: Floats
    polar: Floats

    @property
    def whole(self) -> tuple[float, float, float, float]:
        """Area [m^2], centre x, y [m] and polar moment about it [m^4] of the union."""
        area = float(self.area.sum())
        x, y = float(self.area @ self.x) / area, float(self.area @ self.y) / area
        return area, x, y, float(np.sum(self.polar + self.area * ((self.x - x) ** 2 + (self.y - y) ** 2)))


def pieces(x: Floats, y: Floats, radius: Floats) -> Pieces:
    """The pieces of the union of discs with centres x, y and radii [m], shape (n,) each."""
    x, y, radius = (np.asarray(values, dtype=float) for values in (x, y, radius))
    rows = []
    for k, r in enumerate(radius):
        area, first_x, first_y, second = _piece(float(r), _radical_lines(x, y, radius, k))
        dx, dy = (first_x / area, first_y / area) if area > 0.0 else (0.0, 0.0)
        rows.append((area, x[k] + dx, y[k] + dy, max(second - area * (dx * dx + dy * dy), 0.0)))
    return Pieces(*np.array(rows).T)


Line = tuple[float, float, float]  # nx, ny, d: the half-plane n.p <= d [m], n a unit vector


def _radical_lines(x: Floats, y: Floats, radius: Floats, k: int) -> list[Line] | None:
    """The half-planes, from centre k, that cut disc k's piece out of it; None where nothing is left."""
    r = float(radius[k])
    lines: list[Line] = []
    for j in range(len(x)):
        if j == k:
            continue
        dx, dy = float(x[j] - x[k]), float(y[j] - y[k])
        distance, other = math.hypot(dx, dy), float(radius[j])
        within, around = distance + r <= other, distance + other <= r
        if within and not (around and k < j):  # of discs that are the same but for rounding the first keeps the piece
            return None
        if around or distance >= r + other:
            continue
        # (distance^2 + r^2 - other^2) / (2 distance), without loss where the discs hardly differ
        d = 0.5 * (distance + (r - other) * (r + other) / distance)
        if d <= -r:
            return None
        if d < r:
            lines.append((dx / distance, dy / distance, d))
    return list(dict.fromkeys(lines))


def _piece(r: float, lines: list[Line] | None) -> tuple[float, float, float, float]:
    """Area, first moments and polar moment, about the centre, of a disc cut by half-planes.

    Cones from the centre to the edge: the integral of a homogeneous f of degree q is 1/(q + 2) times that of f p x dp along the edge,
    anticlockwise. p x dp is r^2 d(phi) on the circle and d ds on the line n.p = d, p = d n + s t.
    """
    if lines is None:
        return 0.0, 0.0, 0.0, 0.0
    area = first_x = first_y = second = 0.0
    for low, high in _arcs(r, lines):
        area += 0.5 * r * r * (high - low)
        first_x += r**3 / 3.0 * (math.sin(high) - math.sin(low))
        first_y += r**3 / 3.0 * (math.cos(low) - math.cos(high))
        second += 0.25 * r**4 * (high - low)
    for nx, ny, d in lines:
        low, high = _chord(r, (nx, ny, d), lines)
        if high <= low:
            continue
        length, middle = high - low, 0.5 * (high * high - low * low)
        area += 0.5 * d * length
        first_x += d / 3.0 * (d * nx * length - ny * middle)
        first_y += d / 3.0 * (d * ny * length + nx * middle)
        second += 0.25 * d * (d * d * length + (high**3 - low**3) / 3.0)
    # A piece that other discs cover but for rounding is none.
    return (area, first_x, first_y, second) if area > 1e-14 * r * r else (0.0, 0.0, 0.0, 0.0)


def _arcs(r: float, lines: list[Line]) -> list[tuple[float, float]]:
    """Angles [rad] (from, to) of the circle that lie in all half-planes."""
    cut: list[tuple[float, float]] = []
    for nx, ny, d in lines:
        # not acos(d/r), which for d near r does not fit the chord's length to more than half of the digits
        half, towards = math.atan2(_half_chord(r, d), d), math.atan2(ny, nx)
        low = (towards - half) % (2.0 * math.pi)
        high = low + 2.0 * half
        cut.append((low, min(high, 2.0 * math.pi)))
        if high > 2.0 * math.pi:
            cut.append((0.0, high - 2.0 * math.pi))
    kept, at = [], 0.0
    for low, high in sorted(cut):
        if low > at:
            kept.append((at, low))
        at = max(at, high)
    return [*kept, (at, 2.0 * math.pi)] if at < 2.0 * math.pi else kept


def _half_chord(r: float, d: float) -> float:
    return math.sqrt((r - d) * (r + d))


def _chord(r: float, line: Line, lines: list[Line]) -> tuple[float, float]:
    """The part of a line, as (from, to) along t = (-ny, nx), within the disc and the other half-planes; empty where to <= from."""
    nx, ny, d = line
    high = _half_chord(r, d)
    low = -high
    for other in lines:
        if other == line:
            continue
        mx, my, e = other
        slope, room = nx * my - ny * mx, e - d * (nx * mx + ny * my)
        if slope > 0.0:
            high = min(high, room / slope)
        elif slope < 0.0:
            low = max(low, room / slope)
        elif room < 0.0:
            return 0.0, 0.0
    return low, high
