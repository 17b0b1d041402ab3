"""Rate of dilatancy of shear tests: the slope of the volumetric strain, and its picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import quasi_static_samples as quasi

from dem_cli.report.figures import Picture, draw
from dem_cli.report.look import style
from dem_cli.report.shear_rows import SLOPE_ROWS, dilatancy, stage_rows
from dem_cli.results import open_results


def test_slope_of_a_straight_line_is_its_own() -> None:
    """Expansion is e_v < 0, and dilatancy > 0; noise of single increments is evened out."""
    x = np.linspace(0.0, 0.03, 61)
    np.testing.assert_allclose(dilatancy({"shear_strain": x, "volumetric_strain": 0.001 - 0.2 * x}), 0.2)
    noise = 1e-5 * (-1.0) ** np.arange(61)
    found = dilatancy({"shear_strain": x, "volumetric_strain": noise - 0.2 * x})
    assert np.abs(found[SLOPE_ROWS:-SLOPE_ROWS] - 0.2).max() < 0.01
    assert np.isnan(dilatancy({"shear_strain": np.zeros(5), "volumetric_strain": np.zeros(5)})).all()


def test_picture_shows_the_rate_and_its_angle(tmp_path: Path) -> None:
    path = tmp_path / "test.h5"
    quasi.write_test(path)
    with open_results(path) as results, style():
        figure = draw(results, Picture(what="dilatancy"))
        rows = stage_rows(results, 2)
    ax = figure.axes[0]
    np.testing.assert_allclose(ax.lines[0].get_ydata(), dilatancy(rows))
    np.testing.assert_allclose(ax.lines[0].get_xdata(), 100.0 * rows["shear_strain"])
    (right,) = ax.child_axes
    assert right.get_ylabel() == "dilatancy angle [deg]"
    figure.draw_without_rendering()
    low, high = ax.get_ylim()
    assert right.get_ylim() == pytest.approx((np.degrees(np.arcsin(low)), np.degrees(np.arcsin(high))))
    assert f"slope over {2 * SLOPE_ROWS + 1} increments" in figure.get_supxlabel()
