"""The block of a deck about a servo."""

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
