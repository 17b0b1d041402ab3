"""Speed of the granular element method: the momentum iteration beside the paper's solver, in one process, so that their ratio is fair.

Samples of the paper's grading, `biaxial-kishino` with more discs, are compressed once by the momentum iteration; from there both solvers shear
them at constant mean stress in increments of 0.05 %, each as it is by default (momentum in four sub-steps, to 1e-5 of stress x diameter x
depth; the paper's in one, to its 100 dyn). Printed of each are CPU seconds, also scaled to 60 increments where fewer are done, iterations
of a sub-step (median over the increments), increments that passed through a collapse or were left out of balance, and the bytes a disc that the
sample takes (discs, contacts nearby, work arrays of an iteration; a sub-step keeps one copy of the discs and contacts beside it). By hand:

    taskset -c 0 python tests/benchmarks/granular_element.py               # 122 and 1000 discs
    taskset -c 0 python tests/benchmarks/granular_element.py --only 122
    taskset -c 0 python tests/benchmarks/granular_element.py --only 1000 --increments 5
    taskset -c 0 python tests/benchmarks/granular_element.py --only 10000  # to a shear strain of 1 %, 20 increments
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable

import numpy as np

from dem_cli.assembly import build_assembly
from dem_cli.engines.granular_element.apparatus import Place
from dem_cli.engines.granular_element.engine import GranularElementEngine
from dem_cli.scenario import QuasiStaticScenario, Shear, load_scenario
from dem_cli.scenario.shipped import folder
from dem_cli.state import Increment

GRADING = {"3 mm": 72, "4.5 mm": 32, "6 mm": 18}
SOLVERS = {"momentum": (), "kishino": ("solver=kishino", "solver.accuracy=100 dyn")}
WHOLE = 60  # increments of the paper
INCREMENTS = {122: WHOLE, 1000: WHOLE, 10_000: 20}


def scenario(grains: int, solver: str) -> QuasiStaticScenario:
    """The paper's test with about `grains` discs, a multiple of the paper's three classes."""
    classes = ", ".join(f'{{ radius = "{r}", count = {round(c * grains / 122)} }}' for r, c in GRADING.items())
    found = load_scenario(folder() / "biaxial-kishino.toml", [f"grains.radius.classes=[{classes}]", *SOLVERS[solver]])
    assert isinstance(found, QuasiStaticScenario)
    return found


def compressed(grains: int) -> Place:
    """The sample at the end of the compression."""
    given = scenario(grains, "momentum")
    engine = GranularElementEngine(given, build_assembly(given))
    for one in engine.increments():
        if one.stage == 1:
            break
    return engine.place.copy()


def sheared(grains: int, solver: str, place: Place, increments: int) -> list[tuple[float, Increment]]:
    """CPU seconds and state of each increment from the compressed sample on."""
    given = scenario(grains, solver)
    shear = given.stages[1]
    assert isinstance(shear, Shear)
    engine = GranularElementEngine(given, build_assembly(given))
    engine.place, engine.stage = place.copy(), 1
    engine.first_stress = float(engine.stress().mean())
    found, running = [], engine._shear(shear)
    for _ in range(increments):
        began = time.process_time()
        one = next(running)
        found.append((time.process_time() - began, one))
    return found


def size(arrays: object) -> int:
    """Bytes of all arrays in a tuple of tuples."""
    if isinstance(arrays, np.ndarray):
        return arrays.nbytes
    return sum(size(one) for one in arrays) if isinstance(arrays, Iterable) and not isinstance(arrays, str) else 0


def compare(grains: int, increments: int) -> None:
    began = time.process_time()
    place = compressed(grains)
    seconds, sample = time.process_time() - began, place.sample
    n = len(sample.x)
    parts = (sample.x, sample.anchor, sample.near, sample.bodies, sample.chain, sample.look().room)
    print(f"{n} discs: packed and compressed in {seconds:.1f} s; {size(parts) / n:.0f} bytes a disc", flush=True)
    for solver in SOLVERS:
        rows = sheared(grains, solver, place, increments)
        total = sum(row[0] for row in rows)
        whole = f" ({total * WHOLE / increments:.1f} s in {WHOLE})" if increments != WHOLE else ""
        each = [one.iterations / one.sub_steps for _, one in rows]
        micro = 1e6 * total / max(sum(one.iterations for _, one in rows), 1)
        events, left = sum(one.event for _, one in rows), sum(bool(one.warnings) for _, one in rows)
        print(
            f"  {solver:9s} {increments} increments in {total:.1f} s{whole}; {np.median(each):.0f} iterations a sub-step in the median, "
            f"{max(each):.0f} at most, {micro:.1f} us each; {events} collapses, {left} out of balance; "
            f"s1/s2 {rows[-1][1].stress[1] / rows[-1][1].stress[0]:.3f} at the end",
            flush=True,
        )


def main() -> None:
    """Each size in turn; a first short run of both solvers, which may compile, is left out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=int, nargs="*", default=[122, 1000], help="numbers of discs")
    parser.add_argument("--increments", type=int, help="increments of each")
    given = parser.parse_args()
    place = compressed(30)
    for solver in SOLVERS:
        sheared(30, solver, place, 2)
    for grains in given.only:
        compare(grains, given.increments or INCREMENTS.get(grains, WHOLE))


if __name__ == "__main__":
    main()
