"""Types of the scenario's values: quantities that are written with their unit, and plain numbers within bounds.

A type carries unit and range; error messages, the JSON Schema and the reference of README are made from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from dem_cli import units

JsonSchema = dict[str, Any]


def mistake(rule: str, remedy: str) -> PydanticCustomError:
    """The one error that validators of this model raise."""
    return PydanticCustomError("mistake", "{rule}. {remedy}", {"rule": rule, "remedy": remedy})


@dataclass(frozen=True)
class Range:
    """Bounds of a value in SI units; None is no bound."""

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    def holds(self, value: float) -> bool:
        return (
            (self.gt is None or value > self.gt)
            and (self.ge is None or value >= self.ge)
            and (self.lt is None or value < self.lt)
            and (self.le is None or value <= self.le)
        )

    def words(self, unit: str = "") -> str:
        """For example "above 0 m" or "from 0, below 0.5"."""
        said = {"above": self.gt, "from": self.ge, "below": self.lt, "up to": self.le}
        return ", ".join(f"{word} {bound:g} {unit}".strip() for word, bound in said.items() if bound is not None)

    def check(self, value: float, unit: str = "") -> None:
        if not self.holds(value):
            raise mistake(f"is out of range, allowed is {self.words(unit)}", "Choose a value in this range")


@dataclass(frozen=True)
class Quantity(Range):
    """Annotation of a float that is written as a string with unit and held in SI `unit`.

    words_allowed: words that may stand in its place, for example "auto".
    """

    unit: str = ""
    example: str | None = None
    words_allowed: tuple[str, ...] = ()

    def validate(self, value: Any) -> float | str:
        if isinstance(value, str) and value in self.words_allowed:
            return value
        kind, usual = units.KINDS[self.unit]
        example = self.example or usual
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            rest = example.split(maxsplit=1)[1]
            raise mistake(
                f"is a bare number, {units.article(kind)} needs its unit",
                f'Write "{value:g} {rest}" if that is what you mean',
            )
        if not isinstance(value, str):
            raise mistake(f"must be {units.article(kind)} in quotes", f'Write for example "{example}"')
        try:
            number = units.parse(value, self.unit, example)
        except units.UnitError as error:
            raise mistake(error.rule, error.remedy) from None
        self.check(number, self.unit)
        return number

    def write(self, value: float | str) -> str:
        return value if isinstance(value, str) else units.write(value, self.unit)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.validate,
            serialization=core_schema.plain_serializer_function_ser_schema(self.write, when_used="json"),
        )

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> JsonSchema:
        kind, usual = units.KINDS[self.unit]
        number = r"[+-]?([0-9][0-9_]*\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"
        pattern = rf"^\s*{number}(\s*(?![eE][+-]?[0-9])[A-Za-zµ°%].*|\s+1/.*)$"
        if self.words_allowed:
            pattern = f"^({'|'.join(self.words_allowed)})$|{pattern}"
        bounds = self.words(self.unit)
        about = f"{kind} with its unit" + (f", {bounds}" if bounds else "")
        return {"type": "string", "pattern": pattern, "examples": [self.example or usual], "$comment": about}


@dataclass(frozen=True)
class Number(Range):
    """Annotation of a plain number (no unit)."""

    def validate(self, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise mistake("must be a plain number", _plainly(value, "0.5"))
        if not math.isfinite(value):
            raise mistake("must be a finite number", "Choose a number")
        self.check(value)
        return float(value)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.validate)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> JsonSchema:
        return {"type": "number"} | self._bounds()

    def _bounds(self) -> JsonSchema:
        said = {"exclusiveMinimum": self.gt, "minimum": self.ge, "exclusiveMaximum": self.lt, "maximum": self.le}
        return {word: bound for word, bound in said.items() if bound is not None}


@dataclass(frozen=True)
class Whole(Number):
    """Annotation of a whole number."""

    example: str = "3000"

    def validate(self, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            advice = _plainly(value, self.example)
            raise mistake("must be a whole number", advice if "." not in advice else "Round it")
        self.check(value)
        return value

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> JsonSchema:
        return {"type": "integer"} | self._bounds()


def _plainly(value: Any, example: str) -> str:
    """Advice for a number that came as something else."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return f"Write for example {example}"
    if isinstance(value, bool) or not math.isfinite(number):
        return f"Write for example {example}"
    quotes = " without quotes" if isinstance(value, str) else ""
    return f"Write {int(number) if number.is_integer() else f'{number:g}'}{quotes}"


@dataclass(frozen=True)
class FrictionNumber(Number):
    """Annotation of a coefficient of friction: a number, or a friction angle in quotes, which stands for its tangent."""

    ge: float | None = 0.0

    def validate(self, value: Any) -> float:
        if not isinstance(value, str):
            return super().validate(value)
        try:
            angle = units.parse(value, "rad", "25 deg")
        except units.UnitError as error:
            if error.rule.startswith("has no unit"):
                raise mistake("must be a plain number", _plainly(value, "0.5")) from None
            raise mistake(error.rule, 'Write a plain number, or a friction angle such as "25 deg"') from None
        if not 0.0 <= angle < 0.5 * math.pi:
            raise mistake("is out of range, allowed is from 0 deg, below 90 deg", "Choose an angle in this range")
        return math.tan(angle)

    def __get_pydantic_json_schema__(self, _: core_schema.CoreSchema, __: GetJsonSchemaHandler) -> JsonSchema:
        return friction_schema()


def friction_schema() -> JsonSchema:
    """JSON Schema of a coefficient of friction."""
    angle = {"type": "string", "pattern": r"^\s*\+?[0-9.][0-9._eE+-]*\s*[A-Za-z°µ%].*$", "examples": ["25 deg"]}
    return {"anyOf": [{"type": "number", "minimum": 0}, angle]}


Length = Annotated[float, Quantity(gt=0.0, unit="m", example="7 mm")]
Distance = Annotated[float, Quantity(ge=0.0, unit="m", example="1.5 cm")]
Duration = Annotated[float, Quantity(gt=0.0, unit="s", example="0.5 s")]
DurationOrZero = Annotated[float, Quantity(ge=0.0, unit="s", example="0.5 s")]
Velocity = Annotated[float, Quantity(gt=0.0, unit="m/s", example="150 m/s")]
Acceleration = Annotated[float, Quantity(ge=0.0, unit="m/s^2", example="400 gal")]
Frequency = Annotated[float, Quantity(gt=0.0, unit="Hz", example="10 Hz")]
Rate = Annotated[float, Quantity(ge=0.0, unit="1/s", example="5 1/s")]
Angle = Annotated[float, Quantity(unit="rad", example="-90 deg")]
Density = Annotated[float, Quantity(gt=0.0, unit="kg/m^3", example="2480 kg/m^3")]
Stiffness = Annotated[float, Quantity(gt=0.0, unit="N/m", example="1e8 N/m")]
Pressure = Annotated[float, Quantity(gt=0.0, unit="Pa", example="15 kPa")]
Force = Annotated[float, Quantity(gt=0.0, unit="N", example="1e-5 N")]
ForceOrZero = Annotated[float, Quantity(ge=0.0, unit="N", example="0.1 N")]
Friction = Annotated[float, FrictionNumber()]
Viscosity = Annotated[float, Quantity(gt=0.0, unit="N s/m", example="1e8 N s/m")]
RotationalViscosity = Annotated[float, Quantity(gt=0.0, unit="N m s", example="1e4 N m s")]
