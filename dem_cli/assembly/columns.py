"""CSV files of points: a header, then numbers, a point a line; lines of # are comments."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dem_cli.errors import ScenarioError
from dem_cli.state import Floats


def read_columns(path: Path, wanted: Sequence[str], more: Sequence[str] = ()) -> dict[str, Floats]:
    """The columns of a file whose header is `wanted`, or `wanted` and then `more`. ScenarioError names line and remedy."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read as text ({error}). Give a CSV file") from None
    rows = [(k, text) for k, text in enumerate(lines, 1) if text.strip() and not text.lstrip().startswith("#")]
    headers = [list(wanted), *([[*wanted, *more]] if more else [])]
    words = " or ".join(",".join(header) for header in headers)
    if not rows:
        raise ScenarioError(f"{path}: is empty. Begin with the header {words}")
    header = [name.strip() for name in rows[0][1].split(",")]
    if header not in headers:
        raise ScenarioError(f"{path}: line {rows[0][0]}: the header is {','.join(header)[:60]}. Write {words}")
    table = np.empty((len(rows) - 1, len(header)))
    for row, (number, text) in zip(table, rows[1:], strict=True):
        cells = text.split(",")
        try:
            row[:] = [float(cell) for cell in cells]
        except ValueError:
            raise ScenarioError(
                f"{path}: line {number}: is not {len(header)} numbers. Write {','.join(header)}"
            ) from None
        if not np.isfinite(row).all():
            raise ScenarioError(f"{path}: line {number}: a number is not finite. Correct the line")
    return dict(zip(header, table.T.copy(), strict=True))
