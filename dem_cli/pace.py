"""How far a run is: what share of it is done, how fast it goes, and where it is, in words. A listener of `run_scenario` asks this."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from typing import Any

from dem_cli.rigid import BodyFrame
from dem_cli.scenario import ImpulseScenario, QuasiStaticScenario, Scenario
from dem_cli.state import Frame, Increment

SPEED_OVER = 10.0  # s of wall time that the speed is an average of


class Pace(ABC):
    """Of one run, told of each of its states by `note`. begin, until: stages (from 0) with which it begins, and before which it stops."""

    def __init__(
        self, scenario: Scenario | QuasiStaticScenario | ImpulseScenario, begin: int = 0, until: int | None = None
    ) -> None:
        self.scenario = scenario
        self.begin = begin
        self.until = len(scenario.stages) if until is None else until
        self._marks: deque[tuple[float, int]] = deque()  # wall time and count of late states
        self.row: Mapping[str, float] | None = None

    def note(self, state: Frame | Increment | BodyFrame, row: Mapping[str, float] | None) -> None:
        """row: of the series, where the state has one."""
        self.row = row or self.row
        if self.count(state) > 0:  # compiling is over
            self._marks.append((time.monotonic(), self.count(state)))
        while len(self._marks) > 2 and self._marks[-1][0] - self._marks[0][0] > SPEED_OVER:
            self._marks.popleft()

    @property
    def speed(self) -> float:
        """Counts a second of late."""
        if not self._marks:
            return 0.0
        (began, first), (now, last) = self._marks[0], self._marks[-1]
        return (last - first) / (now - began) if now > began else 0.0

    @abstractmethod
    def count(self, state: Any) -> int:
        """What speed is counted in: time steps or increments."""

    @abstractmethod
    def reached(self, state: Any, row: Mapping[str, float]) -> str:
        """Where a stage has ended."""

    @abstractmethod
    def words(self, state: Any) -> str:
        """Where the run is now."""

    @abstractmethod
    def share(self, state: Any) -> float:
        """How much of the run is done, 0 to 1."""


class TimePace(Pace):
    """Of a run over time, of grains or of rigid bodies."""

    scenario: Scenario | ImpulseScenario
    _stage_began = 0.0

    def note(self, state: Frame | Increment | BodyFrame, row: Mapping[str, float] | None) -> None:
        if isinstance(state, Frame | BodyFrame) and state.stage_start:
            self._stage_began = state.time
        super().note(state, row)

    def count(self, state: Frame | BodyFrame) -> int:
        return state.step

    def reached(self, state: Frame | BodyFrame, row: Mapping[str, float]) -> str:
        voids = f", void ratio {row['void_ratio']:.4f}" if math.isfinite(row["void_ratio"]) else ""
        return f"t = {state.time:.4g} s, {state.step} steps{voids}"

    def words(self, state: Frame | BodyFrame) -> str:
        """Simulated time, speed, time left at most, kinetic energy, and void ratio where there is one."""
        speed = self.speed
        left = self._steps_left(state) / speed if speed > 0.0 else float("inf")
        parts = [f"t = {state.time:.3f} s", f"{speed:,.0f} steps/s", f"at most {clock(left)} left"]
        if self.row:
            parts.append(f"E_kin {self.row['kinetic']:.2e} J")
            parts += [f"e {self.row['void_ratio']:.4f}"] if math.isfinite(self.row["void_ratio"]) else []
        return ", ".join(parts)

    def _steps_left(self, frame: Frame | BodyFrame) -> float:
        later = sum(stage.longest for stage in self.scenario.stages[frame.stage + 1 : self.until])
        return max(self._end(frame) - frame.time + later, 0.0) / frame.dt

    def _end(self, frame: Frame | BodyFrame) -> float:
        return self._stage_began + self.scenario.stages[frame.stage].longest

    def share(self, state: Frame | BodyFrame) -> float:
        total = sum(stage.longest for stage in self.scenario.stages[self.begin : self.until])
        before = sum(stage.longest for stage in self.scenario.stages[self.begin : state.stage])
        here = self.scenario.stages[state.stage].longest - (self._end(state) - state.time)
        return min(max((before + here) / total, 0.0), 1.0)


class IncrementPace(Pace):
    """Of a quasi-static test."""

    scenario: QuasiStaticScenario

    def count(self, state: Increment) -> int:
        return state.number

    def reached(self, state: Increment, row: Mapping[str, float]) -> str:
        return f"{state.in_stage} increments, {condition(row)}, void ratio {row['void_ratio']:.4f}"

    def words(self, state: Increment) -> str:
        """Increment of those planned, stresses and strains, iterations of the last increment, time left."""
        planned = self.scenario.stages[state.stage].planned
        parts = [f"increment {state.in_stage} of {'about ' if self._guessed(state) else ''}{planned}"]
        if self.row:
            parts.append(condition(self.row))
        speed, left = self.speed, self._left(state)
        parts.append(f"{state.iterations} iterations")
        parts.append(f"{'about ' if speed > 0.0 else ''}{clock(left / speed if speed > 0.0 else float('inf'))} left")
        return ", ".join(parts)

    def _guessed(self, increment: Increment) -> bool:
        """Between limits of stress nobody knows the strains beforehand."""
        return self.scenario.stages[increment.stage].kind == "cyclic"

    def _left(self, increment: Increment) -> int:
        later = sum(stage.planned for stage in self.scenario.stages[increment.stage + 1 : self.until])
        return max(self.scenario.stages[increment.stage].planned - increment.in_stage, 0) + later

    def share(self, state: Increment) -> float:
        planned = sum(stage.planned for stage in self.scenario.stages[self.begin : self.until])
        return 1.0 - self._left(state) / max(1, planned)


def condition(row: Mapping[str, float]) -> str:
    """Stresses and strains of a sample in few words: shear strain, s1/s2 and volumetric strain once it is sheared, else the mean stress."""
    if row["shear_strain"] == 0.0:
        return f"mean stress {row['mean_stress'] / 1000.0:.4g} kPa"
    words = f"shear strain {100.0 * row['shear_strain']:.3g} %, s1/s2 {row['stress_ratio']:.3f}"
    words += f", volumetric strain {100.0 * row['volumetric_strain']:.3g} %"
    return (
        words if math.isnan(row["pore_pressure"]) else f"{words}, pore pressure {row['pore_pressure'] / 1000.0:.4g} kPa"
    )


def pace_of(
    scenario: Scenario | QuasiStaticScenario | ImpulseScenario, begin: int = 0, until: int | None = None
) -> Pace:
    """That of a scenario's kind of run."""
    return (IncrementPace if isinstance(scenario, QuasiStaticScenario) else TimePace)(scenario, begin, until)


def clock(seconds: float) -> str:
    """12 s, 3 min 20 s, 2 h 5 min; a dash if unknown."""
    if seconds == float("inf"):
        return "-"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
