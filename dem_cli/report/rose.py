"""Rose of contact normals: how many contacts between grains face each way, and the fabric they make."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.report.look import COLORS, footnote, heading, narrow, new_figure, place_text, stage_label
from dem_cli.results import Results
from dem_cli.state import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.projections.polar import PolarAxes

SECTORS = 36  # of the whole circle; a multiple of 2, as a contact faces both ways


def draw_rose(results: Results, index: int) -> Figure:
    """Density of contact normals over direction in frame `index`, each contact both ways; 1 is the same in every direction.

    The line is what the fabric tensor <n n> alone tells, 1 + 2 (F1 - F2) cos 2(theta - theta_1), the dashed lines are its principal
    directions, longer for the larger. Contacts with walls are left out. ScenarioError without a contact between grains.
    """
    frame = results.frame(index)
    contacts = frame.contacts
    between = np.zeros(0, dtype=bool) if contacts is None else contacts.j >= 0
    if contacts is None or not between.any():
        raise ScenarioError(
            f"{results.path}: grains do not touch each other at {place_text(results, index)}; choose a later frame"
        )
    n = np.stack([contacts.nx[between], contacts.ny[between]])
    density = densities(n[0], n[1])
    # As dem_cli.analysis.stress.fabric, which would bring the compiler along.
    values, directions = np.linalg.eigh(n @ n.T / n.shape[1])
    large = float(np.arctan2(directions[1, 1], directions[0, 1]))
    large -= np.pi * np.floor(large / np.pi + 0.5)  # an axis: -90 to 90 deg

    figure = new_figure(4.8, 5.2, rigid=narrow())
    ax: PolarAxes = figure.add_subplot(projection="polar")  # type: ignore[assignment]
    middle = (np.arange(SECTORS) + 0.5) * 2.0 * np.pi / SECTORS
    ax.bar(middle, density, width=2.0 * np.pi / SECTORS, color=COLORS[4], edgecolor="white", linewidth=0.5)
    theta = np.linspace(0.0, 2.0 * np.pi, 361)
    fitted = 1.0 + 2.0 * (values[1] - values[0]) * np.cos(2.0 * (theta - large))
    ax.plot(theta, fitted, color="black", lw=1.0)
    for angle, length in ((large, fitted.max()), (large + 0.5 * np.pi, fitted.min())):
        ax.plot([angle, angle + np.pi], [length, length], color=COLORS[1], lw=1.2, ls=(0, (4, 2)))
    top = 1.08 * max(float(density.max()), float(fitted.max()))
    ax.set_rmax(top)
    step = max(0.5, round(top / 4.0))
    ax.set_yticks(np.arange(step, top, step).tolist())
    ax.set_rlabel_position(22.5)
    text = place_text(results, index)
    if 0 <= frame.stage < len(results.stages):
        text += f", {stage_label(frame.stage + 1, results.stages[frame.stage])}"
    heading(figure, results, f"Contact normals between grains, {text}")
    footnote(
        figure,
        f"{n.shape[1]} contacts; fabric {values[1]:.3f} at {np.degrees(large):.0f} deg, {values[0]:.3f} across\n"
        "1 is the same in all directions; line: what the fabric alone tells",
    )
    return figure


def densities(nx: Floats, ny: Floats) -> Floats:
    """Share of the directions n and -n in each of SECTORS sectors from +x on, times SECTORS: 1 where all are alike."""
    angle = np.arctan2(np.concatenate([ny, -ny]), np.concatenate([nx, -nx])) % (2.0 * np.pi)
    sector = np.minimum((angle * SECTORS / (2.0 * np.pi)).astype(np.int64), SECTORS - 1)
    return np.asarray(np.bincount(sector, minlength=SECTORS) * (SECTORS / len(angle)), dtype=float)
