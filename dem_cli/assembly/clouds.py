"""Solids made of particles: which lie at the surface, their normals by principal components, mass, and how good it all is.

The article's particle bodies: a particle stands for a cubic cell of a regular lattice. Normals are the directions in which the particles at
the surface around spread least; at edges and corners there is none, and particles there are not trusted.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dem_cli.assembly.columns import read_columns
from dem_cli.assembly.meshes import UNITS
from dem_cli.assembly.solids import Solid
from dem_cli.errors import ScenarioError
from dem_cli.state import Bools, Floats, Ints

BESIDE = 1.2  # spacings within which the six neighbours of a cubic lattice lie, and no others
AROUND = (2.6, 1.8, BESIDE)  # spacings within which a normal is looked for, until the particles there are flat
FLATNESS = 0.1  # of the smallest over the middle principal component, below which particles are flat
OPEN = 0.3  # of the sum of the ways to free places around, along a normal that is trusted
SIDES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
DRAWN = 20000  # cells at the surface at most, whose sides are drawn


class Cloud(NamedTuple):
    """A solid of particles. points, normals (p, 3), trusted (p,): of the surface, as `rigid.Shape` has them; surface: cells' sides to draw.

    particles, inside: how many there are, and how many of them not at the surface. angle_median, angle_largest [rad]: between trusted
    normals of neighbours.
    """

    solid: Solid
    spacing: float
    points: Floats
    normals: Floats
    trusted: Bools
    surface: tuple[Floats, Ints]
    particles: int
    inside: int
    angle_median: float
    angle_largest: float
    warnings: tuple[str, ...]

    def words(self, name: str) -> str:
        """What there is to tell of its quality."""
        many, sure = len(self.points), int(self.trusted.sum())
        return (
            f"cloud {name}: {self.particles} particles {self.spacing:.4g} m apart, {many} at the surface, {sure} of these "
            f"({sure / many:.0%}) with a trusted normal; normals of neighbours differ by {np.degrees(self.angle_median):.1f} deg in the "
            f"median, {np.degrees(self.angle_largest):.1f} deg at most"
        )


def read_cloud(path: Path, unit: str, spacing: float | None, name: str) -> Cloud:
    """The solid of a CSV file x,y,z or x,y,z,nx,ny,nz. spacing [m]: None for the median distance of nearest neighbours.

    ScenarioError if the particles make no solid.
    """
    columns = read_columns(path, ("x", "y", "z"), ("nx", "ny", "nz"))
    x = np.stack([columns[axis] for axis in "xyz"], axis=1) * UNITS[unit]
    given = np.stack([columns[f"n{axis}"] for axis in "xyz"], axis=1) if "nx" in columns else None
    try:
        return make_cloud(x, spacing, given, name)
    except ValueError as error:
        raise ScenarioError(f"{path}: {error}") from None


def make_cloud(x: Floats, spacing: float | None = None, given: Floats | None = None, name: str = "cloud") -> Cloud:
    """The solid of particles at x (n, 3) [m]; given (n, 3): outward normals, zero for particles inside. ValueError if it is none."""
    from scipy.spatial import cKDTree

    if len(x) < 4:
        raise ValueError(f"has {len(x)} particles, a solid has at least 4. Add some")
    spread = np.linalg.svd(x - x.mean(axis=0), compute_uv=False)
    if spread[2] <= 1e-6 * spread[0]:
        form = "in a line" if spread[1] <= 1e-6 * spread[0] else "in a plane"
        raise ValueError(f"all particles lie {form}. Give particles that fill a solid, two layers or more")
    tree = cKDTree(x)
    nearest = tree.query(x, k=2)[0][:, 1]
    own = float(np.median(nearest))
    if float(nearest.min()) <= 1e-6 * own or not own > 0.0:
        k = int(np.argmin(nearest))
        raise ValueError(f"particle {k + 1} lies on another one. Give each place once")
    s = own if spacing is None else spacing
    if not 0.5 * own < s < 2.0 * own:
        raise ValueError(
            f"neighbours are {own:.4g} m apart, which does not fit to a spacing of {s:.4g} m. Correct it, or leave it out"
        )
    beside = _mean_offsets(tree, x, BESIDE * own)
    if given is None:
        chosen = np.flatnonzero(beside[1] < 6)
        normals, trusted = _normals(tree, x, chosen, own, x.mean(axis=0))
    else:
        length = np.linalg.norm(given, axis=1)
        chosen = np.flatnonzero(length > 0.0)
        if not len(chosen):
            raise ValueError("all its normals are zero. Give those of the surface, or leave nx,ny,nz out")
        normals, trusted = given[chosen] / length[chosen, None], np.ones(len(chosen), dtype=bool)
    # Half a cell outside: along a trusted normal, and else towards the corner of the cell between its open sides.
    open_sides = -beside[0][chosen] * beside[1][chosen, None] / own
    thin = np.zeros(len(chosen), dtype=bool)
    if given is None:  # flat, but open on both sides of it: no normal says where outside is
        thin = trusted & (np.einsum("pi,pi->p", open_sides, normals) < OPEN)
        trusted = trusted & ~thin
    corner = np.where(np.linalg.norm(open_sides, axis=1, keepdims=True) > 0.1, open_sides, normals)
    points = x[chosen] + 0.5 * s * np.where(trusted[:, None], normals, corner)
    solid = cells(x, s)
    median, largest = _differences(x[chosen][trusted], normals[trusted], BESIDE * own)
    cloud = Cloud(
        solid, s, points, normals, trusted, _sides_of_cells(x, s), len(x), len(x) - len(chosen), median, largest, ()
    )
    return cloud._replace(warnings=tuple(_warnings(cloud, name, own, nearest, int(thin.sum()))))


def cells(x: Floats, spacing: float) -> Solid:
    """Cubes of edge `spacing` [m] at x (n, 3) [m], with the cells' own share, m d^2/6 about each axis: exact for cuboids."""
    centre = x.mean(axis=0)
    away = x - centre
    second = spacing**3 * (away.T @ away + len(x) * spacing**2 / 12.0 * np.eye(3))
    return Solid(len(x) * spacing**3, centre, second)


def _mean_offsets(tree: Any, x: Floats, radius: float) -> tuple[Floats, Ints]:
    """Mean (n, 3) of the way to the neighbours within a radius, and their number (n,)."""
    pairs = tree.query_pairs(radius, output_type="ndarray")
    total = np.zeros_like(x)
    way = x[pairs[:, 1]] - x[pairs[:, 0]]
    np.add.at(total, pairs[:, 0], way)
    np.add.at(total, pairs[:, 1], -way)
    count = np.bincount(pairs.ravel(), minlength=len(x))
    return total / np.maximum(count, 1)[:, None], count


def _normals(tree: Any, x: Floats, chosen: Ints, s: float, centre: Floats) -> tuple[Floats, Bools]:
    """Outward normals of the particles at the surface, and whether the surface around them is flat enough for one.

    Outwards is away from the particles around; where these give no answer, from the centre.
    """
    from scipy.spatial import cKDTree

    outward = -_mean_offsets(tree, x, AROUND[0] * s)[0][chosen]
    weak = np.linalg.norm(outward, axis=1) < 1e-3 * s
    outward[weak] = (x[chosen] - centre)[weak]
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    outward = np.where(length > 0.0, outward / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
    surface = x[chosen]
    near = cKDTree(surface)
    normals, trusted = outward.copy(), np.zeros(len(chosen), dtype=bool)
    for radius in AROUND:
        left = np.flatnonzero(~trusted)
        for k, around in zip(left, near.query_ball_point(surface[left], radius * s), strict=True):
            if len(around) < 4:
                continue
            spread = surface[around] - surface[around].mean(axis=0)
            values, axes = np.linalg.eigh(spread.T @ spread)
            if values[0] <= FLATNESS * values[1]:
                sign = 1.0 if axes[:, 0] @ outward[k] >= 0.0 else -1.0
                normals[k], trusted[k] = sign * axes[:, 0], True
    return normals, trusted


def _differences(x: Floats, normals: Floats, radius: float) -> tuple[float, float]:
    """Median and largest angle [rad] between normals of particles within a radius; 0 without any."""
    from scipy.spatial import cKDTree

    if len(x) < 2:
        return 0.0, 0.0
    pairs = cKDTree(x).query_pairs(radius, output_type="ndarray")
    if not len(pairs):
        return 0.0, 0.0
    a, b = normals[pairs[:, 0]], normals[pairs[:, 1]]
    angle = 2.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    return float(np.median(angle)), float(angle.max())


def _sides_of_cells(x: Floats, s: float) -> tuple[Floats, Ints]:
    """The free sides of the cells as triangles, to draw them; nothing where the lattice is not along the axes, or large."""
    none = np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    low = x.min(axis=0)
    places = np.rint((x - low) / s).astype(np.int64)
    if np.max(np.abs(places * s - (x - low))) > 1e-3 * s or len(np.unique(places, axis=0)) < len(places):
        return none
    wide = places.max(axis=0) + 3
    filled = np.zeros(wide, dtype=bool)
    filled[tuple((places + 1).T)] = True
    corners, quads = [], 0
    for side in SIDES:
        free = places[~filled[tuple((places + 1 + side).T)]]
        u, v = np.roll(np.abs(side), 1), np.roll(np.abs(side), 2)
        if side.sum() < 0:
            u, v = v, u
        middle = 2 * free + side  # in half cells
        corners.append(np.stack([middle - u - v, middle + u - v, middle + u + v, middle - u + v], axis=1))
        quads += len(free)
    if quads > DRAWN:
        return none
    vertices, number = np.unique(np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True)
    number = number.reshape(-1, 4)
    triangles = np.concatenate([number[:, [0, 1, 2]], number[:, [0, 2, 3]]]).astype(np.int64)
    return low + 0.5 * s * vertices, triangles


def _warnings(cloud: Cloud, name: str, own: float, nearest: Floats, thin: int) -> list[str]:
    said = []
    share = float(cloud.trusted.mean())
    if share < 0.25:
        said.append(f"only {share:.0%} of the particles at the surface have a trusted normal: take a finer lattice")
    if cloud.angle_largest > np.radians(60.0):
        said.append(
            f"normals of neighbours differ by up to {np.degrees(cloud.angle_largest):.0f} deg: the surface is rough for its spacing"
        )
    if cloud.inside == 0 and cloud.particles > 64:
        said.append("no particle lies inside: the mass is that of a shell, unless the particles fill the solid")
    if float(np.quantile(nearest, 0.95)) > 1.3 * own:
        said.append("the particles are no regular lattice: its mass, of equal cells, is rough")
    if own < 0.9 * cloud.spacing or own > 1.1 * cloud.spacing:
        said.append(
            f"neighbours are {own:.4g} m apart, the spacing is {cloud.spacing:.4g} m: cells overlap or leave gaps"
        )
    if thin:
        said.append(
            f"{thin} particles are open on opposite sides: a body there is one particle thick, contacts are found at its particles only"
        )
    return [f"cloud {name}: {one}" for one in said]
