"""Pictures of a sweep, each with the words that explain it: one entry for the command line and for pages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dem_cli.errors import ScenarioError
from dem_cli.report.figures import unknown
from dem_cli.report.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("map", "resonance", "shapes")


def check_request(what: str) -> None:
    """Raise ScenarioError for an unknown kind of picture."""
    if what not in KINDS:
        raise ScenarioError(unknown("kind of picture of a sweep", what, KINDS))


def draw(found: Sweep, what: str) -> tuple[str, str, Figure]:
    """Title, caption and picture `what` of KINDS. ScenarioError if the sweep does not hold what it needs. Call inside `look.style()`."""
    # Imported here so that one kind of picture does not load what only another needs.
    check_request(what)
    if what == "map":
        from dem_cli.report.sweep_map import draw_map

        return draw_map(found)
    if what == "resonance":
        from dem_cli.report.sweep_resonance import draw_resonance

        return draw_resonance(found)
    from dem_cli.report.sweep_shapes import draw_shapes

    return draw_shapes(found)


def sections(found: Sweep) -> list[tuple[str, str, Figure]]:
    """All pictures that the sweep has something for: title, caption, figure. The tables are `sweep_text.blocks`."""
    shown = []
    for what in KINDS:
        try:
            shown.append(draw(found, what))
        except ScenarioError:
            continue
    return shown
