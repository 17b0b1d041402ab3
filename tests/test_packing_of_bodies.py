"""Result files of the impulse engine as packings: what its writer writes is what a scene is made of, to the last bit."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from impulse_runs import write_run
from impulse_text import drop, pour
from scenario_text import ABSENT

from dem_cli.assembly import build_scene
from dem_cli.errors import ScenarioError
from dem_cli.rigid import Shape
from dem_cli.scenario import ImpulseScenario, parse_scenario

MATERIALS = [{"between": ["clump", "wall"], "friction": 0.1}]


def scenario_of(text: str, folder: Path) -> ImpulseScenario:
    scenario = parse_scenario(text, folder=folder)
    assert isinstance(scenario, ImpulseScenario)
    return scenario


def test_bodies_go_over_as_they_are(tmp_path: Path) -> None:
    made = build_scene(
        scenario_of(pour({"contact.pairs": MATERIALS, "grains.0.scale": {"uniform": [0.5, 1]}}), tmp_path)
    )
    moving = replace(
        made.bodies, v=np.random.default_rng(1).normal(size=(21, 3)), w=np.random.default_rng(2).normal(size=(21, 3))
    )
    write_run(tmp_path / "pile.h5", made, [(0.0, made.bodies), (0.1, moving)], dt=0.1)
    changes = {"packing": {"method": "file", "file": "pile.h5"}, "grains": ABSENT, "contact.pairs": MATERIALS}
    found = build_scene(scenario_of(pour(changes), tmp_path))
    assert (found.groups, found.materials) == (made.groups, made.materials)
    for field in fields(moving):
        assert np.array_equal(getattr(found.bodies, field.name), getattr(moving, field.name)), field.name
    for one, other in zip(found.shapes, made.shapes, strict=True):
        for field in fields(Shape):
            assert np.array_equal(getattr(one, field.name), getattr(other, field.name)), field.name
    assert np.array_equal(found.friction, made.friction)


def test_bodies_of_a_file_may_meet_other_planes(tmp_path: Path) -> None:
    made = build_scene(scenario_of(drop(), tmp_path))
    write_run(tmp_path / "one.h5", made, [(0.0, made.bodies)], dt=0.1)
    text = drop(
        {
            "packing": {"method": "file", "file": "one.h5"},
            "grains": ABSENT,
            "plane": [{"name": "slope", "slope": "10 deg"}],
        }
    )
    found = build_scene(scenario_of(text, tmp_path))
    assert (found.groups, found.materials) == (("box",), ("box", "slope"))
    assert np.array_equal(found.bodies.x, made.bodies.x)


def test_bodies_of_a_packing_outside_of_the_container_are_refused(tmp_path: Path) -> None:
    made = build_scene(scenario_of(pour({"grains.1.position": ["0.95 m", "0.5 m", "0.1 m"]}), tmp_path))
    write_run(tmp_path / "pile.h5", made, [(0.0, made.bodies)], dt=0.1)
    text = pour({"packing": {"method": "file", "file": "pile.h5"}, "grains": ABSENT, "container.width": "0.9 m"})
    with pytest.raises(
        ScenarioError, match=r"^scenario: \[packing\] file: body \d+ starts at \(0\.9.*, outside of what"
    ):
        build_scene(scenario_of(text, tmp_path))
