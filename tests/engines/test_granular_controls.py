"""Controls of the granular element engine: what is held, what is reached, where loading is reversed, and where branches begin."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from granular_samples import COMPRESS, SIGMA, prepared, run, stages, turned

from dem_cli.state import Increment

TEST: dict[str, Any] = {"kind": "shear", "hold": "mean-stress", "shear_strain": 0.0025}
CYCLES: dict[str, Any] = {"kind": "cyclic", "hold": "mean-stress", "limit": {"stress_ratio": 0.2}, "cycles": 1}


def last_stage(stage: dict[str, Any], **changes: Any) -> list[Increment]:
    """A stage after compression, from its start on."""
    return stages(run({"seed": 4, "stage": [COMPRESS, stage], **changes}))[1]


def shear_strain(one: Increment) -> float:
    return float(one.strain[one.axial] - one.strain[1 - one.axial])


def deviator(one: Increment) -> float:
    return float(one.stress[one.axial] - one.stress[1 - one.axial])


def same_bits(a: Increment, b: Increment) -> None:
    for name in ("x", "y", "angle", "radius"):
        assert getattr(a.grains, name).tobytes() == getattr(b.grains, name).tobytes()
    for name in ("normal", "shear", "i", "j"):
        assert getattr(a.contacts, name).tobytes() == getattr(b.contacts, name).tobytes()
    assert a.stress.tobytes() == b.stress.tobytes()
    assert a.strain.tobytes() == b.strain.tobytes()
    assert a.energy == b.energy


def test_levels_of_compression() -> None:
    """Each level brings both stresses to its share, the last to the tolerance; strains count from its end."""
    found = run({"stage": [{**COMPRESS, "levels": [0.4, 0.7, 1.0]}]})
    assert len(found) == 4
    for one, share, tolerance in zip(found[1:], (0.4, 0.7, 1.0), (1e-4, 1e-4, 1e-6), strict=True):
        np.testing.assert_allclose(one.stress, share * SIGMA, rtol=2.0 * tolerance)
    assert found[-1].stage_end
    assert found[-1].strain.tolist() == [0.0, 0.0]
    assert found[-1].area == pytest.approx(found[-1].width * found[-1].height, rel=1e-12)


def test_friction_while_compressing_is_left_behind() -> None:
    """The smaller it is, the denser the sample; forces of the last level are those of the contacts' own friction."""
    area = []
    for angle in ("0 deg", "25 deg"):
        last = run({"seed": 4, "contact.friction": "10 deg", "stage": [{**COMPRESS, "friction": angle}]})[-1]
        grains = last.contacts.j >= 0
        share = np.abs(last.contacts.shear[grains]) / last.contacts.normal[grains]
        assert share.max() <= math.tan(math.radians(10.0)) * (1.0 + 1e-9)
        area.append(last.area)
    assert area[0] < area[1]


@pytest.mark.parametrize("axial", ["x", "y"])
@pytest.mark.parametrize("hold", ["mean-stress", "lateral-stress", "volume", "lateral-strain"])
def test_what_is_held(hold: str, axial: str) -> None:
    """To the tolerance each time; the shear strain grows by 0.0005 each and ends where asked, the sample is compressed along `axial`."""
    found = last_stage({**TEST, "hold": hold, "axial": axial, "shear_strain": 0.0022})
    assert len(found) == 6
    along, across = (0, 1) if axial == "x" else (1, 0)
    start = found[0]
    for k, one in enumerate(found):
        e, s = one.strain, one.stress
        assert e[along] - e[across] == pytest.approx(min(0.0005 * k, 0.0022), abs=1e-12)
        if hold == "mean-stress":
            assert s.mean() == pytest.approx(start.stress.mean(), rel=1.01e-6)
        elif hold == "lateral-stress":
            assert s[across] == pytest.approx(start.stress[across], rel=1.01e-6)
        elif hold == "volume":
            assert one.area == pytest.approx(start.area, rel=1e-12)
            assert (1.0 - e[0]) * (1.0 - e[1]) == pytest.approx(1.0, rel=1e-12)
        else:
            assert e[across] == 0.0
        assert math.isnan(one.pore_pressure) == (hold != "volume" or k == 0)
        if k:
            assert one.axial == along
            assert s[along] > s[across]
    assert found[-1].stop_reason == "shear strain of 0.22 % reached"
    assert [one.stage_end for one in found] == [False] * 5 + [True]


@pytest.mark.parametrize(("total", "axial"), [("mean-stress", "y"), ("lateral-stress", "y"), ("lateral-stress", "x")])
def test_pore_pressure(total: str, axial: str) -> None:
    """What the total stress keeps and the grains do not bear: p0 - p', or with the lateral stress s0 - s'."""
    found = last_stage({**TEST, "hold": "volume", "total": total, "axial": axial})
    lateral = 0 if axial == "y" else 1
    for one in found[1:]:
        borne = one.stress.mean() if total == "mean-stress" else one.stress[lateral]
        held = found[0].stress.mean() if total == "mean-stress" else found[0].stress[lateral]
        assert one.pore_pressure == pytest.approx(held - borne, abs=1e-6 * SIGMA)
    assert abs(found[-1].pore_pressure) > 1e-2 * SIGMA


@pytest.mark.parametrize(
    "limit",
    [{"stress_ratio": 0.2}, {"stress": "2.5 kPa"}, {"strain": 0.00053}],
    ids=["stress ratio", "stress", "strain"],
)
@pytest.mark.parametrize("axial", ["x", "y"])
def test_cycles_turn_at_their_limits(limit: dict[str, Any], axial: str) -> None:
    """At both limits in turn, and back to the start: stresses to 1e-3, strains to the last digits."""
    found = last_stage({**CYCLES, "limit": limit, "cycles": 2, "axial": axial, "increment": 0.0002})
    by_strain = "strain" in limit
    path = np.array([shear_strain(one) if by_strain else deviator(one) for one in found])
    at = {"stress_ratio": 0.2 * SIGMA, "stress": 2500.0, "strain": 0.00053}[next(iter(limit))]
    step = np.diff([shear_strain(one) for one in found])
    turns = np.flatnonzero(np.sign(step[1:]) != np.sign(step[:-1])) + 1
    assert len(turns) == 4
    np.testing.assert_allclose(path[turns], [at, -at, at, -at], rtol=1e-11 if by_strain else 1e-3)
    assert path[-1] == pytest.approx(path[0], abs=1e-14 if by_strain else 1.01e-3 * SIGMA * 1e-3)
    assert np.abs(step).max() <= 0.0002 * (1.0 + 1e-9)
    assert found[-1].stop_reason == "2 cycles done"
    for one in found:
        assert one.stress.mean() == pytest.approx(SIGMA, rel=2.01e-6)


def test_half_cycles_end_at_the_largest_strain() -> None:
    """A limit that is out of reach: reversed after 0.001 from the last reversal."""
    found = last_stage({**CYCLES, "limit": {"stress": "14 kPa"}, "max_strain": 0.001, "increment": 0.00025})
    path = np.array([shear_strain(one) for one in found])
    np.testing.assert_allclose(path[:9] / 0.00025, [0, 1, 2, 3, 4, 3, 2, 1, 0], atol=1e-6)


def test_liquefied() -> None:
    """At constant volume a sample that loses 2 % of its stress is told to have liquefied, and in which cycle."""
    stage = {
        **CYCLES,
        "hold": "volume",
        "limit": {"strain": 0.001},
        "cycles": 5,
        "increment": 0.0005,
        "liquefied": 0.981,
    }
    found = last_stage(stage, **{"stage.0.friction": "25 deg", "seed": 1})
    share = [one.stress.mean() / found[0].stress.mean() for one in found]
    assert share[-1] < 0.981
    assert min(share[:-1]) >= 0.981
    assert found[-1].stage_end
    assert f"liquefied in cycle {found[-1].stop_reason.split()[3].rstrip(':')}" in found[-1].stop_reason
    assert f"{share[-1]:.2g}" in found[-1].stop_reason


@pytest.mark.parametrize(
    ("x", "y"),
    [
        ({"stress": "16 kPa"}, {"stress": "18 kPa"}),
        ({"stress": "12 kPa"}, {"strain": 0.0004}),
        ({"strain": -0.0003}, {"stress": "14 kPa"}),
        ({"strain": 0.0002}, {"strain": 0.0005}),
    ],
)
def test_load_reaches_its_targets(x: dict[str, Any], y: dict[str, Any]) -> None:
    """On a straight way: stress and strain of each direction at every increment."""
    found = last_stage({"kind": "load", "x": x, "y": y, "increments": 4})
    assert len(found) == 5
    for k, one in enumerate(found):
        for direction, target in enumerate((x, y)):
            if "strain" in target:
                assert one.strain[direction] == pytest.approx(0.25 * k * target["strain"], abs=1e-14)
            else:
                start, end = found[0].stress[direction], 1e3 * float(target["stress"].split()[0])
                assert one.stress[direction] == pytest.approx(start + 0.25 * k * (end - start), rel=2e-6)
    assert found[-1].stop_reason == "stresses and strains reached"


@pytest.mark.parametrize(
    ("kind", "x", "y"),
    [
        ("chain", {"strain": -0.0003}, {"strain": 0.0005}),
        ("chain", {"stress": "14 kPa"}, {"strain": 0.0005}),
        ("membrane", {"stress": "13 kPa"}, {"stress": "18 kPa"}),
        ("membrane", {"stress": "15 kPa"}, {"strain": 0.0005}),
    ],
)
def test_load_inside_other_boundaries(kind: str, x: dict[str, Any], y: dict[str, Any]) -> None:
    """Grains in a ring, or between membranes, whose pressure is the stress across x, follow a straight way, too."""
    found = last_stage(
        {"kind": "load", "x": x, "y": y, "increments": 3}, **{"boundary.kind": kind, "boundary.radius": "4 mm"}
    )
    assert len(found) == 4
    for k, one in enumerate(found):
        for direction, target in enumerate((x, y)):
            if "strain" in target:
                assert one.strain[direction] == pytest.approx(k / 3.0 * target["strain"], abs=1e-12)
            elif kind == "chain" or direction == 1:
                start, end = found[0].stress[direction], 1e3 * float(target["stress"].split()[0])
                assert one.stress[direction] == pytest.approx(start + k / 3.0 * (end - start), rel=1e-5)
        assert one.area > 0.0
    if kind == "membrane" and x["stress"] != "15 kPa":
        assert found[-1].stress[0] == pytest.approx(13e3, rel=0.05)  # what the links bear is some percent of it
    assert found[-1].stop_reason == "stresses and strains reached"


def test_strains_go_on_from_the_start_of_the_shearing() -> None:
    """A second stage goes on where the first ended; its shear strain counts from its own start."""
    second = {**TEST, "hold": "lateral-stress", "shear_strain": 0.001, "name": "more"}
    one = stages(run({"seed": 4, "stage": [COMPRESS, {**TEST, "shear_strain": 0.001}, second]}))
    assert shear_strain(one[1][-1]) == pytest.approx(0.001, abs=1e-12)
    same_bits(one[1][-1], one[2][0])
    assert shear_strain(one[2][-1]) == pytest.approx(0.002, abs=1e-12)


def test_branches_start_from_the_named_state() -> None:
    """Bit by bit, whatever was done in between; and they go on as if nothing had been."""
    after = {**TEST, "name": "again", "from": "compress"}
    undrained = {**TEST, "name": "undrained", "from": "compress", "hold": "volume"}
    found = stages(run({"seed": 4, "stage": [COMPRESS, TEST, undrained, after]}))
    for k in (1, 2, 3):
        same_bits(found[0][-1], found[k][0])
    for a, b in zip(found[1], found[3], strict=True):
        same_bits(a, b)
    assert found[2][-1].stress[1] != found[1][-1].stress[1]


def test_the_same_bits_twice() -> None:
    changes = {"seed": 2, "boundary.kind": "membrane", "boundary.radius": "4 mm", "stage.1.hold": "lateral-stress"}
    for a, b in zip(run(changes), run(changes), strict=True):
        same_bits(a, b)


# -- boundaries


def test_membrane_holds_its_pressure() -> None:
    """No walls left and right; the lateral stress is the pressure but for what links bear; both ways of holding mean the same pressure."""
    changes = {"boundary.kind": "membrane", "boundary.radius": "3 mm", "grains.count": 40}
    found = last_stage({**TEST, "hold": "lateral-stress"}, **changes)
    for one in found:
        assert one.walls.name == ("bottom", "top")
        assert one.stress[0] == pytest.approx(SIGMA, rel=0.06)
        assert one.boundary > 0
        assert set(one.contacts.j[one.contacts.j < 0].tolist()) == {-1, -2}  # walls are numbered as they are told
        assert len(one.grains) == 40 + one.boundary
        assert one.area == pytest.approx(one.width * one.height, rel=1e-12)
    assert found[-1].stress[1] > 1.1 * found[-1].stress[0]
    # lateral strain comes as it does: the stage ends with the nearest increment
    assert abs(shear_strain(found[-1]) - 0.0025) <= 0.5 * 0.0005
    outer = found[-1].grains.x[40:]
    middle = outer.mean()
    grown = [np.ptp(one.grains.x[40:]) for one in (found[0], found[-1])]
    assert grown[1] > grown[0]
    assert np.sum(outer > middle) * 2 == len(outer)


def test_chain_strains_affinely() -> None:
    """The ring moves with the box; what is held is held as between walls."""
    found = last_stage(TEST, **{"boundary.kind": "chain", "boundary.radius": "4 mm"})
    first, last = found[0].grains, found[-1].grains
    m = found[0].boundary
    assert found[0].walls.name == ()
    for name, strain in (("x", found[-1].strain[0]), ("y", found[-1].strain[1])):
        before, after = (getattr(grains, name)[-m:] for grains in (first, last))
        middle = 0.5 * (before.min() + before.max())
        np.testing.assert_allclose(after - middle, (before - middle) * (1.0 - strain), rtol=1e-9, atol=1e-12)
    for one in found:
        assert one.stress.mean() == pytest.approx(found[0].stress.mean(), rel=1.01e-6)
        assert not np.any((one.contacts.i >= 24) & (one.contacts.j >= 24))  # a ring has no contacts with itself


@pytest.mark.parametrize("gravity", [False, True])
def test_a_turned_sample_gives_the_turned_result(gravity: bool) -> None:
    """Turned by 90 degrees anticlockwise, with axial = x in place of y and gravity along +x: stresses, strains, energies, forces, places."""
    stage = [{**COMPRESS, "levels": [1.0]}, {**TEST, "shear_strain": 0.002}]
    changes: dict[str, Any] = {"stage": stage, "solver.accuracy": "1e-7 N", "solver.stress_tolerance": 1e-9}
    if gravity:
        changes |= {"container.gravity": "9.81 m/s^2"}
    upright = run(changes, prepared(4))
    aside = {**changes, "stage": [stage[0], {**stage[1], "axial": "x"}]}
    if gravity:
        aside["container.gravity_direction"] = "0 deg"
    lying = run(aside, turned(prepared(4)))
    assert not any(one.event for one in upright)
    for a, b in zip(upright, lying, strict=True):
        scale = 1e-6 * SIGMA
        np.testing.assert_allclose(b.stress[::-1], a.stress, rtol=0, atol=scale)
        np.testing.assert_allclose(b.strain[::-1], a.strain, rtol=0, atol=1e-8)
        assert (b.width, b.height) == pytest.approx((a.height, a.width), rel=1e-8)
        if a.in_stage:
            np.testing.assert_allclose(b.grains.y, a.grains.x - a.walls.box[0] + b.walls.box[1], rtol=0, atol=1e-8)
            np.testing.assert_allclose(b.grains.angle, a.grains.angle, rtol=0, atol=1e-6)
            assert b.energy.work == pytest.approx(a.energy.work, rel=1e-5)
            assert b.energy.friction == pytest.approx(a.energy.friction, rel=1e-4, abs=1e-11)
    assert upright[-1].stress[1] > 1.1 * upright[-1].stress[0]
