"""A run as CSV tables: series, stages, surface and tracks, units in the header, every bit of every number
kept.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.report.shear import STATE, ShearSummary
from dem_cli.report.summary import MEASURES, Summary
from dem_cli.results import Results
from dem_cli.results.schema import INCREMENTS, SERIES
from dem_cli.whole import whole

Row = Sequence[object]


def folders(files: Sequence[Path], folder: Path) -> list[Path]:
    """Where the tables of each file go: `folder` itself for one file, else a folder below it named for the
    file.

    Raises ScenarioError if two files would share one.
    """
    if len(files) == 1:
        return [folder]
    places = [folder / path.stem for path in files]
    double = next((place for place in places if places.count(place) > 1), None)
    if double is not None:
        raise ScenarioError(f"--csv: two files would write to {double}; write them one at a time")
    return places


def export_csv(results: Results, summary: Summary, folder: Path, force: bool = False) -> list[Path]:
    """Write the tables that the file holds into `folder` (made if absent) and return their paths.

    series.csv has a row a time and a column a quantity; stages.csv a row a stage; surface.csv a row a time
    and place; tracks.csv a row a time and grain. NaN is written as nan. Raises ResultsError if one of the
    files exists and `force` is not set; then nothing is written.
    """
    tables = {
        "series.csv": series_table(results),
        "stages.csv": _stages(summary),
        "surface.csv": _surface(results),
    }
    if results.tracks is not None:
        tables["tracks.csv"] = tracks_table(results)
    return write_tables(tables, folder, force)


def export_shear_csv(results: Results, summary: ShearSummary, folder: Path, force: bool = False) -> list[Path]:
    """The same for a quasi-static test: series.csv has a row an increment, dissipation.csv a row an increment and rank."""
    tables = {
        "series.csv": series_table(results),
        "stages.csv": _shear_stages(summary),
        "dissipation.csv": _dissipation(results),
    }
    if results.tracks is not None:
        tables["tracks.csv"] = tracks_table(results)
    return write_tables(tables, folder, force)


def write_tables(tables: Mapping[str, Iterator[Row]], folder: Path, force: bool) -> list[Path]:
    paths = {name: folder / name for name in tables}
    there = [str(path) for path in paths.values() if path.exists()]
    if there and not force:
        raise ResultsError(
            f"{', '.join(there)} {'exist' if there[1:] else 'exists'}; choose another folder or add --force"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, rows in tables.items():
            with whole(paths[name]) as work, work.open("w", newline="", encoding="utf-8") as stream:
                csv.writer(stream, lineterminator="\n").writerows(rows)
    except OSError as error:
        raise ResultsError(f"{folder}: cannot be written: {error.strerror}") from None
    return list(paths.values())


def series_table(results: Results) -> Iterator[Row]:
    names = list(results.series)
    if results.axis not in names:
        names.insert(0, results.axis)
    yield [head(name, results.series.unit(name)) for name in names]
    yield from zip(*(np.asarray(results.series[name]).tolist() for name in names), strict=True)


def _stages(summary: Summary) -> Iterator[Row]:
    measures = [head(f"{name} {when}", SERIES[name][0]) for when in ("before", "after") for name in MEASURES]
    yield [
        "stage",
        "name",
        "kind",
        "start [s]",
        "end [s]",
        "reason",
        "amplitude [m/s^2]",
        "frequency [Hz]",
        *measures,
    ]
    for s in summary.stages:
        values = [state[name] for state in (s.before, s.after) for name in MEASURES]
        yield [s.number, s.name, s.kind, s.start, s.end, s.reason, s.amplitude, s.frequency, *values]


def _shear_stages(summary: ShearSummary) -> Iterator[Row]:
    """State at both ends, and what the stage did: numbers of `shear.StageReport` in SI units."""
    states = [head(f"{name} {when}", INCREMENTS[name][0]) for when in ("before", "after") for name in STATE]
    points = [
        f"{name} {what}"
        for what in ("turn", "peak", "end")
        for name in ("increment", "shear strain", "volumetric strain", "s1/s2", "void ratio")
    ]
    energies = ("work", "elastic", "friction", "released", "residual")
    yield [
        "stage",
        "name",
        "kind",
        "reason",
        "increments",
        "events",
        *states,
        *points,
        *(f"{name} [J/m^3]" for name in energies),
        "closure",
    ]
    for s in summary.stages:
        row: list[object] = [s.number, s.name, s.kind, s.reason, s.increments, len(s.solver.events)]
        row += [state[name] for state in (s.before, s.after) for name in STATE]
        done = s.shearing
        for point in (done.turn, done.peak, done.end) if done else (None, None, None):
            row += (
                [math.nan] * 5
                if point is None
                else [point.in_stage, point.shear_strain, point.volumetric_strain, point.stress_ratio, point.void_ratio]
            )
        yield [
            *row,
            *(
                [math.nan] * 6
                if done is None
                else [*(getattr(done.energy, name) for name in energies), done.energy.closure]
            ),
        ]


def _dissipation(results: Results) -> Iterator[Row]:
    yield ["increment", "rank", "i", "j", "energy [J]", "share"]
    table = results.dissipation
    if table is None:
        return
    for k, increment in enumerate(table.increment.tolist()):
        count = int(np.count_nonzero(np.isfinite(table.energy[k])))
        columns = (table.rank, table.i[k], table.j[k], table.energy[k], table.share[k])
        yield from zip([increment] * count, *(np.asarray(column)[:count].tolist() for column in columns), strict=True)


def _surface(results: Results) -> Iterator[Row]:
    yield ["time [s]", "x [m]", "eta [m]"]
    surface = results.surface
    x = np.asarray(surface.x).tolist()
    for time, eta in zip(np.asarray(surface.time).tolist(), np.asarray(surface.eta).tolist(), strict=True):
        yield from zip([time] * len(x), x, eta, strict=True)


def tracks_table(results: Results) -> Iterator[Row]:
    tracks = results.tracks
    if tracks is None:
        return
    units = results.layout.tracks
    names = [name for name in units if name in tracks.arrays]
    yield [
        "time [s]" if results.axis == "time" else "increment",
        "grain",
        *(head(name, units[name][0]) for name in names),
    ]
    ids: Iterable[int] = np.asarray(tracks.ids).tolist()
    columns = [np.asarray(tracks.arrays[name]) for name in names]
    for k, time in enumerate(np.asarray(tracks.time).tolist()):
        yield from zip([time] * len(tracks.ids), ids, *(column[k].tolist() for column in columns), strict=True)


def head(name: str, unit: str) -> str:
    return name if unit in ("", "1") else f"{name} [{unit}]"
