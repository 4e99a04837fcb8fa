"""The parser: the tree of what was written, and for what cannot be read one message that helps."""

from __future__ import annotations

import dataclasses
import random
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ic.grammar.syntax import (
    Binary,
    Call,
    Group,
    Let,
    List,
    Name,
    Number,
    Setting,
    Statement,
    String,
    Unary,
    Unit,
    WithUnit,
    Word,
    spell,
)
from ic.read import read
from met.diagnostic import Place, Problem
from met.messages.programs import to_json
from met.messages.render import render
from tests.ic.decktext import Desk

TWO_LINK = """\
let reach = 2.0 m;
let slow  = 0.03 rad/s;
#define ROD(NAME, MASS) link NAME { mass = MASS; shape = rod(length = reach, along = x); }

arm two_link {
    ROD(upper, 40 kg)
    ROD(lower, 20 kg)
    joint shoulder revolute { parent = base;  child = upper; axis = z; }
    joint elbow    revolute { parent = upper; child = lower; axis = z; at = [reach, 0 m, 0 m]; }
}

servo gearbox like rigid_gearbox { command = rate(slow); }

default run nominal {
    arm         = two_link;
    servos      { shoulder = gearbox;  elbow = gearbox; }
    initial     { q = 0 rad;  qd = 0 rad/s; }
    environment { velocity_products = off; }
    rates       { dynamics = 25 Hz;  servos = 100 Hz;  record = 25 Hz; }
    duration    = 20 s;
    record      = [q, qd, tau, shoulder.servo.voltage];
    metric settle = settling_time { of = shoulder.qd; target = slow; band = 2 %; }
    require settle < 10 s;
}

run hybrid like nominal {
    substitute shoulder { bed = emulated(faults = typical); law = torque_balance; }
    record += [shoulder.bed.shaft_rate];
}

sweep gains of nominal {
    vary gearbox.kp = linspace(0.010, 0.040, 7) V*s/rad;
    zip  { links.upper.mass = [40, 60] kg;  links.lower.mass = [20, 30] kg; }
    exclude when gearbox.kp > 0.032 V*s/rad and links.upper.mass > 50 kg;
}

sweep spread of hybrid {
    seed = 7;
    sample lhs(200) { links.lower.mass = normal(20, 1) kg; }
    repeat 5;
}
sweep both = gains + spread;
"""


def written(node: Any) -> str:
    """A tree as a line of text, every operation in parentheses."""
    match node:
        case Word(text=text):
            return text
        case Number(text=text, unit=unit):
            return text if unit is None else f"{text}<{written(unit)}>"
        case Unit(factors=factors):
            return "*".join(f"{word.text}^{e}" if e != 1 else word.text for word, e in factors)
        case String(value=value):
            return repr(value)
        case Name(text=text):
            return text
        case List(items=items):
            return f"[{', '.join(map(written, items))}]"
        case Call(name=name, positional=positional, named=named, body=body):
            arguments = [*map(written, positional), *(f"{word.text}={written(value)}" for word, value in named)]
            return f"{name.text}({', '.join(arguments)})" + ("" if body is None else f"{{{written(body)}}}")
        case WithUnit(inner=inner, unit=unit):
            return f"{written(inner)}<{written(unit)}>"
        case Unary(operator=operator, operand=operand):
            return f"({operator} {written(operand)})"
        case Binary(operator=operator, left=left, right=right):
            return f"({written(left)} {operator} {written(right)})"
        case Let(name=name, value=value):
            return f"let {name.text} = {written(value)};"
        case Setting(words=words, path=path, operator=operator, value=value):
            return f"{_said(words)}{'.'.join(w.text for w in path)} {operator} {written(value)};"
        case Statement(words=words, value=value):
            return f"{_said(words)}: {written(value)};"
        case Group(words=words, like=like, of=of, body=body):
            base = (f"like {like.text} " if like else "") + (f"of {of.text} " if of else "")
            return f"{_said(words)}{base}{{{written(body)}}}"
        case tuple():
            return " ".join(map(written, node))
    raise AssertionError(node)


def _said(words: tuple[Word, ...]) -> str:
    return "".join(f"<{word.text}> " for word in words)


def tree(desk: Desk, text: str) -> str:
    return written(desk.read(text).entries)


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("let reach = 2.0 m;", "let reach = 2.0<m>;"),
        ("servo gearbox like rigid { }", "<servo> <gearbox> like rigid {}"),
        ("servo gearbox like rigid;", "<servo> <gearbox> like rigid {}"),
        ("default run nominal { a = 1; }", "<default> <run> <nominal> {a = 1;}"),
        ("sweep gains of lib.nominal { }", "<sweep> <gains> of lib.nominal {}"),
        ("sweep x of a like b { }", "<sweep> <x> like b of a {}"),
        ("record += [q];", "record += [q];"),
        ("metric settle = settling_time { of = q; };", "<metric> settle = settling_time(){of = q;};"),
        ("metric a = b { } metric c = d { }", "<metric> a = b(){}; <metric> c = d(){};"),
        ("vary gearbox.kp = linspace(0, 1, 7) V*s/rad;", "<vary> gearbox.kp = linspace(0, 1, 7)<V*s*rad^-1>;"),
        ("require settle < 10 s;", "<require> : (settle < 10<s>);"),
        ("require not a;", "<require> : (not a);"),
        ("require a and b;", "<require> : (a and b);"),
        ("require (a < 3) or b;", "<require> : ((a < 3) or b);"),
        ("require -a < 3;", "<require> : ((- a) < 3);"),
        ("exclude when kp > 3 V and m1.q > 5 kg;", "<exclude> <when> : ((kp > 3<V>) and (m1.q > 5<kg>));"),
        ("exclude when (kp > 3);", "<exclude> <when> : (kp > 3);"),
        ("exclude when not (kp > 3);", "<exclude> <when> : (not (kp > 3));"),
        ("remove settle;", "<remove> : settle;"),
        ("remove a.b;", "<remove> : a.b;"),
        ("sample lhs(200) { a = 1; }", "<sample> : lhs(200){a = 1;};"),
        ("repeat 5;", "<repeat> : 5;"),
        ("substitute shoulder { bed = e(f = t); }", "<substitute> <shoulder> {bed = e(f=t);}"),
        (";;a { };", "<a> {}"),
        ('file = "a\\"b.csv";', "file = 'a\"b.csv';"),
    ],
)
def test_an_entry_is_read_as_the_tree_of_what_it_says(desk: Desk, text: str, made: str):
    assert tree(desk, text) == made


@pytest.mark.parametrize(
    "text",
    [
        "require = 3;", "let = 3;", "sample.q = 1<deg>;", "at = 3;", "like = 4;", "of += [a];", "when = 3;", "not = 3;",
        "<joint> <at> <revolute> {parent = base;}", "<joint> <let> <of> {}", "<joint> <like> <revolute> {}",
        "<let> {}", "<vary> let = 3;",
        "x = [not, and.q, or];", "<default> {}", "m.q = 3<m>;", "<link> <m> {}", "parent = m;", "of = h.q;",
        "x = min(a, b);",
    ],
)  # fmt: skip
def test_keywords_and_units_may_name_what_is_no_value(desk: Desk, text: str):
    source = text.replace("<deg>", " deg").replace("<m>;", " m;").replace("<", "").replace(">", "")
    assert tree(desk, source) == text


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("a or b and not c < 1 + 2 * -3 ^ 2", "(a or (b and (not (c < (1 + (2 * (- (3 ^ 2))))))))"),
        ("1 - 2 - 3", "((1 - 2) - 3)"),
        ("2 ^ 3 ^ 2", "(2 ^ (3 ^ 2))"),
        ("8 / 4 / 2", "((8 / 4) / 2)"),
        ("2 ^ -1", "(2 ^ (- 1))"),
        ("not not a", "(not (not a))"),
        ("1/2 m", "(1 / 2<m>)"),
        ("2 m^2", "2<m^2>"),
        ("(2 m)^2", "(2<m> ^ 2)"),
        ("3 V*s/rad", "3<V*s*rad^-1>"),
        ("3 N*m/(rad*s)", "3<N*m*rad^-1*s^-1>"),
        ("3 kg*(m/s)^2", "3<kg*m^2*s^-2>"),
        ("3 kg*(m/s^-2)^-1", "3<kg*m^-1*s^-2>"),
        ("3 m^(-2)", "3<m^-2>"),
        ("15 1/s", "15<s^-1>"),
        ("15 1/s*m", "15<s^-1*m>"),
        ("15 1/(s*m)", "15<s^-1*m^-1>"),
        ("[1, 2] 1/s^2", "[1, 2]<s^-2>"),
        ("2 m * 1/2", "((2<m> * 1) / 2)"),
        ("2 m * 3", "(2<m> * 3)"),
        ("2 m * reach", "(2<m> * reach)"),
        ("2 m / (3 s)", "(2<m> / 3<s>)"),
        ("2 m / (reach + 1)", "(2<m> / (reach + 1))"),
        ("2 %", "2<%>"),
        ("[1, 2,] kg", "[1, 2]<kg>"),
        ("(1 + 2) m/s", "(1 + 2)<m*s^-1>"),
        ("f(1) rpm + 2", "(f(1)<rpm> + 2)"),
        ("[]", "[]"),
        ("[[1, 2], [3]]", "[[1, 2], [3]]"),
        ("rod(length = reach, along = x)", "rod(length=reach, along=x)"),
        ("10mm", "10<mm>"),
        ("a.b.c", "a.b.c"),
        ("1.5e-3 s", "1.5e-3<s>"),
        ("2 m < a", "(2<m> < a)"),
    ],
)
def test_operators_bind_in_their_order_and_a_unit_binds_tightest(desk: Desk, text: str, made: str):
    assert tree(desk, f"x = {text};") == f"x = {made};"


def test_the_specification_s_example_is_read_whole(desk: Desk):
    deck = desk.read(TWO_LINK)
    assert len(deck.entries) == 9
    assert "<link> <lower> {mass = 20<kg>; shape = rod(length=reach, along=x);}" in written(deck.entries)
    assert deck.warnings == ()
    assert deck.file == "a.ic"


def places(node: Any) -> list[Place]:
    if isinstance(node, Place):
        return [node]
    if dataclasses.is_dataclass(node):
        return [p for f in dataclasses.fields(node) for p in places(getattr(node, f.name))]
    return [p for n in node for p in places(n)] if isinstance(node, tuple) else []


def test_each_node_s_place_is_the_text_it_was_read_from(desk: Desk):
    deck = desk.read("vary a.b =  (1 +\t2) * 30 V*s/rad;\nx = rod(length = 2 m);")
    lines = deck.sources[0].text.split("\n")
    seen = {lines[p.line - 1][p.column - 1 : p.column - 1 + p.length] for p in places(deck.entries)}
    assert {
        "vary",
        "a",
        "vary a.b",
        "30 V*s/rad",
        "V*s/rad",
        "V",
        "*",
        "+",
        "rod(length = 2 m)",
        "rod",
        "length",
        "2 m",
    } <= seen


# messages, whole


def test_a_mistake_in_a_macro_is_shown_where_it_is_used_and_told_once(desk: Desk):
    macro = "#define ROD(NAME, MASS) link NAME { mass = MASS; size = 3 foo; }\n"
    text = macro + "arm a {\n  ROD(upper, 40 kgs)\n  ROD(lower, 2 kg)\n}\n"
    told = desk.told(text)
    assert told.count("error[") == 2
    assert told.startswith("""\
error[D028]: `foo` is not a unit
 --> a.ic:3:3
  |
3 |   ROD(upper, 40 kgs)
  |   ^^^
 ::: a.ic:1:59  written here, in macro ROD
  = help: the units: m, km,""")
    assert told.endswith("""\
  = note: in expansion of macro ROD, used at a.ic:3:3

error[D028]: `kgs` is not a unit
 --> a.ic:3:17
  |
3 |   ROD(upper, 40 kgs)
  |                 ^^^
  = help: did you mean `kg`?
  = note: in expansion of macro ROD, used at a.ic:3:3

2 errors
""")


@pytest.mark.parametrize(
    ("text", "line", "help"),
    [
        ("require q = 3;", "error[D023]: `=` sets a value", "a requirement is a limit: write `<=`"),
        ("exclude when a > 1 and b = 3;", "error[D020]: expected `;` or an operator, found `=`", "write `==`"),
        ("x == 3;", "error[D023]: `==` compares", "to set a value, write `=`"),
        ("x: 3;", "error[D020]: expected `=`, found `:`", "a deck writes `name = value;`"),
        ("x -= 3;", "error[D023]: there is no `-=`", "`+=` appends"),
        ("x = 3,\ny = 4;", "error[D024]: `,` at the end of an entry", "write `;`"),
        ("x = f(a = 1; b = 2);", "error[D024]: `;` between items", "write `,`"),
        ("x = [1 2];", "error[D024]: a `,` is missing before `2`", ""),
        ("x = 3, y = 4;", "error[D024]: `,` at the end of an entry", "write `;`"),
        ("x = 3, 4;", "error[D020]: expected `;` or an operator, found `,`", "a list stands in brackets"),
        ("x = 0,325 m;", "error[D020]: expected `;` or an operator, found `,`", "has a decimal point: `0.325`\n"),
        ("x = 1,5 m;", "error[D020]: expected `;` or an operator, found `,`", "has a decimal point: `1.5`\n"),
        ("x = 1,000 m;", "error[D020]: expected `;` or an operator, found `,`",
         "a number has a decimal point: `1.000`; thousands have no mark: `1000`\n"),
        ("x = kg 3;", "error[D025]: a unit follows its number", "write `3 kg`"),
        ("x = 2 * m;", "error[D025]: `m` is the unit metre, and stands here without a number", "write `2 m`"),
        ("x = a * m;", "error[D025]: `m` is the unit metre, and stands here without a number", "write `1 m`"),
        ("x = slow rad/s;", "error[D030]: `slow` is a name, and only a number takes a unit", "`(slow) rad/s`"),
        ("x = NaN V;", "error[D030]: `NaN` is a name, and only a number takes a unit", "every number of a deck is"),
        ("x = 3 N m;", "error[D030]: units are multiplied with `*`", "write `N*m`"),
        ("x = 3 Nm;", "error[D028]: `Nm` is not a unit", "did you mean `N*m`?"),
        ("x = 3 m/sec;", "error[D028]: `sec` is not a unit", "did you mean `s`?"),
        ("x = 3 m/s2;", "error[D028]: `s2` is not a unit", "write `s^2`"),
        ("x = 3 m2;", "error[D028]: `m2` is not a unit", "did you mean `m^2`?"),
        ("x = 3 m^n;", "error[D030]: a unit's exponent is a whole number from -9 to 9", "(... m)^n"),
        ("x = 3 m^0.5;", "error[D030]: a unit's exponent is a whole number from -9 to 9", ""),
        ("x = 3 m^99;", "error[D030]: a unit's exponent is a whole number from -9 to 9", ""),
        ("x = 1e999;", "error[D027]: `1e999` is too large for a number", "1.8e308"),
        ("x = 1e-999;", "error[D027]: `1e-999` is too small for a number", ""),
        ("x = 1.2.3;", "error[D027]: `1.2.3` is not a number", ""),
        ("x = 0x10;", "error[D027]: `0x10` is hexadecimal", "write `16`"),
        (f"x = {'9' * 65};", "error[D027]: a number has at most 64 characters", ""),
        ("x = a < b < c;", "error[D033]: comparisons do not chain", "write `a < b and b < c`"),
        ("require a < b < c;", "error[D033]: comparisons do not chain", "of requirements write two"),
        ("x = f(a = 1, 2);", "error[D034]: an argument without a name", "give it a name, too"),
        ("x = a && b;", "error[D020]: `&&` is not an operator here", "write `and`"),
        ("x = !a;", "error[D020]: `!` is not an operator here", "write `not`"),
        ("x = 2 ** 3;", "error[D020]: `**` is not an operator", "a power is written `a^b`"),
        ("x = 1 .. 5;", "error[D220]: a range has no step", "`first .. last by step`"),
        ("x = [1 .. 5];", "error[D220]: a range has no step", "`first .. last by step`"),
        ("x = 1 + 2 ..;", "error[D020]: expected a value, found `;`", "the value is missing"),
        ("x = a ? b : c;", "error[D020]: expected `;` or an operator, found `?`", "`#if`"),
        ("x = ;", "error[D020]: expected a value, found `;`", "the value is missing"),
        ("x =\ny = 3;", "error[D020]: expected a value\n --> a.ic:1:4", ""),
        ("x;", "error[D020]: expected `=`, `{` or a value after `x`", ""),
        ("servo x like a, b { }", "error[D032]: there is one base only", ""),
        ("servo x like a like b { }", "error[D032]: `like` is there twice", ""),
        ("a.b { }", "error[D020]: a block's name has no points", "write `a { b { ... } }`"),
        ("{ }", "error[D020]: expected a name before the block", ""),
        ("let a.b = 3;", "error[D020]: `let` gives a value to one name", ""),
        ("let a += 3;", "error[D023]: `let` gives a value once", "write `=`"),
        ("a. = 3;", "error[D020]: expected a name after `.`, found `=`", ""),
        ("}", "error[D022]: this `}` closes nothing", "leave it out"),
        (")", "error[D022]: this `)` closes nothing", "leave it out"),
        ("x = 3);", "error[D022]: this `)` closes nothing", "leave it out"),
        ("x = 2*pi rad / 10 mm;", "error[D030]: a unit follows a number or brackets, and `pi` is neither",
         "as in `(2*pi) rad`; a whole turn is `1 cycle`"),
        ("x = pi rad/s;", "error[D030]: a unit follows a number or brackets", "`1 cycle/s`"),
        ("x = pi m;", "error[D030]: a unit follows a number or brackets", "as in `(2*pi) m`"),
        ("servo strong like weak\n    kp = 3;\n    b { c = 4; }\n}\nlet x = 3;",
         "error[D020]: expected `{` after `weak`\n --> a.ic:1:23", "`... like BASE { ... }`"),
        ("servo strong like weak\n}", "error[D020]: expected `{` after `weak`", ""),
        ("# mast\nx = 3;", "error[D007]: `#mast` is not a directive", "a comment begins with `//`"),
        ("x = f(3\ny = 4;", "error[D022]: expected `,` or `)`, found `y`", ""),
        ("x = [3;\ny = 4;", "error[D022]: expected `,` or `]`, found `;`", ""),
        ("x = [q,\na.y = 4;", "error[D020]: expected a value\n --> a.ic:1:8", ""),
        ('x = "a\\qb";', "error[D020]: `\\q` means nothing in a string", ""),
        ("x = not_there {", "error[D022]: this `{` is not closed", ""),
        ("3 = x;", "error[D020]: expected an entry, such as `name = value;`, found `3`", ""),
    ],
)  # fmt: skip
def test_one_mistake_is_one_message_with_its_remedy(desk: Desk, text: str, line: str, help: str):
    told = desk.told(text)
    assert told.startswith(line), told
    assert help in told
    assert told.endswith("\n1 error\n"), told


@pytest.mark.parametrize(("text", "place"), [
    ("servo motor\n    kp = 3;\n}", "1:12  perhaps a `{` is missing here"),
    ("arm crane\n    link bar { mass = 2; }\n}", "1:10  perhaps a `{` is missing here"),
    ("arm a {\n    link bar mass = 2; }\n}", "2:13  perhaps a `{` is missing here"),
    ("arm a {\n    joint j revolute parent = base; }\n}", "2:21  perhaps a `{` is missing here"),
    ("servo b like a kp = 3; }", "1:15  perhaps a `{` is missing here"),
    ("run r {\n    metric m = peak of = q; }\n    record = [q];\n}", "2:20  perhaps a `{` is missing here"),
    ("run r {\n    rates dynamics = 1 kHz; }\n    record = [q];\n}", "2:29  perhaps the `{` to this one is missing"),
])  # fmt: skip
def test_a_brace_too_many_names_the_place_where_one_may_be_missing(desk: Desk, text: str, place: str):
    told = desk.told(text)
    assert told.startswith("error[D022]: this `}` closes nothing\n"), told
    assert f" ::: a.ic:{place}\n" in told
    assert told.endswith("\n1 error\n"), told


def test_several_mistakes_are_told_in_one_run_and_what_is_right_between_them_is_not(desk: Desk):
    text = """\
run a {
    x = 3 kg
    y = (1 + ;
    good { z = 4; }
    w = rod(length = 2 foo,
            along = x);
    v = [1, 2} ;
    u = 5;
}
run b { t = = 3; s = 1; }
"""
    assert desk.codes(text) == ["D021:2", "D020:3", "D028:5", "D022:7", "D022:9", "D020:10"]


def test_with_very_many_mistakes_reading_stops_and_says_so(desk: Desk):
    told = desk.told("x = ;\n" * 100)
    assert "more than 30 errors: the rest of the deck was not read" in told
    assert told.endswith("31 errors\n")


# hostile decks


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "code"),
    [
        pytest.param("a {" * 5000, "D029", id="braces"),
        pytest.param("x = " + "(" * 5000, "D029", id="parentheses"),
        pytest.param("x = " + "[" * 5000, "D029", id="brackets"),
        pytest.param("x = " + "f(" * 5000, "D029", id="calls"),
        pytest.param("x = " + "f { y = " * 5000, "D029", id="calls with bodies"),
        pytest.param("x = " + "-" * 5000 + "1;", "D029", id="minus"),
        pytest.param("x = " + "not " * 5000 + "a;", "D029", id="not"),
        pytest.param("x = " + "1 + " * 5000 + "1;", "D029", id="sum"),
        pytest.param("x = " + "1 ^ " * 5000 + "1;", "D029", id="power"),
        pytest.param("x = 3 m" + "*m" * 5000 + ";", "D030", id="unit"),
        pytest.param("x = 3 m*" + "(" * 5000 + "m" + ")" * 5000 + ";", "D029", id="unit in parentheses"),
        pytest.param("x = " + '"' + "a" * 5000 + '";', "D020", id="string"),
    ],
)
def test_what_is_too_deep_or_too_long_ends_in_a_diagnostic(desk: Desk, text: str, code: str):
    assert desk.codes(text)[0].split(":")[0] == code


def test_a_tree_is_never_so_deep_that_walking_it_would_fail(desk: Desk):
    # just below every limit: brackets, and operators on both sides of each
    text = "1" + " + 1" * 20
    for _ in range(30):
        text = f"[{text}]" + " + 1"
    deck = desk.read(f"x = {text};")
    assert written(deck.entries)
    hash(deck.entries)
    with pytest.raises(Problem):
        inner = "1"
        for _ in range(30):
            inner = f"[{inner}" + " + 1" * 90 + "]" + " + 1" * 90
        desk.read(f"x = {inner};")


PIECES = [
    "{", "}", "(", ")", "[", "]", ";", ",", "=", "+=", "==", "<", "+", "-", "*", "/", "^", "%", ".", "..",
    "not ", "and ", "or ", " let ", " like ", " of ", " when ", " m ", " rad ", " kg", " x", " y ", " 3", "1e3", ".5",
    '"s"', "'", '"', "/*", "*/", "//", "\n", "#define M(a) a M\n", "#define O M(M)\n", "\n#if 1\n", "\n#if M(1)\n",
    "\n#else\n", "\n#elif O\n", "\n#endif\n", "M(", " O ", "#", "##", "\\\n", "\u00b5", "\x00", "\n#include",
    "\n#include \"a.ic\"\n", "\n#pragma once\n", "$", "?", ":", "!", "&&", "1e999", "\n#undef M\n",
]  # fmt: skip


def _survives(desk: Desk, text: str | bytes) -> None:
    try:
        deck = desk.read(text)
        found, sources = deck.warnings, {s.name: s.text for s in deck.sources}
    except Problem as problem:
        found, sources = problem.diagnostics, dict(problem.sources)
        assert any(d.severity == "error" for d in found)
    told = render(found, sources)
    assert all(c.isprintable() or c == "\n" for c in told)
    to_json(found, sources)


FUZZ = settings(
    max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture], derandomize=True
)


@pytest.mark.release
@FUZZ
@given(st.lists(st.sampled_from(PIECES), max_size=60).map("".join))
def test_no_heap_of_pieces_raises_anything_but_a_problem(desk: Desk, text: str):
    _survives(desk, text)


@pytest.mark.slow
@FUZZ
@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_but_a_problem(desk: Desk, data: bytes):
    _survives(desk, data)


@pytest.mark.release
@pytest.mark.parametrize("seed", range(300))
def test_no_mutilated_deck_raises_anything_but_a_problem(desk: Desk, seed: int):
    rng = random.Random(seed)
    text = TWO_LINK
    for _ in range(rng.randint(1, 6)):
        at, to = sorted(rng.randrange(len(text)) for _ in range(2))
        to = min(to, at + 30)
        text = text[:at] + rng.choice(["", rng.choice(PIECES), text[at:to] * 2]) + text[to:]
    _survives(desk, text)


def test_a_macro_of_the_command_line_that_takes_the_name_of_a_let_is_told_as_that(desk: Desk):
    path = desk.write("let height = 1 m;\nrun a { x = height; }\n")
    with pytest.raises(Problem) as raised:
        read(path, [], ["height=2"])
    (diagnostic,) = raised.value.diagnostics
    assert (diagnostic.code, diagnostic.message) == ("D035", "`-D height` has put `2` in the place of this name")
    assert diagnostic.at is not None and str(diagnostic.at.place) == "a.ic:1:5"
    assert diagnostic.help[0] == "-D defines a macro, as #define does; it does not set a `let`"


def test_a_macro_of_the_deck_that_takes_the_name_of_a_let_is_told_as_that(desk: Desk):
    told = desk.told("#define height 2\nlet height = 1 m;\n")
    assert told.startswith("error[D035]: the macro `height` has put `2` in the place of this name\n --> a.ic:2:5\n")
    assert "help: give one of the two another name\n" in told


def test_a_list_may_be_broken_before_a_path(desk: Desk) -> None:
    deck = desk.read("record = [q,\n    arm.servo.voltage,\n    arm.qd, b];\nlast = 3;")
    assert len(deck.entries) == 2 and spell(deck.entries[0].value) == "[q, arm.servo.voltage, arm.qd, b]"


@pytest.mark.parametrize(("written", "unit"), [
    ("9 (m/s)^2", "(m/s)^2"), ("(1 + 2) (m/s)", "(m/s)"), ("[1, 2] (m)^2/s", "(m)^2/s"),
])  # fmt: skip
def test_a_unit_may_begin_with_a_bracket(desk: Desk, written: str, unit: str):
    (entry,) = desk.read(f"let x = {written};").entries
    assert entry.value.unit.text == unit


def test_a_bracket_that_holds_no_unit_begins_none(desk: Desk):
    assert "expected `;` or an operator, found `(`" in desk.told("let x = 9 (y);")
