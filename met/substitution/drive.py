"""The part of a servo's law that a bed's drive has: what the drive is told, and what its motor then does.

    voltage  all of the law is ours; the motor has back-EMF:      tau_m = Kt/R (V - Kt w), limited
    torque   the drive has a current loop, and the motor's electrical side is ours: tau_m is held from tick to tick

With a drive that is told a torque, the joint's motor is the same as with another: it has its voltage, resistance and
back-EMF in the balance. What is sent is the mean of its torque over the tick, and back-EMF brakes no bed.
"""

from __future__ import annotations

from met.servos import motor as motors
from met.servos.motor import Motor
from met.substitution.balance import Balanced
from met.substitution.bed import DriveCommand
from met.trace import Real, clip, where

LEAST = 1e-8
"""Share of its rate that a shaft loses in a time, at least, where closed forms divide by its damping: without viscous
friction a bed whose drive is told a torque has none. Rounding and error are then of that size."""


def bed_torque(drive: DriveCommand, motor: Motor, command: Real, w: Real) -> Real:
    """Torque of the bed's motor that is held at a command, N m: at a voltage at w rad/s."""
    if drive == "voltage":
        return motors.torque(motor.kt, motor.resistance, motor.tau_max, command, w)
    return clip(command, -motor.tau_max, motor.tau_max)


def bed_damping(drive: DriveCommand, motor: Motor, inertia: Real, time: float) -> Real:
    """Torque that brakes the bed's shaft for each unit of its rate, N m s/rad: above 0, for closed forms over `time`
    s."""
    return motor.damping if drive == "voltage" else at_least(motor.f_v, LEAST * inertia / time)


def at_least(value: Real, least: Real) -> Real:
    return where(value > least, value, least)


def mean_torque(motor: Motor, begins: Real, found: Balanced | None, mean: float) -> Real:
    """Mean torque of the joint's own motor over the coming tick, N m, within its limit.

    begins  its torque as the tick begins, N m
    found   the joint's motion in the tick, None where no balance says it;  mean: half of the tick, s
    """
    if found is None:
        return begins
    gained = motor.ratio * found.qdd * mean
    return clip(begins - motor.kt * motor.kt / motor.resistance * gained, -motor.tau_max, motor.tau_max)
