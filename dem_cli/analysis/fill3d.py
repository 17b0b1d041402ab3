"""Bed of bodies in a container in 3D: which bodies belong to it, the mean height of its top surface, and its void ratio.

The top surface is sampled at the middles of the cells of a grid over the floor, CELLS along its longer side: the highest point of
the bodies of the bed there, the floor where there is none. Its mean times the floor's area is the volume under the surface, so the void ratio is
that of all below the outline, as for `void_ratio` in 2D.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from dem_cli.analysis.placed import by_shape, placed, volume
from dem_cli.analysis.void_ratio import void_ratio
from dem_cli.rigid import Bodies, BodyContacts, Planes, Scene, Shape, touching_pairs
from dem_cli.state import Bools, Floats, Ints

CELLS = 64
SIDES = ("left", "right", "front", "back", "bottom")


@dataclass(frozen=True)
class Floor:
    """Floor of a container: low, high (2,) [m]: x and y of its corners, z [m], and the number of its plane."""

    low: Floats
    high: Floats
    z: float
    plane: int

    @property
    def area(self) -> float:
        return float(np.prod(self.high - self.low))


def floor_of(planes: Planes) -> Floor | None:
    """Floor of the container that planes named as its sides make; None where there is none with upright walls."""
    at = {name: k for k, name in enumerate(planes.name)}
    if any(name not in at for name in SIDES):
        return None
    left, right, front, back, bottom = (at[name] for name in SIDES)
    inward = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0], [0, 0, 1.0]])
    if not np.allclose(planes.normal[[left, right, front, back, bottom]], inward, atol=1e-9):
        return None
    low = np.array([planes.point[left, 0], planes.point[front, 1]])
    high = np.array([planes.point[right, 0], planes.point[back, 1]])
    return Floor(low, high, float(planes.point[bottom, 2]), bottom) if (high > low).all() else None


def bed(contacts: BodyContacts, plane: int, present: Bools) -> Bools:
    """Bodies present that contacts join to a plane, directly or over others, shape (n,)."""
    n = len(present)
    pairs = touching_pairs(contacts)
    pairs = pairs[(pairs[:, 1] >= 0) | (pairs[:, 1] == -1 - plane)]
    ends = np.where(pairs < 0, n, pairs)  # the plane is node n
    graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(n + 1, n + 1))
    _, label = connected_components(graph, directed=False)
    return np.asarray((label[:n] == label[n]) & present)


def measure_fill(bodies: Bodies, contacts: BodyContacts, scene: Scene) -> tuple[float, float]:
    """fill_height [m] and void ratio [-] of the bed; NaN without a container, or with fewer than half of the bodies present in the bed."""
    floor = floor_of(scene.planes)
    present = ~bodies.escaped
    if floor is None or not present.any():
        return math.nan, math.nan
    members = bed(contacts, floor.plane, present)
    if 2 * np.count_nonzero(members) < np.count_nonzero(present):
        return math.nan, math.nan
    height = float(top_surface(bodies, members, scene.shapes, floor).mean())
    return height, void_ratio(floor.area * height, float(volume(bodies, scene.shapes)[members].sum()))


def top_surface(bodies: Bodies, members: Bools, shapes: tuple[Shape, ...], floor: Floor, cells: int = CELLS) -> Floats:
    """Height over the floor [m] of the highest point of the members at the middle of each cell, shape (nx, ny), at least 0."""
    size = floor.high - floor.low
    count = np.maximum(1, np.ceil(cells * size / size.max() - 1e-9).astype(np.int64))
    top = np.full(int(count[0] * count[1]), floor.z)
    for k, some in by_shape(bodies, members):
        shape = shapes[k]
        if shape.kind == "spheres":
            centers = placed(bodies, some, shape.centers).reshape(-1, 3)
            radii = (bodies.scale[some, None] * shape.radii).ravel()
            where, height = _over_spheres(centers, radii, floor.low, size / count, count)
        else:
            corners = placed(bodies, some, shape.vertices.reshape(-1, 3))[:, shape.triangles.reshape(-1, 3)]
            where, height = _over_triangles(corners.reshape(-1, 3, 3), floor.low, size / count, count)
        np.maximum.at(top, where, height)
    return np.asarray((top - floor.z).reshape(count))


def _middles(low: Floats, high: Floats, origin: Floats, cell: Floats, count: Ints) -> tuple[Ints, Ints]:
    """Cells whose middles lie in boxes (m, 2) from low to high [m]: number of the box, and x and y number of the cell, (t, 2)."""
    first = np.maximum(0, np.ceil((low - origin) / cell - 0.5)).astype(np.int64)
    stop = np.minimum(count, np.floor((high - origin) / cell - 0.5).astype(np.int64) + 1)
    span = np.maximum(0, stop - first)
    each = span[:, 0] * span[:, 1]
    box = np.repeat(np.arange(len(low)), each)
    k = np.arange(len(box)) - np.repeat(np.cumsum(each) - each, each)
    return box, first[box] + np.stack([k // span[box, 1], k % span[box, 1]], axis=1)


def _over_spheres(centers: Floats, radii: Floats, origin: Floats, cell: Floats, count: Ints) -> tuple[Ints, Floats]:
    """Number of a cell and height [m] of the sphere over its middle, for all that cover one."""
    flat = centers[:, :2]
    box, at = _middles(flat - radii[:, None], flat + radii[:, None], origin, cell, count)
    offset = origin + (at + 0.5) * cell - flat[box]
    square = radii[box] ** 2 - (offset**2).sum(axis=1)
    over = square >= 0.0
    height = centers[box[over], 2] + np.sqrt(square[over])
    return at[over, 0] * count[1] + at[over, 1], height


def _over_triangles(corners: Floats, origin: Floats, cell: Floats, count: Ints) -> tuple[Ints, Floats]:
    """The same for triangles (t, 3, 3) [m] that face upwards."""
    a, b, c = (corners[:, k] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    up = area > 0.0
    corners, area = corners[up], area[up]
    flat = corners[:, :, :2]
    box, at = _middles(flat.min(axis=1), flat.max(axis=1), origin, cell, count)
    point = origin + (at + 0.5) * cell
    share = np.empty((len(box), 3))  # barycentric
    for k in range(3):
        p, q = flat[box, (k + 1) % 3], flat[box, (k + 2) % 3]
        d, e = q - p, point - p
        share[:, k] = (d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]) / area[box]
    over = (share >= -1e-12).all(axis=1)
    height = (share[over] * corners[box[over], :, 2]).sum(axis=1)
    return at[over, 0] * count[1] + at[over, 1], height
