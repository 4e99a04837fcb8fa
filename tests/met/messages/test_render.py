"""Diagnostics as shown: whole messages, exact carets, nothing that steers a terminal."""

from __future__ import annotations

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from met.diagnostic import Diagnostic, Expansion, Label, Place, error
from met.messages.message import shown_place
from met.messages.render import count_line, render, wants_colour

ARM = "\n" * 41 + "    rate = 300 Hz;\n"


def test_an_error_looks_as_the_house_style_says():
    found = error(
        "D031",
        "servo `shoulder` at 300 Hz does not divide the base rate, 1000 Hz",
        Label(Place("arm.ic", 42, 12, 6), "1000/300 = 3.33"),
        also=[Label(Place("rates.ic", 3, 5), "base rate set here")],
        help="nearest that fit: 333.333 Hz (1000/3), 250 Hz (1000/4); or a base rate of 3000 Hz",
    )
    assert (
        render([found], {"arm.ic": ARM})
        == """\
error[D031]: servo `shoulder` at 300 Hz does not divide the base rate, 1000 Hz
  --> arm.ic:42:12
   |
42 |     rate = 300 Hz;
   |            ^^^^^^ 1000/300 = 3.33
  ::: rates.ic:3:5  base rate set here
   = help: nearest that fit: 333.333 Hz (1000/3), 250 Hz (1000/4); or a base rate of 3000 Hz

1 error
"""
    )


def test_without_the_text_the_place_is_named_and_the_label_kept():
    found = error("D031", "no", Label(Place("arm.ic", 42, 12, 6), "why"), help="two\nlines")
    assert (
        render([found])
        == """\
error[D031]: no
  --> arm.ic:42:12
   = why
   = help: two
           lines

1 error
"""
    )


def test_a_diagnostic_without_a_place_is_its_message_and_help():
    assert (
        render([error("E201", "no device", help="plug it in")])
        == "error[E201]: no device\n = help: plug it in\n\n1 error\n"
    )


def test_nothing_is_rendered_for_no_diagnostics():
    assert render([]) == ""


def test_the_count_says_how_many_of_each():
    warning = Diagnostic("D017", "hm", severity="warning")
    assert count_line([error("D001", "a"), warning, error("D002", "b")]) == "2 errors, 1 warning"
    assert count_line([warning, warning]) == "2 warnings"


BODY = "#define ROD(N) link N { mass = 3 foo; }\n\n  ROD(upper kgs)\n"
USE = Place("two.ic", 3, 3, 3)


def test_what_a_macro_made_is_shown_where_the_macro_was_used_and_then_in_its_body():
    place = Place("two.ic", 1, 34, 3, (Expansion("ROD", USE),))
    assert shown_place(place) == USE
    assert (
        render([error("D028", "`foo` is not a unit", place)], {"two.ic": BODY})
        == """\
error[D028]: `foo` is not a unit
 --> two.ic:3:3
  |
3 |   ROD(upper kgs)
  |   ^^^
 ::: two.ic:1:34  written here, in macro ROD
  = note: in expansion of macro ROD, used at two.ic:3:3

1 error
"""
    )


def test_an_argument_of_a_macro_is_shown_where_it_was_written():
    place = Place("two.ic", 3, 13, 3, (Expansion("ROD", USE),))
    assert (
        render([error("D028", "`kgs` is not a unit", place)], {"two.ic": BODY})
        == """\
error[D028]: `kgs` is not a unit
 --> two.ic:3:13
  |
3 |   ROD(upper kgs)
  |             ^^^
  = note: in expansion of macro ROD, used at two.ic:3:3

1 error
"""
    )


def test_of_macros_within_macros_the_outermost_use_is_shown_and_each_is_named():
    place = Place("lib.ic", 1, 5, 1, (Expansion("INNER", Place("lib.ic", 2, 9, 5)), Expansion("OUTER", USE)))
    told = render([error("D028", "no", place)], {"two.ic": BODY})
    assert " --> two.ic:3:3\n" in told
    assert " ::: lib.ic:1:5  written here, in macro INNER\n" in told
    assert told.index("macro INNER, used at lib.ic:2:9") < told.index("macro OUTER, used at two.ic:3:3")


def test_the_includes_that_led_to_a_file_are_listed_from_the_inside():
    place = Place("c.ic", 1, 1, 1, (), (("b.ic", 7), ("a.ic", 3)))
    assert (
        render([error("D020", "no", place)], {"c.ic": "x"})
        == """\
error[D020]: no
 --> c.ic:1:1
  |
1 | x
  | ^
  = note: included from b.ic:7
  = note: included from a.ic:3

1 error
"""
    )


def test_a_long_chain_is_cut_in_the_middle():
    chain = tuple((f"f{i}.ic", i) for i in range(40))
    told = render([error("D006", "deep", Place("x.ic", 1, 1, 1, (), chain))])
    assert told.count("included from") == 8
    assert "= note: ... 32 files more ..." in told


def _lines(text: str, column: int, length: int = 1) -> tuple[str, str]:
    told = render([error("D020", "no", Place("a.ic", 1, column, length))], {"a.ic": text}).split("\n")
    return told[3][4:], told[4][4:]


@pytest.mark.parametrize(
    ("text", "column", "length", "line", "caret"),
    [
        ("\tx = 3;", 2, 1, "    x = 3;", "    ^"),
        ("ab\tx = 3;", 4, 1, "ab  x = 3;", "    ^"),
        ("a\tb", 2, 1, "a   b", " ^^^"),
        ("\u8155 = 3;", 5, 1, "\u8155 = 3;", "     ^"),
        ("\u8155\u8155 = 3;", 1, 2, "\u8155\u8155 = 3;", "^^^^"),
        ("e\u0301x", 3, 1, "e\u0301x", " ^"),
        ("mass = 3 kg", 12, 1, "mass = 3 kg", "           ^"),
        ("x", 1, 50, "x", "^"),
        ("", 1, 1, "", "^"),
    ],
)
def test_carets_stand_under_their_text_whatever_the_characters_width(text, column, length, line, caret):
    assert _lines(text, column, length) == (line.rstrip(), caret)


def test_of_a_long_line_the_part_around_the_place_is_shown():
    text = "a" * 500 + "HERE" + "b" * 500
    line, caret = _lines(text, 501, 4)
    assert len(line) <= 120
    assert line.startswith("...a") and line.endswith("b...")
    assert line[caret.index("^") : len(caret)] == "HERE"


def test_a_long_caret_ends_with_the_part_that_is_shown():
    line, caret = _lines("x" * 1000, 1, 1000)
    assert len(caret) <= len(line) <= 123


@pytest.mark.slow
@given(st.text(max_size=400).filter(lambda t: "\n" not in t), st.integers(1, 500), st.integers(1, 500))
def test_no_text_can_steer_the_terminal_or_break_the_frame(text, column, length):
    told = render([error("D020", text, Label(Place("a.ic", 1, column, length), text), help=text)], {"a.ic": text})
    assert all(c.isprintable() or c == "\n" or _combines(c) for c in told)
    assert told.count("\n") == 8


def _combines(character: str) -> bool:
    import unicodedata

    return bool(unicodedata.combining(character))


def test_colour_adds_nothing_but_colour():
    import re

    found = [error("D031", "no", Label(Place("arm.ic", 42, 12, 6), "why"), help="so")]
    coloured = render(found, {"arm.ic": ARM}, colour=True)
    assert "\x1b[1;31merror[D031]\x1b[0m" in coloured
    assert re.sub("\x1b\\[[0-9;]*m", "", coloured) == render(found, {"arm.ic": ARM})


def test_colour_is_for_terminals_and_for_those_who_did_not_decline():
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    assert wants_colour(Terminal(), {})
    assert not wants_colour(Terminal(), {"NO_COLOR": "1"})
    assert wants_colour(Terminal(), {"NO_COLOR": ""})
    assert not wants_colour(Terminal(), {"TERM": "dumb"})
    assert not wants_colour(io.StringIO(), {})
