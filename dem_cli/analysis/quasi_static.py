"""Measures of an increment of a quasi-static test: tensors and roses of Kishino 1988, stresses, strains, void ratio, dissipation.

Tensors and roses do without the compiler, so that pictures can be made of a stored increment at once. Only contacts that carry force
are looked at (Kishino 4 (3)). A contact between two grains belongs to both of them; of one with a wall or a boundary grain half is the
boundary's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from dem_cli.state import Bools, Contacts, Floats, Increment, Ints

SECTORS = 36  # of the whole circle


@dataclass(frozen=True)
class IncrementMeasures:
    """Measures of an increment with n elements.

    row: the row of the series, named as in results.schema.INCREMENTS. coordination: contacts of each element, shape (n,).
    stress [Pa]: xx, xy, yx, yy in each element, shape (n, 4).
    """

    row: dict[str, float]
    coordination: Ints
    stress: Floats


def measure_increment(increment: Increment, depth: float, kn: float, kt: float) -> IncrementMeasures:
    """Measure an increment with grains of thickness `depth` [m] and virtual springs kn, kt [N/m]."""
    from dem_cli.analysis import stress  # brings the compiler along

    grains, inner = increment.grains, len(increment.grains) - increment.boundary
    touching = increment.contacts
    carrying = force_carrying(touching)
    between = _take(carrying, (carrying.i < inner) & (carrying.j >= 0) & (carrying.j < inner))
    coordination = stress.coordination(grains, carrying)
    fabric = stress.fabric(between)
    numbers = {
        "contacts": float(len(carrying)),
        "rattlers": float(np.count_nonzero(coordination[:inner] < 2)),
        "sliding": stress.sliding_share(carrying),
        "fabric_xx": float(fabric[0, 0]),
        "fabric_xy": float(fabric[0, 1]),
        "fabric_yy": float(fabric[1, 1]),
        "max_overlap": stress.max_overlap_ratio(grains.b, touching),
    }
    row = {
        **_state(increment),
        **_voids(increment),
        **numbers,
        **_tensor("coordination", coordination_tensor(increment)),
        **_tensor("energy", energy_tensor(increment, depth, kn, kt)),
        **_tensor("branch_stress", branch_stress(increment, depth)),
        "largest_share": _largest_share(increment.slips.energy),
    }
    row["coordination"] = row["coordination_xx"] + row["coordination_yy"]
    row = {name: float(value) for name, value in row.items()}
    return IncrementMeasures(row, coordination, stress.grain_stress(grains, carrying, depth))


def _state(increment: Increment) -> dict[str, float]:
    """Numbers that follow from those of the increment alone."""
    axial, lateral = increment.axial, 1 - increment.axial
    s1, s2 = float(increment.stress[axial]), float(increment.stress[lateral])
    e1, e2 = float(increment.strain[axial]), float(increment.strain[lateral])
    energy = increment.energy
    return {
        "increment": float(increment.number),
        "stage": float(increment.stage),
        "in_stage": float(increment.in_stage),
        "axial": float(axial),
        "strain_x": float(increment.strain[0]),
        "strain_y": float(increment.strain[1]),
        "shear_strain": e1 - e2,
        "volumetric_strain": e1 + e2 - e1 * e2,  # 1 - (1 - e1)(1 - e2) without the loss of digits
        "stress_x": float(increment.stress[0]),
        "stress_y": float(increment.stress[1]),
        "mean_stress": 0.5 * (s1 + s2),
        "deviator": s1 - s2,
        "stress_ratio": s1 / s2 if s2 > 0.0 else math.nan,
        "sine": (s1 - s2) / (s1 + s2) if s1 + s2 > 0.0 else math.nan,
        "pore_pressure": increment.pore_pressure,
        "width": increment.width,
        "height": increment.height,
        "work": energy.work,
        "body_work": energy.body_work,
        "elastic_normal": energy.elastic_normal,
        "elastic_tangential": energy.elastic_tangential,
        "elastic_membrane": energy.elastic_membrane,
        "friction": energy.friction,
        "released": energy.released,
        "residual": energy.residual,
        "event": float(increment.event),
        "balance": increment.balance,
        "unbalanced": increment.unbalanced,
        "iterations": float(increment.iterations),
        "sub_steps": float(increment.sub_steps),
        "rung": float(increment.rung),
    }


def _voids(increment: Increment) -> dict[str, float]:
    """Void ratio and porosity: the area of the sample against what its grains cover, inside the walls, overlaps counted once.

    What a grain has pressed into a wall is no solid of the sample; a boundary grain takes nothing off.
    """
    from dem_cli.analysis.void_ratio import Rectangle, porosity, solid_area, void_ratio

    member = np.arange(len(increment.grains)) < len(increment.grains) - increment.boundary
    solid = solid_area(increment.grains, member, increment.contacts, Rectangle(*increment.walls.box))
    return {"void_ratio": void_ratio(increment.area, solid), "porosity": porosity(increment.area, solid)}


def _largest_share(energy: Floats) -> float:
    """Share of the contact that dissipates most; NaN where nothing is dissipated.

    A force that turns round within a sub-step may give a contact a negative trifle by (28): that is no part of the whole.
    """
    total = float(energy[energy > 0.0].sum())
    return float(energy.max()) / total if total > 0.0 else math.nan


def _tensor(name: str, tensor: Floats) -> dict[str, float]:
    mixed = 0.5 * (tensor[0, 1] + tensor[1, 0])
    return {f"{name}_xx": float(tensor[0, 0]), f"{name}_xy": float(mixed), f"{name}_yy": float(tensor[1, 1])}


def force_carrying(contacts: Contacts) -> Contacts:
    """The contacts with a normal force."""
    return _take(contacts, contacts.normal > 0.0)


def _take(contacts: Contacts, keep: Bools) -> Contacts:
    return contacts if keep.all() else replace(contacts, **{name: getattr(contacts, name)[keep] for name in _COLUMNS})


_COLUMNS = tuple(Contacts.__dataclass_fields__)


def halves(increment: Increment, contacts: Contacts) -> Ints:
    """How many grains of the sample take part in each contact, shape (c,): 2, 1 at the boundary, 0 within it."""
    inner = len(increment.grains) - increment.boundary
    of_i, of_j = contacts.i < inner, (contacts.j >= 0) & (contacts.j < inner)
    return of_i.astype(np.int64) + of_j


def contact_energy(contacts: Contacts, kn: float, kt: float) -> Floats:
    """e_c = (pn^2/kn + pt^2/kt)/2 of each contact, shape (c,) [J]; Kishino (22). kt = 0: no tangential spring, so no energy in it."""
    tangential = contacts.shear**2 / kt if kt > 0.0 else np.zeros(len(contacts))
    return np.asarray(0.5 * (contacts.normal**2 / kn + tangential))


def _normals(contacts: Contacts, weight: Floats | Ints) -> Floats:
    """Sum of weight n (x) n over contacts, shape (2, 2)."""
    n = np.stack([contacts.nx, contacts.ny])
    return np.asarray((weight * n) @ n.T)


def coordination_tensor(increment: Increment) -> Floats:
    """C_ij = (sum over grains of sum over their contacts of n_i n_j)/N, shape (2, 2); Kishino (23). Its trace is the coordination number."""
    contacts = force_carrying(increment.contacts)
    number = len(increment.grains) - increment.boundary
    return _normals(contacts, halves(increment, contacts)) / number if number else np.full((2, 2), math.nan)


def energy_tensor(increment: Increment, depth: float, kn: float, kt: float) -> Floats:
    """E_ij = (sum over grains of sum over their contacts of e_c n_i n_j)/(2 A) over the thickness, shape (2, 2) [J/m^3]; Kishino (24).

    Its trace is the density of elastic energy in the sample, without the boundary's half of contacts there.
    """
    contacts = force_carrying(increment.contacts)
    weight = halves(increment, contacts) * contact_energy(contacts, kn, kt)
    return _normals(contacts, weight) / (2.0 * increment.area * depth)


def branch_stress(increment: Increment, depth: float) -> Floats:
    """Sum of contact force (x) branch vector over area and thickness, shape (2, 2) [Pa], compression > 0 (physics.md 0).

    The branch runs from centre to centre, at walls and boundary grains to the contact point. In equilibrium without gravity it is the
    stress on the boundary, and symmetric.
    """
    c = force_carrying(increment.contacts)
    grains, inner = increment.grains, len(increment.grains) - increment.boundary
    to_grain = (c.j >= 0) & (c.j < inner)
    other = np.where(to_grain, c.j, c.i)  # an index that there is, for the contacts that end at their point
    start = [np.where(c.i < inner, centre[c.i], point) for centre, point in ((grains.x, c.px), (grains.y, c.py))]
    end = [np.where(to_grain, centre[other], point) for centre, point in ((grains.x, c.px), (grains.y, c.py))]
    branch = np.array(end) - np.array(start)
    force = np.stack([c.normal * c.nx - c.shear * c.ny, c.normal * c.ny + c.shear * c.nx])
    return np.asarray(force @ branch.T) / (increment.area * depth)


def contact_rose(increment: Increment, sectors: int = SECTORS) -> Floats:
    """Share of contacts [%] that face each way, shape (sectors,), summing to 100; Kishino Fig. 11. NaN without a contact.

    Sector k has its middle at k/sectors of the circle from +x, so that walls fall into the middle of theirs. A contact faces both ways, n and
    -n; one at the boundary counts half.
    """
    contacts = force_carrying(increment.contacts)
    return _rose(contacts, halves(increment, contacts).astype(float), sectors)


def energy_rose(increment: Increment, kn: float, kt: float, sectors: int = SECTORS) -> Floats:
    """Share of elastic energy [%] in contacts that face each way, as `contact_rose`; Kishino Fig. 12."""
    contacts = force_carrying(increment.contacts)
    return _rose(contacts, halves(increment, contacts) * contact_energy(contacts, kn, kt), sectors)


def _rose(contacts: Contacts, weight: Floats, sectors: int) -> Floats:
    if sectors < 2 or sectors % 2:
        raise ValueError("a contact faces both ways: the number of sectors must be even")
    turn = np.arctan2(contacts.ny, contacts.nx) / (2.0 * np.pi)
    sector = np.floor(turn * sectors + 0.5).astype(np.int64)
    both = np.concatenate([sector, sector + sectors // 2]) % sectors
    total = 2.0 * float(weight.sum())
    if not total > 0.0:
        return np.full(sectors, math.nan)
    return np.asarray(np.bincount(both, np.concatenate([weight, weight]), minlength=sectors) * (100.0 / total))
