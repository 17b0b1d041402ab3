"""`dem report`: what a result file says, as text, JSON or CSV."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="report", short_help="Print what a result file says; compare several.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option("--json", "as_json", is_flag=True, help="The same numbers for machines: SI units, null where undefined.")
@click.option(
    "--csv",
    "folder",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Also write the tables as CSV into DIR.",
)
@click.option("--force", is_flag=True, help="Overwrite CSV tables that exist.")
def command(files: tuple[Path, ...], as_json: bool, folder: Path | None, force: bool) -> None:
    """Print what result FILEs say.

    One FILE: the sample before and after each stage, sloshing, the ledger of energy, and warnings. Several
    FILEs: one table to compare them, a row a file. --json prints an object for one FILE and a list for
    several; its keys are those of the dataclasses in dem_cli/report/summary.py. --csv writes series.csv,
    stages.csv, surface.csv and tracks.csv; with several FILEs into one folder a file below DIR.
    """
    # Imported here so that `dem --help` stays quick.
    import json
    import sys

    from dem_cli.report.export import export_csv, folders
    from dem_cli.report.summary import summary
    from dem_cli.report.text import blocks, comparison, show
    from dem_cli.results import open_results

    places = folders(files, folder) if folder is not None else [None] * len(files)
    found = []
    for path, place in zip(files, places, strict=True):
        with open_results(path) as results:
            found.append(summary(results))
            if place is not None:
                for table in export_csv(results, found[-1], place, force):
                    click.echo(f"wrote {table}", err=True)
    if as_json:
        trees = [s.as_dict() for s in found]
        click.echo(json.dumps(trees[0] if len(trees) == 1 else trees, indent=2, ensure_ascii=False, allow_nan=False))
    else:
        show(blocks(found[0]) if len(found) == 1 else [comparison(found)], sys.stdout)
