"""Text to tokens: numbers whole, places exact."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import ic
from ic.text.lexer import BAD, DECIMAL, SPACE, WHOLE, Text, Token, logical_lines


def tokens(text: str) -> list[Token]:
    return [token for line in logical_lines(Text("a.ic", text)) for token in line if token.kind != SPACE]


def texts(text: str) -> list[str]:
    return [token.text for token in tokens(text)]


@pytest.mark.parametrize(
    ("text", "pieces"),
    [
        ("0.061", ["0.061"]),
        ("1e-3", ["1e-3"]),
        ("1E-3", ["1E-3"]),
        ("1e+3 2.E5", ["1e+3", "2.E5"]),
        ("1..50", ["1", "..", "50"]),
        ("1...50", ["1", "...", "50"]),
        ("1.5..2.5", ["1.5", "..", "2.5"]),
        ("10mm", ["10", "mm"]),
        ("1e", ["1", "e"]),
        (".5", [".5"]),
        ("a.5", ["a", ".5"]),
        ("5.", ["5."]),
        ("1-2", ["1", "-", "2"]),
        ("a+=b", ["a", "+=", "b"]),
        ("a=-5", ["a", "=", "-", "5"]),
        ("2%;", ["2", "%", ";"]),
        ("a<=b==c", ["a", "<=", "b", "==", "c"]),
        ("0x1F", ["0x1F"]),
        ("a /* b */ c // d", ["a", "c"]),
        ('"a // b" c', ['"a // b"', "c"]),
        (r'"a\"b" c', [r'"a\"b"', "c"]),
        ("x_1.q", ["x_1", ".", "q"]),
        ("a\\\nb", ["ab"]),
        ("a \\  \nb\\", ["a", "b"]),
        ("1\\\n2.\\\n5 <\\\n= \\\n\\\nc", ["12.5", "<=", "c"]),
        ('"a\\\nb" /\\\n* c */ d /\\\n/ e \\\n f\ng', ['"ab"', "d", "g"]),
    ],
)
def test_text_is_cut_where_a_reader_would_cut_it(text, pieces):
    assert texts(text) == pieces


def test_a_number_is_whole_or_decimal():
    assert [token.kind for token in tokens("1 1.0 1e3 0x10")] == [WHOLE, DECIMAL, DECIMAL, WHOLE]


@pytest.mark.parametrize("text", ['"abc', "'abc", "$", "\u00b5", "/* abc", "\\ x"])
def test_what_is_no_token_is_a_token_of_kind_bad_so_that_skipped_text_may_hold_it(text):
    assert tokens(text)[0].kind == BAD


def test_a_joined_line_counts_where_it_stands() -> None:
    token, other = tokens("  re\\\n\\ \n  ach = ro\\\nd")[0], tokens("a \\\n = ro\\\nd")[2]
    assert (token.text, token.place.line, token.place.column, token.place.length) == ("re", 1, 3, 2)
    assert (other.text, other.place.line, other.place.column, other.place.length) == ("rod", 2, 4, 3)
    assert other.source.text[other.offset : other.end] == "ro\\\nd"


def test_lines_and_columns_count_characters_from_one_through_tabs_comments_and_joined_lines():
    text = '\tmass = 3 kg; /* two\nlines */ x\\\n  \u00e9 y "\u00e9\u00e9" z\n'
    places = {token.text: (token.place.line, token.place.column, token.place.length) for token in tokens(text)}
    assert places["mass"] == (1, 2, 4)
    assert places["kg"] == (1, 11, 2)
    assert places["x"] == (2, 10, 1)
    assert places["y"] == (3, 5, 1)
    assert places['"\u00e9\u00e9"'] == (3, 7, 4)
    assert places["z"] == (3, 12, 1)


@pytest.mark.slow
@given(st.text(alphabet=st.sampled_from("ab1. \t\n\"'/*\\#+-=e\u00e9{}()"), max_size=60))
def test_every_token_stands_where_it_says(text):
    lines = text.split("\n")
    for token in tokens(text):
        place = token.place
        written = "\n".join(lines[place.line - 1 :])[place.column - 1 :]
        assert re.sub(r"\\[ \t]*(\n|\Z)", "", written).startswith(token.text)


@pytest.mark.release
@given(st.text(max_size=200))
def test_any_text_is_cut_into_lines_that_end_with_a_newline_token(text):
    for line in logical_lines(Text("a.ic", text)):
        assert line[-1].text == "\n"
        assert sum(token.text == "\n" for token in line) == 1


def test_no_pattern_has_a_possessive_repeat_which_an_older_python_matches_wrongly() -> None:
    """`re` of Python 3.11.2 found no comment `/* */` by one."""
    root = Path(ic.__file__).parents[1]
    files = [file for room in ("ic", "met", "batch", "hw") for file in (root / room).rglob("*.py")]
    lines = [line for file in files for line in file.read_text(encoding="utf-8").splitlines()]
    assert len(files) > 700 and not [line for line in lines if re.search(r"[\])][*+?]\+|\(\?>", line)]
