"""Mass properties of solids, and turning between frames: volume, centre, moments of inertia, principal axes, quaternions."""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np

from dem_cli.rigid import rotation
from dem_cli.state import Floats, Ints

EVEN = 1e-12  # share of the largest moment below which products of inertia are rounding


class Solid(NamedTuple):
    """A solid of density 1: volume [m^3], centre (3,) [m], and second (3, 3) [m^5], the integral of (x - centre)(x - centre)' over it."""

    volume: float
    centre: Floats
    second: Floats

    @property
    def inertia(self) -> Floats:
        """Moments and products of inertia about the centre, shape (3, 3) [m^5]."""
        return np.asarray(np.trace(self.second) * np.eye(3) - self.second)


def cuboid(size: Floats) -> Solid:
    """A box of edge lengths (3,) [m] about the origin."""
    volume = float(np.prod(size))
    return Solid(volume, np.zeros(3), np.diag(volume * np.asarray(size) ** 2 / 12.0))


def ball(radius: float) -> Solid:
    """A sphere about the origin."""
    volume = 4.0 / 3.0 * np.pi * radius**3
    return Solid(volume, np.zeros(3), volume * radius**2 / 5.0 * np.eye(3))


def together(parts: list[Solid]) -> Solid:
    """Solids that share no volume, as one."""
    volume = np.array([part.volume for part in parts])
    centres = np.array([part.centre for part in parts])
    centre = volume @ centres / volume.sum()
    away = centres - centre
    second = sum((part.second for part in parts), np.zeros((3, 3))) + np.einsum("k,ki,kj->ij", volume, away, away)
    return Solid(float(volume.sum()), centre, second)


def polyhedron(vertices: Floats, triangles: Ints) -> Solid:
    """The inside of a closed surface, vertices (v, 3), triangles (t, 3) anticlockwise seen from outside.

    Sum over the tetrahedra from the mean of the vertices to each triangle: volume det(a, b, c)/6, centre (a + b + c)/4, and
    second moment volume/20 ((a + b + c)(a + b + c)' + aa' + bb' + cc'), exact for any shape, also one that is not convex.
    """
    start = vertices.mean(axis=0)
    corners = (vertices - start)[triangles]
    volumes = np.linalg.det(corners) / 6.0
    total = corners.sum(axis=1)
    volume = float(volumes.sum())
    centre = volumes @ total / (4.0 * volume)
    second = np.einsum("t,ti,tj->ij", volumes, total, total) + np.einsum("t,tki,tkj->ij", volumes, corners, corners)
    return Solid(volume, start + centre, second / 20.0 - volume * np.outer(centre, centre))


def principal(solid: Solid) -> tuple[Floats, Floats]:
    """Principal moments (3,) [m^5] of a solid of density 1, and the matrix whose columns are their axes, right-handed.

    The axes are the solid's own where these are principal already, and else as near to them as may be.
    """
    tensor = solid.inertia
    off = tensor - np.diag(np.diag(tensor))
    if np.max(np.abs(off)) <= EVEN * np.max(np.abs(tensor)):
        return np.diag(tensor).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(tensor)
    orders = [list(order) for order in permutations(range(3))]
    order = max(orders, key=lambda one: float(np.abs(np.diag(axes[:, one])).sum()))
    moments, axes = moments[order], axes[:, order]
    axes = axes * np.where(np.diag(axes) < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, int(np.argmin(np.abs(np.diag(axes))))] *= -1.0
    return moments, axes


def quaternion_of(matrix: Floats) -> Floats:
    """Unit quaternion w, x, y, z (4,), w >= 0, of a rotation (3, 3); the form with the largest divisor (Shepperd)."""
    m = matrix
    trace = float(np.trace(m))
    squares = np.array([trace, m[0, 0], m[1, 1], m[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        q = np.array([1.0 + trace, m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    else:
        i, j, h = k - 1, k % 3, (k + 1) % 3
        q = np.empty(4)
        q[0] = m[h, j] - m[j, h]
        q[1 + i] = 1.0 + m[i, i] - m[j, j] - m[h, h]
        q[1 + j] = m[j, i] + m[i, j]
        q[1 + h] = m[h, i] + m[i, h]
    q = q / np.linalg.norm(q)
    return np.asarray(-q if q[0] < 0.0 else q)


def multiply(p: Floats, q: Floats) -> Floats:
    """The rotation q and then p, as quaternions (..., 4)."""
    p, q = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def turn(q: Floats, vectors: Floats) -> Floats:
    """Vectors (n, 3) turned by the quaternions (n, 4), or by one (4,)."""
    matrices = np.broadcast_to(rotation(q), (len(vectors), 3, 3))
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def random_quaternions(generator: np.random.Generator, count: int) -> Floats:
    """Unit quaternions (count, 4), every rotation alike likely (Shoemake 1992)."""
    u, a, b = generator.random((3, count)) * np.array([[1.0], [2.0 * np.pi], [2.0 * np.pi]])
    low, high = np.sqrt(1.0 - u), np.sqrt(u)
    return np.stack([high * np.cos(b), low * np.sin(a), low * np.cos(a), high * np.sin(b)], axis=1)
