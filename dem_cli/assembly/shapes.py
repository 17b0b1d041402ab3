"""Grains of every shape as elements: discs, ellipses, and templates of several discs, bonded or rigid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dem_cli.geometry.union import pieces
from dem_cli.scenario import DiscScenario
from dem_cli.scenario.stored_grains import StoredGrains
from dem_cli.state import Bonds, Floats, Grains

STIFF = 1e5  # a viscosity called "stiff", in sqrt(m kn) of the lighter disc


@dataclass(frozen=True)
class Sizes:
    """What the grains are, wherever they lie, shape (g,) each: radius [m], aspect ratio [-] and angle [rad] at the start."""

    radius: Floats
    aspect: Floats
    angle: Floats

    def __len__(self) -> int:
        return len(self.radius)


def draw_sizes(scenario: DiscScenario, generator: np.random.Generator) -> Sizes:
    """Radii, then aspect ratios, then orientations are drawn, those that a packing file does not give; discs draw radii alone."""
    grains, count = scenario.grains, scenario.grain_count
    file = scenario.grain_file() if scenario.packing.file else None
    if file is not None:
        radius = file.radius
    else:
        assert grains.radius is not None
        radius = grains.radius.draw(generator, count)
    if file is not None and file.aspect is not None:
        aspect = file.aspect
    else:
        aspect = grains.aspect_ratio.draw(generator, count) if grains.aspect_ratio else np.ones(count)
    if file is not None and file.angle is not None:
        angle = file.angle
    else:
        angle = grains.orientation.draw(generator, count) if grains.orientation else np.zeros(count)
    return Sizes(radius, aspect, angle)


@dataclass(frozen=True)
class Body:
    """A grain of several discs at unit radius, centre of mass at (0, 0), not turned; shape (k,) each.

    x, y, radius in units of the grain's radius; mass and inertia as multiples of those of a whole disc of the element's radius.
    """

    x: Floats
    y: Floats
    radius: Floats
    mass: Floats
    inertia: Floats


def body_of(scenario: DiscScenario) -> Body:
    """The discs of a scenario's template, each with the mass of its own piece of the outline at its centre.

    These masses have the centre of the union (see `Pieces`). Bonded discs turn as discs of their mass. Those of a clump share
    what its moment of inertia leaves after their distances from its centre, as m r^2; that is positive: it is the sum of the pieces' moments
    about the discs' centres, and of the distance between centres times the integral of -power over the chord, for each pair that overlaps.
    """
    template = scenario.grains.template
    assert template is not None
    x, y, r = (scenario.grains.scale * values for values in template.centred())
    own = pieces(x, y, r)
    share = own.area / (np.pi * r**2)
    if scenario.grains.shape != "clump":
        return Body(x, y, r, share, share)
    turning = own.whole[3] - float(own.area @ (x**2 + y**2))
    return Body(x, y, r, share, turning / (0.5 * float(own.area @ r**2)) * share)


def build_grains(
    scenario: DiscScenario,
    sizes: Sizes,
    x: Floats,
    y: Floats,
    vx: Floats | None = None,
    vy: Floats | None = None,
    spin: Floats | None = None,
) -> tuple[Grains, Bonds]:
    """Elements and bonds of grains whose centres of mass are at x, y [m], shape (g,), turned by `sizes.angle`.

    vx, vy [m/s], spin [rad/s]: motion of the grains, (g,) each, none where left out.
    """
    density, depth = scenario.grains.density, scenario.depth
    still = np.zeros(len(sizes))
    vx, vy, spin = (still if values is None else values for values in (vx, vy, spin))
    if not scenario.grains.template:
        root = np.sqrt(sizes.aspect)
        grains = Grains.ellipses(x, y, sizes.radius * root, sizes.radius / root, sizes.angle, density, depth)
        return replace(grains, vx=vx.copy(), vy=vy.copy(), spin=spin.copy()), Bonds.none()
    body = body_of(scenario)
    many = len(body.x)
    c, s = np.cos(sizes.angle)[:, None], np.sin(sizes.angle)[:, None]
    dx = (sizes.radius[:, None] * (body.x * c - body.y * s)).ravel()
    dy = (sizes.radius[:, None] * (body.x * s + body.y * c)).ravel()
    of = np.repeat(np.arange(len(sizes), dtype=np.int64), many)
    grains = Grains.discs(x[of] + dx, y[of] + dy, np.outer(sizes.radius, body.radius).ravel(), density, depth)
    grains = replace(
        grains,
        angle=sizes.angle[of],
        vx=vx[of] - spin[of] * dy,
        vy=vy[of] + spin[of] * dx,
        spin=spin[of],
        mass=grains.mass * np.tile(body.mass, len(sizes)),
        inertia=grains.inertia * np.tile(body.inertia, len(sizes)),
        body=of,
    )
    return grains, _bonds(scenario, grains, many) if scenario.grains.bond else Bonds.none()


def stored_grains(scenario: DiscScenario, stored: StoredGrains) -> tuple[Grains, Bonds]:
    """Elements as a result file holds them, with the masses and bonds that the scenario asks for."""
    density, depth = scenario.grains.density, scenario.depth
    grains = Grains.ellipses(stored.x, stored.y, stored.a, stored.b, stored.angle, density, depth)
    grains = replace(grains, vx=stored.vx, vy=stored.vy, spin=stored.spin, body=stored.body)
    if not scenario.grains.template:
        return grains, Bonds.none()
    body, number = body_of(scenario), grains.grain_count
    grains = replace(
        grains,
        mass=grains.mass * np.tile(body.mass, number),
        inertia=grains.inertia * np.tile(body.inertia, number),
    )
    return grains, _bonds(scenario, grains, len(body.x)) if scenario.grains.bond else Bonds.none()


def _bonds(scenario: DiscScenario, grains: Grains, many: int) -> Bonds:
    """The bonds of all grains, grain after grain."""
    bond, template = scenario.grains.bond, scenario.grains.template
    assert bond is not None
    assert template is not None
    pairs = np.array(template.bonded(), dtype=np.int64).reshape(-1, 2)
    first = np.arange(0, len(grains), many, dtype=np.int64)[:, None]
    i, j = (first + pairs[:, 0]).ravel(), (first + pairs[:, 1]).ravel()
    stiff = STIFF * np.sqrt(np.minimum(grains.mass[i], grains.mass[j]) * scenario.stiffness[0])
    normal, tangential = (
        stiff if isinstance(value, str) else np.full(len(i), value) for value in (bond.normal, bond.tangential)
    )
    rolling = np.zeros(len(i))
    if bond.rolling:
        usual = tangential * grains.radius[i] * grains.radius[j]
        rolling = usual if bond.rolling_viscosity is None else np.full(len(i), bond.rolling_viscosity)
    return Bonds(i, j, normal, tangential, rolling)
