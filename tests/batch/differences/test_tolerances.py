"""What the deck of the second archive allows, what the command line has over it, and what each line says of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import batch
import ic
from batch.differences.campaigns import diff
from batch.differences.data import as_data
from batch.differences.result import Diff, SignalDiff
from batch.differences.text import diff_lines
from batch.differences.tolerance import Tolerances, check, tolerances
from met.diagnostic import Problem
from met.plan import Experiment
from met.plan.judged import Tolerance
from met.run import Run
from tests.batch.differences.planted import order, two

CASES = 12


def plant(run: Run, place: dict[int, int]) -> None:
    """Case 3: the shoulder 2e-6 rad off, and case 7: the elbow 1e-3 rad."""
    for case, joint, size in ((3, 0, 2e-6), (7, 1, 1e-3)):
        if case in place:
            run.signals["q"][place[case], 40:, joint] += size


def allowing(**given: float) -> Callable[[Experiment], Experiment]:
    made = tuple(Tolerance(name.replace("__", "."), value, f"{value:g} SI") for name, value in given.items())
    return lambda experiment: replace(experiment, tolerances=made)


@pytest.fixture
def archives(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., tuple[Path, Path]]:
    return lambda **given: two(monkeypatch, tmp_path, order(1, CASES), plant, allowing(**given), CASES)


def q_of(found: Diff) -> SignalDiff:
    return next(each for each in found.experiments[0].signals if each.name == "q")


def counts(found: Diff) -> tuple[int, int, int]:
    q = q_of(found)
    return q.identical, q.equivalent, q.different


@pytest.mark.slow
def test_nothing_is_allowed_unless_it_is_said(archives: Callable[..., tuple[Path, Path]]) -> None:
    found = diff(*archives())
    assert counts(found) == (CASES - 2, 0, 2) and diff_lines(found)[-1] == "different; no tolerance was given"


@pytest.mark.slow
def test_the_deck_of_the_second_says_it(archives: Callable[..., tuple[Path, Path]]) -> None:
    a, b = archives(q=5e-6)
    assert counts(diff(a, b)) == (CASES - 2, 1, 1)
    assert counts(diff(b, a)) == (CASES - 2, 0, 2)  # that of a, which allows nothing
    lines = diff_lines(diff(a, b))
    assert "  changed    tolerances.q: none -> 5e-06 SI" in lines
    assert "  the deck of b allows q 5e-06 SI" in lines and lines[-1] == "different"
    assert any(line.endswith("5e-06 SI, 200 times that") for line in lines)


@pytest.mark.slow
def test_of_one_joint_alone(archives: Callable[..., tuple[Path, Path]]) -> None:
    a, b = archives(elbow__q=2e-3)
    found = diff(a, b)
    assert counts(found) == (CASES - 2, 1, 1) and q_of(found).by_joint == {"elbow": 2e-3}
    assert [each.case_a for each in found.experiments[0].worst] == [3]
    both = diff(a, b, tolerances(["q=3e-6 rad"]))
    assert counts(both) == (CASES - 2, 2, 0) and both.verdict == "equivalent"
    assert q_of(both).used == pytest.approx(2 / 3, rel=1e-6)  # the shoulder's, of the two
    assert any(line.endswith("(3e-6 rad, elbow 0.002 SI), 66.7 % used") for line in diff_lines(both))


@pytest.mark.slow
def test_the_command_line_has_its_way(archives: Callable[..., tuple[Path, Path]]) -> None:
    a, b = archives(q=1.0, rel=0.5, time=0.01)
    assert diff(a, b).verdict == "equivalent"
    tighter = diff(a, b, tolerances(["q=5e-6rad", "rel=0", "time=0s"]))
    assert counts(tighter) == (CASES - 2, 1, 1)
    assert "  --tol allows q 5e-6 rad, rel 0, time 0 s" in diff_lines(tighter)
    alone = diff(a, b, tolerances(["none"]))
    assert counts(alone) == (CASES - 2, 0, 2) and diff_lines(alone)[-1] == "different; no tolerance was given"


@pytest.mark.slow
def test_of_programs(archives: Callable[..., tuple[Path, Path]]) -> None:
    found = batch.diff(*archives(elbow__q=2e-3, rel=1e-12), tolerances="tau=1 mN*m")
    [experiment] = json.loads(json.dumps(as_data(found)))["experiments"]
    assert experiment["tolerances"] == {"relative": 1e-12, "time": None, "absolute": {"elbow.q": 2e-3, "tau": 1e-3}}
    [q] = [each for each in experiment["signals"] if each["name"] == "q"]
    assert q["tolerance"] == {"absolute": 0.0, "relative": 1e-12, "time": 0.0, "by_joint": {"elbow": 2e-3}}


@pytest.mark.slow
def test_a_metric_that_is_called_as_a_signal(tmp_path: Path) -> None:
    deck = tmp_path / "deck.ic"
    deck.write_text("""#include <two_link.ic>
run both like nominal {
    metric tau = max { of = shoulder.tau; }
    tolerances { metrics.tau = 2 N*m;  tau = 3 N*m; }
}
""")
    archive = batch.run(ic.compile(deck, select=["both"]), output=tmp_path / "a.h5").path
    [found] = diff(archive, archive).experiments
    allowed = {(each.name, each.metric): each.tolerance.absolute for each in found.signals}
    assert allowed["metrics.tau", True] == 2.0 and allowed["tau", False] == 3.0


@pytest.mark.slow
def test_a_deck_that_cannot_be_read_is_told(
    archives: Callable[..., tuple[Path, Path]], monkeypatch: pytest.MonkeyPatch
) -> None:
    from batch.archive.read import ArchiveFile
    from met.diagnostic import error

    a, b = archives(q=1.0)

    def refuse(self: ArchiveFile, *, as_written: bool = False) -> None:
        raise Problem(error("E303", "it was written by a newer MET"))

    monkeypatch.setattr(ArchiveFile, "plan", refuse)
    lines = diff_lines(diff(a, b))
    assert "  changed    the plan cannot be read here: it was written by a newer MET" in lines
    assert "  note: what its deck allows is not known, for the plan cannot be read" in lines
    assert not any("not known" in line for line in diff_lines(diff(a, b, tolerances(["none"]))))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("qd", "tolerance `qd` cannot be read"),
        ("q=1rad,q=2rad", "tolerance `q` is given twice"),
        ("rel=1,rel=0", "tolerance `rel` is given twice"),
        ("rel=1m", "tolerance `rel=1m` has a unit: `rel` is a share of the value"),
        ("time=1m", "tolerance `time=1m`: `m` is no unit of time"),
        ("q=-1rad", "tolerance `q=-1rad` is no size: it must be at least 0"),
        ("q=1foo", "tolerance `q=1foo`: `foo` is no unit"),
    ],
)
def test_words_that_are_wrong(words: str, message: str) -> None:
    with pytest.raises(Problem) as problem:
        tolerances([words])
    assert problem.value.diagnostics[0].message == message
    assert problem.value.diagnostics[0].help == ("as in `--tol qd=1e-6rad/s,rel=1e-9,time=1ms`",)


@pytest.mark.parametrize(
    ("words", "message", "helps"),
    [
        ("x=1m", "tolerance of `x`: neither archive has such a signal or metric", "signals and metrics here: q"),
        ("q=1deg", "tolerance of `q`: it is in rad and in m", "give each joint its own: one.q, two.q"),
        (
            "two.q=1deg",
            "tolerance of `two.q` is in `deg`, and `two.q` in `m`",
            "as in `--tol qd=1e-6rad/s,rel=1e-9,time=1ms`",
        ),
    ],
)
def test_words_that_do_not_fit(words: str, message: str, helps: str) -> None:
    known = {"q": ["rad", "m"], "one.q": ["rad"], "two.q": ["m"]}
    with pytest.raises(Problem) as problem:
        check(tolerances([words]), known, ["q"])
    assert problem.value.diagnostics[0].message == message
    assert problem.value.diagnostics[0].help[-1] == helps


def test_what_is_within_is_within_for_every_column_by_itself() -> None:
    from batch.differences.compare import compare
    from batch.differences.tolerance import SignalTolerance as Allowed

    a = np.array([[1.0, 1.0], [1.0, 1.0]])
    b = a + np.array([[0.5, 0.0], [0.0, 0.02]])
    absolute = np.array([0.6, 0.01])
    found = compare(a, b, Allowed(), absolute=absolute)
    assert found is not None and found.beyond == 1 and found.first_beyond == 1
    assert found.used == pytest.approx(2.0) and found.largest == pytest.approx(0.02)  # 0.5 is within
    within = compare(a, b, Allowed(relative=0.02), absolute=absolute)
    assert within is not None and within.beyond == 0


def test_over() -> None:
    deck = Tolerances(1e-9, 1e-3, {"q": (1.0, "1 rad"), "qd": (2.0, "2 rad/s")})
    both = {"q": (3.0, "3 rad"), "qd": (2.0, "2 rad/s")}
    assert tolerances(["q=3rad,rel=0"]).over(deck) == Tolerances(0.0, 1e-3, both)
