"""A container shaken by a record, from the scenario to the result file, the report and the pictures."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from engine_samples import text_of
from scenario_text import ABSENT

from dem_cli.cli import main
from dem_cli.report.export import export_csv
from dem_cli.report.figures import Picture, draw
from dem_cli.report.look import style
from dem_cli.report.summary import summary
from dem_cli.report.text import blocks, comparison, plain
from dem_cli.results import Results, open_results
from dem_cli.run import run_scenario
from dem_cli.scenario import Scenario, Shake, load_scenario

TIME = 0.01 * np.arange(60)
NS = 300.0 * np.sin(2 * np.pi * 6.0 * TIME) * np.hanning(60) + 5.0
UD = 100.0 * np.sin(2 * np.pi * 9.0 * TIME) * np.hanning(60)
# What integration leaves of the offset at the end.
LEFT = f"{np.sum(0.5 * 0.01 * (NS[1:] + NS[:-1])):.3g} cm/s"
RECORD = {"file": "ns.csv", "second": {"column": "UD"}, "peak": "500 gal", "baseline": "linear", "pad": "20 ms"}
CHANGES: dict[str, Any] = {
    "title": "by record",
    "grains.count": 20,
    "container.width": "16 cm",
    "packing.grid": {"columns": 5, "spacing": "3 cm", "shift": "1 cm"},
    "contact.damping_ratio": 0.5,
    "stage": [
        {"kind": "settle"},
        {"kind": "shake", "record": RECORD, "angle": "180 deg"},
        {"kind": "shake", "amplitude": "100 gal", "frequency": "10 Hz", "duration": "0.2 s"},
    ],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("recorded")
    rows = [f"{t:.2f},{a!r},{b!r}" for t, a, b in zip(TIME, NS.tolist(), UD.tolist(), strict=True)]
    (found / "ns.csv").write_text("\n".join(["time [s],NS [gal],UD [gal]", *rows]) + "\n")
    (found / "a.toml").write_text(text_of(CHANGES))
    return found


@pytest.fixture(scope="module")
def scenario(folder: Path) -> Scenario:
    return load_scenario(folder / "a.toml")


@pytest.fixture(scope="module")
def results(folder: Path, scenario: Scenario) -> Iterator[Results]:
    with open_results(run_scenario(scenario, folder / "a.h5")) as found:
        yield found


def inside(results: Results, number: int) -> Any:
    stage = results.stages[number - 1]
    time = results.series["time"]
    return (time > stage.start) & (time <= stage.end + 1e-12)


def test_ground_moves_as_the_record_says(scenario: Scenario, results: Results) -> None:
    shake = scenario.stages[1]
    assert isinstance(shake, Shake)
    motion = shake.motion
    assert motion is not None
    rows = inside(results, 2)
    time = results.series["time"][rows] - results.stages[1].start
    within = (time < 0.02 + TIME[-1] - 1e-9) | (time > 0.02 + TIME[-1] + 1e-9)  # it ends with a jump
    samples = motion.begin + motion.interval * np.arange(len(motion.acceleration))
    for axis, sign, column in (("x", -1.0, 0), ("y", -1.0, 1)):  # turned by 180 degrees
        wanted = sign * np.interp(time, samples, motion.acceleration[:, column], left=0.0, right=0.0)
        np.testing.assert_allclose(results.series[f"ground_a{axis}"][rows][within], wanted[within], atol=1e-9)
        assert abs(results.series[f"ground_v{axis}"][rows][-1]) < 1e-12
        assert abs(results.series[f"ground_{axis}"][rows][-1]) < 1e-12
    assert results.stages[1].end - results.stages[1].start == pytest.approx(0.59 + 0.04)


def test_ledger_closes(results: Results) -> None:
    residual, put_in = results.series["residual"], results.series["energy_in"]
    begun = put_in > 0.0
    assert np.max(np.abs(residual[begun]) / put_in[begun]) < 1e-3
    shaken = inside(results, 2)
    assert np.ptp(residual[shaken]) < 1e-4 * np.ptp(results.series["work"][shaken])


def test_file_keeps_the_motion(scenario: Scenario, results: Results) -> None:
    shake = scenario.stages[1]
    assert isinstance(shake, Shake)
    assert shake.motion is not None
    assert list(results.motions) == [2]
    stored = results.motions[2]
    assert np.array_equal(stored.acceleration, shake.motion.acceleration)
    np.testing.assert_allclose(stored.time, 0.02 + TIME, rtol=1e-14)
    assert stored.facts == json.loads(json.dumps(shake.motion.facts()))


def test_report(results: Results) -> None:
    found = summary(results)
    assert [stage.motion is None for stage in found.stages] == [True, False, True]
    stage = found.stages[1]
    motion = stage.motion
    assert motion is not None
    first, second = motion.components
    assert (first.name, first.format, first.component, second.component) == ("ns.csv", "csv", "NS", "UD")
    assert first.recorded_peak == pytest.approx(0.01 * np.abs(NS).max())
    assert first.peak == pytest.approx(5.0)
    assert second.factor == first.factor
    assert (motion.interval, motion.begin, motion.baseline) == (0.01, 0.02, "linear")
    assert motion.duration == pytest.approx(0.63)
    assert first.residual_velocity_before == pytest.approx(0.0005 * np.sum(NS[1:] + NS[:-1]) * 0.1)
    assert abs(first.residual_velocity) < 1e-12 * first.peak_velocity
    assert first.predominant_period == pytest.approx(1 / 6.0, rel=0.1)
    # a record has no amplitude and frequency; its predominant period stands in for the driving one
    assert math.isnan(stage.amplitude)
    assert math.isnan(stage.frequency)
    assert stage.sloshing is not None
    assert stage.sloshing.driving_period == first.predominant_period
    assert not stage.sloshing.is_driving
    sine = found.stages[2].sloshing
    assert sine is not None
    assert sine.driving_period == pytest.approx(0.1)
    tree = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert tree["stages"][1]["motion"]["components"][0]["peak"] == pytest.approx(5.0)
    assert tree["stages"][2]["motion"] is None


def test_report_as_text(results: Results) -> None:
    text = "\n\n".join(plain(block) for block in blocks(summary(results)))
    (block,) = (part for part in text.split("\n\n") if part.startswith("Recorded motion"))
    assert "Stage 2: shake, ns.csv 500 gal, ns.csv " in text
    assert "Stage 3: shake, 100 gal 10 Hz" in text
    rows = {line.strip().split("  ")[0]: line for line in block.splitlines()[2:]}
    for label, words in (
        ("component", ["NS", "UD"]),
        ("understood", ["60 samples of NS in gal; every 0.01 s by its times"]),
        ("recorded", ["0.59 s every 10 ms"]),
        ("used", ["0.63 s every 10 ms"]),
        ("peak, recorded", [f"{np.abs(NS).max():.4g} gal", f"{np.abs(UD).max():.4g} gal"]),
        ("peak, used", ["500 gal"]),
        ("left at the end, as recorded", [LEFT, "cm"]),
        ("left at the end, baseline linear", ["0 cm/s, 0 cm"]),
        ("predominant period", ["s"]),
    ):
        for word in words:
            assert word in rows[label], (label, rows)
    assert "predominant period of the ground" in text
    assert "ns.csv 500 gal" in plain(comparison([summary(results)]))


def test_csv_leaves_amplitude_empty(results: Results, tmp_path: Path) -> None:
    paths = export_csv(results, summary(results), tmp_path / "out", force=False)
    (stages,) = (path for path in paths if path.name == "stages.csv")
    with stages.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == ["settle", "shake", "shake"]
    assert float(rows[2]["amplitude [m/s^2]"]) == 1.0


def test_picture_of_the_motion(results: Results) -> None:
    with style():
        figure = draw(results, Picture(what="motion", stage=2))
        sine = draw(results, Picture(what="motion"))  # the last shaking
        whole = draw(results, Picture(what="motion", stage=0))
    panels = figure.axes
    assert [panel.get_ylabel().split(" [")[0] for panel in panels] == ["acceleration", "velocity", "displacement"]
    x, y = (line for line in panels[0].lines if line.get_label() in ("x", "y"))
    start = results.stages[1].start
    np.testing.assert_allclose(x.get_xdata(), start + results.motions[2].time)
    np.testing.assert_allclose(x.get_ydata(), -100.0 * results.motions[2].acceleration[:, 0], atol=1e-9)
    np.testing.assert_allclose(y.get_ydata(), -100.0 * results.motions[2].acceleration[:, 1], atol=1e-9)
    assert panels[0].get_ylabel() == "acceleration [gal]"
    assert sine.axes[0].lines[0].get_label() == "x"
    assert len(sine.axes[0].lines) == 2  # one direction and the zero
    assert len(whole.axes[0].lines[0].get_xdata()) == len(results.series["time"])


def test_check_prints_it(folder: Path) -> None:
    done = CliRunner().invoke(main, ["check", str(folder / "a.toml")])
    assert done.exit_code == 0
    assert "less than ten rows" not in done.stderr.replace("stage 3", "")
    for words in (
        "record          ns.csv (NS), CSV: 60 samples of NS in gal; every 0.01 s by its times",
        "second          ns.csv (UD), CSV",
        "500 gal",
        f"{LEFT} and",
        "0 cm/s and 0 cm used (baseline: linear)",
        "predominant; Arias intensity",
    ):
        assert words in done.stdout, words
    tree = json.loads(CliRunner().invoke(main, ["check", str(folder / "a.toml"), "--json"]).stdout)
    assert tree["stages"][1]["record"]["components"][0]["peak"] == pytest.approx(5.0)
    assert tree["stages"][2]["record"] is None


def test_check_warns_of_ground_that_does_not_stop(folder: Path) -> None:
    options = ["--set", "stage.2.record.baseline=none", "--set", "output.interval=50 ms"]
    done = CliRunner().invoke(main, ["check", str(folder / "a.toml"), *options])
    assert "stage 2 leaves the ground moving at" in done.stderr
    assert 'record.baseline = "mean" ends at rest' in done.stderr
    assert "stage 2 shakes at a predominant period of" in done.stderr


def test_mistake_ends_with_2_and_writes_nothing(folder: Path) -> None:
    (folder / "bad.csv").write_text((folder / "ns.csv").read_text().replace("0.30,", "0.305,"))
    options = ["--set", "stage.2.record.file=bad.csv", "-o", str(folder / "bad.h5")]
    done = CliRunner().invoke(main, ["run", str(folder / "a.toml"), *options])
    assert done.exit_code == 2
    assert 'record.file = "bad.csv": line 32: 0.015 after the time before, where 0.01 is usual' in done.stderr
    assert not (folder / "bad.h5").exists()


def test_sine_alone_has_no_motions(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(
        text_of({**CHANGES, "stage": CHANGES["stage"][2:], "grains.radius": "7 mm", "seed": ABSENT})
    )
    with open_results(run_scenario(load_scenario(tmp_path / "a.toml"), tmp_path / "a.h5")) as found:
        assert found.motions == {}
