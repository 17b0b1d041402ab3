"""`dem run`: runs a scenario and writes a result file."""

from __future__ import annotations

import time
from pathlib import Path

import click

from dem_cli.cli import INTERRUPTED, Settings


@click.command(name="run", short_help="Run a scenario; write a result file.")
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="FILE", help="Result file [SCENARIO.h5 here].")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a key, e.g. grains.count=500.")
@click.option("--report", is_flag=True, help="Print the report when the run is done.")
@click.option("--force", is_flag=True, help="Overwrite the result file if it exists.")
@click.pass_obj
def command(
    settings: Settings, scenario: Path, output: Path | None, overrides: tuple[str, ...], report: bool, force: bool
) -> None:
    """Run SCENARIO and write a result file (HDF5).

    The result file is SCENARIO's name with .h5 in the present folder; it grows under NAME.partial.h5 and takes its own name when
    it is complete. Ctrl-C ends the run with exit code 130, and a blow-up with 1; what was written stays readable. Progress goes to stderr.
    """
    from dem_cli.results.files import check_target, partial_path
    from dem_cli.scenario import load_scenario

    loaded = load_scenario(scenario, overrides)
    target = output or Path(scenario.with_suffix(".h5").name)
    check_target(target, force=force)

    from dem_cli.cli.progress import Progress
    from dem_cli.jit import is_cold
    from dem_cli.pace import clock
    from dem_cli.run import run_scenario

    began = time.monotonic()
    with Progress(loaded, settings.verbosity) as progress:
        what = "bodies" if loaded.engine == "impulse" else "grains"
        progress.say(f"{loaded.title}: {loaded.grain_count} {what}, {len(loaded.stages)} stages, to {target}")
        if loaded.sweep:
            progress.say("its table [sweep] is left aside: dem sweep runs that")
        if is_cold():
            progress.say("compiling the kernels, once after installation: up to a minute")
        try:
            run_scenario(loaded, target, force=force, listener=progress, packing_listener=progress.packing)
        except KeyboardInterrupt:
            left = partial_path(target)
            progress.say(
                f"interrupted; what was written is in {left}"
                if left.exists()
                else "interrupted before anything was written"
            )
            raise SystemExit(INTERRUPTED) from None
        except Exception:
            if partial_path(target).exists():
                progress.say(f"stopped; what was written is in {partial_path(target)}")
            raise
        progress.say(f"done in {clock(time.monotonic() - began)}: {target}")
    if report:
        from dem_cli.cli.report import command as print_report

        click.get_current_context().invoke(print_report, files=(target,), as_json=False, folder=None, force=False)
    elif settings.verbosity >= 0:
        click.echo(f"dem report {target} says what came out", err=True)
