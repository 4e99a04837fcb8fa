"""Differences between the decks of two archives: files, lines, and names that stand for values.

The texts are an archive's, so nothing here reads a file, runs a deck or follows an `#include`.
"""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

from ic.printing.columns import count
from met.frozen import frozen

CONTEXT = 1
"""Number of lines that are shown around a difference."""

MOST_COMPARED = 4_000
"""Largest number of lines, from the first to the last difference, that are compared one by one: the time grows with its
square."""

LONGEST_READ = 1_000_000
"""Largest size, in characters, of a file that is searched for names: longer ones take seconds, and are not written by
hand."""

LONGEST_VALUE = 60
"""Largest number of characters of a macro's text that are shown."""

MOST_MOVED = 30
"""Largest number of files on either side that are searched for under another name."""

OF_ARGUMENTS = "()"
"""Ending of the names of macros with arguments, whose text alone says little."""

ALIKE = 0.5
"""Share of common lines from which files of different names count as the same."""


@frozen
class DeckFileChange:
    """A deck file that differs. said: in words; lines: a unified difference without its heads, empty where a file is
    new or gone, or too long to be compared."""

    said: str
    lines: tuple[str, ...] = ()


@frozen
class Decks:
    """The differences of two archives' deck files.

    files   each that differs
    names   `let`s and macros whose text differs, in words
    fresh   lines that only the second has, by file and number: where a value's place is one of them, it was written so
    stale   the same of the first
    known   names of all files
    """

    files: tuple[DeckFileChange, ...]
    names: tuple[str, ...]
    fresh: frozenset[tuple[str, int]]
    stale: frozenset[tuple[str, int]]
    known: frozenset[str]


def decks(a: Mapping[str, str], b: Mapping[str, str]) -> Decks:
    """The differences between the decks of two archives, file by file. a, b: texts of the files by name, the deck
    itself first."""
    pairs = _pairs(a, b)
    changes, fresh, stale = [], set(), set()
    for old, new in pairs:
        before, now = a.get(old, "").splitlines(), b.get(new, "").splitlines()
        known = set(before), set(now)
        fresh |= {(new, number) for number, line in enumerate(now, 1) if line not in known[0]}
        stale |= {(old, number) for number, line in enumerate(before, 1) if line not in known[1]}
        if not old or not new:
            changes.append(
                DeckFileChange(f"{old or new} is {'new' if new else 'gone'}: {count(len(before) + len(now), 'line')}")
            )
        elif a[old] != b[new] or PurePosixPath(old).name != PurePosixPath(new).name:
            name = new if old == new else f"{old}, now {new}"
            other = PurePosixPath(old).name != PurePosixPath(new).name and _share(before, now) < ALIKE
            lines = () if other else tuple(_unified(before, now))
            changes.append(
                DeckFileChange(f"{name}: {'another deck, ' if other else ''}{_counted(a[old], b[new])}", lines)
            )
    return Decks(tuple(changes), tuple(_names(a, b)), frozenset(fresh), frozenset(stale), frozenset((*a, *b)))


def _pairs(a: Mapping[str, str], b: Mapping[str, str]) -> list[tuple[str, str]]:
    """Pair the files of the two archives by name; the decks themselves; then by what they have in common. "" where a
    file has no counterpart."""
    pairs = {name: name for name in a if name in b}
    heads = next(iter(a), ""), next(iter(b), "")
    if all(heads) and heads[0] not in pairs and heads[1] not in pairs.values():
        pairs[heads[0]] = heads[1]
    left = [name for name in a if name not in pairs][:MOST_MOVED]
    rest = [name for name in b if name not in pairs.values()]
    lines = [
        {name: Counter(texts[name].splitlines()) for name in names[:MOST_MOVED]}
        for texts, names in ((a, left), (b, rest))
    ]
    for name in left:
        alike = {other: _alike(name, other, lines[0][name], lines[1][other]) for other in rest if other in lines[1]}
        near = max(alike, key=alike.__getitem__, default="")
        if near and alike[near] >= ALIKE:
            pairs[name] = near
            rest.remove(near)
    return [(name, pairs.get(name, "")) for name in a] + [("", name) for name in rest]


def _alike(old: str, new: str, before: Counter[str], now: Counter[str]) -> float:
    """The share of lines that two files have in common; above 1 where they have the same name in different folders."""
    return _share(before, now) + float(PurePosixPath(old).name == PurePosixPath(new).name)


def _share(before: Iterable[str], now: Iterable[str]) -> float:
    """The share of the longer one's lines that both have."""
    lines = Counter(before), Counter(now)
    return (lines[0] & lines[1]).total() / max(lines[0].total(), lines[1].total(), 1)


def _counted(before: str, after: str) -> str:
    """Say how many lines were added and removed."""
    old, now = (Counter(text.splitlines(keepends=True)) for text in (before, after))
    new, gone = (now - old).total(), (old - now).total()
    text = f"{count(new, 'line')} new, {gone} gone" if new or gone else "its lines are in another order"
    return text if before != after else "the same lines"


def _unified(before: Sequence[str], now: Sequence[str]) -> Iterator[str]:
    """The differing lines, each with a mark, under their line numbers, as in `diff -U1`."""
    first = next((i for i, (x, y) in enumerate(zip(before, now, strict=False)) if x != y), min(len(before), len(now)))
    most = min(len(before), len(now)) - first
    backwards = zip(reversed(before), reversed(now), strict=False)
    last = next((i for i, (x, y) in enumerate(backwards) if x != y or i >= most), most)
    start, end = max(0, first - CONTEXT), max(0, last - CONTEXT)
    parts = [list(lines[start : len(lines) - end]) for lines in (before, now)]
    if max(map(len, parts)) > MOST_COMPARED:
        return
    matcher = difflib.SequenceMatcher(None, parts[0], parts[1])
    for group in matcher.get_grouped_opcodes(CONTEXT):
        (_, i1, _, j1, _), (_, _, i2, _, j2) = group[0], group[-1]
        yield f"@@ -{start + i1 + 1},{i2 - i1} +{start + j1 + 1},{j2 - j1} @@"
        for kind, i, i_end, j, j_end in group:
            if kind == "equal":
                yield from (f" {line}" for line in parts[0][i:i_end])
            else:
                yield from (f"-{line}" for line in parts[0][i:i_end])
                yield from (f"+{line}" for line in parts[1][j:j_end])


# Names that stand for values


def _names(a: Mapping[str, str], b: Mapping[str, str]) -> Iterator[str]:
    """Changes of `let`s and macros of both decks whose texts differ; one that is written several times is left to its
    lines."""
    old, new = (
        _written({name: text for name, text in mine.items() if other.get(name) != text})
        for mine, other in ((a, b), (b, a))
    )
    for key in dict.fromkeys([*old, *new]):
        before, now = old.get(key, []), new.get(key, [])
        if [text for text, _ in before] == [text for text, _ in now] or max(len(before), len(now)) > 1:
            continue
        (text, place), kind = (now or before)[0], "new" if now else "gone"
        if not before or not now:
            yield f"{key} is {kind}{'' if key.endswith(OF_ARGUMENTS) else _value_text(text)} ({place})"
        elif max(len(before[0][0]), len(text)) > LONGEST_VALUE or key.endswith(OF_ARGUMENTS):
            yield f"{key} is another ({place})"
        else:
            yield f"{key}: {before[0][0] or 'nothing'} -> {text or 'nothing'} ({place})"


def _value_text(text: str) -> str:
    return f": {text}" if 0 < len(text) <= LONGEST_VALUE else ""


def _written(files: Mapping[str, str]) -> dict[str, list[tuple[str, str]]]:
    """The text and place of each definition, by name: `let reach`, `#define PAIRS`, `#define ROD()`."""
    definitions: dict[str, list[tuple[str, str]]] = {}
    for name, text in files.items():
        if name.rstrip(">").endswith(".ic") and len(text) <= LONGEST_READ:
            for line, key, written in sorted(_of_file(name, text)):
                definitions.setdefault(key, []).append((written, f"{name}:{line}"))
    return definitions


def _of_file(name: str, text: str) -> Iterator[tuple[int, str, str]]:
    """The line, the name and the text of each `let` and macro."""
    from ic.text.lexer import Text, Token, logical_lines

    let: list[Token] | None = None
    for line in logical_lines(Text(name, text)):
        words = [index for index, token in enumerate(line) if token.text.strip()]
        if words and line[words[0]].text == "#":
            if len(words) > 2 and line[words[1]].text == "define":
                index = words[2]
                takes = OF_ARGUMENTS if line[index + 1].text == "(" else ""
                yield line[index].line, f"#define {line[index].text}{takes}", _text(line[index + 1 :])
            continue
        for token in line:
            if token.text in ("let", "param"):
                let = []
            elif token.text == ";" and let is not None:
                head = [index for index, token in enumerate(let) if token.text.strip()][:2]
                if len(head) == 2 and let[head[1]].text == "=":
                    yield let[head[0]].line, f"let {let[head[0]].text}", _text(let[head[1] + 1 :])
                let = None
            elif let is not None:
                let.append(token)


def _text(tokens: Sequence[Any]) -> str:
    """The text of a line without comments and with single spaces."""
    return " ".join("".join(token.text for token in tokens).split())
