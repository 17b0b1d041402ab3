"""What follows from a scenario of the granular element method before it is run. For `dem check`."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from dem_cli.assembly import Assembly, build_loose
from dem_cli.cli.derived import Spread, packing_seconds, spread_of
from dem_cli.results.schema import DISSIPATION, INCREMENTS, RANKS
from dem_cli.scenario import Compress, Cyclic, Load, QuasiStaticScenario, Shear
from dem_cli.scenario.loads import QuasiStaticStage

# Of 122 discs, collapses included: measured on biaxial-kishino (momentum) and on its first 20 increments (kishino, whose increment is
# one sub-step). It grows with the number of discs to the power below, measured between 122 and 1000 before any collapse.
SECONDS_PER_SUB_STEP = {"momentum": 24e-3, "kishino": 85e-3}
GROWTH = 1.15
ACCURACY = 1e-5  # of mean stress x mean diameter x depth, where no accuracy is given
CONTACTS = 2.0  # a disc, with the walls
LARGE_OVERLAP = 0.01  # of a radius


@dataclass(frozen=True)
class LoadPlan:
    """A stage before it is run. branch: name of the stage from whose end it goes on, None for the one before it.

    stresses [Pa]: those that it names, across x and y. moved: how far neighbours move in a sub-step, over the overlap expected at the
    last stress before it; None without either.
    """

    number: int
    kind: str
    name: str
    branch: str | None
    increments: int
    stresses: tuple[float | None, float | None]
    moved: float | None


@dataclass(frozen=True)
class DerivedQuasiStatic:
    """Derived numbers in SI units, angles in degrees; a spread is (smallest, mean, largest).

    accuracy [N]: fixing force that counts as none, None until a stress is known. first_stress, largest_stress: of those that stages name.
    overlap_expected: at the largest stress, over the mean radius: sigma d / (kn depth). floor_stress: of the weight of the sample, on the floor.
    """

    title: str
    hash: str
    engine: str
    grains: int
    radius: Spread
    mass: Spread
    total_mass: float
    kn: float
    ks: float
    friction_angle: float
    wall_friction_angles: dict[str, float]
    cohesion: float
    width: float
    height: float
    void_ratio: float
    boundary: str
    method: str
    sub_steps: int
    first_stress: float | None
    largest_stress: float | None
    accuracy: float | None
    overlap_expected: float | None
    floor_stress: float
    packing_seconds: float
    stages: list[LoadPlan]
    increments: int
    file_bytes: int
    run_seconds: float
    warnings: list[str]

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def derive_quasi_static(scenario: QuasiStaticScenario) -> DerivedQuasiStatic:
    """All derived numbers. ScenarioError if the packing's file cannot be read."""
    assembly = build_loose(scenario)
    grains, walls = assembly.grains, assembly.walls
    width, height = float(walls.x1[1]), float(walls.y1[3])
    solid = float(grains.mass.sum()) / (scenario.grains.density * scenario.depth)
    diameter = 2.0 * float(grains.radius.mean())
    kn, ks = scenario.stiffness
    stages = _plans(scenario, diameter)
    named = [stress for stage in stages for stress in stage.stresses if stress is not None]
    accuracy = scenario.solver.accuracy
    if accuracy is None and named:
        accuracy = ACCURACY * named[0] * diameter * scenario.depth
    contact = scenario.contact
    sides = contact.wall_friction.model_dump()
    overlap = 2.0 * max(named) * scenario.depth / kn if named else None
    floor_stress = float(grains.mass.sum()) * scenario.container.gravity / (width * scenario.depth)
    sub_steps = scenario.solver.sub_steps * scenario.planned
    return DerivedQuasiStatic(
        title=scenario.title,
        hash=scenario.hash,
        engine=scenario.engine,
        grains=len(grains),
        radius=spread_of(grains.radius),
        mass=spread_of(grains.mass),
        total_mass=float(grains.mass.sum()),
        kn=kn,
        ks=ks,
        friction_angle=math.degrees(math.atan(contact.friction)),
        wall_friction_angles={side: math.degrees(math.atan(value)) for side, value in sides.items()},
        cohesion=contact.cohesion,
        width=width,
        height=height,
        void_ratio=width * height / solid - 1.0,
        boundary=scenario.boundary.kind,
        method=scenario.solver.method,
        sub_steps=scenario.solver.sub_steps,
        first_stress=named[0] if named else None,
        largest_stress=max(named) if named else None,
        accuracy=accuracy,
        overlap_expected=overlap,
        floor_stress=floor_stress,
        packing_seconds=packing_seconds(scenario, len(grains)),
        stages=stages,
        increments=scenario.planned,
        file_bytes=file_bytes(scenario, assembly),
        run_seconds=SECONDS_PER_SUB_STEP[scenario.solver.method] * (len(grains) / 122.0) ** GROWTH * sub_steps,
        warnings=_warnings(stages, overlap, floor_stress, named),
    )


def _named(stage: QuasiStaticStage) -> tuple[float | None, float | None]:
    """Stresses that a stage names, across x and y [Pa]."""
    if isinstance(stage, Compress):
        return stage.stress, stage.stress
    return (stage.x.stress, stage.y.stress) if isinstance(stage, Load) else (None, None)


def _plans(scenario: QuasiStaticScenario, diameter: float) -> list[LoadPlan]:
    plans: list[LoadPlan] = []
    known: list[float | None] = []  # the last stress named up to the end of each stage
    for k, stage in enumerate(scenario.stages):
        before = scenario.goes_on_from(k)
        stress = known[before] if before is not None else None
        moved = None
        if stress is not None and isinstance(stage, Shear | Cyclic):
            overlap = stress * diameter * scenario.depth / scenario.stiffness[0]
            moved = 0.5 * stage.increment / scenario.solver.sub_steps * diameter / overlap
        stresses = _named(stage)
        known.append(next((one for one in stresses[::-1] if one is not None), stress))
        plans.append(LoadPlan(k + 1, stage.kind, stage.name, stage.branch, stage.planned, stresses, moved))
    return plans


def file_bytes(scenario: QuasiStaticScenario, assembly: Assembly) -> int:
    """Expected size of the result file.

    A frame: 71 bytes a disc, 88 a contact (results/vtkhdf.py). An increment: 8 bytes for each quantity of the series, and each column and
    rank of the dissipation; 56 bytes for each grain that is followed.
    """
    output, grains = scenario.output, len(assembly.grains)
    row = 8 * (len(INCREMENTS) + RANKS * len(DISSIPATION))
    if output.tracks:
        row += 56 * len(output.tracks.grains)
    frames = scenario.planned / output.frames + 2 * len(scenario.stages)
    return int(frames * grains * (71 + 88 * CONTACTS) + scenario.planned * row) + 200_000


def _warnings(
    stages: list[LoadPlan],
    overlap: float | None,
    floor_stress: float,
    named: list[float],
) -> list[str]:
    """What is allowed but seldom meant."""
    said = []
    if overlap is not None and overlap > LARGE_OVERLAP:
        said.append(
            f"grains will overlap by about {overlap:.1%} of their radius at {max(named) / 1e3:.4g} kPa: the stiffness may be too low"
        )
    for plan in stages:
        if plan.moved is not None and plan.moved > 1.0:
            said.append(
                f"stage {plan.number} moves neighbours by about {plan.moved:.2g} overlaps in a sub-step: take smaller increments, "
                "or more sub-steps"
            )
    if named and floor_stress > named[0]:
        said.append(
            f"its weight presses the sample down with {floor_stress / 1e3:.4g} kPa, more than the first stress of {named[0] / 1e3:.4g} kPa"
        )
    return said
