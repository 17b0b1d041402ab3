"""The scenario of the granular element method: quasi-static tests on discs. All values are SI once it is built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Literal

from dem_cli.scenario.base import DiscScenario, grid_fits, largest_fits
from dem_cli.scenario.loads import LOADS, Compress, Cyclic, Load, Loading, QuasiStaticStage, Shear
from dem_cli.scenario.quasi_static_tables import (
    EXPLICIT,
    Boundary,
    QuasiStaticContact,
    QuasiStaticContainer,
    QuasiStaticOutput,
    Solver,
)
from dem_cli.scenario.stored_grains import is_result_file
from dem_cli.scenario.table import Given, Mistake, Table, did_you_mean, key


class QuasiStaticScenario(DiscScenario):
    """A scenario of the granular element method, complete and consistent: every default filled in, every rule checked."""

    engine: Literal["granular-element"] = key(
        doc="quasi-static tests by the granular element method, Kishino 1988", example="granular-element"
    )
    contact: QuasiStaticContact = key(doc="the law of contacts")
    container: QuasiStaticContainer = key({}, doc="the box at the start, and gravity")
    stages: tuple[Loading, ...] = key(alias="stage", doc="what is done, in sequence: one [[stage]] table each")
    boundary: Boundary = key({}, "what encloses the sample")
    solver: Solver = key({}, "how equilibrium is found", example="kishino")
    output: QuasiStaticOutput = key({}, "what is written")

    stage_kinds: ClassVar[Mapping[str, type[Table]]] = LOADS
    elsewhere: ClassVar = {
        "plane": ("impulse", "Leave it out; [boundary] says what encloses the sample"),
        "terrain": ("impulse", "Leave it out; [boundary] says what encloses the sample"),
        "integration": (EXPLICIT, "Leave it out; how equilibrium is found is said in [solver]"),
        **{
            f"kind={kind}": (EXPLICIT, f'Write engine = "{EXPLICIT}", or one of {", ".join(LOADS)}')
            for kind in ("settle", "shake", "run")
        },
    }

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from super().rules(given)
        good = given.good
        grains, packing, container = (good.get(name) for name in ("grains", "packing", "container"))
        if grains and grains.shape != "disc":
            rule = 'is not for engine = "granular-element", which moves discs'
            yield Mistake(("grains", "shape"), rule, f'Write shape = "disc", or engine = "{EXPLICIT}"')
            return
        width = container.width if container else None
        if packing and packing.grid:
            yield from grid_fits(grains, packing, width)
        elif packing and grains and grains.radius and width is not None:
            yield from largest_fits(grains, width)
        stages = good.get("stages")
        if stages:
            yield from _branches(stages)
            if packing and not is_result_file(packing.file or ""):
                yield from unprepared(stages)
        boundary = good.get("boundary")
        if stages and boundary and boundary.kind == "membrane":
            yield from _for_membrane(stages)

    @property
    def planned(self) -> int:
        """Increments to expect, of all stages."""
        return sum(stage.planned for stage in self.stages)

    def goes_on_from(self, number: int) -> int | None:
        """Stage (0-based) from whose end stage `number` (0-based) goes on; None for the packing."""
        return goes_on_from(self.stages, number)


def goes_on_from(stages: Sequence[Any], number: int) -> int | None:
    """Index of the stage from whose end stage `number` goes on; None for the start, or a branch that names none."""
    branch = stages[number].branch
    if branch is None:
        return number - 1 if number else None
    earlier = [k for k in range(number) if stages[k].name == branch]
    return earlier[-1] if earlier else None


def _branches(stages: Sequence[QuasiStaticStage]) -> Iterator[Mistake]:
    """Each `from` names one earlier stage."""
    for number, stage in enumerate(stages):
        branch, earlier = stage.branch, [one.name for one in stages[:number]]
        if branch is None or earlier.count(branch) == 1:
            continue
        if branch in earlier:
            remedy = "Give each of them a name of its own"
            yield Mistake(("stage", number, "from"), "names several earlier stages", remedy)
            continue
        remedy = did_you_mean(branch, list(dict.fromkeys(earlier))) if earlier else "Leave it out"
        yield Mistake(("stage", number, "from"), "names no earlier stage", remedy)


def unprepared(stages: Sequence[QuasiStaticStage]) -> Iterator[Mistake]:
    """Stages that hold a stress, or the volume, of a sample that nothing has compressed."""
    prepared: list[bool] = []
    for number, stage in enumerate(stages):
        before = goes_on_from(stages, number)
        astray = stage.branch is not None and before is None  # a mistake of its own
        ready = astray or (before is not None and prepared[before])
        if isinstance(stage, Shear | Cyclic) and not ready and stage.hold != "lateral-strain":
            rule = "nothing has compressed the sample before: there is no stress to hold"
            if isinstance(stage, Cyclic) or stage.hold == "volume":
                rule = "nothing has compressed the sample before: there is no stress to begin with"
            remedy = 'Put a stage before it: kind = "compress" with a stress'
            yield Mistake(("stage", number, "hold"), rule, remedy)
            ready = True  # said once
        prepared.append(ready or isinstance(stage, Compress | Load | Shear | Cyclic))


def _for_membrane(stages: Sequence[QuasiStaticStage]) -> Iterator[Mistake]:
    """A membrane gives its pressure on the sides, and nothing else."""
    instead = 'Take boundary.kind = "walls" or "chain"'
    for number, stage in enumerate(stages):
        if isinstance(stage, Shear | Cyclic):
            if stage.axial == "x":
                rule = "contradicts boundary.kind = membrane, which has its pressure across x"
                yield Mistake(("stage", number, "axial"), rule, f'Write axial = "y", or t{instead[1:]}')
            if stage.hold != "lateral-stress":
                rule = "contradicts boundary.kind = membrane, which holds its pressure on the sides and nothing else"
                yield Mistake(("stage", number, "hold"), rule, f'Write hold = "lateral-stress", or t{instead[1:]}')
        elif isinstance(stage, Load) and stage.x.strain is not None:
            rule = "contradicts boundary.kind = membrane, which gives a pressure and holds no strain"
            yield Mistake(("stage", number, "x", "strain"), rule, f"Give x a stress, or t{instead[1:]}")
