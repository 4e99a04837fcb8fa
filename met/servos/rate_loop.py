"""A PI loop on a motor's rate that sets its voltage: its parameters and its law; figure 3 of the paper.

    e = N qd_cmd - w                                  rate error, at the motor
    V* = Kp e + Ki I,  V = clip(V*, +-V_max)          at a tick, held to the next; or continuous
    dI/dt = e, 0 where V* is beyond the limit and e would push it further; I+ = I + T dI/dt at a tick

A position command is followed by asking for qd_cmd = d(q_cmd)/dt + k_position (q_cmd - q). A torque command sets the
voltage that gives this torque at the rate seen, without friction's share; it is open loop.
"""

from __future__ import annotations

from typing import Any

from met.parameter import Memory, Parameter, State
from met.servos.motor import TABLE_1, RateLoop, damping
from met.servos.servo import Control, Setpoint
from met.trace import Real, both, clip, either, maximum, sqrt, where

COMMANDS = ("rate", "position", "torque")

PARAMETERS = (
    Parameter(
        name="kp",
        unit="V*s/rad",
        at_least=0.0,
        source=TABLE_1,
        doc="proportional gain Kp on the error of the motor's rate",
    ),
    Parameter(
        name="ki", unit="V/rad", at_least=0.0, source=TABLE_1, doc="integral gain Ki on the error of the motor's rate"
    ),
    Parameter(name="v_max", unit="V", above=0.0, source=TABLE_1, doc="largest voltage V_max of the drive's amplifier"),
    Parameter(
        name="k_position",
        unit="1/s",
        default=0.0,
        at_least=0.0,
        needed_for=("position",),
        doc="gain of the position loop: commanded rate per position error; used only under a position command",
    ),
)

OUTPUTS = (Memory(name="voltage", unit="V", doc="voltage on the drive motor", limit="v_max"),)
INTEGRALS = (State(name="integral", unit="rad", doc="integral of the motor's rate error"),)


def rate_loop(p: Any, integral: Real, setpoint: Setpoint, *, q: Real, qd: Real) -> Control:
    """The motor's voltage, and the rate of the loop's integral, which stands still under a command of torque and at a
    limit of the voltage.

    q, qd  angle and rate of the motor over the ratio, as the loop sees them (rad, rad/s; m, m/s)
    """
    if setpoint.kind == "torque":
        torque_m = setpoint.value / p.ratio
        voltage = p.resistance * torque_m / p.kt + p.kt * p.ratio * qd
        return Control({"voltage": clip(voltage, -p.v_max, p.v_max)}, {"integral": 0.0})

    error = p.ratio * (rate_wanted(p, q, setpoint) - qd)
    wanted = p.kp * error + p.ki * integral
    winding_up = either(both(wanted > p.v_max, error > 0.0), both(wanted < -p.v_max, error < 0.0))
    return Control({"voltage": clip(wanted, -p.v_max, p.v_max)}, {"integral": where(winding_up, 0.0, error)})


def balanced(p: Any, tau_m: Real, setpoint: Setpoint, *, q: Real, qd: Real) -> dict[str, Real]:
    """The integral with which the loop sets the voltage for this torque of its motor, N m."""
    if setpoint.kind == "torque":
        return {"integral": 0.0}
    tau_m = clip(tau_m, -p.tau_max, p.tau_max)
    voltage = clip(p.resistance / p.kt * tau_m + p.kt * p.ratio * qd, -p.v_max, p.v_max)
    return {"integral": wound(p, voltage, p.ratio * (rate_wanted(p, q, setpoint) - qd))}


def wound(p: Any, wanted: Real, error: Real) -> Real:
    """The integral with which a loop of gains `kp` and `ki` gives this output at this error; 0 for a loop without
    one."""
    integrates = p.ki > 0.0
    return where(integrates, (wanted - p.kp * error) / where(integrates, p.ki, 1.0), 0.0)


def fastest(p: Any) -> Real:
    """A bound on the rate constants of the rate loop on a motor alone, with a continuous law, 1/s: no root of s^2 + b s
    + c is larger in size,

    b = (Kt^2/R + F_v + Kt Kp/R)/J_m,  c = Kt Ki/(R J_m)
    """
    damped = (damping(p.kt, p.resistance, p.f_v) + p.kt * p.kp / p.resistance) / p.j_m
    return maximum(damped, sqrt(p.kt * p.ki / (p.resistance * p.j_m)))


def full(p: Any) -> dict[str, Real]:
    """The output of a servo that gives all it can: its largest voltage, V."""
    return {"voltage": p.v_max}


def settings(p: Any) -> RateLoop:
    """Gains and limit of the loop, which a drive may have in its place."""
    return RateLoop(kp=p.kp, ki=p.ki, v_max=p.v_max)


def rate_wanted(p: Any, q: Real, setpoint: Setpoint) -> Real:
    """The input of the rate loop, a rate of the motor over its ratio (rad/s; m/s): the command under a rate command,
    the position loop's output under a position command."""
    if setpoint.kind == "position":
        return setpoint.slope + p.k_position * (setpoint.value - q)
    return setpoint.value
