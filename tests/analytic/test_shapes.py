"""Ellipses that are dropped, rock and stand on slopes, and bodies in free fall, against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from body_samples import BENT, PAIR, TRIANGLE, bodies, bonds_of, ellipses, set_in_motion
from few_grains import KN, MASS, RADIUS, Bench, G, bench_of, floor

DT = math.pi * math.sqrt(MASS / KN) / 50


def dropped(ratio: float, angle: float, dt: float, **changes: Any) -> Bench:
    a = RADIUS * math.sqrt(ratio)
    return bench_of(ellipses([0.0], [1.5 * a], ratio, angle), dt=dt, walls=floor(changes.get("contact_friction", 0.0)),
                    gravity=(0.0, -G), **changes)  # fmt: skip


@pytest.mark.parametrize("ratio", [1.5, 3.0, 5.0])
def test_elastic_drop_keeps_energy(ratio: float) -> None:
    """A second of bouncing, askew, without friction or damping: the energy between contacts stays that of the start.

    The step in which a contact opens or closes gains or loses energy of the second order in dt; the ledger knows it.
    """
    errors = []
    for parts in (1, 2, 4):
        bench = dropped(ratio, 0.5, DT / parts)
        start, worst, bounces, touching = bench.frame(), 0.0, 0, False
        for _ in range(400):
            assert bench.steps(40 * parts) == 0
            frame = bench.frame()
            bounces += len(frame.contacts) > 0 and not touching
            touching = len(frame.contacts) > 0
            worst = max(worst, abs(frame.energy.stored / start.energy.stored - 1.0))
            assert frame.grains.vx[0] == 0.0
        errors.append(worst)
        assert bounces >= 6
        assert abs(frame.residual) < worst * start.energy.stored + 1e-12
    print(
        f"ratio {ratio}: {bounces} bounces, error of the energy {errors} with the time step, half and a quarter of it"
    )
    assert errors[0] < 5e-3
    assert errors[2] < 0.3 * errors[0]
    assert np.abs(frame.grains.spin).max() > 1.0


@pytest.mark.parametrize("ratio", [1.2, 2.0, 5.0])
@pytest.mark.parametrize("angle", [0.02, 0.8, 1.5, -0.9])
def test_damped_drop_ends_on_the_flat_side(ratio: float, angle: float) -> None:
    """At rest: the long axis level, the centre b - m g/kn above the floor, and no motion at all."""
    parts = 2 if ratio == 5.0 else 1  # its tips come down at 100 rad/s: the ledger's error grows with that times dt
    bench = dropped(ratio, angle, DT / parts, contact_friction=0.5, contact_damping_ratio=0.5)
    rolled = 0.0
    assert bench.frame().energy.potential > 0.0
    for _ in range(55):  # rolling is not damped by the floor: a little mass damping
        assert bench.steps(2000 * parts, damping=(8.0, 0.0)) == 0
        rolled = max(rolled, abs(bench.state.grains().angle[0] - angle))
    frame = bench.frame()
    pressed = MASS * G / KN
    assert frame.grains.y[0] == pytest.approx(RADIUS / math.sqrt(ratio) - pressed, abs=1e-8 * pressed)
    assert math.remainder(frame.grains.angle[0], math.pi) == pytest.approx(0.0, abs=1e-8)
    assert rolled > 0.9 * min(abs(angle), math.pi / 2 - abs(angle))
    assert frame.energy.kinetic < 1e-18 * frame.energy_in
    np.testing.assert_allclose(frame.contacts.normal, MASS * G, rtol=1e-8)
    assert np.abs(frame.forces).max() < 1e-8 * MASS * G
    assert abs(frame.residual) < 1e-3 * frame.energy_in
    assert len(frame.contacts) == 1


@pytest.mark.parametrize("ratio", [1.3, 2.0])
def test_ellipse_rocks_on_its_flat_side(ratio: float) -> None:
    """Small rocking without slip: about the contact the centre's height rises with (a^2 - b^2)/b theta^2/2, so
    w^2 = m g (a^2 - b^2)/b / (I + m b^2) (rolling; KS and KN are stiff against it).
    """
    a, b = RADIUS * math.sqrt(ratio), RADIUS / math.sqrt(ratio)
    start = 1e-3
    grains = ellipses([0.0], [b - MASS * G / KN], ratio, start)
    bench = bench_of(grains, dt=DT, walls=floor(50.0), gravity=(0.0, -G))
    wanted = 2.0 * math.pi / math.sqrt(MASS * G * (a * a - b * b) / b / (grains.inertia[0] + MASS * b * b))
    crossings, last, time = [], start, 0.0
    while len(crossings) < 5:
        assert bench.steps(20) == 0
        now, before, time = bench.state.grains().angle[0], last, bench.state.time
        if before * now < 0.0:
            crossings.append(time - 20 * DT * now / (now - before))
        last = now
    period = 0.5 * (crossings[4] - crossings[0])
    assert period == pytest.approx(wanted, rel=2e-3)


def test_ellipse_stands_on_a_slope() -> None:
    """Held by friction on a slope, tilted so that the weight goes through the contact: there is a place for it while tan q is below
    (a^2 - b^2)/(2 a b); with dampers it comes to rest there.
    """
    ratio, slope = 2.0, 0.1
    bench = bench_of(ellipses([0.0], [0.0085], ratio, slope), dt=DT, walls=floor(0.8, slope), gravity=(0.0, -G),
                     contact_friction=0.8, contact_damping_ratio=0.5)  # fmt: skip
    for _ in range(55):
        assert bench.steps(2000, damping=(8.0, 0.0)) == 0
    frame = bench.frame()
    g, c = frame.grains, frame.contacts
    assert frame.energy.kinetic < 1e-15 * frame.energy_in
    # Centre right above the outline's lowest point across the slope, where the forces act; half the overlap lies before the contact's point.
    assert c.px[0] + 0.5 * c.overlap[0] * c.nx[0] == pytest.approx(g.x[0], abs=1e-7 * RADIUS)
    assert (c.nx[0], c.ny[0]) == pytest.approx((math.sin(slope), -math.cos(slope)), abs=1e-12)
    assert c.normal[0] == pytest.approx(MASS * G * math.cos(slope), rel=1e-6)
    assert abs(c.shear[0]) == pytest.approx(MASS * G * math.sin(slope), rel=1e-6)
    assert abs(g.angle[0] - slope) > 0.01


def test_normal_force_has_an_arm() -> None:
    """A smooth ellipse that meets the floor askew turns by the impulse times its arm (thesis (4.50)): I w = J h'."""
    ratio, angle, speed = 3.0, 0.6, 0.02
    a, b = RADIUS * math.sqrt(ratio), RADIUS / math.sqrt(ratio)
    reach = math.hypot(a * math.sin(angle), b * math.cos(angle))
    grains = ellipses([0.0], [reach + 1e-5], ratio, angle)
    grains.vy[0] = -speed
    bench = bench_of(grains, dt=DT / 4.0, walls=floor())
    while bench.frame().energy.elastic_normal == 0.0:
        bench.steps(1)
    while len(bench.frame().contacts):
        bench.steps(1)
    g = bench.frame().grains
    impulse = MASS * (g.vy[0] + speed)
    arm = (a * a - b * b) * math.sin(angle) * math.cos(angle) / reach  # of the lowest point beside the centre
    # An elastic impulse: J = 2 v/(1/m + arm^2/I)
    assert impulse == pytest.approx(2.0 * speed / (1.0 / MASS + arm**2 / grains.inertia[0]), rel=5e-3)
    assert abs(g.spin[0]) == pytest.approx(impulse * arm / grains.inertia[0], rel=5e-3)
    assert g.spin[0] < 0.0  # the low end lies on the left (angle > 0): the floor pushes it up


@pytest.mark.parametrize("joined", ["rigid", "bonded"])
def test_struck_body_turns_about_its_centre_of_mass(joined: str) -> None:
    """A free body whose discs start as a rigid one in a rotating fall: its centre of mass falls freely, its turn is uniform."""
    for shape in (PAIR, BENT, TRIANGLE):
        grains = set_in_motion(bodies([shape], [0.0], [0.0], 0.2), vx=0.3, vy=1.0, spin=8.0)
        more = {"rigid": True} if joined == "rigid" else {"bonds": bonds_of(grains, 1e12, 1e12)}
        bench = bench_of(grains, dt=DT, gravity=(0.0, -G), **more)
        assert bench.steps(4000) == 0
        g, t = bench.frame().grains, bench.state.time
        x, y = (g.mass * g.x).sum() / g.mass.sum(), (g.mass * g.y).sum() / g.mass.sum()
        np.testing.assert_allclose([x, y], [0.3 * t, t - 0.5 * G * t * t], rtol=0, atol=1e-11)
        np.testing.assert_allclose(g.angle, 0.2 + 8.0 * t, rtol=1e-5)
        np.testing.assert_allclose(g.spin, 8.0, rtol=1e-5)
