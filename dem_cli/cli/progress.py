"""What `dem run` shows while it runs: a bar on a terminal, plain lines in a log. All of it on stderr."""

from __future__ import annotations

import math
import sys
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from typing import Any, Self

from dem_cli.rigid import BodyFrame
from dem_cli.scenario import ImpulseScenario, QuasiStaticScenario, Scenario
from dem_cli.state import Frame, Increment

LOG_EVERY = 10.0  # s of wall time between two lines in a log
PACKING_EVERY = 1.0  # s that a packing takes until it is shown, and between two lines of it in a log
DRAW_EVERY = 0.2  # s between two updates of the bar
SPEED_OVER = 10.0  # s of wall time that the speed is an average of


class Progress(ABC):
    """A listener of `run_scenario`; a context manager. verbosity -1: silent. What it says of a state is up to the kind of run."""

    def __init__(self, scenario: Scenario | QuasiStaticScenario | ImpulseScenario, verbosity: int = 0) -> None:
        self.scenario = scenario
        self.silent = verbosity < 0
        self._began = self._shown = time.monotonic()
        self._marks: deque[tuple[float, int]] = deque()  # wall time and count of late states
        self._row: Mapping[str, float] | None = None
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Self:
        if not self.silent and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn
            from rich.progress import Progress as Bar

            columns = (TextColumn("{task.description}"), BarColumn(bar_width=None), TextColumn("{task.fields[words]}"))
            self._bar = Bar(*columns, console=Console(stderr=True), transient=True)
            self._bar.start()
            self._task = self._bar.add_task("starting", total=1.0, words="")
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def say(self, text: str) -> None:
        """A line for the reader, above the bar if there is one."""
        if self.silent:
            return
        if self._bar:
            self._bar.console.print(text, markup=False, highlight=False)
        else:
            print(text, file=sys.stderr, flush=True)

    def packing(self, words: str) -> None:
        """Told what the packing is at; shown once it has taken a second, and then as often as a run is."""
        now = time.monotonic()
        if self.silent or now - self._shown < (DRAW_EVERY if self._bar else PACKING_EVERY):
            return
        if now - self._began > PACKING_EVERY:
            self._shown = now
            if self._bar:
                self._bar.update(self._task, description="packing", words=words)
            else:
                self.say(f"[packing] {words}")

    def __call__(self, state: Frame | Increment | BodyFrame, row: Mapping[str, float] | None) -> None:
        self._row = row or self._row
        count = self.count(state)
        if count > 0:  # compiling is over
            self._marks.append((time.monotonic(), count))
        while len(self._marks) > 2 and self._marks[-1][0] - self._marks[0][0] > SPEED_OVER:
            self._marks.popleft()
        for warning in state.warnings:
            self.say(f"warning: {warning}")
        head = f"{state.stage + 1}/{len(self.scenario.stages)} {self.scenario.stages[state.stage].name}"
        if state.stage_end and self._row:
            self.say(f"stage {head}: {self.reached(state, self._row)}: {state.stop_reason}")
        now = time.monotonic()
        if not self.silent and count > 0 and now - self._shown >= (DRAW_EVERY if self._bar else LOG_EVERY):
            self._shown = now
            words = self.words(state)
            if self._bar:
                self._bar.update(self._task, description=head, completed=self.share(state), words=words)
            else:
                self.say(f"[{head}] {words}")

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


class TimeProgress(Progress):
    """Progress of a run over time, of grains or of rigid bodies."""

    scenario: Scenario | ImpulseScenario
    _stage_began = 0.0

    def __call__(self, state: Frame | Increment | BodyFrame, row: Mapping[str, float] | None) -> None:
        if isinstance(state, Frame | BodyFrame) and state.stage_start:
            self._stage_began = state.time
        super().__call__(state, row)

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
        if self._row:
            parts.append(f"E_kin {self._row['kinetic']:.2e} J")
            parts += [f"e {self._row['void_ratio']:.4f}"] if math.isfinite(self._row["void_ratio"]) else []
        return ", ".join(parts)

    def _steps_left(self, frame: Frame | BodyFrame) -> float:
        later = sum(stage.longest for stage in self.scenario.stages[frame.stage + 1 :])
        return max(self._end(frame) - frame.time + later, 0.0) / frame.dt

    def _end(self, frame: Frame | BodyFrame) -> float:
        return self._stage_began + self.scenario.stages[frame.stage].longest

    def share(self, state: Frame | BodyFrame) -> float:
        total = sum(stage.longest for stage in self.scenario.stages)
        before = sum(stage.longest for stage in self.scenario.stages[: state.stage])
        here = self.scenario.stages[state.stage].longest - (self._end(state) - state.time)
        return (before + here) / total


class IncrementProgress(Progress):
    """Progress of a quasi-static test."""

    scenario: QuasiStaticScenario

    def count(self, state: Increment) -> int:
        return state.number

    def reached(self, state: Increment, row: Mapping[str, float]) -> str:
        return f"{state.in_stage} increments, {condition(row)}, void ratio {row['void_ratio']:.4f}"

    def words(self, state: Increment) -> str:
        """Increment of those planned, stresses and strains, iterations of the last increment, time left."""
        planned = self.scenario.stages[state.stage].planned
        parts = [f"increment {state.in_stage} of {'about ' if self._guessed(state) else ''}{planned}"]
        if self._row:
            parts.append(condition(self._row))
        speed, left = self.speed, self._left(state)
        parts.append(f"{state.iterations} iterations")
        parts.append(f"{'about ' if speed > 0.0 else ''}{clock(left / speed if speed > 0.0 else float('inf'))} left")
        return ", ".join(parts)

    def _guessed(self, increment: Increment) -> bool:
        """Between limits of stress nobody knows the strains beforehand."""
        return self.scenario.stages[increment.stage].kind == "cyclic"

    def _left(self, increment: Increment) -> int:
        later = sum(stage.planned for stage in self.scenario.stages[increment.stage + 1 :])
        return max(self.scenario.stages[increment.stage].planned - increment.in_stage, 0) + later

    def share(self, state: Increment) -> float:
        return 1.0 - self._left(state) / max(1, self.scenario.planned)


def condition(row: Mapping[str, float]) -> str:
    """Stresses and strains of a sample in few words: shear strain, s1/s2 and volumetric strain once it is sheared, else the mean stress."""
    if row["shear_strain"] == 0.0:
        return f"mean stress {row['mean_stress'] / 1000.0:.4g} kPa"
    words = f"shear strain {100.0 * row['shear_strain']:.3g} %, s1/s2 {row['stress_ratio']:.3f}"
    words += f", volumetric strain {100.0 * row['volumetric_strain']:.3g} %"
    return (
        words if math.isnan(row["pore_pressure"]) else f"{words}, pore pressure {row['pore_pressure'] / 1000.0:.4g} kPa"
    )


def progress_of(scenario: Scenario | QuasiStaticScenario | ImpulseScenario, verbosity: int = 0) -> Progress:
    """The listener for a scenario's kind of run."""
    return (IncrementProgress if isinstance(scenario, QuasiStaticScenario) else TimeProgress)(scenario, verbosity)


def clock(seconds: float) -> str:
    """12 s, 3 min 20 s, 2 h 5 min; a dash if unknown."""
    if seconds == float("inf"):
        return "-"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
