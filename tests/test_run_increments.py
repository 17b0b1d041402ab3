"""Quasi-static tests from the engine to the file and to the reader of the log; the engine is a stand-in that yields increments made by hand."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import few_grains
import numpy as np
import pytest
from click.testing import CliRunner
from quasi_static_samples import DEPTH, KN, KT, lattice, resolved, shear_test

from dem_cli import run
from dem_cli.analysis.quasi_static import branch_stress, measure_increment
from dem_cli.assembly import Assembly
from dem_cli.cli import main
from dem_cli.cli import progress as progress_module
from dem_cli.cli.progress import Progress
from dem_cli.engines.pausing import Pausable
from dem_cli.errors import ResultsError, RunError
from dem_cli.pace import IncrementPace, TimePace, clock, condition, pace_of
from dem_cli.results import open_results, partial_path
from dem_cli.scenario import QuasiStaticScenario, load_scenario, parse_scenario
from dem_cli.state import Increment

Stand = Callable[[list[Increment], BaseException | None], QuasiStaticScenario]
ALL = frozenset({"series", "frames", "tracks"})


def states(increments: int = 20) -> list[Increment]:
    """As an engine yields them: a frame for every second increment of the shear, tracks always."""
    found = []
    for one in shear_test(increments):
        frame = one.number == 0 or (one.in_stage > 0 and one.in_stage % 2 == 0)
        found.append(replace(one, due=ALL if frame else ALL - {"frames"}))
    return found


@pytest.fixture
def stand(monkeypatch: pytest.MonkeyPatch) -> Stand:
    """stand(increments, error): an engine that yields them, then raises `error` if there is one; returns the scenario."""

    def install(given: list[Increment], error: BaseException | None = None) -> QuasiStaticScenario:
        class Engine(Pausable):
            def __init__(self, scenario: QuasiStaticScenario, assembly: Assembly) -> None:
                assert assembly.warnings == ("the packing is loose",)
                assert scenario.engine == "granular-element"
                self.scenario, self.assembly = scenario, assembly
                self.check: Callable[[], None] = lambda: None

            def increments(self, until: int | None) -> Iterator[Increment]:
                assert until is None
                yield from given
                if error is not None:
                    raise error

        module: Any = ModuleType("engine")
        module.GranularElementEngine = Engine
        monkeypatch.setitem(sys.modules, "dem_cli.engines.granular_element.engine", module)
        first = given[0]
        assembly = Assembly(first.grains, first.walls, warnings=("the packing is loose",))
        monkeypatch.setattr(run, "build_assembly", lambda *_: assembly)
        scenario = parse_scenario(resolved(first, increments=20) + "\n[output]\ntracks = { grains = [3, 5] }\n")
        assert isinstance(scenario, QuasiStaticScenario)
        return scenario

    return install


def test_all_increments_reach_the_file(stand: Stand, tmp_path: Path) -> None:
    given = states()
    scenario = stand(given, None)
    told: list[tuple[int, float]] = []

    def listen(state: Any, row: Any) -> None:
        told.append((state.number, row["stress_ratio"]))

    path = run.run_scenario(scenario, tmp_path / "out.h5", listener=listen)
    with open_results(path) as results:
        assert results.complete
        assert results.stop_reason == "all stages are done"
        assert results.series["increment"].tolist() == [one.number for one in given]
        assert told == list(zip(results.series["increment"], results.series["stress_ratio"], strict=True))
        assert results.frame_times.tolist() == [one.number for one in given if "frames" in one.due]
        assert [(s.name, s.kind, s.start, s.end) for s in results.stages] == [
            ("compress", "compress", 0.0, 4.0), ("shear", "shear", 4.0, 24.0),
        ]  # fmt: skip
        assert results.stages[1].reason == "shear strain reached"
        assert results.stages[1].before["shear_strain"] == 0.0
        assert results.warnings == ["the packing is loose", "the increment passed through a collapse"]
        kn, kt = scenario.stiffness
        assert (kn, kt, scenario.depth) == pytest.approx((KN, KT, DEPTH), rel=1e-15)
        row = measure_increment(given[-1], scenario.depth, kn, kt).row
        assert {name: results.series[name][-1] for name in row} == pytest.approx(row, rel=0.0, abs=0.0, nan_ok=True)
        assert results.tracks is not None
        assert results.tracks.ids.tolist() == [3, 5]
        assert len(results.tracks.time) == len(given)
        assert (results.width, results.height) == (given[0].width, given[0].height)
        assert results.attrs["scenario_hash"] == scenario.hash
        dissipation = results.dissipation
        assert dissipation is not None
        assert len(dissipation.energy) == len(given)


def test_run_prints_the_report_of_a_shear_test(stand: Stand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = states()
    monkeypatch.chdir(tmp_path)
    Path("one.toml").write_text(stand(given, None).source)
    done = CliRunner().invoke(main, ["run", "one.toml", "--report"])
    assert done.exit_code == 0, done.output
    assert "peak of s1/s2" in done.stdout
    assert done.stdout == CliRunner().invoke(main, ["report", "one.h5"]).stdout


def test_the_file_begins_with_the_grains_of_the_boundary(stand: Stand, tmp_path: Path) -> None:
    """They are the engine's: the packing knows of none."""
    given = [replace(one, due=ALL) for one in shear_test(20, ring=True)]
    scenario = stand(given, None)
    path = run.run_scenario(scenario, tmp_path / "out.h5")
    with open_results(path) as results:
        assert (results.boundary, results.element_count) == (18, 38)
        assert len(results.frame(-1).grains) == 38


def test_an_error_keeps_all_increments_and_is_a_warning(stand: Stand, tmp_path: Path) -> None:
    words = "increment 9: the mean stress of 15 kPa is not reached, only 3 kPa; take smaller increments"
    scenario = stand(states()[:10], RunError(words))
    with pytest.raises(RunError, match="increment 9"):
        run.run_scenario(scenario, tmp_path / "out.h5")
    with open_results(partial_path(tmp_path / "out.h5")) as results:
        assert results.series["increment"].tolist() == [0, 1, 2, 3, 4, 4, 5, 6, 7, 8]
        assert results.warnings[-1] == words
        assert results.stop_reason == f"RunError: {words}"


def test_an_interrupt_leaves_a_file_that_says_so(stand: Stand, tmp_path: Path) -> None:
    scenario = stand(states()[:10], KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        run.run_scenario(scenario, tmp_path / "out.h5")
    with open_results(partial_path(tmp_path / "out.h5")) as results:
        assert (results.stop_reason, results.series.rows) == ("interrupted", 10)


def test_nothing_is_done_where_a_file_is_in_the_way(
    stand: Stand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Said at once, not after the packing."""
    scenario = stand(states(), None)
    monkeypatch.setattr(run, "build_assembly", lambda *_: pytest.fail("began to pack"))
    (tmp_path / "out.h5").write_text("mine")
    with pytest.raises(ResultsError, match="exists already"):
        run.run_scenario(scenario, tmp_path / "out.h5")
    assert (tmp_path / "out.h5").read_text() == "mine"


def listen(given: list[Increment], scenario: QuasiStaticScenario, seconds: float) -> Progress:
    """A listener told of increments that take `seconds` each; to be used with a clock of its own."""
    with Progress(scenario) as progress:
        for one in given:
            Clock.now += seconds
            progress(one, measure_increment(one, DEPTH, KN, KT).row)
    return progress


class Clock:
    now = 0.0


@pytest.fixture
def own_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    Clock.now = 100.0
    monkeypatch.setattr(progress_module.time, "monotonic", lambda: Clock.now)


@pytest.mark.usefixtures("own_clock")
def test_the_log_tells_stages_increments_and_warnings(stand: Stand, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = stand(states(), None)
    listen(states(), scenario, 3.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[-2:] == [
        "warning: the increment passed through a collapse",
        next(line for line in lines if line.startswith("stage 2/2 shear: ")),
    ]
    end = lines[-1]
    assert re.fullmatch(
        r"stage 2/2 shear: 20 increments, shear strain 1 %, s1/s2 1\.\d{3}, volumetric strain -?[\d.]+ %, "
        r"void ratio 0\.\d{4}: shear strain reached",
        end,
    )
    first = next(line for line in lines if line.startswith("stage 1/2"))
    assert re.fullmatch(
        r"stage 1/2 compress: 4 increments, mean stress 15 kPa, void ratio 0\.\d{4}: stress reached", first
    )
    shown = [line for line in lines if line.startswith("[2/2 shear]")]
    assert len(shown) >= 4  # every 10 s
    told = shown[-1]
    found = re.fullmatch(
        r"\[2/2 shear\] increment (\d+) of 20, shear strain ([\d.]+) %, s1/s2 1\.\d{3}, volumetric strain \S+ %, "
        r"\d+ iterations, about (\d+) s left",
        told,
    )
    assert found
    number, strain, left = int(found[1]), float(found[2]), int(found[3])
    assert strain == pytest.approx(0.05 * number, rel=1e-9)
    assert left == 3 * (20 - number)


@pytest.mark.usefixtures("own_clock")
def test_time_left_counts_later_stages(stand: Stand) -> None:
    scenario = stand(states(), None)
    given = states()[:3]  # 2 of 4 levels, 20 increments later
    progress = listen(given, scenario, 2.0)
    assert progress.pace.words(given[-1]).endswith(f"about {clock(2.0 * 22)} left")
    assert progress.pace.share(given[-1]) == pytest.approx(2.0 / 24.0)
    assert progress.pace.share(states()[-1]) == 1.0


def test_a_quiet_run_says_nothing(stand: Stand, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = stand(states(), None)
    with Progress(scenario, verbosity=-1) as progress:
        for one in states():
            progress(one, measure_increment(one, DEPTH, KN, KT).row)
    assert capsys.readouterr().err == ""


def test_pore_pressure_is_told_where_pores_are_closed() -> None:
    one = replace(shear_test(20)[12], pore_pressure=2500.0)
    words = condition(measure_increment(one, DEPTH, KN, KT).row)
    assert words.endswith(", pore pressure 2.5 kPa")
    assert condition(measure_increment(lattice(), DEPTH, KN, KT).row) == "mean stress 15 kPa"


def test_the_kind_of_scenario_decides() -> None:
    assert isinstance(pace_of(parse_scenario(resolved(lattice()))), IncrementPace)
    assert isinstance(pace_of(few_grains.scenario()), TimePace)


@pytest.mark.usefixtures("own_clock")
def test_shares_of_a_part_count_its_stages_alone(stand: Stand) -> None:
    """Of a preparation, and of a run that goes on from one."""
    scenario, given = stand(states(), None), states()
    first, rest = pace_of(scenario, until=1), pace_of(scenario, begin=1)
    assert first.share(given[2]) == pytest.approx(2.0 / 4.0)
    assert (rest.share(given[5]), rest.share(given[15])) == (0.0, pytest.approx(10.0 / 20.0))


REAL = """
title = "a few discs"
engine = "granular-element"
seed = 3
depth = "1 cm"
grains = { shape = "disc", count = 16, radius = { uniform = ["3 mm", "5 mm"] }, density = "2500 kg/m^3" }
material = { normal_stiffness = "1e5 N/m", tangential_stiffness = "0.7e5 N/m" }
contact = { friction = "25 deg", wall_friction = "10 deg" }
packing = { method = "overlapping" }
stage = [
    { kind = "compress", stress = "15 kPa" },
    { kind = "shear", hold = "mean-stress", shear_strain = 0.003 },
]
"""


def test_the_engine_itself_writes_samples_in_equilibrium(tmp_path: Path) -> None:
    """Forces on each grain add up to nothing, shear forces and moments with them; the stress of the walls is that of
    the branches.
    """
    scenario = parse_scenario(REAL)
    assert isinstance(scenario, QuasiStaticScenario)
    with open_results(run.run_scenario(scenario, tmp_path / "out.h5")) as results:
        assert [stage.reason for stage in results.stages] == ["15 kPa all round", "shear strain of 0.3 % reached"]
        sheared = [one for one in map(results.increment, range(results.n_frames)) if one.stage == 1]
        assert len(sheared) == 6
        for one in sheared:
            c, n = one.contacts, len(one.grains)
            force = np.stack([c.normal * c.nx - c.shear * c.ny, c.normal * c.ny + c.shear * c.nx])
            pairs = c.j >= 0
            left = [np.bincount(c.j[pairs], f[pairs], n) - np.bincount(c.i, f, n) for f in force]
            left.append(np.bincount(c.j[pairs], c.shear[pairs], n) + np.bincount(c.i, c.shear, n))
            assert np.abs(left).max() < 1e-4 * c.normal.mean()
            assert np.abs(c.shear).max() > 0.1 * c.normal.mean()
            at_walls = (force * ~pairs) @ np.stack([c.px, c.py]).T / (one.area * scenario.depth)
            np.testing.assert_allclose(branch_stress(one, scenario.depth), at_walls, atol=1e-4 * at_walls.max())


def test_a_sample_at_stress_from_a_file_is_told_to_be_out_of_balance(tmp_path: Path) -> None:
    """The file's stress is there, its shear forces are not."""
    first = parse_scenario(REAL)
    assert isinstance(first, QuasiStaticScenario)
    run.run_scenario(first, tmp_path / "first.h5")
    text = re.sub(r"count = 16, radius = {.*?}, ", "", REAL).replace(
        'method = "overlapping"', 'method = "file", file = "first.h5"'
    )
    for stages, told in ((text, 0), (re.sub(r".*compress.*\n", "", text), 1)):
        (tmp_path / "next.toml").write_text(stages)
        with open_results(
            run.run_scenario(load_scenario(tmp_path / "next.toml"), tmp_path / "next.h5", force=True)
        ) as results:
            assert len([line for line in results.warnings if "the packing is not in balance" in line]) == told
            assert results.series["mean_stress"][0] == pytest.approx(15e3, rel=1e-5)


def test_iterations_are_limited_where_a_limit_is_given(tmp_path: Path) -> None:
    scenario = parse_scenario(REAL, overrides=["solver.max_iterations=10"])
    assert isinstance(scenario, QuasiStaticScenario)
    words = r"\(15 kPa all round\); the boundary bears [\d.]+ k?Pa across x and .* more solver\.max_iterations"
    with pytest.raises(RunError, match=words):
        run.run_scenario(scenario, tmp_path / "out.h5")
