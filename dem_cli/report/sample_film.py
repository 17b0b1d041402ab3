"""The sample in 2D, frame by frame, on one stage: axes, colour bar and titles are drawn once, grains and chains for each frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from dem_cli.report.look import footnote, heading
from dem_cli.report.moments import AnyFrame
from dem_cli.report.movies import Image
from dem_cli.report.sample import (
    Look,
    Sight,
    colors_of,
    first_frame_of_stage,
    paint,
    stage_set,
    text_of,
    values_of,
    view,
    widest_of,
)
from dem_cli.results import Results
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.artist import Artist

MOST_VALUES = 20_000  # of a frame, that scales are taken from


class SampleFilm:
    """All frames on the scales of `frames` together: the view holds every grain, colours and chains mean the same throughout."""

    def __init__(self, results: Results, frames: list[int], look: Look, dpi: float) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self._results, self._look = results, look
        self._begins: dict[int, AnyFrame] = {}
        self._sight = self._sight_of(frames)
        self.figure, self.ax = stage_set(self._sight, look)
        self.figure.set_dpi(dpi)
        self._canvas = canvas = cast(Any, FigureCanvasAgg(self.figure))
        # A frame on the stage makes room for titles and captions; then it is taken away again.
        last = results.frame(frames[-1])
        before = set(self.ax.get_children())
        caption = paint(self.ax, results, last, self._values(last), look, self._sight)
        heading(self.figure, results, text_of(results, frames[-1], last))
        if caption:
            footnote(self.figure, caption)
        canvas.draw()
        self.figure.set_layout_engine("none")
        self._remove(before)
        self._title = self.figure._suptitle  # type: ignore[attr-defined]
        self._lines = self._title.get_text().split("\n")[:-1]
        self._title.set_visible(False)
        canvas.draw()
        self._background = canvas.copy_from_bbox(self.figure.bbox)
        self._title.set_visible(True)

    def image(self, index: int) -> Image:
        """Frame `index` as pixels."""
        frame = self._results.frame(index)
        renderer = self._canvas.get_renderer()
        self._canvas.restore_region(self._background)
        before = set(self.ax.get_children())
        paint(self.ax, self._results, frame, self._values(frame), self._look, self._sight)
        for artist in sorted(self._new(before), key=lambda one: one.get_zorder()):
            artist.draw(renderer)
        self._remove(before)
        self._title.set_text("\n".join([*self._lines, text_of(self._results, index, frame)]))
        self._title.draw(renderer)
        return np.array(self._canvas.buffer_rgba())[..., :3]

    def _new(self, before: set[Artist]) -> list[Artist]:
        return [one for one in self.ax.get_children() if one not in before]

    def _remove(self, before: set[Artist]) -> None:
        for one in self._new(before):
            one.remove()

    def _values(self, frame: AnyFrame) -> Floats:
        """Of the grains that are shown."""
        quantity, stage = self._look.quantity, frame.stage
        if quantity.since and stage not in self._begins:
            self._begins[stage] = self._results.frame(first_frame_of_stage(self._results, stage))
        begin = self._begins[stage] if quantity.since else frame
        return values_of(self._results, frame, begin, quantity)[~frame.grains.escaped]

    def _sight_of(self, frames: list[int]) -> Sight:
        boxes, values, forces = [], [], []
        for k in frames:
            frame = self._results.frame(k)
            boxes.append(view(self._results, frame))
            found = self._values(frame)
            values.append(found[:: max(len(found) // MOST_VALUES, 1)])
            if frame.contacts is not None:
                pressing = frame.contacts.normal
                forces.append(pressing[:: max(len(pressing) // MOST_VALUES, 1)])
        left, right, bottom, top = zip(*boxes, strict=True)
        colors = colors_of(np.concatenate(values), self._look, bounded=bool(self._results.boundary))
        widest = widest_of(np.concatenate(forces)) if forces else 0.0
        return Sight((min(left), max(right), min(bottom), max(top)), colors, widest)
