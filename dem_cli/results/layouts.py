"""What a result file holds for which engine: runs over time and quasi-static tests over increments share all but these tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dem_cli.results.schema import FRAMES, INCREMENT_FRAMES, INCREMENTS, SERIES, STAGES, TRACKS
from dem_cli.results.tables import INCREMENT, TIME, Axis

Columns = Mapping[str, tuple[str, str]]


@dataclass(frozen=True)
class Layout:
    """The parts of a result file that depend on what is counted along its axis.

    axis: of /series, /tracks, /frames and `Steps/Values`. version: of the format that such files are written in. series, frames, tracks, stages:
    name -> (unit, definition). surface, dissipation: whether there are such groups. moving: walls are written with every frame.
    """

    axis: Axis
    version: int
    series: Columns
    frames: Columns
    tracks: Columns
    stages: Columns
    surface: bool
    dissipation: bool
    moving: bool

    @property
    def measures(self) -> list[str]:
        """Names of the series that stages keep `before` and `after` of."""
        return [name for name in self.series if name not in (self.axis.name, "step", "stage")]


OVER_TIME = Layout(
    axis=TIME,
    version=2,
    series=SERIES,
    frames=FRAMES,
    tracks=TRACKS,
    stages=STAGES,
    surface=True,
    dissipation=False,
    moving=False,
)
OVER_INCREMENTS = Layout(
    axis=INCREMENT,
    version=3,
    series=INCREMENTS,
    frames=INCREMENT_FRAMES,
    tracks={name: TRACKS[name] for name in ("x", "y", "angle")},
    stages={
        **STAGES,
        "kind": ("1", "compress, shear, load, cyclic"),
        "start": ("1", "number of increments done"),
        "end": ("1", "number of increments done, NaN if the stage has not ended"),
    },
    surface=False,
    dissipation=True,
    moving=True,
)


def layout_of(engine: str) -> Layout:
    """The layout of an engine's result files."""
    return OVER_INCREMENTS if engine == "granular-element" else OVER_TIME


def layout_over(axis: str) -> Layout:
    """The layout of a file by its attribute `axis`; KeyError for one that is unknown."""
    return {layout.axis.name: layout for layout in (OVER_TIME, OVER_INCREMENTS)}[axis]
