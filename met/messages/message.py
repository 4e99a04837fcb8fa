"""A message to a user as data: the mistake, its places and the remedies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from met.frozen import frozen


def nearest(word: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The known word that is most similar to this one; None where none is at least `cutoff` similar (1: the same
    word)."""
    import difflib  # imported only after a mistake

    close = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return close[0] if close else None


def meant(word: str, known: Iterable[str]) -> str | None:
    """The known word that was probably meant, regardless of capitals; None where there is none."""
    folded = {candidate.lower(): candidate for candidate in dict.fromkeys(known)}
    close = nearest(word.lower(), folded)
    return folded[close] if close is not None else None


def did_you_mean(word: str, known: Iterable[str]) -> tuple[str, ...]:
    """The help line that offers the word that was probably meant, with the change that writes it; none where there is
    no such word."""
    close = meant(word, known)
    return (Help(f"did you mean `{close}`?", TextChange(close, word)),) if close is not None else ()


Severity = Literal["error", "warning", "note"]
Where = Literal["instead", "value", "before", "behind", "inside", "entry", "head"]


@frozen
class Place:
    """A stretch of one line of a source file.

    line and column count from 1; a column counts characters, not bytes. `expansions` is not empty for a token
    that a macro or a loop made: the token is then written at this place, in the macro's body, in an argument or in the
    loop's body. Each expansion, innermost first, says through which macro it came and where that macro was used; behind
    those, likewise, come the iterations of loops.
    `included` is the chain of lines that led to the file, innermost first: `#include`, but for those at the positions
    `used`, which `use` it.
    """

    file: str
    line: int
    column: int
    length: int = 1
    expansions: tuple[Expansion, ...] = ()
    included: tuple[tuple[str, int], ...] = ()
    used: tuple[int, ...] = ()

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    @property
    def came_by(self) -> tuple[tuple[str, int, str], ...]:
        """The chain of lines that led to the file, innermost first: file, line, and "included from" or "used at"."""
        words = ("used at" if n in self.used else "included from" for n in range(len(self.included)))
        return tuple((file, line, word) for (file, line), word in zip(self.included, words, strict=True))

    @property
    def macros(self) -> tuple[Expansion, ...]:
        """The steps of macro expansion alone, without iterations of loops."""
        return self.expansions[: macro_count(self.expansions)]

    @property
    def iterations(self) -> tuple[Expansion, ...]:
        """The iterations of loops alone, the innermost loop's first."""
        return self.expansions[macro_count(self.expansions) :]


@frozen
class Expansion:
    """One step of macro expansion, or one iteration of a loop.

    macro      the macro's name; of a loop, that of its index
    use        the place where the macro was used; the first words of the loop
    iteration  of a loop, what its index stands for in this iteration; "" of a macro
    """

    macro: str
    use: Place
    iteration: str = ""

    def __str__(self) -> str:
        """The text of an iteration of a loop in messages: `i = 7`."""
        return f"{self.macro} = {self.iteration}"


def macro_count(expansions: tuple[Expansion, ...]) -> int:
    """The number of steps of macro expansion, which come before the iterations of loops."""
    count = len(expansions)
    while count and expansions[count - 1].iteration:
        count -= 1
    return count


@frozen
class Label:
    """A place and a few words about it, printed beside its caret."""

    place: Place
    text: str = ""


@frozen
class TextChange:
    """The change that a line of help asks for in the deck's text (`met.messages.edits` finds its stretch).

    new    the text to write; "" where something is left out
    old    the words in whose place it stands, of which one at least is at the place; None: all of the place
    at     the place; None: that of the diagnostic
    where  "instead"  in place of that
           "value"    in place of that, which is a whole value
           "before"   before it
           "behind"   behind it, which is a whole value
           "inside"   at the beginning of the block of what is defined there
           "entry"    in place of the whole entry of a block that it stands in
           "head"     as the first line of its file, behind the one that says the edition
    """

    new: str
    old: str | None = None
    at: Place | None = None
    where: Where = "instead"


class Help(str):
    """One line of help, and alternative changes of the deck's text that carry it out; none where a person has to write
    it."""

    __slots__ = ("changes",)

    changes: tuple[TextChange, ...]

    def __new__(cls, text: str, *changes: TextChange) -> Help:
        help_text = super().__new__(cls, text)
        help_text.changes = changes
        return help_text


def write(
    new: str, text: str = "", *, old: str | None = None, at: Place | None = None, where: Where = "instead"
) -> Help:
    """The help that says what to write, "write `2 m`" or the given text, with its change; see `TextChange`."""
    return Help(text or f"write `{new}`", TextChange(new, old, at, where))


def write_either(news: Iterable[str], text: str = "", *, old: str | None = None, where: Where = "instead") -> Help:
    """The help that offers several texts to write, "write `30 deg` or `30 rad`", or a text that ends so."""
    texts = tuple(news)
    offer = f"{text}write {' or '.join(f'`{new}`' for new in texts)}"
    return Help(offer, *(TextChange(new, old, None, where) for new in texts))


def leave_out(text: str, at: Place | None = None) -> Help:
    """The help that says to leave out an entry of a block, with its change; the place lies in the entry."""
    return Help(text, TextChange("", None, at, "entry"))


@frozen
class Diagnostic:
    """One message for a user: the mistake, its place, the reason and the remedies."""

    code: str
    message: str
    at: Label | None = None
    also: tuple[Label, ...] = ()
    help: tuple[str, ...] = ()  # each may be a `Help`, which carries a change of the text
    severity: Severity = "error"


def shown_place(place: Place) -> Place:
    """The place where the deck's author should look: the place itself, or the outermost use of the macro that made it.

    A macro's body stands before its uses, or in another file; what stands behind the use is one of its arguments.
    """
    if not place.macros:
        return place
    use = place.macros[-1].use
    argument = place.file == use.file and (place.line, place.column) > (use.line, use.column)
    return place if argument and place.included == use.included else use
