"""How normal forces are spread: the density of the force over its mean, and the exponential tail above the mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.look import COLORS, display_unit, footnote, heading, new_figure, small
from dem_cli.results import Results
from dem_cli.state import Contacts, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BIN = 0.25  # width of a bin, in means
LEAST = 10  # forces above the mean that a tail is fitted to
LOOKS = ((COLORS[0], "o", "-"), (COLORS[1], "s", (0, (4, 2))))


@dataclass(frozen=True)
class Distribution:
    """Normal forces over their mean [N]. edges (b + 1,); density (b,), whose integral is 1; sliding (b,): the part of it that contacts at
    the friction limit make. decay, share: the tail is share x decay x exp(-decay (f - 1)) above 1, share of the forces lie there;
    decay NaN where fewer than LEAST do.
    """

    mean: float
    count: int
    edges: Floats
    density: Floats
    sliding: Floats
    decay: float
    share: float

    @property
    def middle(self) -> Floats:
        return np.asarray(0.5 * (self.edges[1:] + self.edges[:-1]))

    def tail(self, f: Floats) -> Floats:
        """Density of the fitted tail at f >= 1."""
        return np.asarray(self.share * self.decay * np.exp(-self.decay * (f - 1.0)))


def distribution(contacts: Contacts) -> Distribution | None:
    """Of contacts between grains that press on each other; None without any.

    The decay is that of greatest likelihood: 1 over the mean of f - 1 of the forces above the mean.
    """
    pressing = (contacts.j >= 0) & (contacts.normal > 0.0)
    force = contacts.normal[pressing]
    if len(force) == 0:
        return None
    mean = float(force.mean())
    f = force / mean
    edges = np.asarray(BIN * np.arange(int(np.floor(f.max() / BIN)) + 2), dtype=np.float64)
    weight = np.full(len(f), 1.0 / (len(f) * BIN))
    above = f[f > 1.0]
    return Distribution(
        mean=mean,
        count=len(f),
        edges=edges,
        density=np.histogram(f, edges, weights=weight)[0],
        sliding=np.histogram(f, edges, weights=weight * contacts.sliding[pressing])[0],
        decay=float(1.0 / (above - 1.0).mean()) if len(above) >= LEAST else float("nan"),
        share=len(above) / len(f),
    )


def draw_forces_spread(results: Results, frames: Sequence[tuple[Contacts | None, str]], text: str) -> Figure:
    """Densities of one frame, or of two on each other, on a logarithmic axis. frames: contacts and what the frame is called.

    Of one frame also the part that contacts at the friction limit make. ScenarioError where grains touch in none.
    """
    found = [(None if contacts is None else distribution(contacts), name) for contacts, name in frames]
    shown = [(one, name) for one, name in found if one is not None]
    if not shown:
        where = " and ".join(name for _, name in found)
        raise ScenarioError(f"{results.path}: grains do not press on each other at {where}; choose another frame")
    figure = new_figure(5.6, 4.4)
    ax = figure.add_subplot()
    for k, (one, name) in enumerate(shown):
        _panel(ax, one, name if len(shown) > 1 else "all contacts", *LOOKS[k % len(LOOKS)])
    if len(shown) == 1:
        _sliding(ax, shown[0][0])
    least = min(float(one.density[one.density > 0.0].min()) for one, _ in shown)
    ax.set_yscale("log")
    ax.set_ylim(0.5 * least, 2.5 * max(float(one.density.max()) for one, _ in shown))
    ax.set_xlim(0.0, max(float(one.edges[-1]) for one, _ in shown))
    ax.set_xlabel("normal force over its mean, f = N/⟨N⟩")
    ax.set_ylabel("probability density P(f)")
    ax.legend(fontsize=small())
    heading(figure, results, f"Normal forces between grains, {text}")
    footnote(figure, "; ".join(_words(one, name if len(shown) > 1 else "") for one, name in shown))
    return figure


def _words(one: Distribution, name: str) -> str:
    scale, unit = display_unit("N", one.mean)
    return f"{name + ': ' if name else ''}{one.count} contacts, mean {one.mean / scale:.3g} {unit}"


def _panel(ax: Axes, one: Distribution, name: str, color: str, mark: str, dash: Any) -> None:
    kept = one.density > 0.0
    ax.plot(one.middle[kept], one.density[kept], mark, color=color, ms=4.0, mec="white", mew=0.3, label=name, zorder=3)
    if np.isfinite(one.decay):
        f = np.array([1.0, one.edges[-1]])
        ax.plot(f, one.tail(f), color=color, ls=dash, label=f"tail, exp(-{one.decay:.3g} f)", zorder=2)


def _sliding(ax: Axes, one: Distribution) -> None:
    kept = one.sliding > 0.0
    if kept.any():
        ax.plot(
            one.middle[kept], one.sliding[kept], "^", mfc="white", mec=COLORS[1], ms=4.5, label="of these sliding", zorder=3
        )  # fmt: skip
