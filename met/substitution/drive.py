"""The part of a servo's law that a bed's drive has: what the drive is told, and what its motor then does.

    voltage  all of the law is ours; the motor has back-EMF:      tau_m = Kt/R (V - Kt w), limited
    torque   the drive has a current loop, and the motor's electrical side is ours: tau_m is held from tick to tick
    rate     the drive has a rate loop, and ours is what is above it:   V = Kp (w_told - w) + Ki I, limited

With a drive that is told a torque, the joint's motor is the same as with another: it has its voltage, resistance and
back-EMF in the balance. What is sent is the mean of its torque over the tick, and back-EMF brakes no bed.

A drive that is told a rate makes its torque by itself, and need not say it: the servo's own rate loop is what is
believed of the drive's, and stands beside it. What the drive does otherwise is the unknown torque d, as that of a motor
is that is not its data sheet.
"""

from __future__ import annotations

from met.frozen import frozen
from met.servos import motor as motors
from met.servos.motor import Motor, RateLoop
from met.substitution.balance import Balanced
from met.substitution.bed import DriveCommand
from met.trace import Real, absolute, both, clip, either, where

LEAST = 1e-8
"""Share of its rate that a shaft loses in a time, at least, where closed forms divide by its damping: without viscous
friction a bed whose drive is told a torque has none. Rounding and error are then of that size."""


def bed_torque(drive: DriveCommand, motor: Motor, command: Real, w: Real) -> Real:
    """Torque of the bed's motor that is held at a command, N m: at a voltage at w rad/s."""
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
    """Torque of a motor whose drive closes a rate loop, as a tick of `time` s begins.

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
    """Torque that brakes the bed's shaft for each unit of its rate, N m s/rad: above 0, for closed forms over `time`
    s. loop: of a drive that is told a rate."""
    if loop is not None:
        return motor.damping + motor.kt * loop.kp / motor.resistance
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
