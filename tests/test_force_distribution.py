"""Density of normal forces over their mean, its exponential tail, and which frames it is drawn of."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import quasi_static_samples as quasi
import report_samples as made
from matplotlib.figure import Figure

from dem_cli.errors import ScenarioError
from dem_cli.report.figures import Picture, draw
from dem_cli.report.force_distribution import BIN, distribution
from dem_cli.report.look import style
from dem_cli.results import Results, open_results
from dem_cli.state import Contacts, Floats


def contacts_of(normal: Floats, *, wall: Any = None, sliding: Any = None) -> Contacts:
    n = len(normal)
    none = np.zeros(n)
    k = np.arange(n)
    j = k + 1 if wall is None else np.where(wall, -1, k + 1)
    slid = np.zeros(n, dtype=bool) if sliding is None else sliding
    return Contacts(k, j, none, none, none, none, none, normal, none, none, slid)


def drawn(results: Results, **asked: Any) -> Figure:
    with style():
        return draw(results, Picture(what="force-distribution", **asked))


def test_density_integrates_to_one_and_its_mean_is_one() -> None:
    force = np.random.default_rng(3).gamma(2.0, 7.0, 5000)
    found = distribution(contacts_of(force))
    assert found is not None
    assert found.density.sum() * BIN == pytest.approx(1.0)
    assert np.diff(found.edges) == pytest.approx(BIN)
    assert (found.middle * found.density).sum() * BIN == pytest.approx(1.0, abs=0.01)
    assert found.mean == pytest.approx(force.mean())
    np.testing.assert_allclose(
        found.density * len(force) * BIN, np.histogram(force / force.mean(), found.edges)[0], atol=1e-9
    )


def test_tail_of_exponential_forces_decays_as_they_do() -> None:
    """P(f) = exp(-f): the decay is 1, and the tail is the density itself."""
    found = distribution(contacts_of(np.random.default_rng(1).exponential(250.0, 200_000)))
    assert found is not None
    assert found.decay == pytest.approx(1.0, abs=0.02)
    f = np.array([1.0, 2.0, 4.0])
    np.testing.assert_allclose(found.tail(f), np.exp(-f), rtol=0.06)
    assert found.share == pytest.approx(np.exp(-1.0), abs=0.01)


def test_only_grains_that_press_on_each_other_count() -> None:
    found = distribution(contacts_of(np.array([1.0, 3.0, 50.0, 0.0, -4.0]), wall=[False, False, True, False, False]))
    assert found is not None
    assert (found.count, found.mean) == (2, 2.0)
    assert np.isnan(found.decay)
    assert distribution(contacts_of(np.array([5.0]), wall=[True])) is None


def test_sliding_contacts_are_a_part_of_the_whole() -> None:
    force = np.linspace(0.1, 3.9, 40)
    found = distribution(contacts_of(force, sliding=force < 1.0))
    assert found is not None
    assert np.all(found.sliding <= found.density + 1e-12)
    assert found.sliding.sum() * BIN == pytest.approx(np.mean(force < 1.0))


def test_a_run_shows_one_frame_and_its_sliding_contacts(tmp_path: Path) -> None:
    with open_results(made.make_file(tmp_path / "run.h5", interval=0.5)) as results:
        figure = drawn(results)
        wanted = distribution(results.frame(-1).contacts)
        assert wanted is not None
        ax = figure.axes[0]
        points, tail, sliding = ax.lines
        kept = wanted.density > 0.0
        np.testing.assert_allclose(points.get_xdata(), wanted.middle[kept])
        np.testing.assert_allclose(points.get_ydata(), wanted.density[kept])
        assert tail.get_ydata()[0] == pytest.approx(wanted.share * wanted.decay)
        assert f"{wanted.decay:.3g}" in tail.get_label()
        np.testing.assert_allclose(sliding.get_ydata(), wanted.sliding[wanted.sliding > 0.0])
        assert ax.get_yscale() == "log"
        assert f"{wanted.count} contacts" in figure.get_supxlabel()
        assert "t = 2 s" in drawn(results, time=2.0).get_suptitle()


def test_a_shear_test_shows_start_and_peak(tmp_path: Path) -> None:
    path = tmp_path / "test.h5"
    quasi.write_test(path)
    with open_results(path) as results:
        labels = [str(one.get_label()) for one in drawn(results).axes[0].lines]
        assert [label.split(",")[0] for label in labels if not label.startswith("tail")] == ["start", "peak"]
        assert (
            len([one for one in drawn(results, increment=10).axes[0].lines if one.get_label() == "all contacts"]) == 1
        )


def test_grains_that_do_not_touch_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open_results(made.make_file(tmp_path / "run.h5", columns=5, rows=5, interval=0.5, tracks=None)) as results:
        alone = replace(results.frame(-1), contacts=None)
        monkeypatch.setattr(results, "frame", lambda _: alone)
        with pytest.raises(ScenarioError, match="do not press on each other at t = 5 s"):
            drawn(results)
