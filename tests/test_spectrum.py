"""Spectrum of the free surface: peaks where the surface swings, as high as it swings, and lines where the formulas say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import report_samples as made
from matplotlib.figure import Figure

from dem_cli.analysis.sloshing import amplitude_spectrum
from dem_cli.analysis.surface import antisymmetric_mode
from dem_cli.errors import ScenarioError
from dem_cli.report.figures import Picture, draw
from dem_cli.report.look import style
from dem_cli.report.spectrum import MODES, surface_modes
from dem_cli.report.summary import summary
from dem_cli.results import Results, open_results

G = 9.80665


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make_file(tmp_path_factory.mktemp("run") / "run.h5", columns=40, rows=5, tracks=None)


@pytest.fixture
def results(path: Path) -> Iterator[Results]:
    with open_results(path) as found:
        yield found


def drawn(results: Results, **asked: Any) -> Figure:
    with style():
        return draw(results, Picture(what="spectrum", **asked))


def line(figure: Figure, start: str) -> Any:
    (found,) = [one for one in figure.axes[0].lines if str(one.get_label()).startswith(start)]
    return found


@pytest.mark.parametrize("frequency", [0.8, 2.5, 7.3])
def test_a_sine_has_a_peak_at_its_frequency_and_of_its_amplitude(frequency: float) -> None:
    time = np.arange(0.0, 10.0, 0.02)
    found, amplitude = amplitude_spectrum(time, 0.3 + 0.01 * time + 0.004 * np.sin(2 * np.pi * frequency * time + 0.4))
    top = int(np.argmax(amplitude))
    assert found[top] == pytest.approx(frequency, abs=found[1])
    assert amplitude[top] == pytest.approx(0.004, rel=0.02)
    assert amplitude[np.abs(found - frequency) > 0.5].max() < 4e-4


def test_spectrum_of_too_little_is_empty() -> None:
    assert [len(one) for one in amplitude_spectrum(np.arange(15.0), np.ones(15))] == [0, 0]


def test_each_mode_of_a_surface_is_told_from_the_others() -> None:
    places = (np.arange(4000) + 0.5) / 4000
    shape = sum(a * np.cos(n * np.pi * places) for n, a in ((1, 0.3), (2, -0.2), (3, 0.05)))
    bins = (0.5 + shape).reshape(40, 100).mean(axis=1)
    np.testing.assert_allclose(surface_modes(bins[None])[0], [0.3, -0.2, 0.05], atol=1e-6)
    assert surface_modes(bins[None])[0, 0] == pytest.approx(antisymmetric_mode(bins))
    holed = bins.copy()
    holed[20] = np.nan
    np.testing.assert_allclose(surface_modes(holed[None])[0], [0.3, -0.2, 0.05], atol=2e-3)
    assert MODES == 3


def test_first_mode_swings_as_the_file_says(results: Results) -> None:
    """The file: 4 mm at 2.5 Hz and 1 mm at the 10 Hz of the shaking."""
    curve = line(drawn(results), "mode 1")
    frequency, amplitude = curve.get_data()
    for known, size in ((1.0 / made.SLOSH, 4.0), (1.0 / made.DRIVING, 1.0)):
        near = np.abs(frequency - known) < 0.5
        assert frequency[near][np.argmax(amplitude[near])] == pytest.approx(known, abs=0.05)
        assert amplitude[near].max() == pytest.approx(size, rel=0.05)
    ax = curve.axes
    assert ax.get_ylabel().endswith("[mm]")
    assert ax.get_xlabel() == "frequency [Hz]"
    inside = results.series["time"] >= made.SETTLED
    wanted = amplitude_spectrum(results.series["time"][inside], results.series["mode1"][inside])
    np.testing.assert_allclose(amplitude, 1e3 * wanted[1][1:])


def test_lines_lie_where_theory_and_shaking_are(results: Results) -> None:
    figure = drawn(results)
    depth, width = results.stages[1].before["depth"], results.width
    for n in (1, 2, 3):
        f = math.sqrt(n * math.pi * G / width * math.tanh(n * math.pi * depth / width)) / (2.0 * math.pi)
        found = line(figure, f"f{n} = ")
        assert found.get_xdata() == pytest.approx([f, f])
        assert "linear theory" in found.get_label()
    thesis = math.sqrt(math.pi * G * math.tanh(2.0 * math.pi * depth / width) / width) / (2.0 * math.pi)
    (found,) = [one for one in figure.axes[0].lines if "thesis" in str(one.get_label())]
    assert found.get_xdata() == pytest.approx([thesis, thesis])
    assert line(figure, "shaking, 10 Hz").get_xdata() == pytest.approx([10.0, 10.0])
    left, right = figure.axes[0].get_xlim()
    assert left < thesis < 10.0 < right


def test_marks_are_those_of_the_report(results: Results) -> None:
    report = summary(results).stages[1].sloshing
    assert report is not None
    dot = line(drawn(results), "strongest, ")
    assert dot.get_xdata()[0] == pytest.approx(1.0 / report.period)
    assert dot.get_ydata()[0] == pytest.approx(1e3 * report.amplitude)


def test_a_stage_without_shaking_has_theory_alone(results: Results) -> None:
    labels = [str(one.get_label()) for one in drawn(results, stage=1).axes[0].lines]
    assert any(label.startswith("f1 = ") for label in labels)
    assert not any("shaking" in label for label in labels)


def test_what_has_no_spectrum_is_one_line(results: Results, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="a spectrum is that of one stage; choose --stage 1 to 2"):
        drawn(results, stage=0)
    few = made.make_file(tmp_path / "few.h5", columns=5, rows=5, interval=0.5, tracks=None)
    with open_results(few) as other, pytest.raises(ScenarioError, match="fewer than 16 rows of the surface"):
        drawn(other)


def test_why_the_report_found_no_period_is_told(tmp_path: Path) -> None:
    slow = made.make_file(tmp_path / "slow.h5", columns=5, rows=5, interval=0.05, tracks=None)
    with open_results(slow) as other:
        assert "too seldom for the driving period of 0.1 s" in drawn(other).get_supxlabel()
