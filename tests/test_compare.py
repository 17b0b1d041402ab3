"""Outcomes of runs, tracked grains in numbers, and cases: what is said is what the files hold."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import report_samples as made
from compare_samples import a_file, an_outcome, ways
from hypothesis import given
from hypothesis import strategies as st
from shape_samples import shaped

from dem_cli.report.cases import Pooled, pool, pooled
from dem_cli.report.compare import compare, effects
from dem_cli.report.moved import Moved, as_rows, moved
from dem_cli.report.outcome import ENDS, START, Outcome, outcome
from dem_cli.results import open_results

SHAKEN = made.END - made.SETTLED


def read(path: Path) -> Outcome:
    with open_results(path) as results:
        return outcome(results)


# ------------------------------------------------------------------------------------------- one run


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return a_file(tmp_path_factory.mktemp("run") / "run.h5")


def test_ends_are_those_of_the_stages(path: Path) -> None:
    found = read(path).measures
    with open_results(path) as results:
        for name, stored in ENDS.items():
            assert found[f"{name}_packed"] == results.stages[1].before[stored]
            assert found[f"{name}_shaken"] == results.stages[1].after[stored]
    assert found["void_ratio_packed"] == made.VOID_RATIOS[1]
    assert found["void_ratio_change"] == pytest.approx(made.VOID_RATIOS[2] - made.VOID_RATIOS[1])


def test_measures_while_shaken_leave_the_packing_out(tmp_path: Path) -> None:
    """Grains fall through the air as they are packed: that is no scattering by the shaking."""
    time = np.round(np.arange(0.0, made.END + 0.025, 0.05), 9)
    airborne = np.where(time < made.SETTLED, 30.0, np.where(time > 3.0, 4.0, 0.0))
    kinetic = np.where(time < made.SETTLED, 100.0, np.where(time <= made.SETTLED + START, 2.0, 1.0))
    tilt = np.where(time < made.SETTLED, 9.0, -0.08)
    path = a_file(tmp_path / "run.h5", series={"airborne": airborne, "kinetic": kinetic, "mode1": tilt})
    found = read(path).measures
    with open_results(path) as results:
        mass = results.frame(0).grains.mass.sum()
    shaken = time >= made.SETTLED
    assert found["airborne_most"] == 4.0
    assert found["airborne_mean"] == pytest.approx(airborne[shaken].mean())
    assert found["scattered"] == 4.0 + found["escaped"]
    assert found["tilt"] == pytest.approx(0.08 / made.DEPTHS[1])
    assert found["speed_start"] == pytest.approx(math.sqrt(2.0 * 2.0 / mass))
    assert found["speed"] == pytest.approx(math.sqrt(2.0 * kinetic[shaken].mean() / mass))


@pytest.mark.parametrize("shape", ["disc", "bonded"])
def test_displacement_is_that_of_centres_of_mass(tmp_path: Path, shape: str) -> None:
    """Frames at 1 s and 5 s; after whole turns of the circle there is left the drift (1.2, -0.04/0.02) x size, size = 0.02 y."""
    sample = None if shape == "disc" else shaped(shape, 4, 5)
    path = a_file(tmp_path / "run.h5", sample=sample, tracks=None)
    with open_results(path) as results:
        first = results.frame(0).grains
    if shape == "disc":
        grains = made.grid(6, 6)[0]
        height = grains.y
    else:
        _, grains, *_ = shaped(shape, 4, 5)
        height = 0.5 * (grains.y[::2] + grains.y[1::2])
    assert len(first) == len(grains)
    want = np.sqrt(np.mean((0.3 * 0.02 * SHAKEN * height) ** 2 + (0.01 * SHAKEN * height) ** 2))
    assert read(path).measures["displaced"] == pytest.approx(want, rel=1e-9)


def test_bond_gap_is_over_the_radius(tmp_path: Path) -> None:
    path = a_file(tmp_path / "run.h5", sample=shaped("bonded", 4, 5, cell=0.008), tracks=(1, 2), strain=(4e-5, 0, 0))
    found = read(path)
    assert found.measures["bond_gap"] == pytest.approx(4e-5 / (0.48 * 0.008))
    assert (found.shape, found.family, found.grains, found.elements) == ("bonded pair", "pair", 20, 40)
    assert math.isnan(read(a_file(tmp_path / "disc.h5")).measures["bond_gap"])


def test_what_a_run_is(path: Path) -> None:
    found = read(path)
    assert (found.shape, found.family) == ("disc", "disc")
    assert found.shaking_label == "400 gal 10 Hz"
    assert found.settings["stage.2.frequency"] == "10.0 Hz"
    assert not {"title", "seed"} & found.settings.keys()


def test_run_without_tracks_says_so_and_has_its_numbers(tmp_path: Path) -> None:
    found = read(a_file(tmp_path / "run.h5", tracks=None))
    assert found.moved == ()
    assert math.isnan(found.measures["tracked_start"])
    assert any("no tracks of stage 2" in line and "run.h5" in line for line in found.said)
    assert math.isfinite(found.measures["void_ratio_change"])


def test_incomplete_runs(tmp_path: Path) -> None:
    """Cut off while shaken: the last row stands for the end. Cut off while packed: nothing is known."""
    late = read(a_file(tmp_path / "late.h5", stop_after=2.001))
    with open_results(late.file) as results:
        last = float(results.series["void_ratio"][-1])
    assert (late.complete, late.measures["void_ratio_shaken"]) == (False, last)
    assert late.measures["void_ratio_packed"] == made.VOID_RATIOS[1]
    assert any("incomplete" in line for line in late.said)
    for stop in (0.5, -1.0):
        early = read(a_file(tmp_path / f"early{stop}.h5", stop_after=stop))
        assert early.shaking_label == "400 gal 10 Hz"
        assert math.isnan(early.measures["void_ratio_packed"])
        assert math.isnan(early.measures["speed"])
        assert pool([early])[0][0].measures["void_ratio_packed"].n == 0


def test_without_shaking_the_end_is_that_of_the_packing(tmp_path: Path) -> None:
    path = a_file(tmp_path / "run.h5", scenario=(('kind = "shake"', 'kind = "run"'),))
    with h5py.File(path, "a") as file:
        file["stages/kind"][1] = "run"
    found = read(path)
    assert found.shaking_label == "none"
    assert found.measures["void_ratio_packed"] == pytest.approx(made.VOID_RATIOS[2])
    assert math.isnan(found.measures["void_ratio_shaken"])
    assert found.moved == ()
    assert pool([found])[0][0].sine is None


# -------------------------------------------------------------------------------- tracked grains


def test_ways_of_tracked_grains_are_the_formula(path: Path) -> None:
    with open_results(path) as results:
        found = moved(results, 2, START)
        tracks = results.tracks
        assert tracks is not None
        t = tracks.time
        shaken = t >= made.SETTLED
        first = shaken & (t <= made.SETTLED + START + 1e-9)
        assert isinstance(found, Moved)
        assert found.stage == 2
        grains = made.grid(6, 6)[0]
        for k, way in enumerate(found.ways):
            n = (1, 8, 15)[k]
            size = 0.02 * grains.y[n]
            assert way.grain == n
            assert way.x == pytest.approx(0.3 * size * SHAKEN)
            assert way.y == pytest.approx(-0.01 * SHAKEN * grains.y[n])
            assert way.turn == pytest.approx(0.2 * SHAKEN * math.cos(n))
            x, y = tracks.arrays["x"][shaken, k], tracks.arrays["y"][shaken, k]
            assert way.excursion == pytest.approx(
                max(math.hypot(a - x[0], b - y[0]) for a, b in zip(x, y, strict=True))
            )
            steps = zip(x[1:] - x[:-1], y[1:] - y[:-1], strict=True)
            assert way.path == pytest.approx(sum(math.hypot(*step) for step in steps))
            square = tracks.arrays["vx"][:, k] ** 2 + tracks.arrays["vy"][:, k] ** 2
            assert way.speed == pytest.approx(math.sqrt(square[shaken].mean()))
            assert way.speed_start == pytest.approx(math.sqrt(square[first].mean()))
            assert way.level == tracks.arrays["y"][0, k]
        assert found.mean["turn"] == pytest.approx(np.mean([abs(way.turn) for way in found.ways]))
        assert found.mean["y"] == pytest.approx(np.mean([way.y for way in found.ways]))


def test_path_is_no_shorter_than_the_excursion_nor_that_than_the_net_way(path: Path) -> None:
    for way in read(path).moved[0].ways:
        assert way.path >= way.excursion >= math.hypot(way.x, way.y) - 1e-15


def test_rows_of_the_grid_are_told_by_height() -> None:
    found = as_rows(ways((3, 0.1, 1, 0), (1, 0.9, 2, 0), (1, 0.101, 3, 0), (2, 0.9, 4, 0), (2, 0.1, 5, 0)))
    assert [[way.x for way in row] for row in found] == [[3, 5, 1], [2, 4]]


# ---------------------------------------------------------------------------------------- cases


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=8), st.integers(0, 3))
def test_pooling_is_mean_and_deviation_of_what_is_defined(values: list[float], unknown: int) -> None:
    found = pooled([*values, *[math.nan] * unknown])
    assert found.n == len(values)
    assert found.mean == pytest.approx(sum(values) / len(values), abs=1e-6)
    squares = sum((value - found.mean) ** 2 for value in values)
    assert found.sd == pytest.approx(math.sqrt(squares / (len(values) - 1)), rel=1e-6, abs=1e-6)
    assert pooled(reversed(values)).mean == pytest.approx(found.mean, abs=1e-9 * max(map(abs, values), default=0.0))


def test_one_value_has_no_deviation() -> None:
    assert pooled([2.0]).mean == 2.0
    assert math.isnan(pooled([2.0]).sd)
    assert pooled([math.nan]).n == pooled([]).n == 0


def test_seeds_of_a_case_are_pooled() -> None:
    cases, said = pool([an_outcome(seed=seed, packed=packed) for seed, packed in ((3, 0.20), (1, 0.21), (2, 0.22))])
    assert len(cases) == 1
    assert said == []
    assert cases[0].who == "seeds 1, 2, 3"
    value = cases[0].measures["void_ratio_packed"]
    assert (value.mean, value.sd, value.n) == (pytest.approx(0.21), pytest.approx(0.01), 3)


def test_a_seed_counts_once() -> None:
    cases, said = pool([an_outcome(), replace(an_outcome(), file="copy.h5"), an_outcome(seed=2)])
    assert [len(case.runs) for case in cases] == [2]
    assert len(said) == 1
    assert "copy.h5" in said[0]


def test_other_settings_and_incomplete_runs_are_other_cases() -> None:
    runs = [
        an_outcome(seed=1),
        an_outcome(seed=2, settings={"contact.tension": "damping"}),
        an_outcome(seed=3, hertz=1.0),
        an_outcome(seed=4, complete=False),
        an_outcome(seed=5),
    ]
    cases, _ = pool(runs)
    assert sorted(len(case.runs) for case in cases) == [1, 1, 1, 2]
    assert len(pool(runs, each=True)[0]) == len(runs)


def test_cases_are_told_apart_by_what_is_unusual() -> None:
    damped = {"contact.tension": "damping", "grains.bond.rolling": False}
    runs = [an_outcome("disc"), an_outcome("pair"), an_outcome("ellipse"), an_outcome("pair", settings=damped)]
    kinds = [case.kind for case in pool(runs)[0]]
    pairs = ["bonded pair, bond.rolling on", "bonded pair, bond.rolling off, tension damping"]
    assert kinds == ["disc", "ellipse 2", *pairs]


def test_order_is_by_shaking_then_shape() -> None:
    runs = [an_outcome(f, gal=g, hertz=h) for f in ("pair", "disc") for g in (1200, 400) for h in (1, 10)]
    found = [(case.shaking, case.first.family) for case in pool(runs)[0]]
    labels = ("400 gal 10 Hz", "400 gal 1 Hz", "1200 gal 10 Hz", "1200 gal 1 Hz")
    assert found == [(label, family) for label in labels for family in ("disc", "pair")]


def test_effect_of_one_setting_is_over_common_seeds() -> None:
    damping = {"contact.tension": "damping"}
    runs = [an_outcome(seed=s, packed=0.20 + 0.001 * s) for s in (1, 2, 3)]
    runs += [an_outcome(seed=s, packed=0.23 + 0.002 * s, settings=damping) for s in (2, 3, 4)]
    runs += [an_outcome(seed=1, settings={**damping, "contact.friction": 0.5}), an_outcome("pair")]
    found = effects(pool(runs)[0])
    (one,) = [effect for effect in found if effect.setting == "contact.tension"]
    assert {one.one, one.other} == {"none", "damping"}
    sign = 1.0 if one.one == "none" else -1.0
    assert (one.packed.mean, one.packed.n) == (pytest.approx(sign * 0.0325), 2)
    assert one.shaken.mean == pytest.approx(0.0)
    # Two settings at a time tell of neither, and seeds that only one has tell nothing.
    assert len(found) == 1


def test_comparison_of_files(tmp_path: Path) -> None:
    files = [a_file(tmp_path / f"{seed}.h5", seed=seed, after={"void_ratio": 0.19 + 0.01 * seed}) for seed in (1, 2)]
    files.append(a_file(tmp_path / "cut.h5", stop_after=2.001, tracks=None))
    found = compare(files, with_thesis=True)
    assert [case.complete for case in found.cases].count(False) == 1
    value = next(case for case in found.cases if case.complete).measures["void_ratio_shaken"]
    assert (value.mean, value.n) == (pytest.approx(0.205), 2)
    assert all(one.here.n == 2 for one in found.beside)
    tree = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert tree["format"] == "dem-cli comparison"
    assert {len(case["runs"]) for case in tree["cases"]} == {1, 2}
    assert compare(files, each=True).cases[0].measures["void_ratio_shaken"].n == 1
    assert compare(files).checks == ()


def test_pooled_numbers_say_how_many() -> None:
    from dem_cli.report.thesis_checks import text

    assert text(Pooled(0.20055, 0.0023, 3), ".4f") == "0.2006 +- 0.0023 (3)"
    assert text(Pooled(-0.01, 0.002, 2), "+.4f") == "-0.0100 +- 0.0020 (2)"
    assert text(Pooled(0.2, math.nan, 1), ".3f") == "0.200"
    assert text(Pooled(math.nan, math.nan, 0), ".3f") == "-"
