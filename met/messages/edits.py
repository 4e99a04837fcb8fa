"""Edits of a deck's text that carry out a message's help: a file, a stretch of it, and the new text.

A help carries a `TextChange`, which knows a place and a word. This module checks the text itself, and gives an edit
only where that word stands there, in one of the user's own files and outside of macro bodies: an edit in a macro would
change all its uses, and one of the library's decks those of everyone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from met.frozen import frozen
from met.messages.message import Diagnostic, Help, Place, TextChange, shown_place


@frozen
class Edit:
    """One stretch of a file and the text to write in its place; lines and columns count from 1, and the end is
    exclusive."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    text: str


def edits(diagnostic: Diagnostic, sources: Mapping[str, str]) -> Iterator[tuple[int, Edit]]:
    """The edits of a diagnostic, each with the number of its help; each alone resolves the diagnostic.

    A help has several edits where it offers several texts to write.

    sources  the text of each file by the name that places give it
    """
    for n, text in enumerate(diagnostic.help):
        for change in text.changes if isinstance(text, Help) else ():
            place = change.at or (diagnostic.at.place if diagnostic.at is not None else None)
            edit = _edit(change, place, sources) if place is not None else None
            if edit is not None:
                yield n, edit


def apply(edit: Edit, text: str) -> str:
    """The text of the edit's file after the edit."""
    starts = _starts(text)
    first = starts[edit.line - 1] + edit.column - 1
    last = starts[edit.end_line - 1] + edit.end_column - 1
    return text[:first] + edit.text + text[last:]


def _edit(change: TextChange, place: Place, sources: Mapping[str, str]) -> Edit | None:
    """The edit of a text change at a place; None where the text is not the user's own, has another word there, or comes
    from a macro or one turn of a loop."""
    text = sources.get(place.file)
    if text is None or place.file.startswith("<") or shown_place(place) is not place:
        return None
    starts = _starts(text)
    if not 0 < place.line <= len(starts):
        return None
    line_at = starts[place.line - 1]
    line_end = line_at + len(text[line_at:].partition("\n")[0])
    first = line_at + place.column - 1
    last = min(first + place.length, line_end)
    stretch = _stretch(change, text, (line_at, line_end), min(first, line_end), last)
    if stretch is None or text[stretch[0] : stretch[1]] == stretch[2]:  # the new text stands there already
        return None
    if any(
        iteration.macro in _names(text[stretch[0] : stretch[1]]) - _names(stretch[2]) for iteration in place.iterations
    ):
        return None  # it would only concern this turn
    return _between(place.file, starts, *stretch)


def _names(text: str) -> set[str]:
    return set(re.findall(r"[A-Za-z_]\w*", text))


def _stretch(
    change: TextChange, text: str, line: tuple[int, int], first: int, last: int
) -> tuple[int, int, str] | None:
    """The first and the last offset of the replaced text, and the new text; None where there is no such stretch.

    line         where the place's line begins and ends
    first, last  where the place does
    """
    if change.where == "before":
        return first, first, change.new
    if change.where == "head":
        return _at_the_head(text, change.new)
    if change.where == "inside":
        return _at_its_end(text, last, change.new)
    if change.where == "entry":
        entry = _entry(text, first)
        if entry is None or change.new:
            return entry and (*entry, change.new)
        return (*_with_its_line(text, *entry), "")
    if change.old is not None:
        words = [word for word in _words(change.old, text[slice(*line)], line[0]) if _meet(word, first, last)]
        return (*words[0], change.new) if len(words) == 1 else None
    if change.where in ("value", "behind") and not _is_whole_value(text, first, last):
        return None
    return last if change.where == "behind" else first, last, change.new


def _starts(text: str) -> list[int]:
    """The offset of each line's beginning."""
    return [0, *(line_end.end() for line_end in re.finditer("\n", text))]


def _between(file: str, starts: list[int], first: int, last: int, new: str) -> Edit:
    """The edit of the characters from `first` to `last` of a file, by lines and columns. starts: offsets of lines"""
    from bisect import bisect_right

    line, end_line = bisect_right(starts, first), bisect_right(starts, last)
    return Edit(file, line, first - starts[line - 1] + 1, end_line, last - starts[end_line - 1] + 1, new)


def _words(word: str, line: str, offset: int) -> Iterator[tuple[int, int]]:
    """The stretches of a line that consist of these whole words, with or without blanks between them."""
    before = r"(?<!\w)" if word[:1].isalnum() or word[:1] == "_" else ""
    behind = r"(?!\w)" if word[-1:].isalnum() or word[-1:] == "_" else ""
    blanks = r"\s*".join(map(re.escape, word.split(" ")))
    for matched in re.finditer(before + blanks + behind, line):
        yield offset + matched.start(), offset + matched.end()


def _meet(stretch: tuple[int, int], first: int, last: int) -> bool:
    return stretch[0] < max(last, first + 1) and first < stretch[1]


_ENDS_A_VALUE = re.compile(r"\s*(?:[;,)\]}<>=!]|//|/\*|\.\.|(?:by|and|or|in|with)\b|$)")


def _is_whole_value(text: str, first: int, last: int) -> bool:
    """True where a stretch is not part of a longer value, one that goes on after it or began before it in brackets."""
    depth = 0
    for sign in text[first:last]:
        depth += (sign in "([{") - (sign in ")]}")
        if depth < 0:
            return False
    return depth == 0 and _ENDS_A_VALUE.match(text, last) is not None


_EDITION = re.compile(r"(?:\s+|//[^\n]*|/\*(?s:.*?)\*/)*deck\s+\d+\s*;")
_REST = re.compile(r"[ \t\r]*(?://[^\n]*)?\n")


def _at_the_head(text: str, new: str) -> tuple[int, int, str]:
    """The edit that writes a file's first line, behind its `deck 2;`, which has to stand before all else."""
    edition = _EDITION.match(text)
    if edition is None:
        return 0, 0, f"{new}\n"
    rest = _REST.match(text, edition.end())
    offset, line = (rest.end(), f"{new}\n") if rest is not None else (edition.end(), f"\n{new}\n")
    return offset, offset, line


# Entries of blocks. Their kind does not matter here: brackets and semicolons part them, outside of texts.

_PIECES = re.compile(
    r"""(?P<skip>\s+|//[^\n]*|/\*.*?\*/|^[ \t]*\#(?:[^\n]*\\\r?\n)*[^\n]*)"""
    r"""|(?P<string>"(?:[^"\\\n]|\\.)*")|(?P<sign>[{}()\[\];])|.""",
    re.DOTALL | re.MULTILINE,
)


def _at_its_end(text: str, offset: int, new: str) -> tuple[int, int, str] | None:
    """The edit that adds an entry at the end of the next block; None where an entry ends before a block is opened."""
    depth = 0
    for piece in _PIECES.finditer(text, offset):
        sign = piece["sign"]
        depth += (sign == "{") - (sign == "}")
        if depth == 0 and sign in (";", "}"):
            break
    else:
        return None
    if piece["sign"] == ";":
        return None
    end = piece.start()
    line = text.rfind("\n", 0, end) + 1
    indent = text[line:end]
    if not indent.strip() and line > offset:
        return line, line, f"{indent}    {new}\n"
    return end, end, f"{new} " if text[end - 1].isspace() else f" {new} "


def _entry(text: str, offset: int) -> tuple[int, int] | None:
    """The innermost entry of a block around an offset, with its `;` or its block; None where brackets do not match."""
    best: tuple[int, int] | None = None
    begun: list[int | None] = [None]  # start of the unfinished entry in each open block
    rounds = 0
    for piece in _PIECES.finditer(text):
        sign = piece["sign"]
        if piece["skip"] is not None:
            continue
        if sign in ("(", "["):
            rounds += 1
        elif sign in (")", "]"):
            rounds -= 1
        if sign == "}":
            if len(begun) == 1:
                return None
            begun.pop()
        elif begun[-1] is None and sign != ";":
            begun[-1] = piece.start()
        if sign == "{":
            begun.append(None)
        elif sign in (";", "}") and rounds <= 0:
            start = begun[-1]
            if start is not None and start <= offset < piece.end() and (best is None or start > best[0]):
                best = start, piece.end()
            begun[-1] = None
    return best


def _with_its_line(text: str, first: int, last: int) -> tuple[int, int]:
    """The stretch with the blanks after it, and with its line where nothing else stands on it."""
    before = text.rfind("\n", 0, first) + 1
    behind = re.compile(r"[ \t]*").match(text, last)
    end = behind.end() if behind else last
    if not text[before:first].strip() and text[end : end + 1] in ("\n", ""):
        return before, min(end + 1, len(text))
    return first, end
