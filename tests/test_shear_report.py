"""Numbers of shear tests: turn, peak, residual state, energies, cycles; files and tables of them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import quasi_static_samples as made
import shear_samples as rows_of
from hypothesis import given
from hypothesis import strategies as st
from shear_samples import COLLAPSE, DEPTH, LAST, P0, PEAK, STEP, TURN

from dem_cli.report import shear_measures as measures
from dem_cli.report import shear_rows
from dem_cli.report.shear import ShearSummary, shear_summary
from dem_cli.report.shear_text import blocks, comparison
from dem_cli.report.text import plain
from dem_cli.results import open_results
from dem_cli.results.schema import INCREMENTS

VOLUME = rows_of.WIDTH * rows_of.HEIGHT * DEPTH


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.write_test(tmp_path_factory.mktemp("shear") / "walls.h5", title="Lattice")


@pytest.fixture(scope="module")
def summary(path: Path) -> ShearSummary:
    with open_results(path) as results:
        return shear_summary(results)


# ------------------------------------------------------------------------------------------------ one stage


def test_turn_is_that_before_the_peak() -> None:
    """A collapse after the peak contracts the sample more, and is told apart."""
    found = measures.shearing_of(rows_of.sheared(), DEPTH)
    assert found.turn is not None
    assert found.contraction is not None
    assert found.peak is not None
    assert (found.turn.in_stage, found.turn.increment) == (TURN, 100 + TURN)
    assert found.turn.shear_strain == pytest.approx(TURN * STEP)
    assert found.turn.volumetric_strain == pytest.approx(7e-4)
    assert found.contraction.in_stage == COLLAPSE
    assert found.contraction.volumetric_strain == pytest.approx(1e-4 * (2 * TURN - COLLAPSE) + 0.01)


def test_peak_and_end() -> None:
    found = measures.shearing_of(rows_of.sheared(), DEPTH)
    assert found.peak is not None
    assert (found.peak.in_stage, found.peak.stress_ratio) == (PEAK, pytest.approx(1.7))
    assert found.peak.sine == pytest.approx(0.7 / 2.7)
    assert found.peak.shear_strain == pytest.approx(0.01)
    assert (found.end.in_stage, found.end.stress_ratio) == (LAST, pytest.approx(1.28))


def test_residual_state_is_the_mean_of_the_last_fifth() -> None:
    """s1/s2 falls evenly, so the mean is that in the middle of increments 41 to 50."""
    found = measures.residual_of(rows_of.sheared())
    assert found.increments == 10
    assert found.stress_ratio == pytest.approx(1.0 + 0.7 * (1.0 - 0.6 * (45.5 - PEAK) / 30.0))
    assert found.void_ratio == pytest.approx(0.26 - 0.01 - 1e-4 * (2 * TURN - 45.5))


def test_samples_that_only_dilate_or_contract() -> None:
    rows = rows_of.sheared()
    rows["volumetric_strain"] = -1e-4 * rows["in_stage"]
    turn = measures.shearing_of(rows, DEPTH).turn
    assert turn is not None
    assert turn.in_stage == 0
    rows["volumetric_strain"] = 1e-4 * rows["in_stage"]
    turn = measures.shearing_of(rows, DEPTH).turn
    assert turn is not None
    assert turn.in_stage == PEAK


def test_volume_that_is_held_has_no_turn() -> None:
    rows = rows_of.sheared()
    rows["volumetric_strain"] = 1e-13 * np.sin(rows["in_stage"])
    assert measures.shearing_of(rows, DEPTH).turn is None


def test_peak_passes_over_rows_without_lateral_stress() -> None:
    rows = rows_of.sheared()
    rows["stress_ratio"][30:33] = [np.nan, np.inf, np.nan]
    assert shear_rows.row_of_peak(rows) == PEAK
    rows["stress_ratio"][:] = np.nan
    found = measures.shearing_of(rows, DEPTH)
    assert found.peak is None
    assert math.isnan(found.residual.stress_ratio)


def test_energies_and_closure() -> None:
    """Work goes in, and a tenth of it comes back; the ledger misses 1e-3 of what was moved."""
    rows = rows_of.blank(4)
    rows["work"] = np.array([5.0, 6.0, 7.0, 6.8, 8.8])
    rows["body_work"] = np.array([0.0, 0.0, 0.5, 0.5, 0.5])
    rows["friction"] = np.array([2.0, 2.5, 3.0, 3.0, 4.0])
    rows["released"] = np.array([0.0, 0.0, 0.0, 0.0, 0.3])
    rows["residual"] = np.array([0.0, 0.0, 0.001, 0.002, -0.0047])
    for name, share in (("elastic_normal", 0.5), ("elastic_tangential", 0.3), ("elastic_membrane", 0.2)):
        rows[name] = share * (rows["work"] + rows["body_work"] - rows["friction"] - rows["released"] - rows["residual"])
    found = measures.ledger_of(rows, DEPTH)
    assert found.work == pytest.approx(4.3 / VOLUME)
    assert found.put_in == pytest.approx(4.7 / VOLUME)  # 1.0 + 1.5 + 0.2 + 2.0
    assert found.closure == pytest.approx(0.0047 / 4.7)
    assert found.released_share == pytest.approx(0.3 / 4.7)
    assert found.elastic == pytest.approx((4.3 - 2.0 - 0.3 + 0.0047) / VOLUME)


@given(st.lists(st.floats(0.5, 1.5), min_size=2, max_size=20), st.integers(0, 1000))
def test_densities_add_up_whatever_the_area_does(widths: list[float], seed: int) -> None:
    rows = rows_of.blank(len(widths) - 1)
    rng = np.random.default_rng(seed)
    rows["width"] = np.array(widths)
    for name in (
        "friction",
        "released",
        "residual",
        "elastic_normal",
        "elastic_tangential",
        "elastic_membrane",
        "body_work",
    ):
        rows[name] = rng.normal(size=len(widths))
    spent = sum(
        rows[name]
        for name in ("friction", "released", "residual", "elastic_normal", "elastic_tangential", "elastic_membrane")
    )
    rows["work"] = spent - rows["body_work"]
    found = shear_rows.densities(rows, DEPTH)
    want = found["elastic"] + found["friction"] + found["released"] + found["residual"]
    np.testing.assert_allclose(found["work"], want, atol=1e-9 * np.abs(want).max() + 1e-9)
    assert found["work"][0] == 0.0


def test_share_of_the_largest_contact() -> None:
    rows = rows_of.blank(5)
    rows["largest_share"] = np.array([np.nan, 0.3, 0.5, np.nan, 0.2, 0.4])
    assert measures.share_of(rows) == measures.Share(0.5, 2, pytest.approx(0.35))
    rows["largest_share"][:] = np.nan
    assert measures.share_of(rows).at == 0


def test_solver_counts_the_increments_alone() -> None:
    """Row 0 belongs to another stage."""
    rows = rows_of.blank(5)
    rows["iterations"] = np.array([1e6, 400.0, 800.0, 1200.0, 400.0, 8000.0])
    rows["rung"] = np.array([5.0, 0.0, 0.0, 1.0, 0.0, 3.0])
    rows["event"] = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    rows["balance"] = np.array([9.0, 1e-6, 2e-6, 1e-6, 1e-6, 1e-6])
    found = measures.solver_of(rows)
    assert found == measures.Solver((5,), 800.0, 8000.0, 200.0, 2, 3, 2e-6)


def test_cycles_and_liquefaction() -> None:
    rows = rows_of.cyclic()
    found = measures.shearing_of(rows, DEPTH, "cyclic")
    assert [(one.number, one.last, one.whole) for one in found.cycles] == [
        (1, 60, True),
        (2, 140, True),
        (3, 220, True),
        (4, 240, False),
    ]
    assert [one.amplitude for one in found.cycles] == pytest.approx([0.01, 0.01, 0.01, 0.005])
    first = found.cycles[0]
    assert first.mean_stress == pytest.approx(P0 * (1.0 - 0.995 * 60 / 220))
    assert first.mean_stress + first.pore_pressure == pytest.approx(P0)
    assert first.pore_pressure_largest == first.pore_pressure
    assert found.undrained is not None
    assert (found.undrained.liquefied, found.undrained.cycle) == (True, 3)
    assert found.undrained.ratio_least == pytest.approx(0.005)
    assert found.undrained.pore_pressure_largest == pytest.approx(0.995 * P0)


def test_limit_of_liquefaction_is_that_of_the_stage() -> None:
    found = measures.shearing_of(rows_of.cyclic(), DEPTH, "cyclic", limit=0.001).undrained
    assert found is not None
    assert (found.liquefied, found.cycle, found.limit) == (False, 0, 0.001)
    assert measures.shearing_of(rows_of.sheared(), DEPTH).undrained is None


def test_half_cycles_pass_over_rests() -> None:
    rows = rows_of.blank(6)
    rows["shear_strain"] = np.array([0.0, 1.0, 1.0, 2.0, 1.0, 1.0, 3.0])
    assert shear_rows.half_cycles(rows) == [(0, 3), (3, 5), (5, 6)]


# ------------------------------------------------------------------------------------------------ files


def stored(start_row: bool) -> Any:
    """Two stages in series; the second with a row for its start, or without."""
    in_stage = [0, 1, 2, 0, 1, 2] if start_row else [0, 1, 2, 1, 2]
    stage = [0, 0, 0, 1, 1, 1] if start_row else [0, 0, 0, 1, 1]
    series = {name: np.arange(len(stage), dtype=float) for name in INCREMENTS}
    series.update(stage=np.array(stage, dtype=float), in_stage=np.array(in_stage, dtype=float))
    before = {name: 2.5 for name in INCREMENTS if name not in ("increment", "stage")}
    stages = [SimpleNamespace(kind="compress", before=before), SimpleNamespace(kind="shear", before=before)]
    return SimpleNamespace(series=series, stages=stages, path="x.h5")


def test_a_stage_starts_from_its_own_row_or_from_that_of_the_table() -> None:
    rows = shear_rows.stage_rows(stored(True), 2)
    assert rows["in_stage"].tolist() == [0, 1, 2]
    assert rows["work"].tolist() == [3, 4, 5]
    rows = shear_rows.stage_rows(stored(False), 2)
    assert rows["in_stage"].tolist() == [0, 1, 2]
    assert rows["work"].tolist() == [2.5, 3, 4]
    assert math.isnan(rows["increment"][0])


def test_stages_that_shear() -> None:
    results = stored(True)
    assert shear_rows.shear_stages(results) == [2]
    results.series["in_stage"][3:] = 0.0
    assert shear_rows.shear_stages(results) == []


def test_summary_of_a_file(summary: ShearSummary) -> None:
    compress, shear = summary.stages
    assert summary.test.grains == made.COLUMNS * made.ROWS
    assert (compress.shearing, compress.increments, shear.increments) == (None, made.COMPRESSION, 60)
    assert shear.shearing is not None
    assert shear.shearing.peak is not None
    assert shear.shearing.turn is not None
    assert (shear.shearing.peak.in_stage, shear.shearing.peak.stress_ratio) == (36, pytest.approx(1.75))
    assert shear.shearing.turn.in_stage == 15
    assert shear.solver.events == (20, 40, 60)
    assert shear.hold == "mean-stress"
    assert summary.initial["mean_stress"] == pytest.approx(made.SIGMA)
    assert summary.initial == shear.before
    assert compress.before["mean_stress"] == pytest.approx(0.05 * made.SIGMA)


def test_boundary_grains_are_no_grains(tmp_path: Path) -> None:
    with open_results(made.write_test(tmp_path / "ring.h5", increments=4, ring=True)) as results:
        found = shear_summary(results).test
    assert (found.grains, found.boundary_elements, found.boundary) == (20, 18, "chain")


def test_json_holds_no_nan(summary: ShearSummary) -> None:
    summary = replace(summary, test=replace(summary.test, wall_time=math.nan))
    tree = json.loads(json.dumps(summary.as_dict(), allow_nan=False))
    assert tree["test"]["wall_time"] is None
    assert tree["format"] == "dem-cli shear summary"
    assert tree["stages"][1]["shearing"]["peak"]["in_stage"] == 36
    assert tree["stages"][0]["shearing"] is None
    assert "settings" not in tree["test"]


def test_text_of_a_file(summary: ShearSummary) -> None:
    text = "\n".join(plain(block) for block in blocks(summary))
    for part in (
        "Stage 2: shear, mean stress constant, 60 increments; shear strain reached",
        "3: in increments 20, 40, 60",
        "turn of the volume change",
        "residual, mean of the last 12",
        "released by collapses",
    ):
        assert part in text
    peak = next(line for line in text.splitlines() if "peak of s1/s2" in line).split()
    assert peak[3:5] == ["36", "1.800"]
    assert peak[6] == "1.7500"


def test_text_of_cycles(summary: ShearSummary) -> None:
    shear = summary.stages[1]
    cyclic = replace(shear, kind="cyclic", shearing=measures.shearing_of(rows_of.cyclic(), DEPTH, "cyclic"))
    text = "\n".join(plain(block) for block in blocks(replace(summary, stages=(cyclic,))))
    assert "YES, in cycle 3" in text
    assert "4 (half)" in text
    assert "residual, mean" not in text


def test_incomplete_run_says_so(tmp_path: Path) -> None:
    with open_results(made.write_test(tmp_path / "cut.h5", increments=20, stop_after=12)) as results:
        found = shear_summary(results)
    assert "incomplete" in found.warnings[0]
    assert found.stages[1].increments == 12 - made.COMPRESSION
    assert not found.stages[1].ended
    assert "incomplete" in comparison([found]).rows[0]


# ------------------------------------------------------------------------------------------------ several files


def with_peak(summary: ShearSummary, seed: int, peak: float) -> ShearSummary:
    """The same test with another seed and another peak."""
    shear = summary.stages[1]
    assert shear.shearing is not None
    assert shear.shearing.peak is not None
    shearing = replace(shear.shearing, peak=replace(shear.shearing.peak, stress_ratio=peak))
    test = replace(summary.test, seed=seed, file=f"runs/seed{seed}.h5")
    return replace(summary, test=test, stages=(summary.stages[0], replace(shear, shearing=shearing)))


def test_seeds_are_pooled(summary: ShearSummary) -> None:
    many = [with_peak(summary, seed, peak) for seed, peak in ((1, 1.6), (2, 1.7), (3, 2.1))]
    rows = comparison(many).rows
    column = comparison(many).header.index("peak s1/s2")
    assert [row[0] for row in rows] == ["seed1.h5", "seed2.h5", "seed3.h5", "mean of 3 +- sd", "median of 3"]
    assert [row[column] for row in rows] == ["1.600", "1.700", "2.100", "1.800 +- 0.265", "1.700"]
    assert [row[0] for row in comparison(many, each=False).rows] == ["mean of 3 +- sd", "median of 3"]


def test_two_seeds_or_other_settings_are_not_pooled(summary: ShearSummary) -> None:
    three = [with_peak(summary, seed, 1.7) for seed in (1, 2, 2)]
    assert len(comparison(three).rows) == 3
    other = with_peak(summary, 3, 1.7)
    other = replace(other, test=replace(other.test, settings={**other.test.settings, "depth": "2 cm"}))
    assert len(comparison([*three, other]).rows) == 4
    cut = with_peak(summary, 3, 1.7)
    assert len(comparison([*three, replace(cut, test=replace(cut.test, complete=False))]).rows) == 4
