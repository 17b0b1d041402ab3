"""Pictures of shear tests: what is drawn is what the file holds, in percent and kPa, and the peak is marked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import quasi_static_samples as made
import shear_samples as rows_of
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from dem_cli.errors import ScenarioError
from dem_cli.report import shear_curves, shear_forces, shear_page
from dem_cli.report.figures import KINDS, SHEAR_KINDS, Picture, choose_frame, draw
from dem_cli.report.look import style
from dem_cli.report.moments import BOUNDARY, frame_at, frame_box, frames_of_stage
from dem_cli.report.shear_curves import Curve
from dem_cli.report.shear_rows import Rows, stage_rows
from dem_cli.results import Results, open_results

PEAK = 36  # increment of the stage of shearing
FIRST = made.COMPRESSION  # increments before it


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.write_test(tmp_path_factory.mktemp("shear") / "walls.h5", title="Lattice")


@pytest.fixture
def results(path: Path) -> Iterator[Results]:
    with open_results(path) as found:
        yield found


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.write_test(tmp_path_factory.mktemp("ring") / "ring.h5", increments=10, ring=True)


def drawn(results: Results, **asked: Any) -> Figure:
    with style():
        figure = draw(results, Picture(**asked))
        figure.draw_without_rendering()
    return figure


def lines(ax: Axes) -> dict[str, Any]:
    return {str(line.get_label()): line for line in ax.lines}


def dots(ax: Axes) -> list[tuple[float, float]]:
    """Where the black dots are."""
    found = [line for line in ax.lines if line.get_label() == "_peak"]
    assert all(line.get_color() == "black" and line.get_marker() == "o" for line in found)
    return [(float(line.get_xdata()[0]), float(line.get_ydata()[0])) for line in found]  # type: ignore[index]


def panel(draw_it: Callable[[Axes], None]) -> Axes:
    with style():
        figure = Figure()
        ax = figure.add_subplot()
        draw_it(ax)
        figure.draw_without_rendering()
    return ax


def curve_of(rows: Rows, peak: int | None = None, reverses: bool = False, undrained: bool = False) -> Curve:
    return Curve("one", rows, "blue", peak, reverses, undrained)


# ------------------------------------------------------------------------------------------------ all kinds


@pytest.mark.parametrize("what", SHEAR_KINDS)
def test_every_kind_is_drawn(results: Results, what: str) -> None:
    figure = drawn(results, what=what)
    labels = [label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel())]
    if what in ("stress-strain", "coordination", "energy-tensor", "dissipation"):
        assert "shear strain e1 - e2 [%]" in labels
    if what in ("energy-tensor", "dissipation"):
        assert any("[J/m³]" in label for label in labels)
    assert "Lattice" in figure.get_suptitle()


@pytest.mark.parametrize("what", ["sample", "rose", "series", "histories", "trajectories"])
def test_kinds_that_need_no_time_work_as_ever(results: Results, what: str) -> None:
    figure = drawn(results, what=what)
    texts = [label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel())] + [figure.get_suptitle()]
    assert not any("t [s]" in text or "t = " in text for text in texts)


def test_kinds_that_need_time_are_refused(results: Results) -> None:
    for what, word in (("surface", "stress-strain"), ("motion", "stress-strain"), ("energy", "dissipation")):
        with pytest.raises(ScenarioError, match=f"no picture {what}.*{word}"):
            drawn(results, what=what)
    with pytest.raises(ScenarioError, match=r"no time.*--increment"):
        drawn(results, what="sample", time=1.0)
    with pytest.raises(ScenarioError, match="no speed"):
        drawn(results, what="sample", color="speed")


def test_kinds_know_each_other() -> None:
    assert not set(KINDS) & set(SHEAR_KINDS)


def test_stages_without_shear_are_refused(results: Results) -> None:
    with pytest.raises(ScenarioError, match="stage 1 does not shear the sample; choose --stage 2"):
        drawn(results, what="dissipation", stage=1)


# ------------------------------------------------------------------------------------------------ curves


def test_stress_and_volume_over_the_shear_strain(results: Results) -> None:
    rows = stage_rows(results, 2)
    upper, lower = drawn(results, what="stress-strain").axes[:2]
    line = lines(upper)["shear"]
    np.testing.assert_allclose(line.get_xdata(), 100.0 * rows["shear_strain"])
    np.testing.assert_allclose(line.get_ydata(), rows["stress_ratio"])
    np.testing.assert_allclose(lines(lower)["shear"].get_ydata(), 100.0 * rows["volumetric_strain"])
    assert dots(upper) == [(pytest.approx(1.8), pytest.approx(1.75))]
    assert dots(lower) == [(pytest.approx(1.8), pytest.approx(100.0 * rows["volumetric_strain"][PEAK]))]


def test_events_are_strokes_at_their_strain(results: Results) -> None:
    lower = drawn(results, what="stress-strain").axes[1]
    np.testing.assert_allclose(lines(lower)["_events"].get_xdata(), [1.0, 2.0, 3.0])


def test_sine_and_ratio_are_inverse() -> None:
    ratio = np.array([0.5, 1.0, 1.7, 4.0])
    np.testing.assert_allclose(shear_curves._ratio(shear_curves._sine(ratio)), ratio)
    assert shear_curves._sine(np.array([3.0]))[0] == pytest.approx(0.5)


def test_principal_values_and_their_sum(results: Results) -> None:
    rows = stage_rows(results, 2)
    tensors = np.array(
        [[[xx, xy], [xy, yy]] for xx, xy, yy in zip(*(rows[f"energy_{e}"] for e in ("xx", "xy", "yy")), strict=True)]
    )
    small, large = np.linalg.eigvalsh(tensors).T
    ax = drawn(results, what="energy-tensor").axes[0]
    np.testing.assert_allclose(lines(ax)["E1"].get_ydata(), large)
    np.testing.assert_allclose(lines(ax)["E2"].get_ydata(), small)
    np.testing.assert_allclose(lines(ax)["E1 + E2"].get_ydata(), small + large)
    assert len(dots(ax)) == 3
    sums = lines(drawn(results, what="coordination").axes[0])["C1 + C2"].get_ydata()
    np.testing.assert_allclose(sums, rows["coordination"])


def test_principal_values_of_a_turned_tensor() -> None:
    rows = {"t_xx": np.array([2.0]), "t_xy": np.array([1.5]), "t_yy": np.array([-2.0])}
    large, small = shear_curves.principal(rows, "t")
    assert (large[0], small[0]) == (pytest.approx(2.5), pytest.approx(-2.5))


def test_work_and_dissipation_over_the_volume(results: Results) -> None:
    rows = stage_rows(results, 2)
    ax = drawn(results, what="dissipation").axes[0]
    area = rows["width"] * rows["height"]
    friction = rows["friction"] - rows["friction"][0]
    np.testing.assert_allclose(lines(ax)["friction D"].get_ydata(), friction / area / made.DEPTH, rtol=2e-3, atol=1e-12)
    total = sum(lines(ax)[name].get_ydata() for name in ("friction D", "elastic", "released"))
    np.testing.assert_allclose(lines(ax)["work W"].get_ydata(), total, atol=2e-3)


def test_largest_share_over_the_increments(results: Results) -> None:
    rows = stage_rows(results, 2)
    ax = drawn(results, what="largest-share").axes[0]
    np.testing.assert_allclose(ax.lines[0].get_xdata(), np.arange(1, 61))
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 100.0 * rows["largest_share"][1:])
    assert dots(ax) == [(PEAK, pytest.approx(100.0 * rows["largest_share"][PEAK]))]
    np.testing.assert_allclose(lines(ax)["_events"].get_xdata(), [20, 40, 60])


def test_closed_pores_show_path_and_pressure() -> None:
    rows = rows_of.cyclic()
    one = curve_of(rows, reverses=True, undrained=True)
    assert shear_curves.stress_panels([one]) == ["deviator", "path", "water", "strain"]
    path = panel(lambda ax: shear_curves.panel_path(ax, [one]))
    np.testing.assert_allclose(lines(path)["one"].get_xdata(), 1e-3 * rows["mean_stress"])
    np.testing.assert_allclose(lines(path)["one"].get_ydata(), 1e-3 * rows["deviator"])
    assert dots(path) == []
    assert path.get_xlim()[0] == 0.0
    water = panel(lambda ax: shear_curves.panel_water(ax, [one]))
    np.testing.assert_allclose(lines(water)["one"].get_xdata(), rows["in_stage"])
    np.testing.assert_allclose(lines(water)["one"].get_ydata(), 1e-3 * rows["pore_pressure"])


def test_panels_tell_drained_from_undrained() -> None:
    drained, closed = curve_of(rows_of.sheared(), 20), curve_of(rows_of.cyclic(), undrained=True)
    assert shear_curves.stress_panels([drained]) == ["ratio", "volume"]
    assert shear_curves.stress_panels([closed]) == ["deviator", "path", "water", "ratio"]
    assert shear_curves.stress_panels([drained, closed]) == ["ratio", "volume", "path", "water"]
    ax = panel(lambda ax: shear_curves.draw_panel(ax, "volume", [drained, replace(closed, label="closed")]))
    assert "closed" not in lines(ax)


def test_several_stages_are_several_curves(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    one = shear_curves.curve(results, 2)
    monkeypatch.setattr(shear_curves, "curves", lambda *_: [one, replace(one, label="other", colour="red")])
    figure = drawn(results, what="stress-strain")
    assert {"shear", "other"} <= set(lines(figure.axes[0]))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["shear", "other"]


def test_compared_files_are_named(results: Results) -> None:
    with style():
        figure = shear_curves.draw_compared([results] * 9, None)
    drawn_lines = [line for line in figure.axes[0].lines if line.get_label() == "walls"]
    assert len({(line.get_color(), line.get_linestyle()) for line in drawn_lines}) == 9


# ------------------------------------------------------------------------------------------------ forces


def test_rectangles_lie_along_the_forces(results: Results) -> None:
    """Through the contact point, as long as both radii (towards a wall: as one), as wide as the force is large."""
    frame = results.increment(-1)
    c = frame.contacts
    corners = shear_forces.rectangles(frame, largest := shear_forces.largest_force([frame]))
    force = np.stack([c.normal * c.nx - c.shear * c.ny, c.normal * c.ny + c.shear * c.nx], axis=1)
    size = np.hypot(*force.T)
    assert largest == pytest.approx(size.max())
    start, end = corners[:, [0, 3]].mean(axis=1), corners[:, [1, 2]].mean(axis=1)
    axis = end - start
    length = np.hypot(*axis.T)
    np.testing.assert_allclose(axis / length[:, None], force / size[:, None], atol=1e-12)
    np.testing.assert_allclose(length, np.where(c.j < 0, 1.0, 2.0) * made.RADIUS)
    width = np.hypot(*(corners[:, 3] - corners[:, 0]).T)
    np.testing.assert_allclose(width, shear_forces.WIDEST * made.RADIUS * size / size.max())
    to_point = np.column_stack([c.px, c.py]) - start
    np.testing.assert_allclose(to_point[:, 0] * axis[:, 1] - to_point[:, 1] * axis[:, 0], 0.0, atol=1e-12)


def test_fewer_grains_than_walls(tmp_path: Path) -> None:
    """The number of a wall is then no number of a grain from the end either."""
    states = [made.lattice(columns=1, rows=1, number=k, in_stage=k, stage=k // 2, stage_start=k != 1) for k in range(3)]
    with made.open_writer(tmp_path / "one.h5", states[0], tracks=None) as writer:
        for state in states:
            made.write_increment(writer, state)
        writer.finish("done")
    with open_results(tmp_path / "one.h5") as results:
        assert len(shear_forces.rectangles(results.increment(0), 1.0)) == 4
        for what in ("sample", "forces"):
            assert drawn(results, what=what, frame=0).axes


def test_forces_at_start_and_peak_on_one_scale(results: Results) -> None:
    figure = drawn(results, what="forces")
    left, right = figure.axes
    assert left.get_title().startswith("start, increment 4")
    assert right.get_title().startswith(f"peak, increment {FIRST + PEAK}")
    assert left.get_xlim()[1] - left.get_xlim()[0] == pytest.approx(right.get_xlim()[1] - right.get_xlim()[0])
    polygons = [next(c for c in ax.collections if isinstance(c, PolyCollection)) for ax in (left, right)]
    frames = [results.increment(choose_frame(results, Picture(increment=k))) for k in (FIRST, FIRST + PEAK)]
    widest = [max(np.hypot(*(path.vertices[3] - path.vertices[0])) for path in some.get_paths()) for some in polygons]
    forces = [shear_forces.largest_force([frame]) for frame in frames]
    assert widest[0] / widest[1] == pytest.approx(forces[0] / forces[1])
    assert widest[1] == pytest.approx(100.0 * shear_forces.WIDEST * made.RADIUS)  # the largest of both, in cm


def test_walls_are_where_they_are_then(results: Results) -> None:
    ax = drawn(results, what="forces", increment=FIRST + 60).axes[0]
    frame = results.increment(-1)
    assert frame.height < 0.99 * results.increment(0).height
    assert max(float(np.max(line.get_ydata())) for line in ax.lines) == pytest.approx(100.0 * frame.height)


def test_boundary_grains_have_a_tone_of_their_own(ring: Path) -> None:
    with open_results(ring) as results:
        grains = next(c for c in drawn(results, what="forces").axes[0].collections if isinstance(c, EllipseCollection))
        tones = [tuple(tone) for tone in np.asarray(grains.get_facecolors())]
        assert tones.count(to_rgba(BOUNDARY)) == results.boundary
        assert all(tone == to_rgba(BOUNDARY) for tone in tones[-results.boundary :])
        sample = drawn(results, what="sample", color="radius").axes[0]
        discs = next(c for c in sample.collections if isinstance(c, EllipseCollection))
        tones = [tuple(tone) for tone in np.asarray(discs.get_facecolors())]
        assert [tone == to_rgba(BOUNDARY) for tone in tones] == [k >= 20 for k in range(38)]


def test_view_holds_grains_and_walls(results: Results, ring: Path) -> None:
    frame = results.increment(0)
    wide = replace(frame, walls=made.box(1.0, 2.0))
    assert frame_box(wide)[1::2] == (1.0, 2.0)
    assert frame_box(frame) == pytest.approx((0.0, frame.width, 0.0, frame.height), abs=1e-4)
    with open_results(ring) as other:
        g = other.increment(0).grains
        assert frame_box(other.increment(0)) == pytest.approx(
            ((g.x - g.radius).min(), (g.x + g.radius).max(), (g.y - g.radius).min(), (g.y + g.radius).max())
        )


# ------------------------------------------------------------------------------------------------ frames


def test_frames_of_a_stage_begin_with_the_state_it_starts_from(results: Results) -> None:
    """The file holds no frame of its own for the start of the second stage: that is the last of the first."""
    assert frames_of_stage(results, 1).tolist() == list(range(FIRST + 1))
    assert frames_of_stage(results, 2).tolist() == list(range(FIRST, FIRST + 61))


def test_increments_count_from_the_start_of_the_stage_that_is_asked_for(results: Results) -> None:
    assert results.frame_times[frame_at(results, 7, None)] == 7
    assert results.frame_times[frame_at(results, 7, 2)] == FIRST + 7
    with pytest.raises(ScenarioError, match="stage 2 has no increment 61, only 0 to 60"):
        frame_at(results, 61, 2)
    with pytest.raises(ScenarioError, match="the run has no increment -1"):
        frame_at(results, -1, None)


def test_last_frame_of_a_stage(results: Results) -> None:
    assert choose_frame(results, Picture(stage=1)) == FIRST
    assert choose_frame(results, Picture(stage=2)) == FIRST + 60


# ------------------------------------------------------------------------------------------------ roses


def test_roses_are_percent_of_the_whole(results: Results) -> None:
    frame = results.increment(-1)
    for energy in (False, True):
        values = shear_forces.rose(frame, energy=energy)
        assert values.sum() == pytest.approx(100.0)
        np.testing.assert_allclose(values[:18], values[18:])


def test_stiffness_is_that_of_the_springs(results: Results) -> None:
    assert shear_forces.stiffness_of(results.increment(-1)) == pytest.approx((made.KN, made.KT))
    assert shear_forces.stiffness_of(results.increment(0)) == pytest.approx((made.KN, 0.0))


def test_share_within_45_degrees_of_the_axis(results: Results) -> None:
    """Contacts of the lattice are upright or flat, so the rose tells the same."""
    frame = results.increment(-1)
    for energy in (False, True):
        values = shear_forces.rose(frame, energy=energy)
        upright = 2.0 * float(values[9])
        assert shear_forces.within_45(frame, 1, energy=energy) == pytest.approx(upright)
        assert shear_forces.within_45(frame, 0, energy=energy) == pytest.approx(100.0 - upright)


@pytest.mark.parametrize("what", ["normals", "energy-normals"])
def test_bars_of_start_and_peak(results: Results, what: str) -> None:
    figure = drawn(results, what=what)
    for ax, k in zip(figure.axes, (FIRST, FIRST + PEAK), strict=True):
        frame = results.increment(frame_at(results, k, None))
        heights = [patch.get_height() for patch in ax.patches]  # type: ignore[attr-defined]
        np.testing.assert_allclose(heights, shear_forces.rose(frame, energy=what == "energy-normals"))
    assert figure.axes[0].get_ylim() == figure.axes[1].get_ylim()


# ------------------------------------------------------------------------------------------------ ranks


def test_rows_that_are_ranked() -> None:
    assert shear_page.chosen_rows(rows_of.sheared()) == [
        ("first", 1),
        ("turn", 7),
        ("peak", 20),
        ("after the peak", 21),
    ]
    assert [k for _, k in shear_page.chosen_rows(rows_of.cyclic())] == [1, 60, 120, 240]


def test_line_through_a_power_law() -> None:
    """N = 0.5 P^-1.5 gives a and b back, over the contacts that make 99 % of the whole; what is beneath does not move it."""
    n = np.arange(1, 15)
    share = (n / 0.5) ** (-1.0 / 1.5)
    share = share / share.sum()
    found = shear_page.line_of(share)
    assert found is not None
    a = np.log(1.0) + 1.5 * np.log(share[0])
    assert found == pytest.approx((a, -1.5))
    assert shear_page.line_of(np.array([0.6, 0.4])) is None
    heavy = np.append(share * 0.995, [0.003, 0.002, 1e-9])
    bent = shear_page.line_of(heavy)
    assert bent == shear_page.line_of(heavy[:-2])


def test_ranked_contacts_and_the_line_of_the_first(results: Results) -> None:
    figure = drawn(results, what="ranked")
    table = results.dissipation
    assert table is not None
    titles = [ax.get_title() for ax in figure.axes]
    assert titles == ["first, increment 1", "turn, increment 15", "peak, increment 36", "after the peak, increment 37"]
    first = shear_page.line_of(table.share[int(np.flatnonzero(table.increment == FIRST + 1)[0])])
    assert first is not None
    straight = [lines(ax)["first increment"].get_xdata() for ax in figure.axes]
    for ax, k, line in zip(figure.axes, (1, 15, 36, 37), straight, strict=True):
        row = int(np.flatnonzero(table.increment == FIRST + k)[0])
        np.testing.assert_allclose(lines(ax)["contacts"].get_xdata(), 100.0 * table.share[row])
        np.testing.assert_allclose(lines(ax)["contacts"].get_ydata(), np.arange(1, 21))
        np.testing.assert_allclose(line, straight[0])
        np.testing.assert_allclose(first[0] + first[1] * np.log(line / 100.0), np.log([0.7, 28.0]))


def test_nothing_slid(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shear_page, "shares", lambda *_: np.zeros(0))
    with pytest.raises(ScenarioError, match="nothing slides in stage 2"):
        drawn(results, what="ranked")
    assert len(drawn(results, what="paper").axes) > 12


def test_shares_of_an_increment_that_is_not_there() -> None:
    assert len(shear_page.shares(SimpleNamespace(dissipation=None), 3.0)) == 0  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------ the page


def test_the_page_holds_all_panels(results: Results) -> None:
    figure = drawn(results, what="paper")
    assert len([ax for ax in figure.axes if ax.name == "polar"]) == 4
    titles = " ".join(ax.get_title() for ax in figure.axes)
    for part in ("Contact forces: start", "Contact forces: peak", "Normals, peak", "Energy, start", "after the peak"):
        assert part in titles
    labels = " ".join(ax.get_ylabel() for ax in figure.axes)
    for part in ("s1/s2", "volumetric", "contacts per grain", "elastic energy", "energy [J/m³]", "largest share"):
        assert part in labels
