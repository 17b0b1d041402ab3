"""Frames of grains in 2D packed for the player: places, angles, quantities, contacts with their forces, walls and bonds."""

from __future__ import annotations

from typing import Any

import numpy as np

from dem_cli.report import bodies
from dem_cli.report.moments import AnyFrame
from dem_cli.report.page import codes
from dem_cli.report.page.frames import add_contacts, most_frames, player, readouts, spread
from dem_cli.report.page.model import Player
from dem_cli.report.quantities import NOT_QUASI_STATIC, QUANTITIES, Quantity
from dem_cli.report.sample import first_frame_of_stage
from dem_cli.results import Results
from dem_cli.state import Contacts, Floats

# Stored with each frame, within codes.LOG_ERROR of the value.
LOGS = (
    "speed", "spin", "displacement_x", "displacement_y", "rotation", "stress_xx", "stress_yy", "stress_xy",
)  # fmt: skip
# Made from those in the page: quantity -> how, of which.
DERIVED = {
    "displacement": ["hypot", "displacement_x", "displacement_y"],
    "pressure": ["mean", "stress_xx", "stress_yy"],
    "shear_stress": ["shear", "stress_xx", "stress_yy", "stress_xy"],
}
TOLD = {
    "ground_x": "displacement of the container in x", "ground_y": "displacement of the container in y",
    "ground_ax": "acceleration of the container in x", "ground_ay": "acceleration of the container in y",
    "void_ratio": "void ratio", "depth": "fill depth", "coordination": "coordination number", "kinetic": "kinetic energy",
}  # fmt: skip
TOLD_INCREMENTS = {
    "in_stage": "increment of the stage", "shear_strain": "shear strain", "volumetric_strain": "volumetric strain",
    "stress_ratio": "stress ratio s1/s2", "mean_stress": "mean stress", "pore_pressure": "pore pressure", "void_ratio": "void ratio",
    "coordination": "coordination number",
}  # fmt: skip
BYTES_A_GRAIN, BYTES_A_CONTACT = 24, 5


def grain_player(results: Results, budget: int, title: str) -> Player | None:
    """The frames of a file in at most `budget` characters; None where it holds no frame."""
    if results.n_frames == 0:
        return None
    last = results.frame(-1)
    raw = BYTES_A_GRAIN * len(last.grains) + BYTES_A_CONTACT * len(last.contacts)
    indices = spread(results.n_frames, most_frames(raw, budget))
    read = _Read(results, indices)
    return player(results, indices, read.pack, budget, title)


class _Read:
    """Frames of a file as arrays (frames, elements)."""

    def __init__(self, results: Results, indices: list[int]) -> None:
        self.results, self.indices = results, indices
        self.quantities = _known(results)
        stored = [name for name in self.quantities if name in (*LOGS, "orientation")]
        self.arrays: dict[str, list[Floats]] = {name: [] for name in ("x", "y", "angle", *stored)}
        self.shown: list[Any] = []
        self.coordination: list[Any] = []
        self.contacts: list[Contacts] = []
        self.walls: list[Floats] = []
        starts: dict[int, AnyFrame] = {}
        for k in indices:
            frame = results.frame(k)
            if frame.stage not in starts:
                first = first_frame_of_stage(results, frame.stage)
                starts[frame.stage] = frame if first == k else results.frame(first)
            for name in ("x", "y", "angle"):
                self.arrays[name].append(getattr(frame.grains, name))
            for name in stored:
                self.arrays[name].append(QUANTITIES[name].values(frame, starts[frame.stage]))
            self.shown.append(~frame.grains.escaped)
            self.coordination.append(np.minimum(frame.coordination, 255).astype(np.uint8))
            self.contacts.append(frame.contacts)
            w = frame.walls
            self.walls.append(np.stack([w.x0, w.y0, w.x1, w.y1], axis=1).ravel())
        self.grains = results.frame(indices[-1]).grains

    def pack(self, keep: list[int]) -> tuple[codes.Packer, dict[str, Any]]:
        """Sections and facts of the frames at `keep`."""
        packer, g = codes.Packer(), self.grains
        for name in ("radius", "a", "b"):
            packer.add(name, getattr(g, name).astype(np.float32))
        packer.add("body", g.body.astype(np.uint32))
        packer.add("id", g.id.astype(np.uint32))
        if "aspect" in self.quantities:
            packer.add("aspect", bodies.axes(g)[0].astype(np.float32))
        shown = np.stack([self.shown[k] for k in keep])
        packer.add("shown", shown.astype(np.uint8))
        for name, rows in self.arrays.items():
            values = np.stack([rows[k] for k in keep])
            if name in ("x", "y"):
                low, high = _ends(values[shown])
                packer.add(name, codes.linear(values, low, high), delta=True, code="linear", low=low, high=high)
            elif name == "angle":
                packer.add(name, codes.angle(values), delta=True, code="angle")
            elif name == "orientation":
                half = 0.5 * np.pi
                packer.add(name, codes.linear(values, -half, half), code="linear", low=-half, high=half)
            else:
                largest = float(np.abs(values[shown & np.isfinite(values)]).max(initial=0.0))
                packer.add(name, codes.log(values, largest), code="log", largest=largest)
        packer.add("coordination", np.stack([self.coordination[k] for k in keep]))
        contacts = [(c.i, c.j, c.normal, np.stack([c.px, c.py], axis=1)) for c in (self.contacts[k] for k in keep)]
        add_contacts(packer, contacts, len(g), len(self.results.walls))
        self._fixed(packer, keep)
        return packer, self._facts(keep)

    def _fixed(self, packer: codes.Packer, keep: list[int]) -> None:
        """Walls, of each frame where they move, and bonds."""
        moving = self.results.layout.moving
        packer.add("walls", np.stack([self.walls[k] for k in (keep if moving else keep[:1])]).astype(np.float32))
        bonds = self.results.bonds
        packer.add("bonds", np.stack([bonds.i, bonds.j], axis=1).astype(np.uint32))

    def _facts(self, keep: list[int]) -> dict[str, Any]:
        results = self.results
        told = TOLD_INCREMENTS if results.axis == "increment" else TOLD
        return {
            "kind": "grains",
            "count": len(self.grains),
            "boundary": results.boundary,
            "several": bool(results.grain_count < results.element_count),
            "wallNames": list(results.walls.name),
            "quantities": [_fact(name, quantity) for name, quantity in self.quantities.items()],
            "color": "displacement",
            "readouts": readouts(results, [self.indices[k] for k in keep], told),
        }


def _known(results: Results) -> dict[str, Quantity]:
    """Quantities that the file's grains have."""
    grains = results.frame(0).grains
    alike = bool(np.all(grains.a == grains.b)) and results.grain_count == results.element_count
    left_out = set(NOT_QUASI_STATIC) if results.axis == "increment" else set()
    if alike:
        left_out |= {"body", "aspect", "orientation"}
    return {name: quantity for name, quantity in QUANTITIES.items() if name not in left_out}


def _fact(name: str, quantity: Quantity) -> dict[str, Any]:
    label = quantity.label + (" since the stage began" if quantity.since else "")
    return {"name": name, "label": label, "unit": quantity.unit, "kind": quantity.kind, "of": DERIVED.get(name)}


def _ends(values: Floats) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
