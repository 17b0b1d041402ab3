"""Pictures: what is drawn is what the file holds, to scale, and another question gives another picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import report_samples as made
from matplotlib.collections import EllipseCollection, LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.transforms import Affine2D

from dem_cli.errors import DemError, ResultsError, ScenarioError
from dem_cli.report import sample, strokes
from dem_cli.report.figures import KINDS, Picture, choose_frame, choose_window, draw
from dem_cli.report.look import axis_label, check_target, display_unit, extension, save, style
from dem_cli.report.sample import QUANTITIES, first_frame_of_stage
from dem_cli.results import Results, StoredFrame, open_results


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make_file(tmp_path_factory.mktemp("run") / "run.h5", interval=0.05)


@pytest.fixture
def results(path: Path) -> Iterator[Results]:
    with open_results(path) as found:
        yield found


def drawn(results: Results, **asked: Any) -> Figure:
    with style():
        return draw(results, Picture(**asked))


def pixels(results: Results, folder: Path, **asked: Any) -> np.ndarray[Any, Any]:
    with style():
        save(draw(results, Picture(**asked)), folder / "picture.png", 50)
    return np.asarray(imread(folder / "picture.png"))


def collections(figure: Figure, kind: type) -> list[Any]:
    return [c for c in figure.axes[0].collections if type(c) is kind]


# ------------------------------------------------------------------------------------------------ files


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_formats(results: Results, tmp_path: Path, ending: str) -> None:
    """Each is what its ending says, and the same question gives the same bytes."""
    head = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[ending]
    with style():
        for name in ("a", "b"):
            save(draw(results, Picture()), tmp_path / f"{name}.{ending}", 40)
    data = (tmp_path / f"a.{ending}").read_bytes()
    assert data.startswith(head)
    assert len(data) > 5000
    assert data == (tmp_path / f"b.{ending}").read_bytes()


def test_another_question_gives_another_picture(results: Results, tmp_path: Path) -> None:
    asked: list[dict[str, Any]] = [
        {},
        {"color": "rotation"},
        {"chains": False},
        *({"what": what} for what in KINDS if what != "sample"),
        {"what": "series", "series": ("mode1",)},
    ]
    seen: dict[bytes, dict[str, Any]] = {}
    for question in asked:
        image = pixels(results, tmp_path, **question)
        assert image[..., :3].std() > 0.02, question
        key = image.tobytes()
        assert key not in seen, (question, seen.get(key))
        seen[key] = question


def test_target_is_checked(tmp_path: Path) -> None:
    there = tmp_path / "a.png"
    there.write_text("")
    with pytest.raises(ResultsError, match="exists"):
        check_target(there, force=False)
    check_target(there, force=True)
    check_target(tmp_path / "b.PDF", force=False)
    with pytest.raises(ScenarioError, match="must end in"):
        check_target(tmp_path / "b.gif", force=True)


def test_picture_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with style(), pytest.raises(ResultsError, match="cannot be written"):
        save(Figure(), tmp_path / "nowhere" / "a.png", 50)


# --------------------------------------------------------------------------------------------- the sample


def test_discs_are_drawn_to_scale(results: Results) -> None:
    """On the page each disc has its own diameter and place, by the scale of both axes."""
    figure = drawn(results, chains=False)
    ax = figure.axes[0]
    (discs,) = collections(figure, EllipseCollection)
    frame = results.frame(-1)
    factor = 0.01 if "cm" in ax.get_xlabel() else 1.0
    figure.draw_without_rendering()
    origin, right, up = ax.transData.transform([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    assert right[0] - origin[0] == pytest.approx(up[1] - origin[1])
    outline = discs.get_paths()[0]
    boxes = [outline.transformed(Affine2D(matrix)).get_extents() for matrix in discs.get_transforms()]
    diameter = np.array([box.width for box in boxes]) / (right[0] - origin[0]) * factor
    np.testing.assert_allclose(diameter, 2.0 * frame.grains.radius, rtol=1e-3)
    np.testing.assert_allclose(discs.get_offsets() * factor, np.stack([frame.grains.x, frame.grains.y], axis=1))


def test_one_disc_covers_its_area(results: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted in pixels: all discs but one are taken away, and pi r^2 is left."""
    alone = results.frame(-1)
    index = 40
    keep = np.zeros(len(alone.grains), dtype=bool)
    keep[index] = True
    lonely = replace(alone, grains=replace(alone.grains, escaped=~keep), contacts=None)
    monkeypatch.setattr(results, "frame", lambda _: lonely)
    figure = drawn(results, color="radius", chains=False)
    ax = figure.axes[0]
    for line in ax.lines:
        line.set_visible(False)
    figure.axes[1].set_visible(False)
    ax.set_axis_off()
    figure.suptitle("")
    with style():
        save(figure, tmp_path / "one.png", 200)
    image = imread(tmp_path / "one.png")
    dark = float((1.0 - image[..., :3].min(axis=2) > 0.1).sum())
    scale = ax.transData.transform([(1.0, 0.0)])[0, 0] - ax.transData.transform([(0.0, 0.0)])[0, 0]
    radius = alone.grains.radius[index] / 0.01 * scale * 200 / figure.dpi
    assert dark == pytest.approx(np.pi * radius**2, rel=0.05)


def test_values_of_the_quantities(results: Results) -> None:
    frame, begin = results.frame(-1), results.frame(first_frame_of_stage(results, 1))
    g, g0, s = frame.grains, begin.grains, frame.stress
    assert begin.time == made.SETTLED
    want = {
        "radius": g.radius,
        "id": g.id,
        "speed": np.sqrt(g.vx**2 + g.vy**2),
        "spin": g.spin,
        "displacement": np.sqrt((g.x - g0.x) ** 2 + (g.y - g0.y) ** 2),
        "displacement_x": g.x - g0.x,
        "displacement_y": g.y - g0.y,
        "rotation": g.angle - g0.angle,
        "coordination": frame.coordination,
        "pressure": (s[:, 0] + s[:, 3]) / 2,
        "shear_stress": np.sqrt(((s[:, 0] - s[:, 3]) / 2) ** 2 + ((s[:, 1] + s[:, 2]) / 2) ** 2),
        "stress_xx": s[:, 0],
        "stress_yy": s[:, 3],
        "stress_xy": (s[:, 1] + s[:, 2]) / 2,
    }
    assert set(want) | {"body", "aspect", "orientation"} == set(QUANTITIES)  # those: tests/test_render_shapes.py
    for name, values in want.items():
        figure = drawn(results, color=name, chains=False)
        (discs,) = collections(figure, EllipseCollection)
        shown = np.asarray(discs.get_array())
        ratio = shown[np.argmax(np.abs(shown))] / values[np.argmax(np.abs(values))]
        np.testing.assert_allclose(shown, values * ratio, rtol=1e-9, atol=1e-12 * np.abs(shown).max())
        unit = axis_label("", display_unit(QUANTITIES[name].unit, float(np.abs(values).max()))[1]).strip()
        assert figure.axes[1].get_ylabel().endswith(unit)
        assert ratio == pytest.approx(1.0 / display_unit(QUANTITIES[name].unit, float(np.abs(values).max()))[0])


def test_escaped_grains_are_not_drawn(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = results.frame(-1)
    gone = np.zeros(len(frame.grains), dtype=bool)
    gone[[3, 9]] = True
    far = replace(frame.grains, escaped=gone, x=np.where(gone, 100.0, frame.grains.x))
    monkeypatch.setattr(results, "frame", lambda _: replace(frame, grains=far))
    figure = drawn(results)
    (discs,) = collections(figure, EllipseCollection)
    assert len(discs.get_offsets()) == len(frame.grains) - 2
    assert figure.axes[0].get_xlim()[1] < 50.0


def test_walls_without_end_leave_the_picture(results: Results) -> None:
    ax = drawn(results).axes[0]
    left, floor, right = (line.get_xydata() for line in ax.lines)
    width = results.width / 0.01
    np.testing.assert_allclose(np.sort(floor[:, 0]), [0.0, width])
    np.testing.assert_allclose(floor[:, 1], 0.0)
    for wall, place in ((left, 0.0), (right, width)):
        np.testing.assert_allclose(wall[:, 0], place)
        assert wall[:, 1].min() == 0.0
        assert ax.get_ylim()[1] < wall[:, 1].max() < np.inf


def test_chains_join_the_centres_as_wide_as_the_force(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = results.frame(-1)
    c = frame.contacts
    assert c is not None
    monkeypatch.setattr(strokes, "MOST_PATHS", 10**6)  # a path for each contact
    figure = drawn(results, chains=True)
    _, lines = collections(figure, PathCollection)
    widest = np.percentile(c.normal, 99.5)
    kept = np.flatnonzero(c.normal > 0.02 * widest)
    paths, widths = lines.get_paths(), np.asarray(lines.get_linewidths())
    assert len(paths) == len(kept)
    figure.draw_without_rendering()
    across = figure.axes[0].transData.transform([(0.0, 0.0), (1.0, 0.0)])[:, 0]
    mean_radius = frame.grains.radius.mean() / 0.01 * (across[1] - across[0]) * 72.0 / figure.dpi
    assert widths.max() == pytest.approx(min(mean_radius, 5.0), rel=0.1)
    order = kept[np.argsort(c.normal[kept], kind="stable")]
    np.testing.assert_allclose(widths / widths.max(), np.minimum(c.normal[order] / widest, 1.0), rtol=1e-9)
    for k, contact in enumerate(order):
        i, j = c.i[contact], c.j[contact]
        end = (c.px[contact], c.py[contact]) if j < 0 else (frame.grains.x[j], frame.grains.y[j])
        ends = np.array([(frame.grains.x[i], frame.grains.y[i]), end]) / 0.01
        np.testing.assert_allclose(paths[k].vertices, ends)
    caption = figure.get_supxlabel()
    assert f"{widest / 1000:.3g} kN" in caption


def test_paths_are_gathered_but_none_is_lost(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    single = collections(drawn(results, chains=True), PathCollection)[1]
    monkeypatch.setattr(strokes, "MOST_PATHS", 7)
    figure = drawn(results, chains=True)
    lines = collections(figure, PathCollection)[1]
    assert len(lines.get_paths()) <= 7
    count = sum(len(p.vertices) for p in lines.get_paths())
    assert count == sum(len(p.vertices) for p in single.get_paths())


def test_small_grains_have_no_chains_unless_asked_for(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(collections(drawn(results), PathCollection)) == 2
    assert collections(drawn(results, chains=False), PathCollection) == []
    monkeypatch.setattr(sample, "SMALL_RADIUS", 1000.0)
    assert collections(drawn(results), PathCollection) == []
    (lines,) = collections(drawn(results, chains=True), PathCollection)
    normal = results.frame(-1).contacts.normal  # type: ignore[union-attr]
    assert sum(len(p.vertices) for p in lines.get_paths()) == 2 * int((normal > normal.mean()).sum())


def test_colour_limits(results: Results) -> None:
    for name, limits in (("displacement", (0.0, 0.02)), ("spin", (-0.1, 0.3))):
        (discs,) = collections(drawn(results, color=name, limits=limits), EllipseCollection)
        scale = display_unit(QUANTITIES[name].unit, max(map(abs, limits)))[0]
        assert (discs.norm.vmin, discs.norm.vmax) == pytest.approx((limits[0] / scale, limits[1] / scale))
    (discs,) = collections(drawn(results, color="rotation"), EllipseCollection)
    assert discs.norm.vmin == -discs.norm.vmax
    (discs,) = collections(drawn(results, color="coordination"), EllipseCollection)
    colours = {tuple(discs.cmap(discs.norm(value))) for value in range(7)}
    assert len(colours) == 7


@pytest.mark.parametrize(("color", "value"), [("speed", 0.0), ("spin", np.nan), ("radius", 3.0), ("coordination", 0.0)])
def test_one_value_for_all_grains(
    results: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, color: str, value: float
) -> None:
    def same(frame: StoredFrame, _: StoredFrame) -> np.ndarray[Any, Any]:
        return np.full(len(frame.grains), value)

    monkeypatch.setitem(QUANTITIES, color, replace(QUANTITIES[color], values=same))
    (discs,) = collections(drawn(results, color=color), EllipseCollection)
    assert discs.norm.vmax > discs.norm.vmin
    assert pixels(results, tmp_path, color=color).std() > 0.02


def test_title_tells_time_and_stage(results: Results, tmp_path: Path) -> None:
    figure = drawn(results, frame=1)
    assert "t = 1 s, stage 2 (shake)" in figure.get_suptitle()
    cut = made.make_file(tmp_path / "cut.h5", stop_after=3.0, interval=0.1, title="50 $_^ and 100 $ 二次元")
    with open_results(cut) as other:
        title = drawn(other).get_suptitle()
        assert title.startswith("50 $_^ and 100 $")
        assert title.endswith("incomplete run")
        assert pixels(other, tmp_path).std() > 0.02


# --------------------------------------------------------------------------------- pictures over time


def test_histories_are_displacements_from_the_start_of_the_stage(results: Results) -> None:
    tracks = results.tracks
    assert tracks is not None
    inside = tracks.time >= made.SETTLED
    figure = drawn(results, what="histories", grains=(77, 3))
    panels = [ax for ax in figure.axes if ax.get_title()]
    assert [ax.get_title() for ax in panels] == ["No. 77", "No. 3"]
    twins = [ax for ax in figure.axes if not ax.get_title()]
    for panel, twin, column in zip(panels, twins, (2, 0), strict=True):
        factor = {"cm": 0.01, "mm": 0.001}[figure.axes[0].get_ylabel()[-3:-1]]
        for line, name, scale in (
            (panel.lines[0], "x", factor),
            (panel.lines[1], "y", factor),
            (twin.lines[0], "angle", np.pi / 180),
        ):
            values = tracks.arrays[name][inside][:, column]
            np.testing.assert_allclose(line.get_ydata() * scale, values - values[0], atol=1e-12)
            np.testing.assert_array_equal(line.get_xdata(), tracks.time[inside])
    assert panels[0].get_ylim() == panels[1].get_ylim()
    assert twins[0].get_ylim() == twins[1].get_ylim()


def test_trajectories_share_one_scale(results: Results) -> None:
    figure = drawn(results, what="trajectories")
    panels = [ax for ax in figure.axes if ax.get_title()]
    assert len(panels) == 4
    spans = {(round(float(np.ptp(ax.get_xlim())), 9), round(float(np.ptp(ax.get_ylim())), 9)) for ax in panels}
    assert len(spans) == 1
    for ax in panels:
        (lines,) = [c for c in ax.collections if isinstance(c, LineCollection)]
        points = np.concatenate(lines.get_segments())
        assert points[:, 0].min() >= ax.get_xlim()[0]
        assert points[:, 1].max() <= ax.get_ylim()[1]


def test_too_many_tracks_are_said(tmp_path: Path) -> None:
    path = made.make_file(tmp_path / "many.h5", tracks=tuple(range(15)), interval=0.1)
    with open_results(path) as many:
        for what in ("histories", "trajectories"):
            figure = drawn(many, what=what)
            assert sum(bool(ax.get_title()) for ax in figure.axes) == 12
            assert "first 12 of 15" in figure.get_suptitle()


def test_series_are_those_of_the_file(results: Results) -> None:
    names = {"void_ratio": 1.0, "kinetic": 1.0, "mode1": 0.001}
    figure = drawn(results, what="series", series=tuple(names))
    for ax, (name, factor) in zip(figure.axes, names.items(), strict=True):
        np.testing.assert_allclose(ax.lines[0].get_ydata() * factor, results.series[name])
    assert figure.axes[2].get_ylabel() == "mode1 [mm]"
    assert figure.axes[1].get_ylabel() == "kinetic [J]"
    figure = drawn(results, what="series", series=("void_ratio",), stage=1)
    assert figure.axes[0].lines[0].get_xdata()[-1] == made.SETTLED


def test_series_without_a_value_says_so(results: Results) -> None:
    figure = drawn(results, what="series", series=("fabric_xy",))
    assert any("not defined" in text.get_text() for text in figure.axes[0].texts)


@pytest.mark.parametrize("stage", [None, 1, 2])
def test_energy_stack_reaches_what_was_put_in(results: Results, stage: int | None) -> None:
    """Top of the stack = the dashed line, as the made ledger has no residual."""
    figure = drawn(results, what="energy", stage=stage)
    (line,) = figure.axes[0].lines
    top = figure.axes[0].collections
    highest = max(float(area.get_paths()[0].vertices[:, 1].max()) for area in top if area.get_label()[0] != "_")
    assert highest == pytest.approx(line.get_ydata().max(), rel=1e-9)
    last = [area.get_paths()[0].vertices for area in top if area.get_label()[0] != "_"][-1]
    at_end = last[last[:, 0] == last[:, 0].max(), 1].max()
    assert at_end == pytest.approx(line.get_ydata()[-1], rel=1e-9)


def test_surface_is_its_rise_since_the_start(results: Results) -> None:
    figure = drawn(results, what="surface")
    mesh = figure.axes[0].collections[0]
    inside = results.surface.time >= made.SETTLED
    rise = results.surface.eta[inside] - results.surface.eta[inside][0]
    shown = np.ma.asarray(mesh.get_array())
    assert shown[0].mask.all()  # the bin that is NaN in the file
    np.testing.assert_allclose(shown[1:] * 0.01, rise.T[1:], atol=1e-12)
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata() * 0.001, results.series["mode1"][inside])


# -------------------------------------------------------------------------------------- what is chosen


@pytest.mark.parametrize(
    ("asked", "time"),
    [
        ({}, 5.0),
        ({"frame": 0}, 0.0),
        ({"frame": -2}, 4.0),
        ({"time": 2.4}, 2.0),
        ({"time": 2.6}, 3.0),
        ({"stage": 1}, 1.0),
        ({"stage": 2}, 5.0),
        ({"stage": 0}, 5.0),
    ],
)
def test_frame_that_is_chosen(results: Results, asked: dict[str, Any], time: float) -> None:
    assert results.frame_times[choose_frame(results, Picture(**asked))] == pytest.approx(time)


@pytest.mark.parametrize(
    ("asked", "window"),
    [
        ({"what": "series"}, (0.0, 5.0)),
        ({"what": "energy"}, (0.0, 5.0)),
        ({"what": "surface"}, (1.0, 5.0)),
        ({"what": "histories"}, (1.0, 5.0)),
        ({"what": "histories", "stage": 1}, (0.0, 1.0)),
        ({"what": "surface", "stage": 0}, (0.0, 5.0)),
    ],
)
def test_window_that_is_chosen(results: Results, asked: dict[str, Any], window: tuple[float, float]) -> None:
    assert choose_window(results, Picture(**asked))[0] == pytest.approx(window)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"what": "serie"}, 'Did you mean "series"'),
        ({"color": "presure"}, 'Did you mean "pressure"'),
        ({"what": "series", "series": ("void_ration",)}, 'Did you mean "void_ratio"'),
        ({"time": 5.2}, "0 s to 5 s"),
        ({"time": -1.0}, "0 s to 5 s"),
        ({"frame": 6}, "0 to 5"),
        ({"frame": -7}, "0 to 5"),
        ({"stage": 3}, "1 to 2"),
        ({"what": "histories", "grains": (4,)}, "only of 3, 50, 77, 120"),
        ({"limits": (1.0, 1.0)}, "must be the larger"),
    ],
)
def test_mistakes_are_one_clear_line(results: Results, asked: dict[str, Any], words: str) -> None:
    with pytest.raises(DemError) as caught:
        drawn(results, **asked)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_what_the_file_lacks_is_said(tmp_path: Path) -> None:
    bare = made.make_file(tmp_path / "bare.h5", tracks=None, stop_after=0.05, interval=0.1, frames=1)
    with open_results(bare) as found:
        with pytest.raises(ScenarioError, match=r"\[output\] tracks"):
            drawn(found, what="trajectories")
        with pytest.raises(ScenarioError, match="fewer than two rows"):
            drawn(found, what="energy")
    nothing = made.make_file(tmp_path / "nothing.h5", stop_after=-1.0)
    with open_results(nothing) as found:
        with pytest.raises(ScenarioError, match="no frames"):
            drawn(found)
        with pytest.raises(ScenarioError, match="no tracks"):
            drawn(found, what="histories")


@pytest.mark.parametrize(
    ("unit", "largest", "shown"),
    [
        ("m", 2.0, (1.0, "m")),
        ("m", 0.2, (0.01, "cm")),
        ("m", 0.004, (0.001, "mm")),
        ("m", 0.0009, (0.001, "mm")),
        ("m", 1e-9, (1e-6, "µm")),
        ("Pa", 2500.0, (1e3, "kPa")),
        ("m/s^2", 4.0, (1.0, "m/s^2")),
        ("m", 0.0, (1.0, "m")),
        ("m", np.nan, (1.0, "m")),
        ("1", 5.0, (1.0, "")),
    ],
)
def test_units_that_read_well(unit: str, largest: float, shown: tuple[float, str]) -> None:
    assert display_unit(unit, largest) == shown


def test_arrows_of_the_colour_bar() -> None:
    values = np.array([0.0, 1.0])
    assert extension(values, 0.0, 1.0) == "neither"
    assert extension(values, 0.1, 1.0) == "min"
    assert extension(values, 0.0, 0.9) == "max"
    assert extension(values, 0.1, 0.9) == "both"
    assert extension(np.empty(0), 0.0, 1.0) == "neither"
