"""The time step of the impulse engine: given, or by its rule."""

from __future__ import annotations

import math
from typing import Any

import pytest
from impulse_text import BOX, PLACED, drop, pour

from dem_cli.assembly import build_scene
from dem_cli.engines.impulse.timestep import (
    choose_time_step,
    fall_height,
    largest_speed,
    smallest_size,
    time_step_limits,
)
from dem_cli.rigid import Scene
from dem_cli.scenario import ImpulseScenario, parse_scenario


def built(text: str) -> tuple[ImpulseScenario, Scene]:
    scenario = parse_scenario(text)
    assert isinstance(scenario, ImpulseScenario)
    return scenario, build_scene(scenario)


def test_given() -> None:
    assert choose_time_step(*built(drop({"integration": {"time_step": "3 ms"}}))) == 0.003


def test_rule() -> None:
    """A twentieth of the smallest reach, 1.5 m x 0.5, at the speed of the fall by 1.6 m."""
    scenario, scene = built(drop({"grains.scale": 0.5, "container": {"gravity": "10 m/s^2"}}))
    assert smallest_size(scene) == pytest.approx(0.75)
    assert fall_height(scenario, scene) == pytest.approx(1.6)
    assert largest_speed(scenario, scene) == pytest.approx(math.sqrt(32.0))
    assert choose_time_step(scenario, scene) == pytest.approx(0.05 * 0.75 / math.sqrt(32.0))


@pytest.mark.parametrize(
    ("changes", "height"),
    [
        ({"plane": []}, 0.0),
        ({"plane": [{"slope": "45 deg"}]}, 1.6),
        ({"plane": [{"slope": "45 deg"}], "grains.position": ["1 m", "0 m", "1.6 m"]}, 2.6),
        ({"plane": [{}, {"point": ["0 m", "0 m", "1 m"]}]}, 0.6),
        ({"plane": [{"normal": [1, 0, 0]}, {"normal": [0, 0, -1]}]}, 0.0),
        (
            {
                "plane": [{"normal": [-1, 0, 0], "point": ["5 m", "0 m", "0 m"]}],
                "container": {"gravity_direction": [1, 0, 0]},
            },
            5.0,
        ),
    ],
    ids=str,
)
def test_height_of_the_fall(changes: dict[str, Any], height: float) -> None:
    """Along gravity, to the first plane that faces it."""
    assert fall_height(*built(drop(changes))) == pytest.approx(height)


def test_given_speeds_and_shaking_count() -> None:
    none = {"container": {"gravity": "0 m/s^2"}}
    spin = {
        "grains": BOX | PLACED | {"velocity": ["3 m/s", "4 m/s", "0 m/s"], "spin": ["0 rad/s", "2 rad/s", "0 rad/s"]}
    }
    assert largest_speed(*built(drop(none | spin))) == pytest.approx(5.0 + 2.0 * 1.5)
    shake = {"kind": "shake", "amplitude": "1 m/s^2", "frequency": "2 Hz", "duration": "1 s"}
    assert largest_speed(*built(drop(none | spin | {"stage": [shake]}))) == pytest.approx(8.0 + 1.0 / (2.0 * math.pi))


def test_a_short_run_is_over_before_the_fall() -> None:
    scenario, scene = built(drop({"grains.position": ["0 m", "0 m", "1 km"]}))
    assert largest_speed(scenario, scene) == pytest.approx(9.80665 * 1.0)


def test_something_always_moves() -> None:
    """At rest on the floor: the speed of a fall through half of the reach; without gravity a size in the time of the run."""
    assert largest_speed(*built(drop({"grains.position": ["0 m", "0 m", "0 m"]}))) == pytest.approx(
        math.sqrt(9.80665 * 1.5)
    )
    assert largest_speed(*built(drop({"container": {"gravity": "0 m/s^2"}}))) == pytest.approx(1.5)


def test_limits_of_output_and_shaking() -> None:
    limits = time_step_limits(
        *built(pour({"output": {"interval": "2 ms", "frames": "1 s", "tracks": {"grains": [0], "interval": "50 us"}}}))
    )
    assert {name: limits[name] for name in limits if name != "motion"} == pytest.approx(
        {
            "output.interval": 2e-3,
            "output.frames": 1.0,
            "output.tracks.interval": 50e-6,
            "a hundredth of the period of stage 2": 1e-3,
        }
    )
    assert choose_time_step(
        *built(pour({"output": {"tracks": {"grains": [0], "interval": "50 us"}}}))
    ) == pytest.approx(50e-6)
