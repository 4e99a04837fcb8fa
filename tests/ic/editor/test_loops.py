"""Loops and params in an editor: the names that they make, the blocks that they stand in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from ic.editor.names import NamesInTexts
from ic.editor.structure import DeckText
from tests.ic.editor.client import Editor, uri
from tests.ic.editor.test_questions import at, places, words

CHAIN = """\
param span = 0.1 m;
arm chain {
    for i in 0 .. 2 { link seg_{i} { mass = 0.1 kg;  shape = rod(length = span, along = x); } }
    joint j_0 revolute { parent = base;  child = seg_0;  axis = y; }
    for i in 1 .. 2 {
        joint j_{i} revolute { parent = seg_{i-1};  child = seg_{i};  axis = y;  at = [span, 0 m, 0 m]; }
    }
}
default run swing {
    arm      = chain;
    initial  { j_1.q = 0.1 rad; }
    rates    { dynamics = 1 kHz; }
    duration = 1 s;
    record   = [q];
}
"""


def opened(tmp_path: Path, editor: Editor) -> Path:
    path = tmp_path / "chain.ic"
    path.write_text(CHAIN)
    editor.open(path)
    assert editor.of(path) == []
    return path


def outline(found: list[Any]) -> list[Any]:
    return [(each["name"], outline(each.get("children") or [])) for each in found]


def test_names_with_braces_are_names(tmp_path: Path, editor: Editor) -> None:
    text = DeckText("chain.ic", CHAIN)
    assert NamesInTexts([text]).of_kind("link", "joint") == ["seg_{i}", "j_0", "j_{i}"]
    deck = opened(tmp_path, editor)
    found = editor.ask("textDocument/documentSymbol", {"textDocument": {"uri": uri(deck)}})
    assert outline(found)[:2] == [("span", []), ("chain", [("seg_{i}", []), ("j_0", []), ("j_{i}", [])])]


def test_a_name_leads_to_the_loop_that_makes_it(tmp_path: Path, editor: Editor) -> None:
    deck = opened(tmp_path, editor)
    for mark, defined in (
        ("seg_0;", "seg_{i} {"),
        ("seg_{i-1}", "seg_{i} {"),
        ("seg_{i};", "seg_{i} {"),
        ("j_1.q", "j_{i} rev"),
        ("span,", "span ="),
    ):
        found = editor.about("textDocument/definition", deck, *at(CHAIN, mark))
        assert places(found) == [(uri(deck), *at(CHAIN, defined))], mark


def test_a_block_in_a_loop_has_the_entries_of_its_kind(tmp_path: Path, editor: Editor) -> None:
    deck = opened(tmp_path, editor)
    assert "inertia" in words(editor, deck, CHAIN.replace("mass = 0.1 kg;", "mass = 0.1 kg;  |"))
    assert "link" in words(editor, deck, CHAIN.replace("for i in 1 .. 2 {", "for i in 1 .. 2 { |"))
    assert "span" in words(editor, deck, CHAIN.replace("[span,", "[|"))


def test_names_that_a_loop_makes_are_offered_and_those_with_braces_in_the_loop_alone(
    tmp_path: Path, editor: Editor
) -> None:
    deck = opened(tmp_path, editor)
    assert words(editor, deck, CHAIN.replace("{ j_1.q = 0.1 rad; }", "{ |"))[:3] == ["j_0", "j_1", "j_2"]
    linear = "    linear about { %s; }\n    record "
    for before, found in (
        ("open = j_1.|", {"q", "tau"}),
        ("at = |", {"equilibrium"}),
        ("open = |", {"j_0", "j_1", "j_2", "q", "links"}),
    ):
        offered = words(editor, deck, CHAIN.replace("    record ", linear % before))
        assert found <= set(offered) and not {"j_{i}", "axis", "at", "duration"} & set(offered), before
    in_loop = CHAIN.replace("child = seg_{i};", "child = |;")
    assert {"seg_{i}", "seg_0", "seg_1", "seg_2"} <= set(words(editor, deck, in_loop))
    in_run = "    for i in 1 .. 2 { metric top_{i} = peak { of = j_{i}.q; }  require never(| }\n    record "
    offered = words(editor, deck, CHAIN.replace("    record ", in_run))
    assert {"top_{i}", "j_{i}", "j_2"} <= set(offered), "and not what a block of a run may begin with"
    offered = words(editor, deck, CHAIN.replace("    record ", "    require never(|\n    record "))
    assert "j_2" in offered and not any("{" in each for each in offered)


def test_what_words_alone_may_stand_is_offered_alone(tmp_path: Path, editor: Editor) -> None:
    deck = opened(tmp_path, editor)
    sweeps = CHAIN + "run other like swing { }\nsweep a of swing { }\nsweep b of other { }\nsweep both = a + b;\n"
    for word in ("against", "confirm"):
        assert words(editor, deck, sweeps + f"tune t of swing {{ {word} |") == ["a", "both"]
    assert words(editor, deck, 'let bodies = csv("bodies.csv", rows = |);\n' + CHAIN) == ["all"]
    assert words(editor, deck, CHAIN.replace("j_1.q = 0.1 rad", "j_1.q = |"))[0] == "command"
    watched = CHAIN.replace("    record ", "    metric size = peak { of = abs(j_1.q); }\n    record ")
    editor.change(deck, watched)
    assert editor.of(deck) == []
    assert not any(
        "(" in each for each in words(editor, deck, watched.replace("    record ", "    require |\n    record "))
    )


@pytest.mark.slow
def test_a_value_of_all_turns_is_shown(tmp_path: Path, editor: Editor) -> None:
    deck = opened(tmp_path, editor)
    found = editor.about("textDocument/hover", deck, *at(CHAIN, "mass = 0.1"))["contents"]["value"]
    assert all(f"`links.seg_{i}.mass` = 0.1 kg" in found for i in range(3))
    found = editor.about("textDocument/hover", deck, *at(CHAIN, "span ="))["contents"]["value"]
    assert "`span` = 0.1 m" in found and "let `span`" in found


@pytest.mark.release
def test_loops_in_loops_are_answered_however_deep_they_go(editor: Editor, tmp_path: Path) -> None:
    deck = tmp_path / "deep.ic"
    text = "arm a { " + "for i in [1] { " * 2000
    editor.open(deck, text)
    assert [each["message"] for each in editor.of(deck)] == ["this `{` is not closed"]
    found = editor.about("textDocument/completion", deck, 0, len(text))
    assert {"link", "joint"} <= {each["label"] for each in found}
    document = {"textDocument": {"uri": uri(deck)}}
    assert [each["name"] for each in editor.ask("textDocument/documentSymbol", document)] == ["a"]
    assert editor.ask("textDocument/foldingRange", document) is not None
    assert editor.about("textDocument/hover", deck, 0, 1)["contents"]["value"].startswith("`arm NAME { ... }`")
    editor.change(deck, "arm a { link b { " * 1500)
    assert [each["name"] for each in editor.ask("textDocument/documentSymbol", document)] == ["a"]
