"""The contact search of the impulse engine: one object that holds the shapes, the neighbour list and the buffers."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dem_cli.engines.impulse.arrays import COUNT, FRAME, RADIUS, SCALE, SPHERE0, TURN, Found, Placed
from dem_cli.engines.impulse.contacts import DEPTH, find, place_spheres
from dem_cli.engines.impulse.found import empty_found
from dem_cli.engines.impulse.geometry import empty_near, flatten, reach_of
from dem_cli.engines.impulse.search import farthest_move, neighbour_list
from dem_cli.engines.impulse.vectors import set_turns
from dem_cli.errors import RunError
from dem_cli.rigid import Scene
from dem_cli.state import Bools, Floats, Ints

SKIN = 0.1  # of the neighbour list, over the mean reach


class Touching(NamedTuple):
    """Contact points (c,) of one look, sorted by (i, j, key): views that hold until the next look.

    i, j: as in `rigid.BodyContacts`. key: names the point from step to step, unique within its pair. point (c, 3) [m]: half way between both
    surfaces; normal (c, 3): unit, from i to j; gap [m]: < 0 is penetration.
    """

    i: Ints
    j: Ints
    key: Ints
    point: Floats
    normal: Floats
    gap: Floats


class ContactSearch:
    """Contacts of the bodies of a scene, wherever they are.

    `alive` (n,) may be set from outside; bodies that are not are passed over. rebuilds: how often the neighbour list was made.
    """

    def __init__(self, scene: Scene, skin: float = SKIN) -> None:
        bodies, terrain = scene.bodies, scene.terrain is not None
        n, extra = len(bodies), int(terrain)
        self.shapes = flatten(scene)
        shape = np.concatenate([bodies.shape, np.full(extra, len(scene.shapes))]).astype(np.int64)
        frame = np.zeros((n + extra, FRAME))
        frame[:, TURN : TURN + 9] = np.eye(3).reshape(9)
        frame[:, SCALE] = 1.0
        frame[:n, SCALE] = bodies.scale
        frame[:, RADIUS] = reach_of(self.shapes, shape) * frame[:, SCALE]
        self.placed = Placed(frame, shape)
        spheres = np.diff(self.shapes.number[:, SPHERE0])[shape[:n]]
        self._ball_start = np.concatenate([[0], np.cumsum(spheres)]).astype(np.int64)
        self._ball = np.zeros((int(self._ball_start[-1]), 4))
        self._nears = empty_near(self.shapes), empty_near(self.shapes)
        self._walls = np.hstack([scene.planes.point.reshape(-1, 3), scene.planes.normal.reshape(-1, 3)])
        self._found: Found = empty_found(8 * n + 64)
        self.alive: Bools = ~bodies.escaped
        self._reach = frame[:n, RADIUS].copy()
        self._skin = skin * float(self._reach.mean()) if n else 0.0
        self._listed: tuple[Floats, Bools, float, Any, Any] | None = None
        self.rebuilds = 0

    def _neighbours(self, x: Floats, tolerance: float) -> tuple[Any, Any]:
        """The half list, made anew if a body may have come as near as the tolerance to one that it does not hold."""
        moved, bad = farthest_move(x, x if self._listed is None else self._listed[0], self.alive)
        if bad >= 0:
            raise RunError(f"body {bad} is at no finite place")
        if self._listed is not None:
            _, alive, wide, start, neighbour = self._listed
            if 2.0 * moved + tolerance <= wide and np.array_equal(alive, self.alive):
                return start, neighbour
        wide = self._skin + tolerance
        start, neighbour = neighbour_list(x, self._reach, self.alive, wide)
        self._listed = x.copy(), self.alive.copy(), wide, start, neighbour
        self.rebuilds += 1
        return start, neighbour

    def look(self, x: Floats, q: Floats, tolerance: float, deepest: float = DEPTH) -> Touching:
        """All contacts with gap <= tolerance [m] of bodies at x (n, 3) [m], turned by the unit quaternions q (n, 4).

        deepest: bodies that lie deeper in each other, over the smaller one's reach, are not seen.
        """
        n = len(self.alive)
        x, q = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(q, dtype=np.float64)
        start, neighbour = self._neighbours(x, tolerance)
        set_turns(self.placed, x, q, n)
        place_spheres(self.shapes, self.placed, self._ball, self._ball_start, n)
        while True:
            find(
                self.shapes, self.placed, self._ball, self._ball_start, self._nears, self._walls, self.alive,
                start, neighbour, tolerance, deepest, self._found,
            )  # fmt: skip
            count = int(self._found.state[COUNT])
            if count <= len(self._found.i):
                f = self._found
                return Touching(
                    f.i[:count], f.j[:count], f.key[:count], f.point[:count], f.normal[:count], f.gap[:count]
                )
            self._found = empty_found(count + count // 4)
