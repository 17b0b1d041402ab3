"""One entry for all pictures: what is asked for is checked against the file and drawn."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.look import place_text, stage_label
from dem_cli.results import BodyResults, Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dem_cli.report.sample import Look

# Of runs over time.
KINDS = (
    "sample",
    "rose",
    "force-distribution",
    "histories",
    "trajectories",
    "surface",
    "spectrum",
    "energy",
    "motion",
    "series",
)
# Of quasi-static shear tests, beside the six that need no time.
SHEAR_KINDS = (
    "stress-strain", "dilatancy", "forces", "normals", "energy-normals", "coordination", "energy-tensor", "dissipation", "largest-share",
    "ranked", "paper",
)  # fmt: skip
# Of bodies in 3D, beside energy and series.
BODY_KINDS = ("scene", "check", "runout", "trajectories", "histories")
OVER_TIME = ("surface", "spectrum", "energy", "motion")  # kinds that a quasi-static test has not
DEFAULT_SERIES = ("void_ratio", "depth", "coordination", "kinetic")
INCREMENT_SERIES = ("stress_ratio", "volumetric_strain", "void_ratio", "coordination")


@dataclass(frozen=True)
class Picture:
    """What to draw. All quantities SI; None picks the default described in `dem render --help`.

    time [s], frame (0-based, negative from the end), increment (of the run, or of the stage that is asked for), stage (1-based, 0 is
    the whole run), color: a quantity of a grain, chains, bonds, marks: what is drawn over the grains, limits of the colours, series:
    names, grains: numbers of tracked grains. view: azimuth and elevation [deg] of the camera on bodies in 3D, of which "sample" is the scene.
    """

    what: str = "sample"
    time: float | None = None
    frame: int | None = None
    increment: int | None = None
    stage: int | None = None
    color: str | None = None
    chains: bool | None = None
    bonds: bool | None = None
    marks: bool = False
    limits: tuple[float, float] | None = None
    series: Sequence[str] | None = None
    grains: Sequence[int] | None = None
    view: tuple[float, float] | None = None


def draw(results: Results, picture: Picture) -> Figure:
    """Figure of `picture`. Raises ScenarioError if the file does not hold what it needs. Call inside
    `look.style()`.
    """
    # Imported here so that one kind of picture does not load what only another needs.
    from dem_cli.report import curves, motions, rose, sample, spectrum, tracked

    check_request(picture)
    if isinstance(results, BodyResults):
        from dem_cli.report import impulse_figures

        _check_stage(results, picture)
        return impulse_figures.draw_bodies(results, picture)
    check_file(results, picture)
    if picture.what in SHEAR_KINDS:
        return _draw_shear(results, picture)
    if picture.what == "sample":
        return sample.draw_sample(results, choose_frame(results, picture), look_of(picture))
    if picture.what == "rose":
        return rose.draw_rose(results, choose_frame(results, picture))
    if picture.what == "force-distribution":
        return _draw_distribution(results, picture)
    window, text = choose_window(results, picture)
    if picture.what == "spectrum":
        return spectrum.draw_spectrum(results, chosen_stage(results, picture), text)
    if picture.what == "histories":
        return tracked.draw_histories(results, tracked.paths(results, window, picture.grains), text)
    if picture.what == "trajectories":
        return tracked.draw_trajectories(results, tracked.paths(results, window, picture.grains), text)
    time = results.series[results.axis]
    if np.count_nonzero((time >= window[0] - 1e-9) & (time <= window[1] + 1e-9)) < 2:
        first, last = (f"t = {end:g} s" if results.axis == "time" else f"increment {end:g}" for end in window)
        raise ScenarioError(f"{results.path}: holds fewer than two rows of series between {first} and {last}")
    if picture.what == "surface":
        return curves.draw_surface(results, window, text, picture.limits)
    if picture.what == "motion":
        return motions.draw_motion(results, window, text)
    if picture.what == "energy":
        return curves.draw_energy(results, window, text)
    return curves.draw_series(results, series_of(results, picture), window, text)


def look_of(picture: Picture) -> Look:
    """How a sample is drawn."""
    from dem_cli.report.sample import Look

    return Look(picture.color or "displacement", picture.chains, picture.bonds, picture.marks, picture.limits)


def _draw_distribution(results: Results, picture: Picture) -> Figure:
    """Of the frame that is asked for, or the last; of a test that shears its sample the start and the peak."""
    from dem_cli.report.force_distribution import draw_forces_spread
    from dem_cli.report.shear_rows import shear_stages

    asked = picture.frame is not None or picture.increment is not None
    if results.axis == "increment" and shear_stages(results) and not asked:
        from dem_cli.report import shear_forces

        stage = picture.stage or None
        moments = shear_forces.start_and_peak(results, stage)
        frames = [(one.frame.contacts, one.text) for one in moments]
        return draw_forces_spread(results, frames, shear_forces.stage_text(results, stage))
    index = choose_frame(results, picture)
    frame, text = results.frame(index), place_text(results, index)
    if 0 <= frame.stage < len(results.stages):
        text += f", {stage_label(frame.stage + 1, results.stages[frame.stage])}"
    return draw_forces_spread(results, [(frame.contacts, place_text(results, index))], text)


def _draw_shear(results: Results, picture: Picture) -> Figure:
    """A picture of SHEAR_KINDS: of the frame that is asked for, else of the start and the peak of a stage."""
    from dem_cli.report import shear_curves, shear_forces, shear_page
    from dem_cli.report.shear_rows import shear_stages

    what, stage = picture.what, picture.stage or None
    if what == "stress-strain":
        return shear_curves.draw_stress_strain(results, stage)
    if what == "ranked":
        return shear_page.draw_ranked(results, stage)
    if what == "paper":
        return shear_page.draw_page(results, stage)
    if what not in ("forces", "normals", "energy-normals"):
        return shear_curves.draw_one(results, what, stage)
    compressed_only = not shear_stages(results)
    if compressed_only or picture.frame is not None or picture.increment is not None:
        index = choose_frame(results, picture)
        moments = [shear_forces.moment(results, index)]
        number = moments[0].frame.stage + 1
        text = stage_label(number, results.stages[number - 1]) if number <= len(results.stages) else "whole run"
    else:
        moments, text = shear_forces.start_and_peak(results, stage), shear_forces.stage_text(results, stage)
    if what == "forces":
        return shear_forces.draw_forces(results, moments, text)
    return shear_forces.draw_roses(
        results, moments, text, energy=what == "energy-normals", axial=moments[-1].frame.axial
    )


def choose_frame(results: Results, picture: Picture) -> int:
    """Index of the stored frame that is asked for: by index, nearest to a time or an increment, last of a stage, or last of
    all.
    """
    from dem_cli.report.moments import frame_at, frames_of_stage

    count = results.n_frames
    if count == 0:
        raise ScenarioError(f"{results.path}: holds no frames; choose a shorter [output] frames and run again")
    times = results.frame_times
    if picture.frame is not None:
        if not -count <= picture.frame < count:
            raise ScenarioError(f"{results.path}: frame {picture.frame} is none of its {count} (0 to {count - 1})")
        return picture.frame % count
    if picture.increment is not None:
        return frame_at(results, picture.increment, picture.stage)
    if picture.time is not None:
        first, last = float(times[0]), float(times[-1])
        if not first - 1e-9 <= picture.time <= last + 1e-9:
            raise ScenarioError(
                f"{results.path}: time {picture.time:g} s lies outside its frames ({first:g} s to {last:g} s)"
            )
        return int(np.argmin(np.abs(times - picture.time)))
    if picture.stage and results.axis == "increment":
        return int(frames_of_stage(results, picture.stage)[-1])
    if picture.stage:
        stage = results.stages[picture.stage - 1]
        until = stage.end if np.isfinite(stage.end) else np.inf
        within = np.flatnonzero((times >= stage.start - 1e-9) & (times <= until + 1e-9))
        if len(within) == 0:
            raise ScenarioError(f"{results.path}: holds no frame of stage {picture.stage}")
        return int(within[-1])
    return count - 1


def series_of(results: Results, picture: Picture) -> Sequence[str]:
    """The series that are asked for, or those that most want to see."""
    return picture.series or (DEFAULT_SERIES if results.axis == "time" else INCREMENT_SERIES)


def choose_window(results: Results, picture: Picture) -> tuple[tuple[float, float], str]:
    """Window of time [s], or of increments, for a picture over them, and its description.

    Without a stage: the whole run for series and energy, else the last stage (of shaking, if there is one).
    """
    stages = results.stages
    time = results.series[results.axis]
    end = float(time[-1]) if len(time) else 0.0
    number = chosen_stage(results, picture)
    if number == 0:
        return (float(time[0]) if len(time) else 0.0, end), "whole run"
    stage = stages[number - 1]
    stop = stage.end if np.isfinite(stage.end) else end
    return (stage.start, stop), stage_label(number, stage)


def chosen_stage(results: Results, picture: Picture) -> int:
    """Number of the stage (from 1) that a picture over time is about, 0 for the whole run. ScenarioError if a spectrum is to be of that."""
    stages, number = results.stages, picture.stage
    if number is None:
        number = 0
        if picture.what == "spectrum" or (picture.what not in ("series", "energy") and len(stages) > 1):
            shaken = [k for k, stage in enumerate(stages, start=1) if stage.kind == "shake"]
            number = shaken[-1] if shaken else len(stages)
    if number == 0 and picture.what == "spectrum":
        raise ScenarioError(f"{results.path}: a spectrum is that of one stage; choose --stage 1 to {len(stages)}")
    return number


def check_request(picture: Picture) -> None:
    """Raise ScenarioError for what no file could give: an unknown kind of picture or quantity, colour limits
    upside down.
    """
    from dem_cli.report.body_quantities import BODY_QUANTITIES
    from dem_cli.report.quantities import QUANTITIES

    known = tuple(dict.fromkeys((*KINDS, *SHEAR_KINDS, *BODY_KINDS)))
    if picture.what not in known:
        raise ScenarioError(unknown("kind of picture", picture.what, known))
    if picture.color is not None and picture.color not in {**QUANTITIES, **BODY_QUANTITIES}:
        name = "quantity of a body" if picture.what == "scene" else "quantity of a grain"
        raise ScenarioError(unknown(name, picture.color, BODY_QUANTITIES if picture.what == "scene" else QUANTITIES))
    if picture.limits is not None and not picture.limits[1] > picture.limits[0]:
        low, high = picture.limits
        raise ScenarioError(f"--range {low:g},{high:g}: the second number must be the larger")


def check_file(results: Results, picture: Picture) -> None:
    from dem_cli.report.quantities import QUANTITIES

    if picture.what in BODY_KINDS and picture.what not in KINDS:
        raise ScenarioError(
            f"{results.path}: --what {picture.what} shows bodies in 3D, these are grains in 2D; choose from {', '.join(KINDS)}"
        )
    if picture.what == "sample" and picture.color is not None and picture.color not in QUANTITIES:
        raise ScenarioError(f"{results.path}: " + unknown("quantity of a grain", picture.color, QUANTITIES))
    if results.axis == "increment":
        _check_increments(results, picture)
    elif picture.what in SHEAR_KINDS:
        raise ScenarioError(
            f"{results.path}: --what {picture.what} shows a quasi-static shear test, this is a run over time; choose from {', '.join(KINDS)}"
        )
    elif picture.increment is not None:
        raise ScenarioError(f"{results.path}: is a run over time; choose a frame with --time, not --increment")
    if picture.what == "series":
        for name in series_of(results, picture):
            if name not in results.series:
                raise ScenarioError(f"{results.path}: " + unknown("series", name, results.series))
    _check_stage(results, picture)


def _check_stage(results: Results, picture: Picture) -> None:
    """Raise ScenarioError for a stage that the run has not."""
    if picture.stage is not None and not 0 <= picture.stage <= len(results.stages):
        count = len(results.stages)
        raise ScenarioError(
            f"{results.path}: stage {picture.stage} is none of its {count} (1 to {count}; 0: whole run)"
        )


def _check_increments(results: Results, picture: Picture) -> None:
    """Raise ScenarioError for what a quasi-static test has not."""
    from dem_cli.report.quantities import NOT_QUASI_STATIC

    known = (*[kind for kind in KINDS if kind not in OVER_TIME], *SHEAR_KINDS)
    if picture.what in OVER_TIME:
        instead = "dissipation" if picture.what == "energy" else ", ".join(known)
        raise ScenarioError(
            f"{results.path}: a quasi-static test has no picture {picture.what}; choose --what {instead}"
        )
    if picture.time is not None:
        raise ScenarioError(f"{results.path}: a quasi-static test has no time; choose a frame with --increment")
    if picture.what == "sample" and picture.color in NOT_QUASI_STATIC:
        raise ScenarioError(
            f"{results.path}: a quasi-static test has no {picture.color}; choose --color displacement or rotation"
        )


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """One line: what is unknown, the nearest name, and all names."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f' Did you mean "{near[0]}"?' if near else ""
    return f'unknown {kind} "{name}".{hint} Known: {", ".join(names)}'
