"""Writer of result files of grains in 2D: runs over time and quasi-static tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dem_cli.results.dissipation import create_dissipation, ranked
from dem_cli.results.layouts import layout_of
from dem_cli.results.run_file import Part, RunFile
from dem_cli.results.schema import SURFACE
from dem_cli.results.tables import Table, make_scale
from dem_cli.results.vtkhdf import FrameWriter
from dem_cli.results.walls import create_walls
from dem_cli.state import Bonds, Floats, Frame, Grains, Increment, Ints, Slips, Walls


class ResultWriter(RunFile):
    """Writes one result file of grains; a context manager (`run_file.RunFile`).

    Runs over time have a free surface; quasi-static tests go over increments and have the contacts that dissipate most, and walls that move.

    container: width and height [m]; height None or absent for walls without end. tracks: numbers of the grains (not elements) to
    follow. surface_x: centres of the bins of the free surface [m]. bonds: None where there are none. boundary: number of boundary grains, the
    last of the elements. base: see RunFile; preparation: what made it is called.
    """

    _frames: FrameWriter

    def __init__(
        self,
        path: Path | str,
        *,
        scenario_text: str,
        resolved_toml: str,
        scenario_hash: str,
        seed: int,
        engine: str,
        title: str,
        grains: Grains,
        walls: Walls,
        depth: float,
        container: Mapping[str, float | None],
        tracks: Ints | None,
        surface_x: Floats | None = None,
        bonds: Bonds | None = None,
        boundary: int = 0,
        force: bool = False,
        base: Path | None = None,
        preparation: str = "",
    ) -> None:
        if (surface_x is None) == layout_of(engine).surface:
            raise ValueError("a run over time needs the bins of its free surface, and no other run has them")
        super().__init__(path, engine=engine, tracks=tracks, force=force, base=base)
        attributes = {
            "title": title,
            "scenario": scenario_text,
            "resolved": resolved_toml,
            "scenario_hash": scenario_hash,
            "seed": seed,
            "engine": engine,
            **({"preparation": preparation} if preparation else {}),
            "grains": grains.grain_count,
            "elements": len(grains),
            "depth": depth,
            "width": container["width"],
            "height": np.nan if container.get("height") is None else container["height"],
            "boundary": boundary,
        }
        self._begin(attributes, lambda: self._create_groups(grains, walls, surface_x, bonds or Bonds.none()))

    def _create_groups(
        self, grains: Grains, walls: Walls, surface_x: Floats | None, bonds: Bonds
    ) -> Sequence[Part | None]:
        file, layout = self._file, self._layout
        self._series = self._create_series()
        self._surface = self._create_surface(surface_x)
        self._dissipation = create_dissipation(file, layout)
        self._tracks = self._create_tracks("id of the disc or ellipse")
        self._stages = self._create_stages()
        create_walls(file, walls)
        self._warnings = self._create_warnings()
        self._frames = FrameWriter(file, layout, grains, walls, bonds)
        return self._series, self._surface, self._dissipation, self._frames, self._tracks

    def _create_surface(self, x: Floats | None) -> Table | None:
        if x is None:
            return None
        group = self._file.require_group("surface")
        unit, definition = SURFACE["x"]
        across = make_scale(group, "x", np.asarray(x, dtype=np.float64), unit, definition)
        return Table(group, {"eta": SURFACE["eta"]}, self._layout.axis, across)

    def append_series(self, row: Mapping[str, float], eta: Floats | None = None, slips: Slips | None = None) -> None:
        """row: exactly the names of the layout's series. eta: free surface in each bin [m], NaN where there is none, for runs over time;
        slips: the contacts that slid, for increments.
        """
        place = self._check_row(row)
        if (eta is None) != (self._surface is None) or (slips is None) != (self._dissipation is None):
            raise ValueError("a row of series needs the free surface over time, the contacts that slid over increments")
        self._keep_row(row)
        if self._surface is not None:
            self._bytes += self._surface.append(place, [eta])
        if self._dissipation is not None and slips is not None:
            self._bytes += self._dissipation.append(place, ranked(slips))
        self._end_row(row)

    def append_frame(self, frame: Frame | Increment, coordination: Ints, stress: Floats) -> None:
        """One step of /VTKHDF, after its row of the series. coordination (n,); stress of each element (n, 4) [Pa]: xx, xy, yx, yy."""
        with self._guard():
            self._need_room(self._frames.size(frame))
            self._bytes += self._frames.append(frame, coordination, stress, self._rows - 1)
            self._flush_if_due()

    def append_tracks(self, place: float, grains: Grains) -> None:
        """State of the followed grains at a time [s] or an increment; `grains` are all elements. Nothing happens if none is followed."""
        if self._tracks is None:
            return
        row = [getattr(grains, name)[self._track_ids] for name in self._tracks.names]
        self._bytes += self._tracks.append(place, row)
        with self._guard():
            self._flush_if_due()
