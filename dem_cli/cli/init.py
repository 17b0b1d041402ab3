"""`dem init`: the scenarios that come along."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(name="init", short_help="List the scenarios that come along, or write one to start from.")
@click.argument("name", required=False, metavar="[NAME]")
@click.option(
    "-o", "output", type=click.Path(path_type=Path), metavar="FILE", help="Where to write it [default: NAME.toml here]."
)
@click.option("--force", is_flag=True, help="Overwrite a file that exists.")
def command(name: str | None, output: Path | None, force: bool) -> None:
    """List the scenarios that come along, or write a copy of scenario NAME to start from."""
    from dem_cli.errors import ScenarioError
    from dem_cli.scenario.shipped import shipped_scenario, shipped_scenarios

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
    try:
        with target.open("w" if force else "x", encoding="utf-8", newline="\n") as file:
            file.write(one.text)
    except FileExistsError:
        raise ScenarioError(
            f"{target}: exists. Choose another name with -o FILE, or overwrite it with --force"
        ) from None
    except OSError as error:
        raise ScenarioError(
            f"{target}: cannot be written ({error.strerror}). Choose another place with -o FILE"
        ) from None
    click.echo(str(target))
    click.echo(f"Next: dem check {target}", err=True)
