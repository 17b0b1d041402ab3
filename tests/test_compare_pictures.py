"""Pictures of a comparison, and `dem compare` from the command line."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from compare_samples import a_file, an_outcome
from shape_samples import shaped

from dem_cli.cli.compare import command
from dem_cli.errors import DemError, ScenarioError
from dem_cli.report import thesis
from dem_cli.report.cases import Case, pool
from dem_cli.report.compare import compare
from dem_cli.report.compare_figures import APART, KINDS, draw, draw_grid, draw_table
from dem_cli.report.compare_tracked import MOST_COLUMNS, draw_histories, draw_trajectories, side_by_side
from dem_cli.report.look import style
from dem_cli.results import open_results


@pytest.fixture(autouse=True)
def styled() -> Iterator[None]:
    with style():
        yield


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Discs of two seeds, bonded pairs with fewer tracks, a run cut off, and one without tracks."""
    folder = tmp_path_factory.mktemp("runs")
    other = (("10.0 Hz", "1.0 Hz"),)
    return [
        a_file(folder / "one.h5", seed=1),
        a_file(folder / "two.h5", seed=2, after={"void_ratio": 0.19}),
        a_file(folder / "pair.h5", sample=shaped("bonded", 4, 5), tracks=(2, 3)),
        a_file(folder / "cut.h5", stop_after=2.001),
        a_file(folder / "slow.h5", scenario=other, tracks=None),
    ]


def cases_of(files: list[Path]) -> tuple[Case, ...]:
    return compare(files).cases


def call(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


# ------------------------------------------------------------------------------------------- pictures


def test_table_shows_packed_and_shaken_and_the_thesis() -> None:
    cases = pool([an_outcome("disc", packed=0.22, shaken=0.21), an_outcome("pair", hertz=1.0)])[0]
    figure = draw_table(cases, with_thesis=True)
    top = figure.axes[0]
    dots = [tuple(np.asarray(dot.get_offsets())[0]) for dot in top.collections]
    assert (-APART, pytest.approx(0.22)) in dots
    assert (APART, pytest.approx(0.21)) in dots
    bars = [float(line.get_ydata()[0]) for line in top.lines if line.get_color() == "black"]  # type: ignore[index]
    known = thesis.FOUND["disc"]
    assert bars == [known.packed, known.shaken]  # the thesis has no pairs at 1 Hz
    assert not [line for line in draw_table(cases).axes[0].lines if line.get_color() == "black"]
    assert [tick.get_text() for tick in figure.axes[2].get_xticklabels()] == ["400 gal\n10 Hz", "400 gal\n1 Hz"]


def test_table_has_bars_of_seeds_only_where_there_are_several() -> None:
    one = draw_table(pool([an_outcome()])[0]).axes[0]
    three = draw_table(pool([an_outcome(seed=s, packed=0.2 + 0.01 * s) for s in (1, 2, 3)])[0]).axes[0]
    assert (len(one.containers), len(three.containers)) == (0, 2)


def test_airborne_is_a_share_of_the_grains() -> None:
    cases = pool([an_outcome("disc", airborne_most=30.0), an_outcome("pair", airborne_most=30.0)])[0]
    bottom = draw_table(cases).axes[2]
    assert [float(np.asarray(dot.get_offsets())[0, 1]) for dot in bottom.collections] == pytest.approx([1.0, 2.0])


def test_grid_holds_each_change_where_it_belongs() -> None:
    runs = [an_outcome(gal=g, hertz=h, packed=0.2, shaken=0.2 + 1e-5 * g / h) for g in (400, 1200) for h in (10, 1)]
    runs += [an_outcome(seed=2, packed=0.2, shaken=0.2014), an_outcome("pair", shaken=0.2, complete=False)]
    figure = draw_grid(pool(runs)[0])
    left, right = figure.axes[:2]
    image = left.images[0].get_array()
    assert image is not None
    np.testing.assert_allclose(image, [[0.0009, 0.004], [0.0012, 0.012]])
    assert [t.get_text() for t in left.texts] == ["+0.0009\n± 0.0007 (2)", "+0.0040", "+0.0012", "+0.0120"]
    assert [t.get_text() for t in left.get_xticklabels()] == ["10", "1"]
    assert [t.get_text() for t in left.get_yticklabels()] == ["400", "1200"]
    assert [t.get_text() for t in right.texts] == ["-0.0100\nincomplete", "-", "-", "-"]
    assert left.images[0].get_clim() == right.images[0].get_clim() == pytest.approx((-0.012, 0.012))


def test_grid_without_a_sine_is_one_line() -> None:
    with pytest.raises(ScenarioError, match="no run of these"):
        draw_grid([])


def test_columns_are_first_runs_of_cases_with_tracks(files: list[Path]) -> None:
    cases = cases_of(files)
    found = side_by_side(cases)
    assert len(cases) == 4
    assert [column.ids for column in found.columns] == [(1, 8, 15), (1, 8, 15), (2, 3)]
    assert "1 of 4 cases" in found.title
    assert "seed 1" in found.columns[0].head
    assert "incomplete" in found.columns[1].head
    with open_results(files[0]) as results:
        tracks = results.tracks
        assert tracks is not None
        shaken = tracks.time >= results.stages[1].start
        np.testing.assert_allclose(found.columns[0].x, tracks.arrays["x"][shaken] - tracks.arrays["x"][shaken][0])
    assert found.columns[0].time[0] == 0.0


def test_stage_is_chosen(files: list[Path]) -> None:
    settled = side_by_side(cases_of(files), 1)
    assert settled.columns[0].time[-1] == pytest.approx(1.0)
    with pytest.raises(ScenarioError, match="stage 3"):
        side_by_side(cases_of(files), 3)
    with pytest.raises(ScenarioError, match="tracks"):
        side_by_side(cases_of(files[-1:]))


def test_histories_and_trajectories_share_their_axes(files: list[Path]) -> None:
    found = side_by_side(cases_of(files))
    for figure in (draw_histories(found), draw_trajectories(found)):
        panels = [ax for ax in figure.axes if any(text.get_text().startswith("No.") for text in ax.texts)]
        assert len(panels) == 3 + 3 + 2
        assert len({ax.get_xlim() for ax in panels}) == len({ax.get_ylim() for ax in panels}) == 1
        assert [ax.texts[0].get_text() for ax in panels][:3] == ["No. 1", "No. 1", "No. 2"]
    turns = [
        ax
        for ax in draw_histories(found).axes
        if ax.yaxis.get_label_position() == "right" or ax.yaxis.get_ticks_position() == "right"
    ]
    assert len({ax.get_ylim() for ax in turns}) == 1


def test_all_of_each_path_is_shown(files: list[Path]) -> None:
    figure = draw_trajectories(side_by_side(cases_of(files)))
    for ax in figure.axes:
        for lines in ax.collections:
            if len(ax.texts) and ax.texts[0].get_text().startswith("No."):
                points = np.concatenate(lines.get_segments())  # type: ignore[attr-defined]
                assert np.all(np.abs(points[:, 0]) <= ax.get_xlim()[1])
                assert np.all(np.abs(points[:, 1]) <= ax.get_ylim()[1])


def test_no_more_columns_than_can_be_read(files: list[Path]) -> None:
    many = side_by_side(cases_of(files)[:1] * (MOST_COLUMNS + 2))
    assert len(many.columns) == MOST_COLUMNS
    assert "2 of 8 cases" in many.title


@pytest.mark.parametrize("what", KINDS)
def test_every_kind_is_drawn(files: list[Path], what: str, tmp_path: Path) -> None:
    figure = draw(compare([files[0], files[2]], with_thesis=True), what, with_thesis=True)
    figure.savefig(tmp_path / "picture.png", dpi=40)


def test_many_files(files: list[Path]) -> None:
    """Thirty rows of each table, and a picture that is not wider than a page can be."""
    found = compare([files[0]] * 30, each=True)
    assert len(found.cases) == 30
    assert draw(found, "table").get_figwidth() <= 15.0


# --------------------------------------------------------------------------------------- command line


def test_text(files: list[Path]) -> None:
    result = call(*files[:3], "--thesis", "--grains")
    assert result.exit_code == 0, result.output
    text = result.stdout
    for words in (
        "0.2141 +- 0.0000 (2)",
        "seeds 1, 2",
        "20/40",
        "Beside the thesis",
        "holds",
        "not covered",
        "Where the thesis and these runs part",
        "Each tracked grain",
        "the fourth grain is shy",
    ):
        assert words in text, words
    plain = call(*files[:3]).stdout
    assert "What the thesis says" not in plain
    assert "Each tracked" not in plain


def test_incomplete_and_trackless_runs_are_marked(files: list[Path]) -> None:
    text = call(files[0], files[3], files[4]).stdout
    assert "INCOMPLETE: interrupted" in text
    assert "slow.h5: holds no tracks" in text


def test_json_has_everything(files: list[Path]) -> None:
    tree = json.loads(call(*files[:3], "--thesis", "--json").stdout)
    case = tree["cases"][0]
    assert case["measures"]["void_ratio_shaken"]["n"] == 2
    assert [way["grain"] for way in case["runs"][0]["moved"][0]["ways"]] == [1, 8, 15]
    assert {check["holds"] for check in tree["checks"]} <= {True, False}
    assert tree["beside"][0]["thesis"] == 0.213


def test_pictures_are_written_and_not_overwritten(
    files: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = call(files[0], "--what", "histories", "--dpi", 40)
    assert result.stderr == "wrote compare-histories.png\n"
    assert "Void ratio" in result.stdout
    again = call(files[0], "--what", "histories")
    assert isinstance(again.exception, DemError)
    assert again.stdout == ""
    assert call(files[0], "-o", "mine.svg").exit_code == 0
    assert (tmp_path / "mine.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(
    "options",
    [
        ["--what", "movie"],
        ["--what", "grid", "--stage", "2"],
        ["--stage", "2"],
        ["-o", "picture.bmp"],
        ["--what", "histories", "--stage", "9"],
        ["absent.h5"],
    ],
)
def test_mistakes_are_one_line(
    files: list[Path], options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = call(files[0], *options)
    assert isinstance(result.exception, DemError)
    assert result.exception.exit_code == 2
    assert "\n" not in str(result.exception)
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_it_is_light(files: list[Path]) -> None:
    """Help needs nothing heavy, tables neither matplotlib nor Numba."""
    code = (
        "import sys\n"
        "from dem_cli.cli.compare import command\n"
        "try: command(['--help'])\n"
        "except SystemExit: pass\n"
        "assert not {'matplotlib', 'numpy', 'h5py', 'numba', 'rich', 'pint'} & set(sys.modules)\n"
        f"command([{str(files[0])!r}, '--thesis'], standalone_mode=False)\n"
        "assert not [name for name in sys.modules if name in ('numba', 'matplotlib') or name.startswith('dem_cli.engines')]\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert all(kind in done.stdout for kind in KINDS)
