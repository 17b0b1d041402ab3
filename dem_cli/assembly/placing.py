"""Places of rigid bodies that have none: side by side in layers, or by chance; bounding spheres apart."""

from __future__ import annotations

import math

import numpy as np

from dem_cli.assembly.region import Tell
from dem_cli.errors import ScenarioError
from dem_cli.scenario import ImpulseScenario
from dem_cli.state import Floats, Ints

GAP = 0.05  # of the largest diameter, between bounding spheres of a grid
SHARE = 0.15  # of a region without end that bounding spheres fill at first, by rejection
RAISE = 1.05  # the region goes up by this factor where a body finds no place
BATCH = 64  # places that a body tries at a time
PROGRESS = 200  # bodies after which something is told


class _NoRoomError(Exception):
    """Some bodies find no place; says how many do."""


def place(scenario: ImpulseScenario, x: Floats, reach: Floats, generator: np.random.Generator, tell: Tell) -> Floats:
    """Centres of mass (n, 3) [m] of all bodies: those of x that are NaN get a place. reach (n,) [m]: of their bounding spheres.

    ScenarioError if they do not fit.
    """
    loose = np.flatnonzero(np.isnan(x[:, 0]))
    if not len(loose):
        return x
    low, high = region_of(scenario)
    x = x.copy()
    packing = scenario.packing
    largest = 2.0 * float(reach[loose].max())
    narrow = high - low < largest * (1.0 - 1e-9)
    if narrow.any():
        axis = "xyz"[int(np.argmax(narrow))]
        raise _misfit(scenario, f"the largest body is up to {largest:.4g} m across, the region is smaller along {axis}")
    try:
        if packing.method == "rejection":
            _by_chance(x, reach, loose, (low, high), packing.gap or 0.0, packing.attempts or 1, generator, tell)
        else:
            _in_layers(x, reach, loose, (low, high), GAP * largest if packing.gap is None else packing.gap)
    except _NoRoomError as error:
        raise _misfit(scenario, str(error)) from None
    tell(f"{packing.method}: {len(loose)} bodies up to z = {float(np.max((x[:, 2] + reach)[loose])):.4g} m")
    return x


def region_of(scenario: ImpulseScenario) -> tuple[Floats, Floats]:
    """Corners (3,) [m] of what is packed: the region as given, else the container; infinitely high where it has no height."""
    region, container = scenario.packing.region, scenario.container
    if region is not None:
        return np.array(region.low), np.array(region.high)
    assert container.width is not None
    assert container.breadth is not None
    return np.zeros(3), np.array([container.width, container.breadth, container.height or math.inf])


def _misfit(scenario: ImpulseScenario, why: str) -> ScenarioError:
    return ScenarioError(
        f"{scenario.origin}: [packing] method = {scenario.packing.method}: the bodies do not fit: {why}. Take a larger region or container, "
        "fewer or smaller bodies, or less gap"
    )


def _in_layers(x: Floats, reach: Floats, loose: Ints, region: tuple[Floats, Floats], gap: float) -> None:
    """Fills x row by row from the bottom: cells of the largest body's diameter and the gap, spread over the region's width and breadth.

    A cell that a body with a place of its own reaches into is left out.
    """
    low, high = region
    cell = 2.0 * float(reach[loose].max()) + gap
    columns, rows = (max(1, int((high[k] - low[k] + gap) / cell * (1.0 + 1e-12))) for k in range(2))
    fixed = np.flatnonzero(~np.isnan(x[:, 0]))
    wide = (high[:2] - low[:2]) / (columns, rows)
    done, number = 0, 0
    while done < len(loose):
        layer, rest = divmod(number, columns * rows)
        row, column = divmod(rest, columns)
        z = low[2] + 0.5 * (cell - gap) + layer * cell
        if z + 0.5 * (cell - gap) > high[2] * (1.0 + 1e-12) + 1e-12:
            raise _NoRoomError(f"{done} of {len(loose)} find a place below z = {high[2]:.4g} m")
        spot = np.array([low[0] + (column + 0.5) * wide[0], low[1] + (row + 0.5) * wide[1], z])
        number += 1
        if not len(fixed) or (np.linalg.norm(x[fixed] - spot, axis=1) >= reach[fixed] + 0.5 * cell).all():
            x[loose[done]] = spot
            done += 1


def _by_chance(
    x: Floats, reach: Floats, loose: Ints, region: tuple[Floats, Floats], gap: float, attempts: int,
    generator: np.random.Generator, tell: Tell,
) -> None:  # fmt: skip
    """Random sequential addition into x, the largest body first: up to `attempts` places each. A region without end is raised as needed."""
    low, high = region[0].copy(), region[1].copy()
    endless = math.isinf(high[2])
    if endless:
        spheres = 4.0 / 3.0 * math.pi * float(np.sum(reach[loose] ** 3))
        high[2] = low[2] + max(spheres / SHARE / float(np.prod((high - low)[:2])), 2.0 * float(reach[loose].max()))
    there = list(np.flatnonzero(~np.isnan(x[:, 0])))
    order = loose[np.argsort(-reach[loose], kind="stable")]
    for done, k in enumerate(order):
        if done % PROGRESS == 0:
            tell(f"rejection: {done} of {len(order)} bodies placed")
        others, apart = x[there], reach[there] + reach[k] + gap
        tried = 0
        while True:
            many = min(BATCH, attempts - tried)
            spots = low + reach[k] + generator.random((many, 3)) * (high - low - 2.0 * reach[k])
            free = np.all(np.linalg.norm(spots[:, None] - others[None], axis=2) >= apart, axis=1)
            if free.any():
                x[k] = spots[int(np.argmax(free))]
                break
            tried += many
            if tried < attempts:
                continue
            if not endless:
                raise _NoRoomError(f"{done} of {len(order)} find a place in {attempts} attempts each")
            high[2] = low[2] + RAISE * (high[2] - low[2])
            tried = 0
        there.append(k)
