"""The part of a servo's law that a bed's drive has, by its command, and the torque of the bed's motor.

    voltage  all of the law is ours; the motor has back-EMF:      tau_m = Kt/R (V - Kt w), limited
    torque   the drive has a current loop, and the motor's electrical side is ours: tau_m is held from tick to tick
    rate     the drive has a rate loop, and ours is what is above it:   V = Kp (w_told - w) + Ki I, limited

With a torque command, the joint's motor is modelled as with other drives, with its voltage, resistance and back-EMF in
the balance. The command is the mean of its torque over the tick, and back-EMF does not brake the bed.

A drive with a rate command sets its torque itself, and need not report it: the servo's own rate loop serves as its
model. Deviations of the drive appear as the unknown torque d, like those of a motor from its data sheet.
"""

from __future__ import annotations

from met.frozen import frozen
from met.servos import motor as motors
from met.servos.motor import Motor, RateLoop
from met.substitution.balance import Balanced
from met.substitution.bed import DriveCommand
from met.trace import Real, absolute, both, clip, either, where

LEAST = 1e-8
"""Smallest share of its rate that a shaft loses in a time, where closed forms divide by its damping: without viscous
friction, a bed whose drive is commanded a torque has none. Rounding and error are then of that size."""


def bed_torque(drive: DriveCommand, motor: Motor, command: Real, w: Real) -> Real:
    """Torque of the bed's motor at a held command, N m; for a voltage, at a rate of w rad/s."""
    if drive == "voltage":
        return motors.torque(motor.kt, motor.resistance, motor.tau_max, command, w)
    return clip(command, -motor.tau_max, motor.tau_max)


@frozen
class LoopTorque:
    """The torque of a motor under a rate loop.

    torque   N m, the integral being as at the middle of the tick
    brakes   by which it falls as the shaft gains speed, N m s/rad: none at a limit of the motor's torque, and the
             back-EMF's alone at one of the loop's voltage
    """

    torque: Real
    brakes: Real


def loop_torque(motor: Motor, loop: RateLoop, integral: Real, command: Real, w: Real, time: float) -> LoopTorque:
    """Torque of a motor whose drive closes a rate loop, at the start of a tick of `time` s.

    integral  of the rate's error, rad;  command, w: rates of the shaft, told and true, rad/s
    """
    error = command - w
    wanted = loop.kp * error + loop.ki * (integral + 0.5 * time * error)
    voltage = clip(wanted, -loop.v_max, loop.v_max)
    stiff = motor.kt / motor.resistance
    free = stiff * (voltage - motor.kt * w)
    torque = clip(free, -motor.tau_max, motor.tau_max)
    brakes = stiff * (motor.kt + where(absolute(wanted) <= loop.v_max, loop.kp, 0.0))
    return LoopTorque(torque, where(absolute(free) <= motor.tau_max, brakes, 0.0))


def wound(loop: RateLoop, integral: Real, error: Real, time: float) -> Real:
    """The integral after `time` s with a mean error, rad/s: held while the voltage is limited and the error would push
    it further."""
    wanted = loop.kp * error + loop.ki * integral
    winding_up = either(both(wanted > loop.v_max, error > 0.0), both(wanted < -loop.v_max, error < 0.0))
    return integral + where(winding_up, 0.0, time * error)


def bed_damping(drive: DriveCommand, motor: Motor, inertia: Real, time: float, loop: RateLoop | None = None) -> Real:
    """Torque that brakes the bed's shaft for each unit of its rate, N m s/rad: above 0, for closed forms over `time` s.
    loop: of a drive with a rate command."""
    if loop is not None:
        return motor.damping + motor.kt * loop.kp / motor.resistance
    return motor.damping if drive == "voltage" else at_least(motor.f_v, LEAST * inertia / time)


def at_least(value: Real, least: Real) -> Real:
    return where(value > least, value, least)


def mean_torque(motor: Motor, begins: Real, balanced: Balanced | None, mean: float) -> Real:
    """Mean torque of the joint's own motor over the coming tick, N m, within its limit.

    begins    its torque as the tick begins, N m
    balanced  the joint's motion in the tick, None where no balance says it;  mean: half of the tick, s
    """
    if balanced is None:
        return begins
    gained = motor.ratio * balanced.qdd * mean
    return clip(begins - motor.kt * motor.kt / motor.resistance * gained, -motor.tau_max, motor.tau_max)
