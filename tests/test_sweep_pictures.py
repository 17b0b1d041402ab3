"""Pictures of a sweep, and `dem render` of one from the command line."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quasi_static_samples
import sweep_samples as made
from click.testing import CliRunner, Result
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from picture_checks import clashes

from dem_cli.cli.compare import command as compare
from dem_cli.cli.render import command
from dem_cli.errors import DemError, ScenarioError
from dem_cli.report.look import DIVERGING, SEQUENTIAL, style
from dem_cli.report.sweep import Sweep, read_sweep
from dem_cli.report.sweep_curves import plane
from dem_cli.report.sweep_figures import KINDS, draw, sections
from dem_cli.results.manifest import Manifest, SweepAxis, read_manifest, write_manifest

FAILED = ("disc-400-1-1", "disc-400-1-2", "disc-400-1-3")
WAITING = ("ellipse-800-5-1", "ellipse-800-5-2", "ellipse-800-5-3")


@pytest.fixture(autouse=True)
def styled() -> Iterator[None]:
    with style():
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make_sweep(tmp_path_factory.mktemp("work") / "grid", failed=FAILED, waiting=WAITING)


@pytest.fixture(scope="module")
def found(folder: Path) -> Sweep:
    return read_sweep(folder)


def call(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def mean_change(shape: str, gal: int, hertz: int) -> float:
    settings = {made.SHAPE: shape, made.GAL: f"{gal} gal", made.HERTZ: f"{hertz} Hz"}
    return float(np.mean([made.change({**settings, made.SEED: seed}) for seed in (1, 2, 3)]))


def texts(ax: Axes) -> list[str]:
    return [text.get_text() for text in ax.texts]


def ticks(ax: Axes) -> tuple[list[str], list[str]]:
    return [t.get_text() for t in ax.get_xticklabels()], [t.get_text() for t in ax.get_yticklabels()]


def curves(ax: Axes) -> dict[str, list[tuple[float, float]]]:
    """Points of each line that the legend names."""
    return {
        str(line.get_label()): [(float(x), float(y)) for x, y in np.asarray(line.get_xydata())]
        for line in ax.lines
        if not str(line.get_label()).startswith("_")
    }


def bars(ax: Axes) -> int:
    return len(ax.containers)


def best_marks(figure: Figure) -> list[Any]:
    return [one for ax in figure.axes for one in (*ax.patches, *ax.lines) if one.get_gid() == "best"]


# ------------------------------------------------------------------------------------------- map


def test_map_holds_each_mean_where_it_belongs(found: Sweep) -> None:
    _, caption, figure = draw(found, "map")
    disc, ellipse = figure.axes[:2]
    assert [disc.get_title(), ellipse.get_title()] == ["disc", "ellipse"]
    assert (disc.get_xlabel(), disc.get_ylabel()) == ("frequency [Hz]", "amplitude [gal]")
    assert ticks(disc) == (["1", "2", "5"], ["400", "800"])
    want = [[mean_change("disc", gal, hertz) for hertz in (1, 2, 5)] for gal in (400, 800)]
    want[0][0] = np.nan
    np.testing.assert_allclose(np.ma.filled(disc.images[0].get_array(), np.nan), want, rtol=1e-9)
    assert disc.images[0].get_clim() == ellipse.images[0].get_clim()
    assert disc.images[0].get_cmap().name == SEQUENTIAL
    assert disc.get_ylim() == (-0.5, 1.5)  # the larger amplitude on top
    assert texts(disc)[0] == "failed"
    assert texts(disc)[4] == "-0.0161\n± 0.0002 (3)\nbest"
    assert texts(ellipse)[5] == "waiting"
    assert [len([p for p in ax.patches if p.get_hatch()]) for ax in (disc, ellipse)] == [1, 1]
    assert "not distinguishable from ellipse, 800 gal, 2 Hz" in caption


def test_map_frames_the_best_point_once(found: Sweep) -> None:
    (mark,) = best_marks(draw(found, "map")[2])
    assert (mark.get_x() + 0.5 * mark.get_width(), mark.get_y() + 0.5 * mark.get_height()) == pytest.approx((1.0, 1.0))
    assert mark.axes.get_title() == "disc"


def test_map_of_both_signs_is_centred_on_zero(tmp_path: Path) -> None:
    grid = {made.GAL: ("400 gal", "800 gal"), made.HERTZ: ("1 Hz", "5 Hz")}
    folder = made.make_sweep(tmp_path / "signs", grid, change=lambda s: -0.001 if "400" in s[made.GAL] else 0.004)
    figure = draw(read_sweep(folder), "map")[2]
    image = figure.axes[0].images[0]
    assert image.get_cmap().name == DIVERGING
    assert image.get_clim() == pytest.approx((-0.004, 0.004))
    assert texts(figure.axes[0])[:2] == ["-0.0010\nbest", "-0.0010"]


def test_map_of_another_measure(folder: Path, found: Sweep, tmp_path: Path) -> None:
    title, caption, figure = draw(found.by("driven_amplitude"), "map")
    assert title == "Amplitude of the surface at the driving frequency over frequency and amplitude"
    np.testing.assert_allclose(
        np.ma.filled(figure.axes[0].images[0].get_array(), 0.0), [[0, 10, 5], [5, 20, 10]], rtol=1e-6
    )
    assert "Best (largest): disc, 800 gal, 2 Hz" in caption
    with pytest.raises(ScenarioError, match='Did you mean "settlement"'):
        found.by("setlement")
    assert call(folder, "--color", "settlement", "-o", tmp_path / "settlement.png").exit_code == 0
    wrong = call(folder, "--color", "settlement", "--what", "shapes")
    assert "--color has no meaning for --what shapes of a sweep" in str(wrong.exception)


def test_text_in_cells_can_be_read_on_dark_and_light(found: Sweep) -> None:
    ax = draw(found, "map")[2].axes[0]
    colors = {text.get_text().split("\n")[0]: text.get_color() for text in ax.texts}
    assert (colors["-0.0161"], colors["-0.0042"]) == ("white", "black")


def test_map_of_points_that_are_not_in_the_sweep(tmp_path: Path) -> None:
    """Pairs of amplitude and frequency fill a map in part."""
    folder = made.make_sweep(tmp_path / "pairs", {made.GAL: ("400 gal", "800 gal"), made.HERTZ: ("1 Hz", "2 Hz")})
    manifest = read_manifest(folder)
    pairs = SweepAxis((made.GAL, made.HERTZ), (("400 gal", "1 Hz"), ("800 gal", "2 Hz")), "zip")
    members = tuple(one for one in manifest.members if one.name in ("400-1", "800-2"))
    write_manifest(Manifest(**{**vars(manifest), "axes": (pairs,), "members": members}))
    ax = draw(read_sweep(folder), "map")[2].axes[0]
    assert ticks(ax) == (["1", "2"], ["400", "800"])
    assert [text.split("\n")[0] for text in texts(ax)] == ["-0.0021", "not in", "not in", "-0.0162"]


def test_axes_of_a_map_ascend_and_keep_their_units(tmp_path: Path) -> None:
    grid = {"contact.friction": (0.5, 0.1), "grains.count": (1000, 500), "grains.shape": ("disc", "ellipse")}
    figure = draw(read_sweep(made.make_sweep(tmp_path / "other", grid)), "map")[2]
    ax = figure.axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == ("contact.friction", "grains.count", "disc")
    assert ticks(ax) == (["0.1", "0.5"], ["500", "1000"])


def test_shaking_comes_first_on_a_map(tmp_path: Path) -> None:
    grid = {"contact.friction": (0.5, 0.1), made.GAL: ("400 gal", "800 gal"), made.HERTZ: ("1 Hz", "2 Hz")}
    found = read_sweep(made.make_sweep(tmp_path / "three", grid))
    assert [axis.name for axis in plane(found)] == ["frequency", "amplitude"]
    titles = [ax.get_title() for ax in draw(found, "map")[2].axes[:2]]
    assert titles == ["friction 0.5", "friction 0.1"]


def test_one_numeric_axis_is_a_curve_with_bars(tmp_path: Path) -> None:
    grid = {made.GAL: ("800 gal", "400 gal"), made.SHAPE: ("disc", "ellipse"), made.SEED: (1, 2, 3)}
    figure = draw(read_sweep(made.make_sweep(tmp_path / "line", grid)), "map")[2]
    ax = figure.axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("amplitude [gal]", "change of the void ratio (- denser)")
    found = curves(ax)
    assert found.keys() == {"disc", "ellipse"}
    assert [x for x, _ in found["disc"]] == [400.0, 800.0]
    assert bars(ax) == 4
    assert ax.get_xlim() == pytest.approx((376.0, 824.0))
    low, high = ax.get_ylim()
    assert low < -0.0162 < -0.0077 < high
    assert high - low < 0.012
    (mark,) = best_marks(figure)
    assert mark.get_xydata()[0].tolist() == pytest.approx(found["disc"][1])


def test_one_run_a_point_has_no_bars(tmp_path: Path) -> None:
    figure = draw(read_sweep(made.make_sweep(tmp_path / "line", {made.GAL: ("800 gal", "400 gal")})), "map")[2]
    assert bars(figure.axes[0]) == 0


def test_curve_without_points_is_not_in_the_legend(tmp_path: Path) -> None:
    grid = {made.SHAPE: ("disc", "ellipse"), made.HERTZ: ("1 Hz", "2 Hz")}
    _, _, figure = draw(read_sweep(made.make_sweep(tmp_path / "grid", grid, failed=("ellipse-1", "ellipse-2"))), "map")
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["disc"]


def test_axes_of_words_are_side_by_side(tmp_path: Path) -> None:
    grid = {"grains.bond.rolling": (True, False), made.SHAPE: ("disc", "ellipse")}
    ax = draw(read_sweep(made.make_sweep(tmp_path / "words", grid)), "map")[2].axes[0]
    assert ticks(ax)[0] == ["on", "off"]
    assert {label: [x for x, _ in points] for label, points in curves(ax).items()} == {
        "disc": pytest.approx([-0.125, 0.875]),
        "ellipse": pytest.approx([0.125, 1.125]),
    }


def test_map_of_shear_tests_shows_their_peak(tmp_path: Path) -> None:
    def write(path: Path, settings: Any) -> None:
        quasi_static_samples.write_test(path, increments=20, peak=1.0 + settings["contact.friction"])

    grid = {"contact.friction": (0.5, 0.8), "grains.count": (100, 200)}
    title, _, figure = draw(read_sweep(made.make_sweep(tmp_path / "shear", grid, write=write)), "map")
    assert title == "Peak s1/s2 over contact.friction and grains.count"
    np.testing.assert_allclose(figure.axes[0].images[0].get_array(), [[1.5, 1.8], [1.5, 1.8]], atol=1e-3)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------- resonance


def test_resonance_is_over_t1_a_curve_for_each_amplitude_and_shape(found: Sweep) -> None:
    _, caption, figure = draw(found, "resonance")
    top, bottom = figure.axes
    shown = curves(top)
    assert list(shown) == ["disc, 400 gal", "disc, 800 gal", "ellipse, 400 gal", "ellipse, 800 gal"]
    assert np.array(shown["disc, 800 gal"]) == pytest.approx(
        np.array([(0.2 / made.T1, 10.0), (0.5 / made.T1, 20.0), (1.0 / made.T1, 5.0)]), rel=1e-3
    )
    assert len(shown["disc, 400 gal"]) == 2  # all of its runs at 1 Hz failed
    ground = 8.0 / (2.0 * np.pi * 5.0) ** 2
    assert curves(bottom)["disc, 800 gal"][0][1] == pytest.approx(0.010 / ground, rel=1e-6)
    upright = [
        line for line in bottom.lines if np.ptp(np.asarray(line.get_xdata())) == 0.0 and len(line.get_xdata()) == 2
    ]  # type: ignore[arg-type]
    assert [float(np.asarray(line.get_xdata())[0]) for line in upright] == [1.0]
    assert "T = T1" in texts(top)
    assert "tanh(pi h/l)" in caption
    assert bottom.get_xscale() == "log"
    assert top.get_ylim() == pytest.approx((0.0, 21.2))
    low, high = bottom.get_xlim()
    assert low < 0.2 / made.T1 < 1.0 / made.T1 < high < 3.0


def test_resonance_says_what_it_leaves_out(tmp_path: Path) -> None:
    folder = made.make_sweep(tmp_path / "slow", {made.HERTZ: ("1 Hz", "2 Hz", "5 Hz"), made.SEED: (1, 2)})
    import h5py

    for name in ("1-1.h5", "1-2.h5"):
        with h5py.File(folder / name, "a") as file:
            file.attrs["resolved"] = file.attrs["resolved"].replace("1.0 Hz", "0.5 Hz")
    _, caption, figure = draw(read_sweep(folder), "resonance")
    assert "Left out: 2 runs (shaken for less than 3 driving periods of 2 s)." in caption
    assert len(curves(figure.axes[0])["all runs"]) == 2


def test_resonance_bars_are_those_of_seeds(tmp_path: Path) -> None:
    folder = made.make_sweep(tmp_path / "bars", {made.HERTZ: ("1 Hz", "2 Hz"), made.SEED: (1, 2)})
    assert bars(draw(read_sweep(folder), "resonance")[2].axes[0]) == 2


# ------------------------------------------------------------------------------------------- shapes


def test_shapes_stand_side_by_side_before_and_after(found: Sweep) -> None:
    title, _, figure = draw(found, "shapes")
    assert title == "Shapes side by side"
    top, bottom = figure.axes
    assert ticks(bottom)[0] == [f"{gal} gal\n{hertz} Hz" for gal in (400, 800) for hertz in (1, 2, 5)]
    marks = {
        (round(float(line.get_xdata()[0]), 2), line.get_markerfacecolor()): float(line.get_ydata()[0])  # type: ignore[index]
        for line in top.lines
        if line.get_marker() in ("o", "s") and len(line.get_xdata()) == 1  # type: ignore[arg-type]
    }
    place = 4 * 2.5  # of the discs at 800 gal, 2 Hz
    assert marks[round(place - 0.16, 2), "white"] == pytest.approx(0.210)
    after = [y for (x, face), y in marks.items() if x == round(place + 1.16, 2) and face != "white"]
    want = made.PACKED["ellipse"] + mean_change("ellipse", 800, 2)
    assert after == [pytest.approx(want)]
    assert texts(top) == ["failed", "waiting"]
    assert bars(bottom) == 10
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["disc", "ellipse", "packed", "after shaking"]


@pytest.mark.parametrize("name", ["screen", "paper", "paper-wide"])
@pytest.mark.parametrize("what", KINDS)
def test_labels_do_not_run_into_each_other(tmp_path: Path, what: str, name: str) -> None:
    grid = {
        "scenario": ("thesis-discs-400gal-10hz.toml", "thesis-pairs-400gal-10hz.toml"),
        made.GAL: ("400 gal", "800 gal", "1200 gal"),
        made.HERTZ: ("1 Hz", "2 Hz", "5 Hz"),
    }
    with style(name):
        _, _, figure = draw(read_sweep(made.make_sweep(tmp_path / "grid", grid)), what)
        assert clashes(figure) == []


def test_still_surface_is_named_beside_the_axes(found: Sweep) -> None:
    """Where no curve and no line can cross the word."""
    _, _, figure = draw(found, "resonance")
    (still,) = (text for text in figure.axes[0].texts if text.get_text() == "still")
    figure.draw_without_rendering()
    assert still.get_window_extent().x0 > figure.axes[0].bbox.x1


def test_scenarios_are_compared_before_shapes(tmp_path: Path) -> None:
    grid = {made.SHAPE: ("disc", "ellipse"), "scenario": ("loose.toml", "dense.toml")}
    title, _, figure = draw(read_sweep(made.make_sweep(tmp_path / "files", grid)), "shapes")
    assert title == "Scenarios side by side"
    assert ticks(figure.axes[1])[0] == ["disc", "ellipse"]
    assert [t.get_text() for t in figure.legends[0].get_texts()][:2] == ["loose", "dense"]


def test_shapes_of_runs_without_shaking_show_their_main_measure(tmp_path: Path) -> None:
    def write(path: Path, _: Any) -> None:
        quasi_static_samples.write_test(path, increments=20)

    folder = made.make_sweep(tmp_path / "shear", {"boundary.kind": ("walls", "chains")}, write=write)
    title, caption, figure = draw(read_sweep(folder), "shapes")
    assert title == "boundary.kind side by side"
    assert len(figure.axes) == 1
    assert figure.axes[0].get_ylabel() == "peak s1/s2"
    assert caption.startswith("Mean over seeds of the peak s1/s2")


# ------------------------------------------------------------------------------------------- all of them


def test_sections_are_those_that_the_sweep_has(found: Sweep, tmp_path: Path) -> None:
    assert [title for title, _, _ in sections(found)] == [
        "Change of the void ratio over frequency and amplitude",
        "Resonance of the surface",
        "Shapes side by side",
    ]
    assert all(caption.endswith(".") for _, caption, _ in sections(found))
    plain = read_sweep(made.make_sweep(tmp_path / "plain", {made.SEED: (1, 2)}))
    assert sections(plain) == []
    with pytest.raises(ScenarioError, match="vary the frequency"):
        draw(plain, "resonance")


@pytest.mark.parametrize("state", ["failed", "waiting"])
@pytest.mark.parametrize("what", KINDS)
def test_nothing_to_draw_is_one_line(tmp_path: Path, state: str, what: str) -> None:
    names = [made.name_of(one) for one in made.grid(made.GRID)]
    found = read_sweep(made.make_sweep(tmp_path / "none", **{state: names}))  # type: ignore[arg-type]
    assert sections(found) == []
    with pytest.raises(ScenarioError, match="no member of the sweep is done yet"):
        draw(found, what)


def test_sweep_without_shapes_says_what_varies(tmp_path: Path) -> None:
    found = read_sweep(made.make_sweep(tmp_path / "plain", {made.GAL: ("400 gal", "800 gal")}))
    with pytest.raises(ScenarioError, match="neither shapes nor scenarios vary in this sweep, but amplitude"):
        draw(found, "shapes")


# ------------------------------------------------------------------------------------------- command line


def test_render_draws_into_the_folder_or_where_it_is_told(folder: Path, tmp_path: Path) -> None:
    result = call(folder)
    assert result.exit_code == 0, result.exception
    assert result.stdout == f"{folder / 'map.png'}\n"
    assert "Framed: the best point" in result.stderr
    assert (folder / "map.png").stat().st_size > 10_000
    assert isinstance(call(folder).exception, DemError)
    target = tmp_path / "picture.svg"
    assert call(folder / "sweep.toml", "--what", "resonance", "-o", target).exit_code == 0
    assert target.is_file()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--time", "3"), "--time has no meaning for a sweep"),
        (("--grains", "3"), "--grains has no meaning for a sweep"),
        (("--what", "sample"), "unknown kind of picture of a sweep"),
        (("-o", "map.txt"), "must end in"),
    ],
)
def test_render_refuses_what_has_no_meaning(folder: Path, arguments: tuple[str, ...], text: str) -> None:
    result = call(folder, *arguments)
    assert isinstance(result.exception, DemError)
    assert text in str(result.exception)
    assert result.stdout == ""


def test_compare_sends_a_sweep_to_the_report(folder: Path) -> None:
    for path in (folder, folder / "sweep.toml"):
        result = CliRunner().invoke(compare, [str(path)])
        assert isinstance(result.exception, ScenarioError)
        assert f"dem report {path}" in str(result.exception)


def test_pictures_leave_the_report_alone(found: Sweep) -> None:
    before = json.dumps(found.as_dict())
    sections(found)
    assert json.dumps(found.as_dict()) == before
