"""The page of `dem report --html`: what stands in it, that it fetches nothing, and how well its frames keep the file's numbers."""

from __future__ import annotations

import base64
import dataclasses
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quasi_static_samples as shear
import report_samples as made
import scene_samples as solid
import sweep_samples as swept
from click.testing import CliRunner
from matplotlib.figure import Figure
from shape_samples import shaped

from dem_cli.cli.report import command
from dem_cli.errors import DemError
from dem_cli.report import sweep_figures, sweep_text, text
from dem_cli.report.look import new_figure, style
from dem_cli.report.page import build, codes, frames
from dem_cli.report.page.build import BUDGET, comparison, file_page, player_of, sweep_page
from dem_cli.report.page.frames import spread
from dem_cli.report.page.grains import grain_player
from dem_cli.report.page.model import Drawing, Listing, Page, Player, Section
from dem_cli.report.page.pictures import drawing
from dem_cli.report.page.render import html
from dem_cli.report.page.rigid import body_player
from dem_cli.report.quantities import QUANTITIES
from dem_cli.report.summary import summary
from dem_cli.report.sweep import read_sweep
from dem_cli.report.sweep_best import best_point
from dem_cli.report.text import Block
from dem_cli.results import BodyResults, Results, open_results

HOSTILE = """</script><script>alert(1)</script><b>"bold" & 'bad'</b>"""
PLENTY = 10_000_000


class Read(HTMLParser):
    """Elements with their attributes, the cells of tables, running text, and what scripts hold."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.cells: list[str] = []
        self.texts: list[str] = []
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self._open: list[str] = []
        self.feed(source)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "input"):
            self._open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")
        if tag == "script":
            self.scripts.append((dict(attrs), ""))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag, f"</{tag}> closes another element"

    def handle_data(self, data: str) -> None:
        if self._open and self._open[-1] == "script":
            self.scripts[-1] = (self.scripts[-1][0], self.scripts[-1][1] + data)
        elif self._open and self._open[-1] in ("td", "th"):
            self.cells[-1] += data
        elif self._open and self._open[-1] != "style":
            self.texts.append(data)

    def attributes(self, tag: str) -> list[dict[str, str | None]]:
        return [attrs for name, attrs in self.elements if name == tag]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make_file(tmp_path_factory.mktemp("run") / "run.h5", interval=0.05, title=HOSTILE)


@pytest.fixture(scope="module")
def page(path: Path) -> Page:
    return file_page([path])


@pytest.fixture(scope="module")
def source(page: Page) -> str:
    return html(page)


@pytest.fixture(scope="module")
def read(source: str) -> Read:
    return Read(source)


# ------------------------------------------------------------------------------------------------ content


def test_all_numbers_of_the_report_are_there(path: Path, read: Read) -> None:
    with open_results(path) as results:
        blocks = text.blocks(summary(results))
    cells = {cell.replace("→", "->").replace("±", "+-") for cell in read.cells}
    for block in blocks:
        if block.title == "Warnings":
            for (line,) in block.rows:
                assert line in read.texts
            continue
        for row in block.rows:
            assert set(row) - {""} <= cells, row


def test_scenario_and_provenance_are_there(path: Path, read: Read) -> None:
    with open_results(path) as results:
        assert results.attrs["resolved"] in "".join(read.texts)
        for name in ("program_version", "python_version", "numpy_version", "platform", "scenario_hash", "stop_reason"):
            assert str(results.attrs[name]) in read.cells


def test_page_is_well_made(source: str, read: Read) -> None:
    assert source.startswith("<!DOCTYPE html>")
    assert read.attributes("html") == [{"lang": "en"}]
    assert len(read.attributes("h1")) == 1
    names = [attrs["id"] for _, attrs in read.elements if attrs.get("id")]
    assert len(names) == len(set(names))
    for attrs in read.attributes("a"):
        assert attrs["href"].removeprefix("#") in names
    pictures = read.attributes("img")
    assert len(pictures) >= 6
    for attrs in pictures:
        assert attrs["src"].startswith(("data:image/svg+xml;base64,", "data:image/png;base64,"))
        assert len(attrs["alt"]) > 20
    for tag in ("button", "select", "input"):
        for attrs in read.attributes(tag):
            assert attrs.get("data-part") or attrs.get("id")


def test_nothing_is_fetched(source: str, read: Read) -> None:
    """No address but in the text of data; a policy that would forbid it; scripts and styles known by their hashes."""
    for _, attrs in read.elements:
        for name in ("src", "href", "srcset", "action", "poster", "data"):
            assert (attrs.get(name) or "#").startswith(("#", "data:"))
        assert "style" not in attrs
        assert not any(name.startswith("on") for name in attrs)
    assert "url(" not in source.split("</style>")[0]
    assert "@import" not in source
    own = "".join(content for attrs, content in read.scripts if "type" not in attrs)
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|EventSource|importScripts|import)\s*\(", own)
    assert "://" not in own
    policy = next(attrs["content"] for attrs in read.attributes("meta") if attrs.get("http-equiv"))
    assert policy.startswith("default-src 'none'; img-src data:; style-src 'sha256-")
    assert "unsafe" not in policy


def test_hostile_text_stays_text(read: Read, page: Page) -> None:
    """A title that would end the script: it comes back as text, and as the JSON's own string."""
    assert HOSTILE in read.texts
    assert not read.attributes("b")
    programs = [content for attrs, content in read.scripts if "type" not in attrs]
    assert len(programs) == 1
    (facts,) = [json.loads(content) for attrs, content in read.scripts if attrs.get("type") == "application/json"]
    (player,) = [part for section in page.sections for part in section.parts if isinstance(part, Player)]
    assert facts == player.facts
    hostile = replace(player, facts={**player.facts, "stages": [HOSTILE, "\u2028"]})
    again = Read(html(Page("t", sections=(Section("s", (hostile,)),))))
    (told,) = [json.loads(content) for attrs, content in again.scripts if attrs.get("type") == "application/json"]
    assert told["stages"] == [HOSTILE, "\u2028"]


def test_same_file_gives_the_same_page(path: Path, source: str) -> None:
    assert html(file_page([path])) == source


def a_figure(points: int) -> Figure:
    figure = new_figure(4.0, 2.0)
    ax = figure.add_subplot()
    for k in range(points):
        ax.plot([0.1 * k, 0.1 * k + 1.0], [k % 7, k % 5], color=(0.5, k / points, 0.2))
    return figure


@pytest.mark.parametrize(
    ("points", "grains", "kind"), [(5, 0, "svg+xml"), (1500, 0, "png"), (1500, 1500, "png"), (5, 5, "png")]
)
def test_pictures_are_the_smaller_of_two(points: int, grains: int, kind: str) -> None:
    with style():
        one = drawing(a_figure(points), "title", "caption", "alt", grains=grains)
    assert one.kind == kind
    assert one.content.startswith(b"\x89PNG" if kind == "png" else b"<?xml")
    assert base64.b64decode(one.address.partition(",")[2]) == one.content
    assert (one.width, one.wide) == (384, False)


def test_every_picture_is_small(page: Page) -> None:
    drawings = [part for section in page.sections for part in section.parts if isinstance(part, Drawing)]
    assert len(drawings) >= 6
    assert max(len(one.content) for one in drawings) < 400_000


def test_incomplete_run_is_told_at_the_top(tmp_path: Path) -> None:
    partial = made.make_file(tmp_path / "cut.h5", interval=0.05, stop_after=3.0)
    read = Read(html(file_page([partial])))
    line = "Incomplete run: interrupted. Numbers and pictures show what was written, up to its last row."
    headings = [text for text in read.texts if text in ("Warnings", "Summary", line)]
    assert headings[-3:] == [line, "Warnings", "Summary"]  # those before are links
    assert not any("the run is incomplete" in text for text in read.texts)


def test_many_warnings_are_folded_away() -> None:
    lines = tuple(f"warning {k}" for k in range(11))
    read = Read(html(Page("t", warnings=lines)))
    assert [text for text in read.texts if text in lines] == list(lines)
    assert "3 more" in read.texts
    assert "0 more" not in Read(html(Page("t", warnings=lines[:8]))).texts
    assert not Read(html(Page("t", warnings=lines[:8]))).attributes("details")


def test_file_without_frames(tmp_path: Path) -> None:
    """A run that was killed at its start has a page, too."""
    path = made.make_file(tmp_path / "none.h5", stop_after=-1.0)
    read = Read(html(file_page([path])))
    assert "The file holds no frames yet." in read.texts
    assert not read.attributes("canvas")


# ------------------------------------------------------------------------------------------------ frames


def players(results: Results, budget: int = PLENTY) -> Player:
    found = (
        body_player(results, budget, "t") if isinstance(results, BodyResults) else grain_player(results, budget, "t")
    )
    assert found is not None
    return found


def decoded(player: Player) -> dict[str, Any]:
    """The numbers of a player by section, as the page's script has them."""
    quanta = codes.unpack(player.data, player.facts["sections"])
    found: dict[str, Any] = {}
    for name, section in player.facts["sections"].items():
        code = section.get("code")
        if code == "linear":
            found[name] = codes.of_linear(quanta[name], section["low"], section["high"])
        elif code == "log":
            found[name] = codes.of_log(quanta[name], section["largest"])
        else:
            found[name] = codes.of_angle(quanta[name]) if code == "angle" else quanta[name]
    return found


@pytest.fixture(scope="module", params=["disc", "ellipse", "bonded", "clump"])
def grains(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    sample = None if request.param == "disc" else shaped(request.param, 6, 5)
    target = tmp_path_factory.mktemp("grains") / f"{request.param}.h5"
    return made.make_file(target, sample=sample, interval=0.05, tracks=None)


def test_frames_are_the_file_to_half_a_quantum(grains: Path) -> None:
    with open_results(grains) as results:
        player = players(results)
        found, sections = decoded(player), player.facts["sections"]
        assert player.facts["numbers"] == list(range(results.n_frames))
        starts = [results.frame(0), results.frame(1)]
        for k in range(results.n_frames):
            frame = results.frame(k)
            g = frame.grains
            for name in ("x", "y"):
                half = 0.5 * (sections[name]["high"] - sections[name]["low"]) / codes.STEPS
                assert np.abs(found[name][k] - getattr(g, name)).max() <= half * 1.000001
            turn = np.abs(found["angle"][k] - g.angle) % (2.0 * math.pi)
            assert np.minimum(turn, 2.0 * math.pi - turn).max() <= math.pi / 65536 * 1.000001
            assert np.array_equal(found["coordination"][k], frame.coordination)
            for name in ("speed", "spin", "displacement_x", "displacement_y", "rotation", "stress_xx", "stress_xy"):
                want = QUANTITIES[name].values(frame, starts[frame.stage])
                least = codes.LEAST * sections[name]["largest"]
                assert np.all(np.abs(found[name][k] - want) <= codes.LOG_ERROR * np.abs(want) * 1.0001 + least), name
            if "orientation" in found:
                want = QUANTITIES["orientation"].values(frame, frame)
                assert np.array_equal(np.isnan(found["orientation"][k]), np.isnan(want))
                off = np.abs(found["orientation"][k] - want)
                assert np.nan_to_num(off).max() <= 0.5 * math.pi / codes.STEPS * 1.000001


def test_contacts_are_the_file_s(grains: Path) -> None:
    with open_results(grains) as results:
        found = decoded(players(results))
        elements, start, foot = results.element_count, 0, 0
        for k, count in enumerate(found["contacts"]):
            c = results.frame(k).contacts
            rows = slice(start, start + count)
            first = np.cumsum(found["first"][rows], dtype=np.uint16)
            second = first + found["second"][rows]
            assert np.array_equal(first, c.i)
            assert np.array_equal(second, np.where(c.j < 0, elements - 1 - c.j, c.j))
            largest = float(found["largest"][k])
            want = 255.0 * np.sqrt(c.normal / largest)
            assert np.abs(found["force"][rows] - want).max() <= 0.5001
            touching = int(np.count_nonzero(c.j < 0))
            feet = found["feet"][foot : foot + touching]
            assert feet == pytest.approx(np.stack([c.px, c.py], axis=1)[c.j < 0], rel=1e-6, abs=1e-9)
            start, foot = start + count, foot + touching


def test_walls_and_bonds_are_the_file_s(grains: Path) -> None:
    with open_results(grains) as results:
        found, walls = decoded(players(results)), results.walls
        ends = np.stack([walls.x0, walls.y0, walls.x1, walls.y1], axis=1).astype(np.float32)
        assert np.array_equal(found["walls"].reshape(-1, 4), ends)
        assert np.array_equal(
            found["bonds"].reshape(-1, 2), np.stack([results.bonds.i, results.bonds.j], axis=1).reshape(-1, 2)
        )


def test_walls_of_tests_move_with_their_frames(tmp_path: Path) -> None:
    """Over increments: walls of each frame, boundary grains counted, no speed."""
    with open_results(shear.write_test(tmp_path / "ring.h5", increments=10, ring=True)) as results:
        assert players(results).facts["boundary"] == results.boundary > 0
    with open_results(shear.write_test(tmp_path / "walls.h5", increments=10)) as results:
        player = players(results)
        found = decoded(player)
        assert player.facts["axis"] == "increment"
        assert "speed" not in found
        for k in range(results.n_frames):
            w = results.frame(k).walls
            ends = np.stack([w.x0, w.y0, w.x1, w.y1], axis=1).astype(np.float32)
            assert np.array_equal(np.reshape(found["walls"][k], (-1, 4)), ends)


def test_bodies_are_the_file_s(tmp_path: Path) -> None:
    path = solid.write_all(tmp_path / "bodies.h5")
    with open_results(path) as results:
        player = players(results)
        found, sections = decoded(player), player.facts["sections"]
        for k in range(results.n_frames):
            b = results.frame(k).bodies
            here = ~b.escaped
            for axis, name in enumerate("xyz"):
                half = 0.5 * (sections[name]["high"] - sections[name]["low"]) / codes.STEPS
                assert np.abs(found[name][k] - b.x[:, axis])[here].max() <= half * 1.000001
            for axis in range(4):
                assert np.abs(found[f"q{axis}"][k] - b.q[:, axis]).max() <= 1.0 / codes.STEPS * 1.000001
        assert [len(results.frame(k).contacts) for k in range(results.n_frames)] == found["contacts"].tolist()


@pytest.mark.parametrize("largest", [0.0, 1e-12, 3.7, 1e9])
def test_logarithms_keep_their_word(largest: float) -> None:
    """To within LOG_ERROR of each value, sign and NaN included; far below the largest it is 0."""
    values = largest * np.array([1.0, -1.0, 0.37, -1e-3, 2e-9, -1e-12, 0.0, np.nan])
    found = codes.of_log(codes.log(values, largest), largest)
    assert np.isnan(found[-1])
    error = codes.LOG_ERROR * np.abs(values[:-1]) * 1.0001
    assert np.all(np.abs(found - values)[:-1] <= error + codes.LEAST * largest)
    assert np.all(np.sign(found[:4]) == np.sign(values[:4]))
    assert found[5] == found[6] == 0.0


def test_differences_between_frames_come_back() -> None:
    """Whatever jumps there are, modulo 2^16; and a section after it begins where it should."""
    rng = np.random.default_rng(1)
    first, second = rng.integers(0, 65536, (5, 7)).astype(np.uint16), rng.random((4, 3)).astype(np.float32)
    packer = codes.Packer()
    packer.add("first", first, delta=True)
    packer.add("second", second)
    packer.add("third", np.arange(5, dtype=np.uint8))
    found = codes.unpack(packer.text(), packer.sections)
    assert np.array_equal(found["first"], first)
    assert np.array_equal(found["second"], second)
    assert np.array_equal(found["third"], np.arange(5))


def test_frames_are_thinned_to_the_budget(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames, "AHEAD", 100.0)  # formulas compress better than grains
    path = made.make_file(tmp_path / "long.h5", frames=51, interval=0.05, tracks=None)
    with open_results(path) as results:
        whole = players(results)
        thin = players(results, len(whole.data) // 3)
        assert whole.note == f"All {results.n_frames} frames of the file are here."
        kept = thin.facts["numbers"]
        assert len(thin.data) <= len(whole.data) // 3
        assert 8 <= len(kept) < 20
        assert (kept[0], kept[-1]) == (0, 50)
        assert np.ptp(np.diff(kept)) <= 1
        assert thin.note.startswith(f"{len(kept)} of the file's 51 frames")
        assert thin.facts["places"] == [float(f"{t:.9g}") for t in results.frame_times[kept]]
        assert players(results, 1).facts["numbers"] == [50]


def test_spread() -> None:
    assert spread(5, 9) == [0, 1, 2, 3, 4]
    assert spread(9, 3) == [0, 4, 8]
    assert spread(9, 1) == [8]


def test_readouts_are_the_series(grains: Path) -> None:
    with open_results(grains) as results:
        told = {one["label"]: one for one in players(results).facts["readouts"]}
        time = results.series["time"]
        rows = [int(np.argmin(np.abs(time - t))) for t in results.frame_times]
        assert told["void ratio"]["values"] == pytest.approx(results.series["void_ratio"][rows], rel=1e-8)
        assert told["fill depth"]["unit"] == "m"


# ------------------------------------------------------------------------------------------------ several files, sweeps


def test_several_files(tmp_path: Path, path: Path) -> None:
    other = made.make_file(tmp_path / "other.h5", interval=0.05, columns=6, rows=6, tracks=(1, 8, 15), title="Other")
    page = file_page([path, other])
    read = Read(html(page))
    assert [section.title for section in page.sections] == ["Comparison", "1. run.h5", "2. other.h5"]
    assert [line.endswith("the fourth grain is shy") for line in page.warnings].count(True) == 2  # once a file
    assert len(read.attributes("canvas")) == 2
    for block in comparison([path, other])[0]:
        for row in block.rows:
            assert set(row) - {""} <= {cell.replace("→", "->").replace("±", "+-") for cell in read.cells}


def test_sweep(tmp_path: Path) -> None:
    """All tables and pictures of its report, every member with its state and reason, and those that are done compared."""
    axes = {
        swept.SHAPE: ("disc", "ellipse"),
        swept.GAL: ("400 gal", "800 gal"),
        swept.HERTZ: ("1 Hz", "2 Hz"),
        swept.SEED: (1, 2),
    }
    folder = swept.make_sweep(tmp_path / "grid", axes, failed=["disc-400-1-2"], waiting=["ellipse-800-2-2"])
    target = tmp_path / "sweep.html"
    result = CliRunner().invoke(command, [str(folder), "--html", str(target)])
    assert result.exit_code == 0, result.output
    assert result.stderr == f"wrote {target}\n"
    assert "Best point" in result.stdout
    read = Read(target.read_text(encoding="utf-8"))
    cells = {cell.replace("→", "->").replace("±", "+-") for cell in read.cells}
    found = read_sweep(folder)
    for block in [
        *sweep_text.blocks(found, width=None),
        *comparison([folder / one.file for one in found.entries if one.numbers])[0],
    ]:
        if block.title != "Warnings":
            for row in block.rows:
                assert set(row) - {""} <= cells, row
    assert {"disc-400-1-2", "failed", "waiting", "grain 17 left the container at 1.2 s; take a smaller dt"} <= cells
    assert "Incomplete sweep: of 16 members 1 waiting and 1 failed." in read.texts
    with style():
        shown = [f"{title}: {caption}" for title, caption, _ in sweep_figures.sections(found)]
    assert len(shown) >= 2
    assert set(shown) <= {attrs["alt"] for attrs in read.attributes("img")}


def test_sweep_shows_a_run_of_its_best_point_and_where_it_comes_from(tmp_path: Path) -> None:
    axes = {
        swept.SHAPE: ("disc",),
        swept.GAL: ("400 gal", "800 gal"),
        swept.HERTZ: ("1 Hz", "2 Hz"),
        swept.SEED: (1, 2),
    }
    folder = swept.make_sweep(tmp_path / "grid", axes)
    found = read_sweep(folder)
    best = best_point(found)
    assert best is not None
    first = found.cases[best.case].entries[0]
    page = sweep_page(found)
    (motion,) = [section for section in page.sections if section.title.startswith("In motion")]
    assert motion.title == f"In motion: {first.name}, of the best point"
    with open_results(folder / first.file) as results:
        assert motion.parts == player_of(results, BUDGET)
        (sources,) = [section for section in page.sections if section.title == "Scenario and provenance"]
        rows = [row for part in sources.parts if isinstance(part, Block) for row in part.rows]
        assert ("scenario hash", results.attrs["scenario_hash"]) in rows
    listings = [part.text for part in sources.parts if isinstance(part, Listing)]
    assert listings[-1] == (folder / "sweep.toml").read_text(encoding="utf-8")


def test_large_sweeps_are_not_compared_run_by_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    axes = {swept.SHAPE: ("disc",), swept.GAL: ("400 gal", "800 gal"), swept.HERTZ: ("1 Hz",), swept.SEED: (1, 2)}
    found = read_sweep(swept.make_sweep(tmp_path / "grid", axes))
    assert "Runs compared" in [section.title for section in sweep_page(found).sections]
    monkeypatch.setattr(build, "MOST_COMPARED", 3)
    assert "Runs compared" not in [section.title for section in sweep_page(found).sections]


# ------------------------------------------------------------------------------------------------ the command


def test_command_writes_the_page_and_prints_the_text(path: Path, tmp_path: Path, source: str) -> None:
    target = tmp_path / "run.html"
    result = CliRunner().invoke(command, [str(path), "--html", str(target)])
    assert result.exit_code == 0
    assert result.stderr == f"wrote {target}\n"
    assert "0.214 -> 0.199" in result.stdout
    assert target.read_text(encoding="utf-8") == source


def test_command_keeps_what_is_there(tmp_path: Path) -> None:
    path = made.make_file(tmp_path / "cut.h5", stop_after=-1.0)
    target = tmp_path / "run.html"
    target.write_text("mine")
    result = CliRunner().invoke(command, [str(path), "--html", str(target)])
    assert isinstance(result.exception, DemError)
    assert "--force" in str(result.exception)
    assert result.stdout == ""
    assert target.read_text() == "mine"
    assert CliRunner().invoke(command, [str(path), "--html", str(target), "--force"]).exit_code == 0
    assert target.read_text() != "mine"


def test_page_is_no_folder(tmp_path: Path) -> None:
    path = made.make_file(tmp_path / "cut.h5", stop_after=-1.0)
    target = tmp_path / "run.html"
    target.mkdir()
    result = CliRunner().invoke(command, [str(path), "--html", str(target), "--force"])
    assert "is a folder" in str(result.exception)
    assert result.stdout == ""


def test_page_of_a_sweep_of_one_member_has_lines_as_long_as_they_are(tmp_path: Path) -> None:
    """The browser folds them; the text report does at its own width."""
    axes = {swept.SHAPE: ("disc",), swept.HERTZ: ("2 Hz",)}
    found = read_sweep(swept.make_sweep(tmp_path / "one", axes))
    assert ": 1 member, 1 done" in sweep_page(found).subtitle
    long = " ".join(["a word"] * 40)
    said = dataclasses.replace(found, said=(long,))
    rows = {width: sweep_text.blocks(said, width=width)[-1].rows for width in (None, 118)}
    assert rows[None] == ((f"- {long}",),)
    assert len(rows[118]) == 3


@pytest.mark.parametrize("name", ["page.pdf", "page", "no/such/folder/page.html"])
def test_command_refuses_names(path: Path, tmp_path: Path, name: str) -> None:
    result = CliRunner().invoke(command, [str(path), "--html", str(tmp_path / name)])
    assert isinstance(result.exception, DemError)
    assert "\n" not in str(result.exception)
    assert result.stdout == ""  # told before any work
