"""Pictures for the screen and for a journal: sizes, fonts, captions, and labels that do not run into each other, of every kind."""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import quasi_static_samples as quasi
import report_samples as made
import scene_samples as scenes
from click.testing import CliRunner
from matplotlib import rcParams
from picture_checks import clashes, texts
from shape_samples import shaped

from dem_cli.cli.compare import command as compare
from dem_cli.cli.render import command as render
from dem_cli.report.figures import KINDS, OVER_TIME, SHEAR_KINDS, Picture, draw
from dem_cli.report.look import STYLES, caption, current, save, style
from dem_cli.results import open_results

MM = 1.0 / 25.4
WIDTH = {"paper": 85.0 * MM, "paper-wide": 170.0 * MM}
BODY_SHOWN = ("scene", "trajectories", "histories", "energy", "series", "runout")
ASKED = [
    *(("time", kind) for kind in KINDS),
    ("bonded", "sample"),
    *(("increment", kind) for kind in (*(one for one in KINDS if one not in OVER_TIME), *SHEAR_KINDS)),
    *(("bodies", kind) for kind in BODY_SHOWN),
]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    root = tmp_path_factory.mktemp("runs")
    made.make_file(root / "time.h5", interval=0.05)
    made.make_file(root / "bonded.h5", interval=0.5, sample=shaped("bonded"))
    quasi.write_test(root / "increment.h5")
    scenes.write_all(root / "bodies.h5")
    opened = {path.stem: open_results(path) for path in root.glob("*.h5")}
    yield opened
    for results in opened.values():
        results.close()


@pytest.mark.parametrize("name", STYLES)
@pytest.mark.parametrize(("run", "kind"), ASKED, ids=lambda value: str(value))
def test_labels_do_not_run_into_each_other(runs: dict[str, Any], run: str, kind: str, name: str) -> None:
    with style(name):
        figure = draw(runs[run], Picture(what=kind, stage=0 if run == "bodies" else None))
        assert clashes(figure) == []
        width, height = figure.get_size_inches()
        if name != "screen":
            assert width == pytest.approx(WIDTH["paper-wide" if kind == "paper" else name])
            assert height < 245.0 * MM
            assert figure.get_suptitle() == ""
        assert caption(figure).startswith(runs[run].title)
        sizes = {
            text.get_fontsize() for ax in figure.axes for text in (ax.xaxis.label, ax.yaxis.label) if text.get_text()
        }
        assert not sizes or (min(sizes) >= 7.0 and (name == "screen" or max(sizes) <= 8.0))


@pytest.mark.parametrize(("run", "kind"), [one for one in ASKED if one[1] not in ("scene", "paper")], ids=str)
def test_axes_bear_units(runs: dict[str, Any], run: str, kind: str) -> None:
    """Every axis that is labelled names its unit, or is one of those that have none."""
    bare = re.compile(
        r"void ratio|coordination|stress ratio|\(s1 - s2\)/\(s1 \+ s2\)|increment|contacts|bodies|dilatancy -de_v|"
        r"normal force over its mean|probability density|volumetric strain$|share P or more|\d+ % within|nan % within"
    )
    with style():
        figure = draw(runs[run], Picture(what=kind, stage=0 if run == "bodies" else None))
    axes = [*figure.axes, *(child for ax in figure.axes for child in ax.child_axes)]
    labels = [text for ax in axes for text in (ax.get_xlabel(), ax.get_ylabel()) if text]
    assert labels or kind in ("rose", "normals", "energy-normals")
    for label in labels:
        assert re.search(r"\[.+\]", label) or bare.search(label), label


def test_style_is_left_as_it_was() -> None:
    before = dict(rcParams)
    with style("paper"):
        assert current() is STYLES["paper"]
        assert rcParams["font.size"] == 8.0
        assert rcParams["pdf.fonttype"] == 42
        with style("screen"):
            assert current() is STYLES["screen"]
        assert current() is STYLES["paper"]
    assert current() is STYLES["screen"]
    assert dict(rcParams) == before


def test_pdf_embeds_its_fonts_and_is_as_wide_as_a_column(runs: dict[str, Any], tmp_path: Path) -> None:
    with style("paper"):
        save(draw(runs["time"], Picture(what="energy")), tmp_path / "a.pdf", 100)
    data = (tmp_path / "a.pdf").read_bytes()
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", data)
    assert box
    assert float(box.group(1)) == pytest.approx(85.0 * MM * 72.0, abs=0.01)
    assert b"/FontFile2" in data  # TrueType, type 42
    assert b"/Type3" not in data
    names = set(re.findall(rb"/BaseFont /(?:[A-Z]{6}\+)?([\w-]+)", data))
    assert names
    assert all(name.startswith(b"STIX") for name in names)
    whole = b"".join(
        zlib.decompress(part) for part in re.findall(rb"stream\n(.*?)\nendstream", data, re.DOTALL) if part[:1] == b"x"
    )
    assert b"/Title" in data or b"/Title" in whole


def test_svg_keeps_text_as_text(runs: dict[str, Any], tmp_path: Path) -> None:
    with style("paper"):
        save(draw(runs["time"], Picture(what="energy")), tmp_path / "a.svg", 100)
    text = (tmp_path / "a.svg").read_text()
    assert ">energy [" in text
    assert "lost to friction</text>" in text
    assert "Ledger of energy, whole run</dc:title>" in text


def test_options_of_the_commands(runs: dict[str, Any], tmp_path: Path) -> None:
    file = runs["time"].path
    target = tmp_path / "a.png"
    result = CliRunner().invoke(
        render, [str(file), "--what", "rose", "--style", "paper", "--dpi", "100", "-o", str(target)]
    )
    assert result.exit_code == 0
    assert "caption: Discs by formula: Contact normals between grains, t = 5 s" in result.stderr
    assert "line: what the fabric alone tells" in result.stderr
    assert result.stdout == f"{target}\n"
    from matplotlib.image import imread

    assert imread(target).shape[1] == pytest.approx(85.0 * MM * 100.0, abs=1)
    result = CliRunner().invoke(render, [str(file), "--style", "poster"])
    assert result.exit_code == 2
    assert not (tmp_path / "time-sample.png").exists()


@pytest.mark.parametrize("what", ["table", "grid", "histories", "trajectories"])
@pytest.mark.parametrize("name", STYLES)
def test_comparisons_too(
    runs: dict[str, Any], tmp_path: Path, what: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dem_cli.report import look

    seen = []
    original = look.save
    monkeypatch.setattr(look, "save", lambda figure, *rest: (seen.append(clashes(figure)), original(figure, *rest)))
    other = tmp_path / "other.h5"
    made.make_file(other, interval=0.1, sample=shaped("ellipse"))
    target = tmp_path / "a.png"
    result = CliRunner().invoke(
        compare,
        [str(runs["time"].path), str(other), "--what", what, "--style", name, "--dpi", "100", "-o", str(target)],
    )
    assert result.exit_code == 0, result.exception
    assert seen == [[]]
    assert ("caption: " in result.stderr) == (name != "screen")


def test_shear_tests_compared_too(runs: dict[str, Any], tmp_path: Path) -> None:
    target = tmp_path / "a.pdf"
    result = CliRunner().invoke(
        compare,
        [str(runs["increment"].path)] * 2 + ["--what", "stress-strain", "--style", "paper-wide", "-o", str(target)],
    )
    assert result.exit_code == 0, result.exception
    assert "caption: Stress and strain of 2 tests" in result.stderr


def test_clashes_are_found() -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3, 2))
    figure.text(0.5, 0.5, "one")
    figure.text(0.52, 0.5, "two")
    figure.text(0.95, 0.1, "far too long")
    assert sorted(clashes(figure)) == ["'one' on 'two'", "over the edge: 'far too long'"]
    assert len(texts(figure)) == 3


def test_long_names_are_folded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs that differ in a setting are named by it."""
    from dem_cli.report import look

    seen: list[Any] = []
    original = look.save
    monkeypatch.setattr(look, "save", lambda figure, *rest: (seen.extend(clashes(figure)), original(figure, *rest)))
    files = [tmp_path / "a.h5", tmp_path / "b.h5"]
    for columns, file in zip((12, 8), files, strict=True):
        made.make_file(file, interval=0.1, columns=columns, rows=16)  # of another width
    for what in ("table", "histories", "trajectories"):
        result = CliRunner().invoke(
            compare, [*map(str, files), "--what", what, "--style", "paper", "-o", str(tmp_path / f"{what}.png")]
        )
        assert result.exit_code == 0, result.exception
    assert seen == []
    assert (
        "packed (ring) and after shaking (dot)"
        in CliRunner().invoke(compare, [*map(str, files), "--style", "paper", "-o", str(tmp_path / "again.svg")]).stderr
    )


@pytest.mark.parametrize("name", STYLES)
def test_sweeps_too(tmp_path: Path, name: str) -> None:
    import sweep_samples

    folder = sweep_samples.make_sweep(tmp_path / "sweep")
    result = CliRunner().invoke(render, [str(folder), "--what", "resonance", "--style", name, "--dpi", "100"])
    assert result.exit_code == 0, result.exception
    from dem_cli.report import sweep_figures
    from dem_cli.report.sweep import read_sweep

    found = read_sweep(folder)
    for kind in sweep_figures.KINDS:
        with style(name):
            _, _, figure = sweep_figures.draw(found, kind)
            assert clashes(figure) == []
            assert name == "screen" or figure.get_size_inches()[0] == pytest.approx(WIDTH[name])
