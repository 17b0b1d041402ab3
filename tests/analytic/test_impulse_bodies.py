"""Bodies that bounce, roll, land, stand, are shaken and pile up, against closed forms and balances (physics.md 3)."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np
import pytest
from rigid_runs import HEAD, Run, engine_of, run, shipped, written

from dem_cli.errors import RunError, ScenarioError
from dem_cli.scenario import ImpulseScenario, parse_scenario

G = 9.80665
SPHERE = """
[grains]
shape = "sphere"
radius = "10 cm"
density = "1000 kg/m^3"
position = ["0 m", "0 m", "1.1 m"]
[[plane]]
name = "floor"
[[stage]]
kind = "run"
duration = "5 s"
[contact]
restitution = 1.0
friction = 0.3
"""


def mechanical(run: Run) -> np.ndarray:
    """Stored energy of each frame, less what moving bodies apart has brought."""
    return np.array([frame.energy.stored - frame.energy.projection for frame in run.frames])


def test_elastic_bounces_keep_their_energy() -> None:
    energy = mechanical(written(SPHERE, "stage.duration=20 s", "output.interval=50 ms"))
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-9


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.3])
def test_sphere_on_a_slope_rolls_or_slides(friction: float) -> None:
    """5/7 g sin q while tan q < 3.5 mu, else g (sin q - mu cos q), with 2.5 mu g cos q / r of spin."""
    angle, time = np.radians(20.0), 1.0
    run = written(
        SPHERE, "plane.slope=20 deg", f"contact.friction={friction}", "contact.restitution=0", f"stage.duration={time} s",
        f"grains.position=['{float(0.1 * np.sin(angle))!r} m', '0 m', '{float(0.1 * np.cos(angle))!r} m']",
    )  # fmt: skip
    v, w = run.of("v")[-1], run.of("w")[-1]
    speed = float(v @ [np.cos(angle), 0.0, -np.sin(angle)])
    rolls = np.tan(angle) < 3.5 * friction
    slid = G * (np.sin(angle) - friction * np.cos(angle)) * time
    assert speed == pytest.approx(5.0 / 7.0 * G * np.sin(angle) * time if rolls else slid, rel=1e-6)
    assert w[1] == pytest.approx(speed / 0.1 if rolls else 2.5 * friction * G * np.cos(angle) / 0.1 * time, rel=1e-6)


def test_sliding_sphere_comes_to_roll() -> None:
    """5/7 of its speed, at t = 2 u0 / (7 mu g)."""
    run = written(
        SPHERE, "grains.position=['0 m', '0 m', '10 cm']", "grains.velocity=['2 m/s', '0 m/s', '0 m/s']", "stage.duration=0.4 s",
    )  # fmt: skip
    v, w, when = run.of("v")[:, 0], run.of("w")[:, 1], 2.0 * 2.0 / (7.0 * 0.3 * G)
    assert v[-1] == pytest.approx(10.0 / 7.0, rel=1e-6)
    assert w[-1] == pytest.approx(v[-1] / 0.1, rel=1e-6)
    slides = run.time < when - 1e-3
    assert v[slides] == pytest.approx(2.0 - 0.3 * G * run.time[slides], abs=1e-6)


@pytest.mark.parametrize("solver", ["pgs", "energy-tracking"])
def test_tilted_box_lands_flat(solver: str) -> None:
    """2 : 1 : 2 from 40 degrees, e = 0: it hits with an edge, tips over, and lies at half its height; every hit loses energy."""
    run = written(
        """
[grains]
shape = "box"
size = ["2 m", "1 m", "2 m"]
density = "1000 kg/m^3"
position = ["0 m", "0 m", "2 m"]
orientation = { axis = [1, 0, 0], angle = "40 deg" }
[[plane]]
name = "floor"
[[stage]]
kind = "run"
duration = "4 s"
[contact]
restitution = 0.0
friction = 0.5
""",
        f"solver={solver}",
    )
    assert min(abs(run.last.bodies.x[0, 2] - half) for half in (0.5, 1.0)) < 1e-3
    assert np.abs(run.last.bodies.v).max() < 1e-6
    assert np.diff(mechanical(run)).max() < 1e-8 * mechanical(run)[0]


@pytest.mark.parametrize("count", [5, 10])
def test_stack_stands(count: int) -> None:
    """Ten seconds: it sinks by less than 1e-3 of a body, does not drift, and does not move at the end."""
    run = shipped(
        "impulse-stack",
        f"grains.count={count}",
        "output.tracks.grains=[0]",
        "output.interval=1 s",
        "output.tracks.interval=1 s",
    )
    first, last = run.frames[0].bodies, run.last.bodies
    assert np.abs(last.x - first.x).max() < 1e-3 * 0.2
    assert np.abs(last.v).max() < 1e-4
    assert run.last.solving.capped == 0


@pytest.mark.parametrize("count", [64, 200])
def test_pile_settles_without_a_cap(count: int) -> None:
    """Clumps poured into a box: at rest before the limit, no cap hit, penetration below 1e-3 of a body.

    Energy rises in second order of the step where bodies turn on their contacts, by 5e-8 of it in the worst pile that was looked at.
    """
    run = shipped("impulse-pour", f"grains.count={count}", "container.width=35 cm", "container.breadth=35 cm")
    assert run.last.stop_reason.startswith("at rest")
    assert np.diff(mechanical(run)).max() <= 1e-6 * mechanical(run)[0]
    assert run.last.solving.capped == 0
    assert abs(run.last.residual) < 1e-6 * run.last.energy_in
    contacts = run.last.contacts
    assert contacts is not None
    assert contacts.gap.min() > -1e-3 * 0.05
    along = np.einsum("ca,ca->c", contacts.impulse, contacts.normal)
    across = np.linalg.norm(contacts.impulse - along[:, None] * contacts.normal, axis=1)
    assert np.all(along >= -1e-15)
    assert np.all(across <= 0.5 * along + 1e-12)


def test_the_resting_pile_bears_its_weight() -> None:
    """Impulses of a step on the floor, less those on the walls' friction, carry the weight for dt."""
    run = shipped("impulse-pour", "grains.count=30")
    contacts, bodies = run.last.contacts, run.last.bodies
    assert contacts is not None
    on_walls = contacts.impulse[contacts.j < 0].sum(axis=0)
    assert on_walls == pytest.approx(
        [0.0, 0.0, -bodies.mass.sum() * G * run.last.dt], abs=1e-3 * bodies.mass.sum() * G * run.last.dt
    )


def test_frames_tell_the_step_that_was_made() -> None:
    """Impulses over it are forces: 2 ms do not divide 5 ms, so steps are of 5/3 ms, and the sphere at rest weighs what it weighs."""
    run = written(
        SPHERE, "grains.position=['0 m', '0 m', '10 cm']", "contact.restitution=0", "stage.duration=50 ms",
        "integration.time_step=2 ms", "output.interval=5 ms",
    )  # fmt: skip
    contacts, bodies = run.last.contacts, run.last.bodies
    assert contacts is not None
    assert run.last.dt == pytest.approx(5e-3 / 3.0, rel=1e-9)
    assert contacts.impulse[0, 2] / run.last.dt == pytest.approx(-bodies.mass[0] * G, rel=1e-9)


def test_same_bits_twice() -> None:
    one, other = (shipped("impulse-pour", "grains.count=20", "stage.limit=1 s").last.bodies for _ in range(2))
    for name in ("x", "q", "v", "w"):
        assert np.array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize(("amplitude", "sticks"), [("200 gal", True), ("400 gal", False)])
def test_shaken_box_sticks_or_slides(amplitude: str, sticks: bool) -> None:
    """mu = 0.3: below 294 gal the box moves with the container; above, it slides, and the work of the shaking goes into friction."""
    run = written(
        f"""
[grains]
shape = "box"
size = "20 cm"
density = "1000 kg/m^3"
position = ["50 cm", "50 cm", "10 cm"]
[contact]
restitution = 0.0
friction = 0.3
[container]
width = "1 m"
breadth = "1 m"
[[stage]]
kind = "shake"
amplitude = "{amplitude}"
frequency = "5 Hz"
cycles = 5
"""
    )
    moved = np.abs(run.of("x")[:, 0] - 0.5).max()
    energy = run.last.energy
    assert (moved < 1e-6) == sticks
    if not sticks:
        assert energy.work == pytest.approx(energy.friction + energy.kinetic, rel=1e-6)
        assert energy.friction > 0.0
    assert abs(run.last.residual) < 1e-9


def test_tilted_gravity_does_what_a_tilted_plane_does() -> None:
    """A slope under vertical gravity is a floor under tilted gravity: the same speeds."""
    slope = shipped("impulse-slope", "output.tracks.interval=50 ms").of("v")
    angle = np.radians(30.0)
    flat = written(
        f"""
[grains]
shape = "box"
size = ["2 m", "1 m", "2 m"]
density = "2000 kg/m^3"
position = ["0 m", "0 m", "1 m"]
[contact]
restitution = 0.0
friction = 0.3
[container]
gravity_direction = [{float(np.sin(angle))!r}, 0, {float(-np.cos(angle))!r}]
[[plane]]
name = "floor"
[[stage]]
kind = "run"
duration = "1 s"
""",
        "integration.time_step=0.5 ms", "output.interval=50 ms",
    ).of("v")  # fmt: skip
    assert np.linalg.norm(flat[-1]) == pytest.approx(np.linalg.norm(slope[-1]), rel=1e-9)


@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_slope_of_triangles_is_as_good_as_a_plane(shape: str, tmp_path: Path) -> None:
    """A box slides, and a sphere rolls, over hundreds of seams as in closed form."""
    angle = np.radians(30.0)
    rows = [f"{0.25 * i},{0.25 * k},{float(-0.25 * i * np.tan(angle))!r}" for i in range(-10, 31) for k in range(-8, 9)]
    (tmp_path / "slope.csv").write_text("x,y,z\n" + "\n".join(rows))
    size = 'size = ["80 cm", "40 cm", "80 cm"]' if shape == "box" else 'radius = "40 cm"'
    x, z = (float(0.4 * part(angle)) for part in (np.sin, np.cos))
    text = f"""
[grains]
shape = "{shape}"
{size}
density = "2000 kg/m^3"
position = ["{x!r} m", "1.3 cm", "{z!r} m"]
orientation = {{ axis = [0, 1, 0], angle = "30 deg" }}
[contact]
restitution = 0.0
friction = 0.3
[terrain]
file = "slope.csv"
[[stage]]
kind = "run"
duration = "1 s"
"""
    last = run(cast(ImpulseScenario, parse_scenario(HEAD + text, folder=tmp_path))).last.bodies
    speed = float(last.v[0] @ [np.cos(angle), 0.0, -np.sin(angle)])
    expected = G * (np.sin(angle) - 0.3 * np.cos(angle)) if shape == "box" else 5.0 / 7.0 * G * np.sin(angle)
    assert speed == pytest.approx(expected, rel=1e-9)


TWO = """
[grains]
shape = "sphere"
radius = "10 cm"
density = "1000 kg/m^3"
count = 2
position = ["0 m", "0 m", "0 m"]
step = ["15 cm", "0 m", "0 m"]
[contact]
restitution = 0.5
friction = 0.3
[container]
gravity = "0 m/s^2"
[[stage]]
kind = "run"
duration = "10 ms"
"""


def test_overlapping_starts_are_pushed_apart_and_told() -> None:
    run = written(TWO)
    bodies = run.frames[0].bodies
    assert bodies.x[1, 0] - bodies.x[0, 0] == pytest.approx(0.2, abs=1e-4)
    assert "body 0 (sphere) and body 1 (sphere) overlap at the start by 0.5" in run.frames[0].warnings[0]
    assert run.last.energy.kinetic == 0.0


def test_overlapping_starts_may_be_refused() -> None:
    with pytest.raises(
        ScenarioError, match=r"body 0 \(sphere\) and body 1 \(sphere\) overlap at the start by 0\.5 .*overlaps"
    ):
        written(TWO, "packing.overlaps=refuse")


def test_blow_up_names_bodies_time_and_advice() -> None:
    """Much too long a step: the sphere is deep in the floor when it is first looked for."""
    with pytest.raises(
        RunError, match=r"t = .* s: body 0 \(sphere\) and floor penetrate by .*max_penetration = 0\.05.*time step"
    ):
        written(SPHERE, "integration.time_step=50 ms", "solver.max_penetration=0.05", "output.interval=50 ms")


def test_bodies_that_leave_are_counted_and_take_their_energy_along() -> None:
    """Thrown over the wall of a container without lid: escaped once it is above, and the ledger still closes."""
    run = written(
        SPHERE.replace('[[plane]]\nname = "floor"\n', '[container]\nwidth = "1 m"\nbreadth = "1 m"\nheight = "1.5 m"\n'),
        "grains.position=['50 cm', '50 cm', '0.5 m']", "grains.velocity=['0 m/s', '0 m/s', '9 m/s']", "stage.duration=0.5 s",
    )  # fmt: skip
    assert run.last.bodies.escaped.tolist() == [True]
    assert any("has left the scene: 0" in warning for frame in run.frames for warning in frame.warnings)
    assert run.last.energy.escaped > 0.0
    assert abs(run.last.residual) < 1e-9 * run.last.energy_in


def test_a_body_may_hold_still_without_gravity() -> None:
    scenario = parse_scenario(HEADLESS)
    assert isinstance(scenario, ImpulseScenario)
    engine = engine_of(scenario)
    last = list(engine.frames())[-1]
    assert last.stage_end
    assert np.abs(last.bodies.v).max() == 0.0


HEADLESS = """
engine = "impulse"
[grains]
shape = "box"
size = "1 m"
density = "1000 kg/m^3"
position = ["0 m", "0 m", "0 m"]
[contact]
restitution = 0.5
friction = 0.3
[container]
gravity = "0 m/s^2"
[[stage]]
kind = "settle"
limit = "0.2 s"
"""
