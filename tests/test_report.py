"""Summary, text and CSV of result files: what is said is what the file holds."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import report_samples as made

from dem_cli.analysis.sloshing import theory_period, thesis_period
from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.report.cautions import RESIDUAL_LIMIT
from dem_cli.report.export import export_csv, folders
from dem_cli.report.summary import LOST, MEASURES, STORED, Summary, summary
from dem_cli.report.text import Block, blocks, comparison, plain, show
from dem_cli.results import Results, open_results


@pytest.fixture(scope="module")
def complete(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make_file(tmp_path_factory.mktemp("complete") / "run.h5", interval=0.02)


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run stopped in its second stage, without tracks, whose ledger misses 2 J."""
    folder = tmp_path_factory.mktemp("cut")
    return made.make_file(folder / "cut.h5", stop_after=2.001, residual=2.0, tracks=None, interval=0.02)


def summarised(path: Path) -> Summary:
    with open_results(path) as results:
        return summary(results)


def text_of(path: Path) -> str:
    return "\n\n".join(plain(block) for block in blocks(summarised(path)))


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


# ------------------------------------------------------------------------------------------- the summary


def test_stages_are_those_of_the_file(complete: Path) -> None:
    with open_results(complete) as results:
        found = summary(results)
        assert [s.kind for s in found.stages] == ["settle", "shake"]
        for stage, stored in zip(found.stages, results.stages, strict=True):
            assert stage.before == {name: stored.before[name] for name in MEASURES}
            assert stage.after == {name: stored.after[name] for name in MEASURES}
            for name in MEASURES:
                assert stage.change[name] == stored.after[name] - stored.before[name]
            assert (stage.start, stage.end, stage.reason) == (stored.start, stored.end, stored.reason)
    assert found.stages[1].before["void_ratio"] == made.VOID_RATIOS[1]
    assert found.stages[1].after["void_ratio"] == pytest.approx(made.VOID_RATIOS[2], abs=1e-12)
    assert (found.stages[1].amplitude, found.stages[1].frequency) == (4.0, 10.0)
    assert math.isnan(found.stages[0].frequency)


def test_largest_of_a_stage_is_of_its_own_rows(complete: Path) -> None:
    with open_results(complete) as results:
        time, overlap = results.series["time"], results.series["max_overlap"]
        found = summary(results)
    assert found.stages[0].overlap_largest == overlap[time <= made.SETTLED + 1e-9].max()
    assert found.stages[1].overlap_largest == overlap[time >= made.SETTLED - 1e-9].max()
    assert found.stages[0].overlap_largest != found.stages[1].overlap_largest


def test_ledger_is_the_last_row_and_balances(complete: Path) -> None:
    with open_results(complete) as results:
        series = {name: results.series[name] for name in results.series}
        energy = summary(results).energy
    assert energy is not None
    assert energy.stored == {name: series[name][-1] for name in STORED}
    assert energy.lost == {name: series[name][-1] for name in LOST}
    left = energy.stored_start + energy.work + energy.time_step_energy
    assert left == pytest.approx(energy.stored_total + energy.lost_total + energy.residual, rel=1e-12)
    assert energy.residual_ratio == 0.0


def test_residual_is_judged_by_its_largest(tmp_path: Path) -> None:
    """energy_in is 120 J at the end, so 0.11 J are within the limit of 1e-3 and 0.13 J are not."""
    for residual, warned in ((0.11, False), (0.13, True), (-0.13, True)):
        found = summarised(made.make_file(tmp_path / f"r{residual}.h5", residual=residual, interval=0.1))
        assert found.energy is not None
        assert found.energy.residual_largest_ratio == pytest.approx(abs(residual) / 120.0)
        assert any("ledger misses" in line for line in found.warnings) is warned
        assert (found.energy.residual_largest_ratio > RESIDUAL_LIMIT) is warned


def test_sloshing_of_a_stage_of_shaking(complete: Path) -> None:
    found = summarised(complete)
    assert found.stages[0].sloshing is None
    s = found.stages[1].sloshing
    assert s is not None
    width, depth, gravity = found.run.width, made.DEPTHS[1], 9.80665
    assert s.depth == depth
    assert (s.theory_T1, s.theory_T2, s.theory_T3) == tuple(theory_period(n, width, depth, gravity) for n in (1, 2, 3))
    assert s.thesis_T1 == thesis_period(width, depth, gravity)
    assert s.driving_period == pytest.approx(made.DRIVING)
    assert s.period == pytest.approx(made.SLOSH, rel=0.01)
    assert s.amplitude == pytest.approx(made.SLOSH_AMPLITUDE, rel=0.05)
    assert s.ratio == pytest.approx(s.period / s.driving_period)
    assert s.resolution == pytest.approx(1.0 / (made.END - made.SETTLED))


def test_tilted_gravity_pulls_the_surface_by_its_vertical_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(made, "RESOLVED", made.RESOLVED.replace("-90 deg", "-30 deg"))
    found = summarised(made.make_file(tmp_path / "tilted.h5", interval=0.1))
    s = found.stages[1].sloshing
    assert s is not None
    assert s.theory_T1 == pytest.approx(theory_period(1, found.run.width, s.depth, 0.5 * 9.80665))


def test_two_rows_of_one_time_are_no_harm(tmp_path: Path) -> None:
    """The end of a stage and the start of the next: the surface must not be seen as sampled at one instant."""
    path = made.make_file(tmp_path / "a.h5", interval=0.02)
    twice = made.make_file(tmp_path / "b.h5", interval=0.02, double_row=True)
    one, two = summarised(path).stages[1].sloshing, summarised(twice).stages[1].sloshing
    assert one is not None
    assert two is not None
    assert two.period == one.period


def test_incomplete_run_says_so_and_shows_its_last_row(cut: Path) -> None:
    with open_results(cut) as results:
        found = summary(results)
        last = {name: results.series[name][-1] for name in MEASURES}
    assert not found.run.complete
    assert "incomplete (interrupted)" in found.warnings[0]
    assert math.isnan(found.stages[1].end)
    assert found.stages[1].after == last
    text = text_of(cut)
    assert "INCOMPLETE: interrupted" in text
    assert "so far" in text
    assert "the fourth grain is shy" in text


def test_empty_run_has_a_summary(tmp_path: Path) -> None:
    """A run killed before its first row."""
    found = summarised(made.make_file(tmp_path / "empty.h5", stop_after=-1.0))
    assert found.energy is None
    assert found.stages == ()
    assert "no series" in " ".join(found.warnings)
    assert json.dumps(found.as_dict(), allow_nan=False)
    assert plain(comparison([found]))


# ------------------------------------------------------------------------------------------------- text


def test_json_keeps_every_bit_and_turns_nan_to_null(cut: Path) -> None:
    found = summarised(cut)
    tree = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert tree["run"]["height"] is None
    assert tree["stages"][0]["frequency"] is None
    assert tree["stages"][1]["end"] is None
    assert tree["stages"][1]["after"]["void_ratio"] == found.stages[1].after["void_ratio"]
    assert tree["energy"]["residual"] == 2.0
    assert tree["warnings"] == list(found.warnings)
    assert set(tree) == {"format", "format_version", "run", "stages", "energy", "warnings"}


def test_text_and_json_agree(complete: Path) -> None:
    text, tree = text_of(complete), summarised(complete).as_dict()
    parts = re.split(r"\n\n", text)
    assert parts[0].startswith(tree["run"]["title"])
    forms = {
        "void ratio, whole fill": ("void_ratio", "{:.3f} -> {:.3f}"),
        "void ratio, inner window": ("void_ratio_inner", "{:.3f} -> {:.3f}"),
        "coordination number": ("coordination", "{:.2f} -> {:.2f}"),
    }
    for stage, part in zip(tree["stages"], (parts[1], parts[2]), strict=True):
        assert part.startswith(f"Stage {stage['number']}: {stage['kind']}")
        for label, (name, form) in forms.items():
            line = next(line for line in part.splitlines() if label in line)
            assert form.format(stage["before"][name], stage["after"][name]) in line
            assert f"{stage['change'][name]:+.2f}"[:3] in line
    assert "0.214 -> 0.199" in parts[2]
    assert f"T1 {tree['stages'][1]['sloshing']['theory_T1']:.4g} s" in parts[3]
    energy = {line[:44].strip(): line[44:].strip() for line in parts[4].splitlines()[2:]}
    assert float(energy["lost"]) == pytest.approx(tree["energy"]["lost_total"], rel=1e-4)
    assert float(energy["friction"]) == pytest.approx(tree["energy"]["lost"]["friction"], rel=1e-4)
    assert float(energy["work of the shaking"]) == tree["energy"]["work"]


def test_comparison_has_a_row_a_file(complete: Path, cut: Path) -> None:
    block = comparison([summarised(complete), summarised(cut)])
    header, *rows = plain(block).splitlines()
    assert len(rows) == 2
    place = header.index("void ratio") + len("void ratio")
    assert rows[0][:place].endswith("0.214 -> 0.199")
    assert rows[1][:place].endswith("0.214 -> 0.210")
    assert "complete" in rows[0].split()
    assert "incomplete" in rows[1].split()


def test_plain_text_is_aligned() -> None:
    block = Block("Head", ("", "a", "bb"), (("x", "1", "2"), ("long", "1000", "-")))
    assert plain(block) == "Head\n           a  bb\n  x        1   2\n  long  1000   -"


def test_colour_only_on_a_terminal(complete: Path) -> None:
    found = blocks(summarised(complete))
    piped, terminal = io.StringIO(), Terminal()
    show(found, piped)
    show(found, terminal)
    assert "\x1b[" not in piped.getvalue()
    assert "\x1b[" in terminal.getvalue()
    words = re.sub(r"\x1b\[[0-9;]*m", "", terminal.getvalue()).split()
    assert words == piped.getvalue().split()


# -------------------------------------------------------------------------------------------------- CSV


def read(path: Path) -> tuple[list[str], list[list[str]]]:
    with path.open(newline="", encoding="utf-8") as stream:
        header, *rows = csv.reader(stream)
    return header, rows


def exported(results: Results, folder: Path) -> dict[str, tuple[list[str], list[list[str]]]]:
    return {path.name: read(path) for path in export_csv(results, summary(results), folder)}


def test_csv_gives_back_every_bit(complete: Path, tmp_path: Path) -> None:
    with open_results(complete) as results:
        tables = exported(results, tmp_path / "new" / "folder")
        header, rows = tables["series.csv"]
        table = np.array(rows, dtype=float)
        assert header[:3] == ["time [s]", "step", "stage"]
        assert len(header) == len(results.series)
        for column, name in enumerate(results.series):
            unit = results.series.unit(name)
            assert header[column] == (name if unit == "1" else f"{name} [{unit}]")
            np.testing.assert_array_equal(table[:, column], results.series[name])
        assert np.isnan(table[:, header.index("fabric_xy")]).all()

        header, rows = tables["surface.csv"]
        assert header == ["time [s]", "x [m]", "eta [m]"]
        eta = np.array(rows, dtype=float)[:, 2].reshape(results.surface.eta.shape)
        np.testing.assert_array_equal(eta, results.surface.eta)

        tracks = results.tracks
        assert tracks is not None
        header, rows = tables["tracks.csv"]
        table = np.array(rows, dtype=float).reshape(len(tracks.time), len(tracks.ids), -1)
        np.testing.assert_array_equal(table[0, :, 1], tracks.ids)
        np.testing.assert_array_equal(table[:, 0, 0], tracks.time)
        np.testing.assert_array_equal(table[:, :, header.index("angle [rad]")], tracks.arrays["angle"])

        header, rows = tables["stages.csv"]
        assert [row[1] for row in rows] == ["settle", "shake"]
        assert float(rows[1][header.index("void_ratio before")]) == results.stages[1].before["void_ratio"]


def test_file_without_tracks_gives_no_table_of_them(cut: Path, tmp_path: Path) -> None:
    with open_results(cut) as results:
        assert set(exported(results, tmp_path)) == {"series.csv", "stages.csv", "surface.csv"}


def test_csv_never_overwrites_unasked(complete: Path, tmp_path: Path) -> None:
    (tmp_path / "stages.csv").write_text("mine")
    with open_results(complete) as results:
        found = summary(results)
        with pytest.raises(ResultsError, match=r"stages\.csv exists"):
            export_csv(results, found, tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["stages.csv"]
        assert (tmp_path / "stages.csv").read_text() == "mine"
        export_csv(results, found, tmp_path, force=True)
        assert (tmp_path / "stages.csv").read_text().startswith("stage,name")


def test_folder_that_cannot_be_made_is_one_line(complete: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with open_results(complete) as results, pytest.raises(ResultsError, match="cannot be written"):
        export_csv(results, summary(results), tmp_path / "file" / "below")


def test_each_file_has_its_own_folder() -> None:
    place = Path("out")
    assert folders([Path("a/run.h5")], place) == [place]
    assert folders([Path("a.h5"), Path("b.h5")], place) == [place / "a", place / "b"]
    with pytest.raises(ScenarioError, match="two files"):
        folders([Path("a/run.h5"), Path("b/run.h5")], place)
