"""Sizes, orientations and templates of rigid bodies."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from dem_cli.scenario.quantities import Angle, JsonSchema, Number, Whole, mistake
from dem_cli.scenario.radii import Normal
from dem_cli.scenario.table import Given, Mistake, Table, key
from dem_cli.scenario.vectors import Coordinate, Direction, Quaternion

Floats = npt.NDArray[np.float64]
Factor = Annotated[float, Number(gt=0.0)]
_THIRD = 1.0 / math.sqrt(3.0)
# Centres of equal spheres of radius 1 that touch.
TEMPLATES: dict[str, list[tuple[float, float, float]]] = {
    "pair": [(-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)],
    "triangle": [(-1.0, -_THIRD, 0.0), (1.0, -_THIRD, 0.0), (0.0, 2.0 * _THIRD, 0.0)],
    "tetrahedron": [(s * a, s * b, s * c) for s in (math.sqrt(0.5),) for a, b, c in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))],
    "cube": [(float(a), float(b), float(c)) for c in (-1, 1) for b in (-1, 1) for a in (-1, 1)],
}  # fmt: skip
TOUCHING = 1e-3  # spheres touch if what parts them is less than this share of the smaller radius


class ScaleNormal(Normal):
    """Normal distribution, cut off at both ends."""

    mean: Factor = key(doc="mean before cutting", example=1.0)
    sd: Factor = key(doc="standard deviation before cutting", example=0.2)
    min: Factor = key(doc="smallest factor", example=0.5)
    max: Factor = key(doc="largest factor", example=1.5)

    unit: ClassVar[str] = ""


class ScaleClass(Table):
    """Bodies of one size."""

    scale: Factor = key(doc="their factor", example=0.5)
    count: Annotated[int, Whole(ge=1)] = key(doc="how many there are", example=72)


class Scale(Table):
    """Factors on all lengths of the bodies: a number if all are equal, or a table with exactly one of the keys below."""

    fixed: Factor | None = key(None, doc="all bodies have this factor; the same as scale = 1.5", example=1.5)
    uniform: tuple[Factor, Factor] | None = key(None, doc="evenly distributed between two factors", example=[0.5, 1.5])
    normal: ScaleNormal | None = key(
        None,
        doc="normal distribution, cut off at both ends",
        example={"mean": 1.0, "sd": 0.2, "min": 0.5, "max": 1.5},
    )
    factors: tuple[Factor, ...] | None = key(
        None, alias="list", doc="one factor for each body, in the order of their ids", example=[1.0, 0.8, 1.2]
    )
    classes: tuple[ScaleClass, ...] | None = key(
        None, doc="so many bodies of each size, in random order", example=[{"scale": 1.0, "count": 72}]
    )

    alternatives: ClassVar = ((("fixed",), ("uniform",), ("normal",), ("list",), ("classes",)),)
    short_form: ClassVar[JsonSchema | None] = {
        "type": "number",
        "exclusiveMinimum": 0,
        "description": "one factor for all",
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return raw if isinstance(raw, dict) else {"fixed": raw}

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        if (pair := good.get("uniform")) and pair[0] > pair[1]:
            yield Mistake(("uniform",), "must be ascending", "Write the smaller factor first")
        if good.get("factors") == ():
            yield Mistake(("list",), "is empty", "Give one factor for each body")
        if good.get("classes") == ():
            yield Mistake(("classes",), "is empty", "Give for example [{ scale = 1, count = 72 }]")

    @property
    def number(self) -> int | None:
        """How many bodies there are, where the factors say so."""
        if self.factors is not None:
            return len(self.factors)
        return sum(one.count for one in self.classes) if self.classes is not None else None

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """Factors, shape (count,). For a list `count` must be its length, and nothing is drawn; classes are shuffled."""
        if self.fixed is not None:
            return np.full(count, self.fixed)
        if self.uniform is not None:
            return rng.uniform(self.uniform[0], self.uniform[1], count)
        if self.factors is not None:
            return np.array(self.factors)
        if self.classes is not None:
            return rng.permutation(np.repeat([one.scale for one in self.classes], [one.count for one in self.classes]))
        assert self.normal is not None
        return self.normal.draw(rng, count)


class BodyOrientation(Table):
    """How bodies are turned at the start."""

    random: Literal[True] | None = key(
        None, 'each body in another way, all ways alike likely; the same as orientation = "random"', example=True
    )
    axis: Direction | None = key(None, "turned about this axis, anticlockwise seen against it", example=[0, 0, 1])
    angle: Angle | None = key(None, "by this angle", example="30 deg")
    quaternion: Quaternion | None = key(None, "unit quaternion w, x, y, z", example=[1, 0, 0, 0])

    alternatives: ClassVar = ((("random",), ("axis", "angle"), ("quaternion",)),)
    short_form: ClassVar[JsonSchema | None] = {"enum": ["random"], "description": "each body in another way"}
    short_words: ClassVar[str | None] = '`"random"`'

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        if isinstance(raw, str) and raw != "random":
            raise mistake('must be "random", or a table', 'Write for example { axis = [0, 0, 1], angle = "30 deg" }')
        return {"random": True} if raw == "random" else raw

    @property
    def fixed(self) -> tuple[float, float, float, float] | None:
        """Quaternion w, x, y, z of all bodies; None if they are turned at random."""
        if self.random:
            return None
        if self.quaternion is not None:
            return self.quaternion
        assert self.axis is not None
        assert self.angle is not None
        half = 0.5 * self.angle
        x, y, z = (math.sin(half) * part for part in self.axis)
        return math.cos(half), x, y, z


class SphereTemplate(Table):
    """Spheres that make up a clump, in units of its radius: a name, or a list of spheres."""

    name: Literal["pair", "triangle", "tetrahedron", "cube"] | None = key(
        None, "equal spheres of radius 1 that touch", example="tetrahedron"
    )
    spheres: tuple[tuple[Coordinate, Coordinate, Coordinate, Factor], ...] | None = key(
        None,
        "x, y, z and radius of each: each touches or overlaps another one, so that they are one piece; overlaps count once",
        example=[[-1.0, 0.0, 0.0, 1.0], [0.5, 0.0, 0.0, 0.8]],
    )

    alternatives: ClassVar = ((("name",), ("spheres",)),)
    short_form: ClassVar[JsonSchema | None] = {
        "anyOf": [
            {"enum": list(TEMPLATES), "description": "its name"},
            {"type": "array", "items": {"type": "array"}, "minItems": 1, "description": "its spheres"},
        ]
    }
    short_words: ClassVar[str | None] = ", ".join(f'`"{name}"`' for name in TEMPLATES) + ", list of `[x, y, z, r]`"

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return raw if isinstance(raw, dict) else {"spheres": raw} if isinstance(raw, (list, tuple)) else {"name": raw}

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        spheres = given.good.get("spheres")
        if spheres == ():
            yield Mistake(("spheres",), "is empty", "Give at least one sphere: [0, 0, 0, 1]")
        elif spheres:
            yield from _wrong_spheres(np.array(spheres))

    def outline(self) -> tuple[Floats, Floats]:
        """Centres (s, 3) and radii (s,) as they are written, in units of the body's radius."""
        rows = np.array(self.spheres or [(*centre, 1.0) for centre in TEMPLATES[self.name or ""]])
        return rows[:, :3].copy(), rows[:, 3].copy()


def _wrong_spheres(rows: Floats) -> Iterator[Mistake]:
    """Spheres that lie in another one, and such as hang on none."""
    centres, r = rows[:, :3], rows[:, 3]
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    inside = (apart + r[:, None] <= r[None] * (1.0 + 1e-12)) & ~np.eye(len(r), dtype=bool)
    if inside.any():
        rule = f"holds sphere {int(np.flatnonzero(inside.any(axis=1))[0])} (they count from 0), which lies wholly inside another one"
        yield Mistake(("spheres",), rule, "Leave it out, or move it so that it adds to the body")
    touching = apart <= r[:, None] + r[None] + TOUCHING * np.minimum(r[:, None], r[None])
    reached = np.zeros(len(r), dtype=bool)
    reached[0] = True
    for _ in r:
        reached = reached | touching[reached].any(axis=0)
    if not reached.all():
        rule = f"is not one piece: sphere {int(np.argmin(reached))} (they count from 0) does not touch sphere 0 or those that hang on it"
        yield Mistake(("spheres",), rule, "Move the spheres together until they touch or overlap")
