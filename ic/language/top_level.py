"""Entries of a deck itself, besides its definitions."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry

TOP_LEVEL = BlockDeclaration(
    name="deck",
    written="",
    doc="entries that may stand outside of definitions",
    entries=(
        Entry(
            name="deck", form="statement", written="deck 2;",
            doc="the edition of the language that the file is written in; only comments may stand before it",
            default="1",
        ),
        Entry(
            name="let",
            form="named", written="let NAME = VALUE;", doc="a name for a value with its unit", default="none",
        ),
        Entry(
            name="param", form="named", written="param NAME = VALUE;",
            doc="a name for a value that an including deck, a run, a sweep or `--set` may replace", default="none",
        ),
        Entry(
            name="use", form="statement", written="use <FILE> as ROOF;",
            doc="makes the definitions of another deck available as `ROOF.NAME`; its runs, sweeps and macros are "
                "left out", default="none",
        ),
        Entry(
            name="unit", form="named", written="unit NAME = NUMBER UNIT;",
            doc="a unit of the deck's own, known in all of its files that are written in edition 2",
            default="those of the language",
        ),
    ),
)  # fmt: skip
