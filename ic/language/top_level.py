"""Entries of a deck itself, besides its definitions."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry

TOP_LEVEL = BlockDeclaration(
    name="deck",
    written="",
    doc="what may stand outside of definitions",
    entries=(
        Entry(
            name="deck", form="statement", written="deck 2;",
            doc="the edition of the language that the file is written in; before all but comments", default="1",
        ),
        Entry(
            name="let", form="named", written="let NAME = VALUE;", doc="a value with its unit", default="none",
        ),
        Entry(
            name="param", form="named", written="param NAME = VALUE;",
            doc="the same, which an including deck, a run, a sweep and `--set` may set", default="none",
        ),
        Entry(
            name="use", form="statement", written="use <FILE> as ROOF;",
            doc="the definitions of another deck, as `ROOF.NAME`; without its runs, sweeps and macros", default="none",
        ),
        Entry(
            name="unit", form="named", written="unit NAME = NUMBER UNIT;",
            doc="a unit, known in all files of edition 2", default="those of the language",
        ),
    ),
)  # fmt: skip
