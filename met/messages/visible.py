"""Texts from decks, archives and file names with their invisible characters made visible; and printing of them.

A name may contain sequences that move a terminal's cursor, change colours or the window's title, or reverse the
direction of the text that follows. So every text that somebody else wrote is printed through this module, on a terminal
or not.
"""

from __future__ import annotations

import re
import sys

# Control characters but the line end and the tab, other ends of lines, halves of pairs; and marks that turn the
# direction of what follows: a name with one reads as another name.
HIDDEN = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\u200e\u200f\u061c\u202a-\u202e\u2066-\u2069]"
)


def visible(text: str) -> str:
    """The text with what cannot be seen, or cannot be written as UTF-8, as an escape: `\\x00`, `\\u202e`."""
    return HIDDEN.sub(_escape, text)


def line(text: str) -> str:
    """The text made visible as one line: its line ends and tabs are escapes, too."""
    return visible(text).replace("\n", "\\n").replace("\t", "\\t")


def say(text: str = "", *, end: str = "\n", err: bool = False, exact: bool = False) -> None:
    """Print a text, made visible. err: on stderr. exact: unchanged where the output is not a terminal, for programs and
    files."""
    stream = sys.stderr if err else sys.stdout
    print(text if exact and not stream.isatty() else visible(text), end=end, file=stream, flush=True)


def _escape(matched: re.Match[str]) -> str:
    code = ord(matched[0])
    return f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}"
