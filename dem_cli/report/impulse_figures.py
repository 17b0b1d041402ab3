"""Pictures of runs of bodies in 3D: what is asked for is checked against the file and drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dem_cli.errors import ScenarioError
from dem_cli.report.body_quantities import BODY_QUANTITIES
from dem_cli.report.curves import Ledger, draw_energy, draw_series
from dem_cli.report.figures import BODY_KINDS, Picture, choose_frame, choose_window, unknown
from dem_cli.results import BodyResults

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ALL_KINDS = (*BODY_KINDS, "energy", "series")
DEFAULT_SERIES = ("kinetic", "contacts", "penetration", "top")
BODY_LEDGER = Ledger(
    stored={
        "potential": ("potential, above its lowest", "#C6DBEF"),
        "kinetic": ("kinetic", "#6BAED6"),
        "rotational": ("rotational", "#2171B5"),
    },
    lost={
        "restitution_energy": ("lost in impacts", "#D8A04A"),
        "friction": ("lost to friction", "#8C510A"),
        "escaped_energy": ("carried off by escaped bodies", "#737373"),
    },
    given=("work", "projection"),
    label="start + work + projection",
)


def draw_bodies(results: BodyResults, picture: Picture) -> Figure:
    """Figure of `picture`. Raises ScenarioError if the file does not hold what it needs. Call inside `look.style()`."""
    from dem_cli.report import impulse_curves, impulse_paths, scene3d

    what = check_bodies(results, picture)
    if what == "scene":
        index = choose_frame(results, picture)
        return scene3d.draw_scene(
            results, index, color=picture.color, chains=bool(picture.chains), limits=picture.limits,
            view=scene3d.view_of(results, [index], picture.view),
        )  # fmt: skip
    if what == "runout":
        return impulse_curves.draw_runout(results)
    if what == "check":
        return impulse_curves.draw_check(results)
    window, text = choose_window(results, picture)
    if what == "trajectories":
        return impulse_paths.draw_trajectories(results, window, text, picture.grains)
    if what == "histories":
        return impulse_paths.draw_histories(results, window, text, picture.grains)
    time = results.series["time"]
    if ((time >= window[0] - 1e-9) & (time <= window[1] + 1e-9)).sum() < 2:
        raise ScenarioError(
            f"{results.path}: holds fewer than two rows of series between t = {window[0]:g} s and t = {window[1]:g} s"
        )
    if what == "energy":
        return draw_energy(results, window, text, BODY_LEDGER)
    return draw_series(results, picture.series or DEFAULT_SERIES, window, text)


def check_bodies(results: BodyResults, picture: Picture) -> str:
    """The kind of picture; raises ScenarioError for what a file of bodies has not."""
    what = "scene" if picture.what == "sample" else picture.what
    if what not in ALL_KINDS:
        raise ScenarioError(f"{results.path}: bodies in 3D have no picture {what}; choose from {', '.join(ALL_KINDS)}")
    if picture.increment is not None:
        raise ScenarioError(f"{results.path}: is a run over time; choose a frame with --time, not --increment")
    if what == "scene" and picture.color is not None and picture.color not in BODY_QUANTITIES:
        raise ScenarioError(f"{results.path}: " + unknown("quantity of a body", picture.color, BODY_QUANTITIES))
    for name in picture.series or ():
        if what == "series" and name not in results.series:
            raise ScenarioError(f"{results.path}: " + unknown("series", name, results.series))
    return what
