"""A run of bodies in 3D as CSV tables: series, stages, tracks, the check and the run-out, units in the header."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from dem_cli.report.export import Row, head, series_table, tracks_table, write_tables
from dem_cli.report.impulse import MEASURES, BodySummary
from dem_cli.report.impulse_checks import Check
from dem_cli.report.impulse_runout import runout
from dem_cli.results import BodyResults
from dem_cli.results.body_schema import BODY_SERIES


def export_body_csv(results: BodyResults, summary: BodySummary, folder: Path, force: bool = False) -> list[Path]:
    """Write the tables that the file holds into `folder` (made if absent) and return their paths.

    series.csv has a row a time; stages.csv a row a stage; tracks.csv a row a time and body; check.csv a row of the report's check;
    runout.csv a row a body. Raises ResultsError if one of the files exists and `force` is not set; then nothing is written.
    """
    tables = {"series.csv": series_table(results), "stages.csv": _stages(summary)}
    if results.tracks is not None:
        tables["tracks.csv"] = tracks_table(results)
    for check in summary.checks:
        tables["check.csv"] = _check(check)
    if summary.runout is not None:
        tables["runout.csv"] = _runout(results)
    return write_tables(tables, folder, force)


def _stages(summary: BodySummary) -> Iterator[Row]:
    measures = [head(f"{name} {when}", BODY_SERIES[name][0]) for when in ("before", "after") for name in MEASURES]
    yield ["stage", "name", "kind", "start [s]", "end [s]", "reason", *measures]
    for s in summary.stages:
        values = [state[name] for state in (s.before, s.after) for name in MEASURES]
        yield [s.number, s.name, s.kind, s.start, s.end, s.reason, *values]


def _check(check: Check) -> Iterator[Row]:
    yield [head(name, unit) for name, (_, unit) in check.columns.items()]
    for row in check.rows:
        yield [row[name] for name in check.columns]


def _runout(results: BodyResults) -> Iterator[Row]:
    found, groups = runout(results), results.frame(0).bodies.group
    yield ["body", "kind", "distance [m]", "drop [m]", "angle of reach [deg]", "heading [deg]", "at rest", "escaped"]
    for k in range(len(found.distance)):
        numbers = (found.distance[k], found.drop[k], math.degrees(found.angle[k]), math.degrees(found.heading[k]))
        flags = (int(found.at_rest[k]), int(found.escaped[k]))
        yield [k, results.groups[groups[k]], *map(float, numbers), *flags]
