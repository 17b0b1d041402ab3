"""What the scenarios of all engines share: keys, files, what identifies a run, and the rules of grains and packing."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import PrivateAttr

from dem_cli.scenario.extent import largest_reach
from dem_cli.scenario.grain_file import GrainFile, read_grain_file
from dem_cli.scenario.packing import Packing
from dem_cli.scenario.quantities import Length, Whole
from dem_cli.scenario.stored_grains import is_result_file
from dem_cli.scenario.sweep import Sweep
from dem_cli.scenario.table import Given, Mistake, Table, key
from dem_cli.scenario.tables import Followed, Grains, Material


class AnyScenario(Table):
    """A scenario of any engine, complete and consistent: every default filled in, every rule checked."""

    title: str = key("untitled", "what the scenario shows, in a line", example="3000 discs shaken at 400 gal, 10 Hz")
    engine: str = key(doc="method of simulation")
    seed: Annotated[int, Whole(ge=0)] = key(
        0, "seed of all random numbers; the same seed gives the same run", example=2010
    )

    _source: str = PrivateAttr(default="")
    _path: Path | None = PrivateAttr(default=None)
    _folder: Path = PrivateAttr(default=Path())
    _sweep: Sweep | None = PrivateAttr(default=None)

    # Stages of the engine, by kind.
    stage_kinds: ClassVar[Mapping[str, type[Table]]] = {}

    @classmethod
    def kinds(cls) -> list[str]:
        return list(cls.stage_kinds)

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        if given.good.get("stages") == ():
            yield Mistake(("stage",), "is empty", f'Add at least one stage: [[stage]] with kind = "{cls.kinds()[0]}"')

    @property
    def source(self) -> str:
        """The TOML as the user wrote it."""
        return self._source

    @property
    def path(self) -> Path | None:
        """The scenario's file, if it came from one."""
        return self._path

    @property
    def folder(self) -> Path:
        """Where the paths of files in the scenario start."""
        return self._folder

    @property
    def sweep(self) -> Sweep | None:
        """The file's table [sweep], which is no part of the run itself."""
        return self._sweep

    @property
    def origin(self) -> str:
        """What messages call the scenario: its file, if it came from one."""
        return str(self._path or "scenario")

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
        return isinstance(other, AnyScenario) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash(self.hash)


class DiscScenario(AnyScenario):
    """A scenario of grains in the plane: cylinders whose contacts have a stiffness."""

    depth: Length = key(
        "1 m", "depth of the grains, which are cylinders, into the plane (not with impulse)", example="1 m"
    )
    grains: Grains = key(doc="the grains")
    material: Material = key(doc="stiffness of contacts")
    contact: Table = key(doc="the law of contacts")
    container: Table = key(doc="walls and gravity")
    packing: Packing = key(doc="where the grains are at the start")
    stages: tuple[Any, ...] = key(alias="stage", doc="what is done, in sequence: one [[stage]] table each")

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        if tuple(path) != ("packing", "file"):
            return []
        given = ("radius", "count", *(("aspect_ratio", "orientation") if is_result_file(str(value)) else ()))
        return [("grains", name) for name in given]

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from super().rules(given)
        good = given.good
        grains, packing = good.get("grains"), good.get("packing")
        if grains and packing:
            yield from _where_sizes_come_from(grains, packing)
        output = good.get("output")
        if grains and packing and output and output.tracks and not packing.file:
            yield from tracked_exist(output.tracks, grains.number * grains.elements)

    def grain_file(self) -> GrainFile:
        """The grains of `packing.file`, in metres. ScenarioError if there is none or it cannot be read."""
        packing = self.packing
        return read_grain_file(self._folder / (packing.file or ""), packing.file_unit, packing.stage)

    @property
    def grain_count(self) -> int:
        """Number of grains, wherever it is given; a grain of several discs is one."""
        return len(self.grain_file().x) if self.packing.file else self.grains.number

    @property
    def element_count(self) -> int:
        """Number of discs and ellipses that the grains are made of, which is what ids count."""
        return self.grain_count * self.grains.elements

    @property
    def stiffness(self) -> tuple[float, float]:
        """kn, ks [N/m] of a contact."""
        return self.material.stiffness(self.grains.density, self.depth)


def files_named(raw: Mapping[str, Any]) -> list[str]:
    """Paths of the files that a scenario's TOML data name: grains, shapes, terrain and records, as far as they are well-formed; each once."""

    def table(value: Any) -> Mapping[str, Any]:
        return value if isinstance(value, Mapping) else {}

    named = [table(raw.get(name)).get("file") for name in ("packing", "grains", "terrain")]
    kinds = raw.get("grains")
    named += [table(kind).get("file") for kind in kinds] if isinstance(kinds, list) else []
    stages = raw.get("stage")
    for stage in stages if isinstance(stages, list) else []:
        record = table(stage).get("record")
        named += [record, table(record).get("file"), table(table(record).get("second")).get("file")]
    return list(dict.fromkeys(name for name in named if isinstance(name, str)))


def _where_sizes_come_from(grains: Grains, packing: Packing) -> Iterator[Mistake]:
    if packing.file:
        if grains.radius:
            yield Mistake(("grains", "radius"), "contradicts packing.file, which gives the radii", "Leave radius out")
        return
    if grains.shape == "ellipse" and not grains.aspect_ratio:
        yield Mistake(("grains", "aspect_ratio"), "is missing", "Add for example aspect_ratio = 2")
    if not grains.radius:
        yield Mistake(("grains", "radius"), "is missing", 'Add for example radius = { uniform = ["0.5 cm", "1 cm"] }')
    if not grains.number:
        yield Mistake(("grains", "count"), "is missing", "Add for example count = 3000")


def grid_fits(grains: Grains | None, packing: Packing, width: float | None) -> Iterator[Mistake]:
    """The starting grid lies within a container of this width [m] (None: it is made to fit) and keeps grains apart."""
    grid = packing.grid
    assert grid is not None
    needed = grid.columns * grid.spacing + grid.shift
    if width is not None and needed > width * (1.0 + 1e-9):
        columns = int((width * (1.0 + 1e-9) - grid.shift) / grid.spacing)
        advice = f"at most {columns} columns" if columns >= 1 else "a smaller spacing"
        rule = f"is too narrow for the starting grid, {grid.columns} columns and the shift need {needed:.6g} m"
        yield Mistake(("container", "width"), rule, f"Widen it, or take {advice}")
    if not grains or not grains.radius:
        return
    across, high = (2.0 * reach for reach in largest_reach(grains))
    said = 'Widen the grid, so that grains start apart, or bound their orientation: { uniform = ["-30 deg", "30 deg"] }'
    remedy = "Widen the grid, so that grains start apart" if grains.shape == "disc" else said
    for name, least in (("spacing", across), ("row_spacing", high)):
        if name == "row_spacing" and grid.row_spacing == grid.spacing and across > grid.spacing * (1.0 + 1e-9):
            continue  # said already
        if least > getattr(grid, name) * (1.0 + 1e-9):
            sense = "high" if name == "row_spacing" and high != across else "across"
            rule = f"is smaller than the largest grain, which is {least:.6g} m {sense}"
            yield Mistake(("packing", "grid", name), rule, remedy)


def largest_fits(grains: Grains, width: float) -> Iterator[Mistake]:
    """The largest grain has room between walls at this distance [m]."""
    across = 2.0 * largest_reach(grains)[0]
    if across > width:
        rule = f"is narrower than the largest grain, which is up to {across:.6g} m across"
        yield Mistake(("container", "width"), rule, "Widen it")


def tracked_exist(tracks: Followed, count: int) -> Iterator[Mistake]:
    """The tracked ids are among the `count` discs and ellipses."""
    if count and (beyond := [k for k in tracks.grains if k >= count]):
        rule = f"names grain {beyond[0]}, but there are only {count} ids, which count from 0"
        yield Mistake(("output", "tracks", "grains"), rule, f"The last id is {count - 1}")
