"""`dem report`: what a result file says, as text, JSON or CSV."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="report", short_help="Print what a result file says; compare several.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE|SWEEP...")
@click.option("--json", "as_json", is_flag=True, help="The same numbers for machines: SI units, null where undefined.")
@click.option(
    "--csv",
    "folder",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Also write the tables as CSV into DIR.",
)
@click.option("--each", is_flag=True, help="Of a sweep: a row for each run too, not only for each point.")
@click.option(
    "--html",
    "page",
    type=click.Path(path_type=Path),
    metavar="PAGE",
    help="Also write a page to look at: tables, figures, and the grains in motion.",
)
@click.option("--force", is_flag=True, help="Overwrite CSV tables and a page that exist.")
def command(
    files: tuple[Path, ...], as_json: bool, folder: Path | None, each: bool, page: Path | None, force: bool
) -> None:
    """Print what result FILEs say.

    One FILE: the sample before and after each stage, sloshing, the ledger of energy, and warnings; of a
    quasi-static shear test the turn of the volume change, peak and residual state, energies, events and
    iterations; of bodies in 3D the solver's work, the closed form that [output] check names, and the run-out.
    Several FILEs: one table to compare them, a row a file; shear tests that differ in their seed only
    get a row of their mean. --json prints an object for one FILE and a list for several; its keys are those of
    the dataclasses in dem_cli/report/summary.py, of shear tests shear.py, of bodies impulse.py. --csv writes
    series.csv, stages.csv, surface.csv (shear tests: dissipation.csv; bodies: check.csv, runout.csv) and
    tracks.csv; with several FILEs into one folder a file below DIR.

    SWEEP, the folder of a sweep or its sweep.toml: a row a point with seeds pooled (mean and its 95 % confidence
    interval), the best point, failed members with their reasons. --csv writes cases.csv and members.csv.

    --html writes PAGE, of FILEs or of a SWEEP: one file for a browser that fetches nothing, with the tables,
    figures, scenario and provenance, and a player of the frames of each FILE.
    """
    # Imported here so that `dem --help` stays quick.
    import json
    import sys

    from dem_cli.cli import of_sweep
    from dem_cli.report import export, impulse, impulse_csv, impulse_text, shear, shear_text, summary, text
    from dem_cli.report.kinds import kind_of
    from dem_cli.results import BodyResults, open_results

    if page is not None:
        _check_page(page, force)
    if of_sweep.asked_for(files, each):
        of_sweep.report(files[0], as_json, folder, each, force)
        if page is not None:
            _write_page(files, page)
        return
    kind = kind_of(files)
    places = export.folders(files, folder) if folder is not None else [None] * len(files)
    runs, tests, bodies = [], [], []
    for path, place in zip(files, places, strict=True):
        with open_results(path) as results:
            tables: list[Path] = []
            if isinstance(results, BodyResults):
                bodies.append(impulse.body_summary(results))
                if place is not None:
                    tables = impulse_csv.export_body_csv(results, bodies[-1], place, force)
            elif kind == "time":
                runs.append(summary.summary(results))
                if place is not None:
                    tables = export.export_csv(results, runs[-1], place, force)
            else:
                tests.append(shear.shear_summary(results))
                if place is not None:
                    tables = export.export_shear_csv(results, tests[-1], place, force)
            for table in tables:
                click.echo(f"wrote {table}", err=True)
    if as_json:
        trees = [
            *(one.as_dict() for one in runs),
            *(one.as_dict() for one in tests),
            *(one.as_dict() for one in bodies),
        ]
        click.echo(json.dumps(trees[0] if len(trees) == 1 else trees, indent=2, ensure_ascii=False, allow_nan=False))
    elif kind == "time":
        text.show(text.blocks(runs[0]) if len(runs) == 1 else [text.comparison(runs)], sys.stdout)
    elif kind == "bodies":
        found = impulse_text.blocks(bodies[0]) if len(bodies) == 1 else [impulse_text.comparison(bodies)]
        text.show(found, sys.stdout)
    else:
        text.show(shear_text.blocks(tests[0]) if len(tests) == 1 else [shear_text.comparison(tests)], sys.stdout)
    if page is not None:
        _write_page(files, page)


def _check_page(page: Path, force: bool) -> None:
    """Before anything is read: a name that will not do is told at once."""
    from dem_cli.report.page.render import check_page

    check_page(page, force)


def _write_page(files: tuple[Path, ...], page: Path) -> None:
    from dem_cli.cli import of_sweep
    from dem_cli.report.page.build import file_page, sweep_page
    from dem_cli.report.page.render import write_page
    from dem_cli.report.sweep import read_sweep

    write_page(sweep_page(read_sweep(files[0])) if of_sweep.asked_for(files) else file_page(files), page)
    click.echo(f"wrote {page}", err=True)
