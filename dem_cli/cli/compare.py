"""`dem compare`: runs side by side, seeds pooled, the thesis beside them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dem_cli.cli.finite import FiniteRange

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@click.command(name="compare", short_help="Compare runs side by side, and with the thesis; draw it.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option(
    "--thesis", "with_thesis", is_flag=True, help="Set the thesis' chapter 8 beside: its numbers and statements."
)
@click.option("--each", is_flag=True, help="A row a file: do not pool seeds.")
@click.option("--grains", is_flag=True, help="Also a row for each tracked grain.")
@click.option("--json", "as_json", is_flag=True, help="All numbers for machines: SI units, null where undefined.")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="PICTURE",
    help="Draw a picture too: PNG, SVG or PDF [default with --what: compare-KIND.png].",
)
@click.option(
    "--what",
    metavar="KIND",
    help="The picture: table, grid, histories or trajectories, of shear tests stress-strain [default: table].",
)
@click.option(
    "--stage", type=int, metavar="N", help="Histories, trajectories: stage N from 1 [default: the last of shaking]."
)
@click.option(
    "--style",
    "look",
    type=click.Choice(["screen", "paper", "paper-wide"]),
    default="screen",
    show_default=True,
    help="Paper: for a column of 85 mm, or two of 170 mm; 8 pt, no titles, which are printed as a caption.",
)
@click.option("--dpi", type=FiniteRange(20, 1200), help="Resolution of PNG [default: 200, for paper 600].")
@click.option("--force", is_flag=True, help="Overwrite a picture that exists.")
def command(
    files: tuple[Path, ...],
    with_thesis: bool,
    each: bool,
    grains: bool,
    as_json: bool,
    output: Path | None,
    what: str | None,
    stage: int | None,
    look: str,
    dpi: float | None,
    force: bool,
) -> None:
    """Compare the runs of result FILEs: a row a case, in the order of shaking and shape.

    Runs that differ in their seed only are one case: mean +- standard deviation (number of runs). Settings in
    which cases of one shape and shaking differ stand beside the shape. Incomplete runs stand alone and are in no
    statement.

    \b
    table         void ratio before and after, roughness and airborne grains of each case
    grid          change of the void ratio over amplitude and frequency, a matrix for each shape
    histories     displacement x, y and rotation of tracked grains: a column a case, a row a grain, same axes
    trajectories  their paths, likewise

    Histories and trajectories show the first run of each case.

    Quasi-static shear tests are compared by peak, turn of the volume change and energy; their one picture is
    stress-strain, a curve a file.
    """
    # Imported here so that `dem --help` stays quick.
    import json
    import sys

    from dem_cli.errors import ScenarioError
    from dem_cli.report.compare import compare
    from dem_cli.report.compare_figures import check_request, draw
    from dem_cli.report.compare_text import blocks
    from dem_cli.report.kinds import kind_of
    from dem_cli.report.look import check_target
    from dem_cli.report.text import show
    from dem_cli.results.manifest import is_sweep

    sweep = next((path for path in files if is_sweep(path)), None)
    if sweep is not None:
        raise ScenarioError(f"{sweep}: a sweep is told of by dem report {sweep}; dem compare takes result files")
    kind = kind_of(files)
    if kind == "bodies":
        raise ScenarioError("runs of bodies in 3D are compared by dem report FILE FILE ...: a row a file")
    if kind == "increment":
        _shear_tests(
            files,
            each,
            as_json,
            output,
            what,
            stage,
            look,
            dpi,
            force,
            idle={"--thesis": with_thesis, "--grains": grains},
        )
        return
    target = output or (Path(f"compare-{what}.png") if what else None)
    check_request(what or "table", stage=stage is not None)
    if target:
        check_target(target, force)
    found = compare(files, with_thesis=with_thesis, each=each)
    if target:
        _draw(target, look, dpi, lambda: draw(found, what or "table", stage=stage, with_thesis=with_thesis))
    if as_json:
        click.echo(json.dumps(found.as_dict(), indent=2, ensure_ascii=False, allow_nan=False))
    else:
        show(blocks(found, grains=grains), sys.stdout)


def _draw(target: Path, look: str, dpi: float | None, figure_of: Callable[[], Figure]) -> None:
    """Save a picture and say so, with its caption where the style has no titles."""
    from dem_cli.report.look import caption, save, style

    with style(look):
        figure = figure_of()
        save(figure, target, dpi or (200.0 if look == "screen" else 600.0))
    click.echo(f"wrote {target}", err=True)
    if look != "screen":
        click.echo(f"caption: {caption(figure)}", err=True)


def _shear_tests(
    files: tuple[Path, ...],
    each: bool,
    as_json: bool,
    output: Path | None,
    what: str | None,
    stage: int | None,
    look: str,
    dpi: float | None,
    force: bool,
    idle: Mapping[str, bool],
) -> None:
    """The same for quasi-static shear tests. idle: options that say nothing about them. ScenarioError if one is given."""
    import json
    import sys
    from contextlib import ExitStack

    from dem_cli.errors import ScenarioError
    from dem_cli.report.look import check_target
    from dem_cli.report.shear import shear_summary
    from dem_cli.report.shear_curves import draw_compared
    from dem_cli.report.shear_text import comparison
    from dem_cli.report.text import show
    from dem_cli.results import open_results

    for option, given in idle.items():
        if given:
            raise ScenarioError(f"{option} has no meaning for quasi-static tests")
    if what not in (None, "stress-strain"):
        raise ScenarioError(f'--what "{what}": quasi-static tests are compared in one picture, stress-strain')
    target = output or (Path(f"compare-{what}.png") if what else None)
    if stage is not None and target is None:
        raise ScenarioError("--stage chooses what is drawn: add --what stress-strain")
    if target:
        check_target(target, force)
    with ExitStack() as stack:
        opened = [stack.enter_context(open_results(path)) for path in files]
        found = [shear_summary(results) for results in opened]
        if target:
            _draw(target, look, dpi, lambda: draw_compared(opened, stage))
    if as_json:
        click.echo(json.dumps([one.as_dict() for one in found], indent=2, ensure_ascii=False, allow_nan=False))
    else:
        show([comparison(found, each=each)], sys.stdout)
