"""A deck's text, laid out; and the proof that nothing but its layout has changed."""

from __future__ import annotations

from collections.abc import Collection

from ic.formatting.layout import laid_out
from ic.formatting.row import BLANKS, written
from ic.formatting.tabs import rows_as_seen
from ic.text.lexer import SPACE, Text, Token, logical_lines
from met.diagnostic import Place, Problem, error

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
