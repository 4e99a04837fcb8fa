"""Ideal servo: the joint follows its command whatever the arm does, and tau is the torque that this takes.

    r(t) = value + slope (t - since)                  the command, carried on along its slope from the tick at `since`
    rate            qdd = slope + w (r - qd)
    position        qdd = 2 w (slope - qd) + w^2 (r - q)
    acceleration    qdd = r

Value and slope are taken at the servo's ticks and held, or at every stage if the servo is continuous; the law above is
evaluated at every stage. w is `bandwidth`: an error decays as exp(-w t), without overshoot, and so does the error after
a step of the command. The second derivative of a position command is not known, so the joint lags behind a position
command whose rate changes by (its acceleration)/w^2. tau comes from inverse dynamics and includes the share of the
rotor; it has no limit.

This is neither a motor nor a controller: the joint follows its command however much torque that takes. A joint that is
moved in this way shakes the other joints like any other, but nothing shakes it.
"""

from __future__ import annotations

from typing import Any

from met.parameter import Memory, Parameter
from met.servos.servo import Control, Drive, JointMotion, Seen, Servo
from met.trace import Real


def control(p: Any, held: Any, seen: Seen) -> Control:
    """The servo's computer: it passes the command on."""
    return Control({"value": seen.setpoint.value, "slope": seen.setpoint.slope, "since": seen.time})


def drive(p: Any, held: Any, states: Any, joint: JointMotion) -> Drive:
    """The acceleration with which a joint follows its command: that of a low-pass of the parameter `bandwidth`."""
    setpoint = held.value + held.slope * (joint.time - held.since)
    w = p.bandwidth
    if joint.command == "rate":
        qdd = held.slope + w * (setpoint - joint.qd)
    elif joint.command == "position":
        qdd = 2.0 * w * (held.slope - joint.qd) + w * w * (setpoint - joint.q)
    else:
        qdd = setpoint
    return Drive(given=True, qdd=qdd, rotor=p.rotor)


def fastest(p: Any) -> Real:
    """The rate constant, 1/s: both laws have all their roots at -bandwidth; under an acceleration command nothing
    decays."""
    return p.bandwidth


SERVO = Servo(
    name="ideal",
    doc=__doc__,
    commands=("rate", "position", "acceleration"),
    parameters=(
        Parameter(
            name="bandwidth",
            unit="1/s",
            default=0.0,
            at_least=0.0,
            needed_for=("rate", "position"),
            above_where_needed=0.0,
            doc="errors decay as exp(-bandwidth t); used only under a rate or position command",
        ),
        Parameter(
            name="rotor",
            unit="effort*s^2/joint",
            default=0.0,
            at_least=0.0,
            doc="inertia of the drive seen at the joint; tau includes the torque that accelerates it",
        ),
    ),
    outputs=(
        Memory(name="value", unit="command", doc="value of the command at the servo's last tick"),
        Memory(name="slope", unit="command/s", doc="rate of change of the command at the servo's last tick"),
        Memory(name="since", unit="s", doc="time of the servo's last tick"),
    ),
    control=control,
    drive=drive,
    fastest=fastest,
    follows=True,
)
