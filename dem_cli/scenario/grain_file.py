"""CSV files of grains: header x,y,r and, as wanted, vx,vy, angle, aspect, spin; one grain a line, lines of # are comments."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dem_cli.errors import ScenarioError
from dem_cli.scenario.stored_grains import StoredGrains, is_result_file, read_stored_grains

Floats = npt.NDArray[np.float64]
SCALE = {"m": 1.0, "cm": 0.01, "mm": 0.001}
LENGTHS = ("x", "y", "r", "vx", "vy")
COLUMNS = (*LENGTHS, "angle", "aspect", "spin")


@dataclass(frozen=True)
class GrainFile:
    """The grains of a file, shape (n,) each: centres of mass x, y [m], radii [m], velocities vx, vy [m/s], spin [rad/s].

    angle [rad] and aspect [-] (longer over shorter semi-axis of an ellipse) are None where the file does not have them. stored: the
    elements themselves, where the file is a result file.
    """

    x: Floats
    y: Floats
    radius: Floats
    vx: Floats
    vy: Floats
    spin: Floats
    angle: Floats | None
    aspect: Floats | None
    stored: StoredGrains | None = None


def read_grain_file(path: Path, unit: str = "m", stage: str | None = None) -> GrainFile:
    """The grains of a result file, at the end of a stage of it if one is named, or of a CSV file whose lengths are in `unit`.

    ScenarioError names the file, the line and what is wrong.
    """
    if is_result_file(path):
        return _of_results(path, stage)
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
    given = set(header)
    if not {"x", "y", "r"} <= given <= set(COLUMNS) or ("vx" in given) != ("vy" in given) or len(given) < len(header):
        raise ScenarioError(
            f"{path}: line {numbered[0][0]}: the header is {','.join(header)}. "
            "Write x,y,r or x,y,r,vx,vy, each once; angle, aspect and spin may follow"
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
        if not 1.0 <= values.get("aspect", 1.0) <= 5.0:
            raise ScenarioError(f"{path}: line {number}: the aspect ratio is not from 1 to 5. Correct the line")
        rows.append(values)
    if not rows:
        raise ScenarioError(f"{path}: holds no grains. Add one grain a line")
    column = {name: np.array([row.get(name, 0.0) for row in rows]) for name in COLUMNS}
    x, y, radius, vx, vy = (column[name] * SCALE[unit] for name in LENGTHS)
    angle = np.radians(column["angle"]) if "angle" in given else None
    return GrainFile(x, y, radius, vx, vy, column["spin"], angle, column["aspect"] if "aspect" in given else None)


def _of_results(path: Path, stage: str | None) -> GrainFile:
    stored = read_stored_grains(path, stage)
    mean = stored.means
    radius = np.sqrt(np.bincount(stored.body, stored.a * stored.b))
    round_ = np.array_equal(stored.a, stored.b)
    return GrainFile(
        mean(stored.x), mean(stored.y), radius, mean(stored.vx), mean(stored.vy), mean(stored.spin),
        angle=stored.angle if not round_ else None, aspect=stored.a / stored.b if not round_ else None, stored=stored,
    )  # fmt: skip
