"""A small valid scenario as TOML text, with keys changed or left out: what most tests of scenarios start from."""

from __future__ import annotations

import copy
from typing import Any

import tomli_w

SMALL: dict[str, Any] = {
    "title": "small",
    "seed": 3,
    "grains": {"count": 30, "radius": {"uniform": ["5 mm", "1 cm"]}, "density": "2480 kg/m^3"},
    "material": {"s_wave_velocity": "150 m/s", "poisson_ratio": 0.25},
    "contact": {"friction": 0.17, "wall_friction": 0.25, "damping_ratio": 1.0},
    "container": {"width": "30 cm"},
    "packing": {"method": "falling", "grid": {"columns": 8, "spacing": "3 cm"}},
    "stage": [
        {"kind": "settle"},
        {"kind": "shake", "amplitude": "400 gal", "frequency": "10 Hz", "duration": "2 s"},
    ],
}


class _Absent:
    """Stands for a key that is left out; it has a name so that tests are called the same in every process."""

    def __repr__(self) -> str:
        return "ABSENT"


ABSENT = _Absent()


def small(changes: dict[str, Any] | None = None) -> str:
    """SMALL with keys set ("contact.friction", "stage.1.ramp"; lists count from 0), or left out where the value is ABSENT."""
    return changed(SMALL, changes)


def changed(data: dict[str, Any], changes: dict[str, Any] | None) -> str:
    """A scenario's TOML data with changes, as text."""
    data = copy.deepcopy(data)
    for path, value in (changes or {}).items():
        *parents, last = path.split(".")
        table: Any = data
        for parent in parents:
            table = table[int(parent)] if isinstance(table, list) else table.setdefault(parent, {})
        key = int(last) if isinstance(table, list) else last
        if value is ABSENT:
            del table[key]
        else:
            table[key] = value
    return tomli_w.dumps(data)
