"""Torque balance (eq. 10 of the paper, with friction): the load torque with which the shaft turns as it would on the
arm.

    tau_l = (J_bed + c_b) N qdd - (net - friction),  qdd from the balance of all torques (met/substitution/balance.py)

Nothing is differentiated to find the load. The arm gets the backward difference of the filtered rate. What the motor
does besides what its data sheet says is not known, so a motor that differs from it is followed badly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from met.substitution.law import BAND, Law, LawInput, LawOutput
from met.trace import Real


def balanced(inputs: LawInput) -> LawOutput:
    """The load torque by which the shaft takes its part in the balance, and the joint's part."""
    balance = inputs.balance
    assert balance is not None
    torque = (inputs.inertia + inputs.extra) * (inputs.motor.ratio * balance.qdd) - (balance.net - balance.friction)
    return LawOutput(torque, balance.qdd)


def give(
    p: Sequence[Any], held: Sequence[Any], inputs: Sequence[LawInput], load: Callable[[Sequence[Real]], Sequence[Real]]
) -> Sequence[tuple[LawOutput, Mapping[str, Real]]]:
    """The torque of each load motor that balances all torques, and the measured acceleration of each joint."""
    return [
        (LawOutput(balanced(joint).torque, (joint.rate - joint.before) / (joint.period * joint.motor.ratio)), {})
        for joint in inputs
    ]


LAW = Law(name="torque_balance", doc=__doc__, parameters=(BAND,), give=give)
