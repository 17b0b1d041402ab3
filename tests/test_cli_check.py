"""`dem check`: derived numbers against closed forms, mistakes, and what it must not import."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from scenario_text import ABSENT, small

from dem_cli.cli import main
from dem_cli.cli.check import clock, counted
from dem_cli.cli.derived import derive, file_bytes
from dem_cli.engines.explicit.timestep import critical_time_step, disc_modes, thesis_time_step
from dem_cli.results.writer import ResultWriter
from dem_cli.scenario import parse_scenario
from dem_cli.state import Contacts, Energy, Frame, Grains, Walls
from dem_cli.units import human

ROOT = Path(__file__).parent.parent
THESIS = str(ROOT / "scenarios" / "thesis-discs-400gal-10hz.toml")


def check(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["check", *arguments])


def derived(changes: dict[str, Any] | None = None) -> dict[str, Any]:
    return derive(parse_scenario(small(changes))).as_dict()


@pytest.fixture
def path(tmp_path: Path) -> str:
    file = tmp_path / "a.toml"
    file.write_text(small())
    return str(file)


def test_prints_the_constants_of_the_thesis() -> None:
    """physics.md 1.2 and 1.5."""
    result = check(THESIS)
    assert (result.exit_code, result.stderr) == (0, "")
    for text in (
        "3000 discs",
        "Vp 259.81 m/s, Vs 150.00 m/s",
        "kn 1.3148e+08 N/m, ks 4.3825e+07 N/m",
        "restitution 0.1353",
    ):
        assert text in result.stdout
    for label in ("time step", "limit", "thesis' rule", "stage 3", "run time"):
        assert any(
            line.split("  ")[0].strip() == label or line.startswith(label)
            for line in map(str.strip, result.stdout.splitlines())
        )


def test_json_holds_the_same_in_si(path: str) -> None:
    result = check(path, "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout) == json.loads(json.dumps(derived()))


def test_grains_are_those_that_a_run_draws() -> None:
    scenario = parse_scenario(small())
    assert scenario.grains.radius is not None
    radius = scenario.grains.radius.draw(np.random.default_rng(scenario.seed), 30)
    d = derived()
    assert d["radius"] == (radius.min(), pytest.approx(radius.mean()), radius.max())
    assert d["total_mass"] == pytest.approx(2480.0 * math.pi * np.sum(radius**2))
    assert d["mass"][0] == pytest.approx(2480.0 * math.pi * radius.min() ** 2)


def test_time_step() -> None:
    d = derived()
    lightest = d["mass"][0]
    assert d["time_step_limit"] == critical_time_step(d["kn"], d["ks"], 1.0, 1.0, disc_modes(np.array([lightest])))
    assert d["time_step_thesis"] == thesis_time_step(d["kn"], lightest)
    assert d["time_step"] == pytest.approx(0.9 * d["time_step_limit"])
    assert derived({"integration.safety": 0.5})["time_step"] == pytest.approx(0.5 * d["time_step_limit"])
    assert derived({"integration.time_step": "1e-6 s"})["time_step"] == 1e-6


def test_steps_and_times() -> None:
    d = derived({"integration.time_step": "1e-6 s", "stage": [{"kind": "run", "duration": "0.5 s"}]})
    assert d["steps"] == d["stages"][0]["steps"] == 500_000
    assert d["run_seconds"] == pytest.approx(500_000 * 30 / 40e6)
    settle, shake = derived()["stages"]
    assert settle["longest"] == 20.0
    # the highest of four rows of 3 cm falls for sqrt(2 h / g)
    assert settle["expected"] == pytest.approx(math.sqrt(2.0 * 0.12 / 9.80665) + 0.4)
    assert shake["expected"] == shake["longest"] == 2.0
    short = derived({"stage.0.limit": "0.1 s"})["stages"][0]
    assert short["expected"] == 0.1


def test_fill_and_overlap() -> None:
    """Area of the grains over 1 - n over the width; weight of a column of one grain's width over kn, over r."""
    d = derived()
    area = d["total_mass"] / 2480.0
    assert d["depth_expected"] == pytest.approx(area / 0.82 / 0.3)
    column = d["total_mass"] * 9.80665 * 2.0 * d["radius"][1] / 0.3
    assert d["overlap_expected"] == pytest.approx(column / d["kn"] / d["radius"][1])


def test_restitution_is_shown_either_way() -> None:
    d = derived({"contact.damping_ratio": ABSENT, "contact.restitution": 0.5})
    assert d["restitution"] == pytest.approx(0.5)
    assert d["hn"] == d["hs"] == pytest.approx(0.25528, abs=5e-6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stage.1.frequency": "50 Hz"}, "less than ten rows a period"),
        ({"material": {"normal_stiffness": "1e4 N/m", "tangential_stiffness": "1e4 N/m"}}, "stiffness may be too low"),
        ({"stage.1.duration": "0.05 s"}, "before its first period is over"),
        ({"integration.integrator": "thesis", "contact.damping_ratio": 0.01}, "gains energy"),
    ],
)
def test_warnings(changes: dict[str, Any], words: str, tmp_path: Path) -> None:
    assert derived()["warnings"] == []
    (tmp_path / "a.toml").write_text(small(changes))
    result = check(str(tmp_path / "a.toml"))
    assert result.exit_code == 0
    assert result.stderr.startswith("warning: ")
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_sweep_is_told_by_its_members(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(small({"sweep": {"grid": {"contact.friction": [0.1, 0.2]}, "seeds": 3}}), encoding="utf-8")
    last = CliRunner().invoke(main, ["check", str(path)]).stdout.splitlines()[-1]
    assert last.split(maxsplit=1) == ["sweep", f"6 members: dem sweep {path} --dry-run lists them"]
    found = CliRunner().invoke(main, ["check", str(path), "--set", "sweep.seeds=4"])
    assert (found.exit_code, len(found.stderr.splitlines())) == (2, 1)
    path.write_text('[sweep]\nscenarios = ["b.toml"]\n', encoding="utf-8")
    assert "Run it with dem sweep" in CliRunner().invoke(main, ["check", str(path)]).stderr


def test_mistakes_end_with_2(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(small({"contact.frction": 1, "seed": -1}))
    result = check(str(tmp_path / "a.toml"))
    assert (result.exit_code, result.stdout) == (2, "")
    assert len(result.stderr.splitlines()) == 2
    assert "Traceback" not in result.output
    assert check(str(tmp_path / "none.toml")).exit_code == 2


def test_time_step_beyond_the_limit_is_a_mistake(path: str) -> None:
    result = check(path, "--set", "integration.time_step=1e-4 s")
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert f'{path}: [integration] time_step = "0.0001 s": is beyond the stability limit of' in line


def test_set(path: str) -> None:
    result = check(path, "--set", "grains.count=7", "--set", "contact.restitution=0.5", "--json")
    assert json.loads(result.stdout)["grains"] == 7
    assert json.loads(result.stdout)["restitution"] == pytest.approx(0.5)
    assert check(path, "--set", "grains.cuont=7").exit_code == 2


def test_resolved_loads_back(path: str) -> None:
    result = check(path, "--resolved", "--set", "seed=9")
    assert parse_scenario(result.stdout) == parse_scenario(small({"seed": 9}))


def test_starts_quickly() -> None:
    """What would make it slow is not imported."""
    code = (
        "import sys; from dem_cli.cli import main\n"
        f"try: main(['check', {THESIS!r}])\nexcept SystemExit: pass\n"
        "print(*{'numba', 'matplotlib', 'scipy.optimize', 'h5py', 'rich'} & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert "3000 discs" in done.stdout
    assert done.stderr.strip() == ""


def test_size_of_the_file_is_what_the_writer_writes(tmp_path: Path) -> None:
    """A square lattice, whose grains have two contacts each (1.8 are assumed), frames and series of 2 s."""
    side, seconds = 30, 2.0
    scenario = parse_scenario(
        small(
            {
                "grains.count": side**2,
                "stage": [{"kind": "run", "duration": "2 s"}],
                "output.tracks": {"grains": [1, 2]},
            }
        )
    )
    column, row = (a.ravel().astype(float) for a in np.meshgrid(np.arange(side), np.arange(side)))
    grains = Grains.discs(column, row, np.full(side**2, 0.5), 1.0, 1.0)
    index = np.arange(side**2)
    i = np.concatenate([index[column < side - 1], index[row < side - 1]])
    j = i + np.concatenate([np.ones(side * (side - 1), dtype=int), np.full(side * (side - 1), side)])
    ones = np.ones(len(i))
    contacts = Contacts(i, j, ones, ones, ones, ones, ones, ones, ones, ones, ones > 2.0)
    none = np.empty(0)
    with ResultWriter(
        tmp_path / "a.h5",
        scenario_text="",
        resolved_toml="",
        scenario_hash="",
        seed=0,
        engine="explicit",
        title="",
        grains=grains,
        walls=Walls((), none, none, none, none, none),
        depth=1.0,
        container={"width": 1.0},
        tracks=np.array([1, 2]),
        surface_x=np.arange(40.0),
    ) as writer:
        writer.begin_stage("run", "run", 0.0)
        from dem_cli.results.schema import SERIES

        for k in range(round(seconds / scenario.output.frames) + 1):
            frame = Frame(k, 0.1 * k, 1e-6, 0, grains, np.zeros((3, 2)), Energy(), 0.0, 0.0, frozenset(), contacts)
            writer.append_frame(frame, np.zeros(side**2, dtype=np.int64), np.zeros((side**2, 4)))
        for k in range(round(seconds / scenario.output.interval) + 1):
            writer.append_series(dict.fromkeys(SERIES, 0.01 * k), np.zeros(40))
        for k in range(2001):
            writer.append_tracks(0.001 * k, grains)
        writer.end_stage(seconds, "done", dict.fromkeys(SERIES, 0.0))
        writer.finish("done")
    written = (tmp_path / "a.h5").stat().st_size
    assert file_bytes(scenario, side**2, seconds) == pytest.approx(written, rel=0.25)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.005, "m", "5 mm"),
        (1.215, "m", "1.215 m"),
        (2.5e6, "B", "2.5 MB"),
        (1356.2, "kg", "1356 kg"),
        (3e-6, "s", "3 µs"),
        (0.0, "s", "0 s"),
    ],
)
def test_values_are_shown_with_a_prefix(value: float, unit: str, text: str) -> None:
    assert human(value, unit) == text


def test_rounded_values_have_no_exponent() -> None:
    assert human(0.8423, "s", 2) == "840 ms"


def test_counts_and_times_are_rounded() -> None:
    assert [counted(n) for n in (0, 7, 353_000, 1_089_999)] == ["0", "7", "350 000", "1 100 000"]
    assert [clock(t) for t in (0.1, 82.4, 600, 9000)] == ["about 1 s", "about 82 s", "about 10 min", "about 2.5 h"]
