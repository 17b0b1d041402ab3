"""What `dem run` shows while it runs: a bar on a terminal, plain lines in a log. All of it on stderr."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from dem_cli.cli.bars import Bars
from dem_cli.pace import pace_of
from dem_cli.rigid import BodyFrame
from dem_cli.scenario import ImpulseScenario, QuasiStaticScenario, Scenario
from dem_cli.state import Frame, Increment

LOG_EVERY = 10.0  # s of wall time between two lines in a log
PACKING_EVERY = 1.0  # s that a packing takes until it is shown, and between two lines of it in a log
DRAW_EVERY = 0.2  # s between two updates of the bar


class Progress(Bars):
    """A listener of `run_scenario`; a context manager. verbosity -1: silent."""

    def __init__(self, scenario: Scenario | QuasiStaticScenario | ImpulseScenario, verbosity: int = 0) -> None:
        super().__init__(verbosity)
        self.scenario = scenario
        self.pace = pace_of(scenario)
        self._began = self._shown = time.monotonic()
        self._task: Any = None

    def make(self, console: Any) -> Any:
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (TextColumn("{task.description}"), BarColumn(bar_width=None), TextColumn("{task.fields[words]}"))
        bar = Bar(*columns, console=console, transient=True)
        self._task = bar.add_task("starting", total=1.0, words="")
        return bar

    def packing(self, words: str) -> None:
        """Told what the packing is at; shown once it has taken a second, and then as often as a run is."""
        now = time.monotonic()
        if self.silent or now - self._shown < (DRAW_EVERY if self.bar else PACKING_EVERY):
            return
        if now - self._began > PACKING_EVERY:
            self._shown = now
            if self.bar:
                self.bar.update(self._task, description="packing", words=words)
            else:
                self.say(f"[packing] {words}")

    def __call__(self, state: Frame | Increment | BodyFrame, row: Mapping[str, float] | None) -> None:
        pace = self.pace
        pace.note(state, row)
        for warning in state.warnings:
            self.say(f"warning: {warning}")
        head = f"{state.stage + 1}/{len(self.scenario.stages)} {self.scenario.stages[state.stage].name}"
        if state.stage_end and pace.row:
            self.say(f"stage {head}: {pace.reached(state, pace.row)}: {state.stop_reason}")
        now = time.monotonic()
        if not self.silent and pace.count(state) > 0 and now - self._shown >= (DRAW_EVERY if self.bar else LOG_EVERY):
            self._shown = now
            words = pace.words(state)
            if self.bar:
                self.bar.update(self._task, description=head, completed=pace.share(state), words=words)
            else:
                self.say(f"[{head}] {words}")
