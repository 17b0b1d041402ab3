"""What surrounds rigid bodies: which places lie under a terrain."""

from __future__ import annotations

import numpy as np

from dem_cli.assembly.surroundings import under
from dem_cli.rigid import Terrain

# Two triangles that slope down to x = 2, from z = 2 to z = 0.
SLOPE = Terrain(
    "slope", np.array([[0.0, 0, 2], [2, 0, 0], [2, 1, 0], [0, 1, 2]]), np.array([[0, 1, 2], [0, 2, 3]]), material=0
)


def test_places_below_the_surface_are_under_it() -> None:
    x = np.array([[1.0, 0.3, 0.9], [1.0, 0.3, 1.1], [0.1, 0.9, 1.8], [0.1, 0.9, 2.0]])
    assert under(SLOPE, x).tolist() == [0, 2]


def test_places_beside_the_terrain_and_under_its_back_are_not() -> None:
    assert len(under(SLOPE, np.array([[3.0, 0.5, -5.0], [1.0, 1.5, -5.0]]))) == 0
    turned = Terrain("turned", SLOPE.vertices, SLOPE.triangles[:, ::-1], material=0)
    assert len(under(turned, np.array([[1.0, 0.3, 0.9]]))) == 0


def test_a_place_between_two_floors_is_not_under() -> None:
    lower = SLOPE.vertices - np.array([0.0, 0.0, 3.0])
    both = Terrain(
        "both", np.concatenate([SLOPE.vertices, lower]), np.concatenate([SLOPE.triangles, SLOPE.triangles + 4]), 0
    )
    assert under(both, np.array([[1.0, 0.3, 0.0], [1.0, 0.3, -5.0]])).tolist() == [1]
