"""Requests to `met doc`: the pages that its words ask for."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from textwrap import indent
from types import MappingProxyType
from typing import Any

from ic.language import ANYWHERE, BLOCKS, TOP_LEVEL
from ic.language.bodies import JOINT_KINDS
from ic.meaning.mechanics import dh, matter
from ic.printing.description import language_page
from ic.printing.looked_up import entries, is_code, meaning, print_code
from ic.printing.models import KINDS, WHERE_WRITTEN, model_page, model_record, summary
from ic.printing.page import Page, Table, described, terminal_width
from ic.printing.subjects import BLOCK_PAGES, OTHER_PAGES, channels, in_block, in_si, unit_table
from ic.printing.sweeps import PAGES
from met import models
from met.diagnostic import Problem, did_you_mean, error

Row = tuple[str, str, str]
"""What a deck writes, where, and what it means."""

MOST_MEANINGS = 4  # that have a word in passing: one of more says little of any

_CONDITIONAL = ("what follows, up to the next `#elif`, `#else` or `#endif`, is read only where {}", "a line of its own")

SYNTAX: Mapping[str, tuple[str, str, str]] = MappingProxyType({
    "like": ("KIND NAME like BASE { ... }", "a definition, or an entry of `servos`",
             "all entries of BASE, with what differs in the block; a later entry replaces an inherited one"),
    "of": ("sweep NAME of RUN { ... }", "a sweep, search or tuning", "the run whose cases are made"),
    "from": ('arm NAME from urdf("FILE") { ... }', "an arm", "the arm of a robot's file; the block holds what differs"),
    "default": ("default run NAME { ... }", "a run, sweep, search or tuning",
                "the one that `met run DECK` runs where several are defined"),
    "remove": ("remove NAME;", "a block `like` another", "takes an inherited entry out"),
    "macro": ("vary macro NAME = [A, B];", "a sweep", "varies a macro of `#define`: each choice is a deck of its own"),
    "when": ("exclude when CONDITION;", "a sweep", "leaves the cases out for which the condition holds"),
    "in": ("for i in 1 .. 6 by 1 { ... }", "a loop", "the numbers or names of a loop; also `in 99 % of cases`, of a "
           "requirement"),
    "by": ("0.1 .. 1 by 0.1 kg", "a range", "the step from one value to the next; both ends belong to it"),
    "and": ("A and B", "a condition", "holds where both hold"),
    "or": ("A or B", "a condition", "holds where one of them holds, or both"),
    "not": ("not A", "a condition", "holds where A does not"),
    "as": ("use <FILE> as ROOF;", "a deck", "the name in front of the definitions of the used deck: `ROOF.NAME`"),
    "because": ('allow CODE because "REASON";', "a run, sweep, search or tuning", "the reason, which must be written"),
    "cases": ("require METRIC < LIMIT in 99 % of cases;", "a requirement", "how many cases of a sweep must meet it"),
    "confidence": ("require METRIC < LIMIT in 99 % of cases with 90 % confidence;", "a requirement",
                   "how sure that is to be, for a sweep with random values"),
    "percentile": ("require percentile(METRIC, 99 %) < LIMIT with 90 % confidence;", "a requirement",
                   "what that share of a sweep's cases stay below; also without the confidence"),
    "free": ("base = free;", "a run", "the arm's base moves as its mass and the forces on it have it"),
    "prescribed": ("base = prescribed { ... }", "a run", "the arm's base moves as its courses say"),
    "links": ("links.NAME.mass", "a path", "a number of a link; also a channel, as in `links.NAME.position`"),
    "payloads": ("payloads.NAME.mass", "a path", "a number of a payload; also a channel"),
    "guides": ("guides.NAME.PARAMETER", "a path", "a number of a guide"),
    "sensors": ("sensors.NAME", "a path", "a sensor on a link: its reading, or a number of it"),
    "metrics": ("metrics.NAME.PARAMETER", "a path", "a number of a metric"),
    **{kind: (f"joint NAME {kind} {{ ... }}", "an arm", f"a joint that {moves}") for kind, moves in zip(
        JOINT_KINDS, ("turns about its axis", "slides along its axis", "does not move"), strict=True)},
    "include": ('#include "FILE"', _CONDITIONAL[1], "reads a file of the deck's folder here; `<FILE>` is one of MET's"),
    "define": ("#define NAME VALUE", _CONDITIONAL[1], "a macro: its name stands for its text; `-D NAME=VALUE` as well"),
    "undef": ("#undef NAME", _CONDITIONAL[1], "forgets a macro"),
    "if": ("#if CONDITION", _CONDITIONAL[1], _CONDITIONAL[0].format("a condition of macros and whole numbers holds")),
    "ifdef": ("#ifdef NAME", _CONDITIONAL[1], _CONDITIONAL[0].format("there is a macro NAME; a `let` is none")),
    "ifndef": ("#ifndef NAME", _CONDITIONAL[1], _CONDITIONAL[0].format("there is no macro NAME; a `let` is none")),
    "elif": ("#elif CONDITION", _CONDITIONAL[1], "as `#if`, where nothing before it was read"),
    "elifdef": ("#elifdef NAME", _CONDITIONAL[1], "as `#ifdef`, where nothing before it was read"),
    "elifndef": ("#elifndef NAME", _CONDITIONAL[1], "as `#ifndef`, where nothing before it was read"),
    "else": ("#else", _CONDITIONAL[1], "what follows is read where nothing before it was"),
    "endif": ("#endif", _CONDITIONAL[1], "ends the text of an `#if`"),
    "defined": ("#if defined(NAME)", "a condition of `#if`", "whether there is a macro NAME"),
    "pragma": ("#pragma once", _CONDITIONAL[1], "lets a file be read only once"),
    "error": ("#error TEXT", _CONDITIONAL[1], "refuses the deck, with this text"),
    "warning": ("#warning TEXT", _CONDITIONAL[1], "warns with this text"),
})  # fmt: skip
"""Words that the grammar and the preprocessor know, besides those of blocks and models."""


def print_word(word: str) -> Iterator[str]:
    """Every meaning of a word, for a terminal; empty where there is none. The glossary's comes first."""
    word = word.removeprefix("#")
    yield from meaning(word)
    for written, where, doc in dict.fromkeys(_rows(word)) or _that_use(word):
        yield f"{written}  in {where}" if where else written
        yield from described([(line,) for line in doc.split("\n")], width=terminal_width(), indent="    ")


def _rows(word: str) -> Iterator[Row]:
    yield from (row for name, row in _of_blocks() if name == word)
    yield from _of_models(word)
    yield from (row for name, row in _of_values() if name == word)


def _that_use(word: str) -> Sequence[Row]:
    """Entries of blocks and values that are written with this word, such as `choose PATH = between(LOW, HIGH) UNIT;`;
    else those whose meaning has it, and else such words of the glossary, where they are few."""
    whole = re.compile(rf"(?<![\w.]){re.escape(word)}(?!\w)", re.IGNORECASE)
    rows = [row for _, row in (*_of_blocks(), *_of_values())] if word else []
    glossary = [(words, "", meaning) for words, meaning in entries().values()] if word else []
    for among, column, most in ((rows, 0, len(rows)), (rows, 2, MOST_MEANINGS), (glossary, 2, MOST_MEANINGS)):
        matches = [*dict.fromkeys(row for row in among if whole.search(row[column]))]
        if 0 < len(matches) <= most:
            return matches
    return []


def _of_blocks() -> Iterator[tuple[str, Row]]:
    """The words of the grammar and of the entries of blocks, with their meanings."""
    yield from SYNTAX.items()
    for block in (*BLOCKS.values(), TOP_LEVEL, ANYWHERE):
        for entry in block.entries:
            yield entry.name.split()[0], (entry.written, in_block(block), f"{entry.doc}\ndefault: {entry.default}")
            for word in entry.parameter.words if entry.parameter else ():
                yield word, (f"{entry.name} = {word};", in_block(block), entry.doc)


def _of_values() -> Iterator[tuple[str, Row]]:
    """The words of values, shapes, units and channels, with their meanings."""
    for subject, words_page in PAGES.items():
        for record in words_page().records:
            yield record["name"], (record["written"], f"a value: `met doc {subject}`", record["doc"])
    for name, shape in matter.SHAPES.items():
        for word in (name, *(parameter.name for parameter in shape.parameters)):
            yield word, (f"shape = {name}(...)", "a link or payload", "`met doc shapes` shows it")
    for convention in dh.CONVENTIONS:
        yield convention, (f"dh = {convention}(...)", "a joint", "`met doc dh` shows its numbers")
    for number in dh.NUMBERS:
        yield number.name, (f"dh = classic({number.name} = ...)", "a joint", number.doc)
    for unit in unit_table():
        yield unit["name"], (unit["name"], "a quantity, behind its number", f"{unit['word']}, {in_si(unit)}")
    for channel in channels():
        meaning = f"{channel['meaning']}, {channel['unit']}"
        yield channel["path"].rpartition(".")[2], (channel["path"], "a `record`, metric or signal", meaning)


def _of_models(word: str) -> Iterator[Row]:
    """The parameters of this name, and those that may be this word, each with the models that declare it alike."""
    models_by_entry: dict[tuple[str, str, str], list[str]] = {}
    for kind in KINDS:
        for name, model in models.available(kind).items():
            for parameter in models.written(model):
                if parameter.name == word or word in parameter.words:
                    value = (
                        word if parameter.name != word else "..." if parameter.unit == "1" else f"... {parameter.unit}"
                    )
                    models_by_entry.setdefault((kind, f"{parameter.name} = {value}", parameter.doc), []).append(name)
    for (of_kind, written, doc), names in models_by_entry.items():
        yield written, f"{of_kind} {', '.join(names)}", doc


OF_LANGUAGE = tuple(name for name in BLOCKS if name not in KINDS)
"""Blocks of the deck language that have no models."""

SUBJECTS: Mapping[str, Callable[[], Page]] = MappingProxyType(
    {
        **{name: BLOCK_PAGES[name] for name in OF_LANGUAGE},
        **dict(sorted({**OTHER_PAGES, "language": language_page}.items())),
    }
)
"""The page of each word of `met doc` that is neither a model nor a kind of models."""


def requested_pages(words: tuple[str, ...]) -> list[Page]:
    """The pages of a request. Raises Problem D171."""
    word = words[0] if len(words) == 1 else ""
    kind = word.removesuffix("s")
    if is_code(word):
        return [Page(parts=["\n".join(print_code(word))])]
    if word in SUBJECTS:
        return [SUBJECTS[word]()]
    if not words or kind in KINDS:
        return [index_page(kind)]
    meanings = "\n".join(print_word(word))
    try:
        pages = [model_page(kind_of_model, model) for kind_of_model, model in named_models(*words)]
    except Problem:
        if not meanings:
            raise
        return [Page(parts=[meanings])]
    also = f"Also `{word}`\n{indent(meanings, '  ')}" if meanings else ""
    return [*pages, Page(parts=[also])]


def index_page(word: str) -> Page:
    """A list of the models of a kind, with its block if it has one; "": of the models of all kinds."""
    kinds = [kind for kind in KINDS if word in ("", kind)]
    tables = [
        Table(
            head=("name", "meaning"),
            rows=[(name, summary(model)) for name, model in models.available(kind).items()],
            headed=False,
            caption=f"{kind}: {WHERE_WRITTEN[kind]}",
        )
        for kind in kinds
    ]
    others = ", ".join(name for name in SUBJECTS if name not in (*OF_LANGUAGE, "channels"))
    end = (
        "`met doc MODEL` shows everything that a model declares, `met doc channels` everything that can be recorded.\n"
        f"Blocks of a deck: {', '.join(OF_LANGUAGE)}.\n"
        f"Also: {others}; and the code of a message, as in `met doc D060`."
    )
    block = BLOCK_PAGES.get(word, Page)()
    records = [model_record(kind, model) for kind in kinds for model in models.available(kind).values()]
    return replace(block, parts=(*block.parts, *tables, end), records=records)


def named_models(word: str, name: str = "") -> list[tuple[models.Kind, Any]]:
    """The models whose name is the only word, or the one of a kind and a name. Raises Problem D171."""
    for kind in KINDS:
        if word in (kind, f"{kind}s"):
            return [(kind, models.find(kind, name))]
    everything = [(kind, model) for kind in KINDS for model in models.available(kind).values()]
    named = [(kind, model) for kind, model in everything if model.name == word]
    if named and not name:
        return named
    if name and (word in SUBJECTS or named):
        whole = f"{named[0][0]} {word}" if named else word
        raise Problem(error("D171", f"`{word}` takes no second word", help=f"`met doc {whole}` says it all"))
    known = [*KINDS, *SUBJECTS, *(model.name for _, model in everything), *entries()]
    helps = [*did_you_mean(word, known), f"kinds: {', '.join(KINDS)}; also: {', '.join(SUBJECTS)}"]
    raise Problem(error("D171", f"no kind of model and no model `{word}`", help=helps))
