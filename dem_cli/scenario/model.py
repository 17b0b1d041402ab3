"""The scenario of the explicit engine: one typed, frozen model of the TOML file. All values are SI once it is built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Literal

from dem_cli.scenario.base import DiscScenario, grid_fits, largest_fits
from dem_cli.scenario.packing import Packing
from dem_cli.scenario.quantities import JsonSchema
from dem_cli.scenario.stages import STAGES, Stage
from dem_cli.scenario.stored_grains import RESULT_FILE
from dem_cli.scenario.table import Given, Mistake, Table, key
from dem_cli.scenario.tables import Contact, Container, Grains, Integration, Output

QUASI_STATIC, IMPULSE = "granular-element", "impulse"


class Scenario(DiscScenario):
    """A scenario of explicit DEM, complete and consistent: every default filled in, every rule checked."""

    engine: Literal["explicit"] = key(
        "explicit",
        'method of simulation: "explicit", explicit DEM; "granular-element", quasi-static tests by the granular element method; '
        '"impulse", rigid bodies in three dimensions moved by impulses',
        example="explicit",
    )
    contact: Contact = key(doc="the law of contacts")
    container: Container = key(doc="walls and gravity")
    stages: tuple[Stage, ...] = key(alias="stage", doc="what is done, in sequence: one [[stage]] table each")
    integration: Integration = key({}, "how time is stepped")
    output: Output = key({}, "what is written")

    stage_kinds: ClassVar[Mapping[str, type[Table]]] = STAGES
    elsewhere: ClassVar = {
        "boundary": (QUASI_STATIC, "Leave it out: this engine has walls"),
        "plane": (IMPULSE, "Leave it out: this engine has the walls of its container"),
        "terrain": (IMPULSE, "Leave it out: this engine has the walls of its container"),
        "solver": (QUASI_STATIC, "Leave it out; how this engine steps time is said in [integration]"),
        **{
            f"kind={kind}": (QUASI_STATIC, f'Write engine = "{QUASI_STATIC}", or one of {", ".join(STAGES)}')
            for kind in ("compress", "shear", "load", "cyclic")
        },
    }
    # The container's width may be left out where a result file gives it.
    more_schema: ClassVar[JsonSchema] = {
        "if": {"properties": {"packing": {"properties": {"file": {"pattern": RESULT_FILE}}, "required": ["file"]}}},
        "else": {"properties": {"container": {"required": ["width"]}}},
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        """Gives ellipses the default of `ellipse_test`, which other shapes do not have."""
        grains, contact = (raw.get(name) if isinstance(raw, dict) else None for name in ("grains", "contact"))
        if not isinstance(grains, dict) or not isinstance(contact, dict) or grains.get("shape") != "ellipse":
            return raw
        return raw | {"contact": {"ellipse_test": "exact"} | contact}

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        if tuple(path) == ("grains", "shape") and value != "ellipse":
            return [("contact", "ellipse_test")]
        return super().displaced(path, value)

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from super().rules(given)
        good = given.good
        grains, packing, container, contact = (good.get(name) for name in ("grains", "packing", "container", "contact"))
        if grains and contact and contact.ellipse_test and grains.shape != "ellipse":
            rule = f'is no key of shape = "{grains.shape}"'
            yield Mistake(("contact", "ellipse_test"), rule, 'Leave it out, or write shape = "ellipse"')
        if packing and packing.method == "overlapping":
            rule = f'belongs to engine = "{QUASI_STATIC}", which pushes overlapping grains apart'
            yield Mistake(("packing", "method"), rule, 'Write for example method = "growth"')
        elif packing and packing.grid and container:
            yield from grid_fits(grains, packing, container.width)
            if grains and grains.radius:
                yield from _grid_below_lid(grains, packing, container)
        elif packing and packing.random and grains and grains.radius and container:
            yield from _region_fits(grains, packing, container)


def _grid_below_lid(grains: Grains, packing: Packing, container: Container) -> Iterator[Mistake]:
    assert packing.grid is not None
    if container.lid and container.height and (count := grains.number):
        top = packing.grid.rows(count) * packing.grid.row_spacing
        if top > container.height * (1.0 + 1e-9):
            rule = f"is below the starting grid, which is {top:.6g} m high"
            yield Mistake(("container", "height"), rule, "Raise the lid, or take more columns")


def _region_fits(grains: Grains, packing: Packing, container: Container) -> Iterator[Mistake]:
    """The largest grain has room between the walls, and the height to be filled is below the lid."""
    yield from largest_fits(grains, container.width)
    if packing.height and container.lid and container.height and packing.height > container.height:
        rule = f"is above the lid, which is at {container.height:g} m"
        yield Mistake(("packing", "height"), rule, "Raise the lid, or take a smaller height")
