"""Scenes of the impulse engine: bodies where and as the scenario has them, planes, pairs of materials, packings, limits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from impulse_file import write_result_file
from impulse_text import BOX, CLUMP, PLACED, drop, pour
from scenario_text import ABSENT

from dem_cli.assembly import build_scene
from dem_cli.assembly.solids import turn
from dem_cli.errors import ScenarioError
from dem_cli.rigid import Scene, rotation
from dem_cli.scenario import ImpulseScenario, ImpulseSettle, parse_scenario
from dem_cli.state import Floats


def scene(text: str, folder: Path | str = ".", *overrides: str) -> Scene:
    scenario = parse_scenario(text, folder=folder, overrides=overrides)
    assert isinstance(scenario, ImpulseScenario)
    return build_scene(scenario)


def reach(found: Scene) -> Floats:
    return np.array([shape.reach for shape in found.shapes])[found.bodies.shape] * found.bodies.scale


def least_gap(found: Scene) -> float:
    """Between bounding spheres."""
    x, r = found.bodies.x, reach(found)
    gap = np.linalg.norm(x[:, None] - x[None], axis=2) - r[:, None] - r[None]
    return float(np.min(gap + np.diag(np.full(len(x), np.inf))))


# ------------------------------------------------------------------------------------------ bodies


def test_box() -> None:
    found = scene(drop({"grains.face_points": 3}))
    (shape,) = found.shapes
    assert (shape.name, shape.kind, len(shape.vertices), len(shape.triangles), len(shape.points)) == (
        "box",
        "polyhedron",
        8,
        12,
        54,
    )
    assert (shape.mass, shape.volume, shape.reach) == pytest.approx((8000.0, 4.0, 1.5))
    assert shape.inertia == pytest.approx(8000.0 / 12.0 * np.array([5.0, 8.0, 5.0]))
    mesh = trimesh.Trimesh(shape.vertices, shape.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4.0)
    half = np.array([1.0, 0.5, 1.0])
    on = np.abs(np.abs(shape.points) - half) < 1e-12
    assert np.all(on.sum(axis=1) == 1)  # each within one face
    assert np.array_equal(shape.normals, np.sign(shape.points) * on)
    line = np.unique(np.round(shape.points[on[:, 0]][:, 2], 12))
    assert line == pytest.approx([-2 / 3, 0.0, 2 / 3])  # regular, half a spacing off the edges
    bodies = found.bodies
    assert bodies.x.tolist() == [[0.0, 0.0, 1.6]]
    assert bodies.q.tolist() == [[1.0, 0.0, 0.0, 0.0]]
    assert (bodies.mass.tolist(), bodies.inertia.tolist()) == ([shape.mass], [shape.inertia.tolist()])


def test_rows_scales_and_speeds() -> None:
    given = {
        "count": 3,
        "step": ["0 m", "0 m", "5 m"],
        "velocity": ["1 m/s", "0 m/s", "0 m/s"],
        "spin": ["0 rad/s", "2 rad/s", "0 rad/s"],
    }
    found = scene(drop({"grains": BOX | PLACED | given | {"scale": {"list": [1, 2, 0.5]}}}))
    bodies = found.bodies
    assert bodies.x == pytest.approx(np.array([[0, 0, 1.6], [0, 0, 6.6], [0, 0, 11.6]]))
    assert bodies.v.tolist() == [[1.0, 0.0, 0.0]] * 3
    assert bodies.w.tolist() == [[0.0, 2.0, 0.0]] * 3
    assert bodies.mass == pytest.approx(8000.0 * np.array([1.0, 8.0, 0.125]))
    assert bodies.inertia == pytest.approx(found.shapes[0].inertia * np.array([[1.0], [32.0], [1 / 32]]))
    assert bodies.id.tolist() == [0, 1, 2]
    assert not bodies.escaped.any()


def test_orientation_is_that_of_the_users_frame() -> None:
    """A clump whose principal axes are not those of its template: its spheres stand where the template, turned, has them."""
    template = [[0, 0, 0, 1], [1.5, 0.2, 0.1, 0.6], [0.2, 1.1, 0.7, 0.5]]
    given = {"template": template, "radius": "2 m", "scale": 0.5, "position": ["1 m", "2 m", "30 m"]}
    turned = {"axis": [1, 2, -1], "angle": "77 deg"}
    found = scene(drop({"grains": CLUMP | given | {"orientation": turned}}))
    plain = scene(drop({"grains": CLUMP | given}))
    (shape,), bodies = found.shapes, found.bodies
    spheres = bodies.x + bodies.scale * turn(bodies.q[0], shape.centers)
    away = (
        np.array(template)[:, :3]
        @ rotation(np.array([np.cos(np.radians(38.5)), *(np.sin(np.radians(38.5)) * np.array([1, 2, -1]) / 6**0.5)]))[
            0
        ].T
    )
    assert spheres - spheres[0] == pytest.approx(away - away[0], abs=1e-12)
    spheres = plain.bodies.scale * turn(plain.bodies.q[0], plain.shapes[0].centers)
    assert spheres - spheres[0] == pytest.approx(np.array(template)[:, :3], abs=1e-12)
    assert shape.radii == pytest.approx([2.0, 1.2, 1.0])
    assert shape.reach == pytest.approx(np.max(np.linalg.norm(shape.centers, axis=1) + shape.radii))


def test_tetrahedron_of_spheres() -> None:
    """Four that touch: their mass, and m r^2 (2/5 + ...) by the parallel axes: all axes alike."""
    found = scene(
        drop({"grains": CLUMP | {"radius": "1 m", "density": "1000 kg/m^3", "position": ["0 m", "0 m", "9 m"]}})
    )
    (shape,) = found.shapes
    one = 1000.0 * 4.0 / 3.0 * np.pi
    assert shape.mass == pytest.approx(4.0 * one)
    # centres at the corners of a tetrahedron of edge 2: 3/2 from the centre squared, two thirds of it off any axis
    assert shape.inertia == pytest.approx(np.full(3, 4.0 * one * (0.4 + 1.0)))
    assert shape.reach == pytest.approx(1.0 + np.sqrt(1.5))
    apart = np.linalg.norm(shape.centers[:, None] - shape.centers[None], axis=2)
    assert np.sort(apart.ravel())[4:] == pytest.approx(np.full(12, 2.0))


@pytest.mark.parametrize("template", ["pair", "triangle", "tetrahedron", "cube"])
def test_spheres_of_templates_touch(template: str) -> None:
    shape = scene(
        drop({"grains": CLUMP | {"template": template, "radius": "1 m", "position": ["0 m", "0 m", "9 m"]}})
    ).shapes[0]
    apart = np.linalg.norm(shape.centers[:, None] - shape.centers[None], axis=2) + 9.0 * np.eye(len(shape.radii))
    assert apart.min(axis=1) == pytest.approx(np.full(len(shape.radii), 2.0))
    assert shape.centers.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_radii_are_drawn() -> None:
    radius = {"classes": [{"radius": "1 cm", "count": 2}, {"radius": "3 cm", "count": 4}]}
    found = scene(pour({"grains": {"shape": "sphere", "radius": radius, "density": "1000 kg/m^3"}}))
    assert sorted(reach(found)) == pytest.approx([0.01, 0.01, 0.03, 0.03, 0.03, 0.03])
    assert sorted(found.bodies.mass) == pytest.approx(sorted(1000.0 * 4.0 / 3.0 * np.pi * reach(found) ** 3))


def test_mesh_and_cloud_of_one_box_are_alike(tmp_path: Path) -> None:
    """The same box as a surface askew, and as cells: mass, moments and size are those of the box."""
    size = np.array([0.6, 0.5, 0.4])
    mesh = trimesh.creation.box(size)
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(np.array([0.2, 0.6, 0.9])))
    mesh.export(tmp_path / "box.obj")
    cells = np.stack(np.meshgrid(*(np.arange(n) for n in (6, 5, 4)), indexing="ij"), axis=-1).reshape(-1, 3)
    np.savetxt(tmp_path / "box.csv", cells, delimiter=",", header="x,y,z", comments="")
    common: dict[str, Any] = {"density": "1000 kg/m^3", "position": ["0 m", "0 m", "1 m"]}
    found = scene(
        drop({"grains": [
            {"shape": "mesh", "file": "box.obj"} | common,
            {"shape": "cloud", "file": "box.csv", "file_unit": "cm", "scale": 10.0} | common,
        ]}),
        tmp_path,
    )  # fmt: skip
    surface, cloud = found.shapes
    exact = np.sort(120.0 / 12.0 * (np.sum(size**2) - size**2))
    assert np.sort(found.bodies.inertia, axis=1) == pytest.approx(np.tile(exact, (2, 1)), rel=1e-6)
    assert found.bodies.mass == pytest.approx([120.0, 120.0], rel=1e-6)
    assert reach(found) == pytest.approx(np.full(2, 0.5 * np.linalg.norm(size)), rel=1e-6)
    assert (surface.kind, cloud.kind, cloud.spacing) == ("polyhedron", "cloud", pytest.approx(0.01))
    # the mesh stands in the scene as it does in its file
    stands = turn(found.bodies.q[0], surface.vertices)
    nearest = np.linalg.norm(stands[:, None] - np.asarray(mesh.vertices)[None], axis=2).min(axis=1)
    assert nearest == pytest.approx(np.zeros(8), abs=1e-6)


# ------------------------------------------------------------------------------------------ what does not move


def test_walls_of_a_container() -> None:
    found = scene(pour({"container": {"width": "1 m", "breadth": "2 m", "height": "3 m", "lid": True}}))
    planes = found.planes
    assert planes.name == ("left", "right", "front", "back", "bottom", "top")
    middle = np.array([0.5, 1.0, 1.5])
    assert np.einsum("wi,wi->w", middle - planes.point, planes.normal) == pytest.approx([0.5, 0.5, 1.0, 1.0, 1.5, 1.5])
    for edge, point, normal in zip(planes.edge, planes.point, planes.normal, strict=True):
        assert (edge - point) @ normal == pytest.approx(np.zeros(4))
        around = np.cross(edge[1] - edge[0], edge[2] - edge[1])
        assert around / np.linalg.norm(around) == pytest.approx(normal)  # anticlockwise seen from the bodies
    assert np.all(found.low < 0.0)
    assert np.all(found.low > -0.01)
    assert found.high == pytest.approx([1.0, 2.0, 3.0], abs=0.01)
    assert "top" not in scene(pour()).planes.name
    assert scene(pour()).high[2] > 1000.0


@pytest.mark.parametrize(
    "plane", [{"slope": "30 deg"}, {"slope": "30 deg", "heading": "100 deg"}, {"normal": [-1, 0.2, 0.1]}, {}], ids=str
)
def test_pieces_of_planes_are_below_the_bodies(plane: dict[str, Any]) -> None:
    found = scene(drop({"plane": [plane | {"point": ["0 m", "0 m", "-3 m"]}]}))
    (edge,), (point,), (normal,) = found.planes.edge, found.planes.point, found.planes.normal
    assert (edge - point) @ normal == pytest.approx(np.zeros(4), abs=1e-12)
    foot = found.bodies.x[0] - ((found.bodies.x[0] - point) @ normal) * normal
    for k in range(4):  # inside all four sides, counted anticlockwise
        assert np.cross(edge[(k + 1) % 4] - edge[k], foot - edge[k]) @ normal > 0.0


def test_pairs_of_materials() -> None:
    found = scene(
        pour(
            {
                "contact.pairs": [
                    {"between": ["wall", "clump"], "friction": 0.1},
                    {"between": ["box", "box"], "restitution": 0.9},
                ]
            }
        )
    )
    assert found.materials == ("clump", "box", "wall")
    assert found.friction.tolist() == [[0.5, 0.5, 0.1], [0.5, 0.5, 0.5], [0.1, 0.5, 0.5]]
    assert found.restitution.tolist() == [[0.3, 0.3, 0.3], [0.3, 0.9, 0.3], [0.3, 0.3, 0.3]]
    assert set(found.bodies.material[found.bodies.group == 0]) == {0}
    assert set(found.planes.material) == {2}


def test_bodies_that_run_out_over_the_terrain_have_escaped(tmp_path: Path) -> None:
    (tmp_path / "slope.csv").write_text("x,y,z\n" + "".join(f"{x},{y},{-x}\n" for x in (0, 10) for y in (0, 5)))
    found = scene(drop({"terrain": {"file": "slope.csv"}, "plane": []}), tmp_path)
    assert found.terrain is not None
    assert found.materials == ("box", "terrain")
    assert found.terrain.material == 1
    assert -12.0 < found.low[2] < -10.0  # below its lowest point, by a tenth of its extent
    assert found.high[0] > 1000.0


def test_bodies_outside_of_the_container_are_refused() -> None:
    with pytest.raises(
        ScenarioError,
        match=r"^scenario: \[grains\] position: body 20 starts at \(0.5, 2, 0.1\) m, outside of what encloses the scene",
    ):
        scene(pour({"grains.1.position": ["0.5 m", "2 m", "0.1 m"]}))


# ------------------------------------------------------------------------------------------ packings


@pytest.mark.parametrize("method", ["grid", "rejection"])
@pytest.mark.parametrize(
    "region", [None, {"from": ["0.1 m", "0.2 m", "1 m"], "to": ["0.9 m", "0.8 m", "3 m"]}], ids=["container", "region"]
)
def test_packed_bodies_are_apart_and_inside(method: str, region: dict[str, Any] | None) -> None:
    found = scene(pour({"packing": {"method": method, "gap": "5 mm"} | ({"region": region} if region else {})}))
    packed = found.bodies.group == 0
    low, high = ([0.1, 0.2, 1.0], [0.9, 0.8, 3.0]) if region else ([0.0, 0.0, 0.0], [1.0, 1.0, np.inf])
    x, r = found.bodies.x[packed], reach(found)[packed, None]
    assert np.all(x - r >= np.array(low) - 1e-12)
    assert np.all(x + r <= np.array(high) + 1e-12)
    assert least_gap(found) >= 0.005 - 1e-12
    assert found.bodies.x[~packed].tolist() == [[0.5, 0.5, 0.1]]


def test_packed_bodies_are_turned_at_random_unless_said() -> None:
    q = scene(pour()).bodies.q
    assert len(np.unique(np.round(q[:20], 6), axis=0)) == 20
    same = scene(pour({"grains.0.orientation": {"quaternion": [1, 0, 0, 0]}})).bodies.q[:20]
    assert len(np.unique(same, axis=0)) == 1


def test_the_seed_decides() -> None:
    for method in ("grid", "rejection"):
        text = pour({"packing": {"method": method}, "grains.0.scale": {"uniform": [0.5, 1.0]}})
        one, again, other = scene(text), scene(text), scene(text, ".", "seed=4")
        for name in ("x", "q", "scale", "mass"):
            assert np.array_equal(getattr(one.bodies, name), getattr(again.bodies, name))
        assert not np.array_equal(one.bodies.q, other.bodies.q)


@pytest.mark.parametrize("method", ["grid", "rejection"])
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"container.height": "40 cm", "grains.0.count": 200}, "find a place"),
        ({"grains.0.radius": "30 cm"}, "the region is smaller along x"),
    ],
    ids=["low", "large"],
)
def test_bodies_that_do_not_fit(method: str, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(
        ScenarioError, match=rf"^scenario: \[packing\] method = {method}: the bodies do not fit: .*{words}"
    ):
        scene(
            pour(
                {
                    "packing": {"method": method},
                    "grains.1": BOX | {"position": ["0.5 m", "0.5 m", "0.1 m"], "size": "1 cm"},
                }
                | changes
            )
        )


def test_listener_is_told_and_may_interrupt() -> None:
    told: list[str] = []
    scenario = parse_scenario(pour({"packing": {"method": "rejection"}}))
    assert isinstance(scenario, ImpulseScenario)
    build_scene(scenario, told.append)
    assert told[0] == "rejection: 0 of 20 bodies placed"

    def stop(_: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_scene(scenario, stop)


# ------------------------------------------------------------------------------------------ bodies of a result file

FROM_FILE: dict[str, Any] = {"packing": {"method": "file", "file": "pile.h5"}, "grains": ABSENT}


def test_bodies_of_a_file(tmp_path: Path) -> None:
    write_result_file(tmp_path / "pile.h5")
    found = scene(pour(FROM_FILE), tmp_path)
    bodies = found.bodies
    assert (found.groups, found.materials) == (("ball",), ("rubber", "steel", "wall"))
    assert bodies.x.tolist() == [[0.3, 0.5, 0.2], [0.6, 0.5, 0.2]]
    assert bodies.v.tolist() == [[9.0, 10.0, 11.0], [12.0, 13.0, 14.0]]
    assert bodies.w.tolist() == [[-9.0, -10.0, -11.0], [-12.0, -13.0, -14.0]]
    assert bodies.q.tolist() == [[0.6, 0.8, 0.0, 0.0]] * 2
    assert (bodies.scale.tolist(), bodies.mass.tolist(), bodies.material.tolist()) == ([1.0, 0.5], [4.0, 0.5], [0, 1])
    assert (found.shapes[0].kind, found.shapes[0].reach, found.shapes[0].radii.tolist()) == ("spheres", 0.1, [0.1])


def test_bodies_of_a_file_at_the_end_of_a_stage(tmp_path: Path) -> None:
    write_result_file(tmp_path / "pile.h5")
    changes = {**FROM_FILE, "packing": {"method": "file", "file": "pile.h5", "stage": "first"}}
    assert scene(pour(changes), tmp_path).bodies.x[:, 2].tolist() == [1.2, 1.2]
    changes["packing"]["stage"] = "third"
    with pytest.raises(
        ScenarioError,
        match=r'\[packing\] file = "pile.h5": no stage "third" has ended there. Its stages are first, second',
    ):
        scene(pour(changes), tmp_path)


def test_bodies_may_be_added_to_those_of_a_file(tmp_path: Path) -> None:
    write_result_file(tmp_path / "pile.h5", escaped=(1, 0))
    block = BOX | {"size": "10 cm", "position": ["0.5 m", "0.5 m", "0.9 m"], "material": "steel"}
    text = pour(
        FROM_FILE
        | {
            "grains": [block],
            "output.tracks": {"grains": [1]},
            "contact.pairs": [{"between": ["steel", "wall"], "friction": 1}],
        }
    )
    found = scene(text, tmp_path)
    assert found.groups == ("ball", "box")
    assert found.materials == ("steel", "wall")
    assert found.bodies.group.tolist() == [0, 1]
    assert found.bodies.shape.tolist() == [0, 1]
    assert found.bodies.id.tolist() == [0, 1]
    assert found.bodies.material.tolist() == [0, 0]
    assert found.bodies.x.tolist() == [[0.6, 0.5, 0.2], [0.5, 0.5, 0.9]]
    assert parse_scenario(text, folder=tmp_path).grain_count == 2  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("made", "changes", "line"),
    [
        (
            {"engine": "explicit"},
            {},
            '[packing] file = "pile.h5": holds grains of engine = "explicit", which lie in a plane',
        ),
        ({"frames": 0}, {}, '[packing] file = "pile.h5": holds no frame yet'),
        ({"escaped": (1, 1)}, {}, '[packing] file = "pile.h5": all its bodies have left the scene'),
        (
            {},
            {"grains": BOX | PLACED | {"name": "ball"}},
            '[grains] name = "ball": is the name of a kind of bodies of packing.file',
        ),
        (
            {},
            {"output.tracks": {"grains": [2]}},
            "[output] tracks.grains = [2]: names grain 2, but there are only 2 ids",
        ),
        (
            {},
            {"contact.pairs": [{"between": ["rubber", "stel"], "friction": 1}]},
            '[contact] pairs.between (1st value, 2nd value) = "stel": is no material here. Did you mean "steel"?',
        ),
        ({}, {"output.check": "row"}, '[output] check = "row": is of three bodies or more'),
    ],
    ids=str,
)
def test_mistakes_of_a_file(tmp_path: Path, made: dict[str, Any], changes: dict[str, Any], line: str) -> None:
    write_result_file(tmp_path / "pile.h5", **made)
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(pour(FROM_FILE | changes), origin="a.toml", folder=tmp_path)
    assert str(caught.value).startswith(f"a.toml: {line}")
    assert "\n" not in str(caught.value)


def test_file_that_is_no_result_file(tmp_path: Path) -> None:
    (tmp_path / "pile.h5").write_text("no")
    with pytest.raises(ScenarioError, match="is not a result file of dem run"):
        parse_scenario(pour(FROM_FILE), folder=tmp_path)


def test_stages_are_those_of_the_engine() -> None:
    assert isinstance(parse_scenario(pour()).stages[0], ImpulseSettle)
