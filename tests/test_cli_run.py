"""`dem run` as a user meets it: files, streams and exit codes, also when the run is interrupted."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from engine_samples import text_of

import dem_cli
from dem_cli.cli import main
from dem_cli.errors import ResultsError
from dem_cli.results import open_results, partial_path

QUICK: dict[str, Any] = {
    "title": "a few grains fall",
    "grains.count": 10,
    "stage": [{"kind": "run", "duration": "50 ms"}, {"kind": "run", "duration": "20 ms", "name": "more"}],
}
ENV = {**os.environ, "PYTHONPATH": str(Path(dem_cli.__file__).parent.parent)}


def dem(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "dem_cli", *arguments]
    return subprocess.run(command, cwd=folder, env=ENV, capture_output=True, text=True, timeout=300)


def one_line(text: str) -> str:
    lines = text.strip().splitlines()
    assert len(lines) == 1, text
    assert "Traceback" not in text
    return lines[0]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "few.toml").write_text(text_of(QUICK), encoding="utf-8")
    return tmp_path


def test_writes_the_file_and_tells_on_stderr(folder: Path) -> None:
    done = dem(folder, "run", "few.toml")
    assert done.returncode == 0
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert lines[0] == "a few grains fall: 10 grains, 2 stages, to few.h5"
    assert "stage 1/2 run: t = 0.05 s" in done.stderr
    assert "stage 2/2 more: t = 0.07 s" in done.stderr
    assert any(re.fullmatch(r"done in (\d+ min )?\d+ s: few\.h5", line) for line in lines)
    assert "dem report few.h5" in lines[-1]
    assert not re.search(r"[\x1b\r]", done.stderr)  # a log has neither colour nor bars
    assert sorted(path.name for path in folder.iterdir()) == ["few.h5", "few.toml"]
    with open_results(folder / "few.h5") as results:
        assert results.complete
        assert results.stop_reason == "all stages are done"
        assert results.attrs["scenario"] == text_of(QUICK)


def test_overwrites_only_with_force(folder: Path) -> None:
    (folder / "few.h5").write_text("mine")
    done = dem(folder, "run", "few.toml")
    assert done.returncode == 2
    assert one_line(done.stderr) == "few.h5: exists already; --force replaces it"
    assert (folder / "few.h5").read_text() == "mine"
    assert dem(folder, "run", "few.toml", "--force").returncode == 0
    with open_results(folder / "few.h5") as results:
        assert results.complete


def test_output_set_report_and_quiet(folder: Path) -> None:
    (folder / "out").mkdir()
    arguments = ["-o", "out/one.h5", "--set", "grains.count=6", "--set", "stage.more.duration=30 ms", "--report"]
    done = dem(folder, "-q", "run", "few.toml", *arguments)
    assert done.returncode == 0
    assert done.stderr == ""
    report = dem(folder, "report", "out/one.h5")
    assert done.stdout.replace(" ", "") == report.stdout.replace(" ", "")
    assert "a few grains fall" in done.stdout
    assert "residual" in done.stdout
    with open_results(folder / "out" / "one.h5") as results:
        assert len(results.frame(-1).grains) == 6
        assert results.stages[-1].end == pytest.approx(0.08)


MISTAKES: dict[str, tuple[Sequence[str], dict[str, Any], str]] = {
    "no such file": (["none.toml"], {}, r"none\.toml: does not exist"),
    "bad TOML": (["bad.toml"], {}, r"bad\.toml.*line 2"),
    "unknown key": (["few.toml"], {"contact.fricton": 0.2}, r'fricton.*Did you mean "friction"'),
    "unknown key in --set": (["few.toml", "--set", "grains.cuont=3"], {}, r'cuont.*Did you mean "grains\.count"'),
    "time step beyond the limit": (
        ["few.toml"], {"integration.time_step": "1 ms"}, r"time_step.*beyond the stability limit of [\d.e-]+ s",
    ),
    "no such folder": (["few.toml", "-o", "none/out.h5"], {}, "the folder none does not exist"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_a_line_and_exit_code_2(mistake: str, folder: Path) -> None:
    arguments, changes, says = MISTAKES[mistake]
    (folder / "few.toml").write_text(text_of({**QUICK, **changes}), encoding="utf-8")
    (folder / "bad.toml").write_text('title = "x"\nseed = = 3\n', encoding="utf-8")
    done = dem(folder, "-q", "run", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert re.search(says, one_line(done.stderr))
    assert not list(folder.glob("**/*.h5"))


def test_a_blow_up_ends_with_1(folder: Path) -> None:
    weak = {"material": {"normal_stiffness": "2e3 N/m", "tangential_stiffness": "1e3 N/m"}}
    (folder / "few.toml").write_text(text_of({**QUICK, **weak, "stage": [{"kind": "settle"}]}), encoding="utf-8")
    done = dem(folder, "run", "few.toml")
    assert done.returncode == 1
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    last = done.stderr.splitlines()[-2:]
    assert last[0] == "stopped; what was written is in few.partial.h5"
    assert re.match(r"t = .* s: grain \d+ and .* overlap .*raise the stiffness", last[1])
    with open_results(folder / "few.partial.h5") as results:
        assert results.stop_reason == f"RunError: {last[1]}"
    again = dem(folder, "-q", "run", "few.toml")
    assert again.returncode == 2
    assert "left by an unfinished run" in one_line(again.stderr)


def test_an_unstable_step_ends_with_1(folder: Path) -> None:
    """A numerical mistake that only the energy shows; the limit is lifted for the test."""
    code = (
        "import sys\n"
        "from dem_cli.engines.explicit import engine\n"
        "chosen = engine.choose_time_step\n"
        "engine.choose_time_step = lambda *a: (4.0 * chosen(*a)[0], 0.0)\n"
        "from dem_cli.cli import main\n"
        "main()\n"
    )
    (folder / "few.toml").write_text(
        text_of({"contact.damping_ratio": 0.1, "stage": [{"kind": "settle"}]}), encoding="utf-8"
    )
    command = [sys.executable, "-c", code, "run", "few.toml"]
    done = subprocess.run(command, cwd=folder, env=ENV, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    assert re.search(r"^t = .*(time step is unstable|is too long)", done.stderr.splitlines()[-1])
    with open_results(folder / "few.partial.h5") as results:
        assert not results.complete


@pytest.mark.parametrize("interval", [0.01, 20.0], ids=["between calls", "in the loop"])
@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM], ids=lambda kind: kind.name)
def test_interrupted(kind: signal.Signals, interval: float, folder: Path) -> None:
    """A real process, interrupted once its first rows are in the file; with long intervals it is in compiled code nearly always."""
    every = {"output.interval": f"{interval} s", "output.frames": f"{10.0 * interval} s"}
    (folder / "few.toml").write_text(
        text_of({**every, "stage": [{"kind": "run", "duration": "1e6 s"}]}), encoding="utf-8"
    )
    command = [sys.executable, "-m", "dem_cli", "run", "few.toml"]
    with subprocess.Popen(
        command, cwd=folder, env=ENV, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        for _ in range(1200):
            assert process.poll() is None
            if rows_of(partial_path(folder / "few.h5")) > 3:
                break
            time.sleep(0.1)
        process.send_signal(kind)
        sent = time.monotonic()
        try:
            out, err = process.communicate(timeout=20)
        finally:
            process.kill()
    assert time.monotonic() - sent < 10.0
    assert process.returncode == 130
    assert out == ""
    assert "Traceback" not in err
    assert err.splitlines()[-1] == "interrupted; what was written is in few.partial.h5"
    assert not (folder / "few.h5").exists()
    with open_results(folder / "few.partial.h5") as results:
        assert results.status == "INCOMPLETE: interrupted"
        assert results.series.rows > 3
        assert results.series["time"][-1] == pytest.approx(interval * (results.series.rows - 1))
    report = dem(folder, "report", "few.partial.h5")
    assert report.returncode == 0
    assert "INCOMPLETE: interrupted" in report.stdout


def rows_of(path: Path) -> int:
    """Rows of the series that can be read now."""
    try:
        with open_results(path) as results:
            return results.series.rows
    except ResultsError:
        return 0


def test_interrupted_before_there_is_a_file(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As by Ctrl-C while bodies are packed: no file is named that is not there."""

    def stopped(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("dem_cli.run.run_scenario", stopped)
    done = CliRunner().invoke(main, ["run", str(folder / "few.toml"), "-o", str(folder / "few.h5")])
    assert done.exit_code == 130
    assert done.stderr.splitlines()[-1] == "interrupted before anything was written"
