"""How pictures look: figures without a window, colours that survive colour blindness and print, units that
read well.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dem_cli.results import Results, Stage

# Okabe and Ito's palette without its yellow, which is too pale for lines on white.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
SEQUENTIAL = "cividis"
DIVERGING = "PuOr"
CYCLIC = "twilight"

Extend = Literal["neither", "min", "max", "both"]

ENDINGS = (".png", ".svg", ".pdf")

_RC: dict[str, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "figure.titlesize": 10.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-4, 5),
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "image.composite_image": False,
    "pdf.fonttype": 42,
    "svg.hashsalt": "dem-cli",
}
# Fonts with Japanese glyphs, for titles; the first that is installed is used beside the default.
_CJK_FONTS = ("Noto Sans CJK JP", "IPAexGothic", "IPAGothic", "Hiragino Sans", "Yu Gothic", "MS Gothic")

# SI unit -> units to show it in, from the largest: (SI value of the unit, name, least magnitude it is used for).
UNITS: dict[str, tuple[tuple[float, str, float], ...]] = {
    "m": ((1.0, "m", 0.95), (1e-2, "cm", 0.95e-2), (1e-3, "mm", 1e-4), (1e-6, "µm", 0.0)),
    "m/s": ((1.0, "m/s", 0.1), (1e-3, "mm/s", 1e-4), (1e-6, "µm/s", 0.0)),
    "Pa": ((1e9, "GPa", 1e9), (1e6, "MPa", 1e6), (1e3, "kPa", 1e3), (1.0, "Pa", 0.0)),
    "N": ((1e6, "MN", 1e6), (1e3, "kN", 1e3), (1.0, "N", 0.1), (1e-3, "mN", 0.0)),
    "J": ((1e6, "MJ", 1e7), (1e3, "kJ", 1e4), (1.0, "J", 0.1), (1e-3, "mJ", 1e-4), (1e-6, "µJ", 0.0)),
    "kg": ((1e3, "t", 1e4), (1.0, "kg", 0.1), (1e-3, "g", 0.0)),
    "s": ((1.0, "s", 0.1), (1e-3, "ms", 1e-4), (1e-6, "µs", 0.0)),
    "rad": ((np.pi / 180.0, "deg", 0.0),),
    "1": ((1.0, "", 0.0),),
}


def display_unit(unit: str, largest: float) -> tuple[float, str]:
    """Unit in which a quantity whose largest magnitude is `largest` (SI) reads well: (SI value of the unit, name)."""
    choices = UNITS.get(unit, ((1.0, unit, 0.0),))
    known = np.isfinite(largest) and largest > 0.0
    for factor, name, least in choices:
        if largest >= least if known else factor == 1.0:
            return factor, name
    return choices[-1][:2]


def axis_label(name: str, unit: str) -> str:
    """`name [unit]`, or the name alone where there is no unit."""
    return f"{name} [{unit}]" if unit else name


def largest(*arrays: Floats) -> float:
    """Largest finite magnitude of all arrays, 0 if there is none."""
    peaks = [np.abs(a[np.isfinite(a)]).max(initial=0.0) for a in arrays]
    return float(max(peaks, default=0.0))


def extension(values: Floats, low: float, high: float) -> Extend:
    """Arrows of a colour bar from `low` to `high`: at the ends beyond which values lie."""
    tiny = 1e-9 * (high - low)
    below = bool(np.min(values, initial=low) < low - tiny)
    above = bool(np.max(values, initial=high) > high + tiny)
    if below and above:
        return "both"
    return "min" if below else "max" if above else "neither"


@contextmanager
def style() -> Iterator[None]:
    """Settings under which all pictures are drawn and saved; leaves matplotlib as it was."""
    import matplotlib
    from matplotlib import font_manager

    installed = set(font_manager.get_font_names())
    family = ["DejaVu Sans", *[name for name in _CJK_FONTS if name in installed][:1]]
    settings: Any = {**_RC, "font.family": family}
    with matplotlib.rc_context(settings):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Figure of `width` x `height` inches that belongs to no window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def check_target(path: Path, force: bool) -> None:
    """Raise ScenarioError if `path` has an unknown ending, ResultsError if it would be overwritten without
    `force`.
    """
    if path.suffix.lower() not in ENDINGS:
        raise ScenarioError(f"{path}: a picture's name must end in {', '.join(ENDINGS)}")
    if path.exists() and not force:
        raise ResultsError(f"{path} exists; choose another name with -o or add --force")


def save(figure: Figure, path: Path, dpi: float) -> None:
    """Write `figure` as the ending of `path` says (one of ENDINGS); the same picture gives the same bytes.

    Raises ResultsError if that is not possible.
    """
    ending = path.suffix.lower()
    metadata = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[ending]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        try:
            figure.savefig(path, dpi=dpi, metadata=metadata)
        except OSError as error:
            raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None


def heading(figure: Figure, results: Results, text: str) -> None:
    """Title of the picture: the run's own title, then `text`; says so if the run is incomplete."""
    import textwrap

    lines = textwrap.wrap(results.title, int(11.5 * figure.get_figwidth())) or [results.path.name]
    note = "" if results.complete else " - incomplete run"
    figure.suptitle("\n".join([*lines, text + note]), parse_math=False)


def axis_name(results: Results) -> str:
    """Label of the axis that the file goes over."""
    return "t [s]" if results.axis == "time" else "increment"


def place_text(results: Results, index: int) -> str:
    """Where frame `index` lies: `t = 2 s`, or `increment 40`."""
    place = float(results.frame_times[index])
    return f"t = {place:.6g} s" if results.axis == "time" else f"increment {place:.0f}"


def stage_label(number: int, stage: Stage) -> str:
    """`stage 2 (shake)`, or with its name where that says more than the kind."""
    own = "" if stage.name in ("", stage.kind) else f", {stage.name}"
    return f"stage {number} ({stage.kind}{own})"


def mark_stages(axes: Sequence[Axes], stages: Sequence[Stage], end: float) -> None:
    """Shade every second stage on all `axes` (time axis) and name the stages along the top of the first."""
    from matplotlib.transforms import offset_copy

    if len(stages) < 2:
        return
    start = stages[0].start
    for number, stage in enumerate(stages, start=1):
        stop = stage.end if np.isfinite(stage.end) else end
        for ax in axes:
            if number % 2 == 0:
                ax.axvspan(stage.start, stop, color="0.93", zorder=0, linewidth=0)
        share = (stop - stage.start) / max(end - start, 1e-300)
        text = f"{number} {stage.name or stage.kind}"
        if share < 0.015 * len(text):
            text = str(number) if share > 0.02 else ""
        where = offset_copy(axes[0].get_xaxis_transform(), axes[0].get_figure(root=True), y=2.0, units="points")
        axes[0].text(
            0.5 * (stage.start + stop),
            1.0,
            text,
            transform=where,
            ha="center",
            va="bottom",
            fontsize=8,
            color="0.35",
            parse_math=False,
        )
