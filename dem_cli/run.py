"""The whole program in one function: the only place where scenario, assembly, engine, measures and results meet."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli.analysis.bodies3d import measure_bodies
from dem_cli.analysis.measures import Measures, measure_frame, series_row
from dem_cli.analysis.quasi_static import IncrementMeasures, measure_increment
from dem_cli.analysis.surface import bin_centers
from dem_cli.analysis.void_ratio import WindowMargins
from dem_cli.assembly import build_assembly
from dem_cli.assembly.scene import build_scene
from dem_cli.engines.pausing import thaw
from dem_cli.errors import RunError
from dem_cli.interrupts import marked_interrupts
from dem_cli.results import ImpulseWriter, ResultWriter
from dem_cli.results.files import check_target
from dem_cli.results.run_file import RunFile
from dem_cli.rigid import BodyFrame
from dem_cli.scenario import ImpulseScenario, QuasiStaticScenario, Scenario, Shake
from dem_cli.scenario.engines import EngineScenario
from dem_cli.state import Frame, Increment

if TYPE_CHECKING:  # engines are imported when they are needed: each brings its kernels along
    from dem_cli.engines.explicit.engine import ExplicitEngine
    from dem_cli.engines.granular_element.engine import GranularElementEngine
    from dem_cli.engines.impulse.engine import ImpulseEngine

    Engine = ExplicitEngine | GranularElementEngine | ImpulseEngine

# Told of every frame, with its row of the series where it has one, and of every increment, with its row.
Listener = Callable[[Frame | Increment | BodyFrame, Mapping[str, float] | None], None]


@dataclass(frozen=True)
class Preparation:
    """The first stages of a run, over: their result file, which is not changed, and the engine's state after them."""

    file: Path
    state: bytes


@dataclass(frozen=True)
class Job:
    """What to make of an engine: the result file, and the stage (from 0) before which to stop."""

    target: Path
    force: bool
    listener: Listener | None
    prepared: Preparation | None = None
    until: int | None = None

    @property
    def over(self) -> str:
        """Why the run ends."""
        return (
            "all stages are done"
            if self.until is None
            else f"{self.until} stages are done, for other runs to go on from"
        )


def run_scenario(
    scenario: EngineScenario,
    target: Path,
    *,
    force: bool = False,
    listener: Listener | None = None,
    packing_listener: Callable[[str], None] | None = None,
    prepared: Preparation | None = None,
) -> Path:
    """Run a scenario and write its result file `target`; returns the file's path. packing_listener: told what the packing is at.

    prepared: the first stages, which are gone on from as if they had been run here, to the last bit.
    ResultsError if the file exists and `force` is not given, ScenarioError if the scenario cannot be run, RunError if the run blows up or finds
    no equilibrium; after that, and after Ctrl-C, what was written stays readable under the partial name (`results.partial_path`).
    """
    check_target(target, force=force)
    engine = thaw(prepared.state, scenario) if prepared else build_engine(scenario, packing_listener)
    perform(engine, Job(target, force, listener, prepared))
    return target


def prepare_scenario(
    scenario: EngineScenario,
    stages: int,
    target: Path,
    *,
    listener: Listener | None = None,
    packing_listener: Callable[[str], None] | None = None,
    prepared: Preparation | None = None,
) -> Preparation:
    """Run the first `stages` of a scenario alone, for runs that go on from there.

    target: their result file, replaced if it is there. Errors as of `run_scenario`.
    """
    engine = thaw(prepared.state, scenario) if prepared else build_engine(scenario, packing_listener)
    perform(engine, Job(target, True, listener, prepared, stages))
    return Preparation(target, engine.freeze())


def build_engine(scenario: EngineScenario, packing_listener: Callable[[str], None] | None) -> Engine:
    """The engine before the first stage, with grains and walls as they are then."""
    with telling(packing_listener) as tell:
        if isinstance(scenario, ImpulseScenario):
            from dem_cli.engines.impulse.engine import ImpulseEngine

            return ImpulseEngine(scenario, build_scene(scenario, tell))
        if isinstance(scenario, QuasiStaticScenario):
            from dem_cli.engines.granular_element.engine import GranularElementEngine

            return GranularElementEngine(scenario, build_assembly(scenario, tell))
        from dem_cli.engines.explicit.engine import ExplicitEngine

        return ExplicitEngine(scenario, build_assembly(scenario, tell))


def perform(engine: Engine, job: Job) -> None:
    """Let the engine do the job, each kind in its own way."""
    ways: dict[str, Callable[[Any, Job], None]] = {
        "explicit": run_frames,
        "granular-element": run_increments,
        "impulse": run_bodies,
    }
    ways[engine.scenario.engine](engine, job)


@contextmanager
def telling(packing_listener: Callable[[str], None] | None) -> Iterator[Callable[[str], None]]:
    """What a packing tells of itself: passed on, unless an interrupt has come."""
    with marked_interrupts() as check:

        def tell(words: str) -> None:
            check()
            if packing_listener:
                packing_listener(words)

        yield tell


def run_bodies(engine: ImpulseEngine, job: Job) -> None:
    """A run over time of rigid bodies in three dimensions: frames of the impulse engine."""
    scenario, scene = engine.scenario, engine.scene
    container = scenario.container
    with marked_interrupts() as engine.check, ImpulseWriter(
        job.target, **_about(scenario, job), scene=scene, gravity=engine.gravity,
        container={"width": container.width, "breadth": container.breadth, "height": container.height},
    ) as writer:  # fmt: skip
        row: dict[str, float] | None = None
        with warned(writer):
            for frame in engine.frames(job.until):
                if frame.step == 0 and frame.stage_start:
                    frame = replace(frame, warnings=(*scene.warnings, *frame.warnings))
                measured = bool(frame.due & {"series", "frames"})
                row = measure_bodies(frame, scene) if measured else row
                write_bodies(writer, scenario, frame, row)
                if job.listener:
                    job.listener(frame, row if measured else None)
                engine.check()
        writer.finish(job.over)


def run_frames(engine: ExplicitEngine, job: Job) -> None:
    """A run over time: frames of the explicit engine."""
    scenario, assembly = engine.scenario, engine.assembly
    container, output = scenario.container, scenario.output
    with marked_interrupts() as engine.check, ResultWriter(
        job.target, **_about(scenario, job), grains=assembly.grains, walls=assembly.walls, depth=scenario.depth,
        container={"width": container.width, "height": container.height},
        surface_x=bin_centers(container.width, output.surface_bins), bonds=assembly.bonds,
    ) as writer:  # fmt: skip
        for number, stage in enumerate(scenario.stages[engine.done : job.until], engine.done + 1):
            if isinstance(stage, Shake) and stage.motion:
                writer.add_motion(number, stage.motion.acceleration, stage.motion.facts())
        row: dict[str, float] | None = None
        with warned(writer):
            for frame in engine.frames(job.until):
                if frame.step == 0 and frame.stage_start:
                    frame = replace(frame, warnings=(*assembly.warnings, *frame.warnings))
                measures = measure(scenario, frame) if frame.due & {"series", "frames"} else None
                row = series_row(frame, measures) if measures else row
                write(writer, scenario, frame, measures, row)
                if job.listener:
                    job.listener(frame, row if measures else None)
                engine.check()
                del frame, measures  # large; the next ones are made before these names are bound again
        writer.finish(job.over)


def run_increments(engine: GranularElementEngine, job: Job) -> None:
    """A quasi-static test: increments of the granular element engine. The file begins with the first, as the boundary's grains are in it."""
    scenario = engine.scenario
    with marked_interrupts() as engine.check:
        started = not engine.done
        increments: Iterator[Increment] = engine.increments(job.until)
        first = next(increments)
        if started:
            first = replace(first, warnings=(*engine.assembly.warnings, *first.warnings))
        with ResultWriter(
            job.target, **_about(scenario, job), grains=first.grains, walls=first.walls, depth=scenario.depth,
            container={"width": first.width, "height": first.height}, boundary=first.boundary,
        ) as writer:  # fmt: skip
            with warned(writer):
                for increment in chain([first], increments):
                    measures = measure_increment(increment, scenario.depth, *scenario.stiffness)
                    write_increment(writer, scenario, increment, measures)
                    if job.listener:
                        job.listener(increment, measures.row)
                    engine.check()
            writer.finish(job.over)


def _about(scenario: EngineScenario, job: Job) -> dict[str, Any]:
    """What every writer is told of a run."""
    tracks = scenario.output.tracks
    return {
        "scenario_text": scenario.source,
        "resolved_toml": scenario.resolved_toml(),
        "scenario_hash": scenario.hash,
        "seed": scenario.seed,
        "engine": scenario.engine,
        "title": scenario.title,
        "tracks": np.array(tracks.grains) if tracks else None,
        "force": job.force,
        "base": job.prepared.file if job.prepared else None,
        "preparation": job.prepared.file.stem if job.prepared else "",
    }


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


@contextmanager
def warned(writer: RunFile) -> Iterator[None]:
    """What ends a run is told among its warnings too, if it is not the file itself."""
    try:
        yield
    except RunError as error:
        with suppress(RunError):
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
