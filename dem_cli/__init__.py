"""dem-cli: granular mechanics from the command line, in 2D and for rigid bodies in 3D.

In a notebook: `from dem_cli import load_scenario, run_scenario, open_results`. The names are imported when they are first used,
since `dem --help` needs none of what they bring along.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"
__all__ = ["load_scenario", "open_results", "run_scenario"]

_HOME = {"load_scenario": "dem_cli.scenario", "run_scenario": "dem_cli.run", "open_results": "dem_cli.results"}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
