"""Animations: which frame is shown for how long, on the same scales throughout, in files that others play."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quasi_static_samples as quasi
import report_samples as made
import scene_samples as scenes
from click.testing import CliRunner, Result
from matplotlib.collections import EllipseCollection
from PIL import Image

from dem_cli.cli.render import command
from dem_cli.errors import DemError, ResultsError, ScenarioError
from dem_cli.report import movies
from dem_cli.report.animation import frames_of, pixels, save_animation
from dem_cli.report.figures import Picture, draw
from dem_cli.report.look import style
from dem_cli.report.movies import Reel, at_speed, every_frame, find_ffmpeg, write
from dem_cli.report.sample import Look
from dem_cli.report.sample_film import SampleFilm
from dem_cli.results import Results, open_results

imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("runs")
    made.make_file(root / "time.h5", interval=0.1, columns=5, rows=6, tracks=None, frames=11)
    quasi.write_test(root / "increment.h5")
    scenes.write_all(root / "bodies.h5")
    return root


@pytest.fixture
def results(folder: Path) -> Iterator[Results]:
    with open_results(folder / "time.h5") as found:
        yield found


def call(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def probe(path: Path) -> tuple[int, tuple[int, int], str, float]:
    """Pictures, size, pixel format and rate of a film, as ffmpeg tells."""
    said = subprocess.run([find_ffmpeg(), "-hide_banner", "-i", str(path)], capture_output=True, text=True, check=False)
    found = re.search(r"Video: h264.*?, (yuv\w+).*?, (\d+)x(\d+).*?, ([\d.]+) fps", said.stderr)
    assert found, said.stderr
    count, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    return count, (int(found.group(2)), int(found.group(3))), found.group(1), float(found.group(4))


# ------------------------------------------------------------------------------------------------ reels


def test_every_frame_is_shown_once() -> None:
    assert every_frame([3, 4, 5], np.array([0.0, 0.1, 0.2]), True, None) == Reel(
        [3, 4, 5], [1, 1, 1], pytest.approx(10.0)
    )
    assert every_frame([0, 1], np.array([0.0, 0.001]), True, None).rate == 25.0
    assert every_frame([0, 1], np.array([0.0, 9.0]), True, None).rate == 2.0
    assert every_frame([0, 1], np.array([0.0, 9.0]), False, None).rate == 10.0
    assert every_frame([0, 1], np.array([0.0, 9.0]), False, 3.0).rate == 3.0
    assert every_frame([0], np.array([0.0]), True, None).counts == [1]


def test_time_goes_by_at_the_speed_asked_for() -> None:
    """Frames that lie apart unevenly are shown for as long as they last; the last for the median."""
    places = np.array([1.0, 1.1, 1.5, 1.6])
    reel = at_speed([0, 1, 2, 3], places, 0.5, 30.0)
    assert reel.counts == [6, 24, 6, 6]
    assert reel.seconds == pytest.approx((places[-1] - places[0] + 0.1) / 0.5)
    twice = at_speed([0, 1, 2, 3], places, 1.0, 30.0)
    assert twice.counts == [3, 12, 3, 3]


def test_frames_too_short_to_be_seen_are_left_out() -> None:
    reel = at_speed(list(range(101)), np.linspace(0.0, 1.0, 101), 1.0, 30.0)
    assert len(reel.shown) == sum(reel.counts) == 31
    assert reel.shown[0] == 0
    assert reel.shown[-1] == 100 or reel.shown[-1] >= 98
    for n, k in enumerate(reel.shown):
        assert k == int(np.floor(n / 30.0 * 100.0 + 1e-6))


def test_a_film_of_hours_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"--speed 0\.0001: the film would last"):
        at_speed([0, 1], np.array([0.0, 1.0]), 1e-4, 30.0)


def test_frames_of_a_stage(folder: Path) -> None:
    with open_results(folder / "time.h5") as results:
        assert frames_of(results, None) == list(range(11))
        assert frames_of(results, 2) == [k for k in range(11) if results.frame_stages[k] == 1]
    with open_results(folder / "increment.h5") as results:
        chosen = frames_of(results, 2)
        assert results.frame_times[chosen[0]] == results.stages[1].start


# ------------------------------------------------------------------------------------------------ what is drawn


def test_scales_are_the_same_in_all_frames_and_hold_all(results: Results) -> None:
    with style():
        film = SampleFilm(results, list(range(11)), Look(color="speed"), 50.0)
        ax = film.ax
        limits = ax.get_xlim(), ax.get_ylim()
        factor = 0.01 if "cm" in ax.get_xlabel() else 1.0
        everything = [results.frame(k).grains for k in range(11)]
        assert limits[1][1] * factor >= max(float((g.y + g.radius).max()) for g in everything)
        assert limits[0][1] * factor >= max(float((g.x + g.radius).max()) for g in everything)
        norm = film._sight.colors.norm
        speeds = np.concatenate([np.hypot(g.vx, g.vy) for g in everything]) / film._sight.colors.scale
        assert norm.vmax == pytest.approx(np.percentile(speeds, 99.5))
        film.image(3)
        assert (ax.get_xlim(), ax.get_ylim()) == limits
        assert film._sight.colors.norm is norm


def test_a_frame_of_a_film_is_the_picture_of_that_frame(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a stage of one frame the scales are the same, so that all pixels are; the grains are those of the file."""
    with style():
        single = SampleFilm(results, [10], Look(color="rotation", marks=True), 60.0)
        still = pixels(draw(results, Picture(what="sample", color="rotation", marks=True)), 60.0)
        shown = single.image(10)
        assert shown.shape == still.shape
        assert np.abs(shown.astype(int) - still).max() <= 1
        film = SampleFilm(results, list(range(11)), Look(), 60.0)
        seen: list[Any] = []
        original = EllipseCollection.draw

        def watch(self: Any, renderer: Any) -> None:
            seen.append(np.asarray(self.get_offsets()))
            original(self, renderer)

        monkeypatch.setattr(EllipseCollection, "draw", watch)
        factor = 0.01 if "cm" in film.ax.get_xlabel() else 1.0
        for k in (2, 7):
            film.image(k)
            g = results.frame(k).grains
            np.testing.assert_allclose(seen[-1] * factor, np.column_stack([g.x, g.y]))
        assert len(seen) == 2
        assert film.figure.get_suptitle().endswith(f"t = {results.frame_times[7]:g} s, stage 2 (shake)")


def test_nothing_is_left_from_one_frame_to_the_next(results: Results) -> None:
    with style():
        film = SampleFilm(results, list(range(11)), Look(marks=True), 50.0)
        first, other, again = film.image(4).copy(), film.image(9).copy(), film.image(4)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


# ------------------------------------------------------------------------------------------------ files


@pytest.mark.parametrize("name", ["time", "increment", "bodies"])
def test_mp4_plays_anywhere(folder: Path, tmp_path: Path, name: str) -> None:
    """As many pictures as frames, even sizes, the pixel format of browsers, and the index before the data."""
    with open_results(folder / f"{name}.h5") as results:
        frames = results.n_frames
    stage = ("--stage", 2) if name == "increment" else ()
    target = tmp_path / "a.mp4"
    result = call(folder / f"{name}.h5", "-o", target, "--dpi", 41, "--fps", 8, *stage)
    assert result.exit_code == 0, result.exception
    count, (width, height), layout, rate = probe(target)
    if stage:
        with open_results(folder / f"{name}.h5") as results:
            frames = len(frames_of(results, 2))
    assert count == frames
    assert width % 2 == height % 2 == 0
    assert layout == "yuv420p"
    assert rate == 8.0
    data = target.read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")
    assert f"{frames} frames, {frames / 8:.3g} s" in result.stderr
    assert result.stdout == f"{target}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


def test_mp4_holds_what_was_drawn(tmp_path: Path) -> None:
    """Grey levels one after the other, an odd size, and repeated pictures."""
    write(tmp_path / "a.mp4", Reel([10, 120, 230], [1, 3, 2], 5.0), lambda k: np.full((41, 63, 3), k, dtype=np.uint8))
    assert probe(tmp_path / "a.mp4")[:2] == (6, (62, 40))
    raw = subprocess.run(
        [
            find_ffmpeg(),
            "-loglevel",
            "error",
            "-i",
            str(tmp_path / "a.mp4"),
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgb24",
            "-",
        ],
        capture_output=True,
        check=True,
    ).stdout
    levels = np.frombuffer(raw, dtype=np.uint8).reshape(6, -1).mean(axis=1)
    assert levels == pytest.approx([10, 120, 120, 120, 230, 230], abs=4)


def test_gif_shows_frames_for_their_time(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "a.gif"
    assert call(folder / "time.h5", "-o", target, "--dpi", 40, "--speed", 2).exit_code == 0
    with Image.open(target) as image:
        assert image.n_frames == 11
        lengths = []
        for k in range(image.n_frames):
            image.seek(k)
            lengths.append(image.info["duration"])
    assert lengths[0] == pytest.approx(250, abs=30)  # half a second of the run at twice its speed
    assert sum(lengths) == pytest.approx(11 * 250, abs=40)


def test_colours_of_a_gif_are_those_of_the_picture(tmp_path: Path) -> None:
    color = np.array([(200, 30, 40), (20, 90, 160), (250, 250, 250)], dtype=np.uint8)
    write(tmp_path / "a.gif", Reel([0, 1, 2], [1, 1, 1], 10.0), lambda k: np.broadcast_to(color[k], (20, 30, 3)).copy())
    with Image.open(tmp_path / "a.gif") as image:
        for k in range(3):
            image.seek(k)
            assert np.abs(np.asarray(image.convert("RGB"), dtype=int) - color[k]).max() <= 2


def test_film_of_a_stage_is_shorter(folder: Path, tmp_path: Path) -> None:
    with open_results(folder / "time.h5") as results, style():
        reel = save_animation(results, Picture(stage=2), tmp_path / "a.gif", dpi=30.0)
        assert reel.shown == frames_of(results, 2)


def test_no_ffmpeg_is_one_line(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    result = call(folder / "time.h5", "-o", tmp_path / "a.mp4")
    assert isinstance(result.exception, ScenarioError)
    assert str(result.exception) == "no ffmpeg: pip install 'dem-cli[movie]', or write .gif"
    assert list(tmp_path.iterdir()) == []


def test_ffmpeg_that_fails_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "ffmpeg"
    broken.write_text(
        "#!/bin/sh\nfor last; do :; done; echo half > \"$last\"\necho 'Unknown encoder libx264' >&2\nexit 1\n"
    )
    broken.chmod(0o755)
    monkeypatch.setattr(movies, "find_ffmpeg", lambda: str(broken))
    picture = np.zeros((2000, 1000, 3), dtype=np.uint8)
    with pytest.raises(ResultsError, match=r"a\.mp4: cannot be written: ffmpeg: Unknown encoder libx264"):
        write(tmp_path / "a.mp4", Reel([0], [5], 10.0), lambda _: picture)
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


def test_system_ffmpeg_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: f"/somewhere/{name}")
    assert find_ffmpeg() == "/somewhere/ffmpeg"


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("time", ["-o", "a.gif", "--what", "energy"], "energy does not move"),
        ("time", ["-o", "a.mp4", "--time", "1"], "an animation shows all frames"),
        ("increment", ["-o", "a.mp4", "--increment", "1"], "an animation shows all frames"),
        ("time", ["-o", "a.mp4", "--fps", "5", "--speed", "1"], "exclude each other"),
        ("time", ["-o", "a.gif", "--fps", "60"], "50 frames a second at most"),
        ("time", ["-o", "a.png", "--fps", "5"], "--fps and --speed are for animations"),
        ("increment", ["-o", "a.gif", "--speed", "1"], "has no time; choose --fps"),
        ("time", ["-o", "a.gif", "--style", "paper"], "for pictures on a page"),
        ("time", ["-o", "a.gif", "--stage", "9"], "stage 9 is none of its 2"),
        ("increment", ["-o", "a.gif", "--color", "speed"], "a quasi-static test has no speed"),
        ("bodies", ["-o", "a.gif", "--what", "check"], "check does not move"),
    ],
)
def test_mistakes_are_one_line(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, options: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = call(folder / f"{name}.h5", *options)
    assert isinstance(result.exception, DemError)
    assert result.exception.exit_code == 2
    assert words in str(result.exception)
    assert "\n" not in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_a_film_is_not_overwritten_unasked(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "a.gif"
    target.write_text("mine")
    assert isinstance(call(folder / "time.h5", "-o", target).exception, ResultsError)
    assert target.read_text() == "mine"
    assert call(folder / "time.h5", "-o", target, "--force", "--dpi", 30).exit_code == 0
    assert target.read_bytes().startswith(b"GIF89a")


def test_a_folder_that_is_not_there_is_one_line(folder: Path, tmp_path: Path) -> None:
    for ending in ("gif", "mp4"):
        result = call(folder / "time.h5", "-o", tmp_path / "nowhere" / f"a.{ending}", "--dpi", 30)
        assert isinstance(result.exception, ResultsError)
        assert "cannot be written" in str(result.exception)
