"""Which kind of run files hold: grains in 2D over time, a quasi-static test over increments, or bodies in 3D."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from dem_cli.errors import ScenarioError
from dem_cli.results import open_results
from dem_cli.results.layouts import Kind

WORDS: dict[Kind, str] = {
    "time": "a run over time of grains in 2D",
    "increment": "a quasi-static test",
    "bodies": "a run of bodies in 3D",
}


def kind_of(files: Sequence[Path]) -> Kind:
    """Of all `files`. ScenarioError where one table would have to hold several kinds, ResultsError for a file that cannot be read."""
    first: dict[Kind, Path] = {}
    for path in files:
        with open_results(path) as results:
            first.setdefault(results.kind, path)
    if len(first) > 1:
        one, two = list(first)[:2]
        raise ScenarioError(
            f"{first[one]} is {WORDS[one]} and {first[two]} {WORDS[two]}: they have no columns in common; report them separately"
        )
    return next(iter(first), "time")
