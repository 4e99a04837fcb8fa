"""An editor is told at once what a deck's definitions come to, and after a pause what its programs do."""

from __future__ import annotations

import asyncio
import itertools
import math
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest

from ic.editor import checking
from ic.editor.checker_process import CheckerProcess
from ic.editor.checking import (
    EARLY,
    CheckReply,
    CheckRequest,
    FoundAnswers,
    answers,
    compiled_with_reply,
    first_replies,
)
from ic.editor.checks import DeckChecks, LastAudit, OpenText, carried_over
from ic.text.files import LIBRARY
from tests.ic.editor.client import Editor, uri

DECK = """\
#include <two_link.ic>
let spare = 1 kg;
run light like nominal { duration = 1 s; }
sweep spares of light { vary spare = [1 kg, 2 kg]; }
sweep noise of light { repeat 2; }
"""
NO_EFFECT = "`spare` changes nothing in this run"
NO_NOISE = "there is no noise in this run, so a repeat is the same case again"


def told(editor: Editor, path: Path) -> list[list[str]]:
    """The messages of each publication for a file, in turn."""
    return [[d["message"] for d in each["diagnostics"]] for each in editor.published if each["uri"] == uri(path)]


def test_what_a_definition_means_is_told_before_the_audit_begins(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    deck.write_text(DECK.replace("sweep spares", "// sweep spares"))
    editor.open(deck)
    editor.settle()
    assert told(editor, deck)[-1] == [NO_NOISE]
    assert told(editor, deck)[0] == []
    editor.forget()
    editor.change(deck, DECK)
    editor.settle()
    *meanwhile, last = told(editor, deck)
    assert last == [NO_EFFECT], "errors leave no program to look into"
    before = ([NO_NOISE], [NO_EFFECT, NO_NOISE])  # where a check takes long, what was said before is left standing
    assert all(each in before for each in meanwhile)


def all_replies(text: str, seconds: float) -> list[CheckReply]:
    """The replies before the audit, where each look at the clock takes so long."""
    ticks = itertools.count()
    request = CheckRequest(str(LIBRARY), "", text, (), (), {})
    found = [each for each in first_replies(request, lambda: seconds * next(ticks)) if isinstance(each, CheckReply)]
    assert not any(each.audited for each in found)
    return found


def replies(text: str, seconds: float) -> list[list[str]]:
    """The messages of each reply before the audit, where each look at the clock takes so long."""
    return [[each.message for each in reply.diagnostics] for reply in all_replies(text, seconds)]


def test_all_mistakes_of_definitions_are_told_together_where_that_is_quick() -> None:
    wrong = DECK.replace("vary spare", "vary spar").replace("duration = 1 s", "duration = 1")
    bare, unknown = "`duration` of run `light` is in s, and this is a bare number", "no parameter `spar` in this run"
    assert replies(wrong, 0.0) == [[bare, unknown]]
    assert replies(DECK, 0.0) == [[NO_EFFECT]]


def test_mistakes_of_an_arm_are_told_first_where_the_rest_takes_long() -> None:
    wrong = "arm bad { link a { mass = 1 m; } }\n" + DECK.replace("vary spare", "vary spar")
    nothing, first, *further, every = replies(wrong, 2 * EARLY)
    assert nothing == [], "before a definition is checked that is told which is known by then"
    assert "`mass` of link `a` is in kg, and this is in m" in first
    assert all(each in (first, every) for each in further)
    assert every == [*first, "no parameter `spar` in this run"]


def test_what_cannot_be_read_is_told_before_a_definition_is_checked_where_these_take_long() -> None:
    wrong = DECK.replace("vary spare", "vary spar").replace("1 kg;", "1 kg")
    first, *_, every = replies(wrong, 2 * EARLY)
    assert first == ["expected `;`"]
    assert "no parameter `spar` in this run" in every


def test_nothing_is_told_again_where_no_more_is_found() -> None:
    assert len(replies(DECK.replace("sweep spares", "// sweep spares"), 2 * EARLY)) == 2


@pytest.mark.slow
def test_an_audit_takes_along_what_the_last_one_found_also_where_it_was_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checking, "DEAR", -1.0)  # everything is dear
    monkeypatch.setattr(checking, "EARLY", math.inf)  # on a machine of any speed
    request = CheckRequest(str(LIBRARY), "", DECK.replace("sweep spares", "// sweep spares"), (), (), {})
    first: list[FoundAnswers] = []
    told = [each.diagnostics for each in answers(request, pause=0.0, keep=first.append) if isinstance(each, CheckReply)]
    for found, anew in ((b"", len(first)), (first[0].pickled, len(first) - 1), (first[-1].pickled, 1)):
        again: list[FoundAnswers] = []
        known = replace(request, answers=found)
        replies = [each for each in answers(known, pause=0.0, keep=again.append) if isinstance(each, CheckReply)]
        assert [each.diagnostics for each in replies] == told
        assert len(again) == anew  # one for each that was found, and one in the end
    assert len(first) > 3


def test_what_was_said_of_lines_that_are_as_they_were_stays_where_they_are_now() -> None:
    wrong = DECK.replace("vary spare", "vary spar").replace("duration = 1 s", "duration = 1") + "sweep s of ligt { }\n"
    (*_, last) = all_replies(wrong, 0.0)
    lines = wrong.split("\n")
    changed = "\n".join(["// a line more", *lines[:2], "// and one", lines[2].replace("= 1;", "= 2;"), *lines[3:]])
    first, *_, every = all_replies(changed, 2 * EARLY)
    assert not first.diagnostics and len(every.diagnostics) == 3
    carried = carried_over(last, first)
    assert [each for each in every.diagnostics if "bare number" not in each.message] == list(carried.diagnostics)
    assert len(carried.edits) == len(carried.diagnostics) and not any(carried.edits)
    assert carried_over(carried, first).diagnostics == carried.diagnostics
    assert carried_over(last, every).diagnostics == every.diagnostics, "nothing is told twice"


def test_a_change_of_another_deck_need_not_wait_for_an_audit(tmp_path: Path, editor: Editor) -> None:
    one, other = tmp_path / "one.ic", tmp_path / "other.ic"
    quiet = DECK.replace("sweep spares", "// sweep spares")
    for deck in (one, other):
        deck.write_text(quiet)
        editor.open(deck)
    editor.settle()
    editor.change(one, quiet + "// a remark\n")
    editor.change(other, quiet + "run wrong like light { duration = 5; }\n")
    editor.settle()
    assert told(editor, one)[-1] == [NO_NOISE]
    assert any("bare number" in each for each in told(editor, other)[-1])


QUIET = DECK.replace("sweep spares", "// sweep spares")
"""The deck without errors: its audit has one message."""


@pytest.mark.slow
def test_what_the_last_audit_said_of_unchanged_lines_stands_until_the_next_one_ends(
    tmp_path: Path, editor: Editor
) -> None:
    deck = tmp_path / "arm.ic"
    deck.write_text(QUIET)
    editor.open(deck)
    editor.settle()
    for change in (f"// a line\n{QUIET}", f"// a line\n{QUIET}// and another\n"):
        editor.forget()
        editor.change(deck, change)
        editor.settle()
        found = [each["diagnostics"] for each in editor.published if each["uri"] == uri(deck)]
        shown = [[(d["message"], d["range"]["start"]["line"]) for d in each] for each in found]
        assert shown and all(each == [(NO_NOISE, 5)] for each in shown)
    for change in (QUIET.replace("repeat 2", "repeat 3"), QUIET.replace("sweep noise", "sweep noises")):
        editor.change(deck, change)
        editor.settle()
        assert told(editor, deck)[-1] == [NO_NOISE]


def definitions(text: str) -> CheckReply:
    return replace(all_replies(text, 0.0)[-1], known=None)


def audit(text: str) -> CheckReply:
    return compiled_with_reply(CheckRequest(str(LIBRARY), "", text, (), (), {}))[1]


def messages(reply: CheckReply | None) -> list[str]:
    assert reply is not None
    assert len(reply.edits) == len(reply.diagnostics)
    return [each.message for each in reply.diagnostics]


@pytest.mark.slow
def test_errors_of_definitions_stand_alone_and_once_mended_the_last_audit_counts_again() -> None:
    last = LastAudit()
    assert messages(last.carried_into(definitions(QUIET))) == []
    last.take(audit(QUIET))
    assert messages(last.carried_into(definitions(DECK))) == [NO_EFFECT]
    last.take(audit(DECK))  # which has looked into no program
    assert messages(last.carried_into(definitions(QUIET))) == [NO_NOISE]
    last.take(audit(QUIET))
    assert messages(last.carried_into(definitions(QUIET))) == [NO_NOISE]


@pytest.mark.slow
def test_what_an_audit_said_goes_with_its_line_and_with_an_audit_that_does_not_say_it() -> None:
    last = LastAudit()
    last.carried_into(definitions(QUIET))
    last.take(audit(QUIET))
    line = "sweep noise of light { repeat 2; }"
    assert messages(last.carried_into(definitions(QUIET.replace(line, f"{line} // two")))) == []
    assert messages(last.carried_into(definitions(QUIET))) == [], "until it is found again"
    last.take(audit(QUIET))
    last.carried_into(definitions(QUIET))
    last.take(audit(QUIET.replace(line, "")))
    assert messages(last.carried_into(definitions(QUIET))) == []


@pytest.mark.slow
def test_where_an_audit_dies_what_the_last_one_said_is_taken_back() -> None:
    last = LastAudit()
    last.carried_into(definitions(QUIET))
    last.take(audit(QUIET))
    assert last.give_up() is None, "it has ended"
    assert messages(last.carried_into(definitions(QUIET))) == [NO_NOISE]
    assert messages(last.give_up()) == []
    assert last.give_up() is None, "there is nothing left to take back"
    assert messages(last.carried_into(definitions(QUIET))) == []


class GivenReplies(CheckerProcess):
    """A process whose checks have these replies, those of a check each."""

    def __init__(self, *checks: list[CheckReply]) -> None:
        super().__init__()
        self._checks = list(checks)

    async def ask(self, request: CheckRequest) -> AsyncIterator[object]:
        for each in self._checks.pop(0):
            yield each


@pytest.mark.release
def test_a_file_of_values_belongs_to_its_deck_also_while_a_check_has_not_come_to_it(tmp_path: Path) -> None:
    deck = OpenText((tmp_path / "arm.ic").as_uri(), "", 1)
    partial = CheckReply((), (), {"arm.ic": ""}, audited=False)
    whole = CheckReply((), (), {"arm.ic": "", "cases.csv": ""}, known={}, audited=False)
    files: list[set[str]] = []
    process = GivenReplies([partial, whole], [partial, whole])
    checks = DeckChecks(
        process, lambda decks: files.append({Path(each).name for of in decks for each in of.files}), print, print
    )

    async def check_twice() -> None:
        worker = asyncio.create_task(checks.work())
        checks.open(deck)
        await checks.rest()
        checks.change(replace(deck, version=2))
        await checks.rest()
        worker.cancel()

    asyncio.run(check_twice())
    assert files == [{"arm.ic"}, *[{"arm.ic", "cases.csv"}] * 3]
