"""A deck that uses another one, in an editor: where names under a roof lead, what may stand behind one, messages."""

from __future__ import annotations

from pathlib import Path

from tests.ic.editor.client import Editor, uri
from tests.ic.editor.test_questions import at, places, words
from tests.ic.test_used_decks import HOLD, OWN, PART, USE

DECK = USE + "let reach = 3 m;\nlet twice = part.reach * 2 + reach;\n" + HOLD


def opened(folder: Path, editor: Editor, part: str = PART) -> Path:
    (folder / "part.ic").write_text(part)
    deck = folder / "deck.ic"
    deck.write_text(DECK)
    editor.open(deck)
    return deck


def test_a_name_under_a_roof_leads_into_the_deck_that_is_used(editor: Editor, tmp_path: Path) -> None:
    deck = opened(tmp_path, editor)
    assert editor.of(deck) == []

    def leads(mark: str, further: int) -> list[tuple[str, int, int]]:
        line, column = at(DECK, mark)
        return places(editor.about("textDocument/definition", deck, line, column + further))

    part = uri(tmp_path / "part.ic")
    assert leads("part.reach", 5) == [(part, *at(PART, "reach ="))]
    assert leads("part.drive", 5) == [(part, *at(PART, "drive {"))]
    assert leads("part.swing", 5) == [(part, *at(PART, "swing {"))]
    assert leads("part.reach", 0) == [(uri(deck), *at(DECK, "part;"))]
    assert leads("part.ic", 2) == [(part, 0, 0)]
    assert leads("+ reach", 2) == [(uri(deck), *at(DECK, "reach = 3"))]


def test_behind_a_roof_its_definitions_may_stand(editor: Editor, tmp_path: Path) -> None:
    deck = opened(tmp_path, editor)
    assert editor.of(deck) == []
    found = words(editor, deck, DECK + "let x = part.|")
    assert {"reach", "bar", "slow", "drive", "fast", "guided", "swing"} <= set(found)
    assert "hold" not in found and "twice" not in found


def test_a_mistake_in_a_used_deck_is_shown_there(editor: Editor, tmp_path: Path) -> None:
    opened(tmp_path, editor, PART.replace("like drive { kp", "like driv { kp"))
    (told,) = editor.of(tmp_path / "part.ic")
    assert told["code"] == "D041"
    assert told["range"]["start"]["line"] == at(PART, "servo fast")[0]


def test_a_deck_that_another_one_uses_is_checked_with_its_own_runs_too(editor: Editor, tmp_path: Path) -> None:
    deck = opened(tmp_path, editor, PART + OWN)
    assert editor.of(deck) == []
    editor.open(tmp_path / "part.ic", PART + OWN.replace("arm = swing", "arm = swig"))
    assert {each["code"] for each in editor.of(tmp_path / "part.ic")} >= {"D041"}
