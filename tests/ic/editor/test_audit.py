"""An editor is told at once what a deck's definitions come to, and after a pause what its programs do."""

from __future__ import annotations

from pathlib import Path

from tests.ic.editor.client import Editor, uri

DECK = """\
#include <two_link.ic>
let spare = 1 kg;
run light like nominal { duration = 1 s; }
sweep spares of light { vary spare = [1 kg, 2 kg]; }
sweep noise of light { repeat 2; }
"""
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
    assert ["`spare`" in each for each in told(editor, deck)[-1]] == [True], "errors leave no program to look into"


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
