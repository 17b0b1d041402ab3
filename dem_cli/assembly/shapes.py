"""Grains of every shape as elements: discs, ellipses, and templates of several discs, bonded or rigid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.geometry.union import pieces
from dem_cli.scenario import Scenario
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


def draw_sizes(scenario: Scenario, generator: np.random.Generator) -> Sizes:
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


def body_of(scenario: Scenario) -> Body:
    """The discs of a scenario's template. A clump's add up to the mass, centre and inertia of the union of its discs; bonded discs
    carry the mass of their own pieces of it, and turn as discs of that mass. ScenarioError where discs cannot carry a clump's inertia.
    """
    template = scenario.grains.template
    assert template is not None
    rigid = scenario.grains.shape == "clump"
    x, y, r = (scenario.grains.scale * values for values in template.centred(rigid=rigid))
    own = pieces(x, y, r)
    share = own.area / (np.pi * r**2)
    if not rigid:
        return Body(x, y, r, share, share)
    area, _, _, polar = own.whole
    mass = balanced(own.area, x, y)
    carried = float(np.sum(mass * (x**2 + y**2)))
    spin = 0.5 * mass * r**2
    if carried >= polar:
        raise ScenarioError(
            f"{scenario.path or 'scenario'}: [grains] template: has discs whose centres lie too far out to carry the clump's moment of inertia "
            f"({carried / area:.4g} for {polar / area:.4g} radii squared). Add a disc near its centre"
        )
    factor = (polar - carried) / float(spin.sum())
    return Body(x, y, r, mass / (np.pi * r**2), factor * mass / (np.pi * r**2))


def balanced(weight: Floats, x: Floats, y: Floats) -> Floats:
    """Weights of the same sum as `weight` > 0 whose centre is (0, 0): those of least relative entropy, w exp(p x + q y), shape (k,).

    They are positive, and are there wherever the centre lies among the points, which the centre of a union of discs always does:
    mirrored at a line that has all disc centres on one side, what lies beyond the line falls into the discs again. Newton's method on the convex
    potential log sum w exp(p x + q y).
    """
    points = np.array([x, y])
    size = float(np.abs(points).max())
    if size == 0.0:
        return weight
    points = points / size
    total, slope = float(weight.sum()), np.zeros(2)

    def tilted(slope: Floats) -> tuple[Floats, float]:
        power = slope @ points
        raised = weight * np.exp(power - power.max())
        return raised / raised.sum(), float(np.log(raised.sum()) + power.max())

    share, potential = weight / total, float(np.log(total))
    for _ in range(100):
        mean = points @ share
        if np.abs(mean).max() < 1e-15:
            break
        spread = (points - mean[:, None]) * share @ (points - mean[:, None]).T
        step = -np.linalg.lstsq(spread, mean, rcond=1e-12)[0]
        while True:
            new_share, new_potential = tilted(slope + step)
            if new_potential <= potential or np.abs(step).max() < 1e-15:
                break
            step = 0.5 * step
        if np.array_equal(slope + step, slope):
            break
        slope, share, potential = slope + step, new_share, new_potential
    return total * share


def build_grains(
    scenario: Scenario,
    sizes: Sizes,
    x: Floats,
    y: Floats,
    vx: Floats | None = None,
    vy: Floats | None = None,
    spin: Floats | None = None,
) -> tuple[Grains, Bonds]:
    """Elements and bonds of grains whose centres of mass are at x, y [m], shape (g,), turned by `sizes.angle`.

    vx, vy [m/s], spin [rad/s]: motion of the grains, (g,) each, none where left out. ScenarioError: see `body_of`.
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


def _bonds(scenario: Scenario, grains: Grains, many: int) -> Bonds:
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
