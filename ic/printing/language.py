"""Declared blocks of the deck language as pages of `met doc`."""

from __future__ import annotations

from typing import Any

from ic.language import BlockDeclaration, Entry
from ic.printing.models import range_
from ic.printing.page import Page, Table
from ic.text.complaints import with_article


def block_page(block: BlockDeclaration) -> Page:
    """The page of a block."""
    numbers = [
        (entry.name, type_of(entry), "" if entry.parameter.words else range_(entry.parameter))
        for entry in block.entries
        if entry.parameter
    ]
    varying = [(_path(entry), _varies(entry)) for entry in block.entries if entry.path and entry.varies != "never"]
    return Page(
        subject=block.name,
        title=f"block {block.name}",
        summary=block.doc,
        usage=block.written + (f", in {with_article(block.within)}" if block.within else ""),
        parts=(
            Table(
                head=("written", "default", "meaning"),
                rows=[(entry.written, entry.default, entry.doc) for entry in block.entries],
            ),
            f"Also {block.free}." if block.free else "",
            Table(
                head=("name", "type", "bounds"), rows=numbers, headed=False, caption="Types, with bounds in SI units"
            ),
            Table(
                head=("path", "what varies"),
                rows=varying,
                headed=False,
                caption="What a sweep varies and `--set` replaces",
            ),
        ),
        records=[_entry_record(entry) for entry in block.entries],
    )


def in_block(block: BlockDeclaration) -> str:
    """Where the entries of a block stand, in words."""
    return {"deck": "a deck", "anywhere": "any block"}.get(block.name) or with_article(block.name)


def _entry_record(entry: Entry) -> dict[str, Any]:
    """An entry of a block, for programs."""
    return {
        "name": entry.name,
        "form": entry.form,
        "written": entry.written,
        "doc": entry.doc,
        "default": entry.default,
        "type": type_of(entry),
        "unit": entry.unit,
        "varies": entry.varies,
        "path": entry.path,
    }


def type_of(entry: Entry) -> str:
    """The type of an entry's value, in words: `number, kg`, `3 numbers, m`, `on or off`; "" where it has no value."""
    wanted = entry.parameter
    if wanted is None:
        return ""
    if wanted.shape == "word":
        return " or ".join(wanted.words)
    kind = {"vector": "3 numbers", "list": "numbers"}.get(wanted.shape, "number")
    return f"{kind}, {wanted.unit}" if wanted.unit != "1" else kind


def _path(entry: Entry) -> str:
    """The path by which a sweep varies an entry; for several numbers, that of one of them."""
    shape = entry.parameter.shape if entry.parameter is not None else ""
    return entry.path + {"vector": ".x, .y, .z", "list": ".xx, .yy, ..."}.get(shape, "")


def _varies(entry: Entry) -> str:
    return "a number" if entry.varies == "number" else "a choice; each choice makes a program of its own"
