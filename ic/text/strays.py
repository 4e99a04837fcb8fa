"""What to say of text that is no token: unclosed comments and strings, and characters that a deck does not have."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from ic.text.lexer import CHARACTER, Token
from ic.text.limits import Findings

# characters that come out of word processors and other notations, and what a deck writes for them
_PLAIN: Mapping[str, str] = MappingProxyType({
    "\u00b5": "u", "\u03bc": "u", "\u03a9": "ohm", "\u2126": "ohm", "\u00b0": "deg",  # micro, ohm, degree
    "\u00d7": "*", "\u00b7": "*", "\u22c5": "*", "\u00f7": "/",  # times and dots, division sign
    "\u2212": "-", "\u2013": "-", "\u2014": "-", "\u00b2": "^2", "\u00b3": "^3",  # minus and dashes, powers
    "\u201c": '"', "\u201d": '"', "\u201e": '"', "\u2264": "<=", "\u2265": ">=", "\u2260": "!=",  # quotes
    "\u00a0": "a space", "\u202f": "a space", "\ufeff": "nothing", "\u200b": "nothing",
    "\uff1a": ":", "\uff1b": ";", "\uff0c": ",",  # full width
})  # fmt: skip


def complain_of_stray(token: Token, findings: Findings) -> None:
    """Says why a token of kind BAD, a character constant or a `#` cannot stand in a deck."""
    text = token.text
    tell = findings.error
    if text == "/*":
        tell("D003", "this comment is not closed", token.place, help="its `*/` is missing")
    elif text.startswith('"'):
        tell("D003", "this string is not closed", token.place, help='a string ends with `"` on the line it began on')
    elif token.kind == CHARACTER:
        tell("D004", "a string is written in double quotes", token.place, help=f'write `"{text[1:-1]}"`')
    elif text.startswith("'"):
        tell("D004", "a stray `'`", token.place, help='a string is written in double quotes: `"text"`')
    elif text.startswith("#"):
        tell("D004", f"a stray `{text}`", token.place,
             help=["a comment begins with `//`", "a directive is the first thing on its line"])
    elif text == "\\":
        tell("D004", "a stray `\\`", token.place, help="it joins lines only as the last character of one")
    else:
        import unicodedata

        first = text[0]
        plain = _PLAIN.get(first)
        known = unicodedata.name(first, "no name").lower()
        said = f"`{text[:8]}`" if text.isprintable() else f"U+{ord(first):04X}"
        if not text.isascii():
            said += f" ({known})"
        remedy = f"write {plain}" if plain in ("a space", "nothing") else f"write `{plain}`"
        usual = "leave it out" if text.isascii() else "names and units are written in plain ASCII"
        tell("D004", f"{said} does not belong in a deck", token.place, help=remedy if plain else usual)
