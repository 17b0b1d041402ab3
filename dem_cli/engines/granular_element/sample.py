"""The sample of the granular element engine: arrays that kernels change, and what can be asked of them."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dem_cli.engines.granular_element.boundary import MOST_SERVOS, Chain, Servos, area_inside, stresses
from dem_cli.engines.granular_element.contacts import (
    SUMS,
    TOP,
    Bodies,
    Law,
    Near,
    count_contacts,
    no_list,
    renew,
    wall_of,
)
from dem_cli.engines.granular_element.ledger import begin_step, set_anchor, stored
from dem_cli.engines.granular_element.relax import Iterates, look, room_for
from dem_cli.state import Contacts, Floats

SKIN = 0.15  # of the mean radius


@dataclass(frozen=True)
class View:
    """Forces of a sample where it is: of each disc, sums over the boundary, and the energy of normal, tangential springs and links [J]."""

    room: Iterates
    sums: Floats
    energy: Floats


@dataclass
class Sample:
    """Discs, boundary and contacts. x (n, 3) as in contacts.py; box (4,); size (2,) [m]: half sizes that strains count against."""

    x: Floats
    box: Floats
    size: Floats
    bodies: Bodies
    law: Law
    chain: Chain
    depth: float
    near: Near = field(init=False)
    anchor: Floats = field(init=False)
    skin: float = field(init=False)

    def __post_init__(self) -> None:
        self.skin = SKIN * float(self.bodies.radius.mean())
        self.near = renew(self.x, self.bodies, self.law, self.box, self.skin, no_list(len(self.x)))
        self.anchor = self.x.copy()
        self.look()
        self.begin()

    def copy(self) -> Sample:
        """All arrays copied, what never changes shared."""
        twin = copy.copy(self)
        twin.restore(self)
        return twin

    def restore(self, other: Sample) -> None:
        """Take over the state of another copy of this sample."""
        self.x, self.box, self.size, self.anchor = (
            other.x.copy(),
            other.box.copy(),
            other.size.copy(),
            other.anchor.copy(),
        )
        self.near = Near(*(part.copy() for part in other.near))
        self.law = other.law
        self.bodies = other.bodies._replace(load=other.bodies.load.copy())
        self.chain = other.chain._replace(pressure=other.chain.pressure.copy())

    def begin(self) -> None:
        """A sub-step starts from here; `look` must have been called."""
        set_anchor(self.x, self.anchor, self.near)
        begin_step(self.near)

    def look(self) -> View:
        """Forces at the present place, the slider starting from the anchor."""
        room, sums = room_for(len(self.x)), np.zeros(SUMS)
        links = look(
            self.x, self.anchor, self.near, self.bodies, self.law, self.chain, self.box, self.depth, room, sums
        )
        count_contacts(self.near, room.touching, room.other)
        return View(room, sums, np.array([*stored(self.near, self.law), links]))

    def with_friction(self, friction: float, cohesion: float | None = None) -> None:
        """Another friction between grains from now on."""
        self.law = self.law._replace(friction=friction, cohesion=self.law.cohesion if cohesion is None else cohesion)

    @property
    def area(self) -> float:
        """Area of the sample [m^2]."""
        return float(area_inside(self.x, self.box, self.bodies, self.chain))

    def stress(self, view: View) -> Floats:
        """Stress across x and y [Pa]."""
        return np.array(stresses(view.sums, self.area, self.depth))

    @property
    def strain(self) -> Floats:
        """Strain of the box, compression > 0."""
        return 1.0 - self.box[2:] / self.size

    def contacts(self) -> Contacts:
        """Contacts that touch, with forces of the last look."""
        near, radius = self.near, self.bodies.radius
        on = np.flatnonzero(near.normal > 0.0)
        i, j = near.first[on].astype(np.int64), near.second[on].astype(np.int64)
        branch = self.x[j, :2] - self.x[i, :2]
        n = branch / np.hypot(branch[:, 0], branch[:, 1])[:, None]
        overlap = near.normal[on] / self.law.kn
        place = self.x[i, :2] + n * (radius[i] - 0.5 * overlap)[:, None]
        limit = self.law.friction * near.normal[on] + self.law.cohesion
        wall = np.flatnonzero(near.wall_normal > 0.0)
        disc, side = near.disc[wall].astype(np.int64), near.side[wall].astype(np.int64)
        out = np.array([wall_of(w, self.box)[:2] for w in range(TOP + 1)])[side].reshape(-1, 2)
        gap = near.wall_normal[wall] / self.law.kn
        foot = self.x[disc, :2] + out * (radius[disc] - gap)[:, None]
        wall_limit = self.law.wall_friction[side] * near.wall_normal[wall]
        numbers = np.cumsum(self.law.wall)[side] - 1  # walls that are not there have no number
        columns: dict[str, Any] = {
            "i": np.concatenate([i, disc]),
            "j": np.concatenate([j, -1 - numbers]),
            "nx": np.concatenate([n[:, 0], out[:, 0]]),
            "ny": np.concatenate([n[:, 1], out[:, 1]]),
            "px": np.concatenate([place[:, 0], foot[:, 0]]),
            "py": np.concatenate([place[:, 1], foot[:, 1]]),
            "overlap": np.concatenate([overlap, gap]),
            "normal": np.concatenate([near.normal[on], near.wall_normal[wall]]),
            "shear": np.concatenate([near.shear[on], near.wall_shear[wall]]),
            "sliding": np.concatenate([_at_limit(near.shear[on], limit), _at_limit(near.wall_shear[wall], wall_limit)]),
        }
        columns["stretch"] = -columns["shear"] / self.law.kt
        order = np.lexsort((columns["j"], columns["i"]))
        return Contacts(**{name: values[order] for name, values in columns.items()})


def _at_limit(shear: Floats, limit: Floats) -> np.ndarray[Any, np.dtype[np.bool_]]:
    return (np.abs(shear) >= limit * (1.0 - 1e-12)) & (limit > 0.0)


def no_servos() -> Servos:
    """Strains alone are prescribed."""
    return servos([], [], [], 1.0)


def servos(
    direction: list[tuple[float, float]], weight: list[tuple[float, float]], target: list[float], scale: float
) -> Servos:
    """Servos of boundary.Servos."""
    number = len(target)

    def rows(given: list[tuple[float, float]]) -> Floats:
        return np.array([*given, *[(0.0, 0.0)] * (MOST_SERVOS - number)], dtype=float)

    return Servos(
        number, rows(direction), rows(weight), np.array([*target, *[0.0] * (MOST_SERVOS - number)]), float(scale)
    )
