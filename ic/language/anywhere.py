"""Entries that stand for several, in any block of a deck and at its top level."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry

ANYWHERE = BlockDeclaration(
    name="anywhere",
    written="",
    doc="what may stand wherever entries may",
    entries=(
        Entry(
            name="for", form="statement", written="for i in 1 .. 6 by 1 { ... }",
            doc="its block once for each whole number, or for each name of `for side in [left, right] { ... }`; "
            "`seg_{i}` is the name `seg_1` in the first turn, and in values `i` is the number",
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
            doc="in `servos`: the servo of every joint that has none of its own", default="none",
        ),
    ),
)  # fmt: skip
