"""Reports of ellipses, bonded discs and clumps: how many of what, and whether bonded grains keep their shape."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import report_samples as made
from results_samples import as_format_1
from shape_samples import shaped

from dem_cli.report.cautions import ROLL_LIMIT, STRAIN_LIMIT
from dem_cli.report.summary import Summary, summary
from dem_cli.report.text import blocks, comparison, grains_text, plain
from dem_cli.results import open_results
from dem_cli.results.schema import SERIES

RADIUS = 0.48 * 0.008  # of the discs of the pairs


def summarised(path: Path) -> Summary:
    with open_results(path) as results:
        return summary(results)


def bonded(path: Path, strain: tuple[float, float, float], rolling: float = 0.0) -> Summary:
    sample = shaped("bonded", 4, 5)
    bonds = replace(sample[-1], rolling=np.full(len(sample[-1]), rolling))
    return summarised(made.make_file(path, sample=(*sample[:-1], bonds), strain=strain, interval=0.1, tracks=None))


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ("ellipse", "20 discs and ellipses, aspect ratio 1 to 2.5"),
        ("bonded", "20, made of 40 discs and 20 bonds"),
        ("clump", "20 rigid clumps, made of 60 discs"),
    ],
)
def test_run_tells_grains_and_elements(tmp_path: Path, shape: str, words: str) -> None:
    sample = shaped(shape, 4, 5)
    found = summarised(made.make_file(tmp_path / "run.h5", sample=sample, interval=0.1, tracks=None))
    run = found.run
    assert (run.shape, run.grains, run.elements, run.bonds) == (shape, 20, len(sample[1]), len(sample[-1]))
    assert run.element_radius == pytest.approx(sample[1].radius.mean())
    # Mass is density x area x depth for every shape, overlaps counted once.
    area = np.bincount(sample[1].body, sample[1].mass) / 2480.0
    assert run.mean_radius == pytest.approx(np.sqrt(area / np.pi).mean(), rel=1e-12)
    assert run.element_steps_per_second == pytest.approx(run.steps_per_second * len(sample[1]))
    assert ["grains", words] in [[cell.strip() for cell in row] for row in blocks(found)[0].rows]
    assert "element-steps/s" in plain(blocks(found)[0])
    assert shape in plain(comparison([found])).splitlines()[1].split()


def test_discs_are_called_so(tmp_path: Path) -> None:
    run = summarised(made.make_file(tmp_path / "run.h5", interval=0.1, tracks=None)).run
    assert (grains_text(run), run.aspect_ratio, run.elements) == ("180 discs", (1.0, 1.0), 180)
    assert grains_text(replace(run, aspect_ratio=(1.5, 1.5))) == "180 ellipses, aspect ratio 1.5"


def test_bonds_of_each_stage_are_its_largest(tmp_path: Path) -> None:
    """In the sample strain grows with time: at 1 s, the end of the first stage, it is a fifth of that at 5 s."""
    found = bonded(tmp_path / "run.h5", (1e-6, 2e-6, 3e-4))
    for stage, share in zip(found.stages, (0.2, 1.0), strict=True):
        largest = (stage.bond_gap_largest, stage.bond_slip_largest, stage.bond_roll_largest)
        assert largest == pytest.approx((1e-6 * share, 2e-6 * share, 3e-4 * share), rel=1e-9)
    text = plain(blocks(found)[2])
    assert f"{1e-6 / RADIUS:.1e}" in next(line for line in text.splitlines() if "largest bond gap / radius" in line)
    assert f"{2e-6 / RADIUS:.1e}" in next(line for line in text.splitlines() if "largest bond slip / radius" in line)
    assert f"{math.degrees(3e-4):.1e}" in next(line for line in text.splitlines() if "largest bond roll [deg]" in line)


def test_without_bonds_nothing_is_said_of_them(tmp_path: Path) -> None:
    """Whatever the series holds, 0 or NaN or worse."""
    found = summarised(made.make_file(tmp_path / "run.h5", strain=(1.0, 1.0, 1.0), interval=0.1, tracks=None))
    assert all(math.isnan(stage.bond_gap_largest) for stage in found.stages)
    assert not any("bond" in line for line in found.warnings)
    assert "largest bond" not in "".join(plain(block) for block in blocks(found))


@pytest.mark.parametrize(
    ("gap", "slip", "roll", "rolling", "said"),
    [
        (0.99, 0.99, 0.99, 1.0, []),
        (1.01, 0.5, 0.5, 1.0, ["largest gap is 0.01", "normal and tangential viscosity"]),
        (0.5, 3.0, 0.5, 1.0, ["largest slip is 0.03", "normal and tangential viscosity"]),
        (0.5, 0.5, 2.0, 1.0, ["largest roll is 2 deg", "rolling_viscosity"]),
        (0.5, 0.5, 90.0, 0.0, []),  # as gears roll, which keeps the outline
        (2.0, 2.0, 90.0, 0.0, ["largest gap is 0.02", "largest slip is 0.02"]),
    ],
)
def test_lost_shape_is_warned_about(
    tmp_path: Path, gap: float, slip: float, roll: float, rolling: float, said: list[str]
) -> None:
    limit = STRAIN_LIMIT * RADIUS
    found = bonded(tmp_path / "run.h5", (gap * limit, slip * limit, roll * ROLL_LIMIT), rolling)
    lines = [line for line in found.warnings if line.startswith("bonds")]
    assert len(lines) == (1 if said else 0)
    for words in said:
        assert words in lines[0]
    if lines:
        assert "no longer keep their shape" in lines[0]
        assert "roll is" not in lines[0] or rolling > 0.0
        assert ("gap is" in lines[0], "slip is" in lines[0]) == (gap > 1.0, slip > 1.0)


def test_energy_lost_to_bonds_is_in_the_ledger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = made.series_row

    def row(*arguments: float) -> dict[str, float]:
        found = whole(*arguments)  # type: ignore[arg-type]
        return {**found, "bond_energy": 0.25 * found["friction"], "friction": 0.75 * found["friction"]}

    monkeypatch.setattr(made, "series_row", row)
    found = summarised(made.make_file(tmp_path / "run.h5", sample=shaped("bonded", 4, 5), interval=0.1, tracks=None))
    energy = found.energy
    assert energy is not None
    assert energy.lost["bond_energy"] == pytest.approx(energy.lost["friction"] / 3.0)
    left = energy.stored_start + energy.work + energy.time_step_energy
    assert left == pytest.approx(energy.stored_total + energy.lost_total + energy.residual, rel=1e-12)
    (line,) = [row for row in blocks(found)[-2].rows if row[0].strip() == "bonds"]
    assert float(line[1]) == pytest.approx(energy.lost["bond_energy"], rel=1e-4)


def test_a_file_of_format_1_has_its_report(tmp_path: Path) -> None:
    new, old = (made.make_file(tmp_path / f"{name}.h5", interval=0.1, tracks=None) for name in ("new", "old"))
    as_format_1(old)
    one, two = summarised(new), summarised(old)
    assert two.energy == one.energy
    assert two.run.grains == two.run.elements == one.run.grains
    for a, b in zip(one.stages, two.stages, strict=True):
        assert (a.after, a.overlap_largest) == (b.after, b.overlap_largest)


def test_names_of_the_series() -> None:
    """As the measures give them."""
    assert [SERIES[name][0] for name in ("bond_energy", "bond_gap", "bond_slip", "bond_roll")] == ["J", "m", "m", "rad"]
