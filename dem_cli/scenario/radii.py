"""Sizes of grains: one size, uniform, truncated normal, a list, or a grading curve as soil people give it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt

from dem_cli.scenario.quantities import JsonSchema, Length, Number, Whole
from dem_cli.scenario.table import Given, Mistake, Table, key

Floats = npt.NDArray[np.float64]


class Normal(Table):
    """Normal distribution, cut off at both ends."""

    mean: Length = key(doc="mean before cutting", example="7.5 mm")
    sd: Length = key(doc="standard deviation before cutting", example="1 mm")
    min: Length = key(doc="smallest radius", example="5 mm")
    max: Length = key(doc="largest radius", example="10 mm")

    unit: ClassVar[str] = " m"

    @property
    def share(self) -> float:
        """Probability of the window from min to max."""
        low, high = (math.erf((x - self.mean) / (self.sd * math.sqrt(2.0))) for x in (self.min, self.max))
        return 0.5 * (high - low)

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        if not {"min", "max"} <= good.keys():
            return
        if good["min"] >= good["max"]:
            yield Mistake(
                ("min",), "must be smaller than max", f"Swap them, or raise max above {good['min']:g}{cls.unit}"
            )
        elif {"mean", "sd"} <= good.keys() and (share := cls.model_construct(**good).share) < 0.01:
            rule = f"leaves, up to max, only {share:.1g} of the normal distribution; 0.01 is the least"
            yield Mistake(("min",), rule, "Widen the window, or move mean into it")

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """`count` radii [m]: normal numbers, those outside the window drawn again."""
        kept = np.empty(0)
        while len(kept) < count:
            drawn = rng.normal(self.mean, self.sd, 2 * count)
            kept = np.concatenate([kept, drawn[(drawn >= self.min) & (drawn <= self.max)]])
        return kept[:count]


class Grading(Table):
    """Grading curve: percent by mass finer than each sieve, straight between sieves over the logarithm of size."""

    sieve: tuple[Length, ...] = key(doc="sieve sizes (grain diameters), ascending", example=["2 mm", "5 mm", "10 mm"])
    passing: tuple[Annotated[float, Number(ge=0.0, le=100.0)], ...] = key(
        doc="percent by mass that passes each sieve, ascending from 0 to 100", example=[0, 30, 100]
    )

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        sieve, passing = good.get("sieve"), good.get("passing")
        if sieve is not None and len(sieve) < 2:
            yield Mistake(
                ("sieve",), "needs at least two sizes", "Name the size that all grains pass and the one that none does"
            )
        if sieve is not None and any(b <= a for a, b in pairwise(sieve)):
            yield Mistake(("sieve",), "must be ascending", "Sort the sieves from fine to coarse, passing with them")
        if passing is not None and any(b < a for a, b in pairwise(passing)):
            yield Mistake(("passing",), "must be ascending", "What passes a sieve passes every coarser one")
        elif passing is not None and passing and (passing[0] != 0.0 or passing[-1] != 100.0):
            yield Mistake(
                ("passing",), "must begin with 0 and end with 100", "Add the sizes of the finest and coarsest grain"
            )
        if sieve is not None and passing is not None and len(sieve) != len(passing):
            yield Mistake(
                ("passing",), f"has {len(passing)} values for {len(sieve)} sieves", "Give one percentage for each sieve"
            )

    def draw(self, rng: np.random.Generator, count: int, dimensions: int = 2) -> Floats:
        """`count` radii [m] whose mass follows the curve; dimensions: 2 for discs, 3 for spheres.

        Mass per ln d is constant between two sieves a < b, and a disc's mass goes with d^k, k = 2, so their number per d goes with
        d^-(k+1): a segment that holds the share w of mass holds the number w (a^-k - b^-k) / (k ln(b/a)), and within it d^-k
        is uniform.
        """
        d = np.array(self.sieve)
        mass = np.diff(self.passing)
        inverse = d ** -float(dimensions)
        number = mass * -np.diff(inverse) / (dimensions * np.diff(np.log(d)))
        segment = rng.choice(len(number), size=count, p=number / number.sum())
        coarse, fine = inverse[segment + 1], inverse[segment]
        drawn = coarse + (fine - coarse) * rng.random(count)
        return 0.5 / np.sqrt(drawn) if dimensions == 2 else np.asarray(0.5 * drawn ** (-1.0 / dimensions))


class SizeClass(Table):
    """Grains of one size."""

    radius: Length = key(doc="their radius", example="3 mm")
    count: Annotated[int, Whole(ge=1)] = key(doc="how many there are", example=72)


class Radius(Table):
    """Radii of the grains: a length if all are equal, or a table with exactly one of the keys below."""

    fixed: Length | None = key(None, doc='all grains have this radius; the same as radius = "7 mm"', example="7 mm")
    uniform: tuple[Length, Length] | None = key(
        None, doc="evenly distributed between two radii", example=["0.5 cm", "1 cm"]
    )
    normal: Normal | None = key(
        None,
        doc="normal distribution, cut off at both ends",
        example={"mean": "7.5 mm", "sd": "1 mm", "min": "5 mm", "max": "10 mm"},
    )
    sizes: tuple[Length, ...] | None = key(
        None, alias="list", doc="one radius for each grain, in the order of their ids", example=["5 mm", "6 mm", "5 mm"]
    )
    grading: Grading | None = key(
        None,
        doc="grading curve, percent by mass",
        example={"sieve": ["2 mm", "5 mm", "10 mm"], "passing": [0, 30, 100]},
    )

    classes: tuple[SizeClass, ...] | None = key(
        None,
        doc="so many grains of each size, in random order",
        example=[{"radius": "3 mm", "count": 72}, {"radius": "4.5 mm", "count": 32}],
    )

    alternatives: ClassVar = ((("fixed",), ("uniform",), ("normal",), ("list",), ("grading",), ("classes",)),)
    short_form: ClassVar[JsonSchema | None] = {
        "type": "string",
        "description": "one radius for all",
        "examples": ["7 mm"],
    }

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return raw if isinstance(raw, dict) else {"fixed": raw}

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        if (pair := good.get("uniform")) and pair[0] > pair[1]:
            yield Mistake(("uniform",), "must be ascending", "Write the smaller radius first")
        if good.get("sizes") == ():
            yield Mistake(("list",), "is empty", "Give one radius for each grain")
        if good.get("classes") == ():
            yield Mistake(("classes",), "is empty", 'Give for example [{ radius = "3 mm", count = 72 }]')

    @property
    def number(self) -> int | None:
        """How many grains there are, where the sizes say so."""
        if self.sizes is not None:
            return len(self.sizes)
        return sum(one.count for one in self.classes) if self.classes is not None else None

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest radius that can occur [m]."""
        if self.fixed is not None:
            return self.fixed, self.fixed
        if self.uniform is not None:
            return self.uniform
        if self.normal is not None:
            return self.normal.min, self.normal.max
        if self.sizes is not None:
            return min(self.sizes), max(self.sizes)
        if self.classes is not None:
            radii = [one.radius for one in self.classes]
            return min(radii), max(radii)
        assert self.grading is not None
        return self.grading.sieve[0] / 2.0, self.grading.sieve[-1] / 2.0

    def draw(self, rng: np.random.Generator, count: int, dimensions: int = 2) -> Floats:
        """Radii [m], shape (count,). For a list `count` must be its length, and nothing is drawn; classes are shuffled.

        dimensions: of the grains, which a grading curve needs to know.
        """
        if self.fixed is not None:
            return np.full(count, self.fixed)
        if self.uniform is not None:
            return rng.uniform(self.uniform[0], self.uniform[1], count)
        if self.sizes is not None:
            return np.array(self.sizes)
        if self.classes is not None:
            return rng.permutation(np.repeat([one.radius for one in self.classes], [one.count for one in self.classes]))
        if self.normal is not None:
            return self.normal.draw(rng, count)
        assert self.grading is not None
        return self.grading.draw(rng, count, dimensions)
