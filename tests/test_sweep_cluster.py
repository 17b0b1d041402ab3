"""Sweeps on a Dask cluster: a real one in this test, and a scheduler with workers started by hand, one of which is killed."""

from __future__ import annotations

import contextlib
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import wait
from pathlib import Path

import psutil
import pytest
from click.testing import CliRunner, Result
from sweep_text import GAL_HZ, sweep_file
from test_run_prepared import assert_same

pytest.importorskip("distributed", reason="the extra cluster is not installed")

from distributed import LocalCluster

from dem_cli.cli import main
from dem_cli.results.manifest import read_manifest
from dem_cli.results.provenance import program_identity
from dem_cli.run import run_scenario
from dem_cli.sweep import cluster as cluster_module
from dem_cli.sweep.cluster import ClusterError, ClusterWorkers, Parcel, _moved
from dem_cli.sweep.plan import make_plan
from dem_cli.sweep.store import Store
from dem_cli.sweep.task import Task

QUAKE = "t,a\n" + "".join(f"{0.01 * k:.2f},{300 * (-1) ** (k // 3)}\n" for k in range(12))


def dem(*args: object) -> Result:
    return CliRunner().invoke(main, ["sweep", *map(str, args)], catch_exceptions=False)


@pytest.fixture(scope="module")
def local() -> Iterator[str]:
    """The address of a cluster of two worker processes."""
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as found:
        yield found.scheduler_address


def test_a_sweep_on_a_local_cluster(local: str, tmp_path: Path) -> None:
    """The same files as here, and the packing once for all."""
    path = sweep_file(tmp_path, {"grid": GAL_HZ})
    found = dem(path, "-o", tmp_path / "out", "--scheduler", local)
    assert found.exit_code == 0, found.stderr
    assert "which has room for 2 at a time" in found.stderr
    assert found.stderr.count("packing for 4 members: done") == 1
    plan = make_plan(path)
    direct = run_scenario(plan.members[3].load(), tmp_path / "direct.h5")
    assert_same(direct, tmp_path / "out" / plan.members[3].file)


@pytest.fixture
def blind(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers do not see the sweep's folder: the file by which they would know it is not there for them."""
    begin = ClusterWorkers.__init__

    def init(self: ClusterWorkers, address: str, token: Path) -> None:
        begin(self, address, token)
        self._token = ("/nowhere/token", "")

    monkeypatch.setattr(ClusterWorkers, "__init__", init)


@pytest.mark.usefixtures("blind")
def test_files_travel_where_workers_do_not_share_the_disk(local: str, tmp_path: Path) -> None:
    """Records that the scenario names go along, result files and preparations come back."""
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "quake.csv").write_text(QUAKE)
    stages = [
        {"kind": "settle", "limit": "0.3 s", "name": "packing"},
        {"kind": "shake", "record": {"file": "data/quake.csv", "unit": "gal"}, "name": "quake"},
        {"kind": "settle", "limit": "0.1 s", "name": "rest"},
    ]
    path = sweep_file(tmp_path, {"grid": {"stage.rest.limit": ["50 ms", "60 ms"]}}, {"stage": stages})
    found = dem(path, "-o", tmp_path / "out", "--scheduler", local)
    assert found.exit_code == 0, found.stderr
    plan = make_plan(path)
    for member in plan.members:
        assert_same(run_scenario(member.load(), tmp_path / "direct.h5", force=True), tmp_path / "out" / member.file)
    assert sorted(one.suffix for one in (tmp_path / "out" / ".sweep" / "preparations").iterdir()) == [".h5", ".state"]
    assert not list((tmp_path / "out").glob(".*.h5*")), "nothing half written is left"


def test_a_worker_keeps_to_its_own_folder(tmp_path: Path) -> None:
    """Names with ../ stay within it; those that would not are left out, and the scenario's reader tells."""
    task = Task(
        "k", "", "box.toml", "/home/x", (), "h", "/sweep/out.h5", "p", prepared=("/sweep/KEY.h5", "/sweep/KEY.state")
    )
    files = {"a.csv": b"1", "../b.csv": b"2", "../" * 20 + "etc/c.csv": b"3", "/etc/d.csv": b"4"}
    here = _moved(Parcel(task, "s", ("", ""), files, (b"5", b"6"), shipped=True), tmp_path)
    assert {one.name: one.read_bytes() for one in tmp_path.rglob("*") if one.is_file()} == {
        "a.csv": b"1", "b.csv": b"2", "KEY.h5": b"5", "KEY.state": b"6",
    }  # fmt: skip
    assert (Path(here.folder) / "../b.csv").read_bytes() == b"2"
    assert Path(here.target).parent == tmp_path / "made"


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@contextlib.contextmanager
def process(log: Path, *args: str) -> Iterator[psutil.Process]:
    """`dask ...`, with all that it starts, for as long as the block lasts."""
    with log.open("w") as file:
        one = subprocess.Popen([sys.executable, "-m", "dask", *args], stdout=file, stderr=file)
        try:
            yield psutil.Process(one.pid)
        finally:
            kill(psutil.Process(one.pid)) if one.poll() is None else None
            one.wait()


def kill(one: psutil.Process) -> None:
    """At once, and what it has started with it, as when a machine goes down."""
    family = [one, *one.children(recursive=True)]
    for member in family:
        with contextlib.suppress(psutil.NoSuchProcess):
            member.kill()


def test_a_worker_that_is_killed_does_not_stop_the_sweep(tmp_path: Path) -> None:
    """A scheduler and two workers as processes of their own; one of them dies in the middle of a member."""
    path = sweep_file(tmp_path, {"grid": GAL_HZ}, {"stage.1.duration": "4 s"})
    address = f"tcp://127.0.0.1:{free_port()}"
    worker = (
        "worker",
        address,
        "--nthreads",
        "1",
        "--no-dashboard",
        "--local-directory",
        str(tmp_path),
        "--death-timeout",
        "60",
    )
    with (
        process(tmp_path / "s.log", "scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2], "--no-dashboard"),
        process(tmp_path / "1.log", *worker) as first,
        process(tmp_path / "2.log", *worker),
    ):  # fmt: skip
        kept: list[Result] = []
        sweep = threading.Thread(target=lambda: kept.append(dem(path, "-o", tmp_path / "out", "--scheduler", address)))
        sweep.start()
        end = time.monotonic() + 90.0
        while not any(is_busy(one) for one in first.children(recursive=True)):
            assert time.monotonic() < end, (tmp_path / "1.log").read_text()
            assert sweep.is_alive(), kept
            time.sleep(0.05)
        kill(first)
        sweep.join(120.0)
    assert kept, "the sweep does not end"
    assert kept[0].exit_code == 0, kept[0].stderr
    assert "4 of 4 members are done" in kept[0].stderr
    assert [one.state for one in read_manifest(tmp_path / "out").members] == ["done"] * 4


def is_busy(one: psutil.Process) -> bool:
    """Whether this is the process of a member that writes its file."""
    try:
        return "dem_cli.sweep.worker" in " ".join(one.cmdline()) and any(
            re.fullmatch(r"\d+gal-.*\.partial\.h5", Path(file.path).name) for file in one.open_files()
        )
    except psutil.Error:
        return False


def test_workers_of_another_version_are_refused_before_anything_runs(
    local: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse = ClusterWorkers._refuse_others
    monkeypatch.setattr(ClusterWorkers, "_refuse_others", lambda self, _: refuse(self, "dem-cli 9.9 (0123456789)"))
    found = dem(sweep_file(tmp_path, {"grid": GAL_HZ}), "-o", tmp_path / "out", "--scheduler", local)
    assert found.exit_code == 2
    assert re.fullmatch(
        r"workers of another program version: tcp://\S+ runs dem-cli \S+ \(\w+\), this is dem-cli 9\.9 \(0123456789\)\. "
        r"Install the same one everywhere\n",
        found.stderr,
    )


def test_a_worker_that_comes_later_is_asked_by_its_first_task(local: str, tmp_path: Path) -> None:
    plan = make_plan(sweep_file(tmp_path, {"grid": GAL_HZ}))
    store = Store(plan.manifest(tmp_path / "out"))
    workers = ClusterWorkers(local, store.token)
    try:
        member = plan.members[0]
        task = Task("k", "", "box.toml", str(tmp_path), (), member.hash, str(tmp_path / "out.h5"), "dem-cli 9.9 (0)")
        future = workers.submit(task, lambda *_: None)
        wait([future], 60.0)
        assert future.result().end == "strange"
        assert "the sweep dem-cli 9.9 (0)" in future.result().reason
    finally:
        workers.close()
        store.close()


@pytest.mark.parametrize(
    ("address", "said"), [("tcp://127.0.0.1:1", "cannot be reached"), ("udp://x", "unknown address scheme 'udp'")]
)
def test_schedulers_that_are_not_there(
    address: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT", 0.5)
    found = dem(sweep_file(tmp_path, {"grid": GAL_HZ}), "-o", tmp_path / "out", "--scheduler", address)
    assert found.exit_code == 2
    assert found.stderr.startswith(f"--scheduler {address}: cannot be reached (")
    assert said in found.stderr
    assert found.stderr.endswith("Start one with: dask scheduler; its address is like tcp://host:8786\n")
    assert len(found.stderr.splitlines()) == 1


def test_without_dask_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    token = tmp_path / "token"
    token.write_text("")
    with pytest.raises(ClusterError, match=r"pip install 'dem-cli\[cluster\]', here and on the workers"):
        ClusterWorkers("tcp://127.0.0.1:1", token)


def test_an_interrupt_reaches_the_workers(local: str, tmp_path: Path) -> None:
    """The run on the worker stops, and what it has stays."""
    path = sweep_file(tmp_path, {"grid": {"seed": [1, 2]}}, {"stage.1.duration": "500 s", "output.frames": "10 s"})
    plan = make_plan(path)
    store = Store(plan.manifest(tmp_path / "out"))
    workers = ClusterWorkers(local, store.token)
    running = threading.Event()
    member = plan.members[0]
    task = Task(
        member.hash, path.read_text(), str(path), str(tmp_path), member.overrides, member.hash,
        str(tmp_path / "out" / member.file), program_identity(),
    )  # fmt: skip
    try:
        future = workers.submit(task, lambda *_: running.set())
        assert running.wait(60.0), "no word of the member"
        workers.stop()
        wait([future], 60.0)
        assert future.result().end == "stopped"
    finally:
        workers.close()
        store.close()
    assert list((tmp_path / "out").glob("*.partial.h5"))
