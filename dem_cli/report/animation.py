"""Runs in motion: all frames of a run, or of a stage, as GIF or MP4, of grains in 2D and of bodies in 3D."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.body_quantities import BODY_QUANTITIES
from dem_cli.report.figures import Picture, check_file, check_request, look_of
from dem_cli.report.impulse_figures import check_bodies
from dem_cli.report.moments import frames_of_stage
from dem_cli.report.movies import RATE, Image, Reel, at_speed, every_frame, write
from dem_cli.report.scene3d import default_color, draw_scene, values_of, view_of
from dem_cli.results import BodyResults, Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("sample", "scene")  # of pictures that can move
DPI = {".gif": 80.0, ".mp4": 150.0}


def save_animation(
    results: Results, picture: Picture, path: Path, *, dpi: float | None = None, fps: float | None = None, speed: float | None = None
) -> Reel:  # fmt: skip
    """Write each frame with the same axes and colours; returns what the film shows. Call inside `look.style()`.

    fps: frames of the file a second, by default as long as each lasts, within limits. speed: simulated seconds a second; one of both.
    """
    check_request(picture)
    bodies = isinstance(results, BodyResults)
    what = check_bodies(results, picture) if isinstance(results, BodyResults) else picture.what
    if what not in KINDS:
        raise ScenarioError(f"{path}: only --what sample, or scene of bodies in 3D, can be an animation")
    if not bodies:
        check_file(results, picture)
    over_time = results.axis == "time"
    if speed is not None and not over_time:
        raise ScenarioError(f"{results.path}: a quasi-static test has no time; choose --fps, not --speed")
    frames = frames_of(results, picture.stage)
    ending = path.suffix.lower()
    places = results.frame_times[frames]
    reel = at_speed(frames, places, speed, RATE[ending]) if speed else every_frame(frames, places, over_time, fps)
    dots = dpi or DPI[ending]
    if isinstance(results, BodyResults):
        write(path, reel, _scenes(results, picture, frames, dots))
    else:
        from dem_cli.report.sample_film import SampleFilm

        write(path, reel, SampleFilm(results, frames, look_of(picture), dots).image)
    return reel


def frames_of(results: Results, stage: int | None) -> list[int]:
    """Numbers of the frames of a stage (from 1), or of the whole run. ScenarioError without any."""
    if stage and results.axis == "increment":
        return [int(k) for k in frames_of_stage(results, stage)]
    found = np.arange(results.n_frames) if not stage else np.flatnonzero(results.frame_stages == stage - 1)
    if len(found) == 0:
        raise ScenarioError(f"{results.path}: holds no frame to draw")
    return [int(k) for k in found]


def _scenes(results: BodyResults, picture: Picture, frames: list[int], dpi: float) -> Callable[[int], Image]:
    """Draws the scene of a frame."""
    color = picture.color or default_color(results)
    view = view_of(results, frames, picture.view)
    limits = picture.limits or _limits(results, frames, color)
    chains = bool(picture.chains)
    return lambda k: pixels(draw_scene(results, k, color=color, chains=chains, limits=limits, view=view), dpi)


def pixels(figure: Figure, dpi: float) -> Image:
    """The figure as an image."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure.set_dpi(dpi)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())[..., :3]


def _limits(results: BodyResults, frames: list[int], color: str) -> tuple[float, float] | None:
    """Colours from the least to the largest value of all frames; None where they only tell bodies apart."""
    quantity = BODY_QUANTITIES[color]
    if quantity.kind == "label":
        return None
    low, high = np.inf, -np.inf
    for k in frames:
        frame = results.frame(k)
        values, scale, _ = values_of(results, k, frame, quantity, None)
        known = scale * values[~frame.bodies.escaped & np.isfinite(values)]
        low, high = min(low, float(known.min(initial=np.inf))), max(high, float(known.max(initial=-np.inf)))
    if not high > low:
        return None
    return (0.0 if quantity.kind == "from-zero" else low), high
