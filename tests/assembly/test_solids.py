"""Mass properties of solids in three dimensions against closed forms, and against trimesh."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import trimesh

from dem_cli.assembly.clumps import icosphere, sphere_surfaces, union_of_spheres
from dem_cli.assembly.solids import (
    Solid,
    ball,
    cuboid,
    multiply,
    polyhedron,
    principal,
    quaternion_of,
    random_quaternions,
    together,
    turn,
)
from dem_cli.rigid import rotation
from dem_cli.state import Floats

BALL = 4.0 / 3.0 * np.pi
SOME_TURN = rotation(np.array([[0.5, 0.1, -0.7, 0.5]]) / np.linalg.norm([0.5, 0.1, -0.7, 0.5]))[0]


def moved(solid: Solid, turned: Floats, by: Floats) -> Solid:
    return Solid(solid.volume, turned @ solid.centre + by, turned @ solid.second @ turned.T)


def alike(one: Solid, other: Solid, rel: float = 1e-12) -> None:
    size = np.sqrt(np.trace(other.second) / other.volume)
    assert one.volume == pytest.approx(other.volume, rel=rel)
    assert one.centre == pytest.approx(other.centre, abs=rel * size)
    assert one.second == pytest.approx(other.second, abs=rel * other.volume * size**2)


# ------------------------------------------------------------------------------------------ polyhedra


def tetrahedron() -> tuple[Floats, np.ndarray]:
    return np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])


def test_corner_tetrahedron() -> None:
    """0 <= x, y, z and x + y + z <= 1: the integrals of 1, x, x^2, xy are 1/6, 1/24, 1/60, 1/120."""
    solid = polyhedron(*tetrahedron())
    about_origin = np.full((3, 3), 1 / 120) + np.eye(3) * (1 / 60 - 1 / 120)
    alike(solid, Solid(1 / 6, np.full(3, 0.25), about_origin - np.full((3, 3), 1 / 96)))


def test_box_wherever_it_is() -> None:
    size = np.array([2.0, 1.0, 0.5])
    box = trimesh.creation.box(size)
    by = np.array([100.0, -30.0, 7.0])
    alike(
        polyhedron(np.asarray(box.vertices) @ SOME_TURN.T + by, np.asarray(box.faces)),
        moved(cuboid(size), SOME_TURN, by),
        1e-11,
    )


def test_inertia_of_a_box() -> None:
    assert cuboid(np.array([2.0, 1.0, 3.0])).inertia == pytest.approx(6.0 / 12.0 * np.diag([10.0, 13.0, 5.0]))


@pytest.mark.parametrize("name", ["annulus", "capsule", "L"])
def test_surfaces_against_trimesh(name: str) -> None:
    """A solid with a hole, a round one, and one that is not convex."""
    if name == "annulus":
        mesh = trimesh.creation.annulus(r_min=0.3, r_max=1.0, height=0.5)
    elif name == "capsule":
        mesh = trimesh.creation.capsule(height=1.0, radius=0.4)
    else:
        outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
        vertices = np.array([[*place, z] for z in (0.0, 0.7) for place in outline])
        cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
        sides = [t for k in range(6) for t in ([k, (k + 1) % 6, 6 + (k + 1) % 6], [k, 6 + (k + 1) % 6, 6 + k])]
        mesh = trimesh.Trimesh(vertices, np.vstack([cap[:, ::-1], cap + 6, sides]), process=False)
        assert mesh.is_watertight
    mesh.apply_transform(trimesh.transformations.translation_matrix([1.0, 2.0, 3.0]))
    solid = polyhedron(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert solid.volume == pytest.approx(mesh.volume, rel=1e-12)
    assert solid.centre == pytest.approx(mesh.center_mass, rel=1e-11)
    assert solid.inertia == pytest.approx(mesh.moment_inertia, abs=1e-11 * np.trace(mesh.moment_inertia))
    if name == "L":
        assert solid.volume == pytest.approx(0.7 * 4.0)


# ------------------------------------------------------------------------------------------ spheres


def test_one_sphere() -> None:
    alike(
        union_of_spheres(np.array([[1.0, 2.0, 3.0]]), np.array([2.0])),
        ball(2.0)._replace(centre=np.array([1.0, 2.0, 3.0])),
    )
    assert np.diag(ball(2.0).inertia) == pytest.approx(np.full(3, 0.4 * BALL * 8.0 * 4.0))


def test_two_spheres_that_touch() -> None:
    """Radii 1 and 2, 3 apart: masses at their centres, and their own moments."""
    solid = union_of_spheres(np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]), np.array([1.0, 2.0]))
    assert solid.volume == pytest.approx(9.0 * BALL)
    assert solid.centre == pytest.approx([8.0 / 9.0 * 3.0, 0.0, 0.0])
    own = 0.4 * BALL * (1.0 + 32.0)
    across = own + BALL * 8.0 / 9.0 * 9.0
    assert solid.inertia == pytest.approx(np.diag([own, across, across]))


def lens(r: float, d: float) -> tuple[float, float, float]:
    """What two spheres of radius r, d apart, share: volume, and the integrals of x^2 (along their line, from the middle) and y^2."""
    h = r - 0.5 * d  # height of a cap, cut off at the distance d/2 from its centre
    t = np.polynomial.polynomial
    cut = np.array([r * r, 0.0, -1.0])  # radius squared of the cut at height x over the centre
    from_middle = np.array([-0.5 * d, 1.0])

    def integral(p: Floats) -> float:
        whole = t.polyint(p)
        return float(t.polyval(r, whole) - t.polyval(0.5 * d, whole))

    assert np.pi * h * h * (3 * r - h) / 3 == pytest.approx(integral(np.pi * cut))
    square = t.polymul(from_middle, from_middle)
    return (
        2 * integral(np.pi * cut),
        2 * integral(np.pi * t.polymul(cut, square)),
        2 * integral(0.25 * np.pi * t.polymul(cut, cut)),
    )


@pytest.mark.parametrize("d", [0.1, 0.7, 1.3, 1.95])
@pytest.mark.parametrize("turned", [np.eye(3), SOME_TURN], ids=["along x", "anyhow"])
def test_two_spheres_that_overlap(d: float, turned: Floats) -> None:
    """The sum of both less the lens that they share, in closed form."""
    volume, along, across = lens(1.0, d)
    both = together([ball(1.0)._replace(centre=np.array([x, 0.0, 0.0])) for x in (-0.5 * d, 0.5 * d)])
    exact = Solid(both.volume - volume, np.zeros(3), both.second - np.diag([along, across, across]))
    by = np.array([3.0, -1.0, 2.0])
    centres = np.array([[-0.5 * d, 0.0, 0.0], [0.5 * d, 0.0, 0.0]]) @ turned.T + by
    alike(union_of_spheres(centres, np.ones(2)), moved(exact, turned, by), 1e-6)


def test_several_spheres_by_inclusion_and_counting() -> None:
    """Five spheres that overlap in twos and threes: against a count of points."""
    centres = np.array([[0.0, 0.0, 0.0], [0.9, 0.2, 0.1], [0.3, 0.8, -0.2], [0.1, 0.3, 0.9], [2.0, 0.2, 0.1]])
    radii = np.array([1.0, 0.8, 0.7, 0.6, 0.5])
    solid = union_of_spheres(centres, radii)
    n = 100
    axes = [-1.2 + 4.0 * (np.arange(n) + 0.5) / n for _ in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = np.zeros(len(points), dtype=bool)
    for centre, r in zip(centres, radii, strict=True):
        inside |= np.einsum("ni,ni->n", points - centre, points - centre) <= r * r
    cell = (4.0 / n) ** 3
    kept = points[inside]
    count = Solid(cell * len(kept), kept.mean(axis=0), cell * (kept - kept.mean(axis=0)).T @ (kept - kept.mean(axis=0)))
    alike(solid, count, 4e-3)


def test_a_sphere_inside_another_changes_nothing() -> None:
    alike(union_of_spheres(np.array([[0.0, 0.0, 0.0], [0.2, 0.3, 0.1]]), np.array([1.0, 0.1])), ball(1.0), 1e-9)


def test_union_turns_with_its_spheres() -> None:
    centres = np.array([[1.0, 0.0, 0.0], [-0.5, 0.8, 0.0], [-0.5, -0.8, 0.2], [0.0, 0.0, 1.0]])
    radii, by = np.array([1.0, 0.9, 1.1, 0.8]), np.array([5.0, 6.0, 7.0])
    alike(
        union_of_spheres(centres @ SOME_TURN.T + by, radii),
        moved(union_of_spheres(centres, radii), SOME_TURN, by),
        1e-7,
    )


def test_surface_of_a_sphere_is_closed_and_faces_outwards() -> None:
    vertices, triangles = icosphere()
    assert (vertices.shape, triangles.shape) == ((42, 3), (80, 3))
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(np.ones(42))
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0.8 * BALL
    places, corners = sphere_surfaces(np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]), np.array([1.0, 2.0]))
    assert polyhedron(places, corners).volume == pytest.approx(9.0 * mesh.volume)


# ------------------------------------------------------------------------------------------ axes, turns


def test_axes_stay_where_they_are_principal() -> None:
    for solid in (cuboid(np.array([3.0, 1.0, 2.0])), ball(1.0)):
        moments, axes = principal(solid)
        assert np.array_equal(axes, np.eye(3))
        assert np.array_equal(moments, np.diag(solid.inertia))


def test_principal_axes_make_the_inertia_diagonal() -> None:
    for k in range(20):
        turned = rotation(random_quaternions(np.random.default_rng(k), 1))[0]
        solid = moved(cuboid(np.array([3.0, 1.0, 2.0])), turned, np.zeros(3))
        moments, axes = principal(solid)
        assert axes @ np.diag(moments) @ axes.T == pytest.approx(solid.inertia, abs=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert sorted(moments) == pytest.approx(sorted(np.diag(cuboid(np.array([3.0, 1.0, 2.0])).inertia)))


def test_quaternions() -> None:
    q = random_quaternions(np.random.default_rng(1), 200)
    assert np.linalg.norm(q, axis=1) == pytest.approx(np.ones(200))
    for one, matrix in zip(q, rotation(q), strict=True):
        assert rotation(quaternion_of(matrix))[0] == pytest.approx(matrix, abs=1e-12)
        assert quaternion_of(matrix) == pytest.approx(one * np.sign(one[0]), abs=1e-12)
    for axis in np.eye(3):  # half turns, w = 0
        assert rotation(quaternion_of(2.0 * np.outer(axis, axis) - np.eye(3)))[0] == pytest.approx(
            2.0 * np.outer(axis, axis) - np.eye(3)
        )
    p, r = q[:100], q[100:]
    assert rotation(multiply(p, r)) == pytest.approx(rotation(p) @ rotation(r))
    vectors = np.random.default_rng(2).normal(size=(100, 3))
    assert turn(p, vectors) == pytest.approx(np.einsum("nij,nj->ni", rotation(p), vectors))


def test_random_quaternions_turn_every_way_alike() -> None:
    """Turned axes are spread evenly over the sphere, and the trace of the matrix is -1 + 4 w^2 with <w^2> = 1/4."""
    matrices = rotation(random_quaternions(np.random.default_rng(5), 20000))
    for axis in range(3):
        z = matrices[:, 2, axis]
        assert np.quantile(z, [0.1, 0.25, 0.5, 0.75, 0.9]) == pytest.approx([-0.8, -0.5, 0.0, 0.5, 0.8], abs=0.03)
    assert np.trace(matrices, axis1=1, axis2=2).mean() == pytest.approx(0.0, abs=0.03)
    for i, j in combinations(range(3), 2):
        assert np.mean(matrices[:, i, i] * matrices[:, j, j]) == pytest.approx(0.0, abs=0.02)
