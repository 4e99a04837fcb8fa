"""Diffs, by somebody who means them harm: what was found, each as a sentence of what should be."""

from __future__ import annotations

import json
import math
import shutil
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import batch
import ic
from batch.differences import matching
from batch.differences.campaigns import diff
from batch.differences.compare import DIFFERENT, EQUIVALENT, compare
from batch.differences.data import as_data
from batch.differences.decks import decks
from batch.differences.result import Diff, ExperimentDiff, RequirementDiff, SignalDiff
from batch.differences.text import diff_lines
from batch.differences.tolerance import SignalTolerance, tolerances
from batch.differences.words import heading, requirement_lines, verdict
from met import cli
from met.diagnostic import Problem
from tests.batch import plans

CASES = 6

Change = Callable[[Any], None]
"""Changes an archive, an open HDF5 file."""

SLIDER = """
arm turns { link a { mass = 2 kg; shape = rod(length = 1 m, along = x); }
            joint one revolute { parent = base; child = a; axis = z; } }
arm slides { link a { mass = 2 kg; shape = rod(length = 1 m, along = x); }
             joint one prismatic { parent = base; child = a; axis = z; } }
run turning { arm = turns; rates { dynamics = 1 kHz; record = 50 Hz; } duration = 1 s; record = [q];
              initial { one.qd = 1 rad/s; } }
run sliding { arm = slides; rates { dynamics = 1 kHz; record = 50 Hz; } duration = 1 s; record = [q]; }
run longer like turning { duration = 2 s; }
run slower like turning { rates { record = 10 Hz; } initial { one.qd = 0.5 rad/s; } }
run half like turning { rates { record = 20 Hz; } duration = 0.5 s; }
run bounded like turning { metric top = max { of = one.qd; } require top < 5 rad/s; }
run strict like turning { metric top = max { of = one.qd; } require top < 0.5 rad/s; }
run milli like turning { metric top = max { of = one.qd; } require top < 5000 mrad/s; }
let fastest = 0.5 rad/s;
run lettered like turning { metric top = max { of = one.qd; } require top < fastest; }
run free like turning { metric top = max { of = one.qd; } }
run named like turning { record = [q, tau]; metric tau = max { of = one.tau; } }
run fewer like named { record = [q]; }
"""


def untouched(file: Any) -> None:
    """Changes nothing."""


@pytest.fixture
def two(engine: None, here: Path) -> Callable[..., tuple[Path, Path]]:
    """Archives a.h5 and b.h5 of a sweep, of the engine that answers at once, and what is changed in each."""
    batch.run(plans.plan(plans.gains(CASES)), output="whole.h5", histories="all")

    def make(in_b: Change, in_a: Change = untouched) -> tuple[Path, Path]:
        for name, change in (("a.h5", in_a), ("b.h5", in_b)):
            shutil.copy("whole.h5", name)
            with h5py.File(name, "r+") as file:
                change(file)
        return Path("a.h5"), Path("b.h5")

    return make


@pytest.fixture
def ran(here: Path) -> Callable[..., Path]:
    """The archive of a run of SLIDER, whose text may be changed, by the real engine."""

    def make(output: str, *names: str, change: tuple[str, str] = ("", ""), **options: Any) -> Path:
        (here / "slider.ic").write_text(SLIDER.replace(*change))
        found = batch.run(ic.compile("slider.ic", select=list(names)), output=output, **options)
        return Path(found.path)

    return make


def only(found: Diff) -> ExperimentDiff:
    [experiment] = found.experiments
    return experiment


def signal(found: Diff, name: str) -> SignalDiff:
    return next(each for each in only(found).signals if each.name == name)


# Verdicts


@pytest.mark.slow
@pytest.mark.parametrize("last_digits", [False, True])
def test_the_verdict_names_cases_that_no_tolerance_could_match(
    two: Callable[..., tuple[Path, Path]], last_digits: bool
) -> None:
    def change(file: Any) -> None:
        file["case_key"][1] = "0123456789abcdef"
        if last_digits:
            file["gearbox.kp"][1] = np.nextafter(file["gearbox.kp"][1], 1.0)

    found = diff(*two(change))
    [was], [is_] = ([f"{float(x)!r}" for x in h5py.File(name)["gearbox.kp"][1:2]] for name in ("a.h5", "b.h5"))
    said = f"; case #1 has other last digits in what is varied, gearbox.kp = {was}, now {is_} V*s/rad"
    expected = "different: 1 case only in a.h5: #1; 1 case only in b.h5: #1" + said * last_digits
    assert found.verdict == DIFFERENT and diff_lines(found)[-1] == expected


def test_the_verdict_names_how_cases_end_and_that_values_differ(two: Callable[..., tuple[Path, Path]]) -> None:
    def change(file: Any) -> None:
        file["status"][1], file["volts"][0] = 2, 1.0

    assert diff_lines(diff(*two(change)))[-1] == (
        "different: 1 case is timed out that was done: #1; values differ; no tolerance was given"
    )


@pytest.mark.slow
def test_instants_are_compared_to_the_bit(two: Callable[..., tuple[Path, Path]]) -> None:
    def change(file: Any) -> None:
        file["time"][3] *= 1.0 + 1e-13

    one, several = diff(*two(change)), diff("a.h5", "b.h5", tolerances(["time=1us"]))
    assert (signal(one, "time").verdict, one.verdict) == (DIFFERENT, DIFFERENT)
    assert (signal(several, "time").verdict, several.verdict) == (EQUIVALENT, EQUIVALENT)
    assert not [each for each in only(diff(*two(untouched))).signals if each.name == "time"]


@pytest.mark.slow
def test_an_instant_that_moved_is_a_difference(two: Callable[..., tuple[Path, Path]]) -> None:
    def one(file: Any) -> None:
        file["time"][3] += 1e-3

    def rest(file: Any) -> None:
        file["time"][3:] += 1e-3

    for change in (one, rest):
        found = diff(*two(change))
        assert (signal(found, "time").verdict, found.verdict) == (DIFFERENT, DIFFERENT)
        assert diff("a.h5", "b.h5", tolerances(["time=2ms"])).verdict == EQUIVALENT


@pytest.mark.slow
def test_a_figure_of_limits_that_differs_is_said(two: Callable[..., tuple[Path, Path]]) -> None:
    def change(file: Any) -> None:
        name = next(name for name in file if name.startswith("at_limit."))
        file[name][2] = 0.5

    found = diff(*two(change))
    assert found.verdict == EQUIVALENT and "another in 1 of 6 cases" in " ".join(only(found).notes)


@pytest.mark.slow
def test_two_that_have_nothing_to_compare_are_not_identical(ran: Callable[..., Path]) -> None:
    a = ran("a.h5", "turning", histories="none")
    b = ran("b.h5", "turning", histories="none", change=("one.qd = 1 rad/s", "one.qd = 2 rad/s"))
    assert diff(a, b).verdict == "incomparable"
    assert cli.main(["diff", str(a), str(b)]) == cli.NO


@pytest.mark.slow
def test_histories_of_other_cases_are_not_identical(two: Callable[..., tuple[Path, Path]]) -> None:
    def kept(*cases: int) -> str:
        batch.run(plans.plan(plans.gains(CASES)), output=f"kept{cases[0]}.h5", histories=[f"#{case}" for case in cases])
        return f"kept{cases[0]}.h5"

    found = diff(kept(0, 1), kept(2, 3))
    assert signal(found, "q").verdict == "incomparable" and found.verdict == "incomparable"


@pytest.mark.slow
def test_a_run_that_lasts_longer_is_not_identical(ran: Callable[..., Path]) -> None:
    a, b = (
        ran("a.h5", "sliding"),
        ran(
            "b.h5",
            "sliding",
            change=(
                "run sliding { arm = slides; rates { dynamics = 1 kHz; record = 50 Hz; } duration = 1 s",
                "run sliding { arm = slides; rates { dynamics = 1 kHz; record = 50 Hz; } duration = 2 s",
            ),
        ),
    )
    assert cli.main(["diff", str(a), str(b)]) == cli.YES
    assert cli.main(["diff", str(a), str(b), "--require", "identical"]) == cli.NO


@pytest.mark.slow
def test_histories_in_one_alone_are_not_identical(two: Callable[..., tuple[Path, Path]]) -> None:
    batch.run(plans.plan(plans.gains(CASES)), output="few.h5", histories=["#2"])
    found = diff("whole.h5", "few.h5")
    assert found.verdict == "equivalent"
    assert diff_lines(found)[-1] == "equivalent: identical, to the bit, in what both have"


@pytest.mark.slow
def test_no_histories_in_the_second(ran: Callable[..., Path]) -> None:
    a, b = ran("a.h5", "turning"), ran("b.h5", "turning", histories="none")
    assert cli.main(["diff", str(a), str(b)]) == cli.NO


# Tolerances


@pytest.mark.slow
def test_a_tolerance_is_of_what_has_its_unit(ran: Callable[..., Path]) -> None:
    names = ("turning", "sliding")
    a, b = ran("a.h5", *names), ran("b.h5", *names, change=("one.qd = 1 rad/s", "one.qd = 1.001 rad/s"))
    assert diff(a, b, tolerances(["q=2mm"])).verdict == "different"  # by 1 mrad, and no angle was allowed
    assert diff(a, b, tolerances(["q=2mrad"])).verdict == "equivalent"
    with pytest.raises(Problem):
        diff(a, b, tolerances(["q=2V"]))


@pytest.mark.slow
def test_of_one_joint_nothing_is_allowed(two: Callable[..., tuple[Path, Path]]) -> None:
    def plant(file: Any) -> None:
        file["q"][1, 3, 1] += 1e-3

    found = diff(*two(plant), tolerances(["q=1rad", "elbow.q=0rad"]))
    assert signal(found, "q").verdict == "different"
    assert diff(*two(plant), tolerances(["q=0rad", "elbow.q=1rad"])).verdict == "equivalent"


def test_each_instant_is_compared_once() -> None:
    fast, slow = np.arange(11) / 1000.0, np.arange(6) / 500.0
    for a, b in ((fast, slow), (slow, fast)):
        rows_a, rows_b = matching.match_instants(a, b, 1e-3)
        assert a[rows_a].tolist() == b[rows_b].tolist() == slow.tolist()


@pytest.mark.slow
def test_rows_of_other_instants_are_not_identical(ran: Callable[..., Path]) -> None:
    """q = 0.5 t at 10 Hz, and q = t at 20 Hz for half as long: the same numbers, row by row."""
    a, b = ran("a.h5", "slower"), ran("b.h5", "half")
    found = diff(a, b, tolerances(["time=0.5s"]))
    assert signal(found, "q").compared == 1 and found.verdict != "identical"


@pytest.mark.slow
def test_what_a_passes_through_is_all_of_it(ran: Callable[..., Path]) -> None:
    """b comes 4 ms late, at a fifth of the rate; a's peak between two rows of b is seen."""
    t = np.arange(101) * 0.01
    a, b = (np.where(np.abs(t - late - 0.5) < 0.015, 1.0, 0.0) for late in (0.0, 0.02))
    files = []
    for name, values, every in (("a.h5", a, 1), ("b.h5", b, 5)):
        files.append(ran(name, "turning", change=("record = 50 Hz", f"record = {100 / every:g} Hz")))
        with h5py.File(name, "r+") as file:
            file["q"][0, :, 0] = values[::every]
    assert diff(*files, tolerances(["time=20ms"])).verdict == "equivalent"


@pytest.mark.parametrize("steps", [1, 2])
def test_a_shift_by_just_what_is_allowed_is_allowed(steps: int) -> None:
    jumps = np.sign(np.sin(np.arange(201) * 0.7))[:, None]
    later = np.concatenate([jumps[:1]] * steps + [jumps[:-steps]])
    found = compare(jumps, later, SignalTolerance(time=steps / 30.0), np.arange(201) / 30.0)
    assert found is not None and found.beyond == 0


def test_an_infinity_nearby_allows_nothing() -> None:
    a = np.zeros((101, 1))
    a[50] = math.inf
    b = a.copy()
    b[51] = 1e6
    found = compare(a, b, SignalTolerance(time=0.011), np.arange(101) * 0.01)
    assert found is not None and found.beyond > 0


@pytest.mark.slow
def test_of_a_tolerance_of_time_no_share_is_told(two: Callable[..., tuple[Path, Path]]) -> None:
    def plant(file: Any) -> None:
        file["qd"][1, 1:] = file["qd"][1, :-1]
        file["volts"][1] += 1.0

    lines = diff_lines(diff(*two(plant), tolerances(["time=40ms"])))
    [qd] = [line for line in lines if line.startswith("  qd ")]
    assert qd.endswith("time 0.04 s")
    [volts] = [line for line in lines if line.startswith("  volts ")]
    assert volts.endswith("#1")  # a metric has no time


# What is said of a difference


@pytest.mark.slow
def test_what_is_told_of_what_differs_is_beyond_its_tolerance(two: Callable[..., tuple[Path, Path]]) -> None:
    def plant(file: Any) -> None:
        file["q"][1, 3, 1] += 1e-3  # allowed
        file["q"][1, 5, 0] += 2e-6
        file["q"][2, 9, 1] += 1.5e-3  # allowed

    found = diff(*two(plant), tolerances(["elbow.q=2e-3rad"]))
    q, [worst] = signal(found, "q"), only(found).worst
    assert q.place is not None and (q.place.case, q.place.label, q.largest) == (1, "shoulder", pytest.approx(2e-6))
    assert q.place.time == q.first_beyond == pytest.approx(0.2) and worst.place == q.place


@pytest.mark.slow
def test_an_infinite_difference_is_the_worst(two: Callable[..., tuple[Path, Path]]) -> None:
    def plant(file: Any) -> None:
        file["q"][4, 10, 0] = math.inf
        file["q"][2, 10, 0] += 1e-9
        file["qd"][3, 7, 1] = math.nan
        file["qd"][3, 9, 1] += 0.1

    found = diff(*two(plant))
    assert [each.case_a for each in only(found).worst] == [3, 4, 2]
    q, qd = signal(found, "q"), signal(found, "qd")
    assert (q.largest, q.place.case if q.place else None) == (math.inf, 4)
    assert qd.place is not None and qd.place.time == pytest.approx(7 * 0.04) and math.isnan(qd.place.after)
    json.dumps(as_data(found), allow_nan=False)


@pytest.mark.slow
def test_a_metric_that_was_infinite_in_all_cases(two: Callable[..., tuple[Path, Path]]) -> None:
    def infinite(file: Any) -> None:
        file["settle"][:] = math.inf

    def settled(file: Any) -> None:
        file["settle"][:] = np.arange(CASES) + 1.0

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = diff(*two(settled, infinite))
    assert [each.score for each in only(found).worst] == [math.inf] * CASES
    assert signal(found, "settle").largest == math.inf


@pytest.mark.slow
def test_huge_differences_are_told_without_a_warning(two: Callable[..., tuple[Path, Path]]) -> None:
    def plant(sign: float) -> Change:
        def change(file: Any) -> None:
            file["q"][1, 3, 0] = sign * 1e200

        return change

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = diff(*two(plant(1.0), plant(-1.0)))
    assert [each.case_a for each in only(found).worst] == [1]


@pytest.mark.slow
def test_the_span_is_that_of_all_cases(two: Callable[..., tuple[Path, Path]]) -> None:
    def calm(file: Any) -> None:
        """Case 5, which does not differ, spans 100 rad/s; 0 and 1 a hundred thousandth and a tenth of it."""
        for case, top in enumerate((1e-3, 10.0, 0.0, 0.0, 0.0, 100.0)):
            file["qd"][case] = np.linspace(0.0, top, 51)[:, None]

    def plant(file: Any) -> None:
        calm(file)
        file["qd"][0, 20, 0] += 1e-3
        file["qd"][1, 20, 0] += 1.0

    found = diff(*two(plant, calm))
    assert [(each.case_a, each.score) for each in only(found).worst] == [
        (1, pytest.approx(0.01)),
        (0, pytest.approx(1e-5)),
    ]
    assert signal(found, "qd").share == pytest.approx(0.01)


@pytest.mark.slow
def test_a_requirement_that_other_cases_meet_is_told(two: Callable[..., tuple[Path, Path]]) -> None:
    def plant(file: Any) -> None:
        file["met"][:2] = file["met"][:2][::-1]

    found = diff(*two(plant))
    assert only(found).notes == ["require settle < 10 s is met by as many as before, but by others: 1 no more, 1 now"]


@pytest.mark.slow
def test_a_requirement_whose_limit_is_another_is_a_difference(ran: Callable[..., Path]) -> None:
    whole = diff(ran("a.h5", "bounded"), ran("b.h5", "strict"))
    found = only(whole)
    assert (
        found.requirements == [RequirementDiff("top < 5 rad/s", "top < 0.5 rad/s", 1, 0, 0, 1, True)]
        and not found.notes
    )
    assert requirement_lines(found) == ["require top < 0.5 rad/s (before: top < 5 rad/s)  met by 1, now by 0 of 1"]
    assert (whole.verdict, whole.of_values, found.how.tolist()) == ("different", "identical", [0])
    assert heading(found) == "bounded and strict: 1 case in both, identical, with other requirements"
    assert verdict(whole) == (
        "different; requirements differ: top < 5 rad/s -> top < 0.5 rad/s (1 of 1 cases no longer meet it); "
        "values: identical, to the bit"
    )


@pytest.mark.slow
def test_a_limit_that_a_name_stands_for_is_compared_too(ran: Callable[..., Path]) -> None:
    a = ran("a.h5", "lettered")
    whole = diff(a, ran("b.h5", "lettered", change=("let fastest = 0.5 rad/s", "let fastest = 9 rad/s")))
    assert requirement_lines(only(whole)) == [
        "require top < fastest (limit before: 0.5 rad/s, now: 9 rad/s)  met by 0, now by 1 of 1"
    ]
    assert verdict(whole).startswith(
        "different; requirements differ: top < fastest, limit 0.5 rad/s -> 9 rad/s (1 of 1 cases meet it now); values: "
    )


@pytest.mark.slow
def test_a_limit_in_another_unit_is_no_difference(ran: Callable[..., Path]) -> None:
    whole = diff(ran("a.h5", "bounded"), ran("b.h5", "milli"))
    assert (whole.verdict, verdict(whole)) == ("identical", "identical, to the bit")
    assert requirement_lines(only(whole)) == [
        "require top < 5000 mrad/s (before: top < 5 rad/s)  met by 1, now by 1 of 1"
    ]


@pytest.mark.slow
def test_a_requirement_in_one_alone_is_a_difference(ran: Callable[..., Path]) -> None:
    a, b = ran("a.h5", "bounded"), ran("b.h5", "free")
    for found in (diff(a, b), diff(b, a)):
        assert only(found).notes == ["require top < 5 rad/s is only in a.h5, met by 1 of 1"]
        assert found.verdict == "different"
        assert verdict(found) == (
            "different; requirements differ: top < 5 rad/s is only in a.h5, met by 1 of 1; "
            "values: identical, to the bit"
        )


@pytest.mark.slow
def test_the_exit_status_of_another_requirement_is_that_of_a_difference(
    ran: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = map(str, (ran("a.h5", "bounded"), ran("b.h5", "strict")))
    assert (cli.main(["diff", a, a]), cli.main(["diff", a, b])) == (0, 1)
    capsys.readouterr()
    assert cli.main(["diff", a, b, "--format", "json"]) == 1
    [found] = json.loads(capsys.readouterr().out)["experiments"]
    assert (found["verdict"], found["requirements"][0]["lost"], found["required_in_one"]) == ("different", 1, [])


def test_a_deck_in_which_every_line_changed_is_told_at_once() -> None:
    before = "".join(f"    vary links.boom.mass = [{i}, {i + 1}, {i + 2}] kg;\n" for i in range(300))
    [found] = decks({"deck.ic": before}, {"deck.ic": before.replace("kg", "g")}).files
    assert found.said == "deck.ic: 300 lines new, 300 gone"
    assert len(found.lines) == 601


# Against an oracle


SPECIAL = (0.0, -0.0, 5e-324, 1.0, -1.0, math.nan, math.inf, -math.inf, 1e308, 1e-3)


def expected(a: Sequence[float], b: Sequence[float], allowed: Sequence[float], relative: float) -> tuple[str, float]:
    """The verdict of one case, and what is used of its tolerance, number by number."""
    verdict, used = "identical", 0.0
    for x, y, limit in zip(a, b, allowed, strict=True):
        if (math.isnan(x) and math.isnan(y)) or np.float64(x).tobytes() == np.float64(y).tobytes():
            continue
        verdict = "equivalent" if verdict == "identical" else verdict
        apart, larger = abs(y - x), max(abs(x), abs(y))
        limit += relative * larger if math.isfinite(larger) else 0.0
        if not (math.isfinite(apart) and apart <= limit):
            verdict = "different"
        used = max(used, 0.0 if apart == 0.0 else apart / limit if limit and math.isfinite(apart) else math.inf)
    return verdict, used


@pytest.mark.release
@pytest.mark.parametrize("seed", range(12))
def test_verdicts_are_those_of_an_oracle_with_xarray(two: Callable[..., tuple[Path, Path]], seed: int) -> None:
    rng = np.random.default_rng(seed)

    def plant(file: Any) -> None:
        for name in ("q", "qd", "tau", "settle", "volts"):
            for _ in range(rng.integers(0, 3)):
                at = tuple(int(rng.integers(size)) for size in file[name].shape)
                near = file[name][at] * (1.0 + rng.choice([1e-9, 1e-3]))
                file[name][at] = rng.choice(SPECIAL) if rng.random() < 0.5 else near

    a, b = two(plant, plant)
    relative = float(rng.choice([0.0, 1e-6]))
    sizes = {"q": float(rng.choice([0.0, 1e-4])), "elbow.q": float(rng.choice([1e-3, 1.0])), "volts": 1e-2}
    words = [f"q={sizes['q']}rad", f"elbow.q={sizes['elbow.q']}rad", "volts=0.01V", f"rel={relative}"]
    found = diff(a, b, tolerances(words))
    with batch.open(a) as before, batch.open(b) as now:
        for each in only(found).signals:
            one, other = (data[each.name].values.reshape(CASES, -1) for data in (before, now))
            allowed = np.full(one.shape, sizes.get(each.name, 0.0))
            if each.name == "q":
                allowed[:, 1::2] = sizes["elbow.q"]
            rows = zip(one.tolist(), other.tolist(), allowed.tolist(), strict=True)
            cases = [expected(*row, relative) for row in rows]
            assert (each.identical, each.equivalent, each.different) == tuple(
                [verdict for verdict, _ in cases].count(kind) for kind in ("identical", "equivalent", "different")
            )
            assert each.used == pytest.approx(max(used for _, used in cases))
