"""What does not move: planes, the walls of the container, the box outside which bodies count as escaped."""

from __future__ import annotations

import numpy as np

from dem_cli.rigid import Planes, Terrain
from dem_cli.scenario import ImpulseScenario
from dem_cli.scenario.impulse_tables import ImpulseContainer
from dem_cli.state import Floats, Ints

FAR = 1000.0  # times the size of everything there is, at which bodies count as escaped where nothing holds them
MARGIN = 0.5  # of what pictures show of planes without end, around the bodies


def build_planes(scenario: ImpulseScenario, low: Floats, high: Floats) -> Planes:
    """The container's walls and then the scenario's planes, as large in pictures as the bodies between low and high (3,) [m] need."""
    container, materials = scenario.container, scenario.materials
    names, points, normals, edges, of = [], [], [], [], []
    for name, point, normal, edge in _walls(container, high):
        names.append(name)
        points.append(point)
        normals.append(normal)
        edges.append(edge)
        of.append(container.material)
    for plane in scenario.planes:
        point, normal = np.array(plane.point), np.array(plane.direction)
        names.append(plane.name)
        points.append(point)
        normals.append(normal)
        edges.append(_piece(point, normal, low, high))
        of.append(plane.material)
    return Planes(
        name=tuple(names),
        point=np.array(points).reshape(-1, 3),
        normal=np.array(normals).reshape(-1, 3),
        material=np.array([materials.index(one) for one in of], dtype=np.int64),
        edge=np.array(edges).reshape(-1, 4, 3),
    )


def _walls(container: ImpulseContainer, high: Floats) -> list[tuple[str, Floats, Floats, Floats]]:
    """Name, point, normal and corners of each wall; without height they are shown up to the highest body."""
    if container.width is None or container.breadth is None:
        return []
    a, b = container.width, container.breadth
    h = container.height or max(float(high[2]), 0.5 * max(a, b))
    corner: dict[str, list[tuple[float, float, float]]] = {
        "left": [(0, 0, 0), (0, b, 0), (0, b, h), (0, 0, h)],
        "right": [(a, 0, 0), (a, 0, h), (a, b, h), (a, b, 0)],
        "front": [(0, 0, 0), (0, 0, h), (a, 0, h), (a, 0, 0)],
        "back": [(0, b, 0), (a, b, 0), (a, b, h), (0, b, h)],
        "bottom": [(0, 0, 0), (a, 0, 0), (a, b, 0), (0, b, 0)],
        "top": [(0, 0, h), (0, b, h), (a, b, h), (a, 0, h)],
    }
    normal: dict[str, tuple[float, float, float]] = {
        "left": (1, 0, 0), "right": (-1, 0, 0), "front": (0, 1, 0), "back": (0, -1, 0), "bottom": (0, 0, 1), "top": (0, 0, -1),
    }  # fmt: skip
    return [
        (name, np.array(places[0], dtype=float), np.array(normal[name], dtype=float), np.array(places, dtype=float))
        for name, places in corner.items()
        if name != "top" or container.lid
    ]


def _piece(point: Floats, normal: Floats, low: Floats, high: Floats) -> Floats:
    """Corners (4, 3) of a rectangle on a plane, below all that lies between low and high, anticlockwise seen against the normal."""
    u = np.cross(normal, (0.0, 1.0, 0.0) if abs(normal[1]) < 0.9 else (0.0, 0.0, 1.0))
    u = -u / np.linalg.norm(u) if u[0] < 0.0 else u / np.linalg.norm(u)
    v = np.cross(normal, u)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    along = np.stack([corners @ u, corners @ v], axis=1) - np.array([point @ u, point @ v])
    least, most = along.min(axis=0), along.max(axis=0)
    margin = MARGIN * float(np.max(most - least))
    (left, near), (right, far) = least - margin, most + margin
    return np.array([point + p * u + q * v for p, q in ((left, near), (right, near), (right, far), (left, far))])


def limits(container: ImpulseContainer, terrain: Terrain | None, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Corners (3,) [m] of the box outside which a body has escaped. low, high: of what encloses bodies, planes' points and terrain.

    A container's walls are it, up to its height. A terrain ends below its lowest point: there, by a tenth of its extent, bodies that
    ran out over its edge have escaped. Everything else is FAR away.
    """
    size = float(np.max(high - low))
    least, most = low - FAR * size, high + FAR * size
    if terrain is not None:
        bottom, extent = float(terrain.vertices[:, 2].min()), float(np.ptp(terrain.vertices, axis=0).max())
        least[2] = min(bottom - 0.1 * extent, float(low[2]))
    if container.width is not None and container.breadth is not None:
        slack = 1e-3 * max(container.width, container.breadth)
        least[:] = -slack
        most[:2] = container.width + slack, container.breadth + slack
        if container.height is not None:
            most[2] = container.height + (slack if container.lid else 0.0)
    return least, most


def under(terrain: Terrain, x: Floats) -> Ints:
    """Indices of the places x (n, 3) [m] that have an upward-looking triangle of the terrain above and none below them."""
    corners = terrain.vertices[terrain.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    up = normal[:, 2] > 0.0
    corners, normal = corners[up], normal[up]
    low, high = corners[:, :, :2].min(axis=1), corners[:, :, :2].max(axis=1)
    found = []
    for k, place in enumerate(x):
        near = np.flatnonzero(np.all((low <= place[:2]) & (high >= place[:2]), axis=1))
        sides = corners[near][:, [1, 2, 0], :2] - corners[near][:, :, :2]
        to = place[:2] - corners[near][:, :, :2]
        over = np.all(sides[:, :, 0] * to[:, :, 1] - sides[:, :, 1] * to[:, :, 0] >= 0.0, axis=1)
        above = np.einsum("ta,ta->t", place - corners[near][over, 0], normal[near][over])
        if len(above) and np.all(above < 0.0):
            found.append(k)
    return np.array(found, dtype=np.int64)
