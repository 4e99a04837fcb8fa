"""Which pieces of neighbouring lines the author has aligned.

Neighbours are lines of one block with no blank line between; lines within a nested block do not count. Two pieces are
aligned where one of them has more blanks before it than it needs, and both begin at the same column, or end there, or
have their decimal points there. They stay as far out as they were, or go as far as they must.

Where one `=` of a paragraph of entries has more than it needs, all are to be aligned: so a name that has become longer
takes the others with it. For this the `{` of `rates { ... }` is as good as a `=`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ic.formatting.begins import goes_on, stands_below
from ic.formatting.pieces import Piece, gap
from ic.formatting.rows import BLANK, CODE, REMARK, Row

REACH = 3  # lines: two that are aligned may have as many less one between them
ANCHORS = ("start", "end", "point")
Anchor = str  # what of the pieces of a group is at one column
Node = tuple[int, int]  # a row's position, and that of a piece on it


class Groups:
    """Pieces by what they are aligned with. A piece is in one group at most.

    anchors  of all pieces that are in a group
    met      those whose anchors met others as they were written: they do not come closer to their line's beginning
    """

    def __init__(self) -> None:
        self.anchors: dict[Node, Anchor] = {}
        self.met: set[Node] = set()
        self._leaders: dict[Node, Node] = {}

    def group(self, node: Node) -> Node | None:
        """A piece that stands for the group of this one."""
        if node not in self.anchors:
            return None
        while self._leaders[node] != node:
            self._leaders[node] = node = self._leaders[self._leaders[node]]
        return node

    def join(self, one: Node, other: Node, anchor: Anchor) -> None:
        """Aligns two pieces by this anchor, unless one is aligned by another anchor already."""
        if any(self.anchors.get(node, anchor) != anchor for node in (one, other)):
            return
        for node in (one, other):
            if node not in self.anchors:
                self.anchors[node], self._leaders[node] = anchor, node
        first, second = self.group(one), self.group(other)
        assert first is not None and second is not None
        self._leaders[second] = first


def offset(piece: Piece, anchor: Anchor) -> int:
    """How far behind the piece's first character its anchor is."""
    if anchor == "start":
        return 0
    return len(piece.text) if anchor == "end" else len(piece.text.partition(".")[0])


def aligned(found: Sequence[Row], *, paragraphs: bool) -> Groups:
    """The groups of all rows. paragraphs: whether a `=` that is alone in its wide gap takes the others with it."""
    groups = Groups()
    separators = {at: sign for at, row in enumerate(found) if (sign := _separator(row)) is not None}
    paragraph: dict[int, int] = {}  # rows that have a separator, by the first of their paragraph
    for rows in _paragraphs(found, separators) if paragraphs else ():
        if len(rows) > 1 and any(_is_wide(found[at].pieces, separators[at]) for at in rows):
            for at in rows:
                paragraph[at] = rows[0]
                groups.join((rows[0], separators[rows[0]]), (at, separators[at]), "start")
    lines = {at: _Line(row.pieces) for at, row in enumerate(found) if row.kind == CODE and not row.exact}
    pairs = [pair for pair in _neighbours(found) if _may_meet(lines[pair[0]], lines[pair[1]])]
    for anchor in ANCHORS:
        for one, other in pairs:
            together = one in paragraph and paragraph[one] == paragraph.get(other)
            for first, second in _meeting(lines[one], lines[other], anchor):
                if together and _side(first, separators[one]) != _side(second, separators[other]):
                    continue
                groups.join((one, first), (other, second), anchor)
                groups.met |= {(one, first), (other, second)}
    return groups


class _Line:
    """What alignment asks of the pieces of a row.

    wide     those that have more blanks before them than they need
    entries  those that begin an entry within the line
    columns  by anchor, the pieces by the column of their anchor as it was written, from where the line begins
    """

    __slots__ = ("_columns", "entries", "pieces", "wide")

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self.pieces = pieces
        self.wide = {at for at in range(1, len(pieces)) if _is_wide(pieces, at)}
        self.entries = {at for at in range(1, len(pieces)) if pieces[at - 1].text == ";"}
        self._columns: dict[Anchor, dict[int, int]] = {}

    def columns(self, anchor: Anchor) -> dict[int, int]:
        if anchor not in self._columns:
            found: dict[int, int] = {}
            start = self.pieces[0].column
            for at, piece in enumerate(self.pieces):
                if at and (anchor != "point" or piece.kind == "number"):
                    inside = piece.written if anchor == "end" else offset(piece, anchor)
                    found[piece.column - start + inside] = at
            self._columns[anchor] = found
        return self._columns[anchor]


def _may_meet(one: _Line, other: _Line) -> bool:
    return bool(one.wide or other.wide or (one.entries and other.entries))


def _meeting(one: _Line, other: _Line, anchor: Anchor) -> Iterator[tuple[int, int]]:
    """Pieces of two lines whose anchors meet, one of them with more blanks before it than it needs.

    Entries within lines also meet where the blanks before them differ, as where one blank is thought enough.
    """
    above = one.columns(anchor)
    for column, at in other.columns(anchor).items():
        met = above.get(column)
        if met is None:
            continue
        entries = met in one.entries and at in other.entries
        if met in one.wide or at in other.wide or (entries and one.pieces[met].gap != other.pieces[at].gap):
            yield met, at


def _side(piece: int, separator: int) -> int:
    return (piece > separator) - (piece < separator)


def _separator(row: Row) -> int | None:
    """Which piece of an entry stands between its name and the rest, if one does."""
    if row.kind != CODE or row.exact or row.closes is not None:
        return None
    for at, piece in enumerate(row.pieces):
        if piece.text in ("=", "+=") or (piece.text == "{" and at == 1):
            return at or None
        if piece.kind not in ("name", "word"):
            return None
    return None


def _paragraphs(found: Sequence[Row], separators: Mapping[int, int]) -> Iterator[list[int]]:
    """Entries that follow one another and are alike: as many words before the separator, the first one the same."""
    rows: list[int] = []
    for at, row in enumerate(found):
        if row.kind == REMARK:
            continue
        if at in separators:
            if rows and not _alike(found[rows[-1]], found[at], separators[rows[-1]], separators[at]):
                yield rows
                rows = []
            rows.append(at)
        elif rows:
            yield rows
            rows = []
    if rows:
        yield rows


def _alike(one: Row, other: Row, first: int, second: int) -> bool:
    alike = one.parent == other.parent and first == second
    alike = alike and goes_on(one) == goes_on(other) and stands_below(one) == stands_below(other)
    return alike and (first == 1 or one.pieces[0].text == other.pieces[0].text)


def _neighbours(found: Sequence[Row]) -> Iterator[tuple[int, int]]:
    """Positions of rows that stand below each other in one bracket, at most REACH apart."""
    last: dict[tuple[int, int], dict[tuple[bool, bool], list[int]]] = {}  # by bracket, and by how the row begins
    for at, row in enumerate(found):
        bracket = (id(row.parent[0]), row.parent[1]) if row.parent else (0, 0)
        if row.kind == BLANK:
            last.pop(bracket, None)
        elif row.kind == CODE and not row.exact and row.closes is None:
            block, how = last.setdefault(bracket, {}), (goes_on(row), stands_below(row))
            yield from ((other, at) for other in block.get(how, ()))
            block[how] = [*block.get(how, ())[1 - REACH :], at]


def _is_wide(pieces: Sequence[Piece], at: int) -> bool:
    """Whether this piece has more blanks before it than it needs."""
    return at > 0 and pieces[at].kind != "stop" and pieces[at].gap > gap(pieces[at - 1], pieces[at])
