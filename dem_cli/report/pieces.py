"""Planes in pictures of bodies in 3D: pale pieces with a grid, cut where they meet, and outlines of those that are seen from behind."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.report.camera import Camera
from dem_cli.report.look import display_unit
from dem_cli.rigid import Planes
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINES = 12  # of a grid along the longer side of a plane, at most
PALE = np.array([0.935, 0.945, 0.955])


def draw_planes(ax: Axes, planes: Planes, camera: Camera) -> str:
    """Planes that show their bodies' side as a pale piece with a grid, the others as an outline over all. Returns the grid's caption."""
    from matplotlib.collections import LineCollection, PolyCollection

    if len(planes) == 0:
        return ""
    sides = np.linalg.norm(planes.edge - np.roll(planes.edge, 1, axis=1), axis=2)
    step = grid_step(float(sides.max()))
    faced = planes.normal @ camera.toward > 0.0
    order = np.argsort(camera.depth(planes.edge.mean(axis=1)))
    for w in order.tolist():
        corners = camera.screen(piece(planes, w))
        if faced[w]:
            pale = np.clip(PALE * (0.85 + 0.15 * camera.shade(planes.normal[w])), 0.0, 1.0)
            ax.add_collection(PolyCollection([corners], facecolors=[pale], edgecolors="0.55", linewidths=0.6, zorder=0))
            lines = camera.screen(cut_lines(grid_lines(planes.edge[w], planes.normal[w], step), planes, w))
            ax.add_collection(LineCollection(list(lines), colors="0.80", linewidths=0.4, zorder=1))
        else:
            outline = np.concatenate([corners, corners[:1]])
            ax.plot(outline[:, 0], outline[:, 1], color="0.45", lw=0.6, zorder=3)
    scale, unit = display_unit("m", step)
    return f"grid {step / scale:g} {unit}" if faced.any() else ""


def lowered(planes: Planes, ceiling: float) -> Planes:
    """Planes whose upright pieces end at z = `ceiling` [m]: walls may be much higher than what is between them."""
    edge = planes.edge.copy()
    upright = np.abs(planes.normal[:, 2]) < 0.1
    low = edge[..., 2].min(axis=1, initial=np.inf)
    for w in np.flatnonzero(upright & (low < ceiling)).tolist():
        edge[w, :, 2] = np.minimum(edge[w, :, 2], ceiling)
    return replace(planes, edge=edge)


def piece(planes: Planes, w: int) -> Floats:
    """Corners (c, 3) [m] of the piece of plane w that lies on the bodies' side of all other planes; the whole piece where none does."""
    corners = planes.edge[w]
    for other in range(len(planes)):
        if other == w:
            continue
        height = (corners - planes.point[other]) @ planes.normal[other]
        found: list[Floats] = []
        for k in range(len(corners)):
            one, two = height[k], height[(k + 1) % len(corners)]
            if one >= 0.0:
                found.append(corners[k])
            if (one < 0.0) != (two < 0.0):
                found.append(corners[k] + one / (one - two) * (corners[(k + 1) % len(corners)] - corners[k]))
        if len(found) < 3:
            return np.asarray(planes.edge[w])
        corners = np.array(found)
    return np.asarray(corners)


def cut_lines(lines: Floats, planes: Planes, w: int) -> Floats:
    """Parts of lines (g, 2, 3) [m] in plane w on the bodies' side of all other planes."""
    for other in range(len(planes)):
        if other == w:
            continue
        height = (lines - planes.point[other]) @ planes.normal[other]
        lines, height = lines[(height >= 0.0).any(axis=1)].copy(), height[(height >= 0.0).any(axis=1)]
        for end in (0, 1):
            below = height[:, end] < 0.0
            share = (height[below, end] / (height[below, end] - height[below, 1 - end]))[:, None]
            lines[below, end] += share * (lines[below, 1 - end] - lines[below, end])
    return lines


def grid_step(length: float) -> float:
    """1, 2 or 5 times a power of ten [m], at most LINES of them in a length."""
    least = length / LINES
    power = 10.0 ** math.floor(math.log10(least)) if least > 0.0 else 1.0
    return next(k * power for k in (1.0, 2.0, 5.0, 10.0) if k * power >= least * (1.0 - 1e-9))


def grid_lines(edge: Floats, normal: Floats, step: float) -> Floats:
    """Lines (g, 2, 3) [m] of a grid on the piece `edge` (4, 3) of a plane, through the multiples of `step` along its sides from the origin."""
    found = []
    for a, b, c, d in ((0, 1, 2, 3), (1, 2, 3, 0)):
        along = edge[b] - edge[a]
        length = float(np.linalg.norm(along))
        if length == 0.0:
            continue
        along = along / length
        start = float(edge[a] @ along)
        marks = step * np.arange(math.ceil(start / step - 1e-9), math.floor((start + length) / step + 1e-9) + 1) - start
        low, high = edge[a] + marks[:, None] * along, edge[d] + marks[:, None] * along
        assert abs(float((edge[c] - edge[d]) @ normal)) < 1e-6 * max(1.0, length)
        found.append(np.stack([low, high], axis=1))
    return np.concatenate(found) if found else np.empty((0, 2, 3))
