"""Shapes of grains: aspect ratios of ellipses, orientations, templates of several discs, and the bonds between them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, Strict
from pydantic_core import core_schema

from dem_cli.geometry.union import pieces
from dem_cli.scenario.quantities import Angle, JsonSchema, Number, Quantity, RotationalViscosity, Whole, mistake
from dem_cli.scenario.table import Given, Mistake, Table, did_you_mean, key

Floats = npt.NDArray[np.float64]
FULL_TURN = 2.0 * math.pi
TOUCHING = 1e-3  # discs of a template touch if what parts them is less than this share of the smaller radius

AspectNumber = Annotated[float, Number(ge=1.0, le=5.0)]


class Portion(Table):
    """A part of a mixture."""

    ratio: AspectNumber = key(doc="aspect ratio of this part; 1 is a disc", example=2.0)
    share: Annotated[float, Number(gt=0.0, le=1.0)] = key(doc="its share of the number of grains", example=0.5)


class AspectRatio(Table):
    """Aspect ratios a/b of ellipses: one number, or a table with exactly one of the keys below."""

    fixed: AspectNumber | None = key(None, "all ellipses have this ratio; the same as aspect_ratio = 2", example=2.0)
    uniform: tuple[AspectNumber, AspectNumber] | None = key(
        None, "evenly distributed between two ratios", example=[1.0, 2.0]
    )
    mix: tuple[Portion, ...] | None = key(
        None,
        "a mixture, for example of discs (ratio 1) and ellipses: each share to the nearest grain, in random order",
        example=[{"ratio": 1.0, "share": 0.5}, {"ratio": 2.0, "share": 0.5}],
    )

    alternatives: ClassVar = ((("fixed",), ("uniform",), ("mix",)),)
    short_form: ClassVar[JsonSchema | None] = {
        "type": "number",
        "minimum": 1,
        "maximum": 5,
        "description": "one ratio for all",
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return raw if isinstance(raw, dict) else {"fixed": raw}

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        if (pair := good.get("uniform")) and pair[0] > pair[1]:
            yield Mistake(("uniform",), "must be ascending", "Write the smaller ratio first")
        mix = good.get("mix")
        if mix == ():
            yield Mistake(("mix",), "is empty", "Give for example { ratio = 2, share = 1 }")
        elif mix and abs(total := math.fsum(part.share for part in mix) - 1.0) > 1e-9:
            yield Mistake(("mix",), f"has shares that add up to {total + 1.0:g}", "Make them add up to 1")

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest ratio that can occur."""
        if self.uniform is not None:
            return self.uniform
        ratios = [part.ratio for part in self.mix] if self.mix else [self.fixed or 1.0]
        return min(ratios), max(ratios)

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """`count` ratios; nothing is drawn where all are equal."""
        if self.uniform is not None:
            return rng.uniform(self.uniform[0], self.uniform[1], count)
        if self.mix is None:
            return np.full(count, self.fixed)
        ends = np.cumsum([part.share for part in self.mix]) * count
        which = np.searchsorted(np.rint(ends[:-1]), np.arange(count), side="right")
        ratios: Floats = np.array([part.ratio for part in self.mix])[rng.permutation(which)]
        return ratios


class Orientation(Table):
    """Angles of the grains at the start, anticlockwise: of an ellipse's longer axis, or of a template's x axis, from +x."""

    fixed: Angle | None = key(None, 'all grains have this angle; the same as orientation = "30 deg"', example="30 deg")
    uniform: tuple[Angle, Angle] | None = key(
        None,
        'evenly distributed between two angles; "random" stands for a full turn',
        example=["-30 deg", "30 deg"],
    )

    alternatives: ClassVar = ((("fixed",), ("uniform",)),)
    short_form: ClassVar[JsonSchema | None] = {
        "type": "string",
        "description": '"random", or one angle for all',
        "examples": ["random", "30 deg"],
    }
    short_words: ClassVar[str | None] = '`"random"` or angle'

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        if raw == "random":
            return {"uniform": ["0 deg", "360 deg"]}
        return raw if isinstance(raw, dict) else {"fixed": raw}

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        if (pair := given.good.get("uniform")) and pair[0] > pair[1]:
            yield Mistake(("uniform",), "must be ascending", "Write the smaller angle first")

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest angle that can occur [rad]."""
        if self.uniform is not None:
            return self.uniform
        assert self.fixed is not None
        return self.fixed, self.fixed

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """`count` angles [rad]; nothing is drawn where all are equal."""
        if self.uniform is not None:
            return rng.uniform(self.uniform[0], self.uniform[1], count)
        return np.full(count, self.fixed)


@dataclass(frozen=True)
class TemplateName:
    """Annotation of the name of a template that comes along."""

    def validate(self, value: Any) -> str:
        if not isinstance(value, str):
            raise mistake("must be text in quotes, or a table", 'Write for example "pair"')
        chain = re.fullmatch(r"chain-(\d+)", value)
        if value not in SHAPES and not chain:
            known = [*SHAPES, "chain-3"]
            raise mistake("must be one of pair, triangle, square, chain-N", did_you_mean(value, known))
        if chain and not 2 <= int(chain[1]) <= 20:
            raise mistake("is a chain of a length that is not on offer", "Choose a number from 2 to 20: chain-3")
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.validate)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> JsonSchema:
        return {"type": "string", "pattern": NAME_PATTERN}


NAME_PATTERN = "^(pair|triangle|square|chain-([2-9]|1[0-9]|20))$"
# Centres of equal discs of radius 1 that touch.
SHAPES: dict[str, list[tuple[float, float]]] = {
    "pair": [(-1.0, 0.0), (1.0, 0.0)],
    "triangle": [(-1.0, -1.0 / math.sqrt(3.0)), (1.0, -1.0 / math.sqrt(3.0)), (0.0, 2.0 / math.sqrt(3.0))],
    "square": [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)],
}


class TemplateDisc(Table):
    """A disc of a template, in units of the grain's radius."""

    x: Annotated[float, Number()] = key(doc="centre, to the right", example=-1.0)
    y: Annotated[float, Number()] = key(0.0, "centre, upwards", example=0.0)
    r: Annotated[float, Number(gt=0.0)] = key(1.0, "radius", example=1.0)


class Template(Table):
    """Discs that make up a grain, in units of its radius: a name, or a table of discs and bonds. They are shifted to the centre of mass."""

    name: Annotated[str, TemplateName()] | None = key(
        None,
        "pair, triangle, square, or chain-N with N from 2 to 20: equal discs of radius 1 that touch",
        example="pair",
    )
    discs: tuple[TemplateDisc, ...] | None = key(
        None,
        "the discs: each touches or overlaps another one, so that they are one piece; overlaps count once",
        example=[{"x": -1.0, "y": 0.0, "r": 1.0}, {"x": 1.0, "y": 0.0, "r": 1.0}],
    )
    bonds: tuple[tuple[Annotated[int, Whole(ge=0)], Annotated[int, Whole(ge=0)]], ...] | None = key(
        None,
        "which discs are bonded, counted from 0 (default: all that touch or overlap); a clump is rigid without them",
        example=[[0, 1]],
    )

    alternatives: ClassVar = ((("name",), ("discs",)),)
    short_form: ClassVar[JsonSchema | None] = {"type": "string", "pattern": NAME_PATTERN, "description": "its name"}
    short_words: ClassVar[str | None] = '`"pair"`, `"triangle"`, `"square"`, `"chain-N"`'

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return raw if isinstance(raw, dict) else {"name": raw}

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        discs, bonds = good.get("discs"), good.get("bonds")
        if discs == ():
            yield Mistake(("discs",), "is empty", "Give at least one disc: { x = 0, y = 0, r = 1 }")
        wrong = False
        if discs:
            for one in _wrong_discs(cls.model_construct(discs=discs)):
                wrong = True
                yield one
        if bonds is not None and (discs or good.get("name")) and not wrong:
            yield from _wrong_bonds(cls.model_construct(name=good.get("name"), discs=discs), bonds)

    def outline(self) -> tuple[Floats, Floats, Floats]:
        """Centres x, y and radii of the discs as they are written, shape (discs,) each, in units of the grain's radius."""
        if self.discs:
            rows = [(disc.x, disc.y, disc.r) for disc in self.discs]
        else:
            assert self.name is not None
            many = int(self.name[6:]) if self.name.startswith("chain-") else 0
            centres = SHAPES.get(self.name) or [(2.0 * k - (many - 1.0), 0.0) for k in range(many)]
            rows = [(x, y, 1.0) for x, y in centres]
        x, y, r = np.array(rows).T
        return x, y, r

    @property
    def area(self) -> float:
        """Area of the outline, overlaps counted once, in units of the grain's radius squared."""
        return pieces(*self.outline()).whole[0]

    def centred(self) -> tuple[Floats, Floats, Floats]:
        """The outline with its centre of mass at (0, 0), overlaps counted once."""
        x, y, r = self.outline()
        _, cx, cy, _ = pieces(x, y, r).whole
        return x - cx, y - cy, r

    def touching(self) -> list[tuple[int, int]]:
        """Pairs of discs that touch or overlap, the smaller number first."""
        x, y, r = self.outline()
        return [
            (i, j)
            for i, j in combinations(range(len(x)), 2)
            if math.hypot(x[j] - x[i], y[j] - y[i]) <= r[i] + r[j] + TOUCHING * min(r[i], r[j])
        ]

    def bonded(self) -> list[tuple[int, int]]:
        """Pairs of discs that are bonded, sorted, the smaller number first."""
        return self.touching() if self.bonds is None else sorted((min(pair), max(pair)) for pair in self.bonds)


def _pieces_of(count: int, pairs: list[tuple[int, int]]) -> list[set[int]]:
    """Sets of discs that hang together by the pairs."""
    sets = [{k} for k in range(count)]
    for i, j in pairs:
        one, other = (next(s for s in sets if k in s) for k in (i, j))
        if one is not other:
            one |= other
            sets.remove(other)
    return sets


def _wrong_discs(template: Template) -> Iterator[Mistake]:
    x, y, r = template.outline()
    idle = np.flatnonzero(pieces(x, y, r).area <= 1e-9 * r**2)
    if len(idle):
        rule = f"holds disc {idle[0]} (they count from 0), which lies wholly inside the others"
        yield Mistake(("discs",), rule, "Leave it out, or move it so that it adds to the outline")
    apart = _pieces_of(len(x), template.touching())
    if len(apart) > 1:
        rule = f"is not one piece: disc {min(apart[1])} (they count from 0) does not touch disc {min(apart[0])} or those that hang on it"
        yield Mistake(("discs",), rule, "Move the discs together until they touch or overlap")


def _wrong_bonds(template: Template, bonds: tuple[tuple[int, int], ...]) -> Iterator[Mistake]:
    count, touching = len(template.outline()[0]), set(template.touching())
    pairs: list[tuple[int, int]] = []
    for k, (i, j) in enumerate(bonds):
        pair = (min(i, j), max(i, j))
        if max(i, j) >= count:
            yield Mistake(
                ("bonds", k), f"names disc {max(i, j)} of {count}; discs count from 0", f"The last is {count - 1}"
            )
        elif i == j:
            yield Mistake(("bonds", k), "joins a disc with itself", "Name two discs")
        elif pair not in touching:
            yield Mistake(
                ("bonds", k), "joins discs that do not touch", "A bond acts where two discs touch: leave it out"
            )
        elif pair in pairs:
            yield Mistake(("bonds", k), "is there twice", "Leave one out")
        else:
            pairs.append(pair)
    if len(pairs) == len(bonds) and len(apart := _pieces_of(count, pairs)) > 1:
        rule = f"does not hold disc {min(apart[1])} (they count from 0)"
        yield Mistake(("bonds",), rule, "Bond each disc to the others, or leave bonds out: then all that touch are")


BondViscosity = Annotated[
    float | Literal["stiff"], Quantity(gt=0.0, unit="N s/m", example="1e8 N s/m", words_allowed=("stiff",))
]


class Bond(Table):
    """Dashpots between discs of a grain (shape "bonded", thesis ch. 5), without spring and friction limit.

    They creep under lasting load, at the rate force/viscosity.
    """

    normal: BondViscosity = key(
        "stiff", "normal viscosity Cn; stiff = 1e5 sqrt(m kn), m the mass of the lighter disc", example="stiff"
    )
    tangential: BondViscosity = key("stiff", "tangential viscosity Cs; stiff as above", example="stiff")
    rolling: Annotated[bool, Strict()] = key(
        True,
        "whether the bond withstands rolling, so that the grain turns as one; false is the thesis: discs roll on each other like gears",
        example=True,
    )
    rolling_viscosity: RotationalViscosity | None = key(
        None,
        "moment over the rate at which one disc turns against the other (default: tangential viscosity times both radii)",
        example="1e4 N m s",
    )

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        if given.good.get("rolling") is False and "rolling_viscosity" in given.raw:
            yield Mistake(
                ("rolling_viscosity",), "contradicts rolling = false", "Leave it out, or write rolling = true"
            )
