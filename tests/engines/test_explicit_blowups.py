"""Runs that go wrong are stopped, and say by which grain, when, why, and what to do."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from engine_samples import box, engine_of, heavy, last_frame, loose_grains, soft

from dem_cli.assembly import build_assembly
from dem_cli.engines.explicit.timestep import choose_time_step
from dem_cli.errors import RunError, ScenarioError
from dem_cli.state import Frame, Grains

TIME = r"^t = \d[\d.e-]* s: "


def test_contacts_too_soft() -> None:
    scenario = soft({"material": {"normal_stiffness": "2e3 N/m", "tangential_stiffness": "1e3 N/m"}})
    with pytest.raises(RunError, match=TIME + r"grain \d+ and .* overlap by .* max_overlap = 0\.1") as caught:
        last_frame(engine_of(scenario))
    assert "raise the stiffness" in str(caught.value)
    assert caught.value.exit_code == 1


def test_the_grain_that_is_named_is_the_one() -> None:
    """Two of twelve fall upon each other, from either side in the numbering; ids are those of the scenario, not of the sorted rows."""
    for left, right in ((7, 2), (3, 11)):
        grains = loose_grains(12, seed=4, width=0.3)
        grains.x[left], grains.x[right], grains.y[left], grains.y[right] = 0.18, 0.21, 0.25, 0.25
        grains.vx[left], grains.vx[right] = 40.0, -40.0
        engine = engine_of(box({"container.width": "30 cm"}), grains)
        with pytest.raises(RunError, match=rf"grain ({left} and grain {right}|{right} and grain {left}) overlap"):
            last_frame(engine)


@pytest.mark.parametrize(("wall", "vx", "vy"), [("left", -90.0, 0.0), ("right", 90.0, 0.0), ("bottom", 0.0, -90.0)])
def test_the_wall_that_is_named_is_the_one(wall: str, vx: float, vy: float) -> None:
    grains = Grains.discs(np.array([0.06, 0.08]), np.array([0.1, 0.03]), np.array([0.005, 0.005]), 2480.0, 1.0)
    grains.vx[1], grains.vy[1] = vx, vy
    with pytest.raises(RunError, match=rf"{TIME}grain 1 and the {wall} wall overlap by 0\.\d+ of"):
        last_frame(engine_of(box(), grains))


# Run in a process of its own: what goes wrong here may take the interpreter with it.
LOSE_A_NUMBER = """
import sys
import numpy as np
from engine_samples import box, engine_of, loose_grains, settle
from dem_cli.errors import RunError

integrator, sample = sys.argv[1], sys.argv[2]
grains = settle(60, 1) if sample == "settled" else loose_grains(60, seed=4, width=0.16)
for column in (2, 3, 4):
    for value in (float("nan"), float("inf"), *([1e25] if integrator == "leapfrog" else [])):
        engine = engine_of(box({"integration.integrator": integrator}), grains)
        frames = engine.frames()
        for _ in range(3):
            frame = next(frames)
        row = engine.state.order.tolist().index(17)
        target = engine.state.velocity[:, column - 2] if integrator == "thesis" else engine.state.rows[:, column]
        target[row] = value
        try:
            for seen in frames:
                if seen.time > frame.time + 0.021:
                    sys.exit(f"{value} in column {column} goes unnoticed until {seen.time:g} s")
            sys.exit(f"{value} in column {column} goes unnoticed")
        except RunError as error:
            print(column, value, error, flush=True)
"""


@pytest.mark.parametrize("integrator", ["leapfrog", "thesis"])
@pytest.mark.parametrize("sample", ["settled", "loose"])
def test_not_a_number(sample: str, integrator: str) -> None:
    """Velocities and spins that become NaN, infinite or absurd in the middle of a run: it ends within the next two outputs, by an error."""
    command = [sys.executable, "-W", "ignore", "-c", LOSE_A_NUMBER, integrator, sample]
    paths = os.pathsep.join([str(Path(__file__).parent.parent), *filter(None, sys.path)])
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": paths}, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.returncode}: {done.stdout[-200:]} {done.stderr[-200:]}"
    assert len(done.stdout.splitlines()) == (9 if integrator == "leapfrog" else 6)  # the thesis' scheme may gain energy
    assert "no longer a number" in done.stdout
    for line in done.stdout.splitlines():
        assert "time step" in line


def test_the_grain_without_number_is_named() -> None:
    grains = loose_grains(12, seed=4, width=0.3)
    engine = engine_of(box({"container.width": "30 cm", "output.interval": "1 ms"}), grains)
    frames = engine.frames()
    next(frames)
    engine.state.rows[engine.state.order.tolist().index(9), 3] = np.nan
    with (
        np.errstate(all="ignore"),
        pytest.raises(RunError, match=TIME + "the position of grain 9 is no longer a number"),
    ):
        for _ in frames:
            pass


@pytest.mark.parametrize("share", [1.0001, 3.0])
def test_a_step_beyond_the_limit_is_refused(share: float) -> None:
    scenario = soft()
    assembly = build_assembly(scenario)
    _, limit = choose_time_step(scenario, assembly)
    given = soft({"integration.time_step": f"{share * limit:.17g} s"})
    with pytest.raises(ScenarioError, match=rf"beyond the stability limit of {limit:.4g} s") as caught:
        choose_time_step(given, assembly)
    assert caught.value.exit_code == 2
    assert choose_time_step(soft({"integration.time_step": f"{0.9999 * limit:.17g} s"}), assembly)[0] < limit


# -- steps beyond the limit, which no scenario gets by ------------------------------------------------------------------


def run_with_step(factor: float, changes: dict[str, Any], grains: Grains, seconds: float) -> list[Frame]:
    """Frames of a settled sample that is run with `factor` times the largest stable step."""
    stage = [{"kind": "run", "duration": f"{seconds} s"}]
    engine = engine_of(box({"output.interval": "5 ms", "stage": stage, **changes}), grains)
    engine.time_step *= factor / engine.scenario.integration.safety
    return list(heavy(engine.frames()))


LAWS: dict[str, dict[str, Any]] = {
    "usual": {},
    "lightly damped": {"contact.damping_ratio": 0.3},
    "elastic": {"contact.damping_ratio": 0.0},
    "with tension": {"contact.tension": "damping", "contact.slider": "spring"},
}


@pytest.mark.parametrize("law", LAWS)
def test_an_unstable_step_is_noticed(law: str, settled_box: Callable[[int, int], Grains]) -> None:
    """At four times the limit, which is that of the worst arrangement, within 20 ms; by its energy or by an overlap."""
    with pytest.raises(RunError, match=r"out of nothing.*time step is unstable|time step of .* is too long") as caught:
        run_with_step(4.0, LAWS[law], settled_box(60, 1), 1.0)
    assert float(str(caught.value).split()[2]) <= 0.02
    assert "smaller one" in str(caught.value) or "overlap" in str(caught.value)


@pytest.mark.parametrize("law", ["usual", "lightly damped", "with tension"])
def test_a_step_at_the_limit_is_stable(law: str, settled_box: Callable[[int, int], Grains]) -> None:
    """A dense sample comes to rest, so there is no jitter: what a step slightly too long does without being noticed."""
    frame = run_with_step(1.0, LAWS[law], settled_box(60, 1), 0.5)[-1]
    assert frame.unbalanced < 1e-5
    assert abs(frame.residual) < 1e-3 * frame.energy_in


def test_jitter_keeps_a_sample_from_rest(settled_box: Callable[[int, int], Grains]) -> None:
    """At 2.5 times the limit some grains jitter at forces that cancel: the ledger cannot see it, but the test of rest says so."""
    stage = [{"kind": "settle", "limit": "0.5 s"}]
    frames = run_with_step(2.5, {"stage": stage}, settled_box(60, 1), 0.5)
    assert frames[-1].unbalanced > 1e-3
    assert "the time step is unstable here" in frames[-1].warnings[0]
