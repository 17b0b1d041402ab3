"""Workers on this machine: a process each, fed by a thread."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from dem_cli.sweep.process import Tell, WorkerProcess
from dem_cli.sweep.task import Answer, Task


class Workers(Protocol):
    """Where tasks are done. slots: how many to hand out; at_once: how many of them are worked on at a time."""

    @property
    def slots(self) -> int: ...

    @property
    def at_once(self) -> int: ...

    def submit(self, task: Task, tell: Tell) -> Future[Answer]:
        """tell: told how far the task is; called from another thread."""
        ...

    def stop(self) -> None:
        """Interrupt what is running: its answer is `stopped`."""
        ...

    def close(self) -> None: ...


class LocalWorkers:
    """As many processes as asked for, each of which does one task at a time on one core."""

    def __init__(self, jobs: int, process: Callable[[], WorkerProcess] = WorkerProcess) -> None:
        self.slots = self.at_once = jobs
        self._stopped = threading.Event()
        self._idle: queue.SimpleQueue[WorkerProcess] = queue.SimpleQueue()
        for _ in range(jobs):
            self._idle.put(process())
        self._threads = ThreadPoolExecutor(jobs)

    def submit(self, task: Task, tell: Tell) -> Future[Answer]:
        return self._threads.submit(self._do, task, tell)

    def _do(self, task: Task, tell: Tell) -> Answer:
        if self._stopped.is_set():
            return Answer("stopped")
        worker = self._idle.get()
        try:
            return worker.do(task, tell, self._stopped.is_set)
        finally:
            self._idle.put(worker)

    def stop(self) -> None:
        self._stopped.set()

    def close(self) -> None:
        self._stopped.set()
        self._threads.shutdown()
        while not self._idle.empty():
            self._idle.get().close()
