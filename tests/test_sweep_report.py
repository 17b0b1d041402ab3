"""`dem report` of a sweep: which members are done, what its axes are, seeds pooled, the best point, and its tables."""

from __future__ import annotations

import csv
import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import impulse_runs
import numpy as np
import pytest
import quasi_static_samples
import sweep_samples as made
from click.testing import CliRunner, Result
from scipy import stats

from dem_cli.analysis.sloshing import theory_period
from dem_cli.cli.report import command
from dem_cli.errors import DemError
from dem_cli.report.sweep import Sweep, SweepCase, read_sweep
from dem_cli.report.sweep_axes import axes_of
from dem_cli.report.sweep_best import best_point, lines
from dem_cli.report.sweep_measures import MAIN, MEASURES, TABLES
from dem_cli.report.sweep_text import blocks
from dem_cli.report.text import plain
from dem_cli.results.manifest import Manifest, Member, SweepAxis, read_manifest, write_manifest

FAILED, WAITING = "disc-400-1-2", ("ellipse-800-5-1", "ellipse-800-5-2", "ellipse-800-5-3")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made.make_sweep(tmp_path_factory.mktemp("work") / "grid", failed=[FAILED], waiting=WAITING)


@pytest.fixture(scope="module")
def found(folder: Path) -> Sweep:
    return read_sweep(folder)


def call(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def case_of(found: Sweep, label: str) -> SweepCase:
    return next(case for case in found.cases if case.label == label)


def text_of(found: Sweep, **how: bool) -> str:
    return "\n\n".join(plain(block) for block in blocks(found, **how))


# ------------------------------------------------------------------------------------------- which members are done


def test_members_are_counted(found: Sweep) -> None:
    assert found.counts == {"done": 32, "failed": 1, "waiting": 3}
    assert len(found.cases) == 12
    assert case_of(found, "disc, 400 gal, 1 Hz").state == "2 done, 1 failed"
    assert case_of(found, "ellipse, 800 gal, 5 Hz").state == "3 waiting"
    assert found.seconds == sum(one.seconds for one in found.entries if one.numbers)
    unknown = tuple(replace(one, seconds=math.nan) for one in found.entries)
    assert replace(found, entries=unknown).seconds == 32 * 30.0, "as the files have it"


def test_files_are_what_counts(tmp_path: Path) -> None:
    """A member whose file is missing, unfinished, damaged or of another scenario is not done; one whose file is whole is."""
    axes = {made.GAL: ("400 gal",), made.SEED: (1, 2, 3, 4, 5, 6, 7)}
    folder = made.make_sweep(tmp_path / "odd", axes, former=("old.h5",))
    shutil.copy(folder / "400-2.h5", folder / "400-1.h5")
    (folder / "400-2.h5").unlink()
    (folder / "400-2.partial.h5").write_bytes(b"")
    with h5py.File(folder / "400-3.h5", "a") as file:
        file.attrs["complete"] = False
        file.attrs["stop_reason"] = "interrupted"
    (folder / "400-4.h5").write_text("no HDF5")
    manifest = read_manifest(folder)
    members = [
        one.with_state("failed", reason="long ago") if one.name in ("400-5", "400-3") else one
        for one in manifest.members
    ]
    members = [one.with_state("waiting") if one.name == "400-6" else one for one in members]
    write_manifest(Manifest(**{**vars(manifest), "members": tuple(members)}))
    found = read_sweep(folder)
    assert {one.name: one.state for one in found.entries} == {
        "400-1": "waiting", "400-2": "waiting", "400-3": "failed", "400-4": "waiting", "400-5": "done", "400-6": "done", "400-7": "done",
    }  # fmt: skip
    assert [one.begun for one in found.entries] == [False, True, False, False, False, False, False]
    assert found.said[:5] == (
        "400-1: its file is of another scenario (hash 0000000000000001, not 0000000000000000); the member counts as waiting",
        "400-2: its file is missing, though the manifest has it as done; the member counts as waiting",
        "400-3: its file is incomplete (interrupted)",
        "400-4: its file cannot be read (is not a result file of dem-cli (no HDF5 file at all)); the member counts as waiting",
        "left out: 1 result file of members that the sweep no longer has (old.h5)",
    )
    assert "3 done, 1 failed, 3 waiting (1 begun)" in text_of(found)
    assert "400-3" in text_of(found)
    assert "long ago" in text_of(found)


def test_warnings_of_runs_that_are_alike_take_one_line(found: Sweep, tmp_path: Path) -> None:
    assert [line for line in found.said if "shy" in line] == [
        "disc-400-1-1, disc-400-1-3, disc-400-2-1 and 29 more: the fourth grain is shy"
    ]
    motion = [line for line in found.said if "still in motion" in line]
    assert len(motion) == 1
    folder = made.make_sweep(tmp_path / "two", {made.SEED: (1, 2)})
    with h5py.File(folder / "2.h5", "a") as file:
        file["series/residual"][-1] = 1e6
    with h5py.File(folder / "1.h5", "a") as file:
        file["series/residual"][-1] = 2e6
    ledger = [line for line in read_sweep(folder).said if "ledger" in line]
    assert len(ledger) == 1
    assert ledger[0].startswith("1, 2: for example, energy: the ledger misses")


# ------------------------------------------------------------------------------------------- axes


def axes(*given: SweepAxis, members: tuple[Member, ...] = ()) -> list[tuple[str, tuple[str, ...], Any]]:
    return [(axis.label, axis.texts, axis.values) for axis in axes_of(Manifest("t", "s.toml", given, members))]


def test_axes_keep_their_own_units() -> None:
    assert axes(
        SweepAxis(("stage.2.amplitude",), (("400 gal",), ("12 m/s^2",))),
        SweepAxis(("contact.friction",), ((0.3,), (0.17,))),
        SweepAxis(("grains.count",), ((500,), (1_000_000,))),
        SweepAxis(("seed",), ((1,), (2,))),
    ) == [
        ("amplitude [gal]", ("400", "1200"), (400.0, 1200.0)),
        ("contact.friction", ("0.3", "0.17"), (0.3, 0.17)),
        ("grains.count", ("500", "1e+06"), (500.0, 1e6)),
    ]


def test_axes_of_words() -> None:
    assert axes(
        SweepAxis(("grains.shape",), (("disc",), ("ellipse",))),
        SweepAxis(("grains.bond.rolling",), ((True,), (False,))),
        SweepAxis(("grains.radius",), (("7 mm",), ({"uniform": ["0.5 cm", "1 cm"]},))),
        SweepAxis(("scenario",), (("a/discs.toml",), ("b/pairs.toml",)), "scenario"),
        SweepAxis(("contact.friction",), ((0.3,), ("0.3 m",))),
    ) == [
        ("grains.shape", ("disc", "ellipse"), None),
        ("grains.bond.rolling", ("on", "off"), None),
        ("grains.radius", ("7 mm", "uniform [0.5 cm, 1 cm]"), None),
        ("scenario", ("discs", "pairs"), None),
        ("contact.friction", ("0.3", "0.3 m"), None),
    ]
    same = SweepAxis(("scenario",), (("a/discs.toml",), ("b/discs.toml",)), "scenario")
    assert axes(same)[0][1] == ("a/discs.toml", "b/discs.toml")


def test_keys_that_go_together_are_one_axis() -> None:
    """It has the numbers of a key that tells its points apart, of frequency or amplitude before others; else it is of words."""
    zipped = SweepAxis(("grains.count", "container.width", "seed"), ((500, "50 cm", 1), (1000, "1 m", 2)), "zip")
    assert axes(zipped) == [("grains.count", ("500", "1000"), (500.0, 1000.0))]
    (axis,) = axes_of(Manifest("t", "s", (zipped,), ()))
    assert axis.with_others == ("grains.count 500, container.width 50 cm", "grains.count 1000, container.width 1 m")
    slow = SweepAxis(("stage.2.duration", "stage.2.frequency"), (("5 s", "10 Hz"), ("50 s", "1 Hz")), "zip")
    assert axes(slow) == [("frequency [Hz]", ("10", "1"), (10.0, 1.0))]
    same = SweepAxis(("grains.count", "grains.shape"), ((500, "disc"), (500, "ellipse")), "zip")
    assert axes(same)[0] == (
        "grains.count & grains.shape",
        ("grains.count 500, grains.shape disc", "grains.count 500, grains.shape ellipse"),
        None,
    )


def test_amplitude_and_frequency_are_always_two_axes() -> None:
    two = [("amplitude [gal]", ("400",), (400.0,)), ("frequency [Hz]", ("10", "2"), (10.0, 2.0))]
    keys = ("stage.shake.amplitude", "stage.shake.frequency")
    assert axes(SweepAxis(keys, (("400 gal", "10 Hz"), ("400 gal", "2 Hz")), "zip")) == two
    longer = (("400 gal", "10 Hz", "1 s"), ("400 gal", "2 Hz", "5 s"))
    assert axes(SweepAxis((*keys, "stage.shake.duration"), longer, "zip")) == two
    again = (*longer, ("400 gal", "2 Hz", "9 s"))
    assert axes(SweepAxis((*keys, "stage.shake.duration"), again, "zip"))[2] == (
        "duration [s]",
        ("1", "5", "9"),
        (1.0, 5.0, 9.0),
    )


def test_keys_of_two_stages_are_told_apart() -> None:
    found = axes(SweepAxis(("stage.2.amplitude",), (("400 gal",),)), SweepAxis(("stage.3.amplitude",), (("1 gal",),)))
    assert [label for label, _, _ in found] == ["stage.2.amplitude [gal]", "stage.3.amplitude [gal]"]


def test_points_that_only_members_have_are_added() -> None:
    member = Member("a", "a.h5", "0", {"contact.friction": 0.5})
    assert axes(SweepAxis(("contact.friction",), ((0.3,),)), members=(member,))[0][1] == ("0.3", "0.5")


def test_points_in_words() -> None:
    given = [
        SweepAxis((key,), ((value,), (other,)))
        for key, value, other in (
            ("stage.shake.amplitude", "400 gal", "1 gal"), ("stage.shake.duration", "5 s", "1 s"), ("contact.friction", 0.3, 0.1),
            ("grains.bond.rolling", True, False), ("grains.shape", "ellipse", "disc"), ("grains.aspect_ratio", 1.5, 2),
        )
    ]  # fmt: skip
    words = [axis.words(0) for axis in axes_of(Manifest("t", "s", tuple(given), ()))]
    assert words == ["400 gal", "duration 5 s", "friction 0.3", "rolling on", "ellipse", "aspect ratio 1.5"]


# ------------------------------------------------------------------------------------------- numbers


def test_seeds_are_pooled_with_their_confidence(found: Sweep) -> None:
    case = case_of(found, "disc, 800 gal, 5 Hz")
    values = [made.change({**case.settings, made.SEED: seed}) for seed in (1, 2, 3)]
    one = case.estimate("void_ratio_change")
    low, high = stats.t.interval(0.95, 2, np.mean(values), stats.sem(values))
    assert one.n == 3
    assert one.mean == pytest.approx(np.mean(values), rel=1e-9)
    assert one.sd == pytest.approx(np.std(values, ddof=1), rel=1e-6)
    assert (one.mean - one.half, one.mean + one.half) == pytest.approx((low, high), rel=1e-9)
    assert case.by_seed("void_ratio_packed") == pytest.approx({1: 0.209, 2: 0.210, 3: 0.211})
    assert case_of(found, "disc, 400 gal, 1 Hz").estimate("void_ratio_change").n == 2


def test_surface_is_measured_over_that_of_the_ground_and_t1(found: Sweep) -> None:
    case = case_of(found, "ellipse, 800 gal, 2 Hz")
    assert case.estimate("driven_amplitude").mean == pytest.approx(0.02, rel=1e-6)
    ground = 8.0 / (2.0 * math.pi * 2.0) ** 2
    assert case.estimate("driven_ratio").mean == pytest.approx(0.02 / ground, rel=1e-6)
    width = 0.007 * 25
    assert theory_period(1, width, made.DEPTH, 9.80665) == pytest.approx(made.T1, abs=1e-3)
    assert case.estimate("period_ratio").mean == pytest.approx(0.5 / made.T1, rel=1e-3)
    assert case.estimate("period").mean == pytest.approx(0.5, rel=1e-2)
    assert case.estimate("settlement").mean == pytest.approx(0.01 / 0.40)
    assert case.estimate("porosity_change").mean == pytest.approx(
        np.mean([(e + d) / (1 + e + d) - e / (1 + e) for e, d in _ends(case)]), rel=1e-9
    )


def test_t1_is_of_the_depth_before_the_shaking(tmp_path: Path) -> None:
    """Linear theory, not the thesis' formula, which differs in a shallow fill."""
    folder = made.make_sweep(tmp_path / "shallow", {})
    with h5py.File(folder / "only.h5", "a") as file:
        names = list(file["stages/quantity"].asstr()[:])
        file["stages/before"][1, names.index("depth")] = 0.03
    numbers = read_sweep(folder).entries[0].numbers
    assert numbers is not None
    wave = math.pi / 0.175
    t1 = 2.0 * math.pi / math.sqrt(9.80665 * wave * math.tanh(wave * 0.03))
    assert numbers.values["period_ratio"] == pytest.approx(0.5 / t1, rel=1e-9)
    assert numbers.values["theory_T1"] == pytest.approx(t1, rel=1e-9)


def _ends(case: SweepCase) -> list[tuple[float, float]]:
    settings = [{**case.settings, made.SEED: seed} for seed in (1, 2, 3)]
    return [(made.packed(one), made.change(one)) for one in settings]


def test_runs_that_are_not_shaken_by_a_sine_have_no_driven_motion(tmp_path: Path) -> None:
    def record(path: Path, _: object) -> None:
        from compare_samples import a_file

        a_file(path, scenario=(('amplitude = "4.0 m/s^2"\nfrequency = "10.0 Hz"', 'record = "quake.csv"'),))

    found = read_sweep(made.make_sweep(tmp_path / "record", {made.SEED: (1, 2)}, write=record))
    assert found.main == "void_ratio_change"
    assert not found.has("driven_amplitude")
    assert {one.numbers.undriven for one in found.entries if one.numbers} == {
        "a recorded motion has no single driving frequency"
    }


def test_ramps_are_left_out_of_the_steady_part(tmp_path: Path) -> None:
    folder = made.make_sweep(tmp_path / "ramp", {made.HERTZ: ("2 Hz", "5 Hz")})
    for name, ramp in (("2.h5", "0.5 s"), ("5.h5", "0 s")):
        with h5py.File(folder / name, "a") as file:
            file.attrs["resolved"] = file.attrs["resolved"].replace(
                'duration = "4.0 s"', f'duration = "4.0 s"\nramp = "{ramp}"'
            )
            time = file["series/time"][:]
            file["series/mode1"][:] *= np.where(time > 4.5, 0.0, 1.0)
    two, five = (case.estimate("driven_amplitude").mean for case in read_sweep(folder).cases)
    assert two == pytest.approx(0.01, rel=1e-6)
    assert five < 0.9 * 0.005


# ------------------------------------------------------------------------------------------- the best point


def spread(settings: dict[str, Any]) -> float:
    """800 and 1200 gal are alike in the mean, 400 gal is far away; seeds move all by more than points differ."""
    gal, seed = made.number(settings[made.GAL]), settings[made.SEED]
    own = {400.0: 0.0, 800.0: 2e-4, 1200.0: -1e-4}[gal]
    return {400.0: -0.004, 800.0: -0.0123, 1200.0: -0.0122}[gal] + 3e-4 * seed + own * (-1) ** seed


def three(tmp_path: Path, seeds: tuple[int, ...]) -> Sweep:
    grid = {made.GAL: ("400 gal", "800 gal", "1200 gal"), made.HERTZ: ("2 Hz",), made.SEED: seeds}
    return read_sweep(made.make_sweep(tmp_path / "three", grid, change=spread))


def test_best_point_and_what_it_cannot_be_told_from(tmp_path: Path) -> None:
    found = three(tmp_path, (1, 2, 3, 4, 5))
    best = best_point(found)
    assert best is not None
    assert (best.label, best.measure, found.cases[best.case].label) == ("800 gal", "void_ratio_change", "800 gal")
    values = {gal: [spread({made.GAL: gal, made.SEED: seed}) for seed in range(1, 6)] for gal in (400, 800, 1200)}
    p = {gal: stats.ttest_rel(values[gal], values[800]).pvalue for gal in (400, 1200)}
    assert {rival.label: rival.difference.p for rival in best.rivals} == pytest.approx(
        {"1200 gal": p[1200], "400 gal": p[400]}, rel=1e-5
    )
    assert {rival.label: rival.p for rival in best.rivals} == pytest.approx(
        {"1200 gal": p[1200], "400 gal": 2 * p[400]}, rel=1e-5
    )
    assert [rival.told_apart for rival in best.rivals] == [False, True]
    assert lines(best) == [
        "best (largest densification): 800 gal: change of the void ratio -0.0114 +- 0.0006 (95 %, 5 seeds)",
        "not distinguishable from 1200 gal",
        "by paired differences over common seeds; Holm's correction for 2 comparisons, 5 %",
    ]


def test_best_of_single_runs_has_no_confidence(tmp_path: Path) -> None:
    best = best_point(three(tmp_path, (1,)))
    assert best is not None
    assert lines(best) == [
        "best (largest densification): 800 gal: change of the void ratio -0.0122 (one run, so there is no confidence)",
        "too few seeds to tell it from the others",
    ]


def test_best_is_no_single_run_while_others_have_several(tmp_path: Path) -> None:
    grid = {made.GAL: ("400 gal", "800 gal", "1200 gal"), made.SEED: (1, 2)}
    folder = made.make_sweep(tmp_path / "half", grid, waiting=["1200-2"])
    best = best_point(read_sweep(folder))
    assert best is not None
    assert (best.label, best.single) == ("800 gal", ("1200 gal",))
    assert "better still, but in one run only: 1200 gal" in lines(best)
    assert not [line for line in lines(best) if "too few" in line]


def test_best_that_stands_out(tmp_path: Path) -> None:
    grid = {made.GAL: ("400 gal", "800 gal"), made.SEED: (1, 2, 3)}
    best = best_point(read_sweep(made.make_sweep(tmp_path / "two", grid)))
    assert best is not None
    assert lines(best)[1] == "distinguishable from 400 gal"


def test_other_measures_have_their_own_best(found: Sweep) -> None:
    best = best_point(found, "void_ratio_shaken")
    assert best is not None
    assert lines(best)[0].startswith("best (densest): ellipse, 800 gal, 2 Hz: void ratio shaken 0.1739")
    best = best_point(found, "settlement")
    assert best is not None
    assert lines(best)[0].startswith("best (largest): ")


# ------------------------------------------------------------------------------------------- text, JSON, CSV


def test_text_of_a_sweep(tmp_path: Path) -> None:
    grid = {made.SHAPE: ("disc", "ellipse"), made.GAL: ("400 gal", "800 gal"), made.SEED: (1, 2)}
    folder = made.make_sweep(
        tmp_path / "small", grid, failed=["disc-800-2"], waiting=["ellipse-800-1", "ellipse-800-2"]
    )
    text = text_of(read_sweep(folder)).replace(str(folder), "FOLDER")
    assert text == (Path(__file__).parent / "sweep_report.txt").read_text().rstrip("\n")


def test_each_run_has_a_row_when_it_is_asked_for(found: Sweep) -> None:
    rows = [line.split() for line in text_of(found, each=True).splitlines() if line.endswith(".h5")]
    assert len(rows) == 3 * 32
    assert rows[0] == ["disc", "400", "1", "1", "0.2090", "0.2069", "-0.0021", "2.50", "disc-400-1-1.h5"]
    assert rows[32][4:7] == ["17.29", "17.14", "-0.14"]
    assert "each run" not in text_of(found)


def test_one_member(tmp_path: Path) -> None:
    found = read_sweep(made.make_sweep(tmp_path / "one", {}))
    text = text_of(found)
    assert "1 member  " in text
    assert "case" in text
    assert "all runs" in text
    assert best_point(found) is None
    assert "+-" not in text


def test_sweep_without_members(tmp_path: Path) -> None:
    write_manifest(
        Manifest("none", "s.toml", (SweepAxis(("seed",), ()), SweepAxis((made.GAL,), ())), (), folder=tmp_path)
    )
    assert text_of(read_sweep(tmp_path)).splitlines()[-1].split() == ["0", "members", "none"]
    assert call(tmp_path, "--csv", tmp_path / "tables").exit_code == 0


@pytest.mark.parametrize("state", ["failed", "waiting"])
def test_nothing_done_yet(tmp_path: Path, state: str) -> None:
    names = [made.name_of(one) for one in made.grid(made.GRID)]
    folder = made.make_sweep(tmp_path / "none", **{state: names})  # type: ignore[arg-type]
    found = read_sweep(folder)
    assert found.counts[state] == 36  # type: ignore[index]
    assert found.main == ""
    assert best_point(found) is None
    text = text_of(found)
    assert f"36 {state}" in text
    assert ("take a smaller dt" in text) == (state == "failed")
    assert json.loads(json.dumps(found.as_dict(), allow_nan=False))["best"] is None
    assert call(folder).exit_code == 0


def test_json_holds_all_numbers(folder: Path, found: Sweep) -> None:
    tree = json.loads(call(folder / "sweep.toml", "--json").stdout)
    assert (tree["format"], tree["format_version"]) == ("dem-cli sweep report", 1)
    assert tree["counts"] == found.counts
    assert tree["axes"][1] == {
        "keys": [made.GAL],
        "unit": "gal",
        "points": [["400 gal"], ["800 gal"]],
        "values": [400.0, 800.0],
    }
    case = next(one for one in tree["cases"] if one["label"] == "disc, 800 gal, 2 Hz")
    want = case_of(found, case["label"]).estimate("void_ratio_change")
    assert case["measures"]["void_ratio_change"] == {"mean": want.mean, "sd": want.sd, "half": want.half, "n": 3}
    assert tree["best"]["label"] == "disc, 800 gal, 2 Hz"
    member = next(one for one in tree["members"] if one["name"] == FAILED)
    assert (member["state"], member["seed"], member["measures"]) == ("failed", 2, None)
    assert "left the container" in member["reason"]


def test_csv_holds_cases_and_members(folder: Path, found: Sweep, tmp_path: Path) -> None:
    result = call(folder, "--csv", tmp_path / "tables")
    assert result.exit_code == 0
    assert "cases.csv" in result.stderr
    with (tmp_path / "tables" / "cases.csv").open() as stream:
        cases = list(csv.DictReader(stream))
    assert len(cases) == 12
    want = case_of(found, "disc, 400 gal, 1 Hz").estimate("void_ratio_change")
    assert (cases[0][made.GAL], cases[0]["done"], cases[0]["failed"]) == ("400 gal", "2", "1")
    assert float(cases[0]["void_ratio_change mean"]) == want.mean
    assert float(cases[0]["void_ratio_change half"]) == want.half
    with (tmp_path / "tables" / "members.csv").open() as stream:
        members = list(csv.DictReader(stream))
    assert [one["state"] for one in members].count("done") == 32
    assert members[1]["reason"].startswith("grain 17")
    assert float(members[0]["void_ratio_packed"]) == pytest.approx(0.209)
    assert isinstance(call(folder, "--csv", tmp_path / "tables").exception, DemError)
    assert call(folder, "--csv", tmp_path / "tables", "--force").exit_code == 0


def test_command_line_refuses_what_has_no_meaning(folder: Path, tmp_path: Path) -> None:
    for arguments, text in (
        ((folder, folder), "give it alone"),
        ((folder / "disc-400-1-1.h5", "--each"), "--each has no meaning for result files"),
        ((tmp_path,), "is no folder of a sweep"),
    ):
        result = call(*arguments)
        assert isinstance(result.exception, DemError)
        assert text in str(result.exception)
        assert result.stdout == ""


# ------------------------------------------------------------------------------------------- other kinds of runs


def test_shear_tests_are_ranked_by_their_peak(tmp_path: Path) -> None:
    def write(path: Path, settings: Any) -> None:
        quasi_static_samples.write_test(
            path, increments=20, peak=1.0 + settings["contact.friction"] + 0.01 * settings["seed"]
        )

    folder = made.make_sweep(tmp_path / "shear", {"contact.friction": (0.5, 0.8), "seed": (1, 2)}, write=write)
    found = read_sweep(folder)
    assert (found.kinds, found.main) == (("increment",), "peak_ratio")
    assert case_of(found, "friction 0.8").estimate("peak_ratio").mean == pytest.approx(1.815, abs=1e-3)
    text = text_of(found)
    assert "best (highest peak): friction 0.8: peak s1/s2 1.8150 +- 0.0635 (95 %, 2 seeds)" in text
    assert "friction angle [deg]" in text
    assert "void ratio packed" not in text


def test_bodies_are_ranked_by_their_run_out(tmp_path: Path) -> None:
    def write(path: Path, settings: Any) -> None:
        impulse_runs.rockfall_file(path, n=settings["grains.count"])

    folder = made.make_sweep(tmp_path / "fall", {"grains.count": (10, 20)}, write=write)
    found = read_sweep(folder)
    assert (found.kinds, found.main) == (("bodies",), "runout_50")
    few, many = (case.estimate("runout_50").mean for case in found.cases)
    assert (few, many) == (pytest.approx(8.0 + 0.5 * 4.5), pytest.approx(8.0 + 0.5 * 9.5))
    assert "best (furthest run-out): count 20: run-out of 50 % [m] 12.75 (one run" in text_of(found)


def test_kinds_have_tables_of_their_own(tmp_path: Path) -> None:
    def write(path: Path, settings: Any) -> None:
        if settings["scenario"] == "fall.toml":
            impulse_runs.rockfall_file(path, n=8)
        else:
            quasi_static_samples.write_test(path, increments=20)

    names = ("shear.toml", "fall.toml")
    found = read_sweep(made.make_sweep(tmp_path / "both", {"scenario": names, "seed": (1, 2)}, write=write))
    text = text_of(found)
    assert "Shear tests" in text
    assert "Bodies at the end" in text
    shown = [line.split()[0] for line in text.splitlines() if line.endswith("2 done")]
    assert sorted(shown) == ["fall", "shear"]


def test_every_measure_has_its_words() -> None:
    named = {name for tables in TABLES.values() for _, names in tables for name in names}
    assert named | {name for names in MAIN.values() for name in names} <= MEASURES.keys()
