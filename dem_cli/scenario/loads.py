"""Stages of quasi-static tests. Stress is positive in compression; e1, e2 and q = s1 - s2 are axial minus lateral."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from dem_cli.scenario.quantities import Friction, Number, Pressure, Whole
from dem_cli.scenario.table import Given, Mistake, Table, key

Hold = Literal["mean-stress", "lateral-stress", "volume", "lateral-strain"]
Axial = Literal["y", "x"]
Total = Literal["mean-stress", "lateral-stress"]
USUAL_AMPLITUDE = 1e-3  # of shear strain, of cycles between limits of stress; for estimates only
ROUNDING = 1e-9


def _total(good: dict[str, Any]) -> str | None:
    return "mean-stress" if good["hold"] == "volume" else None


class QuasiStaticStage(Table):
    """A stage of a quasi-static test."""

    kind: str = key(doc="what is done")
    name: str = key(doc="name in reports")
    branch: str | None = key(
        None,
        "name of an earlier stage, from whose end this one goes on (default: from the stage before it)",
        example="compress",
        alias="from",
    )

    @property
    @abstractmethod
    def planned(self) -> int:
        """Increments to expect."""


class Compress(QuasiStaticStage):
    """Compresses the sample to an isotropic stress, in levels, each brought to equilibrium."""

    kind: Literal["compress"] = key(doc='"compress"', example="compress")
    name: str = key("compress", "name in reports", example="compress")
    stress: Pressure = key(doc="stress on all boundaries at the end", example="15 kPa")
    levels: tuple[Annotated[float, Number(gt=0.0, le=1.0)], ...] = key(
        [0.05, 0.1, 0.2, 0.4, 0.7, 1.0], "shares of the stress, ascending to 1", example=[0.1, 0.5, 1.0]
    )
    friction: Friction | None = key(
        None,
        "friction between grains during this stage: the smaller, the denser (default: that of the contacts, which follows in any case)",
        example="15 deg",
    )

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        levels = given.good.get("levels")
        if levels == ():
            yield Mistake(("levels",), "is empty", "Write [1], or leave it out")
        elif levels and any(b <= a for a, b in pairwise(levels)):
            yield Mistake(("levels",), "must be ascending", "Sort them, each once")
        elif levels and levels[-1] != 1.0:
            yield Mistake(("levels",), "must end with 1, the whole stress", "Add 1 at the end")

    @property
    def planned(self) -> int:
        return len(self.levels)


class Shear(QuasiStaticStage):
    """Shears the sample by a growing difference of the principal strains."""

    kind: Literal["shear"] = key(doc='"shear"', example="shear")
    name: str = key("shear", "name in reports", example="shear")
    hold: Hold = key(
        doc="what stays as it is at the start of the stage; volume: the pores are closed", example="mean-stress"
    )
    axial: Axial = key("y", "direction of the compression", example="y")
    shear_strain: Annotated[float, Number(gt=0.0, le=2.0)] = key(
        doc="e1 - e2 at the end, counted from the start of the stage", example=0.03
    )
    increment: Annotated[float, Number(gt=0.0, le=0.1)] = key(0.0005, "of e1 - e2", example=0.0005)
    total: Total | None = key(
        maker=_total,
        doc='hold = "volume": total stress that stays as it is, from which the pore pressure follows (default: mean-stress)',
        example="mean-stress",
    )

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from _total_fits(given)
        good = given.good
        if {"shear_strain", "increment"} <= good.keys() and good["increment"] > good["shear_strain"]:
            rule = f"is larger than shear_strain, {good['shear_strain']:g}"
            yield Mistake(("increment",), rule, "Take a smaller increment")

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        return [("total",)] if tuple(path) == ("hold",) and value != "volume" else []

    @property
    def planned(self) -> int:
        return math.ceil(self.shear_strain / self.increment * (1.0 - ROUNDING))


class Target(Table):
    """Stress or strain in one direction at the end of a stage."""

    stress: Pressure | None = key(None, "stress on the boundary; or give strain", example="20 kPa")
    strain: Annotated[float, Number(gt=-1.0, lt=1.0)] | None = key(
        None, "strain from the start of the stage on, compression > 0; or give stress", example=0.01
    )

    alternatives: ClassVar = ((("stress",), ("strain",)),)


class Load(QuasiStaticStage):
    """Brings stress or strain in each direction to a value, in equal increments."""

    kind: Literal["load"] = key(doc='"load"', example="load")
    name: str = key("load", "name in reports", example="consolidation")
    x: Target = key(doc="what is reached across the sample", example={"stress": "15 kPa"})
    y: Target = key(doc="what is reached along its height", example={"strain": 0.01})
    increments: Annotated[int, Whole(ge=1)] = key(20, "number of increments", example=20)

    @property
    def planned(self) -> int:
        return self.increments


class Limit(Table):
    """Where the loading is reversed: at this value to one side, and at its negative to the other."""

    stress: Pressure | None = key(None, "of q = s1 - s2", example="2 kPa")
    stress_ratio: Annotated[float, Number(gt=0.0, lt=2.0)] | None = key(
        None, "of q over the mean stress at the start of the stage", example=0.15
    )
    strain: Annotated[float, Number(gt=0.0, lt=1.0)] | None = key(
        None, "of e1 - e2, counted from the start of the stage", example=0.01
    )

    alternatives: ClassVar = ((("stress",), ("stress_ratio",), ("strain",)),)


class Cyclic(QuasiStaticStage):
    """Shears the sample to and fro between limits; ends when the cycles are done, or the sample has liquefied."""

    kind: Literal["cyclic"] = key(doc='"cyclic"', example="cyclic")
    name: str = key("cyclic", "name in reports", example="cycles")
    hold: Hold = key(
        doc="what stays as it is at the start of the stage; volume: the pores are closed", example="volume"
    )
    axial: Axial = key("y", "direction of the first compression", example="y")
    total: Total | None = key(
        maker=_total,
        doc='hold = "volume": total stress that stays as it is, from which the pore pressure follows (default: mean-stress)',
        example="mean-stress",
    )
    limit: Limit = key(doc="where the loading is reversed", example={"stress_ratio": 0.15})
    cycles: Annotated[int, Whole(ge=1)] = key(doc="how many, each to both limits and back", example=10)
    increment: Annotated[float, Number(gt=0.0, le=0.1)] = key(
        1e-4, "of e1 - e2; the last one before a limit is cut to meet it", example=1e-4
    )
    liquefied: Annotated[float, Number(gt=0.0, lt=1.0)] = key(
        0.01,
        "the stage ends as liquefied once the mean stress is below this share of that at its start",
        example=0.01,
    )
    max_strain: Annotated[float, Number(gt=0.0, lt=2.0)] = key(
        maker=lambda good: max(0.05, 2.0 * (good["limit"].strain or 0.0)),
        doc="largest e1 - e2 between two reversals; the loading is reversed there even if a limit of stress is not met (default: 0.05)",
        example=0.05,
    )

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from _total_fits(given)
        good = given.good
        limit, increment, longest = (good.get(name) for name in ("limit", "increment", "max_strain"))
        if not limit or not limit.strain:
            return
        if increment and increment > limit.strain:
            yield Mistake(("increment",), f"is larger than limit.strain, {limit.strain:g}", "Take a smaller increment")
        if longest and longest < 2.0 * limit.strain:
            rule = f"is less than from one limit to the other, which is {2.0 * limit.strain:g}"
            yield Mistake(("max_strain",), rule, "Leave it out, or take smaller limits")

    @classmethod
    def displaced(cls, path: Sequence[str], value: Any) -> list[tuple[str, ...]]:
        if tuple(path) == ("hold",) and value != "volume":
            return [("total",)]
        return [("max_strain",)] if tuple(path) == ("limit", "strain") else []

    @property
    def planned(self) -> int:
        """Increments to expect; a guess between limits of stress, whose strains nobody knows beforehand."""
        amplitude = self.limit.strain or USUAL_AMPLITUDE
        return self.cycles * math.ceil(4.0 * amplitude / self.increment * (1.0 - ROUNDING))


def _total_fits(given: Given) -> Iterator[Mistake]:
    hold = given.good.get("hold")
    if "total" in given.raw and hold and hold != "volume":
        rule = f'is a key of hold = "volume", which closes the pores, not of "{hold}"'
        yield Mistake(("total",), rule, 'Leave it out, or write hold = "volume"')


Loading = Annotated[Compress | Shear | Load | Cyclic, Field(discriminator="kind")]
LOADS: dict[str, type[QuasiStaticStage]] = {"compress": Compress, "shear": Shear, "load": Load, "cyclic": Cyclic}
