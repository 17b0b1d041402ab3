"""The pictures of a page: those of `dem render`, each as SVG or PNG, whichever is smaller, with words for those who cannot see it."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from dem_cli.errors import DemError
from dem_cli.report.figures import Picture, draw
from dem_cli.report.page.model import Drawing, Note, Part
from dem_cli.results import BodyResults, Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SMALL = 120_000  # bytes of an SVG that no PNG is tried against
BYTES_A_GRAIN = 300  # of an SVG, at least
DPI = 150.0

# Kind of picture -> its heading, and what it shows.
KINDS: dict[str, tuple[str, str]] = {
    "sample": ("The sample at the end", "grains to scale, coloured by displacement, with force chains and walls"),
    "scene": ("The scene at the end", "bodies, planes and terrain, shaded"),
    "series": ("Series", "curves of measures of the sample over the run"),
    "energy": ("Energy", "the ledger of energy over time as stacked areas: what is stored, what is lost, what was put in"),
    "surface": ("Free surface", "height of the surface over place and time, and its antisymmetric mode over time"),
    "spectrum": (
        "Spectrum of the surface",
        "amplitudes of its modes over frequency, with the driving frequency and those of a liquid as deep",
    ),
    "motion": ("Motion of the container", "acceleration, velocity and displacement over time"),
    "rose": ("Directions of contacts", "a rose of contact normals with the principal directions of the fabric"),
    "force-distribution": ("Distribution of forces", "density of normal forces between grains over their mean, with its exponential tail"),
    "histories": ("Tracked grains", "displacement in x and y and rotation over time, a row a grain"),
    "trajectories": ("Paths of tracked grains", "their ways in the container"),
    "stress-strain": ("Stress and strain", "stress ratio and volumetric strain over the shear strain"),
    "dilatancy": ("Dilatancy", "growth of the volumetric strain with the shear strain, and its angle"),
    "forces": ("Contact forces", "rectangles along each force, as wide as it is large, at the start and the peak"),
    "normals": ("Contact normals", "roses of contact normals in percent at the start and the peak"),
    "energy-normals": ("Elastic energy by direction", "roses of contact normals weighted by elastic energy"),
    "coordination": ("Coordination", "principal values of the coordination tensor over the shear strain"),
    "energy-tensor": ("Tensor of elastic energy", "its principal values over the shear strain"),
    "dissipation": ("Work and dissipation", "work, dissipation, elastic and released energy over the shear strain"),
    "largest-share": ("Largest share of one contact", "in the dissipation of each increment"),
    "ranked": ("Ranked dissipation", "contacts ranked by their share in the dissipation of chosen increments"),
    "check": ("Closed form", "velocity over time beside the closed form"),
    "runout": ("Run-out", "how far bodies ran from where they started"),
}  # fmt: skip
OVER_TIME = (
    "sample", "series", "energy", "surface", "spectrum", "motion", "rose", "force-distribution", "histories", "trajectories",
)  # fmt: skip
OF_SHAKING = ("surface", "spectrum", "motion")
OVER_INCREMENTS = (
    "sample", "stress-strain", "dilatancy", "forces", "force-distribution", "normals", "energy-normals", "coordination", "energy-tensor",
    "dissipation", "largest-share", "ranked",
)  # fmt: skip
OF_BODIES = ("scene", "series", "energy", "check", "runout", "histories", "trajectories")
FEW = ("series", "stress-strain")  # of each of several files, whose samples the players show


def drawing(figure: Figure, title: str, caption: str, alt: str, *, grains: int = 0) -> Drawing:
    """A figure for the page. grains: that it draws one by one. Call inside `look.style()`."""
    size = (float(figure.get_figwidth()), float(figure.get_figheight()))
    # What is certain not to be the smaller is not made: the vectors of many grains, the image of a small drawing.
    image = _saved(figure, "png") if grains else b""
    if image and len(image) <= BYTES_A_GRAIN * grains:
        return Drawing(title, caption, alt, "png", image, size)
    vector = _saved(figure, "svg")
    if len(vector) > SMALL and not image:
        image = _saved(figure, "png")
    if image and len(image) < len(vector):
        return Drawing(title, caption, alt, "png", image, size)
    return Drawing(title, caption, alt, "svg+xml", vector, size)


def _saved(figure: Figure, kind: Literal["svg", "png"]) -> bytes:
    metadata = {"svg": {"Date": None}, "png": {"Software": None}}[kind]
    with io.BytesIO() as stream, warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(stream, format=kind, dpi=DPI, metadata=metadata)
        figure.set_layout_engine("none")  # it is laid out now; doing that again takes as long as drawing
        return stream.getvalue()


def pictures(results: Results, *, few: bool = False) -> list[Part]:
    """The pictures that fit the file, and a note of those that it does not hold enough for. Call inside `look.style()`."""
    found: list[Part] = []
    missing = []
    for what in _kinds(results, few):
        title, shows = KINDS[what]
        try:
            figure = draw(results, Picture(what=what))
        except DemError as error:
            missing.append(f"{title.lower()} ({str(error).removeprefix(f'{results.path}: ')})")
            continue
        state = "" if results.complete else " Incomplete run."
        grains = results.element_count if what in ("sample", "scene") else 0
        caption = f"{shows[0].upper()}{shows[1:]}.{state}"
        found.append(drawing(figure, title, caption, f"{title}: {shows}.{state}", grains=grains))
    return [*found, Note(f"Not drawn: {'; '.join(missing)}.")] if missing else found


def _kinds(results: Results, few: bool) -> Sequence[str]:
    if isinstance(results, BodyResults):
        kinds: Sequence[str] = OF_BODIES
        if not results.scenario.get("output", {}).get("check"):
            kinds = [what for what in kinds if what != "check"]
    elif results.axis == "increment":
        kinds = OVER_INCREMENTS
    else:
        shaken = any(stage.kind == "shake" for stage in results.stages)
        kinds = [what for what in OVER_TIME if shaken or what not in OF_SHAKING]
    if results.tracks is None:
        kinds = [what for what in kinds if what not in ("histories", "trajectories")]
    return [what for what in kinds if what in FEW] if few else kinds
