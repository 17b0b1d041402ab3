"""The scenario: one typed, frozen model of the TOML file. All values are SI once it is built."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import PrivateAttr

from dem_cli.scenario.extent import largest_reach
from dem_cli.scenario.grain_file import GrainFile, read_grain_file
from dem_cli.scenario.packing import Packing
from dem_cli.scenario.quantities import Length, Whole
from dem_cli.scenario.stages import Stage
from dem_cli.scenario.stored_grains import is_result_file
from dem_cli.scenario.table import Given, Mistake, Table, key
from dem_cli.scenario.tables import Contact, Container, Grains, Integration, Material, Output


class Scenario(Table):
    """A scenario, complete and consistent: every default filled in, every rule checked."""

    title: str = key("untitled", "what the scenario shows, in a line", example="3000 discs shaken at 400 gal, 10 Hz")
    engine: Literal["explicit"] = key("explicit", "method of simulation: explicit DEM", example="explicit")
    seed: Annotated[int, Whole(ge=0)] = key(
        0, "seed of all random numbers; the same seed gives the same run", example=2010
    )
    depth: Length = key("1 m", "depth of the grains, which are cylinders, into the plane", example="1 m")
    grains: Grains = key(doc="the grains")
    material: Material = key(doc="stiffness of contacts")
    contact: Contact = key(doc="the law of contacts")
    container: Container = key(doc="walls and gravity")
    packing: Packing = key(doc="where the grains are at the start")
    stages: tuple[Stage, ...] = key(alias="stage", doc="what is done, in sequence: one [[stage]] table each")
    integration: Integration = key({}, "how time is stepped")
    output: Output = key({}, "what is written")

    _source: str = PrivateAttr(default="")
    _path: Path | None = PrivateAttr(default=None)
    _folder: Path = PrivateAttr(default=Path())

    short_form: ClassVar = None

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
        if tuple(path) != ("packing", "file"):
            return []
        given = ("radius", "count", *(("aspect_ratio", "orientation") if is_result_file(str(value)) else ()))
        return [("grains", name) for name in given]

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        if good.get("stages") == ():
            yield Mistake(("stage",), "is empty", 'Add at least one stage: [[stage]] with kind = "settle"')
        grains, packing, container = (good.get(name) for name in ("grains", "packing", "container"))
        if grains and packing:
            yield from _where_sizes_come_from(grains, packing)
        contact = good.get("contact")
        if grains and contact and contact.ellipse_test and grains.shape != "ellipse":
            rule = f'is no key of shape = "{grains.shape}"'
            yield Mistake(("contact", "ellipse_test"), rule, 'Leave it out, or write shape = "ellipse"')
        if packing and packing.grid and container:
            yield from _grid_fits(grains, packing, container)
        elif packing and packing.random and grains and grains.radius and container:
            yield from _region_fits(grains, packing, container)
        output = good.get("output")
        if grains and packing and output and output.tracks and not packing.file:
            yield from tracked_exist(output, _count(grains) * grains.elements)

    @property
    def source(self) -> str:
        """The TOML as the user wrote it."""
        return self._source

    @property
    def path(self) -> Path | None:
        """The scenario's file, if it came from one."""
        return self._path

    def grain_file(self) -> GrainFile:
        """The grains of `packing.file`, in metres. ScenarioError if there is none or it cannot be read."""
        packing = self.packing
        return read_grain_file(self._folder / (packing.file or ""), packing.file_unit, packing.stage)

    @property
    def grain_count(self) -> int:
        """Number of grains, wherever it is given; a grain of several discs is one."""
        return len(self.grain_file().x) if self.packing.file else _count(self.grains)

    @property
    def element_count(self) -> int:
        """Number of discs and ellipses that the grains are made of, which is what ids count."""
        return self.grain_count * self.grains.elements

    @property
    def stiffness(self) -> tuple[float, float]:
        """kn, ks [N/m] of a contact."""
        return self.material.stiffness(self.grains.density, self.depth)

    def to_dict(self) -> dict[str, Any]:
        """The resolved scenario as TOML data: all defaults, quantities as strings in SI units."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)

    def resolved_toml(self) -> str:
        """The scenario with every default and all values in SI; it loads back to an equal scenario, to the last bit."""
        import tomli_w

        return tomli_w.dumps(self.to_dict())

    @cached_property
    def hash(self) -> str:
        """16 hex digits that identify the run: the resolved scenario without its title, and what is in the files that it names."""
        import tomli_w

        content = {k: v for k, v in self.to_dict().items() if k != "title"}
        digest = hashlib.sha256(tomli_w.dumps(content).encode())
        for name in files_named(content):
            digest.update((self._folder / name).read_bytes())
        return digest.hexdigest()[:16]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(self.hash)


def files_named(raw: Mapping[str, Any]) -> list[str]:
    """Paths of the files that a scenario's TOML data name: grains and records, as far as they are well-formed; each once."""

    def table(value: Any) -> Mapping[str, Any]:
        return value if isinstance(value, Mapping) else {}

    named = [table(raw.get("packing")).get("file")]
    stages = raw.get("stage")
    for stage in stages if isinstance(stages, list) else []:
        record = table(stage).get("record")
        named += [record, table(record).get("file"), table(table(record).get("second")).get("file")]
    return list(dict.fromkeys(name for name in named if isinstance(name, str)))


def _count(grains: Grains) -> int:
    if grains.count is not None:
        return grains.count
    return len(grains.radius.sizes) if grains.radius and grains.radius.sizes else 0


def _where_sizes_come_from(grains: Grains, packing: Packing) -> Iterator[Mistake]:
    if packing.file:
        if grains.radius:
            yield Mistake(("grains", "radius"), "contradicts packing.file, which gives the radii", "Leave radius out")
        return
    if grains.shape == "ellipse" and not grains.aspect_ratio:
        yield Mistake(("grains", "aspect_ratio"), "is missing", "Add for example aspect_ratio = 2")
    if not grains.radius:
        yield Mistake(("grains", "radius"), "is missing", 'Add for example radius = { uniform = ["0.5 cm", "1 cm"] }')
    if not _count(grains):
        yield Mistake(("grains", "count"), "is missing", "Add for example count = 3000")


def _grid_fits(grains: Grains | None, packing: Packing, container: Container) -> Iterator[Mistake]:
    """The starting grid lies within the walls and keeps grains apart."""
    grid = packing.grid
    assert grid is not None
    needed = grid.columns * grid.spacing + grid.shift
    if needed > container.width * (1.0 + 1e-9):
        columns = int((container.width * (1.0 + 1e-9) - grid.shift) / grid.spacing)
        advice = f"at most {columns} columns" if columns >= 1 else "a smaller spacing"
        rule = f"is too narrow for the starting grid, {grid.columns} columns and the shift need {needed:.6g} m"
        yield Mistake(("container", "width"), rule, f"Widen it, or take {advice}")
    if not grains or not grains.radius:
        return
    across, high = (2.0 * reach for reach in largest_reach(grains))
    said = 'Widen the grid, so that grains start apart, or bound their orientation: { uniform = ["-30 deg", "30 deg"] }'
    remedy = "Widen the grid, so that grains start apart" if grains.shape == "disc" else said
    for name, needed in (("spacing", across), ("row_spacing", high)):
        if name == "row_spacing" and grid.row_spacing == grid.spacing and across > grid.spacing * (1.0 + 1e-9):
            continue  # said already
        if needed > getattr(grid, name) * (1.0 + 1e-9):
            sense = "high" if name == "row_spacing" and high != across else "across"
            rule = f"is smaller than the largest grain, which is {needed:.6g} m {sense}"
            yield Mistake(("packing", "grid", name), rule, remedy)
    if container.lid and container.height and (count := _count(grains)):
        top = grid.rows(count) * grid.row_spacing
        if top > container.height * (1.0 + 1e-9):
            rule = f"is below the starting grid, which is {top:.6g} m high"
            yield Mistake(("container", "height"), rule, "Raise the lid, or take more columns")


def _region_fits(grains: Grains, packing: Packing, container: Container) -> Iterator[Mistake]:
    """The largest grain has room between the walls, and the height to be filled is below the lid."""
    across = 2.0 * largest_reach(grains)[0]
    if across > container.width:
        rule = f"is narrower than the largest grain, which is up to {across:.6g} m across"
        yield Mistake(("container", "width"), rule, "Widen it")
    if packing.height and container.lid and container.height and packing.height > container.height:
        rule = f"is above the lid, which is at {container.height:g} m"
        yield Mistake(("packing", "height"), rule, "Raise the lid, or take a smaller height")


def tracked_exist(output: Output, count: int) -> Iterator[Mistake]:
    """The tracked ids are among the `count` discs and ellipses."""
    assert output.tracks is not None
    if count and (beyond := [k for k in output.tracks.grains if k >= count]):
        rule = f"names grain {beyond[0]}, but there are only {count} ids, which count from 0"
        yield Mistake(("output", "tracks", "grains"), rule, f"The last id is {count - 1}")
