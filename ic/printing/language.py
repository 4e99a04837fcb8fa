"""Declared blocks of the deck language as pages of `met doc` and tables of docs/deck.md.

`python -m ic.printing.language` writes the tables of docs/deck.md anew.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ic.language import BLOCKS, BlockDeclaration, Entry
from ic.printing.columns import columns
from ic.printing.wrapping import described, terminal_width
from met.parameter import Parameter
from met.units import ONE

PAGE = Path(__file__).parents[2] / "docs" / "deck.md"
MARK = "<!-- table of {} -->"
"""The comment above a generated table of docs/deck.md, with the block's name."""


def print_block(block: BlockDeclaration) -> Iterator[str]:
    """The page of a block, for a terminal."""
    yield f"{block.name}: {block.doc}"
    yield ""
    yield f"In a deck: {block.written}" + (f", in {_an(block.within)}" if block.within else "")
    yield ""
    rows = [(each.written, default(each), each.doc) for each in block.entries]
    yield from described([("written", "default", "meaning"), *rows], width=terminal_width(), head=True)
    if block.free:
        yield ""
        yield f"Also {block.free}."
    numbers = [each for each in block.entries if each.parameter is not None]
    if numbers:
        yield ""
        rows = [(each.name, type_of(each), _bounds(each.parameter)) for each in numbers]
        yield "Types, with bounds in SI units"
        yield from columns(rows)
    varying = [(_path(each), _varies(each)) for each in block.entries if each.path and each.varies != "never"]
    if varying:
        yield ""
        yield "What a sweep varies and `--set` replaces"
        yield from columns(varying)


def in_block(block: BlockDeclaration) -> str:
    """Where the entries of a block stand, in words."""
    return {"deck": "a deck", "anywhere": "any block"}.get(block.name) or _an(block.name)


def block_json(block: BlockDeclaration) -> list[dict[str, Any]]:
    """The entries of a block, for programs."""
    return [
        {
            "name": each.name,
            "form": each.form,
            "written": each.written,
            "doc": each.doc,
            "default": each.default,
            "type": type_of(each),
            "unit": each.unit,
            "varies": each.varies,
            "path": each.path,
        }
        for each in block.entries
    ]


def table(block: BlockDeclaration) -> Iterator[str]:
    """The block's entries as a table in Markdown."""
    by_key = block.within and not block.named and not block.statements
    yield f"| {'key' if by_key else 'entry'} of {_an(block.name)} | is | default |"
    yield "|---|---|---|"
    for each in block.entries:
        first = each.name if by_key else each.written
        yield f"| `{first}` | {each.doc} | {each.default} |"
    if block.free:
        yield f"| others | {block.free} | |"


def type_of(entry: Entry) -> str:
    """The type of an entry's value, in words: `number, kg`, `3 numbers, m`, `on or off`; "" where it has no value."""
    wanted = entry.parameter
    if wanted is None:
        return ""
    if wanted.shape == "word":
        return " or ".join(wanted.words)
    kind = {"vector": "3 numbers", "list": "numbers"}.get(wanted.shape, "number")
    return f"{kind}, {wanted.unit}" if wanted.unit != "1" else kind


def default(entry: Entry) -> str:
    """The default of an entry, in words, without the marks of Markdown."""
    return entry.default


def _bounds(wanted: Parameter | None) -> str:
    if wanted is None:
        return ""
    above = f"above {ONE.decimal(wanted.above)}" if wanted.above is not None else ""
    least = f"at least {ONE.decimal(wanted.at_least)}" if wanted.at_least is not None else ""
    return above or least


def _path(entry: Entry) -> str:
    """The path by which a sweep varies an entry; for several numbers, that of one of them."""
    shape = entry.parameter.shape if entry.parameter is not None else ""
    return entry.path + {"vector": ".x, .y, .z", "list": ".xx, .yy, ..."}.get(shape, "")


def _varies(entry: Entry) -> str:
    return "a number" if entry.varies == "number" else "a choice; each choice makes a program of its own"


def _an(name: str) -> str:
    return f"{'an' if name[0] in 'aeio' else 'a'} {name}"


def with_tables(text: str) -> str:
    """The page with each table that has such a mark generated anew. Raises KeyError where a mark names no block."""

    def made(match: re.Match[str]) -> str:
        return f"{match[1]}\n" + "".join(f"{line}\n" for line in table(BLOCKS[match[2]]))

    mark = re.escape(MARK).replace(r"\{\}", r"(\w+)")
    return re.sub(rf"({mark})\n(?:\|.*\n)*", made, text)


def main() -> None:
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"wrote {PAGE}")


if __name__ == "__main__":
    main()
