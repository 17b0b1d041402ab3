"""Keys of a recorded motion in a shake stage."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from dem_cli.scenario.quantities import Duration, DurationOrZero, JsonSchema, Number, Quantity
from dem_cli.scenario.table import Given, Mistake, Table, key

Peak = Annotated[float, Quantity(gt=0.0, unit="m/s^2", example="400 gal")]
Factor = Annotated[float, Number()]


class Component(Table):
    """A second component of the motion, at right angles to the first (anticlockwise: up, if the first is to the right)."""

    file: str | None = key(
        None, "file of the component (default: that of the first, with another column)", example="quake-ud.csv"
    )
    format: Literal["auto", "csv", "at2", "knet"] = key(
        "auto", "CSV with units, PEER NGA AT2, K-NET ASCII; auto looks at the file", example="at2"
    )
    column: str | None = key(
        None, "CSV: name or number (from 1) of the column (default: the first acceleration)", example="ay"
    )
    unit: str | None = key(None, "CSV: unit of acceleration, if the file names none", example="gal")
    interval: Duration | None = key(None, "CSV: time between samples, if the file does not say", example="0.01 s")
    peak: Peak | None = key(
        None, "largest acceleration after correction, to which the record is scaled; or give scale", example="400 gal"
    )
    scale: Factor | None = key(
        None, "factor on the accelerations, negative to turn them round; or give peak", example=1.5
    )

    alternatives: ClassVar = ((("peak",), ("scale",), ()),)

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        if given.good.get("scale") == 0.0:
            yield Mistake(("scale",), "takes all of the motion away", "Choose another factor, or leave the stage out")


class Record(Component):
    """A recorded motion."""

    file: str = key(
        doc="file beside the scenario; the accelerations of the container along `angle`", example="quake-ns.at2"
    )
    second: Component | None = key(
        None,
        "second component, at right angles to the first (anticlockwise: up, if the first is to the right); "
        "without peak and scale it takes the factor of the first",
        example={"file": "quake-ud.at2"},
    )
    baseline: Literal["none", "mean", "linear", "quadratic"] = key(
        "mean",
        "polynomial taken off the accelerations: the ground ends at rest; from linear on also where it began",
        example="quadratic",
    )
    taper: DurationOrZero = key(
        "0 s", "time over which the record is faded in and out, by half a cosine", example="0.5 s"
    )
    start: DurationOrZero = key("0 s", "time of the record at which the shaking begins", example="12 s")
    pad: DurationOrZero = key("0 s", "rest before and after the motion", example="0.5 s")
    resample: Duration | None = key(
        None, "new time between samples, band-limited; without it, straight lines between the samples", example="1 ms"
    )
    time_scale: Annotated[float, Number(gt=0.0)] = key(
        1.0, "factor on the record's times, for tests of models: 0.1 makes it ten times faster", example=0.1
    )

    short_form: ClassVar[JsonSchema | None] = {"type": "string", "minLength": 1, "description": "the file alone"}

    @classmethod
    def spell_out(cls, raw: Any) -> Any:
        return {"file": raw} if isinstance(raw, str) else raw

    @classmethod
    def rules(cls, given: Given) -> Iterator[Mistake]:
        yield from super().rules(given)
        second = given.raw.get("second")
        if isinstance(second, dict) and "file" not in second and "column" not in second:
            yield Mistake(("second", "file"), "is missing", "Give the file of the second component, or another column")
