"""What follows from a scenario of explicit DEM before it is run: constants, time step, expected steps, size and time. For `dem check`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dem_cli.scenario import DiscScenario, Scenario, Settle, Shake
from dem_cli.scenario.packing import USUAL
from dem_cli.scenario.restitution import restitution
from dem_cli.state import Floats

# Discs or ellipses times steps a second, by shape: one core; a usual run with output, see the benchmark in README.
RATE_GRAIN_STEPS = {"disc": 40e6, "ellipse": 12e6, "bonded": 24e6, "clump": 24e6}
SERIES_COLUMNS = 46  # numbers of a row of /series, 8 bytes each
# Seconds that a packing takes, a grain: discs, and by how much other shapes take longer. Measured with 500 and 3000 grains; a guess for others.
PACKING_SECONDS = {
    "falling": 1e-5,
    "rejection": 1e-5,
    "local-move": 2e-3,
    "growth": 1.5e-3,
    "insertion": 6e-4,
    "overlapping": 1e-6,
}
PACKING_FACTOR = {"disc": 1.0, "ellipse": 5.0, "bonded": 2.5, "clump": 2.5}
LOOSE_SETTLING, DENSE_SETTLING = 0.6, 0.3  # s, until packings are at rest that begin loose, or dense
POROSITY = 0.18  # of a bed that has fallen into place; for estimates only
Spread = tuple[float, float, float]  # smallest, mean, largest


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
    """Derived numbers in SI units, None where they do not belong to the shape; a spread is (smallest, mean, largest).

    `elements` are the discs and ellipses that grains are made of, `radius` is theirs; `area` and `mass` are those of whole grains.
    `template_area` is in units of `radius` squared. `bond_lambda` is C dt/m_eff of the normal viscosity; `bond_creep` how far bonds give in the
    expected time under the weight of the bed, over the mean radius.
    """

    title: str
    hash: str
    shape: str
    grains: int
    elements: int
    radius: Spread
    semi_major: Spread | None
    semi_minor: Spread | None
    template_area: float | None
    area: Spread
    mass: Spread
    total_mass: float
    bonds: int
    bond_normal: Spread | None
    bond_tangential: Spread | None
    bond_rolling: Spread | None
    bond_lambda: Spread | None
    bond_creep: float | None
    packing_height: float | None
    packing_seconds: float
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
    from dem_cli.assembly import build_loose
    from dem_cli.engines.explicit.timestep import choose_time_step, thesis_time_step

    assembly = build_loose(scenario)
    elements, bonds = assembly.grains, assembly.bonds
    radius, mass = elements.radius, np.bincount(elements.body, elements.mass).astype(float)
    lightest = float(elements.mass.min())
    kn, ks = scenario.stiffness
    hn, hs = scenario.contact.damping()
    dt, limit = choose_time_step(scenario, assembly)
    vp, vs = scenario.material.wave_speeds(scenario.grains.density, scenario.depth)
    stages = _plan(scenario, dt)
    steps = sum(stage.steps for stage in stages)
    seconds = sum(stage.expected for stage in stages)
    depth, force = _under_own_weight(scenario, float(mass.sum()), float(radius.mean()))
    overlap = force / kn / float(radius.mean())
    shape, template = scenario.grains.shape, scenario.grains.template
    creep = seconds * force / float(bonds.normal.min()) / float(radius.mean()) if len(bonds) else None
    reduced = elements.mass[bonds.i] * elements.mass[bonds.j] / (elements.mass[bonds.i] + elements.mass[bonds.j])
    return Derived(
        title=scenario.title,
        hash=scenario.hash,
        shape=shape,
        grains=len(mass),
        elements=len(elements),
        radius=spread_of(radius),
        semi_major=spread_of(elements.a) if shape == "ellipse" else None,
        semi_minor=spread_of(elements.b) if shape == "ellipse" else None,
        template_area=template.area * scenario.grains.scale**2 if template else None,
        area=spread_of(mass / (scenario.grains.density * scenario.depth)),
        mass=spread_of(mass),
        total_mass=float(mass.sum()),
        bonds=len(bonds),
        bond_normal=spread_of(bonds.normal) if len(bonds) else None,
        bond_tangential=spread_of(bonds.tangential) if len(bonds) else None,
        bond_rolling=spread_of(bonds.rolling) if len(bonds) else None,
        bond_lambda=spread_of(bonds.normal * dt / reduced) if len(bonds) else None,
        bond_creep=creep,
        packing_height=_packing_height(scenario, float(mass.sum())),
        packing_seconds=packing_seconds(scenario, len(mass)),
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
        file_bytes=file_bytes(scenario, len(elements), seconds),
        run_seconds=steps * len(elements) / RATE_GRAIN_STEPS[shape],
        warnings=_warnings(scenario, overlap, creep),
    )


def spread_of(values: Floats) -> Spread:
    """Smallest, mean and largest; the mean of equal values is exactly their value."""
    low, high = float(values.min()), float(values.max())
    return low, min(max(float(values.mean()), low), high), high


def file_bytes(scenario: Scenario, grains: int, seconds: float) -> int:
    """Expected size of the result file; grains: number of discs and ellipses.

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


def _packing_height(scenario: Scenario, mass: float) -> float | None:
    """Height [m] that the packing is to fill; None where a grid or file says where grains are, or it is as low as can be."""
    packing = scenario.packing
    if not packing.random or not (packing.height or packing.void_ratio or USUAL[packing.method]):
        return None
    return packing.region_height(scenario.container.width, mass / (scenario.grains.density * scenario.depth))


def packing_seconds(scenario: DiscScenario, grains: int) -> float:
    """Time that the packing itself takes [s], a guess."""
    if not scenario.packing.random:
        return 0.0
    return grains * PACKING_SECONDS[scenario.packing.method] * PACKING_FACTOR[scenario.grains.shape]


def _settling_time(scenario: Scenario, *, first: bool) -> float:
    """A guess [s]: the fall from the top of the starting grid and 0.4 s to come to rest; 0.2 s for a bed that lies already.

    Seen in the shipped scenarios: 0.3 s after the fall with 500 grains, 0.4 s with 3000; 0.2 s after shaking.
    """
    grid, gravity = scenario.packing.grid, scenario.container.gravity
    if first and gravity > 0.0 and scenario.packing.random:
        return LOOSE_SETTLING if scenario.packing.method in ("falling", "rejection") else DENSE_SETTLING
    if not first or grid is None or gravity == 0.0:
        return 0.2
    return math.sqrt(2.0 * grid.rows(scenario.grain_count) * grid.row_spacing / gravity) + 0.4


def _under_own_weight(scenario: Scenario, mass: float, radius: float) -> tuple[float, float]:
    """Expected fill depth [m], and force [N] on a disc or ellipse at the floor if every one there carries its share."""
    solid = mass / (scenario.grains.density * scenario.depth)
    width = scenario.container.width
    force = mass * scenario.container.gravity * min(1.0, 2.0 * radius / width)
    return solid / (1.0 - POROSITY) / width, force


def _warnings(scenario: Scenario, overlap: float, creep: float | None) -> list[str]:
    """What is allowed but seldom meant."""
    said = []
    if overlap > 0.01:
        said.append(
            f"grains at the floor will overlap by about {overlap:.1%} of their radius: the stiffness may be too low"
        )
    if creep is not None and creep > 0.01:
        said.append(
            f"bonds at the floor will give by about {creep:.1%} of a radius under the weight of the bed: raise their viscosities"
        )
    for number, stage in enumerate(scenario.stages, 1):
        if isinstance(stage, Shake):
            said += [f"stage {number} {words}" for words in about_shaking(stage, scenario.output.interval)]
    if scenario.integration.integrator == "thesis" and max(scenario.contact.damping()) < 0.05:
        said.append('integrator = "thesis" gains energy, and there is little damping to take it away')
    return said


def about_shaking(stage: Shake, interval: float) -> Iterator[str]:
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
