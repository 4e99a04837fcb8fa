"""Macros that make a string of their arguments: `#define SAID(X) #X`. Blanks in such an argument count, so the lines of
a use are not changed."""

from __future__ import annotations

import re
from collections.abc import Iterator

from ic.text.files import Files, FoundFile
from ic.text.lexer import Text, Token, logical_lines
from ic.text.limits import MOST_BYTES, MOST_INCLUDES
from met.host.files import open_regular

_INCLUDE = re.compile(r'\s*#\s*include\s*(?:"([^"\n]*)"|<([^>\n]*)>)')


def making_strings(text: str, file: FoundFile) -> frozenset[str]:
    """Names of such macros that this text or a file that it includes defines."""
    files = Files()
    names: set[str] = set()
    waiting, seen = [(text, file)], {file.identity}
    while waiting and len(seen) < MOST_INCLUDES:
        text, file = waiting.pop()
        if "#" not in text:
            continue
        names.update(_defined(Text(file.name, text)))
        for included in _included(text, file, files):
            if included.identity not in seen:
                seen.add(included.identity)
                waiting.append((_text(included), included))
    return frozenset(names)


def _defined(source: Text) -> Iterator[str]:
    for line in logical_lines(source):
        tokens = [token for token in line if token.text.strip()]
        if [token.text for token in tokens[:2]] == ["#", "define"] and _makes_a_string(tokens[2:]):
            yield tokens[2].text


def _makes_a_string(definition: list[Token]) -> bool:
    return len(definition) > 1 and definition[1].text == "(" and any(token.text == "#" for token in definition)


def _included(text: str, file: FoundFile, files: Files) -> Iterator[FoundFile]:
    for line in text.split("\n"):
        written = _INCLUDE.match(line)
        if written is not None:
            angled = written[1] is None
            included = files.find(written[2] if angled else written[1], files.where(file, angled))
            if included is not None:
                yield included


def _text(file: FoundFile) -> str:
    """The readable part of a file; `met check` reports its errors."""
    try:
        with open_regular(file.path) as stream:
            return stream.read(MOST_BYTES).decode("utf-8", "replace")
    except OSError:
        pass
    return ""
