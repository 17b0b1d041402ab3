"""Shapes where their bodies are: points, corners and spheres in the container's axes, for measures and pictures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dem_cli.rigid import Bodies, Shape, rotation
from dem_cli.state import Bools, Floats, Ints


def by_shape(bodies: Bodies, chosen: Bools) -> Iterator[tuple[int, Ints]]:
    """Number of a shape, and the indices of the chosen bodies (n,) that have it, for each shape that some have."""
    for k in np.unique(bodies.shape[chosen]).tolist():
        yield k, np.flatnonzero(chosen & (bodies.shape == k))


def placed(bodies: Bodies, some: Ints, points: Floats) -> Floats:
    """Points (p, 3) [m] of the shape of the bodies `some` (m,), in the container's axes: shape (m, p, 3) [m]."""
    turned = np.einsum("mab,pb->mpa", rotation(bodies.q[some]), points)
    return np.asarray(bodies.x[some, None] + bodies.scale[some, None, None] * turned)


def outline(shape: Shape) -> Floats:
    """Points (p, 3) [m] of the surface of a shape that is no clump: its corners, and the points that contacts are looked for at."""
    return np.concatenate([shape.vertices.reshape(-1, 3), shape.points.reshape(-1, 3)])


def extent(bodies: Bodies, shapes: tuple[Shape, ...]) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates of each body [m], shape (n, 3) each, exact for its shape."""
    low, high = bodies.x.copy(), bodies.x.copy()
    for k, some in by_shape(bodies, np.ones(len(bodies), dtype=bool)):
        shape = shapes[k]
        if shape.kind == "spheres":
            centers = placed(bodies, some, shape.centers)
            radii = (bodies.scale[some, None] * shape.radii)[:, :, None]
            low[some], high[some] = (centers - radii).min(axis=1), (centers + radii).max(axis=1)
        elif len(outline(shape)):
            points = placed(bodies, some, outline(shape))
            low[some], high[some] = points.min(axis=1), points.max(axis=1)
    return low, high


def volume(bodies: Bodies, shapes: tuple[Shape, ...]) -> Floats:
    """Volume of each body [m^3], shape (n,)."""
    return np.array([shape.volume for shape in shapes])[bodies.shape] * bodies.scale**3
