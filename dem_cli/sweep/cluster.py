"""Workers of a Dask cluster, whether they see the sweep's folder or not: what they need goes with the task, and what they make comes back.

Dask places the tasks, notices workers that die and hands theirs to others. On a worker a member runs in a process of its own,
as it does here: a long call of a kernel does not keep Dask's own talk waiting, and a crash of a member is not one of the worker.
"""

from __future__ import annotations

import contextlib
import functools
import logging
import queue
import secrets
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dem_cli.errors import DemError, ScenarioError
from dem_cli.results.provenance import program_identity
from dem_cli.scenario.base import files_named
from dem_cli.scenario.loader import read_toml
from dem_cli.scenario.overrides import apply_overrides
from dem_cli.sweep.process import Tell, WorkerProcess
from dem_cli.sweep.task import Answer, Task
from dem_cli.sweep.worker import disk_is_full
from dem_cli.whole import whole

CONNECT = 15.0  # s until a scheduler must have answered
COUNT_EVERY = 2.0  # s between two counts of workers
DEEP = "a/b/c/d/e/f"  # so that a scenario's ../../ stays within a worker's own folder
TOPIC = "dem-sweep"


class ClusterError(DemError):
    """The cluster cannot be used: not reached, or without Dask."""

    exit_code = 2


@dataclass(frozen=True)
class Parcel:
    """A task for a worker that may be anywhere. token: path and content of a file by which it knows that it sees the sweep's folder.

    files: what the scenario names, by name; prepared: bytes of the result file and the engine that it goes on from. Both are empty
    at first, as most clusters share a disk.
    """

    task: Task
    sweep: str
    token: tuple[str, str]
    files: dict[str, bytes] = field(default_factory=dict, repr=False)
    prepared: tuple[bytes, bytes] | None = field(default=None, repr=False)
    shipped: bool = False


class ClusterWorkers:
    """Dask workers behind the scheduler at `address`.

    ClusterError if it is not reached, ScenarioError if a worker is of another program version.
    """

    def __init__(self, address: str, token: Path) -> None:
        self._token = (str(token.resolve()), token.read_text())
        self._name = f"{TOPIC}-{secrets.token_hex(6)}"
        self._ships = False
        self._counted, self._threads = -COUNT_EVERY, 0
        self._tells: dict[str, Tell] = {}
        self._remotes: set[Any] = set()
        self._lock = threading.Lock()
        self._client = _connect(address)
        try:
            self._refuse_others(program_identity())
            self._client.subscribe_topic(self._name, self._heard)
        except BaseException:
            self._client.close()
            raise

    @property
    def slots(self) -> int:
        """As many tasks as there are threads, and some in reserve, so that no worker waits for the next one."""
        return self.at_once + min(self.at_once, 8) or 1

    @property
    def at_once(self) -> int:
        """Threads of all workers, which may come and go; as they were some seconds ago."""
        now = time.monotonic()
        if now - self._counted > COUNT_EVERY:
            self._counted = now
            with contextlib.suppress(Exception):  # the scheduler is gone: its tasks will tell
                self._threads = int(sum(self._client.nthreads().values()))
        return self._threads

    def submit(self, task: Task, tell: Tell) -> Future[Answer]:
        with self._lock:
            self._tells[task.key] = tell
        done: Future[Answer] = Future()
        done.add_done_callback(lambda _: self._tells.pop(task.key, None))
        try:
            self._send(task, done)
        except (OSError, DemError) as error:  # what is to travel cannot be read
            done.set_result(Answer("hindered", str(error)))
        return done

    def _send(self, task: Task, done: Future[Answer]) -> None:
        parcel = Parcel(task, self._name, self._token)
        if self._ships:
            parcel = _packed(parcel)
        # A key of its own each time: Dask would give the old answer for an old key.
        remote = self._client.submit(do_parcel, parcel, key=f"{task.key}-{secrets.token_hex(4)}", pure=False)
        self._remotes.add(remote)
        remote.add_done_callback(functools.partial(self._came, task, done))

    def _came(self, task: Task, done: Future[Answer], remote: Any) -> None:
        """Called in a thread of Dask's."""
        self._remotes.discard(remote)
        try:
            if remote.cancelled():
                answer = Answer("stopped")
            elif (error := remote.exception()) is not None:
                answer = Answer("lost", f"{type(error).__name__}: {error}")
            else:
                answer = remote.result()
            if answer.end == "absent":
                self._ships = True
                self._send(task, done)
                return
            _unpack(task, answer)
            done.set_result(replace(answer, content={}))
        except OSError as error:
            done.set_result(Answer("full" if disk_is_full(error) else "hindered", str(error)))
        except Exception as error:
            done.set_exception(error)

    def _heard(self, event: tuple[float, Any]) -> None:
        key, share, words = event[1]
        with self._lock:
            tell = self._tells.get(key)
        if tell:
            tell(share, words)

    def _refuse_others(self, ours: str) -> None:
        """Workers that run another program than ours. Those that come later are asked by their first task."""
        try:
            theirs: dict[str, str] = self._client.run(program_identity)
        except Exception as error:  # the worker has no dem-cli, or one that is older than this question
            raise ScenarioError(
                f"workers of another program version: one of them cannot tell its own ({error}). Install {ours} there"
            ) from None
        for worker, program in theirs.items():
            if program != ours:
                raise ScenarioError(
                    f"workers of another program version: {worker} runs {program}, this is {ours}. Install the same one everywhere"
                )

    def stop(self) -> None:
        with contextlib.suppress(Exception):
            from distributed import Event

            Event(self._name, client=self._client).set()
            if not self._client.nthreads():  # nobody is there to answer
                self._client.cancel(list(self._remotes))

    def close(self) -> None:
        self._client.close()


def _connect(address: str) -> Any:
    try:
        from distributed import Client
        from distributed.comm.addressing import parse_address, parse_host_port
        from distributed.comm.registry import get_backend
    except ImportError:
        raise ClusterError("--scheduler needs Dask: pip install 'dem-cli[cluster]', here and on the workers") from None
    logging.getLogger("distributed.client").setLevel(
        logging.CRITICAL
    )  # what it says of a scheduler that is gone, we say
    try:  # a client with an address of no kind would not let go for half a minute
        kind, place = parse_address(address)
        get_backend(kind)
        if kind != "inproc":
            parse_host_port(place)
        return Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ClusterError(
            f"--scheduler {address}: cannot be reached ({said}). Start one with: dask scheduler; its address is like tcp://host:8786"
        ) from None


# -- on our side --------------------------------------------------------------------------------------------------------


def _packed(parcel: Parcel) -> Parcel:
    """With all that the task reads."""
    task = parcel.task
    raw = read_toml(task.text, task.origin)
    apply_overrides(raw, task.overrides)
    files = {name: (Path(task.folder) / name).read_bytes() for name in files_named(raw)}
    prepared = tuple(Path(name).read_bytes() for name in task.prepared) if task.prepared else None
    return replace(parcel, files=files, prepared=(prepared[0], prepared[1]) if prepared else None, shipped=True)


def _unpack(task: Task, answer: Answer) -> None:
    """Write what came back to where it belongs, each file in one step."""
    for name in (task.target, task.state):
        if name and Path(name).name in answer.content:
            with whole(Path(name)) as fresh:
                fresh.write_bytes(answer.content[Path(name).name])


# -- on the worker ------------------------------------------------------------------------------------------------------


def do_parcel(parcel: Parcel) -> Answer:
    """A task, on a Dask worker: in the sweep's folder if it is to be seen from here, else in a folder of its own."""
    task = parcel.task
    if task.program != program_identity():
        return Answer("strange", f"a worker runs {program_identity()}, the sweep {task.program}")
    if _sees(parcel.token):
        return _in_process(task, parcel.sweep)
    if not parcel.shipped:
        return Answer("absent")
    with _own_folder() as folder:
        here = _moved(parcel, folder)
        answer = _in_process(here, parcel.sweep)
        made = [Path(name) for name in (here.target, here.state) if name] if answer.end == "done" else []
        return replace(answer, content={path.name: path.read_bytes() for path in made})


def _sees(token: tuple[str, str]) -> bool:
    try:
        return Path(token[0]).read_text() == token[1]
    except OSError:
        return False


@contextlib.contextmanager
def _own_folder() -> Iterator[Path]:
    folder = Path(tempfile.mkdtemp(prefix="dem-sweep-"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _moved(parcel: Parcel, folder: Path) -> Task:
    """The task with its files in a folder of this machine."""
    task, base = parcel.task, folder / DEEP
    base.mkdir(parents=True)
    for name, content in parcel.files.items():
        place = (base / name).resolve()
        if not place.is_relative_to(folder.resolve()):
            continue  # a place of the other machine; the scenario's reader says that it is not here
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)
    prepared = None
    if parcel.prepared:
        assert task.prepared
        first, second = (str(folder / Path(name).name) for name in task.prepared)
        prepared = (first, second)
        for name, content in zip(prepared, parcel.prepared, strict=True):
            Path(name).write_bytes(content)
    made = folder / "made"
    made.mkdir()
    state = str(made / Path(task.state).name) if task.state else ""
    return replace(task, folder=str(base), target=str(made / Path(task.target).name), state=state, prepared=prepared)


def _in_process(task: Task, sweep: str) -> Answer:
    """In a process of its own, which tells how far it is through the scheduler and stops when the sweep does."""
    from distributed import Event, get_worker

    worker = get_worker()
    stop = Event(sweep, client=worker._get_client())
    asked = _Seldom(stop.is_set)
    try:
        process = _idle.get_nowait()
    except queue.Empty:
        process = WorkerProcess()
    try:
        return process.do(task, lambda share, words: worker.log_event(sweep, (task.key, share, words)), asked)
    finally:
        _idle.put(process)


# Of a Dask worker, between two tasks; one that gets no more ends by itself.
_idle: queue.SimpleQueue[WorkerProcess] = queue.SimpleQueue()


class _Seldom:
    """A question that goes over the network: asked every other second only."""

    def __init__(self, ask: Callable[[], bool]) -> None:
        self._ask, self._count, self._said = ask, 0, False

    def __call__(self) -> bool:
        self._count += 1
        if self._count % 4 == 0 and not self._said:
            with contextlib.suppress(Exception):
                self._said = bool(self._ask())
        return self._said
