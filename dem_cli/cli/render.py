"""`dem render`: pictures from a result file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import click

from dem_cli.cli.finite import FiniteRange

AT_ONE_FRAME = ("sample", "scene", "rose", "force-distribution", "forces", "normals", "energy-normals")


@click.command(name="render", short_help="Draw a picture from a result file.")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE|SWEEP")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    metavar="PICTURE",
    help="PNG, SVG or PDF; GIF or MP4: an animation of the sample or scene [default: FILE-WHAT.png].",
)
@click.option(
    "--what",
    metavar="KIND",
    help="One of the kinds above [default: sample, of bodies in 3D scene].",
)
@click.option(
    "--time", type=float, metavar="T", help="Sample, rose, force-distribution, scene: the frame nearest to T seconds."
)
@click.option(
    "--frame",
    type=int,
    metavar="K",
    help="Sample, rose, scene, force-distribution, forces, normals: frame K from 0, or -1, -2, ... from the last.",
)
@click.option(
    "--increment",
    type=int,
    metavar="K",
    help="Shear tests: the frame nearest to increment K of the run, or of --stage.",
)
@click.option("--last", is_flag=True, help="Likewise: the last frame (of sample and rose the default).")
@click.option(
    "--stage", type=int, metavar="N", help="Only stage N, from 1 (0: whole run); sample, rose: its last frame."
)
@click.option(
    "--color", metavar="QUANTITY", help="Sample, scene: what grains are coloured by [default: displacement; kind]."
)
@click.option(
    "--chains/--no-chains",
    default=None,
    help="Sample, scene: lines as wide as the normal force [default: if grains are large enough; none].",
)
@click.option(
    "--bonds/--no-bonds",
    default=None,
    help="Sample: bars that join the discs of a grain [default: if grains are large enough].",
)
@click.option("--marks", is_flag=True, help="Sample: a radius of each disc, half the long axis of each ellipse.")
@click.option(
    "--range",
    "limits",
    metavar="LOW,HIGH",
    help="Sample, scene, surface: limits of the colours, SI units.",
)
@click.option("--view", metavar="AZIMUTH,ELEVATION", help="Scene: where it is seen from, degrees [default: -62,24].")
@click.option("--series", metavar="NAME,...", help="Series to draw; implies --what series.")
@click.option("--grains", metavar="ID,...", help="Histories, trajectories: only these tracked grains.")
@click.option(
    "--style",
    "look",
    type=click.Choice(["screen", "paper", "paper-wide"]),
    default="screen",
    show_default=True,
    help="Paper: for a column of 85 mm, or two of 170 mm; 8 pt, no titles, which are printed as a caption.",
)
@click.option(
    "--fps",
    type=FiniteRange(0.1, 60),
    help="Animation: frames of the file a second [default: as long as each lasts, 2 to 25; shear tests 10].",
)
@click.option(
    "--speed", type=FiniteRange(0, min_open=True), help="Animation: simulated seconds a second, in place of --fps."
)
@click.option(
    "--dpi", type=FiniteRange(20, 1200), help="Resolution [default: PNG 200, for paper 600; GIF 80, MP4 150]."
)
@click.option("--force", is_flag=True, help="Overwrite a picture that exists.")
def command(
    file: Path,
    output: Path | None,
    what: str | None,
    time: float | None,
    frame: int | None,
    increment: int | None,
    last: bool,
    stage: int | None,
    color: str | None,
    chains: bool | None,
    bonds: bool | None,
    marks: bool,
    limits: str | None,
    view: str | None,
    series: str | None,
    grains: str | None,
    look: str,
    fps: float | None,
    speed: float | None,
    dpi: float | None,
    force: bool,
) -> None:
    """Draw a picture, or an animation, from a result FILE, or a picture of a SWEEP, and print its name.

    \b
    sample              grains to scale, coloured by a quantity, with force chains
    rose                directions of the contacts between grains, and their fabric
    force-distribution  density of the normal force over its mean, and its exponential tail
    histories           displacement x, y and rotation of tracked grains
    trajectories        ways of tracked grains
    surface             free surface over place and time, and its antisymmetric mode
    spectrum            amplitude spectrum of the surface's modes, the driving frequency, and what
                        linear theory and the thesis give a liquid as deep
    energy              ledger of energy as stacked areas
    motion              acceleration, velocity and displacement of the container
    series              any quantity of /series over time, or over increments

    \b
    Of quasi-static shear tests (figures of Kishino 1988), beside sample, rose, force-distribution,
    histories, trajectories and series:
    stress-strain       stress ratio and volumetric strain over the shear strain; of closed pores
                        stress path and pore pressure too (7, 9)
    dilatancy           -de_v/d(e1 - e2) and the dilatancy angle over the shear strain
    forces              contact forces as rectangles at the start and the peak (6, 8, 10)
    normals             rose of contact normals in percent, start and peak (11)
    energy-normals      the same, weighted by elastic energy (12)
    coordination        principal values of the coordination tensor (13)
    energy-tensor       principal values of the tensor of elastic energy (14)
    dissipation         work, dissipation and elastic energy (15)
    largest-share       share of the contact that dissipates most in each increment (16)
    ranked              contacts ranked by their share in chosen increments (17)
    paper               all of them on a page

    \b
    Of bodies in 3D, beside energy, series, histories and trajectories (in plan and section):
    scene               bodies, planes and terrain, shaded
    check               velocity over time beside the closed form that [output] check names
    runout              how far bodies ran from where they started

    \b
    Of a SWEEP, its folder or sweep.toml:
    map                 change of the void ratio, or --color MEASURE (named as in dem report --json), over
                        two axes; over one axis curves (the default)
    resonance           the surface's motion over the driving period by T1
    shapes              shapes or scenarios side by side, before and after

    Shear tests show the first stage of shearing (stress-strain: all of them) unless --stage says otherwise; forces,
    normals and force-distribution show one frame with --increment, --frame or --last.

    With -o NAME.gif or NAME.mp4 sample and scene become an animation: all frames, or those of --stage, with the same
    axes and colours throughout.

    QUANTITY is radius, id, body, aspect, orientation, speed, spin, displacement, displacement_x,
    displacement_y, rotation, coordination, pressure, shear_stress, stress_xx, stress_yy or stress_xy;
    displacement and rotation count from the start of the frame's stage. Grains of several discs have one
    displacement, speed, aspect ratio and orientation, and the other quantities disc by disc; body only
    tells grains apart. Of scenes it is kind, id, speed, spin, kinetic, displacement, rotation, height, mass or
    coordination. Histories, trajectories, surface, spectrum and motion show the last stage of shaking unless --stage
    says otherwise.
    """
    # Imported here so that `dem --help` stays quick.
    from dem_cli.cli import of_sweep
    from dem_cli.errors import ScenarioError
    from dem_cli.report.figures import Picture, check_request, choose_frame, draw
    from dem_cli.report.kinds import kind_of
    from dem_cli.report.look import caption, check_target, save, style
    from dem_cli.report.movies import ENDINGS
    from dem_cli.results import open_results

    if of_sweep.asked_for([file]):
        context = click.get_current_context()
        source = click.core.ParameterSource.COMMANDLINE
        options = {name for name in context.params if context.get_parameter_source(name) is source}
        of_sweep.render(file, output, what, color, options, look, dpi, force)
        return
    if sum((time is not None, frame is not None, increment is not None, last)) > 1:
        raise ScenarioError("--time, --frame, --increment and --last exclude each other")
    three = kind_of([file]) == "bodies" if file.is_file() else False
    what = what or ("series" if series else "scene" if three else "sample")
    picture = Picture(
        what="scene" if three and what == "sample" else what,
        time=time,
        frame=-1 if last else frame,
        increment=increment,
        stage=stage,
        color=color,
        chains=chains,
        bonds=bonds,
        marks=marks,
        limits=_pair(limits) if limits else None,
        series=[name.strip() for name in series.split(",")] if series else None,
        grains=_whole(grains) if grains else None,
        view=_angles(view) if view else None,
    )
    check_request(picture)
    moment = frame is not None or last
    given = {
        "--time": time is not None,
        "--frame/--last": moment,
        "--increment": increment is not None,
        "--color": color,
        "--chains/--no-chains": chains is not None,
        "--bonds/--no-bonds": bonds is not None,
        "--marks": marks,
        "--series": series,
        "--grains": grains,
        "--range": limits,
        "--view": view,
    }
    _refuse_idle(picture.what, given)
    target = output or file.with_name(f"{file.stem}-{picture.what}.png")
    moving = target.suffix.lower() in ENDINGS
    if moving:
        _check_animation(
            target, picture.what, force, fps, speed, moment or time is not None or increment is not None, look
        )
    else:
        if fps or speed:
            raise ScenarioError(f"--fps and --speed are for animations: name a .gif or .mp4 with -o, not {target.name}")
        check_target(target, force, also=ENDINGS if picture.what in ("sample", "scene") else ())
    with open_results(file) as results:
        if not results.complete:
            click.echo(f"{file}: incomplete run; the picture shows what was written", err=True)
        with style(look):
            if moving:
                from dem_cli.report.animation import save_animation

                reel = save_animation(results, picture, target, dpi=dpi, fps=fps, speed=speed)
                click.echo(f"{len(reel.shown)} frames, {reel.seconds:.3g} s", err=True)
            else:
                figure = draw(results, picture)
                save(figure, target, dpi or (200.0 if look == "screen" else 600.0))
                if look != "screen":
                    click.echo(f"caption: {caption(figure)}", err=True)
        if increment is not None:
            shown = float(results.frame_times[choose_frame(results, picture)])
            asked = increment + (results.stages[stage - 1].start if stage else 0.0)
            if shown != asked:
                click.echo(f"nearest frame: increment {shown:g} of the run", err=True)
        if time is not None:
            shown = float(results.frame_times[choose_frame(results, picture)])
            if abs(shown - time) > 1e-9:
                click.echo(f"nearest frame: t = {shown:g} s", err=True)
    click.echo(str(target))


def _refuse_idle(what: str, given: Mapping[str, object]) -> None:
    """Raise ScenarioError for an option that this kind of picture would ignore."""
    from dem_cli.errors import ScenarioError

    kinds = {
        "--time": ("sample", "scene", "rose", "force-distribution"),
        "--frame/--last": AT_ONE_FRAME,
        "--increment": AT_ONE_FRAME,
        "--color": ("sample", "scene"),
        "--chains/--no-chains": ("sample", "scene"),
        "--bonds/--no-bonds": ("sample",),
        "--marks": ("sample",),
        "--series": ("series",),
        "--grains": ("histories", "trajectories"),
        "--range": ("sample", "scene", "surface"),
        "--view": ("scene",),
    }
    for option, value in given.items():
        names = (
            " and ".join((", ".join(kinds[option][:-1]), kinds[option][-1])) if kinds[option][1:] else kinds[option][0]
        )
        if value and what not in kinds[option]:
            raise ScenarioError(f"{option} has no meaning for --what {what}, only for {names}")


def _check_animation(
    target: Path, what: str, force: bool, fps: float | None, speed: float | None, moment: bool, look: str
) -> None:
    """Raise DemError for what can be no animation, or one that would be overwritten. moment: one frame is asked for."""
    from dem_cli.errors import ScenarioError
    from dem_cli.report.movies import GIF_FASTEST, check_target

    if what not in ("sample", "scene"):
        raise ScenarioError(
            f"{target}: --what {what} does not move, only sample and scene do; write .png, .svg or .pdf"
        )
    if moment:
        raise ScenarioError(
            "an animation shows all frames, or those of --stage; --time, --frame, --increment and --last choose one for a picture"
        )
    if fps and speed:
        raise ScenarioError("--fps and --speed exclude each other")
    if fps and fps > GIF_FASTEST and target.suffix.lower() == ".gif":
        raise ScenarioError(f"--fps {fps:g}: a GIF shows {GIF_FASTEST:g} frames a second at most; write .mp4")
    if look != "screen":
        raise ScenarioError(f"--style {look} is for pictures on a page, not for an animation")
    check_target(target, force)


def _angles(text: str) -> tuple[float, float]:
    from dem_cli.errors import ScenarioError

    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        raise ScenarioError(
            f'--view "{text}": write azimuth and elevation in degrees, for example --view -62,24'
        ) from None
    if not math.isfinite(azimuth):
        raise ScenarioError(f"--view {text}: the azimuth is a finite number of degrees")
    if not -90.0 <= elevation <= 90.0:
        raise ScenarioError(f"--view {text}: the elevation lies between -90 and 90 degrees")
    return azimuth, elevation


def _pair(text: str) -> tuple[float, float]:
    from dem_cli.errors import ScenarioError

    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise ScenarioError(f'--range "{text}": write two numbers, for example --range 0,0.05') from None
    if not (math.isfinite(low) and math.isfinite(high)):
        raise ScenarioError(f"--range {text}: both are finite numbers")
    return low, high


def _whole(text: str) -> list[int]:
    from dem_cli.errors import ScenarioError

    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise ScenarioError(f'--grains "{text}": write numbers of grains, for example --grains 12,40') from None
