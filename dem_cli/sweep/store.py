"""The folder of a sweep on disk: its manifest, its result files, and who works on what.

Several sweeps may work in one folder, on one machine or on several that share the disk: each claims what it runs by a lock on a small
file, which the system takes back when its process ends, however it ends. Whether a member is done its result file says, and nothing else.

    sweep.toml   NAME-HASH.h5 ...   .sweep/lock   .sweep/claims/KEY   .sweep/preparations/KEY.h5, KEY.state
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import os
import pickle
import secrets
import socket
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import h5py

from dem_cli.errors import ResultsError
from dem_cli.results.files import partial_path
from dem_cli.results.manifest import NAME, Manifest, Member, NewerManifestError, read_manifest, write_manifest
from dem_cli.results.provenance import program_identity
from dem_cli.sweep.plan import Planned

INNER = ".sweep"
FAILED = "failed: "  # begins what a claim says of a member that fails


class Store:
    """One sweep's folder, made if it is not there. ResultsError if it cannot be, or holds something else."""

    def __init__(self, manifest: Manifest) -> None:
        self.folder = manifest.folder
        self.manifest = manifest
        self._claims: dict[str, int] = {}
        self._sound: dict[str, tuple[tuple[int, int], ...]] = {}  # times and sizes of preparations that were looked at
        self._verdicts: dict[str, str] = {}  # what was written in a claim before it was ours
        inner = self.folder / INNER
        # Looked at once: another sweep may be making the folder at this moment.
        there = {path.name for path in self.folder.iterdir()} if self.folder.is_dir() else set()
        if there and not there & {NAME, INNER}:
            raise ResultsError(
                f"{self.folder}: holds other files, and is no folder of a sweep. Name another one with -o"
            )
        try:
            (inner / "claims").mkdir(parents=True, exist_ok=True)
            (inner / "preparations").mkdir(exist_ok=True)
            with contextlib.suppress(FileExistsError), (inner / "token").open("x") as file:
                file.write(secrets.token_hex(16))
        except OSError as error:
            raise ResultsError(f"{self.folder}: cannot be written ({error.strerror})") from error
        self._active = self._join()

    def _join(self) -> int:
        """Hold a lock that tells others which members are worked on here. ResultsError if another sweep with other members is at work."""
        with self._locked():  # so that two that begin at once do not meet half-way
            return self._join_alone()

    def _join_alone(self) -> int:
        ours = hashlib.sha256("".join(one.hash for one in self.manifest.members).encode()).hexdigest()
        handle = self._open("active")
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            theirs, _, who = os.read(handle, 1000).decode().partition(" ")
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES) and theirs != ours:
                os.close(handle)
                raise ResultsError(
                    f"{self.folder}: another sweep with other members works there ({who.strip()}). Name another folder with -o, or wait for it"
                ) from None
        else:
            _write_over(handle, f"{ours} {_ourselves()}")
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_SH)
        return handle

    @property
    def token(self) -> Path:
        """A file by which another machine knows whether it sees this folder."""
        return self.folder / INNER / "token"

    # -- what is there ----------------------------------------------------------------------------------------------

    def is_done(self, member: Member) -> bool:
        """Whether a member's result file is there, complete, and of its scenario."""
        return bool(member.hash) and done_file(self.folder / member.file, member.hash)

    def preparation(self, key: str) -> tuple[Path, Path]:
        """Result file and engine of a preparation."""
        folder = self.folder / INNER / "preparations"
        return folder / f"{key}.h5", folder / f"{key}.state"

    def is_prepared(self, key: str) -> bool:
        """Whether a preparation is there, and not cut short by a crash of the machine. The engine is written last."""
        try:
            marks = tuple((one.st_mtime_ns, one.st_size) for one in map(os.stat, self.preparation(key)))
        except OSError:
            return False
        if self._sound.get(key) != marks:
            if not _is_sound(*self.preparation(key)):
                return False
            self._sound[key] = marks
        return True

    def discard_preparations(self, keys: Collection[str]) -> None:
        """Remove preparations but those of `keys`: of a scenario or a program that has changed since, nothing goes on from them."""
        for path in (self.folder / INNER / "preparations").iterdir():
            if path.name.lstrip(".").partition(".")[0] not in keys:  # those that are being written begin with a dot
                path.unlink(missing_ok=True)

    def discard_partial(self, member: Member) -> None:
        """What an interrupted run of a member has left; it is redone from the start of its own stages."""
        partial_path(self.folder / member.file).unlink(missing_ok=True)

    # -- claims -----------------------------------------------------------------------------------------------------

    def claim(self, key: str) -> bool:
        """Take a member or a preparation for this process; False if another one has it."""
        if key in self._claims:
            return True
        handle = self._open(f"claims/{key}")
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                os.close(handle)
                return False
            # a disk that knows no locks: then there is no protection, but the sweep can go on
        self._claims[key] = handle
        self._verdicts[key] = os.pread(handle, 100_000, 0).decode(errors="replace")
        _write_over(handle, _ourselves())
        return True

    def condemn(self, key: str, reason: str) -> None:
        """Leave word with the claim that a member fails, for sweeps that come to it before they read the manifest again."""
        if (handle := self._claims.get(key)) is not None:
            _write_over(handle, f"{FAILED}{program_identity()}\n{reason}")

    def condemned(self, key: str) -> str:
        """Why another sweep with this very program has found a member to fail, since we claimed it; else nothing."""
        head = f"{FAILED}{program_identity()}\n"
        said = self._verdicts.get(key, "")
        return said.removeprefix(head) if said.startswith(head) else ""

    def owner(self, key: str) -> str:
        """Who has claimed it last."""
        try:
            return (self.folder / INNER / "claims" / key).read_text(encoding="utf-8").strip() or "another sweep"
        except OSError:
            return "another sweep"

    def release(self, key: str) -> None:
        handle = self._claims.pop(key, None)
        if handle is not None:
            os.close(handle)

    def close(self) -> None:
        for key in list(self._claims):
            self.release(key)
        os.close(self._active)

    def _open(self, name: str) -> int:
        """A small file that is locked, or says something. ResultsError if it cannot be made."""
        try:
            return os.open(self.folder / INNER / name, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise ResultsError(
                f"{self.folder / INNER / name}: cannot be written ({error.strerror}). No result file is lost"
            ) from error

    # -- the manifest -----------------------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """One process at a time reads and writes the manifest."""
        handle = self._open("lock")
        try:
            with contextlib.suppress(OSError):
                fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)

    def begin(self) -> None:
        """Bring the manifest in line with the plan and with what lies in the folder; what others have written of these members is kept."""
        with self._locked():
            before = {one.hash: one for one in self._written() if one.hash}
            found = find_done(self.folder, self.manifest.members)
            members = []
            for planned in self.manifest.members:
                known = before.get(planned.hash, planned)
                done = found.get(planned.hash)
                if done and done.name != planned.file:
                    os.replace(done, self.folder / planned.file)
                if done and known.state != "done":
                    known = replace(known, state="done", reason="", program=_program_of(self.folder / planned.file))
                elif not done and known.state == "done":
                    known = replace(known, state="waiting")
                members.append(replace(known, name=planned.name, file=planned.file, settings=planned.settings))
            ours = {one.file for one in members}
            former = sorted(
                path.name for path in self.folder.glob("*.h5") if path.name not in ours and ".partial" not in path.name
            )
            self.manifest = replace(self.manifest, members=tuple(members), former=tuple(former))
            self._write()

    def record(self, changed: Mapping[str, Member]) -> None:
        """Write what has become of members, by hash, next to what other processes have written since."""
        with self._locked():
            written = {one.hash: one for one in self._written() if one.hash}
            members = []
            for one in self.manifest.members:
                other = written.get(one.hash, one)
                news = changed.get(one.hash)
                if news and news.state == other.state == "done":  # who has run it knows more of it
                    news = other if other.seconds == other.seconds else news
                members.append(news or (other if other.state != "waiting" else one))
            self.manifest = replace(self.manifest, members=tuple(members))
            self._write()

    def _written(self) -> tuple[Member, ...]:
        try:
            return read_manifest(self.folder).members
        except NewerManifestError:
            raise
        except ResultsError:
            return ()

    def _write(self) -> None:
        try:
            write_manifest(self.manifest)
        except OSError as error:
            first = "make room" if error.errno in (errno.ENOSPC, errno.EDQUOT) else "mend that"
            raise ResultsError(
                f"{self.folder / NAME}: cannot be written ({error.strerror}). No result file is lost; {first} and run the same command again"
            ) from error


def _write_over(handle: int, text: str) -> None:
    """On a full disk it is left out: the lock counts, the words are for those who ask."""
    with contextlib.suppress(OSError):
        os.truncate(handle, 0)
        os.pwrite(handle, text.encode(), 0)


def _ourselves() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"


def find_done(folder: Path, members: Iterable[Member | Planned]) -> dict[str, Path]:
    """Result files of members that are done, by the member's hash. They may have other names, by the settings of another sweep."""
    there: dict[str, list[Path]] = {}
    for path in folder.glob("*.h5"):
        there.setdefault(path.stem[-8:], []).append(path)
    found: dict[str, Path] = {}
    for one in members:
        places = (folder / one.file, *there.get(one.hash[:8], ())) if one.hash else ()
        if done := next((path for path in places if done_file(path, one.hash)), None):
            found[one.hash] = done
    return found


def done_file(path: Path, scenario_hash: str) -> bool:
    """Whether a result file is complete and of the scenario of this hash."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            return bool(file.attrs["complete"]) and file.attrs["scenario_hash"] == scenario_hash
    except (OSError, KeyError):
        return False


def _is_sound(file: Path, state: Path) -> bool:
    """Whether the files of a preparation are whole: a crash of the machine leaves them short, or full of zeros."""
    try:
        with state.open("rb") as handle, h5py.File(file, "r", locking=False) as results:
            handle.seek(-1, os.SEEK_END)
            return handle.read() == pickle.STOP and bool(results.attrs["complete"])
    except (OSError, KeyError):
        return False


def _program_of(path: Path) -> str:
    """The version that wrote a result file."""
    with h5py.File(path, "r", locking=False) as file:
        return f"{file.attrs['program']} {file.attrs['program_version']}"


def failed_before(member: Member) -> bool:
    """Whether this very program has found that a member fails: it would do so again."""
    return member.state == "failed" and member.program == program_identity()
