"""Runs that go on from a preparation: bit by bit the same as a run from the start, whatever the engine holds."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from engine_samples import text_of
from impulse_text import pour
from quasi_static_text import quick

from dem_cli.engines.explicit.engine import ExplicitEngine
from dem_cli.engines.pausing import thaw
from dem_cli.errors import ResultsError, RunError
from dem_cli.results import open_results
from dem_cli.run import Preparation, build_engine, prepare_scenario, run_scenario
from dem_cli.scenario import parse_scenario

SETTLE = {"kind": "settle", "limit": "0.6 s", "name": "packing"}
SHAKE = {"kind": "shake", "amplitude": "700 gal", "frequency": "10 Hz", "duration": "0.15 s", "angle": "20 deg"}
REST = {"kind": "settle", "limit": "0.1 s", "name": "rest"}
BOX: dict[str, Any] = {
    "grains.count": 40,
    "container.width": "16 cm",
    "packing.grid": {"columns": 5, "spacing": "3 cm", "shift": "1 cm"},
    "contact.damping_ratio": 0.5,
    "stage": [SETTLE, SHAKE, REST],
    "output.tracks": {"grains": [0, 7], "interval": "3 ms"},
}
ELLIPSES: dict[str, Any] = {
    "container.width": "20 cm",
    "grains.shape": "ellipse",
    "grains.aspect_ratio": 1.8,
    "packing.grid": {"columns": 4, "spacing": "4 cm"},
}
PAIRS: dict[str, Any] = {
    "material.normal_stiffness": "1e7 N/m",
    "container.width": "20 cm",
    "grains.template": "pair",
    "grains.count": 20,
    "packing.grid": {"columns": 3, "spacing": "5 cm"},
}
QUASI_STATIC: dict[str, Any] = {
    "stage": [
        {"kind": "compress", "stress": "15 kPa"},
        {"kind": "shear", "hold": "mean-stress", "shear_strain": 0.004, "increment": 0.001},
        {"kind": "load", "from": "compress", "x": {"stress": "16 kPa"}, "y": {"strain": 0.001}, "increments": 2},
    ],
    "output.frames": 2,
    "output.tracks": {"grains": [3, 4]},
}
BODIES = {
    "stage": [SETTLE | {"limit": "0.4 s"}, SHAKE | {"duration": "0.1 s", "heading": "30 deg"}, {"kind": "run", "duration": "40 ms"}],
    "integration.time_step": "2 ms",
    "output.frames": "50 ms",
    "output.tracks": {"grains": [1], "interval": "4 ms"},
}  # fmt: skip
CASES = {
    "discs": text_of(BOX),
    "thesis-scheme": text_of({**BOX, "integration.integrator": "thesis"}),
    "ellipses": text_of({**BOX, **ELLIPSES}),
    "pairs": text_of({**BOX, **PAIRS, "grains.shape": "bonded"}),
    "clumps": text_of({**BOX, **PAIRS, "grains.shape": "clump"}),
    "random-packing": text_of(
        {**BOX, "packing": {"method": "rejection"}, "container.width": "20 cm", "stage": [REST, SHAKE, REST]}
    ),
    "walls": quick(QUASI_STATIC),
    "kishino": quick({**QUASI_STATIC, "solver": "kishino"}),
    "membrane": quick(
        {
            **QUASI_STATIC,
            "boundary": {"kind": "membrane", "radius": "3 mm"},
            "stage": [
                QUASI_STATIC["stage"][0],
                QUASI_STATIC["stage"][1] | {"hold": "lateral-stress"},
                QUASI_STATIC["stage"][1] | {"hold": "lateral-stress", "name": "again", "from": "compress"},
            ],
        }
    ),
    "bodies": pour(BODIES),
}
# What tells of the making of a file, and is not the same twice.
OF_THE_MAKING = {"started", "wall_time", "preparation"}


def contents(path: Path) -> dict[str, Any]:
    """All datasets and attributes of a file, by name."""
    found: dict[str, Any] = {}
    with h5py.File(path) as file:
        found.update({f"@{name}": value for name, value in file.attrs.items() if name not in OF_THE_MAKING})

        def keep(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset):
                found[name] = item[()]
            found.update({f"{name}@{key}": item.attrs[key] for key in ("rows", "NSteps") if key in item.attrs})

        file.visititems(keep)
    return found


def assert_same(one: Path, other: Path) -> None:
    first, second = contents(one), contents(other)
    assert first.keys() == second.keys()
    for name, value in first.items():
        assert np.array_equal(value, second[name]) or (
            np.asarray(value).dtype.kind == "f" and np.array_equal(value, second[name], equal_nan=True)
        ), name


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("stages", [1, 2])
def test_going_on_gives_the_same_bits(tmp_path: Path, name: str, stages: int) -> None:
    """Preparation, bytes, and on: all that a direct run writes, and nothing else."""
    scenario = parse_scenario(CASES[name])
    direct = run_scenario(scenario, tmp_path / "direct.h5")
    prepared = prepare_scenario(scenario, stages, tmp_path / "first.h5")
    before = prepared.file.read_bytes()
    on = run_scenario(parse_scenario(CASES[name]), tmp_path / "on.h5", prepared=prepared)
    assert_same(direct, on)
    assert prepared.file.read_bytes() == before, "the preparation is for others, too"
    with open_results(prepared.file) as first, open_results(on) as whole:
        assert first.complete
        assert len(first.stages) == stages
        assert first.attrs["stop_reason"] == f"{stages} stages are done, for other runs to go on from"
        assert whole.attrs["preparation"] == "first"
        assert whole.attrs["wall_time"] > first.attrs["wall_time"]


def test_a_preparation_may_go_on_from_another(tmp_path: Path) -> None:
    scenario = parse_scenario(CASES["discs"])
    direct = run_scenario(scenario, tmp_path / "direct.h5")
    first = prepare_scenario(scenario, 1, tmp_path / "first.h5")
    second = prepare_scenario(scenario, 2, tmp_path / "second.h5", prepared=first)
    assert_same(direct, run_scenario(scenario, tmp_path / "on.h5", prepared=second))


def test_stages_to_come_may_differ(tmp_path: Path) -> None:
    """One packing, shaken in two ways: each as if it had been packed for itself."""
    other = text_of({**BOX, "stage": [SETTLE, SHAKE | {"amplitude": "300 gal", "frequency": "25 Hz"}]})
    prepared = prepare_scenario(parse_scenario(CASES["discs"]), 1, tmp_path / "first.h5")
    on = run_scenario(parse_scenario(other), tmp_path / "on.h5", prepared=prepared)
    assert_same(run_scenario(parse_scenario(other), tmp_path / "direct.h5"), on)


def test_records_are_written_once(tmp_path: Path) -> None:
    """A record in the prepared stage and another one after it are both in the file."""
    (tmp_path / "quake.csv").write_text(
        "t,a\n" + "".join(f"{0.01 * k:.2f},{300 * (-1) ** (k // 3)}\n" for k in range(10))
    )
    record = {"kind": "shake", "record": {"file": "quake.csv", "unit": "gal"}}
    text = text_of({**BOX, "stage": [SETTLE, record | {"name": "first"}, record | {"name": "second"}]})
    scenario = parse_scenario(text, folder=tmp_path)
    direct = run_scenario(scenario, tmp_path / "direct.h5")
    prepared = prepare_scenario(scenario, 2, tmp_path / "first.h5")
    on = run_scenario(scenario, tmp_path / "on.h5", prepared=prepared)
    assert_same(direct, on)
    with open_results(prepared.file) as first, open_results(on) as whole:
        assert (list(first.motions), list(whole.motions)) == ([2], [2, 3])


def test_rows_lie_at_cache_lines_again(tmp_path: Path) -> None:
    """No element lies in two cache lines: the speed depends on it."""
    scenario = parse_scenario(CASES["clumps"])
    engine = thaw(build_engine(scenario, None).freeze(), scenario)
    assert isinstance(engine, ExplicitEngine)
    assert engine.state.cores is not None
    assert engine.state.rows.ctypes.data % 64 == engine.state.cores.rows.ctypes.data % 64 == 0
    assert tmp_path.exists()


def by_name(module: str, name: str) -> bytes:
    """A pickle of what a module has under a name, also one with dots."""
    texts = b"".join(b"\x8c" + bytes([len(text)]) + text.encode() for text in (module, name))
    return b"\x80\x04" + texts + b"\x93."


class Strange:
    """What somebody might put into a file for us to run."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (print, ("hacked",))


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (pickle.dumps(Strange()), "builtins.print does not belong to the state of an engine"),
        (by_name("dem_cli.sweep.process", "WorkerProcess"), "does not belong to the state of an engine"),
        (by_name("dem_cli.engines.schedule", "Output"), "does not belong to the state of an engine"),
        (by_name("dem_cli.sweep.process", "subprocess.Popen"), "does not belong to the state of an engine"),
        (by_name("dem_cli.engines.impulse.engine", "Callable.__class__"), "does not belong to the state of an engine"),
        (pickle.dumps(parse_scenario), "does not belong to the state of an engine"),
        (pickle.dumps(np.array([1.0])), "is none of an engine"),
        (b"abc", "cannot be read"),
    ],
)
def test_states_hold_engines_and_nothing_else(
    data: bytes, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = parse_scenario(CASES["discs"])
    with pytest.raises(ResultsError, match=why):
        run_scenario(scenario, tmp_path / "on.h5", prepared=Preparation(tmp_path / "first.h5", data))
    assert "hacked" not in capsys.readouterr().out


def test_a_full_disk_is_what_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And not what goes wrong after it, when the run wants to leave a warning."""
    calls = iter(range(1000))

    def usage(_: object) -> Any:
        return type("Usage", (), {"free": 0 if next(calls) > 3 else 10**12})

    monkeypatch.setattr("dem_cli.results.run_file.shutil.disk_usage", usage)
    with pytest.raises(
        RunError, match=r"cannot write \(No space left on device\)\. What was written until then stays readable"
    ):
        run_scenario(parse_scenario(CASES["discs"]), tmp_path / "out.h5")
    with open_results(tmp_path / "out.partial.h5") as results:
        assert not results.complete
