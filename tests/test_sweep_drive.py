"""Running the members of a sweep: order, what fails and what is lost, with workers that do as they are told."""

from __future__ import annotations

import pickle
import queue
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import h5py
import pytest
from sweep_text import GAL_HZ, sweep_file

from dem_cli.cli.sweep_progress import told
from dem_cli.errors import RunError, ScenarioError
from dem_cli.results import partial_path
from dem_cli.results.manifest import read_manifest
from dem_cli.sweep.drive import Sweeping, Tally
from dem_cli.sweep.plan import make_plan
from dem_cli.sweep.process import Tell
from dem_cli.sweep.store import Store
from dem_cli.sweep.task import Answer, End, Task

REST = {"kind": "settle", "limit": "0.1 s", "name": "rest"}


def write(task: Task) -> None:
    """The files that a task is to leave."""
    with h5py.File(task.target, "w") as file:
        file.attrs.update({"complete": 1, "scenario_hash": task.hash, "program": "dem-cli", "program_version": "9"})
    if task.state:
        Path(task.state).write_bytes(pickle.STOP)


def write_preparation(store: Store, key: str) -> None:
    file, state = store.preparation(key)
    with h5py.File(file, "w") as results:
        results.attrs["complete"] = 1
    state.write_bytes(pickle.STOP)


class Obedient:
    """Workers that end each task as `ends` says, by the task's target, and note what they were given."""

    def __init__(self, ends: Callable[[Task], End] | None = None, slots: int = 2) -> None:
        self.slots = self.at_once = slots
        self.done: list[Task] = []
        self.stopped = False
        self._ends = ends or (lambda _: "done")

    def submit(self, task: Task, tell: Tell) -> Future[Answer]:
        future: Future[Answer] = Future()
        self.done.append(task)
        tell(0.5, "half way")
        end = self._ends(task)
        if end == "done":
            write(task)
        future.set_result(Answer(end, "" if end == "done" else f"it {end}", 3.0))
        return future

    def stop(self) -> None:
        self.stopped = True

    def close(self) -> None:
        pass


class Deaf:
    """Shows nothing, keeps what is said."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.shown: list[int] = []

    def show(self, tally: Tally) -> None:
        self.shown.append(tally.open)

    def say(self, text: str) -> None:
        self.said.append(text)


def sweeping(folder: Path, workers: Any, sweep: dict[str, Any] | None = None, **options: Any) -> Sweeping:
    plan = make_plan(sweep_file(folder, sweep or {"grid": GAL_HZ}, options.pop("changes", None)))
    store = Store(plan.manifest(folder / "out"))
    store.begin()
    return Sweeping(plan, store, workers, Deaf(), **options)


def names(workers: Obedient) -> list[str]:
    """The preparations by their stages, the members by name."""
    return [f"first {task.stages}" if task.stages else Path(task.target).stem[:-9] for task in workers.done]


def test_a_preparation_comes_first_and_all_start_from_it(tmp_path: Path) -> None:
    workers = Obedient()
    one = sweeping(tmp_path, workers)
    tally = one.run()
    assert names(workers) == ["first 1", "400gal-10Hz", "400gal-20Hz", "800gal-10Hz", "800gal-20Hz"]
    prepared = workers.done[0]
    assert prepared.prepared is None
    assert all(task.prepared == (prepared.target, prepared.state) for task in workers.done[1:])
    assert [task.begin for task in workers.done] == [0, 1, 1, 1, 1]
    assert (tally.done, tally.skipped, tally.failed, tally.open) == (4, 0, {}, 0)
    assert [(m.state, m.seconds) for m in read_manifest(tmp_path / "out").members] == [("done", 3.0)] * 4
    one.store.close()


def test_preparations_of_preparations(tmp_path: Path) -> None:
    grid = {"stage.shake.amplitude": ["400 gal", "800 gal"], "stage.rest.limit": ["0.1 s", "0.2 s"]}
    workers = Obedient(slots=1)
    stages = [
        {"kind": "settle", "limit": "0.3 s", "name": "packing"},
        {"kind": "shake", "amplitude": "400 gal", "frequency": "10 Hz", "duration": "0.1 s"},
        REST,
    ]
    sweeping(tmp_path, workers, {"grid": grid}, changes={"stage": stages}).run()
    assert names(workers)[:3] == ["first 1", "first 2", "first 2"]
    assert [task.begin for task in workers.done[:3]] == [0, 1, 1]
    assert len(workers.done) == 7


def test_what_is_done_is_not_done_again(tmp_path: Path) -> None:
    first = Obedient(lambda task: "hindered" if "800gal" in task.target else "done")
    one = sweeping(tmp_path, first)
    assert one.run().done == 2
    one.store.close()
    second = Obedient()
    again = sweeping(tmp_path, second)
    tally = again.run()
    assert names(second) == ["800gal-10Hz", "800gal-20Hz"]  # the preparation is there, too
    assert (tally.done, tally.skipped) == (2, 2)
    again.store.close()


def test_a_failure_is_recorded_and_the_rest_goes_on(tmp_path: Path) -> None:
    workers = Obedient(lambda task: "failed" if "400gal-20Hz" in task.target else "done")
    one = sweeping(tmp_path, workers)
    tally = one.run()
    assert tally.failed == {"400gal-20Hz": "it failed"}
    assert tally.done == 3
    one.store.close()
    record = next(m for m in read_manifest(tmp_path / "out").members if m.state == "failed")
    assert (record.name, record.reason) == ("400gal-20Hz", "it failed")


@pytest.mark.parametrize(("end", "runs"), [("failed", 0), ("refused", 0), ("hindered", 1)])
def test_what_would_fail_again_is_left_until_it_is_asked_for(tmp_path: Path, end: End, runs: int) -> None:
    """What the machine was to blame for is tried again by itself."""
    one = sweeping(tmp_path, Obedient(lambda task: end if "400gal-20Hz" in task.target else "done"))
    one.run()
    one.store.close()
    workers = Obedient()
    again = sweeping(tmp_path, workers)
    tally = again.run()
    again.store.close()
    assert len(workers.done) == runs
    assert len(tally.failed) == 1 - runs
    retried = sweeping(tmp_path, workers := Obedient(), retry=True)
    assert retried.run().failed == {}
    assert len(workers.done) == 1 - runs
    retried.store.close()


def test_a_process_that_dies_gets_a_second_chance(tmp_path: Path) -> None:
    lives = iter(["lost", "done"])
    once = Obedient(lambda task: next(lives) if "400gal-20Hz" in task.target else "done")  # type: ignore[arg-type,return-value]
    one = sweeping(tmp_path, once)
    assert one.run().failed == {}
    assert names(once).count("400gal-20Hz") == 2
    assert "400gal-20Hz: it lost; once more" in one.watcher.said  # type: ignore[attr-defined]
    one.store.close()


def test_and_no_third(tmp_path: Path) -> None:
    twice = Obedient(lambda task: "lost" if "400gal-20Hz" in task.target else "done")
    one = sweeping(tmp_path, twice)
    assert one.run().failed == {"400gal-20Hz": "it lost"}
    assert names(twice).count("400gal-20Hz") == 2
    one.store.close()


def test_a_fault_of_the_workers_is_not_one_of_the_sweep(tmp_path: Path) -> None:
    class Faulty(Obedient):
        def submit(self, task: Task, tell: Tell) -> Future[Answer]:
            if "400gal-20Hz" not in task.target:
                return super().submit(task, tell)
            future: Future[Answer] = Future()
            future.set_exception(ConnectionError("gone"))
            return future

    one = sweeping(tmp_path, Faulty())
    tally = one.run()
    assert (tally.done, tally.failed) == (3, {"400gal-20Hz": "ConnectionError: gone"})
    one.store.close()


def test_a_result_file_that_does_not_come_counts_as_lost(tmp_path: Path) -> None:
    class Liar(Obedient):
        def submit(self, task: Task, tell: Tell) -> Future[Answer]:
            future = super().submit(task, tell)
            if "800gal-20Hz" in task.target:
                Path(task.target).unlink()
            return future

    one = sweeping(tmp_path, Liar())
    assert one.run().failed == {"800gal-20Hz": "its result file has not come"}
    one.store.close()


def test_members_of_a_preparation_that_fails_fail_with_it(tmp_path: Path) -> None:
    workers = Obedient(lambda task: "failed" if task.stages else "done")
    one = sweeping(tmp_path, workers)
    tally = one.run()
    assert names(workers) == ["first 1"]
    assert set(tally.failed.values()) == {"its preparation failed: it failed"}
    assert len(tally.failed) == 4
    one.store.close()


@pytest.mark.parametrize(("end", "again"), [("failed", 0), ("hindered", 3)])
def test_they_are_tried_again_where_their_preparation_would_be(tmp_path: Path, end: End, again: int) -> None:
    """A preparation that blows up does so again; one that was hindered by the machine may go well."""
    one = sweeping(tmp_path, Obedient(lambda task: end if task.stages else "done"), {"seeds": 1, "zip": GAL_HZ})
    one.run()
    one.store.close()
    second = sweeping(tmp_path, workers := Obedient(), {"seeds": 1, "zip": GAL_HZ})
    second.run()
    second.store.close()
    assert len(workers.done) == again


def test_a_full_disk_stops_the_sweep_and_loses_nothing(tmp_path: Path) -> None:
    workers = Obedient(lambda task: "full" if "800gal-10Hz" in task.target else "done", slots=1)
    one = sweeping(tmp_path, workers)
    with pytest.raises(RunError) as error:
        one.run()
    assert len(str(error.value).splitlines()) == 1
    assert str(error.value).endswith("Members that are done are kept; make room and run the same command again")
    assert workers.stopped
    one.store.close()
    assert [m.state for m in read_manifest(tmp_path / "out").members] == ["done", "done", "waiting", "waiting"]


def test_workers_of_another_version_stop_the_sweep(tmp_path: Path) -> None:
    one = sweeping(tmp_path, Obedient(lambda _: "strange"))
    with pytest.raises(ScenarioError, match=r"workers of another program version: it strange\. Install the same one"):
        one.run()
    one.store.close()


def test_workers_that_stop_by_themselves_end_the_sweep(tmp_path: Path) -> None:
    """As those of a scheduler that has ended: nothing would be done, and it would look as if all was well."""
    one = sweeping(tmp_path, Obedient(lambda task: "stopped" if "400gal-20Hz" in task.target else "done", slots=1))
    with pytest.raises(RunError, match="the workers have stopped"):
        one.run()
    one.store.close()
    assert [m.state for m in read_manifest(tmp_path / "out").members] == ["done", "waiting", "waiting", "waiting"]


def test_an_interrupt_keeps_what_is_done(tmp_path: Path) -> None:
    asked = queue.SimpleQueue[int]()

    def check() -> None:
        asked.put(1)
        if asked.qsize() == 3:
            raise KeyboardInterrupt

    workers = Obedient(slots=1)
    one = sweeping(tmp_path, workers)
    with pytest.raises(KeyboardInterrupt):
        one.run(check)
    assert workers.stopped
    one.store.close()
    assert [m.state for m in read_manifest(tmp_path / "out").members] == ["done", "done", "waiting", "waiting"]


def test_members_of_another_sweep_are_left_to_it(tmp_path: Path) -> None:
    workers = Obedient()
    one = sweeping(tmp_path, workers)
    other = Store(one.store.manifest)
    theirs = one.plan.members[0]
    assert other.claim(theirs.hash)
    tally = one.run()
    assert (tally.done, tally.elsewhere) == (3, [theirs.hash])
    assert theirs.name not in names(workers)
    other.close()
    one.store.close()


def test_what_another_sweep_has_finished_meanwhile_is_not_run(tmp_path: Path) -> None:
    one = sweeping(tmp_path, workers := Obedient())
    for member in one.plan.members[:2]:
        with h5py.File(tmp_path / "out" / member.file, "w") as file:
            file.attrs.update({"complete": 1, "scenario_hash": member.hash, "program": "", "program_version": ""})
    tally = one.run()
    assert (tally.done, tally.skipped) == (2, 2)
    assert names(workers) == ["first 1", "800gal-10Hz", "800gal-20Hz"]
    one.store.close()


def test_what_another_sweep_has_found_to_fail_is_not_tried_again(tmp_path: Path) -> None:
    """Though ours began before that one wrote it into the manifest; with --retry it is."""
    one = sweeping(tmp_path, workers := Obedient(slots=1))
    other = sweeping(tmp_path, Obedient(lambda task: "failed" if "400gal-20Hz" in task.target else "hindered"))
    write_preparation(one.store, next(iter(one.plan.shared)))
    other.run()
    other.store.close()
    tally = one.run()
    assert tally.failed == {"400gal-20Hz": "it failed"}
    assert "400gal-20Hz" not in names(workers)
    one.store.close()
    again = sweeping(tmp_path, workers := Obedient(), retry=True)
    assert again.run().failed == {}
    assert names(workers) == ["400gal-20Hz"]
    again.store.close()


def test_a_preparation_of_another_sweep_is_waited_for(tmp_path: Path) -> None:
    one = sweeping(tmp_path, workers := Obedient())
    other = Store(one.store.manifest)
    key = next(iter(one.plan.shared))
    other.claim(key)
    looks = iter(range(100))

    def check() -> None:
        if next(looks) == 1:
            write_preparation(other, key)
            other.release(key)

    assert one.run(check).done == 4
    assert "first 1" not in names(workers)
    other.close()
    one.store.close()


@pytest.mark.parametrize("damage", ["engine", "file", "both gone"])
def test_a_preparation_that_is_damaged_or_gone_is_made_again(tmp_path: Path, damage: str) -> None:
    """Also while the sweep goes on: it would wait for ever."""

    def ends(task: Task) -> End:
        if task.stages or damaged:
            return "done"
        damaged.append(task)
        file, state = one.store.preparation(key)
        if damage == "engine":
            state.write_bytes(b"\0\0")
        elif damage == "file":
            file.write_bytes(file.read_bytes()[:500])
        else:
            file.unlink()
            state.unlink()
        return "done"

    damaged: list[Task] = []
    one = sweeping(tmp_path, workers := Obedient(ends, slots=1))
    (key,) = one.plan.shared
    assert one.run().done == 4
    assert names(workers) == ["first 1", "400gal-10Hz", "first 1", "400gal-20Hz", "800gal-10Hz", "800gal-20Hz"]
    one.store.close()


def test_failures_of_one_name_are_counted_each() -> None:
    tally = Tally(3)
    for reason in ("a", "b", "c"):
        tally.fail("friction-1", reason)
    assert tally.failed == {"friction-1": "a", "friction-1 (2)": "b", "friction-1 (3)": "c"}
    assert tally.open == 0


def test_what_an_interrupted_run_has_left_is_cleared(tmp_path: Path) -> None:
    one = sweeping(tmp_path, Obedient())
    left = partial_path(tmp_path / "out" / one.plan.members[0].file)
    left.write_text("half a run")
    one.run()
    assert not left.exists()
    one.store.close()


def test_a_line_tells_where_the_sweep_is() -> None:
    tally = Tally(total=9, skipped=2, done=1, seconds=[90.0])
    assert told(tally) == "3 of 9 done, about 9 min 0 s left"
    tally.fail("x", "y")
    assert told(tally) == "3 of 9 done, 1 failed, about 7 min 30 s left"
    tally.at_once = 0
    assert told(tally) == "3 of 9 done, waiting for workers, 1 failed, about 7 min 30 s left"


def test_time_left_is_reckoned_from_what_members_took() -> None:
    tally = Tally(total=10, skipped=2, done=2, seconds=[10.0, 20.0], at_once=2)
    tally.failed["x"] = "y"
    assert tally.open == 5
    assert tally.seconds_left == 15.0 * 5 / 2
    assert Tally(total=3).seconds_left == float("inf")
