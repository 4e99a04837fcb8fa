"""Conversion between places of decks and positions of editors: files and addresses, characters and units of a line."""

from __future__ import annotations

import os
from collections.abc import Mapping
from urllib.parse import quote, unquote, urlsplit

from lsprotocol import types
from pygls.workspace import PositionCodec

from ic.text.files import DECK_IN_MEMORY, LIBRARY
from met.diagnostic import Place


def path_of(uri: str) -> str | None:
    """The file at an address; None where there is none, as for a text that was never saved, or where no file can have
    such a name."""
    try:
        parts = urlsplit(uri)
        if parts.scheme != "file" or not parts.path:
            return None
        path = os.path.normpath(unquote(parts.path))
        os.path.realpath(path)
        os.fsencode(path).decode()
    except (ValueError, OSError):
        return None
    return path


def uri_of(path: str) -> str:
    """The address of a file, as editors commonly write it."""
    return "file://" + quote(path, errors="replace")


def file_named(name: str, folder: str) -> str | None:
    """The path of a file that a place names, seen from a folder; None for the command line, and text in no file."""
    if name.startswith("<"):
        return None if " " in name else os.path.join(LIBRARY, name[1:-1])
    return None if name == DECK_IN_MEMORY else os.path.normpath(os.path.join(folder, name))


def normal(text: str) -> str:
    """A text with its lines ended by newlines alone."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def lines_of(text: str) -> list[str]:
    """The lines of a text as editors count them."""
    return normal(text).split("\n")


class Texts:
    """The lines of texts by a name, with positions in the units that an editor counts in."""

    def __init__(self, texts: Mapping[str, str], codec: PositionCodec) -> None:
        self._texts, self._codec = texts, codec
        self._lines: dict[str, list[str]] = {}

    def position(self, name: str, line: int, column: int) -> types.Position:
        """The position of a column of a line, both counted from 1, the column in characters."""
        lines = self.lines(name)
        number = min(max(line - 1, 0), max(len(lines) - 1, 0))
        before = lines[number][: max(column - 1, 0)] if lines else ""
        return types.Position(number, self._codec.client_num_units(before))

    def range(self, place: Place) -> types.Range:
        """The range of a place: one character at least, where the line has one."""
        lines = self.lines(place.file)
        line = lines[place.line - 1] if 0 < place.line <= len(lines) else ""
        first = min(max(place.column, 1), len(line) + 1)
        last = min(first + max(place.length, 1), len(line) + 1)
        if first == last and first > 1 and place.length > 0:
            first -= 1
        return types.Range(self.position(place.file, place.line, first), self.position(place.file, place.line, last))

    def lines(self, name: str) -> list[str]:
        if name not in self._lines:
            self._lines[name] = lines_of(self._texts.get(name, ""))
        return self._lines[name]
