"""Result files on disk: their names, how one is made, and that an unfinished one opens at any time."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path
from typing import Any

import h5py

from dem_cli.errors import ResultsError

SPARE_BYTES = 4_000_000  # room for HDF5's own bookkeeping of a flush


def partial_path(path: Path | str) -> Path:
    """Where a result file lies until it is complete: out.h5 -> out.partial.h5."""
    path = Path(path)
    return path.with_name(f"{path.stem}.partial{path.suffix}")


def check_target(path: Path | str, *, force: bool) -> None:
    """The one guard against overwriting: ResultsError if a run to `path` would replace a file, or cannot write there."""
    path = Path(path)
    if path.is_dir():
        raise ResultsError(f"{path}: is a folder; give the name of a file")
    partial = partial_path(path)
    if not path.parent.is_dir():
        raise ResultsError(f"{path}: the folder {path.parent} does not exist")
    if force:
        return
    if path.exists():
        raise ResultsError(f"{path}: exists already; --force replaces it")
    if partial.exists():
        raise ResultsError(f"{partial}: left by an unfinished run, or one still going on; --force replaces it")


def create_file(partial: Path, base: Path | None = None) -> Any:
    """A new file that stays readable whatever happens to this process; with the content of `base`, a complete result file, if one is given.

    Superblock 0 has no mark "open for writing" that would lock out readers after a kill, there are no file locks, and
    metadata reach the file only in a flush, not whenever HDF5's cache is full.
    """
    try:
        partial.unlink(missing_ok=True)  # not truncated: a run still writing to the old file keeps its own
        if base is not None:
            shutil.copyfile(base, partial)
        file = h5py.File(partial, "r+" if base else "x", libver=("earliest", "v110"), locking=False, rdcc_nbytes=2**20)
    except OSError as error:
        raise ResultsError(f"{partial}: cannot be written ({cause(error)})") from error
    config = file.id.get_mdc_config()
    config.incr_mode = config.decr_mode = config.flash_incr_mode = 0
    config.evictions_enabled = False
    file.id.set_mdc_config(config)
    return file


def announce_length(file: Any, extra: int) -> None:
    """Give the file its present length plus `extra` bytes (a hole, no room on disk) and say so in its head.

    HDF5 writes the length last in a flush; a process killed before that, or a reader that opened the file before it, would meet
    links that point beyond the end. The number has 8 bytes at 40 in superblock 0 (HDF5 file format specification, II.A).
    """
    length = file.id.get_filesize() + extra
    handle = file.id.get_vfd_handle()
    if extra:
        os.ftruncate(handle, length)
    os.pwrite(handle, length.to_bytes(8, "little"), 40)
    if not extra:
        os.ftruncate(handle, length)


def cause(error: BaseException | None) -> str:
    """The operating system's words inside HDF5's message."""
    found = re.search(r"error message = '([^']+)'", str(error))
    if found:
        return found.group(1)
    return str(getattr(error, "strerror", None) or error)
