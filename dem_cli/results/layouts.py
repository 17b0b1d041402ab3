"""What a result file holds for which engine: runs over time, quasi-static tests and bodies in 3D share all but these tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from dem_cli.results.body_schema import BODY_FRAMES, BODY_SERIES, BODY_TRACKS
from dem_cli.results.schema import FRAMES, INCREMENT_FRAMES, INCREMENTS, SERIES, STAGES, TRACKS
from dem_cli.results.tables import INCREMENT, TIME, Axis

Columns = Mapping[str, tuple[str, str]]
Kind = Literal["time", "increment", "bodies"]


@dataclass(frozen=True)
class Layout:
    """The parts of a result file that depend on what is counted along its axis, and on what moves.

    kind: "time" (grains in 2D over time), "increment" (quasi-static tests) or "bodies" (in 3D, over time). axis: of /series, /tracks,
    /frames and `Steps/Values`. version: of the format that such files are written in. series, frames, tracks, stages: name ->
    (unit, definition). surface, dissipation: whether there are such groups. moving: walls are written with every frame.
    """

    kind: Kind
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
    kind="time",
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
    kind="increment",
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


IMPULSE = Layout(
    kind="bodies",
    axis=TIME,
    version=4,
    series=BODY_SERIES,
    frames=BODY_FRAMES,
    tracks=BODY_TRACKS,
    stages=STAGES,
    surface=False,
    dissipation=False,
    moving=False,
)
ENGINES = {"granular-element": OVER_INCREMENTS, "impulse": IMPULSE}


def layout_of(engine: str) -> Layout:
    """The layout of an engine's result files."""
    return ENGINES.get(engine, OVER_TIME)


def layout_in(attributes: Mapping[str, object]) -> Layout:
    """The layout of a file by the attributes of its root; KeyError for one that is unknown.

    Files of format 1 and early ones of 2 do not tell their axis. That of the impulse engine's is time too, so its name decides.
    """
    if attributes.get("engine") == "impulse":
        return IMPULSE
    return {layout.axis.name: layout for layout in (OVER_TIME, OVER_INCREMENTS)}[str(attributes.get("axis", "time"))]
