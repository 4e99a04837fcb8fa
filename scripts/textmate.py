"""Writes the grammar of decks for editors, docs/editors/met.tmLanguage.json, from the language's own tables.

An editor colours what stands on a line; it knows no meaning. So a word of the language is coloured where its position
fits: a unit behind a number, a key before `=` or `{`, a function before `(`. The expressions are those that Oniguruma
and Python read alike.

    .venv/bin/python scripts/textmate.py      writes them anew, after a change of the language
"""

from __future__ import annotations

import json
import plistlib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ic.grammar.declared_units import UNIT
from ic.grammar.uses import AS, USE
from ic.language import BLOCKS, DEFINITIONS
from ic.language.bodies import JOINT_KINDS
from ic.language.runs import BASE_KINDS
from ic.meaning.definitions.row_tables import CSV
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS
from ic.meaning.mechanics import dh
from ic.meaning.mechanics.matter import SHAPES
from ic.text.edition import EDITION_WORD
from ic.text.preprocess import DIRECTIVES
from met import models, units
from met.plan import BASE
from met.plan.channel import COMMAND_UNIT

SCOPE = "source.met"
FOLDER = Path(__file__).parents[1] / "docs" / "editors"
NAMES = ("met.tmLanguage.json", "met.tmLanguage")

STATEMENTS = (
    *dict.fromkeys(word for block in BLOCKS.values() for statement in block.statements for word in statement.split()),
    "remove",
    "macro",
)
"""Words that begin an entry, or stand in one, and name nothing."""

PARTS = tuple(dict.fromkeys(word for block in BLOCKS.values() for word in block.named))
"""Words that begin an entry and are followed by a name."""

_DECLARED = [entry.parameter for block in BLOCKS.values() for entry in block.entries if entry.parameter is not None]
WORDS = (BASE, "faults", *BASE_KINDS[1:], *(word for wanted in _DECLARED for word in wanted.words))
NAME = r"[A-Za-z_][A-Za-z0-9_]*"
BRACES = r"\{[A-Za-z0-9_(+-][A-Za-z0-9_ +*/%()-]*\}"
IN_LOOPS = rf"(?:[A-Za-z_]|{BRACES})(?:[A-Za-z0-9_]|{BRACES})*"
"""A name in a loop, with or without braces: `seg_{i}`."""

PATH = rf"{NAME}(?:\s*\.\s*{NAME})*"
NUMBER = r"(?<![A-Za-z0-9_.])(?:[0-9]+(?:\.(?!\.)[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"


def grammar() -> dict[str, Any]:
    """The whole grammar."""
    return {
        "name": "MET deck",
        "scopeName": SCOPE,
        "fileTypes": ["ic"],
        "uuid": "0b4f2c0a-6f0b-4d5e-9d57-5c1d2f6c8a41",
        "patterns": [{"include": "#preprocessor"}, {"include": "#code"}],
        "repository": {
            "preprocessor": _preprocessor(),
            "code": _patterns(*({"include": f"#{name}"} for name in ("comment", "string", "number", "entry", "value"))),
            "comment": _patterns(
                _match("comment.line.double-slash", r"//.*$"),
                {"name": _named("comment.block"), "begin": r"/\*", "end": r"\*/"},
            ),
            "string": {
                "name": _named("string.quoted.double"),
                "begin": '"',
                "end": r'"|$',
                "patterns": [_match("constant.character.escape", r"\\.")],
            },
            "number": _numbers(),
            "entry": _entries(),
            "value": _values(),
        },
    }


def _named(scope: str) -> str:
    return f"{scope}.met"


def _match(scope: str, expression: str) -> dict[str, Any]:
    return {"name": _named(scope), "match": expression}


def _groups(expression: str, *scopes: str) -> dict[str, Any]:
    """A pattern whose groups have these scopes, in order; an empty one has none."""
    captures = {str(i): {"name": _named(scope)} for i, scope in enumerate(scopes, start=1) if scope}
    return {"match": expression, "captures": captures}


def _patterns(*patterns: Mapping[str, Any]) -> dict[str, Any]:
    return {"patterns": list(patterns)}


def _any(words: Iterable[str]) -> str:
    """A pattern of these words, the longest match first."""
    return "(?:" + "|".join(re.escape(word) for word in sorted(set(words), key=lambda word: (-len(word), word))) + ")"


def _preprocessor() -> dict[str, Any]:
    """A directive up to the end of its line, including lines that a backslash joins to it."""
    named = ("define", "undef", "ifdef", "ifndef")
    end = r"(?<!\\)(?=\n)|(?=//|/\*)"
    keyword = {
        "1": {"name": _named("punctuation.definition.directive")},
        "2": {"name": _named("keyword.control.directive")},
    }
    shared = {"name": _named("meta.preprocessor"), "end": end}
    inside = [
        _match("constant.character.escape.line-continuation", r"\\$"),
        _match("keyword.operator.preprocessor", r"\bdefined\b|##?"),
        {"include": "#string"},
        {"include": "#number"},
        {"include": "#entry"},
        {"include": "#value"},
    ]
    return _patterns(
        {
            **shared,
            "begin": r"^\s*(#)\s*(include)\b",
            "beginCaptures": keyword,
            "patterns": [_match("string.quoted.other.lt-gt.include", r"<[^>]*>"), {"include": "#string"}],
        },
        {
            **shared,
            "begin": rf"^\s*(#)\s*({_any(named)})\s+({NAME})",
            "beginCaptures": {**keyword, "3": {"name": _named("entity.name.function.preprocessor")}},
            "patterns": inside,
        },
        {
            **shared,
            "begin": r"^\s*(#)\s*(error|warning)\b",
            "beginCaptures": keyword,
            "patterns": [_match("string.unquoted", r".+$")],
        },
        {**shared, "begin": rf"^\s*(#)\s*({_any(DIRECTIVES)})\b", "beginCaptures": keyword, "patterns": inside},
    )


def _unit() -> str:
    """A unit as written, with brackets one deep: `N*m/(rad/s)^2`."""
    letters = _any(name for name in units.ALL_UNITS if name.isalpha())
    factor = rf"(?:{letters}(?![A-Za-z0-9_])(?!\s*[.{{])(?:\s*\^\s*(?:-?[0-9]|\(\s*-?[0-9]\s*\)))?|%)"
    joined = rf"{factor}(?:\s*[*/]\s*{factor})*"
    bracket = rf"\(\s*{joined}\s*\)(?:\s*\^\s*-?[0-9])?"
    return rf"(?:1\s*/\s*)?{factor}(?:\s*[*/]\s*(?:{factor}|{bracket}))*"


def _numbers() -> dict[str, Any]:
    return _patterns(
        _groups(rf"({NUMBER})\s*({_unit()})", "constant.numeric", "keyword.other.unit"),
        _match("constant.numeric", NUMBER),
        _groups(rf"(?<=[\])])\s*({_unit()})", "keyword.other.unit"),
    )


def _entries() -> dict[str, Any]:
    """Patterns of the words that begin an entry: definitions, parts of them, statements, keys."""
    kinds = _any(DEFINITIONS)
    return _patterns(
        _groups(rf"\b(default)\s+(?={kinds}\b)", "storage.modifier"),
        _groups(rf"\b({kinds})\s+({IN_LOOPS})(?=\s+(?:like|of|from)\b|\s*[{{=;])", "storage.type", "entity.name.type"),
        _groups(rf"\b(like|of)\s+({PATH})(?=\s*(?:[{{;]|\bof\b))", "keyword.other", "entity.other.inherited-class"),
        _groups(rf"\b(let|param)\s+({IN_LOOPS})(?=\s*=)", "storage.type", "variable.other.constant"),
        _groups(rf"^\s*({USE})(?=\s*[<\"])", "keyword.control"),
        _groups(rf"\b({AS})\s+({NAME})(?=\s*;)", "keyword.control", "entity.name.namespace"),
        _groups(rf"\b({UNIT})\s+({NAME})(?=\s*=)", "storage.type", "entity.name.type.unit"),
        _groups(rf"^\s*({EDITION_WORD})\s+([0-9]+)(?=\s*;)", "keyword.control.edition", "constant.numeric"),
        _groups(rf"\b(for)\s+({NAME})\s+(in)\b", "keyword.control", "variable.parameter", "keyword.control"),
        _groups(
            rf"\b(joint)\s+({IN_LOOPS})\s+({_any(JOINT_KINDS)})\b",
            "storage.type.part",
            "entity.name.section",
            "storage.modifier.joint",
        ),
        _groups(rf"\b({_any(PARTS)})\s+({IN_LOOPS})(?=\s*[={{;])", "storage.type.part", "entity.name.section"),
        _groups(rf"\b({_any(STATEMENTS)})\b(?=\s+[^=\s]|\s*\{{|\s*\(|\s*\")(?!\s*\+=)", "keyword.control"),
        _groups(rf"\b({_any(_keys())})(?=\s*(?:\+=|=(?!=)|\{{))", "support.type.property-name"),
        _groups(rf"\b({PATH})(?=\s*(?:\+=|=(?!=)))", "variable.other.property"),
    )


def _values() -> dict[str, Any]:
    known = {
        *FUNCTIONS,
        CSV,
        *SHAPES,
        *COMMAND_UNIT,
        *(name for kind in models.GROUPS for name in models.find_own(kind)),
    }
    return _patterns(
        _groups(rf"\b({_any(known)})(?=\s*[({{])", "support.function"),
        _groups(rf"\b({_any(known)})(?=\s*[;,)])(?<![.])", "support.constant"),
        _groups(rf"\b({NAME})(?=\s*\()", "entity.name.function"),
        _match("keyword.operator.word", r"\b(?:and|or|not|by)\b(?!\s*=)"),
        _match("constant.language", rf"\b{_any((*CONSTANTS, *WORDS))}\b(?!\s*[.=])"),
        _match("variable.other", PATH),
        _match("keyword.operator", r"\.\.|[<>=!]=|\+=|[-+*/^<>=]"),
        _match("punctuation.terminator", r";"),
        _match("punctuation.separator", r","),
        _match("punctuation.section", r"[\[\](){}]"),
    )


def _keys() -> set[str]:
    """Every key that the language or a model of MET's own knows."""
    declared = {
        parameter.name
        for kind in models.GROUPS
        for model in models.find_own(kind).values()
        for parameter in models.written(model)
    }
    shaped = {parameter.name for shape in SHAPES.values() for parameter in shape.parameters}
    numbered = {number.name for number in dh.NUMBERS}
    return declared | shaped | numbered | {key for block in BLOCKS.values() for key in block.keys}


def texts() -> dict[str, bytes]:
    """The files by name: for VS Code and others, and for Sublime Text and TextMate."""
    generated = grammar()
    as_json = json.dumps(generated, indent=2, ensure_ascii=False) + "\n"
    return dict(zip(NAMES, (as_json.encode(), plistlib.dumps(generated, sort_keys=False)), strict=True))


def main() -> None:
    for name, text in texts().items():
        (FOLDER / name).write_bytes(text)
        print(f"wrote {FOLDER / name}")


if __name__ == "__main__":
    main()
