"""Ellipses, and bodies of several discs with or without bonds, for tests: whole grains are placed, turned and set in motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from few_grains import DENSITY, RADIUS

from dem_cli.state import Bonds, Contacts, Floats, Frame, Grains

# Discs (x, y, r) of a body about any origin, in units of RADIUS; neighbours touch.
PAIR = ((-1.0, 0.0, 1.0), (1.0, 0.0, 1.0))
UNEQUAL = ((-1.0, 0.0, 1.0), (0.6, 0.0, 0.6))
TRIANGLE = ((-1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (0.0, math.sqrt(3.0), 1.0))
CHAIN = tuple((2.0 * k, 0.0, 1.0) for k in range(5))
BENT = (
    (-2.0 * math.cos(0.5), 2.0 * math.sin(0.5), 1.0),
    (0.0, 0.0, 1.0),
    (2.0 * math.cos(0.3), 2.0 * math.sin(0.3), 1.0),
)
SINGLE = ((0.0, 0.0, 1.0),)

Discs = Sequence[tuple[float, float, float]]


def ellipses(
    x: Sequence[float] | Floats,
    y: Sequence[float] | Floats,
    ratio: float | Floats,
    angle: float | Floats = 0.0,
    radius: float | Floats = RADIUS,
) -> Grains:
    """Ellipses of the area of discs of a radius [m]: a = r sqrt(k), b = r/sqrt(k)."""
    n = len(x)
    r, k = np.broadcast_to(radius, n), np.broadcast_to(ratio, n)
    turned = np.broadcast_to(angle, n)
    return Grains.ellipses(np.array(x), np.array(y), r * np.sqrt(k), r / np.sqrt(k), turned, DENSITY, 1.0)


def bodies(
    shapes: Sequence[Discs], x: Sequence[float] | Floats, y: Sequence[float] | Floats,
    angle: float | Sequence[float] | Floats = 0.0,
) -> Grains:  # fmt: skip
    """Bodies of discs with their centres of mass at (x, y) [m], turned by `angle` [rad]."""
    n = len(shapes)
    centre, turned = np.stack([x, y], axis=1), np.broadcast_to(angle, n)
    parts = []
    for k, shape in enumerate(shapes):
        discs = np.array(shape) * RADIUS
        weight = discs[:, 2] ** 2
        place = discs[:, :2] - (weight[:, None] * discs[:, :2]).sum(axis=0) / weight.sum()
        c, s = math.cos(turned[k]), math.sin(turned[k])
        parts.append(np.column_stack([place @ np.array([[c, s], [-s, c]]) + centre[k], discs[:, 2]]))
    body = np.repeat(np.arange(n), [len(part) for part in parts])
    px, py, r = np.concatenate(parts).T
    grains = Grains.discs(px, py, r, DENSITY, 1.0)
    return replace(grains, body=body, angle=turned[body].astype(float))


def bonds_of(grains: Grains, viscosity: float, rolling: float = 0.0) -> Bonds:
    """Bonds between all touching discs of each body; normal and tangential viscosity [N s/m] are the same, rolling [N m s]."""
    n = len(grains)
    i, j = np.triu_indices(n, 1)
    reach = grains.radius[i] + grains.radius[j]
    near = np.hypot(grains.x[j] - grains.x[i], grains.y[j] - grains.y[i]) < 1.001 * reach
    own = near & (grains.body[i] == grains.body[j])
    one = np.ones(int(own.sum()))
    return Bonds(i[own], j[own], viscosity * one, viscosity * one, rolling * one)


def sums(grains: Grains, values: Floats) -> Floats:
    """Sums over the elements of each grain."""
    return np.bincount(grains.body, weights=values, minlength=grains.grain_count)


def centres(grains: Grains) -> tuple[Floats, Floats]:
    """Centres of mass of the grains [m]."""
    mass = sums(grains, grains.mass)
    return sums(grains, grains.mass * grains.x) / mass, sums(grains, grains.mass * grains.y) / mass


def set_in_motion(
    grains: Grains, vx: float | Floats = 0.0, vy: float | Floats = 0.0, spin: float | Floats = 0.0
) -> Grains:
    """Grains that move as rigid bodies: velocities of their centres of mass [m/s] and spins [rad/s]."""
    x, y = centres(grains)
    of = grains.body
    u, v, w = (np.broadcast_to(value, grains.grain_count)[of].astype(float) for value in (vx, vy, spin))
    return replace(grains, vx=u - w * (grains.y - y[of]), vy=v + w * (grains.x - x[of]), spin=w)


def momentum(grains: Grains) -> Floats:
    """Momentum (x, y) [N s] of all grains."""
    return np.array([(grains.mass * grains.vx).sum(), (grains.mass * grains.vy).sum()])


def angular_momentum(grains: Grains) -> float:
    """Angular momentum of all grains about the origin [N m s]."""
    orbit = grains.mass * (grains.x * grains.vy - grains.y * grains.vx)
    return float((orbit + grains.inertia * grains.spin).sum())


def swing(grains: Grains) -> float:
    """Sum of the sizes of what adds up to the angular momentum: the scale of its rounding [N m s]."""
    orbit = grains.mass * np.hypot(grains.x, grains.y) * np.hypot(grains.vx, grains.vy)
    return float((orbit + grains.inertia * np.abs(grains.spin)).sum())


def total(frame: Frame) -> float:
    """Kinetic, potential and elastic energy [J]."""
    return frame.energy.stored


def wrenches(grains: Grains, contacts: Contacts, *, points: bool = True) -> Floats:
    """Force and moment about its own centre on each element from the contacts, (n, 3) [N], [N m]."""
    fx = contacts.normal * contacts.nx - contacts.shear * contacts.ny
    fy = contacts.normal * contacts.ny + contacts.shear * contacts.nx
    out = np.zeros((len(grains), 3))
    for side, sign in ((contacts.i, -1.0), (contacts.j, 1.0)):
        here = side >= 0
        k = side[here]
        ax, ay = contacts.px[here] - grains.x[k], contacts.py[here] - grains.y[k]
        np.add.at(out, k, sign * np.stack([fx[here], fy[here], (ax * fy[here] - ay * fx[here]) * points], axis=1))
    return out
