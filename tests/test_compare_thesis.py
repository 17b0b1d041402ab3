"""The thesis beside our runs: its numbers, and its statements, each seen to hold and not to hold."""

from __future__ import annotations

from dataclasses import replace

import pytest
from compare_samples import an_outcome, ways

from dem_cli.report import thesis
from dem_cli.report.cases import pool
from dem_cli.report.compare import why
from dem_cli.report.outcome import Outcome
from dem_cli.report.thesis_checks import Check, alike, beside, checks

FAMILIES = ("disc", "ellipse", "pair")


def checked(*runs: Outcome) -> list[Check]:
    return checks(pool(runs)[0])[0]


def verdicts(words: str, *runs: Outcome) -> list[bool]:
    """Of the statements that hold `words`."""
    return [check.holds for check in checked(*runs) if words in check.statement]


def like_the_thesis(family: str, **how: float) -> Outcome:
    known = thesis.FOUND[family]
    return an_outcome(family, packed=known.packed, shaken=known.shaken, **how)  # type: ignore[arg-type]


def test_numbers_of_the_thesis_agree_with_each_other() -> None:
    """n = e/(1 + e) to its rounding, and the order and the change it speaks of."""
    for found in thesis.FOUND.values():
        for e, n in ((found.packed, found.porosity_packed), (found.shaken, found.porosity_shaken)):
            assert e / (1.0 + e) == pytest.approx(n, abs=0.0005 / (1.0 + e) ** 2 + 0.00005)
        assert found.shaken < found.packed
    for state in ("packed", "shaken"):
        ellipse, disc, pair = (getattr(thesis.FOUND[family], state) for family in ("ellipse", "disc", "pair"))
        assert ellipse < disc < pair


def test_beside_the_thesis_is_the_case_it_has() -> None:
    runs = [an_outcome(f, seed=s, packed=0.2 + 0.01 * s) for f in FAMILIES for s in (1, 2)]
    runs += [an_outcome("disc", hertz=2.0), an_outcome("disc", complete=False)]
    found = beside(pool(runs)[0])
    assert len(found) == 3 * 6
    one = next(b for b in found if (b.kind, b.quantity, b.state) == ("ellipse 2", "void ratio", "packed"))
    assert (one.here.mean, one.here.n, one.thesis) == (pytest.approx(0.215), 2, 0.160)
    assert one.difference == pytest.approx(0.055)
    change = next(b for b in found if (b.kind, b.quantity, b.state) == ("bonded pair", "porosity", "change"))
    assert change.thesis == pytest.approx(-0.0101)


def test_its_own_numbers_fulfil_its_statements() -> None:
    found = [check for check in checked(*map(like_the_thesis, FAMILIES)) if "void ratio" in check.statement]
    assert len(found) == 3 + 4
    assert all(check.holds for check in found)


def test_denser_after_shaking() -> None:
    assert verdicts("lower after", an_outcome(packed=0.20, shaken=0.21)) == [False]
    (one,) = checked(an_outcome(), an_outcome(seed=2, packed=0.2, shaken=0.202))
    assert one.holds
    assert one.source == "8.2.4"
    assert "lower in 1 of 2" in one.numbers


def test_order_of_the_void_ratios() -> None:
    disc, ellipse, pair = (
        an_outcome(f, packed=p, shaken=0.1) for f, p in zip(FAMILIES, (0.21, 0.22, 0.215), strict=True)
    )
    assert verdicts("packed: ellipses less than discs", disc, ellipse, pair) == [False]
    assert verdicts("packed: discs less than bonded", disc, ellipse, pair) == [True]
    assert verdicts("packed: ellipses less than bonded pairs", ellipse, pair) == [False]
    assert verdicts("shaken: ellipses less", disc, ellipse, pair) == [False]  # equal is not less


def test_seeds_are_compared_with_themselves() -> None:
    discs = [an_outcome("disc", seed=s, packed=p) for s, p in ((1, 0.20), (2, 0.22), (3, 0.30))]
    ellipses = [an_outcome("ellipse", seed=s, packed=p) for s, p in ((1, 0.19), (2, 0.23), (9, 0.1))]
    (one,) = [c for c in checked(*discs, *ellipses) if "packed: ellipses" in c.statement]
    assert one.holds
    assert "in 1 of 2 seeds" in one.numbers


def test_grains_under_other_conditions_are_not_compared() -> None:
    other = {"contact.tension": "damping"}
    assert not verdicts("less than", an_outcome("disc"), an_outcome("ellipse", settings=other))
    assert verdicts("packed: ell", an_outcome("disc", settings=other), an_outcome("ellipse", settings=other))
    one, two = pool([an_outcome("disc"), an_outcome("ellipse", settings={"contact.ellipse_test": "enlarged"})])[0]
    assert alike(one, two)


def test_motion_grows_from_discs_to_pairs() -> None:
    for start, want in (((1, 2, 3), [True, True]), ((2, 1, 3), [False, True]), ((1, 3, 2), [True, False])):
        runs = [an_outcome(f, speed_start=s, tracked_start=s) for f, s in zip(FAMILIES, start, strict=True)]
        assert verdicts("rms velocity of all grains in", *runs) == want
        assert verdicts("rms velocity of tracked", *runs) == want
    alike = [an_outcome(f, speed_start=s) for f, s in zip(FAMILIES, (1.0, 2.0, 2.4), strict=True)]
    assert verdicts("more like each other", *alike) == [True]
    apart = [an_outcome(f, speed_start=s) for f, s in zip(FAMILIES, (1.0, 2.0, 3.4), strict=True)]
    assert verdicts("more like each other", *apart) == [False]


def test_ways_of_discs() -> None:
    inwards = ways((0, 0, 1, -1), (1, 0, 0, -1), (2, 0, -1, -1))
    outwards = ways((0, 0, -1, -1), (1, 0, 0, -1), (2, 0, 1, -1))
    rising = ways((0, 0, 1, 1), (1, 0, 0, 1), (2, 0, -1, -1))
    for moved, want in ((inwards, True), (outwards, False), (rising, False)):
        assert verdicts("towards the middle", an_outcome("disc", moved=(moved,))) == [want]
    assert not verdicts("towards the middle", an_outcome("disc"))  # no tracks


def test_ways_of_ellipses_and_pairs() -> None:
    same, mixed = ways((0, 0, 1, 0), (1, 0, 2, 0), (2, 0, 1, 0)), ways((0, 0, 1, 0), (1, 0, -2, 0), (2, 0, 1, 0))
    for moved, together in ((same, True), (mixed, False)):
        assert verdicts("of one height move the same way", an_outcome("ellipse", moved=(moved,))) == [together]
        assert verdicts("various directions", an_outcome("pair", moved=(moved,))) == [not together]
    far, near = ways((0, 0, 5, 0)), ways((0, 0, -4, 0))
    assert verdicts("far in x", an_outcome("disc", moved=(near,)), an_outcome("pair", moved=(far,))) == [True]
    assert verdicts("far in x", an_outcome("disc", moved=(far,)), an_outcome("ellipse", moved=(near,))) == [False]


def grid(values: dict[tuple[int, int], float], family: str = "disc", name: str = "displaced") -> list[Outcome]:
    """Runs over (gal, Hz)."""
    return [an_outcome(family, gal=g, hertz=h, **{name: value}) for (g, h), value in values.items()]  # type: ignore[arg-type]


MILD = {(400, 10): 1.0, (800, 10): 2.0, (1200, 10): 3.0, (400, 2): 2.0, (400, 1): 3.0}


@pytest.mark.parametrize("name", ["displaced", "tilt"])
def test_amplitude_and_frequency(name: str) -> None:
    """Changes by 2, of a range of 19, and 20 against 3; then of a range of 4."""
    what = {"displaced": "displacement", "tilt": "tilt of"}[name]

    def found(strong: float) -> list[bool]:
        runs = grid({**MILD, (1200, 1): strong}, name=name)
        return [c.holds for c in checked(*runs) if c.source == "8.9.1" and what in c.statement]

    assert found(20.0) == [True, True, True]
    assert found(5.0) == [False, False, False]
    # At the limits: a range of 8, and twice the most.
    assert found(9.0) == [True, True, True]
    assert found(8.9) == [False, False, True]


def test_amplitudes_alone_say_nothing_of_a_range() -> None:
    runs = grid({key: value for key, value in MILD.items() if key[1] == 10})
    assert not [c for c in checked(*runs) if c.source == "8.9.1"]


def test_sloshing_grows_with_the_period() -> None:
    tilt = {(400, 10): 0.1, (400, 2): 0.2, (400, 1): 0.3, (1200, 1): 0.9}
    assert verdicts("like sloshing: the surface tilts most", *grid(tilt, name="tilt")) == [True]
    assert verdicts("the longer the period", *grid(tilt, name="tilt")) == [True]
    tilt[400, 1] = 0.95
    assert verdicts("like sloshing: the surface tilts most", *grid(tilt, name="tilt")) == [False]
    tilt[400, 2] = 0.05
    assert verdicts("the longer the period", *grid(tilt, name="tilt")) == [False]


@pytest.mark.parametrize("sine", [(1200, 2), (800, 1), (1200, 1)])
def test_surfaces_of_discs_and_pairs(sine: tuple[int, int]) -> None:
    """1500 pairs and 3000 discs: fewer pairs may be a larger share."""
    how = {"gal": sine[0], "hertz": sine[1]}
    disc = an_outcome("disc", **how, roughness_shaken=0.004, scattered=30.0)  # type: ignore[arg-type]
    for rough, off, want in ((0.005, 10.0, [True, True, True, True]), (0.003, 20.0, [False, False, True, False])):
        pair = an_outcome("pair", **how, roughness_shaken=rough, scattered=off)  # type: ignore[arg-type]
        found = [c for c in checked(disc, pair) if c.source.startswith("8.9.2")]
        assert [c.holds for c in found] == want
        assert f"{off:g} of 1500; 30 of 3000" in found[2].numbers


def test_incomplete_runs_are_in_no_statement() -> None:
    assert checked(*(an_outcome(f, complete=False) for f in FAMILIES)) == []
    runs = grid({**MILD, (1200, 1): 20.0})
    assert [c for c in checked(*runs) if c.source == "8.9.1"]
    assert checked(*(replace(run, complete=False) for run in runs)) == []


def test_what_is_not_covered_is_said() -> None:
    missing = checks(pool([an_outcome("disc")])[0])[1]
    assert [line.split(",")[0] for line in missing][-3:] == ["8.9.1", "8.9.3", "8.9.2"]
    everything = [an_outcome(f, moved=(ways((0, 0, 1, 0), (1, 0, 1, 0), (2, 0, 1, 0)),)) for f in FAMILIES]
    everything += grid({**MILD, (1200, 1): 9.0, (1200, 2): 5.0}) + grid({(1200, 1): 9.0}, "pair")
    assert checks(pool(everything)[0])[1] == []


def test_where_runs_differ_in_size_is_said() -> None:
    same = why(pool([an_outcome("disc", overlap=2e-4), an_outcome("pair", overlap=1e-4)])[0])
    assert not any("Size of these samples" in line for line in same)
    assert "2.0e-04" in same[-1]
    small = why(pool([replace(an_outcome("disc"), grains=300)])[0])
    assert any("300 discs in 1.215 m (thesis: 3000 in 1.215 m)" in line for line in small)
    assert why(pool([an_outcome(complete=False)])[0]) == []
