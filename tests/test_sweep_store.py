"""The folder of a sweep: what is done, who works on what, and a manifest that several may write."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import pytest
from sweep_text import GAL_HZ, sweep_file

from dem_cli.errors import ResultsError
from dem_cli.results.manifest import Manifest, Member, SweepAxis, is_sweep, read_manifest, write_manifest
from dem_cli.results.provenance import program_identity
from dem_cli.sweep.plan import make_plan
from dem_cli.sweep.store import Store, failed_before


def manifest_of(folder: Path) -> Manifest:
    return make_plan(sweep_file(folder, {"grid": GAL_HZ})).manifest(folder / "out")


def pretend(folder: Path, member: Member, complete: int = 1, scenario_hash: str = "") -> None:
    """A result file with nothing in it but what tells that it is done."""
    with h5py.File(folder / member.file, "w") as file:
        file.attrs.update(
            {
                "complete": complete,
                "scenario_hash": scenario_hash or member.hash,
                "program": "dem-cli",
                "program_version": "9",
            }
        )


def test_the_manifest_is_read_as_it_was_written(tmp_path: Path) -> None:
    axes = (SweepAxis(("a", "b"), ((1, "x"), (2, "y")), "zip"), SweepAxis(("scenario",), (("d.toml",),), "scenario"))
    members = (
        Member("one", "one-12.h5", "12", {"a": 1, "b": "x"}, "done", seconds=1.5, program="dem-cli 1"),
        Member("two", "two-34.h5", "34", {"a": 2, "b": "y"}, "failed", "grain 3 is nowhere"),
    )
    written = Manifest("title", "box.toml", axes, members, ("old.h5",), tmp_path)
    write_manifest(written)
    found = read_manifest(tmp_path)
    assert (found.title, found.scenario, found.axes, found.former) == ("title", "box.toml", axes, ("old.h5",))
    assert found.members[0] == members[0]
    assert replace(found.members[1], seconds=0.0) == replace(members[1], seconds=0.0)
    assert is_sweep(tmp_path)
    assert is_sweep(tmp_path / "sweep.toml")
    assert not is_sweep(tmp_path.parent)
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.toml"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is no manifest of a sweep"),
        ("a = ", "cannot be read"),
        ('format = "dem-cli sweep"\nformat_version = 99\n', "written by a newer dem-cli"),
        ('format = "dem-cli sweep"\nformat_version = 1\n', "is damaged"),
    ],
)
def test_other_files_are_told_apart(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "sweep.toml").write_text(text)
    with pytest.raises(ResultsError, match=said):
        read_manifest(tmp_path)
    with pytest.raises(ResultsError, match="is no folder of a sweep"):
        read_manifest(tmp_path / "none")


def test_result_files_say_what_is_done(tmp_path: Path) -> None:
    """Not the manifest: one that is lost costs nothing, one that claims too much is corrected."""
    store = Store(manifest_of(tmp_path))
    first, second, third, fourth = store.manifest.members
    pretend(store.folder, first)
    pretend(store.folder, second, complete=0)
    pretend(store.folder, third, scenario_hash="0123456789abcdef")
    (store.folder / fourth.file).write_text("no HDF5")
    store.begin()
    assert [one.state for one in read_manifest(store.folder).members] == ["done", "waiting", "waiting", "waiting"]
    assert read_manifest(store.folder).members[0].program == "dem-cli 9"
    store.record({second.hash: second.with_state("done")})
    store.begin()
    assert [one.state for one in read_manifest(store.folder).members] == ["done", "waiting", "waiting", "waiting"]
    (store.folder / "sweep.toml").write_text("damaged")
    store.begin()
    assert [one.state for one in read_manifest(store.folder).members] == ["done", "waiting", "waiting", "waiting"]
    store.close()


def test_files_of_members_that_are_no_longer_there_are_kept_and_told(tmp_path: Path) -> None:
    store = Store(manifest_of(tmp_path))
    pretend(store.folder, store.manifest.members[0])
    store.close()
    changed = make_plan(sweep_file(tmp_path, {"grid": GAL_HZ}, {"contact.friction": 0.9})).manifest(tmp_path / "out")
    again = Store(changed)
    again.begin()
    assert again.manifest.former == (store.manifest.members[0].file,)
    assert (again.folder / store.manifest.members[0].file).exists()
    assert [one.state for one in again.manifest.members] == ["waiting"] * 4
    again.close()


def test_what_two_processes_record_is_all_kept(tmp_path: Path) -> None:
    one, other = Store(manifest_of(tmp_path)), Store(manifest_of(tmp_path))
    one.begin()
    first, second, third, _ = one.manifest.members
    one.record({first.hash: first.with_state("done")})
    other.record({second.hash: second.with_state("failed", reason="blew up")})
    one.record({third.hash: third.with_state("done")})
    assert [(m.state, m.reason) for m in read_manifest(one.folder).members] == [
        ("done", ""), ("failed", "blew up"), ("done", ""), ("waiting", ""),
    ]  # fmt: skip
    one.close()
    other.close()


CLAIM = """
import sys, time
from pathlib import Path
from dem_cli.results.manifest import Manifest
from dem_cli.sweep.store import Store
store = Store(Manifest("", "", (), (), folder=Path(sys.argv[1])))
print(store.claim("key"), flush=True)
time.sleep(60)
"""


def test_a_claim_ends_with_its_process(tmp_path: Path) -> None:
    """However that ends: a kill leaves no lock behind."""
    store = Store(Manifest("", "", (), (), folder=tmp_path))
    other = subprocess.Popen([sys.executable, "-c", CLAIM, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert other.stdout is not None
    assert other.stdout.readline() == "True\n"
    assert not store.claim("key")
    assert store.owner("key").startswith(f"process {other.pid} on ")
    other.kill()
    other.wait()
    other.stdout.close()
    assert store.claim("key")
    assert store.claim("key"), "ours already"
    store.release("key")
    store.close()


def test_another_sweep_with_other_members_is_kept_out(tmp_path: Path) -> None:
    store = Store(manifest_of(tmp_path))
    others = make_plan(sweep_file(tmp_path, {"seeds": 2})).manifest(tmp_path / "out")
    with pytest.raises(ResultsError, match=rf"another sweep with other members works there \(process {os.getpid()} on"):
        Store(others)
    store.close()
    Store(others).close()


def test_folders_that_hold_something_else_are_refused(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.doc").write_text("mine")
    with pytest.raises(ResultsError, match="holds other files, and is no folder of a sweep"):
        Store(manifest_of(tmp_path))
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ResultsError, match="cannot be written"):
        Store(replace(manifest_of(tmp_path), folder=tmp_path / "file"))


def test_a_manifest_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(manifest_of(tmp_path))
    store.begin()
    before = (store.folder / "sweep.toml").read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    first = store.manifest.members[0]
    with pytest.raises(ResultsError, match=r"cannot be written \(No space left on device\)\. No result file is lost"):
        store.record({first.hash: first.with_state("done")})
    assert (store.folder / "sweep.toml").read_bytes() == before
    assert sorted(path.name for path in store.folder.iterdir()) == [".sweep", "sweep.toml"]
    store.close()


def test_the_manifest_of_a_newer_program_is_left_alone(tmp_path: Path) -> None:
    store = Store(manifest_of(tmp_path))
    text = 'format = "dem-cli sweep"\nformat_version = 99\n'
    (store.folder / "sweep.toml").write_text(text)
    with pytest.raises(ResultsError, match="written by a newer dem-cli"):
        store.begin()
    assert (store.folder / "sweep.toml").read_text() == text
    store.close()


def test_preparations_that_nothing_goes_on_from_are_removed(tmp_path: Path) -> None:
    store = Store(manifest_of(tmp_path))
    for key in ("ours", "theirs"):
        for path in store.preparation(key):
            path.write_bytes(b"")
    store.discard_preparations({"ours": 1, "another": 2})
    assert sorted(path.name for path in store.preparation("ours")[0].parent.iterdir()) == ["ours.h5", "ours.state"]
    store.close()


def test_failures_count_for_the_program_that_found_them() -> None:
    failed = Member("m", "m.h5", "1", {}, "failed", "blew up", program=program_identity())
    assert failed_before(failed)
    assert not failed_before(replace(failed, program="dem-cli 0.0.1"))
    assert not failed_before(replace(failed, program=""))
    assert not failed_before(replace(failed, state="waiting"))


def test_the_manifest_is_readable(tmp_path: Path) -> None:
    store = Store(manifest_of(tmp_path))
    store.begin()
    text = (store.folder / "sweep.toml").read_text()
    raw = tomllib.loads(text)
    assert text.startswith("# Written by dem sweep")
    assert raw["axis"][0] == {"kind": "grid", "values": {"stage.shake.amplitude": ["400 gal", "800 gal"]}}
    assert raw["member"][3]["settings"] == {"stage.shake.amplitude": "800 gal", "stage.shake.frequency": "20 Hz"}
    store.close()


def test_a_member_is_known_under_the_name_that_another_sweep_gave_it(tmp_path: Path) -> None:
    """Axes that come and go change names, and not what was run: seed 3 is the scenario's own."""
    before = Store(manifest_of(tmp_path))
    for member in before.manifest.members[:2]:
        pretend(before.folder, member)
    pretend(before.folder, before.manifest.members[2], complete=0)
    before.close()
    wider = make_plan(sweep_file(tmp_path, {"grid": GAL_HZ, "seeds": [3, 4]})).manifest(tmp_path / "out")
    after = Store(wider)
    after.begin()
    states = {one.name: one.state for one in after.manifest.members}
    assert [name for name, state in states.items() if state == "done"] == ["400gal-10Hz-seed3", "400gal-20Hz-seed3"]
    assert sum(after.is_done(one) for one in after.manifest.members) == 2
    assert after.manifest.former == (before.manifest.members[2].file,)
    after.close()


def test_sweeps_that_begin_together_find_each_other(tmp_path: Path) -> None:
    """A job array does: none of them may take a lock that is half taken for a sweep with other members."""
    manifest, barrier = manifest_of(tmp_path), threading.Barrier(8)

    def begin(_: int) -> Store:
        barrier.wait()
        return Store(manifest)

    for _ in range(5):
        with ThreadPoolExecutor(8) as pool:
            for store in pool.map(begin, range(8)):
                store.close()


@pytest.mark.parametrize("name", ["lock", "active", "claims/key"])
def test_a_folder_that_cannot_be_written_is_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    opened = os.open

    def deny(path: Any, *args: Any, **options: Any) -> int:
        if str(path).endswith(name):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        return opened(path, *args, **options)

    manifest = manifest_of(tmp_path)
    monkeypatch.setattr("dem_cli.sweep.store.os.open", deny)
    with pytest.raises(ResultsError, match=rf"{name}: cannot be written \(Permission denied\)"):
        Store(manifest).claim("key")


def test_what_the_one_who_ran_a_member_wrote_is_kept(tmp_path: Path) -> None:
    """Another sweep finds the file and knows nothing of how long it took."""
    one, other = Store(manifest_of(tmp_path)), Store(manifest_of(tmp_path))
    one.begin()
    first = one.manifest.members[0]
    one.record({first.hash: first.with_state("done", seconds=3.0)})
    other.record({first.hash: first.with_state("done")})
    assert read_manifest(one.folder).members[0].seconds == 3.0
    one.close()
    other.close()
