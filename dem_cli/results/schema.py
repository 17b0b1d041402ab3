"""Names, units and meanings of what a result file holds: used by the writer, the reader, the reports and the README."""

from __future__ import annotations

from typing import NamedTuple

FORMAT = "dem-cli results"
# 1: discs only; no semi-axes, bodies or bonds, and `grains` counts what `elements` counts now. 2: runs over time. 3: the layout of runs over
# increments came along; runs over time are written as 2 still. 4: the layout of bodies in 3D (`body_schema`) came along; the others stay.
FORMAT_VERSION = 4

# Series over time: name -> (unit, definition). The writer stores both as attributes of the dataset.
SERIES: dict[str, tuple[str, str]] = {
    "time": ("s", "simulated time"),
    "step": ("1", "number of time steps done"),
    "stage": ("1", "number of the stage, from 0"),
    "time_step": ("s", "time step in use"),
    "void_ratio": ("1", "voids over solids of the whole fill: container width x mean surface height"),
    "porosity": ("1", "voids over total of the whole fill"),
    "void_ratio_inner": ("1", "voids over solids of the inner window, grains clipped exactly"),
    "porosity_inner": ("1", "voids over total of the inner window, grains clipped exactly"),
    "depth": ("m", "fill depth: mean height of the free surface"),
    "roughness": ("m", "standard deviation of the free surface about its straight line of best fit"),
    "mode1": ("m", "amplitude of the antisymmetric surface mode cos(pi x / l)"),
    "coordination": (
        "1",
        "contacts per grain in the fill; a contact of two grains counts for both, one with a wall once",
    ),
    "contacts": ("1", "number of contacts"),
    "sliding": ("1", "share of contacts at the friction limit"),
    "airborne": ("1", "grains above the fill that touch nothing joined to it"),
    "escaped": ("1", "grains that have left the container"),
    "fabric_xx": ("1", "fabric tensor <n n> of contacts between grains"),
    "fabric_xy": ("1", "fabric tensor <n n> of contacts between grains"),
    "fabric_yy": ("1", "fabric tensor <n n> of contacts between grains"),
    "stress_xx": ("Pa", "mean stress of the inner window, compression > 0"),
    "stress_xy": ("Pa", "mean stress of the inner window, symmetric part"),
    "stress_yy": ("Pa", "mean stress of the inner window, compression > 0"),
    "stress_asymmetry": ("Pa", "(stress_xy - stress_yx)/2 before the symmetric part was taken, a check"),
    "bond_gap": ("m", "largest change of the distance of two bonded elements since the start, NaN without bonds"),
    "bond_slip": ("m", "largest sliding of two bonded elements on each other since the start, NaN without bonds"),
    "bond_roll": ("rad", "largest turn of two bonded elements against each other since the start, NaN without bonds"),
    "unbalanced": ("1", "mean resultant force on a grain over mean contact force"),
    "max_overlap": ("1", "largest overlap over the smaller radius of the two bodies"),
    "center_x": ("m", "centre of mass of the grains in the container"),
    "center_y": ("m", "centre of mass of the grains in the container"),
    "kinetic": ("J", "kinetic energy, rotation included"),
    "potential": ("J", "potential energy of gravity, zero at y = 0"),
    "elastic_normal": ("J", "energy of normal springs"),
    "elastic_tangential": ("J", "energy of tangential springs"),
    "friction": ("J", "lost to friction since the start"),
    "dashpot_normal": ("J", "lost to normal dashpots since the start"),
    "dashpot_tangential": ("J", "lost to tangential dashpots since the start"),
    "bond_energy": ("J", "lost to bonds since the start"),
    "damping": ("J", "lost to extra damping since the start"),
    "escaped_energy": ("J", "carried off by grains that left the container"),
    "time_step_energy": ("J", "gained (+) or lost (-) because contacts open and close within a time step"),
    "work": ("J", "work of the shaking on the grains since the start"),
    "energy_in": ("J", "energy put in since the start: potential energy set free and positive work"),
    "residual": ("J", "energy that the ledger cannot account for"),
    "ground_x": ("m", "displacement of the container"),
    "ground_y": ("m", "displacement of the container"),
    "ground_vx": ("m/s", "velocity of the container"),
    "ground_vy": ("m/s", "velocity of the container"),
    "ground_ax": ("m/s^2", "acceleration of the container"),
    "ground_ay": ("m/s^2", "acceleration of the container"),
}

# Series of a quasi-static test, over its increments. 1 and 2 are the axial direction of the stage ("axial", usually y) and the lateral one.
INCREMENTS: dict[str, tuple[str, str]] = {
    "increment": ("1", "number of increments done, 0 the start"),
    "stage": ("1", "number of the stage, from 0"),
    "in_stage": ("1", "number of increments done in the stage"),
    "axial": ("1", "axial direction: 0 is x, 1 is y"),
    "strain_x": ("1", "strain of the width against that at the start of the shearing, compression > 0"),
    "strain_y": ("1", "strain of the height against that at the start of the shearing, compression > 0"),
    "shear_strain": ("1", "e1 - e2, axial less lateral strain"),
    "volumetric_strain": ("1", "1 - area over that at the start of the shearing, contraction > 0"),
    "stress_x": ("Pa", "stress on the boundaries across x, compression > 0; effective where pores are closed"),
    "stress_y": ("Pa", "stress on the boundaries across y, compression > 0; effective where pores are closed"),
    "mean_stress": ("Pa", "(s1 + s2)/2"),
    "deviator": ("Pa", "s1 - s2, axial less lateral stress"),
    "stress_ratio": ("1", "s1/s2, axial over lateral stress"),
    "sine": ("1", "(s1 - s2)/(s1 + s2), the sine of the mobilised friction angle"),
    "pore_pressure": ("Pa", "pressure of the pore water, NaN where pores are drained"),
    "width": ("m", "mean inner width"),
    "height": ("m", "mean inner height"),
    "void_ratio": ("1", "voids over solids inside the boundaries, overlaps of grains counted once"),
    "porosity": ("1", "voids over total inside the boundaries"),
    "contacts": ("1", "number of contacts that carry force"),
    "coordination": ("1", "trace of the coordination tensor: contacts per grain, each counted for both of its grains"),
    "coordination_xx": ("1", "coordination tensor, Kishino (23)"),
    "coordination_xy": ("1", "coordination tensor, Kishino (23)"),
    "coordination_yy": ("1", "coordination tensor, Kishino (23)"),
    "rattlers": ("1", "grains with fewer than two contacts"),
    "sliding": ("1", "share of contacts at the friction limit"),
    "fabric_xx": ("1", "fabric tensor <n n> of contacts between grains"),
    "fabric_xy": ("1", "fabric tensor <n n> of contacts between grains"),
    "fabric_yy": ("1", "fabric tensor <n n> of contacts between grains"),
    "energy_xx": ("J/m^3", "elastic energy tensor, Kishino (24)"),
    "energy_xy": ("J/m^3", "elastic energy tensor, Kishino (24)"),
    "energy_yy": ("J/m^3", "elastic energy tensor, Kishino (24)"),
    "branch_stress_xx": ("Pa", "sum of contact force x branch vector over the area: a check of stress_x"),
    "branch_stress_xy": ("Pa", "the same, symmetric part"),
    "branch_stress_yy": ("Pa", "the same, a check of stress_y"),
    "max_overlap": ("1", "largest overlap over the smaller radius of the two bodies"),
    "work": ("J", "work of the boundary on the grains since the start"),
    "body_work": ("J", "work of gravity since the start"),
    "elastic_normal": ("J", "energy of normal springs"),
    "elastic_tangential": ("J", "energy of tangential springs"),
    "elastic_membrane": ("J", "energy of the links of membranes"),
    "friction": ("J", "dissipated by sliding since the start, Kishino (25)-(29)"),
    "released": ("J", "set free by collapses since the start"),
    "residual": ("J", "energy that the ledger cannot account for"),
    "largest_share": (
        "1",
        "share of the contact that dissipates most in the dissipation of the increment, NaN without any",
    ),
    "event": ("1", "1 where the increment passed through a collapse"),
    "balance": ("N", "largest fixing force that is left, Kishino (14)"),
    "unbalanced": ("1", "mean resultant force on a grain over mean contact force"),
    "iterations": ("1", "iterations of the increment"),
    "sub_steps": ("1", "sub-steps of the increment"),
    "rung": ("1", "highest fallback of the solver that was needed, 0 for none"),
}
# The contacts that dissipate most, over /dissipation/increment and /dissipation/rank, sorted; NaN (-1 for bodies) beyond the last.
DISSIPATION: dict[str, tuple[str, str]] = {
    "i": ("1", "number of the first element"),
    "j": ("1", "number of the other element, -1 - w for wall w"),
    "energy": ("J", "dissipated in this increment"),
    "share": ("1", "share in the dissipation of all contacts in this increment"),
}
RANKS = 20

# Tracks of chosen discs and ellipses over /tracks/time, shape (times, elements), in the container's frame.
TRACKS: dict[str, tuple[str, str]] = {
    "x": ("m", "position"),
    "y": ("m", "position"),
    "angle": ("rad", "rotation, anticlockwise"),
    "vx": ("m/s", "velocity"),
    "vy": ("m/s", "velocity"),
    "spin": ("rad/s", "angular velocity"),
}

# The free surface over /surface/time and /surface/x.
SURFACE: dict[str, tuple[str, str]] = {
    "x": ("m", "centre of a bin"),
    "eta": ("m", "height of the free surface, airborne grains left out"),
}

# Stages, over /stages/stage; `before` and `after` over /stages/quantity too.
STAGES: dict[str, tuple[str, str]] = {
    "stage": ("1", "number of the stage, from 0"),
    "name": ("1", "name in the scenario"),
    "kind": ("1", "settle, shake, run"),
    "start": ("s", "simulated time"),
    "end": ("s", "simulated time, NaN if the stage has not ended"),
    "reason": ("1", "why it ended"),
    "before": ("1", "series at the start, in the units of /stages/units"),
    "after": ("1", "series at the end, in the units of /stages/units"),
}

# What a frame holds beside grains and contacts, over /frames/time.
FRAMES: dict[str, tuple[str, str]] = {
    **{name: SERIES[name] for name in ("time", "step", "stage", "time_step")},
    **{f"ground_{name}": SERIES[f"ground_{name}"] for name in ("x", "y", "vx", "vy", "ax", "ay")},
    "kinetic": SERIES["kinetic"],
    "potential": SERIES["potential"],
    "elastic_normal": SERIES["elastic_normal"],
    "elastic_tangential": SERIES["elastic_tangential"],
    "friction": SERIES["friction"],
    "dashpot_normal": SERIES["dashpot_normal"],
    "dashpot_tangential": SERIES["dashpot_tangential"],
    "bond_energy": SERIES["bond_energy"],
    "damping": SERIES["damping"],
    "escaped_energy": SERIES["escaped_energy"],
    "time_step_energy": SERIES["time_step_energy"],
    "work": SERIES["work"],
    "residual": SERIES["residual"],
    "energy_in": SERIES["energy_in"],
    "unbalanced": SERIES["unbalanced"],
    "stage_start": ("1", "1 where a stage begins"),
    "stage_end": ("1", "1 where a stage ends"),
}

# What a frame of a quasi-static test holds beside grains, contacts and walls, over /frames/increment.
INCREMENT_FRAMES: dict[str, tuple[str, str]] = {
    **{name: INCREMENTS[name] for name in ("increment", "stage", "in_stage", "axial", "width", "height")},
    "area": ("m^2", "area of the sample, inside walls or chains"),
    **{
        name: INCREMENTS[name]
        for name in (
            "stress_x", "stress_y", "strain_x", "strain_y", "pore_pressure",
            "work", "body_work", "elastic_normal", "elastic_tangential", "elastic_membrane", "friction", "released", "residual",
            "balance", "unbalanced", "iterations", "sub_steps", "rung", "event",
        )
    },
    "stage_start": FRAMES["stage_start"],
    "stage_end": FRAMES["stage_end"],
    "row": ("1", "row of /series that belongs to the frame, from 0; -1 if there is none"),
}  # fmt: skip

# Bonds between elements of a grain, over /bonds/bond; there is no such group where there are none.
BONDS: dict[str, tuple[str, str]] = {
    "i": ("1", "number of the first element"),
    "j": ("1", "number of the second element"),
    "normal": ("N s/m", "viscosity against moving apart or closer"),
    "tangential": ("N s/m", "viscosity against sliding at the common point"),
    "rolling": ("N m s", "viscosity against turning of one element against the other, 0: they roll freely"),
}
# What the bonds have given since the start, over /bonds/time, a row a frame, and /bonds/bond.
BOND_STRAIN: dict[str, tuple[str, str]] = {
    "gap": ("m", "centres further apart (+) or closer (-)"),
    "slip": ("m", "sliding at the common point"),
    "roll": ("rad", "turn of the second element against the first, anticlockwise"),
}


class Column(NamedTuple):
    """One array of /VTKHDF/PointData or CellData: shape (rows,) or (rows, width)."""

    unit: str
    definition: str
    dtype: str
    width: int = 1
    stored: tuple[int, ...] = ()  # of `width` columns, those that are ever other than zero
    static: bool = False  # written once and shared by all frames
    fill: int = 0  # value on helper points (and, for cells, on the elements' vertices)


# Points of a frame: first the elements, then two ends a wall, then one foot point a contact with a wall.
POINT_DATA: dict[str, Column] = {
    "id": Column("1", "number of the element (a disc or ellipse), -1 on helper points", "i4", static=True, fill=-1),
    "body": Column(
        "1", "number of the grain that the element belongs to, -1 on helper points", "i4", static=True, fill=-1
    ),
    "radius": Column("m", "radius of the disc of equal area", "f8", static=True),
    "a": Column("m", "larger semi-axis", "f8", static=True),
    "b": Column("m", "smaller semi-axis", "f8", static=True),
    "mass": Column("kg", "mass of the cylinder of the scenario's depth", "f8", static=True),
    "inertia": Column("kg m^2", "moment of inertia about the centre", "f8", static=True),
    "shape": Column("m", "tensor whose principal values are the diameters", "f8", 9, (0, 4), static=True),
    "angle": Column("rad", "angle of the semi-axis a, anticlockwise from +x", "f8"),
    "velocity": Column("m/s", "velocity in the container's frame", "f8", 3, (0, 1)),
    "spin": Column("rad/s", "angular velocity, anticlockwise", "f8"),
    "coordination": Column("1", "number of contacts", "i2"),
    "stress": Column("Pa", "mean stress tensor of the element, compression > 0", "f4", 9, (0, 1, 3, 4)),
    "escaped": Column("1", "1 once the grain has left the container", "u1"),
}

# In a file with ellipses the shape turns with the element; single precision, as a, b and angle hold every bit.
TURNING_SHAPE = POINT_DATA["shape"]._replace(dtype="f4", stored=(0, 1, 3, 4), static=False)

# Cells of a frame: first one vertex an element, then one line a contact, one line a wall, one line a bond.
CELL_DATA: dict[str, Column] = {
    "kind": Column("1", "0 element, 1 contact of two elements, 2 contact with a wall, 3 wall, 4 nothing, 5 bond", "u1"),
    "wall": Column("1", "number of the wall, -1 if none", "i2", fill=-1),
    "sliding": Column("1", "1 where the friction limit is reached", "u1"),
    "normal_force": Column("N", "normal force, compression > 0", "f8"),
    "shear_force": Column("N", "force on the second body along (-ny, nx)", "f8"),
    "overlap": Column("m", "overlap", "f8"),
    "stretch": Column("m", "elastic tangential stretch", "f8"),
    "normal": Column("1", "unit normal from the first body to the second", "f8", 3, (0, 1)),
    "contact_point": Column("m", "contact point", "f8", 3, (0, 1)),
}
KIND_ELEMENT, KIND_CONTACT, KIND_WALL_CONTACT, KIND_WALL, KIND_NOTHING, KIND_BOND = range(6)
