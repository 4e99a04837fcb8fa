"""Every message about text and grammar, whole: the sentence, its place, other places, remedies, and how it got there.

`text.txt`, `grammar.txt`, `loops.txt` and `editions.txt` hold a deck with a mistake after each line `=== ...`, files
that it includes after lines `-- name`, and what the user is shown after a line `>>>`.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.ic.decktext import Desk

HERE = Path(__file__).parent
ROOT = HERE.parents[2]


def cases(name: str) -> dict[str, tuple[str, dict[str, str], str]]:
    """Each case's deck, the files that it includes, and the message."""
    found = {}
    parts = re.split(r"^=== (.*)\n", (HERE / name).read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    for title, body in zip(parts[::2], parts[1::2], strict=True):
        text, said = re.split(r"^>>>\n", body, flags=re.MULTILINE)
        deck, *files = re.split(r"^-- (.*)\n", text, flags=re.MULTILINE)
        found[title] = (deck, dict(zip(files[::2], files[1::2], strict=True)), said)
    return found


TEXT, GRAMMAR, LOOPS, EDITIONS = (cases(f"{name}.txt") for name in ("text", "grammar", "loops", "editions"))
ALL = {**TEXT, **GRAMMAR, **LOOPS, **EDITIONS}


@pytest.mark.parametrize("title", ALL)
def test_a_mistake_is_this_message(desk: Desk, title: str) -> None:
    deck, others, said = ALL[title]
    assert desk.told(deck, (), others) == said


@pytest.mark.slow
@pytest.mark.parametrize("title", [title for title in ALL if "include" not in title])
def test_in_an_included_file_it_is_the_same_message_with_the_includes_that_led_there(desk: Desk, title: str) -> None:
    deck, others, said = ALL[title]
    told = desk.told('\n#include "b.ic"\n', (), {**others, "b.ic": '#include "c.ic"\n', "c.ic": deck})
    chain = "= note: included from b.ic:1\n{0} = note: included from a.ic:2"
    expected = []
    for message in re.sub(r"\ba\.ic", "c.ic", said).split("\n\n")[:-1]:
        gutter = re.match(r" *", message.split("\n")[1])[0]  # type: ignore[index]
        expected.append(f"{message}\n{gutter} {chain.format(gutter)}")
    assert told == "\n\n".join([*expected, said.split("\n\n")[-1]])


ONE_LINE = [title for title, (deck, _, _) in GRAMMAR.items() if deck.count("\n") == 1 and len(deck) < 80]


@pytest.mark.parametrize("title", ONE_LINE)
def test_in_a_macro_the_message_is_at_its_use_and_shows_where_it_was_written(desk: Desk, title: str) -> None:
    deck, _, said = GRAMMAR[title]
    told = desk.told(f"#define LINE {deck.strip()}\n  LINE\n").split("\n")
    first, at = said.split("\n")[:2]
    column = int(at.rsplit(":", 1)[1]) + len("#define LINE ")
    assert told[:5] == [first, " --> a.ic:2:3", "  |", "2 |   LINE", "  |   ^^^^"]
    assert told[5] == f" ::: a.ic:1:{column}  written here, in macro LINE"
    assert "  = note: in expansion of macro LINE, used at a.ic:2:3" in told


# sizes

LONG = {
    "a condition of many tokens": ("#if " + "1 + " * 1100 + "1\n#endif", "a condition has at most 2000 tokens", "1:2"),
    "a long body": ("#define LONG " + "x " * 2100, "the body of macro `LONG` has more than 4096 tokens", "1:9"),
    "a long line": ("x" * 200_001, "a line has at most 200000 characters", "1:1"),
    "a long joined line": ("x = 1;\n" + "x \\\n" * 100_001, "a line has at most 200000 characters", "2:1"),
    "many tokens": ("x\n" * 500_001, "more than 500000 tokens", "250001:1"),
    "long arguments": (
        "#define FN(X) X\nFN(" + "1 " * 20_001 + ")", "a call of macro `FN` has more than 20000 tokens", "2:1"
    ),
    "deep conditions": ("#if 1\n" * 101, "`#if` goes deeper than 100", "101:2"),
    "many conditions": ("#if 1\n#endif\n" * 10_001, "more than 10000 conditions", "20001:2"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("title", LONG)
def test_what_is_too_large_is_told_where_it_becomes_so(desk: Desk, title: str) -> None:
    text, said, place = LONG[title]
    lines = desk.told(text).split("\n")
    assert lines[0] == f"error[D018]: {said}"
    assert lines[1].strip() == f"--> a.ic:{place}"


def test_many_includes_are_told_at_the_one_that_is_too_many(desk: Desk) -> None:
    assert (
        desk.told("\n" + '#include "b.ic"\n' * 2_001, (), {"b.ic": ""})
        == """\
error[D018]: more than 2000 files are included
    --> a.ic:2002:10
     |
2002 | #include "b.ic"
     |          ^^^^^^

1 error
"""
    )


def test_after_thirty_errors_the_rest_is_not_read(desk: Desk) -> None:
    lines = desk.told("x = $;\n" * 100).split("\n")
    assert [line for line in lines if line.startswith("error")] == [
        *["error[D004]: `$` does not belong in a deck"] * 30,
        "error[D018]: more than 30 errors: the rest of the deck was not read",
    ]
    assert lines[-2] == "31 errors"


def test_a_long_string_is_told_with_the_part_of_its_line_that_fits(desk: Desk) -> None:
    told = desk.told('x = "' + "a" * 4100 + '";').split("\n")
    assert told[0] == "error[D020]: a string has at most 4096 characters"
    assert told[3] == "1 | x = " + '"' + "a" * 109 + "..."


# nothing is left out

# of files: text/test_files.py; of -D: text/test_preprocess.py; of --set: sweeps/test_set.py
RAISED_ELSEWHERE = {"D001", "D002", "D037", "D231", "D232"}


def test_every_code_of_text_and_grammar_has_a_whole_message_here() -> None:
    codes = set()
    raising = {*ROOT.glob("ic/text/*.py"), *ROOT.glob("ic/grammar/*.py")}
    for path in raising - {ROOT / "ic/text/complaints.py"}:  # which names codes that the rest of `ic` raises
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and re.fullmatch(r"D\d{3}", node.value):
                codes.add(node.value)
    shown = {code for _, _, said in ALL.values() for code in re.findall(r"^(?:error|warning)\[(D\d{3})\]", said, re.M)}
    assert codes - shown == RAISED_ELSEWHERE
