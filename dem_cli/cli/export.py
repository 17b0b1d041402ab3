"""`dem export`: bodies in 3D for other programs."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="export", short_help="Write bodies in 3D for ParaView or as STL.")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
@click.option("--to", "form", type=click.Choice(["vtk", "stl"]), required=True, help="What to write.")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="OUT",
    help="File, of stl a folder [default: FILE-surfaces.vtkhdf, FILE-stl].",
)
@click.option("--force", is_flag=True, help="Overwrite what exists.")
def command(file: Path, form: str, output: Path | None, force: bool) -> None:
    """Write the bodies of a result FILE of the impulse engine for other programs, and print what was written.

    \b
    vtk  surfaces of all bodies at every frame, with planes and terrain: one file that ParaView opens and plays
    stl  each shape in its own axes, and the terrain

    Every result file opens in ParaView as it is, too: bodies are points there, to be shown as 3D Glyphs.
    """
    # Imported here so that `dem --help` stays quick.
    from dem_cli.errors import ScenarioError
    from dem_cli.report.surfaces import write_stl, write_vtk
    from dem_cli.results import BodyResults, open_results

    with open_results(file) as results:
        if not isinstance(results, BodyResults):
            raise ScenarioError(f"{file}: grains in 2D have no surfaces; ParaView opens the file as it is")
        if not results.complete:
            click.echo(f"{file}: incomplete run; what was written of it is exported", err=True)
        if form == "stl":
            for path in write_stl(results, output or file.with_name(f"{file.stem}-stl"), force):
                click.echo(str(path))
            return
        target = output or file.with_name(f"{file.stem}-surfaces.vtkhdf")
        frames, triangles = write_vtk(results, target, force)
        click.echo(f"{frames} frames of {triangles} triangles", err=True)
        click.echo(str(target))
