"""The whole program in one function: the only place where scenario, assembly, engine, measures and results meet."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from dem_cli.analysis.bodies3d import measure_bodies
from dem_cli.analysis.measures import Measures, measure_frame, series_row
from dem_cli.analysis.quasi_static import IncrementMeasures, measure_increment
from dem_cli.analysis.surface import bin_centers
from dem_cli.analysis.void_ratio import WindowMargins
from dem_cli.assembly import Assembly, build_assembly
from dem_cli.assembly.scene import build_scene
from dem_cli.errors import RunError
from dem_cli.interrupts import marked_interrupts
from dem_cli.results import ImpulseWriter, ResultWriter
from dem_cli.results.files import check_target
from dem_cli.results.run_file import RunFile
from dem_cli.rigid import BodyFrame, Scene
from dem_cli.scenario import DiscScenario, ImpulseScenario, QuasiStaticScenario, Scenario, Shake
from dem_cli.state import Bonds, Frame, Grains, Increment, Ints, Walls

# Told of every frame, with its row of the series where it has one, and of every increment, with its row.
Listener = Callable[[Frame | Increment | BodyFrame, Mapping[str, float] | None], None]


def run_scenario(
    scenario: Scenario | QuasiStaticScenario | ImpulseScenario,
    target: Path,
    *,
    force: bool = False,
    listener: Listener | None = None,
    packing_listener: Callable[[str], None] | None = None,
) -> Path:
    """Run a scenario and write its result file `target`; returns the file's path. packing_listener: told what the packing is at.

    ResultsError if the file exists and `force` is not given, ScenarioError if the scenario cannot be run, RunError if the run blows up or finds
    no equilibrium; after that, and after Ctrl-C, what was written stays readable under the partial name (`results.partial_path`).
    """
    check_target(target, force=force)
    with telling(packing_listener) as tell:
        start = build_scene(scenario, tell) if isinstance(scenario, ImpulseScenario) else build_assembly(scenario, tell)
    if isinstance(scenario, ImpulseScenario):
        assert isinstance(start, Scene)
        run_bodies(scenario, start, target, force, listener)
    elif isinstance(scenario, QuasiStaticScenario):
        assert isinstance(start, Assembly)
        run_increments(scenario, start, target, force, listener)
    else:
        assert isinstance(start, Assembly)
        run_frames(scenario, start, target, force, listener)
    return target


@contextmanager
def telling(packing_listener: Callable[[str], None] | None) -> Iterator[Callable[[str], None]]:
    """What a packing tells of itself: passed on, unless an interrupt has come."""
    with marked_interrupts() as check:

        def tell(words: str) -> None:
            check()
            if packing_listener:
                packing_listener(words)

        yield tell


def run_bodies(scenario: ImpulseScenario, scene: Scene, target: Path, force: bool, listener: Listener | None) -> None:
    """A run over time of rigid bodies in three dimensions: frames of the impulse engine."""
    from dem_cli.engines.impulse.engine import ImpulseEngine

    engine = ImpulseEngine(scenario, scene)
    container, tracks = scenario.container, scenario.output.tracks
    with marked_interrupts() as engine.check, ImpulseWriter(
        target, scenario_text=scenario.source, resolved_toml=scenario.resolved_toml(), scenario_hash=scenario.hash,
        seed=scenario.seed, title=scenario.title, scene=scene, gravity=engine.gravity,
        container={"width": container.width, "breadth": container.breadth, "height": container.height},
        tracks=np.array(tracks.grains) if tracks else None, force=force,
    ) as writer:  # fmt: skip
        row: dict[str, float] | None = None
        with warned(writer):
            for frame in engine.frames():
                if frame.step == 0 and frame.stage_start:
                    frame = replace(frame, warnings=(*scene.warnings, *frame.warnings))
                measured = bool(frame.due & {"series", "frames"})
                row = measure_bodies(frame, scene) if measured else row
                write_bodies(writer, scenario, frame, row)
                if listener:
                    listener(frame, row if measured else None)
                engine.check()
        writer.finish("all stages are done")


def run_frames(scenario: Scenario, assembly: Assembly, target: Path, force: bool, listener: Listener | None) -> None:
    """A run over time: frames of the explicit engine."""
    from dem_cli.engines.explicit.engine import ExplicitEngine

    engine = ExplicitEngine(scenario, assembly)
    container, output = scenario.container, scenario.output
    with marked_interrupts() as engine.check, begin(
        scenario, target, force, assembly.grains, assembly.walls, {"width": container.width, "height": container.height},
        tracks=np.array(output.tracks.grains) if output.tracks else None,
        surface_x=bin_centers(container.width, output.surface_bins), bonds=assembly.bonds,
    ) as writer:  # fmt: skip
        for number, stage in enumerate(scenario.stages, 1):
            if isinstance(stage, Shake) and stage.motion:
                writer.add_motion(number, stage.motion.acceleration, stage.motion.facts())
        row: dict[str, float] | None = None
        with warned(writer):
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
        writer.finish("all stages are done")


def run_increments(
    scenario: QuasiStaticScenario, assembly: Assembly, target: Path, force: bool, listener: Listener | None
) -> None:
    """A quasi-static test: increments of the granular element engine. The file begins with the first, as the boundary's grains are in it."""
    from dem_cli.engines.granular_element.engine import GranularElementEngine

    engine = GranularElementEngine(scenario, assembly)
    tracks = scenario.output.tracks
    with marked_interrupts() as engine.check:
        increments: Iterator[Increment] = engine.increments()
        first = next(increments)
        first = replace(first, warnings=(*assembly.warnings, *first.warnings))
        with begin(
            scenario, target, force, first.grains, first.walls, {"width": first.width, "height": first.height},
            tracks=np.array(tracks.grains) if tracks else None, boundary=first.boundary,
        ) as writer:  # fmt: skip
            with warned(writer):
                for increment in chain([first], increments):
                    measures = measure_increment(increment, scenario.depth, *scenario.stiffness)
                    write_increment(writer, scenario, increment, measures)
                    if listener:
                        listener(increment, measures.row)
                    engine.check()
            writer.finish("all stages are done")


def write_bodies(
    writer: ImpulseWriter, scenario: ImpulseScenario, frame: BodyFrame, row: Mapping[str, float] | None
) -> None:
    """Write what a frame of bodies is due for; `row` is the last row of the series."""
    stage = scenario.stages[frame.stage]
    if row and "series" in frame.due:
        writer.append_series(row)
    if frame.stage_start:
        writer.begin_stage(stage.name, stage.kind, frame.time, row)
    if "frames" in frame.due:
        writer.append_frame(frame)
    if "tracks" in frame.due:
        writer.append_tracks(frame.time, frame.bodies)
    for warning in frame.warnings:
        writer.warn(warning)
    if frame.stage_end and row:
        writer.end_stage(frame.time, frame.stop_reason, row)


def begin(
    scenario: DiscScenario, target: Path, force: bool, grains: Grains, walls: Walls, container: Mapping[str, float | None], *,
    tracks: Ints | None, surface_x: Any = None, bonds: Bonds | None = None, boundary: int = 0,
) -> ResultWriter:  # fmt: skip
    """A result file of the scenario, with nothing in it yet."""
    return ResultWriter(
        target, scenario_text=scenario.source, resolved_toml=scenario.resolved_toml(), scenario_hash=scenario.hash,
        seed=scenario.seed, engine=scenario.engine, title=scenario.title, grains=grains, walls=walls, depth=scenario.depth,
        container=container, tracks=tracks, surface_x=surface_x, bonds=bonds, boundary=boundary, force=force,
    )  # fmt: skip


@contextmanager
def warned(writer: RunFile) -> Iterator[None]:
    """What ends a run is told among its warnings too."""
    try:
        yield
    except RunError as error:
        writer.warn(str(error))
        raise


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


def write_increment(
    writer: ResultWriter, scenario: QuasiStaticScenario, increment: Increment, measures: IncrementMeasures
) -> None:
    """Write an increment: a row of the series always, frame and tracks where it is due for them."""
    stage, number = scenario.stages[increment.stage], increment.number
    writer.append_series(measures.row, slips=increment.slips)
    if increment.stage_start:
        writer.begin_stage(stage.name, stage.kind, number, measures.row)
    if "frames" in increment.due:
        writer.append_frame(increment, measures.coordination, measures.stress)
    if "tracks" in increment.due:
        writer.append_tracks(number, increment.grains)
    for warning in increment.warnings:
        writer.warn(warning)
    if increment.stage_end:
        writer.end_stage(number, increment.stop_reason, measures.row)
