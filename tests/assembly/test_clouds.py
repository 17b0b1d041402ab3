"""Solids of particles: mass of cuboids, normals, what is trusted, and clouds that are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dem_cli.assembly.clouds import cells, make_cloud, read_cloud
from dem_cli.assembly.solids import cuboid, polyhedron, random_quaternions
from dem_cli.errors import ScenarioError
from dem_cli.rigid import rotation
from dem_cli.state import Floats


def lattice(nx: int, ny: int, nz: int, spacing: float = 0.1) -> Floats:
    grid = np.meshgrid(np.arange(nx), np.arange(ny), np.arange(nz), indexing="ij")
    return spacing * np.stack(grid, axis=-1).reshape(-1, 3)


def round_cloud(radius: float) -> Floats:
    """Points of a lattice of spacing 1 within a radius of a place that is none of its points."""
    x = lattice(2 * int(radius) + 4, 2 * int(radius) + 4, 2 * int(radius) + 4, 1.0) - int(radius) - 1.4
    return x[np.linalg.norm(x, axis=1) <= radius]


@pytest.mark.parametrize("cells_along", [(2, 2, 2), (3, 4, 5), (5, 6, 4), (2, 7, 3)], ids=str)
def test_cuboid_of_cells_is_exact(cells_along: tuple[int, int, int]) -> None:
    """Mass, centre and inertia are those of the box that the cells fill: each has its own m d^2/6 (findings, section 5)."""
    x = lattice(*cells_along) + np.array([3.0, 4.0, 5.0])
    solid, box = cells(x, 0.1), cuboid(0.1 * np.array(cells_along))
    assert solid.volume == pytest.approx(box.volume)
    assert solid.centre == pytest.approx(x.mean(axis=0))
    assert solid.second == pytest.approx(box.second, rel=1e-12, abs=1e-15)
    without = solid.second - np.eye(3) * box.volume * 0.1**2 / 12.0
    if cells_along == (2, 2, 2):  # point masses would give three quarters of it
        assert np.diag(without) == pytest.approx(0.75 * np.diag(box.second))


def test_particles_of_a_box() -> None:
    """All outer ones are at the surface; those inside faces have its normal, those at edges and corners are not trusted."""
    cloud = make_cloud(lattice(6, 5, 4))
    assert (cloud.particles, cloud.inside, len(cloud.points)) == (120, 4 * 3 * 2, 96)
    assert cloud.spacing == pytest.approx(0.1)
    low, high = np.full(3, -0.05), np.array([0.55, 0.45, 0.35])
    on_face = np.sum((np.abs(cloud.points - low) < 1e-9) | (np.abs(cloud.points - high) < 1e-9), axis=1)
    assert sorted(np.bincount(on_face)) == sorted(
        [0, 52, 36, 8]
    )  # none inside, 52 in faces, 36 on edges, 8 in the corners
    assert np.array_equal(cloud.trusted, on_face == 1)
    outward = (cloud.points - high > -1e-9).astype(float) - (cloud.points - low < 1e-9)
    assert cloud.normals[cloud.trusted] == pytest.approx(outward[cloud.trusted], abs=1e-12)
    assert np.all(np.einsum("ni,ni->n", cloud.normals, outward) > 0.5)  # outwards, all of them
    assert (cloud.angle_median, cloud.angle_largest) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert cloud.warnings == ()
    assert "120 particles 0.1 m apart, 96 at the surface, 52 of these (54%) with a trusted normal" in cloud.words(
        "rock"
    )


def test_box_that_stands_askew_is_the_same_body() -> None:
    turned = rotation(random_quaternions(np.random.default_rng(3), 1))[0]
    x = lattice(6, 5, 4)
    plain, askew = make_cloud(x), make_cloud(x @ turned.T)
    assert np.array_equal(askew.trusted, plain.trusted)
    assert askew.points == pytest.approx(plain.points @ turned.T, abs=1e-12)
    assert askew.normals[askew.trusted] == pytest.approx((plain.normals @ turned.T)[askew.trusted], abs=1e-9)


def test_drawn_surface_is_that_of_the_cells() -> None:
    x = lattice(4, 3, 3)
    x = x[~((x[:, 0] > 0.15) & (x[:, 2] > 0.15))]  # a step
    surface = make_cloud(x).surface
    solid, drawn = cells(x, 0.1), polyhedron(*surface)
    assert drawn.volume == pytest.approx(solid.volume)
    assert drawn.second == pytest.approx(solid.second, abs=1e-12)


@pytest.mark.parametrize(("radius", "median", "largest"), [(4.6, 5.0, 15.0), (9.4, 4.0, 15.0)])
def test_normals_of_a_ball(radius: float, median: float, largest: float) -> None:
    """Steps of the lattice are smoothed: normals within these degrees of the radius; nearly all trusted; the surface in the mean where it is."""
    cloud = make_cloud(round_cloud(radius))
    r = np.linalg.norm(cloud.points, axis=1)
    off = np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", cloud.normals, cloud.points) / r, -1.0, 1.0)))[
        cloud.trusted
    ]
    assert cloud.trusted.mean() > 0.9
    assert np.median(off) < median
    assert off.max() < largest
    assert r[cloud.trusted].mean() == pytest.approx(radius, rel=0.02)
    assert cloud.solid.volume == pytest.approx(4.0 / 3.0 * np.pi * radius**3, rel=0.02)


def test_body_that_is_not_convex_has_normals_out_of_its_notch() -> None:
    x = lattice(9, 4, 9)
    x = x[(x[:, 0] < 0.35) | (x[:, 2] < 0.35)]  # an L
    cloud = make_cloud(x)
    notch = cloud.trusted & (np.abs(cloud.points[:, 0] - 0.35) < 1e-9) & (cloud.points[:, 2] > 0.55)
    assert notch.sum() >= 2
    assert cloud.normals[notch] == pytest.approx(np.tile([1.0, 0.0, 0.0], (notch.sum(), 1)), abs=0.2)


def test_given_normals_are_taken_as_they_are(tmp_path: Path) -> None:
    x = lattice(3, 3, 3, 2.0)
    normals = x - x.mean(axis=0)
    rows = [",".join(f"{value:.17g}" for value in (*place, *normal)) for place, normal in zip(x, normals, strict=True)]
    (tmp_path / "rock.csv").write_text("# a cube\nx,y,z,nx,ny,nz\n" + "\n".join(rows))
    cloud = read_cloud(tmp_path / "rock.csv", "cm", None, "rock")
    assert (cloud.particles, cloud.inside, cloud.spacing) == (27, 1, pytest.approx(0.02))
    assert cloud.trusted.all()
    length = np.linalg.norm(normals, axis=1)
    assert cloud.normals == pytest.approx(normals[length > 0.0] / length[length > 0.0, None])
    assert cloud.points == pytest.approx(0.01 * x[length > 0.0] + 0.01 * cloud.normals)


@pytest.mark.parametrize(
    ("x", "words"),
    [
        (lattice(3, 1, 1), "has 3 particles, a solid has at least 4"),
        (lattice(9, 1, 1), "all particles lie in a line"),
        (lattice(4, 4, 1), "all particles lie in a plane"),
        (np.vstack([lattice(3, 3, 3), [[0.1, 0.1, 0.1]]]), "lies on another one"),
    ],
    ids=["few", "line", "plane", "twice"],
)
def test_clouds_that_are_no_solid(x: Floats, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_cloud(x)


def test_spacing_that_fits_to_no_neighbours() -> None:
    with pytest.raises(ValueError, match=r"neighbours are 0.1 m apart, which does not fit to a spacing of 0.01 m"):
        make_cloud(lattice(3, 3, 3), 0.01)


@pytest.mark.parametrize(
    ("x", "spacing", "words"),
    [
        (lattice(3, 3, 3), 0.13, "neighbours are 0.1 m apart, the spacing is 0.13 m: cells overlap or leave gaps"),
        (lattice(3, 3, 3), None, "only 23%"),
        (
            np.vstack([lattice(5, 5, 4), lattice(5, 5, 1) + np.array([0.8, 0.0, 0.1])]),
            None,
            "25 particles are open on opposite sides",
        ),
    ],
    ids=["cells overlap", "coarse", "thin"],
)
def test_warnings(x: Floats, spacing: float | None, words: str) -> None:
    cloud = make_cloud(x, spacing, name="rock")
    assert any(one.startswith(f"cloud rock: {words}") for one in cloud.warnings), cloud.warnings


def test_shell_is_warned_of() -> None:
    """Particles on a sphere alone: no solid, though nothing forbids it."""
    k = np.arange(400)
    z, turn = 1.0 - (2.0 * k + 1.0) / 400.0, k * np.pi * (3.0 - np.sqrt(5.0))
    x = np.stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z], axis=1)
    assert any("no particle lies inside" in one for one in make_cloud(x).warnings)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty. Begin with the header x,y,z or x,y,z,nx,ny,nz"),
        ("x,y\n1,2\n", "line 1: the header is x,y. Write x,y,z or x,y,z,nx,ny,nz"),
        ("x,y,z\n1,2\n", "line 2: is not 3 numbers"),
        ("x,y,z\n1,2,a\n", "line 2: is not 3 numbers"),
        ("# c\nx,y,z\n\n1,2,inf\n", "line 4: a number is not finite"),
        ("x,y,z\n0,0,0\n1,0,0\n", "has 2 particles"),
    ],
    ids=str,
)
def test_files_that_are_no_cloud(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "rock.csv"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        read_cloud(path, "m", None, "rock")
    assert str(caught.value).startswith(f"{path}: {words}")
