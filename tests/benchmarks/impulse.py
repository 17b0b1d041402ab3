"""Speed of the impulse engine: piles of clumps of four spheres while they land and at rest, beside other rigid-body codes where installed.

`impulse-pour` with more clumps, turned at random, in a box as wide as fits. Printed are milliseconds a step of the whole step (search, impacts,
loads, ledger; no output), of the search alone, contact points, and sweeps; for every tenth of a second from the first landing on, and the mean
of the last three tenths, at rest. By hand, the kernels warm:

    taskset -c 0 python tests/benchmarks/impulse.py                  # 200 and 1000 clumps
    taskset -c 0 python tests/benchmarks/impulse.py --only 200 --search
    taskset -c 0 python tests/benchmarks/impulse.py --others         # the same pile in MuJoCo, and discs in 2D in pymunk, if installed

--search times the contact search alone for growing numbers of clumps in a loose lattice, to see how it grows.
"""

from __future__ import annotations

import argparse
import time
from typing import Any, cast

import numpy as np

from dem_cli.assembly.scene import build_scene
from dem_cli.engines.impulse.engine import ImpulseEngine
from dem_cli.rigid import Scene
from dem_cli.scenario import ImpulseScenario, load_scenario
from dem_cli.scenario.shipped import folder

DT = 1e-3
TENTH = round(0.1 / DT)
SIDES = {200: 0.5, 1000: 0.8}  # m, of the box
SECONDS = {200: 2.0, 1000: 2.5}


def pour(clumps: int) -> tuple[ImpulseScenario, Scene]:
    """The scenario and its scene."""
    side = SIDES.get(clumps, 0.085 * clumps ** (1.0 / 3.0))
    sides = [f"container.{name}={side} m" for name in ("width", "breadth")]
    scenario = cast(ImpulseScenario, load_scenario(folder() / "impulse-pour.toml", [f"grains.count={clumps}", *sides]))
    return scenario, build_scene(scenario, lambda _: None)


def pile(clumps: int) -> None:
    """Prints a line a tenth of a second, and the mean at rest."""
    scenario, scene = pour(clumps)
    state = ImpulseEngine(scenario, scene).state
    searched = 0.0
    look = state.look

    def timed() -> Any:
        nonlocal searched
        began = time.process_time()
        found = look()
        searched += time.process_time() - began
        return found

    state.look = timed  # type: ignore[method-assign]
    print(f"{clumps} clumps of 4 spheres, time step {DT * 1e3:g} ms")
    rows = []
    for tenth in range(round(10 * SECONDS.get(clumps, 2.0))):
        searched, began = 0.0, time.process_time()
        for _ in range(TENTH):
            state.advance(DT, np.zeros(3))
        each = 1e3 / TENTH
        told = state.solving(True)
        assert state.found is not None
        rows.append((each * (time.process_time() - began), each * searched, len(state.found.i)))
        print(
            f"  {0.1 * (tenth + 1):.1f} s: {rows[-1][0]:6.2f} ms a step, {rows[-1][1]:.2f} of it search; {rows[-1][2]} contacts, "
            f"{told.impact_iterations:.0f} iterations for impacts, {told.load_sweeps:.0f} sweeps for loads, {told.capped} caps, "
            f"kinetic {state.energy().kinetic:.1e} J",
            flush=True,
        )
    whole, search, _ = np.mean(rows[-3:], axis=0)
    print(
        f"  at rest: {whole:.2f} ms a step, {search:.2f} of it search; slowest {max(row[0] for row in rows):.1f} ms a step"
    )


def search() -> None:
    """Prints microseconds a body of the contact search, list made anew each time and kept."""
    for clumps in (500, 1000, 2000, 4000, 8000, 16000):
        scenario, scene = pour(clumps)
        state = ImpulseEngine(scenario, scene).state
        state.look()
        took = []
        for moved in (1.0, 0.0):
            began = time.process_time()
            for turn in range(5):
                state.moving.x[:clumps, 2] += moved * (-1.0) ** turn
                state.look()
            took.append(1e6 * (time.process_time() - began) / 5 / clumps)
        print(f"{clumps} clumps: {took[0]:.2f} us a body with a new list, {took[1]:.2f} with the old one", flush=True)


def mujoco_pile(clumps: int) -> None:
    """The same pile in MuJoCo (soft contacts, Newton solver, elliptic cones, its defaults elsewhere)."""
    try:
        import mujoco
    except ImportError:
        print("mujoco: not installed")
        return
    scenario, scene = pour(clumps)
    side, bodies = scenario.container.width, []
    for k, shape in enumerate(scene.bodies.shape):
        one, f = scene.shapes[shape], scene.bodies.scale[k]
        balls = "".join(
            f'<geom type="sphere" size="{r * f}" pos="{c[0] * f} {c[1] * f} {c[2] * f}" density="2600"/>'
            for c, r in zip(one.centers, one.radii, strict=True)
        )
        x, q = scene.bodies.x[k], scene.bodies.q[k]
        place = f'pos="{x[0]} {x[1]} {x[2]}" quat="{q[0]} {q[1]} {q[2]} {q[3]}"'
        bodies.append(f"<body {place}><freejoint/>{balls}</body>")
    walls = (
        ("0 0 0", "0 0 1"),
        ("0 0 0", "1 0 0"),
        (f"{side} 0 0", "-1 0 0"),
        ("0 0 0", "0 1 0"),
        (f"0 {side} 0", "0 -1 0"),
    )
    planes = "".join(f'<geom type="plane" size="5 5 1" pos="{p}" zaxis="{z}"/>' for p, z in walls)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{DT}" cone="elliptic"/><size memory="4G"/><default><geom friction="0.5 0 0" condim="3"/></default>'
        f"<worldbody>{planes}{''.join(bodies)}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    _tenths(f"MuJoCo {mujoco.__version__}, {clumps} clumps", lambda: mujoco.mj_step(model, data), lambda: data.ncon)


def pymunk_pile(clumps: int) -> None:
    """As many bodies of three discs in 2D in pymunk (Chipmunk), its ten iterations a step."""
    try:
        import pymunk
    except ImportError:
        print("pymunk: not installed")
        return
    rng = np.random.default_rng(1)
    space = pymunk.Space()
    space.gravity = (0.0, -9.81)
    side, r = 0.1 * clumps**0.5, 0.025
    for a, b in (((0, 0), (side, 0)), ((0, 0), (0, 9)), ((side, 0), (side, 9))):
        wall = pymunk.Segment(space.static_body, a, b, 0.001)
        wall.friction, wall.elasticity = 0.3, 0.2
        space.add(wall)
    columns = int(side / 0.13)
    for k in range(clumps):
        body = pymunk.Body()
        body.position = (0.07 + 0.13 * (k % columns), 0.07 + 0.13 * (k // columns))
        body.angle = rng.uniform(0, 6.28)
        discs = [pymunk.Circle(body, r, (1.15 * r * np.cos(t), 1.15 * r * np.sin(t))) for t in (0.0, 2.094, 4.189)]
        for disc in discs:
            disc.density, disc.friction, disc.elasticity = 2600.0, 0.5, 0.2
        space.add(body, *discs)
    _tenths(f"pymunk {pymunk.version}, {clumps} bodies of 3 discs in 2D", lambda: space.step(DT), lambda: 0)


def _tenths(name: str, step: Any, contacts: Any) -> None:
    rows = []
    for _ in range(20):
        began = time.process_time()
        for _ in range(TENTH):
            step()
        rows.append(1e3 / TENTH * (time.process_time() - began))
    print(
        f"{name}: {np.mean(rows[-3:]):.2f} ms a step at the end ({contacts()} contacts), slowest {max(rows):.1f}",
        flush=True,
    )


def main() -> None:
    """Each size in turn; a first short run, which may compile, is left out."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=int, nargs="*", default=[200, 1000], help="numbers of clumps")
    parser.add_argument("--search", action="store_true", help="time the search alone")
    parser.add_argument("--others", action="store_true", help="the same in other codes")
    given = parser.parse_args()
    scenario, scene = pour(8)
    engine = ImpulseEngine(scenario, scene)
    for _ in range(500):
        engine.state.advance(DT, np.zeros(3))
    if given.search:
        search()
        return
    for clumps in given.only:
        pile(clumps)
        if given.others:
            mujoco_pile(clumps)
            pymunk_pile(clumps)


if __name__ == "__main__":
    main()
