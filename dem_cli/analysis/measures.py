"""All measures of one frame, and the row of the series: they and the engine's own numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dem_cli.analysis import bodies, stress, surface
from dem_cli.analysis.void_ratio import (
    WindowMargins,
    container,
    inner_window,
    porosity,
    solid_area,
    void_ratio,
)
from dem_cli.state import BondStrain, Bools, Floats, Frame, Ints


@dataclass(frozen=True)
class Measures:
    """Measures of a frame with n elements.

    row: the measured part of the series, named as in results.schema. eta [m]: free surface, shape (bins,).
    coordination: contacts of the grain of each element, shape (n,). stress [Pa]: xx, xy, yx, yy in that grain, shape (n, 4).
    """

    row: dict[str, float]
    eta: Floats
    coordination: Ints
    stress: Floats


def measure_frame(
    frame: Frame,
    *,
    width: float,
    depth: float,
    surface_bins: int = 40,
    window: WindowMargins = WindowMargins(),  # noqa: B008 (immutable)
) -> Measures:
    """Measure a frame in a container of `width` [m] with grains of thickness `depth` [m]; ValueError
    without contacts.

    There is a bed once the fill holds at least half of the grains in the container. Before, as grains
    fall, void ratios, porosities and stresses are NaN, while surface and depth tell of what lies on the
    floor. Grains that have escaped, or whose position is not finite, are in no measure but the number of
    escaped ones.
    """
    contacts = frame.contacts
    if contacts is None:
        raise ValueError("a frame without contacts cannot be measured")
    grains = frame.grains
    x, y = grains.x, grains.y
    inside = bodies.whole(grains, ~grains.escaped)
    present = inside & bodies.whole(grains, np.isfinite(x) & np.isfinite(y))
    found = surface.find_surface(grains, present, contacts, width, surface_bins)
    level = surface.mean_depth(found.eta)
    # one element a grain, to count grains by
    head = slice(None) if bodies.single(grains) else bodies.first_elements(grains)
    fill = found.fill[head]
    number = np.count_nonzero(fill)
    has_bed = number > 0 and 2 * number >= np.count_nonzero(present[head])

    inner = inner_window(width, lowest_surface(found.eta, window), window)
    whole_solid = inner_solid = math.nan
    sigma = np.full((2, 2), math.nan)
    if has_bed:
        whole_solid = solid_area(grains, found.fill, contacts, container(width))
        inner_solid = solid_area(grains, found.fill, contacts, inner)
        sigma = stress.window_stress(*bodies.centres(grains), contacts, inner, depth)
    coordination = stress.coordination(grains, contacts)
    fabric = stress.fabric(contacts)
    center_x, center_y = _center_of_mass(grains.mass, x, y, present)
    row = {
        "void_ratio": void_ratio(width * level, whole_solid),
        "porosity": porosity(width * level, whole_solid),
        "void_ratio_inner": void_ratio(inner.area, inner_solid),
        "porosity_inner": porosity(inner.area, inner_solid),
        "depth": level,
        "roughness": surface.roughness(found.eta),
        "mode1": surface.antisymmetric_mode(found.eta),
        "coordination": float(coordination[head][fill].mean()) if number else math.nan,
        "contacts": float(len(contacts)),
        "sliding": stress.sliding_share(contacts),
        "airborne": float(np.count_nonzero(found.airborne[head])),
        "escaped": float(np.count_nonzero(~inside[head])),
        "fabric_xx": float(fabric[0, 0]),
        "fabric_xy": float(fabric[0, 1]),
        "fabric_yy": float(fabric[1, 1]),
        "stress_xx": float(sigma[0, 0]),
        "stress_xy": float(0.5 * (sigma[0, 1] + sigma[1, 0])),
        "stress_yy": float(sigma[1, 1]),
        "stress_asymmetry": float(0.5 * (sigma[0, 1] - sigma[1, 0])),
        "max_overlap": stress.max_overlap_ratio(grains.b, contacts),
        "center_x": center_x,
        "center_y": center_y,
    }
    return Measures(row, found.eta, coordination, stress.grain_stress(grains, contacts, depth))


def series_row(frame: Frame, measures: Measures) -> dict[str, float]:
    """The full row of the series, a value for each name of SERIES: measures and the engine's numbers."""
    energy = frame.energy
    (ground_x, ground_y), (ground_vx, ground_vy), (ground_ax, ground_ay) = frame.ground.tolist()
    return {
        "time": frame.time,
        "step": float(frame.step),
        "stage": float(frame.stage),
        "time_step": frame.dt,
        **measures.row,
        **_bond_strain(frame.bonds),
        "unbalanced": frame.unbalanced,
        "kinetic": energy.kinetic,
        "potential": energy.potential,
        "elastic_normal": energy.elastic_normal,
        "elastic_tangential": energy.elastic_tangential,
        "friction": energy.friction,
        "dashpot_normal": energy.dashpot_normal,
        "dashpot_tangential": energy.dashpot_tangential,
        "bond_energy": energy.bonds,
        "damping": energy.damping,
        "escaped_energy": energy.escaped,
        "time_step_energy": energy.time_step,
        "work": energy.work,
        "energy_in": frame.energy_in,
        "residual": frame.residual,
        "ground_x": ground_x,
        "ground_y": ground_y,
        "ground_vx": ground_vx,
        "ground_vy": ground_vy,
        "ground_ax": ground_ax,
        "ground_ay": ground_ay,
    }


def _bond_strain(bonds: BondStrain | None) -> dict[str, float]:
    """Largest gap [m], slip [m] and roll [rad] of the bonds in magnitude; NaN without a bond."""
    if bonds is None or not len(bonds.gap):
        return dict.fromkeys(("bond_gap", "bond_slip", "bond_roll"), math.nan)
    return {
        "bond_gap": float(np.abs(bonds.gap).max()),
        "bond_slip": float(np.abs(bonds.slip).max()),
        "bond_roll": float(np.abs(bonds.roll).max()),
    }


def lowest_surface(eta: Floats, margins: WindowMargins) -> float:
    """Lowest bin [m] of the free surface above the inner window: where the fill leans, the window stays below its surface."""
    bins = len(eta)
    first = min(math.floor(margins.side * bins), (bins - 1) // 2)
    return float(eta[first : bins - first].min())


def _center_of_mass(mass: Floats, x: Floats, y: Floats, present: Bools) -> tuple[float, float]:
    """Centre of mass [m] of the grains with present = True; NaN without one."""
    m = mass[present]
    total = float(m.sum())
    if not total > 0.0:
        return math.nan, math.nan
    return float(m @ x[present]) / total, float(m @ y[present]) / total
