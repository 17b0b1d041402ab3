"""`dem schema`: the JSON Schema of scenario files."""

from __future__ import annotations

import click


@click.command(name="schema", short_help="Print the JSON Schema of scenario files, for editors.")
def command() -> None:
    """Print the JSON Schema of scenario files: every key with its meaning, unit, range and default.

    Editors that know Taplo (VS Code: "Even Better TOML") complete and check scenarios with it:

    \b
      dem schema > dem.schema.json
      and as the first line of the scenario:  #:schema ./dem.schema.json
    """
    import json

    from dem_cli.scenario.reference import json_schema

    click.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))
