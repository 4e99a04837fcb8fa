"""scripts/benchmark: what it lists, how figures are taken, told, written and compared. No time is asserted."""

from __future__ import annotations

import builtins
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks import arms, differences, evaluation, jacobians, long_deck, peer, report, stepping
from benchmarks import machine as measured_on
from benchmarks.__main__ import SUBJECTS, main
from benchmarks.benchmark import Benchmark, Derived, Target, Untaken, ratio, take, with_sources

import ic
from met.backends.llvm import kernel
from met.dynamics.recursion import solve
from met.dynamics.tree import Tree

pytestmark = pytest.mark.slow

HERE = {
    "processor": "A", "code_for": "a", "avx512": True, "cores": 2, "load": 0.1, "system": "L", "python": "3.11.7",
    "compiler": "llvm 22", "commit": "abc1234", "changed": False,
}  # fmt: skip


def figure(name: str, best: float, median: float | None = None, target: dict[str, float] | None = None) -> Any:
    """A figure as a report has it."""
    median = best if median is None else median
    return {
        "name": name, "doc": "something", "unit": "ns", "best": best, "median": median, "largest": median, "turns": 15,
        "target": target, "met": None,
    }  # fmt: skip


def fixed(name: str, values: list[float], order: list[str], **more: Any) -> Benchmark:
    """A benchmark that gives these values in turn, and notes that it was asked."""
    left = list(values)

    def measure() -> float:
        order.append(name)
        return left.pop(0)

    return Benchmark(name, "made up", "s", lambda: measure, **more)


def test_the_list_names_every_figure_once_ratios_first(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("ratios")
    assert lines[1].split()[0] == "ratio.2R"
    names = [one.name for subject in SUBJECTS for one in subject.BENCHMARKS]
    assert len(set(names)) == len(names)
    assert [line.split()[0] for line in lines if line.startswith("    ")][: len(names)] == names
    assert {"version", "check", "run", "hot.7R", "compile.100R", "static.30R-general"} <= set(names)


def test_a_quick_look_leaves_out_what_is_slow_and_what_follows_from_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--quick", "--repeats", "1", "check.growth"]) == 0
    assert capsys.readouterr().out.endswith("targets: 0, none missed\n")


@pytest.mark.parametrize("lines", [20, 100])
def test_the_long_deck_has_its_lines_and_is_sound(lines: int) -> None:
    text = long_deck.text(lines)
    used = [line for line in text.splitlines() if line.count("(") >= 2 and line.startswith(("let", "LINK"))]
    assert len(used) == lines
    assert ic.check(text=text).diagnostics == ()


def test_what_a_figure_follows_from_is_taken_with_it() -> None:
    known = {one.name: one for subject in SUBJECTS for one in subject.BENCHMARKS}
    for one in known.values():
        assert set(one.sources if isinstance(one, Derived) else ()) <= set(known)
    assert with_sources(["ratio.7R"], known) == ["ratio.7R", "static.7R", "pin.7R"]


def test_a_turn_takes_each_figure_once_after_one_turn_to_warm_up() -> None:
    order: list[str] = []
    a, b = fixed("a", [9, 3, 1, 2], order), fixed("b", [9, 6, 8, 7], order)
    once = fixed("once", [5], order, turns=1)
    made = take([ratio("r", "b to a", over="b", under="a"), a, b, once], 3)
    assert order == ["a", "b", "a", "b", "once", "a", "b", "a", "b"]
    assert [(x["name"], x["best"], x["median"], x["turns"]) for x in made] == [
        ("r", 6.0, 3.5, 3), ("a", 1, 2, 3), ("b", 6, 7, 3), ("once", 5, 5, 1),
    ]  # fmt: skip


def test_the_best_decides_whether_a_target_is_met() -> None:
    some = [
        fixed("less", [9, 2, 4], [], target=Target(2.5)),
        fixed("more", [9, 2, 4], [], target=Target(3.0, "at_least")),
        fixed("missed", [9, 2, 4], [], target=Target(1.5)),
    ]
    made = take(some, 2)
    assert [(x["best"], x["met"]) for x in made] == [(2, True), (4, True), (2, False)]
    assert report.verdict(made) == ["MISSED: missed is 2 s, its target <= 1.5"]
    assert report.verdict(made[:2]) == ["targets: 2, none missed"]


def test_what_cannot_be_taken_says_why_and_misses_nothing() -> None:
    def nowhere() -> Any:
        raise Untaken("no such peer")

    made = take(
        [
            ratio("r", "to a peer", over="peer", under="a", target=Target(9.0, "at_least")),
            fixed("a", [1, 1], []),
            Benchmark("peer", "a peer", "ns", nowhere),
        ],
        1,
    )
    assert report.missed(made) == []
    assert report.verdict(made) == ["targets: 1, none missed", "targets of figures that were not taken: r"]
    assert [x.get("untaken") for x in made] == ["no such peer", None, "no such peer"]
    assert report.table(made) == [
        "      best  median  target",
        "r        -       -    >= 9    not taken: no such peer",
        "a      1 s     1 s            made up",
        "peer     -       -            not taken: no such peer",
    ]


def test_without_pin_the_peer_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name == "pinocchio":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(Untaken, match="`pin` is not installed; `scripts/environment test` adds it"):
        peer.model(arms.TWO)


@pytest.mark.parametrize("arm", arms.ARMS, ids=lambda arm: arm.name)
@pytest.mark.parametrize("dynamic", [False, True])
def test_what_is_timed_is_the_peers_forward_dynamics(arm: arms.Arm, dynamic: bool) -> None:
    """The change of qd over one tick, with every joint in torque mode; a rotor is what tells `dynamic` apart.

    The quotient by the step of 1e-9 s leaves 1e-7 of the rates' last digits: 1e-6 of the largest acceleration.
    """
    n = len(arm.joints)
    inputs = evaluation.states(arm, 32, dynamic=dynamic)
    if dynamic:
        inputs[:, 4 * n :] = 1.0
    q, qd, tau = (inputs[:, i * n : (i + 1) * n] for i in range(3))
    _, outputs = kernel.compile(evaluation.program(arm, dynamic=dynamic)).run(inputs, 0, record=False)
    found = (outputs - qd) / evaluation.STEP
    if dynamic:
        tau = tau - evaluation.ROTOR * found  # what is left for the arm
    theirs = peer.accelerations(arm, q, qd, tau)
    assert np.abs(found - theirs).max() <= 1e-6 * np.abs(theirs).max()


@pytest.mark.parametrize("arm", arms.ARMS[:2], ids=lambda arm: arm.name)
def test_the_jacobian_that_is_timed_is_that_of_the_dynamics(arm: arms.Arm) -> None:
    """The sum of its entries in two cases, by extrapolated differences of the recursion over plain numbers."""
    tree, inputs, n = Tree.build(arm.bodies(), arm.joints), evaluation.states(arm, 2), len(arm.joints)
    _, found = kernel.compile(jacobians.program(arm, jacobian=True)).run(inputs, 0, record=False)

    def total(x: np.ndarray) -> float:
        q, qd, tau = x.reshape(3, n).tolist()
        return sum(solve(tree, q, qd, tau=tau, gravity=arms.GRAVITY, rotor=[evaluation.ROTOR] * n).qdd)

    for case, x in enumerate(inputs):
        entries = 0.0
        for moved in np.eye(3 * n):
            once, again = ((total(x + h * moved) - total(x - h * moved)) / (2.0 * h) for h in (1e-3, 5e-4))
            entries += (4.0 * again - once) / 3.0
        assert found[case, 0] == pytest.approx(entries, rel=1e-8)


def test_a_report_is_written_and_read_as_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "figures.json"
    made = [*take([fixed("a", [1, 1], [], target=Target(2.0))], 1), figure("b", 3.0)]
    report.write(path, HERE, 1, made)
    data = json.loads(path.read_text())
    assert set(data) == {"format", "machine", "turns", "figures"}
    assert data["figures"][0] == {
        "name": "a", "doc": "made up", "unit": "s", "best": 1, "median": 1, "largest": 1, "turns": 1,
        "target": {"at_most": 2.0}, "met": True,
    }  # fmt: skip
    assert report.read(path) == data
    assert set(HERE) == set(measured_on.machine()) and set(measured_on.SAME) <= set(HERE)


@pytest.mark.parametrize(
    ("text", "why"), [(None, "No such file or directory"), ("{", "not JSON: "), ("[]", "not a report of this ")]
)
def test_a_file_that_is_no_report_is_refused(tmp_path: Path, text: str | None, why: str) -> None:
    path = tmp_path / "old.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(report.Unreadable, match=why):
        report.read(path)


def test_against_an_older_report_names_what_got_slower_beyond_noise() -> None:
    old = [
        figure("same", 10.0), figure("slow", 10.0), figure("fast", 10.0), figure("noisy", 10.0, 13.0),
        figure("ratio.2R", 90.0, target={"at_least": 90.0}), figure("gone", 1.0),
    ]  # fmt: skip
    now = [
        figure("same", 11.1), figure("slow", 11.3), figure("fast", 8.0), figure("noisy", 13.0, 14.3),
        figure("ratio.2R", 45.0, target={"at_least": 90.0}), figure("new", 1.0),
    ]  # fmt: skip
    assert report.against({"machine": HERE, "figures": old}, HERE, now) == [
        "against commit abc1234",
        "          then   now  now/then  margin",
        "same      10.0  11.1      1.11     12%",
        "slow      10.0  11.3      1.13     12%  slower",
        "fast      10.0     8      0.80     12%  faster",
        "noisy     10.0  13.0      1.30     40%",
        "ratio.2R  90.0  45.0      0.50     12%  slower",
        "not taken now: gone",
        "slower: slow, ratio.2R",
        "faster: fast",
    ]


def test_against_a_report_of_a_different_machine_says_so() -> None:
    then = {"machine": {**HERE, "processor": "B", "avx512": False}, "figures": [figure("a", 1.0)]}
    lines = report.against(then, HERE, [figure("a", 1.0)])
    assert lines[1] == (
        "a different machine (processor B, now A, avx512 False, now True): the times say nothing about MET"
    )


def test_the_run_that_is_timed_has_few_events_and_the_other_many() -> None:
    few, many = (stepping._events(arms.TWO, command)() for command in ("steady", "reversing"))
    assert few < stepping.FEW < many


@pytest.mark.release
@pytest.mark.parametrize(("state", "unlike"), [("same", 0), ("few", differences.FEW), ("all", 28)])
def test_the_pairs_that_are_compared_differ_by_what_was_planted(state: str, unlike: int) -> None:
    import batch

    [found] = batch.diff(*differences.archives(differences.SMALL, state)).experiments
    assert found.cases.count == 28 and not found.ended
    assert {each.name: each.different for each in found.signals} == dict.fromkeys(
        ["settle", "volts", "q", "qd", "tau", "shoulder.servo.voltage"], unlike
    )


def test_every_tool_comes_to_the_right_answer_over_the_small_pair() -> None:
    for name, command in differences.TOOLS.items():
        try:
            words = command()
        except Untaken:  # h5diff is no Python package: what is said without it has a test of its own
            continue
        for state in ("same", "few"):
            used = differences.compared(words, name, differences.SMALL, state)
            assert used.status == (state == "few") and used.seconds > 0.0 and used.memory > 1.0


def test_a_file_is_dropped_from_memory_and_what_stays_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "some"
    path.write_bytes(bytes(100_000))
    assert differences.resident(path) == 25
    differences.drop(path)
    assert differences.resident(path) == 0
    monkeypatch.setattr(differences, "resident", lambda path: 7)
    with pytest.raises(Untaken) as caught:
        differences.drop(path)
    assert str(caught.value) == (
        f"7 pages of a file stay in memory in {tmp_path}: its file system may lie there; TMPDIR names another"
    )


def test_without_h5diff_it_is_said_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(differences.shutil, "which", lambda name: None)
    with pytest.raises(Untaken) as caught:
        differences.TOOLS["h5diff"]()
    assert str(caught.value) == (
        "`h5diff` is not installed; `apt install hdf5-tools`, or the package of the HDF5 tools here"
    )


def test_a_wrong_answer_ends_the_benchmark(monkeypatch: pytest.MonkeyPatch) -> None:
    said = differences.Used(1.0, 1.0, 1.0, 0, "identical")
    monkeypatch.setattr(differences, "timed", lambda *words, **options: said)
    with pytest.raises(SystemExit) as caught:
        differences.compared(["met"], "met", differences.SMALL, "few")
    assert str(caught.value) == (
        "met was wrong over 28 cases, all histories, a few values differ: it ended with 0:\nidentical"
    )
