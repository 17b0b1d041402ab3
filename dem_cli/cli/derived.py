"""What follows from a scenario before it is run: constants, time step, expected steps, size and time. For `dem check`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from dem_cli.scenario import Scenario, Settle, Shake
from dem_cli.scenario.restitution import restitution

# One core; a usual run with output, see the benchmark in README.
RATE_GRAIN_STEPS = 40e6
SERIES_COLUMNS = 46  # numbers of a row of /series, 8 bytes each
POROSITY = 0.18  # of a bed of discs that has fallen into place; for estimates only


@dataclass(frozen=True)
class StagePlan:
    """A stage before it is run: longest and expected time [s], expected steps, and what there is to tell of its record."""

    number: int
    kind: str
    name: str
    longest: float
    expected: float
    steps: int
    record: dict[str, Any] | None = None


@dataclass(frozen=True)
class Derived:
    """Derived numbers in SI units. `radius` and `mass` are (smallest, mean, largest)."""

    title: str
    hash: str
    grains: int
    radius: tuple[float, float, float]
    mass: tuple[float, float, float]
    total_mass: float
    vp: float
    vs: float
    kn: float
    ks: float
    hn: float
    hs: float
    restitution: float
    depth_expected: float
    overlap_expected: float
    time_step: float
    time_step_limit: float
    time_step_thesis: float
    stages: list[StagePlan]
    steps: int
    file_bytes: int
    run_seconds: float
    warnings: list[str]

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def derive(scenario: Scenario) -> Derived:
    """All derived numbers. ScenarioError if the given time step is beyond the stability limit."""
    from dem_cli.assembly import build_assembly
    from dem_cli.engines.explicit.timestep import choose_time_step, thesis_time_step

    assembly = build_assembly(scenario)
    radius, mass = assembly.grains.radius, assembly.grains.mass
    lightest = float(mass.min())
    kn, ks = scenario.stiffness
    hn, hs = scenario.contact.damping()
    dt, limit = choose_time_step(scenario, assembly)
    vp, vs = scenario.material.wave_speeds(scenario.grains.density, scenario.depth)
    stages = _plan(scenario, dt)
    steps = sum(stage.steps for stage in stages)
    depth, overlap = _under_own_weight(scenario, float(mass.sum()), float(radius.mean()), kn)
    return Derived(
        title=scenario.title,
        hash=scenario.hash,
        grains=len(radius),
        radius=(float(radius.min()), float(radius.mean()), float(radius.max())),
        mass=(lightest, float(mass.mean()), float(mass.max())),
        total_mass=float(mass.sum()),
        vp=vp,
        vs=vs,
        kn=kn,
        ks=ks,
        hn=hn,
        hs=hs,
        restitution=restitution(hn, scenario.contact.tension),
        depth_expected=depth,
        overlap_expected=overlap,
        time_step=dt,
        time_step_limit=limit,
        time_step_thesis=thesis_time_step(kn, lightest),
        stages=stages,
        steps=steps,
        file_bytes=file_bytes(scenario, len(radius), sum(stage.expected for stage in stages)),
        run_seconds=steps * len(radius) / RATE_GRAIN_STEPS,
        warnings=_warnings(scenario, overlap),
    )


def file_bytes(scenario: Scenario, grains: int, seconds: float) -> int:
    """Expected size of the result file.

    A frame: 67 bytes for each grain and each point where a grain touches a wall, 88 for each contact (results/vtkhdf.py), and 4 to
    number each grain; a settled bed of discs has 1.8 contacts a grain. A row of the series: 8 bytes for each of its quantities
    and surface bins. A record of tracks: 6 numbers a grain and the time.
    """
    output = scenario.output
    frame = grains * (67 + 4 + 88 * 1.8)
    row = 8 * (SERIES_COLUMNS + output.surface_bins + 1)
    size = (seconds / output.frames + len(scenario.stages) + 1) * frame + seconds / output.interval * row
    if output.tracks:
        size += seconds / output.tracks.interval * 8 * (6 * len(output.tracks.grains) + 1)
    return int(size) + 200_000  # names, attributes, empty tails of blocks


def _plan(scenario: Scenario, dt: float) -> list[StagePlan]:
    plans = []
    for number, stage in enumerate(scenario.stages, 1):
        expected = _settling_time(scenario, first=number == 1) if isinstance(stage, Settle) else stage.longest
        expected = min(expected, stage.longest)
        facts = stage.motion.facts() if isinstance(stage, Shake) and stage.motion else None
        plans.append(
            StagePlan(number, stage.kind, stage.name, stage.longest, expected, math.ceil(expected / dt), facts)
        )
    return plans


def _settling_time(scenario: Scenario, *, first: bool) -> float:
    """A guess [s]: the fall from the top of the starting grid and 0.4 s to come to rest; 0.2 s for a bed that lies already.

    Seen in the shipped scenarios: 0.3 s after the fall with 500 grains, 0.4 s with 3000; 0.2 s after shaking.
    """
    grid, gravity = scenario.packing.grid, scenario.container.gravity
    if not first or grid is None or gravity == 0.0:
        return 0.2
    return math.sqrt(2.0 * grid.rows(scenario.grain_count) * grid.row_spacing / gravity) + 0.4


def _under_own_weight(scenario: Scenario, mass: float, radius: float, kn: float) -> tuple[float, float]:
    """Expected fill depth [m], and overlap at the floor over the mean radius if every grain there carries its share."""
    solid = mass / (scenario.grains.density * scenario.depth)
    width = scenario.container.width
    force = mass * scenario.container.gravity * min(1.0, 2.0 * radius / width)
    return solid / (1.0 - POROSITY) / width, force / kn / radius


def _warnings(scenario: Scenario, overlap: float) -> list[str]:
    """What is allowed but seldom meant."""
    said = []
    if overlap > 0.01:
        said.append(
            f"grains at the floor will overlap by about {overlap:.1%} of their radius: the stiffness may be too low"
        )
    for number, stage in enumerate(scenario.stages, 1):
        if isinstance(stage, Shake):
            said += [f"stage {number} {words}" for words in _about_shaking(stage, scenario.output.interval)]
    if scenario.integration.integrator == "thesis" and max(scenario.contact.damping()) < 0.05:
        said.append('integrator = "thesis" gains energy, and there is little damping to take it away')
    return said


def _about_shaking(stage: Shake, interval: float) -> Iterator[str]:
    """What is odd about a shaking whose series has rows every `interval` [s]."""
    if (motion := stage.motion) is not None:
        for one in motion.components:
            if interval > 0.1 * one.predominant_period:
                yield (
                    f"shakes at a predominant period of {one.predominant_period:.3g} s ({one.name}), and output.interval "
                    "gives it less than ten rows"
                )
            if abs(one.residual_velocity) > 0.01 * one.peak_velocity:
                yield (
                    f"leaves the ground moving at {one.residual_velocity:.3g} m/s ({one.name}): "
                    'record.baseline = "mean" ends at rest'
                )
        return
    assert stage.frequency is not None
    if interval > 0.1 / stage.frequency:
        yield f"shakes at {stage.frequency:g} Hz, and output.interval gives it less than ten rows a period"
    if stage.amplitude and stage.longest * stage.frequency < 1.0:
        yield "ends before its first period is over"
