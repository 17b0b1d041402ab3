"""The process that runs members of a sweep, one after the other: `python -m dem_cli.sweep.worker`.

It reads a task a line from its standard input and writes a line of JSON for each word on how far it is, and for each answer. A process
of its own keeps a crash from the others, and lets a signal stop it between two calls of kernels. It ends when its input does: no member
outlives its sweep.
"""

from __future__ import annotations

import errno
import json
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TextIO

from dem_cli.errors import DemError, RunError, ScenarioError
from dem_cli.results.provenance import program_identity
from dem_cli.sweep.task import Answer, Task
from dem_cli.whole import whole

TELL_EVERY = 0.5  # s between two words on how far a member is
IDLE = 60.0  # s without a task after which the process ends; a new one is started when there is work again


class Told:
    """A listener of a run that tells how far it is, as share and words."""

    def __init__(self, pace: Any, tell: Callable[[float, str], None]) -> None:
        self._pace, self._tell = pace, tell
        self._last = 0.0

    def __call__(self, state: Any, row: Mapping[str, float] | None) -> None:
        self._pace.note(state, row)
        if self._due():
            self._tell(self._pace.share(state), self._pace.words(state))

    def packing(self, words: str) -> None:
        if self._due():
            self._tell(0.0, f"packing: {words}")

    def _due(self) -> bool:
        now = time.monotonic()
        if now - self._last < TELL_EVERY:
            return False
        self._last = now
        return True


def perform(task: Task, tell: Callable[[float, str], None]) -> Answer:
    """Do a task in this process. Whatever goes wrong is in the answer."""
    began = time.monotonic()

    def ended(end: Any, reason: str = "") -> Answer:
        return Answer(end, reason, time.monotonic() - began)

    if task.program != program_identity():
        return ended("strange", f"this worker runs {program_identity()}, the sweep {task.program}")
    try:
        _run(task, tell)
    except KeyboardInterrupt:
        return ended("stopped")
    except ScenarioError as error:
        return ended("refused", _line(error))
    except (DemError, OSError) as error:
        why = "full" if disk_is_full(error) else "failed" if isinstance(error, RunError) else "hindered"
        return ended(why, _line(error))
    except MemoryError:
        return ended("hindered", "out of memory. Run fewer members at a time (--jobs)")
    except Exception as error:  # a fault of ours must not take the others along
        return ended("failed", f"{type(error).__name__}: {_line(error)} (a fault of the program)")
    return ended("done")


def _run(task: Task, tell: Callable[[float, str], None]) -> None:
    from dem_cli.pace import pace_of
    from dem_cli.run import Preparation, prepare_scenario, run_scenario
    from dem_cli.scenario import parse_scenario

    scenario = parse_scenario(task.text, task.origin, task.folder, task.overrides)
    if scenario.hash != task.hash:
        raise ScenarioError(
            "the scenario, or a file that it names, has changed since the sweep began. Start the sweep again"
        )
    prepared = None
    if task.prepared:
        prepared = Preparation(Path(task.prepared[0]), Path(task.prepared[1]).read_bytes())
    told = Told(pace_of(scenario, task.begin, task.stages), tell)
    target = Path(task.target)
    if task.stages is None:
        run_scenario(scenario, target, force=True, listener=told, packing_listener=told.packing, prepared=prepared)
        return
    found = prepare_scenario(
        scenario, task.stages, target, listener=told, packing_listener=told.packing, prepared=prepared
    )
    with whole(Path(task.state)) as fresh:
        fresh.write_bytes(found.state)


def disk_is_full(error: BaseException | None) -> bool:
    """Whether this, or what caused it, is a full disk or quota."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        if isinstance(error, RunError) and os.strerror(errno.ENOSPC) in str(error):
            return True
        error = error.__cause__
    return False


def _line(error: BaseException) -> str:
    """Its message in one line."""
    return "; ".join(str(error).splitlines()) or type(error).__name__


def serve(tasks: TextIO, out: TextIO) -> None:
    """Answer tasks until none has come for a while; the last one is interrupted where the input ends before it does."""
    waiting: queue.Queue[str | None] = queue.Queue()
    busy, ended = threading.Event(), threading.Event()

    def listen() -> None:
        for line in tasks:
            waiting.put(line)
        ended.set()
        waiting.put(None)
        if busy.is_set():  # nobody is there to hear the answer
            os.kill(os.getpid(), signal.SIGTERM)

    def say(**words: Any) -> None:
        print(json.dumps(words), file=out, flush=True)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        try:
            line = waiting.get(timeout=IDLE)
        except queue.Empty:
            return
        if line is None:
            return
        busy.set()
        if ended.is_set():  # before it was begun, so that nobody would interrupt it
            return
        answer = perform(Task.from_json(line), lambda share, words: say(share=share, words=words))
        busy.clear()
        print(answer.to_json(), file=out, flush=True)


def main() -> None:
    """Entry of the process. What libraries print goes to the log, not between the answers."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    try:
        serve(sys.stdin, out)
    except (KeyboardInterrupt, BrokenPipeError):
        os._exit(0)


if __name__ == "__main__":
    main()
