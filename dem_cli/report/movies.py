"""Films: which frame is shown for how long, and writing them as GIF or, through ffmpeg, as MP4."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dem_cli.errors import ResultsError, ScenarioError
from dem_cli.state import Floats
from dem_cli.whole import whole

Image = npt.NDArray[np.uint8]  # (height, width, 3)

ENDINGS = (".gif", ".mp4")
SLOWEST, FASTEST = 2.0, 25.0  # frames a second, where none are asked for
INCREMENTS_A_SECOND = 10.0  # of quasi-static tests, likewise
RATE = {".gif": 25.0, ".mp4": 30.0}  # of films that follow simulated time [1/s]
GIF_FASTEST = 50.0  # frames a second: browsers slow down what is shorter than two hundredths of a second
LONGEST = 3600.0  # s
PALETTE_FRAMES = 5  # of a GIF, that its colours are taken from
NO_FFMPEG = "no ffmpeg: pip install 'dem-cli[movie]', or write .gif"


@dataclass(frozen=True)
class Reel:
    """What a film shows: frame `shown[k]` of the file during `counts[k]` pictures, of which there are `rate` a second."""

    shown: list[int]
    counts: list[int]
    rate: float

    @property
    def seconds(self) -> float:
        return sum(self.counts) / self.rate


def every_frame(frames: list[int], places: Floats, over_time: bool, fps: float | None) -> Reel:
    """Each of `frames` for 1/fps; by default for as long as it lasts, within limits. places: of the frames [s], or increments."""
    if fps is None:
        typical = float(np.median(np.diff(places))) if len(places) > 1 else 0.0
        fps = float(np.clip(1.0 / typical, SLOWEST, FASTEST)) if typical > 0.0 else SLOWEST
        fps = fps if over_time else INCREMENTS_A_SECOND
    return Reel(list(frames), [1] * len(frames), fps)


def at_speed(frames: list[int], places: Floats, speed: float, rate: float) -> Reel:
    """A film in which `speed` simulated seconds go by in one second: each picture shows the frame that was last then.

    places [s] of `frames`, rising; the last frame is shown for as long as they last in the median.
    """
    typical = float(np.median(np.diff(places))) if len(places) > 1 else 0.0
    ends = np.append(places[1:], places[-1] + max(typical, 1.0 / rate * speed)) - places[0]
    seconds = float(ends[-1]) / speed
    if seconds > LONGEST:
        raise ScenarioError(f"--speed {speed:g}: the film would last {seconds:.3g} s; choose a larger one")
    # The small term keeps a picture whose time is that of a frame from showing the one before.
    edges = np.ceil(ends / speed * rate - 1e-6).astype(np.int64)
    counts = np.diff(edges, prepend=0)
    return Reel([k for k, count in zip(frames, counts, strict=True) if count], [int(c) for c in counts if c], rate)


def check_target(path: Path, force: bool) -> None:
    """ResultsError if `path` would be overwritten without `force`; ScenarioError for an MP4 without ffmpeg."""
    if path.exists() and not force:
        raise ResultsError(f"{path} exists; choose another name with -o or add --force")
    if path.suffix.lower() == ".mp4":
        find_ffmpeg()


def find_ffmpeg() -> str:
    """Of the system, else the one that imageio-ffmpeg brings along. ScenarioError without any."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise ScenarioError(NO_FFMPEG) from None


def write(path: Path, reel: Reel, draw: Callable[[int], Image]) -> None:
    """Draw each frame of the reel and write the film as the ending of `path` says (one of ENDINGS). ResultsError if that is not possible."""
    try:
        with whole(path) as work:
            (_write_mp4 if path.suffix.lower() == ".mp4" else _write_gif)(work, reel, draw)
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror or error}") from None


def _write_gif(path: Path, reel: Reel, draw: Callable[[int], Image]) -> None:
    """All frames in one set of colours, that of some of them, so that nothing flickers."""
    from PIL import Image as Pillow

    chosen = np.unique(np.linspace(0, len(reel.shown) - 1, PALETTE_FRAMES).round().astype(int))
    strip = np.concatenate([draw(reel.shown[k])[::2, ::2] for k in chosen])
    palette = Pillow.fromarray(strip).quantize(256)
    images = [Pillow.fromarray(draw(k)).quantize(palette=palette, dither=Pillow.Dither.NONE) for k in reel.shown]
    # GIF counts in hundredths of a second; ends are rounded, not lengths, so that no error adds up.
    ends = np.round(np.cumsum(reel.counts) * 100.0 / reel.rate).astype(int)
    lengths = [10 * max(int(length), 2) for length in np.diff(ends, prepend=0)]
    images[0].save(path, "GIF", save_all=True, append_images=images[1:], duration=lengths, loop=0)


def _write_mp4(path: Path, reel: Reel, draw: Callable[[int], Image]) -> None:
    """H.264 in the pixel format that browsers play, with the index in front so that playing starts at once."""
    first = _even(draw(reel.shown[0]))
    size = f"{first.shape[1]}x{first.shape[0]}"
    command: list[str] = [
        find_ffmpeg(), "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", f"{reel.rate:.6f}",
        "-i", "-", "-an", "-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(path),
    ]  # fmt: skip

    def pictures() -> Iterator[Any]:
        for n, (k, count) in enumerate(zip(reel.shown, reel.counts, strict=True)):
            data = np.ascontiguousarray(first if n == 0 else _even(draw(k))).data
            for _ in range(count):
                yield data

    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            for data in pictures():
                process.stdin.write(data)
            process.stdin.close()
        except BrokenPipeError:  # it says why below
            pass
        except BaseException:
            process.kill()
            raise
        said = process.stderr.read().decode(errors="replace").strip()
    if process.returncode:
        raise OSError(f"ffmpeg: {said.splitlines()[-1] if said else process.returncode}")


def _even(image: Image) -> Image:
    """Without the last row and column where they are odd: yuv420p holds a colour for every four pixels."""
    return image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2]
