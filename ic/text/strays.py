"""Messages for text outside of tokens: unclosed comments and strings, and characters that are not allowed in a deck."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from ic.text.lexer import CHARACTER, Text, Token
from ic.text.limits import Findings
from met.diagnostic import write

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


def complain_of_stray(token: Token, findings: Findings) -> None:
    """Report why a token of kind BAD, a character constant or a `#` cannot stand in a deck."""
    text = token.text
    tell = findings.error
    if text == "/*":
        tell("D003", "this comment is not closed", token.place, help="its `*/` is missing")
    elif text.startswith('"'):
        tell("D003", "this string is not closed", token.place, help='a string ends with `"` on the line it began on')
    elif token.kind == CHARACTER:
        tell("D004", "a string is written in double quotes", token.place, help=write(f'"{text[1:-1]}"'))
    elif text.startswith("'"):
        tell("D004", "a stray `'`", token.place, help='a string is written in double quotes: `"text"`')
    elif text.startswith("#"):
        tell(
            "D004",
            f"a stray `{text}`",
            token.place,
            help=["a comment begins with `//`", "a directive is the first thing on its line"],
        )
    elif text == "\\":
        tell("D004", "a stray `\\`", token.place, help="it joins lines only as the last character of one")
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
        tell("D004", f"{name} does not belong in a deck", token.place, help=remedy if plain else usual)
