"""What the granular element engine refuses: the message names stage, increment, what was reached and what to do; the file keeps the rest."""

from __future__ import annotations

import collections
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from granular_samples import COMPRESS, SIGMA, scenario
from quasi_static_text import quick

import dem_cli
from dem_cli.assembly import build_assembly
from dem_cli.engines.granular_element.engine import GranularElementEngine
from dem_cli.errors import RunError
from dem_cli.results import open_results, partial_path
from dem_cli.state import Increment

ENV = {**os.environ, "PYTHONPATH": str(Path(dem_cli.__file__).parent.parent)}
# far beyond the strength of the sample
TOO_MUCH: dict[str, Any] = {
    "kind": "load",
    "name": "axial",
    "x": {"stress": "15 kPa"},
    "y": {"stress": "150 kPa"},
    "increments": 6,
}


def until_refused(changes: dict[str, Any]) -> tuple[list[Increment], str]:
    """Increments before the refusal, and its words."""
    one, found = scenario(changes), []
    with pytest.raises(RunError) as caught:
        collections.deque(map(found.append, GranularElementEngine(one, build_assembly(one)).increments()))
    return found, str(caught.value)


def test_a_stress_beyond_the_strength() -> None:
    """What the boundary bears is told, and it is far from what is asked for."""
    found, words = until_refused({"seed": 1, "stage": [COMPRESS, TOO_MUCH], "solver.sub_steps": 1})
    number = found[-1].in_stage + 1
    assert words.startswith(f"stage 2 (axial), increment {number}: the stress that is to be held is not reached")
    assert "(15 kPa across x, 150 kPa across y)" in words
    said = re.findall(r"([-\d.e+]+) (k?)Pa across [xy]", words.split("bears")[1])
    across = [float(value) * (1e3 if kilo else 1.0) for value, kilo in said]
    assert len(across) == 2
    asked = [SIGMA, SIGMA * (1.0 + 1.5 * number)]  # by then
    assert np.abs(np.array(across) - asked).max() > 0.01 * 150e3
    assert "end the stage before, prescribe the strain, or take smaller increments" in words
    for one in found:
        assert np.all(np.isfinite(one.stress))


def test_overlaps_too_large() -> None:
    """1 MPa on springs for 15 kPa."""
    _, words = until_refused(
        {"stage": [{"kind": "compress", "stress": "1 MPa", "levels": [1.0]}], "solver.max_overlap": 0.05}
    )
    assert re.match(
        r"stage 1 \(compress\), increment 1: grain \d+ and (grain \d+|a wall) overlap by [\d.]+ of a radius, 0.05 is the most",
        words,
    )
    assert "[solver] max_overlap" in words
    assert "Raise the stiffness, or lower the stress" in words
    share = float(re.findall(r"by ([\d.]+) of", words)[0])
    assert 0.05 < share < 1.0


def test_overlaps_are_allowed_below_the_limit() -> None:
    one = scenario({"stage": [COMPRESS], "solver.max_overlap": 0.01})
    last = list(GranularElementEngine(one, build_assembly(one)).increments())[-1]
    assert 0.0 < (last.contacts.overlap / last.grains.radius[last.contacts.i]).max() < 0.01


def test_a_file_keeps_all_increments_before_the_refusal(tmp_path: Path) -> None:
    """`dem run` ends with exit code 1 and one line that says it."""
    text = quick({"seed": 1, "grains.count": 24, "stage": [COMPRESS, TOO_MUCH], "solver.sub_steps": 1})
    (tmp_path / "test.toml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "dem_cli", "run", "test.toml"]
    done = subprocess.run(command, cwd=tmp_path, env=ENV, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    number = re.search(r"stage 2 \(axial\), increment (\d+): the stress that is to be held is not reached", done.stderr)
    assert number is not None, done.stderr
    assert not (tmp_path / "test.h5").exists()
    with open_results(partial_path(tmp_path / "test.h5")) as results:
        assert not results.complete
        assert int(results.series["increment"][-1]) == 6 + int(number[1]) - 1
        assert results.series["stress_ratio"][-1] > 2.0
