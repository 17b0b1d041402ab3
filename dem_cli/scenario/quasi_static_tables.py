"""Tables of a scenario that are those of the granular element method: contact, container, boundary, solver, output."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Literal

from dem_cli.scenario.quantities import (
    Acceleration,
    Angle,
    Force,
    ForceOrZero,
    Friction,
    JsonSchema,
    Length,
    Number,
    Stiffness,
    Whole,
)
from dem_cli.scenario.table import Given, Mistake, Table, key, misplaced
from dem_cli.scenario.tables import Followed, WallFriction

EXPLICIT, IMPULSE = "explicit", "impulse"
UNDAMPED = "Leave it out: a quasi-static test has no damping"
# Keys that only some boundaries, and some solvers, have.
BOUNDARIES_OF = {"radius": ("chain", "membrane"), "link_stiffness": ("membrane",)}
OF_KISHINO = {"alpha": 0.75, "alpha_prime": 0.5, "beta": 20.0, "beta_prime": 20.0}


class SmoothWalls(WallFriction):
    """Friction of each wall: one number for all, or a table of sides; a side left out is smooth."""

    left: Friction = key(0.0, "friction of the left wall", example="5 deg")
    right: Friction = key(0.0, "friction of the right wall", example="5 deg")
    bottom: Friction = key(0.0, "friction of the bottom wall", example="5 deg")
    top: Friction = key(0.0, "friction of the top wall", example="5 deg")


class QuasiStaticContact(Table):
    """The law between grains, and between grains and walls: linear springs, friction and cohesion, no damping and no tension."""

    friction: Friction = key(doc="coefficient of friction between grains, or the friction angle", example="25 deg")
    wall_friction: SmoothWalls = key(0.0, "friction of the walls", example="5 deg")
    cohesion: ForceOrZero = key(
        "0 N",
        "shear force that a contact bears without normal force: |pt| <= mu pn + c, as long as it touches",
        example="0.1 N",
    )

    elsewhere: ClassVar = {
        "damping_ratio": (EXPLICIT, UNDAMPED),
        "restitution": (EXPLICIT, UNDAMPED),
        "pairs": (IMPULSE, "Leave it out; wall_friction says what differs at walls"),
        "tension": (EXPLICIT, UNDAMPED),
        "slider": (EXPLICIT, UNDAMPED),
        "ellipse_test": (EXPLICIT, "Leave it out: this engine moves discs"),
    }


class QuasiStaticContainer(Table):
    """The box at the start, and gravity. The top wall lies on the packing; walls move in pairs."""

    width: Length | None = key(
        None,
        "width at the start (default: that of the result file or grid; else as wide as high, at the packing's void ratio)",
        example="10 cm",
    )
    gravity: Acceleration = key("0 m/s^2", "gravity", example="980 gal")
    gravity_direction: Angle = key("-90 deg", "direction of gravity, anticlockwise from +x", example="-90 deg")

    elsewhere: ClassVar = {
        "height": (EXPLICIT, "Leave it out: the top wall lies on the packing; packing.height says how high that is"),
        "breadth": (IMPULSE, "Leave it out: grains lie in a plane, depth says how long they are"),
        "material": (IMPULSE, "Leave it out; contact.wall_friction says what differs at walls"),
        "lid": (EXPLICIT, "Leave it out: there is always a top wall, which lies on the packing"),
    }


class Boundary(Table):
    """What encloses the sample: four rigid walls, or chains of boundary grains."""

    kind: Literal["walls", "chain", "membrane"] = key(
        "walls",
        "walls: four rigid walls; chain: a ring of boundary grains that moves with the imposed strain; membrane: chains left and right "
        "under the lateral pressure, between rigid walls at bottom and top",
        example="membrane",
    )
    radius: Length | None = key(
        None, "chain, membrane: radius of the boundary grains (default: the median of the grains)", example="3 mm"
    )
    link_stiffness: Stiffness | None = key(
        None, "membrane: stiffness of the links between neighbours (default: a tenth of kn)", example="1e4 N/m"
    )

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from misplaced(given, "kind", BOUNDARIES_OF)

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        return [(name,) for name, kinds in BOUNDARIES_OF.items() if tuple(path) == ("kind",) and value not in kinds]


def _only_kishino(name: str) -> Any:
    return lambda good: OF_KISHINO[name] if good["method"] == "kishino" else None


class Solver(Table):
    """How equilibrium is found in each increment, and when it counts as found."""

    method: Literal["momentum", "kishino"] = key(
        "momentum",
        "momentum: steps by the grains' own stiffness with momentum, friction counted from the start of the sub-step; kishino: the paper's "
        "block Jacobi relaxation",
        example="momentum",
    )
    sub_steps: Annotated[int, Whole(ge=1)] = key(
        maker=lambda good: 1 if good["method"] == "kishino" else 4,
        doc="steps into which each increment is divided (default: 4; kishino: 1)",
        example=4,
    )
    accuracy: Force | None = key(
        None,
        "largest force on a grain that counts as none, a (14) (default: 1e-5 of mean stress x mean diameter x depth)",
        example="1 dyn",
    )
    stress_tolerance: Annotated[float, Number(gt=0.0, lt=0.1)] = key(
        maker=lambda good: 1e-4 if good["method"] == "kishino" else 1e-6,
        doc="share by which a stress that is held may be off (default: 1e-6; kishino: 1e-4)",
        example=1e-6,
    )
    alpha: Annotated[float, Number(gt=0.0, le=1.0)] | None = key(
        maker=_only_kishino("alpha"),
        doc="kishino: factor of moves of grains with two contacts and more, (9) (default: 0.75)",
        example=0.75,
    )
    alpha_prime: Annotated[float, Number(gt=0.0, le=1.0)] | None = key(
        maker=_only_kishino("alpha_prime"),
        doc="kishino: factor of moves of grains with one contact, (11) (default: 0.5)",
        example=0.5,
    )
    beta: Annotated[float, Number(ge=0.0)] | None = key(
        maker=_only_kishino("beta"),
        doc="kishino: factor of moves of grains without contacts, (10) (default: 20)",
        example=20,
    )
    beta_prime: Annotated[float, Number(ge=0.0)] | None = key(
        maker=_only_kishino("beta_prime"),
        doc="kishino: factor of rolling of grains with one contact, (11) (default: 20)",
        example=20,
    )
    max_iterations: Annotated[int, Whole(ge=1)] | None = key(
        maker=lambda good: 100000 if good["method"] == "kishino" else None,
        doc="iterations at most in a sub-step; momentum: on each of its fallbacks (default: their own limits; kishino: 100000)",
        example=100000,
    )
    max_overlap: Annotated[float, Number(gt=0.0, le=1.0)] = key(
        0.1, "the run stops once an overlap exceeds this share of the smaller radius", example=0.1
    )

    short_form: ClassVar[JsonSchema | None] = {"enum": ["momentum", "kishino"], "description": "the method alone"}
    short_words: ClassVar[str | None] = '`"momentum"` or `"kishino"`'

    elsewhere: ClassVar = {
        **{
            f"method={name}": (IMPULSE, 'Write method = "momentum" or "kishino"') for name in ("pgs", "energy-tracking")
        },
        **dict.fromkeys(
            ("quanta", "iterations", "sweeps", "tolerance", "rest_speed", "correction", "slop"),
            (IMPULSE, "Leave it out; accuracy says when equilibrium is found"),
        ),
        "max_penetration": (IMPULSE, "Give max_overlap in its place"),
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return {"method": raw} if isinstance(raw, str) else raw

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        if given.good.get("method") != "momentum":
            return
        for name in OF_KISHINO:
            if name in given.raw:
                rule = 'is no key of method = "momentum", whose steps follow from the stiffness'
                yield Mistake((name,), rule, 'Leave it out, or write method = "kishino"')

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        return [(name,) for name in OF_KISHINO if tuple(path) == ("method",) and value != "kishino"]


class QuasiStaticOutput(Table):
    """What is written. The series has a row for each increment."""

    frames: Annotated[int, Whole(ge=1, example="1, a frame each increment")] = key(
        1, "a frame every so many increments: all grains, contacts and forces", example=1
    )
    tracks: Followed | None = key(
        None, "grains that are followed closely, a record each increment", example={"grains": [3, 57]}
    )

    elsewhere: ClassVar = {
        "interval": (EXPLICIT, "Leave it out: the series has a row for each increment"),
        "surface_bins": (EXPLICIT, "Leave it out: the sample has no free surface"),
        "check": (IMPULSE, "Leave it out"),
        "window": (EXPLICIT, "Leave it out: measures are those of the whole sample"),
    }
