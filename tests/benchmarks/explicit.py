"""Speed and memory of the explicit engine in a normal run: series with all measures and the ledger of energy every
1000 steps, frames every 10 000, all written.

The sample of `packing_3000.csv` (x, y, r in m; 3000 discs settled in a box 1.215 m wide) and copies of it side by side; unit depth,
2480 kg/m^3, kn 1.3e8, ks 4.4e7 N/m, damping ratio 0.3, friction 0.17 (walls 0.25), dt 1e-6 s. Prints million grain-steps
per CPU second of the loop on one core, and the memory above that of the same program with 3000 grains. By hand:

    taskset -c 0 python tests/benchmarks/explicit.py [copies ...]
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
WIDTH = 1.215
STEPS = {1: 40_000, 10: 5_000, 100: 3_000}
SCENARIO = """
title = "benchmark"
engine = "explicit"
grains = {{ shape = "disc", density = "2480 kg/m^3" }}
material = {{ normal_stiffness = "1.3e8 N/m", tangential_stiffness = "4.4e7 N/m" }}
contact = {{ friction = 0.17, wall_friction = 0.25, damping_ratio = 0.3 }}
container = {{ width = "{width} m" }}
packing = {{ method = "file", file = "sample.csv" }}
integration = {{ time_step = "1e-6 s" }}
output = {{ interval = "1 ms", frames = "10 ms" }}
[[stage]]
kind = "run"
duration = "{duration} s"
"""


def measure(copies: int, steps: int) -> dict[str, float]:
    """One run in this process: grains, steps, CPU seconds of the loop, peak memory [byte]."""
    from dem_cli.run import run_scenario
    from dem_cli.scenario import load_scenario

    sample = np.loadtxt(HERE / "packing_3000.csv", delimiter=",", skiprows=1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.toml"
        shifted = [sample + np.array([k * WIDTH, 0.0, 0.0]) for k in range(copies)]
        np.savetxt(Path(folder) / "sample.csv", np.concatenate(shifted), "%.17g", ",", header="x,y,r", comments="")
        path.write_text(SCENARIO.format(width=copies * WIDTH, duration=steps * 1e-6))
        marks: list[tuple[int, float]] = []
        run_scenario(
            load_scenario(path),
            Path(folder) / "run.h5",
            listener=lambda frame, _row: marks.append((frame.step, time.process_time())),
        )
        peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        (first, began), (last, ended) = (
            marks[1],
            marks[-1],
        )  # before the first output compiled code is read from the cache
        return {"grains": 3000 * copies, "steps": last - first, "seconds": ended - began, "memory": peak}


def main() -> None:
    """Each size in a process of its own, after one run that fills the cache of compiled code."""
    sizes = [int(a) for a in sys.argv[1:]] or list(STEPS)
    run = [sys.executable, __file__, "--one"]
    base = json.loads(subprocess.run([*run, "1", "2000"], check=True, capture_output=True, text=True).stdout)
    print("grains    million grain-steps/s (runs)      memory above 3000 grains, byte a grain")
    for copies in sizes:
        runs = []
        for _ in range(3):
            out = subprocess.run(
                [*run, str(copies), str(STEPS[copies])], check=True, capture_output=True, text=True
            ).stdout
            runs.append(json.loads(out))
        rates = sorted(r["grains"] * r["steps"] / r["seconds"] / 1e6 for r in runs)
        extra = (
            (max(r["memory"] for r in runs) - base["memory"]) / (runs[0]["grains"] - 3000)
            if copies > 1
            else float("nan")
        )
        print(
            f"{runs[0]['grains']:7d}   {rates[1]:5.1f}  ({', '.join(f'{r:.1f}' for r in rates)})   {extra:22.0f}",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(measure(int(sys.argv[2]), int(sys.argv[3]))))
    else:
        main()
