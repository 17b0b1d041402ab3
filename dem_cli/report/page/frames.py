"""Frames as the page's player wants them: what all kinds of runs share. Which frames, what is told of each, and colours."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from dem_cli.report.look import CYCLIC, DIVERGING, SEQUENTIAL, UNITS, stage_label
from dem_cli.report.moments import BOUNDARY
from dem_cli.report.page.codes import Packer, root
from dem_cli.report.page.model import Player
from dem_cli.report.sample import PALETTE
from dem_cli.results import Results
from dem_cli.state import Floats, Ints

Pack = Callable[[list[int]], tuple[Packer, dict[str, Any]]]  # places within what was read -> sections and facts of them
AHEAD = 2.5  # frames that are read and tried, over those that would fit if nothing could be compressed; more would only take time


def spread(count: int, most: int) -> list[int]:
    """At most `most` of 0 to count - 1, evenly spread, the first and the last among them (the last, if it is one)."""
    if most >= count:
        return list(range(count))
    if most <= 1:
        return [count - 1]
    return [int(k) for k in np.unique(np.rint(np.linspace(0, count - 1, most)))]


def most_frames(raw: float, budget: int) -> int:
    """How many frames of `raw` bytes are worth trying for a text of `budget` characters."""
    return max(1, int(AHEAD * budget / max(raw, 1.0)))


def player(results: Results, indices: Sequence[int], pack: Pack, budget: int, title: str) -> Player:
    """Those of the frames `indices` that fit into `budget` characters, thinned evenly where they do not all."""
    keep = list(range(len(indices)))
    while True:
        packer, facts = pack(keep)
        data = packer.text()
        if len(data) <= budget or len(keep) <= 1:
            break
        keep = spread(len(indices), max(1, min(len(keep) - 1, int(0.97 * len(keep) * budget / len(data)))))
    shown = [indices[k] for k in keep]
    total = results.n_frames
    counts = f"All {total} frames of the file are here." if len(shown) == total else _thinned(len(shown), total)
    return Player(title, {**common(results, shown), **facts, "sections": packer.sections}, data, counts)


def _thinned(shown: int, total: int) -> str:
    return f"{shown} of the file's {total} frames are here, evenly chosen to keep the page small."


def common(results: Results, shown: Sequence[int]) -> dict[str, Any]:
    """What any player has to know: when its frames are, their stages, units and colour maps."""
    stages = results.frame_stages[list(shown)]
    return {
        "axis": results.axis,
        "places": _plain(results.frame_times[list(shown)]),
        "numbers": list(shown),
        "total": results.n_frames,
        "stage": stages.tolist(),
        "stages": [stage_label(number, stage) for number, stage in enumerate(results.stages, start=1)],
        "complete": results.complete,
        "units": {unit: [list(row) for row in rows] for unit, rows in UNITS.items()},
        "maps": {name: _colors(cmap) for name, cmap in _MAPS.items()},
        "palette": list(PALETTE),
        "boundaryColor": BOUNDARY,
    }


_MAPS = {"range": SEQUENTIAL, "signed": DIVERGING, "cyclic": CYCLIC}


def _colors(name: str) -> str:
    """256 colours of a map, six hex digits each."""
    from matplotlib import colormaps

    table = np.rint(255.0 * colormaps[name](np.linspace(0.0, 1.0, 256))[:, :3]).astype(np.uint8)
    return table.tobytes().hex()


def readouts(results: Results, shown: Sequence[int], columns: Mapping[str, str]) -> list[dict[str, Any]]:
    """Series that are told beside the frames: name -> label; one that is never defined or always 0 is left out."""
    found = []
    rows = [row_of(results, k) for k in shown]
    for name, label in columns.items():
        if name not in results.series or not len(results.series[name]):
            continue
        column = results.series[name]
        values = column[rows]
        if name.startswith("ground"):  # rounding is no motion
            values = np.where(np.abs(values) < 1e-9 * np.nanmax(np.abs(column), initial=0.0), 0.0, values)
        if np.any(np.nan_to_num(values) != 0.0):
            found.append({"label": label, "unit": results.series.unit(name), "values": _plain(values)})
    return found


def row_of(results: Results, k: int) -> int:
    """Row of the series at frame k; where stages meet, that of the frame's own stage."""
    places, stages = results.series[results.axis], results.series["stage"]
    distance = np.abs(places - results.frame_times[k])
    near = np.flatnonzero(distance <= distance.min() + 1e-12)
    own = near[stages[near] == results.frame_stages[k]]
    return int(own[0] if len(own) else near[0])


def _plain(values: Floats) -> list[float | None]:
    return [float(f"{value:.9g}") if math.isfinite(value) else None for value in values]


def add_contacts(
    packer: Packer, frames: Sequence[tuple[Ints, Ints, Floats, Floats]], elements: int, walls: int
) -> None:
    """Contacts of all frames, one frame after the other. frames: i, j (-1 - w for wall w), normal force [N], point (c, 2 or 3) [m] of each.

    Sections: `contacts` of each frame, `first` bodies as steps from the contact before (from 0 in each frame), `second` ones as steps from the
    first (wall w counts as body `elements` + w), `force` over the frame's `largest`, and the `feet` of contacts with walls.
    """
    wide: Any = np.uint16 if elements + walls < 65536 else np.uint32
    packer.add("contacts", np.array([len(i) for i, *_ in frames], dtype=np.uint32))
    packer.add("first", np.concatenate([np.diff(i, prepend=0) for i, *_ in frames]).astype(wide))
    second = [np.where(j < 0, elements - 1 - j, j) - i for i, j, *_ in frames]
    packer.add("second", np.concatenate(second).astype(wide))
    largest = [float(force.max(initial=0.0)) for _, _, force, _ in frames]
    packer.add("force", np.concatenate([root(f, most) for (_, _, f, _), most in zip(frames, largest, strict=True)]))
    packer.add("largest", np.array(largest, dtype=np.float32))
    packer.add("feet", np.concatenate([point[j < 0] for _, j, _, point in frames]).astype(np.float32))
