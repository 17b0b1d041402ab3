"""`dem check`: validates a scenario and prints what follows from it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dem_cli.units import human

if TYPE_CHECKING:
    from dem_cli.cli.derived import Derived
    from dem_cli.cli.derived_impulse import DerivedImpulse
    from dem_cli.cli.derived_quasi_static import DerivedQuasiStatic
    from dem_cli.scenario import EngineScenario, Scenario


@click.command(name="check", short_help="Check a scenario; print derived constants, time step, run time.")
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a key, e.g. grains.count=500.")
@click.option("--json", "as_json", is_flag=True, help="Print the derived numbers as JSON, in SI units.")
@click.option("--resolved", is_flag=True, help="Print the scenario with all defaults, in SI units, as TOML.")
def command(scenario: Path, overrides: tuple[str, ...], as_json: bool, resolved: bool) -> None:
    """Check SCENARIO without running it.

    Prints all mistakes, or what follows from the scenario: sizes and masses, stiffness and wave speeds, the time step beside its
    stability limit and the thesis' rule, and the steps, file size and run time to expect. Of quasi-static tests: the box and its void
    ratio, accuracy in force, expected overlap, and the increments of each stage. Of rigid bodies: sizes, masses and what contacts are found
    with, the pairs of materials, the time step and its rule.
    """
    from dem_cli.scenario import load_scenario

    loaded = load_scenario(scenario, overrides)
    if resolved:
        click.echo(loaded.resolved_toml(), nl=False)
        return
    derived, lines = derive_any(loaded)
    if as_json:
        import json

        click.echo(json.dumps(derived.as_dict(), indent=2, ensure_ascii=False))
        return
    if loaded.sweep:
        lines.append(("sweep", f"{loaded.sweep.count:,} members: dem sweep {scenario} --dry-run lists them"))
    for label, text in lines:
        click.echo(f"{label:<18}{text}".rstrip())
    for warning in derived.warnings:
        click.echo(f"warning: {warning}", err=True)


def derive_any(
    scenario: EngineScenario,
) -> tuple[Derived | DerivedQuasiStatic | DerivedImpulse, list[tuple[str, str]]]:
    """What follows from a scenario, and the lines that say it, by its engine."""
    from dem_cli.scenario import ImpulseScenario, Scenario

    if isinstance(scenario, ImpulseScenario):
        from dem_cli.cli.check_impulse import rows as impulse_rows
        from dem_cli.cli.derived_impulse import derive_impulse

        bodies = derive_impulse(scenario)
        return bodies, impulse_rows(scenario, bodies)
    if isinstance(scenario, Scenario):
        from dem_cli.cli.derived import derive

        derived = derive(scenario)
        return derived, rows(scenario, derived)
    from dem_cli.cli.check_quasi_static import rows as quasi_static_rows
    from dem_cli.cli.derived_quasi_static import derive_quasi_static

    found = derive_quasi_static(scenario)
    return found, quasi_static_rows(scenario, found)


def rows(scenario: Scenario, d: Derived) -> list[tuple[str, str]]:
    """Label and text of each line."""
    from dem_cli.cli.derived import RATE_GRAIN_STEPS

    walls = scenario.contact.wall_friction
    by_rule = scenario.integration.time_step == "auto"
    chosen = (
        f"{scenario.integration.safety:g} of the limit"
        if by_rule
        else f"given, {d.time_step / d.time_step_limit:.2f} of the limit"
    )
    lines = [
        ("scenario", f"{d.title}  (hash {d.hash}, seed {scenario.seed})"),
        *grain_rows(scenario, d),
        (
            "  expected fill",
            f"depth {human(d.depth_expected, 'm')}, overlap at the floor {d.overlap_expected:.1e} of a radius",
        ),
        *packing_rows(scenario, d),
        ("wave speeds", f"Vp {d.vp:.2f} m/s, Vs {d.vs:.2f} m/s"),
        ("stiffness", f"kn {d.kn:.4e} N/m, ks {d.ks:.4e} N/m"),
        (
            "damping",
            f"hn {d.hn:.4g}, hs {d.hs:.4g}, restitution {d.restitution:.4g} (tension: {scenario.contact.tension})",
        ),
        (
            "friction",
            f"grains {scenario.contact.friction:g}, walls {walls.left:g} left, {walls.right:g} right, {walls.bottom:g} floor",
        ),
        ("time step", f"{d.time_step:.4e} s  ({chosen})"),
        ("  limit", f"{d.time_step_limit:.4e} s  (stability, dashpots and contacts included)"),
        ("  thesis' rule", f"{d.time_step_thesis:.4e} s  (an eighth of the natural period of the lightest grain)"),
    ]
    for stage in d.stages:
        title = f"{stage.kind}" + (f' "{stage.name}"' if stage.name != stage.kind else "")
        time = human(stage.longest, "s")
        time = f"about {human(stage.expected, 's', 2)}, at most {time}" if stage.kind == "settle" else time
        lines.append((f"stage {stage.number}", f"{title}: {time}, {counted(stage.steps)} steps"))
        lines += about_record(stage.record) if stage.record else []
    return [
        *lines,
        ("expected", f"{counted(d.steps)} steps, result file {human(d.file_bytes, 'B', 2)}"),
        (
            "  run time",
            f"{clock(d.run_seconds)} at {RATE_GRAIN_STEPS[d.shape] / 1e6:.0f} million grain-steps per second (one core)",
        ),
    ]


def packing_rows(scenario: Scenario, d: Derived) -> list[tuple[str, str]]:
    """Label and text of the line on the packing, where it takes some doing."""
    packing = scenario.packing
    if not packing.random:
        return []
    filled = "as dense as it gets"
    if d.packing_height is not None:
        solid = d.total_mass / (scenario.grains.density * scenario.depth)
        void_ratio = scenario.container.width * d.packing_height / solid - 1.0
        filled = f"void ratio {void_ratio:.4g} over a height of {human(d.packing_height, 'm')}"
    return [("packing", f"{packing.method}: {filled}, takes {clock(d.packing_seconds)}")]


def grain_rows(scenario: Scenario, d: Derived) -> list[tuple[str, str]]:
    """Label and text of the lines on grains, as their shape needs them."""
    counts = {"disc": f"{d.grains} discs", "ellipse": f"{d.grains} ellipses"}
    words = {"bonded": "bonded grains", "clump": "rigid clumps"}
    count = counts.get(d.shape) or f"{d.grains} {words[d.shape]} of {d.elements // d.grains} discs, {d.elements} in all"
    lines = [
        ("grains", f"{count}, total mass {human(d.total_mass, 'kg')} at depth {human(scenario.depth, 'm')}"),
        (
            "  radius",
            f"{spread(d.radius, 'm')}  (smallest, mean, largest{', of the discs' if d.template_area else ''})",
        ),
    ]
    if d.semi_major and d.semi_minor:
        lines += [("  semi-axis a", spread(d.semi_major, "m")), ("  semi-axis b", spread(d.semi_minor, "m"))]
    if d.template_area:
        areas = ", ".join(f"{1e4 * area:.4g}" for area in d.area)
        times = d.template_area / math.pi
        lines.append(("  area", f"{areas} cm^2  (of whole grains: {times:.4g} pi r^2, r the radius of [grains])"))
    lines.append(("  mass", spread(d.mass, "kg") + ("  (of whole grains)" if d.template_area else "")))
    if d.bond_normal and d.bond_tangential and d.bond_rolling and d.bond_lambda:
        rolling = (
            scientific(d.bond_rolling, "N m s") if scenario.grains.bond and scenario.grains.bond.rolling else "free"
        )
        lines += [
            ("bonds", f"{d.bonds}: normal {scientific(d.bond_normal, 'N s/m')}"),
            ("  tangential", scientific(d.bond_tangential, "N s/m")),
            ("  rolling", rolling),
            (
                "  lambda",
                f"C dt/m_eff from {d.bond_lambda[0]:.3g} to {d.bond_lambda[2]:.3g}  (implicit: any is stable)",
            ),
            ("  expected creep", f"{d.bond_creep:.1e} of a radius under the weight of the bed"),
        ]
    return lines


def about_record(motion: dict[str, Any]) -> list[tuple[str, str]]:
    """Lines about the recorded motion of a stage."""
    from dem_cli.scenario.record_formats import FORMATS

    def left(one: dict[str, Any], when: str) -> str:
        """Velocity and displacement at the end; what is rounding alone is zero."""
        pair = []
        for what, unit in (("velocity", "cm/s"), ("displacement", "cm")):
            value = one[f"residual_{what}{when}"]
            value = 0.0 if abs(value) < 1e-9 * one[f"peak_{what}"] else value
            pair.append(f"{100.0 * value:.3g} {unit}")
        return " and ".join(pair)

    lines = []
    for label, one in zip(("  record", "  second"), motion["components"], strict=False):
        name = f"{one['name']} ({one['component']})" if one["component"] else one["name"]
        period, within = one["predominant_period"], one["significant_duration"]
        lines += [
            (label, f"{name}, {FORMATS[one['format']]}: {one['understood']}"),
            (
                "    peak",
                f"{100.0 * one['recorded_peak']:.4g} gal recorded; {100.0 * one['peak']:.4g} gal, "
                f"{100.0 * one['peak_velocity']:.3g} cm/s, {100.0 * one['peak_displacement']:.3g} cm used",
            ),
            (
                "    at the end",
                f"{left(one, '_before')} as recorded; {left(one, '')} used (baseline: {motion['baseline']})",
            ),
            (
                "    period",
                "none, nothing moves"
                if period is None
                else f"{human(period, 's', 3)} predominant; Arias intensity {one['arias']:.3g} m/s, "
                f"{human(within, 's', 3)} from 5 to 95 % of it",
            ),
        ]
    return lines


def scientific(values: tuple[float, float, float], unit: str) -> str:
    """Smallest and largest with exponents."""
    return f"{values[0]:.3e} {unit}" if values[0] == values[2] else f"from {values[0]:.3e} to {values[2]:.3e} {unit}"


def counted(number: int) -> str:
    """A large number to two digits, in groups of three: 350 000."""
    step = 10 ** max(0, len(str(number)) - 2)
    return f"{round(number / step) * step:,}".replace(",", " ")


def spread(values: tuple[float, float, float], unit: str) -> str:
    return ", ".join(human(value, unit) for value in values)


def clock(seconds: float) -> str:
    """A time to wait in words: 40 s, 3 min, 2.5 h."""
    if seconds < 100:
        return f"about {max(1, round(seconds))} s"
    return f"about {seconds / 60:.0f} min" if seconds < 7200 else f"about {seconds / 3600:.1f} h"
