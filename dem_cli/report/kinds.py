"""Which kind of run files hold: over time, or over the increments of a quasi-static test."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dem_cli.errors import ScenarioError
from dem_cli.results import open_results


def axis_of(files: Sequence[Path]) -> str:
    """ "time" or "increment". ScenarioError where one table would have to hold both, ResultsError for a file that cannot be read."""
    first: dict[str, Path] = {}
    for path in files:
        with open_results(path) as results:
            first.setdefault(results.axis, path)
    if len(first) > 1:
        raise ScenarioError(
            f"{first['time']} is a run over time and {first['increment']} a quasi-static test: they have no column in common; "
            "report them separately"
        )
    return next(iter(first), "time")
