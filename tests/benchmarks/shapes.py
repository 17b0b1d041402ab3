"""Speed of the explicit engine for each shape of grain beside discs, in one process and in turn, so that their ratios are fair.

3000 elements of the thesis (discs, ellipses of aspect ratio 2, 1500 bonded pairs, 1500 rigid ones) come to rest at damping ratio 0.3; then
they lie under gravity, and blocks of 2000 steps of each, with all measures every 1000 steps, are timed one after the other. Prints
million element-steps per CPU second on one core. By hand, ten minutes:

    taskset -c 0 python tests/benchmarks/shapes.py
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from dem_cli.assembly import build_assembly
from dem_cli.engines.explicit.engine import ExplicitEngine
from dem_cli.run import measure
from dem_cli.scenario import load_scenario
from dem_cli.scenario.shipped import folder

CASES = {
    "discs": ("thesis-discs-400gal-10hz", ()),
    "ellipses": ("thesis-ellipses-400gal-10hz", ()),
    "bonded pairs": ("thesis-pairs-400gal-10hz", ()),
    "rigid pairs": ("thesis-pairs-400gal-10hz", ("grains.shape=clump",)),
}
STEPS = 2000
ROUNDS = 15


def blocks(name: str, changes: tuple[str, ...]) -> Iterator[float]:
    """Rates of block after block, once the sample is at rest."""
    scenario = load_scenario(
        folder() / f"{name}.toml", ["contact.damping_ratio=0.3", "stage.shake.amplitude=0 gal", *changes]
    )
    assembly = build_assembly(scenario)
    step = ExplicitEngine(scenario, assembly).time_step
    scenario = load_scenario(
        scenario.path or "",
        ["contact.damping_ratio=0.3", "stage.shake.amplitude=0 gal", *changes, f"output.interval={1000 * step} s"],
    )
    frames = ExplicitEngine(scenario, assembly).frames()
    for frame in frames:
        if frame.stage == 1:
            break
    while True:
        began, first = time.process_time(), frame.step
        while frame.step - first < STEPS:
            frame = next(frames)
            if "series" in frame.due:
                measure(scenario, frame)
        yield (frame.step - first) * len(frame.grains) / (time.process_time() - began) / 1e6


def main() -> None:
    """Each case in turn; the first block of each, which may compile, is left out."""
    running = {name: blocks(*case) for name, case in CASES.items()}
    rates: dict[str, list[float]] = {name: [] for name in CASES}
    for turn in range(ROUNDS + 1):
        for name, block in running.items():
            rate = next(block)
            if turn:
                rates[name].append(rate)
    discs = np.median(rates["discs"])
    for name, found in rates.items():
        middle = np.median(found)
        print(
            f"{name:13s} {middle:5.1f} million element-steps/s ({min(found):.1f} to {max(found):.1f}), {middle / discs:.2f} of discs"
        )


if __name__ == "__main__":
    main()
