"""The other end of a worker process: starts it, hands it a task, and listens until it answers or dies."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import Any

from dem_cli.sweep.task import Answer, Task

# One core for each: what the libraries below start by themselves would only get into each other's way.
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("NUMBA", "OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM")}
PATIENCE = 20.0  # s that a process gets to write down what it has when it is told to stop
ASK_EVERY = 0.5  # s between two looks whether the sweep is to stop

Tell = Callable[[float, str], None]  # share of the task that is done, and words


class WorkerProcess:
    """A process that does one task after the other; begun when the first comes, and anew after a crash."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._log: Any = None

    def do(self, task: Task, tell: Tell, stopped: Callable[[], bool]) -> Answer:
        """The answer to a task. stopped: asked twice a second; once it is true the run is interrupted and what it has is kept."""
        began = time.monotonic()
        process = self._running()
        assert process.stdin is not None
        try:
            process.stdin.write(task.to_json().encode() + b"\n")
            process.stdin.flush()
            answer = self._listen(process, tell, stopped)
        except (BrokenPipeError, OSError) as error:
            answer = None if process.poll() is not None else Answer("lost", str(error))
        if answer is None:
            answer = Answer("lost", self._obituary(process), time.monotonic() - began)
            self.close()
        return answer

    def close(self) -> None:
        """End the process; it interrupts what it does."""
        process, self._process = self._process, None
        if process is None:
            return
        assert process.stdin is not None
        assert process.stdout is not None
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        self._log.close()

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is not None:
            self.close()
        if self._process is None:
            self._log = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
            self._process = subprocess.Popen(
                [sys.executable, "-m", "dem_cli.sweep.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._log,
                env=os.environ | ONE_THREAD,
                start_new_session=True,  # Ctrl-C comes to the sweep alone, which then tells its workers
            )
        return self._process

    def _listen(self, process: subprocess.Popen[bytes], tell: Tell, stopped: Callable[[], bool]) -> Answer | None:
        """None if the process ends without an answer."""
        deadline = float("inf")
        for line in _lines(process):
            if line:
                raw = json.loads(line)
                if "end" in raw:
                    return Answer.from_raw(raw)
                tell(raw["share"], raw["words"])
            if deadline == float("inf") and stopped():
                process.send_signal(signal.SIGTERM)
                deadline = time.monotonic() + PATIENCE
            if time.monotonic() > deadline:
                process.kill()
                return Answer("stopped", "did not answer")
        return Answer("stopped") if deadline < float("inf") else None

    def _obituary(self, process: subprocess.Popen[bytes]) -> str:
        """How a process that is gone came to its end."""
        code = process.wait()
        self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, self._log.tell() - 4000))
        said = self._log.read().decode(errors="replace").strip().splitlines()
        last = f": {said[-1]}" if said else ""
        if code < 0:
            name = signal.Signals(-code).name
            why = ", perhaps for want of memory" if -code == signal.SIGKILL else ""
            return f"its process was ended by {name}{why}{last}"
        return f"its process ended with code {code}{last}"


def _lines(process: subprocess.Popen[bytes]) -> Iterator[bytes]:
    """Lines that the process writes, and an empty one twice a second, until it closes its end."""
    assert process.stdout is not None
    handle, rest = process.stdout.fileno(), b""
    while True:
        ready, _, _ = select.select([handle], [], [], ASK_EVERY)
        if not ready:
            yield b""
            continue
        got = os.read(handle, 65536)
        if not got:
            return
        *lines, rest = (rest + got).split(b"\n")
        yield from lines
