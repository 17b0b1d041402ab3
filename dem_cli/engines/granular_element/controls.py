"""What a stage asks of the boundary in each sub-step: strains that are prescribed, and stresses that servos hold."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dem_cli.engines.granular_element.boundary import Servos
from dem_cli.engines.granular_element.sample import Sample, no_servos, servos
from dem_cli.errors import RunError
from dem_cli.state import Floats
from dem_cli.units import human


def _along(direction: int) -> tuple[float, float]:
    return (1.0, 0.0) if direction == 0 else (0.0, 1.0)


def is_membrane(sample: Sample) -> bool:
    """Whether the lateral stress is the pressure of a membrane."""
    return len(sample.chain.ring) > 0 and not sample.chain.closed


def hold_stress(sample: Sample, target: dict[int, float], scale: float) -> Servos:
    """Servos, one a direction, that bring the stress across it to its target [Pa]; the pressure of a membrane is set instead."""
    moved = dict(target)
    if is_membrane(sample):
        sample.chain.pressure[0] = moved.pop(0, sample.chain.pressure[0])
    ways = [_along(direction) for direction in moved]
    return servos(ways, ways, list(moved.values()), scale)


@dataclass(frozen=True)
class ShearControl:
    """Shear strain e1 - e2 that grows under what is held.

    axial: direction of e1, 0 is x, 1 is y; stress (2,) [Pa]: at the start; volume: product of the half sizes over that of `size`.
    """

    axial: int
    hold: str
    stress: Floats
    volume: float

    @classmethod
    def start(cls, sample: Sample, axial: str, hold: str) -> ShearControl:
        """Holds what there is now."""
        stress = sample.stress(sample.look())
        return cls(int(axial == "y"), hold, stress, float(np.prod(sample.box[2:] / sample.size)))

    @property
    def mean(self) -> float:
        """Mean stress at the start [Pa]."""
        return float(self.stress.mean())

    def step(self, sample: Sample, growth: float) -> tuple[Floats, Servos]:
        """Half sizes after a growth of the shear strain, and the servos."""
        axial, lateral = self.axial, 1 - self.axial
        goal, size = sample.box[2:].copy(), sample.size
        if self.hold == "volume":
            wide, high = goal[lateral] / size[lateral], goal[axial] / size[axial]
            shear = wide - high + growth
            wide = 0.5 * (shear + math.sqrt(shear * shear + 4.0 * self.volume))
            goal[lateral], goal[axial] = size[lateral] * wide, size[axial] * self.volume / wide
            return goal, no_servos()
        if self.hold == "lateral-strain":
            goal[axial] -= size[axial] * growth
            return goal, no_servos()
        goal[axial] -= 0.5 * size[axial] * growth
        if is_membrane(sample):
            return goal, no_servos()
        goal[lateral] += 0.5 * size[lateral] * growth
        both = [(1.0, 1.0)]
        if self.hold == "mean-stress":
            return goal, servos(both, [(0.5, 0.5)], [self.mean], max(self.mean, 1e-300))
        held = float(self.stress[lateral])
        return goal, servos(both, [_along(lateral)], [held], max(held, 1e-300))

    def total_pressure(self, total: str | None) -> tuple[Floats, float]:
        """Weights of the stresses, and their sum at the start: what the pore pressure is counted from."""
        weight = np.array([0.5, 0.5]) if total == "mean-stress" else np.array(_along(1 - self.axial))
        return weight, float(weight @ self.stress)


@dataclass(frozen=True)
class LoadControl:
    """Each direction on a straight way: stress [Pa] or half size [m] at start and end, None where it is not what is prescribed."""

    stress: tuple[tuple[float, float] | None, ...]
    half: tuple[tuple[float, float] | None, ...]

    def step(self, sample: Sample, share: float) -> tuple[Floats, Servos]:
        """Half sizes and servos at this share of the way."""
        goal, target, scale = sample.box[2:].copy(), {}, 0.0
        for direction in (0, 1):
            stress, half = self.stress[direction], self.half[direction]
            if half is not None:
                goal[direction] = half[0] + share * (half[1] - half[0])
            elif stress is not None:
                target[direction] = stress[0] + share * (stress[1] - stress[0])
                scale = max(scale, abs(stress[0]), abs(stress[1]))
        return goal, hold_stress(sample, target, scale or 1.0)


def refuse_unreached(where: str, missing: float, wanted: str, reached: Floats) -> None:
    """RunError if a stress that is held is missed by more than a hundredth."""
    if missing > 0.01:
        across = " and ".join(
            f"{human(float(one), 'Pa')} across {name}" for one, name in zip(reached, "xy", strict=True)
        )
        raise RunError(
            f"{where}: the stress that is to be held is not reached ({wanted}); the boundary bears {across}. The sample yields or has "
            "fallen apart: end the stage before, prescribe the strain, or take smaller increments, more solver.sub_steps or, where it is "
            "given, more solver.max_iterations"
        )
