"""Small valid scenarios of the impulse engine as TOML text, with keys changed or left out."""

from __future__ import annotations

from typing import Any

from scenario_text import changed

BOX: dict[str, Any] = {"shape": "box", "size": ["2 m", "1 m", "2 m"], "density": "2000 kg/m^3"}
CLUMP: dict[str, Any] = {"shape": "clump", "radius": "5 cm", "density": "2500 kg/m^3"}
PLACED: dict[str, Any] = {"position": ["0 m", "0 m", "1.6 m"]}
DROP: dict[str, Any] = {
    "title": "small",
    "engine": "impulse",
    "seed": 3,
    "grains": BOX | PLACED,
    "contact": {"friction": 0.5, "restitution": 0.3},
    "plane": [{"name": "floor"}],
    "stage": [{"kind": "run", "duration": "1 s"}],
}
POUR: dict[str, Any] = {
    "title": "small",
    "engine": "impulse",
    "seed": 3,
    "grains": [CLUMP | {"count": 20}, BOX | PLACED | {"size": "10 cm", "position": ["0.5 m", "0.5 m", "0.1 m"]}],
    "contact": {"friction": 0.5, "restitution": 0.3},
    "container": {"width": "1 m", "breadth": "1 m"},
    "stage": [{"kind": "settle"}, {"kind": "shake", "amplitude": "400 gal", "frequency": "10 Hz", "duration": "2 s"}],
}


def drop(changes: dict[str, Any] | None = None) -> str:
    """A box above a floor, with keys set ("grains.size", "plane.0.slope"; lists count from 0), or left out where the value is ABSENT."""
    return changed(DROP, changes)


def pour(changes: dict[str, Any] | None = None) -> str:
    """20 clumps that are packed into a container over a box."""
    return changed(POUR, changes)
