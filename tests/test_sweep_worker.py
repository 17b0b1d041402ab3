"""The process that runs members: its answers, how it is stopped, and what becomes of it when things go wrong."""

from __future__ import annotations

import io
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest
from sweep_text import sweep_text
from test_run_prepared import assert_same

from dem_cli.errors import RunError
from dem_cli.results import open_results
from dem_cli.results.provenance import program_identity
from dem_cli.run import run_scenario
from dem_cli.scenario import parse_scenario
from dem_cli.sweep import worker
from dem_cli.sweep.process import WorkerProcess
from dem_cli.sweep.task import Answer, Task

LONG = {"stage": [{"kind": "run", "duration": "500 s"}], "output.frames": "10 s"}


def task_of(folder: Path, text: str | None = None, **changes: Any) -> Task:
    text = text or sweep_text()
    scenario = parse_scenario(text)
    plain = Task("key", text, "box.toml", str(folder), (), scenario.hash, str(folder / "out.h5"), program_identity())
    return replace(plain, **changes)


def no_words(_share: float, _words: str) -> None:
    pass


def test_a_preparation_and_a_member_through_a_process(tmp_path: Path) -> None:
    """The same bits as in this process, with one packing for both."""
    told: list[tuple[float, str]] = []
    first = task_of(tmp_path, stages=1, target=str(tmp_path / "first.h5"), state=str(tmp_path / "first.state"))
    second = task_of(tmp_path, prepared=(first.target, first.state), begin=1)
    process = WorkerProcess()
    try:
        for task in (first, second):
            answer = process.do(task, lambda share, words: told.append((share, words)), lambda: False)
            assert (answer.end, answer.reason) == ("done", "")
            assert answer.seconds > 0.0
    finally:
        process.close()
    assert_same(run_scenario(parse_scenario(sweep_text()), tmp_path / "direct.h5"), tmp_path / "out.h5")
    assert all(0.0 <= share <= 1.0 for share, _ in told)
    assert any("steps/s" in words for _, words in told)


@pytest.mark.parametrize(
    ("changes", "end", "reason"),
    [
        ({"hash": "0"}, "refused", "has changed since the sweep began. Start the sweep again"),
        ({"program": "dem-cli 0.0.1 (abc)"}, "strange", "the sweep dem-cli 0.0.1 (abc)"),
        ({"overrides": ("contact.friction=-1",)}, "refused", "[contact] friction = -1: is out of range"),
        ({"target": "/nowhere/out.h5"}, "hindered", "the folder /nowhere does not exist"),
        ({"prepared": ("none.h5", "none.state")}, "hindered", "none.state"),
    ],
)
def test_whatever_goes_wrong_is_an_answer(tmp_path: Path, changes: dict[str, Any], end: str, reason: str) -> None:
    answer = worker.perform(task_of(tmp_path, **changes), no_words)
    assert answer.end == end
    assert reason in answer.reason
    assert len(answer.reason.splitlines()) == 1


@pytest.mark.parametrize(
    ("error", "end"),
    [
        (RunError("grain 3 has left"), "failed"),
        (RunError("out.partial.h5: cannot write (No space left on device). What was written"), "full"),
        (OSError(28, "No space left on device"), "full"),
        (PermissionError(13, "Permission denied"), "hindered"),
        (MemoryError(), "hindered"),
        (ZeroDivisionError("division by zero"), "failed"),
        (KeyboardInterrupt(), "stopped"),
    ],
)
def test_errors_of_a_run_are_told_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, end: str
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(worker, "_run", fail)
    assert worker.perform(task_of(tmp_path), no_words).end == end


def test_answers_are_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "IDLE", 0.2)
    out = io.StringIO()
    strange = task_of(tmp_path, program="another")
    ours, theirs = os.pipe()
    with os.fdopen(ours) as tasks, os.fdopen(theirs, "w") as feed:
        feed.write(2 * f"{strange.to_json()}\n")
        feed.flush()
        worker.serve(tasks, out)
        feed.close()
    answers = [Answer.from_raw(json.loads(line)) for line in out.getvalue().splitlines()]
    assert [one.end for one in answers] == ["strange", "strange"]
    assert Task.from_json(strange.to_json()) == strange


def test_a_task_of_a_sweep_that_has_ended_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was killed while this process was starting: nobody would interrupt the task."""
    monkeypatch.setattr(worker, "perform", lambda *_: pytest.fail("begun"))
    got = queue.Queue.get

    def late(self: Any, **options: Any) -> Any:
        while self.qsize() < 2:  # the task and the end
            time.sleep(0.01)
        return got(self, **options)

    monkeypatch.setattr(queue.Queue, "get", late)
    out = io.StringIO()
    worker.serve(io.StringIO("{}\n"), out)
    assert out.getvalue() == ""


def test_a_process_keeps_to_one_core() -> None:
    process = WorkerProcess()
    try:
        settings = psutil.Process(process._running().pid).environ()
    finally:
        process.close()
    assert {settings[f"{name}_NUM_THREADS"] for name in ("NUMBA", "OMP", "OPENBLAS", "MKL")} == {"1"}


def test_a_process_without_work_ends_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "IDLE", 0.05)
    ours, theirs = os.pipe()
    with os.fdopen(ours) as tasks:
        worker.serve(tasks, io.StringIO())  # returns though nobody has closed the other end
        os.close(theirs)


def test_a_run_is_stopped_and_what_it_has_is_kept(tmp_path: Path) -> None:
    running = threading.Event()
    process = WorkerProcess()
    try:
        answer = process.do(task_of(tmp_path, sweep_text(None, LONG)), lambda *_: running.set(), running.is_set)
    finally:
        process.close()
    assert answer.end == "stopped"
    with open_results(tmp_path / "out.partial.h5") as results:
        assert results.stop_reason == "interrupted"


def test_a_process_that_is_killed_is_lost_and_the_next_one_works(tmp_path: Path) -> None:
    process = WorkerProcess()

    def kill(_share: float, _words: str) -> None:
        assert process._process is not None
        process._process.kill()

    try:
        answer = process.do(task_of(tmp_path, sweep_text(None, LONG)), kill, lambda: False)
        assert answer.end == "lost"
        assert answer.reason == "its process was ended by SIGKILL, perhaps for want of memory"
        again = process.do(task_of(tmp_path, program="another"), no_words, lambda: False)
        assert again.end == "strange"
    finally:
        process.close()


def test_no_member_outlives_its_sweep(tmp_path: Path) -> None:
    """The process ends when the other end of its pipe is gone, though nobody told it to."""
    task = task_of(tmp_path, sweep_text(None, LONG))
    ours = subprocess.Popen(
        [sys.executable, "-m", "dem_cli.sweep.worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert ours.stdin is not None
    assert ours.stdout is not None
    ours.stdin.write(task.to_json() + "\n")
    ours.stdin.flush()
    assert "share" in ours.stdout.readline()
    ours.stdin.close()  # alone: a word to nobody would end it, too, but later
    try:
        assert ours.wait(20.0) in (0, -signal.SIGTERM)
    finally:
        ours.kill()
        ours.stdout.close()
    with open_results(tmp_path / "out.partial.h5") as results:
        assert not results.complete
