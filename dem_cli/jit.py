"""The one decorator for compiled kernels, and the folder that their machine code is kept in.

Numba's own cache misses edits in other files that a kernel calls. So the folder is named by a hash of all kernel sources: an
edit anywhere gives a new folder, and unchanged sources find theirs. It lies beside the user's other caches, so
that a read-only installation works too; `NUMBA_CACHE_DIR` overrides it.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba


def _cache_folder() -> Path:
    package = Path(__file__).parent
    digest = hashlib.sha256(f"{numba.__version__} {sys.version_info[:2]} {package}".encode())
    for source in sorted(package.rglob("*.py")):
        text = source.read_bytes()
        if b"jit import kernel" in text or source == Path(__file__):
            digest.update(text)
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "dem-cli" / f"numba-{digest.hexdigest()[:16]}"


CACHE_FOLDER = Path(os.environ.get("NUMBA_CACHE_DIR") or _cache_folder())
numba.config.CACHE_DIR = str(CACHE_FOLDER)  # type: ignore[attr-defined]


def kernel(*, inline: bool = False, inner: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Decorator of every compiled function: cached, IEEE arithmetic save that a*b + c may be fused.

    inline: merge the machine code into its callers (small functions of inner loops).
    inner: called by other kernels only; saves the time to compile what Python would need to call it.
    NaN and the order of sums are kept, so the same scenario gives the same bits on one machine.
    """
    # Numba knows the last two, its type hints do not.
    unhinted: dict[str, Any] = {"no_cpython_wrapper": inner, "no_cfunc_wrapper": inner}
    decorate: Callable[[Callable[..., Any]], Any] = numba.njit(
        cache=True, error_model="numpy", fastmath={"contract"}, forceinline=inline, **unhinted
    )
    return decorate


def is_cold() -> bool:
    """Whether the cache holds no machine code of the present sources yet: the first run will compile."""
    return not any(CACHE_FOLDER.rglob("*.nbi"))
