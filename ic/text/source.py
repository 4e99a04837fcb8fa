"""Text that was read, and its unreadable stretches."""

from __future__ import annotations

from ic.text.edition import edition_of
from met.diagnostic import Place
from met.frozen import frozen


@frozen
class UnreadableStretch:
    """A stretch of text that could not be read, which is already reported: any other mistake there follows from it.

    place   its first token; the line and column of its end
    names   what it may have named or defined
    within  the place of the block that it stands in, where it is not known which of its entries this is
    """

    place: Place
    end: tuple[int, int]
    names: tuple[str, ...]
    within: Place | None


@frozen
class SourceFile:
    """A file that was read: the name messages print, its text, SHA-256 of its bytes."""

    name: str
    text: str
    sha256: str

    @property
    def edition(self) -> int:
        """The edition of the deck language of the text; 1 for a file that is not a deck."""
        return edition_of(self.text)
