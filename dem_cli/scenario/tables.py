"""Tables of a scenario: grains, material, contact, container, integration, output."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Strict
from pydantic_core import PydanticCustomError

from dem_cli.scenario.quantities import (
    Acceleration,
    Angle,
    Density,
    Duration,
    Friction,
    FrictionNumber,
    JsonSchema,
    Length,
    Number,
    Quantity,
    Stiffness,
    Velocity,
    Whole,
    friction_schema,
)
from dem_cli.scenario.radii import Radius
from dem_cli.scenario.restitution import Tension, damping_ratio
from dem_cli.scenario.shapes import AspectRatio, Bond, Orientation, Template
from dem_cli.scenario.table import Given, Mistake, Table, key, misplaced

Ratio = Annotated[float, Number(ge=0.0)]
Share = Annotated[float, Number(ge=0.0, lt=1.0)]
SIDES = ("left", "right", "bottom", "top")
TEMPLATED = ("bonded", "clump")
# Keys of [grains] that only some shapes have.
SHAPES_OF = {
    "aspect_ratio": ("ellipse",),
    "orientation": ("ellipse", *TEMPLATED),
    "template": TEMPLATED,
    "equal_area": TEMPLATED,
    "bond": ("bonded",),
}
IMPULSE = "impulse"
# Keys and shapes of the bodies of the impulse engine.
OF_BODIES = {
    **dict.fromkeys(
        (
            "name",
            "size",
            "face_points",
            "file",
            "file_unit",
            "spacing",
            "scale",
            "material",
            "position",
            "step",
            "velocity",
            "spin",
        ),
        (IMPULSE, f'Leave it out, or write engine = "{IMPULSE}"'),
    ),
    **{f"shape={name}": (IMPULSE, f'Write engine = "{IMPULSE}"') for name in ("box", "sphere", "cloud", "mesh")},
}


class Grains(Table):
    """The grains. With a packing from a file, count and radius come from there."""

    shape: Literal["disc", "ellipse", "bonded", "clump"] = key(
        "disc",
        "outline of the grains: discs, ellipses, several discs held together by viscous bonds, or several discs as one rigid body",
        example="disc",
    )
    count: Annotated[int, Whole(ge=1)] | None = key(
        None, "number of grains; may be left out with a list or classes of radii, or a file", example=3000
    )
    density: Density = key(doc="density of the solid", example="2480 kg/m^3")
    radius: Radius | None = key(
        None,
        "radii: one length, or a distribution (table grains.radius). Of ellipses it is sqrt(a b), that of the disc of equal area; "
        "of templates the unit in which they are written",
        example={"uniform": ["0.5 cm", "1 cm"]},
    )
    aspect_ratio: AspectRatio | None = key(
        None, "ellipses: longer over shorter semi-axis, a = r sqrt(k), b = r/sqrt(k)", example=2.0
    )
    orientation: Orientation | None = key(
        maker=lambda good: None if good["shape"] == "disc" else "random",
        doc="all but discs: angle at the start (default: random, of any angle); a file's own angles come first",
        example="random",
    )
    template: Template | None = key(
        maker=lambda good: "pair" if good["shape"] in TEMPLATED else None,
        doc="bonded and clump: the discs of a grain, in units of its radius (default: pair)",
        example="pair",
    )
    equal_area: Annotated[bool, Strict()] | None = key(
        maker=lambda good: False if good["shape"] in TEMPLATED else None,
        doc="bonded and clump: scale the template so that a grain has the area pi r^2 of a disc of its radius (default: false)",
        example=True,
    )
    bond: Bond | None = key(
        maker=lambda good: {} if good["shape"] == "bonded" else None,
        doc="bonded: what holds the discs of a grain together",
        example={"normal": "stiff", "tangential": "stiff", "rolling": True},
    )

    elsewhere: ClassVar = OF_BODIES

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        count, radius = good.get("count"), good.get("radius")
        if radius and radius.number and count is not None and count != radius.number:
            whose = "radii of the list" if radius.sizes else "grains of the classes"
            yield Mistake(
                ("count",), f"differs from the {radius.number} {whose}", "Leave count out, or make them agree"
            )
        yield from misplaced(given, "shape", SHAPES_OF)

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        return [(name,) for name in SHAPES_OF if tuple(path) == ("shape",) and value not in SHAPES_OF[name]]

    @property
    def number(self) -> int:
        """Number of grains, 0 where only a file says it."""
        return self.count or (self.radius.number if self.radius else None) or 0

    @property
    def elements(self) -> int:
        """Discs or ellipses that a grain is made of."""
        return len(self.template.outline()[0]) if self.template else 1

    @property
    def scale(self) -> float:
        """Length of a unit of the template over the grain's radius."""
        return math.sqrt(math.pi / self.template.area) if self.template and self.equal_area else 1.0


class Material(Table):
    """Stiffness of a contact: from the speeds of elastic waves, or given directly."""

    s_wave_velocity: Velocity | None = key(
        None, "speed of shear waves Vs: ks = pi/4 L rho Vs^2, thesis (2.22)-(2.27)", example="150 m/s"
    )
    poisson_ratio: Annotated[float, Number(ge=0.0, lt=0.5)] | None = key(
        None, "Poisson's ratio nu: Vp = Vs sqrt(2(1-nu)/(1-2nu)), kn = pi/4 L rho Vp^2", example=0.25
    )
    normal_stiffness: Stiffness | None = key(None, "normal stiffness kn of a contact", example="1.3e8 N/m")
    tangential_stiffness: Stiffness | None = key(None, "tangential stiffness ks of a contact", example="4.4e7 N/m")

    alternatives: ClassVar = ((("s_wave_velocity", "poisson_ratio"), ("normal_stiffness", "tangential_stiffness")),)

    def wave_speeds(self, density: float, depth: float) -> tuple[float, float]:
        """Vp, Vs [m/s]: as given, or those that the given stiffnesses stand for at this density and depth."""
        if self.s_wave_velocity is not None and self.poisson_ratio is not None:
            nu, vs = self.poisson_ratio, self.s_wave_velocity
            return vs * math.sqrt(2.0 * (1.0 - nu) / (1.0 - 2.0 * nu)), vs
        kn, ks = self.stiffness(density, depth)
        unit = math.pi / 4.0 * depth * density
        return math.sqrt(kn / unit), math.sqrt(ks / unit)

    def stiffness(self, density: float, depth: float) -> tuple[float, float]:
        """kn, ks [N/m] of a contact (physics.md 1.2)."""
        if self.normal_stiffness is not None and self.tangential_stiffness is not None:
            return self.normal_stiffness, self.tangential_stiffness
        vp, vs = self.wave_speeds(density, depth)
        unit = math.pi / 4.0 * depth * density
        return unit * vp**2, unit * vs**2


def _no_friction(_: Mapping[str, Any]) -> float:
    """Stands in where `Contact` has not filled in the friction between grains."""
    return 0.0


class WallFriction(Table):
    """Friction of each wall: one number for all, or a table of sides; a side left out has the grains' friction."""

    left: Friction = key(maker=_no_friction, doc="friction of the left wall (default: as between grains)", example=0.25)
    right: Friction = key(
        maker=_no_friction, doc="friction of the right wall (default: as between grains)", example=0.25
    )
    bottom: Friction = key(maker=_no_friction, doc="friction of the floor (default: as between grains)", example=0.25)
    top: Friction = key(maker=_no_friction, doc="friction of the lid (default: as between grains)", example=0.25)

    short_form: ClassVar[JsonSchema | None] = friction_schema() | {"description": "the same for all walls"}
    short_words: ClassVar[str | None] = "number or angle"

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return raw if isinstance(raw, dict) else dict.fromkeys(SIDES, raw)


class DampingRatio(Table):
    """Damping ratio of a contact: one number for both directions, or a table."""

    normal: Ratio = key(doc="h of the normal dashpot, cn = 2 h sqrt(m_eff kn)", example=0.3)
    tangential: Ratio = key(doc="h of the tangential dashpot, cs = 2 h sqrt(m_eff ks)", example=0.3)

    short_form: ClassVar[JsonSchema | None] = {
        "type": "number",
        "minimum": 0,
        "description": "the same in both directions",
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return raw if isinstance(raw, dict) else {"normal": raw, "tangential": raw}


class Contact(Table):
    """The law between grains, and between grains and walls: linear spring, dashpot and slider."""

    friction: Friction = key(doc="coefficient of friction between grains, or the friction angle", example=0.17)
    wall_friction: WallFriction = key(
        maker=lambda good: good["friction"], doc="friction of the walls (default: as between grains)", example=0.25
    )
    damping_ratio: DampingRatio | None = key(
        None, "damping over critical damping h, 1 is aperiodic; or give restitution", example=1.0
    )
    restitution: Annotated[float, Number(gt=0.0, le=1.0)] | None = key(
        None, "speed after over speed before a head-on impact; or give damping_ratio", example=0.5
    )
    tension: Tension = key(
        "none",
        "whether the dashpot may pull: none = the normal force is never negative, damping = only the spring is cut, thesis (2.8)",
        example="none",
    )
    slider: Literal["total", "spring"] = key(
        "total",
        "what friction limits: spring and dashpot together, or the spring alone, thesis (2.16)",
        example="total",
    )
    ellipse_test: Literal["exact", "enlarged"] | None = key(
        None,
        "ellipses: exact geometry of the two outlines (default), or the enlarged ellipse of thesis (4.32), which misses some contacts",
        example="exact",
    )

    alternatives: ClassVar = ((("damping_ratio",), ("restitution",)),)
    elsewhere: ClassVar = {
        "cohesion": ("granular-element", 'Leave it out, or write engine = "granular-element"'),
        "pairs": (IMPULSE, "Leave it out; wall_friction says what differs at walls"),
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        """Gives sides that `wall_friction` leaves out the friction between grains (0 if that is missing, too)."""
        walls = raw.get("wall_friction") if isinstance(raw, dict) else None
        if not isinstance(walls, dict):
            return raw
        try:
            inner = FrictionNumber().validate(raw.get("friction"))
        except PydanticCustomError:
            inner = 0.0
        return raw | {"wall_friction": dict.fromkeys(SIDES, inner) | walls}

    def damping(self) -> tuple[float, float]:
        """Damping ratios hn, hs [-]; a restitution is inverted by the formula that fits `tension`, for both directions."""
        if self.damping_ratio is not None:
            return self.damping_ratio.normal, self.damping_ratio.tangential
        assert self.restitution is not None
        h = damping_ratio(self.restitution, self.tension)
        return h, h


class Container(Table):
    """The container: a floor at y = 0, walls at x = 0 and x = width, and gravity."""

    width: Length = key(
        doc="inner width; may be left out with a result file, whose width it then is", example="121.5 cm"
    )
    height: Length | None = key(
        None,
        "height of the walls; left out, they have no upper end. What goes over them is lost and counted",
        example="2 m",
    )
    lid: Annotated[bool, Strict()] = key(False, "a wall on top, at height", example=False)
    gravity: Acceleration = key("9.80665 m/s^2", "gravity", example="980 gal")
    gravity_direction: Angle = key("-90 deg", "direction of gravity, anticlockwise from +x", example="-90 deg")

    elsewhere: ClassVar = {
        "breadth": (IMPULSE, "Leave it out: grains lie in a plane, depth says how long they are"),
        "material": (IMPULSE, "Leave it out; contact.wall_friction says what differs at walls"),
    }
    more_schema: ClassVar[JsonSchema] = {"required": []}  # the scenario says when width is needed

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        raw, good = given
        if good.get("lid") and "height" not in raw:
            yield Mistake(("lid",), "needs to know where the lid is", 'Add for example height = "1 m"')


class Integration(Table):
    """How time is stepped, and when a run counts as blown up."""

    time_step: Annotated[
        float | Literal["auto"], Quantity(gt=0.0, unit="s", example="1e-6 s", words_allowed=("auto",))
    ] = key("auto", "time step; auto = the largest safe one, see dem check", example="auto")
    integrator: Literal["leapfrog", "thesis"] = key(
        "leapfrog",
        "leapfrog, or the scheme of thesis (3.16)-(3.17), which gains energy without damping",
        example="leapfrog",
    )
    safety: Annotated[float, Number(gt=0.0, le=1.0)] = key(
        0.9, "share of the stability limit that auto takes", example=0.9
    )
    max_overlap: Annotated[float, Number(gt=0.0, le=1.0)] = key(
        0.1, "the run stops as blown up once an overlap exceeds this share of the smaller radius", example=0.1
    )


class Followed(Table):
    """Grains that are followed closely."""

    grains: tuple[Annotated[int, Whole(ge=0)], ...] = key(
        doc="their ids, counted from 0; each disc of a bonded grain or clump has its own, grain after grain",
        example=[484, 499, 514],
    )

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        ids = good.get("grains")
        if ids == ():
            yield Mistake(("grains",), "is empty", "Name at least one grain, or leave tracks out")
        if twice := sorted(k for k, n in Counter(ids or ()).items() if n > 1):
            yield Mistake(("grains",), f"names grain {twice[0]} twice", "Name each grain once")


class Tracks(Followed):
    """Grains that are followed closely."""

    interval: Duration = key("1 ms", "time between records", example="1 ms")


class Window(Table):
    """Inner window for void ratio and stress, away from walls and surface."""

    side: Annotated[float, Number(ge=0.0, lt=0.5)] = key(
        0.1, "left out on each side, as a share of the width", example=0.1
    )
    bottom: Share = key(
        0.1, "left out at the bottom, as a share of the height of the lowest surface between the sides", example=0.1
    )
    top: Share = key(0.2, "left out below the lowest surface between the sides, as a share of its height", example=0.2)

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        if {"bottom", "top"} <= good.keys() and good["bottom"] + good["top"] >= 1.0:
            yield Mistake(
                ("top",), "leaves nothing of the depth, together with bottom", "Make their sum smaller than 1"
            )


class Output(Table):
    """What is written, and how often."""

    interval: Duration = key("0.01 s", "time between rows of the series", example="0.01 s")
    frames: Duration = key("0.1 s", "time between frames: all grains, contacts and forces", example="0.1 s")
    tracks: Tracks | None = key(
        None, "grains that are followed closely", example={"grains": [484, 499], "interval": "1 ms"}
    )
    surface_bins: Annotated[int, Whole(ge=4, le=10000)] = key(
        40, "columns across the width in which the free surface is measured", example=40
    )
    window: Window = key({}, "inner window for void ratio and stress", example={"side": 0.1, "bottom": 0.1, "top": 0.2})

    elsewhere: ClassVar = {"check": (IMPULSE, "Leave it out")}
