"""Every change that is planted among 300 shuffled cases is found and named exactly, and none is invented."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from batch.differences.campaigns import diff
from batch.differences.result import Diff, SignalDiff
from batch.differences.text import diff_lines
from batch.differences.tolerance import tolerances
from met.plan import Experiment, Origin, Quantity
from met.run import Run
from tests.batch.differences.planted import CASES, order, two

SIGNALS = {"q", "qd", "tau", "shoulder.servo.voltage", "settle", "volts"}


def signal(found: Diff, name: str) -> SignalDiff:
    return next(each for each in found.experiments[0].signals if each.name == name)


def others_are_identical(found: Diff, *but: str) -> None:
    assert {each.name for each in found.experiments[0].signals} >= SIGNALS - set(but)
    assert {each.name: each.verdict for each in found.experiments[0].signals if each.name not in but} == dict.fromkeys(
        SIGNALS - set(but), "identical"
    )


@pytest.mark.slow
def test_the_same_cases_in_another_order_are_identical(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    found = diff(*two(monkeypatch, tmp_path, order(1)))
    assert found.verdict == "identical"
    assert found.experiments[0].cases.count == CASES
    others_are_identical(found)
    assert not found.experiments[0].worst and not found.experiments[0].ended


@pytest.mark.slow
def test_one_bit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def plant(run: Run, place: dict[int, int]) -> None:
        if 77 in place:
            values = run.signals["qd"]
            values[place[77], 30, 1] = np.nextafter(values[place[77], 30, 1], 1.0)

    mixed = order(2)
    found = diff(*two(monkeypatch, tmp_path, mixed, plant))
    assert found.verdict == "different"
    others_are_identical(found, "qd")
    qd = signal(found, "qd")
    assert (qd.different, qd.identical, qd.compared) == (1, CASES - 1, CASES)
    assert qd.place is not None and (qd.place.case, qd.place.label) == (mixed.index(77), "elbow")
    assert qd.place.time == qd.first == qd.first_beyond == pytest.approx(1.2)
    assert 0.0 < qd.largest < 1e-16
    [worst] = found.experiments[0].worst
    assert (worst.case_a, worst.case_b, worst.signal) == (77, mixed.index(77), "qd")


@pytest.mark.slow
def test_a_late_drift_within_and_beyond_a_tolerance(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def plant(run: Run, place: dict[int, int]) -> None:
        for case, size in ((5, 1e-6), (250, 3e-6)):
            if case in place:
                run.signals["q"][place[case], 40:, 0] += size * np.linspace(0.0, 1.0, 11)

    mixed = order(3)
    a, b = two(monkeypatch, tmp_path, mixed, plant)
    found = diff(a, b, tolerances(["q=2e-6rad"]))
    others_are_identical(found, "q")
    q = signal(found, "q")
    assert (q.different, q.equivalent, q.identical) == (1, 1, CASES - 2)
    assert q.largest == pytest.approx(3e-6) and q.used == pytest.approx(1.5)
    assert q.first == pytest.approx(41 * 0.04) and q.first_beyond == pytest.approx(47 * 0.04)
    assert [each.case_a for each in found.experiments[0].worst] == [250]
    assert diff(a, b, tolerances(["q=4e-6rad"])).verdict == "equivalent"


@pytest.mark.slow
def test_not_a_number(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def plant(run: Run, place: dict[int, int]) -> None:
        if 9 in place:
            run.signals["tau"][place[9], 12, 0] = math.nan

    found = diff(*two(monkeypatch, tmp_path, order(4), plant), tolerances(["tau=1e9N*m"]))
    others_are_identical(found, "tau")
    tau = signal(found, "tau")
    assert (tau.different, tau.nan, tau.first_beyond) == (1, 1, pytest.approx(0.48))


@pytest.mark.slow
def test_a_case_that_fails_now_is_the_headline(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from batch.differences.text import diff_lines

    def plant(run: Run, place: dict[int, int]) -> None:
        if 123 in place:
            case = place[123]
            run.status[case], run.cause[case], run.n_valid[case] = 1, "t = 0.8 s: joint elbow: it broke", 20
            for values in run.signals.values():
                values[case, 20:] = math.nan
            for metric in run.metrics.values():
                metric[case] = math.nan

    mixed = order(5)
    found = diff(*two(monkeypatch, tmp_path, mixed, plant))
    [ended] = found.experiments[0].ended
    assert (ended.case, ended.before, ended.after, ended.rows_after) == (mixed.index(123), 0, 1, 20)
    lines = diff_lines(found)
    at = next(i for i, line in enumerate(lines) if line.startswith("gains: "))
    assert lines[at + 1] == f"  1 case fails that did not: #{mixed.index(123)}"
    assert lines[at + 2].endswith("t = 0.8 s: joint elbow: it broke")


@pytest.mark.slow
def test_missing_and_new_cases(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    mixed = [each for each in order(6) if each not in (17, 18, 200)]
    found = diff(*two(monkeypatch, tmp_path, mixed))
    assert found.verdict == "different"
    assert found.experiments[0].only_a == [17, 18, 200] and found.experiments[0].only_b == []
    others_are_identical(found)
    back = diff(tmp_path / "b.h5", tmp_path / "a.h5")
    assert back.experiments[0].only_b == [17, 18, 200]


@pytest.mark.slow
def test_a_renamed_signal_is_incomparable(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def renamed(experiment: Experiment) -> Experiment:
        record = tuple(replace(r, name="speed") if r.name == "qd" else r for r in experiment.structure.record)
        return replace(experiment, structure=replace(experiment.structure, record=record))

    def plant(run: Run, place: dict[int, int]) -> None:
        run.signals["speed"] = run.signals["qd"]

    a, b = two(monkeypatch, tmp_path, order(7), plant, renamed)
    found = diff(a, b)
    assert found.verdict == "incomparable"
    assert {each.name: each.why for each in found.experiments[0].signals if each.why} == {
        "qd": f"only in {a}",
        "speed": f"only in {b}",
    }


@pytest.mark.slow
def test_parameters_that_changed_and_one_that_is_new(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def change(experiment: Experiment) -> Experiment:
        parameters = dict(experiment.parameters)
        parameters["elbow.servo.f_c"] = replace(parameters["elbow.servo.f_c"], value=0.03)
        parameters["elbow.servo.k_aw"] = Quantity(0.5, "1/s", Origin("default"))
        return replace(experiment, parameters=parameters)

    found = diff(*two(monkeypatch, tmp_path, order(8), change=change)).changed
    [line] = found.meaning
    assert line.startswith("elbow.servo.f_c: 0.0205 N*m -> 0.03 N*m")
    assert found.defaults == ("elbow.servo.k_aw is new, at its default, 0.5 1/s",)


@pytest.mark.slow
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_planted_changes_are_found_and_none_is_invented(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    cases = 40
    names = sorted(SIGNALS - {"settle", "volts"})
    spots = data.draw(
        st.dictionaries(
            st.tuples(st.integers(0, cases - 1), st.sampled_from(names)),
            st.tuples(st.integers(0, 50), st.sampled_from([1e-12, 1e-3, -5.0, math.nan])),
            max_size=6,
        )
    )
    gone = data.draw(st.sets(st.integers(0, cases - 1), max_size=3))
    mixed = [each for each in data.draw(st.permutations(range(cases))) if each not in gone]

    def plant(run: Run, place: dict[int, int]) -> None:
        for (case, name), (row, size) in spots.items():
            if case in place:
                run.signals[name][(place[case], row, *([0] if run.signals[name].ndim == 3 else []))] += size

    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("two")
        found = diff(*two(patch, folder, mixed, plant, cases=cases)).experiments[0]
    there: dict[str, set[int]] = {}
    for case, name in spots:
        if case not in gone:
            there.setdefault(name, set()).add(case)
    assert set(found.only_a) == gone and not found.only_b
    assert {each.name: each.different for each in found.signals if each.different} == {
        name: len(hit) for name, hit in there.items()
    }
    assert {each.case_a for each in found.worst} == set().union(*there.values(), set())
    assert found.cases_different == len(set().union(*there.values(), set()))


@pytest.mark.slow
def test_the_same_answer_for_programs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import json

    from batch.differences.data import as_data

    def plant(run: Run, place: dict[int, int]) -> None:
        if 3 in place:
            run.signals["q"][place[3], 1, 0] += 1.0

    said: dict[str, Any] = json.loads(json.dumps(as_data(diff(*two(monkeypatch, tmp_path, order(9), plant)))))
    assert (said["schema"], said["version"], said["verdict"]) == ("met.diff", 2, "different")
    [different] = [each for each in said["experiments"][0]["signals"] if each["verdict"] == "different"]
    assert (different["name"], different["different"], different["largest"]) == ("q", 1, pytest.approx(1.0))


def drawn(experiment: Experiment) -> Experiment:
    """The same cases, as of a random sample."""
    coordinates = tuple(replace(each, design="random") for each in experiment.cases.coordinates)
    return replace(experiment, cases=replace(experiment.cases, coordinates=coordinates))


@pytest.mark.slow
def test_pairs_of_cases_say_which_version_is_better(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Twelve cases of forty whose metric rises, two in which it falls: both tests are exact, corrected by Holm. Of a
    grid the counts are said, and no chance."""

    def plant(run: Run, place: dict[int, int]) -> None:
        for case in range(14):
            if case in place:
                run.metrics["volts"][place[case]] += 1.0 if case < 12 else -1.0

    grid = diff(*two(monkeypatch, tmp_path, list(range(40)), plant, cases=40))
    assert "    volts rose in 12 of 40, fell in 2" in diff_lines(grid)
    assert all(math.isnan(each.chance) for each in grid.experiments[0].signals)
    (tmp_path / "drawn").mkdir()
    found = diff(*two(monkeypatch, tmp_path / "drawn", list(range(40)), plant, drawn, cases=40))
    [experiment] = found.experiments
    volts = next(each for each in experiment.signals if each.name == "volts")
    tests = len(experiment.requirements) + sum(each.metric for each in experiment.signals)
    # at most two of fourteen signs are the rarer ones, on either side: 2 (1 + 14 + 91) / 2^14
    assert (volts.higher, volts.lower) == (12, 2)
    assert volts.chance == pytest.approx(tests * 212 / 2**14, rel=1e-12)
    shown = "shown" if volts.chance < 0.05 else "not shown"
    assert f"    volts rose in 12 of 40, fell in 2: {shown} (p = {volts.chance:.2g})" in diff_lines(found)
