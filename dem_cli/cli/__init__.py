"""The command `dem`: parses, calls one function, prints. Each command is a file of its own, read only when it is used."""

from __future__ import annotations

import difflib
import importlib
from dataclasses import dataclass
from typing import Any

import click

from dem_cli import __version__
from dem_cli.errors import DemError

# name -> short help: known here, so that `dem --help` imports none of the commands. Module: dem_cli.cli.NAME, its `command`.
COMMANDS = {
    "init": "List the scenarios that come along, or write one to start from.",
    "check": "Check a scenario; print derived constants, time step, run time.",
    "run": "Run a scenario; write a result file.",
    "sweep": "Run a scenario over a grid of its keys, on all cores or a cluster.",
    "report": "Print what a result file says; compare several.",
    "compare": "Compare runs side by side, and with the thesis; draw it.",
    "render": "Draw a picture from a result file.",
    "export": "Write bodies in 3D for ParaView or as STL.",
    "schema": "Print the JSON Schema of scenario files, for editors.",
}
INTERRUPTED = 130


@dataclass(frozen=True)
class Settings:
    """Options of the program itself, passed to commands that ask for them with `click.pass_obj`.

    verbosity: -1 quiet (errors only), 0 usual, 1 and more with details.
    """

    verbosity: int = 0


class LazyGroup(click.Group):
    """A group that imports a command when it is called, and ends with a line and an exit code on errors of the program."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        command = importlib.import_module(f"dem_cli.cli.{cmd_name}").command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            near = difflib.get_close_matches(name, COMMANDS, n=1)
            raise click.UsageError(
                f'There is no command "{name}".' + (f' Did you mean "{near[0]}"?' if near else ""), ctx
            )
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except DemError as error:
            click.echo(str(error), err=True)
            ctx.exit(error.exit_code)
        except KeyboardInterrupt:
            click.echo("interrupted", err=True)
            ctx.exit(INTERRUPTED)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="dem")
@click.option("-v", "--verbose", count=True, help="Say more on stderr.")
@click.option("-q", "--quiet", is_flag=True, help="No progress on stderr, errors only.")
@click.pass_context
def main(ctx: click.Context, verbose: int, quiet: bool) -> None:
    """Granular mechanics from the command line, in 2D and for rigid bodies in 3D.

    A scenario (TOML) goes in, a result file (HDF5) comes out, a report says what it means:

    \b
      dem init shake-quick                   write a scenario to start from
      dem check shake-quick.toml             what it stands for, and how long it will take
      dem run shake-quick.toml               run it
      dem report shake-quick.h5              what came out
      dem sweep shake-quick.toml --vary ...  run it for many values of a key

    Exit codes: 0 done, 1 the run failed, 2 a mistake of yours, 130 interrupted.
    """
    ctx.obj = Settings(-1 if quiet else verbose)
