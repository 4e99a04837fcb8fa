"""Text to tokens, each of which knows exactly where it was written.

One regular expression cuts a whole file. Numbers are decimal with an optional exponent and never swallow a unit or a
range: `0.061`, `1e-3`, `.5`, `10mm` (a number and a name), `1..50` (a number, `..`, a number). What cannot be a token
becomes a token of kind BAD, and is complained about only where it reaches the deck: text that `#if` leaves out may be
anything. A backslash at a line's end joins it to the next, before anything else and in the middle of a word or comment
too, as in C.

The kinds have the names that pcpp asks for, and a token answers to pcpp's names for its fields as well (`type`,
`value`, `lexpos`, `lineno`): the same objects go through the preprocessor and on to the parser.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import Any

from ic.text.edition import Heading, edition_of, heading
from ic.text.limits import Findings
from met.diagnostic import Expansion, Place, write

NAME = "CPP_ID"
WHOLE = "CPP_INTEGER"
DECIMAL = "CPP_FLOAT"
STRING = "CPP_STRING"
CHARACTER = "CPP_CHAR"
SPACE = "CPP_WS"
BAD = "BAD"  # no token; with an empty text where that has been said
END = "END"
PASTE = "CPP_DPOUND"
NOTHING = "NOTHING"  # stands for an empty argument while `##` joins, and where a directive was
LEFT = "LEFT"  # stands behind what a macro made, whose name is its text
HASHES = "HASHES"  # a `##` that joins nothing: in an argument, or one that was joined itself
COMMAND_LINE = "<command line>"  # the name of the text that holds the macros given with -D

NUMBERS = (WHOLE, DECIMAL)

_SYMBOLS = {
    "#": "CPP_POUND", "##": PASTE, "+": "CPP_PLUS", "-": "CPP_MINUS", "*": "CPP_STAR", "/": "CPP_FSLASH",
    "%": "CPP_PERCENT", "|": "CPP_BAR", "&": "CPP_AMPERSAND", "~": "CPP_TILDE", "^": "CPP_HAT", "<": "CPP_LESS",
    ">": "CPP_GREATER", "=": "CPP_EQUAL", "!": "CPP_EXCLAMATION", "?": "CPP_QUESTION", "(": "CPP_LPAREN",
    ")": "CPP_RPAREN", "[": "CPP_LBRACKET", "]": "CPP_RBRACKET", "{": "CPP_LCURLY", "}": "CPP_RCURLY", ".": "CPP_DOT",
    ",": "CPP_COMMA", ";": "CPP_SEMICOLON", ":": "CPP_COLON", "<<": "CPP_LSHIFT", "<=": "CPP_LESSEQUAL",
    ">>": "CPP_RSHIFT", ">=": "CPP_GREATEREQUAL", "||": "CPP_LOGICALOR", "&&": "CPP_LOGICALAND", "==": "CPP_EQUALITY",
    "!=": "CPP_INEQUALITY", "+=": "CPP_PLUSEQUAL", "-=": "CPP_MINUSEQUAL", "*=": "CPP_MULTIPLYEQUAL",
    "/=": "CPP_DIVIDEEQUAL", "..": "RANGE", "...": "ELLIPSIS",
}  # fmt: skip

# The order of the alternatives matters; a hexadecimal number is for #if only. There are no possessive repeats, as `*+`:
# `re` of Python 3.11.2, which Debian 12 has, matches some of them wrongly.
_SPLICE = re.compile(r"\\[ \t\f\v]*(?:\n|\Z)")
_REST = re.compile(r"[^\\\n]*(?:\\(?:[ \t\f\v]*\n)?[^\\\n]*)*")
_TOKEN = re.compile(
    r"""
      (?P<space>[ \t\f\v]+)
    | (?P<name>[A-Za-z_][A-Za-z0-9_]*)
    | (?P<newline>\n)
    | (?P<number>0[xX][0-9a-fA-F]+|(?:[0-9]+(?:\.(?!\.)[0-9]*)?|(?<!\.)\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
    | (?P<comment>//[^\n]*|/\*(?s:.*?)\*/)
    | (?P<unclosed>/\*)
    | (?P<string>"[^"\\\n]*(?:\\.[^"\\\n]*)*")
    | (?P<character>'[^'\\\n]*(?:\\.[^'\\\n]*)*')
    | (?P<symbol>\#\#|\.\.\.|\.\.|<<|>>|[<>=!+*/-]=|\|\||&&|[][(){}<>=!+*/%^;:,.\#&|~?-])
    | (?P<bad>"[^\n]*|'[^\n]*|[^\x00-\x7f]+|.)
    """,
    re.VERBOSE,
)

_KINDS = {"name": NAME, "string": STRING, "character": CHARACTER}
"""The kinds of tokens that are kept as they are written, by the group of `_TOKEN` that finds them."""


class Text:
    """A file's text under the name that messages print, and the lines that led to it, as a `Place` has them.

    The same file included twice makes two of these, since their chains differ.
    """

    def __init__(
        self, name: str, text: str, included: tuple[tuple[str, int], ...] = (), used: tuple[int, ...] = ()
    ) -> None:
        self.name = name
        self.text = text
        self.included = included
        self.used = used

    @cached_property
    def _starts(self) -> list[int]:
        """The offset at which each line begins, [line]."""
        return [0, *(match.end() for match in re.finditer("\n", self.text))]

    @cached_property
    def joined(self) -> str:
        """The text without the line ends that a backslash takes away."""
        return _SPLICE.sub("", self.text) if "\\" in self.text else self.text

    @cached_property
    def _joints(self) -> tuple[list[int], list[int]]:
        """Offsets in the joined text at which characters were removed, with the number removed up to each."""
        offsets, taken, total = [], [], 0
        for match in _SPLICE.finditer(self.text):
            offsets.append(match.start() - total)
            total += match.end() - match.start()
            taken.append(total)
        return offsets, taken

    @cached_property
    def edition(self) -> int:
        """The edition of the deck language that the file is written in."""
        return edition_of(self.joined)

    @cached_property
    def heading(self) -> Heading | None:
        """The line with the edition, by offsets in the text as written."""
        edition_line = heading(self.joined)
        if edition_line is None or len(self.joined) == len(self.text):
            return edition_line
        first, last, (start, end) = edition_line.first, edition_line.last, edition_line.number
        written_at = self.written_at
        return Heading(
            edition_line.edition,
            written_at(first),
            written_at(last - 1) + 1,
            (written_at(start), written_at(end - 1) + 1),
            edition_line.closed,
        )

    def written_at(self, offset: int) -> int:
        """The offset in the text as written of the character at `offset` of the joined text."""
        offsets, taken = self._joints
        before = bisect_right(offsets, offset)
        return offset + taken[before - 1] if before else offset

    def line(self, offset: int) -> int:
        """The number of the line, from 1, that holds the character at `offset`."""
        return bisect_right(self._starts, offset)

    def place(self, offset: int, length: int, expansions: tuple[Expansion, ...] = ()) -> Place:
        """The place of `length` characters from `offset`, cut at the end of the line."""
        line = self.line(offset)
        start = self._starts[line - 1]
        end = self._starts[line] - 1 if line < len(self._starts) else len(self.text)
        return Place(
            self.name, line, offset - start + 1, min(length, end - offset) or 1, expansions, self.included, self.used
        )

    def offset(self, line: int, column: int) -> int:
        """The offset of the character at a column of a line, both from 1."""
        return self._starts[line - 1] + column - 1

    def indent(self, offset: int) -> int:
        """The column, from 1, of the first thing on the line that holds the token at `offset`."""
        before = self.text[self._starts[self.line(offset) - 1] : offset]
        return len(before) - len(before.lstrip(" \t")) + 1

    def rest_of_line(self, offset: int) -> str:
        """The text from `offset` to the end of its line and of those that a backslash joins to it."""
        return _SPLICE.sub("", _REST.match(self.text, offset)[0])  # type: ignore[index]  # it matches nothing at least


class Token:
    """A piece of a deck: its kind, its text, and where it was written.

    expansions  the macros it came through, innermost first, as in `Place`
    painted     whether this name was met within what its macro made, so that it is never again a use of that macro
    """

    __slots__ = ("expansions", "kind", "length", "lexer", "offset", "painted", "source", "text")

    # pcpp's names for `kind`, `text` and `offset`: the same slots
    type: str
    value: str
    lexpos: int

    def __init__(self, kind: str, text: str, source: Text, offset: int, length: int) -> None:
        self.kind = kind
        self.text = text
        self.source = source
        self.offset = offset
        self.length = length
        self.expansions: tuple[Expansion, ...] = ()
        self.painted = False

    @property
    def line(self) -> int:
        """The number of the line, from 1, in which it begins."""
        return self.source.line(self.offset)

    lineno = line  # pcpp's name for it

    @property
    def place(self) -> Place:
        return self.source.place(self.offset, self.length, self.expansions)

    @property
    def end(self) -> int:
        """The offset just after the token."""
        return self.offset + self.length

    def __copy__(self) -> Token:
        other = Token(self.kind, self.text, self.source, self.offset, self.length)
        other.expansions = self.expansions
        other.painted = self.painted
        return other

    def standing_for(self, kind: str, text: str) -> Token:
        """A token of another kind and text at the same place, which came through the same macros."""
        token = self.__copy__()
        token.kind, token.text = kind, text
        return token

    def __repr__(self) -> str:
        return f"Token({self.kind!r}, {self.text!r}, {self.place})"


_slots: Any = Token
_slots.type, _slots.value, _slots.lexpos = Token.__dict__["kind"], Token.__dict__["text"], Token.__dict__["offset"]


def logical_lines(source: Text) -> Iterator[list[Token]]:
    """The tokens of each line, the last of them its newline. Comments are spaces; a backslash at a line's end joins
    it to the next. The last line gets its newline too."""
    lines = _lines_of(source, source.joined)
    if len(source.joined) < len(source.text):
        lines = (_where_written(line, source) for line in lines)
    return lines


def solid_tokens(source: Text) -> Iterator[Token]:
    """The tokens of a text in order, as they stand there, without white space and comments."""
    return (token for line in logical_lines(source) for token in line if token.kind != SPACE)


def _where_written(line: list[Token], source: Text) -> list[Token]:
    """The tokens of the joined text, with their places in the original text."""
    for token in line:
        last = source.written_at(max(token.offset, token.offset + token.length - 1))
        token.offset = source.written_at(token.offset)
        token.length = last - token.offset + 1 if token.length else 0
    return line


def _lines_of(source: Text, text: str) -> Iterator[list[Token]]:
    """The tokens of each line, white space included. source: the text that their offsets are of"""
    line: list[Token] = []
    add = line.append
    for match in _TOKEN.finditer(text):
        group = match.lastgroup
        piece = match.group()
        offset = match.start()
        if group == "space" or group == "comment":
            add(Token(SPACE, " ", source, offset, len(piece)))
        elif group in _KINDS:
            add(Token(_KINDS[group], piece, source, offset, len(piece)))
        elif group == "symbol":
            add(Token(_SYMBOLS[piece], piece, source, offset, len(piece)))
        elif group == "newline":
            add(Token(SPACE, "\n", source, offset, 1))
            yield line
            line = []
            add = line.append
        elif group == "number":
            kind = WHOLE if piece.isdigit() or piece[1:2] in ("x", "X") else DECIMAL
            add(Token(kind, piece, source, offset, len(piece)))
        elif group == "unclosed":
            add(Token(BAD, piece, source, offset, 2))
            break
        else:
            add(Token(BAD, piece, source, offset, len(piece.rstrip())))
    if line:
        add(Token(SPACE, "\n", source, len(text), 1))
        yield line


# characters from word processors and other notations, with the deck's text for them
_PLAIN: Mapping[str, str] = MappingProxyType({
    "\u00b5": "u", "\u03bc": "u", "\u03a9": "ohm", "\u2126": "ohm", "\u00b0": "deg",  # micro, ohm, degree
    "\u00d7": "*", "\u00b7": "*", "\u22c5": "*", "\u00f7": "/",  # times and dots, division sign
    "\u2212": "-", "\u2013": "-", "\u2014": "-", "\u00b2": "^2", "\u00b3": "^3",  # minus and dashes, powers
    "\u201c": '"', "\u201d": '"', "\u201e": '"', "\u2264": "<=", "\u2265": ">=", "\u2260": "!=",  # quotes
    "\u00a0": "a space", "\u202f": "a space",
    "\uff1a": ":", "\uff1b": ";", "\uff0c": ",",  # full width
})  # fmt: skip

# invisible marks: those that change the direction of writing, joiners and blanks without width, tags
_UNSEEN = re.compile(
    "[\u00ad\u034f\u061c\u115f\u1160\u17b4\u17b5\u180b-\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\u3164\ufeff\uffa0"
    "\ufff9-\ufffb\U000e0000-\U000e007f]"
)
_JOINERS = "\u00ad\u200c\u200d"  # some languages write with them


def complain_of_unseen(source: Text, findings: Findings) -> None:
    """Report invisible characters in a text, including comments and strings; those in one line once."""
    if source.text.isascii():
        return
    seen: set[tuple[int, bool]] = set()
    for match in _UNSEEN.finditer(source.text):
        place = source.place(match.start(), 1)
        soft = match[0] in _JOINERS
        if (place.line, soft) in seen:
            continue
        seen.add((place.line, soft))
        import unicodedata

        known = unicodedata.name(match[0], "no name").lower()
        tell = findings.warn if soft else findings.error
        tell(
            "D038",
            f"U+{ord(match[0]):04X} ({known}) is not seen, so this may not say what it seems to say",
            place,
            help=write("", "leave it out"),
        )


_STRAY: Mapping[str, tuple[str, str, Sequence[str] | str]] = MappingProxyType({
    "/": ("D003", "this comment is not closed", "its `*/` is missing"),
    '"': ("D003", "this string is not closed", 'a string ends with `"` on the line it began on'),
    "'": ("D004", "a stray `'`", 'a string is written in double quotes: `"text"`'),
    "#": ("D004", "a stray `{}`", ("a comment begins with `//`", "a directive is the first thing on its line")),
    "\\": ("D004", "a stray `\\`", "it joins lines only as the last character of one"),
})  # fmt: skip
"""By the first character of what is no token: the code of the message, the message, and the help."""


def complain_of_stray(token: Token, findings: Findings) -> None:
    """Report why a token of kind BAD, a character constant or a `#` cannot stand in a deck."""
    text, place = token.text, token.place
    if token.kind == CHARACTER:
        findings.error("D004", "a string is written in double quotes", place, help=write(f'"{text[1:-1]}"'))
    elif text[0] in _STRAY:
        code, message, help = _STRAY[text[0]]
        findings.error(code, message.format(text), place, help=help)
    else:
        import unicodedata

        first = text[0]
        if _UNSEEN.match(first) and first not in _JOINERS:  # reported for the whole text
            return
        plain = _PLAIN.get(first)
        known = unicodedata.name(first, "no name").lower()
        name = f"`{text[:8]}`" if text.isprintable() else f"U+{ord(first):04X}"
        if not text.isascii():
            name += f" ({known})"
        remedy = write(" ", "write a space", old=first) if plain == "a space" else write(plain or "", old=first)
        usual = write("", "leave it out", old=first) if text.isascii() else "names and units are written in plain ASCII"
        findings.error("D004", f"{name} does not belong in a deck", place, help=remedy if plain else usual)
