"""Where a result comes from: versions, platform and the revision of the code."""

from __future__ import annotations

import hashlib
import platform
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

from dem_cli import __version__


def provenance() -> dict[str, str]:
    """Attributes for the root of a result file."""
    found = {f"{name}_version": _version(name) for name in ("numpy", "numba", "h5py")}
    return {
        "program": "dem-cli",
        "program_version": __version__,
        "git_revision": git_revision(),
        "python_version": platform.python_version(),
        **found,
        "platform": platform.platform(),
    }


@cache
def program_identity() -> str:
    """Version and a digest of the package's sources: two installations with the same one give the same results of the same libraries."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode() + source.read_bytes())
    return f"dem-cli {__version__} ({digest.hexdigest()[:10]})"


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def git_revision(folder: Path | None = None) -> str:
    """Commit of the checkout that this package is tracked in, with "-dirty" after changes; "" where there is none."""
    folder = folder or Path(__file__).parents[1]

    def git(*args: str) -> str:
        command = ["git", "-C", str(folder), *args]
        return subprocess.run(command, capture_output=True, text=True, timeout=5, check=True).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", "__init__.py")  # a virtual environment inside somebody's repository is none
        return git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return ""
