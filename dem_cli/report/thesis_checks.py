"""The thesis' findings of chapter 8 set against cases: its void ratios beside ours, and each of its statements in our numbers.

Where the thesis gives words only, the measure and the limit are ours and stand in the statement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

from dem_cli.report import thesis
from dem_cli.report.cases import Case, Pooled
from dem_cli.report.moved import Moved, Way, as_rows

LITTLE = 0.25  # share of the range over all cases of a shape up to which a change counts as not large
MUCH = 2.0  # factor from which a change counts as violent
MOST = 2.0 / 3.0  # share from which it is most of the grains

Sine = tuple[float, float]


@dataclass(frozen=True)
class Beside:
    """A number of ours beside the thesis': quantity is "void ratio" or "porosity", state "packed", "shaken" or "change"."""

    kind: str
    quantity: str
    state: str
    here: Pooled
    thesis: float
    figures: str

    @property
    def difference(self) -> float:
        return self.here.mean - self.thesis


@dataclass(frozen=True)
class Check:
    """A statement of the thesis, where it is made, of which cases it is read, our numbers, and whether it holds of them."""

    source: str
    statement: str
    of: str
    numbers: str
    holds: bool


def beside(cases: Sequence[Case]) -> list[Beside]:
    """Void ratios and porosities of the complete cases that the thesis has too."""
    found = []
    for case in _of(cases, thesis.SHAKING):
        known = thesis.FOUND[case.first.family]
        for quantity, name, packed, shaken in (
            ("void ratio", "void_ratio", known.packed, known.shaken),
            ("porosity", "porosity", known.porosity_packed, known.porosity_shaken),
        ):
            values = {"packed": packed, "shaken": shaken, "change": shaken - packed}
            for state, value in values.items():
                here = case.measures[f"{name}_{state}"]
                found.append(Beside(case.kind, quantity, state, here, value, known.figures))
    return found


def checks(cases: Sequence[Case]) -> tuple[list[Check], list[str]]:
    """Statements that the complete cases cover, and those they do not, in words."""
    parts: tuple[tuple[str, Callable[[Sequence[Case]], Iterator[Check]]], ...] = (
        ("8.2.4 to 8.4.4, denser after shaking at 400 gal 10 Hz", _denser),
        ("figures 8.2 to 8.23, order of the void ratios at 400 gal 10 Hz", _order),
        ("8.5.2, motion of three shapes at 400 gal 10 Hz", _livelier),
        ("8.5.3, ways of tracked grains at 400 gal 10 Hz", _ways),
        ("8.9.1, amplitude and frequency", _amplitudes),
        ("8.9.3, sloshing and the period of shaking", _periods),
        ("8.9.2, discs and bonded pairs at 1200 gal 2 Hz, 800 gal 1 Hz, 1200 gal 1 Hz", _surfaces),
    )
    found, missing = [], []
    for name, part in parts:
        some = list(part(cases))
        found += some
        if not some:
            missing.append(name)
    return found, missing


# ---------------------------------------------------------------------------------- which cases


def _of(cases: Sequence[Case], sine: Sine, family: str = "") -> list[Case]:
    """Complete cases of a family (any, without it), shaken once by a sine."""
    return [
        case
        for case in cases
        if case.complete and case.sine and thesis.is_shaking(*case.sine, sine) and case.first.family
        and family in ("", case.first.family)
    ]  # fmt: skip


def alike(one: Case, other: Case) -> bool:
    """Whether two cases differ in nothing that bears on a comparison of their grains: law, material, container and scheme."""
    a, b = one.first.settings, other.first.settings
    shared = ("contact.", "material.", "container.", "integration.integrator")
    keys = {key for key in {**a, **b} if key.startswith(shared) and key != "contact.ellipse_test"}
    return all(a.get(key) == b.get(key) for key in keys)


def _together(cases: Sequence[Case], sine: Sine, families: Sequence[str]) -> Iterator[tuple[Case, ...]]:
    """Cases of each of the families under the same conditions."""
    for some in product(*(_of(cases, sine, family) for family in families)):
        if all(alike(*pair) for pair in product(some, repeat=2)):
            yield some


def _shared(one: Case, other: Case, name: str) -> tuple[int, int]:
    """In how many seeds that both have `name` is smaller in the first case, and how many those are."""
    theirs = {run.seed: run.measures[name] for run in other.runs}
    both = [(run.measures[name], theirs[run.seed]) for run in one.runs if run.seed in theirs]
    return sum(a < b for a, b in both), len(both)


def text(value: Pooled, form: str, factor: float = 1.0) -> str:
    """Mean, and where there are several values their standard deviation and number."""
    if value.n == 0 or not math.isfinite(value.mean):
        return "-"
    mean = format(factor * value.mean, form)
    if value.n == 1:
        return mean
    return f"{mean} +- {format(factor * value.sd, form.lstrip('+'))} ({value.n})"


# ---------------------------------------------------------------------------------- the statements


def _denser(cases: Sequence[Case]) -> Iterator[Check]:
    for case in _of(cases, thesis.SHAKING):
        name = thesis.PLURAL[case.first.family]
        fell = sum(run.measures["void_ratio_change"] < 0.0 for run in case.runs)
        numbers = (
            f"{text(case.measures['void_ratio_packed'], '.4f')} -> {text(case.measures['void_ratio_shaken'], '.4f')}"
        )
        yield Check(
            thesis.DENSER[case.first.family],
            f"{name}: the void ratio is lower after shaking",
            case.kind,
            f"{numbers}, lower in {fell} of {len(case.runs)}",
            case.measures["void_ratio_change"].mean < 0.0,
        )


def _ordered(
    cases: Sequence[Case],
    families: Sequence[str],
    name: str,
    what: str,
    source: str,
    form: str,
    unit: str,
    factor: float,
) -> Iterator[Check]:
    """Whether a measure grows from family to family; those that are absent are passed over."""
    there = [family for family in families if _of(cases, thesis.SHAKING, family)]
    for small, large in pairwise(there):
        for one, other in _together(cases, thesis.SHAKING, (small, large)):
            a, b = one.measures[name], other.measures[name]
            if not (a.n and b.n):
                continue
            less, shared = _shared(one, other, name)
            seeds = f", in {less} of {shared} seeds" if shared > 1 else ""
            yield Check(
                source,
                f"{what}: {thesis.PLURAL[small]} less than {thesis.PLURAL[large]}",
                f"{one.kind}; {other.kind}",
                f"{text(a, form, factor)}; {text(b, form, factor)}{unit}{seeds}",
                a.mean < b.mean,
            )


def _order(cases: Sequence[Case]) -> Iterator[Check]:
    families = ("ellipse", "disc", "pair")
    for state, figures in (("packed", "8.28, 8.30"), ("shaken", "8.29, 8.31")):
        yield from _ordered(
            cases, families, f"void_ratio_{state}", f"void ratio, {state}", f"figs {figures}", ".4f", "", 1.0
        )


def _livelier(cases: Sequence[Case]) -> Iterator[Check]:
    families = ("disc", "ellipse", "pair")
    for name, what in (
        ("tracked_start", "rms velocity of tracked grains in the first second"),
        ("speed_start", "rms velocity of all grains in the first second"),
    ):
        yield from _ordered(cases, families, name, what, "8.5.2", ".3g", " mm/s", 1e3)
    for disc, ellipse, pair in _together(cases, thesis.SHAKING, families):
        a, b, c = (case.measures["speed_start"] for case in (disc, ellipse, pair))
        if a.n and b.n and c.n:
            yield Check(
                "8.6",
                "ellipses and bonded pairs move more like each other than like discs (rms velocity of all grains, first second)",
                f"{disc.kind}; {ellipse.kind}; {pair.kind}",
                f"{text(a, '.3g', 1e3)}; {text(b, '.3g', 1e3)}; {text(c, '.3g', 1e3)} mm/s",
                abs(b.mean - c.mean) < min(abs(b.mean - a.mean), abs(c.mean - a.mean)),
            )


def _ways(cases: Sequence[Case]) -> Iterator[Check]:
    """The tracked grains of all runs of a case, in the rows of the starting grid."""
    for case in _of(cases, thesis.SHAKING):
        moved = [run.moved[0] for run in case.runs if run.moved]
        rows = [row for one in moved for row in as_rows(one) if len(row) >= 3]
        if rows:
            yield from _rows(case, moved, rows)
    for other in ("ellipse", "pair"):
        for disc, case in _together(cases, thesis.SHAKING, ("disc", other)):
            if disc.moved and case.moved:
                a, b = disc.moved[0]["x"], case.moved[0]["x"]
                yield Check(
                    "8.5.3",
                    f"{thesis.PLURAL[other]} move far in x (mean size of the net displacement, against discs)",
                    f"{case.kind}; {disc.kind}",
                    f"{text(b, '.3g', 1e3)}; {text(a, '.3g', 1e3)} mm",
                    b.mean > a.mean,
                )


def _rows(case: Case, moved: Sequence[Moved], rows: Sequence[Sequence[Way]]) -> Iterator[Check]:
    family = case.first.family
    if family == "disc":
        ends = [(row[0].x, -row[-1].x) for row in rows]
        inwards = sum(value > 0.0 for pair in ends for value in pair)
        every = [way for one in moved for way in one.ways]
        sunk = sum(way.y < 0.0 for way in every)
        yield Check(
            "8.5.3",
            "discs on the left and right move towards the middle and sink (most of them)",
            case.kind,
            f"inwards {inwards} of {2 * len(rows)}, sunk {sunk} of {len(every)}",
            inwards >= MOST * 2 * len(rows) and sunk >= MOST * len(every),
        )
        return
    same = sum(len({way.x > 0.0 for way in row}) == 1 for row in rows)
    if family == "ellipse":
        yield Check(
            "8.5.3",
            "ellipses of one height move the same way in x (most rows)",
            case.kind,
            f"{same} of {len(rows)} rows",
            same >= MOST * len(rows),
        )
    else:
        yield Check(
            "8.5.3",
            "bonded pairs of one height move in various directions (most rows)",
            case.kind,
            f"{len(rows) - same} of {len(rows)} rows",
            len(rows) - same >= MOST * len(rows),
        )


def _grids(cases: Sequence[Case]) -> Iterator[tuple[str, dict[Sine, Case]]]:
    """Complete cases of discs and of bonded pairs over amplitude and frequency, for each kind."""
    found: dict[str, dict[Sine, Case]] = {}
    for case in cases:
        if case.complete and case.sine and case.first.family in ("disc", "pair"):
            found.setdefault(case.kind, {})[case.sine] = case
    yield from found.items()


# Changes that a picture shows, as those in the thesis: measure, words, form, unit, factor.
VISIBLE = (
    ("displaced", "rms displacement of the grains", ".3g", " mm", 1e3),
    ("tilt", "tilt of the surface / depth", ".3f", "", 1.0),
)


def _amplitudes(cases: Sequence[Case]) -> Iterator[Check]:
    for kind, grid in _grids(cases):
        for name, what, form, unit, factor in VISIBLE:
            value = {sine: case.measures[name].mean for sine, case in grid.items() if case.measures[name].n}
            span = max(value.values(), default=0.0) - min(value.values(), default=0.0)
            if not span > 0.0:
                continue
            mild = {}
            for statement, part in (
                ("at 10 Hz no large change with the amplitude", [s for s in value if math.isclose(s[1], 10.0)]),
                ("at 400 gal no large change with the frequency", [s for s in value if math.isclose(s[0], 4.0)]),
            ):
                mild.update({sine: value[sine] for sine in part})
                if len(part) < 2 or len(part) == len(value):
                    continue
                change = max(value[s] for s in part) - min(value[s] for s in part)
                shown = ", ".join(f"{_name(s)} {value[s] * factor:{form}}" for s in sorted(part, key=_strength))
                yield Check(
                    "8.9.1",
                    f"{statement}: {what}, at most {LITTLE:g} of its range over all cases",
                    kind,
                    f"{shown}{unit}; {change / span:.2f} of the range",
                    change <= LITTLE * span,
                )
            strong = {s: value[s] for s in value if s not in mild and s[0] > 4.0 and s[1] < 10.0}
            if not strong or not mild:
                continue
            strongest = max(strong, key=_strength)
            most = max(mild, key=lambda s: mild[s])
            yield Check(
                "8.9.1",
                f"large amplitude at low frequency changes much: {what}, at least {MUCH:g} times that at 10 Hz or 400 gal",
                kind,
                f"{_name(strongest)} {strong[strongest] * factor:{form}}, {_name(most)} {mild[most] * factor:{form}}{unit}",
                strong[strongest] >= MUCH * mild[most],
            )


def _periods(cases: Sequence[Case]) -> Iterator[Check]:
    for kind, grid in _grids(cases):
        tilt = {sine: case.measures["tilt"].mean for sine, case in grid.items() if case.measures["tilt"].n}
        if len(tilt) > 2 and any(thesis.is_shaking(*s, (12.0, 1.0)) for s in tilt):
            most = max(tilt, key=lambda s: tilt[s])
            yield Check(
                "8.9.1",
                "1200 gal 1 Hz is like sloshing: the surface tilts most there",
                kind,
                f"most at {_name(most)}, {tilt[most]:.3f} of the depth",
                thesis.is_shaking(*most, (12.0, 1.0)),
            )
        said, grows = [], True
        for amplitude in sorted({sine[0] for sine in tilt}):
            line = sorted((s for s in tilt if s[0] == amplitude), key=lambda s: -s[1])
            if len(line) > 1:
                said.append(f"{_name(line[0])} to {line[-1][1]:.3g} Hz: " + ", ".join(f"{tilt[s]:.3f}" for s in line))
                grows = grows and all(tilt[a] < tilt[b] for a, b in pairwise(line))
        if said:
            yield Check(
                "8.9.3",
                "the longer the period, the more like sloshing: tilt of the surface / depth grows at each amplitude",
                kind,
                "; ".join(said),
                grows,
            )


def _surfaces(cases: Sequence[Case]) -> Iterator[Check]:
    for sine in thesis.LIVELY:
        for disc, pair in _together(cases, sine, ("disc", "pair")):
            who = f"{pair.kind}; {disc.kind}; {disc.shaking}"
            a, b = (case.measures["roughness_shaken"] for case in (pair, disc))
            yield Check(
                "8.9.2",
                "the surface of bonded pairs is rougher",
                who,
                f"{text(a, '.3g', 1e3)}; {text(b, '.3g', 1e3)} mm",
                a.mean > b.mean,
            )
            per = a.mean / pair.first.radius, b.mean / disc.first.radius
            yield Check(
                "8.9.2 (ours)",
                "also over the radius of a disc of a grain's area",
                who,
                f"{per[0]:.3f}; {per[1]:.3f}",
                per[0] > per[1],
            )
            a, b = (case.measures["scattered"] for case in (pair, disc))
            yield Check(
                "8.9.2",
                "fewer bonded pairs fly off (most airborne at a time, and escaped)",
                who,
                f"{text(a, '.4g')} of {pair.first.grains}; {text(b, '.4g')} of {disc.first.grains}",
                a.mean < b.mean,
            )
            share = 100.0 * a.mean / pair.first.grains, 100.0 * b.mean / disc.first.grains
            yield Check(
                "8.9.2 (ours)",
                "also as a share of the grains",
                who,
                f"{share[0]:.3g}; {share[1]:.3g} %",
                share[0] < share[1],
            )


def _strength(sine: Sine) -> tuple[float, float]:
    return sine[0], -sine[1]


def _name(sine: Sine) -> str:
    return f"{100.0 * sine[0]:.4g} gal {sine[1]:.3g} Hz"
