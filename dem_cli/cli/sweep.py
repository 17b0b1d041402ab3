"""`dem sweep`: runs a scenario over a grid of its keys."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dem_cli.cli import INTERRUPTED, Settings

if TYPE_CHECKING:
    from dem_cli.scenario.sweep import Points
    from dem_cli.sweep.drive import Tally
    from dem_cli.sweep.plan import Plan
    from dem_cli.sweep.store import Store

MANY = 10_000  # members that nobody means by accident
MOST_FAILED = 50  # rows of the table of what failed
FEW = 10  # preparations that are listed one by one


@click.command(name="sweep", short_help="Run a scenario over a grid of its keys, on all cores or a cluster.")
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), metavar="DIR", help="Folder [SCENARIO-sweep here].")
@click.option(
    "--vary",
    "vary",
    multiple=True,
    metavar="KEY=A,B,...",
    help='Vary a key, e.g. "stage.shake.amplitude=400 gal,800 gal".',
)
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a key of all members.")
@click.option(
    "--jobs", type=click.IntRange(1), metavar="N", help="Members at a time, each on one core [default: all cores]."
)
@click.option("--scheduler", metavar="ADDRESS", help="Run on a Dask cluster, e.g. tcp://host:8786 (extra: cluster).")
@click.option("--dry-run", is_flag=True, help="List the members and how long they may take; run nothing.")
@click.option("--retry", is_flag=True, help="Run members that failed once more.")
@click.option("--yes", is_flag=True, help=f"Go on with more than {MANY:,} members.")
@click.pass_obj
def command(
    settings: Settings,
    scenario: Path,
    output: Path | None,
    vary: tuple[str, ...],
    overrides: tuple[str, ...],
    jobs: int | None,
    scheduler: str | None,
    dry_run: bool,
    retry: bool,
    yes: bool,
) -> None:
    """Run SCENARIO once for each member of its table [sweep], and of --vary, which adds axes to it or takes their place.

    \b
      dem sweep shake-quick.toml --vary "stage.shake.amplitude=400 gal,800 gal" --vary seed=1..4
      dem report shake-quick-sweep

    Result files and a manifest, sweep.toml, go into one folder. Members that are done are skipped, so the same command
    goes on after an interrupt, and a changed sweep runs what is new; files that no longer belong to it are kept and
    told. Stages that several members begin with, such as one packing for many ways of shaking, are run once. The
    command may be started several times in one folder, on several machines too: each takes what the others have not.

    Exit codes: 0 all members are done or run by another sweep, 1 some failed (a table says why), 2 a mistake of yours, 130 interrupted.
    """
    from dem_cli.errors import ScenarioError
    from dem_cli.sweep.plan import make_plan

    if scheduler is not None and not scheduler.strip():  # perhaps a variable of the shell that is not set
        raise ScenarioError("--scheduler: is empty. Give the address of a Dask scheduler, such as tcp://host:8786")
    if jobs and scheduler:
        raise ScenarioError("--jobs and --scheduler exclude each other: a cluster has as many workers as were started")
    plan = make_plan(scenario, overrides, _varied(vary), None if yes else MANY)
    jobs = jobs or _cores()
    folder = output or Path(f"{scenario.stem}-sweep")
    if dry_run:
        _list(plan, folder, jobs)
        return

    from dem_cli.sweep.store import Store

    store = Store(plan.manifest(folder))
    try:
        store.begin()
        store.discard_preparations(plan.shared)
        tally = _run(settings, plan, store, jobs, scheduler, retry)
    finally:
        store.close()
    _conclude(settings, tally, store, folder)


def _cores() -> int:
    """Those that this process may use: a batch system often gives fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _varied(texts: Sequence[str]) -> Points:
    from dem_cli.errors import ScenarioError
    from dem_cli.scenario.sweep import varied

    found: Points = {}
    for text in texts:
        try:
            axis = varied(text)
        except ValueError as error:
            raise ScenarioError(f"--vary {text}: {error}") from None
        for name in axis.keys() & found.keys():
            raise ScenarioError(f"--vary {text}: {name} is varied already. Give all its values in one --vary")
        found |= axis
    return found


def _run(settings: Settings, plan: Plan, store: Store, jobs: int, scheduler: str | None, retry: bool) -> Tally:
    from dem_cli.cli.sweep_progress import SweepProgress
    from dem_cli.interrupts import marked_interrupts
    from dem_cli.jit import is_cold
    from dem_cli.sweep.drive import Sweeping
    from dem_cli.sweep.local import LocalWorkers, Workers

    workers: Workers
    if scheduler:
        from dem_cli.sweep.cluster import ClusterWorkers

        workers = ClusterWorkers(scheduler, store.token)
        room = workers.at_once
        where = f"{scheduler}, which has {f'room for {room} at a time' if room else 'no workers yet'}"
    else:
        workers = LocalWorkers(jobs)
        where = f"{jobs} process{'es' if jobs > 1 else ''}"
    with SweepProgress(settings.verbosity) as progress, marked_interrupts() as check:
        count = len(store.manifest.members)
        progress.say(f"{plan.title}: {count} member{'s' if count > 1 else ''}, to {store.folder}, on {where}")
        if not scheduler and is_cold():
            progress.say("compiling the kernels, once after installation: up to a minute, in which no member moves on")
        for line in _remarks(plan, store):
            progress.say(line)
        try:
            return Sweeping(plan, store, workers, progress, retry=retry).run(check)
        except KeyboardInterrupt:
            progress.say("interrupted; members that are done are kept, and the same command goes on with the others")
            raise SystemExit(INTERRUPTED) from None
        finally:
            workers.close()


def _remarks(plan: Plan, store: Store) -> list[str]:
    """What the user may not expect."""
    said = []
    if plan.twins:
        said.append(
            f"{plan.twins} member{'s have' if plan.twins > 1 else ' has'} the same scenario as another one; left out"
        )
    if former := store.manifest.former:
        said.append(
            f"{len(former)} result file{'s are' if len(former) > 1 else ' is'} of members that the sweep no longer has, "
            f"e.g. {former[0]}; kept, and in no report"
        )
    done = [one for one in store.manifest.members if one.state == "done"]
    if done:
        said.append(f"{len(done)} member{'s are' if len(done) > 1 else ' is'} done already; skipped")
    return said


def _conclude(settings: Settings, tally: Tally, store: Store, folder: Path) -> None:
    """The table of what failed, and what to do next."""
    if tally.elsewhere:
        count = len(tally.elsewhere)
        who = sorted({store.owner(key) for key in tally.elsewhere})
        click.echo(
            f"{count} member{'s are' if count > 1 else ' is'} being run by another sweep ({', '.join(who[:3])})",
            err=True,
        )
    if tally.failed:
        from dem_cli.report.text import Block, show

        rows = [(name, "; ".join(reason.splitlines())) for name, reason in list(tally.failed.items())[:MOST_FAILED]]
        if len(tally.failed) > MOST_FAILED:
            rows.append(("...", f"and {len(tally.failed) - MOST_FAILED} more, see {folder / 'sweep.toml'}"))
        title = f"{len(tally.failed)} of {tally.total} members failed"
        show([Block(title, ("member", "reason"), tuple(rows), left=2)], sys.stderr)
    if settings.verbosity >= 0:
        click.echo(f"{tally.done + tally.skipped} of {tally.total} members are done: {folder}", err=True)
        click.echo(f"dem report {folder} says what came out", err=True)
    if tally.failed:
        raise SystemExit(1)


def _list(plan: Plan, folder: Path, jobs: int) -> None:
    """The members, each with its state and estimated time, and the whole."""
    from dem_cli.cli.check import clock
    from dem_cli.cli.estimate import estimate_sweep
    from dem_cli.report.text import Block, show
    from dem_cli.results.manifest import is_sweep, read_manifest
    from dem_cli.sweep.store import find_done

    written = read_manifest(folder).members if is_sweep(folder) else ()
    records = {one.hash: one for one in written if one.hash}
    guess = estimate_sweep(plan, records)
    done = find_done(folder, plan.members)
    open_members = [one for one in plan.members if one.hash not in done]
    needed = {key for one in open_members if (key := plan.start.get(one.hash))}
    keys = [key for axis in plan.axes for key in axis.keys]
    rows = []
    for one in plan.members:
        record = records.get(one.hash)
        state = "done" if one.hash in done else "failed" if record and record.state == "failed" else "to do"
        time = "" if one.hash in done else clock(guess.members[one.hash])
        rows.append((*(str(one.settings[key]) for key in keys), state, time, one.file))
    for one in plan.invalid:
        rows.append((*(str(one.settings[key]) for key in keys), "invalid", "", one.error))
    whole = sum(guess.members[one.hash] for one in open_members) + sum(guess.preparations[key] for key in needed)
    title = f"{plan.title}: {len(plan.members) + len(plan.invalid)} members, {len(done)} done; folder {folder}"
    shared = [one for key, one in plan.shared.items() if key in needed]
    lines = [(one.label, clock(guess.preparations[one.key])) for one in shared[:FEW]]
    if more := shared[FEW:]:
        lines.append((f"and {len(more)} more such", clock(sum(guess.preparations[one.key] for one in more))))
    basis = (
        "guessed"
        if guess.pace is None
        else f"guessed, {guess.pace:.3g} times as long as dem check says, as the members that are done"
    )
    lines.append((f"in all, {basis}", f"{clock(whole)} of one core, {clock(whole / jobs)} on {jobs}"))
    header = (*(key.rpartition(".")[2] for key in keys), "state", "time", "file")
    show([Block(title, header, tuple(rows), left=len(header)), Block("Time", (), tuple(lines), left=2)], sys.stdout)
