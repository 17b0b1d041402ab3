"""A small valid scenario of the granular element method as TOML text, with keys changed or left out."""

from __future__ import annotations

from typing import Any

from scenario_text import changed

QUICK: dict[str, Any] = {
    "title": "small",
    "engine": "granular-element",
    "seed": 3,
    "depth": "1 cm",
    "grains": {"count": 30, "radius": {"uniform": ["3 mm", "6 mm"]}, "density": "2480 kg/m^3"},
    "material": {"normal_stiffness": "1e8 dyn/cm", "tangential_stiffness": "7e7 dyn/cm"},
    "contact": {"friction": "25 deg"},
    "packing": {"method": "overlapping"},
    "stage": [
        {"kind": "compress", "stress": "15 kPa"},
        {"kind": "shear", "hold": "mean-stress", "shear_strain": 0.03},
        {"kind": "load", "x": {"stress": "20 kPa"}, "y": {"strain": 0.01}},
        {"kind": "cyclic", "from": "compress", "hold": "volume", "limit": {"stress_ratio": 0.15}, "cycles": 10},
    ],
}


def quick(changes: dict[str, Any] | None = None) -> str:
    """QUICK with keys set ("contact.friction", "stage.1.hold"; lists count from 0), or left out where the value is ABSENT."""
    return changed(QUICK, changes)
