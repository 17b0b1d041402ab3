"""When outputs are due: at whole multiples of their intervals, counted from the start of the run, and at the end of a stage."""

from __future__ import annotations

import math

from dem_cli.scenario.impulse_tables import ImpulseOutput
from dem_cli.scenario.tables import Output

NEAR = 1e-9  # of an interval: two moments this close are one


class Schedule:
    """Moments of one stage that starts at `start` [s] and lasts at most `longest` [s]."""

    def __init__(self, output: Output | ImpulseOutput, start: float, longest: float) -> None:
        self.end = start + longest
        self.intervals = {"series": output.interval, "frames": output.frames}
        if output.tracks:
            self.intervals["tracks"] = output.tracks.interval
        self._slack = NEAR * min(self.intervals.values())

    def over(self, time: float) -> bool:
        """Whether the stage has had its longest time."""
        return time >= self.end - self._slack

    def next(self, time: float) -> tuple[float, frozenset[str]]:
        """The next moment after `time` [s], and the outputs that are due at it."""
        moments = {name: (math.floor(time / every + NEAR) + 1) * every for name, every in self.intervals.items()}
        moment = min(self.end, *moments.values())
        due = frozenset(name for name, at in moments.items() if at <= moment + self._slack)
        if moment >= self.end - self._slack:
            moment = self.end
        return moment, due
