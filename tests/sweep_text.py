"""Small scenarios with sweeps as TOML text: soft grains in a narrow box, so that a member takes a blink."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from engine_samples import text_of

PACKED: dict[str, Any] = {
    "grains.count": 20,
    "container.width": "16 cm",
    "packing.grid": {"columns": 5, "spacing": "3 cm", "shift": "1 cm"},
    "contact.damping_ratio": 0.5,
    "stage": [
        {"kind": "settle", "limit": "0.3 s", "name": "packing"},
        {"kind": "shake", "amplitude": "400 gal", "frequency": "10 Hz", "duration": "0.1 s"},
    ],
}
GAL_HZ = {"stage.shake.amplitude": ["400 gal", "800 gal"], "stage.shake.frequency": ["10 Hz", "20 Hz"]}


def sweep_text(sweep: dict[str, Any] | None = None, changes: dict[str, Any] | None = None) -> str:
    """A packing that is shaken, with a table [sweep]."""
    return text_of({**PACKED, **({"sweep": sweep} if sweep else {}), **(changes or {})})


def sweep_file(
    folder: Path, sweep: dict[str, Any] | None = None, changes: dict[str, Any] | None = None, name: str = "box.toml"
) -> Path:
    path = folder / name
    path.write_text(sweep_text(sweep, changes), encoding="utf-8")
    return path
