"""Stages of a run of the impulse engine, in the order in which they are done."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from dem_cli.scenario.quantities import Angle, Duration, Number
from dem_cli.scenario.stages import Run, Shake
from dem_cli.scenario.table import Table, key

EXPLICIT = "explicit"


class ImpulseSettle(Table):
    """Waits until the bodies are at rest. Ends when the measure is below its limit three rows of the series in a row, or at the limit."""

    kind: Literal["settle"] = key(doc='"settle"', example="settle")
    name: str = key("settle", "name in reports", example="packing")
    limit: Duration = key("20 s", "longest time; the stage ends here even if bodies still move", example="20 s")
    kinetic: Annotated[float, Number(gt=0.0)] = key(
        1e-6, "rest: mean kinetic energy of a body over its weight times its size is below this", example=1e-6
    )

    elsewhere: ClassVar = {
        "unbalanced": (EXPLICIT, "Leave it out: kinetic says when bodies are at rest"),
        "damping": (EXPLICIT, "Leave it out: bodies come to rest by restitution and friction"),
    }

    @property
    def longest(self) -> float:
        """Longest time that the stage can take [s]."""
        return self.limit


class ImpulseShake(Shake):
    """Shakes the container: by a sine, ground acceleration amplitude * sin(2 pi frequency t), or by a recorded motion."""

    angle: Angle = key("0 deg", "direction of the shaking, from the horizontal upwards", example="0 deg")
    heading: Angle = key("0 deg", "direction of the shaking in plan, from +x towards +y", example="90 deg")

    elsewhere: ClassVar = {}


ImpulseStage = Annotated[ImpulseSettle | ImpulseShake | Run, Field(discriminator="kind")]
IMPULSE_STAGES: dict[str, type[Table]] = {"settle": ImpulseSettle, "shake": ImpulseShake, "run": Run}
