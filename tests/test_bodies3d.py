"""Measures of bodies in 3D: answers known beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scene_samples import (
    axis_angle,
    bodies_at,
    box_shape,
    container,
    frame_of,
    pair_shape,
    planes_of,
    scene_of,
    some_contacts,
    some_frame,
    some_scene,
)

from dem_cli.analysis.bodies3d import angular_momentum, measure_bodies
from dem_cli.analysis.fill3d import floor_of, top_surface
from dem_cli.analysis.placed import extent
from dem_cli.results.body_schema import BODY_SERIES, MOVING
from dem_cli.rigid import BodyContacts, BodyFrame, Scene, rotation

CUBE = (box_shape((1.0, 1.0, 1.0)),)


def lying(pairs: list[tuple[int, int]], gap: float = 0.0) -> BodyContacts:
    contacts = some_contacts(pairs)
    return replace(contacts, gap=np.full(len(pairs), gap))


def test_a_row_has_exactly_the_names_of_the_series() -> None:
    row = measure_bodies(some_frame(1, [(0, 1)]), some_scene())
    assert row.keys() == BODY_SERIES.keys()
    assert all(isinstance(value, float) for value in row.values())


def test_moving_is_defined_once() -> None:
    from dem_cli.analysis import bodies3d

    assert bodies3d.MOVING == MOVING


def test_the_engines_numbers_are_passed_on() -> None:
    frame = some_frame(1, [])
    row = measure_bodies(frame, some_scene())
    assert (row["restitution_energy"], row["escaped_energy"]) == (frame.energy.restitution, frame.energy.escaped)
    assert (row["most_iterations"], row["solver_residual"]) == (40.0, 1e-6)
    assert (row["ground_x"], row["ground_vz"], row["ground_ay"]) == (
        frame.ground[0, 0],
        frame.ground[1, 2],
        frame.ground[2, 1],
    )


def test_momentum_and_centre_of_mass() -> None:
    bodies = bodies_at(
        [[0, 0, 0], [3, 0, 1], [9, 9, 9]], CUBE, scale=[1.0, 2.0, 1.0], v=[[1.0, 0, 0], [0, 2.0, 0], [0, 0, 0.0]]
    )
    bodies.escaped[2] = True
    m = CUBE[0].mass
    row = measure_bodies(frame_of(bodies), scene_of(bodies, CUBE))
    assert [row[f"momentum_{axis}"] for axis in "xyz"] == pytest.approx([m, 16 * m, 0.0])
    assert [row[f"center_{axis}"] for axis in "xyz"] == pytest.approx([24 / 9, 0.0, 8 / 9])
    assert [row[f"angular_momentum_{axis}"] for axis in "xyz"] == pytest.approx([-16 * m, 0.0, 48 * m])
    assert (row["escaped"], row["speed_max"], row["moving"]) == (1.0, 2.0, 2.0)


def test_angular_momentum_is_that_of_point_masses() -> None:
    """A turned box as 8 point masses at the corners of a smaller one with the same moments."""
    shapes = (box_shape((2.0, 1.0, 3.0)),)
    q = axis_angle([1, 2, 3], 0.7)
    bodies = bodies_at([[1, 2, 3]], shapes, q=[q], v=[[0.3, -1.0, 2.0]], w=[[1.0, -2.0, 0.5]])
    corners = shapes[0].vertices / np.sqrt(3.0)
    place = bodies.x[0] + corners @ rotation(q)[0].T
    speed = bodies.v[0] + np.cross(bodies.w[0], place - bodies.x[0])
    want = (bodies.mass[0] / 8.0 * np.cross(place, speed)).sum(axis=0)
    assert angular_momentum(bodies) == pytest.approx(want)


def test_turning_counts_as_moving() -> None:
    bodies = bodies_at([[0, 0, 0], [5, 0, 0]], CUBE, w=[[0, 0, 0.002], [0, 0, 0.001]])
    assert measure_bodies(frame_of(bodies), scene_of(bodies, CUBE))["moving"] == 1.0  # 0.87 m reach


def test_top_is_exact() -> None:
    """A cube on its corner, and a pair upright."""
    turned = axis_angle([1, -1, 0], np.arctan(np.sqrt(2.0)))
    one = bodies_at([[0, 0, 2.0]], CUBE, q=[turned], scale=[2.0])
    assert measure_bodies(frame_of(one), scene_of(one, CUBE))["top"] == pytest.approx(2.0 + np.sqrt(3.0))
    pair = (pair_shape(0.5),)
    upright = bodies_at([[0, 0, 2.0]], pair, q=[axis_angle([0, 1, 0], 0.5 * np.pi)])
    low, high = extent(upright, pair)
    assert (low[0, 2], high[0, 2], high[0, 0]) == pytest.approx((1.0, 3.0, 0.5))


def test_contacts_are_counted_by_points_and_pairs() -> None:
    bodies = bodies_at([[0, 0, 0], [1, 0, 0], [0, 0, 9]], CUBE)
    contacts = lying([(0, -1), (0, -1), (0, 1), (1, -1)])
    contacts.gap[:] = [-0.002, 0.001, -0.004, 0.0]
    contacts.sliding[:] = [True, False, False, False]
    row = measure_bodies(
        frame_of(bodies, contacts=contacts), scene_of(bodies, CUBE, planes_of(("floor", [0, 0, 0], [0, 0, 1])))
    )
    assert (row["contacts"], row["touching"], row["sliding"]) == (4.0, 3.0, 0.25)
    assert row["coordination"] == pytest.approx(4 / 3)  # 2 + 2 + 0 of three bodies
    assert (row["penetration"], row["penetration_mean"]) == pytest.approx((0.004, 0.0015))


def filled(contacts: list[tuple[int, int]], x: list[list[float]]) -> tuple[Scene, BodyFrame]:
    bodies = bodies_at(x, CUBE)
    return scene_of(bodies, CUBE, container(2.0, 1.0)), frame_of(bodies, contacts=lying(contacts))


def test_void_ratio_of_cubes() -> None:
    """Two side by side fill a container of 2 m x 1 m to 1 m without voids; one on one leaves half of the floor free."""
    scene, frame = filled([(0, -5), (1, -5)], [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5]])
    row = measure_bodies(frame, scene)
    assert (row["fill_height"], row["void_ratio"]) == pytest.approx((1.0, 0.0))
    scene, frame = filled([(0, -5), (0, 1)], [[0.5, 0.5, 0.5], [0.5, 0.5, 1.5]])
    row = measure_bodies(frame, scene)
    assert (row["fill_height"], row["void_ratio"]) == pytest.approx((1.0, 0.0))
    scene, frame = filled([(0, -5), (0, 1)], [[0.5, 0.5, 0.5], [0.5, 0.5, 2.0]])  # a slit of half a metre
    row = measure_bodies(frame, scene)
    assert (row["fill_height"], row["void_ratio"]) == pytest.approx((1.25, 0.25))


def test_bodies_in_the_air_are_no_fill() -> None:
    scene, frame = filled([(0, -5)], [[0.5, 0.5, 0.5], [1.5, 0.5, 5.0]])
    row = measure_bodies(frame, scene)
    assert (row["fill_height"], row["void_ratio"]) == pytest.approx((0.5, 0.0))
    scene, frame = filled([(0, -1)], [[0.5, 0.5, 0.5], [1.5, 0.5, 5.0]])  # one leans on a wall, none lies
    assert np.isnan(measure_bodies(frame, scene)["void_ratio"])
    bodies = frame.bodies
    assert np.isnan(measure_bodies(frame, scene_of(bodies, CUBE))["fill_height"])  # no container


def test_surface_over_a_sphere() -> None:
    """Mean height of half a sphere over its square: pi r^2 (r + 2/3 r) / (2 r)^2."""
    shapes = (replace(pair_shape(0.5), centers=np.zeros((1, 3)), radii=np.array([0.5])),)
    bodies = bodies_at([[0.5, 0.5, 0.5]], shapes)
    floor = floor_of(container(1.0, 1.0))
    assert floor is not None
    eta = top_surface(bodies, np.array([True]), shapes, floor, cells=400)
    assert eta.mean() == pytest.approx(np.pi * 0.25 * (0.5 + 1.0 / 3.0), rel=2e-4)
    assert eta.max() == pytest.approx(1.0, abs=1e-5)
    assert eta.shape == (400, 400)


def test_surface_of_triangles_is_that_of_the_turned_box() -> None:
    """A cube turned about y by 45 deg is a roof: mean height over its shadow."""
    bodies = bodies_at([[1.0, 0.5, np.sqrt(0.5)]], CUBE, q=[axis_angle([0, 1, 0], 0.25 * np.pi)])
    floor = floor_of(container(2.0, 1.0))
    assert floor is not None
    eta = top_surface(bodies, np.array([True]), CUBE, floor, cells=512)
    assert eta.max() == pytest.approx(np.sqrt(2.0), abs=3e-3)
    assert eta.mean() * 2.0 == pytest.approx(np.sqrt(2.0) * (np.sqrt(0.5) + 0.5 * np.sqrt(0.5)), rel=2e-3)


def test_no_floor_without_upright_walls() -> None:
    assert floor_of(planes_of(("bottom", [0, 0, 0], [0, 0, 1]))) is None
    tilted = container(1.0, 1.0)
    assert floor_of(replace(tilted, normal=tilted.normal[:, ::-1].copy())) is None
