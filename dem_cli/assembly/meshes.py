"""Surfaces of triangles from files: closed ones of bodies, and terrain."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dem_cli.assembly.columns import read_columns
from dem_cli.errors import ScenarioError
from dem_cli.rigid import Terrain
from dem_cli.state import Bools, Floats, Ints

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
SAME = 1e-9  # of the extent, within which vertices are one
FLAT = 1e-12  # of the extent squared, an area below which is none
Surface = tuple[Floats, Ints]


def read_mesh(path: Path, unit: str) -> Surface:
    """Vertices (v, 3) [m], each once, and triangles (t, 3) of a file. ScenarioError if it holds none, or trimesh is not there."""
    try:
        import trimesh
    except ImportError:
        remedy = "Install it: pip install 'dem-cli[meshes]'"
        raise ScenarioError(f"{path}: meshes are read with trimesh, which is not installed. {remedy}") from None
    try:
        mesh: Any = trimesh.load(str(path), force="mesh", process=False)
        vertices, triangles = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # whatever a reader of some format may raise
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ScenarioError(f"{path}: cannot be read as a mesh ({reason}). Give an STL, OBJ or PLY file") from None
    if len(triangles) == 0 or not np.isfinite(vertices).all():
        raise ScenarioError(f"{path}: holds no triangles, or numbers that are not finite. Give another mesh")
    return merged(vertices * UNITS[unit], triangles)


def merged(vertices: Floats, triangles: Ints) -> Surface:
    """The surface with vertices at the same place made one, those of no triangle left out, and triangles without three corners, too."""
    step = SAME * float(np.max(np.ptp(vertices, axis=0)))
    if step > 0.0:
        _, first, inverse = np.unique(
            np.rint((vertices - vertices.min(axis=0)) / step).astype(np.int64),
            axis=0,
            return_index=True,
            return_inverse=True,
        )
        vertices, triangles = vertices[first], inverse.reshape(-1)[triangles]
    whole = np.array([len(set(corners)) == 3 for corners in triangles.tolist()], dtype=bool)
    used, renumbered = np.unique(triangles[whole], return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3).astype(np.int64)


def areas(vertices: Floats, triangles: Ints) -> Floats:
    """Area (t,) [m^2] of each triangle."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))


def without_area(vertices: Floats, triangles: Ints) -> Bools:
    """Which triangles (t,) are lines but for rounding."""
    extent = float(np.max(np.ptp(vertices, axis=0))) if len(vertices) else 0.0
    return np.asarray(areas(vertices, triangles) <= FLAT * extent**2)


def check_closed(path: Path, vertices: Floats, triangles: Ints) -> None:
    """ScenarioError, with the number of edges and a place, if a surface is not that of a solid, seen from outside."""
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges, times = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    for wrong, words in (
        (times == 1, "is open: {n} edges bound one triangle only, one of them {place}. Close the surface"),
        (
            times > 2,
            "has {n} edges at which more than two triangles meet, one of them {place}. Give the surface of one solid",
        ),
    ):
        if wrong.any():
            said = words.format(n=int(wrong.sum()), place=_place(vertices[edges[wrong][0]]))
            raise ScenarioError(f"{path}: {said} with a mesh tool, or take another mesh")
    ways, alike = np.unique(directed, axis=0, return_counts=True)
    if (twice := alike > 1).any():
        at = _place(vertices[ways[twice][0]])
        raise ScenarioError(
            f"{path}: its triangles do not all face outwards: at {int(twice.sum())} edges neighbours face opposite ways, one of them {at}. "
            "Let a mesh tool make the normals consistent"
        )
    if (flat := without_area(vertices, triangles)).any():
        at = _place(vertices[triangles[flat][0]])
        raise ScenarioError(
            f"{path}: has {int(flat.sum())} triangles without area, one of them {at}. Repair it with a mesh tool"
        )
    corners = (vertices - vertices.mean(axis=0))[triangles]
    volume = float(np.sum(np.linalg.det(corners)) / 6.0)
    if volume <= 0.0:
        raise ScenarioError(
            f"{path}: is inside out: its volume is {volume:.4g} m^3. Turn its normals round with a mesh tool"
        )


def _place(points: Floats) -> str:
    return "near ({:.4g}, {:.4g}, {:.4g}) m".format(*points.mean(axis=0))


def pieces_of(triangles: Ints, count: int) -> int:
    """How many separate pieces a surface has, by its vertices."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    links = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    return int(connected_components(graph, directed=False)[0])


def read_terrain(path: Path, unit: str, name: str, material: int) -> tuple[Terrain, tuple[str, ...]]:
    """The surface of a mesh or CSV grid, looking upwards, and what there is to tell of it. ScenarioError if the file is none."""
    warnings = []
    grid = path.suffix.lower() in (".csv", ".txt", ".xyz")
    vertices, triangles = read_grid(path, unit) if grid else read_mesh(path, unit)
    flat = without_area(vertices, triangles)
    if flat.any():
        warnings.append(f"terrain {name}: {int(flat.sum())} of {len(flat)} triangles have no area and are left out")
        triangles = triangles[~flat]
    if not len(triangles):
        raise ScenarioError(f"{path}: has no triangle with an area. Give another surface")
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    if float(np.sum(np.cross(b - a, c - a)[:, 2])) < 0.0:
        warnings.append(f"terrain {name}: its triangles look down; they are turned round, bodies are above")
        triangles = triangles[:, ::-1].copy()
    return Terrain(name, vertices, triangles, material), tuple(warnings)


def read_grid(path: Path, unit: str) -> Surface:
    """Vertices and triangles, seen from above, of a full grid of points x,y,z, in any order."""
    columns = read_columns(path, ("x", "y", "z"))
    x, y, z = (columns[name] * UNITS[unit] for name in "xyz")
    if len(x) < 4:
        raise ScenarioError(f"{path}: has {len(x)} points. A grid has two by two or more")
    numbers, many = [], []
    for name, values in (("x", x), ("y", y)):
        step = SAME * float(np.ptp(values))
        if not step > 0.0:
            raise ScenarioError(f"{path}: all its points have the same {name}. Give a grid")
        levels, number = np.unique(np.rint((values - values.min()) / step), return_inverse=True)
        numbers.append(number.reshape(-1))
        many.append(len(levels))
    if many[0] * many[1] > 4 * len(x):
        raise ScenarioError(
            f"{path}: is no grid: its {len(x)} points have {many[0]} different x and {many[1]} different y. Give one height for each x and y"
        )
    place = numbers[0] * many[1] + numbers[1]
    taken = np.bincount(place, minlength=many[0] * many[1])
    if (wrong := np.flatnonzero(taken != 1)).size:
        i, j = divmod(int(wrong[0]), many[1])
        at = f"x = {x[numbers[0] == i][0] / UNITS[unit]:g}, y = {y[numbers[1] == j][0] / UNITS[unit]:g}"
        said = "no point" if taken[wrong[0]] == 0 else f"{int(taken[wrong[0]])} points"
        raise ScenarioError(
            f"{path}: is no full grid of {many[0]} x by {many[1]} y: at {at} there is {said}. Give one height for each x and y"
        )
    order = np.argsort(place)
    vertices = np.stack([x, y, z], axis=1)[order]
    cells = np.meshgrid(np.arange(many[0] - 1), np.arange(many[1] - 1), indexing="ij")
    a = (cells[0] * many[1] + cells[1]).ravel()
    b, c, d = a + many[1], a + many[1] + 1, a + 1
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return vertices, triangles.astype(np.int64)
