"""The whole program in one function: the only place where scenario, assembly, engine, measures and results meet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from dem_cli.analysis.measures import Measures, measure_frame, series_row
from dem_cli.analysis.surface import bin_centers
from dem_cli.analysis.void_ratio import WindowMargins
from dem_cli.assembly import build_assembly
from dem_cli.engines.explicit.engine import ExplicitEngine
from dem_cli.errors import RunError
from dem_cli.interrupts import marked_interrupts
from dem_cli.results import ResultWriter
from dem_cli.scenario import Scenario, Shake
from dem_cli.state import Frame

# Told of every frame, with its row of the series where it has one.
Listener = Callable[[Frame, Mapping[str, float] | None], None]


def run_scenario(
    scenario: Scenario,
    target: Path,
    *,
    force: bool = False,
    listener: Listener | None = None,
    packing_listener: Callable[[str], None] | None = None,
) -> Path:
    """Run a scenario and write its result file `target`; returns the file's path. packing_listener: told what the packing is at.

    ResultsError if the file exists and `force` is not given, ScenarioError if the scenario cannot be run, RunError if the run blows up; after
    that, and after Ctrl-C, what was written stays readable under the partial name (`results.partial_path`).
    """
    with marked_interrupts() as check:

        def tell(words: str) -> None:
            check()
            if packing_listener:
                packing_listener(words)

        assembly = build_assembly(scenario, tell)
    engine = ExplicitEngine(scenario, assembly)
    output, container = scenario.output, scenario.container
    surface_x = bin_centers(container.width, output.surface_bins)
    with marked_interrupts() as engine.check, ResultWriter(
        target, scenario_text=scenario.source, resolved_toml=scenario.resolved_toml(), scenario_hash=scenario.hash,
        seed=scenario.seed, engine=scenario.engine, title=scenario.title, grains=assembly.grains, walls=assembly.walls,
        depth=scenario.depth, container={"width": container.width, "height": container.height},
        tracks=np.array(output.tracks.grains) if output.tracks else None, surface_x=surface_x, bonds=assembly.bonds,
        force=force,
    ) as writer:  # fmt: skip
        for number, stage in enumerate(scenario.stages, 1):
            if isinstance(stage, Shake) and stage.motion:
                writer.add_motion(number, stage.motion.acceleration, stage.motion.facts())
        row: dict[str, float] | None = None
        try:
            for frame in engine.frames():
                if frame.step == 0 and frame.stage_start:
                    frame = replace(frame, warnings=(*assembly.warnings, *frame.warnings))
                measures = measure(scenario, frame) if frame.due & {"series", "frames"} else None
                row = series_row(frame, measures) if measures else row
                write(writer, scenario, frame, measures, row)
                if listener:
                    listener(frame, row if measures else None)
                engine.check()
                del frame, measures  # large; the next ones are made before these names are bound again
        except RunError as error:
            writer.warn(str(error))
            raise
        writer.finish("all stages are done")
    return target


def measure(scenario: Scenario, frame: Frame) -> Measures:
    """Measures of a frame as the scenario's [output] asks for them."""
    window = scenario.output.window
    return measure_frame(
        frame,
        width=scenario.container.width,
        depth=scenario.depth,
        surface_bins=scenario.output.surface_bins,
        window=WindowMargins(window.side, window.bottom, window.top),
    )


def write(
    writer: ResultWriter, scenario: Scenario, frame: Frame, measures: Measures | None, row: Mapping[str, float] | None
) -> None:
    """Write what a frame is due for; `row` is the last row of the series."""
    stage = scenario.stages[frame.stage]
    if measures and row and "series" in frame.due:
        writer.append_series(row, measures.eta)
    if frame.stage_start:
        writer.begin_stage(stage.name, stage.kind, frame.time, row)
    if measures and "frames" in frame.due:
        writer.append_frame(frame, measures.coordination, measures.stress)
    if "tracks" in frame.due:
        writer.append_tracks(frame.time, frame.grains)
    for warning in frame.warnings:
        writer.warn(warning)
    if frame.stage_end and row:
        writer.end_stage(frame.time, frame.stop_reason, row)
