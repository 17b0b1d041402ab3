"""Recorded motions in a result file: the accelerations as they were used, and what there is to tell of the records.

/motions/N for stage N (from 1): `acceleration` (samples, 2) [m/s^2] along the stage's angle and at right angles to it over `time` [s] of
the stage; attributes `interval`, `begin`, `duration` [s], `baseline`, and `components`, a JSON list of facts in SI units.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dem_cli.results.tables import describe, make_scale
from dem_cli.state import Floats


@dataclass(frozen=True)
class StoredMotion:
    """The recorded motion of a stage. acceleration (n, 2) [m/s^2] over time (n,) [s] of the stage, nothing before and behind.

    facts: interval, begin, duration [s], baseline, and components: a list of facts of each record, None where not defined.
    """

    time: Floats
    acceleration: Floats
    facts: dict[str, Any]


def write_motion(file: Any, number: int, acceleration: Floats, facts: Mapping[str, Any]) -> None:
    """Write the motion of stage `number` (from 1) into an open file."""
    group = file.require_group("motions").create_group(str(number))
    for name in ("interval", "begin", "duration", "baseline"):
        group.attrs[name] = facts[name]
    group.attrs["components"] = json.dumps(facts["components"], ensure_ascii=False)
    time = facts["begin"] + facts["interval"] * np.arange(len(acceleration))
    scale = make_scale(group, "time", time, "s", "time of the stage")
    dataset = group.create_dataset("acceleration", data=np.asarray(acceleration, dtype=np.float64))
    describe(dataset, "m/s^2", "acceleration of the ground along the stage's angle, and at right angles to it")
    dataset.dims[0].attach_scale(scale)


def read_motions(file: Any) -> dict[int, StoredMotion]:
    """Number of the stage (from 1) -> its motion, for stages with a record."""
    found = {}
    for number, group in file["motions"].items() if "motions" in file else ():
        facts: dict[str, Any] = {name: group.attrs[name] for name in ("interval", "begin", "duration", "baseline")}
        facts = {name: value.item() if isinstance(value, np.generic) else value for name, value in facts.items()}
        facts["components"] = json.loads(group.attrs["components"])
        found[int(number)] = StoredMotion(group["time"][:], group["acceleration"][:], facts)
    return found
