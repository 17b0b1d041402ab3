"""Stages of a run, in the order in which they are done."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field, PrivateAttr

from dem_cli.scenario.ground_motion import GroundMotion, ground_motion
from dem_cli.scenario.quantities import (
    Acceleration,
    Angle,
    Duration,
    DurationOrZero,
    Frequency,
    JsonSchema,
    Number,
    Rate,
)
from dem_cli.scenario.records import Record
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
    """Waits until the sample is at rest. Ends when both measures are below their limits three rows of the series in a row, or at the limit."""

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
    """Shakes the container: by a sine, ground acceleration amplitude * sin(2 pi frequency t), or by a recorded motion."""

    kind: Literal["shake"] = key(doc='"shake"', example="shake")
    name: str = key("shake", "name in reports", example="400 gal")
    amplitude: Acceleration | None = key(
        None, "sine: amplitude of the ground's acceleration; or give record", example="400 gal"
    )
    frequency: Frequency | None = key(None, "sine: its frequency", example="10 Hz")
    record: Record | None = key(
        None,
        "recorded motion, in place of amplitude and frequency: the file, or a table",
        example={"file": "quake-ns.at2", "peak": "400 gal"},
    )
    duration: Duration | None = key(
        None,
        "how long; or give cycles. With a record it may be left out; the record is cut, or followed by rest",
        example="5 s",
    )
    cycles: Annotated[float, Number(gt=0.0)] | None = key(
        None, "how many periods of the sine; or give duration", example=50
    )
    ramp: DurationOrZero = key(
        "0 s",
        "sine: time over which the amplitude grows from zero at the start, and falls to zero at the end",
        example="0.5 s",
    )
    angle: Angle = key("0 deg", "direction of the shaking, anticlockwise from +x (to the right)", example="0 deg")

    alternatives: ClassVar = ((("amplitude", "frequency"), ("record",)), (("duration",), ("cycles",), ()))
    more_schema: ClassVar[JsonSchema] = {
        "if": {"required": ["record"]},
        "then": {"not": {"anyOf": [{"required": [name]} for name in ("amplitude", "frequency", "cycles")]}},
        "else": {"oneOf": [{"required": ["duration"]}, {"required": ["cycles"]}]},
    }

    # The motion of the record, once `read_record` has been called: paths start in the scenario's folder.
    _motion: GroundMotion | None = PrivateAttr(default=None)

    elsewhere: ClassVar = {"heading": ("impulse", "Leave it out: grains lie in a plane, angle says how it is shaken")}

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        raw, good = given
        if "record" in raw:
            for name, remedy in (
                ("cycles", "Write duration in its place"),
                ("ramp", "Write taper in the record's table in its place"),
            ):
                if name in raw and good.get(name) and "amplitude" not in raw:
                    yield Mistake((name,), "is of a sine, and contradicts record", remedy)
            rest = 2.0 * good["record"].pad if good.get("record") else 0.0
            if good.get("duration") and rest >= good["duration"]:
                rule = f"leaves nothing of the stage, which takes {good['duration']:g} s"
                yield Mistake(("record", "pad"), rule, "Shorten it, or give the stage more time")
            return
        if "duration" not in raw and "cycles" not in raw:
            yield Mistake(("duration",), "is missing", "Give one of: duration or cycles")
        enough = {"frequency", "ramp", "duration", "cycles"} <= good.keys() and good["frequency"]
        if enough and bool(good["duration"]) != bool(good["cycles"]):
            longest = good["duration"] or good["cycles"] / good["frequency"]
            if 2.0 * good["ramp"] > longest:
                yield Mistake(
                    ("ramp",), f"is longer than half of the stage, which takes {longest:g} s", "Shorten the ramp"
                )

    def read_record(self, folder: Path) -> None:
        """Reads and prepares the recorded motion; its path starts in `folder`. RecordError if it cannot be used."""
        if self.record is not None:
            self._motion = ground_motion(self.record, self.duration, folder)

    @property
    def motion(self) -> GroundMotion | None:
        """The recorded motion, None for a sine. ValueError if it has not been read."""
        if self.record is not None and self._motion is None:
            raise ValueError("the record of this stage has not been read: load the scenario, or call read_record")
        return self._motion

    @property
    def longest(self) -> float:
        """Time that the stage takes [s]."""
        if self.duration is not None:
            return self.duration
        if (motion := self.motion) is not None:
            return motion.duration
        assert self.cycles is not None
        assert self.frequency is not None
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
