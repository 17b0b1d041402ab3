"""The lines of `dem check` on a scenario of the impulse engine."""

from __future__ import annotations

from dataclasses import asdict

from dem_cli.cli.check import about_record, counted, spread
from dem_cli.cli.derived_impulse import DerivedImpulse, KindPlan
from dem_cli.engines.impulse.timestep import MOVED
from dem_cli.scenario import ImpulseScenario, ImpulseShake
from dem_cli.units import human

PAIRS = 12  # pairs of materials that are shown at most


def rows(scenario: ImpulseScenario, d: DerivedImpulse) -> list[tuple[str, str]]:
    """Label and text of each line."""
    plural = "bodies" if d.bodies > 1 else "body"
    lines = [
        ("scenario", f"{d.title}  (hash {d.hash}, seed {scenario.seed})"),
        ("bodies", f"{d.bodies} {plural}, total mass {human(d.total_mass, 'kg')}"),
    ]
    for kind in d.kinds:
        lines += [
            (f"  {kind.name}"[:17], f"{kind.bodies} x {_shape(kind)}, material {kind.material}"),
            ("    size", f"radius of the bounding sphere {_sizes(kind.size, 'm')}"),
            ("    mass", _sizes(kind.mass, "kg")),
            ("    inertia", f"{', '.join(f'{one:.5g}' for one in kind.inertia)} kg m^2  (principal, of scale 1)"),
        ]
    lines += [("", note) for note in d.notes]
    fixed = [*d.planes, *([f"{d.terrain} ({d.terrain_triangles} triangles)"] if d.terrain else [])]
    lines.append(("fixed", ", ".join(fixed) or "nothing"))
    lines += _pairs(d)
    auto = scenario.integration.time_step == "auto"
    chosen = "by rule" if auto else f"given, {d.time_step / d.time_step_rule:.3g} of the rule"
    lines += [
        ("time step", f"{d.time_step:.4e} s  ({chosen})"),
        ("  rule", f"{d.time_step_rule:.4e} s  ({_rule(d)})"),
        ("solver", _solver(scenario)),
    ]
    for plan, stage in zip(d.stages, scenario.stages, strict=True):
        title = plan.kind + (f' "{plan.name}"' if plan.name != plan.kind else "")
        most = "at most " if plan.kind == "settle" else ""
        lines.append(
            (f"stage {plan.number}", f"{title}: {most}{human(plan.longest, 's')}, {most}{counted(plan.steps)} steps")
        )
        if isinstance(stage, ImpulseShake) and stage.motion is not None:
            lines += about_record(
                {"baseline": stage.motion.baseline, "components": [asdict(one) for one in stage.motion.components]}
            )
    most = "at most " if any(plan.kind == "settle" for plan in d.stages) else ""
    return [*lines, ("expected", f"{most}{counted(d.steps)} steps, result file {most}{human(d.file_bytes, 'B', 2)}")]


def _shape(kind: KindPlan) -> str:
    """A shape, and what contacts are found with."""
    if kind.spheres:
        return "sphere" if kind.spheres == 1 else f"{kind.shape} of {kind.spheres} spheres"
    if kind.shape == "cloud":
        return f"cloud of {kind.points} points, {kind.trusted} with a trusted normal"
    points = f", {kind.points} points on faces" if kind.points else ""
    return f"{kind.shape} of {kind.corners} corners, {kind.triangles} triangles{points}"


def _rule(d: DerivedImpulse) -> str:
    """What the rule's time step follows from."""
    if d.time_step_bound != "motion":
        return d.time_step_bound
    return (
        f"no body moves by more than {MOVED:g} x {human(d.size_smallest, 'm')}, the smallest one's size, at {d.largest_speed:.4g} m/s, "
        f"after a fall of up to {human(d.fall_height, 'm')}"
    )


def _sizes(values: tuple[float, float, float], unit: str) -> str:
    """Smallest, mean and largest, or the one that all are but for rounding."""
    return (
        human(values[1], unit)
        if values[2] - values[0] <= 1e-9 * values[2]
        else f"{spread(values, unit)}  (smallest, mean, largest)"
    )


def _pairs(d: DerivedImpulse) -> list[tuple[str, str]]:
    """The law of all pairs of materials that may meet: in one line where they are alike."""
    names = range(len(d.materials))
    moving = {d.materials.index(kind.material) for kind in d.kinds if kind.bodies}
    law = {(i, j): (d.restitution[i][j], d.friction[i][j]) for i in names for j in names if i <= j and {i, j} & moving}
    if len(set(law.values())) == 1:
        e, mu = next(iter(law.values()))
        return [("contact", f"restitution {e:g}, friction {mu:.4g} of all pairs of {', '.join(d.materials)}")]
    lines = [
        (f"  {d.materials[i]} - {d.materials[j]}", f"restitution {e:g}, friction {mu:.4g}")
        for (i, j), (e, mu) in law.items()
    ]
    left = [("", f"... and {len(lines) - PAIRS} pairs more")] if len(lines) > PAIRS else []
    shown = [(label, text) if len(label) < 18 else ("", f"{label.strip()}: {text}") for label, text in lines[:PAIRS]]
    return [("contact", "pairs of materials"), *shown, *left]


def _solver(scenario: ImpulseScenario) -> str:
    solver = scenario.solver
    ends = f"ends at {solver.tolerance:g} m/s or {solver.sweeps} sweeps"
    return (
        ends.replace("ends", f"{solver.method}: ends")
        if solver.method == "pgs"
        else f"{solver.method}: {solver.quanta} quanta, {ends}"
    )
