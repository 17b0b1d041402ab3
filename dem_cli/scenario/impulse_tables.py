"""Tables of a scenario that are those of the impulse engine: contact, container, planes, terrain, packing, solver, output."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Strict

from dem_cli.scenario.quantities import (
    Acceleration,
    Angle,
    Distance,
    Duration,
    Friction,
    JsonSchema,
    Length,
    Number,
    Quantity,
    Whole,
)
from dem_cli.scenario.stored_grains import is_result_file
from dem_cli.scenario.table import Given, Mistake, Table, key, misplaced
from dem_cli.scenario.tables import Followed
from dem_cli.scenario.vectors import ORIGIN, Direction, Point

EXPLICIT, QUASI_STATIC = "explicit", "granular-element"
Restitution = Annotated[float, Number(ge=0.0, le=1.0)]
Positive = Annotated[float, Quantity(gt=0.0, unit="m/s", example="1e-5 m/s")]
RIGID = "Leave it out: bodies are rigid, restitution says what an impact loses"
METHODS_OF = {
    "region": ("grid", "rejection"),
    "gap": ("grid", "rejection"),
    "attempts": ("rejection",),
    "file": ("file",),
    "stage": ("file",),
}
KISHINO = ("alpha", "alpha_prime", "beta", "beta_prime")
OF_ENERGY_TRACKING = {"quanta": 50, "iterations": 100000}


class Pair(Table):
    """What holds between two materials, in place of the law of all."""

    between: tuple[str, str] = key(
        doc="names of the two materials; twice the same for bodies of one", example=["rock", "slope"]
    )
    friction: Friction | None = key(
        None, "coefficient of friction, or the friction angle (default: that of all)", example=0.6
    )
    restitution: Restitution | None = key(None, "coefficient of restitution (default: that of all)", example=0.1)

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        if "between" in given.raw and "friction" not in given.raw and "restitution" not in given.raw:
            yield Mistake(("friction",), "is missing", "Give friction, restitution, or both, or leave the pair out")


class ImpulseContact(Table):
    """The law of all contacts: rigid bodies, restitution and friction."""

    friction: Friction = key(doc="coefficient of friction, or the friction angle", example=0.5)
    restitution: Restitution = key(doc="speed after over speed before an impact along the normal", example=0.3)
    pairs: tuple[Pair, ...] = key(
        (), "what differs between two materials", example=[{"between": ["rock", "slope"], "friction": 0.6}]
    )

    elsewhere: ClassVar = {
        "damping_ratio": (EXPLICIT, "Give restitution in its place"),
        "tension": (EXPLICIT, RIGID),
        "slider": (EXPLICIT, RIGID),
        "ellipse_test": (EXPLICIT, "Leave it out: there are no ellipses"),
        "cohesion": (QUASI_STATIC, "Leave it out: contacts bear no tension"),
        "wall_friction": (EXPLICIT, 'Give it in pairs: [{ between = ["box", "wall"], friction = 0.25 }]'),
    }

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        seen: set[frozenset[str]] = set()
        for number, pair in enumerate(given.good.get("pairs", ())):
            if (names := frozenset(pair.between)) in seen:
                yield Mistake(("pairs", number), "names the same two materials as a pair before it", "Leave one out")
            seen.add(names)


class ImpulseContainer(Table):
    """A box with a floor at z = 0, where width and breadth are given; and gravity. z is up."""

    width: Length | None = key(None, "inner width, x from 0; left out, there are no walls", example="1 m")
    breadth: Length | None = key(None, "inner breadth, y from 0", example="1 m")
    height: Length | None = key(
        None,
        "height of the walls; left out, they have no upper end. What goes over them is lost and counted",
        example="2 m",
    )
    lid: Annotated[bool, Strict()] = key(False, "a wall on top, at height", example=False)
    material: str = key("wall", "name of the walls' material in contact.pairs", example="steel")
    gravity: Acceleration = key("9.80665 m/s^2", "gravity", example="980 gal")
    gravity_direction: Direction = key([0.0, 0.0, -1.0], "direction of gravity", example=[0, 0, -1])

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        raw = given.raw
        for one, other in (("width", "breadth"), ("breadth", "width")):
            if one in raw and other not in raw:
                yield Mistake((other,), f"is missing, {one} is given", f'Add for example {other} = "1 m"')
        if given.good.get("lid") and "height" not in raw:
            yield Mistake(("lid",), "needs to know where the lid is", 'Add for example height = "1 m"')
        for name in ("height",):
            if name in raw and not {"width", "breadth"} & raw.keys():
                yield Mistake((name,), "is of walls, and there are none", "Give width and breadth, or leave it out")


class Plane(Table):
    """A plane without end, fixed: a floor, a wall, a slope."""

    name: str = key("plane", 'name in reports, and in --set (default: "plane 1", ...)', example="slope")
    point: Point = key(ORIGIN, "a point on it", example=["0 m", "0 m", "1 m"])
    normal: Direction | None = key(
        None,
        "direction at right angles to it, to the side of the bodies (default: upwards); or give slope",
        example=[0, 0, 1],
    )
    slope: Angle | None = key(
        None, "angle of a slope that falls towards +x, or towards heading; or give normal", example="30 deg"
    )
    heading: Angle | None = key(
        maker=lambda good: None if good["slope"] is None else "0 deg",
        doc="with slope: direction in plan in which it falls, from +x towards +y (default: 0 deg)",
        example="90 deg",
    )
    material: str = key(
        maker=lambda good: good["name"], doc="name of its material in contact.pairs (default: name)", example="soil"
    )

    alternatives: ClassVar = ((("normal",), ("slope",), ()),)

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        raw, slope = given.raw, given.good.get("slope")
        if slope is not None and not 0.0 <= slope <= 0.5 * math.pi:
            rule = "is out of range, allowed is from 0 deg up to 90 deg"
            yield Mistake(("slope",), rule, "Choose an angle in this range; heading says where it falls")
        if "heading" in raw and "slope" not in raw:
            yield Mistake(("heading",), "is of a slope", 'Add for example slope = "30 deg", or leave it out')

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        del value
        return [("heading",)] if tuple(path) == ("normal",) else []

    @property
    def direction(self) -> tuple[float, float, float]:
        """Unit normal, to the side of the bodies."""
        if self.normal is not None:
            return self.normal
        slope, heading = self.slope or 0.0, self.heading or 0.0
        return math.sin(slope) * math.cos(heading), math.sin(slope) * math.sin(heading), math.cos(slope)


class TerrainTable(Table):
    """A fixed surface of triangles that bodies roll down, from a file."""

    file: str = key(
        doc="mesh (OBJ, STL, PLY, ...), looking to the bodies; or CSV with header x,y,z: heights z of a full grid of x and y",
        example="slope.obj",
    )
    file_unit: Literal["m", "cm", "mm"] = key("m", "unit of length in the file", example="cm")
    name: str = key("terrain", "name in reports", example="slope")
    material: str = key(
        maker=lambda good: good["name"], doc="name of its material in contact.pairs (default: name)", example="soil"
    )


class PackedRegion(Table):
    """A cuboid along the axes."""

    low: Point = key(alias="from", doc="its lowest corner", example=ORIGIN)
    high: Point = key(alias="to", doc="its highest corner", example=["1 m", "1 m", "2 m"])

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        low, high = given.good.get("low"), given.good.get("high")
        if low and high and any(a >= b for a, b in zip(low, high, strict=True)):
            yield Mistake(
                ("to",), "is not above from in each direction", "Make each of its parts larger than that of from"
            )


class ImpulsePacking(Table):
    """Where bodies are at the start that have no position. The stages that follow bring them to rest."""

    method: Literal["grid", "rejection", "file"] = key(
        "grid",
        "grid: side by side in layers, bounding spheres apart; rejection: at random places, large ones first, those whose bounding "
        "spheres overlap are tried again; file: the bodies of a result file, as they are there",
        example="rejection",
    )
    region: PackedRegion | None = key(
        None,
        "where they are put (default: the container; without height upwards as far as needed)",
        example={"from": ORIGIN, "to": ["1 m", "1 m", "2 m"]},
    )
    gap: Distance | None = key(
        None,
        "least distance between bounding spheres (default: grid 5 % of the largest diameter, rejection 0)",
        example="1 mm",
    )
    attempts: Annotated[int, Whole(ge=1)] | None = key(
        maker=lambda good: 1000 if good["method"] == "rejection" else None,
        doc="rejection: places that a body tries (default: 1000)",
        example=1000,
    )
    file: str | None = key(None, "file: result file of dem run (.h5) of this engine", example="pile.h5")
    stage: str | None = key(
        None,
        "file: stage, by name, at whose end the bodies are taken (default: as they are in the last frame)",
        example="settle",
    )
    overlaps: Literal["separate", "refuse"] = key(
        "separate",
        "bodies that overlap at the start: pushed apart, with a warning, or an error that names them",
        example="refuse",
    )

    elsewhere: ClassVar = {
        **dict.fromkeys(
            ("grid", "void_ratio", "height", "sweeps"), (EXPLICIT, "Leave it out; gap says how far bodies start apart")
        ),
        "file_unit": (EXPLICIT, "Leave it out: a result file is in metres"),
        **{
            f"method={name}": (EXPLICIT, 'Write method = "grid" or "rejection", and a stage that settles the bodies')
            for name in ("falling", "local-move", "growth", "insertion")
        },
        "method=overlapping": (QUASI_STATIC, 'Write method = "grid" or "rejection"'),
    }

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        raw, method = given.raw, given.good.get("method")
        yield from misplaced(given, "method", METHODS_OF)
        if method == "file" and "file" not in raw:
            yield Mistake(("file",), "is missing", 'Add for example file = "pile.h5"')
        elif method == "file" and isinstance(raw.get("file"), str) and not is_result_file(raw["file"]):
            yield Mistake(("file",), "is no result file, by its name", "Give a .h5 file of dem run")

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        return [(name,) for name, methods in METHODS_OF.items() if tuple(path) == ("method",) and value not in methods]


class ImpulseIntegration(Table):
    """How time is stepped."""

    time_step: Annotated[
        float | Literal["auto"], Quantity(gt=0.0, unit="s", example="0.5 ms", words_allowed=("auto",))
    ] = key(
        "auto",
        "time step; auto: in a step no body moves by more than a twentieth of the smallest one at the largest speed to expect, see dem check",
        example="auto",
    )

    elsewhere: ClassVar = {
        "integrator": (EXPLICIT, "Leave it out: there is one"),
        "safety": (EXPLICIT, "Leave it out: rigid bodies have no stability limit"),
        "max_overlap": (EXPLICIT, "Give solver.max_penetration in its place"),
    }


def _only_tracking(name: str) -> Any:
    return lambda good: OF_ENERGY_TRACKING[name] if good["method"] == "energy-tracking" else None


class ImpulseSolver(Table):
    """How the impulses of a step are found."""

    method: Literal["pgs", "energy-tracking"] = key(
        "pgs",
        "pgs: projected Gauss-Seidel, which never adds energy; energy-tracking: the article's compression and release for impacts",
        example="pgs",
    )
    quanta: Annotated[int, Whole(ge=1)] | None = key(
        maker=_only_tracking("quanta"),
        doc="energy-tracking: steps into which a compression is divided, the article's alpha0 (default: 50)",
        example=50,
    )
    iterations: Annotated[int, Whole(ge=1)] | None = key(
        maker=_only_tracking("iterations"),
        doc="energy-tracking: steps at most in one solve (default: 100000)",
        example=100000,
    )
    sweeps: Annotated[int, Whole(ge=1)] = key(5000, "sweeps at most in one solve", example=5000)
    tolerance: Positive = key(
        "1e-4 m/s",
        "change of the contacts' velocities in a sweep, root mean square, at which a solve ends; large groups: times their first change over "
        "1 cm/s, if that is more; few contacts or bodies: to rounding",
        example="1e-4 m/s",
    )
    rest_speed: Positive = key("1 mm/s", "contacts that approach more slowly are no impact", example="1 mm/s")
    correction: Annotated[float, Number(ge=0.0, le=1.0)] = key(
        0.2, "share of a penetration that is taken back in a step", example=0.2
    )
    slop: Annotated[float, Number(ge=0.0, lt=1.0)] = key(
        1e-4, "penetration that is left, as a share of the smaller body's size", example=1e-4
    )
    max_penetration: Annotated[float, Number(gt=0.0, le=1.0)] = key(
        0.5, "the run stops once a penetration exceeds this share of the smaller body's size", example=0.5
    )

    short_form: ClassVar[JsonSchema | None] = {"enum": ["pgs", "energy-tracking"], "description": "the method alone"}
    short_words: ClassVar[str | None] = '`"pgs"` or `"energy-tracking"`'
    elsewhere: ClassVar = {
        **{
            f"method={name}": (QUASI_STATIC, 'Write method = "pgs" or "energy-tracking"')
            for name in ("momentum", "kishino")
        },
        **dict.fromkeys(
            ("sub_steps", "accuracy", "stress_tolerance", "max_iterations", *KISHINO),
            (QUASI_STATIC, "Leave it out; tolerance says when a solve ends"),
        ),
        "max_overlap": (QUASI_STATIC, "Give max_penetration in its place"),
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return {"method": raw} if isinstance(raw, str) else raw

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from misplaced(given, "method", dict.fromkeys(OF_ENERGY_TRACKING, ("energy-tracking",)))

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        return [(name,) for name in OF_ENERGY_TRACKING if tuple(path) == ("method",) and value != "energy-tracking"]


class BodyTracks(Followed):
    """Bodies that are followed closely."""

    grains: tuple[Annotated[int, Whole(ge=0)], ...] = key(doc="their ids, counted from 0", example=[0, 9])
    interval: Duration = key("1 ms", "time between records", example="1 ms")


class ImpulseOutput(Table):
    """What is written, and how often."""

    interval: Duration = key("0.01 s", "time between rows of the series", example="0.01 s")
    frames: Duration = key("0.1 s", "time between frames: all bodies, contacts and impulses", example="0.1 s")
    tracks: BodyTracks | None = key(
        None, "bodies that are followed closely", example={"grains": [0, 9], "interval": "1 ms"}
    )
    check: Literal["drop", "slope", "collision", "row"] | None = key(
        None,
        "closed form that dem report sets beside the run: of one body that falls on a plane or slides down it, two bodies that collide, a row",
        example="drop",
    )

    elsewhere: ClassVar = {
        "surface_bins": (EXPLICIT, "Leave it out: no free surface is measured"),
        "window": (EXPLICIT, "Leave it out: measures are those of the whole sample"),
    }
