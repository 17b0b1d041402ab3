"""Stages of a run, in the order in which they are done."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from dem_cli.scenario.quantities import Acceleration, Angle, Duration, DurationOrZero, Frequency, Number, Rate
from dem_cli.scenario.table import Given, Mistake, Table, key


class ExtraDamping(Table):
    """Damping while this stage settles, on top of that of the contacts; off by default."""

    mass: Rate = key(
        "0 1/s", "mass-proportional damping c: force -c m v on every grain, thesis (3.13)", example="5 1/s"
    )
    local: Annotated[float, Number(ge=0.0, lt=1.0)] = key(
        0.0, "Cundall's local damping: this share of the resultant force, against the motion", example=0.2
    )


class Settle(Table):
    """Waits until the sample is at rest. Ends when both measures are below their limits, or at the time limit."""

    kind: Literal["settle"] = key(doc='"settle"', example="settle")
    name: str = key("settle", "name in reports", example="packing")
    limit: Duration = key("20 s", "longest time; the stage ends here even if the sample still moves", example="20 s")
    unbalanced: Annotated[float, Number(gt=0.0, lt=1.0)] = key(
        1e-4, "rest: mean resultant force on a grain over mean contact force is below this", example=1e-4
    )
    kinetic: Annotated[float, Number(gt=0.0)] = key(
        1e-6, "rest: mean kinetic energy of a grain over its weight times its radius is below this", example=1e-6
    )
    damping: ExtraDamping = key({}, "extra damping while settling", example={"mass": "5 1/s"})

    @property
    def longest(self) -> float:
        """Longest time that the stage can take [s]."""
        return self.limit


class Shake(Table):
    """Shakes the container by a sine: ground acceleration amplitude * sin(2 pi frequency t), begun at rest."""

    kind: Literal["shake"] = key(doc='"shake"', example="shake")
    name: str = key("shake", "name in reports", example="400 gal")
    amplitude: Acceleration = key(doc="amplitude of the ground's acceleration", example="400 gal")
    frequency: Frequency = key(doc="frequency of the sine", example="10 Hz")
    duration: Duration | None = key(None, "how long; or give cycles", example="5 s")
    cycles: Annotated[float, Number(gt=0.0)] | None = key(
        None, "how many periods of the sine; or give duration", example=50
    )
    ramp: DurationOrZero = key(
        "0 s",
        "time over which the amplitude grows from zero at the start, and falls to zero at the end",
        example="0.5 s",
    )
    angle: Angle = key("0 deg", "direction of the shaking, anticlockwise from +x (to the right)", example="0 deg")

    alternatives: ClassVar = ((("duration",), ("cycles",)),)

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        good = given.good
        enough = {"frequency", "ramp", "duration", "cycles"} <= good.keys()
        if enough and bool(good["duration"]) != bool(good["cycles"]):
            longest = good["duration"] or good["cycles"] / good["frequency"]
            if 2.0 * good["ramp"] > longest:
                yield Mistake(
                    ("ramp",), f"is longer than half of the stage, which takes {longest:g} s", "Shorten the ramp"
                )

    @property
    def longest(self) -> float:
        """Time that the stage takes [s]."""
        if self.duration is not None:
            return self.duration
        assert self.cycles is not None
        return self.cycles / self.frequency


class Run(Table):
    """Lets the sample move under gravity for a fixed time."""

    kind: Literal["run"] = key(doc='"run"', example="run")
    name: str = key("run", "name in reports", example="rest")
    duration: Duration = key(doc="how long", example="1 s")

    @property
    def longest(self) -> float:
        """Time that the stage takes [s]."""
        return self.duration


Stage = Annotated[Settle | Shake | Run, Field(discriminator="kind")]
STAGES: dict[str, type[Table]] = {"settle": Settle, "shake": Shake, "run": Run}
