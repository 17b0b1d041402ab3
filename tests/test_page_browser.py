"""The page in a browser: it plays, it can be used by keyboard and pointer, and it tells the file's numbers."""

from __future__ import annotations

import base64
import io
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quasi_static_samples as shear
import report_samples as made
import scene_samples as solid
from PIL import Image
from shape_samples import shaped

from dem_cli.report.page.build import player_of
from dem_cli.report.page.model import Note, Page, Section
from dem_cli.report.page.render import write_page
from dem_cli.report.quantities import QUANTITIES
from dem_cli.report.sample import first_frame_of_stage
from dem_cli.results import open_results

webdriver = pytest.importorskip("selenium.webdriver")
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402
from selenium.webdriver.support.ui import WebDriverWait  # noqa: E402

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
CHROMEDRIVER = shutil.which("chromedriver")
PATIENCE = 20  # s
SI = {
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "µm": 1e-6,
    "m/s": 1.0,
    "mm/s": 1e-3,
    "µm/s": 1e-6,
    "deg": np.pi / 180.0,
    "Pa": 1.0,
    "kPa": 1e3,
    "": 1.0,
}
SI["rad/s"] = 1.0


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if CHROMIUM is None or CHROMEDRIVER is None:
        missing = "chromium" if CHROMIUM is None else "chromedriver"
        if os.environ.get("CI") == "true":
            pytest.fail(f"{missing} is not on PATH; CI has to try the page in a browser")
        pytest.skip(f"{missing} is not on PATH")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--window-size=1200,1000",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(CHROMEDRIVER))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Result files and the pages of their players: grains (a file of 11 frames), pairs, ellipses, clumps, bodies and a shear test."""
    folder = tmp_path_factory.mktemp("pages")
    made.make_file(folder / "single.h5", interval=0.05, frames=1, tracks=None)
    made.make_file(folder / "grains.h5", interval=0.05, frames=11, tracks=None, title="Grains <by> formula")
    for shape in ("bonded", "ellipse", "clump"):
        made.make_file(folder / f"{shape}.h5", sample=shaped(shape, 6, 5), interval=0.05, tracks=None)
    solid.write_all(folder / "bodies.h5")
    shear.write_test(folder / "increments.h5", increments=10)
    for path in folder.glob("*.h5"):
        with open_results(path) as results:
            parts = (Note("before"), *player_of(results, 10_000_000))
            write_page(
                Page("Test", "of <the> page", ("a banner",), ("a warning",), (Section("Grains", parts),)),
                path.with_suffix(".html"),
            )
    return folder


class Player:
    """The only player of a page."""

    def __init__(self, browser: Any) -> None:
        self.browser = browser
        self.canvas = browser.find_element(By.TAG_NAME, "canvas")
        self.wait(lambda: self.root("dataset.drawn") is not None)

    def wait(self, done: Callable[[], bool]) -> None:
        WebDriverWait(self.browser, PATIENCE, 0.05).until(lambda _: done())

    def script(self, text: str, *arguments: Any) -> Any:
        return self.browser.execute_script(text, *arguments)

    def root(self, expression: str) -> Any:
        return self.script(f"return document.querySelector('.player').{expression}")

    def part(self, name: str) -> Any:
        return self.browser.find_element(By.CSS_SELECTOR, f'[data-part="{name}"]')

    @property
    def frame(self) -> int:
        """The frame that is drawn."""
        return int(self.root("dataset.drawn"))

    def shows(self, frame: int) -> None:
        self.wait(lambda: self.frame == frame)

    def drawn(self, act: Callable[[], object]) -> None:
        """Do something, and wait until the picture was drawn anew."""
        self.script("delete document.querySelector('.player').dataset.drawn")
        act()
        self.wait(lambda: self.root("dataset.drawn") is not None)

    def pixels(self) -> np.ndarray[Any, Any]:
        """Colours in the picture, (height, width, 4)."""
        address = self.script("return document.querySelector('canvas').toDataURL()")
        with io.BytesIO(base64.b64decode(address.partition(",")[2])) as stream, Image.open(stream) as image:
            return np.asarray(image.convert("RGBA"))

    def choose(self, name: str, value: str) -> None:
        text = "const s = arguments[0]; s.value = arguments[1]; s.dispatchEvent(new Event('change', {bubbles: true}))"
        self.drawn(lambda: self.script(text, self.part(name), value))

    def press(self, *keys: str) -> None:
        ActionChains(self.browser).send_keys(*keys).perform()

    def focus(self) -> None:
        self.script("document.querySelector('canvas').focus()")

    def rows(self, name: str) -> dict[str, str]:
        rows = self.script(
            "return [...arguments[0].rows].map((r) => [...r.cells].map((c) => c.textContent))", self.part(name)
        )
        return dict(rows)

    def point_at(self, k: int) -> None:
        """Move the pointer to an element."""
        x, y = self.root(f"player.painter.place({k}, {self.frame})")
        box = self.script(
            "arguments[0].scrollIntoView({block: 'start'}); const b = arguments[0].getBoundingClientRect(); return [b.width, b.height]",
            self.canvas,
        )
        move = ActionChains(self.browser, duration=0)
        move.move_to_element_with_offset(self.canvas, round(x - box[0] / 2), round(y - box[1] / 2)).perform()


@pytest.fixture
def opened(browser: Any, folder: Path) -> Callable[[str], Player]:
    def open_page(name: str) -> Player:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
        browser.get_log("browser")
        browser.get((folder / f"{name}.html").as_uri())
        return Player(browser)

    return open_page


def number(text: str) -> float:
    """A number with its unit in SI."""
    found = re.fullmatch(r"(-?[\d.]+(?:e[-+]?\d+)?) ?(.*)", text)
    assert found, text
    return float(found.group(1)) * SI[found.group(2)]


@pytest.mark.parametrize("name", ["grains", "bonded", "ellipse", "clump", "bodies", "increments"])
def test_every_kind_is_drawn_without_errors(opened: Callable[[str], Player], name: str) -> None:
    player = opened(name)
    pictures = []
    for frame in (0, 2):
        player.script(
            "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input'))",
            player.part("scrub"),
            frame,
        )
        player.shows(frame)
        pictures.append(player.pixels())
        assert len(np.unique(pictures[-1].reshape(-1, 4), axis=0)) > 10
    assert not np.array_equal(*pictures)
    chains = player.part("chains")
    player.drawn(lambda: player.script("arguments[0].click()", chains))
    assert not np.array_equal(player.pixels(), pictures[-1])
    assert [entry for entry in player.browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")] == []


def test_single_frame(opened: Callable[[str], Player]) -> None:
    """There is nothing to play, and each quantity has its colours all the same."""
    player = opened("single")
    pictures = []
    for name in ("radius", "coordination"):
        player.choose("color", name)
        pictures.append(player.pixels())
        assert len(np.unique(pictures[-1].reshape(-1, 4), axis=0)) > 10
    assert not np.array_equal(*pictures)
    player.part("play").click()
    assert player.root("player.playing") is False


def test_it_asks_for_nothing_but_itself(opened: Callable[[str], Player]) -> None:
    player = opened("grains")
    assert player.script("return performance.getEntriesByType('resource').map((r) => r.name)") == []
    blocked = player.script("return fetch('data:,x').then(() => 'answered', () => 'forbidden')")
    assert blocked == "forbidden"


def test_play_goes_on_and_ends(opened: Callable[[str], Player]) -> None:
    """From the last frame it starts anew; it stops at the last one."""
    player = opened("grains")
    assert player.frame == 10
    player.script("arguments[0].value = '20'", player.part("speed"))
    seen = player.script(
        "const root = document.querySelector('.player'); const seen = new Set();"
        "root.querySelector('[data-part=play]').click();"
        "return new Promise((done) => { const look = () => { seen.add(root.dataset.drawn);"
        "if (root.player.playing) requestAnimationFrame(look); else setTimeout(() => done([...seen, root.dataset.drawn]), 100); }; look(); })"
    )
    assert len(set(seen)) >= 5
    assert seen[-1] == "10"
    assert player.part("play").text == "Play"


def test_keyboard(opened: Callable[[str], Player]) -> None:
    player = opened("grains")
    player.focus()
    player.press(Keys.HOME)
    player.shows(0)
    player.press(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    player.shows(3)
    player.press(Keys.ARROW_LEFT)
    player.shows(2)
    assert player.part("place").text.endswith("frame 3 of 11")
    player.press(" ")
    player.wait(lambda: player.frame > 3)
    player.press(" ")
    assert player.root("player.playing") is False
    before = player.pixels()
    player.drawn(lambda: player.press("+"))
    assert not np.array_equal(player.pixels(), before)
    before = player.pixels()
    held = ActionChains(player.browser).key_down(Keys.SHIFT).send_keys(Keys.ARROW_UP).key_up(Keys.SHIFT)
    player.drawn(held.perform)
    assert not np.array_equal(player.pixels(), before)
    player.press(Keys.END)
    player.shows(10)
    player.drawn(lambda: player.press("0"))
    player.press("n", "n", "p")
    player.wait(lambda: player.part("grain").get_attribute("value") == "0")
    assert player.part("grain-title").text == "Grain 0"
    player.press(Keys.ESCAPE)
    player.wait(lambda: player.part("grain").get_attribute("value") == "")


def test_tab_reaches_everything(opened: Callable[[str], Player]) -> None:
    """In the order of the page: picture, frames, choices, grain."""
    player = opened("grains")
    player.focus()
    order = []
    for _ in range(15):
        player.press(Keys.TAB)
        order.append(player.script("return document.activeElement.dataset.part"))
    assert order == [
        "first", "back", "play", "next", "last", "scrub", "speed", "color", "scale", "chains", "marks", "out", "in", "fit", "grain",
    ]  # fmt: skip


def test_colour_choice_changes_the_picture(opened: Callable[[str], Player]) -> None:
    player = opened("grains")
    pictures, labels = [], []
    for name in ("displacement", "radius", "speed", "pressure", "coordination", "rotation"):
        player.choose("color", name)
        pictures.append(player.pixels())
        labels.append(player.part("bar-label").text)
        assert len(player.part("ticks").text.split()) >= 3
    for k in range(len(pictures) - 1):
        assert not np.array_equal(pictures[k], pictures[k + 1])
    assert labels[0].startswith("displacement since the stage began [")
    assert labels[3].startswith("mean stress in the grain [kPa]")


@pytest.mark.parametrize("name", ["grains", "ellipse", "bonded"])
def test_pointer_tells_the_file_s_numbers(opened: Callable[[str], Player], folder: Path, name: str) -> None:
    player = opened(name)
    k = 13
    player.point_at(k)
    player.wait(lambda: player.part("grain-title").text.endswith(f" {k}"))
    told = player.rows("facts")
    with open_results(folder / f"{name}.h5") as results:
        frame = results.frame(-1)
        start = results.frame(first_frame_of_stage(results, frame.stage))
        want = {label: float(QUANTITIES[key].values(frame, start)[k]) for label, key in TOLD.items()}
        want |= {"x": float(frame.grains.x[k]), "y": float(frame.grains.y[k])}
        span = results.width
    for label, value in want.items():
        # Four digits of a number that is known to 3.2e-4; places to a quantum of the box.
        assert number(told[label]) == pytest.approx(value, rel=1e-3, abs=span / 65534 if label in "xy" else 1e-12), (
            label
        )
    assert told["contacts"] == str(frame.coordination[k])
    if name == "grains":
        assert number(told["radius"]) == pytest.approx(float(frame.grains.radius[k]), rel=1e-3)


TOLD = {
    "speed": "speed", "angular velocity": "spin", "displacement since the stage began": "displacement",
    "rotation since the stage began": "rotation", "mean stress": "pressure", "largest shear stress": "shear_stress",
    "stress xx": "stress_xx", "stress xy": "stress_xy",
}  # fmt: skip


def test_pointer_on_bodies(opened: Callable[[str], Player], folder: Path) -> None:
    """The numbers of a body in 3D; dragging turns the scene."""
    player = opened("bodies")
    with open_results(folder / "bodies.h5") as results:
        frame = results.frame(-1)
        k = int(np.flatnonzero(~frame.bodies.escaped)[-1])
        player.script(f"document.querySelector('.player').player.select({k})")
        player.wait(lambda: player.part("grain-title").text == f"Body {k}")
        told = player.rows("facts")
        for axis, name in enumerate("xyz"):
            ends = [results.frame(n).bodies.x[:, axis] for n in range(results.n_frames)]
            quantum = float(np.ptp(ends)) / 65534
            assert number(told[name]) == pytest.approx(frame.bodies.x[k, axis], rel=1e-4, abs=quantum)
        assert number(told["speed"]) == pytest.approx(float(np.linalg.norm(frame.bodies.v[k])), rel=1e-3)
        assert told["kind"] == results.groups[frame.bodies.group[k]]
    before = player.pixels()
    player.drawn(ActionChains(player.browser, duration=0).drag_and_drop_by_offset(player.canvas, 60, 20).perform)
    assert not np.array_equal(player.pixels(), before)


def test_frame_is_told(opened: Callable[[str], Player], folder: Path) -> None:
    player = opened("grains")
    told = player.rows("frame")
    assert told["time"] == "5 s"
    assert told["stage"] == "stage 2 (shake)"
    with open_results(folder / "grains.h5") as results:
        assert float(told["void ratio"]) == pytest.approx(results.series["void_ratio"][-1], rel=1e-3)


def test_dark_and_light(opened: Callable[[str], Player]) -> None:
    """As the system wants it, and as the button says."""
    player = opened("grains")
    assert player.pixels()[2, 2].tolist() == [255, 255, 255, 255]
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    player.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    player.wait(lambda: int(player.pixels()[2, 2, :3].max()) < 60)
    button = player.browser.find_element(By.ID, "theme")
    button.click()
    assert button.text == "Theme: light"
    player.wait(lambda: player.pixels()[2, 2].tolist() == [255, 255, 255, 255])
    button.click()
    player.wait(lambda: int(player.pixels()[2, 2, :3].max()) < 60)
    assert player.script("return getComputedStyle(document.body).backgroundColor") == "rgb(14, 17, 20)"


def test_narrow_window_has_no_sideways_scrolling(opened: Callable[[str], Player]) -> None:
    player = opened("bonded")
    size = {"width": 380, "height": 800, "deviceScaleFactor": 2, "mobile": False}
    player.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        player.wait(lambda: player.script("return document.querySelector('canvas').clientWidth") < 380)
        assert player.script("return document.documentElement.scrollWidth") <= 380
        assert len(np.unique(player.pixels().reshape(-1, 4), axis=0)) > 10
    finally:
        player.browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
