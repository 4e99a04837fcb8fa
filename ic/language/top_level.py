"""Entries of a deck itself, besides its definitions."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry

SERVO = BlockDeclaration(
    name="servo",
    written="servo NAME { ... }",
    doc="The drive of a joint: a model with its parameters, a command, a tick rate, and sensors.",
    entries=(
        Entry(name="model", written="model = rigid_gearbox;", varies="choice", path="SERVO.model",
              doc="model of the servo, one of MET's (`met doc servos`) or of another package"),
        Entry(name="command", written="command = rate(0.1 rad/s);", varies="choice", path="SERVO.command",
              default="needed if the model takes one",
              doc="setpoint of the servo as a function of time (`met doc commands`)"),
        Entry(name="rate", written="rate = 500 Hz;", varies="choice", path="SERVO.rate",
              default="the run's `rates.servos`",
              doc="ticks of the servo's computer per second; `continuous`: the control law is a part of each step of "
                  "the dynamics instead"),
        Entry(name="sensor", form="named", written="sensor QUANTITY = MODEL { ... }", default="none",
              path="SERVO.sensor.QUANTITY",
              doc="a sensor through which the control law reads `q`, `qd` or a state of the servo (`met doc sensors`)"),
    ),
    free="parameters of the model, such as those that `met doc rigid_gearbox` lists",
)  # fmt: skip


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
