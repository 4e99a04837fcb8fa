"""Conditions that ask for the macro of a name which the deck defines otherwise."""

from __future__ import annotations

import pytest

from ic.language import DEFINITIONS
from ic.text.naming import NAMING
from tests.ic.decktext import Desk


def test_to_ask_for_the_macro_of_a_definition_written_before_gets_a_warning(desk: Desk):
    assert (
        desk.told("let heavy = 1;\n#ifdef heavy\n#endif\n")
        == """\
warning[D036]: `heavy` is no macro, so it counts as not defined in this condition
 --> a.ic:2:8
  |
2 | #ifdef heavy
  |        ^^^^^
 ::: a.ic:1:5  this `let` is a value; a condition sees macros alone
  = help: define a macro for it, `#define NAME ...`, and ask that

1 warning
"""
    )


@pytest.mark.parametrize("condition", [
    "#ifdef x", "#ifndef x", "#if defined(x)", "#if !defined x", "#if 0\n#elifdef x", "#if 0\n#elifndef x",
    "#if 0\n#elif defined(x)", "#define ASK defined(x)\n#if ASK",
])  # fmt: skip
@pytest.mark.parametrize("before", [
    "let x = 1;", "run x { }", "run x{ }", 'use "b.ic" as x;', "use <b.ic> as x;", "unit x = 2 kg;",
    "#define LET(name) let name = 1;\nLET(x)", '#include "b.ic"',
])  # fmt: skip
def test_each_way_to_ask_and_each_definition_before_it_gets_this_warning_once(desk: Desk, condition: str, before: str):
    desk.write("let x = 1;\n", "b.ic")
    made = desk.tokens(f"{before}\n{condition}\n#endif\n#ifdef x\n#endif\n")
    assert [d.code for d in made.diagnostics] == ["D036"]


@pytest.mark.parametrize("text", [
    "#ifndef x\nlet x = 1;\n#endif", "#ifdef x\n#else\nlet x = 1;\n#endif", "#ifdef x\n#endif\nlink x { }",
    "#ifdef 1\n#endif\nlet x = 1;", "#undef x\n#define x 1\n#undef x\nrun x { }",
    '#if !defined(x)\n#include "b.ic"\n#endif',
])  # fmt: skip
def test_to_ask_before_the_definition_is_written_gets_no_warning(desk: Desk, text: str):
    desk.write("let x = 1;\n", "b.ic")
    assert "D036" not in desk.told(text + "\n")


@pytest.mark.parametrize(("text", "at"), [
    ("#ifdef x\n#endif\nlet x = 1;", "1:8"),
    ("#ifdef y\n#ifdef x\n#endif\n#endif\n#ifdef x\n#else\n#endif\nlet x = 1;", "5:8"),
    ("#undef x\nlet x = 1;", "1:8"), ("let x = 1;\n#undef x", "2:8"),
])  # fmt: skip
def test_a_value_is_no_macro_wherever_it_is_written(desk: Desk, text: str, at: str):
    told = desk.told(text + "\n")
    assert told.startswith("warning[D036]: `x` is no macro, so ") and f"--> a.ic:{at}\n" in told and "1 warning" in told


@pytest.mark.parametrize(("looped", "made", "others"), [
    ("let w{i} = i;", "w1", "w v1 w1.x"), ("link w{i + 1}_b { }", "w2_b", "w2 w_b"), ("joint w{i}{j} { }", "w12", "w"),
    ("let wrong = {i};", "wrong", "wrong1"), ("servo w{m = 1;}", "w", "wm w1"),
])  # fmt: skip
def test_a_name_that_a_loop_makes_is_no_macro_either(desk: Desk, looped: str, made: str, others: str):
    asked = [f"#ifdef {name}\n#endif" for name in (*others.split(), made)]
    found = desk.tokens("\n".join((f"for i in 1 .. 2 {{ {looped} }}", *asked)) + "\n").diagnostics
    assert [each.message.split("`")[1] for each in found if each.code == "D036"] == [made]


def test_a_used_deck_is_named_as_one(desk: Desk):
    assert "this is the name of a used deck; a condition" in desk.told('use "b.ic" as x;\n#ifdef x\n#endif\n')


def test_the_words_of_definitions_that_a_condition_knows_are_those_of_the_language():
    assert {*DEFINITIONS, "let", "param", "link", "joint", "loop", "unit", "as"} == set(NAMING)
