"""Answers of the analysis that are brought along change nothing, and are found anew only where a number has changed."""

from __future__ import annotations

import pickle
import random
from collections.abc import Mapping
from typing import Any

import pytest

from ic.driver.compile import Compiled, check
from ic.text.files import LIBRARY
from met.analysis.memo import MOST, AnalysisMemo
from met.plan import file as plan_file
from tests.ic.driver.test_by_definition import ARM, RUN, typed
from tests.ic.meaning.checks.test_beds import BENCH, ROTOR

SPRING = """\
servo spring { model = passive;  stiffness = 2000 N*m/rad; }
run swings like slow {
    servos { hinge = spring; }
    initial { hinge.q = 5 deg; }
    rates { dynamics = 100 Hz;  servos = 100 Hz; }
    duration = 5 s;
}
"""
"""A run whose step makes the arm swing up (D317), which has a remedy."""

DECK = ARM + RUN


def audited(text: str, known: Mapping[bytes, Any]) -> tuple[Compiled, dict[bytes, Any], int]:
    """The deck compiled, the answers to bring along, and how many were found anew. As between processes, pickled."""
    found: list[None] = []
    memo = AnalysisMemo(pickle.loads(pickle.dumps(known)), lambda: found.append(None))
    compiled = check("", include_dirs=(), defines=(), select="all", text=text, memo=memo)
    return compiled, memo.answers, len(found)


def plain(text: str) -> Compiled:
    return check("", include_dirs=(), defines=(), select="all", text=text)


def assert_same(compiled: Compiled, other: Compiled, text: str) -> None:
    assert compiled.diagnostics == other.diagnostics, text
    plans = [None if each.plan is None else plan_file.dumps(each.plan) for each in (compiled, other)]
    assert plans[0] == plans[1], text


def test_an_answer_is_found_once() -> None:
    first, known, anew = audited(DECK, {})
    again, kept, found = audited(DECK, known)
    assert anew == len(known) > 3  # steps of two runs and a sweep, and what the sweep changes
    assert (found, kept.keys()) == (0, known.keys())
    assert_same(again, first, DECK)


def test_lines_that_move_and_other_names_of_definitions_ask_for_nothing_new() -> None:
    _, known, _ = audited(DECK, {})
    moved = "// a line\n\n" + DECK.replace("slow", "steady").replace("drive", "turner").replace("masses", "loads")
    compiled, _, found = audited(moved, known)
    assert found == 0
    assert_same(compiled, plain(moved), moved)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "anew"),
    [
        (("[1 kg, 2 kg]", "[1 kg, 3 kg]"), 1),  # of the sweep the steps, not what has an effect
        (("rate(0.2 rad/s)", "rate(0.3 rad/s)"), 3),  # the second run, and the sweep of it
        (("duration = 1 s", "duration = 2 s"), 4),
        (("record = [q]", "record = [qd]"), 4),
    ],
)
def test_a_number_that_changes_is_looked_into(change: tuple[str, str], anew: int) -> None:
    _, known, _ = audited(DECK, {})
    now = DECK.replace(*change)
    assert now != DECK
    compiled, kept, found = audited(now, known)
    assert found == anew
    assert len(kept) == len(known)  # what is asked no more is not kept
    assert_same(compiled, plain(now), now)


def test_a_warning_and_its_remedy_are_the_same_where_they_were_known() -> None:
    deck = ARM + RUN + SPRING
    first, known, _ = audited(deck, {})
    assert [each.code for each in first.diagnostics] == ["D317"]
    again, _, found = audited(deck, known)
    assert found == 0
    assert_same(again, first, deck)


def test_a_remedy_that_is_not_known_is_found_for_a_fault_that_is() -> None:
    deck = ARM + RUN + SPRING
    first, known, _ = audited(deck, {})
    faults = {key: each for key, each in known.items() if type(each.answer).__name__ != "Remedy"}
    assert len(faults) == len(known) - 1
    again, _, found = audited(deck, faults)
    assert found == 1
    assert_same(again, first, deck)


@pytest.mark.slow
def test_motors_on_beds_and_all_else_of_a_shipped_deck_are_looked_into_once() -> None:
    deck = (LIBRARY / "two_link.ic").read_text()
    _, known, anew = audited(deck, {})
    moved = f"// a line\n{deck}"
    again, kept, found = audited(moved, known)
    assert (anew, found, kept.keys()) == (len(known), 0, known.keys())
    assert_same(again, plain(moved), moved)
    other = deck.replace("duration    = 20 s", "duration    = 25 s")
    changed, _, found = audited(other, known)
    assert other != deck and found > 0
    assert_same(changed, plain(other), other)


def test_a_bed_that_is_unstable_is_told_again_where_it_was_known() -> None:
    heavy = BENCH.replace("[1, 1, 1]", str([5.4 * ROTOR] * 3)).replace("{ command", "{ kp = 0.02 V*s/rad;  command")
    first, known, _ = audited(heavy, {})
    assert [each.code for each in first.diagnostics] == ["D321"]
    again, _, found = audited(heavy, known)
    assert found == 0
    assert_same(again, first, heavy)


def test_of_what_may_be_asked_for_yet_the_oldest_leave() -> None:
    known = {bytes([n // 256, n % 256]): n for n in range(2 * MOST)}
    assert list(AnalysisMemo(known).so_far.values()) == list(range(MOST, 2 * MOST))


def test_equal_runs_are_looked_into_once() -> None:
    _, _, anew = audited(DECK + "run same like fast { }\nsweep both = slow + fast;\n", {})
    assert anew == len(audited(DECK, {})[1])


@pytest.mark.slow
def test_after_any_edits_answers_that_were_brought_along_make_no_difference() -> None:
    known: Mapping[bytes, Any] = {}
    for now in typed(DECK, random.Random(5), 12):
        compiled, known, _ = audited(now, known)
        assert_same(compiled, plain(now), now)
