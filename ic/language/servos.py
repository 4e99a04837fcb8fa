"""The block of a deck about a servo."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry

SERVO = BlockDeclaration(
    name="servo",
    written="servo NAME { ... }",
    doc="What drives joints: a model, its parameters, a command, a rate.",
    entries=(
        Entry(name="model", written="model = rigid_gearbox;", varies="choice", path="SERVO.model",
              doc="one of those below, or of another package"),
        Entry(name="command", written="command = rate(0.1 rad/s);", varies="choice", path="SERVO.command",
              default="needed where the model takes one", doc="what is asked of it"),
        Entry(name="rate", written="rate = 500 Hz;", varies="choice", path="SERVO.rate",
              default="the run's `rates.servos`",
              doc="how often its computer ticks, or `continuous`: its law is a part of each step of the dynamics"),
        Entry(name="sensor", form="named", written="sensor QUANTITY = MODEL { ... }", default="none",
              path="SERVO.sensor.QUANTITY", doc="through which its law sees `q`, `qd` or a state of the servo"),
    ),
    free="parameters of the model: `met doc rigid_gearbox` lists them",
)  # fmt: skip
