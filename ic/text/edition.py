"""The edition of the deck language that a file is written in: its line `deck 2;`, before which only comments may stand.

What a deck means never changes within an edition. A file without the line is of edition 1.
"""

from __future__ import annotations

import re

from met.frozen import frozen

FIRST, LATEST = 1, 2
EDITIONS = (FIRST, LATEST)

EDITION_WORD = "deck"

_BLANK = re.compile(r"\s+|//[^\n]*|/\*(?s:.*?)\*/")
_HEADING = re.compile(rf"{EDITION_WORD}\s+(?P<number>[0-9]{{1,9}})(?![\w.])(?:\s*(?P<end>;))?")


@frozen
class Heading:
    """The line of a file that says its edition, by offsets in the text: where it begins and ends, and its number.

    closed  whether its `;` is there
    """

    edition: int
    first: int
    last: int
    number: tuple[int, int]
    closed: bool


def heading(text: str) -> Heading | None:
    """The heading of a file's text; None where it has none."""
    first = 0
    while blank := _BLANK.match(text, first):
        first = blank.end()
    matched = _HEADING.match(text, first)
    if matched is None:
        return None
    return Heading(
        int(matched["number"]), matched.start(), matched.end(), matched.span("number"), matched["end"] is not None
    )


def edition_of(text: str) -> int:
    """The edition of a file's text; the latest for an unknown one, which is reported."""
    edition_line = heading(text)
    if edition_line is None:
        return FIRST
    return edition_line.edition if edition_line.edition in EDITIONS else LATEST
