"""`dem schema`."""

from __future__ import annotations

import json

from click.testing import CliRunner

from dem_cli.cli import main
from dem_cli.scenario.reference import json_schema


def test_prints_the_schema() -> None:
    result = CliRunner().invoke(main, ["schema"])
    assert result.exit_code == 0
    assert json.loads(result.stdout) == json_schema()


def test_help_says_how_editors_use_it() -> None:
    result = CliRunner().invoke(main, ["schema", "--help"])
    assert "#:schema ./dem.schema.json" in result.stdout
