"""The preprocessor: what a C programmer expects, where pcpp would surprise, and what a hostile deck gets."""

from __future__ import annotations

import gc
import os
from pathlib import Path
from types import TracebackType

import pytest

from ic.text.preprocess import preprocess
from tests.ic.decktext import Desk

# numbers, units and macros


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("0.061 N*m/A", "0.061 N * m / A"),
        ("#define E 9\n1E-3 E", "1E-3 9"),
        ("#define AX 1\nAX..AX", "1 .. 1"),
        ("#define FN(x) x\nFN(10mm) FN(.5)", "10 mm .5"),
        ("#define FN(x, y) [y, x]\nFN((1, 2), 3)", "[ 3 , ( 1 , 2 ) ]"),
        ("#define FN() 1\nFN() FN", "1 FN"),
        ("#define FN(x) x\n FN\n (\n 1\n )", "1"),
        ("#define S(x) #x\nS(a  +  b)", '"a + b"'),
        ("#define JN(a, b) a##b\nJN(up, per) JN(, x) JN(x, ) JN(,)", "upper x x"),
        ("#define JN(a,b) (a##b)\nJN(,x)", "( x )"),
        ("#define AB a ## b\nAB", "ab"),
        ("#define VN(...) [__VA_ARGS__]\nVN(1, 2) VN()", "[ 1 , 2 ] [ ]"),
        ("#define VN(x, ...) x(__VA_ARGS__)\nVN(f, 1, 2)", "f ( 1 , 2 )"),
        ("#define AX B\n#define B AX\nAX B", "AX B"),
        ("#define f(x) x f\nf(1)(2)", "1 f ( 2 )"),
        ("#define LONG 1 \\\n  + 2\nLONG", "1 + 2"),
        ("??=define X", "? ? = define X"),
        ("#define X 1\n#undef X\nX", "X"),
        ("#define X 1\n#define X   1 // the same\nX", "1"),
        ("__LINE__\n__LINE__ __FILE__", '1 2 "a.ic"'),
        ("#ifdef __DATE__\nclock\n#endif\n#ifdef __PCPP__\npcpp\n#endif\nend", "end"),
    ],
)
def test_macros_do_what_a_c_programmer_expects(desk: Desk, text: str, made: str):
    assert desk.texts(text) == made


@pytest.mark.parametrize(
    ("condition", "truth"),
    [
        ("1", True), ("0", False), ("!0", True), ("X == 3", True), ("defined(X) && !defined Y", True), ("Y", False),
        ("(1 + 2) * 3 == 9", True), ("-7 / 2 == -3", True), ("1 << 4 == 16", True), ("0x10 == 16", True),
        ("010 == 8", True),
        ("'a' == 97", True), ("1 ? 0 : 1", False), ("0 && 1 / 0", False), ("FN(2) == 4", True),
    ],
)  # fmt: skip
def test_if_computes_with_whole_numbers_as_c_does(desk: Desk, condition: str, truth: bool):
    text = f"#define X 3\n#define FN(x) x * 2\n#if {condition}\nyes\n#else\nno\n#endif"
    assert desk.texts(text) == ("yes" if truth else "no")


def test_of_several_elifs_the_first_true_one_counts_and_the_rest_is_not_even_read(desk: Desk):
    text = "#if 0\n' \" $ #foo\n#elif 1\nb\n#elif 1 / 0\nc\n#else\nd\n#endif\n"
    assert desk.texts(text) == "b"
    assert desk.texts("#if 0\n#if 1\na\n#else\nb\n#endif\n#define\n#include\n#pragma\n#elif 0\n#else\nc\n#endif") == "c"


@pytest.mark.parametrize("name", ["x", "upper"])
def test_defines_from_the_command_line(desk: Desk, name: str):
    assert desk.texts("SIZE FLAG", ["SIZE=" + name, "FLAG"]) == f"{name} 1"


def test_a_token_knows_where_it_was_written_and_every_macro_it_came_through(desk: Desk):
    text = "#define INNER(y) y + 1\n#define OUTER(x) INNER(x) x\n  OUTER(a)"
    came = [
        (token.text, str(token.place), [(e.macro, str(e.use)) for e in token.place.expansions])
        for token in desk.tokens(text).tokens[:-1]
    ]
    inner, outer = ("INNER", "a.ic:2:18"), ("OUTER", "a.ic:3:3")
    assert came == [
        ("a", "a.ic:3:9", [inner, outer]),
        ("+", "a.ic:1:20", [inner, outer]),
        ("1", "a.ic:1:22", [inner, outer]),
        ("a", "a.ic:3:9", [outer]),
    ]


def test_a_token_of_an_included_file_knows_the_includes_that_led_there(desk: Desk):
    desk.write("\ny", "sub/c.ic")
    desk.write('#include "c.ic"', "sub/b.ic")
    token = desk.tokens('\n#include "sub/b.ic"\n').tokens[0]
    assert str(token.place) == "sub/c.ic:2:1"
    assert token.place.included == (("sub/b.ic", 1), ("a.ic", 2))


# files


def test_a_quoted_include_looks_beside_the_including_file_and_then_where_all_look(desk: Desk, monkeypatch):
    for directory in ("sub", "given", "env", "library"):
        desk.write(f"from_{directory}", f"{directory}/x.ic")
    desk.write("only_given", "given/y.ic")
    desk.write("env_not_library", "env/z.ic")
    desk.write("library_z", "library/z.ic")
    desk.write("last", "library/w.ic")
    desk.write('#include "x.ic"\n#include <x.ic>\n#include "y.ic"\n#include <z.ic>\n#include "w.ic"', "sub/b.ic")
    monkeypatch.setenv("MET_DECK_PATH", os.pathsep.join(["env", "nowhere"]))
    made = desk.tokens('#include "sub/b.ic"', ["given"])
    assert [t.text for t in made.tokens[:-1]] == ["from_sub", "from_given", "only_given", "env_not_library", "last"]
    assert [s.name for s in made.sources] == [
        "a.ic",
        "sub/b.ic",
        "sub/x.ic",
        "given/x.ic",
        "given/y.ic",
        "env/z.ic",
        "<w.ic>",
    ]


def test_an_angled_include_does_not_look_beside_the_including_file(desk: Desk):
    desk.write("beside", "b.ic")
    assert "cannot find <b.ic>" in desk.told("#include <b.ic>\nx = 1;")


def test_a_library_file_finds_its_neighbours_and_is_named_without_the_place_of_installation(desk: Desk):
    desk.write('#include "b.ic"', "library/servos/a.ic")
    desk.write("ok", "library/servos/b.ic")
    made = desk.tokens("#include <servos/a.ic>")
    assert [s.name for s in made.sources] == ["a.ic", "<servos/a.ic>", "<servos/b.ic>"]


def test_a_deck_that_is_no_file_is_looked_for_in_the_library(desk: Desk):
    from ic.text.preprocess import preprocess

    desk.write("found", "library/demo.ic")
    made = preprocess("demo.ic", library=desk.library)
    assert [t.text for t in made.tokens[:-1]] == ["found"]


def test_pragma_once_reads_a_file_once_by_whatever_name(desk: Desk):
    desk.write("#pragma once\nx", "sub/b.ic")
    assert desk.texts('#include "sub/b.ic"\n#include "sub/../sub/b.ic"') == "x"


def test_an_include_may_be_named_by_a_macro_and_may_hold_two_slashes(desk: Desk):
    desk.write("x", "sub/b.ic")
    desk.write("y", "library/c.ic")
    assert (
        desk.texts(
            '#define B "sub/b.ic"\n#define C <c.ic>\n#include B\n#include C\n#include "sub//b.ic"\n#include <.//c.ic>'
        )
        == "x y x y"
    )


def test_an_include_guard_works(desk: Desk):
    desk.write('#ifndef B\n#define B\n#include "b.ic"\nx\n#endif', "b.ic")
    assert desk.texts('#include "b.ic"\n#include "b.ic"') == "x"


def test_byte_order_mark_and_foreign_line_ends_are_forgiven(desk: Desk):
    made = desk.tokens(b"\xef\xbb\xbfa\r\nb\rc\xc3".replace(b"\xc3", b""))
    assert [(t.text, t.place.line, t.place.column) for t in made.tokens[:-1]] == [("a", 1, 1), ("b", 2, 1), ("c", 3, 1)]


# messages, whole


def test_a_missing_include_says_where_it_looked_and_what_there_is(desk: Desk):
    told = desk.told(
        '#include "sub/b.ic"\n',
        ["extra"],
        {"sub/b.ic": "\n#include <servos/rigid_gearbx.ic>  // table 1\n", "library/servos/rigid_gearbox.ic": ""},
    )
    assert (
        told
        == """\
error[D005]: cannot find <servos/rigid_gearbx.ic>
 --> sub/b.ic:2:10
  |
2 | #include <servos/rigid_gearbx.ic>  // table 1
  |          ^^^^^^^^^^^^^^^^^^^^^^^^
  = help: did you mean `servos/rigid_gearbox.ic`?
  = help: looked in `extra` (there is no such folder), the standard library
  = note: included from a.ic:1

1 error
"""
    )


@pytest.mark.parametrize("body", [
    "2 m", "2 N*m", "2 N^2/(s*m)", "2 N^-1*m", "15 1/m", "(1 + X) m", "[X] m", "X m", "TWO m", "9 (m/s)", "2 m ## X",
])  # fmt: skip
def test_a_parameter_may_not_bear_the_name_of_a_unit_that_its_body_may_have(desk: Desk, body: str):
    made = desk.tokens(f"#define TWO 2\n#define ROD(X, m) {body}\n")
    assert [d.code for d in made.diagnostics] == ["D011"]


@pytest.mark.parametrize(("body", "made"), [
    ("link N { mass = m; }", "link 3 { mass = 4 ; }"), ("m", "4"), ("N*m", "3 * 4"), ("2 - m", "2 - 4"),
    ("2*(N + 1)*m", "2 * ( 3 + 1 ) * 4"), ("2 * m", "2 * 4"), ("f(m, N)", "f ( 4 , 3 )"),
    ("link m revolute", "link 4 revolute"),
    ("#m", '"4"'), ("x ## m", "x4"), ("N.q", "3 . q"), ("2^m", "2 ^ 4"), ("rod(1)*m", "rod ( 1 ) * 4"),
])  # fmt: skip
def test_elsewhere_a_parameter_may_be_called_like_a_unit(desk: Desk, body: str, made: str):
    seen = desk.tokens(f"#define ROD(N, m) {body}\nROD(3, 4)\n")
    assert (" ".join(token.text for token in seen.tokens[:-1]), seen.diagnostics) == (made, ())


def test_a_macro_that_is_a_quantity_gets_a_warning_that_proposes_let(desk: Desk):
    assert (
        desk.told("#define LENGTH 2.0 m\nx = LENGTH;\n")
        == """\
warning[D017]: macro `LENGTH` is a quantity
 --> a.ic:1:9
  |
1 | #define LENGTH 2.0 m
  |         ^^^^^^
  = help: write `let LENGTH = 2.0 m;`: a macro is put in as text, so `LENGTH^2` would be `2.0 m^2`

1 warning
"""
    )
    assert desk.told("#define COUNT 2\n#define AREA (2.0 m)\n#define ROD 2 m; x = 3 kg\nx = COUNT;\n") == ""


def test_two_tokens_that_a_macro_without_arguments_does_not_join_are_an_error(desk: Desk):
    assert (
        desk.told("#define PART 5 ## mm\nx = PART;\n")
        == """\
error[D019]: `##` makes `5mm`, which is not one token
 --> a.ic:2:5
  |
2 | x = PART;
  |     ^^^^
 ::: a.ic:1:9  `PART` is defined here
  = help: what it joins must be one name, one number or one sign

1 error
"""
    )
    assert [token.text for token in desk.tokens("#define PART a ## b ## 1\nPART").tokens[:-1]] == ["ab1"]


@pytest.mark.parametrize("text", [
    "#ifdef LINK\n#elifndef ROD\n#endif", "#if defined(LINK) && LINK > 1\n#endif", "#if 1 || LINK\n#endif",
    "#if 0 && LINK\n#endif", "#if 0\n#if LINK\n#endif\n#endif", "#define LINK 0\n#if LINK\n#endif",
])  # fmt: skip
def test_to_ask_whether_a_macro_is_defined_gets_no_warning(desk: Desk, text: str):
    assert desk.told(text + "\n") == ""


def test_a_macro_on_the_command_line_that_nothing_asks_for_gets_a_warning(desk: Desk):
    asked = "#ifdef LINKS\n#endif\n#if RODS > 1 && defined(BARS)\n#endif\nlet mass = MASS * 1 kg;\n"
    made = desk.tokens(asked, defines=["LINKS", "RODS=2", "BARS", "MASS=3", "LINK=2", "mas=1"])
    assert [(d.severity, d.code, d.message, d.help) for d in made.diagnostics] == [
        (
            "warning",
            "D037",
            "`-D LINK` has no effect: nothing in the deck asks for a macro `LINK`",
            ("did you mean `LINKS`?",),
        ),
        (
            "warning",
            "D037",
            "`-D mas` has no effect: nothing in the deck asks for a macro `mas`",
            ("did you mean `MASS`?", "a `let` is set by `--set 'mass=VALUE'`"),
        ),
    ]


@pytest.mark.parametrize("mark", ["\u202e", "\u2066", "\u200b", "\u2028", "\U000e0041", "\ufeff"])
@pytest.mark.parametrize("text", ["x // {}", "x /* {} */", 'x = "{}";', "x {} y", "#if 0\n{}\n#endif", "#define X {}"])
def test_a_character_that_is_not_seen_is_an_error_wherever_it_stands(desk: Desk, text: str, mark: str):
    made = desk.tokens(text.format(mark))
    assert [(d.code, d.severity) for d in made.diagnostics] == [("D038", "error")]


def test_a_character_that_some_languages_write_with_is_a_warning_in_a_comment(desk: Desk):
    assert [(d.code, d.severity) for d in desk.tokens("// a\u200db\n").diagnostics] == [("D038", "warning")]
    both = desk.tokens("// a\u200db\u202e\n").diagnostics
    assert sorted((d.code, d.severity) for d in both) == [("D038", "error"), ("D038", "warning")]


def test_a_circular_include_is_told_as_the_circle_it_is(desk: Desk):
    assert (
        desk.told('#include "b.ic"\n', (), {"b.ic": '// b\n  #include "c.ic"\n', "c.ic": '#include "b.ic"\n'})
        == """\
error[D006]: circular include: b.ic -> c.ic -> b.ic
 --> c.ic:1:10
  |
1 | #include "b.ic"
  |          ^^^^^^
  = help: `#pragma once` at the head of a file lets it be read only once
  = note: included from b.ic:2
  = note: included from a.ic:1

1 error
"""
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ("#define", ["D007:1"]),
        ("#ifndef X\n#define\n#endif", ["D007:2"]),
        ("#define 3 x", ["D007:1"]),
        ("#define AX(", ["D007:1"]),
        ("#define AX(x x) x", ["D007:1"]),
        ("#define AX(x, x) x", ["D007:1"]),
        ("#define AX(x,) x", ["D007:1"]),
        ("#define AX-1", ["D007:1"]),
        ("#define defined 1", ["D007:1"]),
        ("#define __DATE__ 1", ["D007:1"]),
        ("#define AX ## b", ["D019:1"]),
        ("#define AX b ##", ["D019:1"]),
        ("#define JN(a, b) a ## b\nx = JN(3, [);", ["D019:2"]),
        ("#undef", ["D007:1"]),
        ("#undef 3", ["D007:1"]),
        ("#ifdef\n#endif", ["D007:1"]),
        ("#ifndef\n#endif", ["D007:1"]),
        ("#if\n#endif", ["D009:1"]),
        ("#if !\n#endif", ["D009:1"]),
        ("#if ! defined\n#endif", ["D009:1"]),
        ("#if !defined(\n#endif", ["D009:1"]),
        ("#if defined(X\n#endif", ["D009:1"]),
        ("#define X\n#if X\n#endif", ["D009:2"]),
        ("#if X = 3\n#endif", ["D009:1"]),
        ("#if 3 4\n#endif", ["D009:1"]),
        ("#if (3\n#endif", ["D009:1"]),
        ("#if f(3)\n#endif", ["D009:1"]),
        ("#if 1 / 0\n#endif", ["D009:1"]),
        ("#if 08\n#endif", ["D009:1"]),
        ("#if 1 << 999999999999\n#endif", ["D009:1"]),
        ("#if 1 << (1 << 40)\n#endif", ["D009:1"]),
        ("#if $\n#endif", ["D004:1"]),
        ("#if 1", ["D008:1"]),
        ("#if 1\n#else\n", ["D008:1"]),
        ("#if 0\n", ["D008:1"]),
        ("#else", ["D007:1"]),
        ("#elif 1", ["D007:1"]),
        ("#endif", ["D007:1"]),
        ("#if 1\n#else\n#else\n#endif", ["D007:3"]),
        ("#if 1\n#else\n#elif 1\n#endif", ["D007:3"]),
        ("#if 1\n#endif X", ["D007:2"]),
        ("#pragma", ["D007:1"]),
        ("#pragma pack", ["D007:1"]),
        ("#line 3", ["D007:1"]),
        ("#include_next <x>", ["D007:1"]),
        ("#!/usr/bin/met", ["D007:1"]),
        ("# 3", ["D007:1"]),
        ("#", []),
        ("#include", ["D005:1"]),
        ("#include x", ["D005:1"]),
        ("#include <x", ["D005:1"]),
        ("#include <>", ["D005:1"]),
        ('#include ""', ["D005:1"]),
        ('#include "x" y', ["D007:1", "D005:1"]),
        ('#include "/dev/zero"', ["D001:1"]),
        ('#include "."', ["D001:1"]),
        ("x = 1; # stray", ["D004:1"]),
        ("x = __DATE__;", ["D016:1"]),
        ("x = __TIME__;", ["D016:1"]),
        ("#if __DATE__\n#endif", ["D016:1"]),
        ("#if 0\n#elseif 1\nx = 3;\n#endif", ["D007:2"]),
        ("#if 0\n#mast\n#endif", []),
        ("/* open", ["D003:1"]),
        ("#if 0\n/* open\n#endif", ["D008:1", "D003:2"]),
        ('x = "open;\ny = 1;', ["D003:1"]),
        ("x = 'c';", ["D004:1"]),
        ("#define FN(x) x\ny = FN(1;\nz = 2;", ["D012:2"]),
        ("#define FN(x) x\ny = FN(1\n#define G\n);", ["D012:2"]),
        ("x = 3 \u00b5m;", ["D004:1"]),
        ("x = 3\u00a0kg;", ["D004:1"]),
        ("\u202e\u202dx = 3;", ["D038:1"]),
    ],
)
def test_a_broken_directive_is_one_error_on_its_line_and_nothing_else(desk: Desk, text: str, codes: list[str]):
    assert sorted(desk.codes(text)) == sorted(codes)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"x = 1;\ny = \xff;\n", "error[D002]: `a.ic` is not UTF-8: byte 0xff\n --> a.ic:2:5\n"),
        (b"x = 1;\n\x00\x00\x00", "error[D002]: `a.ic` is not text: it holds the byte 0x00\n --> a.ic:2:1\n"),
        (b"\x7fELF\x02\x01", "error[D002]: `a.ic` is not text: it holds the byte 0x7f\n --> a.ic:1:1\n"),
        *(
            ("x = 1;".encode(coded), f"error[D002]: `a.ic` is {coded[:6].upper()}, but decks are UTF-8\n")
            for coded in ("utf-16", "utf-16-le", "utf-16-be", "utf-32")
        ),
        (b"x = \x1b[31m;", "error[D002]: `a.ic` is not text: it holds the byte 0x1b\n --> a.ic:1:5\n"),
    ],
)
def test_a_file_that_is_no_text_is_refused_at_its_first_bad_byte(desk: Desk, data: bytes, said: str):
    assert desk.told(data).startswith(said)
    assert "\x1b" not in desk.told(data)


def test_a_deck_that_cannot_be_read_is_an_error_without_a_traceback(desk: Desk):
    from ic.read import read
    from met.diagnostic import Problem

    for name, why in [("nowhere.ic", "No such file"), (".", "directory"), ("x\0y", "null")]:
        with pytest.raises(Problem, match=f"D001.*{why}"):
            read(name, library=desk.library)


def test_the_clock_is_refused_with_a_reason(desk: Desk):
    assert "a deck must mean the same whenever it is read" in desk.told("x = __DATE__;")


def test_nothing_is_written_beside_the_deck_or_the_library(desk: Desk):
    import pcpp

    before = sorted(p.name for p in Path(pcpp.__file__).parent.iterdir())
    desk.tokens("#if 1\nx\n#endif")
    assert sorted(p.name for p in desk.directory.iterdir()) == ["a.ic", "library"]
    assert sorted(p.name for p in Path(pcpp.__file__).parent.iterdir()) == before


@pytest.mark.release
def test_a_deck_that_was_read_is_forgotten(tmp_path: Path) -> None:
    """An exception made once for all keeps every place it was raised at: 60 KB a deck, which the fuzzer found."""
    deck = tmp_path / "deck.ic"
    deck.write_text("#if 0\n#elseif\n#endif\n#error no\n#odd\n#define\nlet a = 1;\n", encoding="utf-8")

    def kept() -> int:
        gc.collect()
        # Not isinstance: it asks an object for its class, which other libraries' placeholders refuse.
        return sum(type(each) is TracebackType for each in gc.get_objects())

    preprocess(deck)
    before = kept()
    for _ in range(20):
        preprocess(deck)
    assert kept() == before
