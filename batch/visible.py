"""Texts from decks and file names, in which what cannot be seen is made visible."""

from __future__ import annotations

import unicodedata

# Marks that turn the direction of what follows: a name with one reads as another name.
TURNING = frozenset("\u200e\u200f\u061c\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def visible(text: str) -> str:
    """The text with what cannot be seen, or cannot be written as UTF-8, as an escape: `\\x00`, `\\u202e`."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(_shown(character) for character in text)


def _shown(character: str) -> str:
    if character in "\n\t":
        return character
    hidden = unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp") or character in TURNING
    if not hidden:
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}"
