"""An editor and a deck's text: quick fixes, layout, the list of definitions, folding."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from ic.editor.outline import folds
from ic.editor.structure import DeckText
from ic.formatting.formatter import formatted
from tests.ic.editor.client import Editor, uri

BAD = """#include <two_link.ic>
run more like nominal {
    duration = 5;
}
run other like nominal {
    duratoin = 5 s;
}
"""


def fixes(editor: Editor, path: Path, found: Any) -> list[Any]:
    context = {"diagnostics": [found]}
    parameters = {"textDocument": {"uri": uri(path)}, "range": found["range"], "context": context}
    actions: list[Any] = editor.ask("textDocument/codeAction", parameters)
    return actions


def edited(text: str, edits: list[Any]) -> str:
    """The text with edits made; in it every character is one unit."""
    lines = text.split("\n")

    def offset(position: Any) -> int:
        return sum(len(line) + 1 for line in lines[: position["line"]]) + int(position["character"])

    for edit in sorted(edits, key=lambda each: offset(each["range"]["start"]), reverse=True):
        text = text[: offset(edit["range"]["start"])] + edit["newText"] + text[offset(edit["range"]["end"]) :]
    return text


def test_each_fix_mends_what_its_message_says(tmp_path: Path, editor: Editor) -> None:
    deck, text = tmp_path / "arm.ic", BAD
    editor.open(deck, text)
    found = editor.of(deck)
    assert [each["code"] for each in found] == ["D060", "D109"]
    while found := editor.of(deck):
        (fix,) = fixes(editor, deck, found[0])
        assert fix["kind"] == "quickfix" and fix["isPreferred"] is True
        assert f"help: {fix['title']}" in [each["message"] for each in found[0]["relatedInformation"]]
        text = edited(text, fix["edit"]["changes"][uri(deck)])
        editor.change(deck, text)
    assert text == BAD.replace("= 5;", "= 5 s;").replace("duratoin", "duration")


def test_a_fix_of_an_included_file_changes_that_file(tmp_path: Path, editor: Editor) -> None:
    deck, part = tmp_path / "arm.ic", tmp_path / "part.ic"
    part.write_text("run more like nominal { duration = 5; }\n")
    editor.open(deck, '#include <two_link.ic>\n#include "part.ic"\n')
    editor.open(part)
    (found,) = editor.of(part)
    (fix,) = fixes(editor, part, found)
    assert edited(part.read_text(), fix["edit"]["changes"][uri(part)]) == "run more like nominal { duration = 5 s; }\n"


@pytest.mark.parametrize(
    ("written", "code", "fixed"),
    [
        ("let rev = 2;\nlet a = 3 kg*rev;\n", "D392", ["let rev = 2;\nlet a = (3 kg)*rev;\n"]),
        ("let a = 1/2 m;\n", "D392", ["let a = 1/(2 m);\n", "let a = (1/2) m;\n"]),
        ("deck 2;\nlet a = 1/2 m;\n", "D393", ["deck 2;\nlet a = 1/(2 m);\n", "deck 2;\nlet a = (1/2) m;\n"]),
    ],
)
def test_what_editions_mean_differently_has_quick_fixes(
    tmp_path: Path, editor: Editor, written: str, code: str, fixed: list[str]
) -> None:
    deck = tmp_path / "arm.ic"
    editor.open(deck, written)
    (found,) = [each for each in editor.of(deck) if each["code"] == code]
    offered = fixes(editor, deck, found)
    assert [edited(written, each["edit"]["changes"][uri(deck)]) for each in offered] == fixed


def test_nothing_is_offered_for_a_text_that_has_changed_since_it_was_checked(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    editor.open(deck, BAD)
    found = editor.of(deck)[0]
    editor.change(deck, "\n" + BAD)
    assert fixes(editor, deck, found) == []
    editor.settle()


def test_layout_is_that_of_met_fmt(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    text = "#include <two_link.ic>\nrun   more like nominal{\nduration=5 s; // é\n}\n"
    editor.open(deck, text)
    options = {"textDocument": {"uri": uri(deck)}, "options": {"tabSize": 2, "insertSpaces": True}}
    assert edited(text, editor.ask("textDocument/formatting", options)) == formatted("arm.ic", text)
    editor.change(deck, formatted("arm.ic", text))
    assert editor.ask("textDocument/formatting", options) == []
    editor.change(deck, "run a { duration = 5 s;\n")
    assert editor.ask("textDocument/formatting", options) == []
    assert len(editor.shown) == 1 and editor.shown[0].startswith("met lsp: not laid out: ")


def named(found: list[Any]) -> list[Any]:
    return [(each["name"], named(each["children"])) if each.get("children") else each["name"] for each in found]


OUTLINED = """#define REACH 2
let length = 1 m;
arm two {
    link upper { mass = 1 kg; }
    joint elbow revolute { child = upper; }
}
servo motor like rigid_gearbox;
default run nominal {
    rates { dynamics = 1 kHz; }
    metric settle = settling_time { of = elbow.q; };
}
sweep masses of nominal { vary two.links.upper.mass = [1, 2] kg; }
run broken like nominal {
    initial {
"""


@pytest.mark.slow
def test_definitions_are_listed_in_order_also_of_a_text_that_is_not_whole(tmp_path: Path, editor: Editor) -> None:
    deck = tmp_path / "arm.ic"
    editor.open(deck, OUTLINED)
    found = editor.ask("textDocument/documentSymbol", {"textDocument": {"uri": uri(deck)}})
    assert named(found) == [
        "REACH",
        "length",
        ("two", ["upper", "elbow"]),
        "motor",
        ("nominal", ["rates", "settle"]),
        "masses",
        ("broken", ["initial"]),
    ]


@pytest.mark.release
@pytest.mark.parametrize(
    ("text", "folded"),
    [
        ("run a {\n  duration = 1 s;\n}\n", [(0, 1)]),
        ("run a {\n  rates {\n  }\n}\n", [(0, 2)]),
        ("// a\n// b\nrun a { }\n/* c\nd */\n", [(0, 1), (3, 4)]),
        ("#if A\nlet a = 1;\n#else\nlet a = 2;\n#endif\n", [(0, 1), (2, 3)]),
        ("run a {\n\n", [(0, 1)]),
        ("", []),
    ],
)
def test_blocks_comments_and_conditionals_fold(
    tmp_path: Path, editor: Editor, text: str, folded: list[tuple[int, int]]
) -> None:
    deck = tmp_path / "arm.ic"
    editor.open(deck, text)
    found = editor.ask("textDocument/foldingRange", {"textDocument": {"uri": uri(deck)}})
    assert [(each["startLine"], each["endLine"]) for each in found] == folded


BLOCKS = "// a\n#if 1\nrun b {\n    duration = 5 s;\n}\n#else\narm a { link l { }\n}\n#endif\n/* x\n */ // y\n"


@pytest.mark.parametrize(
    "text", ["run b {}", "run b { }\n", "{", "}", "run b {", "/*", "#if 1", "#else", "#endif", "\r\r"]
)
def test_what_stands_on_one_line_does_not_fold(text: str) -> None:
    assert folds(DeckText("deck", text)) == []


def test_what_folds_goes_down_whatever_is_missing() -> None:
    whole = [(each.start_line, each.end_line) for each in folds(DeckText("deck", BLOCKS))]
    assert whole == [(1, 4), (2, 3), (5, 7), (9, 10)]
    for first in range(len(BLOCKS)):
        for text in (BLOCKS[:first], BLOCKS[first:], BLOCKS[:first] + BLOCKS[first + 1 :].replace("\n", "")):
            for each in folds(DeckText("deck", text)):
                assert 0 <= each.start_line < each.end_line <= text.count("\n")
