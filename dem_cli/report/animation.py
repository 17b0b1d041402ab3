"""Bodies in 3D in motion: all frames of a run, or of a stage, as a GIF."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.report.body_quantities import BODY_QUANTITIES
from dem_cli.report.figures import Picture, check_request
from dem_cli.report.impulse_figures import check_bodies
from dem_cli.report.scene3d import default_color, draw_scene, values_of, view_of
from dem_cli.results import BodyResults

ENDING = ".gif"
SHORTEST, LONGEST = 40, 500  # ms that a frame is shown


def check_gif(path: Path, force: bool) -> None:
    """Raise ResultsError if `path` would be overwritten without `force`."""
    if path.exists() and not force:
        raise ResultsError(f"{path} exists; choose another name with -o or add --force")


def save_animation(results: BodyResults, picture: Picture, path: Path, dpi: float) -> int:
    """Write the scene of each frame, with the same view and colours; each is shown as long as it lasts, within limits. Returns their number."""
    from PIL import Image

    check_request(picture)
    if check_bodies(results, picture) != "scene":
        raise ScenarioError(f"{path}: only --what scene can be an animation")
    frames = frames_of(results, picture.stage)
    color = picture.color or default_color(results)
    view = view_of(results, frames, picture.view)
    limits = picture.limits or _limits(results, frames, color)
    images = []
    for k in frames:
        figure = draw_scene(results, k, color=color, chains=bool(picture.chains), limits=limits, view=view)
        with io.BytesIO() as stream:
            figure.savefig(stream, format="png", dpi=dpi)
            stream.seek(0)
            images.append(Image.open(stream).convert("RGB").quantize(128))
    spans = np.diff(results.frame_times[frames], append=np.nan)
    typical = float(np.nanmedian(spans)) if len(frames) > 1 else 0.1
    length = int(np.clip(round(1000.0 * typical, -1), SHORTEST, LONGEST))
    try:
        images[0].save(path, save_all=True, append_images=images[1:], duration=length, loop=0)
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None
    return len(images)


def frames_of(results: BodyResults, stage: int | None) -> list[int]:
    """Numbers of the frames of a stage (from 1), or of the whole run. ScenarioError without any."""
    found = np.arange(results.n_frames) if not stage else np.flatnonzero(results.frame_stages == stage - 1)
    if len(found) == 0:
        raise ScenarioError(f"{results.path}: holds no frame to draw")
    return [int(k) for k in found]


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
