"""The entry of a message's code on the page docs/diagnostics.md, for the terminal."""

from __future__ import annotations

import re
from collections.abc import Iterator

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
