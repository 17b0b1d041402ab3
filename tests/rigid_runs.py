"""Short runs of the impulse engine, from scenario text or from shipped scenarios."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from dem_cli.assembly.scene import build_scene
from dem_cli.engines.impulse.engine import ImpulseEngine
from dem_cli.rigid import BodyFrame
from dem_cli.scenario import ImpulseScenario, load_scenario, parse_scenario
from dem_cli.scenario.shipped import folder
from dem_cli.state import Floats

HEAD = """
engine = "impulse"
[integration]
time_step = "1 ms"
[output]
interval = "10 ms"
frames = "1 s"
"""


@dataclass
class Run:
    """Frames of a run that are due for tracks or the series, in time."""

    engine: ImpulseEngine
    frames: list[BodyFrame]

    @property
    def time(self) -> Floats:
        return np.array([frame.time for frame in self.frames])

    def of(self, name: str, body: int = 0) -> Floats:
        """x, q, v or w of a body over the frames."""
        return np.array([getattr(frame.bodies, name)[body] for frame in self.frames])

    @property
    def last(self) -> BodyFrame:
        return self.frames[-1]


def engine_of(scenario: ImpulseScenario) -> ImpulseEngine:
    return ImpulseEngine(scenario, build_scene(scenario, lambda _: None))


def shipped(name: str, *overrides: str) -> Run:
    """A shipped scenario, run to its end."""
    return run(cast(ImpulseScenario, load_scenario(folder() / f"{name}.toml", overrides)))


def written(text: str, *overrides: str) -> Run:
    """Tables behind HEAD, run to their end."""
    return run(cast(ImpulseScenario, parse_scenario(HEAD + text, overrides=overrides)))


def run(scenario: ImpulseScenario) -> Run:
    engine = engine_of(scenario)
    return Run(engine, list(engine.frames()))
