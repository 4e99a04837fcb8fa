"""Alignments: the pieces of neighbouring lines that the author has aligned.

Neighbours are lines of one block with no blank line between; lines within a nested block do not count. Two pieces are
aligned where they are of one family, one of them is set apart, and both begin at the same column, or end there, or
have their decimal points there. They stay as far out as they were, or go as far as they must.

A piece is set apart by two blanks at least, and by more than it needs. Other coincidences are by chance: a number and a
`<`, or two `=` with a blank before each.

Where one `=` of a paragraph of entries has more than it needs, all are aligned: so a longer name moves the others. For
this the `{` of `rates { ... }` is as good as a `=`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ic.formatting.pieces import blanks_between
from ic.formatting.row import BLANK, CODE, REMARK, Row, RowPiece

REACH = 3  # lines: two that are aligned may have as many less one between them
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
ANCHORS = ("start", "end", "point")
Anchor = str  # the part of the pieces of a group that is at one column
Node = tuple[int, int]  # a row's position, and that of a piece on it


class Groups:
    """Pieces by what they are aligned with. A piece is in one group at most.

    anchors  of all pieces that are in a group
    met      those whose anchors met others as they were written: they do not come closer to their line's beginning
    unsigned numbers behind a `[` and a blank, where a list of that name on a line nearby has a sign
    """

    def __init__(self) -> None:
        self.anchors: dict[Node, Anchor] = {}
        self.met: set[Node] = set()
        self.unsigned: set[Node] = set()
        self._leaders: dict[Node, Node] = {}

    def group(self, node: Node) -> Node | None:
        """The piece that represents the group of this one."""
        if node not in self.anchors:
            return None
        while self._leaders[node] != node:
            self._leaders[node] = node = self._leaders[self._leaders[node]]
        return node

    def join(self, piece: Node, other: Node, anchor: Anchor) -> None:
        """Aligns two pieces by this anchor, unless one is aligned by another anchor already."""
        if any(self.anchors.get(node, anchor) != anchor for node in (piece, other)):
            return
        for node in (piece, other):
            if node not in self.anchors:
                self.anchors[node], self._leaders[node] = anchor, node
        first, second = self.group(piece), self.group(other)
        assert first is not None and second is not None
        self._leaders[second] = first


def offset(piece: RowPiece, anchor: Anchor) -> int:
    """The distance, in characters, from the start of a piece to its anchor."""
    if anchor == "start":
        return 0
    return len(piece.text) if anchor == "end" else len(piece.text.partition(".")[0])


def aligned(all_rows: Sequence[Row], *, paragraphs: bool) -> Groups:
    """The groups of all rows. paragraphs: whether a `=` that is alone in its wide gap moves the others"""
    groups = Groups()
    separators = {index: sign for index, row in enumerate(all_rows) if (sign := _separator(row)) is not None}
    paragraph: dict[int, int] = {}  # rows that have a separator, by the first of their paragraph
    for rows in _paragraphs(all_rows, separators) if paragraphs else ():
        if len(rows) > 1 and any(_is_wide(all_rows[index].pieces, separators[index]) for index in rows):
            for index in rows:
                paragraph[index] = rows[0]
                groups.join((rows[0], separators[rows[0]]), (index, separators[index]), "start")
    lines = lines_of(all_rows)
    pairs = [pair for pair in neighbours(all_rows) if _may_meet(lines[pair[0]], lines[pair[1]])]
    for pair in pairs:
        for signed, bare in (pair, pair[::-1]):
            groups.unsigned |= {(bare, index) for index in _unsigned(lines[signed].lists, lines[bare].lists)}
    for anchor in ANCHORS:
        for above, other in pairs:
            together = above in paragraph and paragraph[above] == paragraph.get(other)
            for first, second in meeting(lines[above], lines[other], anchor):
                if together and _side(first, separators[above]) != _side(second, separators[other]):
                    continue
                groups.join((above, first), (other, second), anchor)
                groups.met |= {(above, first), (other, second)}
    return groups


class AlignedLine:
    """A row's pieces, and their possible alignments with pieces of other rows.

    wide      those that are set apart
    entries   those that begin an entry within the line
    families  of each piece, what it may be aligned with: its like, in as many brackets of the line
    lists     of each list that begins with a number: its name, which piece that number is, and the number
    columns   by anchor, the pieces by the column of their anchor as it was written, from where the line begins
    """

    __slots__ = ("_columns", "entries", "families", "lists", "pieces", "wide")

    def __init__(self, pieces: Sequence[RowPiece]) -> None:
        self.pieces = pieces
        self.wide = {index for index in range(1, len(pieces)) if _is_wide(pieces, index)}
        self.families = list(_families(pieces))
        self.entries = {index for index in range(1, len(pieces)) if pieces[index - 1].text == ";"}
        self.lists = [
            (pieces[index - 3].text, index, pieces[index])
            for index in range(3, len(pieces))
            if _begins_list(pieces, index)
        ]
        self._columns: dict[Anchor, dict[int, int]] = {}

    def columns(self, anchor: Anchor) -> dict[int, int]:
        """The places at which the line's pieces could be aligned, as columns from its first piece, each with the
        piece's index. anchor: the part of a piece that is aligned."""
        if anchor not in self._columns:
            columns: dict[int, int] = {}
            start = self.pieces[0].column
            for index, piece in enumerate(self.pieces):
                if index and (anchor != "point" or piece.kind == "number"):
                    inside = piece.written if anchor == "end" else offset(piece, anchor)
                    columns[piece.column - start + inside] = index
            self._columns[anchor] = columns
        return self._columns[anchor]


def lines_of(all_rows: Sequence[Row]) -> dict[int, AlignedLine]:
    """The lines whose pieces may be aligned, by the position of their row."""
    return {index: AlignedLine(row.pieces) for index, row in enumerate(all_rows) if row.kind == CODE and not row.exact}


def _families(pieces: Sequence[RowPiece]) -> Iterator[tuple[int, str]]:
    """For each piece of a line how deep it is in brackets, and the family of pieces with which it may be aligned."""
    depth, before = 0, ""
    for piece in pieces:
        depth -= piece.kind == "close"
        called = piece.text == "(" and before == "name" and not piece.gap
        yield depth, "(" if called else _family(piece)
        depth, before = depth + (piece.kind == "open"), piece.kind


def _family(piece: RowPiece) -> str:
    """The family of pieces with which a piece may be aligned, such as "=" or "value"."""
    if piece.text in ("=", "+=", "{"):
        return "="
    if piece.text in COMPARISONS:
        return "<"
    if piece.kind in ("operator", "other"):
        return piece.text
    return piece.kind if piece.kind in ("unit", "close", "stop", "comment") else "value"


def _begins_list(pieces: Sequence[RowPiece], index: int) -> bool:
    return pieces[index].kind == "number" and pieces[index - 1].text == "[" and pieces[index - 2].text in ("=", "+=")


def _unsigned(lists: Sequence[tuple[str, int, RowPiece]], others: Sequence[tuple[str, int, RowPiece]]) -> Iterator[int]:
    """Numbers of `others` with a blank before them, where a list of the same name in `lists` has a sign."""
    signed = {name for name, _, number in lists if number.text[0] in "+-"}
    for name, index, number in others:
        if name in signed and number.gap == 1 and number.text[0] not in "+-":
            yield index


def _may_meet(line: AlignedLine, other: AlignedLine) -> bool:
    return bool(line.wide or other.wide or (line.entries and other.entries))


def meeting(line: AlignedLine, other: AlignedLine, anchor: Anchor) -> Iterator[tuple[int, int]]:
    """Pieces of two lines whose anchors meet, one of them set apart. Behind the first word they may be of any family.

    Entries of one name also meet where one of them has two blanks before it, as where one blank is thought enough.
    """
    above = line.columns(anchor)
    for column, index in other.columns(anchor).items():
        met = above.get(column)
        if met is None or (line.families[met] != other.families[index] and not met == index == 1):
            continue
        if met in line.wide or index in other.wide or (anchor == "start" and _is_one_entry(line, met, other, index)):
            yield met, index


def _is_one_entry(line: AlignedLine, first: int, other: AlignedLine, second: int) -> bool:
    """Return True if two pieces begin entries of one name, with different blanks before them."""
    above, below = line.pieces[first], other.pieces[second]
    entries = first in line.entries and second in other.entries
    return entries and above.text == below.text and above.gap != below.gap


def _side(piece: int, separator: int) -> int:
    return (piece > separator) - (piece < separator)


def _separator(row: Row) -> int | None:
    """The position of the piece between an entry's name and the rest; None where there is none."""
    if row.kind != CODE or row.exact or row.closes is not None:
        return None
    for index, piece in enumerate(row.pieces):
        if piece.text in ("=", "+=") or (piece.text == "{" and index == 1):
            return index or None
        if piece.kind not in ("name", "word") and (index or piece.text != "*"):
            return None
    return None


def _paragraphs(all_rows: Sequence[Row], separators: Mapping[int, int]) -> Iterator[list[int]]:
    """Neighbouring similar entries: with equally many words before the separator, the first one the same."""
    rows: list[int] = []
    for index, row in enumerate(all_rows):
        if row.kind == REMARK:
            continue
        if index in separators:
            if rows and not _alike(all_rows[rows[-1]], all_rows[index], separators[rows[-1]], separators[index]):
                yield rows
                rows = []
            rows.append(index)
        elif rows:
            yield rows
            rows = []
    if rows:
        yield rows


def _alike(row: Row, other: Row, first: int, second: int) -> bool:
    alike = row.parent == other.parent and first == second
    alike = alike and row.goes_on == other.goes_on and row.stands_below == other.stands_below
    return alike and (first == 1 or row.pieces[0].text == other.pieces[0].text)


def neighbours(all_rows: Sequence[Row]) -> Iterator[tuple[int, int]]:
    """Positions of rows that stand below each other in one bracket, at most REACH apart."""
    last: dict[tuple[int, int], dict[tuple[bool, bool], list[int]]] = {}  # by bracket, and by how the row begins
    for index, row in enumerate(all_rows):
        bracket = (id(row.parent[0]), row.parent[1]) if row.parent else (0, 0)
        if row.kind == BLANK:
            last.pop(bracket, None)
        elif row.kind == CODE and not row.exact and row.closes is None:
            block, how = last.setdefault(bracket, {}), (row.goes_on, row.stands_below)
            yield from ((other, index) for other in block.get(how, ()))
            block[how] = [*block.get(how, ())[1 - REACH :], index]


def _is_wide(pieces: Sequence[RowPiece], index: int) -> bool:
    """Return True if this piece is set apart. After a `[` one blank is enough, as in `[ 90, 5]` below `[-90, 5]`."""
    before, piece = pieces[index - 1], pieces[index]
    needed = blanks_between(before, piece)
    least = 1 if before.text == "[" or (before.kind == "open" and piece.kind == "number") else 2
    return index > 0 and piece.kind != "stop" and piece.gap > needed and piece.gap >= least
