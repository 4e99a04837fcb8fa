"""The meaning of a word of MET's from docs/glossary.md, for the terminal."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from ic.printing.codes import in_plain_text

PAGE = Path(__file__).parents[1] / "pages" / "glossary.md"

_ROW = re.compile(r"^\| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)


@cache
def entries() -> dict[str, tuple[str, str]]:
    """The row of each word, (its words, their meaning), in plain text; empty where the page is not installed.

    A row of several words explains each of them, and also a word in bold type within its meaning.
    """
    if not PAGE.is_file():
        return {}
    rows: dict[str, tuple[str, str]] = {}
    for row in _ROW.finditer(PAGE.read_text(encoding="utf-8")):
        words, meaning = row[1].strip(), row[2].strip()
        if words == "word" or set(words) == {"-"}:
            continue
        row_of_all = (in_plain_text(words), in_plain_text(meaning))
        for word in (*words.replace("the wire", "wire").split(", "), *re.findall(r"\*\*(.+?)\*\*", meaning)):
            rows.setdefault(in_plain_text(word), row_of_all)
    return rows


def meaning(word: str) -> Iterator[str]:
    """Return the glossary's meaning of a word, in one line; empty for an unknown word."""
    row = entries().get(word) or entries().get(word.removesuffix("s"))
    if row is not None:
        yield f"{row[0]}: {row[1]}"
