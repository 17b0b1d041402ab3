"""Names, units and meanings of what a result file of bodies in 3D holds (engine "impulse"), where it differs from `schema`.

Vectors are in the container's axes, z up; a body is "present" until it has escaped.
"""

from __future__ import annotations

from dem_cli.results.schema import FRAMES, KIND_CONTACT, KIND_WALL_CONTACT, SERIES, Column

MOVING = 1e-3  # m/s; a body is at rest below that

_SOLVING: dict[str, tuple[str, str]] = {
    "steps": ("1", "time steps since the row before, which the solver's numbers below tell of"),
    "impacts": ("1", "groups of touching bodies with an impact to solve, summed over those steps"),
    "impact_iterations": ("1", "iterations of the solver of impacts in a step, mean"),
    "load_sweeps": ("1", "sweeps of the solver of lasting contacts in a step, mean"),
    "most_iterations": ("1", "most iterations of one solve"),
    "capped": ("1", "solves that hit a cap of iterations, since the start of the run"),
    "solver_residual": ("m/s", "largest change of a contact's velocity that a solve ended with"),
    "islands": ("1", "groups of bodies that touch, in the last step"),
    "largest_island": ("1", "contact points of the largest group, in the last step"),
}
_ENERGY: dict[str, tuple[str, str]] = {
    "kinetic": ("J", "kinetic energy of the centres of mass"),
    "rotational": ("J", "kinetic energy of rotation about the centres of mass"),
    "potential": ("J", "potential energy of gravity, zero at the origin"),
    "restitution_energy": ("J", "lost in impacts since the start: work of the normal impulses"),
    "friction": ("J", "lost to friction since the start: work of the tangential impulses"),
    "projection": ("J", "gained (+) or lost (-) since the start where penetrating bodies are moved apart"),
    "escaped_energy": ("J", "carried off by bodies that left the scene"),
    "work": ("J", "work of the shaking on the bodies since the start"),
    "residual": ("J", "energy that the ledger cannot account for: rotation of bodies in free flight"),
    "energy_in": (
        "J",
        "energy put in: kinetic energy at the start, potential energy set free and positive work since then",
    ),
}
_GROUND: dict[str, tuple[str, str]] = {
    f"ground_{kind}{axis}": (unit, f"{what} of the container")
    for kind, unit, what in (("", "m", "displacement"), ("v", "m/s", "velocity"), ("a", "m/s^2", "acceleration"))
    for axis in "xyz"
}

# Series over time.
BODY_SERIES: dict[str, tuple[str, str]] = {
    **{name: SERIES[name] for name in ("time", "step", "stage", "time_step")},
    **_GROUND,
    **_ENERGY,
    **{f"momentum_{axis}": ("kg m/s", "momentum of the bodies present") for axis in "xyz"},
    **{
        f"angular_momentum_{axis}": ("kg m^2/s", "angular momentum of the bodies present about the origin")
        for axis in "xyz"
    },
    "contacts": ("1", "number of contact points; two bodies may touch at several"),
    "touching": ("1", "number of pairs that touch: of two bodies, and of a body and a plane or the terrain"),
    "coordination": (
        "1",
        "touching pairs of a body present, mean; a pair of two bodies counts for both, one with a plane or the terrain once",
    ),
    "sliding": ("1", "share of contact points at the friction limit, NaN without any"),
    "penetration": ("m", "largest penetration of a contact point, 0 without any"),
    "penetration_mean": ("m", "mean penetration over all contact points, those that are apart counting 0"),
    **_SOLVING,
    "center_x": ("m", "centre of mass of the bodies present"),
    "center_y": ("m", "centre of mass of the bodies present"),
    "center_z": ("m", "centre of mass of the bodies present"),
    "top": ("m", "z of the highest point of a body present"),
    "speed_max": ("m/s", "largest speed of a centre of mass"),
    "moving": (
        "1",
        "bodies present that move by more than 1 mm/s: speed of the centre of mass, or angular speed times reach",
    ),
    "escaped": ("1", "bodies that have left the scene"),
    "fill_height": (
        "m",
        "mean height of the top surface over the floor of the container: highest point of the bodies of the bed at each place, "
        "0 where there is none; NaN without a container, or while fewer than half of the bodies belong to the bed that "
        "joins the floor by contacts",
    ),
    "void_ratio": (
        "1",
        "voids over solids of the whole bed: floor of the container x fill_height, volume of its bodies",
    ),
}

# Tracks of chosen bodies over /tracks/time, shape (times, bodies).
BODY_TRACKS: dict[str, tuple[str, str]] = {
    **dict.fromkeys("xyz", ("m", "centre of mass")),
    **{f"q{k}": ("1", f"orientation, a unit quaternion w, x, y, z: component {k}") for k in range(4)},
    **{f"v{axis}": ("m/s", "velocity of the centre of mass") for axis in "xyz"},
    **{f"w{axis}": ("rad/s", "angular velocity") for axis in "xyz"},
}

# What a frame holds beside bodies and contacts, over /frames/time.
BODY_FRAMES: dict[str, tuple[str, str]] = {
    **{name: SERIES[name] for name in ("time", "step", "stage", "time_step")},
    **_GROUND,
    **_ENERGY,
    **_SOLVING,
    "stage_start": FRAMES["stage_start"],
    "stage_end": FRAMES["stage_end"],
}

# Points of a frame: first the bodies (centres of mass), then four corners a plane, then one foot point a contact with a plane or the
# terrain. ParaView's 3D Glyphs turn a body by `orientation`, mode "Quaternion".
BODY_POINT_DATA: dict[str, Column] = {
    "id": Column("1", "number of the body, -1 on helper points", "i4", static=True, fill=-1),
    "group": Column("1", "number of its kind in /groups, -1 on helper points", "i4", static=True, fill=-1),
    "shape": Column("1", "number of its shape in /shapes, -1 on helper points", "i4", static=True, fill=-1),
    "scale": Column("1", "factor of all lengths of its shape", "f8", static=True),
    "material": Column("1", "number of its material in /materials, -1 on helper points", "i4", static=True, fill=-1),
    "mass": Column("kg", "mass", "f8", static=True),
    "inertia": Column("kg m^2", "principal moments of inertia", "f8", 3, static=True),
    "orientation": Column("1", "unit quaternion w, x, y, z that turns the shape's axes into the container's", "f8", 4),
    "velocity": Column("m/s", "velocity of the centre of mass", "f8", 3),
    "angular_velocity": Column("rad/s", "angular velocity in the container's axes", "f8", 3),
    "speed": Column("m/s", "magnitude of the velocity", "f4"),
    "coordination": Column("1", "bodies, planes and terrain that it touches", "i2"),
    "escaped": Column("1", "1 once the body has left the scene", "u1"),
}
# Columns of `Bodies` that no frame changes.
FIXED = ("id", "group", "shape", "scale", "material", "mass", "inertia")

# Cells of a frame: first one vertex a body, then one line a contact point, four lines a plane.
BODY_CELL_DATA: dict[str, Column] = {
    "kind": Column(
        "1",
        "0 body, 1 contact of two bodies, 2 contact with a plane or the terrain, 3 edge of a plane, 4 nothing",
        "u1",
    ),
    "wall": Column("1", "number of the plane, that of the terrain is the number of planes; -1 if none", "i2", fill=-1),
    "sliding": Column("1", "1 where the friction limit is reached", "u1"),
    "gap": Column("m", "distance, < 0 is penetration", "f8"),
    "normal": Column("1", "unit normal from the first body to the second", "f8", 3),
    "contact_point": Column("m", "contact point", "f8", 3),
    "impulse": Column("N s", "impulse of the first body on the second in the last step", "f8", 3),
    "normal_impulse": Column("N s", "its part along the normal, compression > 0", "f4"),
    "normal_force": Column("N", "mean normal force of the last step: normal impulse over time step", "f4"),
}
CONTACT_KINDS = (KIND_CONTACT, KIND_WALL_CONTACT)

# Arrays of a shape, in /shapes/K: name -> (unit, definition). Attributes of the group: name, kind, spacing [m], mass [kg],
# volume [m^3], reach [m].
SHAPE: dict[str, tuple[str, str]] = {
    "vertices": ("m", "corners of the surface, in the shape's own axes from its centre of mass"),
    "triangles": ("1", "corners of each triangle, anticlockwise seen from outside"),
    "centers": ("m", "centres of the spheres of a clump"),
    "radii": ("m", "radii of the spheres of a clump"),
    "points": ("m", "points that contacts are looked for at, beside corners"),
    "normals": ("1", "outward normal at each point"),
    "trusted": ("1", "1 where the normal of a point is one, not so near edges and corners of clouds"),
    "inertia": ("kg m^2", "principal moments"),
}
