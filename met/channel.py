"""Channels: every number of a structure that can be recorded, watched by a metric, or plotted.

    <joint>.q .qd .qdd              position, rate, acceleration (rad ...; m ... on a prismatic joint)
    <joint>.tau                     torque on the joint from its servo, rotor's share included (N m; N)
    <joint>.servo.<name>            a servo's memory, state or signal, by its declaration
    <joint>.servo.command           what the servo was asked at its last tick, in the command's unit
"""

from __future__ import annotations

from met import models
from met.frozen import frozen
from met.plan import Joint, Structure

MOTION = (
    ("q", "joint", "joint position"),
    ("qd", "joint/s", "joint rate"),
    ("qdd", "joint/s^2", "joint acceleration"),
    ("tau", "effort", "torque of the servo on the joint"),
)

COMMAND_UNIT = {"rate": "joint/s", "position": "joint", "torque": "effort"}


@frozen
class Channel:
    """One number that changes in time. divisor: base ticks between its samples; between them it is held."""

    path: str
    unit: str
    doc: str
    divisor: int


def joint_unit(unit: str, joint: Joint, command: str | None = None) -> str:
    """A declared unit with `joint`, `effort` and `command` put in words: `joint/s` -> `rad/s`, or `m/s`."""
    replacements = {"joint": "m", "effort": "N"} if joint.kind == "prismatic" else {"joint": "rad", "effort": "N*m"}
    if command is not None:
        replacements["command"] = joint_unit(COMMAND_UNIT[command], joint)
    out, word = "", ""
    for character in unit + " ":
        if character.isalpha() or character == "_":
            word += character
            continue
        out += _factor(replacements.get(word, word), out) + character
        word = ""
    return out.strip()


def _factor(unit: str, before: str) -> str:
    """A product or quotient in a denominator needs its brackets."""
    return f"({unit})" if before.endswith("/") and ("*" in unit or "/" in unit) else unit


def channels(structure: Structure) -> dict[str, Channel]:
    """Every channel of the structure, by path, in the order joint by joint."""
    servos = {use.joint: use for use in structure.servos}
    found: dict[str, Channel] = {}

    def add(path: str, unit: str, doc: str, divisor: int) -> None:
        found[path] = Channel(path, unit, doc, divisor)

    for joint in structure.moving:
        for name, unit, doc in MOTION:
            add(f"{joint.name}.{name}", joint_unit(unit, joint), doc, structure.schedule.dynamics)
        use = servos.get(joint.name)
        if use is None:
            continue
        servo = models.find("servo", use.model)
        if use.command is not None:
            unit = joint_unit(COMMAND_UNIT[use.command.kind], joint)
            add(f"{joint.name}.servo.command", unit, f"{use.command.kind} asked of the servo", use.divisor)
        for memory in servo.memory:
            add(f"{joint.name}.servo.{memory.name}", joint_unit(memory.unit, joint), memory.doc, use.divisor)
        for part in (*servo.states, *servo.signals):
            unit = joint_unit(part.unit, joint)
            add(f"{joint.name}.servo.{part.name}", unit, part.doc, structure.schedule.dynamics)
    return found
