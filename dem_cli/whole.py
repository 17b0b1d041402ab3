"""Files that are there whole or not at all: what stood in their place is kept until they are written."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Where to write; it becomes `path`, or what a link there points to, once the block ends, and goes if the block fails."""
    target = path.resolve()
    work = target.with_name(f".{target.name}.{os.getpid()}.partial")
    try:
        yield work
        os.replace(work, target)
    finally:
        work.unlink(missing_ok=True)
