"""The pieces of a line, tokens that belong together, and the blanks between them.

A path, a unit and a number with its sign are one piece each. The parser finds the end of a unit, so that the `*` of `2
kg*m^2` is told from that of `2 * width`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise

from ic.formatting.row import Kind, Row, RowPiece
from ic.grammar.braced_names import name_length
from ic.grammar.cursor import OPENING
from ic.grammar.declared_units import TAKEN, declarations
from ic.grammar.expressions import Expressions
from ic.grammar.uses import USE
from ic.text.lexer import END, NAME, NUMBERS, SPACE, STRING, WHOLE, Text, Token, solid_tokens
from ic.text.limits import Findings
from met import units
from met.units import ONE

WORDS = ("and", "or", "not", "when", "require", "by", "in")
"""Words after which a value begins."""

OPERATORS = ("+", "-", "*", "/", "^", "=", "+=", "<", "<=", ">", ">=", "==", "!=", "..", "&&", "||")
_SIGNS = ("-", "+", "!")
_OPERANDS = ("name", "number", "unit", "string", "close")


def cut(rows: Iterable[Row]) -> None:
    """Give every row of code its pieces, without the comment at its end."""
    code = list(rows)
    tokens = [token for row in code for token in row.tokens]
    if not tokens:
        return
    parser = Expressions([*tokens, Token(END, "", tokens[-1].source, tokens[-1].end, 1)], Findings())
    parser.declared = dict.fromkeys(_declared_units(tokens), ONE)
    position = 0
    for row in code:
        row.pieces = _cut(row, position, parser)
        position += len(row.tokens)


def _declared_units(tokens: Sequence[Token]) -> Iterator[str]:
    """The units that a file of edition 2 declares, or has from another file: only units stand after a number."""
    if tokens[0].source.edition > 1:
        yield from declarations(tokens)
        for before, token in pairwise(tokens):
            if before.kind in NUMBERS and token.kind == NAME and token.text not in TAKEN:
                yield token.text


def _cut(row: Row, position: int, parser: Expressions) -> list[RowPiece]:
    """The pieces of one row, whose first token is the parser's token `position`."""
    pieces: list[RowPiece] = []
    line = row.whole[: len(row.whole) - (row.tail is not None)]
    operand = position > 0 and _ends_operand(parser.tokens[position - 1])
    i = end = 0
    comments = [k for k, token in enumerate(line) if token.kind == SPACE]
    while i < len(line):
        first = line[i]
        kind: Kind = "comment"
        count = 1
        if first.kind != SPACE:
            free = (comments[0] if comments else len(line)) - i
            kind, count = _piece(parser, position, free, pieces[-1] if pieces else None, operand)
            operand = kind in _OPERANDS and first.text != "}"
            position += count
        else:
            comments.pop(0)
        text = "".join(token.source.text[token.offset : token.end] for token in line[i : i + count])
        if kind == "string":  # the name of a file may have blanks
            text = first.source.text[first.offset : line[i + count - 1].end]
        column, last = row.column(first.offset), row.column(line[i + count - 1].end)
        before = column - end if pieces else 0
        pieces.append(RowPiece(kind, text, column, last - column, before, tuple(line[i : i + count])))
        i += count
        end = last
    return pieces


def _ends_operand(token: Token) -> bool:
    return (token.kind in (NAME, STRING, *NUMBERS) and token.text not in WORDS) or token.text in (")", "]", "%")


def _piece(parser: Expressions, position: int, free: int, before: RowPiece | None, operand: bool) -> tuple[Kind, int]:
    """The kind of the piece at the parser's token `position`, and its number of tokens, at most `free`."""
    token = parser.tokens[position]
    text = token.text
    if before is not None and operand and (length := _unit(parser, position, before)) and length <= free:
        return "unit", length
    if token.kind == NAME or 1 < name_length(parser.tokens, position) <= free:
        length = _path(parser, position, free)
        return ("word" if length == 1 and text in WORDS else "name"), length
    if token.kind in NUMBERS:
        return "number", _number(parser, position, free)
    if token.kind == STRING:
        return "string", 1
    if text == "<" and _is_used(parser.tokens[max(0, position - 2) : position]):
        closed = (n for n, part in enumerate(parser.tokens[position : position + free]) if part.text == ">")
        return ("string", 1 + length) if (length := next(closed, 0)) else ("operator", 1)
    if text in OPENING:
        return "open", 1
    if text in OPENING.values():
        return "close", 1
    if text in (";", ","):
        return "stop", 1
    if text in _SIGNS and not operand:
        if text != "!" and free > 1 and parser.tokens[position + 1].kind in NUMBERS:
            return "number", 1 + _number(parser, position + 1, free - 1)
        if text != "!" and free > 1 and parser.tokens[position + 1].kind == NAME:
            return "name", 1 + _path(parser, position + 1, free - 1)
        return "sign", 1
    return ("operator" if text in OPERATORS else "other"), 1


def _is_used(before: Sequence[Token]) -> bool:
    """Return True after the `use` that begins an entry, by the two tokens before."""
    return before[-1:] != [] and before[-1].text == USE and (len(before) == 1 or before[0].text in (";", "}"))


def _path(parser: Expressions, position: int, free: int) -> int:
    """The number of tokens of the path that begins here."""
    tokens = parser.tokens
    length = _name(tokens, position, free)
    while length + 2 <= free and tokens[position + length].text == ".":
        more = _name(tokens, position + length + 1, free - length - 1)
        if not more:
            break
        length += 1 + more
    return length


def _name(tokens: Sequence[Token], position: int, free: int) -> int:
    """The number of tokens of the name that begins here, `seg_{i}` among them; 0 where none does."""
    length = name_length(tokens, position)
    return length if length <= free else int(tokens[position].kind == NAME)


def _number(parser: Expressions, position: int, free: int) -> int:
    """The number of tokens of the number that begins here: three where it is written as a fraction, `1/3`."""
    number, line, below = parser.tokens[position : position + 3]
    fraction = free > 2 and line.text == "/" and below.kind in NUMBERS
    return 3 if fraction and number.end == line.offset and line.end == below.offset else 1


def _unit(parser: Expressions, position: int, before: RowPiece) -> int:
    """The number of tokens of the unit that begins after this piece; 0 where none does."""
    token, following = parser.tokens[position], parser.tokens[position + 1]
    over = None
    if token.kind == WHOLE and token.text == "1" and following.text == "/":
        over = parser.unit_factor(position + 2, -1, 0)
    if over is None and not (
        (token.kind == NAME or token.text == "%") and (token.text in units.ALL_UNITS or token.text in parser.declared)
    ):
        return 0
    if before.kind == "name" and following.text not in ("*", "/", "^"):  # a macro's name, perhaps: `TEETH V*s/rad`
        return 0
    product = parser.unit_product(position, 1, 0, over)
    return 0 if product is None else product[1] - position


def blanks_between(before: RowPiece, piece: RowPiece) -> int:
    """The number of blanks between two pieces of a line that are not aligned with anything."""
    wanted = _wanted(before, piece)
    own = min(piece.gap, 1)
    if before.kind == piece.kind == "number":
        return own
    if wanted is None:
        return own
    return wanted if wanted or not own or _stay_apart(before.text, piece.text) else own


def _wanted(before: RowPiece, piece: RowPiece) -> int | None:
    """The blanks between two pieces by their kinds; None to keep the author's choice of one or none."""
    first, second = before.kind, piece.kind
    if second == "stop" and first != "comment":
        return 1 if before.text == "{" else 0
    if first == "comment" or second == "comment":
        return None
    if first == "stop":
        if second == "close":
            return 1 if piece.text == "}" else 0
        return 2 if before.text == ";" else 1
    if "{" in (before.text, piece.text) or "}" in (before.text, piece.text):
        return _around_brace(before, piece)
    if first in ("open", "sign") or second == "close":
        return 0
    if before.text == "^" or piece.text == "^":
        return 0
    if "other" in (first, second):
        return None
    if piece.text == "(" and first == "name":
        return 0
    if second == "open" and first != "operator" and first != "word":
        return None
    return 1


def _around_brace(before: RowPiece, piece: RowPiece) -> int | None:
    """The blanks between two pieces of which one is a brace of a name."""
    if before.text == "{" or piece.text == "}":
        return 1
    if piece.text == "{":
        return 0 if before.text in ("(", "[") else 1
    if piece.kind == "close":
        return 0
    return 2 if piece.kind == "name" else 1


@lru_cache(maxsize=4096)
def _stay_apart(before: str, after: str) -> bool:
    """Return True if the lexer still separates two texts when nothing stands between them."""

    def texts(text: str) -> list[str]:
        return [token.text for token in solid_tokens(Text("", text))]

    return texts(before + after) == [*texts(before), *texts(after)]
