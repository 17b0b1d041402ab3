"""Types of values in three dimensions: places, directions, velocities, edges; each a list of three."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import core_schema

from dem_cli.scenario.quantities import JsonSchema, Length, Number, Quantity, mistake

Place = Annotated[float, Quantity(unit="m", example="1.6 m")]
Speed = Annotated[float, Quantity(unit="m/s", example="2 m/s")]
SpinRate = Annotated[float, Quantity(unit="rad/s", example="1 rad/s")]
Coordinate = Annotated[float, Number()]
Point = tuple[Place, Place, Place]
Velocity3 = tuple[Speed, Speed, Speed]
Spin3 = tuple[SpinRate, SpinRate, SpinRate]
ORIGIN = ["0 m", "0 m", "0 m"]


@dataclass(frozen=True)
class _Unit:
    """Annotation of a list of numbers that is held with the length 1; `what` it gives."""

    what: str

    def normalise(self, values: tuple[float, ...]) -> tuple[float, ...]:
        length = math.hypot(*values)
        if not length > 0.0:
            raise mistake(f"is all zeros, which is no {self.what}", "Give at least one number other than 0")
        # What has the length 1 stays as it is, to the last bit, so that a resolved scenario loads back to itself.
        return values if abs(length - 1.0) < 1e-15 else tuple(value / length for value in values)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(self.normalise, handler(source))


Direction = Annotated[tuple[Coordinate, Coordinate, Coordinate], _Unit("direction")]
Quaternion = Annotated[tuple[Coordinate, Coordinate, Coordinate, Coordinate], _Unit("orientation")]


@dataclass(frozen=True)
class _Cube:
    """Annotation of three edge lengths: a single length in their place makes a cube."""

    def spread(self, value: Any) -> Any:
        if isinstance(value, (list, tuple)):
            return value
        Quantity(gt=0.0, unit="m", example="2 m").validate(value)
        return (value, value, value)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self.spread, handler(source))

    def __get_pydantic_json_schema__(self, core: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchema:
        edges = handler(core)
        return {"anyOf": [edges["prefixItems"][0], edges]}


Edges = Annotated[tuple[Length, Length, Length], _Cube()]
