"""What `dem report` and `dem render` do with the folder of a sweep."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import click

PICTURE_OPTIONS = {"file", "output", "what", "color", "look", "dpi", "force"}


def asked_for(files: Sequence[Path], each: bool = False) -> bool:
    """Whether a sweep is meant; any folder is taken for one. ScenarioError if it is not alone, or `each` is given without."""
    from dem_cli.errors import ScenarioError
    from dem_cli.results.manifest import is_sweep

    sweeps = [path for path in files if path.is_dir() or is_sweep(path)]
    if sweeps and len(files) > 1:
        raise ScenarioError(f"{sweeps[0]} is a sweep: give it alone")
    if each and not sweeps:
        raise ScenarioError("--each has no meaning for result files, which have a row each, only for a sweep")
    return bool(sweeps)


def report(path: Path, as_json: bool, folder: Path | None, each: bool, force: bool) -> None:
    """Tables to stdout, as text or JSON; with a `folder` as CSV too."""
    import json
    import sys

    from dem_cli.report.sweep import read_sweep
    from dem_cli.report.sweep_text import blocks, write_csv
    from dem_cli.report.text import show

    found = read_sweep(path)
    if folder is not None:
        for table in write_csv(found, folder, force):
            click.echo(f"wrote {table}", err=True)
    if as_json:
        click.echo(json.dumps(found.as_dict(), indent=2, ensure_ascii=False, allow_nan=False))
    else:
        show(blocks(found, each=each), sys.stdout)


def render(
    path: Path,
    output: Path | None,
    what: str | None,
    measure: str | None,
    given: Collection[str],
    look: str,
    dpi: float | None,
    force: bool,
) -> None:
    """A picture, by default in the sweep's folder; its name to stdout, what it shows to stderr. measure: that a map shows; given: names of
    the options that are set; look: the style.
    """
    from dem_cli.errors import ScenarioError
    from dem_cli.report.look import check_target, save, style
    from dem_cli.report.sweep import read_sweep
    from dem_cli.report.sweep_figures import KINDS, check_request, draw

    what = what or KINDS[0]
    check_request(what)
    idle = sorted(set(given) - PICTURE_OPTIONS)
    if idle:
        raise ScenarioError(f"--{idle[0].replace('_', '-')} has no meaning for a sweep")
    if measure and what != "map":
        raise ScenarioError(f"--color has no meaning for --what {what} of a sweep, only for map")
    target = output or (path if path.is_dir() else path.parent) / f"{what}.png"
    check_target(target, force)
    found = read_sweep(path)
    if measure:
        found = found.by(measure)
    with style(look):
        _, caption, figure = draw(found, what)
        save(figure, target, dpi or (200.0 if look == "screen" else 600.0))
    click.echo(caption, err=True)
    click.echo(str(target))
