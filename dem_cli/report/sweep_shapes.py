"""Shapes, or whole scenarios, of a sweep side by side: what each is before and after shaking, at the same points of the other axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dem_cli.errors import ScenarioError
from dem_cli.report import look
from dem_cli.report.look import COLORS, new_figure
from dem_cli.report.sweep import Sweep, SweepCase
from dem_cli.report.sweep_axes import SCENARIO, Axis
from dem_cli.report.sweep_curves import BARS, MARKERS, bars, by_words, varying
from dem_cli.report.sweep_measures import MEASURES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE = 0.17  # height of a line of the legend [inch]
FILLED = 0.8  # share of a figure's width that its panels take
APART = 0.5  # from one group to the next, in places of a shape
SHAPES = ("grains.shape", "grains.aspect_ratio", "grains.template", "grains.bond")


def draw_shapes(found: Sweep) -> tuple[str, str, Figure]:
    """Title, caption and picture. ScenarioError if no member is done, or neither shapes nor scenarios nor any other kinds vary."""
    if not found.main:
        raise ScenarioError("--what shapes: no member of the sweep is done yet")
    axis = _axis(found)
    if axis is None:
        names = ", ".join(axis.name for axis in varying(found)) or "nothing but seeds"
        raise ScenarioError(f"--what shapes: neither shapes nor scenarios vary in this sweep, but {names}")
    at = found.axes.index(axis)
    groups = by_words(found, [axis])
    shaken = found.has("void_ratio_change")
    count = len(axis.points)
    places = len(groups) * (count + APART)
    figure = new_figure(min(max(1.8 + 0.34 * places, 5.2), 15.0), 5.6 if shaken else 3.6)
    panels: list[Axes] = list(figure.subplots(2 if shaken else 1, 1, sharex=True, squeeze=False).flat)
    for g, cases in enumerate(groups.values()):
        for case in cases:
            x = g * (count + APART) + case.places[at]
            color, marker = COLORS[case.places[at] % len(COLORS)], MARKERS[case.places[at] % len(MARKERS)]
            if shaken:
                _before_after(panels[0], x, case, color, marker)
                _mark(panels[1], x, case, "void_ratio_change", color, marker)
            else:
                _mark(panels[0], x, case, found.main, color, marker)
    labels = ["void ratio", "change"] if shaken else [MEASURES[found.main].label]
    for ax, label in zip(panels, labels, strict=True):
        ax.set_ylabel(label, parse_math=False)
        ax.grid(axis="y", color="0.9", lw=0.6)
        ax.set_axisbelow(True)
    if shaken:
        panels[1].axhline(0.0, color="0.6", lw=0.8, zorder=1)
    bottom = panels[-1]
    middles = [g * (count + APART) + 0.5 * (count - 1) for g in range(len(groups))]
    upright = _name_groups(bottom, middles, list(groups), figure.get_figwidth())
    bottom.tick_params(axis="x", length=0)
    bottom.set_xlim(-0.5 - APART, middles[-1] + 0.5 * count + APART)
    figure.align_ylabels()
    letters = look.LETTERS[look.current().titles]
    longest = max(len(axis.words(k)) for k in range(count))
    columns = max(1, int(figure.get_figwidth() / (0.5 + (longest + 1) / letters)))
    entries = _legend(axis, shaken)
    figure.legend(handles=entries, loc="outside lower center", ncols=min(4, columns))
    more = LINE * (-(-len(entries) // min(4, columns)) - 1) + (max(map(len, groups)) / letters if upright else 0.0)
    figure.set_figheight(min(figure.get_figheight() + more, look.HIGHEST))
    what = "Scenarios" if axis.keys == (SCENARIO,) else "Shapes" if axis.keys[0].startswith(SHAPES) else axis.name
    title = f"{what} side by side"
    look.title(figure, title)
    state = (
        "void ratio packed (open) and after shaking (full), and its change" if shaken else MEASURES[found.main].label
    )
    return title, f"Mean over seeds of the {state}; {BARS}.", figure


def _name_groups(ax: Axes, middles: list[float], labels: list[str], width: float) -> bool:
    """Below each group what it is, a line for each axis; upright, and True, where that is too wide for the figure's `width` [inch]."""
    longest = max((len(line) for label in labels for line in label.split(", ")), default=0)
    upright = longest > FILLED * width / len(labels) * look.LETTERS[look.current().titles]
    if upright:
        ax.set_xticks(middles, labels, rotation=90, parse_math=False)
    else:
        ax.set_xticks(middles, [label.replace(", ", "\n") for label in labels], parse_math=False)
    return upright


def _axis(found: Sweep) -> Axis | None:
    """Scenarios, else what makes a shape, else any axis that is not of numbers."""
    known = varying(found)
    return next(
        (axis for test in (_of_scenarios, _of_shapes, _of_words) for axis in known if test(axis)),
        None,
    )


def _of_scenarios(axis: Axis) -> bool:
    return axis.keys == (SCENARIO,)


def _of_shapes(axis: Axis) -> bool:
    return any(key.startswith(SHAPES) for key in axis.keys)


def _of_words(axis: Axis) -> bool:
    return axis.values is None


def _before_after(ax: Axes, x: float, case: SweepCase, color: str, marker: str) -> None:
    before, after = case.estimate("void_ratio_packed"), case.estimate("void_ratio_shaken")
    ax.plot([x - 0.16, x + 0.16], [before.mean, after.mean], color=color, lw=0.8, zorder=1)
    if case.estimate("void_ratio_packed").n:
        _mark(ax, x - 0.16, case, "void_ratio_packed", color, marker, "white")
    _mark(ax, x + 0.16, case, "void_ratio_shaken", color, marker)


def _mark(ax: Axes, x: float, case: SweepCase, name: str, color: str, marker: str, face: str = "") -> None:
    value, factor = case.estimate(name), MEASURES[name].factor
    if value.n:
        bars(ax, x, value, factor, color)
        ax.plot(
            x, factor * value.mean, ls="", marker=marker, ms=look.mark_size(5.5), mec=color, mfc=face or color, zorder=3
        )
    elif not case.counts.get("done"):
        place = ax.get_xaxis_transform()
        text = " ".join(case.counts)
        ax.text(x, 0.02, text, rotation=90, transform=place, ha="center", va="bottom", fontsize=7, color="0.4")


def _legend(axis: Axis, shaken: bool) -> list[object]:
    from matplotlib.lines import Line2D

    def mark(label: str, color: str, marker: str, face: str) -> Line2D:
        return Line2D([], [], ls="", marker=marker, ms=5.5, mec=color, mfc=face, label=label.replace("$", r"\$"))

    shown = []
    for k in range(len(axis.points)):
        color = COLORS[k % len(COLORS)]
        shown.append(mark(axis.words(k), color, MARKERS[k % len(MARKERS)], color))
    if shaken:
        shown += [mark("packed", "0.4", "o", "white"), mark("after shaking", "0.4", "o", "0.4")]
    return list(shown)
