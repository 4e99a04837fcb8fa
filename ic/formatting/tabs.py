"""The author's tab stops. A deck does not state them, but they follow from its columns, which met for the author."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ic.formatting.align import ANCHORS, lines_of, meeting, neighbours
from ic.formatting.begins import stands_below
from ic.formatting.row import BLANK, CODE, REMARK, Row
from ic.formatting.rows import rows
from ic.text.lexer import Text

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
    return len(met) + sum(stands_below(row) for row in all_rows if row.tabbed) + _comments_met(all_rows)


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
