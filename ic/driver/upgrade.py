"""`met fmt --upgrade`: decks rewritten to the latest edition of the language, and the proof that they mean the same.

Texts about which edition 1 warns (D392) get brackets that mean the same in both editions, and the file its line `deck
2;`. The result counts only once it is proved: every deck has the same tree before and after, and all its runs and
sweeps have the same plans and keys. A file that is not a deck alone is proved by decks that include it. A file without
a proof is not changed, and neither is one that an unnamed deck beside it would read differently.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from ic.driver.compile import Compiled, check
from ic.read import read
from ic.text.edition import EDITION_WORD, LATEST, edition_of
from ic.text.files import NOTHING_UNSAVED, Files, FoundFile, Unsaved
from ic.text.lexer import NAME, NUMBERS, Text, solid_tokens
from met import units
from met.diagnostic import Diagnostic, Label, Place, Problem, error
from met.frozen import frozen
from met.messages.edits import edits
from met.plan import Experiment, Origin
from met.plan.columns import ComputedColumn
from met.plan.keys import case_ids, inputs, structure_key

CODE = "D392"
"""The warning about text that the next edition reads differently; the first change of its help means the same in
both."""

DECK = ".ic"

MOST_BESIDE = 1_000
"""Largest number of decks beside those to be upgraded that are read."""

_INCLUDED = re.compile(r'^[ \t]*(?:#[ \t]*include|use)\b[ \t]*["<]([^">\n]+)[">]', re.MULTILINE)

MOST_ROWS = 10_000
"""Number of rows of a case table that are compared at either end; all of it follows from the tree, which is compared
whole."""


@frozen
class Upgrades:
    """The new texts of files, by path, and the reasons why others are not changed."""

    texts: Mapping[str, str]
    refused: Mapping[str, Problem]


def upgrades(paths: Sequence[str]) -> Upgrades:
    """The texts that `met fmt --upgrade` makes of these files, without those of the latest edition."""
    text_of: dict[str, str] = {}
    before: dict[str, Compiled] = {}
    refused: dict[str, Problem] = {}
    for path in paths:
        try:
            text_of[path] = Files().text(FoundFile(path, os.path.normpath(path)))
        except Problem as problem:
            refused[path] = problem
            continue
        before[path] = _compiled(path)
    old = {os.path.realpath(path): text for path, text in text_of.items() if edition_of(text) < LATEST}
    new = {path: _rewritten(path, text, before.values()) for path, text in old.items()}
    proved: set[str] = set()
    wrong: dict[str, Problem] = {}
    for path, compiled in before.items():
        files = {os.path.realpath(name) for name in compiled.sources} & new.keys()
        if compiled.plan is not None and not compiled.plan.experiments:
            files = {file for file in files if not _depends_on_its_decks(old[file])}
        if compiled.plan is None or not files:
            continue
        difference = _difference(path, compiled, new)
        if difference is None:
            proved |= files
        else:
            wrong.update(dict.fromkeys(files, difference))
    for path in _decks_beside(proved - wrong.keys(), {os.path.realpath(named) for named in text_of}):
        compiled = _compiled(path)
        files = {os.path.realpath(name) for name in compiled.sources} & proved - wrong.keys()
        parts = ", ".join(sorted(os.path.relpath(file) for file in files))
        difference = _difference(path, compiled, new, parts) if compiled.plan is not None and files else None
        if difference is not None:
            wrong.update(dict.fromkeys(files, difference))
    texts: dict[str, str] = {}
    for path in text_of:
        real = os.path.realpath(path)
        if real in wrong:
            refused[path] = wrong[real]
        elif real in proved:
            texts[path] = new[real]
        elif real in new:
            refused[path] = _not_proved(path, before[path])
    return Upgrades(texts, refused)


def _compiled(path: str, unsaved: Unsaved = NOTHING_UNSAVED) -> Compiled:
    return check(path, include_dirs=(), defines=(), select="all", unsaved=unsaved)


def _decks_beside(reals: Iterable[str], named: Collection[str]) -> Iterator[str]:
    """The decks that include files by name, also through others, and are not among those that are named.

    The files' folders and those around and inside of these are searched.
    """
    folders = {os.path.dirname(path) for path in reals}
    around = sorted({*folders, *map(os.path.dirname, folders), *(folder for f in folders for folder in _folders_in(f))})
    texts: dict[str, str] = {}
    for path in (os.path.join(folder, name) for folder in around for name in sorted(os.listdir(folder))):
        if path.endswith(DECK) and len(texts) < MOST_BESIDE:
            try:
                texts[os.path.relpath(path)] = Files().text(FoundFile(path, path))
            except Problem:
                continue
    wanted = {os.path.basename(path) for path in reals}
    includes = {
        path: {os.path.basename(include) for include in _INCLUDED.findall(text)} for path, text in texts.items()
    }
    waiting = dict.fromkeys(path for path in texts if os.path.realpath(path) not in named)
    while including := [path for path in waiting if includes[path] & wanted]:
        for path in including:
            del waiting[path]
            wanted.add(os.path.basename(path))
            yield path


def _folders_in(folder: str) -> Iterator[str]:
    with os.scandir(folder) as entries:
        yield from (entry.path for entry in entries if entry.is_dir() and not entry.name.startswith("."))


# The text


def _rewritten(real: str, text: str, compiled: Iterable[Compiled]) -> str:
    """The text of a file with brackets where the editions differ, and with its line."""
    stretches: set[tuple[int, int]] = set()
    source = Text("", text)
    for checked in compiled:
        for warning in (*checked.diagnostics, *(allowed for allowed, _ in checked.allowed)):
            first = next(edits(warning, checked.sources), None) if warning.code == CODE else None
            if first is not None and os.path.realpath(first[1].file) == real:
                edit = first[1]
                start, end = source.offset(edit.line, edit.column), source.offset(edit.end_line, edit.end_column)
                if edit.text == f"({text[start:end]})":
                    stretches.add((start, end))
    marks = sorted([(end, 0, ")") for _, end in stretches] + [(start, 1, "(") for start, _ in stretches], reverse=True)
    for offset, _, mark in marks:
        text = text[:offset] + mark + text[offset:]
    return _with_line(text)


def _with_line(text: str) -> str:
    """The text with the line of the latest edition: before its first entry, and the comment that belongs to it."""
    source, line = Text("", text), f"{EDITION_WORD} {LATEST};"
    if source.heading is not None:
        start, end = source.heading.number
        return f"{text[:start]}{LATEST}{text[end:]}"
    first = next((token.offset for token in solid_tokens(source)), len(text))
    offset = text.rfind("\n", 0, first) + 1
    above = text[:offset].rstrip(" \t").rpartition("\n\n")
    if above[1] and above[0].strip() and above[2].strip():  # a comment of its own, below that of the file
        offset = len(above[0]) + len(above[1])
    elif text[:offset].strip() and not text[:offset].endswith("\n\n"):
        line = f"\n{line}"
    behind = "" if text[offset:].startswith("\n") or not text[offset:] else "\n"
    return f"{text[:offset]}{line}\n{behind}{text[offset:]}"


# The proof


def _depends_on_its_decks(text: str) -> bool:
    """Return True if a name in a file of edition 1 may be a unit, or a value of a deck that includes the file: one of
    the units that came later, other than directly behind a number."""
    return any(
        token.text in units.FURTHER_UNITS and before.kind not in NUMBERS
        for before, token in pairwise(solid_tokens(Text("", text)))
        if token.kind == NAME
    )


def _difference(path: str, before: Compiled, new: Mapping[str, str], parts: str = "") -> Problem | None:
    """The reason why a deck with these texts differs from before; None where it does not. parts: the files concerned,
    if not all"""
    after = _compiled(path, new)
    if after.plan is None:
        first_error = next(diagnostic for diagnostic in after.diagnostics if diagnostic.severity == "error")
        return Problem(
            _left(path, f"{first_error.code}, {first_error.message}", first_error, parts=parts), after.sources
        )
    assert before.plan is not None
    olds, news = before.plan.experiments, after.plan.experiments
    for old, upgraded in zip(olds, news, strict=False):
        if _meaning(old) != _meaning(upgraded):
            return Problem(_left(path, f"`{old.name}` would not have the same plan", parts=parts))
    same = len(olds) == len(news) and placeless(read(path).entries) == placeless(read(path, unsaved=new).entries)
    return None if same else Problem(_left(path, "it would not have the same entries", parts=parts))


def _left(path: str, why: str, diagnostic: Diagnostic | None = None, *, parts: str = "") -> Diagnostic:
    """The error that a deck stays in its edition (E346). why: in words; parts: the file that includes `path`, if there
    is one."""
    message = f"`{parts or path}` stays in its edition: " + (f"in `{path}`, which includes it, " * bool(parts)) + why
    if diagnostic is None and parts:
        return error("E346", message, help=f"`met check {path}` may warn of what the editions read otherwise (D392)")
    if diagnostic is None:
        help = "does it count lines, by `__LINE__`? The file has one more; else please report it together with the deck"
        return error("E346", message, help=help)
    label = Label(diagnostic.at.place, "in the new edition") if diagnostic.at is not None else None
    return error("E346", message, label, help=[*diagnostic.help, "write it so that both editions read it alike"])


def _not_proved(path: str, compiled: Compiled) -> Problem:
    """The reason why a file that no deck proves is not changed: it cannot be read, does not compile, or has no run."""
    first = next((diagnostic for diagnostic in compiled.diagnostics if diagnostic.severity == "error"), None)
    label = (
        Label(first.at.place, f"{first.code}, {first.message}") if first is not None and first.at is not None else None
    )
    include = "name a deck that includes it, too: `met fmt --upgrade DECK PART`; or write the line by hand"
    why, helps = "it does not compile by itself", ["what it means cannot be compared before and after", include]
    if first is None:
        why = "it has no run, and what it means depends on the deck that includes it"
        helps = [include]
    elif not _is_readable(path):
        why, helps = "it cannot be read", ["mend it first: `met check` shows all that is wrong"]
    return Problem(error("E346", f"`{path}` stays in its edition: {why}", label, help=helps), compiled.sources)


def _is_readable(path: str) -> bool:
    try:
        read(path)
    except Problem:
        return False
    return True


def _meaning(experiment: Experiment) -> object:
    """Everything that defines a run or sweep, and its keys, without places in files."""
    rows = range(min(experiment.cases.count, MOST_ROWS))
    keys = structure_key(experiment.structure, inputs(experiment)), case_ids(experiment, rows)
    return placeless(replace(experiment, notes=())), keys  # notes are words for a reader, with line numbers in them


def placeless(value: Any) -> Any:
    """A part of a plan or of a tree without places and origins, for comparison."""
    if isinstance(value, Place | Origin):
        return None
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, ComputedColumn):
        ends = (slice(0, MOST_ROWS), slice(max(0, len(value) - MOST_ROWS), len(value)))
        return type(value).__name__, len(value), *(np.asarray(value[end]).tobytes() for end in ends)
    if is_dataclass(value):
        return type(value).__name__, *(placeless(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, Mapping):
        return {name: placeless(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [placeless(part) for part in value]
    return value
