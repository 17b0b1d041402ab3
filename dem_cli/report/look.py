"""How pictures look: figures without a window, styles for screen and paper, colours that survive colour blindness and print, units
that read well.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.state import Floats
from dem_cli.whole import whole

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
_PAPER: dict[str, Any] = {
    # A Times that comes with matplotlib, so that pictures are the same on every machine.
    "mathtext.fontset": "stix",
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelpad": 2.5,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.2,
    "axes.linewidth": 0.5,
    "lines.linewidth": 0.8,
    "patch.linewidth": 0.5,
    **{f"{axis}tick.{part}": size for axis in "xy" for part, size in (
        ("major.width", 0.5), ("minor.width", 0.4), ("major.size", 2.5), ("minor.size", 1.5), ("major.pad", 2.0),
    )},
    "svg.fonttype": "none",  # text stays text
}  # fmt: skip


@dataclass(frozen=True)
class Style:
    """Settings of matplotlib; width [inch] that figures have, None: their own; whether they bear titles and notes.

    small: size [points] of secondary text.
    """

    rc: dict[str, Any] = field(default_factory=dict)
    family: str = "DejaVu Sans"
    width: float | None = None
    titles: bool = True
    small: float = 8.0


# One column, and two, of a journal's page: 85 and 170 mm. Titles become captions, which `save` puts into the file.
STYLES = {
    "screen": Style(),
    "paper": Style(_PAPER, "STIXGeneral", 85.0 / 25.4, titles=False, small=7.0),
    "paper-wide": Style(_PAPER, "STIXGeneral", 170.0 / 25.4, titles=False, small=7.0),
}
_CURRENT: ContextVar[Style] = ContextVar("style", default=STYLES["screen"])
LETTERS = {True: 11.5, False: 14.0}  # an inch, of styles with titles and without
HIGHEST = 9.5  # inch, of a figure on a page
NARROW = 4.5  # inch, below which what stands side by side goes below each other

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
def style(name: str = "screen") -> Iterator[None]:
    """Settings under which all pictures are drawn and saved, one of STYLES; leaves matplotlib as it was."""
    import matplotlib
    from matplotlib import font_manager

    chosen = STYLES[name]
    installed = set(font_manager.get_font_names())
    family = [chosen.family, *[name for name in _CJK_FONTS if name in installed][:1]]
    settings: Any = {**_RC, **chosen.rc, "font.family": family}
    token = _CURRENT.set(chosen)
    try:
        with matplotlib.rc_context(settings):
            yield
    finally:
        _CURRENT.reset(token)


def current() -> Style:
    """The style that pictures are drawn in now."""
    return _CURRENT.get()


def small() -> float:
    """Size of secondary text [points]."""
    return _CURRENT.get().small


def narrow() -> bool:
    """Whether figures are as wide as one column of a page."""
    width = _CURRENT.get().width
    return width is not None and width < NARROW


def mark_size(points: float) -> float:
    """Diameter of a mark [points]: smaller in a column of a page."""
    return 0.6 * points if narrow() else points


def folded(text: str) -> str:
    """`start, increment 6, e1 - e2 = 0 %` for a panel: on two lines, broken at its last comma, in a column of a page."""
    return "\n".join(text.rsplit(", ", 1)) if narrow() else text


def wrapped(text: str, width: float) -> str:
    """Lines of text folded to `width` inches, by the mean width of letters of the style's titles."""
    import textwrap

    letters = max(int(width * LETTERS[_CURRENT.get().titles]), 8)
    return "\n".join(textwrap.fill(line, letters) for line in text.split("\n"))


def new_figure(width: float, height: float, *, rigid: bool = False, page: bool = False) -> Figure:
    """Figure of `width` x `height` inches that belongs to no window; of the style's width where it has one, of two columns for a `page`.

    Then it is lower, too: by as much if `rigid`, else by less, as labels keep their height.
    """
    from matplotlib.figure import Figure

    own = _CURRENT.get().width
    if page and own is not None:
        own = STYLES["paper-wide"].width
    if own is not None:
        ratio = own / width
        height = min(height * (ratio if rigid else min(ratio, 1.0) ** 0.6), HIGHEST)
        width = own
    return Figure(figsize=(width, height), layout="constrained")


def check_target(path: Path, force: bool, also: Sequence[str] = ()) -> None:
    """Raise ScenarioError if `path` has an unknown ending, ResultsError if it would be overwritten without
    `force`. also: endings that other pictures of the kind may have.
    """
    if path.suffix.lower() not in ENDINGS:
        raise ScenarioError(f"{path}: a picture's name must end in {', '.join((*ENDINGS, *also))}")
    if path.exists() and not force:
        raise ResultsError(f"{path} exists; choose another name with -o or add --force")


def save(figure: Figure, path: Path, dpi: float) -> None:
    """Write `figure` as the ending of `path` says (one of ENDINGS); the same picture gives the same bytes.

    Raises ResultsError if that is not possible.
    """
    ending = path.suffix.lower()
    metadata: dict[str, Any] = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[
        ending
    ]
    if caption(figure):
        metadata["Title"] = caption(figure)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        try:
            with whole(path) as work:
                figure.savefig(work, dpi=dpi, metadata=metadata, format=ending[1:])
        except OSError as error:
            raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None


def heading(figure: Figure, results: Results, text: str) -> None:
    """Title of the picture: the run's own title, then `text`; says so if the run is incomplete."""
    note = "" if results.complete else " - incomplete run"
    title(figure, text + note, results.title or results.path.name)


def title(figure: Figure, text: str, name: str = "") -> None:
    """`text` below the name of the run: over the picture, or in its caption where the style has no titles."""
    describe(figure, f"{name}: {text}" if name else text)
    if _CURRENT.get().titles:
        figure.suptitle(wrapped(f"{name}\n{text}" if name else text, figure.get_figwidth()), parse_math=False)


def footnote(figure: Figure, text: str, size: float | None = None) -> None:
    """What else must be known: small (`size` points), under the picture, or in its caption where the style has no titles."""
    describe(figure, text)
    if _CURRENT.get().titles:
        import textwrap

        size = size or small()
        wide = int(115.0 * figure.get_figwidth() / size)
        figure.supxlabel("\n".join(textwrap.fill(line, wide) for line in text.split("\n")), fontsize=size)


def caption(figure: Figure) -> str:
    """Title and notes of the picture in one line."""
    return str(figure.get_label())


def describe(figure: Figure, text: str) -> None:
    """Add a part to the caption."""
    one = text.replace("\n", "; ")
    figure.set_label(f"{caption(figure)}; {one}" if caption(figure) else one)


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
        wide = 7.0 / (current().width or 7.0)
        if share < 0.015 * wide * len(text):
            text = str(number) if share > 0.02 * wide else ""
        where = offset_copy(axes[0].get_xaxis_transform(), axes[0].get_figure(root=True), y=2.0, units="points")
        axes[0].text(
            0.5 * (stage.start + stop),
            1.0,
            text,
            transform=where,
            ha="center",
            va="bottom",
            fontsize=small(),
            color="0.35",
            parse_math=False,
        )
