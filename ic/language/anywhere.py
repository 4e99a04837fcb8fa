"""Entries that stand for several, in any block of a deck and at its top level."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry

ANYWHERE = BlockDeclaration(
    name="anywhere",
    written="",
    doc="entries that may stand in any block of a deck",
    entries=(
        Entry(
            name="for", form="statement", written="for i in 1 .. 6 by 1 { ... }",
            doc="repeats its block for each whole number, or for each name as in `for side in [left, right] { ... }`; "
            "`seg_{i}` is then the name `seg_1`, `seg_2` and so on, and `i` in a value is the number",
            default="none",
        ),
        Entry(
            name="[", form="statement", written="[NAME, NAME] = ...;",
            doc="the same entry for each of these names: `[lift, swing] = turner;`, `[lift, swing].q = 0 rad;`, or a "
            "block",
            default="none",
        ),
        Entry(
            name="*", form="statement", written="* = SERVO;",
            doc="in `servos`: the servo of every joint that is given none by its name", default="none",
        ),
    ),
)  # fmt: skip
