"""What contacts keep of a step, and what it has cost: anchors of the sliders, dissipation by (25)-(28), energy of the springs (22)."""

from __future__ import annotations

import math

from dem_cli.engines.granular_element.contacts import (
    DEPTH,
    LOST,
    NORMAL,
    OVERLAP,
    SHEAR,
    STEP_NORMAL,
    STEP_SHEAR,
    wall_of,
)
from dem_cli.jit import kernel


@kernel()
def opened_and_closed(near, law):
    """What trapezoids of the forces at both ends of a move make too much of contacts that opened or closed in it [J].

    The force of such a contact has a kink: with the depths a and b (gaps are negative) its work is kn (b+^2 - a+^2)/2.
    """
    return (
        0.5
        * law.kn
        * (_kinks(near.memory[OVERLAP], near.work[DEPTH]) + _kinks(near.wall_memory[OVERLAP], near.wall_depth))
    )


@kernel()
def _kinks(old, new):
    """Sum of (a+ + b+)(b - a) - (b+^2 - a+^2) over the depths a = old, b = new that differ in sign."""
    total = 0.0
    for c in range(old.size):
        if old[c] * new[c] < 0.0:
            before, after = max(old[c], 0.0), max(new[c], 0.0)
            total += (before + after) * (new[c] - old[c]) - (after - before) * (after + before)
    return total


@kernel()
def set_anchor(x, anchor, near):
    """The slider starts from here."""
    anchor[:] = x
    near.memory[SHEAR], near.memory[NORMAL], near.memory[OVERLAP] = near.shear, near.normal, near.work[DEPTH]
    near.wall_memory[SHEAR], near.wall_memory[NORMAL] = near.wall_shear, near.wall_normal
    near.wall_memory[OVERLAP] = near.wall_depth


@kernel()
def begin_step(near):
    """A sub-step starts from here: forces are kept, and nothing has been lost yet."""
    near.memory[STEP_SHEAR], near.memory[STEP_NORMAL], near.memory[LOST] = near.shear, near.normal, 0.0
    near.wall_memory[STEP_SHEAR], near.wall_memory[STEP_NORMAL] = near.wall_shear, near.wall_normal
    near.wall_memory[LOST] = 0.0


@kernel()
def lose(near, through):
    """Adds to LOST what sliding since the anchor has cost: mean shear force times slip.

    By (28) only where there was force at both ends; `through` a collapse, iterate by iterate, contacts that open or close count, too: what the
    spring of one that opens had stored is lost, and without that the ledger would not close.
    """
    for c in range(near.first.size):
        if near.slip[c] != 0.0 and (through or (near.memory[NORMAL, c] > 0.0 and near.normal[c] > 0.0)):
            near.memory[LOST, c] += 0.5 * (near.memory[SHEAR, c] + near.shear[c]) * near.slip[c]
    for c in range(near.disc.size):
        if near.wall_slip[c] != 0.0 and (through or (near.wall_memory[NORMAL, c] > 0.0 and near.wall_normal[c] > 0.0)):
            near.wall_memory[LOST, c] += 0.5 * (near.wall_memory[SHEAR, c] + near.wall_shear[c]) * near.wall_slip[c]


@kernel()
def lost_so_far(near):
    """Sum of LOST [J]."""
    return near.memory[LOST].sum() + near.wall_memory[LOST].sum()


@kernel()
def lose_in_step(x, began, near, law):
    """LOST of a whole sub-step by (25)-(28), from its start at `began` (n, 3): for a slider that was moved on in between."""
    for c in range(near.first.size):
        i, j = near.first[c], near.second[c]
        near.memory[LOST, c] = 0.0
        if near.normal[c] > 0.0 and near.memory[STEP_NORMAL, c] > 0.0:
            mx = x[j, 0] - x[i, 0] + began[j, 0] - began[i, 0]
            my = x[j, 1] - x[i, 1] + began[j, 1] - began[i, 1]
            ux = (x[i, 0] - began[i, 0]) - (x[j, 0] - began[j, 0])
            uy = (x[i, 1] - began[i, 1]) - (x[j, 1] - began[j, 1])
            turn = (x[i, 2] - began[i, 2]) + (x[j, 2] - began[j, 2])
            along = (mx * uy - my * ux) / math.sqrt(mx * mx + my * my) + turn
            old, new = near.memory[STEP_SHEAR, c], near.shear[c]
            near.memory[LOST, c] = 0.5 * (old + new) * (along - (new - old) / law.kt)
    for c in range(near.disc.size):
        i = near.disc[c]
        near.wall_memory[LOST, c] = 0.0
        if near.wall_normal[c] > 0.0 and near.wall_memory[STEP_NORMAL, c] > 0.0:
            nx, ny, _ = wall_of(near.side[c], near.box)
            along = (x[i, 1] - began[i, 1]) * nx - (x[i, 0] - began[i, 0]) * ny + x[i, 2] - began[i, 2]
            old, new = near.wall_memory[STEP_SHEAR, c], near.wall_shear[c]
            near.wall_memory[LOST, c] = 0.5 * (old + new) * (along - (new - old) / law.kt)


@kernel()
def stored(near, law):
    """Energy of the normal and of the tangential springs [J], by (22)."""
    normal = (near.normal**2).sum() + (near.wall_normal**2).sum()
    shear = (near.shear**2).sum() + (near.wall_shear**2).sum()
    return 0.5 * normal / law.kn, 0.5 * shear / law.kt
