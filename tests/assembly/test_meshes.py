"""Surfaces from files: closed ones of bodies, and terrain."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dem_cli.assembly.meshes import check_closed, merged, pieces_of, read_grid, read_mesh, read_terrain
from dem_cli.errors import ScenarioError

BOX = trimesh.creation.box([2.0, 1.0, 0.5])


def saved(folder: Path, mesh: trimesh.Trimesh, name: str = "rock.stl") -> Path:
    mesh.export(folder / name)
    return folder / name


@pytest.mark.parametrize("name", ["rock.stl", "rock.obj", "rock.ply"])
def test_formats_give_the_same_body(tmp_path: Path, name: str) -> None:
    vertices, triangles = read_mesh(saved(tmp_path, BOX, name), "cm")
    assert (vertices.shape, triangles.shape) == ((8, 3), (12, 3))
    check_closed(tmp_path / name, vertices, triangles)
    assert np.ptp(vertices, axis=0) == pytest.approx([0.02, 0.01, 0.005])


def test_vertices_at_one_place_are_one() -> None:
    soup = BOX.vertices[BOX.faces].reshape(-1, 3) + 1e-13
    vertices, triangles = merged(soup, np.arange(36).reshape(-1, 3))
    assert len(vertices) == 8
    assert trimesh.Trimesh(vertices, triangles, process=False).is_watertight


def test_triangles_without_three_corners_are_left_out() -> None:
    vertices, triangles = merged(np.vstack([BOX.vertices, [[9.0, 9.0, 9.0]]]), np.vstack([BOX.faces, [[0, 0, 8]]]))
    assert (len(vertices), len(triangles)) == (8, 12)


def open_box() -> trimesh.Trimesh:
    return trimesh.Trimesh(BOX.vertices, BOX.faces[1:], process=False)


def one_turned() -> trimesh.Trimesh:
    faces = BOX.faces.copy()
    faces[0] = faces[0, ::-1]
    return trimesh.Trimesh(BOX.vertices, faces, process=False)


def fin() -> trimesh.Trimesh:
    return trimesh.Trimesh(
        np.vstack([BOX.vertices, [[0, 0, 9]]]), np.vstack([BOX.faces, [[*BOX.faces[0, :2], 8]]]), process=False
    )


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (open_box(), "is open: 3 edges bound one triangle only, one of them near ("),
        (one_turned(), "its triangles do not all face outwards: at 3 edges neighbours face opposite ways"),
        (trimesh.Trimesh(BOX.vertices, BOX.faces[:, ::-1], process=False), "is inside out: its volume is -1 m^3"),
        (fin(), "is open: 2 edges bound one triangle only"),
    ],
    ids=["open", "turned", "inside out", "fin"],
)
def test_surfaces_of_no_solid(mesh: trimesh.Trimesh, words: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        check_closed(Path("rock.stl"), np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert str(caught.value).startswith(f"rock.stl: {words}")


def test_edges_of_more_than_two_triangles() -> None:
    """Two tetrahedra that share an edge."""
    corners = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0.5], [-1, 0, 0], [0, -1, 0.5]], dtype=float)
    one = np.array([[0, 2, 3], [1, 3, 2], [0, 1, 2], [0, 3, 1]])
    other = np.array([[0, 4, 5], [1, 5, 4], [0, 1, 4], [0, 5, 1]])
    with pytest.raises(
        ScenarioError, match=r"has 1 edges at which more than two triangles meet, one of them near \(0, 0, 0.5\) m"
    ):
        check_closed(Path("rock.stl"), corners, np.vstack([one, other]))


def test_triangles_without_area_are_told() -> None:
    """A tetrahedron with a corner on an edge: one side has it, the other side's triangle is joined to it by one without area."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0]], dtype=float)
    triangles = np.array([[0, 2, 4], [4, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [0, 4, 1]])
    with pytest.raises(ScenarioError, match=r"has 1 triangles without area, one of them near \(0.5, 0, 0\) m"):
        check_closed(Path("rock.stl"), vertices, triangles)


def test_files_that_are_no_mesh(tmp_path: Path) -> None:
    (tmp_path / "rock.stl").write_text("no mesh")
    (tmp_path / "rock.xyz").write_text("no mesh")
    for name in ("rock.stl", "rock.xyz"):
        with pytest.raises(ScenarioError, match=f"{name}: "):
            read_mesh(tmp_path / name, "m")


def test_says_how_to_get_trimesh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ScenarioError, match=r"rock.stl: meshes are read with trimesh.*pip install 'dem-cli\[meshes\]'"):
        read_mesh(Path("rock.stl"), "m")


def test_separate_pieces_are_counted() -> None:
    far = BOX.faces + 8
    assert pieces_of(BOX.faces, 8) == 1
    assert pieces_of(np.vstack([BOX.faces, far]), 16) == 2


# ------------------------------------------------------------------------------------------ terrain


def grid_text(nx: int, ny: int, order: np.ndarray | None = None) -> str:
    rows = [f"{0.1 * i:.17g},{0.3 * j:.17g},{i * i - j}" for i in range(nx) for j in range(ny)]
    return "x,y,z\n" + "\n".join(rows[k] for k in (order if order is not None else range(len(rows)))) + "\n"


def test_grid_looks_upwards_and_holds_its_points(tmp_path: Path) -> None:
    path = tmp_path / "slope.csv"
    path.write_text(grid_text(5, 4, np.random.default_rng(1).permutation(20)))
    terrain, warnings = read_terrain(path, "m", "slope", 3)
    assert (terrain.name, terrain.material, warnings) == ("slope", 3, ())
    assert (terrain.vertices.shape, terrain.triangles.shape) == ((20, 3), (2 * 4 * 3, 3))
    x, y, z = terrain.vertices.T
    assert z == pytest.approx((10.0 * x) ** 2 - y / 0.3)
    a, b, c = (terrain.vertices[terrain.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    assert np.all(normal[:, 2] > 0.0)
    assert np.sum(normal[:, 2]) / 2.0 == pytest.approx(0.4 * 0.9)  # in plan they fill the grid, once
    assert read_terrain(path, "cm", "slope", 0)[0].vertices == pytest.approx(0.01 * terrain.vertices)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            grid_text(4, 3).rsplit("\n", 2)[0] + "\n",
            "is no full grid of 4 x by 3 y: at x = 0.3, y = 0.6 there is no point",
        ),
        (grid_text(4, 3) + "0,0,7\n", "is no full grid of 4 x by 3 y: at x = 0, y = 0 there is 2 points"),
        (
            "x,y,z\n" + "".join(f"{k},{k * k},0\n" for k in range(9)),
            "is no grid: its 9 points have 9 different x and 9 different y",
        ),
        ("x,y,z\n" + "".join(f"{k},1,0\n" for k in range(9)), "all its points have the same y"),
        ("x,y,z\n0,0,0\n", "has 1 points"),
    ],
    ids=["gap", "twice", "scattered", "line", "point"],
)
def test_points_that_are_no_grid(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "slope.csv"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        read_grid(path, "m")
    assert str(caught.value).startswith(f"{path}: {words}")


def test_mesh_as_terrain(tmp_path: Path) -> None:
    """Triangles without area are left out, those that look down turned round; both is told."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0.5], [0.5, 0, 0]], dtype=float)
    mesh = trimesh.Trimesh(vertices, [[0, 2, 1], [0, 3, 2], [0, 4, 1]], process=False)
    terrain, warnings = read_terrain(saved(tmp_path, mesh, "slope.obj"), "m", "slope", 0)
    assert len(terrain.triangles) == 2
    assert warnings == (
        "terrain slope: 1 of 3 triangles have no area and are left out",
        "terrain slope: its triangles look down; they are turned round, bodies are above",
    )
    a, b, c = (terrain.vertices[terrain.triangles[:, k]] for k in range(3))
    assert np.all(np.cross(b - a, c - a)[:, 2] > 0.0)
