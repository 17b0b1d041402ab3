"""Pictures of bodies in 3D: polygons are where the bodies are, the near hides the far, another question gives another picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import impulse_runs as made
import numpy as np
import pytest
from click.testing import CliRunner, Result
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from picture_checks import clashes
from PIL import Image
from scene_samples import axis_angle, bodies_at, box_shape, container, pair_shape, planes_of, scene_of

from dem_cli.cli import main
from dem_cli.errors import ScenarioError
from dem_cli.report.camera import Camera, Paint, faces
from dem_cli.report.figures import Picture, draw
from dem_cli.report.impulse_figures import ALL_KINDS
from dem_cli.report.look import style
from dem_cli.report.pieces import cut_lines, grid_lines, grid_step, lowered, piece
from dem_cli.report.scene3d import view_of
from dem_cli.report.solids import icosphere, sharp_edges, solid_of, subdivided
from dem_cli.results import BodyResults, open_results
from dem_cli.rigid import Terrain


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs")
    made.rockfall_file(path / "rocks.h5", n=8)
    made.drop_file(path / "drop.h5", duration=1.0)
    made.pile_file(path / "pile.h5")
    return path


@pytest.fixture
def rocks(folder: Path) -> Iterator[BodyResults]:
    with opened(folder / "rocks.h5") as results:
        yield results


def opened(path: Path) -> BodyResults:
    results = open_results(path)
    assert isinstance(results, BodyResults)
    return results


def drawn(results: BodyResults, **asked: Any) -> Figure:
    with style():
        return draw(results, Picture(**asked))


def pixels(figure: Figure, folder: Path) -> np.ndarray[Any, Any]:
    with style():
        figure.savefig(folder / "picture.png", dpi=40)
    return np.asarray(Image.open(folder / "picture.png").convert("RGB"), dtype=float)


def polygons(figure: Figure) -> PolyCollection:
    (found,) = [c for c in figure.axes[0].collections if c.get_label() == "bodies"]
    assert isinstance(found, PolyCollection)
    return found


def dem(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(part) for part in arguments])


# ------------------------------------------------------------------------------------------------ camera and solids


def test_camera_keeps_lengths_and_right_hands() -> None:
    camera = Camera.at(-62.0, 24.0)
    axes = np.stack([camera.right, camera.up, camera.toward])
    assert axes @ axes.T == pytest.approx(np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)
    front = Camera.at(-90.0, 0.0)  # x to the right, z up, y away
    assert front.screen(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, 3.0])
    assert front.depth(np.array([1.0, 2.0, 3.0])) == pytest.approx(-2.0)
    above = Camera.at(-90.0, 90.0)
    assert above.screen(np.array([1.0, 2.0, 3.0])) == pytest.approx([1.0, 2.0])


def test_icosphere_is_a_closed_sphere() -> None:
    points, triangles = icosphere(2)
    assert (len(points), len(triangles)) == (162, 320)
    assert np.linalg.norm(points, axis=1) == pytest.approx(np.ones(162))
    a, b, c = (points[triangles[:, k]] for k in range(3))
    assert np.einsum("tk,tk->t", np.cross(a, b), c).sum() / 6.0 == pytest.approx(4.0 / 3.0 * np.pi, rel=0.04)
    assert (np.einsum("tk,tk->t", np.cross(b - a, c - a), a) > 0.0).all()


def test_solid_of_a_box_has_its_surface_and_twelve_edges() -> None:
    shape = box_shape((2.0, 1.0, 3.0))
    solid = solid_of(shape, 2)
    across = np.cross(solid.triangles[:, 1] - solid.triangles[:, 0], solid.triangles[:, 2] - solid.triangles[:, 0])
    assert 0.5 * np.linalg.norm(across, axis=1).sum() == pytest.approx(22.0)
    assert (np.einsum("tk,tk->t", across, solid.normals) > 0.0).all()
    volume = (
        np.einsum("tk,tk->t", solid.triangles[:, 0], np.cross(solid.triangles[:, 1], solid.triangles[:, 2])).sum() / 6.0
    )
    assert volume == pytest.approx(6.0)
    assert np.linalg.norm(solid.edges[:, 1] - solid.edges[:, 0], axis=1).sum() == pytest.approx(4 * 6.0)
    assert np.linalg.norm(solid.triangles - np.roll(solid.triangles, 1, axis=1), axis=2).max() <= 0.45 * shape.reach
    edges, beside = sharp_edges(shape.vertices, shape.triangles, np.array([[0.0, 0, 1]] * 12))
    assert (len(edges), len(beside)) == (0, 0)  # where no face turns there is none


def test_solid_of_a_clump_and_of_a_cloud() -> None:
    pair = solid_of(pair_shape(0.5), 1)
    assert len(pair.triangles) == 160
    assert np.abs(pair.triangles[..., 0]).max() == pytest.approx(1.0)
    cube = box_shape((1.0, 1.0, 1.0))
    none = np.empty((0, 3))
    cloud = replace(cube, kind="cloud", points=cube.vertices, vertices=none, triangles=none.astype(np.int64))
    hull = solid_of(cloud, 1)
    area = (
        0.5
        * np.linalg.norm(
            np.cross(hull.triangles[:, 1] - hull.triangles[:, 0], hull.triangles[:, 2] - hull.triangles[:, 0]), axis=1
        ).sum()
    )
    assert area == pytest.approx(6.0)
    assert np.einsum("tk,tk->t", hull.normals, hull.triangles.mean(axis=1)).min() > 0.4


def test_subdivision_keeps_the_area() -> None:
    corners = np.array([[[0.0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0.0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]]])
    cut, owner = subdivided(corners, 1.5)
    area = 0.5 * np.linalg.norm(np.cross(cut[:, 1] - cut[:, 0], cut[:, 2] - cut[:, 0]), axis=1)
    assert np.bincount(owner, area) == pytest.approx([8.0, 0.005])
    assert np.bincount(owner).tolist() == [16, 1]


def test_faces_that_look_away_are_left_out_and_the_near_comes_last() -> None:
    camera = Camera.at(-90.0, 0.0)
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    corners = np.stack([triangle, triangle + np.array([0, -5.0, 0]), triangle])
    normals = np.array([[0, -1.0, 0], [0, -1.0, 0], [0, 1.0, 0]])
    paint = Paint.together([faces(camera, corners, normals, np.eye(3))])
    assert paint.depth == pytest.approx([0.0, 5.0])
    assert paint.face[1, 1] > 0.5 > paint.face[1, 0]  # the green one, near


def test_grid() -> None:
    assert (grid_step(10.0), grid_step(0.12), grid_step(3.0)) == (1.0, 0.01, 0.5)
    edge = np.array([[0.5, 0, 0], [2.5, 0, 0], [2.5, 1, 0], [0.5, 1, 0]])
    lines = grid_lines(edge, np.array([0.0, 0, 1]), 1.0)
    assert np.unique(lines[lines[:, 0, 0] == lines[:, 1, 0]][:, 0, 0]).tolist() == [1.0, 2.0]


def test_planes_are_cut_where_they_meet() -> None:
    """A floor and an upright wall through its middle: half of each is left."""
    planes = planes_of(("floor", [0, 0, 0], [0, 0, 1]), ("wall", [0, 0, 0], [1, 0, 0]))
    assert piece(planes, 0)[:, 0].min() == pytest.approx(0.0)
    assert piece(planes, 0)[:, 0].max() == pytest.approx(1.0)
    assert piece(planes, 1)[:, 2].min() == pytest.approx(0.0)
    lines = cut_lines(grid_lines(planes.edge[0], planes.normal[0], 0.5), planes, 0)
    assert (lines[..., 0].min(), lines[..., 0].max()) == (pytest.approx(0.0), pytest.approx(1.0))
    assert len(lines) == 5 + 3  # across, and those along at 0, 0.5 and 1
    apart = planes_of(("floor", [0, 0, 0], [0, 0, 1]), ("over it", [0, 0, 5], [0, 0, 1]))
    assert len(piece(apart, 0)) == 4  # nothing would be left


def test_walls_end_a_little_over_the_bodies() -> None:
    planes = container(4.0, 3.0, height=50.0)
    low = lowered(planes, 2.0)
    assert low.edge[:4, :, 2].max() == 2.0
    assert np.array_equal(low.edge[4], planes.edge[4])
    assert np.array_equal(lowered(planes, -1.0).edge, planes.edge)  # walls that begin above stay


# ------------------------------------------------------------------------------------------------ the scene


def test_polygons_lie_where_the_bodies_are(tmp_path: Path) -> None:
    """A turned box and a pair, from the front: their outline on the page is that of their corners and spheres."""
    shapes = (box_shape((2.0, 1.0, 1.0)), pair_shape(0.5))
    q = [axis_angle([0, 1, 0], np.radians(30.0)), [1.0, 0, 0, 0]]  # the end at +x goes down
    bodies = bodies_at([[0, 0, 3], [5, 0, 1]], shapes, [0, 1], q=q)
    path = made.write_run(
        tmp_path / "a.h5", scene_of(bodies, shapes), [(0.0, bodies), (0.1, bodies)], dt=0.1, every=(1, 1, 1)
    )
    with opened(path) as results:
        found = polygons(drawn(results, what="scene", view=(-90.0, 0.0)))
    corners = np.concatenate([p.vertices for p in found.get_paths()])
    box = corners[corners[:, 0] < 2.5]
    right, up = np.sqrt(0.75) + 0.25, 0.5 + 0.5 * np.sqrt(0.75)
    assert (box.min(axis=0), box.max(axis=0)) == (pytest.approx([-right, 3 - up]), pytest.approx([right, 3 + up]))
    assert box[np.argmax(box[:, 0])] == pytest.approx([right, 3 - 0.5 + 0.5 * np.sqrt(0.75)])
    pair = corners[corners[:, 0] > 2.5]
    assert (pair.min(axis=0), pair.max(axis=0)) == (
        pytest.approx([4.0, 0.5], abs=0.01),
        pytest.approx([6.0, 1.5], abs=0.01),
    )


def test_the_near_body_hides_the_far_one(tmp_path: Path) -> None:
    shapes = (box_shape((1.0, 1.0, 1.0), "far"), box_shape((2.0, 1.0, 2.0), "near"))
    for name, y in (("front", -3.0), ("behind", 3.0)):
        bodies = bodies_at([[0, 0, 0], [0, y, 0]], shapes, [0, 1])
        made.write_run(
            tmp_path / f"{name}.h5", scene_of(bodies, shapes), [(0.0, bodies), (0.1, bodies)], dt=0.1, every=(1, 1, 1)
        )
    middle = []
    for name in ("front", "behind"):
        with opened(tmp_path / f"{name}.h5") as results:
            figure = drawn(results, view=(-90.0, 0.0))
            image = pixels(figure, tmp_path)
            at = figure.axes[0].transData.transform((0.0, 0.0)) / figure.dpi * 40
            middle.append(image[image.shape[0] - 1 - int(at[1]), int(at[0]) + 2])
    far, near = (np.array([0.55, 0.82, 0.78]) * 255, np.array([0.99, 0.86, 0.55]) * 255)
    assert np.abs(middle[0] / middle[0].max() - near / near.max()).max() < 0.1
    assert np.abs(middle[1] / middle[1].max() - far / far.max()).max() < 0.1


def test_escaped_bodies_are_not_drawn(rocks: BodyResults) -> None:
    assert rocks.frame(-1).bodies.escaped.sum() == 1
    assert len(view_of(rocks, [0]).window) == 4
    before, after = (len(polygons(drawn(rocks, what="scene", frame=k)).get_paths()) for k in (0, -1))
    assert after < before - 10


def test_a_body_on_the_terrain_is_before_it(tmp_path: Path) -> None:
    """Wherever it lies on coarse triangles its top is seen."""
    shapes = (box_shape((0.5, 0.5, 0.2)),)
    field = Terrain(
        "field", np.array([[0.0, 0, 0], [16, 0, 0], [16, 16, 0], [0, 16, 0]]), np.array([[0, 1, 2], [0, 2, 3]]), 1
    )
    level = [[x, y, 0.1] for x in np.arange(1.0, 16.0, 1.3) for y in np.arange(1.0, 16.0, 1.7)]
    bodies = bodies_at(level, shapes)
    path = made.write_run(
        tmp_path / "a.h5",
        scene_of(bodies, shapes, None, field),
        [(0.0, bodies), (0.1, bodies)],
        dt=0.1,
        every=(1, 1, 1),
    )
    with opened(path) as results:
        figure = drawn(results, what="scene", color="kind")
        image = pixels(figure, tmp_path)
        camera = Camera.at(-62.0, 24.0)
        for place in level:
            at = figure.axes[0].transData.transform(camera.screen(np.add(place, [0, 0, 0.1]))) / figure.dpi * 40
            found = image[image.shape[0] - 1 - round(at[1]), round(at[0])]
            assert np.ptp(found / found.max()) > 0.12, place  # earth is nearly grey


def test_chains_lead_to_the_floor(folder: Path) -> None:
    with opened(folder / "pile.h5") as results:
        figure = drawn(results, what="scene", chains=True)
    (lines,) = [c for c in figure.axes[0].collections if c.get_label() == "chains"]
    segments = sum(len(p.vertices) // 2 for p in lines.get_paths())
    assert segments == 36
    assert "mean normal forces" in figure._supxlabel.get_text()


@pytest.mark.parametrize("what", ALL_KINDS)
def test_another_question_gives_another_picture(folder: Path, tmp_path: Path, what: str) -> None:
    name = "drop" if what == "check" else "rocks"
    with opened(folder / f"{name}.h5") as results:
        image = pixels(drawn(results, what=what), tmp_path)
    assert image.std() > 5.0


def test_colours_and_views_differ(rocks: BodyResults, tmp_path: Path) -> None:
    seen = set()
    asked: list[dict[str, Any]] = [{}, {"frame": 0}, {"view": (30.0, 60.0)}, {"chains": True}]
    asked += [
        {"color": name}
        for name in ("id", "speed", "spin", "kinetic", "displacement", "rotation", "height", "mass", "coordination")
    ]
    for question in asked:
        seen.add(pixels(drawn(rocks, what="scene", **{"frame": 5, **question}), tmp_path).tobytes())
    assert len(seen) == len(asked)


# ------------------------------------------------------------------------------------------------ curves


def test_check_shows_both_velocities(folder: Path) -> None:
    with opened(folder / "drop.h5") as results:
        ax = drawn(results, what="check").axes[0]
        tracks = results.tracks
    assert tracks is not None
    lines = {line.get_label(): line for line in ax.lines}
    assert np.array_equal(np.asarray(lines["body 0"].get_ydata()), tracks.arrays["vz"][:, 0])
    closed = np.asarray(lines["closed form"].get_ydata())
    assert closed.min() == pytest.approx(-np.sqrt(2.0 * made.G * 0.6), rel=2e-3)


def test_runout_counts_all_bodies(rocks: BodyResults) -> None:
    ax = drawn(rocks, what="runout").axes[0]
    assert sum(patch.get_height() for patch in ax.patches) == 8.0


def test_shares_at_one_place_do_not_hide_each_other(folder: Path) -> None:
    """As of one body, whose way is that of 50 and of 90 percent."""
    with opened(folder / "drop.h5") as results:
        assert clashes(drawn(results, what="runout")) == []


def test_trajectories_begin_and_end_where_the_bodies_do(rocks: BodyResults) -> None:
    left, right = drawn(rocks, what="trajectories").axes
    ways = [line for line in left.lines if str(line.get_label()).startswith("No.")]
    assert [str(line.get_label()) for line in ways] == ["No. 0", "No. 1", "No. 2", "No. 7"]
    for line, k in zip(ways, (0, 1, 2, 7), strict=True):
        start, end = (rocks.frame(n).bodies.x[k] for n in (0, -1))
        assert (line.get_xdata()[0], line.get_xdata()[-1]) == pytest.approx((start[0], end[0]))  # type: ignore[index]
    assert len(right.lines) == 3 * 4 + 1  # with the terrain's profile


def test_what_a_file_has_not_is_one_line(rocks: BodyResults) -> None:
    for asked, words in (
        ({"what": "rose"}, "no picture rose; choose from scene"),
        ({"what": "scene", "color": "radius"}, 'unknown quantity of a body "radius"'),
        ({"what": "series", "series": ["depth"]}, 'unknown series "depth"'),
        ({"what": "scene", "increment": 3}, "with --time"),
        ({"what": "check"}, "no closed form is known"),
        ({"what": "histories", "grains": [99]}, "has no body 99, only 0 to 7"),
        ({"what": "scene", "stage": 7}, "stage 7 is none of its 1"),
    ):
        with pytest.raises(ScenarioError, match=words.replace("[", r"\[")):
            drawn(rocks, **asked)


# ------------------------------------------------------------------------------------------------ the command


def test_command_draws_pictures_and_animations(folder: Path, tmp_path: Path) -> None:
    done = dem("render", folder / "pile.h5", "-o", tmp_path / "a.png", "--dpi", 30, "--view", "20,30")
    assert (done.exit_code, done.stdout.strip()) == (0, str(tmp_path / "a.png"))
    done = dem("render", folder / "pile.h5", "-o", tmp_path / "a.gif", "--dpi", 30, "--color", "speed")
    assert done.exit_code == 0, done.stderr
    with Image.open(tmp_path / "a.gif") as image:
        assert (image.format, image.n_frames, image.info["duration"]) == ("GIF", 3, 100)  # type: ignore[attr-defined]
    assert "exists" in dem("render", folder / "pile.h5", "-o", tmp_path / "a.gif").stderr
    for arguments, words in (
        (["--view", "20"], "write azimuth and elevation"),
        (["--view", "0,95"], "between -90 and 90"),
        (["--what", "energy", "--view", "0,9"], "--view has no meaning for --what energy"),
        (["-o", str(tmp_path / "b.gif"), "--last"], "an animation shows all frames"),
    ):
        refused = dem("render", folder / "pile.h5", *arguments)
        assert refused.exit_code == 2, arguments
        assert words in refused.stderr


def test_planes_are_drawn_on_the_side_of_the_bodies(tmp_path: Path) -> None:
    """A wall behind the bodies is a pale piece under them, one before them an outline over them."""
    shapes = (box_shape((1.0, 1.0, 1.0)),)
    bodies = bodies_at([[0, 0, 0]], shapes)
    planes = planes_of(("behind", [0, 2, 0], [0, -1, 0]), ("before", [0, -2, 0], [0, 1, 0]))
    path = made.write_run(
        tmp_path / "a.h5", scene_of(bodies, shapes, planes), [(0.0, bodies), (0.1, bodies)], dt=0.1, every=(1, 1, 1)
    )
    with opened(path) as results:
        ax = drawn(results, view=(-90.0, 0.0)).axes[0]
    below = [c for c in ax.collections if isinstance(c, PolyCollection) and c.get_label() != "bodies"]
    assert [c.get_zorder() for c in below] == [0]
    assert [line.get_zorder() for line in ax.lines] == [3]
