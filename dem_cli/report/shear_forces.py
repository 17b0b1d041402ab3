"""The sample of a shear test at an instant, as in Kishino's figures 6, 8, 10, 11 and 12: contact forces, and roses of contact normals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dem_cli.analysis.quasi_static import SECTORS, contact_energy, contact_rose, energy_rose, force_carrying, halves
from dem_cli.errors import ScenarioError
from dem_cli.report.look import (
    COLORS,
    axis_label,
    display_unit,
    folded,
    footnote,
    heading,
    narrow,
    new_figure,
    stage_label,
)
from dem_cli.report.moments import BOUNDARY, frame_box, frames_of_stage
from dem_cli.report.shear_rows import one_shear_stage, shown_peak, stage_rows
from dem_cli.results import Results, StoredIncrement
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

FORCE = "#B2182B"
GRAIN = "#F4F1EA"
WIDEST = 0.5  # width of the largest force over the mean radius


@dataclass(frozen=True)
class Moment:
    """A stored frame and what it stands for: "start", "peak" or empty."""

    index: int
    name: str
    frame: StoredIncrement
    text: str


def moment(results: Results, index: int, name: str = "") -> Moment:
    """Frame `index`, described by the increment of its stage."""
    frame = results.increment(index)
    number = round(float(results.frame_times[index]))
    text = f"{name + ', ' if name else ''}increment {number}"
    row = np.flatnonzero(np.asarray(results.series["increment"]) == number)
    if len(row):
        strain = 100.0 * float(results.series["shear_strain"][row[-1]])
        if np.isfinite(strain):
            text += f", e1 - e2 = {strain:.3g} %"
    return Moment(index, name, frame, text)


def start_and_peak(results: Results, number: int | None) -> list[Moment]:
    """Frames nearest to the start of a stage of shearing and to its peak of s1/s2 (its end where there is no peak)."""
    stage = one_shear_stage(results, number)
    rows = stage_rows(results, stage)
    inside = frames_of_stage(results, stage)
    at = np.asarray(results.frame_times)[inside]
    peak = shown_peak(rows)
    last = len(rows["increment"]) - 1
    start, top = rows["increment"][0], rows["increment"][last if peak is None else peak]
    if np.isnan(start):
        start = at[0]
    found = []
    for name, wanted in (("start", start), ("end" if peak is None else "peak", top)):
        k = int(np.argmin(np.abs(at - wanted)))
        near = "" if abs(at[k] - wanted) < 0.5 else "near the "
        found.append(moment(results, int(inside[k]), near + name))
    return found


def stage_text(results: Results, number: int | None) -> str:
    found = one_shear_stage(results, number)
    return stage_label(found, results.stages[found - 1])


# ---------------------------------------------------------------------------------------------- forces


def draw_forces(results: Results, moments: list[Moment], text: str) -> Figure:
    """Contact forces of one frame, or of several side by side on one scale."""
    views = [frame_box(one.frame) for one in moments]
    wide, high = max(v[1] - v[0] for v in views), max(v[3] - v[2] for v in views)
    size = 4.4 if len(moments) > 1 else 6.0
    figure = new_figure(size * len(moments), min(size * high / wide, 9.0) + 1.1, rigid=narrow())
    axes = np.atleast_1d(figure.subplots(1, len(moments)))
    largest = largest_force([one.frame for one in moments])
    boundary = results.boundary
    for ax, one in zip(axes, moments, strict=True):
        panel_forces(ax, one.frame, largest, boundary, (wide, high))
        ax.set_title(folded(one.text))
    heading(figure, results, f"Contact forces, {text}" if text else "Contact forces")
    footnote(figure, force_note(largest, boundary))
    return figure


def force_note(largest: float, boundary: int) -> str:
    scale, unit = display_unit("N", largest)
    note = f"rectangles: contact forces, as wide as they are large (widest: {largest / scale:.3g} {unit})"
    return note + ("; blue grey: boundary grains" if boundary else "")


def largest_force(frames: list[StoredIncrement]) -> float:
    """Largest contact force of all frames [N], 0 without contacts."""
    return max(
        (float(np.hypot(c.normal, c.shear).max(initial=0.0)) for c in (frame.contacts for frame in frames)), default=0.0
    )


def panel_forces(ax: Axes, frame: StoredIncrement, largest: float, boundary: int, size: tuple[float, float]) -> None:
    """Grains as outlines, walls, and a slender rectangle through each contact point along its force.

    size: width and height [m] of the view, about the middle of the sample. boundary: boundary elements at the end of the grains.
    """
    from matplotlib.collections import EllipseCollection, PolyCollection

    g = frame.grains
    x0, x1, y0, y1 = frame_box(frame)
    factor, unit = display_unit("m", max(size))
    ax.set_aspect("equal")
    for middle, length, limit in ((0.5 * (x0 + x1), size[0], ax.set_xlim), (0.5 * (y0 + y1), size[1], ax.set_ylim)):
        limit((middle - 0.52 * length) / factor, (middle + 0.52 * length) / factor)
    ax.set(xlabel=axis_label("x", unit), ylabel=axis_label("y", unit))
    ax.spines[:].set_visible(False)
    colours = np.full(len(g), GRAIN, dtype=object)
    if boundary:
        colours[-boundary:] = BOUNDARY
    ax.add_collection(
        EllipseCollection(
            2.0 * g.a / factor, 2.0 * g.b / factor, np.degrees(g.angle), units="x", facecolors=list(colours), edgecolors="0.45",
            linewidths=0.4, offsets=np.column_stack([g.x, g.y]) / factor, offset_transform=ax.transData, label="grains",
        )
    )  # fmt: skip
    w = frame.walls
    for k in range(len(w)):
        ax.plot([w.x0[k] / factor, w.x1[k] / factor], [w.y0[k] / factor, w.y1[k] / factor], color="black", lw=1.5)
    corners = rectangles(frame, largest)
    ax.add_collection(
        PolyCollection(list(corners / factor), facecolors=FORCE, edgecolors="none", label="forces", zorder=3)
    )


def rectangles(frame: StoredIncrement, largest: float) -> Floats:
    """Corners (c, 4, 2) [m] of a rectangle a contact: along its force, through the contact point, as long as both radii together.

    The largest force is WIDEST times the mean radius wide. Towards a wall a rectangle ends at the wall.
    """
    c, g = frame.contacts, frame.grains
    force = np.stack([c.normal * c.nx - c.shear * c.ny, c.normal * c.ny + c.shear * c.nx], axis=1)
    size = np.hypot(force[:, 0], force[:, 1])
    along = force / np.where(size > 0.0, size, 1.0)[:, None]
    half = 0.5 * WIDEST * float(g.radius.mean()) * size / (largest if largest > 0.0 else 1.0)
    across = np.column_stack([-along[:, 1], along[:, 0]]) * half[:, None]
    point = np.column_stack([c.px, c.py])
    back = point - along * g.radius[c.i][:, None]
    front = point + along * np.where(c.j < 0, 0.0, g.radius[np.maximum(c.j, 0)])[:, None]
    return np.stack([back - across, front - across, front + across, back + across], axis=1)


# ---------------------------------------------------------------------------------------------- roses


def stiffness_of(frame: StoredIncrement) -> tuple[float, float]:
    """Stiffness [N/m] of the springs, the same in all contacts, as their forces tell; tangential 0 where no shear force acts."""
    c = frame.contacts
    normal, shear = c.overlap > 0.0, c.stretch != 0.0
    kn = float(np.median(c.normal[normal] / c.overlap[normal])) if normal.any() else 0.0
    return kn, float(np.median(-c.shear[shear] / c.stretch[shear])) if shear.any() else 0.0


def rose(frame: StoredIncrement, *, energy: bool = False) -> Floats:
    """Percent of the contacts, or of their elastic energy, that faces each of SECTORS ways, together 100; NaN without a contact."""
    return energy_rose(frame, *stiffness_of(frame), SECTORS) if energy else contact_rose(frame, SECTORS)


def within_45(frame: StoredIncrement, axial: int, *, energy: bool = False) -> float:
    """Percent of the same within 45 deg of the axial direction; what faces 45 deg itself counts half."""
    c = force_carrying(frame.contacts)
    weight = halves(frame, c).astype(float)
    if energy:
        weight = weight * contact_energy(c, *stiffness_of(frame))
    lead = np.abs(c.ny) - np.abs(c.nx) if axial == 1 else np.abs(c.nx) - np.abs(c.ny)
    total = float(weight.sum())
    return 100.0 * float(np.sum(weight * (0.5 + 0.5 * np.sign(lead)))) / total if total > 0.0 else float("nan")


def within_text(frame: StoredIncrement, axial: int, *, energy: bool) -> str:
    return f"{within_45(frame, axial, energy=energy):.0f} % within 45° of {'xy'[axial]}"


def panel_rose(ax: PolarAxes, values: Floats, top: float, before: Floats | None = None, *, small: bool = False) -> None:
    """Bars of `values`; the outline of `before` over them. small: no room for angles."""
    width = 2.0 * np.pi / SECTORS
    middle = np.arange(SECTORS) * width
    ax.bar(middle, values, width=width, color=COLORS[4], edgecolor="white", linewidth=0.4)
    if before is not None:
        edges = np.repeat(np.arange(SECTORS + 1) - 0.5, 2)[1:-1] * width
        steps = np.repeat(before, 2)
        ax.plot(
            np.append(edges, edges[0] + 2.0 * np.pi), np.append(steps, steps[0]), color="black", lw=0.7, label="before"
        )
    ax.set_ylim(0.0, top)
    most = 2.5 if small or narrow() else 4.5
    step = next((s for s in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0) if top / s <= most), 25.0)
    ticks = np.arange(step, top, step)
    ax.set_yticks(ticks.tolist(), [f"{tick:g} %" for tick in ticks], fontsize=5.5 if small else 6.5)
    ax.set_rlabel_position(22.5)
    angles = np.arange(0, 360, 90 if small else 45)
    ax.set_xticks(np.radians(angles).tolist(), ["" if small else f"{angle}°" for angle in angles], fontsize=7)
    ax.tick_params(axis="x", pad=-1)


def draw_roses(results: Results, moments: list[Moment], text: str, *, energy: bool, axial: int) -> Figure:
    """Rose of the contact normals (figure 11), or of the elastic energy in their direction (figure 12), in percent, a panel a frame."""
    found = [rose(one.frame, energy=energy) for one in moments]
    if not any(np.isfinite(values).all() for values in found):
        raise ScenarioError(
            f"{results.path}: nothing touches in the frames that are asked for; choose another --increment"
        )
    top = 1.08 * max(float(np.nanmax(values, initial=0.0)) for values in found)
    figure = new_figure(3.9 * len(moments) if len(moments) > 1 else 4.8, 5.5, rigid=narrow())
    for k, (one, values) in enumerate(zip(moments, found, strict=True)):
        ax: PolarAxes = figure.add_subplot(1, len(moments), k + 1, projection="polar")  # type: ignore[assignment]
        panel_rose(ax, values, top, found[0] if k else None)
        ax.set_title(folded(one.text), pad=10)
        ax.set_xlabel(within_text(one.frame, axial, energy=energy), labelpad=8)
    what = "Elastic energy in the direction of contact normals" if energy else "Contact normals"
    heading(figure, results, f"{what}, {text}")
    note = "percent of the whole in sectors of 10°; contacts with walls count half"
    footnote(figure, note + ("\nline: at the start" if len(moments) > 1 else ""))
    return figure
