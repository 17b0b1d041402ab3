"""The scenario of the impulse engine: rigid bodies in three dimensions, z up. All values are SI once it is built."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

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
from dem_cli.scenario.table import Given, Mistake, Table, did_you_mean, key

EXPLICIT, QUASI_STATIC = "explicit", "granular-element"
WALLS = ("left", "right", "front", "back", "bottom", "top")


class ImpulseScenario(AnyScenario):
    """A scenario of the impulse engine, complete and consistent: every default filled in, every rule checked."""

    engine: Literal["impulse"] = key(doc="rigid bodies in three dimensions, moved by impulses", example="impulse")
    grains: tuple[BodyKind, ...] = key((), doc="the bodies, kind by kind")
    contact: ImpulseContact = key(doc="the law of contacts")
    container: ImpulseContainer = key({}, doc="walls and gravity")
    planes: tuple[Plane, ...] = key((), alias="plane", doc="planes without end: one [[plane]] table each")
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
        container, contact = good.get("container"), good.get("contact")
        if kinds is not None and packing:
            yield from _bodies_are_there(given, kinds, packing)
        if kinds is not None:
            yield from _named_once("grains", [kind.name for kind in kinds])
        if planes is not None and container:
            walls = WALLS if container.width is not None else ()
            yield from _named_once("plane", [plane.name for plane in planes], walls)
        if packing and packing.method != "file" and kinds and container:
            yield from _room_to_pack(kinds, packing, container)
        if None not in (kinds, planes, container, contact) and "terrain" in good and packing and packing.method != "file":
            assert contact is not None
            known = cls.model_construct(**good).materials
            yield from _known_materials(contact, known)
        output = good.get("output")
        if kinds and output and packing and packing.method != "file":
            total = sum(kind.count for kind in kinds)
            if output.tracks:
                yield from tracked_exist(output.tracks, total)
            if output.check and planes is not None and container:
                walls_and_planes = len(planes) + (4 + 1 + container.lid if container.width is not None else 0)
                yield from _check_fits(output.check, total, walls_and_planes, container.gravity)

    @property
    def materials(self) -> tuple[str, ...]:
        """Names of materials, each once: of the kinds of bodies, the container's walls, planes and terrain."""
        named = [kind.material for kind in self.grains]
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
        """Number of bodies that the tables of grains have, those of a packing's file not counted."""
        return sum(kind.count for kind in self.grains)

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
    """There is somewhere to put bodies without position."""
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
                yield Mistake(("contact", "pairs", number, "between", k), "is no material here", did_you_mean(name, list(known)))


def _check_fits(check: str, bodies: int, planes: int, gravity: float) -> Iterator[Mistake]:
    """The closed form that is asked for belongs to what the scenario has."""
    wanted = {
        "drop": (bodies == 1 and planes == 1 and gravity > 0.0, "of one body above one plane, with gravity"),
        "slope": (bodies == 1 and planes == 1 and gravity > 0.0, "of one body on one plane, with gravity"),
        "collision": (bodies == 2, "of two bodies"),
        "row": (bodies >= 3 and gravity == 0.0, "of three bodies or more, without gravity"),
    }
    fits, words = wanted[check]
    if not fits:
        has = f"here are {bodies} bodies and {planes} planes, gravity is {gravity:g} m/s^2"
        yield Mistake(("output", "check"), f"is {words}; {has}", "Leave it out, or change the scenario")
