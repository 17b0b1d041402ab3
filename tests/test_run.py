"""From a scenario to a result file: when rows are written, how stages end, what the ledger says, and that it all repeats itself."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from engine_samples import soft, text_of

import dem_cli
from dem_cli.assembly import build_assembly
from dem_cli.engines.explicit.engine import QUIET_ROWS
from dem_cli.engines.explicit.timestep import choose_time_step
from dem_cli.errors import RunError
from dem_cli.results import Results, open_results, partial_path
from dem_cli.run import run_scenario
from dem_cli.scenario import Scenario

# A box of 16 cm in which 40 grains fall 20 cm.
FALL: dict[str, Any] = {
    "grains.count": 40,
    "container.width": "16 cm",
    "packing.grid": {"columns": 5, "spacing": "3 cm", "shift": "1 cm"},
    "contact.damping_ratio": 0.5,
    "stage": [{"kind": "settle"}],
}
STIFF = {"normal_stiffness": "2e7 N/m", "tangential_stiffness": "7e6 N/m"}
SHAKE = {"kind": "shake", "amplitude": "500 gal", "frequency": "10 Hz", "duration": "0.2 s"}


def fall(changes: dict[str, Any] | None = None) -> Scenario:
    return soft({**FALL, **(changes or {})})


def run(folder: Path, changes: dict[str, Any] | None = None, name: str = "run.h5") -> Results:
    return open_results(run_scenario(fall(changes), folder / name))


def is_multiple(times: Any, every: float) -> bool:
    count = np.asarray(times) / every
    return bool(np.all(np.abs(count - np.round(count)) < 1e-6))


# -- outputs at their times ----------------------------------------------------------------------------------------------


def test_outputs_are_at_multiples_of_their_intervals(tmp_path: Path) -> None:
    """Intervals that fit neither each other, nor the stages, nor the time step; the ends of stages are written as well."""
    series, frames, tracks = 0.007, 0.031, 0.0023
    stages = [
        {"kind": "run", "duration": "0.1 s"},
        SHAKE | {"duration": "0.0505 s"},
        {"kind": "run", "duration": "50 ms"},
    ]
    output = {
        "interval": f"{series} s", "frames": f"{frames} s", "tracks": {"grains": [3, 0, 39], "interval": f"{tracks} s"},
    }  # fmt: skip
    ends = [0.0, 0.1, 0.1505, 0.2005]
    with run(tmp_path, {"output": output, "stage": stages}) as results:
        assert results.tracks is not None
        for times, every in (
            (results.series["time"], series),
            (results.frame_times, frames),
            (results.tracks.time, tracks),
        ):
            wanted = sorted({*(np.arange(1, 0.2005 / every) * every).round(12), *ends})
            assert times == pytest.approx(wanted, rel=1e-12, abs=1e-15)
        assert [stage.end for stage in results.stages] == pytest.approx(ends[1:], rel=1e-15)
        assert [stage.start for stage in results.stages] == [0.0] + [stage.end for stage in results.stages[:-1]]
        assert np.array_equal(results.surface.time, results.series["time"])
        assert results.tracks.ids.tolist() == [3, 0, 39]
        last = results.frame(-1)
        for name in ("x", "y", "angle", "vx", "vy", "spin"):
            assert results.tracks.arrays[name][-1].tolist() == getattr(last.grains, name)[[3, 0, 39]].tolist()
        steps = np.diff(results.series["step"]) * results.series["time_step"][1:]
        assert steps == pytest.approx(
            np.diff(results.series["time"]), rel=0.7
        )  # frames and tracks divide some intervals
        assert results.series["time_step"].max() <= fall_limit()
        assert results.stages[1].before["kinetic"] == results.stages[0].after["kinetic"]


def fall_limit() -> float:
    scenario = fall()
    return choose_time_step(scenario, build_assembly(scenario))[1]


def test_outputs_do_not_bend_the_motion(tmp_path: Path) -> None:
    """More outputs at odd moments: the same motion but for the time step, which they change again and again."""
    stage = [{"kind": "run", "duration": "80 ms"}]
    found = []
    for name, frames in (("few", "40 ms"), ("many", "1.37 ms")):
        output = {"interval": "10 ms", "frames": frames}
        with run(tmp_path, {"stage": stage, "output": output}, f"{name}.h5") as results:
            found.append(results.frame(-1).grains)
    assert np.abs(found[0].x - found[1].x).max() < 1e-4
    assert np.abs(found[0].y - found[1].y).max() < 1e-4


# -- stages ----------------------------------------------------------------------------------------------------------------


def rest_measures(results: Results) -> tuple[float, float]:
    """Unbalanced force ratio, and kinetic energy of a grain over its weight times its radius, worked out from the last frame."""
    frame = results.frame(-1)
    grains, contacts = frame.grains, frame.contacts
    assert contacts is not None
    force = np.zeros((len(grains), 2))
    force[:, 1] -= grains.mass * 9.80665
    push = np.stack(
        [contacts.normal * contacts.nx - contacts.shear * contacts.ny, contacts.normal * contacts.ny + contacts.shear * contacts.nx],
        axis=1,
    )  # fmt: skip
    np.subtract.at(force, contacts.i, push)
    np.add.at(force, contacts.j[contacts.j >= 0], push[contacts.j >= 0])
    unbalanced = np.hypot(*force.T).mean() / np.hypot(contacts.normal, contacts.shear).mean()
    swing = grains.mass * (grains.vx**2 + grains.vy**2) + grains.inertia * grains.spin**2
    return float(unbalanced), float(0.5 * swing.mean() / (grains.mass * 9.80665 * grains.radius).mean())


@pytest.mark.parametrize(("unbalanced", "kinetic"), [(1e-4, 1e-6), (1e-2, 1e-7), (1e-5, 1e-2)])
def test_settling_ends_at_rest(tmp_path: Path, unbalanced: float, kinetic: float) -> None:
    """At its end both measures are below their limits; in three rows; in the row before one of them was not."""
    stage = [{"kind": "settle", "unbalanced": unbalanced, "kinetic": kinetic}]
    with run(tmp_path, {"stage": stage}) as results:
        assert results.complete
        assert results.stages[0].reason.startswith("at rest: unbalanced force ratio ")
        assert results.warnings == []
        found = rest_measures(results)
        assert found[0] < unbalanced
        assert found[1] < kinetic
        series = results.series
        assert series["unbalanced"][-1] == pytest.approx(found[0], rel=1e-6)
        assert series["time"][-1] == results.stages[0].end < 20.0
        scale = series["kinetic"][-1] / found[1]
        still = (series["unbalanced"] < unbalanced) & (series["kinetic"] / scale < kinetic)
        assert still[-QUIET_ROWS:].all()
        assert not still[-1 - QUIET_ROWS]
        assert series["airborne"][-1] == 0.0


def test_grains_in_the_air_are_not_at_rest(tmp_path: Path) -> None:
    """They start at rest and without contacts, and are not taken as settled however slow they are."""
    stage = [{"kind": "settle", "kinetic": 100.0}]
    with run(tmp_path, {"stage": stage, "packing.grid.row_spacing": "4 cm"}) as results:
        assert results.series["contacts"][:3].max() == 0.0
        assert results.stages[0].end > 0.2


def test_settling_ends_at_its_limit_with_a_warning(tmp_path: Path) -> None:
    with run(tmp_path, {"stage": [{"kind": "settle", "name": "too short", "limit": "0.123 s"}]}) as results:
        assert results.complete
        assert results.stages[0].end == 0.123
        assert results.stages[0].reason.startswith("still moving after 0.123 s: unbalanced force ratio ")
        assert len(results.warnings) == 1
        assert results.warnings[0] == f"stage too short: {results.stages[0].reason}"


LIVELY: dict[str, Any] = {"contact.damping_ratio": 0.02, "material": STIFF}


@pytest.fixture(scope="module")
def undamped(tmp_path_factory: pytest.TempPathFactory) -> float:
    with run(tmp_path_factory.mktemp("undamped"), LIVELY) as results:
        assert results.series["damping"].max() == 0.0
        return calm(results)


def calm(results: Results) -> float:
    """When the first stage's kinetic energy was last above a ten-thousandth of its peak; a single rattler decides when it ends."""
    settling = results.series["stage"] == 0.0
    kinetic = results.series["kinetic"][settling]
    return float(results.series["time"][settling][kinetic > 1e-4 * kinetic.max()][-1])


@pytest.mark.parametrize("damping", [{"mass": "8 1/s"}, {"local": 0.3}, {"mass": "3 1/s", "local": 0.1}])
def test_extra_damping_shortens_settling(tmp_path: Path, damping: dict[str, Any], undamped: float) -> None:
    """It takes energy, which the ledger knows, and only while settling."""
    stage = [{"kind": "settle", "damping": damping}, SHAKE]
    with run(tmp_path, {**LIVELY, "stage": stage}) as results:
        assert calm(results) < 0.9 * undamped
        taken = results.series["damping"]
        settling = results.series["stage"] == 0.0
        assert (np.diff(taken[settling]) >= 0.0).all()
        assert taken[settling][-1] > 0.1 * results.series["energy_in"][settling][-1]
        assert set(taken[~settling]) == {taken[settling][-1]}
        assert residual_share(results) < 1e-3


def test_mass_damping_of_a_falling_grain(tmp_path: Path) -> None:
    """v' = g - c v has the closed form v = g/c (1 - exp(-c t))."""
    changes = {
        "grains": {"count": 1, "radius": "5 mm", "density": "2480 kg/m^3"},
        "packing.grid": {"columns": 1, "spacing": "3 m", "shift": "0 m"},
        "container.width": "3 m",
        "stage": [{"kind": "settle", "limit": "0.4 s", "damping": {"mass": "8 1/s"}}],
    }
    with run(tmp_path, changes) as results:
        assert results.frame(-1).grains.vy[0] == pytest.approx(-9.80665 / 8.0 * (1.0 - math.exp(-3.2)), rel=1e-3)
        series = results.series
        assert series["damping"][-1] + series["kinetic"][-1] == pytest.approx(series["energy_in"][-1], rel=1e-6)


def test_cycles_are_a_duration(tmp_path: Path) -> None:
    files = []
    for name, stage in (("cycles", {"cycles": 3}), ("duration", {"duration": "0.3 s"})):
        shake = {"kind": "shake", "amplitude": "500 gal", "frequency": "10 Hz", **stage}
        changes = {"stage": [{"kind": "run", "duration": "0.3 s"}, shake]}
        with run(tmp_path, changes, f"{name}.h5") as results:
            assert results.stages[1].end == pytest.approx(0.6, abs=1e-15)
            files.append({key: results.series[key] for key in ("kinetic", "work", "ground_x", "void_ratio")})
    for key, values in files[0].items():
        assert np.array_equal(values, files[1][key], equal_nan=True), key


def test_ground_motion(tmp_path: Path) -> None:
    """A sine along its angle that begins at t = 0 of its stage: acceleration, velocity and place fit each other, without drift."""
    shake = {"kind": "shake", "amplitude": "500 gal", "frequency": "5 Hz", "cycles": 4, "angle": "30 deg"}
    with run(tmp_path, {"stage": [{"kind": "run", "duration": "0.1 s"}, shake], "output.interval": "1 ms"}) as results:
        s = results.series
        during = s["time"] > 0.1 + 1e-9
        t, wave = s["time"][during] - 0.1, 2.0 * np.pi * 5.0
        for axis, share in (("x", math.cos(math.pi / 6.0)), ("y", 0.5)):
            assert s[f"ground_a{axis}"][during] == pytest.approx(5.0 * share * np.sin(wave * t), abs=1e-9)
            assert s[f"ground_v{axis}"][during] == pytest.approx(-5.0 * share / wave * np.cos(wave * t), abs=2e-4)
            assert s[f"ground_{axis}"][during] == pytest.approx(-5.0 * share / wave**2 * np.sin(wave * t), abs=2e-5)
            assert not s[f"ground_a{axis}"][~during].any()


def test_work_of_shaking(tmp_path: Path) -> None:
    """The ledger's work is that of the inertial force on the centre of mass, worked out from the series."""
    shake = {"kind": "shake", "amplitude": "800 gal", "frequency": "4 Hz", "duration": "0.5 s", "ramp": "0.1 s"}
    changes = {"stage": [{"kind": "settle"}, shake], "output.interval": "1 ms", "output.frames": "1 s"}
    with run(tmp_path, changes) as results:
        s = results.series
        mass = results.frame(0).grains.mass.sum()
        power = -0.5 * (s["ground_ax"][1:] + s["ground_ax"][:-1]) * np.diff(s["center_x"]) * mass
        assert s["work"][-1] == pytest.approx(power.sum(), rel=1e-2)
        assert s["work"].max() > 0.01
        assert residual_share(results) < 1e-3


# -- grains that leave ---------------------------------------------------------------------------------------------------------


def test_grains_that_leave_are_counted_and_kept(tmp_path: Path) -> None:
    shake = {"kind": "shake", "amplitude": "3000 gal", "frequency": "3 Hz", "duration": "1.5 s", "angle": "50 deg"}
    changes = {
        "material": STIFF,
        "container.height": "7 cm",
        "stage": [{"kind": "settle", "limit": "0.5 s"}, shake],
    }
    with run(tmp_path, changes) as results:
        s = results.series
        assert 3.0 <= s["escaped"][-1] <= 40.0
        assert (np.diff(s["escaped"]) >= 0.0).all()
        assert (np.diff(s["escaped_energy"][s["escaped"] > 0]) != 0.0).any()
        frames = [results.frame(k) for k in range(results.n_frames)]
        for frame, after in zip(frames, [*frames[1:], frames[-1]], strict=True):
            grains, gone = frame.grains, frame.grains.escaped
            assert len(grains) == 40
            assert np.isfinite(np.stack([grains.x, grains.y, grains.angle])).all()
            assert not np.stack([grains.vx, grains.vy, grains.spin])[:, gone].any()
            out = (grains.x < -grains.radius) | (grains.x > 0.16 + grains.radius) | (grains.y < -grains.radius)
            assert out[gone].all()
            assert (after.grains.x[gone] == grains.x[gone]).all()  # kept where they left
            assert after.grains.escaped[gone].all()
            assert frame.contacts is not None
            touched = np.concatenate([frame.contacts.i, frame.contacts.j[frame.contacts.j >= 0]])
            assert not gone[touched].any()
        for time, count in zip(s["time"], s["escaped"], strict=True):
            near = [f for f in frames if abs(f.time - time) < 1e-9]
            assert all(f.grains.escaped.sum() == count for f in near)
        assert residual_share(results) < 1e-3


# -- the ledger ----------------------------------------------------------------------------------------------------------------


def residual_share(results: Results) -> float:
    """Largest residual of the run over the energy put in by then, from the moment on when a grain has touched something."""
    s = results.series
    begun = s["energy_in"] > 1e-3 * s["energy_in"][-1]
    assert np.isfinite(s["residual"]).all()
    return float(np.max(np.abs(s["residual"][begun]) / s["energy_in"][begun]))


@pytest.mark.parametrize(
    "law",
    [
        {},
        {"contact.damping_ratio": 1.0, "contact.friction": 0.6},
        {"contact.damping_ratio": 0.0, "material": STIFF, "integration.safety": 0.3},
        {"contact.tension": "damping", "contact.slider": "spring", "contact.damping_ratio": 0.3},
        {"container.lid": True, "container.height": "40 cm", "container.gravity_direction": "-60 deg"},
    ],
    ids=["usual", "aperiodic, rough", "elastic", "thesis law", "leaning box with a lid"],
)
def test_ledger_closes(tmp_path: Path, law: dict[str, Any]) -> None:
    with run(tmp_path, {"stage": [{"kind": "run", "duration": "0.5 s"}, SHAKE], **law}) as results:
        assert residual_share(results) < 1e-3
        for name in ("friction", "dashpot_normal", "dashpot_tangential"):
            values = results.series[name]
            assert (np.diff(values) >= -1e-4 * results.series["energy_in"][-1]).all(), name
        frame = results.frame(-1)
        grains, contacts = frame.grains, frame.contacts
        assert contacts is not None
        kn, ks = fall(law).stiffness
        assert frame.energy.elastic_normal == pytest.approx(0.5 * kn * float((contacts.overlap**2).sum()), rel=1e-9)
        assert frame.energy.elastic_tangential == pytest.approx(0.5 * ks * float((contacts.stretch**2).sum()), rel=1e-9)
        swing = grains.mass * (grains.vx**2 + grains.vy**2) + grains.inertia * grains.spin**2
        assert frame.energy.kinetic == pytest.approx(0.5 * float(swing.sum()), rel=1e-9)


# -- the same again ------------------------------------------------------------------------------------------------------------

CHANGING = {"started", "wall_time", "scenario"}
TWO_STAGES: dict[str, Any] = {
    "stage": [{"kind": "settle", "limit": "0.5 s"}, SHAKE],
    "output.tracks": {"grains": [1, 30], "interval": "2 ms"},
}


def contents(path: Path) -> dict[str, Any]:
    """All datasets of a result file as bytes, and all attributes that do not tell of the clock."""
    found: dict[str, Any] = {}

    def note(name: str, item: Any) -> None:
        for key, value in item.attrs.items():
            if (
                key not in CHANGING
                and not isinstance(value, h5py.Reference)
                and "REFERENCE" not in key
                and "DIM" not in key
            ):
                found[f"{name}@{key}"] = repr(np.asarray(value).tolist())
        if isinstance(item, h5py.Dataset):
            data = item[()]
            found[name] = data.tolist() if data.dtype == object else (data.dtype.str, data.shape, data.tobytes())

    with h5py.File(path, "r") as file:
        note("", file)
        file.visititems(note)
    return found


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_scenario(fall(TWO_STAGES), tmp_path_factory.mktemp("first") / "run.h5")


def test_same_bits_again(first: Path, tmp_path: Path) -> None:
    one, two = contents(first), contents(run_scenario(fall(TWO_STAGES), tmp_path / "again.h5"))
    assert "series/kinetic" in one
    assert "VTKHDF/Points" in one
    assert one.keys() == two.keys()
    assert [name for name in one if one[name] != two[name]] == []


def test_same_bits_in_another_process(first: Path, tmp_path: Path) -> None:
    (tmp_path / "fall.toml").write_text(text_of({**FALL, **TWO_STAGES}), encoding="utf-8")
    command = [sys.executable, "-m", "dem_cli", "-q", "run", "fall.toml"]
    subprocess.run(command, cwd=tmp_path, env=with_package(), check=True)
    one, two = contents(first), contents(tmp_path / "fall.h5")
    assert [name for name in one if one[name] != two.get(name)] == []


def with_package() -> dict[str, str]:
    """An environment in which another folder's process finds the same package."""
    return {**os.environ, "PYTHONPATH": str(Path(dem_cli.__file__).parent.parent)}


def test_another_seed_is_another_sample(first: Path, tmp_path: Path) -> None:
    with open_results(first) as one, run(tmp_path, {**TWO_STAGES, "seed": 4}) as two:
        assert not np.array_equal(one.frame(0).grains.radius, two.frame(0).grains.radius)
        assert one.series["kinetic"][20] != two.series["kinetic"][20]
        assert one.attrs["scenario_hash"] != two.attrs["scenario_hash"]
        assert (one.attrs["seed"], two.attrs["seed"]) == (3, 4)


# -- runs that end early ---------------------------------------------------------------------------------------------------------


def test_a_blow_up_leaves_a_readable_file(tmp_path: Path) -> None:
    weak = {"material": {"normal_stiffness": "2e3 N/m", "tangential_stiffness": "1e3 N/m"}}
    with pytest.raises(RunError, match=r"grain .* overlap") as caught:
        run_scenario(fall(weak), tmp_path / "run.h5")
    assert not (tmp_path / "run.h5").exists()
    with open_results(partial_path(tmp_path / "run.h5")) as results:
        assert not results.complete
        assert results.stop_reason == f"RunError: {caught.value}"
        assert results.warnings == [str(caught.value)]
        assert results.series.rows > 3
        assert math.isnan(results.stages[0].end)
        assert results.frame(-1).grains.y.min() > 0.0
        assert residual_share(results) < 1e-3


def test_an_interruption_leaves_a_readable_file(tmp_path: Path) -> None:
    def interrupt(frame: Any, _row: Any) -> None:
        if frame.time > 0.15:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_scenario(fall(), tmp_path / "run.h5", listener=interrupt)
    with open_results(partial_path(tmp_path / "run.h5")) as results:
        assert results.status == "INCOMPLETE: interrupted"
        assert results.series["time"][-1] == pytest.approx(0.16)
