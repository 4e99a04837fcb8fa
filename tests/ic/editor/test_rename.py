"""A name is changed in all files that have it, and the plan stays what it was but for the name; or it is refused."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from lsprotocol import types

import ic
from ic.editor.answers import CannotRename
from ic.editor.checks import OpenText
from ic.editor.renaming import same_but_for
from ic.text.files import LIBRARY
from met.plan import Plan
from met.plan.codec import encode
from tests.ic.editor.client import Editor, uri
from tests.ic.editor.test_loops import CHAIN
from tests.ic.editor.test_memory import checking
from tests.ic.editor.test_questions import ARM, LENGTHS, at
from tests.ic.editor.test_text import edited

SECOND = '#include "arm.ic"\nrun second like nominal { servos { elbow = gearbox { kp = 0.01 V*s/rad; } } }\n'
LAST = """\
run last like nominal {
    metric settle = settling_time { of = elbow.qd;  target = slow; }
    require settle < 10 s;
}
sweep masses of last { vary links.upper.mass = [10, 20] kg;  vary gearbox.kp = [0.02, 0.03] V*s/rad; }
"""
DECK = ARM + LAST


@pytest.fixture
def deck(tmp_path: Path, editor: Editor) -> Path:
    """A deck that is open, beside one that is not and includes it."""
    (tmp_path / "lengths.ic").write_text(LENGTHS)
    (tmp_path / "second.ic").write_text(SECOND)
    path = tmp_path / "arm.ic"
    path.write_text(DECK)
    editor.tell(
        "workspace/didChangeWorkspaceFolders",
        {"event": {"added": [{"uri": uri(tmp_path), "name": "decks"}], "removed": []}},
    )
    editor.open(path)
    assert editor.of(path) == []
    return path


def rename(editor: Editor, deck: Path, mark: str, new: str, n: int = 0) -> dict[str, Any]:
    line, column = at(deck.read_text(), mark, n)
    found: dict[str, Any] = editor.about("textDocument/rename", deck, line, column, newName=new)
    return found["changes"]


def refused(editor: Editor, deck: Path, mark: str, new: str = "another", n: int = 0) -> str:
    with pytest.raises(AssertionError) as reason:
        rename(editor, deck, mark, new, n)
    assert reason.value.args[0]["code"] == -32803
    return str(reason.value.args[0]["message"])


@pytest.mark.release
@pytest.mark.parametrize(
    ("mark", "old", "new", "files"),
    [
        ("gearbox like", "gearbox", "motor", {"arm.ic", "second.ic"}),
        ("elbow    rev", "elbow", "wrist", {"arm.ic", "second.ic"}),
        ("reach, 0", "reach", "span", {"arm.ic", "lengths.ic"}),
        pytest.param("nominal {", "nominal", "usual", {"arm.ic", "second.ic"}, marks=pytest.mark.slow),
        pytest.param("two {", "two", "planar", {"arm.ic"}, marks=pytest.mark.slow),
        pytest.param("settle < 10", "settle", "done", {"arm.ic"}, marks=pytest.mark.slow),
        pytest.param("slow)", "slow", "gentle", {"arm.ic"}, marks=pytest.mark.slow),
        ("ROD(upper", "ROD", "BAR", {"arm.ic"}),
    ],
)
def test_a_name_is_changed_in_all_files_and_the_plan_but_for_the_name_is_what_it_was(
    editor: Editor, deck: Path, mark: str, old: str, new: str, files: set[str]
) -> None:
    before = {name: ic.compile(deck.parent / name, select="all") for name in ("arm.ic", "second.ic")}
    changes = rename(editor, deck, mark, new)
    assert {Path(address).name for address in changes} == files
    for address, edits in changes.items():
        path = deck.parent / Path(address).name
        path.write_text(edited(path.read_text(), edits))
        assert not path.read_text().count(f" {old} ") or old == "two"
    for name, plan in before.items():
        after = ic.compile(deck.parent / name, select="all")
        assert same_but_for(old, new, encode(Plan, plan), encode(Plan, after))


@pytest.mark.slow
def test_a_unit_of_the_deck_is_changed_wherever_it_stands(editor: Editor, deck: Path) -> None:
    deck.write_text("deck 2;\n" + DECK.replace("let slow = 3 deg/s", "unit turn = 360 deg;\nlet slow = 0.01 turn/s"))
    editor.change(deck, deck.read_text())
    assert editor.of(deck) == []
    (edits,) = rename(editor, deck, "turn =", "lap").values()
    assert len(edits) == 2
    assert edited(deck.read_text(), edits) == deck.read_text().replace("turn", "lap")
    assert "`rev` is a unit already" in refused(editor, deck, "turn =", "rev")


@pytest.mark.parametrize(
    ("mark", "new", "reason"),
    [
        ("rigid_gearbox {", "drive", "`rigid_gearbox` is defined in <servos/rigid_gearbox.ic>, which comes with MET"),
        ("upper, 40", "boom", "`upper` is made by a macro: change what the macro is given by hand"),
        ("elbow    rev", "shoulder", "`shoulder` exists: joint at arm.ic:8:11"),
        ("gearbox like", "kg", "`kg` is a unit"),
        ("gearbox like", "2nd", "`2nd` is no name: letters, digits and `_`, not a digit first"),
        ("gearbox like", "sqrt", "`sqrt` is a function or a number of the language"),
        ("gearbox like", "like", "`like` is a word of the language"),
        ("duration", "length", "`duration` is no name that a deck defines here"),
    ],
)
def test_what_cannot_be_renamed_is_refused_with_the_reason(
    editor: Editor, deck: Path, mark: str, new: str, reason: str
) -> None:
    assert refused(editor, deck, mark, new) == reason


def test_a_refusal_is_an_answer_and_no_failure_that_is_logged(editor: Editor, deck: Path) -> None:
    logged = editor.errors()
    line, column = at(DECK, "duration")
    with pytest.raises(AssertionError):
        editor.about("textDocument/prepareRename", deck, line, column)
    refused(editor, deck, "duration")
    refused(editor, deck, "gearbox like", "sqrt")
    editor.settle()
    assert editor.errors() == logged


def test_a_name_of_a_loop_is_refused(tmp_path: Path, editor: Editor) -> None:
    path = tmp_path / "chain.ic"
    path.write_text(CHAIN)
    editor.open(path)
    editor.settle()
    for mark in ("seg_0;", "seg_{i} {"):
        assert refused(editor, path, mark).endswith("is made by a loop: change `seg_{i}` by hand")
    assert len(rename(editor, path, "span =", "pitch")[uri(path)]) == 3


@pytest.mark.slow
def test_a_file_outside_of_the_open_folders_is_not_changed(tmp_path: Path, editor: Editor) -> None:
    (tmp_path / "lengths.ic").write_text(LENGTHS)
    inside = tmp_path / "inside"
    inside.mkdir()
    path = inside / "arm.ic"
    path.write_text(DECK.replace('"lengths.ic"', '"../lengths.ic"'))
    editor.open(path)
    assert editor.of(path) == []
    reason = refused(editor, path, "reach, 0")
    assert reason.startswith("`reach` stands in ") and reason.endswith("outside of the folders that are open")


@pytest.mark.slow
def test_a_deck_with_a_mistake_is_mended_first(editor: Editor, deck: Path) -> None:
    text = DECK + "run broken like nominal { duration = 5; }\n"
    deck.write_text(text)
    editor.change(deck, text)
    assert refused(editor, deck, "gearbox like").endswith("mend D060 first")


@pytest.mark.slow
def test_a_name_with_other_uses_in_a_table_is_refused(editor: Editor, deck: Path) -> None:
    (deck.parent / "cases.csv").write_text("gearbox.kp [V*s/rad]\n0.02\n0.03\n")
    text = DECK + 'sweep listed of nominal { from "cases.csv"; }\n'
    deck.write_text(text)
    editor.change(deck, text)
    assert editor.of(deck) == []
    assert "`gearbox` would not be found everywhere" in refused(editor, deck, "gearbox like", "motor")


@pytest.mark.slow
def test_a_change_before_the_new_name_is_proved_ends_the_renaming(tmp_path: Path) -> None:
    text, address = (LIBRARY / "two_link.ic").read_text(), (tmp_path / "deck.ic").as_uri()

    async def ends() -> str:
        async with checking() as server:
            server.checks.open(OpenText(address, text, 0))
            await server.checks.rest()
            position = types.Position(*at(text, "reach"))
            renaming = asyncio.create_task(server.in_text(address, position).rename("span", (), server.process))
            await asyncio.sleep(0)
            server.checks.change(OpenText(address, text + "\n", 1))
            with pytest.raises(CannotRename) as reason:
                await renaming
            return reason.value.message

    assert asyncio.run(ends()) == "a deck was changed or saved before the new name was proved: rename again"


@pytest.mark.release
def test_an_editor_is_told_of_the_name_before_it_asks_for_a_new_one(editor: Editor, deck: Path) -> None:
    line, column = at(DECK, "slow)")
    found = editor.about("textDocument/prepareRename", deck, line, column + 1)
    assert found["placeholder"] == "slow" and found["range"]["start"] == {"line": line, "character": column}
