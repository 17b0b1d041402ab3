"""Bodies made of spheres: mass properties of their union, and surfaces to draw."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np

from dem_cli.assembly.solids import Solid, ball, together
from dem_cli.geometry.union import pieces
from dem_cli.state import Floats, Ints

NODES = 12  # of a Gauss rule between two heights at which the cut through the spheres changes its kind
MERGED = 1e-9  # share of the clump's size below which two such heights are one


def union_of_spheres(centres: Floats, radii: Floats) -> Solid:
    """The union of spheres, centres (s, 3) and radii (s,) [m], what they share counted once.

    Exact where none overlap. Else its cuts along x, y and z are unions of discs, whose area, centre and polar moment are exact; they are
    summed over the height by Gauss' rule between all heights at which the cut changes its kind. The error is some 1e-8 of the volume.
    """
    parts = [ball(float(r)) for r in radii]
    if not any(
        np.linalg.norm(centres[i] - centres[j]) < (radii[i] + radii[j]) * (1.0 - 1e-12)
        for i, j in combinations(range(len(radii)), 2)
    ):
        return together([part._replace(centre=centre) for part, centre in zip(parts, centres, strict=True)])
    middle = centres.mean(axis=0)
    cuts = [_along(centres - middle, radii, axis) for axis in range(3)]
    volume = sum(cut[0] for cut in cuts) / 3.0
    # Each axis gives the first moment along itself, the product moments with it, and the polar moment about it.
    first = np.array([cuts[axis][1][axis] for axis in range(3)])
    second = np.zeros((3, 3))
    polar = np.array([cuts[axis][3] for axis in range(3)])
    second[np.diag_indices(3)] = 0.5 * polar.sum() - polar
    for i, j in combinations(range(3), 2):
        second[i, j] = second[j, i] = 0.5 * (cuts[i][2][j] + cuts[j][2][i])
    centre = first / volume
    return Solid(volume, middle + centre, second - volume * np.outer(centre, centre))


def _along(centres: Floats, radii: Floats, axis: int) -> tuple[float, Floats, Floats, float]:
    """Volume, first moments (3,), moments (3,) of each coordinate with that of the axis, and polar moment about the axis."""
    one, other = (axis + 1) % 3, (axis + 2) % 3
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    # Cubic in the node, so that the cut's square roots at both ends are smooth in it.
    places, shares = 0.5 * (3.0 * nodes - nodes**3), 1.5 * weights * (1.0 - nodes**2)
    volume, polar, first, product = 0.0, 0.0, np.zeros(3), np.zeros(3)
    for low, high in pairwise(_heights(centres, radii, axis)):
        half = 0.5 * (high - low)
        for height, weight in zip(0.5 * (low + high) + half * places, half * shares, strict=True):
            left = radii**2 - (height - centres[:, axis]) ** 2
            cut = left > 0.0
            if not cut.any():
                continue
            area, x, y, own = pieces(centres[cut, one], centres[cut, other], np.sqrt(left[cut])).whole
            place = np.zeros(3)
            place[axis], place[one], place[other] = height, x, y
            volume += weight * area
            first += weight * area * place
            product += weight * area * height * place
            polar += weight * (own + area * (x * x + y * y))
    return volume, first, product, polar


def _heights(centres: Floats, radii: Floats, axis: int) -> list[float]:
    """Heights along an axis at which spheres, their circles of intersection and points of three spheres begin and end."""
    found = [*(centres[:, axis] - radii), *(centres[:, axis] + radii)]
    circles = []
    for i, j in combinations(range(len(radii)), 2):
        away = centres[j] - centres[i]
        distance = float(np.linalg.norm(away))
        if not abs(radii[i] - radii[j]) < distance < radii[i] + radii[j]:
            continue
        normal = away / distance
        offset = 0.5 * (distance + (radii[i] - radii[j]) * (radii[i] + radii[j]) / distance)
        round_ = np.sqrt(radii[i] ** 2 - offset**2)
        middle = centres[i] + offset * normal
        reach = round_ * np.sqrt(max(0.0, 1.0 - normal[axis] ** 2))
        found += [middle[axis] - reach, middle[axis] + reach]
        circles.append((i, j, middle, normal, round_))
    for i, j, middle, normal, round_ in circles:
        for k in range(j + 1, len(radii)):
            found += _points_of_three(centres[k], radii[k], middle, normal, round_, axis)
        del i
    size = float(np.max(found) - np.min(found))
    heights = [min(found)]
    heights += [height for height in sorted(found) if height > heights[0] + MERGED * size]
    kept = [heights[0]]
    for height in heights[1:]:
        if height > kept[-1] + MERGED * size:
            kept.append(height)
    return [float(height) for height in kept]


def _points_of_three(
    centre: Floats, radius: float, middle: Floats, normal: Floats, round_: float, axis: int
) -> list[float]:
    """Heights of the points in which a circle (middle, normal, radius round_) meets a sphere."""
    away = centre - middle
    above = float(away @ normal)
    within = away - above * normal
    distance, left = float(np.linalg.norm(within)), radius**2 - above**2
    if distance == 0.0 or left <= 0.0:
        return []
    along = (distance**2 + round_**2 - left) / (2.0 * distance)
    if abs(along) >= round_:
        return []
    towards = within / distance
    across = np.sqrt(round_**2 - along**2) * np.cross(normal, towards)
    return [float((middle + along * towards + sign * across)[axis]) for sign in (-1.0, 1.0)]


def icosphere() -> tuple[Floats, Ints]:
    """An icosahedron whose edges are halved once, on the unit sphere: vertices (42, 3), triangles (80, 3)."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    corners = [(a, b * golden, 0.0) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    points = np.array([corner[k:] + corner[:k] for corner in corners for k in range(3)])
    points /= np.linalg.norm(points[0])
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    edge = np.sort(apart[0])[1] * 1.01
    faces = [
        _outward(points, face)
        for face in combinations(range(12), 3)
        if all(apart[a, b] < edge for a, b in combinations(face, 2))
    ]
    vertices, middles = list(points), {}
    for face in faces:
        for a, b in combinations(sorted(face), 2):
            if (a, b) not in middles:
                middles[a, b] = len(vertices)
                between = points[a] + points[b]
                vertices.append(between / np.linalg.norm(between))
    small = []
    for a, b, c in faces:
        ab, bc, ca = (middles[min(p, q), max(p, q)] for p, q in ((a, b), (b, c), (c, a)))
        small += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return np.array(vertices), np.array(small, dtype=np.int64)


def _outward(points: Floats, face: tuple[int, ...]) -> tuple[int, int, int]:
    a, b, c = face
    return (a, b, c) if np.linalg.det(points[[a, b, c]]) > 0.0 else (a, c, b)


def sphere_surfaces(centres: Floats, radii: Floats) -> tuple[Floats, Ints]:
    """Vertices (42 s, 3) and triangles (80 s, 3) of spheres, to draw them."""
    vertices, triangles = icosphere()
    count = len(vertices)
    return (
        np.concatenate([centre + r * vertices for centre, r in zip(centres, radii, strict=True)]),
        np.concatenate([triangles + k * count for k in range(len(radii))]),
    )
