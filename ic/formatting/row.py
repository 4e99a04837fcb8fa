"""A row of a deck's text, a line or several that are joined, and the pieces that stand on it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

from ic.text.lexer import NUMBERS, SPACE, STRING, Text, Token
from met.frozen import frozen

TAB = 4
BLANKS = " \t\f\v"
_SPLICE = re.compile(r"\\[ \t\f\v]*(?:\n|\Z)")
_JOINING = frozenset(("+", "-", "*", "/", "^", "=", "+=", "<", "<=", ">", ">=", "==", "!=", "..", "and", "or", "by"))
_LEFT_OPEN = _JOINING | {"not", "when", "like", "of"}
BLANK, DIRECTIVE, REMARK, CODE = "blank", "directive", "remark", "code"

Kind = Literal[
    "name", "word", "number", "unit", "string", "open", "close", "stop", "operator", "sign", "comment", "other"
]


@frozen
class RowPiece:
    """Tokens that stand together.

    text    as it is laid out
    column  where it was written, from 0
    written how many columns it took there
    gap     blanks that were before it; 0 for the first of a row
    """

    kind: Kind
    text: str
    column: int
    written: int
    gap: int
    tokens: tuple[Token, ...]


class Row:
    """A line, or several that a comment or a backslash joins.

    kind     BLANK; DIRECTIVE; REMARK, of comments alone; CODE
    raw      its text without the newline
    whole    its tokens without white space; comments are there, as SPACE
    tokens   the same without comments
    exact    whether it stays as it is, but for blanks at its end
    opaque   whether even its brackets do not count
    tail     the comment at the end of code, or of a directive
    pieces   of code: what stands apart on it, in order, without the tail
    outer    the bracket in which this row begins, and the row that opens it; None at the top level
    parent   this row and the piece of it that is the bracket
    closes   the row that opened the last of the brackets that close at its beginning
    behind   the last token before it in the same bracket
    tab      how far apart its tab stops are
    tabbed   whether a tab stands between its tokens, or before them
    """

    __slots__ = (
        "_lines",
        "_tabs",
        "behind",
        "closes",
        "exact",
        "kind",
        "opaque",
        "outer",
        "parent",
        "pieces",
        "raw",
        "start",
        "tab",
        "tabbed",
        "tail",
        "tokens",
        "whole",
    )

    def __init__(self, source: Text, start: int, line: Sequence[Token], tab: int) -> None:
        """start: the line's offset in the text; line: its tokens; tab: columns from one tab stop to the next"""
        self.start = start
        self.tab = tab
        self.raw = source.text[start : line[-1].offset]
        self.whole = [token for token in line if token.kind != SPACE or written(token)[:1] == "/"]
        self.tokens = [token for token in self.whole if token.kind != SPACE]
        self.opaque = False
        self.pieces: list[RowPiece] = []
        self.tail: RowPiece | None = None
        self.outer: tuple[Token, Row] | None = None
        self.parent: tuple[Row, int] | None = None
        self.closes: Row | None = None
        self.behind: Token | None = None
        self._tabs = self._expanded()
        self.tabbed = self._tabs is not None and any(
            token.kind == SPACE and written(token)[:1] != "/" and "\t" in written(token) for token in line
        )
        self._lines = "\n" in self.raw
        joined = self._lines or _SPLICE.search(self.raw) is not None
        if self.tokens:
            directive = self.tokens[0].text == "#"
            self.kind, self.exact = (DIRECTIVE, True) if directive else (CODE, joined)
        elif self.whole:
            self.kind, self.exact = REMARK, len(self.whole) > 1 or _SPLICE.search(self.raw) is not None
        else:
            self.kind, self.exact = BLANK, "\\" in self.raw
        last = self.whole[-1] if self.tokens and not joined else None
        if last is not None and last.kind == SPACE:
            self.tail = RowPiece("comment", written(last).rstrip(BLANKS), self.column(last.offset), last.length, 0, ())

    @property
    def directive(self) -> str:
        """The word after the `#`; empty where the row is no directive."""
        return self.tokens[1].text if self.kind == DIRECTIVE and len(self.tokens) > 1 else ""

    def column(self, offset: int) -> int:
        """The column, from 0, of the character at this offset."""
        inside = offset - self.start
        before = self.raw.rfind("\n", 0, inside) + 1 if self._lines else 0
        return inside - before if self._tabs is None else self._tabs[inside]

    @property
    def stands_below(self) -> bool:
        """Return True if the row was written below the text after its bracket."""
        if self.parent is None or self.closes is not None:
            return False
        outer, opener = self.parent
        following = outer.pieces[opener + 1 : opener + 2]
        if outer.exact or not following or outer.pieces[opener].text == "{" or following[0].kind == "comment":
            return False
        return self.column(self.whole[0].offset) == following[0].column

    @property
    def _sets_others(self) -> bool:
        """Return True for `* = spindle;`."""
        return [piece.text for piece in self.pieces[:2]] == ["*", "="]

    @property
    def goes_on(self) -> bool:
        """Return True if the row continues the one before without a bracket that says so."""
        behind = self.behind
        if self.closes is not None or self.stands_below:
            return False
        if behind is None or behind.text in (";", ",", "}"):
            joining = bool(self.pieces) and self.pieces[0].text in _JOINING and not self._sets_others
            return behind is not None and behind.text == "}" and joining
        if behind.text in _LEFT_OPEN:
            return True
        if not self.pieces or self._sets_others:
            return False
        first = self.pieces[0]
        return first.text in _JOINING or first.text in ("(", "[") or first.tokens[0].kind in (STRING, *NUMBERS)

    def _expanded(self) -> list[int] | None:
        """By character, its distance in the row; None where no tab makes this differ from its position."""
        if "\t" not in self.raw:
            return None
        distances, column = [0], 0
        for character in self.raw:
            column = 0 if character == "\n" else column + (self.tab - column % self.tab if character == "\t" else 1)
            distances.append(column)
        return distances


def written(token: Token) -> str:
    """The token as in the file; the lexer makes one blank of a comment."""
    return token.source.text[token.offset : token.end]
