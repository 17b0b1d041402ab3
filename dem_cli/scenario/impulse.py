"""The scenario of the impulse engine: rigid bodies in three dimensions, z up. All values are SI once it is built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import GetJsonSchemaHandler, PrivateAttr
from pydantic_core import core_schema

from dem_cli.scenario.base import AnyScenario, tracked_exist
from dem_cli.scenario.impulse_bodies import BodyKind
from dem_cli.scenario.impulse_stages import IMPULSE_STAGES, ImpulseStage
from dem_cli.scenario.impulse_tables import (
    ImpulseContact,
    ImpulseContainer,
    ImpulseIntegration,
    ImpulseOutput,
    ImpulsePacking,
    ImpulseSolver,
    Plane,
    TerrainTable,
)
from dem_cli.scenario.quantities import JsonSchema
from dem_cli.scenario.stored_bodies import StoredBodies, read_stored_bodies
from dem_cli.scenario.table import Given, Mistake, Table, did_you_mean, key

EXPLICIT, QUASI_STATIC = "explicit", "granular-element"
WALLS = ("left", "right", "front", "back", "bottom", "top")


class _OneOrMany:
    """Annotation of a list of tables in JSON Schema: a single table may stand in its place."""

    def __get_pydantic_json_schema__(self, core: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        listed = handler(core)
        return {"anyOf": [listed["items"], listed]}


class ImpulseScenario(AnyScenario):
    """A scenario of the impulse engine, complete and consistent: every default filled in, every rule checked."""

    engine: Literal["impulse"] = key(doc="rigid bodies in three dimensions, moved by impulses", example="impulse")
    grains: Annotated[tuple[BodyKind, ...], _OneOrMany()] = key((), doc="the bodies, kind by kind")
    contact: ImpulseContact = key(doc="the law of contacts")
    container: ImpulseContainer = key({}, doc="walls and gravity")
    planes: Annotated[tuple[Plane, ...], _OneOrMany()] = key(
        (), alias="plane", doc="planes without end: one [[plane]] table each"
    )
    terrain: TerrainTable | None = key(None, doc="a fixed surface")
    packing: ImpulsePacking = key({}, doc="where bodies without position are at the start")
    stages: tuple[ImpulseStage, ...] = key(alias="stage", doc="what is done, in sequence: one [[stage]] table each")
    integration: ImpulseIntegration = key({}, "how time is stepped")
    solver: ImpulseSolver = key({}, "how impulses are found", example="energy-tracking")
    output: ImpulseOutput = key({}, "what is written")

    stage_kinds: ClassVar[Mapping[str, type[Table]]] = IMPULSE_STAGES
    elsewhere: ClassVar = {
        "depth": (EXPLICIT, "Leave it out: bodies are solids"),
        "material": (EXPLICIT, "Leave it out: bodies are rigid; density stands in [grains]"),
        "boundary": (QUASI_STATIC, "Leave it out; give [container] or [[plane]]"),
        **{
            f"kind={kind}": (QUASI_STATIC, f'Write engine = "{QUASI_STATIC}", or one of {", ".join(IMPULSE_STAGES)}')
            for kind in ("compress", "shear", "load", "cyclic")
        },
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        """Makes a list of a single [grains], and gives kinds and planes that have no name one of their own."""
        if not isinstance(raw, dict):
            return raw
        spelled = dict(raw)
        for table in ("grains", "plane"):
            if isinstance(raw.get(table), dict):
                spelled[table] = [raw[table]]
            if isinstance(spelled.get(table), list):
                names = names_in(table, spelled[table])
                spelled[table] = [
                    {"name": name, **one} if isinstance(one, dict) and name else one
                    for name, one in zip(names, spelled[table], strict=True)
                ]
        return spelled

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from super().rules(given)
        good = given.good
        kinds, planes, packing = good.get("grains"), good.get("planes"), good.get("packing")
        container = good.get("container")
        if kinds is not None and packing:
            yield from _bodies_are_there(given, kinds, packing)
        if kinds is not None:
            yield from _named_once("grains", [kind.name for kind in kinds])
        if planes is not None and container:
            walls = WALLS if container.width is not None else ()
            yield from _named_once("plane", [plane.name for plane in planes], walls)
        if packing and packing.method != "file" and kinds and container:
            yield from _room_to_pack(kinds, packing, container)
        everything = {"grains", "contact", "container", "planes", "terrain", "packing", "output"}
        if everything <= good.keys() and packing and packing.method != "file":
            scenario = cls.model_construct(**good)
            yield from _known_materials(scenario.contact, scenario.materials)
            yield from _of_output(scenario)

    @property
    def materials(self) -> tuple[str, ...]:
        """Names of materials, each once: of the kinds of bodies, the container's walls, planes and terrain."""
        named = [*self._stored.materials] if self._stored else []
        named += [kind.material for kind in self.grains]
        if self.container.width is not None:
            named.append(self.container.material)
        named += [plane.material for plane in self.planes]
        if self.terrain is not None:
            named.append(self.terrain.material)
        return tuple(dict.fromkeys(named))

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of gravity x, y, z [m/s^2]."""
        x, y, z = (self.container.gravity * part + 0.0 for part in self.container.gravity_direction)
        return x, y, z

    @property
    def grain_count(self) -> int:
        """Number of bodies, those of a packing's file included."""
        return (len(self._stored) if self._stored else 0) + sum(kind.count for kind in self.grains)

    @property
    def stored(self) -> StoredBodies | None:
        """The bodies of the packing's file, which come before those of [grains]; None without one."""
        return self._stored

    def read_packing(self) -> None:
        """Reads the packing's file, if there is one. ScenarioError if it cannot be used."""
        if self.packing.file is not None:
            self._stored = read_stored_bodies(self.path_of(self.packing.file), self.packing.stage)

    def rules_of_file(self) -> Iterator[Mistake]:
        """What holds between the bodies of a packing's file, once it is read, and the scenario."""
        assert self._stored is not None
        for number, kind in enumerate(self.grains):
            if kind.name in self._stored.groups:
                rule = "is the name of a kind of bodies of packing.file"
                yield Mistake(("grains", number, "name"), rule, "Give it another name")
        yield from _known_materials(self.contact, self.materials)
        yield from _of_output(self)

    # The bodies of the packing's file, once `read_packing` has been called: its path starts in the scenario's folder.
    _stored: StoredBodies | None = PrivateAttr(default=None)

    def path_of(self, name: str) -> Path:
        """Where a file is that the scenario names."""
        return self._folder / name


def names_in(table: str, listed: Sequence[Any]) -> list[str]:
    """The names of tables [[grains]] or [[plane]], by default their shape, or "plane 1"; empty where there is nothing to tell."""
    given = [one.get("name") if isinstance(one, dict) else None for one in listed]
    taken = {name for name in given if isinstance(name, str)}
    names = []
    for number, (one, said) in enumerate(zip(listed, given, strict=True), 1):
        name = said if isinstance(said, str) else ""
        if said is None and table == "plane" and isinstance(one, dict):
            name = f"plane {number}"
        elif said is None and isinstance(one, dict) and isinstance(shape := one.get("shape"), str):
            free = (shape if k == 1 else f"{shape} {k}" for k in range(1, len(listed) + len(taken) + 2))
            name = next(word for word in free if word not in taken)
        taken.add(name)
        names.append(name)
    return names


def _bodies_are_there(given: Given, kinds: Sequence[BodyKind], packing: ImpulsePacking) -> Iterator[Mistake]:
    """There is a body; a file gives all but those with a position."""
    if not kinds and packing.method != "file":
        said = "is missing" if "grains" not in given.raw else "is empty"
        yield Mistake(("grains",), said, 'Add the table [grains], or [packing] method = "file"')
    for number, kind in enumerate(kinds):
        if packing.method == "file" and kind.position is None:
            rule = 'is missing: with [packing] method = "file" the bodies without position are those of the file'
            yield Mistake(("grains", number, "position"), rule, "Add it, or leave this kind out")


def _named_once(table: str, names: Sequence[str], others: Sequence[str] = ()) -> Iterator[Mistake]:
    twice = [number for number, name in enumerate(names) if name in (*names[:number], *others)]
    for number in twice:
        whose = "a wall of the container" if names[number] in others else "one before it"
        yield Mistake((table, number, "name"), f"is the name of {whose}", "Give each a name of its own")


def _room_to_pack(kinds: Sequence[BodyKind], packing: ImpulsePacking, container: ImpulseContainer) -> Iterator[Mistake]:
    """There is somewhere to put bodies without position, and it lies in the container."""
    if packing.region and container.width is not None and container.breadth is not None:
        most = (container.width, container.breadth, container.height or float("inf"))
        for axis, end, low, high in zip("xyz", most, packing.region.low, packing.region.high, strict=True):
            if low < 0.0 or high > end * (1.0 + 1e-12):
                rule = f"reaches beyond the container, which goes from 0 m to {end:g} m along {axis}"
                yield Mistake(("packing", "region"), rule, "Make it smaller, or leave it out")
    if packing.region or container.width is not None or all(kind.position is not None for kind in kinds):
        return
    number = next(k for k, kind in enumerate(kinds) if kind.position is None)
    remedy = (
        "Add it, or say where the bodies are packed: container.width and breadth, or "
        'packing.region = { from = ["0 m", "0 m", "0 m"], to = ["1 m", "1 m", "2 m"] }'
    )
    yield Mistake(("grains", number, "position"), "is missing, and there is neither container nor region", remedy)


def _known_materials(contact: ImpulseContact, known: Sequence[str]) -> Iterator[Mistake]:
    for number, pair in enumerate(contact.pairs):
        for k, name in enumerate(pair.between):
            if name not in known:
                yield Mistake(
                    ("contact", "pairs", number, "between", k), "is no material here", did_you_mean(name, list(known))
                )


def _of_output(scenario: ImpulseScenario) -> Iterator[Mistake]:
    """Tracked bodies are there, and the closed form that is asked for belongs to what the scenario has."""
    output, container = scenario.output, scenario.container
    if output.tracks:
        yield from tracked_exist(output.tracks, scenario.grain_count)
    if output.check and scenario.grain_count:
        walls = (5 + container.lid) if container.width is not None else 0
        planes = walls + len(scenario.planes) + (scenario.terrain is not None)
        yield from _check_fits(output.check, scenario.grain_count, planes, container.gravity)


def _check_fits(check: str, bodies: int, planes: int, gravity: float) -> Iterator[Mistake]:
    wanted = {
        "drop": (bodies == 1 and planes == 1 and gravity > 0.0, "of one body above one plane, with gravity"),
        "slope": (bodies == 1 and planes == 1 and gravity > 0.0, "of one body on one plane, with gravity"),
        "collision": (bodies == 2, "of two bodies"),
        "row": (bodies >= 3 and gravity == 0.0, "of three bodies or more, without gravity"),
    }
    fits, words = wanted[check]
    if not fits:
        has = f"here: bodies {bodies}, planes {planes}, gravity {gravity:g} m/s^2"
        yield Mistake(("output", "check"), f"is {words}; {has}", "Leave it out, or change the scenario")
