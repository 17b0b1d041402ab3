"""Ends of walls, corners, and grains that leave the container."""

from __future__ import annotations

import math

import numpy as np
import pytest
from few_grains import KN, MASS, RADIUS, G, few_grains, floor, run_for, segments, series

DT = math.pi * math.sqrt(MASS / KN) / 200


@pytest.mark.parametrize("offset", [0.0, 0.2, 0.5, -0.8])
@pytest.mark.parametrize("end", ["first", "second"])
def test_tip_of_a_wall_deflects(end, offset):
    # A smooth disc that falls on the tip at (0, 0) of a wall that hangs down meets a point: the force goes through the tip.
    wall = (0.0, 0.0, 0.0, -1.0) if end == "first" else (0.0, -1.0, 0.0, 0.0)
    speed, x0 = 0.05, offset * RADIUS
    height = math.sqrt(RADIUS**2 - x0**2)
    bench = few_grains([x0], [height + 0.1 * RADIUS], vy=-speed, walls=segments([wall]), dt=DT)
    frames = run_for(bench, 0.2 * RADIUS / speed + 4 * 200 * DT, every=5)
    grains = frames[-1].grains
    assert not len(frames[-1].contacts)
    assert any(len(frame.contacts) for frame in frames)
    # Angular momentum about the tip is kept, energy too, and the velocity is mirrored at the normal through the tip.
    spun = series(frames, "x") * series(frames, "vy") - series(frames, "y") * series(frames, "vx")
    np.testing.assert_allclose(spun, -x0 * speed, rtol=0, atol=1e-12 * RADIUS * speed)
    np.testing.assert_allclose(math.hypot(grains.vx[0], grains.vy[0]), speed, rtol=1e-5)
    n = np.array([x0, height]) / RADIUS
    incoming = np.array([0.0, -speed])
    wanted = incoming - 2.0 * (incoming @ n) * n
    np.testing.assert_allclose([grains.vx[0], grains.vy[0]], wanted, rtol=0, atol=0.02 * speed)
    assert grains.spin[0] == 0.0


def test_passes_beside_the_tip():
    # Half a hair further than its radius from the end, the disc does not feel the wall.
    bench = few_grains(
        [RADIUS * (1.0 + 1e-9)], [0.5 * RADIUS], vy=-1.0, walls=segments([(0.0, 0.0, 0.0, -0.01)]), dt=DT
    )
    frames = run_for(bench, 3.0 * RADIUS, every=10)
    assert not any(len(frame.contacts) for frame in frames)
    np.testing.assert_allclose(series(frames, "vy"), -1.0, rtol=1e-14)


def test_tip_joins_the_flank_smoothly():
    # A disc that lies on a floor and moves past its end loses no support before its centre is over the end.
    bench = few_grains([-3.0 * RADIUS], [RADIUS - MASS * G / KN], vx=0.05, walls=segments([(-1.0, 0.0, 0.0, 0.0)]),
                       gravity=(0.0, -G), dt=DT)  # fmt: skip
    frames = run_for(bench, 3.3 * RADIUS / 0.05, every=50)
    x, y = series(frames, "x"), series(frames, "y")
    np.testing.assert_allclose(y[x < 0.0], RADIUS - MASS * G / KN, rtol=1e-9)
    overlap = np.array([frame.contacts.overlap.sum() for frame in frames])
    assert np.abs(np.diff(overlap[x < 0.2 * RADIUS])).max() < 0.1 * MASS * G / KN
    np.testing.assert_allclose([frame.residual for frame in frames], 0.0, atol=1e-6 * MASS * G * RADIUS)


def test_corner_holds_on_both_walls():
    walls = segments([(0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.0)])
    overlap = MASS * G / math.sqrt(2.0) / KN
    bench = few_grains([RADIUS - overlap], [RADIUS - overlap], walls=walls, dt=DT,
                       gravity=(-G / math.sqrt(2.0), -G / math.sqrt(2.0)))  # fmt: skip
    frames = run_for(bench, 0.05, every=100)
    for frame in frames:
        np.testing.assert_allclose(frame.contacts.normal, MASS * G / math.sqrt(2.0), rtol=1e-9)
        np.testing.assert_allclose(frame.forces, 0.0, atol=1e-9 * MASS * G)


@pytest.mark.parametrize(("vx", "vy"), [(2.0, 0.0), (-2.0, 0.0), (0.0, -2.0)])
def test_leaves_the_box(vx, vy):
    bench = few_grains([0.05, 0.05], [0.05, 0.1], vx=[vx, 0.0], vy=[vy, 0.0], spin=[30.0, 0.0],
                       box=(0.0, 0.1, 0.0), dt=DT)  # fmt: skip
    frames = run_for(bench, 0.06, every=10)
    gone = np.array([frame.grains.escaped[0] for frame in frames])
    first = int(np.argmax(gone))
    assert gone.any()
    assert np.all(gone[first:])  # and it stays so
    assert not any(frame.grains.escaped[1] for frame in frames)
    # It was wholly outside, and by no more than the skin of the list and a step's way.
    place = np.array([frames[first].grains.x[0], frames[first].grains.y[0]])
    beyond = max(-place[0], place[0] - 0.1, -place[1]) - RADIUS
    assert 0.0 <= beyond <= 0.2 * RADIUS
    still = frames[-1].grains
    assert (still.x[0], still.y[0]) == tuple(place)
    assert still.vx[0] == still.vy[0] == still.spin[0] == 0.0
    brought = 0.5 * MASS * 4.0 + 0.25 * MASS * RADIUS**2 * 900.0
    np.testing.assert_allclose(frames[-1].energy.escaped, brought, rtol=1e-12)
    assert frames[-1].energy.kinetic == 0.0
    np.testing.assert_allclose([frame.residual / brought for frame in frames], 0.0, atol=1e-12)


def test_leaves_under_gravity():
    # Its potential energy goes along; energies of the half step are at most g dt v apart.
    for dt in (DT, DT / 10):
        bench = few_grains([0.05, 0.02], [0.05, 0.01], gravity=(0.0, -G), box=(0.0, 0.1, 0.0), dt=dt,
                           walls=segments([(0.0, 0.0, 0.04, 0.0)]))  # fmt: skip
        frames = run_for(bench, 0.2, every=50)
        last = frames[-1]
        assert list(last.grains.escaped) == [True, False]
        scale = MASS * G * 0.06
        np.testing.assert_allclose([frame.residual / scale for frame in frames], 0.0, atol=40.0 * dt)
        np.testing.assert_allclose(last.energy.escaped, MASS * G * 0.05, rtol=0, atol=40.0 * dt * scale)


def test_escaped_grains_touch_no_more():
    # What has left is no obstacle: a second disc flies through the place where the first one rests.
    bench = few_grains([0.08, 0.03], [0.05, 0.05], vx=[4.0, 2.0], box=(0.0, 0.1, 0.0), dt=DT)
    frames = run_for(bench, 0.1, every=10)
    assert frames[-1].grains.escaped.all()
    assert not any(len(frame.contacts) for frame in frames)
    np.testing.assert_allclose(frames[-1].energy.escaped, 0.5 * MASS * (16.0 + 4.0), rtol=1e-12)


def test_floor_of_finite_length_ends():
    # Off the end of a floor a disc falls freely and counts as escaped once it is below the box.
    bench = few_grains([0.0], [RADIUS - MASS * G / KN], vx=0.4, walls=floor(0.0, length=0.04), gravity=(0.0, -G), dt=DT,
                       box=(-1.0, 1.0, 0.0))  # fmt: skip
    frames = run_for(bench, 0.2, every=20)
    assert frames[-1].grains.escaped[0]
    assert frames[-1].grains.x[0] > 0.02 + RADIUS
