"""Signals for linear answers, from the structure alone: possible inputs, and places where a loop opens."""

from __future__ import annotations

from met import models
from met.frozen import frozen
from met.plan import ServoUse, Structure
from met.plan.uses import servo_parts


@frozen
class InputSignal:
    """A signal that may be an input: of a servo that ticks, its command or an output of its law.

    path      of its channel: `pan.servo.command`, `pan.servo.voltage`
    divisor   ticks of the base rate from one to the next
    is_output whether a law puts it out, so that its loop may be opened there
    """

    path: str
    joint: str
    divisor: int
    is_output: bool


def input_signals(structure: Structure) -> tuple[InputSignal, ...]:
    """The signals of a structure that may be inputs, joint by joint: commands, then outputs of laws."""
    uses = {use.joint: use for use in structure.servos}
    return tuple(signal for joint in structure.moving if joint.name in uses for signal in _of_servo(uses[joint.name]))


def _of_servo(use: ServoUse) -> list[InputSignal]:
    """The signals at which a linear answer may put something in: a servo's command, and the outputs of its law if that
    ticks."""
    parts = servo_parts(use)
    if models.find("servo", use.model, use.place).control is None or parts.continuous:
        return []
    signals = [InputSignal(f"{use.joint}.servo.command", use.joint, use.divisor, False)] if use.command else []
    return signals + [
        InputSignal(f"{use.joint}.servo.{output.name}", use.joint, use.divisor, True) for output in parts.outputs
    ]


def no_computer(structure: Structure, name: str = "") -> tuple[str, ...]:
    """The help where a run has no computer whose loop could be opened, or the joint of this signal has none: what to do
    if the law is continuous. Empty where there is one."""
    ticks = any(input_signal.is_output for input_signal in input_signals(structure))
    laws = {use.joint for use in structure.servos if use.continuous}
    joint = name.partition(".")[0]
    if joint in laws or (laws and not ticks):
        rate = f"{structure.schedule.base_hz / structure.schedule.dynamics:.6g} Hz"
        return (
            "a law that is `continuous` is a part of the arm, and has no loop to open",
            f"a fast computer is nearly the same: write `rate = {rate};`, that of the dynamics, in "
            f"{f'the servo of `{joint}`' if joint in laws else 'a servo'}",
        )
    return () if ticks else ("no servo here has a computer that ticks",)
