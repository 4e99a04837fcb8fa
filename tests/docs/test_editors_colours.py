"""docs/editors: an engine that colours by TextMate grammars colours decks with ours as they are meant."""

from __future__ import annotations

import platform
import plistlib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import textmate

import ic
from ic.formatting.rows import rows
from ic.meaning.expressions.evaluate import FUNCTIONS
from ic.text.lexer import NUMBERS, Text
from met import units

pytestmark = [
    pytest.mark.oracle,
    # Oniguruma, as a TextMate engine has it: there is no wheel of it for other machines.
    *([] if platform.machine() == "x86_64" else [pytest.mark.xfail(run=False, strict=False, reason="no wheel")]),
]

DECKS = sorted((Path(ic.__file__).parent / "decks").rglob("*.ic"))


@cache
def engine() -> Any:
    from textmate_grammar.parsers.base import LanguageParser

    return LanguageParser(plistlib.loads(textmate.texts()["met.tmLanguage"]))


def coloured(text: str) -> list[tuple[tuple[int, int], str, list[str]]]:
    """Place, text and scopes, the narrowest last, of all that is not blank."""
    return [(place, piece, scopes) for place, piece, scopes in engine().parse_string(text).flatten() if piece.strip()]


def scopes(text: str) -> dict[str, str]:
    """The narrowest scope of each piece; the last one of the same text counts."""
    return {piece: found[-1].removesuffix(".met") for _, piece, found in coloured(text)}


@pytest.mark.release
@pytest.mark.parametrize("deck", DECKS, ids=lambda path: path.name)
def test_every_piece_of_a_standard_deck_has_a_scope_and_numbers_and_comments_have_theirs(deck: Path) -> None:
    text = deck.read_text(encoding="utf-8")
    found = coloured(text)
    # the engine gives the whole of a directive's line a scope, and of other blanks none
    assert all(len(each) > 1 for _, _, each in found), [piece for _, piece, each in found if len(each) < 2]
    at = {place: (piece, each[-1]) for place, piece, each in found}
    for row in rows(Text(deck.name, text)):
        for token in row.tokens:
            place = (token.place.line - 1, token.place.column - 1)
            if token.kind in NUMBERS and place in at:  # within a unit, `s^-1`, a number is none of its own
                assert at[place][1] in ("constant.numeric.met", "keyword.other.unit.met"), (place, token.text)
        if row.tail is not None:
            place = (row.whole[-1].place.line - 1, row.tail.column)
            assert at[place][1] == "comment.line.double-slash.met"


def test_what_units_are_is_coloured_as_one() -> None:
    for unit in units.ALL_UNITS:
        assert scopes(f"let a = 3 {unit};")[unit] == "keyword.other.unit"
    for unit in ("V*s/rad", "N*m/(rad/s)", "kg*m^2", "s^-1", "1/s", "rad/s^2"):
        assert scopes(f"let a = 3 {unit};")[unit] == "keyword.other.unit", unit
    assert scopes("let a = [1, 2] mm;")["mm"] == scopes("let a = 10mm;")["mm"] == "keyword.other.unit"
    assert scopes("let a = 3 * m.mass;")["m.mass"] == "variable.other"


@pytest.mark.parametrize("function", FUNCTIONS)
def test_functions_are_known_where_they_are_called(function: str) -> None:
    assert scopes(f"let a = {function}(2);")[function] == "support.function"
    assert scopes("let a = other(2);")["other"] == "entity.name.function"


@pytest.mark.parametrize(("text", "piece", "scope"), [
    ("default run nominal {", "default", "storage.modifier"),
    ("default run nominal {", "run", "storage.type"),
    ("run nominal like other {", "nominal", "entity.name.type"),
    ("run nominal like other {", "other", "entity.other.inherited-class"),
    ("sweep gains of nominal {", "of", "keyword.other"),
    ("metric m = max { of = q; }", "of", "support.type.property-name"),
    ("metric m = max { of = q; }", "max", "support.function"),
    ("joint elbow revolute { }", "elbow", "entity.name.section"),
    ("joint elbow revolute { }", "revolute", "storage.modifier.joint"),
    ("    vary gearbox.kp = [1, 2];", "vary", "keyword.control"),
    ("    vary gearbox.kp = [1, 2];", "gearbox.kp", "variable.other.property"),
    ("    exclude when a > b and c < d;", "when", "keyword.control"),
    ("    exclude when a > b and c < d;", "and", "keyword.operator.word"),
    ("    require settle < 10 s;", "require", "keyword.control"),
    ("    rates { dynamics = 1 kHz; }", "rates", "support.type.property-name"),
    ("    initial { elbow.q = 1 rad; }", "elbow.q", "variable.other.property"),
    ("    integrator = rk4;", "rk4", "support.constant"),
    ("    environment { velocity_products = off; }", "off", "constant.language"),
    ("    sample lhs(200) { a = b; }", "sample", "keyword.control"),
    ("    vary a = 0 .. 1 by 0.1;", "..", "keyword.operator"),
    ("let turn = 2 * pi;", "pi", "constant.language"),
    ("let turn = 2 * pi;", "turn", "variable.other.constant"),
    ('a = table("x.csv");', '"x.csv"', "string.quoted.double"),
    ("#include <servos/ideal.ic>  // why", "<servos/ideal.ic>", "string.quoted.other.lt-gt.include"),
    ("#include <servos/ideal.ic>  // why", "// why", "comment.line.double-slash"),
    ("#define ROD(N) link N { mass = 2 kg; }", "ROD", "entity.name.function.preprocessor"),
    ("#define ROD(N) link N { mass = 2 kg; }", "kg", "keyword.other.unit"),
    ("#if LINKS > 1", "if", "keyword.control.directive"),
    ("#error this is not built", " this is not built", "string.unquoted"),
    ("/* one\n two */ let a = 1;", " two */", "comment.block"),
])  # fmt: skip
def test_words_are_coloured_by_what_they_are_where_they_stand(text: str, piece: str, scope: str) -> None:
    assert scopes(text + "\n").get(piece) == scope, scopes(text + "\n")


def test_a_directive_goes_on_over_a_backslash_and_ends_with_its_line() -> None:
    found = coloured("#define MOVE(A)  \\\n    rate(A)\nlet a = 1;\n")
    inside = [piece for _, piece, each in found if "meta.preprocessor.met" in each]
    assert "rate" in inside and "let" not in inside
