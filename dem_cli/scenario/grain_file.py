"""CSV files of grains: header x,y,r or x,y,r,vx,vy, one grain a line, lines of # are comments."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dem_cli.errors import ScenarioError

Floats = npt.NDArray[np.float64]
SCALE = {"m": 1.0, "cm": 0.01, "mm": 0.001}


@dataclass(frozen=True)
class GrainFile:
    """Centres x, y [m], radii [m] and velocities vx, vy [m/s] of the grains of a file, shape (n,) each."""

    x: Floats
    y: Floats
    radius: Floats
    vx: Floats
    vy: Floats


def read_grain_file(path: Path, unit: str = "m") -> GrainFile:
    """The grains of a CSV file whose lengths are in `unit`. ScenarioError names the file, the line and what is wrong."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise ScenarioError(f"{path}: does not exist. The path is taken from the scenario's folder") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read as text ({error}). Give a CSV file") from None
    numbered = [(k, text) for k, text in enumerate(lines, 1) if text.strip() and not text.lstrip().startswith("#")]
    if not numbered:
        raise ScenarioError(f"{path}: is empty. Begin with the header x,y,r")
    header = [name.strip() for name in numbered[0][1].split(",")]
    if not {"x", "y", "r"} <= set(header) <= {"x", "y", "r", "vx", "vy"} or ("vx" in header) != ("vy" in header):
        raise ScenarioError(
            f"{path}: line {numbered[0][0]}: the header is {','.join(header)}. Write x,y,r or x,y,r,vx,vy"
        )
    rows = []
    for (number, _), cells in zip(numbered[1:], csv.reader(text for _, text in numbered[1:]), strict=True):
        try:
            values = dict(zip(header, (float(cell) for cell in cells), strict=True))
        except ValueError:
            raise ScenarioError(
                f"{path}: line {number}: is not {len(header)} numbers. Write {','.join(header)}"
            ) from None
        if not all(map(math.isfinite, values.values())) or values["r"] <= 0.0:
            raise ScenarioError(f"{path}: line {number}: a number is not finite or r is not above 0. Correct the line")
        rows.append(values)
    if not rows:
        raise ScenarioError(f"{path}: holds no grains. Add one grain a line")
    column = {
        name: np.array([row.get(name, 0.0) for row in rows]) * SCALE[unit] for name in ("x", "y", "r", "vx", "vy")
    }
    return GrainFile(column["x"], column["y"], column["r"], column["vx"], column["vy"])
