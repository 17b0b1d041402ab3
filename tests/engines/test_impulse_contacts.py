"""Contact points of boxes, spheres, meshes and clouds: flat stacks, closed forms, and the separating axis theorem as reference."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from contact_samples import (
    about,
    ball,
    box,
    box_mesh,
    cloud_box,
    clump,
    contacts,
    corners_of,
    mesh,
    product,
    random_turn,
    round_stone,
    scene,
    subdivided,
)

from dem_cli.engines.impulse.detect import Touching
from dem_cli.rigid import Scene, Shape, rotation
from dem_cli.state import Floats

UP = np.array([0.0, 0.0, 1.0])
FLOOR = [([0.0, 0.0, 0.0], UP)]


def stack(shift: Sequence[float], turn: float, gap: float, shape: Shape | None = None) -> Scene:
    """A box of edge 1 on another, moved and turned about the vertical."""
    return scene([shape or box()], [[0, 0, 0], [*shift, 1.0 + gap]], q=[about(UP, 0.0), about(UP, turn)])


# --- flat on flat


@pytest.mark.parametrize("gap", [1e-9, 0.0, -1e-6, -1e-4])
@pytest.mark.parametrize(
    ("shift", "turn", "points"),
    [
        ((0.0, 0.0), 0.0, 4), ((0.3, 0.0), 0.0, 4), ((0.3, 0.2), 0.0, 4), ((1e-5, 1e-5), 0.0, 4), ((1e-7, 2e-7), 0.0, 4),
        ((0.0, 0.0), np.pi / 2, 4), ((0.0, 0.0), 1e-7, 4), ((0.0, 0.0), 1e-4, 4), ((0.0, 0.0), 0.3, 8),
        ((0.0, 0.0), np.pi / 4, 8), ((0.3, 0.2), 0.5, 5), ((0.999, 0.0), 0.0, 4),
    ],
)  # fmt: skip
def test_flat_on_flat(shift: tuple[float, float], turn: float, points: int, gap: float) -> None:
    """The corners of the area that both faces share, each once, with the vertical as the normal."""
    found = contacts(stack(shift, turn, gap))
    assert len(found.gap) == points
    np.testing.assert_allclose(found.gap, gap, atol=1e-12)
    np.testing.assert_allclose(found.normal, np.tile(UP, (points, 1)), atol=1e-9)
    np.testing.assert_allclose(found.point[:, 2], 0.5 + gap / 2, atol=1e-12)
    # the force may act anywhere in the area, so the points surround its middle
    middle = found.point.mean(axis=0)
    for corner in found.point:
        assert np.min((found.point - middle) @ (corner - middle)) < 0.0


@pytest.mark.parametrize("gap", [1e-9, -1e-6])
def test_flat_on_flat_in_any_attitude(gap: float) -> None:
    random = np.random.default_rng(5)
    for _ in range(20):
        q = random_turn(random)
        given = scene([box()], [[0, 0, 0], rotation(q)[0] @ [0.3, 0.2, 1.0 + gap]], q=[q, q])
        found = contacts(given)
        assert len(found.gap) == 4
        np.testing.assert_allclose(found.gap, gap, atol=1e-12)
        np.testing.assert_allclose(found.normal @ rotation(q)[0], np.tile(UP, (4, 1)), atol=1e-9)


@pytest.mark.parametrize("gap", [1e-9, -1e-6])
def test_row_on_the_floor(gap: float) -> None:
    """Boxes face to face whose tops, sides and bottoms lie in common planes push along the row only, and the floor upwards only."""
    x = [[k * (1.0 + gap), 0.0, 0.5 - 1e-7] for k in range(5)]
    found = contacts(scene([box()], x, planes=FLOOR))
    between, below = found.j >= 0, found.j < 0
    assert between.sum() == 4 * 4
    np.testing.assert_allclose(np.abs(found.normal[between, 0]), 1.0, atol=1e-9)
    assert below.sum() == 5 * 4
    np.testing.assert_allclose(found.normal[below], np.tile(-UP, (20, 1)), atol=1e-12)


def test_wall_of_bricks() -> None:
    """A brick over two others in a row touches both from above, and neither from the side."""
    x = [[0, 0, 0], [2, 0, 0], [1, 0, 1 - 1e-6]]
    found = contacts(scene([box([2.0, 1.0, 1.0])], x))
    pairs = {pair: np.flatnonzero((found.i == pair[0]) & (found.j == pair[1])) for pair in [(0, 1), (0, 2), (1, 2)]}
    assert [len(rows) for rows in pairs.values()] == [4, 4, 4]
    np.testing.assert_allclose(np.abs(found.normal[pairs[0, 1]] @ [1, 0, 0]), 1.0, atol=1e-9)
    for pair in [(0, 2), (1, 2)]:
        np.testing.assert_allclose(found.normal[pairs[pair]] @ UP, 1.0, atol=1e-9)


def test_face_points_carry_what_corners_do_not() -> None:
    """A small box in the middle of a large one, k x k points on each face: its corners and points, and the one of the large below."""
    small, large = box([1.0, 1.0, 1.0], 3), box([4.0, 4.0, 1.0], 4)
    found = contacts(scene([large, small], [[0, 0, 0], [0.1, 0.05, 1.0]]))
    assert len(found.gap) == 4 + 9 + 1
    np.testing.assert_allclose(found.normal, np.tile(UP, (14, 1)), atol=1e-12)


# --- closed forms


def test_corner_on_face() -> None:
    q = about(np.cross([1.0, 1.0, 1.0], -UP), np.arccos(-1.0 / np.sqrt(3.0)))  # (1, 1, 1) turned down
    height = 0.5 + np.sqrt(3.0) / 2.0
    found = contacts(
        scene([box([3.0, 3.0, 1.0]), box()], [[0, 0, 0], [0.2, 0.1, height - 1e-3]], q=[about(UP, 0.0), q])
    )
    np.testing.assert_allclose(found.gap, [-1e-3], atol=1e-12)
    np.testing.assert_allclose(found.normal, [UP], atol=1e-12)
    np.testing.assert_allclose(found.point, [[0.2, 0.1, 0.5 - 5e-4]], atol=1e-9)


def test_edge_on_face() -> None:
    q = about([0.0, 1.0, 0.0], np.pi / 4)
    found = contacts(
        scene([box([3.0, 3.0, 1.0]), box()], [[0, 0, 0], [0, 0, 0.5 + np.sqrt(0.5) - 1e-3]], q=[about(UP, 0.0), q])
    )
    np.testing.assert_allclose(found.gap, [-1e-3, -1e-3], atol=1e-12)
    np.testing.assert_allclose(np.sort(found.point[:, 1]), [-0.5, 0.5], atol=1e-12)


@pytest.mark.parametrize("gap", [5e-7, -1e-3])
def test_edge_across_edge(gap: float) -> None:
    lower, upper = about([1.0, 0.0, 0.0], np.pi / 4), about([0.0, 1.0, 0.0], np.pi / 4)
    found = contacts(scene([box()], [[0, 0, 0], [0.1, 0.2, 2 * np.sqrt(0.5) + gap]], q=[lower, upper]))
    np.testing.assert_allclose(found.gap, [gap], atol=1e-12)
    np.testing.assert_allclose(found.normal, [UP], atol=1e-12)
    np.testing.assert_allclose(found.point, [[0.1, 0.0, np.sqrt(0.5) + gap / 2]], atol=1e-9)


@pytest.mark.parametrize("shift", [(1.001, 0.0, 0.0), (1.001, 0.3, 0.2), (1.0, 1.001, 0.0), (1.001, 1.001, 1.001)])
def test_beside_is_no_contact(shift: tuple[float, float, float]) -> None:
    assert len(contacts(scene([box()], [[0, 0, 0], shift])).gap) == 0


def test_spheres() -> None:
    found = contacts(scene([ball(0.5)], [[0, 0, 0], [0.6, 0.0, 0.8 - 1e-3]], scale=[1.0, 1.0]))
    way = np.array([0.6, 0.0, 0.799])
    distance = np.linalg.norm(way)
    np.testing.assert_allclose(found.gap, [distance - 1.0], atol=1e-15)
    np.testing.assert_allclose(found.normal, [way / distance], atol=1e-15)
    np.testing.assert_allclose(found.point, [way / 2], atol=1e-15)


def test_clump_on_plane_and_scale() -> None:
    pair = clump([[-0.5, 0, 0], [0.5, 0, 0]], [0.5, 0.4])
    q = about([0.0, 1.0, 0.0], -np.pi / 2)  # its x axis up
    found = contacts(scene([pair], [[0, 0, 2.0 - 1e-3]], q=[q], scale=[2.0], planes=FLOOR))
    np.testing.assert_allclose(found.gap, [-1e-3], atol=1e-12)
    np.testing.assert_allclose(found.normal, [-UP], atol=1e-12)
    np.testing.assert_allclose(found.point, [[0, 0, -5e-4]], atol=1e-12)
    assert found.j.tolist() == [-1]


@pytest.mark.parametrize(
    ("place", "direction"),
    [
        ((0.2, 0.1, 0.5), (0, 0, 1)), ((0.0, 0.0, 0.5), (0, 0, 1)), ((0.5, 0.2, 0.5), (1, 0, 1)), ((0.5, 0.2, 0.5), (1, 0, 3)),
        ((0.5, 0.5, 0.5), (1, 1, 1)), ((0.5, -0.5, 0.5), (2, -1, 3)), ((0.5, 0.5, 0.1), (1, 2, 0)),
    ],
)  # fmt: skip
@pytest.mark.parametrize("gap", [5e-7, -1e-2])
def test_sphere_on_box(place: Sequence[float], direction: Sequence[float], gap: float) -> None:
    """One contact, at the face, edge or corner that is nearest, from either order of the bodies."""
    n = np.array(direction) / np.linalg.norm(direction)
    center = np.array(place) + (0.3 + gap) * n
    found = contacts(scene([box(), ball(0.3)], [[0, 0, 0], center]))
    np.testing.assert_allclose(found.gap, [gap], atol=1e-12)
    np.testing.assert_allclose(found.normal, [n], atol=1e-9)
    np.testing.assert_allclose(found.point, [place + gap / 2 * n], atol=1e-12)
    back = contacts(scene([ball(0.3), box()], [center, [0, 0, 0]]))
    np.testing.assert_allclose(back.normal, [-n], atol=1e-9)
    np.testing.assert_allclose(back.point, found.point, atol=1e-12)


def test_sphere_with_its_centre_in_a_box() -> None:
    found = contacts(scene([box(), ball(0.3)], [[0, 0, 0], [0.1, 0.2, 0.4]]))
    np.testing.assert_allclose(found.gap, [-0.4], atol=1e-12)
    np.testing.assert_allclose(found.normal, [UP], atol=1e-12)


def test_sphere_in_a_thin_plate() -> None:
    """Deeper than the plate is thick, with its centre outside: pushed out the way it came, not through."""
    found = contacts(scene([box([3.0, 3.0, 0.01]), ball()], [[0, 0, 0], [0.1, 0.2, 0.485]]))
    np.testing.assert_allclose(found.gap, [-0.02], atol=1e-12)
    np.testing.assert_allclose(found.normal, [UP], atol=1e-12)


def test_box_on_slope() -> None:
    """Four corners at equal depth on a plane; the normal points into the wall."""
    angle = np.pi / 6
    n = np.array([np.sin(angle), 0.0, np.cos(angle)])
    q = about([0.0, 1.0, 0.0], angle)
    found = contacts(scene([box([2.0, 1.0, 1.0], 2)], [0.499 * n], q=[q], planes=[([0, 0, 0], n), ([0, 0, -9], UP)]))
    assert found.j.tolist() == [-1] * 8  # 4 corners, 2 x 2 face points
    np.testing.assert_allclose(found.gap, -1e-3, atol=1e-12)
    np.testing.assert_allclose(found.normal, np.tile(-n, (8, 1)), atol=1e-12)


# --- the separating axis theorem


def separating_axes(a: Floats, b: Floats, turns: tuple[Floats, Floats]) -> tuple[float, Floats, Floats]:
    """Corners (8, 3) of two boxes: least overlap over all 15 axes (negative if apart), unit axis from a to b, and overlaps of all axes."""
    axes = [*turns[0].T, *turns[1].T, *(np.cross(u, v) for u, v in itertools.product(turns[0].T, turns[1].T))]
    best, normal, overlaps = np.inf, UP, []
    for axis in axes:
        if np.linalg.norm(axis) < 1e-6:
            continue
        n = axis / np.linalg.norm(axis)
        for way in (n, -n):
            overlap = (a @ way).max() - (b @ way).min()
            overlaps.append(overlap)
            if overlap < best:
                best, normal = overlap, way
    return best, normal, np.array(overlaps)


def touching_boxes(random: np.random.Generator, depth: float) -> tuple[Scene, float, Floats]:
    """Two boxes of random sizes and attitudes, moved along the axis of least overlap until that is `depth`."""
    shapes = [box(random.uniform(0.5, 1.5, 3)), box(random.uniform(0.5, 1.5, 3))]
    q = np.array([random_turn(random), random_turn(random)])
    x = np.array([np.zeros(3), random.normal(size=3)])
    x[1] *= random.uniform(0.5, 1.2) / np.linalg.norm(x[1])
    for _ in range(4):
        given = scene(shapes, x, q=q)
        turns = rotation(q)
        overlap, n, _ = separating_axes(corners_of(given, 0), corners_of(given, 1), (turns[0], turns[1]))
        x[1] += (overlap - depth) * n
    given = scene(shapes, x, q=q)
    overlap, n, _ = separating_axes(corners_of(given, 0), corners_of(given, 1), (turns[0], turns[1]))
    return given, overlap, n


def overlap_along(given: Scene, n: Floats) -> float:
    return float((corners_of(given, 0) @ n).max() - (corners_of(given, 1) @ n).min())


@pytest.mark.parametrize("depth", [1e-7, 1e-3, 0.02])
def test_boxes_against_separating_axes(depth: float) -> None:
    """Boxes that overlap have contacts; the deepest is as deep as the least overlap, and all are along axes of as little overlap."""
    random = np.random.default_rng(11)
    for _ in range(150):
        given, overlap, n = touching_boxes(random, depth)
        assert overlap == pytest.approx(depth, abs=1e-9)
        found = contacts(given)
        assert len(found.gap) > 0
        assert -found.gap.min() == pytest.approx(depth, abs=2e-4 + 0.01 * depth)
        for normal in found.normal:
            assert normal @ n > 0.99 or overlap_along(given, normal) < depth + 2e-4


def test_boxes_apart_have_no_contact() -> None:
    random = np.random.default_rng(12)
    for _ in range(150):
        given, overlap, _ = touching_boxes(random, -1e-4)
        assert overlap < -9e-5
        assert len(contacts(given).gap) == 0


def swapped(given: Scene) -> Scene:
    bodies = given.bodies.take(np.array([1, 0]))
    return scene(given.shapes, bodies.x, which=bodies.shape, q=bodies.q)


def in_order(found: Touching) -> np.ndarray:
    return np.lexsort(np.round(np.column_stack([found.point, found.gap]), 7).T)


def test_action_is_reaction_and_any_attitude_is_as_good() -> None:
    """Bodies told in the other order, and a scene that is moved and turned as a whole: the same contacts."""
    random = np.random.default_rng(13)
    for _ in range(60):
        given, _, _ = touching_boxes(random, 1e-3)
        found, back = contacts(given), contacts(swapped(given))
        a, b = in_order(found), in_order(back)
        np.testing.assert_allclose(found.point[a], back.point[b], atol=1e-9)
        np.testing.assert_allclose(found.normal[a], -back.normal[b], atol=1e-9)
        np.testing.assert_allclose(found.gap[a], back.gap[b], atol=1e-9)
        q, shift = random_turn(random), random.normal(size=3)
        turn = rotation(q)[0]
        moved = scene(given.shapes, given.bodies.x @ turn.T + shift, q=[product(q, p) for p in given.bodies.q])
        there = contacts(moved)
        np.testing.assert_array_equal(there.key, found.key)
        np.testing.assert_allclose(there.point, found.point @ turn.T + shift, atol=1e-9)
        np.testing.assert_allclose(there.normal, found.normal @ turn.T, atol=1e-9)


def test_points_keep_their_names_while_bodies_slide() -> None:
    """A box that slides and turns a little, and a sphere that rolls, over the diagonal of a face, and boxes of any scale alike."""
    names = set()
    for shift in np.linspace(-0.2, 0.2, 9):
        given = scene(
            [box([3.0, 3.0, 1.0]), box()],
            [[0, 0, 0], [shift, 0.3 * shift, 1.0 - 1e-6]],
            q=[about(UP, 0.0), about(UP, shift)],
        )
        names.add(tuple(contacts(given).key.tolist()))
        rolling = scene([box([3.0, 3.0, 1.0]), ball()], [[0, 0, 0], [shift, 0.3 * shift, 1.0]])
        names.add(tuple(contacts(rolling).key.tolist()))
        larger = scene(given.shapes, given.bodies.x * 7.0, q=given.bodies.q, scale=[7.0, 7.0])
        found = contacts(larger, 7e-6)
        names.add(tuple(found.key.tolist()))
        np.testing.assert_allclose(found.gap, -7e-6, atol=1e-11)
    assert len(names) == 2
    assert sorted(len(name) for name in names) == [1, 4]


def test_scales_of_both_bodies() -> None:
    """Half of a cube of 2 on twice a cube of 0.5 is a cube of 1 on a cube of 1."""
    found = contacts(scene([box([2.0] * 3), box([0.5] * 3)], [[0, 0, 0], [0.3, 0.2, 1 - 1e-6]], scale=[0.5, 2.0]))
    plain = contacts(stack((0.3, 0.2), 0.0, -1e-6))
    for a, b in zip(found, plain, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


@pytest.mark.parametrize("rise", [-0.5, -0.1, 0.1, 1.0])
def test_sphere_at_a_sharp_edge(rise: float) -> None:
    """Outside, though behind the plane of one of the two faces."""
    wedge = prism([(0.0, 0.0), (2.0, 0.0), (2.0, 0.4)], [(0, 1, 2)], 2.0)
    n = np.array([-1.0, 0.0, rise]) / np.hypot(1.0, rise)
    found = contacts(scene([wedge, ball(0.3)], [[0, 0, 0], 0.29 * n]))
    np.testing.assert_allclose(found.gap, [-0.01], atol=1e-12)
    np.testing.assert_allclose(found.normal, [n], atol=1e-12)


@pytest.mark.parametrize(("gap", "count"), [(1e-4, 0), (5e-7, 1), (-1e-3, 1)])
def test_edges_of_octahedra(gap: float, count: int) -> None:
    """An edge across an edge of bodies whose boxes overlap, whether they touch or not."""
    lower = about([0.0, 1.0, 0.0], -np.pi / 4)  # the edge between x and z up, along x
    upper = product(about(UP, np.pi / 2), product(about([1.0, 0.0, 0.0], np.pi), lower))
    found = contacts(scene([round_stone(0, 1.0)], [[0, 0, 0], [0.1, 0.2, np.sqrt(2.0) + gap]], q=[lower, upper]))
    assert len(found.gap) == count
    np.testing.assert_allclose(found.gap, [gap] * count, atol=1e-12)
    np.testing.assert_allclose(found.normal, np.tile(UP, (count, 1)), atol=1e-9)
    np.testing.assert_allclose(found.point, np.tile([0.1, 0.0, (np.sqrt(2.0) + gap) / 2], (count, 1)), atol=1e-9)


def test_beside_a_sharp_wedge() -> None:
    """A corner in front of the lower face of a wedge of 11 degrees lies behind its upper face, and touches neither."""
    wedge = prism([(0.0, 0.0), (2.0, 0.0), (2.0, 0.4)], [(0, 1, 2)], 2.0)
    point = mesh(
        [[0, 0, 0], [-1, 1, -0.05], [-1, -1, -0.05], [-1, 0, -1]], [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    )
    assert len(contacts(scene([wedge, point], [[0, 0, 0], [1.0, 0, -0.01]])).gap) == 0
    found = contacts(scene([wedge, point], [[0, 0, 0], [1.0, 0, 0.01]]))
    assert found.gap.min() == pytest.approx(-0.01, abs=1e-3)
    assert found.normal[np.argmin(found.gap)] @ UP < -0.99


# --- meshes and terrain


def prism(outline: Sequence[tuple[float, float]], fan: Sequence[tuple[int, int, int]], length: float) -> Shape:
    """An outline in the x-z plane, anticlockwise seen from -y, and triangles of it, drawn out along y."""
    n = len(outline)
    front = [(x, -length / 2, z) for x, z in outline]
    back = [(x, length / 2, z) for x, z in outline]
    triangles = [*fan, *((a + n, c + n, b + n) for a, b, c in fan)]
    for k in range(n):
        m = (k + 1) % n
        triangles += [(k, k + n, m + n), (k, m + n, m)]
    return mesh(front + back, triangles)


def angle_iron() -> Shape:
    """An L of legs 2 and thickness 0.5; its inner edge at (0.5, 0.5)."""
    outline = [(0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 2), (0, 2)]
    return prism(outline, [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)], 3.0)


def test_sphere_in_the_corner_of_an_l() -> None:
    found = contacts(scene([angle_iron(), ball(0.4)], [[0, 0, 0], [0.899, 0.0, 0.8999]]))
    order = np.argsort(found.gap)
    np.testing.assert_allclose(found.gap[order], [-1e-3, -1e-4], atol=1e-12)
    np.testing.assert_allclose(found.normal[order], [[1, 0, 0], [0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize("deep", [1e-7, 1e-3])
def test_box_in_the_corner_of_an_l(deep: float) -> None:
    """Its corners at the inner edge are held by both legs; no inner edge or hidden face pushes any other way."""
    found = contacts(scene([angle_iron(), box()], [[0, 0, 0], [1.0 - deep, 0.1, 1.0 - deep]]))
    along = np.abs(found.normal)
    assert np.all((along[:, 0] > 1 - 1e-9) | (along[:, 2] > 1 - 1e-9))
    assert np.all(found.normal[:, [0, 2]] >= -1e-12)
    np.testing.assert_allclose(found.gap, -deep, atol=1e-12)
    for axis in (0, 2):
        rows = along[:, axis] > 0.5
        assert rows.sum() == 4
        assert np.ptp(found.point[rows], axis=0).max() == pytest.approx(1.0, abs=2e-3)


def test_mesh_of_a_box_is_a_box() -> None:
    """Triangles across a flat face, and corners inside it, add no contact."""
    fine = mesh(*subdivided(*box_mesh([1.0, 1.0, 1.0]), 2))
    for shift, turn in [((0.3, 0.2), 0.0), ((0.0, 0.0), 0.3)]:
        coarse, finer = (
            contacts(stack(shift, turn, -1e-6)),
            contacts(stack(shift, turn, -1e-6, fine)),
        )
        a, b = in_order(coarse), in_order(finer)
        np.testing.assert_allclose(coarse.point[a], finer.point[b], atol=1e-9)
        np.testing.assert_allclose(coarse.normal[a], finer.normal[b], atol=1e-9)


def test_round_meshes_touch_as_spheres_do() -> None:
    """Meshes of 512 triangles about spheres: depth and normal as of spheres, to the height of their facets."""
    random = np.random.default_rng(3)
    stone = round_stone(3, 0.5)
    sag = 0.5 - min(np.linalg.norm(stone.vertices[t].mean(axis=0)) for t in stone.triangles)
    for _ in range(40):
        n = random.normal(size=3)
        n /= np.linalg.norm(n)
        q = [random_turn(random), random_turn(random)]
        found = contacts(scene([stone], [[0, 0, 0], n * (1.0 - 2 * sag - 2e-3)], q=q))
        assert len(found.gap) > 0
        assert -2e-3 - 2 * sag <= found.gap.min() <= -2e-3
        assert np.all(found.normal @ n > 0.97)


def grid_terrain(height: Callable[[Floats, Floats], Floats], cells: int, width: float) -> tuple[Floats, np.ndarray]:
    """z = height(x, y) over a square about the origin, two triangles a cell."""
    at = np.linspace(-width / 2, width / 2, cells + 1)
    x, y = np.meshgrid(at, at, indexing="ij")
    vertices = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
    index = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def test_flat_terrain_is_a_plane() -> None:
    """Spheres and boxes anywhere on flat ground of many triangles: the contacts that a plane gives."""
    random = np.random.default_rng(6)
    ground = grid_terrain(lambda x, y: 0.0 * x * y, 20, 10.0)
    x = np.column_stack([random.uniform(-4, 4, 40), random.uniform(-4, 4, 40), np.full(40, 0.5 - 1e-3)])
    x[0], x[2] = [0, 0, 0.499], [0.5, 0.25, 0.499]  # over a vertex, over an edge
    q = [about(UP, angle) for angle in random.uniform(0, 6, 40)]
    which = np.arange(40) % 2
    for k in (0, 1):
        some = which == k
        plane = contacts(scene([ball(), box()], x[some], which=which[some], q=np.array(q)[some], planes=FLOOR))
        found = contacts(scene([ball(), box()], x[some], which=which[some], q=np.array(q)[some], terrain=ground))
        on_ground, on_plane = found.j == -1, plane.j == -1
        assert on_ground.sum() == on_plane.sum() == some.sum() * (1, 4)[k]
        np.testing.assert_allclose(found.point[on_ground], plane.point[on_plane], atol=1e-9)
        np.testing.assert_allclose(found.normal[on_ground], plane.normal[on_plane], atol=1e-9)
        np.testing.assert_allclose(found.gap[on_ground], plane.gap[on_plane], atol=1e-9)


def test_valley_of_terrain() -> None:
    """A V of 45 degrees: a sphere in it has two contacts, a box in it lies flat on both sides."""
    ground = grid_terrain(lambda x, y: np.abs(x) + 0.0 * y, 8, 8.0)
    found = contacts(scene([ball(0.5)], [[0.0, 0.2, np.sqrt(0.5) - 1e-3]], terrain=ground, planes=[([0, 0, -9], UP)]))
    assert found.j.tolist() == [-2, -2]
    np.testing.assert_allclose(np.sort(found.normal[:, 0]), [-np.sqrt(0.5), np.sqrt(0.5)], atol=1e-9)
    np.testing.assert_allclose(found.gap, -1e-3 * np.sqrt(0.5), atol=1e-12)
    q = about([0.0, 1.0, 0.0], np.pi / 4)
    found = contacts(scene([box()], [[0.0, 0.2, np.sqrt(0.5) - 1e-3]], q=[q], terrain=ground))
    np.testing.assert_allclose(found.gap, -1e-3 * np.sqrt(0.5), atol=1e-12)
    for sign in (-1, 1):
        rows = found.normal[:, 0] * sign > 0
        assert rows.sum() == 4
        np.testing.assert_allclose(
            found.normal[rows], np.tile([sign * np.sqrt(0.5), 0, -np.sqrt(0.5)], (rows.sum(), 1)), atol=1e-9
        )
        np.testing.assert_allclose([found.point[rows, 1].min(), found.point[rows, 1].max()], [-0.3, 0.7], atol=1e-9)


def test_nearly_flat_valley_is_one_face() -> None:
    """Two faces that bend by less than makes an edge share a name, and a sphere on both touches one of them."""
    ground = grid_terrain(lambda x, y: 1e-4 * np.abs(x) + 0.0 * y, 8, 8.0)
    found = contacts(scene([ball(0.5)], [[0.0, 0.2, 0.5]], terrain=ground))
    assert len(found.gap) == 1
    assert found.gap[0] == pytest.approx(0.0, abs=1e-7)


def test_ridge_of_terrain() -> None:
    """A box that lies across a ridge touches it with its bottom, at the ridge, from below only."""
    ground = grid_terrain(lambda x, y: -0.5 * np.abs(x) + 0.0 * y, 8, 8.0)
    found = contacts(scene([box([1.0, 1.0, 1.0])], [[0.1, 0.2, 0.5 - 1e-4]], terrain=ground))
    np.testing.assert_allclose(found.normal, np.tile(-UP, (len(found.gap), 1)), atol=1e-9)
    np.testing.assert_allclose(found.gap, -1e-4, atol=1e-12)
    np.testing.assert_allclose([found.point[:, 1].min(), found.point[:, 1].max()], [-0.3, 0.7], atol=1e-9)
    np.testing.assert_allclose(found.point[:, 0], 0.0, atol=1e-9)


def test_spheres_in_a_bowl_of_terrain() -> None:
    """Spheres that touch a round bowl inside: normals point away from its centre, and their depth is that of the sphere in it."""
    random = np.random.default_rng(8)
    ground = grid_terrain(lambda x, y: -np.sqrt(100.0 - x * x - y * y), 60, 10.0)
    ways = np.column_stack([random.uniform(-0.4, 0.4, (30, 2)), -np.ones(30)])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    found = contacts(scene([ball(0.5)], ways * 9.51, terrain=ground), 1e-2)
    ground_contacts = found.j == -1
    assert set(found.i[ground_contacts]) == set(range(30))
    assert np.all(np.einsum("ck,ck->c", found.normal, ways[found.i])[ground_contacts] > 0.99)
    deepest = np.array([found.gap[(found.i == i) & ground_contacts].min() for i in range(30)])
    np.testing.assert_allclose(deepest, -0.0115, atol=3e-3)


# --- clouds


def test_cloud_on_plane_and_cloud() -> None:
    """Boxes of 5 x 5 particles a face, one on another on a floor: 25 points at each joint, along the vertical."""
    cloud = cloud_box([1.0, 1.0, 1.0], 5, 0.5)
    found = contacts(scene([cloud], [[0, 0, 0.5], [0, 0, 1.5 - 1e-6]], planes=FLOOR))
    on_floor = found.j < 0
    assert on_floor.sum() == 25
    np.testing.assert_allclose(found.normal[on_floor], np.tile(-UP, (25, 1)), atol=1e-12)
    assert (~on_floor).sum() == 25
    np.testing.assert_allclose(found.normal[~on_floor], np.tile(UP, (25, 1)), atol=1e-12)
    np.testing.assert_allclose(found.gap[~on_floor], -1e-6, atol=1e-12)


def test_clouds_in_a_row_push_along_it() -> None:
    for edge, count in [
        (0.5, 25),
        (0.3, 21),
    ]:  # without those at the edges, corners are more than a spacing from any plane
        found = contacts(scene([cloud_box([1.0, 1.0, 1.0], 5, edge)], [[0, 0, 0], [1.0, 0, 0]]))
        assert len(found.gap) == count
        np.testing.assert_allclose(found.normal, np.tile([1.0, 0, 0], (count, 1)), atol=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_cloud_against_others(order: int) -> None:
    """A cloud on a large box, a sphere and a small box on a cloud."""
    cloud = cloud_box([1.0, 1.0, 1.0], 5)
    cases = [
        ([cloud, box([4.0, 4.0, 1.0])], -UP, 25),
        ([cloud, ball(0.5)], UP, 1),
        ([cloud, box([0.3, 0.3, 1.0])], UP, 4),
    ]
    for shapes, n, count in cases:
        given = scene(shapes[::order], np.array([[0, 0, 0], n * (1.0 - 1e-5)])[::order])
        found = contacts(given)
        assert len(found.gap) >= count
        np.testing.assert_allclose(found.normal, np.tile(n * order, (len(found.gap), 1)), atol=1e-9)
        np.testing.assert_allclose(found.gap, -1e-5, atol=1e-9)
