"""`dem init`: the scenarios that come along."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click


@click.command(name="init", short_help="List the scenarios that come along, or write one to start from.")
@click.argument("name", required=False, metavar="[NAME]")
@click.option(
    "-o", "output", type=click.Path(path_type=Path), metavar="FILE", help="Where to write it [default: NAME.toml here]."
)
@click.option("--force", is_flag=True, help="Overwrite a file that exists.")
def command(name: str | None, output: Path | None, force: bool) -> None:
    """List the scenarios that come along, or write a copy of scenario NAME, and of files that it reads, to start from."""
    from dem_cli.scenario.shipped import folder, shipped_scenario, shipped_scenarios

    if name is None:
        for one in shipped_scenarios():
            click.echo(
                f"{one.name}\n    {one.title}\n    {one.shows[:1].upper()}{one.shows[1:]}\n    Takes {one.takes}\n"
            )
        click.echo("Copy one here with: dem init NAME")
        return
    one = shipped_scenario(name)
    target = output or Path(f"{one.name}.toml")
    if target.is_dir():
        target = target / f"{one.name}.toml"
    # The files that it reads lie beside it, under their own names.
    content = {target: one.text.encode()}
    content |= {target.parent / file: (folder() / file).read_bytes() for file in one.files}
    _write(content, target, force=force)
    for path in content:
        click.echo(str(path))
    click.echo(f"Next: dem sweep {target} --dry-run" if one.sweeps else f"Next: dem check {target}", err=True)


def _write(content: Mapping[Path, bytes], scenario: Path, *, force: bool) -> None:
    """Writes all files or none, unless the disk fails. What is there already, bit for bit, is no obstacle beside the scenario."""
    from dem_cli.errors import ScenarioError

    for path, data in content.items():
        same = path != scenario and path.is_file() and path.read_bytes() == data
        if path.exists() and not (force or same):
            raise ScenarioError(f"{path}: exists. Choose another name with -o FILE, or overwrite it with --force")
    for path, data in content.items():
        try:
            path.write_bytes(data)
        except OSError as error:
            raise ScenarioError(
                f"{path}: cannot be written ({error.strerror}). Choose another place with -o FILE"
            ) from None
