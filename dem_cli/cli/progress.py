"""What `dem run` shows while it runs: a bar on a terminal, plain lines in a log. All of it on stderr."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

from dem_cli.scenario import Scenario
from dem_cli.state import Frame

LOG_EVERY = 10.0  # s of wall time between two lines in a log
PACKING_EVERY = 1.0  # s that a packing takes until it is shown, and between two lines of it in a log
DRAW_EVERY = 0.2  # s between two updates of the bar
SPEED_OVER = 10.0  # s of wall time that the speed is an average of


class Progress:
    """A listener of `run_scenario`; a context manager. verbosity -1: silent."""

    def __init__(self, scenario: Scenario, verbosity: int = 0) -> None:
        self.scenario = scenario
        self.silent = verbosity < 0
        self._began = self._shown = time.monotonic()
        self._stage_began = 0.0
        self._marks: deque[tuple[float, int]] = deque()  # wall time and step of late frames
        self._row: Mapping[str, float] | None = None
        self._bar: Any = None
        self._task: Any = None

    def __enter__(self) -> Progress:
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

    def __call__(self, frame: Frame, row: Mapping[str, float] | None) -> None:
        self._row = row or self._row
        if frame.stage_start:
            self._stage_began = frame.time
        if frame.step > 0:  # compiling is over
            self._marks.append((time.monotonic(), frame.step))
        while len(self._marks) > 2 and self._marks[-1][0] - self._marks[0][0] > SPEED_OVER:
            self._marks.popleft()
        for warning in frame.warnings:
            self.say(f"warning: {warning}")
        stage = self.scenario.stages[frame.stage]
        if frame.stage_end and self._row:
            self.say(
                f"stage {frame.stage + 1}/{len(self.scenario.stages)} {stage.name}: t = {frame.time:.4g} s, "
                f"{frame.step} steps, void ratio {self._row['void_ratio']:.4f}: {frame.stop_reason}"
            )
        now = time.monotonic()
        if not self.silent and frame.step > 0 and now - self._shown >= (DRAW_EVERY if self._bar else LOG_EVERY):
            self._shown = now
            self._show(frame, stage.name)

    def _show(self, frame: Frame, name: str) -> None:
        words = self.words(frame)
        head = f"{frame.stage + 1}/{len(self.scenario.stages)} {name}"
        if self._bar:
            self._bar.update(self._task, description=head, completed=self._share(frame), words=words)
        else:
            self.say(f"[{head}] {words}")

    def words(self, frame: Frame) -> str:
        """Simulated time, speed, time left at most, kinetic energy and void ratio."""
        (began, first), (now, last) = self._marks[0], self._marks[-1]
        speed = (last - first) / (now - began) if now > began else 0.0
        left = self._steps_left(frame) / speed if speed > 0.0 else float("inf")
        parts = [f"t = {frame.time:.3f} s", f"{speed:,.0f} steps/s", f"at most {clock(left)} left"]
        if self._row:
            parts += [f"E_kin {self._row['kinetic']:.2e} J", f"e {self._row['void_ratio']:.4f}"]
        return ", ".join(parts)

    def _steps_left(self, frame: Frame) -> float:
        later = sum(stage.longest for stage in self.scenario.stages[frame.stage + 1 :])
        return max(self._end(frame) - frame.time + later, 0.0) / frame.dt

    def _end(self, frame: Frame) -> float:
        return self._stage_began + self.scenario.stages[frame.stage].longest

    def _share(self, frame: Frame) -> float:
        total = sum(stage.longest for stage in self.scenario.stages)
        before = sum(stage.longest for stage in self.scenario.stages[: frame.stage])
        here = self.scenario.stages[frame.stage].longest - (self._end(frame) - frame.time)
        return (before + here) / total


def clock(seconds: float) -> str:
    """12 s, 3 min 20 s, 2 h 5 min; a dash if unknown."""
    if seconds == float("inf"):
        return "-"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
