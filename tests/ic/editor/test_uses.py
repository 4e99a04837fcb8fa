"""A deck that uses another one, in an editor: where names under a roof lead, what may stand behind one, messages."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from met.plan.keys import structure_key
from tests.ic.editor.client import Editor, uri
from tests.ic.editor.test_questions import at, places, words
from tests.ic.editor.test_text import edited
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


WHOLE = PART[: PART.index("servo guided")]  # all that a deck without a guide can have
CELL = """\
use "part.ic" as left;
let twice = left.reach * 2;
arm swing like left.swing { bar { mass = left.bar; } }
servo drive like left.drive { kp = left.drive.kp * 3; }
servo fast like drive { }
let slow = left.slow;
"""
NESTED = (
    'use "cell.ic" as cell;\n'
    + HOLD.replace("part.", "cell.")
    + "sweep two of hold { vary cell.left.drive.kp = [0.1, 0.2] V*s/rad; vary cell.left.reach = [1, 2] m; }\n"
)


@pytest.fixture
def nested(tmp_path: Path, editor: Editor) -> Path:
    """A deck that uses a deck that uses another one, in a folder that is open."""
    (tmp_path / "part.ic").write_text(WHOLE)
    (tmp_path / "cell.ic").write_text(CELL)
    deck = tmp_path / "deck.ic"
    deck.write_text(NESTED)
    opened = {"added": [{"uri": uri(tmp_path), "name": "decks"}], "removed": []}
    editor.tell("workspace/didChangeWorkspaceFolders", {"event": opened})
    editor.open(deck)
    assert editor.of(deck) == []
    return deck


def test_a_name_under_several_roofs_leads_through_all_of_them(editor: Editor, nested: Path) -> None:
    line, column = at(NESTED, "cell.left.reach")
    found = [places(editor.about("textDocument/definition", nested, line, column + n)) for n in (0, 5, 10)]
    folder = nested.parent
    assert found == [
        [(uri(nested), *at(NESTED, "cell;"))],
        [(uri(folder / "cell.ic"), *at(CELL, "left;"))],
        [(uri(folder / "part.ic"), *at(WHOLE, "reach ="))],
    ]


@pytest.mark.slow
def test_behind_several_roofs_their_definitions_may_stand_and_before_them_none(editor: Editor, nested: Path) -> None:
    part = {"reach", "bar", "drive", "fast"}
    assert part <= set(words(editor, nested, NESTED + "let x = cell.left.|"))
    behind = set(words(editor, nested, NESTED + "let x = cell.|"))
    assert {"left", "twice", "swing"} <= behind and not behind & part - {"drive", "fast"}
    outside = set(words(editor, nested, NESTED + "let x = |"))
    assert "cell" in outside and not outside & {"left", "twice", "reach", "bar"}
    assert {"ratio", "kp"} <= set(words(editor, nested, NESTED + "servo weak like cell.left.drive { |"))
    assert {"hinge", "wrist"} <= set(words(editor, nested, NESTED + "run other like hold { servos { |"))


@pytest.mark.release
@pytest.mark.parametrize(("mark", "further", "new", "count"), [
    ("cell.left.reach", 10, "span", {"deck.ic": 1, "cell.ic": 1, "part.ic": 4}),
    ("cell.left.reach", 5, "other", {"deck.ic": 2, "cell.ic": 7}),
    ('"cell.ic" as cell', 13, "room", {"deck.ic": 8}),
])  # fmt: skip
def test_a_name_and_a_roof_are_renamed_in_all_files_under_several_roofs(
    mark: str, further: int, new: str, count: dict[str, int], editor: Editor, nested: Path
) -> None:
    line, column = at(NESTED, mark)
    before = ic.compile(nested, select="all")
    changes = editor.about("textDocument/rename", nested, line, column + further, newName=new)["changes"]
    assert {Path(address).name: len(edits) for address, edits in changes.items()} == count
    for address, edits in changes.items():
        path = nested.parent / Path(address).name
        path.write_text(edited(path.read_text(), edits))
    after = ic.compile(nested, select="all")
    for one, other in zip(before.experiments, after.experiments, strict=True):
        assert structure_key(one.structure) == structure_key(other.structure)
        assert [each.values.tolist() for each in one.cases.coordinates] == [
            each.values.tolist() for each in other.cases.coordinates
        ]
