"""Table of a scenario that says what rigid bodies there are, and where they start."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

from dem_cli.scenario.body_shapes import BodyOrientation, Scale, SphereTemplate
from dem_cli.scenario.quantities import Density, Length, Whole
from dem_cli.scenario.radii import Radius
from dem_cli.scenario.table import Given, Mistake, Table, key, misplaced
from dem_cli.scenario.vectors import Edges, Point, Spin3, Velocity3

EXPLICIT = "explicit"
# Keys of [[grains]] that only some shapes have.
SHAPES_OF = {
    "size": ("box",),
    "face_points": ("box",),
    "radius": ("sphere", "clump"),
    "template": ("clump",),
    "file": ("cloud", "mesh"),
    "file_unit": ("cloud", "mesh"),
    "spacing": ("cloud",),
}
NEEDED = {
    "box": ("size", 'size = ["2 m", "1 m", "2 m"]'),
    "sphere": ("radius", 'radius = "5 cm"'),
    "clump": ("radius", 'radius = "5 cm"'),
    "cloud": ("file", 'file = "rock.csv"'),
    "mesh": ("file", 'file = "rock.stl"'),
}


def _only(shape: str, value: Any) -> Any:
    return lambda good: value if good["shape"] == shape else None


def _turned(good: dict[str, Any]) -> Any:
    return "random" if good["position"] is None else {"quaternion": [1.0, 0.0, 0.0, 0.0]}


def _number_of_sizes(good: Mapping[str, Any]) -> int:
    """How many bodies a list or classes of sizes have; else 1."""
    sizes = [good[name] for name in ("radius", "scale") if good[name] is not None]
    return next((one.number for one in sizes if one.number is not None), 1)


class BodyKind(Table):
    """Rigid bodies of one kind: their shape, and where they start. Write [grains] for one kind, a table [[grains]] each for several."""

    shape: Literal["box", "sphere", "clump", "cloud", "mesh"] = key(
        doc="box: a cuboid; sphere; clump: spheres joined, rigid; cloud: particles that fill a solid on a regular lattice, from a file; "
        "mesh: a closed surface, from a file",
        example="box",
    )
    name: str = key(
        maker=lambda good: good["shape"],
        doc='name in reports, and in --set (default: its shape; the second of that name is "box 2")',
        example="block",
    )
    density: Density = key(doc="density of the solid", example="2650 kg/m^3")
    size: Edges | None = key(
        None, "box: edge lengths along its x, y, z; one length for a cube", example=["2 m", "1 m", "2 m"]
    )
    face_points: Annotated[int, Whole(ge=0, le=100)] | None = key(
        maker=_only("box", 0),
        doc="box: points on a face along each edge, to find contacts with, beside the corners (default: 0)",
        example=3,
    )
    radius: Radius | None = key(
        None,
        "sphere: its radius; clump: unit of the template. One length, or a distribution (table grains.radius)",
        example="5 cm",
    )
    template: SphereTemplate | None = key(
        maker=_only("clump", "tetrahedron"),
        doc="clump: its spheres, in units of its radius (default: tetrahedron)",
        example="cube",
    )
    file: str | None = key(
        None,
        "mesh: file of a closed surface (STL, OBJ, PLY, ...); cloud: CSV file, a particle a line, with header x,y,z or x,y,z,nx,ny,nz "
        "(outward normals; 0,0,0 inside the solid)",
        example="rock.stl",
    )
    file_unit: Literal["m", "cm", "mm"] | None = key(
        maker=lambda good: "m" if good["shape"] in SHAPES_OF["file_unit"] else None,
        doc="cloud, mesh: unit of length in the file (default: m)",
        example="cm",
    )
    spacing: Length | None = key(
        None,
        "cloud: edge of the cube that each particle stands for (default: the median distance of nearest neighbours)",
        example="2 cm",
    )
    scale: Scale = key(1.0, "factor on all lengths: a number, or a distribution (table grains.scale)", example=0.5)
    count: Annotated[int, Whole(ge=1)] = key(
        maker=_number_of_sizes,
        doc="number of bodies (default: 1, or as many as a list or classes of sizes have)",
        example=100,
    )
    material: str = key(
        maker=lambda good: good["name"], doc="name of its material in contact.pairs (default: name)", example="rock"
    )
    position: Point | None = key(
        None, "centre of mass of the first at the start (default: placed by [packing])", example=["0 m", "0 m", "1.6 m"]
    )
    step: Point | None = key(
        None,
        "with position: from each of the bodies to the next, for rows and stacks",
        example=["1.001 m", "0 m", "0 m"],
    )
    orientation: BodyOrientation = key(
        maker=_turned,
        doc="how the bodies are turned at the start (default: not with position, else random)",
        example={"axis": [0, 1, 0], "angle": "30 deg"},
    )
    velocity: Velocity3 = key(
        ["0 m/s", "0 m/s", "0 m/s"], "of the centre of mass at the start", example=["2 m/s", "0 m/s", "0 m/s"]
    )
    spin: Spin3 = key(
        ["0 rad/s", "0 rad/s", "0 rad/s"],
        "angular velocity at the start, in the axes of the container",
        example=["0 rad/s", "0 rad/s", "1 rad/s"],
    )

    elsewhere: ClassVar = {
        "aspect_ratio": (EXPLICIT, "Leave it out: a box has a size, any other form comes from a file"),
        "equal_area": (EXPLICIT, "Leave it out: radius is the unit of the template"),
        "bond": (EXPLICIT, 'Leave it out, or write shape = "clump", which is rigid'),
        **{
            f"shape={shape}": (EXPLICIT, f'Write shape = "{instead}"')
            for shape, instead in (("disc", "sphere"), ("ellipse", "mesh"), ("bonded", "clump"))
        },
    }

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        raw, good = given
        yield from misplaced(given, "shape", SHAPES_OF)
        needed = NEEDED.get(good.get("shape", ""))
        if needed and needed[0] not in raw:
            yield Mistake((needed[0],), "is missing", f"Add for example {needed[1]}")
        if "step" in raw and "position" not in raw:
            yield Mistake(
                ("step",),
                "has no position that it goes on from",
                'Add position = ["0 m", "0 m", "1 m"], or leave it out',
            )
        if "position" in raw and "step" not in raw and good.get("count", 1) > 1:
            remedy = (
                'Add for example step = ["0 m", "0 m", "1 m"], or leave position out, so that [packing] places them'
            )
            yield Mistake(("step",), f"is missing: all {good['count']} bodies would start at the same place", remedy)
        if good.get("step") == (0.0, 0.0, 0.0) and good.get("count", 1) > 1:
            yield Mistake(("step",), "puts all bodies at the same place", "Make one of its parts differ from 0")
        yield from _wrong_sizes(given)

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        if path[0] == "position":
            return []
        return [(name,) for name in SHAPES_OF if tuple(path) == ("shape",) and value not in SHAPES_OF[name]]


def _wrong_sizes(given: Given) -> Iterator[Mistake]:
    """Numbers of sizes and bodies agree, and only one of radius and scale varies."""
    raw, good = given
    radius, scale, count = good.get("radius"), good.get("scale"), good.get("count")
    for name, sizes in (("radius", radius), ("scale", scale)):
        if sizes and sizes.number and "count" in raw and count != sizes.number:
            rule = f"differs from the {sizes.number} bodies of {name}"
            yield Mistake(("count",), rule, "Leave count out, or make them agree")
    if radius and scale and radius.fixed is None and scale.fixed is None:
        yield Mistake(("scale",), "varies, and so does radius", "Let one of them be one number")


__all__ = ["NEEDED", "SHAPES_OF", "BodyKind"]
