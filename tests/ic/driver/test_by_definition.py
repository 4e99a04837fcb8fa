"""Definitions checked by themselves for an editor: what is brought along changes nothing, and does not grow."""

from __future__ import annotations

import pickle
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ic.driver.by_definition import DefinitionChecks, Known
from ic.driver.compile import check
from ic.meaning.definitions.resolve import Definition
from ic.meaning.mechanics import arm as mechanics_arm
from ic.meaning.parameters.scope import Scope
from ic.read import read
from ic.text.files import LIBRARY
from met.diagnostic import Diagnostic, Problem
from tests.ic.editor.fuzz import mutated

ARM = """\
#include <servos/rigid_gearbox.ic>
let heavy = 5 kg;
arm lever {
    link boom { mass = heavy;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = boom;  axis = z; }
}
servo drive like rigid_gearbox { command = rate(0.1 rad/s); }
"""
RUN = """\
run slow {
    arm = lever;
    servos { hinge = drive; }
    rates { dynamics = 1 kHz;  servos = 1 kHz; }
    duration = 1 s;
    record = [q];
}
run fast like slow { servos { hinge { command = rate(0.2 rad/s); } } }
sweep masses of fast { vary heavy = [1 kg, 2 kg]; }
"""


def found(text: str, known: Known, units: list[int] | None = None) -> tuple[tuple[Diagnostic, ...], Known]:
    """What the definitions of a text come to, and the findings to bring along; none where it cannot be read."""
    try:
        deck = read(Path(""), [], (), despite_errors=True, text=text)
    except Problem as problem:
        return problem.diagnostics, known
    checks, count = DefinitionChecks(deck, known), 0
    while checks.to_come:
        checks.check_next()
        count += 1
    if units is not None:
        units.append(count)
    return checks.diagnostics()[0], checks.findings


def checked(text: str) -> tuple[Diagnostic, ...]:
    return check("", include_dirs=(), defines=(), select="all", text=text).diagnostics


def typed(text: str, chance: random.Random, edits: int) -> Iterator[str]:
    """The text as somebody changes it, mostly letter by letter, and mostly takes it back."""
    now = text
    for _ in range(edits):
        now = mutated(now, chance) if chance.random() < 0.7 else text
        yield now


def compare(text: str, seed: int, edits: int) -> None:
    known: Known = {}
    for now in typed(text, random.Random(seed), edits):
        brought, known = found(now, known)
        assert brought == found(now, {})[0], (seed, now)


def test_an_edit_of_a_run_leaves_arms_servos_and_other_runs_as_they_were_found() -> None:
    units: list[int] = []
    _, known = found(ARM + RUN, {}, units)
    _, known = found(ARM + RUN, known, units)
    _, known = found(ARM + RUN.replace("[1 kg, 2 kg]", "[1 kg, 3 kg]"), known, units)
    _, known = found(ARM + RUN.replace("rate(0.2 rad/s)", "rate(0.3 rad/s)"), known, units)
    _, known = found(ARM.replace("5 kg", "6 kg") + RUN, known, units)
    arms, servos, runs = 1, 2, 3
    assert units == [arms + servos + runs, 0, 1, 2, arms + servos + runs]


def test_an_arm_that_has_not_changed_is_brought_along(monkeypatch: pytest.MonkeyPatch) -> None:
    resolved: list[str] = []
    resolve = mechanics_arm._resolved

    def noted(scope: Scope, definition: Definition, *given: Any, **named: Any) -> mechanics_arm.ResolvedArm | None:
        resolved.append(definition.name)
        return resolve(scope, definition, *given, **named)

    monkeypatch.setattr(mechanics_arm, "_resolved", noted)
    run = RUN.replace("record = [q]", "record = [q, qd]")
    _, known = found(ARM + RUN, {})
    assert resolved == ["lever", "lever"], "by itself, and for the sweep that varies a mass of it"
    resolved.clear()
    told, again = found(ARM + run, known)
    assert resolved == ["lever"]
    assert told == found(ARM + run, {})[0] == ()
    assert [each.arm for each in again.values() if each.arm] == [each.arm for each in known.values() if each.arm] != []
    resolved.clear()
    found(ARM.replace("heavy = 5 kg", "heavy = 6 kg") + RUN, known)
    assert resolved == ["lever", "lever"]


def test_an_arm_with_a_mistake_in_it_is_not_brought_along() -> None:
    wrong = ARM.replace("let heavy = 5 kg", "let heavy = 5 m")
    told, known = found(wrong + RUN, {})
    assert [each.code for each in told] == ["D061"]
    assert not any(each.arm for each in known.values())
    assert found(ARM + RUN, known)[0] == ()
    assert found(wrong + RUN.replace("[q]", "[qd]"), known)[0] == found(wrong + RUN.replace("[q]", "[qd]"), {})[0]


def test_while_a_line_cannot_be_read_what_is_known_of_other_runs_counts() -> None:
    units: list[int] = []
    _, known = found(ARM + RUN.replace("vary heavy =", "vary ="), {}, units)
    told, known = found(ARM + RUN.replace("vary heavy =", "vary hea ="), known, units)
    assert [each.severity for each in told].count("error") >= 1
    assert units[1] < units[0]


@pytest.mark.slow
def test_findings_of_what_is_no_more_are_not_kept() -> None:
    _, known = found(ARM + RUN, {})
    sizes = []
    for n in range(10, 40):
        _, known = found(ARM + RUN.replace("0.2 rad/s", f"0.0{n} rad/s"), known)
        sizes.append(len(pickle.dumps(dict(known))))
    assert len(known) == 6
    assert max(sizes) <= sizes[0] + 100


def test_a_deck_that_reads_a_file_of_values_brings_nothing_along(tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text("heavy [kg]\n1\n2\n")
    (tmp_path / "deck.ic").write_text(ARM + RUN.replace("vary heavy = [1 kg, 2 kg];", 'from "cases.csv";'))
    checks = DefinitionChecks(read(tmp_path / "deck.ic", despite_errors=True), {})
    while checks.to_come:
        checks.check_next()
    assert str(tmp_path / "cases.csv") in checks.diagnostics()[1]
    assert checks.findings == {}


def test_nor_does_a_deck_whose_file_is_not_there_yet() -> None:
    told, known = found(ARM + RUN.replace("vary heavy = [1 kg, 2 kg];", 'from "no.csv";'), {})
    assert [each.code for each in told] == ["D190"]
    assert known == {}


@pytest.mark.slow
def test_after_any_edits_what_was_brought_along_makes_no_difference() -> None:
    compare(ARM + RUN, 1, 40)


@pytest.mark.release
@pytest.mark.parametrize("name", sorted(path.name for path in LIBRARY.glob("*.ic")))
def test_after_any_edits_of_a_shipped_deck_what_was_brought_along_makes_no_difference(name: str) -> None:
    compare((LIBRARY / name).read_text(), 7, 30)


@pytest.mark.slow
def test_what_is_told_first_is_told_in_the_end() -> None:
    for now in typed(ARM + RUN, random.Random(2), 12):
        errors = {each for each in checked(now) if each.severity == "error"}
        told = {each for each in found(now, {})[0] if each.severity == "error"}
        assert {(each.code, each.at) for each in told} <= {(each.code, each.at) for each in errors}, now


@pytest.mark.parametrize("name", ["two_link.ic", "station_arm.ic"])
def test_of_a_shipped_deck_nothing_is_told_first(name: str) -> None:
    assert found((LIBRARY / name).read_text(), {})[0] == ()
