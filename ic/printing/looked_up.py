"""Entries of pages of docs for the terminal: of a message's code, and of a word of MET's glossary."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from ic.text.codes import PAGE
from met.diagnostic import Problem, did_you_mean, error

_ENTRY = re.compile(r"^### ([A-Z]\d{3}): .*?(?=^##)", re.MULTILINE | re.DOTALL)
_ROW = re.compile(r"^\| ([A-Z]\d{3}) \| (.*?) \|", re.MULTILINE)  # of codes that no deck causes
_HIDDEN = re.compile(r"<!-- .*?-->\n?", re.DOTALL)


def is_code(word: str) -> bool:
    """Return True if a word looks like the code of a message: `D063`, `d063`, `d63`."""
    return re.fullmatch(r"[A-Za-z]\d{2,3}", word) is not None


def titles() -> dict[str, str]:
    """The subject of each code in a line, from the page's headings; empty where the page is not installed."""
    if not PAGE.is_file():
        return {}
    page = PAGE.read_text(encoding="utf-8")
    rows = {row[1]: in_plain_text(row[2]) for row in _ROW.finditer(page)}
    return rows | {head[1]: head[2] for head in re.finditer(r"^### ([A-Z]\d{3}): (.*)$", page, re.MULTILINE)}


def print_code(word: str) -> Iterator[str]:
    """The entry of a code. Raises Problem D171 where it or the page is missing."""
    code = word[0].upper() + word[1:].zfill(3)
    if not PAGE.is_file():
        help = "the entry of every code is in docs/diagnostics.md of a checkout"
        raise Problem(error("D171", f"the page that explains `{code}` is not installed with MET", help=help))
    page = PAGE.read_text(encoding="utf-8")
    entries = {row[1]: f"{row[1]}: {row[2]}" for row in _ROW.finditer(page)}
    entries |= {entry[1]: entry[0] for entry in _ENTRY.finditer(page + "\n##")}
    if code not in entries:
        helps = [*did_you_mean(code, entries), "a code is printed with its message, as in `error[D060]`"]
        raise Problem(error("D171", f"no message has the code `{code}`, or none that needs an entry", help=helps))
    yield from in_plain_text(_HIDDEN.sub("", entries[code]).strip().removeprefix("### ")).rstrip().splitlines()


def in_plain_text(text: str) -> str:
    """Markdown as text for the terminal: code blocks are indented, links are their words, bold type is plain."""
    lines = [""]
    code = False
    for line in text.splitlines():
        if line.startswith("```"):
            code = not code
            line = ""
        elif code:
            line = f"    {line}".rstrip()
        else:
            line = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", line).replace("**", "")
        if line or lines[-1]:
            lines.append(line)
    return "\n".join(lines[1:])


GLOSSARY = Path(__file__).parents[1] / "pages" / "glossary.md"

_WORD_ROW = re.compile(r"^\| ([^|]+) \| ([^|]+) \|$", re.MULTILINE)


@cache
def entries() -> dict[str, tuple[str, str]]:
    """The row of each word, (its words, their meaning), in plain text; empty where the page is not installed.

    A row of several words explains each of them, and also a word in bold type within its meaning.
    """
    if not GLOSSARY.is_file():
        return {}
    rows: dict[str, tuple[str, str]] = {}
    for row in _WORD_ROW.finditer(GLOSSARY.read_text(encoding="utf-8")):
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
