"""A deck's text, laid out; and the proof that nothing but its layout has changed.

A line begins four blanks to the right of the line that opened its bracket, and four more where it continues an entry.
After a bracket that is not the last of its line it may stand below the text after the bracket, if it did. Comments at
the ends of lines keep their places, at least two blanks after their line, and stay aligned.

Columns depend on columns to their left and on lines further out, and grow only: the rows are gone through until nothing
moves.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ic.formatting.align import ANCHORS, Groups, Node, aligned, lines_of, meeting, neighbours, offset
from ic.formatting.pieces import blanks_between
from ic.formatting.row import BLANK, BLANKS, CODE, REMARK, TAB, Row, written
from ic.formatting.rows import rows
from ic.text.lexer import SPACE, Text, Token, logical_lines
from met.diagnostic import Place, Problem, error

OTHER_STOPS = (8, 2)  # the default of terminals, and the narrowest setting of editors


def rows_as_seen(source: Text, making_strings: Collection[str] = ()) -> list[Row]:
    """The rows of a file with the tab stops at which most of its columns meet; of equals, those that `rows` takes.

    Raises Problem as `rows` does.
    """
    all_rows = rows(source, making_strings)
    if not any(row.tabbed for row in all_rows if row.kind == CODE and not row.exact):
        return all_rows
    return max((all_rows, *(rows(source, making_strings, tab) for tab in OTHER_STOPS)), key=_met)


def _met(all_rows: Sequence[Row]) -> int:
    """A score of tab stops: the number of pieces exactly below those with which they may have been aligned."""
    lines = lines_of(all_rows)
    met = {
        (above, first, other, second)
        for above, other in neighbours(all_rows)
        if all_rows[above].tabbed or all_rows[other].tabbed
        for anchor in ANCHORS
        for first, second in meeting(lines[above], lines[other], anchor)
    }
    return len(met) + sum(row.stands_below for row in all_rows if row.tabbed) + _comments_met(all_rows)


def _comments_met(all_rows: Sequence[Row]) -> int:
    """The number of comments below one that ends a line of the same paragraph."""
    met, above = 0, -1
    for row in all_rows:
        if row.kind == BLANK:
            above = -1
        elif row.tail is not None:
            met += row.tail.column == above
            above = row.tail.column
        elif row.kind == REMARK:
            met += row.column(row.whole[0].offset) == above
    return met


BEFORE_COMMENT = 2
MOST_WORK = 3_000_000  # columns looked at; a deck by hand takes some thousand
MOST_BLANK = 2  # lines at the top level; within a bracket it is one


def laid_out(rows: Sequence[Row]) -> str:
    """The text of these rows as `met fmt` writes it: indented, aligned, and with few blank lines."""
    columns = _columns(rows)
    tails = _tails(rows, columns)
    keep = any(token.text == "__LINE__" for row in rows for token in row.tokens)  # which counts blank lines too
    lines: list[str] = []
    blank, above = 0, None
    for index, row in enumerate(rows):
        if row.kind == BLANK and not row.exact:
            blank += 1
            continue
        lines += [""] * (blank if keep else min(blank, _most_blank(above, row)))
        blank, above = 0, row
        lines.append(_text(row, columns[index], tails[index]))
    return "".join(f"{line}\n" for line in lines)


def _most_blank(above: Row | None, row: Row) -> int:
    """The largest number of blank lines between two rows: none at the edges of a block and of the file."""
    if above is None or row.closes is not None or (above.pieces and above.pieces[-1].kind == "open"):
        return 0
    return 1 if row.parent else MOST_BLANK


def _text(row: Row, columns: Sequence[int], tail: int) -> str:
    """The text of a row, its pieces at these columns, and its comment at column `tail`."""
    if row.exact:
        return "\n".join(line.rstrip(BLANKS) for line in row.raw.split("\n"))
    if row.kind == REMARK:
        return _remark(row, tail if tail >= 0 else columns[0])
    line = ""
    for piece, column in zip(row.pieces, columns, strict=True):
        line += " " * (column - len(line)) + piece.text
    if row.tail is not None:
        line += " " * (tail - len(line)) + row.tail.text
    return line


def _remark(row: Row, column: int) -> str:
    """The text of a separate comment; the further lines of a long one move with its first."""
    first, *others = row.raw.split("\n")
    moved = column - row.column(row.whole[0].offset)
    lines = [" " * column + first.strip(BLANKS)]
    for line in others:
        text = line.strip(BLANKS)
        before = len(line[: len(line) - len(line.lstrip(BLANKS))].expandtabs(row.tab))
        lines.append(" " * max(0, before + moved) + text if text else "")
    return "\n".join(lines)


def _columns(rows: Sequence[Row]) -> list[list[int]]:
    """The column of each piece of each row; for a comment row, that of the comment.

    Columns of the author's are consistent with each other. Those of a paragraph that is to be aligned need not be, and
    a generated deck may have more of either than time allows: then less is aligned.
    """
    for paragraphs in (True, False):
        columns = _settled(rows, aligned(rows, paragraphs=paragraphs))
        if columns is not None:
            return columns
    columns = _settled(rows, Groups())
    assert columns is not None, "rows that are aligned with nothing move once"
    return columns


def _settled(rows: Sequence[Row], groups: Groups) -> list[list[int]] | None:
    """The columns with these alignments, None where they do not settle."""
    columns = [_as_written(row) for row in rows]
    reached: dict[Node, int] = {}  # by group: the column of its anchors
    positions = {id(row): index for index, row in enumerate(rows)}
    free = [
        (index, row, row.stands_below, TAB * row.goes_on)
        for index, row in enumerate(rows)
        if row.kind in (CODE, REMARK) and not row.exact
    ]
    steps = {index: _steps(index, row, groups) for index, row, _, _ in free}
    for index, _, _, _ in free:
        columns[index] = [0] * max(1, len(steps[index]))
    work, moved = 0, True
    while moved:
        if work > MOST_WORK:
            return None
        moved = False
        for index, row, below, further in free:
            old = columns[index]
            column = start = _indentation(row, positions, columns, below) + further
            new = [start]
            for distance, group, inside, own in steps[index][1:]:
                column += distance
                if group is not None:
                    column = max(column, start + own, reached.get(group, 0) - inside)
                    reached[group] = column + inside
                new.append(column)
            if new != old:
                columns[index] = new
                moved = True
            work += len(new)
    return columns


def _steps(index: int, row: Row, groups: Groups) -> list[tuple[int, Node | None, int, int]]:
    """For each piece: the smallest distance of its column from the one before; its group, the anchor's offset in it,
    and the smallest distance from the row's beginning."""
    steps: list[tuple[int, Node | None, int, int]] = [(0, None, 0, 0)] if row.pieces else []
    for i in range(1, len(row.pieces)):
        before, piece = row.pieces[i - 1 : i + 1]
        group = groups.group((index, i))
        inside = offset(piece, groups.anchors[group]) if group is not None else 0
        distance = len(before.text) + blanks_between(before, piece) + ((index, i) in groups.unsigned)
        own = piece.column - row.pieces[0].column if (index, i) in groups.met else 0
        steps.append((distance, group, inside, own))
    return steps


def _as_written(row: Row) -> list[int]:
    columns = [piece.column for piece in row.pieces]
    return [row.column(row.whole[0].offset), *columns[1:]] if row.whole else []


def _indentation(row: Row, positions: dict[int, int], columns: Sequence[Sequence[int]], below: bool) -> int:
    """The column, from 0, of a row that does not continue another."""
    if row.closes is not None:
        return columns[positions[id(row.closes)]][0]
    if row.parent is None:
        return 0
    outer, opener = row.parent
    return columns[positions[id(outer)]][opener + 1 if below else 0] + TAB * (not below)


def _tails(rows: Sequence[Row], columns: Sequence[Sequence[int]]) -> list[int]:
    """The column of each comment at the end of a line, and of those that continue one below; -1 for all others."""
    tails = [-1] * len(rows)
    paragraph: list[int] = []
    for index, row in enumerate([*rows, None]):
        if row is None or row.kind == BLANK:
            _settle(rows, columns, paragraph, tails)
            paragraph = []
        elif row.kind == CODE and row.tail is not None and not row.exact:
            paragraph.append(index)
    written = -1
    for index, row in enumerate(rows):
        if row.tail is not None:
            written = row.tail.column
            tails[index] = written if row.exact else tails[index]
        elif row.kind == REMARK and not row.exact and index and row.column(row.whole[0].offset) == written:
            tails[index] = tails[index - 1]
        else:
            written = -1
    return tails


def _settle(rows: Sequence[Row], columns: Sequence[Sequence[int]], paragraph: Sequence[int], tails: list[int]) -> None:
    """Give the comments of a paragraph's rows one column where they were below each other."""
    places: dict[int, list[int]] = {}
    for index in paragraph:
        tail = rows[index].tail
        assert tail is not None
        places.setdefault(tail.column, []).append(index)
    for column, together in places.items():
        ends = [columns[index][-1] + len(rows[index].pieces[-1].text) for index in together]
        row = rows[together[0]]
        if len(together) == 1:  # alone: as far from its line as before
            written = row.column(row.whole[-2].end)
            column = ends[0] + column - written
        column = max(column, max(ends) + BEFORE_COMMENT)
        for index in together:
            tails[index] = column


MOST_PASSES = 10


def formatted(name: str, text: str, making_strings: Collection[str] = ()) -> str:
    """The text laid out. `name` is the file's, for messages; `making_strings` as in `rows`.

    Raises Problem where the text is broken, and E340 where laying it out would change what it says.
    """
    laid = text
    for _ in range(MOST_PASSES):  # accidental alignments may need a second pass
        before = laid
        laid = laid_out(rows_as_seen(Text(name, before), making_strings))
        if laid == before:
            break
    prove(name, text, laid)
    return laid


def prove(name: str, before: str, after: str) -> None:
    """Raise Problem E340 where two texts do not have the same tokens, line by line, and the same comments."""
    old, new = _lines(Text(name, before)), _lines(Text(name, after))
    index = next((i for i, (line, other) in enumerate(zip(old, new, strict=False)) if line[0] != other[0]), None)
    if index is None and len(old) != len(new):
        index = min(len(old), len(new))
    if index is None and _characters(before) == _characters(after):
        return
    place = old[min(index or 0, len(old) - 1)][1] if old else Place(name, 1, 1)
    message = "laying out this deck would change what it says, so it is left as it is: a defect of MET"
    raise Problem(error("E340", message, place, help="please report it together with the deck"), {name: before})


def _characters(text: str) -> str:
    """All non-blank characters."""
    return "".join(text.split())


def _lines(source: Text) -> list[tuple[list[str], Place]]:
    """The words of each line that is not blank, comments included, and where the line begins."""
    lines = []
    for line in logical_lines(source):
        words = [word for token in line if (word := _token_word(token))]
        if words:
            first = next(token for token in line if _token_word(token))
            lines.append((words, first.place))
    return lines


def _token_word(token: Token) -> str:
    """A token as written, a comment without the blanks at the ends of its lines; empty for white space."""
    text = written(token)
    text = Text("", text).joined if "\\" in text else text
    if token.kind == SPACE and text[:1] != "/":
        return ""
    return "\n".join(line.strip(BLANKS) for line in text.split("\n")) if token.kind == SPACE else text
