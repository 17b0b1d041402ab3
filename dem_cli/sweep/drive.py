"""Runs the members of a sweep on workers: what is ready, what waits for a preparation, and what has become of each."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

from dem_cli.errors import DemError, RunError, ScenarioError
from dem_cli.results.manifest import Member
from dem_cli.results.provenance import program_identity
from dem_cli.sweep.local import Workers
from dem_cli.sweep.plan import Plan, Planned, Shared, text_of
from dem_cli.sweep.store import Store, failed_before
from dem_cli.sweep.task import Answer, Task

LOOK_EVERY = 0.5  # s between two looks at interrupts and at what others do
RECORD_EVERY = 2.0  # s at least between two writings of the manifest
TRIES = 2  # of a task whose process dies: once may be the machine's fault


@dataclass
class Job:
    """A preparation or a member on its way. needs: key of the preparation that it goes on from. share, words: how far it is."""

    key: str
    name: str
    task: Task
    needs: str | None
    member: Planned | None = None
    shared: Shared | None = None
    tries: int = 0
    share: float = 0.0
    words: str = ""

    def tell(self, share: float, words: str) -> None:
        self.share, self.words = share, words


@dataclass
class Tally:
    """Where the sweep is, for those who show it. skipped: done before; elsewhere: keys of those that another sweep runs."""

    total: int
    skipped: int = 0
    done: int = 0
    elsewhere: list[str] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)  # name -> reason
    running: list[Job] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)  # wall times of members that were run
    at_once: int = 1

    def fail(self, name: str, reason: str) -> None:
        """Members may be of one name where their settings differ in signs that no file name has."""
        others = sum(1 for one in self.failed if one == name or one.startswith(f"{name} ("))
        self.failed[f"{name} ({others + 1})" if others else name] = reason

    @property
    def open(self) -> int:
        """Members of which nothing is known yet."""
        return self.total - self.skipped - self.done - len(self.failed)

    @property
    def seconds_left(self) -> float:
        """Guessed from the members that are done; inf before the first one."""
        if not self.seconds:
            return math.inf
        mean = sum(self.seconds) / len(self.seconds)
        begun = sum(job.share for job in self.running if job.member)
        return mean * max(self.open - begun, 0.0) / max(min(self.at_once, self.open), 1)


class Watcher(Protocol):
    """Shows a sweep. Called twice a second, and for each thing there is to say."""

    def show(self, tally: Tally) -> None: ...

    def say(self, text: str) -> None: ...


class Sweeping:
    """One `dem sweep`: its store, workers and what is left to do."""

    def __init__(self, plan: Plan, store: Store, workers: Workers, watcher: Watcher, *, retry: bool = False) -> None:
        self.plan, self.store, self.workers, self.watcher = plan, store, workers, watcher
        self._retry = retry
        self._jobs: dict[str, Job] = {}  # to be done, by key, in order
        self._flights: dict[Future[Answer], Job] = {}
        self._news: dict[str, Member] = {}
        self._recorded = 0.0
        self._records = {one.hash: one for one in store.manifest.members if one.hash}
        self.tally = Tally(len(store.manifest.members), at_once=workers.at_once)

    # -- what there is to do ----------------------------------------------------------------------------------------

    def _collect(self) -> None:
        """Jobs for all members that are neither done nor known to fail, and for what they start from."""
        for one in self.plan.invalid:
            self.tally.fail(one.name, one.error)
        for member in self.plan.members:
            record = self._records[member.hash]
            if record.state == "done":
                self.tally.skipped += 1
            elif failed_before(record) and not self._retry:
                self.tally.fail(record.name, record.reason)
            else:
                self._need(self.plan.start.get(member.hash))
                self._jobs[member.hash] = self._member_job(member)

    def _need(self, key: str | None) -> None:
        """The preparation of this key, and before it the one that it goes on from."""
        if key is None or key in self._jobs or self.store.is_prepared(key):
            return
        shared = self.plan.shared[key]
        self._need(shared.parent)
        file, state = self.store.preparation(key)
        task = replace(self._task(shared.of, str(file), shared.parent), key=key, stages=shared.stages, state=str(state))
        self._jobs[key] = Job(key, shared.label, task, shared.parent, shared=shared)

    def _member_job(self, member: Planned) -> Job:
        start = self.plan.start.get(member.hash)
        task = self._task(member, str(self.store.folder / member.file), start)
        return Job(member.hash, member.name, task, start, member=member)

    def _task(self, member: Planned, target: str, start: str | None) -> Task:
        prepared = tuple(str(path) for path in self.store.preparation(start)) if start else None
        return Task(
            member.hash,
            text_of(member.base),
            str(member.base),
            str(member.base.parent),
            member.overrides,
            member.hash,
            target,
            program_identity(),
            prepared=(prepared[0], prepared[1]) if prepared else None,
            begin=self.plan.shared[start].stages if start else 0,
        )

    # -- running ----------------------------------------------------------------------------------------------------

    def run(self, check: Callable[[], None] = lambda: None) -> Tally:
        """Run what is left; returns what came of it. check: called twice a second, may raise KeyboardInterrupt.

        RunError if the disk is full or the workers are gone, ScenarioError if a worker is of another program version; what is done is done.
        """
        self._collect()
        self.watcher.show(self.tally)
        try:
            while self._flights or self._launch():
                over, _ = wait(self._flights, LOOK_EVERY, FIRST_COMPLETED)
                for future in over:
                    self._take(self._flights.pop(future), future)
                check()
                self._launch()
                self.tally.running, self.tally.at_once = list(self._flights.values()), self.workers.at_once
                self.watcher.show(self.tally)
                self._record()
                if not self._flights and self._jobs:  # all that is left is being done by another sweep
                    if not self._worth_waiting():
                        break
                    for job in list(self._jobs.values()):
                        self._need(job.needs)  # may have been removed meanwhile: then nobody would compute it
                    time.sleep(LOOK_EVERY)
        except BaseException:
            self._abort()
            raise
        finally:
            self.tally.running = []
            self._record(now=True)
        self.tally.elsewhere = [job.key for job in self._jobs.values() if job.member]
        return self.tally

    def _launch(self) -> bool:
        """Hand out what is ready, while there are workers for it; whether anything flies or is left."""
        for job in self._ready():
            if len(self._flights) >= self.workers.slots:
                break
            if not self.store.claim(job.key):
                continue
            if self._done_meanwhile(job):
                continue
            del self._jobs[job.key]
            if job.member:
                self.store.discard_partial(self._records[job.key])
            job.tries += 1
            self._flights[self.workers.submit(job.task, job.tell)] = job
        return bool(self._flights or self._jobs)

    def _ready(self) -> Iterator[Job]:
        """Preparations first, as others wait for them."""
        jobs = sorted(self._jobs.values(), key=lambda job: job.shared is None)
        for job in jobs:
            if job.needs is None or self.store.is_prepared(job.needs):
                yield job

    def _done_meanwhile(self, job: Job) -> bool:
        """Whether another sweep has done it, or found it to fail, before we came to claim it."""
        there = self._arrived(job)
        reason = self.store.condemned(job.key)
        if job.member and reason and not there and not self._retry:
            del self._jobs[job.key]
            self.tally.fail(job.name, reason)
            self.store.condemn(job.key, reason)
            self.store.release(job.key)
            return True
        if there:
            del self._jobs[job.key]
            self.store.release(job.key)
            if job.member:
                self.tally.skipped += 1
                self._news[job.key] = self._records[job.key].with_state("done", program=program_identity())
        return there

    def _worth_waiting(self) -> bool:
        """Whether members of ours wait for a preparation that another sweep computes; its members are its own matter."""
        return any(job.needs and not self.store.is_prepared(job.needs) for job in self._jobs.values())

    def _take(self, job: Job, future: Future[Answer]) -> None:
        try:
            answer = future.result()
        except Exception as error:  # a fault of the workers, not of the member
            answer = Answer("lost", f"{type(error).__name__}: {error}")
        if answer.end == "done" and not self._arrived(job):
            answer = replace(answer, end="lost", reason="its result file has not come")
        if answer.end == "lost" and job.tries < TRIES:
            self.watcher.say(f"{job.name}: {answer.reason}; once more")
            self.store.release(job.key)
            self._jobs = {job.key: job, **self._jobs}
            return
        if answer.end in ("failed", "refused"):
            self.store.condemn(job.key, answer.reason)
        self.store.release(job.key)
        if answer.end == "stopped":  # not by us: then nothing is taken any more
            raise RunError(
                f"{self.store.folder}: the workers have stopped, e.g. as their scheduler has ended. "
                "Members that are done are kept; the same command goes on with the others"
            )
        if answer.end == "strange":
            raise ScenarioError(f"workers of another program version: {answer.reason}. Install the same one everywhere")
        if answer.end == "full":
            raise RunError(
                f"{self.store.folder}: {answer.reason.rstrip('.')}. Members that are done are kept; make room and run the same command again"
            )
        if job.member:
            self._end_member(job.member, answer)
        elif answer.end != "done":
            self._give_up(job.key, replace(answer, reason=f"its preparation failed: {answer.reason}"))
        else:
            self.watcher.say(f"{job.name}: done in {answer.seconds:.0f} s")

    def _arrived(self, job: Job) -> bool:
        if job.member is None:
            return self.store.is_prepared(job.key)
        return self.store.is_done(self._records[job.key])

    def _end_member(self, member: Planned, answer: Answer) -> None:
        record = self._records[member.hash]
        state: Literal["done", "failed"] = "done" if answer.end == "done" else "failed"
        if state == "done":
            self.tally.done += 1
            self.tally.seconds.append(answer.seconds)
            self.watcher.say(f"{member.name}: done in {answer.seconds:.0f} s")
        else:
            self.tally.fail(member.name, answer.reason)
            self.watcher.say(f"{member.name}: failed: {answer.reason}")
        self._news[member.hash] = record.with_state(
            state,
            reason=answer.reason,
            seconds=round(answer.seconds, 1),
            program="" if answer.end in ("lost", "hindered") else program_identity(),  # those may go well the next time
        )

    def _give_up(self, key: str, answer: Answer) -> None:
        """All that start from a preparation that came to no good, each with its answer."""
        for job in [one for one in self._jobs.values() if one.needs == key]:
            del self._jobs[job.key]
            if job.member:
                self._end_member(job.member, replace(answer, seconds=0.0))
            else:
                self._give_up(job.key, answer)

    def _record(self, *, now: bool = False) -> None:
        """Write the news into the manifest, some seconds late at most."""
        if not self._news or not (now or time.monotonic() - self._recorded > RECORD_EVERY):
            return
        news, self._news = self._news, {}
        try:
            self.store.record(news)
        except DemError as error:
            self._news = news | self._news
            self.watcher.say(str(error))
        self._recorded = time.monotonic()

    def _abort(self) -> None:
        """Interrupt what runs, and take what was just done."""
        self.workers.stop()
        for future in list(self._flights):
            job = self._flights.pop(future)
            try:
                answer = future.result(timeout=60.0)
            except Exception:
                continue
            if answer.end == "done" and job.member and self._arrived(job):
                self._end_member(job.member, answer)
