"""Pictures of ellipses, bonded discs and clumps: outlines, axes, bonds and the rose of contact normals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import report_samples as made
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.collections import EllipseCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D
from shape_samples import DENSITY, DEPTH, pairs, shaped, triangles

from dem_cli.analysis.stress import fabric
from dem_cli.errors import ScenarioError
from dem_cli.report import bodies, sample, strokes
from dem_cli.report.figures import Picture, draw
from dem_cli.report.look import style
from dem_cli.report.rose import SECTORS, densities
from dem_cli.report.sample import first_frame_of_stage
from dem_cli.results import Results, open_results
from dem_cli.state import Grains

SHAPES = ("ellipse", "bonded", "clump")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("shapes")
    for shape in SHAPES:
        made.make_file(place / f"{shape}.h5", sample=shaped(shape, 5, 4), interval=0.1, tracks=None)
    return place


@pytest.fixture
def ellipse(folder: Path) -> Iterator[Results]:
    with open_results(folder / "ellipse.h5") as found:
        yield found


@pytest.fixture
def bonded(folder: Path) -> Iterator[Results]:
    with open_results(folder / "bonded.h5") as found:
        yield found


@pytest.fixture
def clump(folder: Path) -> Iterator[Results]:
    with open_results(folder / "clump.h5") as found:
        yield found


def drawn(results: Results, **asked: Any) -> Figure:
    with style():
        return draw(results, Picture(**asked))


def fills(figure: Figure) -> Any:
    (found,) = [c for c in figure.axes[0].collections if type(c) is EllipseCollection]
    return found


def strokes_of(figure: Figure, label: str) -> list[Any]:
    return [c for c in figure.axes[0].collections if type(c) is PathCollection and c.get_label() == label]


def ends_of(lines: Any) -> Any:
    """Ends of drawn lines in the order of their start's x, shape (n, 2, 2) [cm]."""
    ends = np.concatenate([path.vertices.reshape(-1, 2, 2) for path in lines.get_paths()])
    return ends[np.lexsort(ends[:, 0].T)]


def sorted_ends(start: Any, end: Any) -> Any:
    ends = np.stack([start, end], axis=1)
    return ends[np.lexsort(ends[:, 0].T)]


# --------------------------------------------------------------------------------------------- geometry


def test_reach_is_that_of_the_outline() -> None:
    grains = Grains.ellipses(
        np.zeros(4), np.zeros(4), np.array([3.0, 5.0, 2.0, 2.0]), np.array([1.0, 1.0, 2.0, 1.0]), np.array([0.3, -2.0, 1.0, 7.0]),
        DENSITY, DEPTH,
    )  # fmt: skip
    phi = np.linspace(0.0, 2.0 * np.pi, 20001)
    x = grains.a[:, None] * np.cos(phi) * np.cos(grains.angle)[:, None]
    x -= grains.b[:, None] * np.sin(phi) * np.sin(grains.angle)[:, None]
    y = grains.a[:, None] * np.cos(phi) * np.sin(grains.angle)[:, None]
    y += grains.b[:, None] * np.sin(phi) * np.cos(grains.angle)[:, None]
    wide, high = bodies.reach(grains)
    np.testing.assert_allclose(wide, x.max(axis=1), rtol=1e-7)
    np.testing.assert_allclose(high, y.max(axis=1), rtol=1e-7)
    assert wide[2] == grains.a[2]


def test_axes_of_an_ellipse_are_its_own() -> None:
    angle = np.array([-1.5, -0.4, 0.0, 0.7, 1.5, 2.0, 9.0])
    ratio = np.array([1.01, 1.2, 1.5, 2.0, 3.0, 5.0, 1.3])
    b = np.full(7, 0.01)
    found, axis = bodies.axes(Grains.ellipses(np.arange(7.0), np.zeros(7), ratio * b, b, angle, DENSITY, DEPTH))
    np.testing.assert_allclose(found, ratio, rtol=1e-12)
    np.testing.assert_allclose(np.tan(axis), np.tan(angle), rtol=1e-9)
    assert np.all(np.abs(axis) <= 0.5 * np.pi)


def test_axes_of_grains_of_several_discs() -> None:
    """Second moments of two touching discs: 5/2 m r^2 along the line of centres, 1/2 m r^2 across; a triangle has no axis."""
    angle = np.array([0.3, -1.2, 2.5])
    ratio, axis = bodies.axes(pairs(np.arange(3.0), np.ones(3), angle, 0.01)[0])
    np.testing.assert_allclose(ratio, np.sqrt(5.0), rtol=1e-9)
    np.testing.assert_allclose(np.tan(axis), np.tan(np.repeat(angle, 2)), rtol=1e-9)
    ratio, axis = bodies.axes(triangles(np.arange(3.0), np.ones(3), angle, 0.01, 0.008))
    np.testing.assert_allclose(ratio, 1.0, rtol=1e-6)
    assert np.isnan(axis).all()
    ratio, axis = bodies.axes(Grains.discs(np.zeros(2), np.zeros(2), np.ones(2), DENSITY, DEPTH))
    assert ratio.tolist() == [1.0, 1.0]
    assert np.isnan(axis).all()


def test_mean_of_a_body_leaves_single_elements_alone() -> None:
    grains = pairs(np.arange(2.0), np.zeros(2), np.zeros(2), 0.01)[0]
    grains = replace(grains, mass=np.array([1.0, 3.0, 1.0, 1.0]), body=np.array([0, 0, 1, 2]))
    values = np.array([1.0, 2.0, 0.1, 0.3])
    assert bodies.of_bodies(grains, values).tolist() == [1.75, 1.75, 0.1, 0.3]
    rng = np.random.default_rng(1)
    alone = Grains.discs(rng.random(500), rng.random(500), rng.random(500), DENSITY, DEPTH)
    assert np.array_equal(bodies.of_bodies(alone, alone.x), alone.x)


numbers = st.floats(-1.0, 1.0)


@given(st.lists(st.tuples(numbers, numbers, st.floats(0.05, 1.2)), min_size=1, max_size=6))
def test_outline_is_what_lies_in_no_other_disc(discs: list[tuple[float, float, float]]) -> None:
    """Every point of every circle, but for those within 1e-6 of the edge of another disc."""
    x, y, r = np.array(discs).T
    arcs = bodies.open_arcs(x, y, r)
    for k in range(len(x)):
        phi = np.linspace(0.0, 2.0 * np.pi, 181)[:-1] + 1e-4
        px, py = x[k] + r[k] * np.cos(phi), y[k] + r[k] * np.sin(phi)
        others = np.arange(len(x)) != k
        depth = (r[others, None] - np.hypot(px - x[others, None], py - y[others, None])).max(axis=0, initial=-np.inf)
        free = np.zeros(len(phi), dtype=bool)
        for disc, low, high in arcs:
            assert high > low
            if disc == k:
                free |= (phi - low) % (2.0 * np.pi) < high - low
        clear = np.abs(depth) > 1e-6
        assert np.array_equal(free[clear], depth[clear] < 0.0)


def test_the_same_disc_twice_is_one() -> None:
    one = np.zeros(2)
    assert bodies.open_arcs(one, one, one + 1.0) == [(0, 0.0, 2.0 * np.pi)]


def test_curves_are_arcs() -> None:
    """Cubics of 45 deg lie on the circle to 1e-5 of its radius, and go from one end to the other."""
    low, high = np.array([0.3, 5.0, 0.0]), np.array([0.9, 9.0, 2.0 * np.pi])
    points = strokes._curves(low, high)
    assert points.shape == (3, 25, 2)
    np.testing.assert_allclose(points[:, 0], np.stack([np.cos(low), np.sin(low)], axis=1), atol=1e-12)
    np.testing.assert_allclose(points[:, -1], np.stack([np.cos(high), np.sin(high)], axis=1), atol=1e-12)
    p0, p1, p2, p3 = (points[:, k : k + 22 : 3] for k in range(4))
    for t in (0.25, 0.5, 0.8):
        at = (1 - t) ** 3 * p0 + 3 * t * (1 - t) ** 2 * p1 + 3 * t**2 * (1 - t) * p2 + t**3 * p3
        np.testing.assert_allclose(np.hypot(at[..., 0], at[..., 1]), 1.0, atol=1e-5)


# --------------------------------------------------------------------------------------------- the sample


def test_ellipses_are_drawn_turned_and_to_scale(ellipse: Results) -> None:
    """On the page: the ends of both axes of each ellipse, by the scale of the axes."""
    figure = drawn(ellipse, chains=False)
    ax, found = figure.axes[0], fills(figure)
    grains = ellipse.frame(-1).grains
    figure.draw_without_rendering()
    scale = (ax.transData.transform([(1.0, 0.0)]) - ax.transData.transform([(0.0, 0.0)]))[0, 0] / 0.01
    for k, matrix in enumerate(found.get_transforms()):
        local = Affine2D(matrix).transform([(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)]) / scale
        c, s = np.cos(grains.angle[k]), np.sin(grains.angle[k])
        along, across = grains.a[k] * np.array([c, s]), grains.b[k] * np.array([-s, c])
        if grains.a[k] == grains.b[k]:
            along, across = grains.a[k] * np.array([1.0, 0.0]), grains.a[k] * np.array([0.0, 1.0])
        np.testing.assert_allclose(local[0] - local[2], along, atol=1e-3 * grains.a[k])
        np.testing.assert_allclose(local[1] - local[2], across, atol=1e-3 * grains.a[k])
    np.testing.assert_allclose(found.get_offsets() * 0.01, np.stack([grains.x, grains.y], axis=1))
    assert strokes_of(figure, "outlines") == []
    assert set(found.get_linewidths()) == {strokes.EDGE_WIDTH}


@pytest.mark.parametrize("shape", ["bonded", "clump"])
def test_grains_of_several_discs_have_one_outline(folder: Path, shape: str) -> None:
    with open_results(folder / f"{shape}.h5") as results:
        figure = drawn(results, chains=False)
        grains = results.frame(-1).grains
    assert not np.any(fills(figure).get_linewidths())
    (outlines,) = strokes_of(figure, "outlines")
    assert len(outlines.get_paths()) == grains.grain_count
    for body, path in enumerate(outlines.get_paths()):
        of = grains.body == body
        on = path.vertices.reshape(-1, 25, 2)[:, ::3].reshape(-1, 2) * 0.01  # an arc is 8 cubics end to end
        distance = np.hypot(on[:, 0] - grains.x[of][:, None], on[:, 1] - grains.y[of][:, None])
        # On a circle, and in no other disc.
        np.testing.assert_allclose((grains.radius[of][:, None] - distance).max(axis=0), 0.0, atol=1e-12)


def test_escaped_grains_have_no_outline(clump: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = clump.frame(-1)
    monkeypatch.setattr(
        clump, "frame", lambda _: replace(frame, grains=replace(frame.grains, escaped=frame.grains.body == 3))
    )
    figure = drawn(clump)
    (outlines,) = strokes_of(figure, "outlines")
    assert len(outlines.get_paths()) == frame.grains.grain_count - 1
    assert len(fills(figure).get_offsets()) == len(frame.grains) - 3


def test_a_grain_has_one_displacement(bonded: Results) -> None:
    """That of its centre of mass: both discs in one colour."""
    g, g0 = bonded.frame(-1).grains, bonded.frame(first_frame_of_stage(bonded, 1)).grains
    shown = np.asarray(fills(drawn(bonded)).get_array()).reshape(-1, 2)
    np.testing.assert_array_equal(shown[:, 0], shown[:, 1])
    x, y = ((now - then).reshape(-1, 2).mean(axis=1) for now, then in ((g.x, g0.x), (g.y, g0.y)))
    np.testing.assert_allclose(shown[:, 0] / shown.max(), np.hypot(x, y) / np.hypot(x, y).max(), rtol=1e-9)
    speed = np.asarray(fills(drawn(bonded, color="speed")).get_array()).reshape(-1, 2)
    np.testing.assert_array_equal(speed[:, 0], speed[:, 1])


def test_orientation_goes_round(ellipse: Results) -> None:
    figure = drawn(ellipse, color="orientation")
    found, grains = fills(figure), ellipse.frame(-1).grains
    assert (found.norm.vmin, found.norm.vmax) == (-90.0, 90.0)
    values = np.ma.asarray(found.get_array())
    assert np.array_equal(np.ma.getmaskarray(values), grains.a == grains.b)
    turned = grains.a > grains.b
    np.testing.assert_allclose(np.tan(np.radians(values[turned])), np.tan(grains.angle[turned]), rtol=1e-6)
    ends = found.cmap([0.0, 1.0])
    np.testing.assert_allclose(ends[0], ends[1], atol=0.02)  # -90 and 90 deg are the same
    assert np.ptp(found.cmap(np.ma.masked_all(1))[0][:3]) == 0.0  # grey, which the map has not
    assert figure.axes[1].get_ylabel().endswith("[deg]")


def test_aspect_ratio(ellipse: Results, bonded: Results) -> None:
    grains = ellipse.frame(-1).grains
    np.testing.assert_allclose(fills(drawn(ellipse, color="aspect")).get_array(), grains.a / grains.b, rtol=1e-9)
    found = fills(drawn(bonded, color="aspect"))
    np.testing.assert_allclose(found.get_array(), np.sqrt(5.0), rtol=1e-9)
    assert found.norm.vmax - found.norm.vmin > 1e-3  # not the last digits spread over all colours


def test_bodies_are_told_apart(bonded: Results) -> None:
    figure = drawn(bonded, color="body")
    found = fills(figure)
    colours = found.cmap(found.norm(found.get_array())).reshape(-1, 2, 4)
    assert np.array_equal(colours[:, 0], colours[:, 1])
    assert np.all(np.any(colours[1:, 0] != colours[:-1, 0], axis=1))
    assert len(figure.axes) == 1  # numbers need no bar


def test_chains_run_between_centres_of_grains(clump: Results) -> None:
    frame = clump.frame(-1)
    g, c = frame.grains, frame.contacts
    assert c is not None
    lines = strokes_of(drawn(clump, chains=True), "chains")[0]
    centre = np.stack([values.reshape(-1, 3).mean(axis=1) for values in (g.x, g.y)], axis=1)
    kept = c.normal > 0.02 * np.percentile(c.normal, 99.5)
    start = centre[g.body[c.i]]
    end = np.where((c.j < 0)[:, None], np.stack([c.px, c.py], axis=1), centre[g.body[c.j]])
    found, want = ends_of(lines), sorted_ends(start[kept], end[kept])
    assert {tuple(np.round(line.ravel(), 9)) for line in found} == {
        tuple(np.round(line.ravel() / 0.01, 9)) for line in want
    }


def test_bonds_are_drawn_where_grains_are_large_enough(bonded: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    g, bonds = bonded.frame(-1).grains, bonded.bonds
    (bars,) = strokes_of(drawn(bonded), "bonds")
    places = np.stack([g.x, g.y], axis=1) / 0.01
    np.testing.assert_allclose(ends_of(bars), sorted_ends(places[bonds.i], places[bonds.j]))
    assert strokes_of(drawn(bonded, bonds=False), "bonds") == []
    monkeypatch.setattr(sample, "SMALL_RADIUS", 1000.0)
    assert strokes_of(drawn(bonded), "bonds") == []
    assert len(strokes_of(drawn(bonded, bonds=True), "bonds")) == 1


def test_bars_of_a_clump_meet_at_its_centre(clump: Results, ellipse: Results) -> None:
    g = clump.frame(-1).grains
    (bars,) = strokes_of(drawn(clump), "bonds")
    places = np.stack([g.x, g.y], axis=1) / 0.01
    np.testing.assert_allclose(
        ends_of(bars), sorted_ends(places, np.repeat(places.reshape(-1, 3, 2).mean(axis=1), 3, axis=0))
    )
    assert strokes_of(drawn(ellipse, bonds=True), "bonds") == []


@pytest.mark.parametrize("shape", SHAPES)
def test_marks_show_how_elements_are_turned(folder: Path, shape: str) -> None:
    with open_results(folder / f"{shape}.h5") as results:
        assert strokes_of(drawn(results), "marks") == []
        (marks,) = strokes_of(drawn(results, marks=True), "marks")
        g = results.frame(-1).grains
    start = np.stack([g.x, g.y], axis=1)
    end = start + g.a[:, None] * np.stack([np.cos(g.angle), np.sin(g.angle)], axis=1)
    np.testing.assert_allclose(ends_of(marks), sorted_ends(start, end) / 0.01)


# ----------------------------------------------------------------------------------------------- the rose


def test_densities_count_both_ways() -> None:
    angle = np.array([0.01, np.pi / 2 + 0.01, np.pi / 2 + 0.02, -np.pi / 2 + 0.03])
    found = densities(np.cos(angle), np.sin(angle))
    want = np.zeros(SECTORS)
    want[[0, SECTORS // 2]] = 1.0
    want[[SECTORS // 4, 3 * SECTORS // 4]] = 3.0
    np.testing.assert_allclose(found, want * SECTORS / 8.0)
    even = np.linspace(0.0, 2.0 * np.pi, 10 * SECTORS, endpoint=False) + 1e-6
    np.testing.assert_allclose(densities(np.cos(even), np.sin(even)), 1.0)


def test_rose_shows_contacts_between_grains_and_their_fabric(ellipse: Results) -> None:
    contacts = ellipse.frame(-1).contacts
    assert contacts is not None
    between = contacts.j >= 0
    assert not between.all()
    figure = drawn(ellipse, what="rose")
    ax = figure.axes[0]
    heights = np.array([bar.get_height() for bar in ax.patches])
    np.testing.assert_allclose(heights, densities(contacts.nx[between], contacts.ny[between]))
    tensor = fabric(contacts)
    curve, large, small = ax.lines
    theta, radius = curve.get_data()
    # What the fabric tensor alone tells, by its definition: n . D n with D = 4 (F - I/4), 1 where F = I/2.
    n = np.stack([np.cos(theta), np.sin(theta)])
    np.testing.assert_allclose(radius, 4.0 * np.einsum("ik,ij,jk->k", n, tensor, n) - 1.0, atol=1e-12)
    for line, value in ((large, np.linalg.eigvalsh(tensor)[1]), (small, np.linalg.eigvalsh(tensor)[0])):
        d = np.array([np.cos(line.get_xdata()[0]), np.sin(line.get_xdata()[0])])
        np.testing.assert_allclose(tensor @ d, value * d, atol=1e-12)
    assert f"{np.count_nonzero(between)} contacts" in figure.get_supxlabel()


def test_no_contact_no_rose(ellipse: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = ellipse.frame(-1)
    contacts = frame.contacts
    assert contacts is not None
    lonely = replace(contacts, j=np.full(len(contacts), -1))
    monkeypatch.setattr(ellipse, "frame", lambda _: replace(frame, contacts=lonely))
    with pytest.raises(ScenarioError, match="do not touch"):
        drawn(ellipse, what="rose")
