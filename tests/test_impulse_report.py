"""`dem report` on runs of bodies in 3D whose answers are known."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import impulse_runs as made
import numpy as np
import pytest
from click.testing import CliRunner, Result
from results_samples import write_all as write_grains

from dem_cli.cli import main
from dem_cli.errors import ScenarioError
from dem_cli.report.impulse import BodySummary, body_summary
from dem_cli.report.impulse_checks import Bounces, collided
from dem_cli.report.impulse_text import blocks
from dem_cli.report.kinds import kind_of
from dem_cli.report.text import plain
from dem_cli.results import BodyResults, open_results


def summary_of(path: Path) -> BodySummary:
    with open_results(path) as results:
        assert isinstance(results, BodyResults)
        return body_summary(results)


def text_of(path: Path) -> str:
    return "\n\n".join(plain(block) for block in blocks(summary_of(path)))


def dem(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(part) for part in arguments])


# ------------------------------------------------------------------------------------------------ closed forms


def test_bounces_in_closed_form() -> None:
    """Thrown up with 2 m/s from 1 m: against a simulation in small steps."""
    form = Bounces(gap=1.0, start=2.0, gravity=10.0, restitution=0.8)
    assert form.impact == pytest.approx(np.sqrt(24.0))
    assert form.time(1) == pytest.approx((2.0 + np.sqrt(24.0)) / 10.0)
    assert form.time(3) - form.time(2) == pytest.approx(2.0 * form.rebound(2) / 10.0)
    times = np.array([0.0, 0.3, form.time(1) + 1e-9, form.time(2) - 1e-9])
    u = form.impact
    assert form.velocity(times) == pytest.approx([2.0, -1.0, 0.8 * u, -0.8 * u], abs=1e-6)
    assert form.velocity(np.array([1e3]))[0] == 0.0
    assert Bounces(1.0, 0.0, 10.0, 0.0).velocity(np.array([0.1, 1.0])).tolist() == [-1.0, 0.0]


def test_central_impact_keeps_momentum_and_gives_back_e() -> None:
    for e in (0.0, 0.5, 1.0):
        a, b = collided((1.0, 3.0), (2.0, -1.0), e)
        assert a + 3.0 * b == pytest.approx(-1.0)
        assert b - a == pytest.approx(3.0 * e)


# ------------------------------------------------------------------------------------------------ checks


@pytest.mark.parametrize("every", [1, 7])
def test_drop(tmp_path: Path, every: int) -> None:
    """Whatever the interval of the tracks, the restitution comes out exactly, and times as the split step has them."""
    (check,) = summary_of(made.drop_file(tmp_path / "a.h5", every=every)).checks
    rows = check.rows[:3]
    u = np.sqrt(2.0 * made.G * 0.6)
    assert [row["bounce"] for row in rows] == [1.0, 2.0, 3.0]
    assert [row["ratio"] for row in rows] == pytest.approx([0.5] * 3, abs=1e-9)
    assert [row["rebound_closed"] for row in rows] == pytest.approx([0.5 * u, 0.25 * u, 0.125 * u])
    first = np.sqrt(2.0 * 0.6 / made.G)
    assert [row["time_closed"] for row in rows] == pytest.approx([first, 2.0 * first, 2.5 * first])
    # The first impact is in the step in which the box meets the floor.
    assert rows[0]["time"] == pytest.approx(0.35025, abs=1e-9)
    assert rows[0]["time_error"] == pytest.approx((0.35025 - first) / 5e-4, abs=1e-6)
    assert all(row["spin"] == 0.0 for row in rows)


def test_drop_with_another_restitution_is_told(tmp_path: Path) -> None:
    """The scene says 0.5, the box bounces as with 0.4."""
    path = made.drop_file(tmp_path / "a.h5", e=0.4)
    import h5py

    with h5py.File(path, "a") as file:
        file["materials/restitution"][...] = 0.5
    (check,) = summary_of(path).checks
    assert check.rows[0]["ratio"] == pytest.approx(0.4)
    assert check.rows[0]["rebound_error"] == pytest.approx(-0.2, abs=2e-3)


def test_slope(tmp_path: Path) -> None:
    (check,) = summary_of(made.slope_file(tmp_path / "a.h5")).checks
    assert len(check.rows) == 20
    assert [row["friction"] for row in check.rows[::5]] == [0.0, 0.1, 0.3, 0.6]
    for row in check.rows:
        want = made.G * max(0.0, 0.5 - row["friction"] * np.sqrt(0.75)) * row["time"]
        assert row["closed"] == pytest.approx(want, rel=1e-9)
        assert row["velocity"] == pytest.approx(want, rel=1e-9)
        assert abs(row["off_plane"]) < 1e-12
    assert check.notes == ("body 3: friction 0.6 holds it (tan q = 0.5774); largest speed 0 m/s",)
    (wrong,) = summary_of(made.slope_file(tmp_path / "b.h5", (0.1,), error=1e-3)).checks
    assert [row["error"] for row in wrong.rows] == pytest.approx([1e-3] * 5, rel=1e-6)


def test_collision_of_unequal_masses(tmp_path: Path) -> None:
    """1 kg with 2 m/s on 3 kg, e = 0.5: -0.25 and 0.75 m/s."""
    (check,) = summary_of(made.collision_file(tmp_path / "a.h5")).checks
    assert [row["closed"] for row in check.rows] == pytest.approx([-0.25, 0.75])
    assert [row["error"] for row in check.rows] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert "kinetic energy is 0.4375 of that before, closed form 0.4375" in check.notes[0]
    (equal,) = summary_of(made.collision_file(tmp_path / "b.h5", masses=(1.0, 1.0), wrong=1e-4)).checks
    assert [row["closed"] for row in equal.rows] == pytest.approx([0.5, 1.5])
    assert equal.rows[1]["error"] == pytest.approx(1e-4)
    assert "momentum changes by 5.0e-05" in equal.notes[0]


def test_row(tmp_path: Path) -> None:
    (check,) = summary_of(made.row_file(tmp_path / "a.h5")).checks
    assert [row["after"] for row in check.rows] == pytest.approx([0.0, 0.0, 0.0, 1.0])
    assert [row["closed"] for row in check.rows] == [0.0, 0.0, 0.0, 1.0]
    assert check.notes[0].startswith("restitution 1: momentum is 1 and kinetic energy 1 ")
    (other,) = summary_of(made.row_file(tmp_path / "b.h5", e=0.5)).checks
    assert np.isnan(other.rows[0]["closed"])


def test_without_tracks_a_check_takes_the_frames(tmp_path: Path) -> None:
    (check,) = summary_of(made.collision_file(tmp_path / "a.h5", every=(1, 10, 50))).checks
    path = made.write_run(
        tmp_path / "b.h5",
        *without_tracks(tmp_path / "a.h5"),
        dt=1e-3,
        check="collision",
        gravity=np.zeros(3),
        every=(1, 1, 1),
    )
    (again,) = summary_of(path).checks
    assert [row["after"] for row in again.rows] == [row["after"] for row in check.rows]


def without_tracks(path: Path):  # type: ignore[no-untyped-def]
    with open_results(path) as results:
        assert isinstance(results, BodyResults)
        return results.scene, [(results.frame(k).time, results.frame(k).bodies) for k in range(results.n_frames)]


# ------------------------------------------------------------------------------------------------ the rest


def test_run_out(tmp_path: Path) -> None:
    """Body k stops 8 + 0.5 k metres away; the last of 30 left the scene."""
    found = summary_of(made.rockfall_file(tmp_path / "a.h5")).runout
    assert found is not None
    assert found.distance == pytest.approx((8.0, 9.45, 15.25, 21.05, 22.5))
    assert found.distance_mean == pytest.approx(15.25)
    assert (found.at_rest, found.escaped) == (29, 1)
    with open_results(tmp_path / "a.h5") as results:
        way = results.frame(-1).bodies.x - results.frame(0).bodies.x
    assert found.angle[-1] == pytest.approx(np.arctan(-way[:, 2] / way[:, 0]).max())
    assert summary_of(made.row_file(tmp_path / "b.h5")).runout is None


def test_stage_energy_and_solver(tmp_path: Path) -> None:
    found = summary_of(made.pile_file(tmp_path / "a.h5"))
    (stage,) = found.stages
    assert stage.after["fill_height"] == pytest.approx(1.9405, abs=1e-3)
    assert stage.after["coordination"] == pytest.approx(60 / 36)
    assert stage.penetration_largest == pytest.approx(1e-4)
    assert (found.solver.steps, found.solver.most_iterations) == (2.0, 42.0)
    assert found.energy is not None
    assert found.energy.stored_total + found.energy.lost_total == pytest.approx(found.energy.stored_start)
    slide = summary_of(made.slope_file(tmp_path / "b.h5", residual=1.0))
    assert slide.energy is not None
    assert slide.energy.lost["friction"] > 0.0
    assert slide.energy.residual_largest_ratio == pytest.approx(1000.0 / slide.energy.energy_in)
    assert slide.solver.steps == 1000.0
    assert slide.solver.impact_iterations == pytest.approx(3.0, abs=0.01)
    assert any("the ledger misses" in line for line in slide.warnings)


def test_caps_are_warned_of(tmp_path: Path) -> None:
    path = made.drop_file(tmp_path / "a.h5", capped=3)
    assert "3 solves hit their cap" in text_of(path)
    assert "hit their cap" not in text_of(made.drop_file(tmp_path / "b.h5"))


def test_an_incomplete_run_says_so(tmp_path: Path) -> None:
    text = text_of(made.row_file(tmp_path / "a.h5", complete=False))
    assert "INCOMPLETE" in text
    assert "the run is incomplete" in text


def test_head_tells_kinds_and_pairs(tmp_path: Path) -> None:
    text = text_of(made.rockfall_file(tmp_path / "a.h5"))
    for line in (
        "15 x box: surface of 12 triangles, scale 0.7",
        "15 x pair: clump of 2 spheres",
        "hill, 960 triangles",
        "solver pgs",
    ):
        assert line in text, line
    contacts = text[text.index("Contacts") :].splitlines()[2:4]
    assert [line.split() for line in contacts] == [
        ["rock", "-", "rock", "0.3", "0.5"],
        ["rock", "-", "slope", "0.6", "0.25"],
    ]


def test_command_prints_text_json_and_csv(tmp_path: Path) -> None:
    one, two = made.rockfall_file(tmp_path / "a.h5"), made.collision_file(tmp_path / "b.h5")
    done = dem("report", two)
    assert done.exit_code == 0
    assert "Check against the closed form: collision" in done.stdout
    tree = json.loads(dem("report", two, "--json").stdout)
    assert (tree["format"], tree["checks"][0]["kind"]) == ("dem-cli report of bodies", "collision")
    assert tree["stages"][0]["before"]["void_ratio"] is None
    both = dem("report", one, two)
    assert [line.split()[1] for line in both.stdout.splitlines()] == ["bodies", "30", "2"]
    assert dem("report", one, "--csv", tmp_path / "csv").exit_code == 0
    assert {path.name for path in (tmp_path / "csv").iterdir()} == {
        "series.csv",
        "stages.csv",
        "tracks.csv",
        "runout.csv",
    }
    with (tmp_path / "csv" / "runout.csv").open() as stream:
        rows = list(csv.reader(stream))
    assert rows[0][:3] == ["body", "kind", "distance [m]"]
    assert [float(row[2]) for row in rows[1:]] == pytest.approx([8.0 + 0.5 * k for k in range(30)])
    with (tmp_path / "csv" / "tracks.csv").open() as stream:
        head = next(csv.reader(stream))
    assert head[:7] == ["time [s]", "grain", "x [m]", "y [m]", "z [m]", "q0", "q1"]


def test_files_of_different_kinds_are_refused(tmp_path: Path) -> None:
    grains, bodies = write_grains(tmp_path / "a.h5"), made.row_file(tmp_path / "b.h5")
    assert kind_of([bodies, bodies]) == "bodies"
    with pytest.raises(
        ScenarioError, match=r"a\.h5 is a run over time of grains in 2D and .*b\.h5 a run of bodies in 3D"
    ):
        kind_of([grains, bodies])
    refused = dem("compare", bodies)
    assert refused.exit_code == 2
    assert "dem report" in refused.stderr
