"""The lines of `dem check` on a scenario of the granular element method."""

from __future__ import annotations

from dem_cli.cli.check import clock, spread
from dem_cli.cli.derived_quasi_static import DerivedQuasiStatic, LoadPlan
from dem_cli.scenario import Compress, Cyclic, Load, QuasiStaticScenario, Shear
from dem_cli.units import human


def rows(scenario: QuasiStaticScenario, d: DerivedQuasiStatic) -> list[tuple[str, str]]:
    """Label and text of each line."""
    lines = [
        ("scenario", f"{d.title}  (hash {d.hash}, seed {scenario.seed})"),
        ("grains", f"{d.grains} discs, total mass {human(d.total_mass, 'kg')} at depth {human(scenario.depth, 'm')}"),
        ("  radius", f"{spread(d.radius, 'm')}  (smallest, mean, largest)"),
        ("  mass", spread(d.mass, "kg")),
        ("box", f"{human(d.width, 'm')} wide, {human(d.height, 'm')} high, void ratio {d.void_ratio:.4g}"),
        ("boundary", _boundary(scenario)),
    ]
    if d.packing_seconds:
        lines.append(("packing", f"{scenario.packing.method}: takes {clock(d.packing_seconds)}"))
    lines += [
        ("stiffness", f"kn {d.kn:.4e} N/m, ks {d.ks:.4e} N/m"),
        ("friction", f"{d.friction_angle:.4g} deg between grains, walls {_wall_friction(d)}"),
        ("cohesion", f"{human(d.cohesion, 'N')} a contact" if d.cohesion else "none"),
        (
            "gravity",
            f"{scenario.container.gravity:g} m/s^2, {human(d.floor_stress, 'Pa')} on the floor"
            if scenario.container.gravity
            else "none",
        ),
        (
            "solver",
            f"{d.method}, {d.sub_steps} sub-step{'s' if d.sub_steps > 1 else ''} an increment, forces in balance to {_accuracy(d)}",
        ),
    ]
    if d.overlap_expected is not None and d.largest_stress is not None:
        lines.append(
            (
                "  overlap",
                f"{d.overlap_expected:.1e} of a radius expected at {human(d.largest_stress, 'Pa')}, sigma d / kn",
            )
        )
    lines += [(f"stage {plan.number}", _stage(scenario, plan)) for plan in d.stages]
    return [
        *lines,
        ("expected", f"{d.increments} increments, result file {human(d.file_bytes, 'B', 2)}"),
        ("  run time", f"{clock(d.run_seconds)}  (one core; collapses take longer)"),
    ]


def _wall_friction(d: DerivedQuasiStatic) -> str:
    """The friction of the walls that there are."""
    there = {"walls": ("left", "right", "bottom", "top"), "membrane": ("bottom", "top"), "chain": ()}[d.boundary]
    angles = {side: d.wall_friction_angles[side] for side in there}
    if not any(angles.values()):
        return "smooth" if angles else "none"
    if len(set(angles.values())) == 1:
        return f"{angles['bottom']:.4g} deg"
    return ", ".join(f"{angle:.4g} deg {side}" for side, angle in angles.items())


def _accuracy(d: DerivedQuasiStatic) -> str:
    if d.accuracy is None:
        return "1e-5 of mean stress x mean diameter x depth"
    return human(d.accuracy, "N")


def _boundary(scenario: QuasiStaticScenario) -> str:
    boundary = scenario.boundary
    if boundary.kind == "walls":
        return "four rigid walls"
    size = f"radius {human(boundary.radius, 'm')}" if boundary.radius else "of the median radius"
    if boundary.kind == "chain":
        return f"a ring of grains, {size}, moved with the strain"
    stiffness = boundary.link_stiffness or 0.1 * scenario.stiffness[0]
    return f"membrane of grains left and right, {size}, links of {stiffness:.4g} N/m; rigid walls at bottom and top"


def _stage(scenario: QuasiStaticScenario, plan: LoadPlan) -> str:
    """What a stage does, and in how many increments."""
    stage = scenario.stages[plan.number - 1]
    title = plan.kind + (f' "{plan.name}"' if plan.name != plan.kind else "")
    if plan.branch:
        title += f' from the end of "{plan.branch}"'
    about = "about " if isinstance(stage, Cyclic) and not stage.limit.strain else ""
    return f"{title}: {_words(stage)}, {about}{plan.increments} increments"


def _words(stage: Compress | Shear | Load | Cyclic) -> str:
    if isinstance(stage, Compress):
        return f"to {human(stage.stress, 'Pa')} in {len(stage.levels)} levels"
    if isinstance(stage, Load):
        ends = []
        for name, target in (("x", stage.x), ("y", stage.y)):
            end = f"a strain of {target.strain:g}" if target.stress is None else human(target.stress, "Pa")
            ends.append(f"{name} to {end}")
        return ", ".join(ends)
    held = f"{stage.hold.replace('-', ' ')} held"
    if isinstance(stage, Shear):
        return f"to a shear strain of {stage.shear_strain:g} along {stage.axial}, {held}"
    limit = stage.limit
    if limit.stress is not None:
        ends_at = f"q = {human(limit.stress, 'Pa')}"
    elif limit.stress_ratio is not None:
        ends_at = f"q = {limit.stress_ratio:g} of the mean stress"
    else:
        ends_at = f"a shear strain of {limit.strain:g}"
    return f"{stage.cycles} cycles between limits of {ends_at}, {held}"
