"""What `dem sweep` shows while it runs: a bar for the sweep and one for each running member, or plain lines in a log. All of it on stderr."""

from __future__ import annotations

import time
from typing import Any

from dem_cli.cli.bars import Bars
from dem_cli.pace import clock
from dem_cli.sweep.drive import Tally

LOG_EVERY = 10.0  # s of wall time between two lines in a log
MOST_BARS = 16  # of members that run at a time; a cluster may have hundreds


class SweepProgress(Bars):
    """A watcher of a sweep; a context manager. verbosity -1: silent."""

    def __init__(self, verbosity: int = 0) -> None:
        super().__init__(verbosity)
        self._logged = time.monotonic()
        self._whole: Any = None
        self._members: dict[str, Any] = {}

    def make(self, console: Any) -> Any:
        from rich.progress import BarColumn, Progress, TextColumn
        from rich.table import Column

        columns = (
            TextColumn("{task.description}", table_column=Column(no_wrap=True, max_width=40)),
            BarColumn(bar_width=20),
            TextColumn("{task.fields[words]}", table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1)),
        )
        bar = Progress(*columns, console=console, transient=True, expand=True)
        self._whole = bar.add_task("sweep", total=1.0, words="")
        return bar

    def show(self, tally: Tally) -> None:
        if self.bar:
            self._draw(tally)
        elif not self.silent and time.monotonic() - self._logged >= LOG_EVERY:
            self._logged = time.monotonic()
            running = ", ".join(f"{job.name} {job.share:.0%}" for job in tally.running[:4])
            more = f" and {len(tally.running) - 4} more" if len(tally.running) > 4 else ""
            self.say(f"[{told(tally)}] {running}{more}".rstrip())

    def _draw(self, tally: Tally) -> None:
        known = tally.total - tally.open
        begun = sum(job.share for job in tally.running if job.member)
        self.bar.update(self._whole, completed=(known + begun) / max(tally.total, 1), words=told(tally))
        shown = {job.key: job for job in tally.running[:MOST_BARS]}
        for key in [key for key in self._members if key not in shown]:
            self.bar.remove_task(self._members.pop(key))
        for key, job in shown.items():
            if key not in self._members:
                self._members[key] = self.bar.add_task(job.name, total=1.0, words="")
            self.bar.update(self._members[key], completed=job.share, words=job.words or "starting")


def told(tally: Tally) -> str:
    """5 of 18 done, 2 running, 1 failed, 7 min left."""
    running = sum(1 for job in tally.running if job.member)
    preparing = len(tally.running) - running
    parts = [f"{tally.done + tally.skipped} of {tally.total} done"]
    parts += [f"{preparing} being prepared"] if preparing else []
    parts += [f"{running} running"] if running and tally.at_once else []
    parts += ["waiting for workers"] if not tally.at_once else []
    parts += [f"{len(tally.failed)} failed"] if tally.failed else []
    if tally.open and tally.seconds:
        parts.append(f"about {clock(tally.seconds_left)} left")
    return ", ".join(parts)
